//! `KHR_materials_variants`: a file may hold several sets of materials.

use crate::ReadError;
use crate::scene::gltf::Reader;
use crate::scene::gltf::json::Json;

/// Notes the available variants, and selects the requested one. By default, primitives have the
/// materials that they name outside of the extension.
pub(super) fn choose(reader: &mut Reader) -> Result<(), ReadError> {
    let extension = reader.root.extension("KHR_materials_variants")?;
    let variants = extension.as_ref().map_or(Ok(Vec::new()), |e| e.items_of("variants"))?;
    reader.scene.variants = variants.iter().map(Json::name).collect();
    let names = &reader.scene.variants;
    let Some(wanted) = &reader.input.options.variant else {
        if !names.is_empty() {
            let names = names.join(", ");
            reader.scene.note(format!(
                "KHR_materials_variants: shown with the default materials; the file has the \
                    variants {names}"
            ));
        }
        return Ok(());
    };
    let by_number = || wanted.parse().ok().filter(|&i| i < names.len());
    reader.variant = names.iter().position(|name| name == wanted).or_else(by_number);
    if reader.variant.is_some() {
        return Ok(());
    }
    let problem = format!("there is no variant \"{wanted}\"");
    let known = if names.is_empty() {
        "the file has none".into()
    } else {
        format!("choose one of {}", names.join(", "))
    };
    Err(reader.root.error_with(problem, known))
}

/// Index of a primitive's material in the table.
pub(in crate::scene::gltf) fn material(
    reader: &Reader,
    primitive: &Json,
) -> Result<Option<usize>, ReadError> {
    let usual = primitive.get("material")?.map(|m| m.size()).transpose()?;
    let Some(variant) = reader.variant else { return Ok(usual) };
    let Some(extension) = primitive.extension("KHR_materials_variants")? else { return Ok(usual) };
    for mapping in extension.items_of("mappings")? {
        for of_variant in mapping.items_of("variants")? {
            if of_variant.size()? == variant {
                let material = mapping.require("material")?;
                reader.root.entry("materials", &material)?;
                return material.size().map(Some);
            }
        }
    }
    Ok(usual)
}
