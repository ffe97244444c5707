//! A packet of sixteen rays: bounds that all rays share, and the single rays in lanes.
//!
//! The packet is described relative to a point, its *apex*: the common origin of the rays, or
//! approximately the common point where they end, or else any point near their origins. Along the
//! axis on which the first ray is fastest, `z` is the distance from the apex, growing away from it,
//! and a ray is the line `x = slope z + offset` in each of the other two axes. With a common origin
//! all offsets are 0. No inverse direction appears, so rays that are parallel to an axis, or go
//! both ways along it, need no special case.
//!
//! All rays miss a box that lies outside of the four planes around the packet (Reshetov, Soupikov
//! and Hurley, Multi-Level Ray Tracing Algorithm, 2005, traverse with the same kind of frustum).
//! All tests here are conservative.

use super::exact_rays::{ExactColumns, ExactRays, LaneRays, rounded3};
use super::rays::PacketRays;
use crate::exact::plane_hit::doubles;
use crate::exact::ray::Axes;
use crate::kernel::packet::PacketTests;
use crate::search::CULL_PADDING;
use crate::tree::node::WideNode;
use snell_math::simd::{Doubles16, Lanes8, Lanes16};
use snell_math::{DVec3, Vec3};

/// The number of rays in a packet.
pub(super) const RAYS: usize = 16;

/// One value per ray.
pub(crate) type PerRay<T> = [T; RAYS];

/// Relative padding of everything computed from rounded coordinates, like
/// [`crate::exact::prepared::BOX_PADDING`]: the roundings of `f32` here, and of the projection of
/// triangles, add up to less than half of it.
const PADDING: f32 = 1.0e-6;

/// The limit of coordinates and directions, so that nothing overflows here; rays beyond it are left
/// to the other kernels.
const LARGEST: f32 = 1.0e15;

/// A distance beyond every box, at which boxes that are missed and empty boxes begin.
const FARTHEST: f32 = 1.0e16;

/// The largest spread of slopes, per unit of depth, at which a packet is worthwhile.
const MAX_SPREAD: f32 = 0.25;

/// The description of a packet without its rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kind {
    /// The point relative to which the packet is described.
    pub apex: [f32; 3],
    /// True if the rays end near the apex instead of starting there.
    pub reversed: bool,
    /// True if all rays start at the apex.
    pub common: bool,
    /// True if children are visited from the ends of the rays to their starts.
    pub backward: bool,
    /// True if the apex, or the origins used by triangle tests, are rounded.
    pub rounded: bool,
    /// Bound on the error of vertices; 0 in single precision.
    pub slack: f32,
}

