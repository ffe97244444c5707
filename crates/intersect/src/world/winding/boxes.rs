//! A tree of boxes that finds the boxes above a point along an axis, or around it.
//!
//! A node has eight children. Boxes and points are rounded to `f32` relative to a centre, which
//! keeps their order: no box is lost, and the few that are found in excess are for the caller to
//! reject.

use rayon::prelude::*;
use snell_math::{Bounds3d, DVec3};

/// The largest number of boxes in a leaf.
const LEAF: usize = 4;

/// Nodes with more boxes than this are built by several threads.
const PARALLEL: usize = 4096;

/// Eight children: first the lows and highs along the two axes across, then along the axis.
#[derive(Clone, Debug)]
struct Node {
    low: [[f32; 8]; 3],
    high: [[f32; 8]; 3],
    /// The node of an inner child, or the first item of a leaf.
    first: [u32; 8],
    /// The number of items of a leaf; 0 for an inner child.
    count: [u32; 8],
}

impl Node {
    const EMPTY: Self = Self {
        low: [[f32::INFINITY; 8]; 3],
        high: [[f32::NEG_INFINITY; 8]; 3],
        first: [0; 8],
        count: [0; 8],
    };
}

/// The tree. Items are numbered by their place in the order of the leaves.
#[derive(Debug, Default)]
pub struct Boxes {
    nodes: Vec<Node>,
    center: DVec3,
    /// Two axes across, and the axis along which boxes above a point are found.
    axes: [usize; 3],
}

/// Which boxes are found.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Above,
    Around,
}

impl Boxes {
    /// Builds the tree; also returns the numbers of the boxes in the order of the items.
    pub fn build(boxes: &[Bounds3d]) -> (Self, Vec<u32>) {
        let all = boxes.iter().fold(Bounds3d::EMPTY, |all, b| all.union(b));
        let center = if all.is_finite() { all.center() } else { DVec3::ZERO };
        let axis = best_axis(boxes, &all);
        let mut this =
            Self { nodes: Vec::new(), center, axes: [(axis + 1) % 3, (axis + 2) % 3, axis] };
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        if !boxes.is_empty() {
            this.nodes = build(&this, boxes, &mut order, 0);
        }
        (this, order)
    }

    /// The axes of the tree, in cyclic order: two across, and the one along which boxes above a
    /// point are found.
    pub fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// Calls `visit` for each box that a ray from the point along the axis meets, until it returns
    /// true; then the result is true.
    #[inline]
    pub fn above(&self, point: DVec3, visit: impl FnMut(u32) -> bool) -> bool {
        self.find(Kind::Above, point, visit)
    }

    /// Calls `visit` for each box around the point, until it returns true; then the result is true.
    #[inline]
    pub fn around(&self, point: DVec3, visit: impl FnMut(u32) -> bool) -> bool {
        self.find(Kind::Around, point, visit)
    }

    fn rounded(&self, point: DVec3) -> [f32; 3] {
        self.axes.map(|axis| (point[axis] - self.center[axis]) as f32)
    }

    #[inline(always)]
    fn find(&self, kind: Kind, point: DVec3, mut visit: impl FnMut(u32) -> bool) -> bool {
        if self.nodes.is_empty() {
            return false;
        }
        let [x, y, z] = self.rounded(point);
        // Each of at most eleven levels leaves at most seven entries.
        let mut stack = [0u32; 96];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let node = &self.nodes[stack[top] as usize];
            let mut found = 0u32;
            for i in 0..8 {
                let across = (node.low[0][i] <= x)
                    & (x <= node.high[0][i])
                    & (node.low[1][i] <= y)
                    & (y <= node.high[1][i]);
                let along = (z <= node.high[2][i]) & (kind == Kind::Above || node.low[2][i] <= z);
                found |= u32::from(across & along) << i;
            }
            while found != 0 {
                let i = found.trailing_zeros() as usize;
                found &= found - 1;
                let (first, count) = (node.first[i], node.count[i]);
                if count == 0 {
                    stack[top] = first;
                    top += 1;
                } else if (first..first + count).any(&mut visit) {
                    return true;
                }
            }
        }
        false
    }
}

/// The axis along which a ray from a point of the whole meets the fewest boxes on average.
fn best_axis(boxes: &[Bounds3d], all: &Bounds3d) -> usize {
    let across = |b: &Bounds3d, axis: usize| {
        let size = b.size();
        size[(axis + 1) % 3] * size[(axis + 2) % 3]
    };
    let cost = |axis: usize| {
        let cost = boxes.iter().map(|b| across(b, axis)).sum::<f64>() / across(all, axis);
        if cost.is_nan() { f64::INFINITY } else { cost }
    };
    // The upright axis is the usual choice of equals.
    let costs = [cost(0), cost(1), cost(2)];
    [2, 1, 0].into_iter().min_by(|&a, &b| costs[a].total_cmp(&costs[b])).unwrap_or(2)
}

