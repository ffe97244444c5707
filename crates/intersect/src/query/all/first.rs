//! The first hits of a ray, or their number up to a limit.

use super::{AllHits, Key, Searcher, Tally, World, is_mesh, key};
use crate::kernel::Kernels;
use crate::precision::{Double, Facts};
use crate::search::rays::Rays;
use crate::search::{Goal, Grouping, HitFilter};
use crate::world::Geometry;
use crate::world::double::DWorld;

impl World {
    /// The first `most` hits of each ray, in order along the ray: those at the start of
    /// [`Self::all`]. What lies behind them is not searched.
    pub fn first<'a>(
        &self,
        rays: impl Into<Rays<'a>>,
        filter: &dyn HitFilter,
        most: usize,
    ) -> AllHits {
        let rays = rays.into();
        self.searcher(filter).with_cancel(rays.cancel()).search_first(rays, most)
    }

    /// The number of hits of each ray, at most `most`: the lesser of `most` and the result of
    /// [`Self::count`]. The search of a ray ends when it has found so many.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn count_to<'a>(
        &self,
        rays: impl Into<Rays<'a>>,
        filter: &dyn HitFilter,
        most: u32,
        counts: &mut [u32],
    ) {
        let rays = rays.into();
        self.searcher(filter).with_cancel(rays.cancel()).search_counts_to(rays, most, counts);
    }
}

impl DWorld {
    /// The first `most` hits of each ray; see [`World::first`].
    pub fn first<'a>(
        &self,
        rays: impl Into<Rays<'a, Double>>,
        filter: &dyn HitFilter<Double>,
        most: usize,
    ) -> AllHits<Double> {
        let rays = rays.into();
        let scaled = self.scaled(&rays);
        let rays = scaled.as_ref().map_or(rays, |scaled| scaled.of(rays));
        let all = self.searcher(filter).with_cancel(rays.cancel()).search_first(rays, most);
        match scaled {
            Some(scaled) => scaled.restore_all(all),
            None => all,
        }
    }

    /// The number of hits of each ray, at most `most`; see [`World::count_to`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn count_to<'a>(
        &self,
        rays: impl Into<Rays<'a, Double>>,
        filter: &dyn HitFilter<Double>,
        most: u32,
        counts: &mut [u32],
    ) {
        let rays = rays.into();
        let scaled = self.scaled(&rays);
        let rays = scaled.as_ref().map_or(rays, |scaled| scaled.of(rays));
        self.searcher(filter).with_cancel(rays.cancel()).search_counts_to(rays, most, counts);
    }
}

impl<P: Kernels> Searcher<'_, P> {
    /// The first hits of each ray; the search behind [`World::first`].
    pub fn search_first(&self, rays: Rays<P>, most: usize) -> AllHits<P> {
        let mut rows = vec![Vec::new(); rays.len()];
        if most > 0 {
            let start = |ray: &P::Ray| First::<P>::new(ray, &self.world.geometries, most);
            self.search_all(rays, Grouping::None, start, |i, goal| rows[i] = goal.finish());
        }
        AllHits::concatenated_rows(rows)
    }

    /// The number of hits of each ray; the search behind [`World::count_to`].
    pub fn search_counts_to(&self, rays: Rays<P>, most: u32, counts: &mut [u32]) {
        assert_eq!(rays.len(), counts.len(), "one count per ray");
        if most == 0 {
            counts.fill(0);
        } else if !self.world.may_repeat() {
            let start = |ray: &P::Ray| Tally::new(ray, most);
            self.search_all(rays, Grouping::None, start, |i, goal| counts[i] = goal.count);
        } else if most as usize <= super::BUFFER {
            let start = |ray: &P::Ray| First::<P> {
                is_enough: true,
                ..First::new(ray, &self.world.geometries, most as usize)
            };
            self.search_all(rays, Grouping::None, start, |i, goal| {
                counts[i] = goal.finish().len() as u32;
            });
        } else {
            self.search_counts(rays, counts);
            counts.iter_mut().for_each(|count| *count = (*count).min(most));
        }
    }
}

/// A goal that keeps the first hits along the ray, in any number of reports.
#[derive(Clone, Debug)]
struct First<'a, P: Facts> {
    geometries: &'a [Geometry],
    limit: P::Real,
    most: usize,
    /// True if any `most` hits will do, not only the first.
    is_enough: bool,
    /// The last of the hits to keep, once there are enough.
    last: Option<Key<P>>,
    /// The number of reports at which the hits are sorted next.
    full: usize,
    found: Vec<(Key<P>, P::Hit)>,
}

impl<'a, P: Facts> First<'a, P> {
    fn new(ray: &P::Ray, geometries: &'a [Geometry], most: usize) -> Self {
        let limit = P::interval(ray)[1];
        Self {
            geometries,
            limit,
            most,
            is_enough: false,
            last: None,
            full: most,
            found: Vec::new(),
        }
    }

    /// Sorts the hits, and keeps the first different ones.
    fn compact(&mut self) {
        let geometries = self.geometries;
        // Hits on one primitive of a set are reported in their order, which a stable sort keeps.
        self.found.sort_by(|a, b| a.0.compare(&b.0));
        self.found.dedup_by(|a, b| a.0 == b.0 && is_mesh(geometries, a.0.rank[1] as u32));
        self.found.truncate(self.most);
        self.full = self.found.len() + self.most / 4 + 1;
        if self.found.len() == self.most {
            self.last = self.found.last().map(|(key, _)| *key);
        } else {
            self.full = self.full.max(self.most);
        }
    }

    fn finish(mut self) -> Vec<P::Hit> {
        self.compact();
        self.found.into_iter().map(|(_, hit)| hit).collect()
    }
}

impl<P: Facts> Goal for First<'_, P> {
    type Precision = P;
    const NARROWS: bool = true;

    #[inline(always)]
    fn limit(&self) -> P::Real {
        self.last.map_or(self.limit, |last| last.t)
    }

    #[inline(always)]
    fn wants(&self, hit: &P::Hit) -> bool {
        P::t(hit) < self.limit
            && self.last.is_none_or(|last| key::<P>(hit, self.geometries).compare(&last).is_lt())
    }

    fn take(&mut self, hit: P::Hit) -> bool {
        self.found.push((key::<P>(&hit, self.geometries), hit));
        if self.found.len() >= self.full {
            self.compact();
        }
        self.is_enough && self.last.is_some()
    }
}
