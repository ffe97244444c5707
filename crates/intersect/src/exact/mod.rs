//! The tests that decide hits: rays prepared for tests, and the watertight test of a triangle.

pub(crate) mod double;
pub(crate) mod plane_hit;
pub(crate) mod prepared;
pub(crate) mod ray;
mod single;
pub(crate) mod triangle;

use crate::precision::frame::Frames;
use crate::search::{Goal, Search};
use prepared::PreparedRay;
use ray::LocalRay;
use snell_math::simd::Lanes8;
use snell_math::{DRay, DVec3};

/// Transforms rays of a precision into the coordinates of trees, and decides hits on triangles.
pub(crate) trait TriangleTest: Frames {
    /// True if the triangle test reads data outside of the blocks, which can then be prefetched.
    const TRIANGLES_ELSEWHERE: bool;

    /// Prefetches the data of a triangle.
    fn fetch_triangle(data: &Self::Data, geometry: u32, triangle: u32);

    /// Prepares a ray in the coordinates of a group for the general kernels.
    fn local_ray(data: &Self::Data, group: usize, ray: &DRay) -> LocalRay;

    /// The relative rounding of the coordinates of vertices and of their projections.
    const EPSILON: f64;

    /// A ray prepared for [`Self::hit_at`].
    type Line: Copy;

    /// Prepares a ray in the coordinates of a group for [`Self::hit_at`].
    fn line(ray: &DRay) -> Self::Line;

    /// The hit on a triangle that is in no tree, given its corners in `f64`: the same as on a
    /// triangle of a mesh with these vertices. `None` unless the hit is after the start of the ray
    /// and not beyond the limit of the goal.
    fn hit_at<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        line: &Self::Line,
        corners: &[DVec3; 3],
        ids: [u32; 3],
        closed: u32,
    ) -> Option<Self::Hit>;

    /// The hit on a triangle, given its corners as the tree stores them; `None` unless the hit is
    /// after the start of the ray and not beyond the limit of the goal.
    fn triangle_hit<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &LocalRay,
        corners: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<Self::Hit>;

    /// Prepares a ray of the world for the fast kernels, in the root group. Returns false if the
    /// ray is not ordinary, or its interval is empty or begins below zero.
    fn prepare_root<L: Lanes8>(
        data: &Self::Data,
        prepared: &mut PreparedRay,
        ray: &Self::Ray,
    ) -> bool;

    /// Prepares a ray of a group for the fast kernels. Returns false if the ray is not ordinary.
    fn prepare<L: Lanes8>(
        data: &Self::Data,
        group: usize,
        prepared: &mut PreparedRay,
        ray: &DRay,
    ) -> bool;

    /// Performs [`Self::triangle_hit`] for an ordinary ray; `origin` and `direction` are in the
    /// coordinates of the group.
    fn hit_on_line<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &PreparedRay,
        origin: &DVec3,
        direction: &DVec3,
        corners: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<Self::Hit>;
}