/// Builds the nodes of a part of the order, which begins at the item `first`; the first of them is
/// the root.
fn build(tree: &Boxes, boxes: &[Bounds3d], order: &mut [u32], first: u32) -> Vec<Node> {
    let whole = 0..order.len();
    let mut parts = vec![whole];
    // The largest part is divided until there are eight.
    while parts.len() < 8 {
        let largest = (0..parts.len()).max_by_key(|&i| parts[i].len()).unwrap_or(0);
        let part = parts[largest].clone();
        if part.len() <= LEAF {
            break;
        }
        let middle = part.start + divide(boxes, &mut order[part.clone()]);
        parts[largest] = part.start..middle;
        parts.push(middle..part.end);
    }
    parts.sort_by_key(|part| part.start);
    let mut rest = &mut *order;
    let mut slices = Vec::with_capacity(8);
    for part in &parts {
        let (slice, others) = rest.split_at_mut(part.len());
        rest = others;
        slices.push((part.start, slice));
    }
    let child = |(start, slice): (usize, &mut [u32])| {
        let first = first + start as u32;
        let bounds = slice.iter().fold(Bounds3d::EMPTY, |b, &i| b.union(&boxes[i as usize]));
        let nodes = if slice.len() <= LEAF { Vec::new() } else { build(tree, boxes, slice, first) };
        (bounds, first, slice.len() as u32, nodes)
    };
    let many = slices.iter().map(|s| s.1.len()).sum::<usize>() > PARALLEL;
    let children: Vec<_> = if many {
        slices.into_par_iter().map(child).collect()
    } else {
        slices.into_iter().map(child).collect()
    };
    let mut nodes = vec![Node::EMPTY];
    for (i, (bounds, first, count, below)) in children.into_iter().enumerate() {
        let (low, high) = (tree.rounded(bounds.min), tree.rounded(bounds.max));
        for axis in 0..3 {
            (nodes[0].low[axis][i], nodes[0].high[axis][i]) = (low[axis], high[axis]);
        }
        let offset = nodes.len() as u32;
        if below.is_empty() {
            (nodes[0].first[i], nodes[0].count[i]) = (first, count);
        } else {
            (nodes[0].first[i], nodes[0].count[i]) = (offset, 0);
            nodes.extend(below.into_iter().map(|mut node| {
                for k in 0..8 {
                    let is_inner = node.count[k] == 0 && node.low[0][k] <= node.high[0][k];
                    node.first[k] += if is_inner { offset } else { 0 };
                }
                node
            }));
        }
    }
    nodes
}

/// Divides a part at the median along the longest axis of its centres; returns the place.
fn divide(boxes: &[Bounds3d], part: &mut [u32]) -> usize {
    let center = |i: u32| boxes[i as usize].center();
    let centers = part.iter().fold(Bounds3d::EMPTY, |b, &i| b.with_point(center(i)));
    let axis = centers.size().max_position();
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| {
        center(a)[axis].total_cmp(&center(b)[axis]).then(a.cmp(&b))
    });
    middle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::tests::Random;

    #[test]
    fn every_box_above_or_around_a_point_is_found() {
        let mut random = Random(9);
        for count in [1, 5, 40, 3000] {
            let boxes: Vec<Bounds3d> = (0..count)
                .map(|_| {
                    let a = random.point(10.0).as_dvec3() + 1e6;
                    Bounds3d::of([a, a + random.point(1.0).as_dvec3()])
                })
                .collect();
            let (tree, order) = Boxes::build(&boxes);
            let [u, v, w] = tree.axes();
            for _ in 0..200 {
                let p = random.point(10.0).as_dvec3() + 1e6;
                let mut seen = vec![[false; 2]; count];
                tree.above(p, |i| {
                    seen[order[i as usize] as usize][0] = true;
                    false
                });
                tree.around(p, |i| {
                    seen[order[i as usize] as usize][1] = true;
                    false
                });
                for (b, [above, around]) in boxes.iter().zip(seen) {
                    assert!(around || !b.contains(p));
                    let within = |axis: usize| b.min[axis] <= p[axis] && p[axis] <= b.max[axis];
                    assert!(above || !(within(u) && within(v) && p[w] <= b.max[w]));
                }
            }
        }
    }
}
