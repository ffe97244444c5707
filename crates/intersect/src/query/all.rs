//! Queries for all hits of a ray, or for their number.
//!
//! A structure may hold a triangle several times (because of spatial splits), so a hit may be
//! reported several times, in any order. It counts once: two reports for a triangle with the same
//! (instance, geometry, primitive), `t` and `uv` are one hit. A shape is held once, and two
//! different hits on it may be equal in single precision.

mod first;
#[cfg(test)]
mod tests;

use super::searcher::Searcher;
use crate::hit::Hit;
use crate::kernel::Kernels;
use crate::precision::{Facts, Precision, Real, Single};
use crate::search::rays::{RayQuery, Rays};
use crate::search::{All, Goal, Grouping, HitFilter};
use crate::world::{Geometry, Structure, World};

/// Every hit of each ray of a batch, as compressed sparse rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AllHits<P: Precision = Single> {
    /// The index in `hits` of each ray's first hit, followed by the number of hits: one entry more
    /// than there are rays.
    pub ray_splits: Vec<usize>,
    /// The hits, ray after ray. Those of a ray are sorted by `t`, at equal `t` by instance,
    /// geometry and primitive; hits on one primitive other than a quad keep their order along the
    /// ray.
    pub hits: Vec<P::Hit>,
}

impl<P: Precision> AllHits<P> {
    /// The hits of one ray.
    ///
    /// # Panics
    /// If the ray number is out of range.
    pub fn of_ray(&self, ray: usize) -> &[P::Hit] {
        &self.hits[self.ray_splits[ray]..self.ray_splits[ray + 1]]
    }

    /// The number of rays.
    pub fn ray_count(&self) -> usize {
        self.ray_splits.len().saturating_sub(1)
    }

    /// The result with these hits of each ray.
    fn concatenated_rows(rows: Vec<Vec<P::Hit>>) -> Self {
        let total = rows.iter().map(Vec::len).sum();
        let mut all = Self { ray_splits: vec![0], hits: Vec::with_capacity(total) };
        for row in rows {
            all.hits.extend(row);
            all.ray_splits.push(all.hits.len());
        }
        all
    }

    /// The results of several batches, one after the other.
    pub(super) fn concatenated(batches: Vec<Self>) -> Self {
        let mut all = Self {
            ray_splits: vec![0],
            hits: Vec::with_capacity(batches.iter().map(|b| b.hits.len()).sum()),
        };
        for batch in batches {
            let before = all.hits.len();
            all.ray_splits.extend(batch.ray_splits.iter().skip(1).map(|split| before + split));
            all.hits.extend(batch.hits);
        }
        all
    }
}

/// The sort key of hits. Hits on one primitive of a set are reported in their order along the ray,
/// and keep it where their rounded `t` are equal, so that the first one is also the closest hit.
fn key<P: Facts>(hit: &P::Hit, geometries: &[Geometry]) -> Key<P> {
    let [instance, geometry, primitive, u, v] = P::rank(hit);
    let [u, v] = if is_mesh(geometries, P::ids(hit)[1]) { [u, v] } else { [0; 2] };
    Key { t: P::t(hit), rank: [instance, geometry, primitive, u, v] }
}

fn is_mesh(geometries: &[Geometry], geometry: u32) -> bool {
    matches!(geometries[geometry as usize], Geometry::Mesh(_) | Geometry::Quads(_))
}

impl World {
    /// Every hit of each ray, in order along the ray; none for invalid rays. The number of hits is
    /// unlimited.
    pub fn all<'a>(&self, rays: impl Into<Rays<'a>>, filter: &dyn HitFilter) -> AllHits {
        let rays = rays.into();
        self.searcher(filter).with_cancel(rays.cancel()).all(rays)
    }

    /// Every hit of one ray in ascending order of `t`, at equal `t` of instance, geometry and
    /// primitive.
    pub fn all_one<'a>(&self, ray: impl Into<RayQuery<'a>>, filter: &dyn HitFilter) -> Vec<Hit> {
        self.searcher(filter).all_one(ray.into())
    }

    /// The number of hits of each ray, found without storing them; 0 for invalid rays.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn count<'a>(&self, rays: impl Into<Rays<'a>>, filter: &dyn HitFilter, counts: &mut [u32]) {
        let rays = rays.into();
        self.searcher(filter).with_cancel(rays.cancel()).count(rays, counts);
    }

    /// True if the structure may hold a triangle several times.
    fn may_repeat(&self) -> bool {
        *self.repeats.get_or_init(|| match &self.structure {
            Structure::None(_) | Structure::Walked(_) => false,
            Structure::Bvh(forest) => forest.trees.iter().any(|tree| tree.has_repeated_triangles()),
        })
    }
}

