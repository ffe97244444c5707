//! Sixteen rays in lanes, and which faces of a list they certainly hit.
//!
//! All arithmetic is in `f32`, except the distance of the origin from a plane that is not
//! perpendicular to an axis, which decides whether a ray starts in front of the surface that it
//! leaves. In the following error bounds, `u = 2^-24`, `D` is the largest distance of any vertex
//! from the origin of the ray along any axis, `S` the largest component of the direction, and `s =
//! |n d|` for the unit normal `n` (errors given as plain multiples of `u` are relative to `D S /
//! s`, which is at least `D / sqrt 3`):
//!
//! - The error of `s` is less than `7 u S`, and lanes with `s` below [`LEAST_SLOPE`] of `S` are not
//!   decided here; so the error of the distance `t` to the plane is `12.6 u D / s`.
//! - The error of the intersection with the plane is 18 u in each coordinate; that of the distance
//!   from an edge, a product of two of these coordinates and rounded coefficients, is 57.3 u.
//! - The error of the edges of parallelograms is up to 8 u, since opposite edges are treated as
//!   parallel ([`Outline`]).
//! - The projection of the exact test moves corners by `8.5 u D`. So a point that the projection
//!   puts on one side of an edge is on the other side, by less than 14.8 u measured in the plane;
//!   projected along an axis, distances are only shorter. The sum is less than [`EDGE_ERROR`].
//! - The exact test puts a hit at the intersection with the plane, or nearer to the projected
//!   point: within `8.5 u D / s`, and so within [`DISTANCE_ERROR`] of `t`, unless the ray is as
//!   close as that to an edge.

use crate::kernel::columns::ray_columns;
use crate::tree::list::List;
use crate::tree::list::faces::{Face, LEAST_COORDINATE, Line, Outline};
use snell_math::simd::{Doubles16, Lanes16};
use snell_math::{Bounds3, Ray};

/// The number of rays that are tested together.
pub(super) const RAYS: usize = 16;

/// One value per ray.
pub(super) type PerRay<T> = [T; RAYS];

const ROUNDING: f32 = f32::EPSILON / 2.0;
const EDGE_ERROR: f32 = 128.0 * ROUNDING;
const DISTANCE_ERROR: f32 = 32.0 * ROUNDING;

/// The slope, relative to `S`, below which a ray counts as parallel to a plane.
const LEAST_SLOPE: f32 = 1.0 / 2048.0;

/// A ray parallel to a plane hits no face in the plane if it starts farther away from the plane
/// than this, relative to `D`.
const BESIDE: f32 = 4.0 * LEAST_SLOPE;

/// The largest distance of ray origins, relative to the reach of the list; rays that start farther
/// away are left to the tree.
const FARTHEST: f32 = 64.0;

/// The least magnitude of the largest component of an ordinary ray's direction.
const SMALLEST: f32 = 1e-12;
/// The greatest magnitude of the largest component of an ordinary ray's direction.
const LARGEST: f32 = 1e12;

/// Sixteen rays, prepared for a list.
#[derive(Clone, Copy)]
pub(super) struct ListPacket<D: Doubles16> {
    pub origin: [D::Singles; 3],
    pub direction: [D::Singles; 3],
    pub t_min: D::Singles,
    pub t_max: D::Singles,
    /// The largest magnitude of the components of the direction.
    pub size: D::Singles,
    /// A bit for each lane with an ordinary ray.
    pub ordinary: u32,
    pub exact_origin: [D; 3],
    /// The origins relative to the centre of the list.
    from_center: [D::Singles; 3],
    /// The distance `D` of the error bounds above.
    far: D::Singles,
    /// The inverse of the least slope for which results can be certain.
    steepest: D::Singles,
    /// The error of distances from edges, to be multiplied by the inverse of the slope.
    edge_error: D::Singles,
    /// The error of distances to planes, to be multiplied by the inverse of the slope.
    distance_error: D::Singles,
}

