//! Ray queries over batches, the main queries of a [`World`]. The result of a ray depends only on
//! that ray, never on other rays of the batch.

pub mod all;
pub mod culling;
mod double;
pub mod nearest;
mod order;
pub mod pair;
pub mod parallel;
pub mod queries;
mod scaled;
pub(crate) mod searcher;
mod spawn;
pub mod trace;
pub mod winding;

use crate::hit::Hit;
use crate::search::rays::{RayQuery, Rays};
use crate::search::{AcceptAll, Context, Grouping, HitFilter, TraversalCounters, TraversalWork};
use crate::world::World;
use searcher::Searcher;

impl World {
    /// The nearest hit of each ray. The result is [`Hit::MISS`] for a ray that misses or is invalid
    /// ([`snell_math::Ray::is_valid`]).
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest<'a>(
        &self,
        rays: impl Into<Rays<'a>>,
        grouping: Grouping,
        filter: &dyn HitFilter,
        hits: &mut [Hit],
    ) {
        let rays = rays.into();
        self.searcher(filter).with_cancel(rays.cancel()).closest(rays, grouping, hits);
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
        self.searcher(filter).with_cancel(rays.cancel()).occluded(rays, grouping, blocked);
    }

    /// The nearest hit of one ray.
    pub fn closest_one<'a>(&self, ray: impl Into<RayQuery<'a>>, filter: &dyn HitFilter) -> Hit {
        self.searcher(filter).closest_one(ray.into())
    }

    /// True if anything lies in the interval of one ray.
    pub fn occluded_one<'a>(&self, ray: impl Into<RayQuery<'a>>, filter: &dyn HitFilter) -> bool {
        self.searcher(filter).occluded_one(ray.into())
    }

    /// The nearest hit of one ray, and counters of the traversal.
    pub fn closest_counted<'a>(
        &self,
        ray: impl Into<RayQuery<'a>>,
        filter: &dyn HitFilter,
    ) -> (Hit, TraversalCounters) {
        self.searcher(filter).closest_counted(ray.into())
    }

    /// The number of instances that the search for the nearest hit of a ray enters, each counted as
    /// often as it is entered. The search is given up when it has entered `most`.
    pub fn instances_entered<'a>(&self, ray: impl Into<RayQuery<'a>>, most: u32) -> u32 {
        self.searcher(&AcceptAll).instances_entered(ray.into(), most)
    }

    /// The nearest hit of each ray, and counters of the traversal for all rays together.
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
        self.searcher(filter).with_cancel(rays.cancel()).closest_work(rays, hits)
    }

    /// For each ray, whether anything lies in its interval, and counters of the traversal for all
    /// rays together.
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
        self.searcher(filter).with_cancel(rays.cancel()).occluded_work(rays, blocked)
    }

    #[inline]
    pub(crate) fn searcher<'a>(&'a self, filter: &'a dyn HitFilter) -> Searcher<'a> {
        let options = self.options_for(filter.decides_everywhere());
        let context = Context { filter, options, data: &(), cancel: None };
        Searcher { world: self, context }
    }
}
