//! Quadrilaterals: pairs of triangles that are one primitive.

use crate::hit::{DHit, Hit};
use crate::mesh::{MeshError, TriangleMesh};
use snell_math::{DVec2, Vec2};
use std::sync::Arc;

/// A mesh of quadrilaterals. Each consists of the two triangles (0, 1, 3) and (2, 3, 1) of its
/// corners, which share the diagonal from 1 to 3 and are hit by the same watertight test as all
/// triangles, so that meshes of quads and triangles can be watertight. A quad whose last two
/// corners are the same is a triangle.
///
/// [`Hit::primitive`] is the number of the quad. [`Hit::uv`] is the position in the quad: (0, 0),
/// (1, 0), (1, 1) and (0, 1) at its corners, and linear in each of the triangles (for a
/// parallelogram in all of it). `u + v` exceeds 1 on the second triangle only. Vertex attributes
/// are interpolated in the triangles too.
#[derive(Clone, Debug, PartialEq)]
pub struct QuadMesh {
    triangles: Arc<TriangleMesh>,
}

impl QuadMesh {
    /// Makes quads from the vertices and attributes of `mesh`; its triangles are replaced. There
    /// must be one material slot per quad, or none. The rest must satisfy
    /// [`TriangleMesh::validate`].
    pub fn new(mesh: TriangleMesh, quads: &[[u32; 4]]) -> Result<Self, MeshError> {
        let slots = mesh.material_slots;
        if !slots.is_empty() && slots.len() != quads.len() {
            let (found, expected) = (slots.len(), quads.len());
            return Err(MeshError::AttributeLength {
                attribute: "material_slots",
                found,
                expected,
                per: "quad",
            });
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

    /// True if the mesh has no quads.
    pub fn is_empty(&self) -> bool {
        self.triangles.indices.is_empty()
    }

    /// The mesh of all triangles. Quad `i` consists of the triangles `2 i` and `2 i + 1`.
    pub fn triangles(&self) -> &Arc<TriangleMesh> {
        &self.triangles
    }

    /// Vertex numbers of a quad.
    pub fn quad(&self, quad: usize) -> [u32; 4] {
        let ([a, b, d], [c, ..]) =
            (self.triangles.indices[2 * quad], self.triangles.indices[2 * quad + 1]);
        [a, b, c, d]
    }

    /// Converts a hit on a quad to a hit on one of its triangles.
    pub(crate) fn triangle_hit(&self, hit: &Hit) -> Hit {
        let quad = hit.primitive as usize;
        // A `uv` that was not reported by a query may lie on a degenerate triangle.
        let second = (is_beyond_f32(hit.uv.x, hit.uv.y)
            && !self.triangles.is_degenerate(2 * quad + 1))
            || self.triangles.is_degenerate(2 * quad);
        let uv = if second { Vec2::ONE - hit.uv } else { hit.uv };
        Hit { primitive: 2 * hit.primitive + u32::from(second), uv, ..*hit }
    }
}

/// Converts a hit on one of the triangles to a hit on the quad.
#[inline(always)]
pub(crate) fn quad_hit(hit: &Hit) -> Hit {
    let uv = Vec2::from(place_f32(hit.uv.into(), hit.primitive & 1 == 1));
    Hit { primitive: hit.primitive >> 1, uv, ..*hit }
}

/// Converts a hit on one of the triangles to a hit on the quad, in double precision.
#[inline(always)]
pub(crate) fn quad_hit_double(hit: &DHit) -> DHit {
    let uv = DVec2::from(place_f64(hit.uv.into(), hit.primitive & 1 == 1));
    DHit { primitive: hit.primitive >> 1, uv, ..*hit }
}

/// Positions on quads: those with `u + v` up to 1 belong to the first triangle, the others to the
/// second, decided exactly. So where a quad is folded over and a ray hits both triangles on their
/// common edge, these are two different hits. A position that rounding or this rule puts on the
/// wrong side of the diagonal is moved across it, by one or two units in the last place.
macro_rules! places {
    ($place:ident, $is_beyond:ident, $float:ty) => {
        /// True if `u + v` is more than 1, without rounding.
        #[inline(always)]
        fn $is_beyond(u: $float, v: $float) -> bool {
            // For `large` from a half on, `1.0 - large` is exact.
            let (small, large) = (u.min(v), u.max(v));
            large >= 0.5 && small > 1.0 - large
        }

        /// Converts barycentrics of the first or second triangle to the position on the quad.
        #[inline(always)]
        fn $place([b1, b2]: [$float; 2], second: bool) -> [$float; 2] {
            let [u, v] = if second { [1.0 - b1, 1.0 - b2] } else { [b1, b2] };
            if $is_beyond(u, v) == second {
                return [u, v];
            }
            let (mut small, mut large) = (u.min(v), u.max(v));
            large = if second { large.max(1.0 - small) } else { large.min(1.0 - small) };
            for _ in 0..2 {
                if $is_beyond(small, large) == second {
                    break;
                }
                match (second, large < 1.0) {
                    (true, true) => large = large.next_up(),
                    (true, false) => small = small.next_up(),
                    (false, _) => large = large.next_down(),
                }
            }
            if u < v { [small, large] } else { [large, small] }
        }
    };
}

places!(place_f32, is_beyond_f32, f32);
places!(place_f64, is_beyond_f64, f64);

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
            QuadMesh::new(TriangleMesh { positions, ..TriangleMesh::default() }, &[[0, 1, 2, 3]])
                .expect("valid");
        for (triangle, b1, b2) in [(0, 0.25, 0.5), (1, 0.25, 0.5), (1, 0.0, 0.0), (0, 1.0, 0.0)] {
            let hit = Hit {
                primitive: triangle,
                uv: Vec2::new(b1, b2),
                t: 1.0,
                instance: 0,
                geometry: 0,
            };
            let [a, b, c] = quads.triangles().corners(triangle as usize);
            let on_quad = quad_hit(&hit);
            assert_eq!(on_quad.primitive, 0);
            assert_eq!(on_quad.uv, (a * (1.0 - b1 - b2) + b * b1 + c * b2).truncate());
            assert_eq!(quads.triangle_hit(&on_quad), hit);
        }
    }

