//! Lists of few primitives: sixteen rays at a time against each triangle in turn, without a tree.
//!
//! First the signs of the edges for all rays, in `f32` and generously ([`Lines::passing`]): the signed volume of a ray and an edge is a
//! product of the two lines (Plücker coordinates), of which the edge's part is worked out when the list is made. That leaves some
//! three triangles a ray. Of these the nearest plane is found in `f64`; its triangle alone is then tested exactly, unless anything is
//! close: then all of them are. Shapes are tested ray by ray, with a look at their boxes before. Rays of extraordinary size go through the tree.

mod contents;
mod exact;
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
use contents::{MAX_TRIANGLES, Row};
use lines::{Lines, PerRay, RAYS};
use snell_math::simd::{Level, Portable8, WideLanes};
use snell_math::{Ray, Vec2};
use std::hint::select_unpredictable;
use std::mem::MaybeUninit;

/// Batches of fewer rays are not worth it.
const MIN_RAYS: usize = 4;

/// After so many rays it is seen whether lists are the right thing for a batch.
const TRIAL: usize = 128;

/// Planes that a ray meets at less than this, relative to the size of both, are not compared by distance.
const MIN_SLOPE: f64 = 1.0 / 256.0;

/// What a hit may be off from where the ray meets the plane of the triangle, relative to the distance of the farthest vertex: this over
/// the slope in units of [`MIN_SLOPE`]. The drawing is off by `6 * 2^-24` of the distance, and twice of that counts.
const PLACE_ERROR: f64 = 12.5 / 16_777_216.0 / MIN_SLOPE;

/// And this, because `f32` rounds.
const ROUNDING: f64 = 1.0 / 4_194_304.0;

/// True if a list answers the queries of this goal.
pub(crate) fn is_suitable<G: Goal>(forest: &Forest, rays: usize) -> bool {
    G::WANTS_ONE && rays >= MIN_RAYS && forest.list.is_some()
}

/// Searches for the rays of a batch; `finish` gets the number of a ray and what was found. [`is_suitable`] must hold. Returns how many
/// rays were searched for: less than all if most of them point past everything, for in a tree that costs next to nothing.
pub(crate) fn search_list<G: Goal<Precision = Single>>(
    forest: &Forest,
    level: Level,
    batch: &Batch<Single>,
    start: impl Fn(&Ray) -> G,
    finish: impl FnMut(usize, G),
) -> usize {
    let Some(list) = &forest.list else { return 0 };
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
) -> usize {
    use super::traverse::walk_avx2;
    // SAFETY: as promised by the caller.
    unsafe { run::<snell_math::simd::Avx8, G>(forest, list, level, batch, stack, start, finish, walk_avx2::<G>) }
}

/// # Safety
/// The machine must have the instructions of `L`; `stack` must have room for all groups; `enter` must be the entry of the same level.
#[inline(always)]
unsafe fn run<L: WideLanes, G: Goal<Precision = Single>>(
    forest: &Forest,
    list: &List,
    level: Level,
    batch: &Batch<Single>,
    stack: &mut Stack,
    start: impl Fn(&Ray) -> G,
    mut finish: impl FnMut(usize, G),
    enter: Walk<G>,
) -> usize {
    let (mut lines, mut found) = (Lines::NONE, Found::NONE);
    let mut passing = [[0u16; 4]; MAX_TRIANGLES / 4];
    let words = list.edges.len().div_ceil(4);
    let (mut first, mut met) = (0, 0);
    while first < batch.rays.len() {
        if first >= TRIAL && 2 * met < first {
            break;
        }
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
        // SAFETY: as promised by the caller.
        unsafe { nearest.test::<L, G>(list, &lines, &mut found) };
        met += nearest.first.iter().filter(|&&t| t < f64::INFINITY).count() + nearest.doubtful.count_ones() as usize;
        for (lane, ray) in rays.iter().enumerate() {
            let query = batch.rays.get(first + lane);
            let mut search = Search::new(query, batch.context, start(ray));
            if ordinary >> lane & 1 == 0 {
                if Single::is_valid(ray) {
                    search_forest(forest, level, &mut search);
                }
            } else {
                let is_over = match found.offer(list, lane, &mut search) {
                    Some(is_over) => is_over,
                    None => offer_all(list, &lines.exact(lane, ray), passing.as_flattened(), lane, &mut search),
                };
                if !is_over && list.has_objects() {
                    // SAFETY: as promised by the caller.
                    unsafe { test_objects(forest, list, &mut search, stack, enter) };
                }
            }
            finish(first + lane, search.goal);
        }
        first = end;
    }
    first
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
            let over = unsafe { test_object(forest, &forest.trees[0], object.number, &ray, 0, search, stack, enter) };
            if over {
                return;
            }
        }
    }
}

