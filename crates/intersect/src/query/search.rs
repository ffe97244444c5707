//! One search in progress: the world's ray, what it may be asked to reject, and what it has found.

use super::HitFilter;
use super::rays::{RayQuery, clamped_time};
use crate::geometry::quads::quad_hit;
use crate::hit::Hit;
use crate::kernel::node::padded;
use crate::world::{GeometryOptions, TraversalCounters};
use snell_math::Ray;

/// What a query wants to know about a ray: the nearest hit, any hit, all hits.
pub(crate) trait Goal {
    /// True if hits bring the limit nearer while the search goes on.
    const NARROWS: bool;

    /// Hits at a greater `t` are of no interest.
    fn limit(&self) -> f32;

    /// True if this hit would be taken.
    fn wants(&self, hit: &Hit) -> bool;

    /// True if this hit was dealt with before: then later ones on the same thing may still count.
    #[inline(always)]
    fn is_past(&self, _hit: &Hit) -> bool {
        false
    }

    /// Takes a hit; true if the search is over.
    fn take(&mut self, hit: Hit) -> bool;

    /// Told of every node whose boxes are tested.
    #[inline(always)]
    fn count_node(&mut self) {}

    /// Told of every primitive tested.
    #[inline(always)]
    fn count_primitives(&mut self, _count: u32) {}

    /// Told of nodes and cells visited.
    #[inline(always)]
    fn count_visits(&mut self, _nodes: u32, _cells: u32) {}
}

/// What became of a hit that was offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Taken, and nothing more is needed.
    Finished,
    /// Taken; the search goes on.
    Taken,
    /// Behind what is known already.
    Behind,
    /// Passed through: a later hit on the same thing may count.
    Rejected,
}

/// What all searches of a batch share.
pub(crate) struct Context<'a> {
    /// Who may reject hits.
    pub filter: &'a dyn HitFilter,
    /// Per geometry: its mask, and whether the filter is asked.
    pub options: &'a [GeometryOptions],
}

/// A search over one ray.
pub(crate) struct Search<'a, G> {
    /// The ray in world space.
    pub ray: &'a Ray,
    /// What it may meet: [`RayQuery::mask`].
    pub mask: u32,
    /// When: from 0 to 1.
    pub time: f32,
    /// What is common to all.
    pub context: &'a Context<'a>,
    /// What is wanted, and found so far.
    pub goal: G,
}

impl<'a, G: Goal> Search<'a, G> {
    #[inline(always)]
    pub fn new(query: RayQuery<'a>, context: &'a Context<'a>, goal: G) -> Self {
        Self { ray: query.ray, mask: query.mask, time: clamped_time(query.time), context, goal }
    }

    /// The padded limit: boxes that start beyond it can be skipped. Equal distances are never beyond it, because the lower
    /// number wins there.
    #[inline(always)]
    pub fn cull(&self) -> f32 {
        padded(self.goal.limit())
    }

    /// Offers a hit. The filter is asked last, so a rejected hit leaves no trace.
    #[inline(always)]
    pub fn offer(&mut self, hit: Hit) -> Verdict {
        // The open interval holds after rounding too.
        if hit.t <= self.ray.t_min || self.goal.is_past(&hit) {
            return Verdict::Rejected;
        }
        let options = &self.context.options[hit.geometry as usize];
        let hit = if options.quads { quad_hit(&hit) } else { hit };
        if !self.goal.wants(&hit) {
            return Verdict::Behind;
        }
        if options.mask & self.mask == 0 || (options.filtered && !self.context.filter.accept(self.ray, &hit)) {
            return Verdict::Rejected;
        }
        if self.goal.take(hit) { Verdict::Finished } else { Verdict::Taken }
    }
}

/// The nearest hit; the lowest (instance, geometry, primitive) among equally near ones.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Closest {
    best: Hit,
    /// Not a `bool`: padding would make copies slow.
    found: u32,
}

impl Closest {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        // No ids are below zero, so only hits before `t_max` come before this.
        Self { best: Hit { t: ray.t_max, instance: 0, geometry: 0, primitive: 0, ..Hit::MISS }, found: 0 }
    }

    #[inline(always)]
    pub fn result(&self) -> Hit {
        if self.found != 0 { self.best } else { Hit::MISS }
    }
}

impl Goal for Closest {
    const NARROWS: bool = true;

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.best.t
    }

    #[inline(always)]
    fn wants(&self, hit: &Hit) -> bool {
        hit.is_before(&self.best)
    }

    #[inline(always)]
    fn take(&mut self, hit: Hit) -> bool {
        self.best = hit;
        self.found = 1;
        false
    }
}

/// Whether there is any hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Any {
    limit: f32,
    /// The answer.
    pub found: bool,
}

impl Any {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        Self { limit: ray.t_max, found: false }
    }
}

impl Goal for Any {
    const NARROWS: bool = false;

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }

    #[inline(always)]
    fn wants(&self, hit: &Hit) -> bool {
        hit.t < self.limit
    }

    #[inline(always)]
    fn take(&mut self, _: Hit) -> bool {
        self.found = true;
        true
    }
}

/// Every hit, in no order yet.
#[derive(Clone, Debug)]
pub(crate) struct All {
    limit: f32,
    /// The answer.
    pub hits: Vec<Hit>,
}

impl All {
    pub fn new(ray: &Ray) -> Self {
        Self { limit: ray.t_max, hits: Vec::new() }
    }
}

impl Goal for All {
    const NARROWS: bool = false;

    fn limit(&self) -> f32 {
        self.limit
    }

    fn wants(&self, hit: &Hit) -> bool {
        hit.t < self.limit
    }

    fn take(&mut self, hit: Hit) -> bool {
        self.hits.push(hit);
        false
    }
}

/// [`Closest`] that also counts its work.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counted {
    /// The hit.
    pub closest: Closest,
    /// The work.
    pub counters: TraversalCounters,
}

impl Counted {
    pub fn new(ray: &Ray) -> Self {
        Self { closest: Closest::new(ray), counters: TraversalCounters::default() }
    }
}

impl Goal for Counted {
    const NARROWS: bool = true;

    fn limit(&self) -> f32 {
        self.closest.limit()
    }

    fn wants(&self, hit: &Hit) -> bool {
        self.closest.wants(hit)
    }

    fn take(&mut self, hit: Hit) -> bool {
        self.closest.take(hit)
    }

    fn count_node(&mut self) {
        self.counters.nodes_visited = self.counters.nodes_visited.saturating_add(1);
    }

    fn count_primitives(&mut self, count: u32) {
        self.counters.primitives_tested = self.counters.primitives_tested.saturating_add(count);
    }

    fn count_visits(&mut self, nodes: u32, cells: u32) {
        self.counters.nodes_visited = self.counters.nodes_visited.saturating_add(nodes);
        self.counters.cells_stepped = self.counters.cells_stepped.saturating_add(cells);
    }
}
