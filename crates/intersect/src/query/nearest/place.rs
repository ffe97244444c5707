//! A query point in the coordinates of a group, and lower bounds on its distance from the group's
//! boxes in world space.

use crate::precision::frame::Frame;
use crate::shape::Metric;
use crate::tree::block::TriangleBlock;
use crate::tree::node::WideNode;
use snell_math::{DAffine3, DMat3, DVec3};

/// A query point in the coordinates of a group. The result is decided by the `f64` point and the
/// metric; the other fields, in `f32`, only cull boxes that are certainly too far.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// The point, computed by mapping it down group by group, so that it is the same with every
    /// structure.
    pub point: DVec3,
    /// The metric by which differences in the group have their length in world space.
    pub metric: Metric,
    /// The coordinates of the point, rounded down.
    low: [f32; 3],
    /// The coordinates of the point, rounded up.
    high: [f32; 3],
    /// [`Metric::axis_weights`], rounded down.
    weights: [f32; 3],
}

/// Lower bounds on squared distances are multiplied by this. It covers all rounding, both of the
/// `f32` bounds and of the `f64` distances with which they are compared.
const SLACK: f32 = 1.0 - 2e-6;

/// Distances along an axis are clamped to this, so that their squares do not overflow.
const FAR: f32 = 1e18;

/// The sum `x + by`, rounded in the direction of `by`.
fn farther(x: f32, by: f32) -> f32 {
    match by {
        0.0 => x,
        by if by < 0.0 => (x + by).next_down(),
        by => (x + by).next_up(),
    }
}

impl Place {
    /// The point in world space, where lengths are multiplied by `scale`.
    pub fn world(point: DVec3, scale: f64) -> Self {
        let metric = if scale == 1.0 {
            Metric::EUCLIDEAN
        } else {
            Metric::new(DMat3::from_diagonal(DVec3::splat(scale)))
        };
        Self::new(point, metric, 0.0)
    }

    /// The point in the coordinates of a frame in which the boxes of the group are stored.
    pub fn in_frame(&self, frame: &Frame) -> Self {
        Self::new(
            frame.point(self.point),
            Metric::new(*self.metric.linear() * (1.0 / frame.scale)),
            frame.slack,
        )
    }

    /// Makes a place for boxes that may be off by `slack` along each axis.
    fn new(point: DVec3, metric: Metric, slack: f32) -> Self {
        let nearest = point.to_array().map(|x| (x as f32).clamp(f32::MIN, f32::MAX));
        let rounded = |i: usize, to: fn(f32) -> f32| {
            if f64::from(nearest[i]) == point[i] { nearest[i] } else { to(nearest[i]) }
        };
        let weights = metric.axis_weights().to_array();
        Self {
            point,
            metric,
            low: std::array::from_fn(|i| farther(rounded(i, f32::next_down), -slack).max(f32::MIN)),
            high: std::array::from_fn(|i| farther(rounded(i, f32::next_up), slack).min(f32::MAX)),
            weights: weights.map(|w| ((w * (1.0 - 1e-6)) as f32).min(f32::MAX)),
        }
    }

    /// The point in the coordinates of an instanced group; `None` if it overflows, and then nothing
    /// in the group is found.
    pub fn in_child(&self, child_from_group: &DAffine3) -> Option<Self> {
        let point = child_from_group.transform_point3(self.point);
        point.is_finite().then(|| Self::new(point, self.metric_in_child(child_from_group), 0.0))
    }

    /// The metric of an instanced group or of the coordinates of a shape in this group.
    pub fn metric_in_child(&self, child_from_group: &DAffine3) -> Metric {
        let group_from_child: DMat3 = child_from_group.matrix3.inverse();
        Metric::new(*self.metric.linear() * group_from_child)
    }

    /// Lower bounds of the squared world-space distances to the contents of a node's eight boxes.
    #[inline(always)]
    pub fn node_bounds(&self, node: &WideNode) -> [f32; 8] {
        self.bounds(|axis| (&node.bounds[0][axis], &node.bounds[1][axis]))
    }

    /// Lower bounds of the squared world-space distances to the eight triangles of a block.
    #[inline(always)]
    pub fn triangle_bounds(&self, block: &TriangleBlock) -> [f32; 8] {
        let [a, b, c] = &block.vertices;
        let mut boxes = [([0.0; 8], [0.0; 8]); 3];
        for (axis, (low, high)) in boxes.iter_mut().enumerate() {
            for i in 0..8 {
                // Comparisons are faster than `min` and `max`, which treat NaN specially; no NaN
                // occurs here.
                let (x, y, z) = (a[axis][i], b[axis][i], c[axis][i]);
                let (least, most) = if x < y { (x, y) } else { (y, x) };
                low[i] = if z < least { z } else { least };
                high[i] = if z > most { z } else { most };
            }
        }
        self.bounds(|axis| (&boxes[axis].0, &boxes[axis].1))
    }

    #[inline(always)]
    fn bounds<'a>(&self, sides: impl Fn(usize) -> (&'a [f32; 8], &'a [f32; 8])) -> [f32; 8] {
        let mut sum = [0.0; 8];
        for axis in 0..3 {
            let (min, max) = sides(axis);
            let (low, high, weight) = (self.low[axis], self.high[axis], self.weights[axis]);
            for i in 0..8 {
                let (before, after) = (min[i] - high, low - max[i]);
                let d = if before > after { before } else { after };
                let d = if d > 0.0 { d } else { 0.0 };
                let d = if d < FAR { d } else { FAR };
                sum[i] += d * d * weight;
            }
        }
        sum.map(|squared| (squared * SLACK - f32::MIN_POSITIVE).min(f32::MAX))
    }
}
