//! A search: the ray in world space, the filters of hits, and the result so far.

pub(crate) mod answers;
mod counters;
mod filter;
pub(crate) mod points;
pub(crate) mod rays;
pub(crate) mod region;

pub use counters::{TraversalCounters, TraversalWork};
pub use filter::{AcceptAll, GeometryOptions, Grouping, HitFilter};

use crate::precision::{Facts, Precision, Real};
use crate::search::rays::{RayQuery, clamped_time};
use crate::search::region::Region;
use snell_math::DAffine3;
use std::sync::atomic::{AtomicBool, Ordering};

/// The type of rays in the precision of a goal; the types of hits, data and reals follow.
pub(crate) type RayOf<G> = <<G as Goal>::Precision as Precision>::Ray;
pub(crate) type HitOf<G> = <<G as Goal>::Precision as Precision>::Hit;
pub(crate) type DataOf<G> = <<G as Goal>::Precision as Facts>::Data;
pub(crate) type RealOf<G> = <<G as Goal>::Precision as Facts>::Real;

/// The goal of a query: the nearest hit, any hit, or all hits of a ray.
pub(crate) trait Goal {
    /// The precision of the world that is searched.
    type Precision: Facts;
    /// True if hits reduce the limit of the search.
    const NARROWS: bool;
    /// True if one hit suffices, and the way in which it is found does not matter.
    const WANTS_ONE: bool = false;
    /// True if any hit will do, so that [`Self::take`] ignores its data.
    const ANY: bool = false;
    /// True if the goal records regions and instances.
    const RECORDS: bool = false;

    /// The limit: hits at a greater `t` do not count.
    fn limit(&self) -> RealOf<Self>;

    /// True if this hit would be taken.
    fn wants(&self, hit: &HitOf<Self>) -> bool;

    /// True if this hit was reported before; later hits on the same primitive may still count.
    #[inline(always)]
    fn is_past(&self, _hit: &HitOf<Self>) -> bool {
        false
    }

    /// Takes a hit. Returns true if the search is over.
    fn take(&mut self, hit: HitOf<Self>) -> bool;

    /// Called for every node whose boxes are tested.
    #[inline(always)]
    fn count_node(&mut self) {}

    /// Called for every primitive that is tested.
    #[inline(always)]
    fn count_primitives(&mut self, _count: u32) {}

    /// Called with the number of nodes and cells visited.
    #[inline(always)]
    fn count_visits(&mut self, _nodes: u32, _cells: u32) {}

    /// Called for every instance that the search enters.
    #[inline(always)]
    fn count_instance(&mut self) {}

    /// Called for every region that the search enters, in the coordinates of the group.
    #[inline(always)]
    fn visit(&mut self, _is_leaf: bool, _region: impl FnOnce() -> Region) {}

    /// Called when the search enters an instance, with the map from outside to inside.
    #[inline(always)]
    fn enter(&mut self, _child_from_group: &DAffine3) {}

    /// True if the search should end without a result. Asked before every instance.
    #[inline(always)]
    fn gives_up(&self) -> bool {
        false
    }

    /// Called when the search leaves the instance entered last.
    #[inline(always)]
    fn leave(&mut self) {}
}

/// The outcome of a reported hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The hit was taken, and nothing more is needed.
    Finished,
    /// The hit was taken, and the search goes on.
    Taken,
    /// The hit is beyond the limit.
    Behind,
    /// The hit was rejected, but a later hit on the same primitive may count.
    Rejected,
}

/// The data that all searches of a batch share.
pub(crate) struct Context<'a, P: Facts> {
    /// The filter that may reject hits.
    pub filter: &'a dyn HitFilter<P>,
    /// For each geometry its mask, and whether hits on it are filtered.
    pub options: &'a [GeometryOptions],
    /// Data that only one precision needs, such as meshes in double precision.
    pub data: &'a P::Data,
    /// Ends all searches early when it is set.
    pub cancel: Option<&'a AtomicBool>,
}

impl<P: Facts> Context<'_, P> {
    /// True if the query was cancelled. Called at every instance, because a search through many may
    /// take long.
    #[inline(always)]
    pub fn is_cancelled(&self) -> bool {
        self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}

