//! Linear motion between keys, which are evenly spaced in time from 0 to 1 or have times of their
//! own.

use crate::mesh::{MeshError, TriangleMesh};
use snell_math::{Bounds3d, DAffine3, DVec3, Transform, Vec3};
use std::sync::Arc;

/// Where a time from 0 to 1 lies between keys: the key before it, and the fraction of the way to
/// the next key.
#[inline(always)]
pub(crate) fn between_keys(time: f32, keys: usize) -> (usize, f32) {
    if keys < 2 {
        return (0, 0.0);
    }
    let x = time * (keys - 1) as f32;
    let key = (x as usize).min(keys - 2);
    (key, x - key as f32)
}

/// Where a time lies between keys at these times, which are ascending: the key before it, and the
/// fraction of the way to the next key. Before the first key it is the first, after the last the
/// last.
#[inline(always)]
fn between_times(time: f32, times: &[f32]) -> (usize, f32) {
    match times.partition_point(|&key| key <= time) {
        0 => (0, 0.0),
        after if after == times.len() => (after - 1, 0.0),
        after => {
            let (a, b) = (times[after - 1], times[after]);
            (after - 1, (time - a) / (b - a))
        }
    }
}

/// Linear interpolation from `a` to `b` by `s`. The result is never outside the box of both points,
/// and exact where they are equal.
#[inline(always)]
pub(crate) fn lerp(a: Vec3, b: Vec3, s: f32) -> Vec3 {
    // The products are rounded and never fused with the sum: a vertex has the same bits in all its
    // triangles.
    (a * (1.0 - s) + b * s).max(a.min(b)).min(a.max(b))
}

/// An interpolated matrix counts as singular if the determinant of its normalised columns is at
/// most this, or if the length of a column is at most this fraction of its length at the keys.
const FLAT: f64 = 1e-9;

/// The transform at a time, from that at the first key and those at the later ones. `times` are the
/// times of all keys, ascending; evenly spaced from 0 to 1 if it is empty. Matrices are
/// interpolated entry by entry (as in Embree), so every point moves on straight lines between keys;
/// a rotation between two keys is not rigid and needs several keys. `None` while the interpolated
/// matrix is singular in double precision (as halfway through a rotation by 180 degrees between two
/// keys); the instance is not hit then.
pub(crate) fn transform_at(
    first: &Transform,
    later: &[Transform],
    times: &[f32],
    time: f32,
) -> Option<Transform> {
    let (key, s) = match times {
        [] => between_keys(time, later.len() + 1),
        times => between_times(time, times),
    };
    let s = f64::from(s);
    let (first, second) = match key.checked_sub(1) {
        None => (first, later.first().unwrap_or(first)),
        Some(before) => (later.get(before)?, later.get(key).or(later.last())?),
    };
    if s == 0.0 || first == second {
        return Some(*first);
    }
    if s == 1.0 {
        return Some(*second);
    }
    let (a, b) = (first.matrix(), second.matrix());
    let mean = |p: DVec3, q: DVec3| p * (1.0 - s) + q * s;
    let mut map = DAffine3::from_translation(mean(a.translation, b.translation));
    let (mut sides, mut is_flat) = (1.0, false);
    for axis in 0..3 {
        let (p, q) = (a.matrix3.col(axis), b.matrix3.col(axis));
        let column = mean(p, q);
        *map.matrix3.col_mut(axis) = column;
        sides *= column.length();
        is_flat |= column.length() <= p.length().max(q.length()) * FLAT;
    }
    is_flat |= map.matrix3.determinant().abs() <= FLAT * sides;
    if is_flat { None } else { Transform::new(map) }
}

/// Padding of the box of a moving triangle, relative to its largest side.
const PADDING: f64 = 1.1e-6;

/// Vertices of a [`MovingMesh`] at a later key.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshKey {
    /// Vertex positions, one per vertex of the mesh; see [`TriangleMesh::positions`].
    pub positions: Vec<Vec3>,
    /// Vertex normals, see [`TriangleMesh::normals`]; empty where the mesh has none.
    pub normals: Vec<Vec3>,
}