    #[test]
    fn places_tell_the_triangle_and_are_moved_by_a_rounding_at_most() {
        for i in 0..2000u32 {
            let [a, b, ..] =
                snell_math::rng::pcg4d([i, 4, 5, 6]).map(|x| x as f32 / u32::MAX as f32);
            // In the triangle, and as close to the common edge as rounding permits.
            let b1 = if i % 3 == 0 { a * a * a * a * 1e-9 } else { a };
            for b2 in [(1.0 - b1) * b, 1.0 - b1, (1.0 - b1).next_up(), (1.0 - b1).next_down(), 0.0]
            {
                for (u, v) in [(b1, b2), (b2, b1)] {
                    let (first, second) = (place_f32([u, v], false), place_f32([u, v], true));
                    assert!(
                        !is_beyond_f32(first[0], first[1]) && is_beyond_f32(second[0], second[1]),
                        "{u} {v}"
                    );
                    for (place, exact) in [(first, [u, v]), (second, [1.0 - u, 1.0 - v])] {
                        assert!(
                            (0..2).all(|k| (place[k] - exact[k]).abs() <= 1.8e-7),
                            "{u} {v} {place:?}"
                        );
                        assert!(
                            place.iter().all(|x| (0.0..=1.0).contains(x)) || b2 > 1.0,
                            "{u} {v} {place:?}"
                        );
                    }
                }
            }
        }
        assert_eq!(
            [place_f64([0.25, 0.75], false), place_f64([0.25, 0.75], true)],
            [[0.25, 0.75], [0.75f64.next_up(), 0.25]]
        );
        let corner = place_f64([0.0, 1.0], true);
        assert!(corner[0] == 1.0 && corner[1] > 0.0 && corner[1] < 1e-300);
    }

    #[test]
    fn a_ray_that_meets_the_edge_of_a_fold_meets_it_twice_or_not_at_all() {
        let corner = |z: f32| Vec3::new(1.0, 0.0, z);
        let positions = vec![corner(-0.5), Vec3::ZERO, corner(0.5), Vec3::Y];
        let mesh = TriangleMesh { positions, ..TriangleMesh::default() };
        let quads = QuadMesh::new(mesh, &[[0, 1, 2, 3]]).expect("valid");
        let mut builder = crate::WorldBuilder::default();
        builder.add_quads(crate::WorldBuilder::ROOT, Arc::new(quads));
        let world = builder.build(&crate::BuildOptions::default()).expect("it builds");
        let hits = |direction: Vec3, y: f32| {
            let ray = snell_math::Ray::new(Vec3::new(0.0, y, 0.0) - direction, direction);
            let (all, mut counts) = (world.all_one(&ray, &crate::AcceptAll), [u32::MAX]);
            world.count(std::slice::from_ref(&ray), &crate::AcceptAll, &mut counts);
            assert_eq!(counts[0] as usize, all.len(), "{direction} {all:?}");
            all.len()
        };
        let mut met = 0;
        for y in [0.25, 0.375, 0.5] {
            // Both triangles are on one side of the edge.
            let aside =
                [Vec3::Z, -Vec3::Z, Vec3::new(0.25, 0.0, 1.0), Vec3::new(-0.25, 0.125, -1.0)];
            let counts = aside.map(|direction| hits(direction, y));
            assert!(counts.iter().all(|&count| count == 0 || count == 2), "{counts:?}");
            met += counts.iter().sum::<usize>();
            // Here one triangle is on each side of the edge.
            assert_eq!(
                [Vec3::X, -Vec3::X, Vec3::new(1.0, 0.25, 0.125)]
                    .map(|direction| hits(direction, y)),
                [1; 3]
            );
        }
        assert!(met > 0, "a fold is met from somewhere");
    }
}