/// A search over one ray.
pub(crate) struct Search<'a, G: Goal> {
    /// The ray in world space.
    pub ray: &'a RayOf<G>,
    /// The start of the ray's interval, rounded down to `f32`.
    pub start: f32,
    /// The mask of the ray: [`RayQuery::mask`].
    pub mask: u64,
    /// The time of the ray, from 0 to 1.
    pub time: f32,
    /// The number of the ray in its batch, for kernels that trace many at once. It is here because
    /// four bytes are free.
    pub ray_number: u32,
    /// The shared data.
    pub context: &'a Context<'a, G::Precision>,
    /// The goal, with the result so far.
    pub goal: G,
}

impl<'a, G: Goal> Search<'a, G> {
    #[inline(always)]
    pub fn new(
        query: RayQuery<'a, G::Precision>,
        context: &'a Context<'a, G::Precision>,
        goal: G,
    ) -> Self {
        let start = G::Precision::interval(query.ray)[0].below();
        Self {
            ray: query.ray,
            start,
            mask: query.mask,
            time: clamped_time(query.time),
            ray_number: 0,
            context,
            goal,
        }
    }

    /// True if the search ends here, because the query was cancelled or the goal gives up.
    #[inline(always)]
    pub fn is_given_up(&self) -> bool {
        self.context.is_cancelled() || self.goal.gives_up()
    }

    /// The start of the ray's interval.
    #[inline(always)]
    pub fn t_min(&self) -> RealOf<G> {
        G::Precision::interval(self.ray)[0]
    }

    /// The padded limit: boxes that start beyond it can be skipped. A hit at a distance equal to
    /// the limit may still be taken, if its (instance, geometry, primitive) is lower than that of
    /// the nearest hit.
    #[inline(always)]
    pub fn cull(&self) -> f32 {
        padded(self.goal.limit().above())
    }

    /// Reports a hit. The filter is called last, so a rejected hit has no effect.
    #[inline(always)]
    pub fn offer(&mut self, hit: HitOf<G>) -> Verdict {
        // The interval is open, also after rounding.
        if G::Precision::t(&hit) <= self.t_min() || self.goal.is_past(&hit) {
            return Verdict::Rejected;
        }
        let options = &self.context.options[G::Precision::ids(&hit)[1] as usize];
        let hit = if options.quads { G::Precision::quad_hit(&{ hit }) } else { hit };
        if !self.goal.wants(&hit) {
            return Verdict::Behind;
        }
        if options.mask & self.mask == 0
            || (options.filtered && !self.context.filter.accept_at(self.ray, self.time, &{ hit }))
        {
            return Verdict::Rejected;
        }
        if self.goal.take(hit) { Verdict::Finished } else { Verdict::Taken }
    }
}

/// The goal of finding the nearest hit. Among equally near hits, the hit with the lowest (instance,
/// geometry, primitive) counts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Closest<P: Facts> {
    /// The nearest hit so far; a miss as long as nothing is found.
    best: P::Hit,
    /// Distance of the nearest hit so far, or the end of the ray's interval.
    limit: P::Real,
}

impl<P: Facts> Closest<P> {
    #[inline(always)]
    pub fn new(ray: &P::Ray) -> Self {
        Self { best: P::MISS, limit: P::interval(ray)[1] }
    }

    #[inline(always)]
    pub fn result(&self) -> P::Hit {
        self.best
    }
}

impl<P: Facts> Goal for Closest<P> {
    type Precision = P;
    const NARROWS: bool = true;
    const WANTS_ONE: bool = true;

    #[inline(always)]
    fn limit(&self) -> P::Real {
        self.limit
    }

    #[inline(always)]
    fn wants(&self, hit: &P::Hit) -> bool {
        // A hit at infinity is not before a miss, so misses are recognised by their ids.
        let is_found = || P::ids(&self.best) != P::ids(&P::MISS);
        P::t(hit) < self.limit
            || (P::t(hit) == self.limit && is_found() && P::is_before(hit, &self.best))
    }

