//! Batches of hits on triangles: the result of [`World::interaction`] for each, with the same bits,
//! without the parts that only some materials need.

use super::interaction::{MAP_ERROR, derivatives, spanning};
use super::{Geometry, GeometryId, World};
use crate::hit::Hit;
use crate::mesh::TriangleMesh;
use snell_math::simd::{Wide, mask_select, max as greater};
use snell_math::{Vec2, Vec3, at_level};

/// The number of hits that a [`TriangleHits`] holds.
pub const TRIANGLE_HITS: usize = 64;

/// A number for each hit.
pub type HitLanes = [f32; TRIANGLE_HITS];
/// A vector for each hit, stored axis by axis.
pub type HitVectors = [HitLanes; 3];

/// The triangles of a static mesh without vertex colours, in the coordinates of its group.
#[derive(Clone, Copy, Debug)]
pub struct PlainMesh<'w> {
    positions: &'w [Vec3],
    /// Normal of each vertex; empty if the mesh has none.
    normals: &'w [Vec3],
    /// First texture coordinates of each vertex; empty if the mesh has none.
    uvs: &'w [Vec2],
    indices: &'w [[u32; 3]],
}

/// Hits on triangles, gathered by [`Self::gather`] and evaluated together by [`Self::points`].
#[derive(Clone, Debug)]
pub struct TriangleHits {
    /// Vertex numbers of the corners.
    indices: [[u32; 3]; TRIANGLE_HITS],
    pub(super) corners: [HitVectors; 3],
    /// Vertex normals; zero where there are none.
    pub(super) normals: [HitVectors; 3],
    has_normals: [bool; TRIANGLE_HITS],
    /// Barycentric coordinates of the second and third corner.
    pub(super) weights: [HitLanes; 2],
    /// First texture coordinates of the corners, for hits that were [gathered](Self::gather_uvs)
    /// with them; zero for meshes without texture coordinates.
    uvs: [[HitLanes; 2]; 3],
}

/// Points of triangles; each field has one value per lane. [`crate::SurfaceInteraction`] explains
/// the values.
#[derive(Clone, Debug)]
pub struct TrianglePoints {
    /// Points on the surfaces.
    pub position: HitVectors,
    /// Bounds on the absolute errors of the coordinates of `position`.
    pub position_error: HitVectors,
    /// Unit normals of the triangles.
    pub geometric_normal: HitVectors,
    /// Unit shading normals.
    pub shading_normal: HitVectors,
    /// 1 where the values of a lane are valid; 0 for degenerate triangles and after overflow, where
    /// [`World::interaction`] must be used instead.
    pub is_sound: [u32; TRIANGLE_HITS],
}

const ZERO: HitVectors = [[0.0; TRIANGLE_HITS]; 3];

impl Default for TriangleHits {
    fn default() -> Self {
        Self {
            indices: [[0; 3]; TRIANGLE_HITS],
            corners: [ZERO; 3],
            normals: [ZERO; 3],
            has_normals: [false; TRIANGLE_HITS],
            weights: [[0.0; TRIANGLE_HITS]; 2],
            uvs: [[[0.0; TRIANGLE_HITS]; 2]; 3],
        }
    }
}

impl Default for TrianglePoints {
    fn default() -> Self {
        let is_sound = [0; TRIANGLE_HITS];
        Self {
            position: ZERO,
            position_error: ZERO,
            geometric_normal: ZERO,
            shading_normal: ZERO,
            is_sound,
        }
    }
}

impl World {
    /// The triangles of a geometry if [`TriangleHits`] can hold them, that is for a static mesh
    /// without vertex colours; otherwise `None`. Hits on it must be in the root group (`instance`
    /// 0).
    pub fn plain_mesh(&self, geometry: GeometryId) -> Option<PlainMesh<'_>> {
        match self.geometry(geometry) {
            Geometry::Mesh(mesh) if mesh.colors.is_empty() => {
                let TriangleMesh { positions, normals, uvs: [uvs, ..], indices, .. } = &**mesh;
                Some(PlainMesh { positions, normals, uvs, indices })
            }
            _ => None,
        }
    }
}