/// For each ray the nearest planes of triangles that its line passes through.
struct Nearest {
    /// Distance of the nearest.
    first: [f64; RAYS],
    /// Hits on its triangle are no nearer than this, those on any other no nearer than that.
    first_low: [f64; RAYS],
    second_low: [f64; RAYS],
    /// The triangle of the nearest.
    triangle: [u32; RAYS],
    /// The rays for which that may not be the order of the hits.
    doubtful: u32,
}

impl Nearest {
    const NONE: Self = Self {
        first: [f64::INFINITY; RAYS],
        first_low: [f64::INFINITY; RAYS],
        second_low: [f64::INFINITY; RAYS],
        triangle: [0; RAYS],
        doubtful: 0,
    };

    /// Notes that the line of a ray may pass through a triangle. (Without branches: whether that is ahead, and nearer than what is known,
    /// is as good as random.)
    #[inline(always)]
    fn note(&mut self, list: &List, lines: &Lines, triangle: usize, lane: usize) {
        let plane = &list.planes[triangle];
        let lane = lane % RAYS;
        // As in `plane_distance`, so the same bits.
        let slope = plane.normal.dot(lines.direction(lane));
        let t = plane.normal.dot(plane.corner - lines.origin(lane)) / slope;
        let is_ahead = !is_behind(t, lines.t_min[lane].into());
        let least = plane.steep * f64::from(lines.size[lane]);
        let is_steep = (slope.abs() >= least) & (t.abs() < f64::INFINITY);
        self.doubtful |= u32::from(is_ahead & !is_steep) << lane;
        let is_used = is_ahead & is_steep;
        let error = f64::from(lines.reach[lane]) * (PLACE_ERROR * (least / slope.abs()) + ROUNDING);
        let (t, low) = if is_used { (t, t - error) } else { (f64::INFINITY, f64::INFINITY) };
        let (first, first_low) = (self.first[lane], self.first_low[lane]);
        let is_first = t < first;
        // As integers, which can be chosen without a branch.
        let choose = |is_one: bool, one: f64, other: f64| {
            f64::from_bits(select_unpredictable(is_one, one.to_bits(), other.to_bits()))
        };
        let other_low = choose(is_first, first_low, low);
        self.second_low[lane] = if other_low < self.second_low[lane] { other_low } else { self.second_low[lane] };
        self.first[lane] = choose(is_first, t, first);
        self.first_low[lane] = choose(is_first, low, first_low);
        self.triangle[lane] = select_unpredictable(is_first, triangle as u32, self.triangle[lane]);
    }

