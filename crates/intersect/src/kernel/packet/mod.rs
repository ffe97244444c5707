//! Coherent rays traced sixteen at a time: one test of eight boxes serves a whole packet of rays.
//!
//! A run of sixteen rays of the batch becomes a [`Packet`] if the rays leave one point, go towards
//! one point, or are otherwise close together. Up to four consecutive packets are traversed
//! together if they are [coherent](Packet::is_coherent_with): a node is loaded and its children are
//! ordered once for all of them, the data of a block of triangles are computed once, and their
//! tests do not wait for each other. Each packet visits the nodes that it would visit alone, in the
//! same order. Runs that do not make packets are left to the caller. Every pair of ray and triangle
//! that is not certainly a miss gets the exact test of all other kernels, so neighbouring rays do
//! not change results.

pub(crate) mod certain;
pub(crate) mod doubles;
mod edges;
pub(crate) mod exact;
pub(crate) mod exact_rays;
pub(crate) mod frustum;
mod leaf;
mod objects;
mod planes;
mod precision;
mod projection;
mod rays;
pub(crate) mod runs;
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
use certain::CertainHits;
use exact::Found;
use frustum::RAYS;
pub(crate) use precision::PacketTests;
#[cfg(target_arch = "x86_64")]
use snell_math::simd::Avx16;
use snell_math::simd::{Lanes8, Lanes16, Pair, Portable, Portable8, Token, Wide, Wide8, WideToken};
use std::mem::MaybeUninit;
use std::ops::Range;
use trial::{Detail, Trial};
use walk::{Cursor, Deferred, MAX_PACKETS, PacketGroup, Stacks, Walker, enter, first};

/// The smallest number of rays that is worth a packet.
const MIN_RAYS: usize = 6;

/// True if the forest can be searched with packets at all.
pub(crate) fn is_suitable(forest: &Forest) -> bool {
    fits::<Portable8>(Portable, &forest.trees[0])
}

/// True if packets can traverse this tree.
#[inline(always)]
fn fits<L: Lanes8>(token: L::Token, tree: &GroupTree) -> bool {
    // The place of a child, eight times the number of its node plus the slot, must fit 32 bits.
    tree.root != ChildRef::NONE
        && tree.root.is_node()
        && tree.nodes.len() < 1 << 29
        && frustum::is_in_range::<L>(token, &tree.nodes[tree.root.index()])
}

/// Searches for the rays of the batch run by run; `answers` receives the number of each ray and its
/// goal. Returns the ranges of rays that were left out.
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
        hit_masks: vec![0; forest.stack_size()],
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
        Some(wide) => {
            let token = WideToken::from(wide);
            token.run(
                #[inline(always)]
                move || run::<Pair<Wide8>, G>(token, forest, batch, &mut stacks, start, answers),
            )
        }
        // Without wide registers, single rays are as fast.
        None => std::iter::once(0..batch.rays.len()).collect(),
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
        searched: 0,
        hit: 0,
        nearest: [G::Precision::MISS; RAYS],
        begin: &begin,
        found: Found::NONE,
        alive: 0,
        deferred: Deferred::NONE,
        unresolved: 0,
        certain: 0,
        certain_hits: CertainHits::NONE,
        is_small: false,
        counted: [0; 2],
    };
    let (mut walkers, mut packet_group) = ([new(), new(), new(), new()], PacketGroup::new());
    let (mut trial, mut detail) = (Trial::default(), Detail::default());
    let mut next = 0;
    while next < all.len() && !batch.context.is_cancelled() {
        // Collects runs that make packets.
        let (mut count, mut members) = (0, 0);
        let (chunk, backward) = (next, G::ANY && trial.is_backward());
        while count < MAX_PACKETS && next < all.len() {
            let run = next..(next + RAYS).min(all.len());
            next = run.end;
            let rays = &all[run.clone()];
            fetch_ahead(&all[next..], run.clone(), &answers);
            let anchor = runs::anchor::<G::Precision>(&all[chunk], rays);
            if G::Precision::set_up_packet::<W>(
                token,
                batch.context.data,
                &mut packet_group.packets[count],
                rays,
                anchor,
                backward,
            ) {
                walkers[count].start_run(rays, run.start, batch.rays.common_mask(run.clone()));
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
            let coherent = packet_group.coherent(rest);
            rest &= !coherent;
            let mut states = packet_group.states(walkers.each_mut());
            stacks.work = 0;
            let is_small = detail.is_small::<G>();
            for state in &mut states {
                state.scratch.clear();
                (state.walker.is_small, state.walker.counted) = (is_small, [0; 2]);
            }
            enter::<W, G>(
                token,
                &mut states,
                coherent,
                stacks,
                Cursor { group: 0, instance: 0, top: 0 },
            );
            detail.count(
                states
                    .iter()
                    .map(|state| state.walker.counted)
                    .fold([0; 2], |[a, b], [c, d]| [a + c, b + d]),
            );
            if packet_group.packets[first(coherent)].kind.reversed {
                trial.count(stacks.work);
            }
        }
        for walker in &mut walkers[..count] {
            walker.answer(&start, &mut answers);
            let mut rest = walker.unresolved;
            while rest != 0 {
                let number = walker.first + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                left.push(number..number + 1);
            }
        }
    }
    left
}