impl TriangleHits {
    /// Puts hits into lanes, given the lane, mesh and hit of each.
    #[inline]
    pub fn gather<'w>(
        &mut self,
        hits: impl Iterator<Item = (usize, &'w PlainMesh<'w>, &'w Hit)> + Clone,
    ) {
        // Done in two steps, so that the cache misses of many hits overlap.
        for (lane, mesh, hit) in hits.clone() {
            self.indices[lane] = mesh.indices[hit.primitive as usize];
            (self.weights[0][lane], self.weights[1][lane]) = (hit.uv.x, hit.uv.y);
        }
        for (lane, mesh, _) in hits {
            let indices = self.indices[lane];
            put(&mut self.corners, lane, mesh.positions, indices);
            let has_normals = !mesh.normals.is_empty();
            if has_normals {
                put(&mut self.normals, lane, mesh.normals, indices);
            } else if self.has_normals[lane] {
                put(&mut self.normals, lane, &[Vec3::ZERO], [0; 3]);
            }
            self.has_normals[lane] = has_normals;
        }
    }

    /// Adds the texture coordinates of hits that were gathered before; [`Self::tangents`] needs
    /// them. Each item is a lane and the mesh of its hit.
    #[inline]
    pub fn gather_uvs<'w>(&mut self, hits: impl Iterator<Item = (usize, &'w PlainMesh<'w>)>) {
        for (lane, mesh) in hits {
            let indices = self.indices[lane];
            for (to, index) in self.uvs.iter_mut().zip(indices) {
                let uv = mesh.uvs.get(index as usize).copied().unwrap_or(Vec2::ZERO);
                (to[0][lane], to[1][lane]) = (uv.x, uv.y);
            }
        }
    }

    /// The tangents at the points of all lanes, equal to [`crate::SurfaceInteraction::dpdu`].
    pub fn tangents(&self, points: &TrianglePoints, to: &mut HitVectors, wide: Option<Wide>) {
        at_level!(
            wide,
            tangents,
            (hits: &TriangleHits = self, points: &TrianglePoints = points, to: &mut HitVectors = to)
        );
    }

    /// True if a hit on a mesh with vertex normals was ever gathered.
    pub fn has_normals(&self) -> bool {
        self.has_normals.contains(&true)
    }

    /// Computes the points of all lanes, including those that hold no hit.
    pub fn points(&self, to: &mut TrianglePoints, wide: Option<Wide>) {
        match self.has_normals() {
            true => {
                at_level!(
                    wide,
                    points::<true>,
                    (hits: &TriangleHits = self, to: &mut TrianglePoints = to)
                )
            }
            false => {
                at_level!(
                    wide,
                    points::<false>,
                    (hits: &TriangleHits = self, to: &mut TrianglePoints = to)
                )
            }
        }
    }
}

/// Stores the vectors of a triangle's three corners in a lane.
#[inline(always)]
fn put(to: &mut [HitVectors; 3], lane: usize, from: &[Vec3], indices: [u32; 3]) {
    for (to, index) in to.iter_mut().zip(indices) {
        let vector = from[index as usize];
        for (axis, to) in to.iter_mut().enumerate() {
            to[lane] = vector[axis];
        }
    }
}

type Vector = [f64; 3];

#[inline(always)]
fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}