/// A packet in the coordinates of a group.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Packet {
    /// The rays, written only when they [are needed](Self::has_rays).
    pub rays: ExactRays,
    /// Origins and directions in `f64`, by axis of the group; used if anything is rounded.
    pub exact: ExactColumns,
    /// Directions by axis of the group; used if nothing is rounded.
    pub direction: [PerRay<f32>; 3],
    /// Slopes of the rays, by axis of the packet.
    pub slope: [PerRay<f32>; 2],
    /// Offsets of the rays, by axis of the packet.
    offset: [PerRay<f32>; 2],
    /// The 2D cross product of slope and offset.
    across: PerRay<f32>,
    /// The start of each ray in `z`.
    near: PerRay<f32>,
    /// The end of each ray in `z`; it is before the start for a ray whose search is over.
    far: PerRay<f32>,
    /// The `z` of each ray at `t = 0`.
    start: PerRay<f32>,
    /// The magnitude of the change of `z` per unit of `t`.
    along: PerRay<f32>,
    /// The start of the interval of each ray.
    pub t_min: PerRay<f32>,
    /// The current padded limit of each ray; see [`Columns::cull`].
    pub cull: PerRay<f32>,
    /// The origins used by triangle tests, by axis of the packet; not used with a common origin.
    pub projected_origin: [PerRay<f32>; 3],
    /// The rays in the form for triangle tests. (All rows up to here are aligned.)
    pub packet_rays: PacketRays,
    pub has_rays: bool,
    pub kind: Kind,
    /// Axes x, y and z of the packet: z is the axis along which the rays run.
    pub axes: Axes,
    /// 1 if `z` grows along its axis, -1 if it falls.
    pub sign: f32,
    /// The octant that gives the order in which children are visited, with the numbering of
    /// [`crate::tree::node::WideNode::order`].
    pub octant: usize,
    /// True if the exact test projects all rays along the z axis of the packet.
    pub is_aligned: bool,
    /// Bound on the absolute errors of positions; 0 for a common origin at which nothing was
    /// rounded.
    margin: f32,
    /// The smallest start in `z` of all rays.
    packet_near: f32,
    /// The largest end in `z` of all rays.
    pub packet_far: f32,
    /// Lower bounds on the slopes of all rays: x and y per unit of `z`.
    low_slope: [f32; 2],
    /// Upper bounds on the slopes of all rays: x and y per unit of `z`.
    high_slope: [f32; 2],
    /// Lower bounds on the offsets of all rays in x and y.
    low_offset: [f32; 2],
    /// Upper bounds on the offsets of all rays in x and y.
    high_offset: [f32; 2],
}

/// The axes of a packet, from the magnitudes of a direction: the last axis has the largest
/// magnitude, as in [`crate::exact::ray::LocalRay`].
#[inline(always)]
fn axes(d: [f32; 3]) -> Axes {
    let z = if d[0] >= d[1] && d[0] >= d[2] { 0 } else { 2 - usize::from(d[1] >= d[2]) };
    Axes::BY_Z[z]
}

/// The rays from which a packet is made, by axis of the group, rounded to nearest.
pub(crate) struct Columns<W> {
    /// Origins relative to the apex; not used with a common origin.
    pub from_apex: [W; 3],
    /// Origins relative to `point`; not used with a common origin.
    pub from_point: [W; 3],
    pub direction: [W; 3],
    /// A point among the origins.
    pub point: [f32; 3],
    /// Starts of the intervals, not negative.
    pub t_min: W,
    /// The padded limits of the searches; negative for rays whose search is over, and for lanes
    /// without a ray.
    pub cull: W,
}

impl Packet {
    /// A placeholder for a packet that is not set up yet.
    pub const NONE: Self = Self {
        rays: ExactRays { origin: [[0.0; 4]; RAYS], direction: [[0.0; 4]; RAYS] },
        exact: [[[0.0; RAYS]; 3]; 2],
        direction: [[0.0; RAYS]; 3],
        slope: [[0.0; RAYS]; 2],
        offset: [[0.0; RAYS]; 2],
        across: [0.0; RAYS],
        near: [0.0; RAYS],
        far: [0.0; RAYS],
        start: [0.0; RAYS],
        along: [0.0; RAYS],
        t_min: [0.0; RAYS],
        cull: [0.0; RAYS],
        projected_origin: [[0.0; RAYS]; 3],
        packet_rays: PacketRays::NONE,
        has_rays: false,
        kind: Kind {
            apex: [0.0; 3],
            reversed: false,
            common: false,
            backward: false,
            rounded: false,
            slack: 0.0,
        },
        axes: Axes::BY_Z[0],
        sign: 1.0,
        octant: 0,
        is_aligned: false,
        margin: 0.0,
        packet_near: 0.0,
        packet_far: 0.0,
        low_slope: [0.0; 2],
        high_slope: [0.0; 2],
        low_offset: [0.0; 2],
        high_offset: [0.0; 2],
    };

