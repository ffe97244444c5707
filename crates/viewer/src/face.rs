//! The face at a hit: its corners, and which of its edges are edges of the body. The page snaps to
//! them when it measures.

use snell_intersect::{Geometry, GeometryId, Hit, TriangleMesh, World};
use snell_math::{DVec3, Vec3};

/// Two faces that meet at more than this angle make a sharp edge: its cosine, of 20 degrees.
const SHARP: f32 = 0.94;

/// A triangle or quadrilateral.
pub struct Face {
    /// The corners in the world, in order.
    pub corners: Vec<DVec3>,
    /// For each corner, whether the edge from it to the next corner is a border of the mesh or a
    /// sharp edge. Others only divide a smooth surface into faces.
    pub sharp: Vec<bool>,
}

/// The face at a hit; `None` for shapes and curves, which have no corners.
pub fn face(world: &World, hit: &Hit) -> Option<Face> {
    let primitive = hit.primitive as usize;
    let (mesh, corners, own) = match world.geometry(GeometryId(hit.geometry)) {
        Geometry::Mesh(mesh) => {
            (mesh, mesh.indices.get(primitive)?.to_vec(), primitive..=primitive)
        }
        Geometry::Quads(quads) if primitive < quads.len() => {
            let mut corners = quads.quad(primitive).to_vec();
            // A quad whose last two corners are the same is a triangle.
            corners.dedup();
            (quads.triangles(), corners, 2 * primitive..=2 * primitive + 1)
        }
        _ => return None,
    };
    let corners: Vec<Vec3> = corners.iter().map(|&i| mesh.positions[i as usize]).collect();
    let world_from_mesh = world.world_from_instance(hit.instance);
    Some(Face {
        sharp: sharp(mesh, &corners, own),
        corners: corners.iter().map(|p| world_from_mesh.point(p.as_dvec3())).collect(),
    })
}

/// Which edges of a face are sharp. Vertices count as the same if their positions are: files repeat
/// vertices where normals or texture coordinates differ.
fn sharp(mesh: &TriangleMesh, corners: &[Vec3], own: std::ops::RangeInclusive<usize>) -> Vec<bool> {
    let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).normalize_or_zero();
    let here = normal([corners[0], corners[1], corners[2]]);
    let mut sharp = vec![true; corners.len()];
    for (i, triangle) in mesh.indices.iter().enumerate() {
        let positions = triangle.map(|v| mesh.positions[v as usize]);
        let shared = corners.iter().filter(|corner| positions.contains(corner)).count();
        if shared < 2 || own.contains(&i) {
            continue;
        }
        let is_smooth = normal(positions).dot(here).abs() > SHARP;
        for edge in 0..corners.len() {
            let ends = [corners[edge], corners[(edge + 1) % corners.len()]];
            if is_smooth && ends.iter().all(|end| positions.contains(end)) {
                sharp[edge] = false;
            }
        }
    }
    sharp
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonals_of_a_box_are_no_edges_and_its_edges_are() {
        // Two triangles of a square, and a third that stands on one side of it.
        let mesh = TriangleMesh {
            positions: [
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [1.0, 1.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
            ]
            .map(Vec3::from)
            .to_vec(),
            indices: vec![[0, 1, 2], [0, 2, 3], [0, 1, 4]],
            ..TriangleMesh::default()
        };
        let corners = [0, 1, 2].map(|i| mesh.positions[i]);
        // The side with the standing triangle, the border, and the diagonal.
        assert_eq!(sharp(&mesh, &corners, 0..=0), [true, true, false]);
    }
}
