//! The coordinates of a tree in single precision, for a group in double precision.

use super::{Double, DoubleData, Facts, Single};
use crate::mesh::{DTriangleMesh, TriangleMesh};
use snell_math::{Bounds3d, DRay, DVec3, Vec3, real};

/// The map `(p - center) * scale` from a group's coordinates to those of its tree, which are within
/// -1 to 1. Ray parameters are the same in both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub center: DVec3,
    /// The scale of the map, a power of two.
    pub scale: f64,
    /// Bound on the error of each coordinate of a vertex of the rounded mesh.
    pub slack: f32,
}

/// A bound on the `f64` rounding error of positions in the tree's coordinates, for boxes and
/// vertices.
const DOUBLE_ROUNDING: f64 = 1.0 / (1u64 << 50) as f64;

impl Frame {
    /// The frame of a group whose triangles and finite boxes are within `bounds`.
    pub fn of(bounds: &Bounds3d) -> Self {
        // The slack is never 0, because rays are rounded when they are transformed.
        let frame = Self { center: DVec3::ZERO, scale: 1.0, slack: f32::MIN_POSITIVE };
        if bounds.is_empty() {
            return frame;
        }
        let center = bounds.center();
        let radius =
            (bounds.max * 0.5 - bounds.min * 0.5).max_element().clamp(f64::MIN_POSITIVE, f64::MAX);
        // The power of two that brings the radius to between a half and 1. It is limited to what
        // `f64` can represent.
        let exponent = (radius.to_bits() >> 52) as i32 - 1022;
        let scale = real::powi(2f64, (-exponent).clamp(-1000, 1000));
        Self { center, scale, ..frame }
    }

    /// Maps a point to the tree's coordinates.
    #[inline(always)]
    pub fn point(&self, p: DVec3) -> DVec3 {
        (p - self.center) * self.scale
    }

    /// Maps a point from the tree's coordinates back to the group's, approximately.
    pub fn point_in_group(&self, p: DVec3) -> DVec3 {
        p / self.scale + self.center
    }

    /// Maps a ray to the tree's coordinates.
    #[inline(always)]
    pub fn ray(&self, ray: &DRay) -> DRay {
        DRay { origin: self.point(ray.origin), direction: ray.direction * self.scale, ..*ray }
    }

    /// Maps a box to the tree's coordinates, padded for rounding; infinite sides and empty boxes
    /// stay as they are.
    pub fn bounds(&self, b: &Bounds3d) -> Bounds3d {
        if b.is_empty() {
            return *b;
        }
        let (min, max) = (self.point(b.min), self.point(b.max));
        let margin = |v: DVec3| v.abs() * DOUBLE_ROUNDING + DOUBLE_ROUNDING;
        Bounds3d { min: min - margin(min), max: max + margin(max) }
    }

    /// The rounded copy of a mesh of the group, with the same number of triangles. Degenerate
    /// triangles stay degenerate, and all others stay non-degenerate. The slack grows to the
    /// largest error of a vertex.
    pub fn shadow(&mut self, mesh: &DTriangleMesh) -> TriangleMesh {
        let shadow_point = |p: &DVec3| self.point(*p).as_vec3();
        let mut positions: Vec<Vec3> = mesh.positions.iter().map(shadow_point).collect();
        let mut indices = mesh.indices.clone();
        let mut slack = 0.0f64;
        for (i, triangle) in indices.iter_mut().enumerate() {
            let mut corners = triangle.map(|v| positions[v as usize]);
            if mesh.is_degenerate(i) {
                *triangle = [triangle[0]; 3];
                continue;
            }
            if separate(&mut corners) {
                *triangle = corners.map(|corner| {
                    positions.push(corner);
                    (positions.len() - 1) as u32
                });
            }
            for (corner, exact) in corners.iter().zip(mesh.corners(i)) {
                let off = (corner.as_dvec3() - self.point(exact)).abs().max_element();
                slack = slack.max(off);
            }
        }
        self.slack = self.slack.max((slack + DOUBLE_ROUNDING) as f32).next_up();
        TriangleMesh { positions, indices, ..TriangleMesh::default() }
    }
}

/// Maps rays and points of a precision to the coordinates of trees, and back.
pub(crate) trait Frames: Facts {
    /// Maps a ray of a group to the coordinates of the group's structures.
    fn ray_in_structure(data: &Self::Data, group: usize, ray: &DRay) -> DRay;

    /// Maps a point of a group to the coordinates of the group's structures.
    fn point_in_structure(data: &Self::Data, group: usize, point: DVec3) -> DVec3;

    /// Maps a point from the coordinates of a group's structures back to the group's,
    /// approximately.
    fn point_in_group(data: &Self::Data, group: usize, point: DVec3) -> DVec3;

    /// Bound on the error of each coordinate of a vertex in the structures of a group.
    fn slack(data: &Self::Data, group: usize) -> f32;
}

impl Frames for Single {
    #[inline(always)]
    fn ray_in_structure(_: &(), _: usize, ray: &DRay) -> DRay {
        *ray
    }

    #[inline(always)]
    fn point_in_structure(_: &(), _: usize, point: DVec3) -> DVec3 {
        point
    }

    #[inline(always)]
    fn point_in_group(_: &(), _: usize, point: DVec3) -> DVec3 {
        point
    }

    #[inline(always)]
    fn slack(_: &(), _: usize) -> f32 {
        0.0
    }
}

impl Frames for Double {
    #[inline(always)]
    fn ray_in_structure(data: &DoubleData, group: usize, ray: &DRay) -> DRay {
        data.frames[group].ray(ray)
    }

    #[inline(always)]
    fn point_in_structure(data: &DoubleData, group: usize, point: DVec3) -> DVec3 {
        data.frames[group].point(point)
    }

    #[inline(always)]
    fn point_in_group(data: &DoubleData, group: usize, point: DVec3) -> DVec3 {
        data.frames[group].point_in_group(point)
    }

    #[inline(always)]
    fn slack(data: &DoubleData, group: usize) -> f32 {
        data.frames[group].slack
    }
}

/// Moves rounded corners until all three differ. Returns true if any was moved.
fn separate([a, b, c]: &mut [Vec3; 3]) -> bool {
    let mut moved = false;
    if a == b {
        b.x = b.x.next_up();
        moved = true;
    }
    while c == a || c == b {
        c.y = c.y.next_up();
        moved = true;
    }
    moved
}
