//! Every crossing of a ray: how many there are, and which.
//!
//! A structure may hold a triangle several times (spatial splits do that), so a crossing may be offered several times, in any order.
//! Each counts once: for triangles the same (instance, geometry, primitive) at the same `t` and `uv` is the same crossing. Shapes are held
//! once, and two of their crossings may well be equal in single precision.

#[cfg(test)]
mod tests;

use super::rays::{RayQuery, Rays};
use super::search::{All, Goal};
use super::{Grouping, HitFilter};
use crate::hit::Hit;
use crate::world::{Geometry, Structure, World};
use snell_math::Ray;

/// Every hit of each ray of a batch, as compressed sparse rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AllHits {
    /// Where the hits of each ray begin in `hits`, and after the last ray their number: one entry more than there are rays.
    pub ray_splits: Vec<usize>,
    /// The hits, ray after ray; of each ray ascending by `t`, equal ones by instance, geometry and primitive.
    pub hits: Vec<Hit>,
}

impl AllHits {
    /// The hits of one ray.
    ///
    /// # Panics
    /// If there is no such ray.
    pub fn of_ray(&self, ray: usize) -> &[Hit] {
        &self.hits[self.ray_splits[ray]..self.ray_splits[ray + 1]]
    }

    /// How many rays there are.
    pub fn ray_count(&self) -> usize {
        self.ray_splits.len().saturating_sub(1)
    }

    /// One batch after another.
    pub(super) fn concatenated(batches: Vec<Self>) -> Self {
        let mut all =
            Self { ray_splits: vec![0], hits: Vec::with_capacity(batches.iter().map(|b| b.hits.len()).sum()) };
        for batch in batches {
            let before = all.hits.len();
            all.ray_splits.extend(batch.ray_splits.iter().skip(1).map(|split| before + split));
            all.hits.extend(batch.hits);
        }
        all
    }
}

/// What hits are sorted by.
fn key(hit: &Hit) -> Key {
    Key { t: hit.t, rank: hit.rank() }
}

/// Sorts hits and leaves each crossing once.
fn sort_and_deduplicate(hits: &mut Vec<Hit>, geometries: &[Geometry]) {
    hits.sort_by(|a, b| key(a).compare(&key(b)));
    hits.dedup_by(|a, b| key(a) == key(b) && is_mesh(geometries, a.geometry));
}

fn is_mesh(geometries: &[Geometry], geometry: u32) -> bool {
    matches!(geometries[geometry as usize], Geometry::Mesh(_) | Geometry::Quads(_))
}

impl World {
    /// Every hit of each ray, in order; none for invalid rays. There is no limit to their number.
    pub fn all<'a>(&self, rays: impl Into<Rays<'a>>, filter: &dyn HitFilter) -> AllHits {
        let rays = rays.into();
        let mut rows = vec![Vec::new(); rays.len()];
        self.search_all(rays, Grouping::None, filter, All::new, |i, goal| {
            rows[i] = goal.hits;
            sort_and_deduplicate(&mut rows[i], &self.geometries);
        });
        let mut all = AllHits { ray_splits: vec![0], hits: Vec::with_capacity(rows.iter().map(Vec::len).sum()) };
        for row in rows {
            all.hits.extend(row);
            all.ray_splits.push(all.hits.len());
        }
        all
    }

    /// Every hit of one ray, ascending by `t`, equal ones by instance, geometry and primitive.
    pub fn all_one<'a>(&self, ray: impl Into<RayQuery<'a>>, filter: &dyn HitFilter) -> Vec<Hit> {
        let mut hits = self.search(ray.into(), filter, All::new).hits;
        sort_and_deduplicate(&mut hits, &self.geometries);
        hits
    }

    /// How many hits each ray has, without keeping them; 0 for invalid rays.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn count<'a>(&self, rays: impl Into<Rays<'a>>, filter: &dyn HitFilter, counts: &mut [u32]) {
        let rays = rays.into();
        assert_eq!(rays.len(), counts.len(), "one count per ray");
        if self.may_repeat() {
            self.count_distinct(rays, filter, BUFFER, counts);
        } else {
            self.search_all(rays, Grouping::None, filter, Tally::new, |i, goal| counts[i] = goal.count);
        }
    }

    /// As [`Self::count`] for structures that may offer a crossing several times.
    fn count_distinct(&self, rays: Rays, filter: &dyn HitFilter, buffer: usize, counts: &mut [u32]) {
        let start = |ray: &Ray| Distinct::new(ray, &self.geometries, buffer);
        self.search_all(rays, Grouping::None, filter, start, |i, mut goal| {
            let mut count = 0u32;
            loop {
                let (found, last) = goal.finish();
                count = count.saturating_add(found);
                let Some(last) = last else { break };
                goal = self.search(rays.get(i), filter, |ray| Distinct { after: Some(last), ..start(ray) });
            }
            counts[i] = count;
        });
    }

    /// True if the structure may hold a triangle several times.
    fn may_repeat(&self) -> bool {
        *self.repeats.get_or_init(|| match &self.structure {
            Structure::None(_) | Structure::Walked(_) => false,
            Structure::Bvh(forest) => {
                let used = |ids: &[u32; 8]| ids.iter().filter(|&&id| id != u32::MAX).count() as u64;
                let held: u64 = forest.trees.iter().flat_map(|t| t.blocks.iter()).map(|b| used(&b.ids)).sum();
                held > self.stats().triangles - self.stats().skipped_triangles
            }
        })
    }
}

