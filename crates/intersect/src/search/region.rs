//! Regions that a search visits, for visualisation.

use snell_math::{Bounds3, Bounds3d, DAffine3, DVec3};

/// The form of a [`Region`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegionKind {
    /// A parallelepiped: `center` plus each of the axes times a number from -1 to 1.
    Box,
    /// An ellipsoid: `center` plus the axes times the coordinates of any vector of length up to 1.
    Ball,
    /// A piece of a plane: `center` plus each of the first two axes times a number from -1 to 1.
    Plane,
    /// A piece of the ray itself: `center` plus the first axis times a number from -1 to 1.
    Stretch,
}

/// A region that a search visited, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// The form of the region.
    pub kind: RegionKind,
    /// The middle of the region.
    pub center: DVec3,
    /// Vectors from the middle to the sides.
    pub axes: [DVec3; 3],
}

impl Region {
    fn along_axes(kind: RegionKind, center: DVec3, half: DVec3) -> Self {
        Self { kind, center, axes: [DVec3::X * half.x, DVec3::Y * half.y, DVec3::Z * half.z] }
    }

    /// A box.
    pub(crate) fn of_box(bounds: &Bounds3d) -> Self {
        Self::along_axes(RegionKind::Box, bounds.center(), bounds.size() * 0.5)
    }

    /// A box in single precision.
    pub(crate) fn of_bounds(bounds: &Bounds3) -> Self {
        Self::of_box(&(*bounds).into())
    }

    /// A ball.
    pub(crate) fn ball(center: DVec3, radius: f64) -> Self {
        Self::along_axes(RegionKind::Ball, center, DVec3::splat(radius))
    }

    /// A square piece of a plane. The normal need not have length 1.
    pub(crate) fn plane(center: DVec3, normal: DVec3, half_side: f64) -> Self {
        let normal = normal.normalize_or(DVec3::X);
        let first = normal.any_orthonormal_vector();
        let axes = [first * half_side, normal.cross(first) * half_side, DVec3::ZERO];
        Self { kind: RegionKind::Plane, center, axes }
    }

    /// A piece of a ray.
    pub(crate) fn stretch(from: DVec3, to: DVec3) -> Self {
        let axes = [(to - from) * 0.5, DVec3::ZERO, DVec3::ZERO];
        Self { kind: RegionKind::Stretch, center: (from + to) * 0.5, axes }
    }

    pub(crate) fn mapped(&self, map: &DAffine3) -> Self {
        let axes = self.axes.map(|axis| map.transform_vector3(axis));
        Self { kind: self.kind, center: map.transform_point3(self.center), axes }
    }
}
