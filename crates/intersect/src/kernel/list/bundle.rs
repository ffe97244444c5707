//! Sixteen rays, a lane each, and what is certain about them and all faces of a list.
//!
//! Everything is in `f32` but the distance of the start from a plane, unless that is across an axis: it has to tell whether a ray starts in front of the
//! surface that it leaves.
//! With `u = 2^-24`, `D` the most that any vertex is away from the start of the ray along any axis, `S` the largest component of the direction, and
//! `s = |n d|` for the unit normal `n` (errors are relative to `D S / s`, which is at least `D / sqrt 3`):
//!
//! - `s` is off by less than `7 u S`, and lanes with `s` below [`LEAST_SLOPE`] of `S` are not decided here; so the distance `t` to the plane is off by `12.6 u D / s`.
//! - The place where the ray meets the plane is off by 18 u in each coordinate; the distance from an edge, a product of two of these and numbers
//!   that are rounded too, by 57.3 u.
//! - The drawing of the exact test moves corners by `8.5 u D`. So what is drawn on one side of an edge is, by distance in the plane, on the other by less than
//!   14.8 u; seen along an axis, distances are only shorter. It sums up to less than [`EDGE_ERROR`].
//! - Hits are where the ray meets the plane, or nearer to the place that was drawn: within `8.5 u D / s`, and so within [`DISTANCE_ERROR`] of `t`, unless the
//!   ray is as near to an edge as that.

use super::super::columns::ray_columns;
use super::List;
use super::faces::Face;
use snell_math::simd::{Doubles16, Lanes16};
use snell_math::{Bounds3, Ray};

/// Rays that are tested together.
pub(super) const RAYS: usize = 16;

/// One number per ray.
pub(super) type PerRay<T> = [T; RAYS];

const ROUNDING: f32 = f32::EPSILON / 2.0;
const EDGE_ERROR: f32 = 128.0 * ROUNDING;
const DISTANCE_ERROR: f32 = 32.0 * ROUNDING;

/// At less than this a ray runs along a plane.
const LEAST_SLOPE: f32 = 1.0 / 2048.0;

/// Rays that run along a plane meet no face in it if they start farther away from it, relative to `D`.
const BESIDE: f32 = 4.0 * LEAST_SLOPE;

/// The sign of a distance from a tilted plane is certain if that is more than this, relative to `D` and the coordinates of the centre: `f64` is
/// off by less than `2^-44` of them, here and in the exact test together.
const HEIGHT_ERROR: f32 = 1.0 / (1u64 << 36) as f32;

/// For planes across an axis the sign is always certain; but what is less than this may vanish by division.
const LEAST_HEIGHT: f32 = 1e-30;

/// Rays that start farther away, relative to the reach of the list, are left to the tree.
const FARTHEST: f32 = 64.0;

/// Sizes of directions of ordinary rays.
const SMALLEST: f32 = 1e-12;
const LARGEST: f32 = 1e12;

/// Sixteen rays.
#[derive(Clone, Copy)]
pub(super) struct Bundle<D: Doubles16> {
    pub origin: [D::Singles; 3],
    pub direction: [D::Singles; 3],
    pub t_min: D::Singles,
    pub t_max: D::Singles,
    /// The largest component of the direction, without its sign.
    pub size: D::Singles,
    /// The lanes with rays that are ordinary.
    pub ordinary: u32,
    pub exact_origin: [D; 3],
    /// Seen from the centre of the list.
    from_center: [D::Singles; 3],
    /// `D` above.
    far: D::Singles,
    /// Inverse of the least slope.
    steepest: D::Singles,
    /// Of heights above tilted planes.
    height_error: D::Singles,
    /// By the inverse of a slope.
    edge_error: D::Singles,
    minus_distance_error: D::Singles,
}

/// See [`Bundle::may_meet`].
const BOX_PADDING: f32 = 33.0 / 16_777_216.0;

/// What is certain about the nearest faces that sixteen rays meet.
pub(super) struct Nearest<W> {
    /// The nearest face of each ray is no nearer than this; infinite without one.
    pub first: W,
    /// All others are no nearer than that.
    pub second: W,
    /// The number of the triangle, as bits.
    pub triangle: W,
    /// The rays for which all this is not certain.
    pub doubtful: u32,
}

/// What is certain where any face will do.
pub(super) struct Blocked {
    /// The rays that surely meet one in their interval.
    pub blocked: u32,
    /// Those that may.
    pub doubtful: u32,
    /// Those that surely meet one somewhere ahead.
    pub met: u32,
}

/// How sixteen rays meet a face.
struct Meeting<W> {
    /// The distance to the plane.
    t: W,
    /// The inverse of the slope, without its sign.
    steepness: W,
    /// Where the ray meets the plane, in the coordinates of the face.
    place: [W; 2],
    /// Where the face is surely met ahead.
    hits: u32,
    /// Where it may be.
    doubtful: u32,
}

