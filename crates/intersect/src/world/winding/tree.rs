//! A tree over the surfaces of a group that approximates distant surfaces by their moments.
//!
//! The method is that of Barill, Dickson, Schmidt, Levin and Jacobson, Fast Winding Numbers for
//! Soups and Clouds, 2018: seen from far away, a patch of surface acts as a dipole (its area
//! vector), corrected by the first moment of its area vectors around its centre. The tree is
//! separate from the accelerator's, and holds each triangle exactly once.

use rayon::prelude::*;
use snell_math::{Bounds3d, DMat3, DVec3, Transform, real};

/// The moments of a patch of surface, which approximate it from a distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moments {
    /// Centroid of the patch by area.
    pub center: DVec3,
    /// Sum of area times unit normal.
    pub area_vector: DVec3,
    /// Sum of area times the outer product of unit normal and offset from `center`.
    pub gradient: DMat3,
    /// Area, used only as a weight in means of centres.
    pub area: f64,
    /// Bounds of the patch.
    pub bounds: Bounds3d,
}

/// The matrix `a b^T`.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

impl Moments {
    /// Exact moments of a triangle.
    pub fn of_triangle([a, b, c]: [DVec3; 3]) -> Self {
        let area_vector = (b - a).cross(c - a) * 0.5;
        let bounds = Bounds3d::of([a, b, c]);
        Self {
            center: (a + b + c) / 3.0,
            area_vector,
            gradient: DMat3::ZERO,
            area: area_vector.length(),
            bounds,
        }
    }

    /// Moments of a closed surface. They are zero, because its winding number is 0 outside.
    pub fn of_closed(bounds: Bounds3d) -> Self {
        Self {
            center: bounds.center(),
            area_vector: DVec3::ZERO,
            gradient: DMat3::ZERO,
            area: 0.0,
            bounds,
        }
    }

    /// Moments of the union of several patches.
    fn sum<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let bounds = parts.clone().fold(Bounds3d::EMPTY, |b, m| b.union(&m.bounds));
        let area: f64 = parts.clone().map(|m| m.area).sum();
        let center = if area > 0.0 {
            parts.clone().map(|m| m.center * m.area).sum::<DVec3>() / area
        } else {
            bounds.center()
        };
        let mut sum =
            Self { center, area_vector: DVec3::ZERO, gradient: DMat3::ZERO, area, bounds };
        for m in parts {
            sum.area_vector += m.area_vector;
            sum.gradient += m.gradient + outer(m.area_vector, m.center - center);
        }
        sum
    }

    /// The moments after the transformation to another group. The outer side stays outside, also
    /// under reflections.
    pub fn placed(&self, map: &Transform) -> Self {
        let view = View::new(DVec3::ZERO, map.matrix().matrix3);
        Self {
            center: map.point(self.center),
            area_vector: view.area * self.area_vector,
            gradient: view.area * self.gradient * view.linear.transpose(),
            area: self.area * real::powi(real::cbrt(map.determinant().abs()), 2),
            bounds: map.bounds(&self.bounds),
        }
    }
}

/// A query point in the coordinates of a group, and the maps from the group to the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    /// The point in the coordinates of the group.
    pub point: DVec3,
    /// Maps differences of points to the world.
    pub linear: DMat3,
    /// Maps area vectors to the world.
    area: DMat3,
    /// -1 if the map is a reflection, otherwise 1.
    pub orientation: f64,
    /// The factor by which the map enlarges volumes.
    volume: f64,
    /// The largest factor by which the map lengthens differences.
    stretch: f64,
}

impl View {
    pub fn new(point: DVec3, linear: DMat3) -> Self {
        let determinant = linear.determinant();
        let gram = linear.transpose() * linear;
        // A cheap upper bound on the spectral norm; equal to it for a scaling along the axes
        // followed or preceded by a permutation of the axes.
        let row = |v: DVec3| v.abs().element_sum();
        let stretch = row(gram.x_axis).max(row(gram.y_axis)).max(row(gram.z_axis)).sqrt();
        let area = linear.inverse().transpose() * determinant.abs();
        Self {
            point,
            linear,
            area,
            orientation: if determinant < 0.0 { -1.0 } else { 1.0 },
            volume: determinant.abs(),
            stretch,
        }
    }

    /// A point in world space.
    pub fn world(point: DVec3) -> Self {
        let (linear, area) = (DMat3::IDENTITY, DMat3::IDENTITY);
        Self { point, linear, area, orientation: 1.0, volume: 1.0, stretch: 1.0 }
    }
}

/// A node. The first child of an inner node follows it directly.
#[derive(Clone, Copy, Debug)]
struct Node {
    moments: Moments,
    /// The largest distance from the centroid of the patch to a point of its bounds.
    radius: f64,
    /// The index of the node's first item in [`Tree::order`].
    first: u32,
    /// The number of the node's items in [`Tree::order`].
    count: u32,
    /// The index of the second child; 0 for a leaf.
    second: u32,
    /// The bits that the masks of all items have in common.
    mask: u64,
}

/// The tree of a group.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    /// Item numbers, ordered so that the items of each node are a range.
    order: Vec<u32>,
}