/// A triangle mesh whose vertices move along straight lines between keys that are evenly spaced in
/// time from 0 to 1.
///
/// At any time it is hit exactly, bit for bit, as the triangle mesh with the vertices of that time
/// ([`Self::at`]), so closed meshes stay closed. A vertex that is not finite at one key counts as
/// not finite at all times.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingMesh {
    first: Arc<TriangleMesh>,
    later: Vec<MeshKey>,
}

impl MovingMesh {
    /// Makes a moving mesh from the mesh at time 0 and its vertices at the later keys.
    pub fn new(first: TriangleMesh, later: Vec<MeshKey>) -> Result<Self, MeshError> {
        first.validate()?;
        for key in &later {
            let same = |attribute, found: usize, expected: usize| {
                let error =
                    MeshError::AttributeLength { attribute, found, expected, per: "vertex" };
                if found == expected { Ok(()) } else { Err(error) }
            };
            same("positions", key.positions.len(), first.positions.len())?;
            same("normals", key.normals.len(), first.normals.len())?;
        }
        Ok(Self { first: Arc::new(first), later })
    }

    /// The mesh at time 0.
    pub fn first(&self) -> &Arc<TriangleMesh> {
        &self.first
    }

    /// The vertices at the keys after time 0.
    pub fn later(&self) -> &[MeshKey] {
        &self.later
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.first.indices.len()
    }

    /// True if the mesh has no triangles.
    pub fn is_empty(&self) -> bool {
        self.first.indices.is_empty()
    }

    /// The whole mesh at a time from 0 to 1.
    pub fn at(&self, time: f32) -> TriangleMesh {
        let (before, after, s) = self.positions(time);
        let position = |v: usize| {
            let finite = self.keys().all(|positions| positions[v].is_finite());
            if finite { lerp(before[v], after[v], s) } else { Vec3::NAN }
        };
        let mut mesh = TriangleMesh::clone(&self.first);
        mesh.positions = (0..mesh.positions.len()).map(position).collect();
        mesh.normals = (0..mesh.normals.len()).map(|v| self.normal(v, time)).collect();
        mesh
    }

    /// Positions of the three corners of a triangle at a time from 0 to 1.
    ///
    /// # Panics
    /// If the index of the triangle is out of range.
    #[inline(always)]
    pub fn corners(&self, triangle: usize, time: f32) -> [Vec3; 3] {
        let [a, b, c] = self.first.indices[triangle];
        let (before, after, s) = self.positions(time);
        let at = |v: u32| lerp(before[v as usize], after[v as usize], s);
        [at(a), at(b), at(c)]
    }

    /// A slightly padded box around the three corners at all times; `None` for a triangle that is
    /// never hit, because a corner is not finite at some key or two corners coincide at all keys.
    pub(crate) fn bounds(&self, triangle: usize) -> Option<Bounds3d> {
        let corners = self.first.indices[triangle].map(|v| v as usize);
        if !self.keys().all(|positions| corners.iter().all(|&v| positions[v].is_finite())) {
            return None;
        }
        let together = |a: usize, b: usize| self.keys().all(|p| p[corners[a]] == p[corners[b]]);
        if together(0, 1) || together(1, 2) || together(2, 0) {
            return None;
        }
        let b = Bounds3d::of(self.keys().flat_map(|p| corners.map(|v| p[v].as_dvec3())));
        // A static triangle has the same padding, see `mesh::padded_bounds`.
        let margin = b.size().max_element() * PADDING
            + b.min.abs().max(b.max.abs()).max_element() * f64::from(f32::EPSILON)
            + f64::from(f32::MIN_POSITIVE);
        Some(Bounds3d { min: b.min - margin, max: b.max + margin })
    }

    fn keys(&self) -> impl Iterator<Item = &[Vec3]> {
        std::iter::once(&self.first.positions[..])
            .chain(self.later.iter().map(|key| &key.positions[..]))
    }

