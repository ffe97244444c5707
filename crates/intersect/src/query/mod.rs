//! Ray queries over batches: the main way to ask a [`World`]. Results depend only on each ray, never on its neighbours.

pub(crate) mod answers;
pub mod crossings;
mod double;
pub mod journey;
pub mod nearest;
mod order;
pub mod parallel;
pub mod queries;
pub mod rays;
pub(crate) mod search;
pub mod winding;

use crate::accel::brute_force::search_all;
use crate::hit::Hit;
use crate::kernel::traverse::search_forest;
use crate::kernel::{interleave, packet};
use crate::precision::{Precision, Rules, Single};
use crate::world::{Structure, TraversalCounters, TraversalWork, World};
use answers::{Answers, Part, Slice};
use rays::{RayQuery, Rays};
use search::{Any, Closest, Context, Counted, Goal, RayOf, Search};

/// Which rays of a batch belong together. The kernel follows from this and from the kind of query, never from what happens to
/// share a batch, so a ray's result never depends on its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grouping {
    /// Unrelated rays.
    #[default]
    None,
    /// Rays that are much like their neighbours: each run of 16, counted from the start of the batch (the last may be shorter),
    /// leaves one point or goes to one point, in similar directions. Such are the samples of a pixel or of 4x4 pixels seen by a
    /// pinhole, and the shadow rays from them to a point light. Where it is not so, such runs are traced like unrelated rays.
    Coherent,
}

/// Decides about hits on geometries marked by [`crate::WorldBuilder::set_filtered`] (cut-out and blended surfaces). Must be a pure
/// function of its arguments.
pub trait HitFilter<P: Precision = Single>: Sync {
    /// False if the ray passes through at this hit. `ray` is in world space; its `t_max` is unspecified.
    fn accept(&self, ray: &P::Ray, hit: &P::Hit) -> bool;

    /// The same for a ray with a time from 0 to 1. For those to whom the time means nothing, as [`Self::accept`].
    fn accept_at(&self, ray: &P::Ray, time: f32, hit: &P::Hit) -> bool {
        let _ = time;
        self.accept(ray, hit)
    }
}

/// The filter that keeps every hit.
#[derive(Clone, Copy, Debug)]
pub struct AcceptAll;

impl<P: Precision> HitFilter<P> for AcceptAll {
    fn accept(&self, _: &P::Ray, _: &P::Hit) -> bool {
        true
    }
}

impl World {
    /// The nearest hit of each ray, [`Hit::MISS`] where there is none or the ray is invalid ([`snell_math::Ray::is_valid`]).
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest<'a>(&self, rays: impl Into<Rays<'a>>, grouping: Grouping, filter: &dyn HitFilter, hits: &mut [Hit]) {
        let rays = rays.into();
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        self.searcher(filter).search_into(rays, grouping, Closest::new, Slice(hits));
    }

    /// For each ray, whether anything lies in its interval. Invalid rays are not occluded.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded<'a>(
        &self,
        rays: impl Into<Rays<'a>>,
        grouping: Grouping,
        filter: &dyn HitFilter,
        blocked: &mut [bool],
    ) {
        let rays = rays.into();
        assert_eq!(rays.len(), blocked.len(), "one answer per ray");
        self.searcher(filter).search_into(rays, grouping, Any::new, Slice(blocked));
    }

    /// The nearest hit of one ray.
    pub fn closest_one<'a>(&self, ray: impl Into<RayQuery<'a>>, filter: &dyn HitFilter) -> Hit {
        self.searcher(filter).search(ray.into(), Closest::new).result()
    }

    /// True if anything lies in the interval of one ray.
    pub fn occluded_one<'a>(&self, ray: impl Into<RayQuery<'a>>, filter: &dyn HitFilter) -> bool {
        self.searcher(filter).search(ray.into(), Any::new).found
    }

    /// The nearest hit of one ray, and what it cost to find.
    pub fn closest_counted<'a>(
        &self,
        ray: impl Into<RayQuery<'a>>,
        filter: &dyn HitFilter,
    ) -> (Hit, TraversalCounters) {
        let counted = self.searcher(filter).search(ray.into(), |ray| Counted::new(Closest::new(ray)));
        (counted.goal.result(), counted.counters)
    }

    /// The nearest hit of each ray, and what all of them together cost to find.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest_work<'a>(
        &self,
        rays: impl Into<Rays<'a>>,
        filter: &dyn HitFilter,
        hits: &mut [Hit],
    ) -> TraversalWork {
        let rays = rays.into();
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        let mut work = TraversalWork::default();
        let start = |ray: &_| Counted::new(Closest::new(ray));
        self.searcher(filter).search_all(rays, Grouping::None, start, |i, counted| {
            hits[i] = counted.goal.result();
            work.add(&counted.counters);
        });
        work
    }

    /// For each ray, whether anything lies in its interval, and what all of them together cost to find out.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_work<'a>(
        &self,
        rays: impl Into<Rays<'a>>,
        filter: &dyn HitFilter,
        blocked: &mut [bool],
    ) -> TraversalWork {
        let rays = rays.into();
        assert_eq!(rays.len(), blocked.len(), "one answer per ray");
        let mut work = TraversalWork::default();
        let start = |ray: &_| Counted::new(Any::new(ray));
        self.searcher(filter).search_all(rays, Grouping::None, start, |i, counted| {
            blocked[i] = counted.goal.found;
            work.add(&counted.counters);
        });
        work
    }

    pub(crate) fn searcher<'a>(&'a self, filter: &'a dyn HitFilter) -> Searcher<'a, Single> {
        let context = Context { filter, options: &self.options, data: &() };
        Searcher { world: self, context }
    }
}