impl<D: Doubles16> Bundle<D> {
    /// The rays that may meet a box, or come within the width of [`crate::accel::box_ray::BoxRay`] of it; only ordinary ones count.
    ///
    /// The line misses it if an axis across it and an edge of the box tells them apart (Gottschalk, Lin and Manocha, OBBTree, 1996), the
    /// ray if it starts beyond a side and goes away. Coordinates and products are off by less than `12 u` of the distance `D`, with
    /// `u = 2^-24`, and the width is `17 u D`: the box is padded by `33 u D`.
    ///
    /// # Safety
    /// The machine must have the instructions of `D`.
    #[inline(always)]
    pub unsafe fn may_meet(&self, list: &List, bounds: &Bounds3) -> u32 {
        let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let middle = ((low + high) * 0.5 - list.center.as_dvec3()).as_vec3();
        let half = ((high - low) * 0.5).as_vec3();
        let ([px, py, pz], [dx, dy, dz]) = (self.from_center, self.direction);
        // SAFETY: passed on to the caller.
        unsafe {
            let splat = |value: f32| D::Singles::splat(value);
            let padding = self.far.mul(splat(BOX_PADDING));
            let (mx, my, mz) = (px.sub(splat(middle.x)), py.sub(splat(middle.y)), pz.sub(splat(middle.z)));
            let (hx, hy, hz) = (padding.add(splat(half.x)), padding.add(splat(half.y)), padding.add(splat(half.z)));
            let (ax, ay, az) = (dx.abs(), dy.abs(), dz.abs());
            // What is too small for `f32` is not told apart.
            let least = splat(f32::MIN_POSITIVE);
            let apart = hy.mul(az).add(hz.mul(ay)).add(least).lt(dy.mul(mz).sub(dz.mul(my)).abs())
                | hz.mul(ax).add(hx.mul(az)).add(least).lt(dz.mul(mx).sub(dx.mul(mz)).abs())
                | hx.mul(ay).add(hy.mul(ax)).add(least).lt(dx.mul(my).sub(dy.mul(mx)).abs());
            let behind = hx.mul(ax).add(least).lt(dx.mul(mx))
                | hy.mul(ay).add(least).lt(dy.mul(my))
                | hz.mul(az).add(least).lt(dz.mul(mz));
            !(apart | behind) & 0xffff
        }
    }

    /// Takes in sixteen rays, of which the first so many count: at least one.
    ///
    /// # Safety
    /// The machine must have the instructions of `D`.
    #[inline(always)]
    pub unsafe fn new(list: &List, rays: &[Ray; RAYS], count: usize) -> Self {
        // SAFETY: passed on to the caller.
        unsafe {
            let [x, y, z, t_min, dx, dy, dz, t_max] = ray_columns::<D::Singles>(rays);
            let splat = |value: f32| D::Singles::splat(value);
            let (px, py, pz) = (x.sub(splat(list.center.x)), y.sub(splat(list.center.y)), z.sub(splat(list.center.z)));
            let size = dx.abs().max(dy.abs()).max(dz.abs());
            let distance = px.abs().max(py.abs()).max(pz.abs());
            // Zero if all are numbers. (What is not a number is below nothing.)
            let zero = splat(0.0);
            let sum = px.add(py).add(pz).add(dx).add(dy).add(dz).mul(zero);
            let ordinary = sum.le(zero)
                & zero.le(t_min)
                & t_min.lt(t_max)
                & distance.le(splat(list.reach * FARTHEST))
                & splat(SMALLEST).le(size)
                & size.le(splat(LARGEST))
                & ((2 << (count - 1)) - 1);
            let far = distance.add(splat(list.reach));
            let magnitude = far.add(splat(list.center.abs().max_element()));
            Self {
                origin: [x, y, z],
                direction: [dx, dy, dz],
                t_min,
                t_max,
                size,
                ordinary,
                exact_origin: [D::of(x), D::of(y), D::of(z)],
                from_center: [px, py, pz],
                far,
                steepest: splat(1.0 / LEAST_SLOPE).div(size),
                height_error: magnitude.mul(splat(HEIGHT_ERROR)),
                edge_error: far.mul(size).mul(splat(EDGE_ERROR)),
                minus_distance_error: far.mul(splat(-DISTANCE_ERROR)),
            }
        }
    }

    /// The nearest face of each ray.
    ///
    /// # Safety
    /// The machine must have the instructions of `D`.
    #[inline(always)]
    pub unsafe fn nearest(&self, list: &List) -> Nearest<D::Singles> {
        // SAFETY: passed on to the caller.
        unsafe {
            let infinity = D::Singles::splat(f32::INFINITY);
            let triangle = D::Singles::splat(0.0);
            let mut nearest = Nearest { first: infinity, second: infinity, triangle, doubtful: 0 };
            let mut number = 0;
            for (axis, faces) in list.faces.iter().enumerate() {
                for face in &faces.across {
                    nearest.note(self.meet::<true>(face, axis), face, number, self.minus_distance_error);
                    number += 2;
                }
                for face in &faces.tilted {
                    nearest.note(self.meet::<false>(face, axis), face, number, self.minus_distance_error);
                    number += 2;
                }
            }
            nearest
        }
    }

