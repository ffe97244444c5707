//! The order in which the rays of a large batch are traced: rays with nearby origins follow each
//! other, because they visit the same parts of the tree.
//!
//! Rays are sorted by the Morton code of their origin's cell, by a counting sort, unless they are
//! already in such an order. Each ray is still traced independently, so the results are the same.

use crate::morton;
use crate::precision::Facts;
use crate::search::rays::Rays;
use snell_math::Vec3;
use std::ops::Range;

/// The smallest number of rays that is worth sorting.
const MIN_RAYS: usize = 1 << 14;

/// The largest number of rays sorted at a time; more rays and their results would not fit the
/// caches.
const MAX_RAYS: usize = 1 << 16;

/// Bits of a cell's coordinate on each axis.
const CELL_BITS: u32 = 5;

/// The number of cells, few enough that their counters fit the second-level cache.
const CELLS: usize = 1 << (3 * CELL_BITS);

/// The number of pairs of consecutive rays that are sampled to find out whether rays are in order.
const SAMPLES: usize = 256;

/// One origin of this many is sampled to estimate the extent of all origins.
const STEP: usize = 61;

/// Consecutive origins are close together if their distance is within this fraction of the extent
/// of all origins.
const CLOSE: f32 = 1.0 / 16.0;

/// Sorts a batch part by part.
pub(crate) struct Sorter {
    rays: usize,
    /// The number of rays in a part.
    size: usize,
    sorts: bool,
    /// The cell of each ray.
    cells: Vec<u16>,
    /// For each cell first the number of its rays, then the position of its next ray in the order.
    places: Vec<u32>,
    order: Vec<u32>,
}

impl Sorter {
    /// A sorter for a batch of this many rays. It sorts if `sorts` is true and the batch is large
    /// enough.
    pub fn new(rays: usize, sorts: bool) -> Self {
        let sorts = sorts && rays >= MIN_RAYS;
        let parts = if sorts { rays.div_ceil(MAX_RAYS) } else { 1 };
        Self {
            rays,
            size: rays.div_ceil(parts).max(1),
            sorts,
            cells: vec![],
            places: vec![],
            order: vec![],
        }
    }

    /// The ranges of the parts, of equal size except the last.
    pub fn parts(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let (rays, size) = (self.rays, self.size);
        (0..rays).step_by(size).map(move |first| first..(first + size).min(rays))
    }

    /// The number of rays to process at a time: a part if rays are sorted, otherwise `unsorted`.
    pub fn at_once(&self, unsorted: usize) -> usize {
        if self.sorts { self.size } else { unsorted }
    }

    /// The order in which to trace the rays of a part; empty if it need not change.
    pub fn order<P: Facts>(&mut self, rays: Rays<P>) -> &[u32] {
        self.order_of::<P>(rays.rays().iter())
    }

    /// The order in which to trace a subset of the rays, as indices into the subset; empty if it
    /// need not change.
    pub fn order_of<'r, P: Facts>(
        &mut self,
        rays: impl ExactSizeIterator<Item = &'r P::Ray> + Clone,
    ) -> &[u32] {
        self.order.clear();
        if !self.sorts || rays.len() < MIN_RAYS {
            return &self.order;
        }
        let (low, high) = extent_of(rays.clone().map(P::origin));
        if is_in_order(rays.clone().map(P::origin), high - low) {
            return &self.order;
        }
        let Self { cells, places, order, .. } = self;
        let grid = Grid::new(low, high);
        places.clear();
        places.resize(CELLS, 0);
        cells.clear();
        cells.extend(rays.map(|ray| {
            let cell = grid.cell(P::origin(ray));
            places[cell as usize % CELLS] += 1;
            cell
        }));
        let mut sum = 0;
        for place in places.iter_mut() {
            sum += std::mem::replace(place, sum);
        }
        order.resize(cells.len(), 0);
        for (number, &cell) in cells.iter().enumerate() {
            let place = &mut places[cell as usize % CELLS];
            order[*place as usize] = number as u32;
            *place += 1;
        }
        order
    }
}

/// Approximate bounds of all origins, from every [`STEP`]-th one. (Origins outside of the bounds
/// are clamped to them.)
fn extent_of(origins: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    origins
        .step_by(STEP)
        .filter(|o| o.is_finite())
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), o| (low.min(o), high.max(o)))
}

/// True if most origins are close to the previous one.
fn is_in_order(origins: impl ExactSizeIterator<Item = Vec3> + Clone, extent: Vec3) -> bool {
    let step = (origins.len() / SAMPLES).max(1);
    let pairs = origins.clone().zip(origins.skip(1)).step_by(step);
    let count = pairs.len();
    let close = pairs.filter(|(a, b)| (*b - *a).abs().cmple(extent * CLOSE).all()).count();
    close * 4 > count * 3
}

/// A grid over the origins.
struct Grid {
    low: Vec3,
    scale: Vec3,
}