impl<P: Kernels> Searcher<'_, P> {
    /// Every hit of each ray; the search behind [`World::all`].
    pub fn search_hits(&self, rays: Rays<P>) -> AllHits<P> {
        let mut rows = vec![Vec::new(); rays.len()];
        self.search_all(rays, Grouping::None, All::new, |i, goal| {
            rows[i] = goal.hits;
            self.sort_and_deduplicate(&mut rows[i]);
        });
        AllHits::concatenated_rows(rows)
    }

    /// Every hit of one ray; the search behind [`World::all_one`].
    pub fn search_hits_of(&self, ray: RayQuery<P>) -> Vec<P::Hit> {
        let mut hits = self.search(ray, All::new).hits;
        self.sort_and_deduplicate(&mut hits);
        hits
    }

    /// Sorts hits and removes repeated reports of one hit.
    fn sort_and_deduplicate(&self, hits: &mut Vec<P::Hit>) {
        let geometries = &self.world.geometries;
        let key = |hit: &P::Hit| key::<P>(hit, geometries);
        hits.sort_by(|a, b| key(a).compare(&key(b)));
        hits.dedup_by(|a, b| key(a) == key(b) && is_mesh(geometries, P::ids(a)[1]));
    }

    /// The number of hits of each ray; the search behind [`World::count`].
    pub fn search_counts(&self, rays: Rays<P>, counts: &mut [u32]) {
        if self.world.may_repeat() {
            self.count_distinct(rays, BUFFER, counts);
        } else {
            let start = |ray: &P::Ray| Tally::new(ray, u32::MAX);
            self.search_all(rays, Grouping::None, start, |i, goal| counts[i] = goal.count);
        }
    }

    /// The number of hits of each ray, for structures that may report a hit several times.
    fn count_distinct(&self, rays: Rays<P>, buffer: usize, counts: &mut [u32]) {
        let start = |ray: &P::Ray| Distinct::<P>::new(ray, &self.world.geometries, buffer);
        self.search_all(rays, Grouping::None, start, |i, mut goal| {
            let mut count = 0u32;
            loop {
                let (found, last) = goal.finish();
                count = count.saturating_add(found);
                let Some(last) = last else { break };
                goal = self.search(rays.get(i), |ray| Distinct { after: Some(last), ..start(ray) });
            }
            counts[i] = count;
        });
    }
}

/// A goal that counts hits, for structures that report each hit once.
#[derive(Clone, Copy, Debug)]
struct Tally<P: Facts> {
    limit: P::Real,
    count: u32,
    /// The number at which counting stops.
    most: u32,
}

impl<P: Facts> Tally<P> {
    fn new(ray: &P::Ray, most: u32) -> Self {
        Self { limit: P::interval(ray)[1], count: 0, most }
    }
}

impl<P: Facts> Goal for Tally<P> {
    type Precision = P;
    const NARROWS: bool = false;

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
        self.count = self.count.saturating_add(1);
        self.count >= self.most
    }
}

/// The key by which hits are sorted.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key<P: Facts> {
    t: P::Real,
    /// The result of [`Facts::rank`].
    rank: [u64; 5],
}

impl<P: Facts> Key<P> {
    fn compare(&self, other: &Self) -> std::cmp::Ordering {
        self.t.compare(other.t).then(self.rank.cmp(&other.rank))
    }
}

/// The largest number of hits in the buffer.
const BUFFER: usize = 4096;

/// A goal that counts different hits in fixed memory. The buffer holds the first hits along the
/// ray; if there are more, another search continues `after` the last hit of the buffer.
#[derive(Clone, Debug)]
struct Distinct<'a, P: Facts> {
    geometries: &'a [Geometry],
    limit: P::Real,
    after: Option<Key<P>>,
    /// If some hits were dropped, the last hit that was kept.
    until: Option<Key<P>>,
    found: Vec<Key<P>>,
    buffer: usize,
}

impl<'a, P: Facts> Distinct<'a, P> {
    fn new(ray: &P::Ray, geometries: &'a [Geometry], buffer: usize) -> Self {
        Self {
            geometries,
            limit: P::interval(ray)[1],
            after: None,
            until: None,
            found: Vec::new(),
            buffer,
        }
    }

    /// Removes duplicates, and if that does not free half the buffer, drops the hits farther along
    /// the ray.
    fn compact(&mut self) {
        self.sort_and_deduplicate();
        if self.found.len() > self.buffer / 2 {
            // Hits on a shape with equal keys are dropped or kept together.
            let last = self.found[self.buffer / 2 - 1];
            self.found.truncate(self.found.partition_point(|key| key.compare(&last).is_le()));
            self.until = Some(last);
        }
    }

    fn sort_and_deduplicate(&mut self) {
        self.found.sort_unstable_by(Key::compare);
        let geometries = self.geometries;
        self.found.dedup_by(|a, b| a == b && is_mesh(geometries, a.rank[1] as u32));
    }

    /// The number of hits in the buffer, and the last of them if any were dropped.
    fn finish(mut self) -> (u32, Option<Key<P>>) {
        self.sort_and_deduplicate();
        (self.found.len() as u32, self.until)
    }
}

impl<P: Facts> Goal for Distinct<'_, P> {
    type Precision = P;
    const NARROWS: bool = true;

    fn limit(&self) -> P::Real {
        self.until.map_or(self.limit, |last| last.t)
    }

    fn wants(&self, hit: &P::Hit) -> bool {
        let key = key::<P>(hit, self.geometries);
        P::t(hit) < self.limit && self.until.is_none_or(|until| key.compare(&until).is_le())
    }

    fn is_past(&self, hit: &P::Hit) -> bool {
        self.after.is_some_and(|after| key::<P>(hit, self.geometries).compare(&after).is_le())
    }

    fn take(&mut self, hit: P::Hit) -> bool {
        self.found.push(key::<P>(&hit, self.geometries));
        if self.found.len() >= self.buffer {
            self.compact();
        }
        false
    }
}
