//! Lists of few primitives: sixteen rays at a time against each triangle in turn, without a tree.
//!
//! First the signs of the edges for all rays, in `f32` and generously ([`Lines::passing`]): the signed volume of a ray and an edge is a
//! product of the two lines (Plücker coordinates), of which the edge's part is worked out when the list is made. That leaves some
//! three triangles a ray. Of these the nearest plane is found in `f64`; its triangle alone is then tested exactly, unless anything is
//! close: then all of them are. Shapes are tested ray by ray, with a look at their boxes before. Rays of extraordinary size go through the tree.

mod contents;
mod lines;
#[cfg(test)]
mod tests;

pub(crate) use contents::List;

use super::interleave::Batch;
use super::traverse::{Entry, Stack, Walk, search_forest, test_object, walk_portable};
use super::triangle::{ExactRay, hit_in_plane, is_behind};
use crate::accel::box_ray::BoxRay;
use crate::accel::bvh::Forest;
use crate::hit::Hit;
use crate::precision::{Rules, Single};
use crate::query::search::{Goal, Search, Verdict};
use contents::MAX_TRIANGLES;
use lines::{Lines, RAYS};
use snell_math::simd::{Lanes8, Level, Portable8};
use snell_math::Ray;
use std::mem::MaybeUninit;

/// Batches of fewer rays are not worth it.
const MIN_RAYS: usize = 4;

/// Planes that a ray meets at less than this, relative to the size of both, are not compared by distance.
const MIN_SLOPE: f64 = 1.0 / 256.0;

/// Bound of what a hit may be off from where the ray meets the plane of the triangle at [`MIN_SLOPE`] or more, relative to the distance
/// of the farthest vertex. The drawing is off by `6 * 2^-24` of it, twice of that counts, divided by the slope; and `f32` rounds.
const PLACE_ERROR: f64 = 1.0 / 4096.0;

/// True if a list answers the queries of this goal.
pub(crate) fn is_suitable<G: Goal>(forest: &Forest, rays: usize) -> bool {
    G::WANTS_ONE && rays >= MIN_RAYS && forest.list.is_some()
}

/// Searches for every ray of a batch; `finish` gets the number of a ray and what was found. [`is_suitable`] must hold.
pub(crate) fn search_list<G: Goal<Precision = Single>>(
    forest: &Forest,
    level: Level,
    batch: &Batch<Single>,
    start: impl Fn(&Ray) -> G,
    finish: impl FnMut(usize, G),
) {
    let Some(list) = &forest.list else { return };
    let mut small = [const { MaybeUninit::<Entry>::uninit() }; super::traverse::SMALL_STACK];
    let mut large = Vec::new();
    let stack: &mut Stack = if forest.stack_size <= small.len() {
        &mut small
    } else {
        large.resize_with(forest.stack_size, MaybeUninit::uninit);
        &mut large
    };
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `World` holds only levels that the machine supports.
        Level::Avx2 | Level::Avx512 => unsafe { run_avx2(forest, list, level, batch, stack, start, finish) },
        // SAFETY: portable code.
        _ => unsafe { run::<Portable8, G>(forest, list, level, batch, stack, start, finish, walk_portable::<G>) },
    }
}

/// # Safety
/// As [`run`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn run_avx2<G: Goal<Precision = Single>>(
    forest: &Forest,
    list: &List,
    level: Level,
    batch: &Batch<Single>,
    stack: &mut Stack,
    start: impl Fn(&Ray) -> G,
    finish: impl FnMut(usize, G),
) {
    use super::traverse::walk_avx2;
    // SAFETY: as promised by the caller.
    unsafe { run::<snell_math::simd::Avx8, G>(forest, list, level, batch, stack, start, finish, walk_avx2::<G>) }
}

/// # Safety
/// The machine must have the instructions of `L`; `stack` must have room for all groups; `enter` must be the entry of the same level.
#[inline(always)]
unsafe fn run<L: Lanes8, G: Goal<Precision = Single>>(
    forest: &Forest,
    list: &List,
    level: Level,
    batch: &Batch<Single>,
    stack: &mut Stack,
    start: impl Fn(&Ray) -> G,
    mut finish: impl FnMut(usize, G),
    enter: Walk<G>,
) {
    let mut lines = Lines::NONE;
    let mut passing = [[0u16; 4]; MAX_TRIANGLES / 4];
    let words = list.edges.len().div_ceil(4);
    let mut first = 0;
    while first < batch.rays.len() {
        let end = (first + RAYS).min(batch.rays.len());
        let rays = &batch.rays.rays()[first..end];
        let ordinary = lines.set_up(list, rays);
        // SAFETY: as promised by the caller.
        unsafe { lines.passing::<L>(&list.edges, passing.as_flattened_mut()) };
        let mut nearest = Nearest::NONE;
        for (number, word) in passing[..words].iter().enumerate() {
            let [a, b, c, d] = word.map(u64::from);
            let mut word = a | b << 16 | c << 32 | d << 48;
            while word != 0 {
                let bit = word.trailing_zeros() as usize;
                word &= word - 1;
                nearest.note(list, &lines, number * 4 + bit / RAYS, bit % RAYS);
            }
        }
        for (lane, ray) in rays.iter().enumerate() {
            let query = batch.rays.get(first + lane);
            let mut search = Search::new(query, batch.context, start(ray));
            if ordinary >> lane & 1 == 0 {
                if Single::is_valid(ray) {
                    search_forest(forest, level, &mut search);
                }
            } else if !nearest.offer_nearest(list, &lines, lane, &mut search, &passing) && list.has_objects() {
                // SAFETY: as promised by the caller.
                unsafe { test_objects(forest, list, &mut search, stack, enter) };
            }
            finish(first + lane, search.goal);
        }
        first = end;
    }
}