/// The padding of boxes in [`ListPacket::may_meet`], relative to `D`.
const BOX_PADDING: f32 = 33.0 / 16_777_216.0;

/// The certain results for the nearest faces along sixteen rays.
pub(super) struct Nearest<W> {
    /// A lower bound on the distance of the nearest face; infinite if there is no face ahead.
    pub first: W,
    /// A lower bound on the distances of all other faces.
    pub second: W,
    /// The index of the nearest triangle, as the bits of a float.
    pub triangle: W,
    /// Positive if the nearest face is certainly hit, and not only possibly.
    certain: W,
    /// A bit for each ray whose results are not certain.
    pub doubtful: u32,
}

/// The certain results for occlusion rays.
pub(super) struct Blocked {
    /// The rays that certainly hit a face in their interval.
    pub blocked: u32,
    /// The rays that may hit a face in their interval.
    pub doubtful: u32,
    /// The rays that may hit a face somewhere ahead, also beyond their interval.
    pub met: u32,
}

/// The intersection of sixteen rays with planes of one orientation.
#[derive(Clone, Copy)]
struct Slope<W> {
    /// The inverse of the slope.
    inverse: W,
    /// A bound on the error of distances to the plane.
    distance_error: W,
    /// Up to this distance from an edge, the side is not certain.
    margin: W,
    /// The rays parallel to the plane, for which none of this is certain.
    along: u32,
}

/// The intersection of sixteen rays with a face.
struct FaceHits<W> {
    /// The distance to the plane.
    t: W,
    /// A bound on the error of `t`.
    error: W,
    /// The intersection with the plane, in the projected coordinates of the face.
    place: [W; 2],
    /// The distance from the intersection to the outline, positive inside. For rays for which this
    /// is not certain, it is below any margin.
    inside: W,
    margin: W,
    /// The rays that may or may not hit the face.
    doubtful: u32,
}

impl<D: Doubles16> ListPacket<D> {
    /// The rays that may hit a box, or come within the width of [`crate::lecture::box_ray::BoxRay`]
    /// of it. The result is valid for ordinary rays only.
    ///
    /// The line misses the box if an axis perpendicular to the line and to an edge of the box
    /// separates both (Gottschalk, Lin and Manocha, OBBTree, 1996); the ray misses it also if it
    /// starts beyond a side and goes away. The errors of coordinates and products are less than
    /// `12 u` of the distance `D`, with `u = 2^-24`, and the width is `17 u D`, so the box is
    /// padded by `33 u D`.
    #[inline(always)]
    pub fn may_meet(&self, token: D::Token, list: &List, bounds: &Bounds3) -> u32 {
        let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let middle = ((low + high) * 0.5 - list.center.as_dvec3()).as_vec3();
        let half = ((high - low) * 0.5).as_vec3();
        let ([px, py, pz], [dx, dy, dz]) = (self.from_center, self.direction);
        let splat = |value: f32| D::Singles::splat(token, value);
        let padding = self.far.mul(splat(BOX_PADDING));
        let (mx, my, mz) =
            (px.sub(splat(middle.x)), py.sub(splat(middle.y)), pz.sub(splat(middle.z)));
        let (hx, hy, hz) =
            (padding.add(splat(half.x)), padding.add(splat(half.y)), padding.add(splat(half.z)));
        let (ax, ay, az) = (dx.abs(), dy.abs(), dz.abs());
        // Differences too small for `f32` are not resolved.
        let least = splat(f32::MIN_POSITIVE);
        let separated = hy.mul(az).add(hz.mul(ay)).add(least).lt(dy.mul(mz).sub(dz.mul(my)).abs())
            | hz.mul(ax).add(hx.mul(az)).add(least).lt(dz.mul(mx).sub(dx.mul(mz)).abs())
            | hx.mul(ay).add(hy.mul(ax)).add(least).lt(dx.mul(my).sub(dy.mul(mx)).abs());
        let behind = hx.mul(ax).add(least).lt(dx.mul(mx))
            | hy.mul(ay).add(least).lt(dy.mul(my))
            | hz.mul(az).add(least).lt(dz.mul(mz));
        !(separated | behind) & 0xffff
    }

