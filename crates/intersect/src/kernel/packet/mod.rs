//! Coherent rays sixteen at a time: one test of eight boxes serves a whole bundle of rays.
//!
//! A run of sixteen rays of the batch becomes a [`Bundle`] if it is one: rays from one point, or
//! towards one point, or otherwise close together. Up to four that follow each other walk together
//! if they are [alike](Bundle::is_like): a node is loaded and put in order once for all of them, a
//! block of triangles is seen once, and their tests do not wait for each other. Each goes where it
//! would go alone, in the same order. Runs that are no bundles are left to the caller. Every pair
//! of ray and triangle that is not surely a miss goes to the same exact test as everywhere else, so
//! that neighbours do not change results.

pub(crate) mod bundle;
pub(crate) mod doubles;
mod drawing;
pub(crate) mod exact;
pub(crate) mod exact_rays;
mod facing;
mod leaf;
mod lines;
mod objects;
mod planes;
mod precision;
pub(crate) mod runs;
pub(crate) mod sure;
#[cfg(test)]
mod tests;
mod trial;
mod triangles;
mod walk;

use super::stream::interleave::Batch;
use crate::kernel::Goal;
use crate::precision::Facts;
use crate::prefetch::fetch;
use crate::search::answers::Answers;
use crate::search::{RayOf, Search};
use crate::tree::node::ChildRef;
use crate::tree::{Forest, GroupTree};
use bundle::RAYS;
use exact::Found;
pub(crate) use precision::PacketTests;
#[cfg(target_arch = "x86_64")]
use snell_math::simd::{Avx8, Avx16, Pair, Token};
use snell_math::simd::{Lanes8, Lanes16, Portable, Portable8, Wide};
use std::mem::MaybeUninit;
use std::ops::Range;
use sure::Sure;
use trial::{Detail, Trial};
use walk::{Luggage, Position, ROWS, Stacks, Walker, enter, first};

/// Fewer rays are not worth a bundle.
const MIN_RAYS: usize = 6;

/// True if the forest can be searched with bundles at all.
pub(crate) fn is_suitable(forest: &Forest) -> bool {
    fits::<Portable8>(Portable, &forest.trees[0])
}

/// True if bundles can walk this tree.
#[inline(always)]
fn fits<L: Lanes8>(token: L::Token, tree: &GroupTree) -> bool {
    // A child is remembered as its place: eight to a node.
    tree.root != ChildRef::NONE
        && tree.root.is_node()
        && tree.nodes.len() < 1 << 29
        && bundle::is_in_range::<L>(token, &tree.nodes[tree.root.index()])
}

/// Searches for the rays of the batch run by run; `answers` get the number of a ray and what was
/// found. Returns the ranges of rays that were left out.
pub(crate) fn search_runs<G: Goal>(
    forest: &Forest,
    wide: Option<Wide>,
    batch: &Batch<G::Precision>,
    start: impl Fn(&RayOf<G>) -> G,
    answers: impl Answers<G>,
) -> Vec<Range<usize>> {
    debug_assert!(is_suitable(forest));
    let mut stacks = Stacks {
        distances: vec![0.0; forest.stack_size()],
        places: vec![0; forest.stack_size()],
        meetings: vec![0; forest.stack_size()],
        single: vec![MaybeUninit::uninit(); forest.stack_size()],
        spare: Vec::new(),
        work: 0,
    };
    match wide {
        #[cfg(target_arch = "x86_64")]
        Some(Wide::Avx512(token)) => token.run(
            #[inline(always)]
            move || run::<Avx16, G>(token, forest, batch, &mut stacks, start, answers),
        ),
        #[cfg(target_arch = "x86_64")]
        Some(Wide::Avx2(token)) => token.run(
            #[inline(always)]
            move || run::<Pair<Avx8>, G>(token, forest, batch, &mut stacks, start, answers),
        ),
        // Without wide registers, rays are as fast one by one.
        _ => std::iter::once(0..batch.rays.len()).collect(),
    }
}