    /// Sets up the packet from rays in `f64` by axis, the starts of their intervals and the padded
    /// limits of their searches, the apex, and the point relative to which triangles are tested
    /// (neither point is used with a common origin), all in the coordinates of a group. Returns
    /// false if these rays do not make a packet.
    #[inline(always)]
    pub fn set_up_exactly<W: Lanes16, P: PacketTests>(
        &mut self,
        token: W::Token,
        rays: LaneRays<W>,
        [t_min, cull]: [W; 2],
        data: &P::Data,
        group: usize,
        [apex, point]: [DVec3; 2],
        kind: &Kind,
    ) -> bool {
        self.has_rays = false;
        rays.store(&mut self.exact);
        let rays = P::rays_in_structure(token, data, group, rays);
        let ([ox, oy, oz], direction) = (rounded3::<W>(rays.origin), rounded3::<W>(rays.direction));
        ox.store(&mut self.projected_origin[0]);
        oy.store(&mut self.projected_origin[1]);
        oz.store(&mut self.projected_origin[2]);
        // The sum is zero if everything is finite, otherwise NaN.
        let zero = W::splat(token, 0.0);
        let mut sum = zero;
        for column in [ox, oy, oz, direction[0], direction[1], direction[2]] {
            sum = sum.add(column.mul(zero));
        }
        if sum.le(zero) != 0xffff {
            return false;
        }
        let (mut apex, mut point) = (
            P::point_in_structure(data, group, apex).as_vec3(),
            P::point_in_structure(data, group, point).as_vec3(),
        );
        if kind.common {
            apex = Vec3::new(
                self.projected_origin[0][0],
                self.projected_origin[1][0],
                self.projected_origin[2][0],
            );
            point = apex;
        }
        let kind =
            Kind { apex: apex.to_array(), rounded: true, slack: P::slack(data, group), ..*kind };
        let (from_apex, from_point) = if kind.common {
            ([zero; 3], [zero; 3])
        } else {
            (rays.seen_from(token, apex), rays.seen_from(token, point))
        };
        let [dx, dy, dz] = &self.exact[1];
        let first = [dx[0] as f32, dy[0] as f32, dz[0] as f32];
        let point = point.to_array();
        self.set_up::<W, P>(
            token,
            &Columns { from_apex, from_point, direction, point, t_min, cull },
            first,
            kind,
        )
    }

