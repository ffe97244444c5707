//! Exact decisions in double precision: rays in the coordinates of trees, the plane of a triangle,
//! and its edges.

pub(crate) mod plane;
pub(crate) mod triangle;

#[cfg(test)]
mod tests;

use super::TriangleTest;
use super::prepared::PreparedRay;
use super::ray::LocalRay;
use crate::hit::DHit;
use crate::precision::frame::Frame;
use crate::precision::{Double, DoubleData};
use crate::search::{Goal, Search};
use snell_math::simd::Lanes8;
use snell_math::{DRay, DVec2, DVec3};

/// Rays with a coordinate of the origin of at least this magnitude have no useful `f32` form and
/// visit the whole tree.
const FAR: f64 = 1e15;
/// Rays whose largest component of the direction is not between `1 / FAST` and `FAST` have no
/// useful `f32` form and visit the whole tree.
const FAST: f64 = 1e18;

impl Frame {
    /// Prepares a ray of the group for the fast kernels. Returns false if the ray is not ordinary.
    #[inline(always)]
    pub fn prepare<L: Lanes8>(&self, prepared: &mut PreparedRay, ray: &DRay) -> bool {
        let DRay { origin, direction, .. } = self.ray(ray);
        let ordinary = prepared.set_from_exact::<L>(&origin, &direction);
        prepared.widen::<L>(self.slack);
        ordinary
    }

    /// Prepares a ray in the coordinates of the group for the general kernels, with the tree's
    /// coordinates for boxes and the filter.
    #[inline(always)]
    pub fn local_ray(&self, ray: &DRay) -> LocalRay {
        let DRay { origin: o, direction: d, .. } = self.ray(ray);
        let (distance, speed) = (o.abs().max_element(), d.abs().max_element());
        if distance < FAR && speed < FAST && speed > 1.0 / FAST {
            LocalRay::within(ray, o, d, self.slack)
        } else {
            blind(ray)
        }
    }
}

/// A local ray that culls nothing, for rays without a useful `f32` form.
#[cold]
fn blind(ray: &DRay) -> LocalRay {
    let local = LocalRay::within(ray, DVec3::ZERO, ray.direction.signum(), f32::INFINITY);
    LocalRay {
        depth_scale: 0.0,
        near_origin: local.negative.map(|n| if n == 1 { f32::MIN } else { f32::MAX }),
        far_origin: local.negative.map(|n| if n == 1 { f32::MAX } else { f32::MIN }),
        ..local
    }
}

impl TriangleTest for Double {
    const TRIANGLES_ELSEWHERE: bool = true;

    #[inline(always)]
    fn fetch_triangle(data: &DoubleData, geometry: u32, triangle: u32) {
        data.fetch(geometry, triangle);
    }

    #[inline(always)]
    fn local_ray(data: &DoubleData, group: usize, ray: &DRay) -> LocalRay {
        data.frames[group].local_ray(ray)
    }

    #[inline(always)]
    fn triangle_hit<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &LocalRay,
        _: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<DHit> {
        double_hit(search, &ray.exact, ids())
    }

    const EPSILON: f64 = f64::EPSILON;

    type Line = DRay;

    #[inline(always)]
    fn line(ray: &DRay) -> DRay {
        *ray
    }

    #[inline(always)]
    fn hit_at<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        line: &DRay,
        corners: &[DVec3; 3],
        ids: [u32; 3],
        closed: u32,
    ) -> Option<DHit> {
        if closed != 0 {
            let found = triangle::exact_hit_closed(line, corners, search.ray.t_min, closed);
            return double_hit_of(search, found, ids);
        }
        hit_on(search, line, corners, ids)
    }

    #[inline(always)]
    fn prepare_root<L: Lanes8>(data: &DoubleData, prepared: &mut PreparedRay, ray: &DRay) -> bool {
        (ray.t_min >= 0.0) & (ray.t_min < ray.t_max) && Self::prepare::<L>(data, 0, prepared, ray)
    }

    #[inline(always)]
    fn prepare<L: Lanes8>(
        data: &DoubleData,
        group: usize,
        prepared: &mut PreparedRay,
        ray: &DRay,
    ) -> bool {
        data.frames[group].prepare::<L>(prepared, ray)
    }

    #[inline(always)]
    fn hit_on_line<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        _: &PreparedRay,
        origin: &DVec3,
        direction: &DVec3,
        _: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<DHit> {
        double_hit(search, &DRay::new(*origin, *direction), ids())
    }
}

/// The hit on a triangle in double precision. `ray` is in the coordinates of the group; its
/// interval is not used.
#[inline(always)]
fn double_hit<G: Goal<Precision = Double>>(
    search: &Search<'_, G>,
    ray: &DRay,
    ids: [u32; 3],
) -> Option<DHit> {
    hit_on(search, ray, search.context.data.corners(ids[1], ids[2]), ids)
}

/// The hit on a triangle with these corners; see [`double_hit`].
#[inline(always)]
fn hit_on<G: Goal<Precision = Double>>(
    search: &Search<'_, G>,
    ray: &DRay,
    corners: &[DVec3; 3],
    ids: [u32; 3],
) -> Option<DHit> {
    double_hit_of(search, triangle::exact_hit(ray, corners, search.ray.t_min), ids)
}

/// Converts the result of the exact test to a hit; `None` if it is beyond the limit.
#[inline(always)]
fn double_hit_of<G: Goal<Precision = Double>>(
    search: &Search<'_, G>,
    found: Option<(f64, DVec2)>,
    [instance, geometry, primitive]: [u32; 3],
) -> Option<DHit> {
    let (t, uv) = found?;
    // Adding 0 turns -0 into +0.
    let t = t + 0.0;
    (t <= search.goal.limit()).then_some(DHit { t, uv, instance, geometry, primitive })
}
