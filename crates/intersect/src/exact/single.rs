//! Exact decisions in single precision.

use super::TriangleTest;
use super::prepared::PreparedRay;
use super::ray::LocalRay;
use super::triangle::{exact_hit, exact_hit_closed, height_and_speed, hit_in_plane, is_behind};
use crate::hit::Hit;
use crate::mesh::are_degenerate;
use crate::precision::Single;
use crate::search::{Goal, Search};
use snell_math::simd::Lanes8;
use snell_math::{DRay, DVec3, Ray, Vec2};

impl TriangleTest for Single {
    const TRIANGLES_ELSEWHERE: bool = false;

    #[inline(always)]
    fn fetch_triangle(_: &(), _: u32, _: u32) {}

    #[inline(always)]
    fn local_ray(_: &(), _: usize, ray: &DRay) -> LocalRay {
        LocalRay::new(ray)
    }

    #[inline(always)]
    fn triangle_hit<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &LocalRay,
        corners: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<Hit> {
        single_hit(search, exact_hit(ray, corners, search.start.into()), ids)
    }

    const EPSILON: f64 = f32::EPSILON as f64;

    type Line = LocalRay;

    #[inline(always)]
    fn line(ray: &DRay) -> LocalRay {
        LocalRay::new(ray)
    }

    #[inline(always)]
    fn hit_at<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        line: &LocalRay,
        corners: &[DVec3; 3],
        ids: [u32; 3],
        closed: u32,
    ) -> Option<Hit> {
        let corners = corners.map(|p| p.as_vec3());
        if are_degenerate(&corners) {
            return None;
        }
        let corners = corners.map(|p| p.to_array());
        if closed != 0 {
            let found = exact_hit_closed(line, &corners, search.start.into(), closed);
            return single_hit(search, found, || ids);
        }
        Self::triangle_hit(search, line, &corners, || ids)
    }

    #[inline(always)]
    fn prepare_root<L: Lanes8>(_: &(), prepared: &mut PreparedRay, ray: &Ray) -> bool {
        prepared.set_from_ray::<L>(ray)
    }

    #[inline(always)]
    fn prepare<L: Lanes8>(_: &(), _: usize, prepared: &mut PreparedRay, ray: &DRay) -> bool {
        prepared.set_from_exact::<L>(&ray.origin, &ray.direction)
    }

    #[inline(always)]
    fn hit_on_line<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &PreparedRay,
        origin: &DVec3,
        direction: &DVec3,
        corners: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<Hit> {
        let t_min = search.start.into();
        let [height, speed] = height_and_speed(origin, direction, corners);
        // A plane behind the start is rejected at once, without waiting for the quotient. (The
        // product is finite: for an ordinary ray, both factors are between `1e-150` and `1e40`.)
        if height * speed < 0.0 {
            return None;
        }
        let plane = height / speed;
        if is_behind(plane, t_min) {
            return None;
        }
        single_hit(
            search,
            hit_in_plane(&ray.exact(*origin, *direction), corners, plane, t_min),
            ids,
        )
    }
}

/// Converts the result of the exact test to a hit in single precision; `None` if it is beyond the
/// limit.
#[inline(always)]
fn single_hit<G: Goal<Precision = Single>>(
    search: &Search<'_, G>,
    found: Option<(f64, Vec2)>,
    ids: impl FnOnce() -> [u32; 3],
) -> Option<Hit> {
    let (t, uv) = found?;
    // Adding 0 turns -0 into +0.
    let t = t as f32 + 0.0;
    if t > search.goal.limit() {
        return None;
    }
    let [instance, geometry, primitive] = ids();
    Some(Hit { t, uv, instance, geometry, primitive })
}
