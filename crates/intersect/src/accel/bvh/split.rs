//! Where to divide a set of primitives: the surface area heuristic over bins (Wald, On fast construction of SAH-based bounding
//! volume hierarchies, 2007).

use rayon::prelude::*;
use snell_math::{Bounds3, Vec3};

/// A primitive to be sorted into a tree.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Primitive {
    pub min: Vec3,
    pub id: u32,
    pub max: Vec3,
    pub is_object: bool,
}

impl Primitive {
    pub fn bounds(&self) -> Bounds3 {
        Bounds3 { min: self.min, max: self.max }
    }

    fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }
}

/// Bins per axis.
const BINS: usize = 16;

/// Sets at least this large are binned by several threads. The result is the same: minima, maxima and counts do not depend on
/// the order.
const PARALLEL: usize = 1 << 16;
const CHUNK: usize = 1 << 14;

/// Boxes around the primitives and around their centres.
pub(super) fn extent(primitives: &[Primitive]) -> [Bounds3; 2] {
    let add = |[a, c]: [Bounds3; 2], p: &Primitive| [a.union(&p.bounds()), c.with_point(p.center())];
    let merge = |x: [Bounds3; 2], y: [Bounds3; 2]| [x[0].union(&y[0]), x[1].union(&y[1])];
    let empty = || [Bounds3::EMPTY; 2];
    if primitives.len() < PARALLEL {
        return primitives.iter().fold(empty(), add);
    }
    primitives.par_chunks(CHUNK).map(|c| c.iter().fold(empty(), add)).reduce(empty, merge)
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Bounds3,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Bounds3::EMPTY, count: 0 };

    fn union(&self, other: &Self) -> Self {
        Self { bounds: self.bounds.union(&other.bounds), count: self.count + other.count }
    }

    /// What it costs to visit: area times blocks of up to eight triangles.
    fn cost(&self) -> f32 {
        let blocks = if self.count > 256 { self.count as f32 / 8.0 } else { self.count.div_ceil(8) as f32 };
        self.bounds.half_area() * blocks
    }
}

type Bins = [[Bin; BINS]; 3];

/// Maps centres to bins.
struct Binning {
    low: Vec3,
    scale: Vec3,
}

impl Binning {
    fn new(centers: &Bounds3) -> Self {
        let size = centers.size();
        let scale = Vec3::select(size.cmpgt(Vec3::ZERO), Vec3::splat(BINS as f32 * 0.9999) / size, Vec3::ZERO);
        // Tiny extents give an infinite scale: one bin for all, and the middle is used.
        Self { low: centers.min, scale: Vec3::select(scale.is_finite_mask(), scale, Vec3::ZERO) }
    }

    fn bins_of(&self, p: &Primitive) -> [usize; 3] {
        ((p.center() - self.low) * self.scale).to_array().map(|x| (x as usize).min(BINS - 1))
    }

    fn fill(&self, primitives: &[Primitive]) -> Bins {
        let mut bins = [[Bin::EMPTY; BINS]; 3];
        for p in primitives {
            let bounds = p.bounds();
            for (axis, &i) in self.bins_of(p).iter().enumerate() {
                let bin = &mut bins[axis][i];
                bin.bounds = bin.bounds.union(&bounds);
                bin.count += 1;
            }
        }
        bins
    }
}

/// Reorders the primitives into two parts and returns the size of the first; both hold at least one. `centers` is the box
/// around their centres. There must be at least two.
pub(super) fn split(primitives: &mut [Primitive], centers: &Bounds3) -> usize {
    let binning = Binning::new(centers);
    let bins = if primitives.len() < PARALLEL {
        binning.fill(primitives)
    } else {
        let merge = |mut a: Bins, b: Bins| {
            a.iter_mut().flatten().zip(b.iter().flatten()).for_each(|(x, y)| *x = x.union(y));
            a
        };
        primitives.par_chunks(CHUNK).map(|c| binning.fill(c)).reduce(|| [[Bin::EMPTY; BINS]; 3], merge)
    };
    let Some((axis, first_right)) = best_plane(&bins) else { return primitives.len() / 2 };
    partition(primitives, |p| binning.bins_of(p)[axis] < first_right)
}

/// The axis and the first bin of the second part with the least cost; `None` if all primitives share a bin on every axis.
fn best_plane(bins: &Bins) -> Option<(usize, usize)> {
    let mut best = None;
    let mut best_cost = f32::INFINITY;
    for (axis, bins) in bins.iter().enumerate() {
        let mut right = [Bin::EMPTY; BINS];
        let mut sum = Bin::EMPTY;
        for i in (1..BINS).rev() {
            sum = sum.union(&bins[i]);
            right[i] = sum;
        }
        let mut left = Bin::EMPTY;
        for i in 1..BINS {
            left = left.union(&bins[i - 1]);
            let cost = left.cost() + right[i].cost();
            let divides = left.count > 0 && right[i].count > 0;
            // Areas may overflow to infinity: any division is better than none.
            if divides && (cost < best_cost || best.is_none()) {
                (best, best_cost) = (Some((axis, i)), cost);
            }
        }
    }
    best
}

/// Moves the primitives for which `is_first` holds to the front and returns how many they are.
fn partition(primitives: &mut [Primitive], is_first: impl Fn(&Primitive) -> bool) -> usize {
    let (mut low, mut high) = (0, primitives.len());
    while low < high {
        if is_first(&primitives[low]) {
            low += 1;
        } else {
            high -= 1;
            primitives.swap(low, high);
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32, id: u32) -> Primitive {
        Primitive { min: Vec3::new(x, 0.0, 0.0), id, max: Vec3::new(x + 0.1, 1.0, 1.0), is_object: false }
    }

    #[test]
    fn two_clusters_are_divided_between_them() {
        let mut set: Vec<_> = (0..20).map(|i| at(if i % 2 == 0 { 0.0 } else { 50.0 } + i as f32 * 0.1, i)).collect();
        let centers = extent(&set)[1];
        let n = split(&mut set, &centers);
        assert_eq!(n, 10);
        assert!(set[..n].iter().all(|p| p.id % 2 == 0));
    }

    #[test]
    fn equal_and_extreme_primitives_are_divided_somewhere() {
        for x in [0.0, 3e38, -3e38, 1e-45] {
            let mut set = vec![at(x, 0), at(x, 1), at(x, 2)];
            let centers = extent(&set)[1];
            let n = split(&mut set, &centers);
            assert!(n > 0 && n < 3);
        }
        let mut set = vec![at(-3e38, 0), at(3e38, 1)];
        let centers = extent(&set)[1];
        assert_eq!(split(&mut set, &centers), 1);
    }
}