/// The number of hits, if each is offered once.
#[derive(Clone, Copy, Debug)]
struct Tally {
    limit: f32,
    count: u32,
}

impl Tally {
    fn new(ray: &Ray) -> Self {
        Self { limit: ray.t_max, count: 0 }
    }
}

impl Goal for Tally {
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
        self.count = self.count.saturating_add(1);
        false
    }
}

/// The order of hits.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    t: f32,
    /// [`Hit::rank`].
    rank: [u32; 5],
}

impl Key {
    fn compare(&self, other: &Self) -> std::cmp::Ordering {
        self.t.total_cmp(&other.t).then(self.rank.cmp(&other.rank))
    }
}

/// Crossings remembered at once.
const BUFFER: usize = 4096;

/// The number of different hits in fixed memory: as many of the first ones as fit the buffer. When there are more, what is left is
/// for another search, `after` the last of these.
#[derive(Clone, Debug)]
struct Distinct<'a> {
    geometries: &'a [Geometry],
    limit: f32,
    after: Option<Key>,
    /// Hits behind this one were dropped.
    until: Option<Key>,
    found: Vec<Key>,
    buffer: usize,
}

impl<'a> Distinct<'a> {
    fn new(ray: &Ray, geometries: &'a [Geometry], buffer: usize) -> Self {
        Self { geometries, limit: ray.t_max, after: None, until: None, found: Vec::new(), buffer }
    }

    /// Makes room, if need be by dropping the farther half.
    fn compact(&mut self) {
        self.sort_and_deduplicate();
        if self.found.len() > self.buffer / 2 {
            // Equal crossings of a shape stay together.
            let last = self.found[self.buffer / 2 - 1];
            self.found.truncate(self.found.partition_point(|key| key.compare(&last).is_le()));
            self.until = Some(last);
        }
    }

    fn sort_and_deduplicate(&mut self) {
        self.found.sort_unstable_by(Key::compare);
        let geometries = self.geometries;
        self.found.dedup_by(|a, b| a == b && is_mesh(geometries, a.rank[1]));
    }

    /// How many there are, and the last of them if there are more.
    fn finish(mut self) -> (u32, Option<Key>) {
        self.sort_and_deduplicate();
        (self.found.len() as u32, self.until)
    }
}

impl Goal for Distinct<'_> {
    const NARROWS: bool = true;

    fn limit(&self) -> f32 {
        self.until.map_or(self.limit, |last| last.t)
    }

    fn wants(&self, hit: &Hit) -> bool {
        let key = key(hit);
        hit.t < self.limit && self.until.is_none_or(|until| key.compare(&until).is_le())
    }

    fn is_past(&self, hit: &Hit) -> bool {
        self.after.is_some_and(|after| key(hit).compare(&after).is_le())
    }

    fn take(&mut self, hit: Hit) -> bool {
        self.found.push(key(&hit));
        if self.found.len() >= self.buffer {
            self.compact();
        }
        false
    }
}
