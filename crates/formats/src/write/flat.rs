//! All surfaces as triangles in the world, as the simplest formats have them.

use super::{AROUND, BYTES_OF_TRIANGLE, Output};
use crate::strip;
use snell_intersect::{AnyShape, Curves, Shape, TriangleMesh};
use snell_scene::placed::{Placed, placed, total};
use snell_scene::{Geometry, Node, Scene, Surface};
use std::borrow::Cow;

/// What 32-bit numbers can count of corners.
const MOST_TRIANGLES: u64 = u32::MAX as u64 / 3;

/// How many triangles a shape becomes at most.
fn most_triangles(shape: &AnyShape) -> u64 {
    shape.patches().iter().map(|patch| patch.most_triangles(AROUND)).sum()
}

/// What a scene becomes when everything is triangles: their number, instances counted each.
fn triangle_count(scene: &Scene) -> Result<u64, String> {
    let of_surface = |surface: &Surface| match &surface.geometry {
        Geometry::Mesh(mesh) => mesh.indices.len() as u64,
        Geometry::Shape(shape) => most_triangles(shape),
        Geometry::Curves(curves) => strip::most_triangles(curves) as u64,
    };
    let of_node = |node: &Node| node.surfaces.iter().map(of_surface).fold(0, u64::saturating_add);
    total(scene, of_node)
}

/// Refuses a scene of more triangles than a file or the memory of this process can hold.
fn check_expansion(scene: &Scene, output: &Output) -> Result<(), String> {
    let count = triangle_count(scene)?;
    let remedy = "write a format with instances: .snell, .pbrt or .glb";
    if count > MOST_TRIANGLES {
        return Err(format!(
            "it is {count} triangles, instances counted each, and the limit is {MOST_TRIANGLES}; \
                {remedy}"
        ));
    }
    let what = format!("the scene as {count} triangles, instances counted each,");
    let admitted = output.available.admit(&what, count.saturating_mul(BYTES_OF_TRIANGLE));
    admitted.map_err(|problem| format!("{problem}; {remedy}"))
}

/// Every surface and its mesh in the world. What is no mesh becomes one, and that is noted.
pub fn world_meshes<'a>(
    scene: &'a Scene,
    output: &mut Output,
) -> Result<Vec<(Placed<'a>, TriangleMesh)>, String> {
    check_expansion(scene, output)?;
    let mut meshes = Vec::new();
    for placed in placed(scene)? {
        let mesh = match &placed.surface.geometry {
            Geometry::Mesh(mesh) => Some(Cow::Borrowed(&**mesh)),
            Geometry::Shape(shape) => {
                note_shape(shape.name(), output);
                shape.tessellate(AROUND).map(Cow::Owned)
            }
            Geometry::Curves(curves) => tubes_of(curves, output).map(Cow::Owned),
        };
        let Some(mesh) = mesh else { continue };
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
        "box" | "rectangle" | "triangle" | "polygon" => {
            output.lose(format!("a {name} became triangles"))
        }
        _ => output.lose(format!("a {name} became triangles, and is round no more")),
    }
}