    /// Loads sixteen rays, of which the first `count`, at least one, are valid.
    #[inline(always)]
    pub fn new(token: D::Token, list: &List, rays: &[Ray; RAYS], count: usize) -> Self {
        let [x, y, z, t_min, dx, dy, dz, t_max] = ray_columns::<D::Singles>(token, rays);
        let splat = |value: f32| D::Singles::splat(token, value);
        let (px, py, pz) =
            (x.sub(splat(list.center.x)), y.sub(splat(list.center.y)), z.sub(splat(list.center.z)));
        let size = dx.abs().max(dy.abs()).max(dz.abs());
        let distance = px.abs().max(py.abs()).max(pz.abs());
        // The sum is zero if all are finite; otherwise it is NaN, which fails every comparison.
        let zero = splat(0.0);
        let sum = px.add(py).add(pz).add(dx).add(dy).add(dz).mul(zero);
        let ordinary = sum.le(zero)
            & zero.le(t_min)
            & t_min.lt(t_max)
            & distance.le(splat(list.reach * FARTHEST))
            & splat(SMALLEST).le(size)
            & size.le(splat(LARGEST))
            & ((2 << (count - 1)) - 1);
        let tiny = x.abs().min(y.abs()).min(z.abs()).lt(splat(LEAST_COORDINATE));
        let ordinary =
            if tiny & ordinary != 0 { ordinary & !vanishing(token, [x, y, z]) } else { ordinary };
        let far = distance.add(splat(list.reach));
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
            edge_error: far.mul(size).mul(splat(EDGE_ERROR)),
            distance_error: far.mul(splat(DISTANCE_ERROR)),
        }
    }

    /// Finds the nearest face of each ray.
    #[inline(always)]
    pub fn nearest(&self, token: D::Token, list: &List) -> Nearest<D::Singles> {
        let (zero, infinity) =
            (D::Singles::splat(token, 0.0), D::Singles::splat(token, f32::INFINITY));
        let mut nearest = Nearest {
            first: infinity,
            second: infinity,
            triangle: zero,
            certain: zero,
            doubtful: 0,
        };
        let mut number = 0;
        for (axis, faces) in list.faces.iter().enumerate() {
            let across = self.slope(token, self.direction[axis]);
            for face in &faces.across {
                nearest.note(
                    token,
                    self.t_min,
                    self.meet_across(token, face, axis, across),
                    face,
                    number,
                );
                number += 2;
            }
            for face in &faces.tilted {
                nearest.note(token, self.t_min, self.meet_tilted(token, face, axis), face, number);
                number += 2;
            }
        }
        let ahead = nearest.first.lt(infinity);
        nearest.doubtful |= ahead & nearest.certain.le(zero);
        nearest
    }

    /// Finds the rays that hit any face within their intervals.
    #[inline(always)]
    pub fn blocked(&self, token: D::Token, list: &List) -> Blocked {
        let (zero, none) =
            (D::Singles::splat(token, 0.0), D::Singles::splat(token, f32::NEG_INFINITY));
        let mut all = AnyFace { certainly: none, maybe: none, ahead: none, doubtful: 0 };
        let (mut blocked, mut doubtful) = (0, 0);
        for (axis, faces) in list.faces.iter().enumerate() {
            let across = self.slope(token, self.direction[axis]);
            for face in &faces.across {
                all.note([self.t_min, self.t_max], self.meet_across(token, face, axis, across));
            }
            for face in &faces.tilted {
                all.note([self.t_min, self.t_max], self.meet_tilted(token, face, axis));
            }
            blocked = zero.lt(all.certainly);
            doubtful = all.doubtful | zero.lt(all.maybe);
            if blocked & self.ordinary == self.ordinary {
                break;
            }
        }
        Blocked { blocked, doubtful: doubtful & !blocked, met: zero.lt(all.ahead) | blocked }
    }

    /// The values that follow from a slope, which is the dot product of directions with a plane's
    /// normal.
    #[inline(always)]
    fn slope(&self, token: D::Token, slope: D::Singles) -> Slope<D::Singles> {
        let inverse = D::Singles::splat(token, 1.0).div(slope);
        let steepness = inverse.abs();
        Slope {
            inverse,
            distance_error: steepness.mul(self.distance_error),
            margin: steepness.mul(self.edge_error),
            along: self.steepest.lt(steepness),
        }
    }

    /// Intersects the rays with a face perpendicular to an axis.
    #[inline(always)]
    fn meet_across(
        &self,
        token: D::Token,
        face: &Face,
        axis: usize,
        slope: Slope<D::Singles>,
    ) -> FaceHits<D::Singles> {
        let height = D::Singles::splat(token, face.level).sub(self.origin[axis]);
        let mut hits = self.meet(token, face, axis, height, slope);
        if slope.along != 0 {
            let is_beside = height.abs().le(self.far.mul(D::Singles::splat(token, BESIDE)));
            hits.mark_doubtful(token, slope.along, slope.along & is_beside);
        }
        hits
    }

    /// Intersects the rays with a face that is not perpendicular to its axis.
    #[inline(always)]
    fn meet_tilted(&self, token: D::Token, face: &Face, axis: usize) -> FaceHits<D::Singles> {
        let ([x, y, z], [a, b, c]) = (self.exact_origin, face.down);
        let height = z.mul_add(D::splat(token, c), D::splat(token, face.offset));
        let height = x.mul_add(D::splat(token, a), y.mul_add(D::splat(token, b), height)).rounded();
        let ([x, y, z], [a, b, c]) = (self.direction, face.normal);
        let slope = y.mul_add(D::Singles::splat(token, b), x.mul(D::Singles::splat(token, a)));
        let slope = self.slope(token, z.mul_add(D::Singles::splat(token, c), slope));
        let mut hits = self.meet(token, face, axis, height, slope);
        let ([x, y, z], [a, b, c, d]) =
            (self.origin, face.near.map(|x| D::Singles::splat(token, x)));
        let least = y.abs().mul_add(b, x.abs().mul_add(a, d));
        let near = height.abs().le(z.abs().mul_add(c, least));
        if slope.along | near != 0 {
            let is_beside = height.abs().le(self.far.mul(D::Singles::splat(token, BESIDE)));
            let outside = hits.inside.add(hits.margin).lt(D::Singles::splat(token, 0.0));
            hits.mark_doubtful(
                token,
                slope.along | near,
                (slope.along & is_beside) | (near & !slope.along & !outside),
            );
        }
        hits
    }

    /// Intersects the rays with a face whose plane is at the given heights above their origins.
    #[inline(always)]
    fn meet(
        &self,
        token: D::Token,
        face: &Face,
        axis: usize,
        height: D::Singles,
        slope: Slope<D::Singles>,
    ) -> FaceHits<D::Singles> {
        let t = height.mul(slope.inverse);
        let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
        let place = [
            t.mul_add(self.direction[x], self.from_center[x]),
            t.mul_add(self.direction[y], self.from_center[y]),
        ];
        let inside = match &face.outline {
            Outline::Strips([u, v], [half_u, half_v]) => {
                let from_u = D::Singles::splat(token, *half_u).sub(distance(token, u, place).abs());
                from_u.min(D::Singles::splat(token, *half_v).sub(distance(token, v, place).abs()))
            }
            Outline::Edges([a, b, c, d]) => distance(token, a, place)
                .min(distance(token, b, place))
                .min(distance(token, c, place).min(distance(token, d, place))),
        };
        FaceHits {
            t,
            error: slope.distance_error,
            place,
            inside,
            margin: slope.margin,
            doubtful: 0,
        }
    }
}

