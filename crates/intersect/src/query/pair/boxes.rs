//! Boxes in any orientation, and trees of them (Gottschalk, Lin and Manocha, OBBTree: A
//! Hierarchical Structure for Rapid Interference Detection, 1996).
//!
//! Boxes that lie along a surface are as thin as it is flat, so that two surfaces that lie close
//! together are told apart by few of them. (The boxes of the trees for rays lie along the axes of
//! their group, which makes them thick where a surface is oblique.)

use crate::shape::nearest::eigen;
use rayon::prelude::*;
use snell_math::glam::Vec3Swizzles;
use snell_math::{DMat3, DVec3};

/// The number of items from which on two threads build the halves of a tree.
const PARALLEL: usize = 4096;

/// A box: `center + axes * x` for `|x| <= half`, with axes of length 1 at right angles.
#[derive(Clone, Copy, Debug)]
pub struct OrientedBox {
    pub center: DVec3,
    pub axes: DMat3,
    pub half: DVec3,
}

impl OrientedBox {
    /// A small box around some items, each of them the hull of its points.
    fn around<const N: usize>(items: &[[DVec3; N]], order: &[u32]) -> Self {
        let points = || order.iter().flat_map(|&i| &items[i as usize]);
        let mut best = Self::along(DMat3::IDENTITY, points());
        let mut offer = |axes: DMat3| {
            let found = Self::along(axes, points());
            // Neither of them is kept if it is not a number.
            if found.area() < best.area() {
                best = found;
            }
        };
        if N == 3 && order.len() <= 4 {
            order.iter().filter_map(|&i| frame(&items[i as usize])).for_each(&mut offer);
        }
        if order.len() * N > 3 {
            let mean = points().sum::<DVec3>() / (order.len() * N) as f64;
            let spread = points().fold(DMat3::ZERO, |sum, &p| {
                let d = p - mean;
                sum + DMat3::from_cols(d * d.x, d * d.y, d * d.z)
            });
            offer(eigen(&spread).1);
        }
        best
    }

    /// The smallest box along some axes.
    fn along<'a>(axes: DMat3, points: impl Iterator<Item = &'a DVec3>) -> Self {
        let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let across = axes.transpose();
        let (min, max) = points.fold(nothing, |(min, max), &p| {
            let x = across * p;
            (min.min(x), max.max(x))
        });
        Self { center: axes * ((min + max) * 0.5), axes, half: (max - min) * 0.5 }
    }

    /// An eighth of the surface.
    fn area(&self) -> f64 {
        self.half.dot(self.half.yzx())
    }

    /// The radius of the ball around the box.
    pub fn radius(&self) -> f64 {
        self.half.length()
    }

    /// The corners.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let side = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            self.center + self.axes * (self.half * DVec3::new(side(0), side(1), side(2)))
        })
    }

    /// A lower bound of the distance of two boxes: that of two boxes around them along the axes of
    /// the one, and of the other, or that along the line between their centres.
    #[inline]
    pub fn gap(&self, other: &Self) -> f64 {
        let [near, far] = self.gaps(other);
        let gap = near.length_squared().max(far.length_squared()).sqrt();
        let d = other.center - self.center;
        let length = d.length();
        if length > 0.0 { gap.max(length - (self.width(d) + other.width(d)) / length) } else { gap }
    }

    /// Half the width along a direction, times its length.
    #[inline]
    pub fn width(&self, along: DVec3) -> f64 {
        let DMat3 { x_axis, y_axis, z_axis } = self.axes;
        let seen = DVec3::new(x_axis.dot(along), y_axis.dot(along), z_axis.dot(along));
        seen.abs().dot(self.half)
    }

    /// True if two boxes are certainly more than `margin` apart: along an axis of either, or normal
    /// to one of each (all axes that can separate them).
    #[inline]
    pub fn is_apart(&self, other: &Self, margin: f64) -> bool {
        let d = other.center - self.center;
        let columns = |m: &DMat3| [m.x_axis, m.y_axis, m.z_axis];
        let (a, b) = (columns(&self.axes), columns(&other.axes));
        let t = a.map(|a| a.dot(d));
        let r = a.map(|a| b.map(|b| a.dot(b)));
        let size = r.map(|row| row.map(f64::abs));
        let (ours, theirs) = (self.half.to_array(), other.half.to_array());
        let is_apart_along_ours = |i: usize| {
            let width = theirs[0] * size[i][0] + theirs[1] * size[i][1] + theirs[2] * size[i][2];
            t[i].abs() > ours[i] + width + margin
        };
        let is_apart_along_theirs = |j: usize| {
            let width = ours[0] * size[0][j] + ours[1] * size[1][j] + ours[2] * size[2][j];
            b[j].dot(d).abs() > theirs[j] + width + margin
        };
        if (0..3).any(is_apart_along_ours) || (0..3).any(is_apart_along_theirs) {
            return true;
        }
        for i in 0..3 {
            let (k, l) = ((i + 1) % 3, (i + 2) % 3);
            for j in 0..3 {
                let (m, n) = ((j + 1) % 3, (j + 2) % 3);
                let width = ours[k] * size[l][j]
                    + ours[l] * size[k][j]
                    + theirs[m] * size[i][n]
                    + theirs[n] * size[i][m];
                // The length of the product of both axes is at most 1.
                if (t[l] * r[k][j] - t[k] * r[l][j]).abs() > width + margin {
                    return true;
                }
            }
        }
        false
    }

    /// The gaps along the axes of this box and of the other; 0 where they overlap.
    #[inline(always)]
    pub fn gaps(&self, other: &Self) -> [DVec3; 2] {
        let d = other.center - self.center;
        let (a, b) = (&self.axes, &other.axes);
        // The other's axes as seen along ours.
        let seen = [b.x_axis, b.y_axis, b.z_axis]
            .map(|v| DVec3::new(a.x_axis.dot(v), a.y_axis.dot(v), a.z_axis.dot(v)).abs());
        let along = DVec3::new(a.x_axis.dot(d), a.y_axis.dot(d), a.z_axis.dot(d)).abs();
        let width = seen[0] * other.half.x + seen[1] * other.half.y + seen[2] * other.half.z;
        let near = (along - self.half - width).max(DVec3::ZERO);
        let along = DVec3::new(b.x_axis.dot(d), b.y_axis.dot(d), b.z_axis.dot(d)).abs();
        let width = DVec3::from_array(seen.map(|v| v.dot(self.half)));
        [near, (along - other.half - width).max(DVec3::ZERO)]
    }
}