    /// The positions at the keys before and after a time, and the fraction between them.
    #[inline(always)]
    fn positions(&self, time: f32) -> (&[Vec3], &[Vec3], f32) {
        let (key, s) = between_keys(time, self.later.len() + 1);
        let before = if key == 0 { &self.first.positions } else { &self.later[key - 1].positions };
        let after = self.later.get(key).map_or(before, |key| &key.positions);
        (before, after, s)
    }

    fn normal(&self, v: usize, time: f32) -> Vec3 {
        let (key, s) = between_keys(time, self.later.len() + 1);
        let Some(after) = self.later.get(key) else { return self.first.normals[v] };
        let before = if key == 0 { &self.first.normals } else { &self.later[key - 1].normals };
        before[v].lerp(after.normals[v], s)
    }

    /// One triangle with its attributes at a time, as a separate mesh.
    pub(crate) fn triangle_at(&self, triangle: usize, time: f32) -> TriangleMesh {
        let indices = self.first.indices[triangle].map(|v| v as usize);
        fn part<T: Copy>(all: &[T], indices: [usize; 3]) -> Vec<T> {
            if all.is_empty() { Vec::new() } else { indices.map(|v| all[v]).to_vec() }
        }
        let (mesh, has_normals) = (&self.first, !self.first.normals.is_empty());
        TriangleMesh {
            positions: self.corners(triangle, time).to_vec(),
            indices: vec![[0, 1, 2]],
            normals: if has_normals {
                indices.map(|v| self.normal(v, time)).to_vec()
            } else {
                Vec::new()
            },
            tangents: part(&mesh.tangents, indices),
            uvs: mesh.uvs.each_ref().map(|set| part(set, indices)),
            colors: part(&mesh.colors, indices),
            material_slots: Vec::new(),
            exact: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::DMat3;

    #[test]
    fn keys_are_evenly_spread() {
        assert_eq!(
            [0.0, 0.25, 0.5, 0.75, 1.0].map(|t| between_keys(t, 3)),
            [(0, 0.0), (0, 0.5), (1, 0.0), (1, 0.5), (1, 1.0)]
        );
        assert_eq!(between_keys(0.7, 1), (0, 0.0));
    }

    #[test]
    fn interpolated_points_stay_between_their_keys() {
        let (a, b) = (Vec3::new(0.1, -3e38, 7.0), Vec3::new(0.1, 3e38, 7.000_001));
        for i in 0..=1000 {
            let p = lerp(a, b, i as f32 / 1000.0);
            assert_eq!(p.x, 0.1);
            assert!(p.y.is_finite() && p.z >= a.z && p.z <= b.z);
        }
        assert_eq!((lerp(a, b, 0.0), lerp(a, b, 1.0)), (a, b));
    }

    #[test]
    fn transforms_hit_their_keys_and_vanish_where_they_are_flat() {
        let half_turn =
            Transform::new(DAffine3::from_mat3(DMat3::from_rotation_z(std::f64::consts::PI)));
        let keys =
            [Transform::IDENTITY, half_turn.expect("invertible"), Transform::translation(DVec3::X)];
        let at = |times: &[f32], time| transform_at(&keys[0], &keys[1..], times, time);
        for (time, key) in [(0.0, 0), (0.5, 1), (1.0, 2)] {
            assert_eq!(at(&[], time), Some(keys[key]));
        }
        assert_eq!(at(&[], 0.25), None, "all points are on the axis");
        let quarter = at(&[], 0.125).expect("shrunk but not flat");
        assert!((quarter.point(DVec3::X) - DVec3::X * 0.5).length() < 1e-12);
        let times = [0.25, 0.75, 0.875];
        for (time, key) in [(0.0, 0), (0.25, 0), (0.75, 1), (0.875, 2), (1.0, 2)] {
            assert_eq!(at(&times, time), Some(keys[key]), "at {time}");
        }
        assert_eq!(at(&times, 0.375), Some(quarter));
    }

    #[test]
    fn later_keys_must_have_as_many_vertices() {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            ..TriangleMesh::default()
        };
        let key = MeshKey { positions: vec![Vec3::ZERO; 2], normals: Vec::new() };
        assert!(matches!(
            MovingMesh::new(mesh, vec![key]),
            Err(MeshError::AttributeLength { found: 2, .. })
        ));
    }
}