/// Prefetches the memory for the answers of a run, and the rays that come after it.
#[inline(always)]
fn fetch_ahead<G: Goal>(next: &[RayOf<G>], run: Range<usize>, answers: &impl Answers<G>) {
    let mut at = 0;
    while at < RAYS {
        answers.fetch((run.start + at).min(run.end - 1));
        fetch(next.as_ptr().wrapping_add((MAX_PACKETS - 1) * RAYS + at));
        at += 2;
    }
}

impl<'w, G: Goal> Walker<'w, '_, G> {
    /// Prepares the walker for a run; `first` is the number of its first ray.
    #[inline(always)]
    fn start_run(&mut self, rays: &'w [RayOf<G>], first: usize, masks: u64) {
        (self.rays, self.first, self.masks) = (rays, first, masks);
        self.alive = u32::MAX >> (32 - rays.len());
        (self.deferred.rays, self.certain, self.hit, self.unresolved) = (0, 0, 0, 0);
    }

    /// Writes the answers of all rays except the unresolved ones.
    #[inline(always)]
    fn answer(&mut self, start: &impl Fn(&RayOf<G>) -> G, answers: &mut impl Answers<G>) {
        let searched = std::mem::take(&mut self.searched);
        let special = searched | self.certain | self.hit | self.unresolved;
        for (lane, ray) in self.rays.iter().enumerate() {
            let (number, is_in) = (self.first + lane, |rays: u32| rays >> lane & 1 == 1);
            if !is_in(special) {
                answers.put(number, start(ray));
            } else if is_in(self.unresolved) {
                // Unresolved rays are answered by another kernel.
            } else if is_in(self.certain) {
                let (t, b) = (
                    self.certain_hits.t[lane],
                    [self.certain_hits.b1[lane], self.certain_hits.b2[lane]],
                );
                let (geometry, primitive) = self.forest.trees[0].triangle(self.deferred.ids[lane]);
                let hit = G::Precision::found(t, b, [0, geometry, primitive]);
                let is_quad = self.options[geometry as usize].quads;
                let hit = if is_quad { G::Precision::quad_hit(&hit) } else { hit };
                let mut goal = start(ray);
                if t > G::Precision::interval(ray)[0] && goal.wants(&hit) {
                    goal.take(hit);
                }
                answers.put(number, goal);
            } else if is_in(self.hit) {
                let mut goal = start(ray);
                goal.take(self.nearest[lane]);
                answers.put(number, goal);
            } else if let Some(search) = self.searches[lane].take() {
                answers.put(number, search.goal);
            }
        }
    }
}
