//! `KHR_materials_variants`: a file may hold several sets of materials.

use crate::ReadError;
use crate::scene::gltf::Reader;

/// Says which variants there are: the scene is shown with the materials that primitives name outside of the extension.
pub(super) fn check(reader: &mut Reader) -> Result<(), ReadError> {
    let Some(extension) = reader.root.extension("KHR_materials_variants")? else { return Ok(()) };
    let mut names = Vec::new();
    for variant in extension.items_of("variants")? {
        names.push(variant.name());
    }
    if !names.is_empty() {
        reader.scene.note(format!(
            "KHR_materials_variants: shown with the default materials; the file has the variants {}",
            names.join(", ")
        ));
    }
    Ok(())
}
