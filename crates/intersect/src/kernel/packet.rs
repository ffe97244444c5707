//! Coherent rays sixteen at a time: one test of eight boxes serves a whole bundle of rays.
//!
//! A run of sixteen rays of the batch becomes a [`Bundle`] if it is one: rays from one point, or towards one point, or otherwise close together.
//! Runs that are none, and those that turn out to have little in common in this tree, are left to the caller. The
//! decision is made by the run alone, and every pair of ray and triangle that is not surely a miss goes to the same exact test
//! as everywhere else, so that neighbours change neither results nor what is done for a ray.

pub(crate) mod bundle;
pub(crate) mod doubles;
pub(crate) mod exact;
mod leaf;
mod lines;
mod objects;
pub(crate) mod runs;
pub(crate) mod sure;
#[cfg(test)]
mod tests;
mod trial;
mod triangles;
mod walk;

use super::interleave::Batch;
use super::node::ChildRef;
use super::traverse::{Walk, walk_portable};
use crate::accel::bvh::{Forest, GroupTree};
use crate::precision::Rules;
use crate::query::search::{Goal, RayOf, Search};
use bundle::{Bundle, RAYS};
use exact::Found;
use snell_math::simd::{Lanes16, Level, Pair, Portable8};
use std::mem::MaybeUninit;
use std::ops::Range;
use sure::Sure;
use trial::Trial;
use walk::{Position, Stacks, WalkBundle, Walker, walk_bundle_portable};
#[cfg(target_arch = "x86_64")]
use {
    super::traverse::walk_avx2,
    snell_math::simd::{Avx8, Avx16},
    walk::{walk_bundle_avx2, walk_bundle_avx512},
};

/// Fewer rays are not worth a bundle.
const MIN_RAYS: usize = 6;

/// True if the forest can be searched with bundles at all.
pub(crate) fn is_suitable(forest: &Forest) -> bool {
    fits(&forest.trees[0])
}

/// True if bundles can walk this tree.
fn fits(tree: &GroupTree) -> bool {
    // A child is remembered as its place: eight to a node.
    tree.root != ChildRef::NONE
        && tree.root.is_node()
        && tree.nodes.len() < 1 << 29
        && bundle::is_in_range(&tree.nodes[tree.root.index()])
}

/// Searches for the rays of the batch run by run; `finish` gets the number of a ray and what was found. Returns the ranges of
/// rays that were left out.
pub(crate) fn search_runs<G: Goal>(
    forest: &Forest,
    level: Level,
    batch: &Batch<G::Precision>,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) -> Vec<Range<usize>> {
    debug_assert!(is_suitable(forest));
    let mut stacks = Stacks {
        distances: vec![0.0; forest.stack_size],
        places: vec![0; forest.stack_size],
        masks: vec![0; forest.stack_size],
        single: vec![MaybeUninit::uninit(); forest.stack_size],
    };
    match level {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `World` holds only levels that the machine supports, and the stacks have `stack_size` entries.
        Level::Avx512 => unsafe { run_avx512(forest, batch, &mut stacks, start, finish) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Level::Avx2 => unsafe { run_avx2(forest, batch, &mut stacks, start, finish) },
        // SAFETY: portable code, and the stacks have `stack_size` entries.
        _ => unsafe {
            let entries = (walk_bundle_portable::<G> as WalkBundle<G>, walk_portable::<G> as Walk<G>);
            run::<Pair<Portable8>, G>(forest, batch, &mut stacks, start, finish, entries)
        },
    }
}

/// # Safety
/// As [`run`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn run_avx2<G: Goal>(
    forest: &Forest,
    batch: &Batch<G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) -> Vec<Range<usize>> {
    let entries = (walk_bundle_avx2::<G> as WalkBundle<G>, walk_avx2::<G> as Walk<G>);
    // SAFETY: as promised by the caller.
    unsafe { run::<Pair<Avx8>, G>(forest, batch, stacks, start, finish, entries) }
}