/// Tests the shapes of a list.
///
/// # Safety
/// As [`run`].
#[inline(never)]
unsafe fn test_objects<G: Goal<Precision = Single>>(
    forest: &Forest,
    list: &List,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
    enter: Walk<G>,
) {
    let ray = Single::exact(search.ray);
    let thick = BoxRay::new(&ray, &list.bounds, search.start);
    for object in &list.objects {
        let (begins, ends) = object.bounds.map_or((f64::NEG_INFINITY, f64::INFINITY), |bounds| thick.span_of(&bounds));
        if begins <= ends && begins <= search.cull().into() {
            // SAFETY: as promised by the caller.
            let over =
                unsafe { test_object(forest, &forest.trees[0], object.number, &ray, 0, search, stack, enter) };
            if over {
                return;
            }
        }
    }
}

/// For each ray the nearest planes of triangles that its line passes through.
struct Nearest {
    /// Distances of the nearest and the second.
    first: [f64; RAYS],
    second: [f64; RAYS],
    /// The triangle of the nearest.
    triangle: [u32; RAYS],
    /// The rays for which that may not be the order of the hits.
    doubtful: u32,
}

impl Nearest {
    const NONE: Self =
        Self { first: [f64::INFINITY; RAYS], second: [f64::INFINITY; RAYS], triangle: [0; RAYS], doubtful: 0 };

    /// Notes that the line of a ray may pass through a triangle. (Without branches: whether that is ahead, and nearer than what is known,
    /// is as good as random.)
    #[inline(always)]
    fn note(&mut self, list: &List, lines: &Lines, triangle: usize, lane: usize) {
        let plane = &list.planes[triangle];
        let lane = lane % RAYS;
        // As in `plane_distance`, so the same bits.
        let slope = plane.normal.dot(lines.direction[lane]);
        let t = plane.normal.dot(plane.corner - lines.origin[lane]) / slope;
        let is_ahead = !is_behind(t, lines.t_min[lane]);
        let is_steep = (slope.abs() >= plane.steep * lines.size[lane]) & (t.abs() < f64::INFINITY);
        self.doubtful |= u32::from(is_ahead & !is_steep) << lane;
        let t = if is_ahead & is_steep { t } else { f64::INFINITY };
        let (first, second) = (self.first[lane], self.second[lane]);
        let is_first = t < first;
        let later = if is_first { first } else { t };
        self.second[lane] = if later < second { later } else { second };
        self.first[lane] = if is_first { t } else { first };
        self.triangle[lane] = if is_first { triangle as u32 } else { self.triangle[lane] };
    }

    /// Offers the nearest hit of a ray. True if the search is over.
    #[inline(always)]
    fn offer_nearest<G: Goal<Precision = Single>>(
        &self,
        list: &List,
        lines: &Lines,
        lane: usize,
        search: &mut Search<'_, G>,
        passing: &[[u16; 4]; MAX_TRIANGLES / 4],
    ) -> bool {
        let exact = lines.exact(lane, search.ray);
        let error = lines.reach[lane] * PLACE_ERROR;
        if self.doubtful >> lane & 1 == 0 {
            let t = self.first[lane];
            if t == f64::INFINITY || t > f64::from(search.goal.limit()) + error {
                // Nothing within the interval.
                return false;
            }
            if let Some((verdict, t)) = offer(list, &exact, self.triangle[lane] as usize, search)
                && (t + error < self.second[lane] || verdict == Verdict::Finished)
                && verdict != Verdict::Rejected
            {
                return verdict == Verdict::Finished;
            }
        }
        let mut of_ray = passing.as_flattened().iter().enumerate().take(list.edges.len());
        of_ray.any(|(triangle, rays)| {
            rays >> lane & 1 == 1
                && offer(list, &exact, triangle, search).is_some_and(|(verdict, _)| verdict == Verdict::Finished)
        })
    }
}

/// Offers the hit on a triangle; `None` if it is none. The distance is as found, before it is rounded.
#[inline(always)]
fn offer<G: Goal<Precision = Single>>(
    list: &List,
    ray: &ExactRay,
    triangle: usize,
    search: &mut Search<'_, G>,
) -> Option<(Verdict, f64)> {
    let (plane, triangle) = (&list.planes[triangle], &list.triangles[triangle]);
    let t_min = search.start.into();
    let distance = plane.normal.dot(plane.corner - ray.origin) / plane.normal.dot(ray.direction);
    if is_behind(distance, t_min) {
        return None;
    }
    let (exact, uv) = hit_in_plane(ray, &triangle.corners, distance, t_min)?;
    // Never minus zero.
    let t = exact as f32 + 0.0;
    if t > search.goal.limit() {
        return Some((Verdict::Behind, exact));
    }
    let (geometry, primitive) = triangle.ids;
    Some((search.offer(Hit { t, uv, instance: 0, geometry, primitive }), exact))
}
