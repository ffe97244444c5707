//! Partitioning of a set into two parts, in place; large sets by several threads.

use super::binning::{BinPlane, Binning, Box8, Parts, Primitive, part};
use super::bins::{CHUNK, PARALLEL};
use rayon::prelude::*;
use snell_math::Vec3;
use snell_math::simd::Wide;
use std::cell::RefCell;

/// Moves the primitives before the plane to the front. The order within the parts is arbitrary but
/// deterministic.
pub(super) fn partition(
    wide: Option<Wide>,
    binning: &Binning,
    plane: BinPlane,
    primitives: &mut [Primitive],
) -> Parts {
    let part = |piece: &mut [Primitive]| {
        SCRATCH.with_borrow_mut(|scratch| {
            if scratch.len() < piece.len() {
                scratch.resize(piece.len(), Primitive::new(Vec3::ZERO, Vec3::ZERO, 0));
            }
            part(wide, binning, plane, piece, scratch)
        })
    };
    if primitives.len() < PARALLEL {
        return part(primitives);
    }
    let pieces: Vec<Parts> = primitives.par_chunks_mut(CHUNK).map(part).collect();
    let first = pieces.iter().map(|p| p.first).sum();
    exchange(primitives, &pieces, first);
    let centers = |side: usize| pieces.iter().fold(Box8::EMPTY, |b, p| b.union(&p.centers[side]));
    Parts { first, centers: [centers(0), centers(1)] }
}

thread_local! {
    /// Memory for the second part, used for small sets.
    static SCRATCH: RefCell<Vec<Primitive>> = const { RefCell::new(Vec::new()) };
}

/// Completes a partition whose pieces are partitioned one by one: exchanges primitives of the
/// second part that lie before `first` with primitives of the first part that lie behind it.
fn exchange(primitives: &mut [Primitive], pieces: &[Parts], first: usize) {
    let (front, back) = primitives.split_at_mut(first);
    // Ranges of the front that belong to the second part, and of the back that belong to the first.
    let (mut wrong_front, mut wrong_back) = (Vec::new(), Vec::new());
    for (i, piece) in pieces.iter().enumerate() {
        let start = i * CHUNK;
        let (middle, end) = (start + piece.first, (start + CHUNK).min(first + back.len()));
        if middle < first {
            wrong_front.push(middle..end.min(first));
        }
        if middle > first {
            wrong_back.push(start.max(first) - first..middle - first);
        }
    }
    let mut pairs = Vec::new();
    let (mut a, mut b) =
        (ranges(front, &wrong_front).into_iter(), ranges(back, &wrong_back).into_iter());
    let (mut x, mut y): (&mut [Primitive], &mut [Primitive]) = (&mut [], &mut []);
    loop {
        if x.is_empty() {
            let Some(next) = a.next() else { break };
            x = next;
        }
        if y.is_empty() {
            let Some(next) = b.next() else { break };
            y = next;
        }
        let n = x.len().min(y.len());
        let ((x0, x1), (y0, y1)) = (x.split_at_mut(n), y.split_at_mut(n));
        pairs.push((x0, y0));
        (x, y) = (x1, y1);
    }
    pairs.into_par_iter().for_each(|(x, y)| x.swap_with_slice(y));
}

/// Mutable subslices at ascending disjoint ranges that are not empty.
fn ranges<'a>(
    mut slice: &'a mut [Primitive],
    ranges: &[std::ops::Range<usize>],
) -> Vec<&'a mut [Primitive]> {
    let mut start = 0;
    let mut parts = Vec::with_capacity(ranges.len());
    for range in ranges.iter().filter(|r| !r.is_empty()) {
        let (part, rest) = slice.split_at_mut(range.end - start);
        parts.push(&mut part[range.start - start..]);
        (slice, start) = (rest, range.end);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::primitive::Numbered;
    use snell_math::rng;
    use snell_math::simd::Level;

    #[test]
    fn large_and_small_sets_are_parted_without_loss_alike_at_every_level() {
        for n in [1, 2, 9, 1000, PARALLEL, PARALLEL + 3 * CHUNK + 17] {
            for bin in [0, 1, 5, 15, 16] {
                let x = |i: u32| rng::to_unit(rng::hash32(i));
                let set: Vec<_> = (0..n as u32)
                    .map(|i| Primitive::new(Vec3::splat(x(i)), Vec3::splat(x(i)), i))
                    .collect();
                let binning = Binning::new(&Box8::new(Vec3::ZERO, Vec3::splat(2.0)));
                let run = |level: Level| {
                    let mut set = set.clone();
                    (partition(level.wide(), &binning, BinPlane { axis: 1, bin }, &mut set), set)
                };
                let (parts, set) = run(Level::Scalar);
                let (same, best) = run(Level::best());
                let ids = |set: &[Primitive]| set.iter().map(Numbered::id).collect::<Vec<_>>();
                assert!(parts.first == same.first && ids(&set) == ids(&best));
                let highest = |set: &[Primitive]| {
                    set.iter().map(|p| p.center2().y).fold(f32::NEG_INFINITY, f32::max)
                };
                let lowest = |set: &[Primitive]| {
                    set.iter().map(|p| p.center2().y).fold(f32::INFINITY, f32::min)
                };
                let (a, b) = set.split_at(parts.first);
                assert!(highest(a) <= lowest(b), "{n} {bin}");
                assert_eq!(parts.centers[1].low().y, lowest(b));
                let mut all = ids(&set);
                all.sort_unstable();
                assert!(all.into_iter().eq(0..n as u32));
            }
        }
    }
}