    /// Sets up the packet from the kind, `columns` and the direction of the first ray. Before the
    /// call, `projected_origin` must be set by axis of the group if the rays have no common origin
    /// or anything was rounded, and `exact` if anything was rounded. Returns false if these rays do
    /// not make a packet.
    #[inline(always)]
    pub fn set_up<W: Lanes16, P: PacketTests>(
        &mut self,
        token: W::Token,
        columns: &Columns<W>,
        first: [f32; 3],
        kind: Kind,
    ) -> bool {
        // Values that were just stored are not read back here, because the loads would have other
        // widths than the stores and would wait.
        self.kind = kind;
        let directions = &columns.direction;
        let axes = axes([first[0].abs(), first[1].abs(), first[2].abs()]);
        self.axes = axes;
        let forward: f32 = if *axes.of(&first)[2] < 0.0 { -1.0 } else { 1.0 };
        let sign = if kind.reversed { -forward } else { forward };
        self.sign = sign;
        // The slopes are quotients as in [`crate::exact::ray::LocalRay`]: they are its shears if
        // triangles are projected in `f32`.
        let is_projected = kind.rounded && !P::TRIANGLES_ELSEWHERE;
        let [x, y, speed] = axes.of(directions);
        let along = speed.mul(W::splat(token, forward));
        let [shear_x, shear_y] = if is_projected {
            let [x, y, z] = axes.of(&self.exact[1]);
            let exact_speed = W::Doubles::load(token, z);
            [
                W::Doubles::load(token, x).div(exact_speed).rounded(),
                W::Doubles::load(token, y).div(exact_speed).rounded(),
            ]
        } else {
            [x.div(*speed), y.div(*speed)]
        };
        let slopes = [shear_x.mul(W::splat(token, sign)), shear_y.mul(W::splat(token, sign))];
        let (low, high) = (
            [slopes[0].reduce_min(), slopes[1].reduce_min()],
            [slopes[0].reduce_max(), slopes[1].reduce_max()],
        );
        let fine = along.reduce_min() > 1.0 / LARGEST
            && along.reduce_max() < LARGEST
            && (0..2).all(|i| low[i] >= -2.0 && high[i] <= 2.0 && high[i] - low[i] <= MAX_SPREAD)
            && kind.apex.iter().all(|a| a.abs() < LARGEST);
        if !fine {
            return false;
        }
        slopes[0].store(&mut self.slope[0]);
        slopes[1].store(&mut self.slope[1]);
        along.store(&mut self.along);
        // At slope 1 the choice of the z axis is a tie, or decided by less than the rounding of the
        // slope.
        self.is_aligned = (0..2).all(|i| low[i] > -1.0 && high[i] < 1.0);
        self.margin = 0.0;
        self.packet_rays.margin = 0.0;
        if kind.common {
            // Vectors are stored, not arrays: a value stored in halves cannot be loaded as a whole
            // for some time.
            let zero = W::splat(token, 0.0);
            zero.store(&mut self.start);
            zero.store(&mut self.offset[0]);
            zero.store(&mut self.offset[1]);
            zero.store(&mut self.across);
            self.packet_rays.point = axes.of(&kind.apex).map(|x| *x);
        } else {
            self.place::<W>(token, columns);
        }
        if kind.rounded {
            let [x, y, z] = &self.projected_origin;
            let size = W::load(token, x)
                .abs()
                .max(W::load(token, y).abs())
                .max(W::load(token, z).abs())
                .reduce_max();
            self.packet_rays.margin = size * (12.0 * f32::EPSILON) + f32::MIN_POSITIVE + kind.slack;
            self.margin += self.packet_rays.margin;
        }
        if self.margin.is_nan() || self.margin >= LARGEST {
            return false;
        }
        self.packet_rays.forward = forward;
        let slopes = [shear_x.mul(W::splat(token, forward)), shear_y.mul(W::splat(token, forward))];
        self.packet_rays.set_up(token, columns, &kind, axes, slopes, along);
        self.octant = (0..3).fold(0, |octant, axis| {
            let down = (first[axis] < 0.0) != kind.backward;
            octant | usize::from(down) << axis
        });
        let cull = columns.cull;
        columns.t_min.store(&mut self.t_min);
        cull.store(&mut self.cull);
        let start = W::load(token, &self.start);
        let (early, end) = (columns.t_min.mul(along), self.ends(token, start, cull, along));
        let (wide, narrow, margin) = (
            W::splat(token, 1.0 + PADDING),
            W::splat(token, 1.0 - PADDING),
            W::splat(token, self.margin),
        );
        let (near, far) = if kind.reversed {
            (end, start.sub(early).mul(wide).add(margin))
        } else {
            (start.add(early).mul(narrow).sub(margin), end)
        };
        let over = cull.lt(W::splat(token, 0.0));
        let near = near.replace(over, W::splat(token, f32::INFINITY));
        let far = far.replace(over, W::splat(token, f32::NEG_INFINITY));
        near.store(&mut self.near);
        far.store(&mut self.far);
        (self.packet_near, self.packet_far) = (near.reduce_min(), far.reduce_max());
        // Before the apex the order of the slopes is reversed; the packet is hardly wider there.
        let before = (-self.packet_near).max(0.0);
        for i in 0..2 {
            self.low_slope[i] = low[i] - 2.0 * PADDING;
            self.high_slope[i] = high[i] + 2.0 * PADDING;
            let extra = self.margin + (self.high_slope[i] - self.low_slope[i]) * before;
            (self.low_offset[i], self.high_offset[i]) = (-extra, extra);
            if !kind.common {
                let offset = W::load(token, &self.offset[i]);
                self.low_offset[i] += offset.reduce_min();
                self.high_offset[i] += offset.reduce_max();
            }
        }
        true
    }

