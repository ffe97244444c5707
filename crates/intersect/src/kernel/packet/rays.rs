//! The rays of a packet as triangles see them: lines, in coordinates around the start of the first
//! ray.
//!
//! Triangles are seen from there, not from the apex of the packet, because every hit is decided by
//! the distance from the start of its ray: a light far away, as the apex is, would make all errors
//! as large as its distance. `z` grows along the rays.

use super::frustum::{Columns, Kind, PerRay, RAYS};
use crate::exact::ray::Axes;
use snell_math::simd::Lanes16;

/// Roundings of a distance along the axis: a few.
const ROUNDINGS: f32 = 8.0 * (f32::EPSILON / 2.0);

/// How much nearer than its padded limit ([`crate::search::padded`]) a ray certainly ends,
/// relative to its length: twice the padding.
const END_PADDING: f32 = 2.0e-4;

/// No length needs to be larger, and coordinates are not ([`super::frustum`]).
const LONGEST: f32 = 1.0e16;

/// By ray, and by axis of the packet.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct PacketRays {
    /// How `x` and `y` change with `z`.
    pub slope: [PerRay<f32>; 2],
    /// The vector product of the point at `z = 0` and the direction; not used with a shared origin.
    pub moment: [PerRay<f32>; 3],
    /// The middle and half of the width of the moments of all rays.
    pub moments: [[f32; 3]; 2],
    /// The interval begins between these.
    pub begin: PerRay<f32>,
    pub certain_begin: PerRay<f32>,
    /// What is nearer than `certain_end` is certainly wanted, what is beyond `end` certainly not:
    /// at first about the end of the interval, then about the nearest hit.
    pub certain_end: PerRay<f32>,
    pub end: PerRay<f32>,
    /// The origins of the rays.
    pub start: PerRay<f32>,
    /// The lengths of their directions.
    along: PerRay<f32>,
    /// The common point, relative to which all is computed.
    pub point: [f32; 3],
    /// 1 if `z` grows along its axis, -1 if it falls.
    pub forward: f32,
    /// The largest distance of the origins from there.
    pub spread: f32,
    /// And how far from the plane of that point across the axis.
    pub latest: f32,
    /// Bound on the absolute error of vertices relative to that point, besides relative rounding
    /// errors.
    pub margin: f32,
    /// The rays do not share their origin.
    pub separate: bool,
}

impl PacketRays {
    /// None yet.
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

    /// Works out everything from what packets are made of, and the slopes and speeds of the packet.
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
        // (Of rays that want nothing this is unspecified.)
        let [certain_end, end] = self.ends(token, columns.cull.mul(along));
        certain_end.store(&mut self.certain_end);
        end.store(&mut self.end);
    }

    /// Bound of the errors of a place at this distance from the start.
    #[inline(always)]
    fn error<W: Lanes16>(&self, token: W::Token, start: W, length: W) -> W {
        let (margin, roundings) =
            (W::splat(token, self.margin + f32::MIN_POSITIVE), W::splat(token, ROUNDINGS));
        start.abs().add(length).mul(roundings).add(margin)
    }

    /// Between where rays end that have these padded lengths.
    #[inline(always)]
    fn ends<W: Lanes16>(&self, token: W::Token, length: W) -> [W; 2] {
        let (start, length) = (W::load(token, &self.start), length.min(W::splat(token, LONGEST)));
        let error = self.error(token, start, length);
        [
            start.add(length.mul(W::splat(token, 1.0 - END_PADDING))).sub(error),
            start.add(length).add(error),
        ]
    }

    /// After hits of some rays: their new padded lengths.
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
