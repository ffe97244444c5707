//! All surfaces as triangles in the world, as the simplest formats have them.

use super::Output;
use super::tessellate::tessellate;
use snell_intersect::TriangleMesh;
use snell_scene::placed::{Placed, placed};
use snell_scene::{Geometry, Scene};
use std::borrow::Cow;

/// Every surface and its mesh in the world. What is no mesh becomes one, and that is noted.
pub fn world_meshes<'a>(scene: &'a Scene, output: &mut Output) -> Result<Vec<(Placed<'a>, TriangleMesh)>, String> {
    let mut meshes = Vec::new();
    let mut triangles = 0;
    for placed in placed(scene)? {
        let mesh = match &placed.surface.geometry {
            Geometry::Mesh(mesh) => Some(Cow::Borrowed(&**mesh)),
            Geometry::Shape(shape) => {
                note_shape(shape.name(), output);
                tessellate(shape).map(Cow::Owned)
            }
        };
        let Some(mesh) = mesh else { continue };
        triangles += mesh.indices.len();
        if triangles > u32::MAX as usize / 3 {
            return Err("more triangles than 32-bit numbers can count, instances counted each: the limit".into());
        }
        let mesh = match placed.world_from_surface.is_identity() {
            true => mesh.into_owned(),
            false => mesh.transformed(&placed.world_from_surface),
        };
        meshes.push((placed, mesh));
    }
    Ok(meshes)
}

/// Says what became of an analytic shape.
pub fn note_shape(name: &str, output: &mut Output) {
    match name {
        "plane" => output.lose("an infinite plane is left out"),
        "box" | "rectangle" | "triangle" | "polygon" => output.lose(format!("a {name} became triangles")),
        _ => output.lose(format!("a {name} became triangles, and is round no more")),
    }
}
