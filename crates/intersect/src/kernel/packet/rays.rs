//! The rays of a packet in the form for triangle tests: lines in coordinates around the start of
//! the first ray.
//!
//! Triangles are tested relative to that point rather than to the apex of the packet, because every
//! hit is decided by the distance from the start of its ray. With a distant light as the apex, all
//! errors would be proportional to the distance of the light. `z` grows along the rays.

use super::frustum::{Columns, Kind, PerRay, RAYS};
use crate::exact::ray::Axes;
use snell_math::simd::Lanes16;

/// Bound on the rounding error of a `z`, relative to `|start| + length`: eight roundings.
const ROUNDINGS: f32 = 8.0 * (f32::EPSILON / 2.0);

/// A bound on how much nearer the true limit of a ray is than its padded limit
/// ([`crate::search::padded`]), relative to the length of the ray: twice the padding.
const END_PADDING: f32 = 2.0e-4;

/// Lengths of rays in `z` are limited to this, which is larger than all coordinates
/// ([`super::frustum`]).
const LONGEST: f32 = 1.0e16;

/// The rays of a packet, by ray and by axis of the packet.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct PacketRays {
    /// The change of `x` and `y` per unit of `z`.
    pub slope: [PerRay<f32>; 2],
    /// The cross product of the point at `z = 0` and the direction; not used with a common origin.
    pub moment: [PerRay<f32>; 3],
    /// The range of the moments of all rays, as its middle and half its width.
    pub moments: [[f32; 3]; 2],
    /// A lower bound on the `z` at which the interval starts.
    pub begin: PerRay<f32>,
    /// An upper bound on the `z` at which the interval starts.
    pub certain_begin: PerRay<f32>,
    /// Hits nearer than this certainly count. This is at first just before the end of the interval,
    /// and later just before the nearest hit.
    pub certain_end: PerRay<f32>,
    /// Hits beyond this certainly do not count. This is at first just after the end of the
    /// interval, and later just after the nearest hit.
    pub end: PerRay<f32>,
    /// The `z` of the origins of the rays.
    pub start: PerRay<f32>,
    /// The change of `z` per unit of `t`.
    along: PerRay<f32>,
    /// The point relative to which everything is computed.
    pub point: [f32; 3],
    /// 1 if `z` grows along its axis, -1 if it falls.
    pub forward: f32,
    /// The largest distance of an origin from `point`, as a sum over the axes.
    pub spread: f32,
    /// The largest distance of the start of an interval from the plane through `point`
    /// perpendicular to the axis.
    pub latest: f32,
    /// Bound on the absolute error of vertices relative to `point`, besides relative rounding
    /// errors.
    pub margin: f32,
    /// True if the rays have no common origin.
    pub separate: bool,
}

impl PacketRays {
    /// A placeholder for rays that are not set up yet.
    pub const NONE: Self = Self {
        slope: [[0.0; RAYS]; 2],
        moment: [[0.0; RAYS]; 3],
        moments: [[0.0; 3]; 2],
        begin: [0.0; RAYS],
        certain_begin: [0.0; RAYS],
        certain_end: [0.0; RAYS],
        end: [0.0; RAYS],
        start: [0.0; RAYS],
        along: [0.0; RAYS],
        point: [0.0; 3],
        forward: 1.0,
        spread: 0.0,
        latest: 0.0,
        margin: 0.0,
        separate: false,
    };

    /// Sets up the rays from the columns of a packet, its slopes, and the change of `z` per unit of
    /// `t`.
    #[inline(always)]
    pub fn set_up<W: Lanes16>(
        &mut self,
        token: W::Token,
        columns: &Columns<W>,
        kind: &Kind,
        axes: Axes,
        slopes: [W; 2],
        along: W,
    ) {
        self.separate = !kind.common;
        let [slope_x, slope_y] = slopes;
        slope_x.store(&mut self.slope[0]);
        slope_y.store(&mut self.slope[1]);
        along.store(&mut self.along);
        let mut start = W::splat(token, 0.0);
        self.spread = 0.0;
        if self.separate {
            let [from_x, from_y, from_z] = axes.of(&columns.from_point);
            self.spread = from_x.abs().add(from_y.abs()).add(from_z.abs()).reduce_max();
            start = from_z.mul(W::splat(token, self.forward));
            let (at_x, at_y) = (from_x.sub(slope_x.mul(start)), from_y.sub(slope_y.mul(start)));
            let moment =
                [at_y, W::splat(token, 0.0).sub(at_x), at_x.mul(slope_y).sub(at_y.mul(slope_x))];
            for (i, moment) in moment.into_iter().enumerate() {
                moment.store(&mut self.moment[i]);
                let (low, high) = (moment.reduce_min(), moment.reduce_max());
                self.moments[0][i] = (low + high) * 0.5;
                self.moments[1][i] = (high - low) * 0.5;
            }
        }
        start.store(&mut self.start);
        let early = columns.t_min.mul(along);
        let begin = start.add(early);
        let error = self.error(token, start, early);
        begin.sub(error).store(&mut self.begin);
        begin.add(error).store(&mut self.certain_begin);
        self.latest = begin.abs().add(error).reduce_max();
        // For rays whose search is over the result is unspecified.
        let [certain_end, end] = self.ends(token, columns.cull.mul(along));
        certain_end.store(&mut self.certain_end);
        end.store(&mut self.end);
    }

    /// Bound on the error of the `z` of a point at this distance from the start.
    #[inline(always)]
    fn error<W: Lanes16>(&self, token: W::Token, start: W, length: W) -> W {
        let (margin, roundings) =
            (W::splat(token, self.margin + f32::MIN_POSITIVE), W::splat(token, ROUNDINGS));
        start.abs().add(length).mul(roundings).add(margin)
    }

    /// Bounds on the `z` of the ends of rays with these padded lengths.
    #[inline(always)]
    fn ends<W: Lanes16>(&self, token: W::Token, length: W) -> [W; 2] {
        let (start, length) = (W::load(token, &self.start), length.min(W::splat(token, LONGEST)));
        let error = self.error(token, start, length);
        [
            start.add(length.mul(W::splat(token, 1.0 - END_PADDING))).sub(error),
            start.add(length).add(error),
        ]
    }

    /// Updates the ends after hits of some rays, with their new padded lengths.
    #[inline(always)]
    pub fn tighten<W: Lanes16>(&mut self, token: W::Token, rays: u32, length: W) {
        let [certain_end, end] = self.ends(token, length);
        let (certain_end, end) = (
            certain_end.min(W::load(token, &self.certain_end)),
            end.min(W::load(token, &self.end)),
        );
        certain_end.store_where(rays, &mut self.certain_end);
        end.store_where(rays, &mut self.end);
    }
}