    /// The rays that meet any face within their intervals.
    ///
    /// # Safety
    /// The machine must have the instructions of `D`.
    #[inline(always)]
    pub unsafe fn blocked(&self, list: &List) -> Blocked {
        let mut all = Blocked { blocked: 0, doubtful: 0, met: 0 };
        for (axis, faces) in list.faces.iter().enumerate() {
            // SAFETY: passed on to the caller.
            unsafe {
                for face in &faces.across {
                    self.note_blocked(self.meet::<true>(face, axis), &mut all);
                }
                for face in &faces.tilted {
                    self.note_blocked(self.meet::<false>(face, axis), &mut all);
                }
            }
            if all.blocked & self.ordinary == self.ordinary {
                break;
            }
        }
        all
    }

    #[inline(always)]
    fn note_blocked(&self, meeting: Meeting<D::Singles>, all: &mut Blocked) {
        let error = meeting.steepness.mul(self.minus_distance_error);
        let (low, high) = (meeting.t.add(error), meeting.t.sub(error));
        let blocked = meeting.hits & self.t_min.lt(low) & high.lt(self.t_max);
        all.blocked |= blocked;
        all.doubtful |= meeting.doubtful | (meeting.hits & low.lt(self.t_max) & !blocked);
        all.met |= meeting.hits;
    }

    /// How the rays meet a face, which is either across the axis or tilted.
    ///
    /// # Safety
    /// The machine must have the instructions of `D`; `axis` must be that of the face.
    #[inline(always)]
    unsafe fn meet<const ACROSS: bool>(&self, face: &Face, axis: usize) -> Meeting<D::Singles> {
        // SAFETY: passed on to the caller.
        unsafe {
            // Both with the sign that the normal has along the axis, or both without.
            let (height, slope, least) = if ACROSS {
                let height = D::Singles::splat(face.level).sub(self.origin[axis]);
                (height, self.direction[axis], D::Singles::splat(LEAST_HEIGHT))
            } else {
                let ([x, y, z], [a, b, c]) = (self.exact_origin, face.down);
                let height = z.mul_add(D::splat(c), D::splat(face.offset));
                let height = x.mul_add(D::splat(a), y.mul_add(D::splat(b), height));
                let ([x, y, z], [a, b, c]) = (self.direction, face.normal);
                let slope = y.mul_add(D::Singles::splat(b), x.mul(D::Singles::splat(a)));
                let slope = z.mul_add(D::Singles::splat(c), slope);
                (height.rounded(), slope, self.height_error)
            };
            let inverse = D::Singles::splat(1.0).div(slope);
            let t = height.mul(inverse);
            let steepness = inverse.abs();
            let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
            let place =
                [t.mul_add(self.direction[x], self.from_center[x]), t.mul_add(self.direction[y], self.from_center[y])];
            let [e0, e1, e2, e3] = &face.edges;
            let inside = distance(e0, place).min(distance(e1, place)).min(distance(e2, place).min(distance(e3, place)));
            let margin = self.edge_error.mul(steepness);
            let along = self.steepest.lt(steepness);
            let near = height.abs().le(least);
            let (mut ahead, mut doubtful) = (self.t_min.lt(t), 0);
            if along | near != 0 {
                ahead &= !(along | near);
                let zero = D::Singles::splat(0.0);
                // On the plane, or surely on the way from it: then it is not ahead.
                let leaves = if ACROSS { height.abs().le(zero) | (height.signs() ^ slope.signs()) } else { 0 };
                doubtful = along & height.abs().le(self.far.mul(D::Singles::splat(BESIDE)));
                doubtful |= near & !along & !leaves & !inside.lt(zero.sub(margin));
            }
            let hits = ahead & margin.lt(inside);
            doubtful |= ahead & inside.abs().le(margin);
            Meeting { t, steepness, place, hits, doubtful }
        }
    }
}

impl<W: Lanes16> Nearest<W> {
    /// Notes how rays meet a face, whose first triangle has this number.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    unsafe fn note(&mut self, meeting: Meeting<W>, face: &Face, number: u32, minus_distance_error: W) {
        // SAFETY: passed on to the caller.
        unsafe {
            self.doubtful |= meeting.doubtful;
            let low = meeting.steepness.mul_add(minus_distance_error, meeting.t);
            let low = W::splat(f32::INFINITY).replace(meeting.hits, low);
            let is_nearer = low.lt(self.first);
            self.second = self.second.min(self.first.max(low));
            self.first = self.first.min(low);
            let is_other = is_nearer & distance(&face.diagonal, meeting.place).signs();
            self.triangle = self.triangle.replace(is_nearer, W::splat(f32::from_bits(number)));
            self.triangle = self.triangle.replace(is_other, W::splat(f32::from_bits(number + 1)));
        }
    }
}

/// The distance of a place from a line.
///
/// # Safety
/// The machine must have the instructions of `W`.
#[inline(always)]
unsafe fn distance<W: Lanes16>(line: &[f32; 3], place: [W; 2]) -> W {
    // SAFETY: passed on to the caller.
    unsafe { place[0].mul_add(W::splat(line[0]), place[1].mul_add(W::splat(line[1]), W::splat(line[2]))) }
}
