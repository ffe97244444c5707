//! The searches that the queries of a world call.

use super::all::AllHits;
use super::order;
use crate::hit::Hit;
use crate::kernel::single::traverse::search_forest;
use crate::kernel::stream::interleave;
use crate::kernel::{Goal, Kernels, packet};
use crate::lecture::brute_force::search_all;
use crate::precision::{Double, Facts, Precision, Single};
use crate::search::answers::{Answers, Part, Slice};
use crate::search::rays::{RayQuery, Rays};
use crate::search::{
    Any, Closest, Context, Counted, Grouping, RayOf, Search, TraversalCounters, TraversalWork,
};
use crate::tree::Forest;
use crate::world::{Structure, World};
use std::sync::atomic::AtomicBool;

type HitOf<P> = <P as Precision>::Hit;

/// The number of unsorted rays that are tested against outliers before the remaining ones traverse
/// the tree. Their data fit the caches.
const RAYS_AT_ONCE: usize = 1 << 12;

/// Everything that a search needs independently of its goal.
pub(crate) struct Searcher<'a, P: Facts = Single> {
    /// The world whose structure is searched. In double precision its meshes are empty stand-ins.
    pub world: &'a World,
    pub context: Context<'a, P>,
}

macro_rules! searches {
    ($($precision:ident)+) => {$(
        /// The searches for all queries of worlds. Generic code is compiled where it is called, and
        /// the kernels are large; so the generic methods of worlds call these methods, which are
        /// compiled once, here.
        impl Searcher<'_, $precision> {
            pub fn closest(
                &self,
                rays: Rays<$precision>,
                grouping: Grouping,
                hits: &mut [HitOf<$precision>],
            ) {
                assert_eq!(rays.len(), hits.len(), "one hit per ray");
                self.search_into(rays, grouping, Closest::new, Slice(hits));
            }

            pub fn occluded(
                &self,
                rays: Rays<$precision>,
                grouping: Grouping,
                blocked: &mut [bool],
            ) {
                assert_eq!(rays.len(), blocked.len(), "one answer per ray");
                self.search_into(rays, grouping, Any::new, Slice(blocked));
            }

            // The function is inlined, because a single ray is so little work that nested calls
            // cost time.
            #[inline]
            pub fn closest_one(&self, ray: RayQuery<$precision>) -> HitOf<$precision> {
                let mut search = Search::new(ray, &self.context, Closest::new(ray.ray));
                self.closest_of(&mut search);
                search.goal.result()
            }

            #[inline]
            pub fn occluded_one(&self, ray: RayQuery<$precision>) -> bool {
                let mut search = Search::new(ray, &self.context, Any::new(ray.ray));
                self.any_of(&mut search);
                search.goal.found
            }

            fn closest_of(&self, search: &mut Search<Closest<$precision>>) {
                self.run(search);
            }

            fn any_of(&self, search: &mut Search<Any<$precision>>) {
                self.run(search);
            }

            pub fn closest_counted(
                &self,
                ray: RayQuery<$precision>,
            ) -> (HitOf<$precision>, TraversalCounters) {
                let counted = self.search(ray, |ray| Counted::new(Closest::new(ray)));
                (counted.goal.result(), counted.counters)
            }

            pub fn all(&self, rays: Rays<$precision>) -> AllHits<$precision> {
                self.search_hits(rays)
            }

            pub fn all_one(&self, ray: RayQuery<$precision>) -> Vec<HitOf<$precision>> {
                self.search_hits_of(ray)
            }

            pub fn count(&self, rays: Rays<$precision>, counts: &mut [u32]) {
                assert_eq!(rays.len(), counts.len(), "one count per ray");
                self.search_counts(rays, counts);
            }
        }
    )+};
}

searches!(Single Double);

impl Searcher<'_> {
    pub fn instances_entered(&self, ray: RayQuery, most: u32) -> u32 {
        let start = |ray: &_| Counted { most_instances: most, ..Counted::new(Closest::new(ray)) };
        self.search(ray, start).counters.instances_entered
    }

    pub fn closest_work(&self, rays: Rays, hits: &mut [Hit]) -> TraversalWork {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        let mut work = TraversalWork::default();
        let start = |ray: &_| Counted::new(Closest::new(ray));
        self.search_all(rays, Grouping::None, start, |i, counted| {
            hits[i] = counted.goal.result();
            work.add(&counted.counters);
        });
        work
    }

    pub fn occluded_work(&self, rays: Rays, blocked: &mut [bool]) -> TraversalWork {
        assert_eq!(rays.len(), blocked.len(), "one answer per ray");
        let mut work = TraversalWork::default();
        let start = |ray: &_| Counted::new(Any::new(ray));
        self.search_all(rays, Grouping::None, start, |i, counted| {
            blocked[i] = counted.goal.found;
            work.add(&counted.counters);
        });
        work
    }
}

impl<'a, P: Facts> Searcher<'a, P> {
    /// Sets the flag that ends the searches early.
    #[inline]
    pub fn with_cancel(mut self, cancel: Option<&'a AtomicBool>) -> Self {
        self.context.cancel = cancel;
        self
    }
}