    /// Tests the nearest triangle of each ray exactly.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    unsafe fn test<L: WideLanes, G: Goal>(&self, list: &List, lines: &Lines, found: &mut Found) {
        let (mut ahead, mut alone) = (0, 0);
        for lane in 0..RAYS {
            let t = self.first[lane];
            let is_ahead = (t < f64::INFINITY) & (self.first_low[lane] <= f64::from(lines.t_max[lane]));
            // The hit is where the plane is met, and the second may be off. If any hit will do, there is no second.
            let is_alone = (t < self.second_low[lane]) | (!G::NARROWS & ((t as f32) < lines.t_max[lane]));
            ahead |= u32::from(is_ahead) << lane;
            alone |= u32::from(is_alone) << lane;
            found.t[lane] = t as f32;
        }
        (found.hits, found.unsure, found.triangle) = (0, self.doubtful, self.triangle);
        for from in [0, 4, 8, 12] {
            if ahead >> from & 0xf == 0 {
                continue;
            }
            let of_lane = |i: usize| &list.triangles[self.triangle[from + i] as usize].rows;
            let [a, b, c, d] = [of_lane(0), of_lane(1), of_lane(2), of_lane(3)];
            let axes = std::array::from_fn(|i| lines.axis[from + i]);
            let corners = [[&a[0], &b[0], &c[0], &d[0]], [&a[1], &b[1], &c[1], &d[1]], [&a[2], &b[2], &c[2], &d[2]]];
            let distances = std::array::from_fn(|i| self.first[from + i]);
            // SAFETY: passed on to the caller; axes are below 3.
            let four = unsafe {
                exact::test::<L::Doubles>(
                    four_of(&lines.origin, from),
                    four_of(&lines.direction, from),
                    corners,
                    axes,
                    &distances,
                )
            };
            found.b1[from..from + 4].copy_from_slice(&four.b1);
            found.b2[from..from + 4].copy_from_slice(&four.b2);
            found.hits |= four.hits << from;
        }
        found.hits &= ahead & alone & !found.unsure;
        // What is ahead and no hit, or not alone.
        found.unsure |= ahead & !found.hits;
    }
}

#[inline(always)]
fn four_of(rows: &PerRay<Row>, from: usize) -> [&Row; 4] {
    [&rows[from], &rows[from + 1], &rows[from + 2], &rows[from + 3]]
}

/// What is known of the hits on triangles: nothing for rays without a bit.
struct Found {
    /// The rays whose nearest hit is known.
    hits: u32,
    /// The rays for which all triangles are to be tested.
    unsure: u32,
    t: PerRay<f32>,
    b1: PerRay<f32>,
    b2: PerRay<f32>,
    triangle: PerRay<u32>,
}

impl Found {
    const NONE: Self =
        Self { hits: 0, unsure: 0, t: [0.0; RAYS], b1: [0.0; RAYS], b2: [0.0; RAYS], triangle: [0; RAYS] };

    /// Offers the nearest hit. True if the search is over, `None` if all triangles are to be tested.
    #[inline(always)]
    fn offer<G: Goal<Precision = Single>>(&self, list: &List, lane: usize, search: &mut Search<'_, G>) -> Option<bool> {
        if self.unsure >> lane & 1 == 1 {
            return None;
        }
        // Never minus zero.
        let t = self.t[lane] + 0.0;
        if self.hits >> lane & 1 == 0 || t > search.goal.limit() {
            return Some(false);
        }
        let (geometry, primitive) = list.triangles[self.triangle[lane] as usize].ids;
        let uv = Vec2::new(self.b1[lane], self.b2[lane]);
        match search.offer(Hit { t, uv, instance: 0, geometry, primitive }) {
            Verdict::Finished => Some(true),
            Verdict::Taken | Verdict::Behind => Some(false),
            Verdict::Rejected => None,
        }
    }
}

/// Tests all triangles of a list exactly that the line of a ray may pass through. True if the search is over.
#[inline(never)]
fn offer_all<G: Goal<Precision = Single>>(
    list: &List,
    ray: &ExactRay,
    passing: &[u16],
    lane: usize,
    search: &mut Search<'_, G>,
) -> bool {
    let t_min = search.start.into();
    let of_ray = passing.iter().zip(&list.planes).zip(&list.triangles).filter(|((rays, _), _)| *rays >> lane & 1 == 1);
    for ((_, plane), triangle) in of_ray {
        let distance = plane.normal.dot(plane.corner - ray.origin) / plane.normal.dot(ray.direction);
        if is_behind(distance, t_min) {
            continue;
        }
        let Some((t, uv)) = hit_in_plane(ray, &triangle.corners, distance, t_min) else { continue };
        // Never minus zero.
        let t = t as f32 + 0.0;
        let (geometry, primitive) = triangle.ids;
        let hit = Hit { t, uv, instance: 0, geometry, primitive };
        if t <= search.goal.limit() && search.offer(hit) == Verdict::Finished {
            return true;
        }
    }
    false
}
