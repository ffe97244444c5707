//! What bundles leave to single rays: the parts of the tree that few rays of a bundle meet.
//!
//! There a bundle does more work than its rays would do alone. So it goes on without them, and they go there later, many rays at a
//! time, with the interleaved kernel (as hybrid packets do: Benthin, Wald, Woop, Ernst and Mark, Combining Single and Packet-Ray Tracing
//! for Arbitrary Ray Distributions on the Intel MIC Architecture, 2012, which walk them at once). What a ray finds does not depend on who
//! goes where, or when.

use super::super::interleave::{self, Batch, Work};
use super::super::node::ChildRef;
use super::bundle::RAYS;
use crate::accel::bvh::Forest;
use crate::precision::Single;
use crate::query::rays::{RayQuery, Rays};
use crate::query::search::Goal;
use snell_math::Ray;
use snell_math::simd::Level;

/// Children that a ray may be left.
pub(super) const MAX_CHILDREN: usize = 32;

/// So many rays are enough to interleave them.
const ENOUGH: usize = 1024;

/// The parts that are left, ray by ray.
pub(super) struct Rest<G> {
    /// What so many rays of a bundle meet, or fewer, is left to them.
    pub few: u32,
    /// Of the bundle on its way.
    counts: [usize; RAYS],
    children: [[ChildRef; MAX_CHILDREN]; RAYS],
    /// Of the bundles before.
    rays: Vec<Waiting<G>>,
    ways: Vec<ChildRef>,
}

/// A ray with children left to visit.
struct Waiting<G> {
    number: usize,
    /// What was found so far.
    goal: Option<G>,
    /// Where its children end in [`Rest::ways`].
    end: usize,
}

impl<G: Goal<Precision = Single>> Rest<G> {
    pub fn new(forest: &Forest) -> Self {
        let few = std::env::var("FEW").ok().and_then(|s| s.parse().ok()).unwrap_or(3);
        Self {
            few: if interleave::can_resume(forest, MAX_CHILDREN) { few } else { 0 },
            counts: [0; RAYS],
            children: [[ChildRef::NONE; MAX_CHILDREN]; RAYS],
            rays: Vec::new(),
            ways: Vec::new(),
        }
    }

    /// For the next bundle.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.counts = [0; RAYS];
    }

    /// Leaves a child to some rays of the bundle. Returns those that have no room for it.
    #[inline(always)]
    pub fn add(&mut self, mut mask: u32, child: ChildRef) -> u32 {
        let mut kept = 0;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & (RAYS - 1);
            mask &= mask - 1;
            let count = self.counts[lane];
            if count < MAX_CHILDREN {
                self.children[lane][count] = child;
                self.counts[lane] = count + 1;
            } else {
                kept |= 1 << lane;
            }
        }
        kept
    }

    /// True if something is left to this ray of the bundle.
    #[inline(always)]
    pub fn has_any(&self, lane: usize) -> bool {
        self.counts[lane] != 0
    }

    /// Keeps a ray of the bundle for later.
    #[inline(always)]
    pub fn put(&mut self, number: usize, lane: usize, goal: G) {
        self.ways.extend_from_slice(&self.children[lane][..self.counts[lane].min(MAX_CHILDREN)]);
        self.rays.push(Waiting { number, goal: Some(goal), end: self.ways.len() });
    }

    pub fn is_full(&self) -> bool {
        self.rays.len() >= ENOUGH
    }

    /// Searches for all rays that are kept.
    pub fn search(
        &mut self,
        forest: &Forest,
        level: Level,
        batch: &Batch<Single>,
        start: impl Fn(&Ray) -> G,
        mut finish: impl FnMut(usize, G),
    ) {
        if !self.rays.is_empty() {
            let numbers: Vec<usize> = self.rays.iter().map(|ray| ray.number).collect();
            let work = Resumed { batch: batch.rays, rays: &mut self.rays, ways: &self.ways, start };
            interleave::search_work(forest, level, batch.context, work, |i, goal| finish(numbers[i], goal));
            self.rays.clear();
            self.ways.clear();
        }
    }
}

/// Rays that go on where bundles have left them.
struct Resumed<'r, 'a, G, S> {
    batch: Rays<'a>,
    rays: &'r mut [Waiting<G>],
    ways: &'r [ChildRef],
    start: S,
}

impl<'a, G: Goal<Precision = Single>, S: Fn(&Ray) -> G> Work<'a, G> for Resumed<'_, 'a, G, S> {
    #[inline(always)]
    fn len(&self) -> usize {
        self.rays.len()
    }

    #[inline(always)]
    fn query(&self, number: usize) -> RayQuery<'a> {
        self.batch.get(self.rays[number].number)
    }

    #[inline(always)]
    fn goal(&mut self, number: usize) -> G {
        self.rays[number].goal.take().unwrap_or_else(|| (self.start)(self.query(number).ray))
    }

    #[inline(always)]
    fn children(&self, number: usize) -> &[ChildRef] {
        let first = if number == 0 { 0 } else { self.rays[number - 1].end };
        &self.ways[first..self.rays[number].end]
    }
}