impl<P: Kernels> Searcher<'_, P> {
    /// Searches for all rays of a batch; `finish` is called with the number of each ray and its
    /// goal, in no particular order.
    pub fn search_all<G: Goal<Precision = P>>(
        &self,
        rays: Rays<P>,
        grouping: Grouping,
        start: impl Fn(&RayOf<G>) -> G,
        finish: impl FnMut(usize, G),
    ) {
        self.search_into(rays, grouping, start, finish);
    }

    /// Searches for all rays of a batch independently, with the kernels that suit the structure and
    /// the grouping. Lists and packets are only for goals that want one hit; for others their
    /// kernels are not compiled.
    pub fn search_into<G: Goal<Precision = P>>(
        &self,
        rays: Rays<P>,
        grouping: Grouping,
        start: impl Fn(&RayOf<G>) -> G,
        mut answers: impl Answers<G>,
    ) {
        let mut done = 0;
        if G::WANTS_ONE
            && let Structure::Bvh(forest) = &self.world.structure
            && (forest.list.is_some() || forest.outliers.is_some() && grouping == Grouping::None)
        {
            done = self.search_lists(forest, rays, &start, &mut answers);
        }
        if done < rays.len() {
            let rest = Part { first: done, answers: &mut answers };
            self.search_tree(rays.slice(done..rays.len()), grouping, start, rest);
        }
    }

    /// Performs [`Self::search_into`] with the list of the world, or with the list of its outliers
    /// and the tree of the remaining triangles. Returns the number of rays that are done.
    fn search_lists<G: Goal<Precision = P>>(
        &self,
        forest: &Forest,
        rays: Rays<P>,
        start: &impl Fn(&RayOf<G>) -> G,
        answers: &mut impl Answers<G>,
    ) -> usize {
        let (wide, mut unresolved) = (self.world.wide, Vec::new());
        let mut sorter = order::Sorter::new(
            rays.len(),
            forest.outliers.is_some() && interleave::pays_to_sort::<G>(forest, wide),
        );
        let at_once =
            if forest.outliers.is_some() { sorter.at_once(RAYS_AT_ONCE) } else { rays.len() };
        let mut first = 0;
        while first < rays.len() {
            let part = rays.slice(first..(first + at_once).min(rays.len()));
            let mut own = Part { first, answers: &mut *answers };
            let batch = interleave::Batch::new(part, &self.context);
            let done = P::search_list(forest, wide, &batch, &mut unresolved, start, |i, goal| {
                own.put(i, goal)
            });
            if !unresolved.is_empty() {
                let order = sorter.order_of::<P>(
                    unresolved.iter().map(|unresolved| part.get(unresolved.number as usize).ray),
                );
                let batch = interleave::Batch { order, unresolved: Some(&unresolved), ..batch };
                interleave::search_batch(forest, wide, &batch, start, own);
                unresolved.clear();
            }
            first += done;
            if done < part.len() {
                break;
            }
        }
        first
    }

    /// Performs [`Self::search_into`] with the structure of the world.
    fn search_tree<G: Goal<Precision = P>>(
        &self,
        rays: Rays<P>,
        grouping: Grouping,
        start: impl Fn(&RayOf<G>) -> G,
        mut answers: impl Answers<G>,
    ) {
        match &self.world.structure {
            Structure::Bvh(forest)
                if G::WANTS_ONE
                    && grouping == Grouping::Coherent
                    && packet::is_suitable(forest) =>
            {
                let batch = interleave::Batch::new(rays, &self.context);
                let all = Part { first: 0, answers: &mut answers };
                for left in packet::search_runs(forest, self.world.wide, &batch, &start, all) {
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
                let wide = self.world.wide;
                let mut sorter =
                    order::Sorter::new(rays.len(), interleave::pays_to_sort::<G>(forest, wide));
                for part in sorter.parts() {
                    let own = Part { first: part.start, answers: &mut answers };
                    let rays = rays.slice(part);
                    let order = sorter.order(rays);
                    let batch =
                        interleave::Batch { order, ..interleave::Batch::new(rays, &self.context) };
                    interleave::search_batch(forest, wide, &batch, &start, own);
                }
            }
            Structure::Walked(structures) => {
                let mut scratch = structures.scratch();
                for i in (0..rays.len()).take_while(|_| !self.context.is_cancelled()) {
                    let query = rays.get(i);
                    let mut search = Search::new(query, &self.context, start(query.ray));
                    if P::is_valid(query.ray) {
                        structures.search(&mut search, &mut scratch);
                    }
                    answers.put(i, search.goal);
                }
                scratch.keep();
            }
            _ => {
                for i in (0..rays.len()).take_while(|_| !self.context.is_cancelled()) {
                    answers.put(i, self.search(rays.get(i), &start));
                }
            }
        }
    }

    /// Searches for one ray.
    #[inline(always)]
    pub fn search<G: Goal<Precision = P>>(
        &self,
        query: RayQuery<P>,
        start: impl Fn(&RayOf<G>) -> G,
    ) -> G {
        let mut search = Search::new(query, &self.context, start(query.ray));
        self.run(&mut search);
        search.goal
    }

    #[inline(always)]
    fn run<G: Goal<Precision = P>>(&self, search: &mut Search<G>) {
        match &self.world.structure {
            Structure::Bvh(forest) => search_forest(forest, self.world.wide, search),
            other => search_other(other, search),
        }
    }
}

/// Searches a structure other than the 8-wide tree. Invalid rays find nothing.
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