/// Axes along the longest edge of a triangle and normal to it.
fn frame<const N: usize>(corners: &[DVec3; N]) -> Option<DMat3> {
    let (a, b, c) = (corners[0], corners[1], corners[2]);
    let edges = [b - a, c - b, a - c];
    let long =
        edges.into_iter().max_by(|u, v| u.length_squared().total_cmp(&v.length_squared()))?;
    let (x, z) = (long.try_normalize()?, edges[0].cross(edges[2]).try_normalize()?);
    let y = z.cross(x).try_normalize()?;
    Some(DMat3::from_cols(x, y, x.cross(y)))
}

/// A node of a tree. The first child of a node follows it.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    pub bounds: OrientedBox,
    /// For a leaf, its first place in the order of the items; else the second child.
    first: u32,
    /// The number of items of a leaf; 0 for other nodes.
    count: u32,
}

/// What a node has below it.
#[derive(Clone, Copy, Debug)]
pub enum Below {
    /// Two nodes.
    Nodes([u32; 2]),
    /// Places in the order of the items: the first, and their number.
    Items(usize, usize),
}

/// A tree of boxes. It is empty if there is nothing in it.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    pub nodes: Vec<Node>,
}

impl Tree {
    /// Builds a tree with at most `leaf` items in each leaf, and returns it with the order of the
    /// items. The tree is the same for any number of threads.
    pub fn build<const N: usize>(items: &[[DVec3; N]], leaf: usize) -> (Self, Vec<u32>) {
        let mut order: Vec<u32> = (0..items.len() as u32).collect();
        if items.is_empty() {
            return (Self::default(), order);
        }
        let nothing = OrientedBox { center: DVec3::ZERO, axes: DMat3::IDENTITY, half: DVec3::ZERO };
        let mut nodes =
            vec![Node { bounds: nothing, first: 0, count: 0 }; node_count(items.len(), leaf)];
        fill(items, leaf, [0, 0], &mut order, &mut nodes);
        (Self { nodes }, order)
    }

    /// What is below a node.
    #[inline]
    pub fn below(&self, node: u32) -> Below {
        let Node { first, count, .. } = self.nodes[node as usize];
        match count {
            0 => Below::Nodes([node + 1, first]),
            _ => Below::Items(first as usize, count as usize),
        }
    }

    /// The bytes that the tree takes.
    pub fn memory(&self) -> usize {
        self.nodes.len() * size_of::<Node>()
    }
}

/// The number of nodes of a tree whose leaves are full, except for the last.
fn node_count(items: usize, leaf: usize) -> usize {
    2 * items.div_ceil(leaf) - 1
}

/// Builds the nodes of some items. The first of the items and of the nodes have the numbers `at` in
/// the whole tree.
fn fill<const N: usize>(
    items: &[[DVec3; N]],
    leaf: usize,
    at: [u32; 2],
    order: &mut [u32],
    nodes: &mut [Node],
) {
    let bounds = OrientedBox::around(items, order);
    let Some((node, rest)) = nodes.split_first_mut() else { return };
    if order.len() <= leaf {
        *node = Node { bounds, first: at[0], count: order.len() as u32 };
        return;
    }
    let middle = order.len().div_ceil(leaf) / 2 * leaf;
    let axis = match bounds.half.max_position() {
        0 => bounds.axes.x_axis,
        1 => bounds.axes.y_axis,
        _ => bounds.axes.z_axis,
    };
    let place = |&i: &u32| items[i as usize].iter().sum::<DVec3>().dot(axis);
    order.select_nth_unstable_by(middle, |i, j| place(i).total_cmp(&place(j)).then(i.cmp(j)));
    let (left, right) = order.split_at_mut(middle);
    let count = node_count(middle, leaf);
    let second = at[1] + 1 + count as u32;
    *node = Node { bounds, first: second, count: 0 };
    let is_large = left.len() >= PARALLEL;
    let (below, other) = rest.split_at_mut(count);
    let (at_left, at_right) = ([at[0], at[1] + 1], [at[0] + middle as u32, second]);
    let mut first = || fill(items, leaf, at_left, left, below);
    let mut last = || fill(items, leaf, at_right, right, other);
    if is_large {
        rayon::join(first, last);
    } else {
        first();
        last();
    }
}

/// The points of items, each reduced by `origin`.
pub fn relative(corners: &[[DVec3; 3]], origin: DVec3) -> Vec<[DVec3; 3]> {
    corners.par_iter().map(|t| t.map(|p| p - origin)).collect()
}