/// # Safety
/// As [`run`].
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
unsafe fn run_avx512<G: Goal>(
    forest: &Forest,
    batch: &Batch<G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    finish: impl FnMut(usize, G),
) -> Vec<Range<usize>> {
    let entries = (walk_bundle_avx512::<G> as WalkBundle<G>, walk_avx2::<G> as Walk<G>);
    // SAFETY: as promised by the caller.
    unsafe { run::<Avx16, G>(forest, batch, stacks, start, finish, entries) }
}
/// # Safety
/// The machine must have the instructions of `W`; the stacks must have room for all groups; `enter` and `enter_single` must be
/// entries of the same level.
#[inline(always)]
unsafe fn run<'s, W: Lanes16, G: Goal>(
    forest: &Forest,
    batch: &Batch<'s, G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    mut finish: impl FnMut(usize, G),
    (enter, enter_single): (WalkBundle<G>, Walk<G>),
) -> Vec<Range<usize>> {
    let mut left: Vec<Range<usize>> = Vec::new();
    let (mut bundle, mut found, mut sure) = (Bundle::NONE, Found::NONE, Sure::NONE);
    let (mut trial, mut spare) = (Trial::default(), Vec::new());
    let mut searches = [const { None }; RAYS];
    let mut first = 0;
    while first < batch.rays.len() {
        let run = first..(first + RAYS).min(batch.rays.len());
        first = run.end;
        // SAFETY: as promised by the caller.
        if unsafe {
            let (data, rays) = (batch.context.data, &batch.rays.rays()[run.clone()]);
            let backward = G::ANY && trial.is_backward();
            G::Precision::set_up_bundle::<W>(data, &mut bundle, rays, backward)
        } {
            // (In place: what is returned would be copied as a whole after it was written in pieces.)
            let begin = |lane: usize, search: &mut Option<Search<'s, G>>| {
                let query = batch.rays.get((run.start + lane).min(run.end - 1));
                *search = Some(Search::new(query, batch.context, start(query.ray)));
            };
            let alive = u32::MAX >> (32 - run.len());
            let mut walker = Walker {
                forest,
                data: batch.context.data,
                options: batch.context.options,
                masks: batch.rays.common_mask(run.clone()),
                rays: &batch.rays.rays()[run.clone()],
                searches: &mut searches,
                begin: &begin,
                found: &mut found,
                stacks,
                alive,
                waiting: 0,
                put_off: [0; RAYS],
                spare: &mut spare,
                work: 0,
                known: 0,
                sure: &mut sure,
                enter,
                enter_single,
            };
            // SAFETY: as promised by the caller.
            unsafe { enter(&mut walker, Position { group: 0, instance: 0, top: 0 }, &mut bundle) };
            if bundle.kind.reversed {
                trial.count(walker.work);
            }
            let (known, put_off) = (walker.known, walker.put_off);
            for (lane, (number, search)) in run.zip(&mut searches).enumerate() {
                let ray = &batch.rays.rays()[number];
                if known >> lane & 1 == 1 {
                    let (t, b) = (sure.t[lane], [sure.b1[lane], sure.b2[lane]]);
                    let (geometry, primitive) = forest.trees[0].triangle_at(put_off[lane]);
                    let hit = G::Precision::found(t, b, [0, geometry, primitive]);
                    let is_quad = batch.context.options[geometry as usize].quads;
                    let hit = if is_quad { G::Precision::quad_hit(&hit) } else { hit };
                    let mut goal = start(ray);
                    if t > G::Precision::interval(ray)[0] && goal.wants(&hit) {
                        goal.take(hit);
                    }
                    finish(number, goal);
                    continue;
                }
                match search.take() {
                    Some(search) => finish(number, search.goal),
                    None => finish(number, start(ray)),
                }
            }
            continue;
        }
        match left.last_mut() {
            Some(last) if last.end == run.start => last.end = run.end,
            _ => left.push(run),
        }
    }
    left
}
