//! All surfaces as triangles in the world, for the simplest formats.

use super::{AROUND, BYTES_OF_TRIANGLE, Expansion, Output};
use crate::strip;
use snell_intersect::{AnyShape, Curves, Shape, TriangleMesh};
use snell_math::{Bounds3d, DAffine3, DVec3, Transform};
use snell_scene::placed::{Placed, placed, total};
use snell_scene::{Geometry, Node, Scene, Surface, framing};
use std::borrow::Cow;

/// Maximum number of triangles whose corners 32-bit numbers can count.
const MOST_TRIANGLES: u64 = u32::MAX as u64 / 3;

/// The maximum number of triangles that a shape becomes.
fn most_triangles(shape: &AnyShape) -> u64 {
    shape.patches().iter().map(|patch| patch.most_triangles(AROUND)).sum()
}

/// The number of triangles after tessellating everything; each instance counts.
fn triangle_count(scene: &Scene) -> Result<u64, String> {
    let of_surface = |surface: &Surface| match &surface.geometry {
        Geometry::Mesh(mesh) => mesh.indices.len() as u64,
        Geometry::Shape(shape) => most_triangles(shape),
        Geometry::Curves(curves) => strip::most_triangles(curves) as u64,
    };
    let of_node = |node: &Node| node.surfaces.iter().map(of_surface).fold(0, u64::saturating_add);
    total(scene, of_node)
}

/// Refuses a scene with more triangles than a file or the memory of this process can hold.
fn check_expansion(scene: &Scene, output: &Output) -> Result<(), String> {
    let expansion = Expansion {
        count: triangle_count(scene)?,
        limit: MOST_TRIANGLES,
        what: "triangles",
        bytes_of_each: BYTES_OF_TRIANGLE,
        remedy: "write a format with instances: .snell, .pbrt or .glb",
    };
    expansion.check(output)
}

/// The precision of the numbers of a format.
#[derive(Clone, Copy, PartialEq)]
pub enum Digits {
    /// Any number of digits: meshes that need them get positions in double precision.
    Any,
    /// Those of single precision.
    Single,
}

/// The world-space mesh of every surface. Other geometry is tessellated, which is noted.
pub fn world_meshes<'a>(
    scene: &'a Scene,
    output: &mut Output,
    digits: Digits,
) -> Result<Vec<(Placed<'a>, TriangleMesh)>, String> {
    check_expansion(scene, output)?;
    let mut meshes = Vec::new();
    let all = placed(scene)?;
    let by = moved_by(scene, &all, output, digits);
    for placed in all {
        let mesh = match &placed.surface.geometry {
            Geometry::Mesh(mesh) => Some(Cow::Borrowed(&**mesh)),
            Geometry::Shape(shape) => {
                note_shape(shape.name(), output);
                shape.tessellate(AROUND).map(Cow::Owned)
            }
            Geometry::Curves(curves) => tubes_of(curves, output).map(Cow::Owned),
        };
        let Some(mesh) = mesh else { continue };
        let written_from_surface = by(&placed.world_from_surface);
        let mut mesh = mesh.into_owned();
        if !written_from_surface.is_identity() {
            if digits == Digits::Any && mesh.exact.is_empty() {
                mesh.exact = mesh.exact_positions().into_owned();
            }
            mesh = mesh.transformed(&written_from_surface);
        }
        if digits == Digits::Single || !needs_doubles(&mesh) {
            mesh.exact = Vec::new();
        }
        meshes.push((placed, mesh));
    }
    Ok(meshes)
}

/// How many times its size a mesh may be away from zero before it is written with more digits than
/// single precision has.
const AWAY: f64 = 2.0;

/// True if single precision holds fewer digits of the mesh where it is than it does near zero.
fn needs_doubles(mesh: &TriangleMesh) -> bool {
    let bounds = Bounds3d::of(mesh.exact.iter().copied().filter(|p| p.is_finite()));
    let away = bounds.min.abs().max(bounds.max.abs()).max_element();
    !bounds.is_empty() && away > AWAY * (bounds.max - bounds.min).max_element()
}

/// Where surfaces are written: moved near zero, with a note, if transforms place them so far away
/// that the format does not hold their shape; otherwise where they are.
fn moved_by(
    scene: &Scene,
    placed: &[Placed],
    output: &mut Output,
    digits: Digits,
) -> impl Fn(&Transform) -> Transform + use<> {
    let is_placed =
        digits == Digits::Single && placed.iter().any(|p| !p.world_from_surface.is_identity());
    let bounds = scene.bounds().ok().filter(|_| is_placed);
    let origin = bounds.and_then(|bounds| framing::far_origin(&bounds));
    if let Some(DVec3 { x, y, z }) = origin.map(|origin| -origin) {
        output.lose(format!(
            "the coordinates are too far from zero to hold the shape: all are moved by {x} {y} {z}"
        ));
    }
    let by = origin.map(|origin| DAffine3::from_translation(-origin));
    move |transform| match by {
        Some(by) => Transform::new(by * *transform.matrix()).unwrap_or(*transform),
        None => *transform,
    }
}

/// Tessellates strands for formats without curves, and notes it.
pub fn tubes_of(curves: &Curves, output: &mut Output) -> Option<TriangleMesh> {
    if strip::most_triangles(curves) > u32::MAX as usize / 3 {
        output.lose("strands of more segments than can become triangles are left out");
        return None;
    }
    let balls = curves.ball_count();
    if balls > 0 {
        output.lose("balls became octahedra");
    }
    if balls < curves.strands().len() {
        output.lose("strands became tubes of triangles with five sides");
    }
    Some(strip::tubes(curves))
}

/// Records that an analytic shape was converted to triangles.
pub fn note_shape(name: &str, output: &mut Output) {
    match name {
        "plane" => output.lose("an infinite plane is left out"),
        "box" | "rectangle" | "triangle" | "polygon" => {
            output.lose(format!("a {name} became triangles"))
        }
        _ => output.lose(format!("a {name} became triangles, and is no longer exactly round")),
    }
}
