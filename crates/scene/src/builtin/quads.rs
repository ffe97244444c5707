//! Meshes of flat quadrilaterals.

use crate::graph::MaterialId;
use crate::graph::{Geometry, Surface};
use snell_intersect::{TriangleMesh, first_uv_set};
use snell_math::{Vec2, Vec3};
use std::sync::Arc;

/// A surface of quadrilaterals. Each is given by its corners, counter-clockwise as seen from
/// outside.
pub fn quads(corners: &[[[f32; 3]; 4]], material: MaterialId) -> Surface {
    let first = |i: usize| 4 * i as u32;
    let mesh = TriangleMesh {
        positions: corners.iter().flatten().map(|&p| Vec3::from(p)).collect(),
        indices: (0..corners.len())
            .flat_map(|i| {
                [[first(i), first(i) + 1, first(i) + 2], [first(i), first(i) + 2, first(i) + 3]]
            })
            .collect(),
        uvs: first_uv_set(
            corners.iter().flat_map(|_| [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]).collect(),
        ),
        ..TriangleMesh::default()
    };
    Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material)
}

/// A square ground at this height, with sides of twice `half`, that faces up.
pub fn ground(height: f32, half: f32, material: MaterialId) -> Surface {
    let p = |x: f32, z: f32| [x * half, height, z * half];
    quads(&[[p(-1.0, 1.0), p(1.0, 1.0), p(1.0, -1.0), p(-1.0, -1.0)]], material)
}
