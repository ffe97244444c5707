//! Ray queries over batches: the main way to ask a [`World`]. Results depend only on each ray,
//! never on its neighbours.

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
pub(crate) mod searcher;
pub mod winding;

use crate::hit::Hit;
use crate::precision::{Precision, Single};
use crate::world::{TraversalCounters, TraversalWork, World};
use rays::{RayQuery, Rays};
use search::Context;
use searcher::Searcher;

/// Which rays of a batch belong together. The kernel follows from this and from the kind of query,
/// never from what happens to share a batch, so a ray's result never depends on its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grouping {
    /// Unrelated rays.
    #[default]
    None,
    /// Rays that are much like their neighbours: each run of 16, counted from the start of the
    /// batch (the last may be shorter), leaves one point or goes to one point, in similar
    /// directions. Such are the samples of a pixel or of 4x4 pixels seen by a pinhole, and the
    /// shadow rays from them to a point light. Where it is not so, such runs are traced like
    /// unrelated rays.
    Coherent,
}

/// Decides about hits on geometries marked by [`crate::WorldBuilder::set_filtered`] (cut-out and
/// blended surfaces). Must be a pure function of its arguments.
pub trait HitFilter<P: Precision = Single>: Sync {
    /// False if the ray passes through at this hit. `ray` is in world space; its `t_max` is
    /// unspecified.
    fn accept(&self, ray: &P::Ray, hit: &P::Hit) -> bool;

    /// The same for a ray with a time from 0 to 1. For those to whom the time means nothing, as
    /// [`Self::accept`].
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
    /// The nearest hit of each ray, [`Hit::MISS`] where there is none or the ray is invalid
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

    /// The nearest hit of one ray, and what it cost to find.
    pub fn closest_counted<'a>(
        &self,
        ray: impl Into<RayQuery<'a>>,
        filter: &dyn HitFilter,
    ) -> (Hit, TraversalCounters) {
        self.searcher(filter).closest_counted(ray.into())
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
        self.searcher(filter).with_cancel(rays.cancel()).closest_work(rays, hits)
    }

    /// For each ray, whether anything lies in its interval, and what all of them together cost to
    /// find out.
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
        let context = Context { filter, options: &self.options, data: &(), cancel: None };
        Searcher { world: self, context }
    }
}
