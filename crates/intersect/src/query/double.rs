//! The queries of worlds in double precision.

use super::all::AllHits;
use super::scaled::restored;
use super::searcher::Searcher;
use crate::hit::DHit;
use crate::precision::Double;
use crate::search::rays::{RayQuery, Rays};
use crate::search::{Context, Grouping, HitFilter, TraversalCounters};
use crate::world::double::DWorld;

impl DWorld {
    /// Finds the nearest hit of each ray; see [`crate::World::closest`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest<'a>(
        &self,
        rays: impl Into<Rays<'a, Double>>,
        grouping: Grouping,
        filter: &dyn HitFilter<Double>,
        hits: &mut [DHit],
    ) {
        let rays = rays.into();
        let scaled = self.scaled(&rays);
        let rays = scaled.as_ref().map_or(rays, |scaled| scaled.of(rays));
        self.searcher(filter).with_cancel(rays.cancel()).closest(rays, grouping, hits);
        if let Some(scaled) = &scaled {
            scaled.restore(hits);
        }
    }

    /// For each ray, whether anything lies in its interval; see [`crate::World::occluded`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded<'a>(
        &self,
        rays: impl Into<Rays<'a, Double>>,
        grouping: Grouping,
        filter: &dyn HitFilter<Double>,
        blocked: &mut [bool],
    ) {
        let rays = rays.into();
        let scaled = self.scaled(&rays);
        let rays = scaled.as_ref().map_or(rays, |scaled| scaled.of(rays));
        self.searcher(filter).with_cancel(rays.cancel()).occluded(rays, grouping, blocked);
    }

    /// The nearest hit of one ray; see [`crate::World::closest_one`].
    pub fn closest_one<'a>(
        &self,
        ray: impl Into<RayQuery<'a, Double>>,
        filter: &dyn HitFilter<Double>,
    ) -> DHit {
        let query = ray.into();
        match self.scaled_one(query.ray) {
            None => self.searcher(filter).closest_one(query),
            Some((ray, factor)) => {
                let hit = self.searcher(filter).closest_one(RayQuery { ray: &ray, ..query });
                restored(hit, factor)
            }
        }
    }

    /// True if anything lies in the interval of one ray; see [`crate::World::occluded_one`].
    pub fn occluded_one<'a>(
        &self,
        ray: impl Into<RayQuery<'a, Double>>,
        filter: &dyn HitFilter<Double>,
    ) -> bool {
        let query = ray.into();
        match self.scaled_one(query.ray) {
            None => self.searcher(filter).occluded_one(query),
            Some((ray, _)) => self.searcher(filter).occluded_one(RayQuery { ray: &ray, ..query }),
        }
    }

    /// Every hit of each ray; see [`crate::World::all`].
    pub fn all<'a>(
        &self,
        rays: impl Into<Rays<'a, Double>>,
        filter: &dyn HitFilter<Double>,
    ) -> AllHits<Double> {
        let rays = rays.into();
        let scaled = self.scaled(&rays);
        let rays = scaled.as_ref().map_or(rays, |scaled| scaled.of(rays));
        let all = self.searcher(filter).with_cancel(rays.cancel()).all(rays);
        match scaled {
            Some(scaled) => scaled.restore_all(all),
            None => all,
        }
    }

    /// Every hit of one ray; see [`crate::World::all_one`].
    pub fn all_one<'a>(
        &self,
        ray: impl Into<RayQuery<'a, Double>>,
        filter: &dyn HitFilter<Double>,
    ) -> Vec<DHit> {
        let query = ray.into();
        match self.scaled_one(query.ray) {
            None => self.searcher(filter).all_one(query),
            Some((ray, factor)) => {
                let mut all = self.searcher(filter).all_one(RayQuery { ray: &ray, ..query });
                all.iter_mut().for_each(|hit| *hit = restored(*hit, factor));
                all
            }
        }
    }

    /// The number of hits of each ray; see [`crate::World::count`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn count<'a>(
        &self,
        rays: impl Into<Rays<'a, Double>>,
        filter: &dyn HitFilter<Double>,
        counts: &mut [u32],
    ) {
        let rays = rays.into();
        let scaled = self.scaled(&rays);
        let rays = scaled.as_ref().map_or(rays, |scaled| scaled.of(rays));
        self.searcher(filter).with_cancel(rays.cancel()).count(rays, counts);
    }

    /// The nearest hit of one ray, and counters of the traversal; see
    /// [`crate::World::closest_counted`].
    pub fn closest_counted<'a>(
        &self,
        ray: impl Into<RayQuery<'a, Double>>,
        filter: &dyn HitFilter<Double>,
    ) -> (DHit, TraversalCounters) {
        let query = ray.into();
        match self.scaled_one(query.ray) {
            None => self.searcher(filter).closest_counted(query),
            Some((ray, factor)) => {
                let query = RayQuery { ray: &ray, ..query };
                let (hit, counters) = self.searcher(filter).closest_counted(query);
                (restored(hit, factor), counters)
            }
        }
    }

    #[inline]
    pub(super) fn searcher<'a>(
        &'a self,
        filter: &'a dyn HitFilter<Double>,
    ) -> Searcher<'a, Double> {
        let world = &self.world;
        let options = world.options_for(filter.decides_everywhere());
        let context = Context { filter, options, data: &self.data, cancel: None };
        Searcher { world, context }
    }
}