    /// The rays in `f64`, in the coordinates of the group.
    #[inline(always)]
    pub fn lane_rays<W: Lanes16>(&self, token: W::Token) -> LaneRays<W> {
        if self.kind.rounded {
            return LaneRays::load(token, &self.exact);
        }
        let projected = self.projected::<W>(token);
        let origin = self.axes.back(projected);
        LaneRays { origin: doubles(origin), direction: doubles(load3(token, &self.direction)) }
    }

    /// The origins used by triangle tests, by axis of the packet.
    #[inline(always)]
    pub fn projected<W: Lanes16>(&self, token: W::Token) -> [W; 3] {
        if !self.kind.common {
            return load3(token, &self.projected_origin);
        }
        let [x, y, z] = self.axes.of(&self.kind.apex);
        [W::splat(token, *x), W::splat(token, *y), W::splat(token, *z)]
    }

    /// The point relative to which triangles are tested, by axis of the group.
    #[inline(always)]
    pub fn point(&self) -> Vec3 {
        Vec3::from_array(self.axes.back(self.packet_rays.point))
    }

    /// True if both packets run the same way and are described relative to the same points, so that
    /// they can be traversed together.
    #[inline(always)]
    pub fn is_coherent_with(&self, other: &Self) -> bool {
        let (a, b) = (&self.kind, &other.kind);
        (a.apex, a.reversed, a.common, a.backward, a.rounded)
            == (b.apex, b.reversed, b.common, b.backward, b.rounded)
            && (self.axes, self.sign, self.octant) == (other.axes, other.sign, other.octant)
            && self.packet_rays.point == other.packet_rays.point
    }

    /// Raises the error bounds to those of another packet where these are larger, so that both can
    /// use the same boxes and triangles.
    #[inline(always)]
    pub fn widen(&mut self, other: &Self) {
        self.margin = self.margin.max(other.margin);
        self.packet_rays.spread = self.packet_rays.spread.max(other.packet_rays.spread);
        self.packet_rays.latest = self.packet_rays.latest.max(other.packet_rays.latest);
        self.packet_rays.margin = self.packet_rays.margin.max(other.packet_rays.margin);
    }

    /// Computes where rays without a common origin begin.
    #[inline(always)]
    fn place<W: Lanes16>(&mut self, token: W::Token, columns: &Columns<W>) {
        self.packet_rays.point = self.axes.of(&columns.point).map(|x| *x);
        self.projected_origin = self.axes.of(&self.projected_origin).map(|row| *row);
        let distance = {
            let [from_x, from_y, from_z] = self.axes.of(&columns.from_apex);
            let start = from_z.mul(W::splat(token, self.sign));
            start.store(&mut self.start);
            let (slope_x, slope_y) =
                (W::load(token, &self.slope[0]), W::load(token, &self.slope[1]));
            let (offset_x, offset_y) =
                (from_x.sub(slope_x.mul(start)), from_y.sub(slope_y.mul(start)));
            offset_x.store(&mut self.offset[0]);
            offset_y.store(&mut self.offset[1]);
            slope_y.mul(offset_x).sub(slope_x.mul(offset_y)).store(&mut self.across);
            from_x.abs().add(from_y.abs()).add(from_z.abs()).reduce_max()
        };
        self.margin = distance * (2.0 * PADDING) + f32::MIN_POSITIVE;
    }

    /// The ends of searches with these padded limits.
    #[inline(always)]
    fn ends<W: Lanes16>(&self, token: W::Token, start: W, cull: W, along: W) -> W {
        let length = cull.mul(along);
        let margin = W::splat(token, self.margin);
        if self.kind.reversed {
            start.mul(W::splat(token, 1.0 - PADDING)).sub(length).sub(margin)
        } else {
            start
                .add(length)
                .mul(W::splat(token, 1.0 + PADDING))
                .add(margin)
                .min(W::splat(token, FARTHEST))
        }
    }

