//! Where to divide a set of primitives: the surface area heuristic over bins (Wald, On fast construction of SAH-based bounding
//! volume hierarchies, 2007).

use super::primitive::{Box4, Primitive};
use rayon::prelude::*;
use snell_math::Vec4;

/// Bins per axis.
const BINS: usize = 16;

/// Sets at least this large are binned and partitioned by several threads, in pieces of [`CHUNK`]. The result is the same: minima,
/// maxima and counts do not depend on the order.
pub(super) const PARALLEL: usize = 1 << 15;
pub(super) const CHUNK: usize = 1 << 13;

/// Boxes around the primitives of a set, and around their doubled centres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub bounds: Box4,
    pub centers: Box4,
}

impl Extent {
    pub const EMPTY: Self = Self { bounds: Box4::EMPTY, centers: Box4::EMPTY };

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
        primitives.par_chunks(CHUNK).map(of).reduce(|| Self::EMPTY, |a, b| a.union(&b))
    }

    fn union(&self, other: &Self) -> Self {
        Self { bounds: self.bounds.union(&other.bounds), centers: self.centers.union(&other.centers) }
    }
}

/// What lies in each bin, by bin and axis.
#[derive(Clone)]
pub(super) struct Bins {
    boxes: [[Box4; 3]; BINS],
    counts: [[u32; 3]; BINS],
}

impl Bins {
    const EMPTY: Self = Self { boxes: [[Box4::EMPTY; 3]; BINS], counts: [[0; 3]; BINS] };

    /// Sorts a set into bins.
    pub fn of(binning: &Binning, primitives: &[Primitive]) -> Self {
        if primitives.len() < PARALLEL {
            return Self::of_piece(binning, primitives);
        }
        primitives.par_chunks(CHUNK).map(|c| Self::of_piece(binning, c)).reduce(|| Self::EMPTY, Self::union)
    }

    fn of_piece(binning: &Binning, primitives: &[Primitive]) -> Self {
        let mut bins = Self::EMPTY;
        for p in primitives {
            let at = binning.bins_of(p.center2());
            for axis in 0..3 {
                let bin = &mut bins.boxes[at[axis]][axis];
                *bin = bin.union(p.bounds());
                bins.counts[at[axis]][axis] += 1;
            }
        }
        bins
    }

    fn union(mut self, other: Self) -> Self {
        for i in 0..BINS {
            for axis in 0..3 {
                self.boxes[i][axis] = self.boxes[i][axis].union(&other.boxes[i][axis]);
                self.counts[i][axis] += other.counts[i][axis];
            }
        }
        self
    }

    /// The division of least cost; `None` if all primitives share a bin on every axis.
    pub fn best_plane(&self) -> Option<Plane> {
        let mut right = [([Box4::EMPTY; 3], [0; 3]); BINS];
        let (mut boxes, mut counts) = ([Box4::EMPTY; 3], [0; 3]);
        for i in (1..BINS).rev() {
            for axis in 0..3 {
                boxes[axis] = boxes[axis].union(&self.boxes[i][axis]);
                counts[axis] += self.counts[i][axis];
            }
            right[i] = (boxes, counts);
        }
        (boxes, counts) = ([Box4::EMPTY; 3], [0; 3]);
        let (mut best, mut best_cost) = (None, f32::INFINITY);
        for i in 1..BINS {
            for axis in 0..3 {
                boxes[axis] = boxes[axis].union(&self.boxes[i - 1][axis]);
                counts[axis] += self.counts[i - 1][axis];
                let (right_box, right_count) = (right[i].0[axis], right[i].1[axis]);
                let cost = cost(&boxes[axis], counts[axis]) + cost(&right_box, right_count);
                let divides = counts[axis] > 0 && right_count > 0;
                // Areas may overflow to infinity: any division is better than none.
                if divides && (cost < best_cost || best.is_none()) {
                    best_cost = cost;
                    best = Some(Plane { axis, bin: i as u32, bounds: [boxes[axis], right_box], cost });
                }
            }
        }
        best
    }
}

/// What it costs to visit a set: area times blocks of up to eight triangles.
#[inline(always)]
fn cost(bounds: &Box4, count: u32) -> f32 {
    bounds.half_area() * blocks(count)
}

/// How many blocks of up to eight triangles a set will need. Large ones do not fill their blocks evenly anyway.
#[inline(always)]
pub(super) fn blocks(count: u32) -> f32 {
    if count > 256 { count as f32 / 8.0 } else { count.div_ceil(8) as f32 }
}

/// A division between bins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub axis: usize,
    /// The first bin of the second part.
    pub bin: u32,
    /// The boxes of both parts.
    pub bounds: [Box4; 2],
    /// Area times blocks.
    pub cost: f32,
}

/// Maps doubled centres to bins.
#[derive(Clone, Copy)]
pub(super) struct Binning {
    low: Vec4,
    scale: Vec4,
}

impl Binning {
    /// `centers` is the box around the doubled centres.
    pub fn new(centers: &Box4) -> Self {
        let size = centers.high - centers.low;
        let scale = Vec4::select(size.cmpgt(Vec4::ZERO), Vec4::splat(BINS as f32 * 0.9999) / size, Vec4::ZERO);
        // Tiny and overflown extents give no usable scale: one bin for all.
        let usable = scale.is_finite_mask() & size.is_finite_mask();
        Self { low: centers.low, scale: Vec4::select(usable, scale, Vec4::ZERO) }
    }

    /// The bin on each axis, plus `2^23`: so it is in the low bits.
    #[inline(always)]
    fn bins_as_floats(&self, center2: Vec4) -> Vec4 {
        // Half a bin less, rounded to the nearest by adding `2^23`.
        let x = (center2 - self.low) * self.scale - 0.5;
        x.max(Vec4::ZERO).min(Vec4::splat((BINS - 1) as f32)) + FIRST_INTEGER
    }

    /// The bin on each axis.
    #[inline(always)]
    fn bins_of(&self, center2: Vec4) -> [usize; 3] {
        let x = self.bins_as_floats(center2);
        let bin = |x: f32| (x.to_bits() & (BINS as u32 - 1)) as usize;
        [bin(x.x), bin(x.y), bin(x.z)]
    }

    /// True if the primitive belongs to the first part.
    #[inline(always)]
    pub fn is_first(&self, plane: &Plane, center2: Vec4) -> bool {
        let before = self.bins_as_floats(center2).cmplt(Vec4::splat(plane.bin as f32 + FIRST_INTEGER));
        before.bitmask() >> plane.axis & 1 == 1
    }
}

/// From here on `f32` has only integers.
const FIRST_INTEGER: f32 = 8388608.0;
