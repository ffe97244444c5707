//! Sixteen rays as one bundle: what they have in common, and each of them in lanes.
//!
//! The bundle is described from a point, its *apex*: where the rays start if they share an origin, about where they end if they
//! go to one point, and any point near their origins else. Along the axis on which the first ray is fastest, `z` counts the distance from the apex, growing away from
//! it, and a ray is the line `x = slope z + offset` in each of the other two axes. With a shared origin all offsets are 0. No
//! inverse direction appears, so rays that are parallel to an axis, or go both ways along it, are nothing special.
//!
//! A box is missed by all if it lies outside of the four planes around the bundle (Reshetov, Soupikov and Hurley, Multi-Level Ray
//! Tracing Algorithm, 2005, go down with the same kind of frustum). Everything here is conservative.

use super::super::node::WideNode;
use crate::precision::Rules;
use snell_math::DRay;
use snell_math::DVec3;
use snell_math::simd::{Lanes8, WideLanes};

/// Rays in a bundle.
pub(super) const RAYS: usize = 16;

/// One number per ray.
pub(crate) type PerRay<T> = [T; RAYS];

/// Relative padding of everything that follows from rounded coordinates, as [`super::super::node::BOX_PADDING`]: roundings
/// of `f32` here, and of the drawing of triangles, come to less than half of it.
const PADDING: f32 = 1.0e-6;

/// Relative to their distance, how far from the start of an interval triangles are surely within: many times the roundings.
const SURE_PADDING: f32 = 16.0 * PADDING;

/// The same at the end, relative to the length: twice what limits are padded by ([`super::super::node::padded`]).
const END_PADDING: f32 = 2.0e-4;

/// Coordinates and directions beyond this are left to the other kernels: here nothing may overflow.
const LARGEST: f32 = 1.0e15;

/// No box is as far. (So that boxes that are missed, and empty ones, begin beyond it.)
const FARTHEST: f32 = 1.0e16;

/// Bundles that spread more than this, per unit of depth, are not worth it.
const MAX_SPREAD: f32 = 0.25;

/// The rays of a bundle in the coordinates of a group, a row per ray.
#[derive(Clone, Debug)]
pub(crate) struct ExactRays {
    /// With `t_min` as fourth.
    pub origin: PerRay<[f64; 4]>,
    pub direction: PerRay<[f64; 4]>,
}

impl ExactRays {
    /// One of the rays; its interval is not used.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> DRay {
        let (o, d) = (&self.origin[lane], &self.direction[lane]);
        DRay::new(DVec3::new(o[0], o[1], o[2]), DVec3::new(d[0], d[1], d[2]))
    }
}

/// What is known of a bundle besides its rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kind {
    /// The point that the bundle is described from.
    pub apex: [f32; 3],
    /// The rays end near the apex instead of starting there.
    pub reversed: bool,
    /// All rays start at the apex.
    pub common: bool,
    /// Children are visited from the ends of the rays to their starts.
    pub backward: bool,
    /// The apex, or the origins as triangles see them, are rounded.
    pub rounded: bool,
    /// How far vertices may be from where they should be; 0 in single precision.
    pub slack: f32,
}