/// The largest number of items in a leaf.
const LEAF: usize = 8;

/// Nodes with more items than this are built by several threads.
const PARALLEL: usize = 4096;

impl Tree {
    /// Builds the tree over items with these moments and masks.
    pub fn build(items: &[(u32, Moments)], mask: impl Fn(u32) -> u64 + Sync) -> Self {
        let mut order: Vec<u32> = (0..items.len() as u32).collect();
        let nodes = if items.is_empty() { Vec::new() } else { build(items, &mask, &mut order, 0) };
        order.par_iter_mut().for_each(|i| *i = items[*i as usize].0);
        Self { nodes, order }
    }

    /// The moments of all items; `None` if the tree is empty.
    pub fn moments(&self) -> Option<&Moments> {
        Some(&self.nodes.first()?.moments)
    }

    /// The winding number of all items around a point. Nodes farther away than `accuracy` times
    /// their radius are approximated by their moments, if `mask` certainly has a bit in common with
    /// all their items; `exact` gives the winding number of each item in the other nodes.
    pub fn winding_number(
        &self,
        view: &View,
        accuracy: f64,
        mask: u64,
        exact: &mut impl FnMut(u32) -> f64,
    ) -> f64 {
        let mut sum = 0.0;
        // Each level halves the number of items, so 64 entries suffice.
        let mut stack = [0u32; 64];
        let mut top = usize::from(!self.nodes.is_empty());
        while top > 0 {
            top -= 1;
            let index = stack[top];
            let node = &self.nodes[index as usize];
            let r = view.linear * (node.moments.center - view.point);
            let distance = r.length();
            if distance > accuracy * node.radius * view.stretch && node.mask & mask != 0 {
                sum += from_afar(&node.moments, view, r, distance);
            } else if node.second == 0 {
                let items = &self.order[node.first as usize..(node.first + node.count) as usize];
                sum += items.iter().map(|&item| exact(item)).sum::<f64>();
            } else {
                stack[top] = node.second;
                stack[top + 1] = index + 1;
                top += 2;
            }
        }
        sum
    }
}

/// The first two terms of the expansion around the centre of a patch; `r` is the vector from the
/// point to the centre, of length `distance`.
fn from_afar(moments: &Moments, view: &View, r: DVec3, distance: f64) -> f64 {
    let inverse = 1.0 / distance;
    let direction = r * inverse;
    // The maps are applied to the direction instead of the moments.
    let across = view.area.transpose() * direction;
    let dipole = across.dot(moments.area_vector);
    let gradient = &moments.gradient;
    let trace = (gradient.x_axis.x + gradient.y_axis.y + gradient.z_axis.z) * view.volume;
    let along = across.dot(*gradient * (view.linear.transpose() * direction));
    (dipole + (trace - 3.0 * along) * inverse) * inverse * inverse / (4.0 * std::f64::consts::PI)
}

/// Builds the nodes of a part of the order, divided at the median of centres along the longest
/// axis. `first` is the index in the whole order at which the part begins.
fn build(
    items: &[(u32, Moments)],
    mask: &(impl Fn(u32) -> u64 + Sync),
    order: &mut [u32],
    first: u32,
) -> Vec<Node> {
    let of = |i: &u32| &items[*i as usize].1;
    let mut nodes = Vec::new();
    let mut second = 0;
    let moments = if order.len() <= LEAF {
        order.sort_unstable();
        nodes.push(Node {
            moments: Moments::sum(order.iter().map(of)),
            radius: 0.0,
            first,
            count: order.len() as u32,
            second: 0,
            mask: order.iter().fold(u64::MAX, |all, &i| all & mask(items[i as usize].0)),
        });
        nodes[0].moments
    } else {
        let centers = order.iter().fold(Bounds3d::EMPTY, |b, i| b.with_point(of(i).center));
        let axis = centers.size().max_position();
        let middle = order.len() / 2;
        let by_center =
            |a: &u32, b: &u32| of(a).center[axis].total_cmp(&of(b).center[axis]).then(a.cmp(b));
        order.select_nth_unstable_by(middle, by_center);
        let (low, high) = order.split_at_mut(middle);
        let (left, right) = if low.len() > PARALLEL {
            rayon::join(
                || build(items, mask, low, first),
                || build(items, mask, high, first + middle as u32),
            )
        } else {
            (build(items, mask, low, first), build(items, mask, high, first + middle as u32))
        };
        let moments = Moments::sum([left[0].moments, right[0].moments].iter());
        let moved = |by: u32| {
            move |n: Node| Node { second: if n.second == 0 { 0 } else { n.second + by }, ..n }
        };
        second = 1 + left.len() as u32;
        nodes.push(Node {
            moments,
            radius: 0.0,
            first,
            count: (low.len() + high.len()) as u32,
            second,
            mask: left[0].mask & right[0].mask,
        });
        nodes.extend(left.into_iter().map(moved(1)));
        nodes.extend(right.into_iter().map(moved(second)));
        moments
    };
    let far = (moments.center - moments.bounds.min)
        .abs()
        .max((moments.bounds.max - moments.center).abs());
    nodes[0].radius = far.length();
    nodes[0].second = second;
    nodes
}