#[inline(always)]
fn run<'s, W: Lanes16, G: Goal>(
    token: W::Token,
    forest: &Forest,
    batch: &Batch<'s, G::Precision>,
    stacks: &mut Stacks,
    start: impl Fn(&RayOf<G>) -> G,
    mut answers: impl Answers<G>,
) -> Vec<Range<usize>> {
    let mut left: Vec<Range<usize>> = Vec::new();
    let all = batch.rays.rays();
    let begin = |number: usize, search: &mut Option<Search<'s, G>>| {
        let query = batch.rays.get(number.min(all.len() - 1));
        *search = Some(Search::new(query, batch.context, start(query.ray)));
    };
    let new = || Walker {
        forest,
        data: batch.context.data,
        options: batch.context.options,
        cancel: batch.context.cancel,
        masks: 0,
        rays: &[],
        first: 0,
        searches: [const { None }; RAYS],
        begun: 0,
        met: 0,
        nearest: [G::Precision::MISS; RAYS],
        begin: &begin,
        found: Found::NONE,
        alive: 0,
        waiting: 0,
        put_off: [0; RAYS],
        put_off_ids: [0; RAYS],
        drawn: 0,
        given_up: 0,
        known: 0,
        sure: Sure::NONE,
        is_small: false,
        counted: [0; 2],
    };
    let (mut walkers, mut luggage) = ([new(), new(), new(), new()], Luggage::new());
    let (mut trial, mut detail) = (Trial::default(), Detail::default());
    let mut next = 0;
    while next < all.len() && !batch.context.is_cancelled() {
        // Runs that are bundles.
        let (mut count, mut members) = (0, 0);
        let (chunk, backward) = (next, G::ANY && trial.is_backward());
        while count < ROWS && next < all.len() {
            let run = next..(next + RAYS).min(all.len());
            next = run.end;
            let rays = &all[run.clone()];
            fetch_ahead(&all[next..], run.clone(), &answers);
            let anchor = runs::anchor::<G::Precision>(&all[chunk], rays);
            if G::Precision::set_up_bundle::<W>(
                token,
                batch.context.data,
                &mut luggage.bundles[count],
                rays,
                anchor,
                backward,
            ) {
                walkers[count].set_off(rays, run.start, batch.rays.common_mask(run.clone()));
                members |= 1 << (8 * count);
                count += 1;
                continue;
            }
            match left.last_mut() {
                Some(last) if last.end == run.start => last.end = run.end,
                _ => left.push(run),
            }
        }
        let mut rest = members;
        while rest != 0 {
            let alike = luggage.alike(rest);
            rest &= !alike;
            let mut rows = luggage.rows(walkers.each_mut());
            stacks.work = 0;
            let is_small = detail.is_small::<G>();
            for row in &mut rows {
                row.memory.clear();
                (row.walker.is_small, row.walker.counted) = (is_small, [0; 2]);
            }
            enter::<W, G>(
                token,
                &mut rows,
                alike,
                stacks,
                Position { group: 0, instance: 0, top: 0 },
            );
            detail.count(
                rows.iter()
                    .map(|row| row.walker.counted)
                    .fold([0; 2], |[a, b], [c, d]| [a + c, b + d]),
            );
            if luggage.bundles[first(alike)].kind.reversed {
                trial.count(stacks.work);
            }
        }
        for walker in &mut walkers[..count] {
            walker.answer(&start, &mut answers);
            let mut rest = walker.given_up;
            while rest != 0 {
                let number = walker.first + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                left.push(number..number + 1);
            }
        }
    }
    left
}

/// Asks for the memory of the answers of a run, and for that of rays that come after it.
#[inline(always)]
fn fetch_ahead<G: Goal>(next: &[RayOf<G>], run: Range<usize>, answers: &impl Answers<G>) {
    let mut at = 0;
    while at < RAYS {
        answers.fetch((run.start + at).min(run.end - 1));
        fetch(next.as_ptr().wrapping_add((ROWS - 1) * RAYS + at));
        at += 2;
    }
}

impl<'w, G: Goal> Walker<'w, '_, G> {
    /// Prepares it for a run, whose first ray has this number.
    #[inline(always)]
    fn set_off(&mut self, rays: &'w [RayOf<G>], first: usize, masks: u32) {
        (self.rays, self.first, self.masks) = (rays, first, masks);
        self.alive = u32::MAX >> (32 - rays.len());
        (self.waiting, self.known, self.met, self.given_up) = (0, 0, 0, 0);
    }

    /// Gives the answers of all rays that were not given up.
    #[inline(always)]
    fn answer(&mut self, start: &impl Fn(&RayOf<G>) -> G, answers: &mut impl Answers<G>) {
        let begun = std::mem::take(&mut self.begun);
        let special = begun | self.known | self.met | self.given_up;
        for (lane, ray) in self.rays.iter().enumerate() {
            let (number, is_in) = (self.first + lane, |rays: u32| rays >> lane & 1 == 1);
            if !is_in(special) {
                answers.put(number, start(ray));
            } else if is_in(self.given_up) {
                // Others answer.
            } else if is_in(self.known) {
                let (t, b) = (self.sure.t[lane], [self.sure.b1[lane], self.sure.b2[lane]]);
                let (geometry, primitive) = self.forest.trees[0].triangle(self.put_off_ids[lane]);
                let hit = G::Precision::found(t, b, [0, geometry, primitive]);
                let is_quad = self.options[geometry as usize].quads;
                let hit = if is_quad { G::Precision::quad_hit(&hit) } else { hit };
                let mut goal = start(ray);
                if t > G::Precision::interval(ray)[0] && goal.wants(&hit) {
                    goal.take(hit);
                }
                answers.put(number, goal);
            } else if is_in(self.met) {
                let mut goal = start(ray);
                goal.take(self.nearest[lane]);
                answers.put(number, goal);
            } else if let Some(search) = self.searches[lane].take() {
                answers.put(number, search.goal);
            }
        }
    }
}