impl<W: Lanes16> FaceHits<W> {
    /// Records that some rays do not certainly hit the face, and that some of these may hit it.
    #[inline(always)]
    fn mark_doubtful(&mut self, token: W::Token, lanes: u32, doubtful: u32) {
        self.inside = self.inside.replace(lanes, W::splat(token, f32::NEG_INFINITY));
        self.doubtful = doubtful;
    }

    /// Positive if the face may be ahead of the ray.
    #[inline(always)]
    fn ahead(&self, t_min: W) -> W {
        self.t.sub(t_min).min(self.inside.add(self.margin))
    }
}

/// Statements about rays and faces. For each ray, a value is positive if the statement holds.
struct AnyFace<W> {
    /// A face is certainly hit within the interval.
    certainly: W,
    /// A face may be hit within the interval.
    maybe: W,
    /// A face may be hit ahead.
    ahead: W,
    doubtful: u32,
}

impl<W: Lanes16> AnyFace<W> {
    /// Includes the hits of another face by rays with these intervals. (NaN counts as less than any
    /// number, because it is the first operand of `max`.)
    #[inline(always)]
    fn note(&mut self, [t_min, t_max]: [W; 2], hits: FaceHits<W>) {
        let ahead = hits.ahead(t_min);
        let (low, high) = (hits.t.sub(hits.error), hits.t.add(hits.error));
        let certainly = low.sub(t_min).min(t_max.sub(high)).min(hits.inside.sub(hits.margin));
        self.doubtful |= hits.doubtful;
        self.certainly = certainly.max(self.certainly);
        self.maybe = t_max.sub(low).min(ahead).max(self.maybe);
        self.ahead = ahead.max(self.ahead);
    }
}