    /// Updates the packet after tests of some rays, with their new padded limits; the searches of
    /// the rays `over` are finished. [`Self::update_limits`] must follow.
    #[inline(always)]
    pub fn narrow<W: Lanes16>(
        &mut self,
        token: W::Token,
        rays: u32,
        over: u32,
        culls: &PerRay<f32>,
    ) {
        self.tighten::<W>(token, rays & !over, culls);
        self.finish::<W>(token, over);
    }

    /// Updates the packet after hits of some rays, with their new padded limits.
    /// [`Self::update_limits`] must follow.
    #[inline(always)]
    fn tighten<W: Lanes16>(&mut self, token: W::Token, rays: u32, culls: &PerRay<f32>) {
        let (cull, along) = (W::load(token, culls), W::load(token, &self.along));
        cull.store_where(rays, &mut self.cull);
        let end = self.ends(token, W::load(token, &self.start), cull, along);
        if self.kind.reversed {
            let near = end.max(W::load(token, &self.near));
            near.store_where(rays, &mut self.near);
        } else {
            let far = end.min(W::load(token, &self.far));
            far.store_where(rays, &mut self.far);
        }
        self.packet_rays.tighten(token, rays, cull.mul(along));
    }

    /// Marks the searches of some rays as finished. [`Self::update_limits`] must follow.
    #[inline(always)]
    pub fn finish<W: Lanes16>(&mut self, token: W::Token, rays: u32) {
        W::splat(token, f32::INFINITY).store_where(rays, &mut self.near);
        W::splat(token, f32::NEG_INFINITY).store_where(rays, &mut self.far);
        W::splat(token, -1.0).store_where(rays, &mut self.cull);
    }

    /// Updates the packet after certain hits of some rays, given by bounds on their `z` in
    /// [`PacketRays`]. The packet must not be reversed. [`Self::update_limits`] must follow.
    #[inline(always)]
    pub fn tighten_to<W: Lanes16>(&mut self, token: W::Token, rays: u32, low: W, high: W) {
        low.store_where(rays, &mut self.packet_rays.certain_end);
        high.store_where(rays, &mut self.packet_rays.end);
        let length = high
            .sub(W::load(token, &self.packet_rays.start))
            .mul(W::splat(token, 1.0 + CULL_PADDING));
        let far = W::load(token, &self.start)
            .add(length)
            .mul(W::splat(token, 1.0 + PADDING))
            .add(W::splat(token, self.margin));
        let far = far.min(W::load(token, &self.far));
        far.store_where(rays, &mut self.far);
    }

    /// Updates the limits of the packet to the smallest start and largest end of all rays.
    #[inline(always)]
    pub fn update_limits<W: Lanes16>(&mut self, token: W::Token) {
        self.packet_near = W::load(token, &self.near).reduce_min();
        self.packet_far = W::load(token, &self.far).reduce_max();
    }

    /// The rays that have no hit yet and whose interval has no end.
    #[inline(always)]
    pub fn endless<W: Lanes16>(&self, token: W::Token) -> u32 {
        W::splat(token, FARTHEST).le(W::load(token, &self.far))
    }

    /// The range of all slopes in [`PacketRays`], as its middle and half its width.
    #[inline(always)]
    pub fn slopes(&self) -> [[f32; 2]; 2] {
        let turn = self.sign * self.packet_rays.forward * 0.5;
        let [low, high] = [self.low_slope, self.high_slope];
        [
            [(low[0] + high[0]) * turn, (low[1] + high[1]) * turn],
            [(high[0] - low[0]) * 0.5, (high[1] - low[1]) * 0.5],
        ]
    }

