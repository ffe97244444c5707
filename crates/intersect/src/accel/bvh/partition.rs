//! Reordering a set into two parts, in place; large sets by several threads.

use super::bins::{CHUNK, PARALLEL};
use super::primitive::{Box4, Primitive};
use rayon::prelude::*;
use snell_math::{Vec3, Vec4};
use std::cell::RefCell;

/// The size of the first part and, for both, the boxes around the doubled centres.
pub(super) struct Parts {
    pub first: usize,
    pub centers: [Box4; 2],
}

/// Moves the primitives whose doubled centre satisfies `is_first` to the front. The order within the parts is arbitrary but
/// always the same.
pub(super) fn partition(primitives: &mut [Primitive], is_first: impl Fn(Vec4) -> bool + Sync) -> Parts {
    if primitives.len() < PARALLEL {
        return partition_piece(primitives, &is_first);
    }
    let pieces: Vec<Parts> = primitives.par_chunks_mut(CHUNK).map(|c| partition_piece(c, &is_first)).collect();
    let first = pieces.iter().map(|p| p.first).sum();
    exchange(primitives, &pieces, first);
    let centers = |side: usize| pieces.iter().fold(Box4::EMPTY, |b, p| b.union(&p.centers[side]));
    Parts { first, centers: [centers(0), centers(1)] }
}

/// Stable, and without a branch on data, which could not be predicted: every primitive is written to where it would go in either
/// part, the second part to other memory first.
fn partition_piece(primitives: &mut [Primitive], is_first: &impl Fn(Vec4) -> bool) -> Parts {
    SECOND.with_borrow_mut(|second| {
        let n = primitives.len();
        if second.len() < n {
            second.resize(n, Primitive::new(Vec3::ZERO, Vec3::ZERO, 0));
        }
        let (second, mut first) = (&mut second[..n], 0);
        for i in 0..n {
            let p = primitives[i];
            // `first` never passes `i`: the slot is free, and `i - first` are in the second part.
            primitives[first] = p;
            second[i - first] = p;
            first += usize::from(is_first(p.center2()));
        }
        primitives[first..].copy_from_slice(&second[..n - first]);
        let (a, b) = primitives.split_at(first);
        Parts { first, centers: [centers(a), centers(b)] }
    })
}

thread_local! {
    /// Memory for the second part of small sets.
    static SECOND: RefCell<Vec<Primitive>> = const { RefCell::new(Vec::new()) };
}

fn centers(primitives: &[Primitive]) -> Box4 {
    primitives.iter().fold(Box4::EMPTY, |b, p| b.with_point(p.center2()))
}

/// Each piece is partitioned in itself: exchanges the second parts that lie before `first` with the first parts that lie behind it.
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
    let (mut a, mut b) = (ranges(front, &wrong_front).into_iter(), ranges(back, &wrong_back).into_iter());
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

/// The parts of a slice at ascending disjoint ranges that are not empty.
fn ranges<'a>(mut slice: &'a mut [Primitive], ranges: &[std::ops::Range<usize>]) -> Vec<&'a mut [Primitive]> {
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
    use super::super::primitive::Numbered;
    use super::*;
    use snell_math::rng;

    #[test]
    fn large_and_small_sets_are_parted_without_loss() {
        for n in [0, 1, 2, 9, 1000, PARALLEL, PARALLEL + 3 * CHUNK + 17] {
            for share in [0.0, 0.001, 0.5, 0.9, 1.0] {
                let x = |i: u32| rng::to_unit(rng::hash32(i));
                let mut set: Vec<_> =
                    (0..n as u32).map(|i| Primitive::new(Vec3::splat(x(i)), Vec3::splat(x(i)), i)).collect();
                let parts = partition(&mut set, |c| c.x < 2.0 * share);
                assert!(set[..parts.first].iter().all(|p| p.center2().x < 2.0 * share));
                assert!(set[parts.first..].iter().all(|p| p.center2().x >= 2.0 * share));
                let mut ids: Vec<_> = set.iter().map(Numbered::id).collect();
                ids.sort_unstable();
                assert!(ids.into_iter().eq(0..n as u32));
                let low = set[..parts.first].iter().fold(f32::INFINITY, |m, p| m.min(p.center2().x));
                assert_eq!(parts.centers[0].low.x, low);
            }
        }
    }
}
