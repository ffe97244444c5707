//! Quadrilaterals: pairs of triangles that answer as one primitive.

use crate::hit::Hit;
use crate::mesh::{MeshError, TriangleMesh};
use snell_math::Vec2;
use std::sync::Arc;

/// A mesh of quadrilaterals. Each is the two triangles (0, 1, 3) and (2, 3, 1) of its corners, which share the diagonal from 1 to 3 and
/// are hit by the same watertight test as all triangles; so quads and triangles close meshes together. A quad whose last two corners
/// are the same is a triangle.
///
/// [`Hit::primitive`] is the quad and [`Hit::uv`] the place in it: (0, 0), (1, 0), (1, 1), (0, 1) at its corners, linear in each of the
/// triangles (for a parallelogram in all of it). Vertex attributes are interpolated in the triangles too.
#[derive(Clone, Debug, PartialEq)]
pub struct QuadMesh {
    triangles: Arc<TriangleMesh>,
}

impl QuadMesh {
    /// Quads between the vertices of `mesh`, whose triangles are replaced; material slots are one per quad, or none. All else must be
    /// as [`TriangleMesh::validate`] wants it.
    pub fn new(mesh: TriangleMesh, quads: &[[u32; 4]]) -> Result<Self, MeshError> {
        let slots = mesh.material_slots;
        if !slots.is_empty() && slots.len() != quads.len() {
            let (found, expected) = (slots.len(), quads.len());
            return Err(MeshError::AttributeLength { attribute: "material_slots", found, expected, per: "quad" });
        }
        let indices = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, d], [c, d, b]]).collect();
        let material_slots = slots.into_iter().flat_map(|slot| [slot; 2]).collect();
        let triangles = TriangleMesh { indices, material_slots, ..mesh };
        triangles.validate()?;
        Ok(Self { triangles: Arc::new(triangles) })
    }

    /// Number of quads.
    pub fn len(&self) -> usize {
        self.triangles.indices.len() / 2
    }

    /// True without quads.
    pub fn is_empty(&self) -> bool {
        self.triangles.indices.is_empty()
    }

    /// The triangles: those of quad `i` are `2 i` and `2 i + 1`.
    pub fn triangles(&self) -> &Arc<TriangleMesh> {
        &self.triangles
    }

    /// Vertex numbers of a quad.
    pub fn quad(&self, quad: usize) -> [u32; 4] {
        let ([a, b, d], [c, ..]) = (self.triangles.indices[2 * quad], self.triangles.indices[2 * quad + 1]);
        [a, b, c, d]
    }

    /// The hit on one of the triangles that stands for a hit on a quad.
    pub(crate) fn triangle_hit(&self, hit: &Hit) -> Hit {
        let quad = hit.primitive as usize;
        // On the diagonal either will do, unless it is a triangle in name only.
        let second = (hit.uv.x + hit.uv.y > 1.0 && !self.triangles.is_degenerate(2 * quad + 1))
            || self.triangles.is_degenerate(2 * quad);
        let uv = if second { Vec2::ONE - hit.uv } else { hit.uv };
        Hit { primitive: 2 * hit.primitive + u32::from(second), uv, ..*hit }
    }
}

/// The hit on a quad that a hit on one of its triangles is.
#[inline(always)]
pub(crate) fn quad_hit(hit: &Hit) -> Hit {
    let uv = if hit.primitive & 1 == 1 { Vec2::ONE - hit.uv } else { hit.uv };
    Hit { primitive: hit.primitive >> 1, uv, ..*hit }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec3;

    #[test]
    fn a_quad_is_two_triangles_of_the_same_side() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        let mesh = TriangleMesh { positions, material_slots: vec![7], ..TriangleMesh::default() };
        let quads = QuadMesh::new(mesh.clone(), &[[0, 1, 2, 3]]).expect("valid");
        assert_eq!((quads.len(), quads.quad(0)), (1, [0, 1, 2, 3]));
        for triangle in 0..2 {
            let [a, b, c] = quads.triangles().corners(triangle);
            assert_eq!((b - a).cross(c - a), Vec3::Z);
        }
        assert_eq!(quads.triangles().material_slots, [7, 7]);
        assert!(QuadMesh::new(mesh.clone(), &[[0, 1, 2, 4]]).is_err());
        assert!(QuadMesh::new(mesh, &[]).is_err(), "a slot too many");
    }

    #[test]
    fn hits_on_triangles_are_places_in_the_quad_and_back() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        let quads =
            QuadMesh::new(TriangleMesh { positions, ..TriangleMesh::default() }, &[[0, 1, 2, 3]]).expect("valid");
        for (triangle, b1, b2) in [(0, 0.25, 0.5), (1, 0.25, 0.5), (1, 0.0, 0.0), (0, 1.0, 0.0)] {
            let hit = Hit { primitive: triangle, uv: Vec2::new(b1, b2), t: 1.0, instance: 0, geometry: 0 };
            let [a, b, c] = quads.triangles().corners(triangle as usize);
            let on_quad = quad_hit(&hit);
            assert_eq!(on_quad.primitive, 0);
            assert_eq!(on_quad.uv, (a * (1.0 - b1 - b2) + b * b1 + c * b2).truncate());
            assert_eq!(quads.triangle_hit(&on_quad), hit);
        }
    }
}