/// Where and how to search, whatever the goal.
pub(crate) struct Searcher<'a, P: Rules> {
    /// Its structure, and which of its geometries are meshes; not what these hold.
    pub world: &'a World,
    pub context: Context<'a, P>,
}

impl<P: Rules> Searcher<'_, P> {
    /// Searches for all rays of a batch; `finish` gets the number of a ray and what was found, in no particular order.
    pub fn search_all<G: Goal<Precision = P>>(
        &self,
        rays: Rays<P>,
        grouping: Grouping,
        start: impl Fn(&RayOf<G>) -> G,
        finish: impl FnMut(usize, G),
    ) {
        self.search_into(rays, grouping, start, finish);
    }

    /// Searches for all rays of a batch, each for itself, with the kernels that suit the structure and the grouping.
    pub fn search_into<G: Goal<Precision = P>>(
        &self,
        rays: Rays<P>,
        grouping: Grouping,
        start: impl Fn(&RayOf<G>) -> G,
        mut answers: impl Answers<G>,
    ) {
        let mut done = 0;
        if let Structure::Bvh(forest) = &self.world.structure {
            let batch = interleave::Batch { rays, context: &self.context, order: &[] };
            done = P::search_list(forest, self.world.simd, &batch, &start, |i, goal| answers.put(i, goal));
        }
        if done < rays.len() {
            let rest = Part { first: done, answers: &mut answers };
            self.search_tree(rays.slice(done..rays.len()), grouping, start, rest);
        }
    }

    /// [`Self::search_into`] by the structure.
    fn search_tree<G: Goal<Precision = P>>(
        &self,
        rays: Rays<P>,
        grouping: Grouping,
        start: impl Fn(&RayOf<G>) -> G,
        mut answers: impl Answers<G>,
    ) {
        match &self.world.structure {
            Structure::Bvh(forest) if grouping == Grouping::Coherent && packet::is_suitable(forest) => {
                let batch = interleave::Batch { rays, context: &self.context, order: &[] };
                let all = Part { first: 0, answers: &mut answers };
                for left in packet::search_runs(forest, self.world.simd, &batch, &start, all) {
                    let part = Part { first: left.start, answers: &mut answers };
                    self.search_unrelated(rays.slice(left), &start, part);
                }
            }
            _ => self.search_unrelated(rays, &start, answers),
        }
    }

    fn search_unrelated<G: Goal<Precision = P>>(
        &self,
        rays: Rays<P>,
        start: impl Fn(&RayOf<G>) -> G,
        mut answers: impl Answers<G>,
    ) {
        match &self.world.structure {
            Structure::Bvh(forest) if interleave::is_suitable(forest, rays.len()) => {
                let mut sorter = order::Sorter::new(rays.len(), interleave::is_large(forest));
                for part in sorter.parts() {
                    let own = Part { first: part.start, answers: &mut answers };
                    let rays = rays.slice(part);
                    let batch = interleave::Batch { rays, context: &self.context, order: sorter.order(rays) };
                    interleave::search_batch(forest, self.world.simd, &batch, &start, own);
                }
            }
            Structure::Walked(structures) => {
                let mut scratch = structures.scratch();
                for i in 0..rays.len() {
                    let query = rays.get(i);
                    let mut search = Search::new(query, &self.context, start(query.ray));
                    if P::is_valid(query.ray) {
                        structures.search(&mut search, &mut scratch);
                    }
                    answers.put(i, search.goal);
                }
                scratch.keep();
            }
            _ => (0..rays.len()).for_each(|i| answers.put(i, self.search(rays.get(i), &start))),
        }
    }

    /// Searches for one ray.
    #[inline(always)]
    pub fn search<G: Goal<Precision = P>>(&self, query: RayQuery<P>, start: impl Fn(&RayOf<G>) -> G) -> G {
        let mut search = Search::new(query, &self.context, start(query.ray));
        match &self.world.structure {
            Structure::Bvh(forest) => search_forest(forest, self.world.simd, &mut search),
            other => search_other(other, &mut search),
        }
        search.goal
    }
}

/// Searches a structure that is not the fast one. Rays that are not valid find nothing.
#[inline(never)]
fn search_other<G: Goal>(structure: &Structure, search: &mut Search<'_, G>) {
    if !G::Precision::is_valid(search.ray) {
        return;
    }
    match structure {
        Structure::Bvh(_) => {}
        Structure::None(groups) => {
            search_all(groups, 0, &G::Precision::exact(search.ray), 0, search);
        }
        Structure::Walked(structures) => {
            let mut scratch = structures.scratch();
            structures.search(search, &mut scratch);
            scratch.keep();
        }
    }
}