#[inline(always)]
fn inverse_length(v: Vector) -> f64 {
    1.0 / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

/// Computes the points of all lanes. `SMOOTH` must be true if any lane has vertex normals.
#[inline(always)]
fn points<const SMOOTH: bool>(hits: &TriangleHits, to: &mut TrianglePoints) {
    for i in 0..TRIANGLE_HITS {
        let wide = |v: &HitVectors| [f64::from(v[0][i]), f64::from(v[1][i]), f64::from(v[2][i])];
        let [p0, p1, p2] = [wide(&hits.corners[0]), wide(&hits.corners[1]), wide(&hits.corners[2])];
        let (b1, b2) = (f64::from(hits.weights[0][i]), f64::from(hits.weights[1][i]));
        let b0 = 1.0 - b1 - b2;
        let largest = |p: Vector| greater(greater(p[0].abs(), p[1].abs()), p[2].abs());
        let error = greater(greater(largest(p0), largest(p1)), largest(p2)) * 4.0 * MAP_ERROR;
        let normal = cross(minus(p1, p0), minus(p2, p0));
        let scale = inverse_length(normal);
        let mut is_sound =
            (scale > 0.0) & (scale < f64::INFINITY) & (error < f64::from(f32::MAX) * 1e-10);
        let mut flat = [0.0f32; 3];
        for axis in 0..3 {
            let position = p0[axis] * b0 + p1[axis] * b1 + p2[axis] * b2;
            let single = position as f32;
            let off = ((position - f64::from(single)).abs() + error) as f32;
            to.position[axis][i] = single;
            // The next larger `f32` of a number that is not negative.
            to.position_error[axis][i] = f32::from_bits(off.to_bits() + 1);
            flat[axis] = (normal[axis] * scale) as f32;
            to.geometric_normal[axis][i] = flat[axis];
            if !SMOOTH {
                to.shading_normal[axis][i] = flat[axis];
            }
            is_sound &= off < f32::MAX;
        }
        to.is_sound[i] = u32::from(is_sound);
        if SMOOTH {
            let [n0, n1, n2] =
                [wide(&hits.normals[0]), wide(&hits.normals[1]), wide(&hits.normals[2])];
            // A closure rather than `map`, which is a call and would prevent vectorisation.
            let blend = |axis: usize| n0[axis] * b0 + n1[axis] * b1 + n2[axis] * b2;
            let blended = [blend(0), blend(1), blend(2)];
            let scale = inverse_length(blended);
            let has_own = u32::from((scale > 0.0) & (scale < f64::INFINITY));
            let smooth = [
                (blended[0] * scale) as f32,
                (blended[1] * scale) as f32,
                (blended[2] * scale) as f32,
            ];
            let is_behind = smooth[0] * flat[0] + smooth[1] * flat[1] + smooth[2] * flat[2] < 0.0;
            let side = if is_behind { -1.0 } else { 1.0 };
            for axis in 0..3 {
                to.shading_normal[axis][i] = mask_select(has_own, side * smooth[axis], flat[axis]);
            }
        }
    }
}

/// Computes the tangents of all lanes; see [`TriangleHits::tangents`].
#[inline(always)]
fn tangents(hits: &TriangleHits, points: &TrianglePoints, to: &mut HitVectors) {
    for i in 0..TRIANGLE_HITS {
        let corner = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]).as_dvec3();
        let uv = |v: &[HitLanes; 2]| Vec2::new(v[0][i], v[1][i]).as_dvec2();
        let p = [corner(&hits.corners[0]), corner(&hits.corners[1]), corner(&hits.corners[2])];
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        let normal = normal * (1.0 / normal.length());
        let (dpdu, dpdv) =
            derivatives(&p, [uv(&hits.uvs[0]), uv(&hits.uvs[1]), uv(&hits.uvs[2])], normal);
        let shading_normal = Vec3::new(
            points.shading_normal[0][i],
            points.shading_normal[1][i],
            points.shading_normal[2][i],
        );
        let (dpdu, _) = spanning(dpdu.as_vec3(), dpdv.as_vec3(), shading_normal);
        (to[0][i], to[1][i], to[2][i]) = (dpdu.x, dpdu.y, dpdu.z);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BuildOptions, WorldBuilder};
    use snell_math::simd::Level;
    use snell_math::{Ray, rng};

    fn number(i: u32, k: u32) -> f32 {
        rng::uniform2([i, k, 3, 5]).x * 2.0 - 1.0
    }

    fn vector(i: u32, k: u32) -> Vec3 {
        Vec3::new(number(i, 3 * k), number(i, 3 * k + 1), number(i, 3 * k + 2))
    }

    #[test]
    fn many_points_are_those_of_single_interactions_at_every_level() {
        for (with_normals, with_uvs, far) in
            [(false, true, 0.0), (true, true, 0.0), (true, false, 1e5)]
        {
            let positions =
                (0..3 * TRIANGLE_HITS as u32).map(|i| vector(i, 0) + Vec3::splat(far)).collect();
            let normals = (0..3 * TRIANGLE_HITS as u32)
                .map(|i| vector(i, 1))
                .filter(|_| with_normals)
                .collect();
            let indices =
                (0..TRIANGLE_HITS as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            // Every seventh triangle has the same coordinates at all corners.
            let uv = |i: u32| vector(if (i / 3).is_multiple_of(7) { 0 } else { i }, 2).truncate();
            let uvs = (0..3 * TRIANGLE_HITS as u32).map(uv).filter(|_| with_uvs).collect();
            let uvs = crate::first_uv_set(uvs);
            let mesh = TriangleMesh { positions, normals, uvs, indices, ..TriangleMesh::default() };
            let mut builder = WorldBuilder::default();
            builder.add_mesh(WorldBuilder::ROOT, mesh.into());
            let world = builder.build(&BuildOptions::default()).expect("a world");
            let hits: Vec<Hit> = (0..TRIANGLE_HITS as u32)
                .map(|t| {
                    let uv = rng::uniform2([t, 9, 9, 9]) * 0.5;
                    Hit {
                        t: 1.0,
                        uv: Vec2::new(uv.x, uv.y),
                        instance: 0,
                        geometry: 0,
                        primitive: t,
                    }
                })
                .collect();
            let mut gathered = TriangleHits::default();
            let mesh = world.plain_mesh(GeometryId(0)).expect("a mesh");
            gathered.gather(hits.iter().enumerate().map(|(lane, hit)| (lane, &mesh, hit)));
            gathered.gather_uvs((0..hits.len()).map(|lane| (lane, &mesh)));
            for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                let (mut points, mut tangents) = (TrianglePoints::default(), ZERO);
                gathered.points(&mut points, level.wide());
                gathered.tangents(&points, &mut tangents, level.wide());
                for (i, hit) in hits.iter().enumerate() {
                    let single = world.interaction(&Ray::new(Vec3::ZERO, Vec3::Z), hit);
                    let at = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
                    assert_eq!(points.is_sound[i], 1);
                    assert_eq!(at(&points.position), single.position);
                    assert_eq!(at(&points.position_error), single.position_error);
                    assert_eq!(at(&points.geometric_normal), single.geometric_normal);
                    assert_eq!(at(&points.shading_normal), single.shading_normal);
                    assert_eq!(at(&tangents), single.dpdu);
                }
            }
        }
    }

    #[test]
    fn what_has_no_plane_is_not_sound() {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::splat(f32::INFINITY)],
            indices: vec![[0, 1, 2], [0, 1, 3]],
            ..TriangleMesh::default()
        };
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, mesh.into());
        let world = builder.build(&BuildOptions::default()).expect("a world");
        let mut gathered = TriangleHits::default();
        let mesh = world.plain_mesh(GeometryId(0)).expect("a mesh");
        let hits = [0, 1].map(|primitive| Hit {
            t: 1.0,
            uv: Vec2::splat(0.3),
            instance: 0,
            geometry: 0,
            primitive,
        });
        gathered.gather(hits.iter().enumerate().map(|(lane, hit)| (lane, &mesh, hit)));
        let mut points = TrianglePoints::default();
        gathered.points(&mut points, None);
        assert_eq!(points.is_sound[..2], [0, 0]);
    }
}