impl Grid {
    const LAST: f32 = ((1 << CELL_BITS) - 1) as f32;

    fn new(low: Vec3, high: Vec3) -> Self {
        Self { low, scale: Vec3::splat(Self::LAST) / (high - low) }
    }

    /// The Morton code of a point's cell; an arbitrary valid code if the point is not finite.
    #[inline(always)]
    fn cell(&self, point: Vec3) -> u16 {
        // Adding this constant rounds a number and puts it in the low bits, without range checks.
        const TO_WHOLE: f32 = (1 << 23) as f32;
        let at = ((point - self.low) * self.scale).max(Vec3::ZERO).min(Vec3::splat(Self::LAST))
            + TO_WHOLE;
        let spread = |x: f32| SPREAD[x.to_bits() as usize % SPREAD.len()];
        (spread(at.x) | spread(at.y) << 1 | spread(at.z) << 2) as u16
    }
}

/// Table that spreads the bits of a coordinate along one axis for a Morton code.
static SPREAD: [u32; 1 << CELL_BITS] = morton::spread();

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hit::Hit;
    use crate::kernel::stream::interleave::pays_to_sort;
    use crate::precision::Single;
    use crate::search::Closest;
    use crate::search::{AcceptAll, Grouping};
    use crate::world::tests::{Random, dust};
    use crate::world::{BuildOptions, Structure, WorldBuilder};
    use snell_math::Ray;
    use std::sync::Arc;

    fn random_rays(count: usize, extent: f32) -> Vec<Ray> {
        let mut random = Random(11);
        (0..count).map(|_| Ray::new(random.point(extent), random.direction())).collect()
    }

    #[test]
    fn every_ray_of_a_sorted_batch_has_its_turn_once() {
        let mut rays = random_rays(MIN_RAYS + 5, 2.0);
        rays[7].origin = Vec3::NAN;
        rays[8].origin = Vec3::INFINITY;
        for count in [MIN_RAYS, rays.len()] {
            let rays = Rays::<Single>::new(&rays[..count]);
            let mut sorter = Sorter::new(count, true);
            assert_eq!(sorter.parts().next(), Some(0..count));
            let mut order = sorter.order(rays).to_vec();
            assert!(order.windows(2).any(|pair| pair[0] > pair[1]));
            order.sort_unstable();
            assert!(
                order.iter().enumerate().all(|(i, &number)| i == number as usize)
                    && order.len() == count
            );
        }
    }

    #[test]
    fn sorted_rays_start_near_each_other() {
        let rays = random_rays(MIN_RAYS, 2.0);
        let mut sorter = Sorter::new(rays.len(), true);
        let order = sorter.order(Rays::<Single>::new(&rays)).to_vec();
        let sum = |of: &dyn Fn(usize) -> Vec3| {
            (1..rays.len()).map(|i| of(i).distance(of(i - 1))).sum::<f32>()
        };
        let (before, after) = (sum(&|i| rays[i].origin), sum(&|i| rays[order[i] as usize].origin));
        assert!(after < 0.1 * before, "{before} {after}");
        let sorted: Vec<Ray> = order.iter().map(|&i| rays[i as usize]).collect();
        assert!(sorter.order(Rays::<Single>::new(&sorted)).is_empty(), "what is in order stays so");
    }

    #[test]
    fn parts_are_of_equal_size_and_small_batches_are_not_sorted() {
        let sizes = |rays, sorts| {
            Sorter::new(rays, sorts).parts().map(|part| part.len()).collect::<Vec<_>>()
        };
        assert_eq!(sizes(3 * MAX_RAYS - 1, true), [MAX_RAYS, MAX_RAYS, MAX_RAYS - 1]);
        assert_eq!(sizes(3 * MAX_RAYS, false), [3 * MAX_RAYS]);
        assert!(sizes(0, true).is_empty());
        let rays = random_rays(MIN_RAYS - 1, 1.0);
        assert!(Sorter::new(rays.len(), true).order(Rays::<Single>::new(&rays)).is_empty());
    }

    #[test]
    fn a_sorted_batch_finds_what_single_rays_find() {
        let mut random = Random(3);
        let mesh = dust(&mut random, 700_000);
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
        let options = BuildOptions {
            accelerator: crate::world::AcceleratorKind::Bvh,
            ..BuildOptions::default()
        };
        let world = builder.build(&options).expect("it builds");
        let Structure::Bvh(forest) = &world.structure else { panic!("no tree") };
        assert!(
            pays_to_sort::<Closest<Single>>(forest, world.wide),
            "large enough to be sorted for"
        );
        let mut rays = random_rays(MAX_RAYS + 100, 1.0);
        rays[50].direction = Vec3::ZERO;
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
        world.occluded(&rays, Grouping::None, &AcceptAll, &mut blocked);
        for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked) {
            assert_eq!(world.closest_one(ray, &AcceptAll), *hit);
            assert_eq!(hit.is_hit(), *blocked);
        }
    }
}