/// A bundle in the coordinates of a group.
#[derive(Clone, Debug)]
pub(crate) struct Bundle {
    pub rays: ExactRays,
    pub kind: Kind,
    /// Axes x, y and z of the bundle: z is the one along which it goes.
    pub axes: [usize; 3],
    /// 1 if `z` grows along its axis, -1 if it falls.
    pub sign: f32,
    /// For the order in which children are visited: as [`super::super::node::WideNode::order`] counts them.
    pub octant: usize,
    /// Bound of all absolute errors of positions; 0 for a shared origin at which nothing was rounded.
    pub margin: f32,
    /// The farthest that a ray starts from the apex.
    pub distance: f32,
    /// Per axis and ray.
    pub slope: [PerRay<f32>; 2],
    pub offset: [PerRay<f32>; 2],
    /// About where rays start, by axis of the bundle (z along the axis, not away from the apex), and how far the others do from there; not
    /// used with a shared origin.
    pub start_point: [f32; 3],
    pub start_spread: f32,
    /// Where the intervals of the rays begin, seen from there with the opposite sign (z away from the apex).
    pub begin: [PerRay<f32>; 3],
    /// The origins as triangles see them, by axis of the bundle; not used with a shared origin.
    pub drawn_origin: [PerRay<f32>; 3],
    /// All rays are drawn along the z axis of the bundle.
    pub is_aligned: bool,
    /// Where each ray starts and ends on the z axis; it ends before it starts when nothing is wanted of it any more.
    near: PerRay<f32>,
    far: PerRay<f32>,
    /// `z` at `t = 0`, and how fast it changes with `t`, without sign.
    start: PerRay<f32>,
    along: PerRay<f32>,
    /// What lies between is surely within the interval that the ray had at first.
    pub sure_near: PerRay<f32>,
    pub sure_far: PerRay<f32>,
    /// Least and greatest of all rays.
    bundle_near: f32,
    pub bundle_far: f32,
    low_slope: [f32; 2],
    high_slope: [f32; 2],
    low_offset: [f32; 2],
    high_offset: [f32; 2],
}

/// The axes of a bundle, by the sizes of a direction: the last is the largest, as in [`super::super::ray::LocalRay`].
#[inline(always)]
fn axes(d: [f32; 3]) -> [usize; 3] {
    if d[0] >= d[1] && d[0] >= d[2] {
        [1, 2, 0]
    } else if d[1] >= d[2] {
        [2, 0, 1]
    } else {
        [0, 1, 2]
    }
}

/// What a bundle is made of, by axis of the group and ray, rounded to nearest.
pub(crate) struct Columns {
    /// Origins, seen from the apex and from [the first one, rounded](Bundle::drawn_origin); not used with a shared origin.
    pub from_apex: [PerRay<f32>; 3],
    pub from_first: [PerRay<f32>; 3],
    pub direction: [PerRay<f32>; 3],
    /// Not negative.
    pub t_min: PerRay<f32>,
    /// The padded limits of the searches; negative for rays whose search is over, and lanes without a ray.
    pub cull: PerRay<f32>,
}

impl Columns {
    pub const ZERO: Self = Self {
        from_apex: [[0.0; RAYS]; 3],
        from_first: [[0.0; RAYS]; 3],
        direction: [[0.0; RAYS]; 3],
        t_min: [0.0; RAYS],
        cull: [0.0; RAYS],
    };

    /// Where half of the rays are at `t`, with the opposite sign, seen from the first one.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; `half` must be 0 or 1.
    #[inline(always)]
    unsafe fn begin<L: Lanes8>(&self, axis: usize, half: usize, t: L) -> L {
        // SAFETY: passed on to the caller.
        unsafe {
            let (from, direction): (L, L) = (lanes(&self.from_first[axis], half), lanes(&self.direction[axis], half));
            L::splat(0.0).sub(from).sub(t.mul(direction))
        }
    }
}

/// # Safety
/// The machine must have the instructions of `L`.
#[inline(always)]
unsafe fn least<L: WideLanes>(values: &PerRay<f32>) -> f32 {
    // SAFETY: passed on to the caller.
    unsafe { lanes::<L>(values, 0).min(lanes(values, 1)).least() }
}

/// The greatest of both halves without their signs.
///
/// # Safety
/// The machine must have the instructions of `L`.
#[inline(always)]
unsafe fn size<L: WideLanes>(values: &PerRay<f32>) -> L {
    // SAFETY: passed on to the caller.
    unsafe { lanes::<L>(values, 0).abs().max(lanes::<L>(values, 1).abs()) }
}

/// # Safety
/// The machine must have the instructions of `L`.
#[inline(always)]
unsafe fn greatest<L: WideLanes>(values: &PerRay<f32>) -> f32 {
    // SAFETY: passed on to the caller.
    unsafe { lanes::<L>(values, 0).max(lanes(values, 1)).greatest() }
}