    #[inline(always)]
    fn take(&mut self, hit: P::Hit) -> bool {
        self.limit = P::t(&hit);
        self.best = hit;
        false
    }
}

/// The goal of finding out whether there is any hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Any<P: Facts> {
    limit: P::Real,
    /// True if a hit was found.
    pub found: bool,
}

impl<P: Facts> Any<P> {
    #[inline(always)]
    pub fn new(ray: &P::Ray) -> Self {
        Self { limit: P::interval(ray)[1], found: false }
    }
}

impl<P: Facts> Goal for Any<P> {
    type Precision = P;
    const NARROWS: bool = false;
    const ANY: bool = true;
    const WANTS_ONE: bool = true;

    #[inline(always)]
    fn limit(&self) -> P::Real {
        self.limit
    }

    #[inline(always)]
    fn wants(&self, hit: &P::Hit) -> bool {
        P::t(hit) < self.limit
    }

    #[inline(always)]
    fn take(&mut self, _: P::Hit) -> bool {
        self.found = true;
        true
    }
}

/// The goal of collecting every hit, unsorted.
#[derive(Clone, Debug)]
pub(crate) struct All<P: Facts> {
    limit: P::Real,
    /// The hits found so far.
    pub hits: Vec<P::Hit>,
}

impl<P: Facts> All<P> {
    pub fn new(ray: &P::Ray) -> Self {
        Self { limit: P::interval(ray)[1], hits: Vec::new() }
    }
}

impl<P: Facts> Goal for All<P> {
    type Precision = P;
    const NARROWS: bool = false;

    fn limit(&self) -> P::Real {
        self.limit
    }

    fn wants(&self, hit: &P::Hit) -> bool {
        P::t(hit) < self.limit
    }

    fn take(&mut self, hit: P::Hit) -> bool {
        self.hits.push(hit);
        false
    }
}

/// A goal that also counts the steps of the traversal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counted<G> {
    /// The goal whose traversal is counted.
    pub goal: G,
    /// The counters so far.
    pub counters: TraversalCounters,
    /// The search is given up at the next instance once so many were entered.
    pub most_instances: u32,
}

impl<G> Counted<G> {
    pub fn new(goal: G) -> Self {
        Self { goal, counters: TraversalCounters::default(), most_instances: u32::MAX }
    }
}

impl<G: Goal> Goal for Counted<G> {
    type Precision = G::Precision;
    const NARROWS: bool = G::NARROWS;

    fn limit(&self) -> RealOf<G> {
        self.goal.limit()
    }

    fn wants(&self, hit: &HitOf<G>) -> bool {
        self.goal.wants(hit)
    }

    fn is_past(&self, hit: &HitOf<G>) -> bool {
        self.goal.is_past(hit)
    }

    fn take(&mut self, hit: HitOf<G>) -> bool {
        self.goal.take(hit)
    }

    fn count_node(&mut self) {
        self.counters.nodes_visited = self.counters.nodes_visited.saturating_add(1);
    }

    fn count_primitives(&mut self, count: u32) {
        self.counters.primitives_tested = self.counters.primitives_tested.saturating_add(count);
    }

    #[inline(always)]
    fn count_instance(&mut self) {
        self.counters.instances_entered = self.counters.instances_entered.saturating_add(1);
    }

    #[inline(always)]
    fn gives_up(&self) -> bool {
        self.counters.instances_entered >= self.most_instances
    }

    fn count_visits(&mut self, nodes: u32, cells: u32) {
        self.counters.nodes_visited = self.counters.nodes_visited.saturating_add(nodes);
        self.counters.cells_stepped = self.counters.cells_stepped.saturating_add(cells);
    }
}

/// Relative padding of the culling distance. After a spatial split, a hit may lie outside of the
/// box of its piece of a triangle, along the ray, by up to
/// [`crate::exact::triangle::PLACE_TOLERANCE`]; this padding is larger.
pub(crate) const CULL_PADDING: f32 = 1.0e-4;

/// An upper bound on distances, padded by [`CULL_PADDING`].
#[inline(always)]
pub(crate) fn padded(t: f32) -> f32 {
    t + t.abs() * CULL_PADDING
}
