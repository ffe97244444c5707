//! Materials of an OBJ file.

use super::parse::ObjFile;
use crate::mesh::notes::Notes;
use crate::{Input, ReadError};
use snell_math::Rgb;
use snell_scene::material::Diffuse;
use snell_scene::{Material, MaterialId, Scene};

/// The materials that an OBJ file uses, by the number of their name.
pub fn materials(
    input: &Input,
    file: &ObjFile,
    scene: &mut Scene,
    notes: &mut Notes,
) -> Result<Vec<Option<MaterialId>>, ReadError> {
    let _ = (input, notes);
    Ok(file
        .materials
        .iter()
        .map(|(name, _)| Some(scene.add_material(Material::new(name, Diffuse::new(Rgb::splat(0.8))))))
        .collect())
}