impl Bundle {
    /// No bundle yet.
    pub const NONE: Self = Self {
        rays: ExactRays { origin: [[0.0; 4]; RAYS], direction: [[0.0; 4]; RAYS] },
        kind: Kind { apex: [0.0; 3], reversed: false, common: false, backward: false, rounded: false, slack: 0.0 },
        axes: [0; 3],
        sign: 1.0,
        octant: 0,
        margin: 0.0,
        distance: 0.0,
        slope: [[0.0; RAYS]; 2],
        offset: [[0.0; RAYS]; 2],
        start_point: [0.0; 3],
        start_spread: 0.0,
        begin: [[0.0; RAYS]; 3],
        drawn_origin: [[0.0; RAYS]; 3],
        is_aligned: false,
        near: [0.0; RAYS],
        far: [0.0; RAYS],
        start: [0.0; RAYS],
        along: [0.0; RAYS],
        sure_near: [0.0; RAYS],
        sure_far: [0.0; RAYS],
        bundle_near: 0.0,
        bundle_far: 0.0,
        low_slope: [0.0; 2],
        high_slope: [0.0; 2],
        low_offset: [0.0; 2],
        high_offset: [0.0; 2],
    };

    /// Works out the kind, the columns and everything else from `rays` in `f64`, the intervals in `columns`, and the apex, all in the
    /// coordinates of a group. False if these rays do not make a bundle.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn set_up_exactly<L: WideLanes, P: Rules>(
        &mut self,
        columns: &mut Columns,
        data: &P::Data,
        group: usize,
        apex: DVec3,
        kind: &Kind,
    ) -> bool {
        // Zero if everything is finite.
        let mut sum = 0.0;
        for lane in 0..RAYS {
            let ray = P::ray_in_structure(data, group, &self.rays.get(lane));
            let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
            for axis in 0..3 {
                sum += o[axis] * 0.0 + d[axis] * 0.0;
                columns.direction[axis][lane] = d[axis] as f32;
                self.drawn_origin[axis][lane] = o[axis] as f32;
            }
        }
        let apex = P::point_in_structure(data, group, apex).as_vec3().to_array();
        self.kind = Kind { apex, rounded: true, slack: P::slack(data, group), ..*kind };
        if !kind.common {
            let apex = apex.map(f64::from);
            let first = [0, 1, 2].map(|axis| f64::from(self.drawn_origin[axis][0]));
            for lane in 0..RAYS {
                let o = P::ray_in_structure(data, group, &self.rays.get(lane)).origin.to_array();
                for axis in 0..3 {
                    columns.from_apex[axis][lane] = (o[axis] - apex[axis]) as f32;
                    columns.from_first[axis][lane] = (o[axis] - first[axis]) as f32;
                }
            }
        }
        // SAFETY: as promised by the caller.
        sum == 0.0 && unsafe { self.set_up::<L, P>(columns) }
    }

    /// Works out everything else from `kind`, `drawn_origin` by axis of the group, `rays` and `columns`. False if these rays do not make
    /// a bundle.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn set_up<L: WideLanes, P: Rules>(&mut self, columns: &Columns) -> bool {
        let kind = self.kind;
        let directions = &columns.direction;
        self.axes = axes([0, 1, 2].map(|axis| directions[axis][0].abs()));
        let [x, y, z] = self.axes;
        let forward: f32 = if directions[z][0] < 0.0 { -1.0 } else { 1.0 };
        let sign = if kind.reversed { -forward } else { forward };
        self.sign = sign;
        // Quotients as in [`super::super::ray::LocalRay`], whose shears these are if triangles are drawn in `f32`.
        let is_drawn = kind.rounded && !P::TRIANGLES_ELSEWHERE;
        if is_drawn {
            for (i, d) in self.rays.direction.iter().enumerate() {
                self.slope[0][i] = (d[x] / d[z]) as f32 * sign;
                self.slope[1][i] = (d[y] / d[z]) as f32 * sign;
            }
        }
        // SAFETY: passed on to the caller; halves are 0 and 1.
        unsafe {
            for half in 0..2 {
                let along: L = lanes(&directions[z], half);
                if !is_drawn {
                    for (slope, axis) in self.slope.iter_mut().zip([x, y]) {
                        store(lanes::<L>(&directions[axis], half).div(along).mul(L::splat(sign)), slope, half);
                    }
                }
                store(along.mul(L::splat(forward)), &mut self.along, half);
            }
        }
        // SAFETY: passed on to the caller.
        let (low, high) = unsafe {
            let [a, b] = &self.slope;
            ([least::<L>(a), least::<L>(b)], [greatest::<L>(a), greatest::<L>(b)])
        };
        // SAFETY: passed on to the caller.
        let fine = unsafe { least::<L>(&self.along) > 1.0 / LARGEST && greatest::<L>(&self.along) < LARGEST }
            && (0..2).all(|i| low[i] >= -2.0 && high[i] <= 2.0 && high[i] - low[i] <= MAX_SPREAD)
            && kind.apex.iter().all(|a| a.abs() < LARGEST);
        if !fine {
            return false;
        }
        // At slope 1 the choice of the axis is a tie, or decided by less than the rounding of the slope.
        self.is_aligned = (0..2).all(|i| low[i] > -1.0 && high[i] < 1.0);
        (self.margin, self.distance) = (0.0, 0.0);
        // SAFETY: passed on to the caller.
        unsafe {
            if kind.common {
                (self.start, self.offset) = ([0.0; RAYS], [[0.0; RAYS]; 2]);
            } else {
                self.place::<L>(columns);
            }
            if kind.rounded {
                let [x, y, z] = &self.drawn_origin;
                let size = size::<L>(x).max(size(y)).max(size(z)).greatest();
                self.margin += size * (12.0 * f32::EPSILON) + f32::MIN_POSITIVE + kind.slack;
            }
        }
        if self.margin.is_nan() || self.margin >= LARGEST {
            return false;
        }
        self.octant = (0..3).fold(0, |octant, axis| {
            let down = (directions[axis][0] < 0.0) != kind.backward;
            octant | usize::from(down) << axis
        });
        for i in 0..RAYS {
            let early = columns.t_min[i] * self.along[i];
            let end = self.end(i, columns.cull[i]);
            let (near, far) = if kind.reversed {
                (end, (self.start[i] - early) * (1.0 + PADDING) + self.margin)
            } else {
                ((self.start[i] + early) * (1.0 - PADDING) - self.margin, end)
            };
            let over = columns.cull[i] < 0.0;
            self.near[i] = if over { f32::INFINITY } else { near };
            self.far[i] = if over { f32::NEG_INFINITY } else { far };
            // Limits are padded, starts are not.
            let length = columns.cull[i] * self.along[i];
            let at_end = if length < FARTHEST { length.abs() * END_PADDING } else { 0.0 };
            let (at_near, at_far) = if kind.reversed { (at_end, 0.0) } else { (0.0, at_end) };
            self.sure_near[i] = near + near.abs() * SURE_PADDING + 8.0 * self.margin + at_near;
            self.sure_far[i] = far - far.abs() * SURE_PADDING - 8.0 * self.margin - at_far;
        }
        // SAFETY: passed on to the caller.
        unsafe { self.update_limits::<L>() };
        // Before the apex the slopes change places; the bundle is hardly wider there.
        let before = (-self.bundle_near).max(0.0);
        for i in 0..2 {
            self.low_slope[i] = low[i] - 2.0 * PADDING;
            self.high_slope[i] = high[i] + 2.0 * PADDING;
            let extra = self.margin + (self.high_slope[i] - self.low_slope[i]) * before;
            // SAFETY: passed on to the caller.
            unsafe {
                self.low_offset[i] = least::<L>(&self.offset[i]) - extra;
                self.high_offset[i] = greatest::<L>(&self.offset[i]) + extra;
            }
        }
        true
    }

    /// Works out where rays that do not share their origin begin.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    unsafe fn place<L: WideLanes>(&mut self, columns: &Columns) {
        let [x, y, z] = self.axes;
        self.start_point = [self.drawn_origin[x][0], self.drawn_origin[y][0], self.drawn_origin[z][0]];
        self.drawn_origin = [self.drawn_origin[x], self.drawn_origin[y], self.drawn_origin[z]];
        // SAFETY: passed on to the caller; halves are 0 and 1.
        unsafe {
            let (mut far, mut spread) = (L::splat(0.0), L::splat(0.0));
            let sign = L::splat(self.sign);
            for half in 0..2 {
                let from = &columns.from_apex;
                let from: [L; 3] = [lanes(&from[x], half), lanes(&from[y], half), lanes(&from[z], half)];
                let from_z = from[2].mul(sign);
                store(from_z, &mut self.start, half);
                for (i, from) in from.iter().enumerate().take(2) {
                    let slope: L = lanes(&self.slope[i], half);
                    store(from.sub(slope.mul(from_z)), &mut self.offset[i], half);
                }
                far = far.max(from[0].abs().add(from[1].abs()).add(from[2].abs()));
                let t: L = lanes(&columns.t_min, half);
                let begin =
                    [columns.begin::<L>(x, half, t), columns.begin::<L>(y, half, t), columns.begin::<L>(z, half, t)];
                spread = spread.max(begin[0].abs().add(begin[1].abs()).add(begin[2].abs()));
                store(begin[0], &mut self.begin[0], half);
                store(begin[1], &mut self.begin[1], half);
                store(begin[2].mul(sign), &mut self.begin[2], half);
            }
            self.start_spread = spread.greatest();
            self.distance = far.greatest();
        }
        self.margin = self.distance * (2.0 * PADDING) + f32::MIN_POSITIVE;
    }

    /// Where a search with this limit ends.
    #[inline(always)]
    fn end(&self, lane: usize, cull: f32) -> f32 {
        if self.kind.reversed {
            self.start[lane] * (1.0 - PADDING) - cull * self.along[lane] - self.margin
        } else {
            let end = (self.start[lane] + cull * self.along[lane]) * (1.0 + PADDING) + self.margin;
            if end < FARTHEST { end } else { FARTHEST }
        }
    }

    /// After a hit of one ray: its new padded limit, negative if its search is over. [`Self::update_limits`] must follow.
    #[inline(always)]
    pub fn tighten(&mut self, lane: usize, cull: f32) {
        if cull < 0.0 {
            (self.near[lane], self.far[lane]) = (f32::INFINITY, f32::NEG_INFINITY);
        } else if self.kind.reversed {
            self.near[lane] = self.end(lane, cull);
        } else {
            self.far[lane] = self.end(lane, cull);
        }
    }

    /// After hits: what is of interest to any of the rays.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn update_limits<L: WideLanes>(&mut self) {
        // SAFETY: passed on to the caller.
        unsafe {
            self.bundle_near = least::<L>(&self.near);
            self.bundle_far = greatest::<L>(&self.far);
        }
    }

    /// For each child of a node where the bundle enters its box (at or beyond `bundle_far` if it is missed).
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn box_distances<L: Lanes8>(&self, node: &WideNode) -> L {
        let [x, y, z] = self.axes;
        let up = usize::from(self.sign < 0.0);
        // SAFETY: passed on to the caller; axes are below 3.
        unsafe {
            let near = self.planes::<L>(node, up, z).mul(L::splat(self.sign)).sub(L::splat(self.margin));
            let far =
                self.planes::<L>(node, up ^ 1, z).mul(L::splat(self.sign * (1.0 + PADDING))).add(L::splat(self.margin));
            let near = near.max(L::splat(self.bundle_near));
            let far = far.min(L::splat(self.bundle_far));
            // The last one is always a number.
            let gap = self.gap(node, 0, x, near, far).max(self.gap(node, 1, y, near, far).max(near.sub(far)));
            gap.mul(L::splat(f32::MAX)).max(near)
        }
    }

    /// The planes of the boxes of a node as seen from the apex.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; `side` must be 0 or 1, `axis` below 3.
    #[inline(always)]
    unsafe fn planes<L: Lanes8>(&self, node: &WideNode, side: usize, axis: usize) -> L {
        // SAFETY: passed on to the caller.
        unsafe {
            let planes = L::load(node.bounds.get_unchecked(side).get_unchecked(axis));
            planes.sub(L::splat(*self.kind.apex.get_unchecked(axis)))
        }
    }

    /// Positive where the boxes of a node, from `near` to `far`, lie beside the bundle on an axis.
    ///
    /// # Safety
    /// As [`Self::planes`].
    #[inline(always)]
    unsafe fn gap<L: Lanes8>(&self, node: &WideNode, i: usize, axis: usize, near: L, far: L) -> L {
        // SAFETY: passed on to the caller.
        unsafe {
            let (low, high) = (L::splat(self.low_slope[i]), L::splat(self.high_slope[i]));
            let low = near.mul(low).min(far.mul(low)).add(L::splat(self.low_offset[i]));
            let high = near.mul(high).max(far.mul(high)).add(L::splat(self.high_offset[i]));
            self.planes::<L>(node, 0, axis).sub(high).max(low.sub(self.planes::<L>(node, 1, axis)))
        }
    }

    /// Which rays meet one of the boxes of a node.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn rays_meeting<L: Lanes8>(&self, node: &WideNode, slot: usize) -> u32 {
        let [x, y, z] = self.axes;
        let up = usize::from(self.sign < 0.0);
        // SAFETY: sides are 0 or 1, axes below 3.
        let plane = |side: usize, axis: usize| unsafe {
            node.bounds.get_unchecked(side).get_unchecked(axis)[slot & 7] - self.kind.apex.get_unchecked(axis)
        };
        let near = plane(up, z) * self.sign - self.margin;
        let far = plane(up ^ 1, z) * self.sign * (1.0 + PADDING) + self.margin;
        let mut sides = [[0.0; 2]; 2];
        for (side, axis) in sides.iter_mut().zip([x, y]) {
            let (low, high) = (plane(0, axis), plane(1, axis));
            *side = [low - low.abs() * PADDING - self.margin, high + high.abs() * PADDING + self.margin];
        }
        let mut mask = 0;
        for half in 0..2 {
            // SAFETY: passed on to the caller.
            unsafe {
                let near = L::splat(near).max(lanes(&self.near, half));
                let far = L::splat(far).min(lanes(&self.far, half));
                let mut gap = near.sub(far);
                for (i, side) in sides.iter().enumerate() {
                    let (slope, offset): (L, L) = (lanes(&self.slope[i], half), lanes(&self.offset[i], half));
                    let (a, b) = (near.mul_add(slope, offset), far.mul_add(slope, offset));
                    let [low, high] = [L::splat(side[0]), L::splat(side[1])];
                    // The last one is always a number.
                    gap = a.min(b).sub(high).max(low.sub(a.max(b))).max(gap);
                }
                mask |= gap.le(L::splat(0.0)) << (8 * half);
            }
        }
        mask
    }
}

/// One half of the rays.
///
/// # Safety
/// The machine must have the instructions of `L`; `half` must be 0 or 1.
#[inline(always)]
unsafe fn lanes<L: Lanes8>(values: &PerRay<f32>, half: usize) -> L {
    // SAFETY: passed on to the caller.
    unsafe { L::load(&*values.as_ptr().add(8 * half).cast::<[f32; 8]>()) }
}

/// # Safety
/// `half` must be 0 or 1.
#[inline(always)]
pub(super) unsafe fn store<L: Lanes8>(from: L, values: &mut PerRay<f32>, half: usize) {
    // SAFETY: passed on to the caller.
    from.store(unsafe { &mut *values.as_mut_ptr().add(8 * half).cast::<[f32; 8]>() });
}

/// True if the boxes of a node are where the tests of bundles cannot overflow.
#[inline(always)]
pub(super) fn is_in_range(node: &WideNode) -> bool {
    let mut within = true;
    for slot in 0..8 {
        for axis in 0..3 {
            let (low, high) = (node.bounds[0][axis][slot], node.bounds[1][axis][slot]);
            // Unused slots are empty.
            within &= low > high || (low > -LARGEST && high < LARGEST);
        }
    }
    within
}