    /// The boxes of a node relative to the apex.
    #[inline(always)]
    pub fn boxes<L: Lanes8>(&self, token: L::Token, node: &WideNode) -> Boxes<L> {
        let up = usize::from(self.sign < 0.0);
        let [apex_x, apex_y, apex_z] = self.axes.of(&self.kind.apex);
        let (apex_x, apex_y, apex_z) =
            (L::splat(token, *apex_x), L::splat(token, *apex_y), L::splat(token, *apex_z));
        let [[low_x, low_y, _], [high_x, high_y, _]] =
            [self.axes.of(&node.bounds[0]), self.axes.of(&node.bounds[1])];
        let (near, far) =
            (self.axes.of(&node.bounds[up])[2], self.axes.of(&node.bounds[up ^ 1])[2]);
        let (near, far) = (L::load(token, near).sub(apex_z), L::load(token, far).sub(apex_z));
        Boxes {
            near: near.mul(L::splat(token, self.sign)).sub(L::splat(token, self.margin)),
            far: far
                .mul(L::splat(token, self.sign * (1.0 + PADDING)))
                .add(L::splat(token, self.margin)),
            sides: [
                [L::load(token, low_x).sub(apex_x), L::load(token, high_x).sub(apex_x)],
                [L::load(token, low_y).sub(apex_y), L::load(token, high_y).sub(apex_y)],
            ],
        }
    }

    /// The distances at which the packet enters each of eight boxes (at or beyond `packet_far` for
    /// a miss).
    #[inline(always)]
    pub fn box_distances<L: Lanes8>(&self, token: L::Token, boxes: &Boxes<L>) -> L {
        let near = boxes.near.max(L::splat(token, self.packet_near));
        let far = boxes.far.min(L::splat(token, self.packet_far));
        // The last operand is never NaN.
        let gap = self
            .gap(token, boxes, 0, near, far)
            .max(self.gap(token, boxes, 1, near, far).max(near.sub(far)));
        gap.mul(L::splat(token, f32::MAX)).max(near)
    }

    /// The distance between packet and boxes on an axis, between the depths `near` and `far`;
    /// positive if the packet misses.
    #[inline(always)]
    fn gap<L: Lanes8>(&self, token: L::Token, boxes: &Boxes<L>, i: usize, near: L, far: L) -> L {
        let (low, high) = (L::splat(token, self.low_slope[i]), L::splat(token, self.high_slope[i]));
        let low = near.mul(low).min(far.mul(low)).add(L::splat(token, self.low_offset[i]));
        let high = near.mul(high).max(far.mul(high)).add(L::splat(token, self.high_offset[i]));
        let [low_side, high_side] = boxes.sides[i];
        low_side.sub(high).max(low.sub(high_side))
    }

    /// One of the boxes of a node, prepared for tests of all rays.
    #[inline(always)]
    pub fn one_box<W: Lanes16>(&self, token: W::Token, node: &WideNode, slot: usize) -> OneBox<W> {
        let (up, slot) = (usize::from(self.sign < 0.0), slot & 7);
        let [apex_x, apex_y, apex_z] = self.axes.of(&self.kind.apex);
        let [[low_x, low_y, _], [high_x, high_y, _]] =
            [self.axes.of(&node.bounds[0]), self.axes.of(&node.bounds[1])];
        let near = self.axes.of(&node.bounds[up])[2][slot] - apex_z;
        let far = self.axes.of(&node.bounds[up ^ 1])[2][slot] - apex_z;
        let near = near * self.sign - self.margin;
        let far = far * self.sign * (1.0 + PADDING) + self.margin;
        let x_sides = self.padded([low_x[slot] - apex_x, high_x[slot] - apex_x]);
        let y_sides = self.padded([low_y[slot] - apex_y, high_y[slot] - apex_y]);
        let ([x, half_x], [y, half_y]) = (middle(x_sides), middle(y_sides));
        OneBox {
            near: W::splat(token, near),
            far: W::splat(token, far),
            sides: [
                x_sides.map(|side| W::splat(token, side)),
                y_sides.map(|side| W::splat(token, side)),
            ],
            middle: [W::splat(token, x), W::splat(token, y)],
            half: [W::splat(token, half_x), W::splat(token, half_y)],
        }
    }

