//! All surfaces as triangles in the world, as the simplest formats have them.

use super::Output;
use super::tessellate::tessellate;
use crate::strip;
use snell_intersect::{Curves, TriangleMesh};
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
            Geometry::Curves(curves) => tubes_of(curves, output).map(Cow::Owned),
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

/// The triangles of strands, for formats that have none; says so.
pub fn tubes_of(curves: &Curves, output: &mut Output) -> Option<TriangleMesh> {
    if strip::most_triangles(curves) > u32::MAX as usize / 3 {
        output.lose("strands of more segments than can become triangles are left out");
        return None;
    }
    output.lose("strands became tubes of triangles with five sides");
    Some(strip::tubes(curves))
}

/// Says what became of an analytic shape.
pub fn note_shape(name: &str, output: &mut Output) {
    match name {
        "plane" => output.lose("an infinite plane is left out"),
        "box" | "rectangle" | "triangle" | "polygon" => output.lose(format!("a {name} became triangles")),
        _ => output.lose(format!("a {name} became triangles, and is round no more")),
    }
}
