//! A point as seen from a group, and how far boxes of the group are from it in the world.

use crate::precision::frame::Frame;
use crate::shape::Metric;
use crate::tree::block::TriangleBlock;
use crate::tree::node::WideNode;
use snell_math::{DAffine3, DMat3, DVec3};

/// A point in the coordinates of a group. The `f64` point and the metric decide; the rest, in
/// `f32`, only culls boxes that are certainly too far.
#[derive(Clone, Debug)]
pub(super) struct Place {
    /// The point. It is defined by mapping it down group by group, so it is the same with every
    /// structure.
    pub point: DVec3,
    /// Lengths in the world of differences in the group.
    pub metric: Metric,
    /// The point rounded down and up.
    low: [f32; 3],
    high: [f32; 3],
    /// [`Metric::axis_weights`], rounded down.
    weights: [f32; 3],
}

/// Lower bounds of squared distances are lowered by this part: more than all roundings, in `f32`
/// here and in `f64` of the distances that they are compared with.
const SLACK: f32 = 1.0 - 2e-6;

/// Beyond this, distances along an axis count as this: its square does not overflow.
const FAR: f32 = 1e18;

/// At least the sum of both, away from the first.
fn farther(x: f32, by: f32) -> f32 {
    match by {
        0.0 => x,
        by if by < 0.0 => (x + by).next_down(),
        by => (x + by).next_up(),
    }
}

impl Place {
    /// In the world.
    pub fn world(point: DVec3) -> Self {
        Self::new(point, Metric::EUCLIDEAN, 0.0)
    }

    /// As the boxes of the group see it, if they are in coordinates of their own.
    pub fn in_frame(&self, frame: &Frame) -> Self {
        Self::new(
            frame.point(self.point),
            Metric::new(*self.metric.linear() * (1.0 / frame.scale)),
            frame.slack,
        )
    }

    /// Boxes may be off by `slack` along each axis.
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

    /// The place in an instanced group; `None` if it overflows on the way, then nothing is found
    /// there.
    pub fn in_child(&self, child_from_group: &DAffine3) -> Option<Self> {
        let point = child_from_group.transform_point3(self.point);
        point.is_finite().then(|| Self::new(point, self.metric_in_child(child_from_group), 0.0))
    }

    /// The metric of what is placed in the group.
    pub fn metric_in_child(&self, child_from_group: &DAffine3) -> Metric {
        let group_from_child: DMat3 = child_from_group.matrix3.inverse();
        Metric::new(*self.metric.linear() * group_from_child)
    }

    /// Lower bounds of the squared distances in the world to what the eight boxes of a node hold.
    #[inline(always)]
    pub fn node_bounds(&self, node: &WideNode) -> [f32; 8] {
        self.bounds(|axis| (&node.bounds[0][axis], &node.bounds[1][axis]))
    }

    /// The same for eight triangles.
    #[inline(always)]
    pub fn triangle_bounds(&self, block: &TriangleBlock) -> [f32; 8] {
        let [a, b, c] = &block.vertices;
        let mut boxes = [([0.0; 8], [0.0; 8]); 3];
        for (axis, (low, high)) in boxes.iter_mut().enumerate() {
            for i in 0..8 {
                // Comparisons instead of `min` and `max`, which care about NaN: there is none.
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
