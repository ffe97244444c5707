//! The split of a set of primitives: the binned surface area heuristic (Wald, On fast construction
//! of SAH-based bounding volume hierarchies, 2007).

use super::binning::{BINS, BinPlane, Binning, Bins, Box8, Primitive, fill};
use rayon::prelude::*;
use snell_math::simd::Wide;

/// Sets of at least this many primitives are binned and partitioned by several threads. The result
/// is the same, because minima, maxima and counts do not depend on the order.
pub(super) const PARALLEL: usize = 1 << 15;
/// The number of primitives that a thread takes at a time.
pub(super) const CHUNK: usize = 1 << 13;

/// Boxes around the primitives of a set, and around the doubled centres of the primitives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub bounds: Box8,
    pub centers: Box8,
}

impl Extent {
    const EMPTY: Self = Self { bounds: Box8::EMPTY, centers: Box8::EMPTY };

    pub fn of(primitives: &[Primitive]) -> Self {
        let of = |primitives: &[Primitive]| {
            primitives.iter().fold(Self::EMPTY, |e, p| Self {
                bounds: e.bounds.union(p.bounds()),
                centers: e.centers.with_point(p.center2()),
            })
        };
        if primitives.len() < PARALLEL {
            return of(primitives);
        }
        let union = |a: Self, b: Self| Self {
            bounds: a.bounds.union(&b.bounds),
            centers: a.centers.union(&b.centers),
        };
        primitives.par_chunks(CHUNK).map(of).reduce(|| Self::EMPTY, union)
    }
}

/// Sorts a set into bins.
pub(super) fn bins_of(wide: Option<Wide>, binning: &Binning, primitives: &[Primitive]) -> Bins {
    let of = |primitives: &[Primitive]| {
        let mut bins = Bins::EMPTY;
        fill(wide, binning, primitives, &mut bins);
        bins
    };
    if primitives.len() < PARALLEL {
        return of(primitives);
    }
    primitives.par_chunks(CHUNK).map(of).reduce(|| Bins::EMPTY, union)
}

fn union(mut a: Bins, b: Bins) -> Bins {
    for axis in 0..3 {
        for i in 0..BINS {
            a.boxes[axis][i] = a.boxes[axis][i].union(&b.boxes[axis][i]);
            a.counts[axis][i] += b.counts[axis][i];
        }
    }
    a
}

/// A division of a set at a plane between bins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub at: BinPlane,
    /// The boxes of both parts.
    pub bounds: [Box8; 2],
    /// The sum over both parts of half the area times the number of blocks.
    pub cost: f32,
}

/// The division of least cost; `None` if on every axis all primitives share a bin.
pub(super) fn best_plane(bins: &Bins) -> Option<Plane> {
    let mut best = None;
    let mut best_cost = f32::INFINITY;
    for axis in 0..3 {
        let (boxes, counts) = (&bins.boxes[axis], &bins.counts[axis]);
        // Cost and count of the primitives from each bin to the last.
        let mut right = [(0.0, 0); BINS];
        let (mut bounds, mut count) = (Box8::EMPTY, 0);
        for i in (1..BINS).rev() {
            bounds = bounds.union(&boxes[i]);
            count += counts[i];
            right[i] = (cost(&bounds, count), count);
        }
        (bounds, count) = (Box8::EMPTY, 0);
        for i in 1..BINS {
            bounds = bounds.union(&boxes[i - 1]);
            count += counts[i - 1];
            let (right_cost, right_count) = right[i];
            let cost = cost(&bounds, count) + right_cost;
            let divides = count > 0 && right_count > 0;
            // Areas may overflow to infinity; then any division is better than none.
            if divides && (cost < best_cost || best.is_none()) {
                best_cost = cost;
                best = Some(BinPlane { axis, bin: i });
            }
        }
    }
    let at = best?;
    let (a, b) = bins.boxes[at.axis].split_at(at.bin);
    let bounds = |boxes: &[Box8]| boxes.iter().fold(Box8::EMPTY, |a, b| a.union(b));
    Some(Plane { at, bounds: [bounds(a), bounds(b)], cost: best_cost })
}

/// The cost of visiting a set: half the area times the number of blocks of up to eight triangles.
#[inline(always)]
fn cost(bounds: &Box8, count: u32) -> f32 {
    bounds.half_area() * blocks(count)
}

/// The number of blocks of up to eight triangles that a set will need. It is not rounded up for
/// large sets, because these do not fill their blocks evenly anyway.
#[inline(always)]
pub(super) fn blocks(count: u32) -> f32 {
    if count > 256 { count as f32 / 8.0 } else { count.div_ceil(8) as f32 }
}