impl<W: Lanes16> Nearest<W> {
    /// Includes the hits of a face, whose first triangle has this index, by rays that begin at
    /// `t_min`.
    #[inline(always)]
    fn note(&mut self, token: W::Token, t_min: W, hits: FaceHits<W>, face: &Face, number: u32) {
        let zero = W::splat(token, 0.0);
        let (one, other) =
            (W::splat(token, f32::from_bits(number)), W::splat(token, f32::from_bits(number + 1)));
        self.doubtful |= hits.doubtful;
        let low = hits.t.sub(hits.error);
        let low = W::splat(token, f32::INFINITY).where_less(zero, hits.ahead(t_min), low);
        let of_side = one.where_less(distance(token, &face.diagonal, hits.place), zero, other);
        self.triangle = self.triangle.where_less(low, self.first, of_side);
        self.certain = self.certain.where_less(low, self.first, hits.inside.sub(hits.margin));
        self.second = self.second.min(self.first.max(low));
        self.first = self.first.min(low);
    }
}

/// The rays whose origin has a coordinate that is not zero, but so small that heights above planes
/// may underflow.
#[inline(always)]
fn vanishing<W: Lanes16>(token: W::Token, [x, y, z]: [W; 3]) -> u32 {
    let (zero, least) = (W::splat(token, 0.0), W::splat(token, LEAST_COORDINATE));
    let [x, y, z] = [x.abs(), y.abs(), z.abs()];
    (zero.lt(x) & x.lt(least)) | (zero.lt(y) & y.lt(least)) | (zero.lt(z) & z.lt(least))
}

/// The signed distance of a point from a line in the projection.
#[inline(always)]
fn distance<W: Lanes16>(token: W::Token, line: &Line, place: [W; 2]) -> W {
    place[0].mul_add(
        W::splat(token, line[0]),
        place[1].mul_add(W::splat(token, line[1]), W::splat(token, line[2])),
    )
}