    /// The sides of a box relative to the apex, padded.
    #[inline(always)]
    fn padded(&self, [low, high]: [f32; 2]) -> [f32; 2] {
        [low - low.abs() * PADDING - self.margin, high + high.abs() * PADDING + self.margin]
    }

    /// The rays that hit [a box](Self::one_box).
    #[inline(always)]
    pub fn rays_hitting<W: Lanes16>(&self, token: W::Token, one: &OneBox<W>) -> u32 {
        let near = one.near.max(W::load(token, &self.near));
        let far = one.far.min(W::load(token, &self.far));
        // In the projection along the axis of the packet: the distance of the line from the middle
        // of the box, times the length of the slope vector.
        let (slope_x, slope_y) = (W::load(token, &self.slope[0]), W::load(token, &self.slope[1]));
        let from_middle = W::load(token, &self.across)
            .sub(slope_y.mul(one.middle[0]))
            .add(slope_x.mul(one.middle[1]));
        let reach = slope_y.abs().mul_add(one.half[0], slope_x.abs().mul(one.half[1]));
        let beside = from_middle.abs().sub(reach);
        // The last operand is never NaN.
        let gap = self.gap_of_rays(token, one, 1, near, far).max(near.sub(far));
        self.gap_of_rays(token, one, 0, near, far).max(beside).max(gap).le(W::splat(token, 0.0))
    }

    /// The distance between the rays and a box on an axis; positive if a ray misses.
    #[inline(always)]
    fn gap_of_rays<W: Lanes16>(
        &self,
        token: W::Token,
        one: &OneBox<W>,
        i: usize,
        near: W,
        far: W,
    ) -> W {
        let (slope, offset) = (W::load(token, &self.slope[i]), W::load(token, &self.offset[i]));
        let (a, b) = (near.mul_add(slope, offset), far.mul_add(slope, offset));
        let [low, high] = one.sides[i];
        a.min(b).sub(high).max(low.sub(a.max(b)))
    }
}

/// Boxes relative to the apex of packets that are [coherent](Packet::is_coherent_with): the depths
/// where they begin and end along the axis of the packet, and their sides on the other two axes.
pub(crate) struct Boxes<L> {
    near: L,
    far: L,
    sides: [[L; 2]; 2],
}

/// A box relative to the apex, padded by all errors.
pub(crate) struct OneBox<W> {
    near: W,
    far: W,
    sides: [[W; 2]; 2],
    /// The middle of the two sides on each axis.
    middle: [W; 2],
    /// Half of the distance of the two sides on each axis, rounded up.
    half: [W; 2],
}

/// The middle of two sides, and half of their distance, rounded up.
#[inline(always)]
fn middle([low, high]: [f32; 2]) -> [f32; 2] {
    [(low + high) * 0.5, (high - low) * 0.5 + (low.abs() + high.abs()) * (0.5 * PADDING)]
}

/// Loads vectors by axis and ray.
#[inline(always)]
fn load3<W: Lanes16>(token: W::Token, [x, y, z]: &[PerRay<f32>; 3]) -> [W; 3] {
    [W::load(token, x), W::load(token, y), W::load(token, z)]
}

/// True if the boxes of a node are so small and near that the tests of packets cannot overflow.
#[inline(always)]
pub(super) fn is_in_range<L: Lanes8>(token: L::Token, node: &WideNode) -> bool {
    let [lows, highs] = &node.bounds;
    let mut within = 0xff;
    let largest = L::splat(token, LARGEST);
    for (low, high) in lows.iter().zip(highs) {
        let (low, high) = (L::load(token, low), L::load(token, high));
        // Unused slots are empty.
        within &= high.lt(low) | (L::splat(token, -LARGEST).lt(low) & high.lt(largest));
    }
    within == 0xff
}
