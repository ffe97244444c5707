//! The exact test for the triangle that each ray certainly hits.

use super::exact_rays::LaneRays;
use super::frustum::{Packet, PerRay, RAYS};
use crate::exact::plane_hit::{Corners, PlaneHit, ProjectedHit, dot};
use crate::exact::triangle::PLACE_TOLERANCE;
use crate::precision::Real;
use crate::tree::Blocks;
use snell_math::simd::{Doubles16, Lanes16};

/// Distances and barycentrics of certain hits, by ray.
pub(crate) struct CertainHits<R> {
    pub t: PerRay<R>,
    pub b1: PerRay<R>,
    pub b2: PerRay<R>,
}

impl<R: Real> CertainHits<R> {
    pub const NONE: Self = Self { t: [R::ZERO; RAYS], b1: [R::ZERO; RAYS], b2: [R::ZERO; RAYS] };
}

/// Square of the inverse of the least slope, relative to the normal, of rays that are decided here.
/// The error of the projection is 8.5 units of `2^-24`, relative to the farthest vertex, so hits
/// are within [`crate::exact::triangle::PLACE_TOLERANCE`] up to an inverse slope of 98. (Hits are
/// in the box of the triangle, since the ray certainly passes through the triangle itself, not only
/// through its projection. The bound for that includes the rounding of the origin, so a triangle
/// that is certainly hit is large compared with that rounding.)
const STEEPEST_SQUARE: f64 = 64.0 * 64.0;

/// The results of rays: a bit for each.
pub(crate) struct Decided {
    /// The rays that hit their triangle.
    pub hits: u32,
    /// The rays that miss the box of their triangle, so that the exact test moves their hit away
    /// from the intersection with the plane.
    pub moved: u32,
}

/// Tests some of the rays, each with the triangle (given by eight times the number of its block
/// plus its lane) that it certainly hits. For the `projected` rays it is only certain that they hit
/// the projected triangle, and not that the hit is in the box of the triangle.
#[inline(always)]
pub(crate) fn test<W: Lanes16>(
    token: W::Token,
    blocks: &Blocks,
    packet: &Packet,
    [rays, projected]: [u32; 2],
    places: &PerRay<u32>,
    certain: &mut CertainHits<f32>,
) -> Decided {
    let corners = corners::<W>(token, blocks, rays, places);
    let LaneRays { origin, direction } = packet.lane_rays::<W>(token);
    let PlaneHit { normal: [nx, ny, nz], slope, t } =
        PlaneHit::<W::Doubles>::new(&corners, origin, direction);
    let [first, second, third] =
        [turned(corners[0], packet), turned(corners[1], packet), turned(corners[2], packet)];
    let speed = *packet.axes.of(&direction)[2];
    let square = nx.mul(nx).add(ny.mul(ny)).add(nz.mul(nz)).mul(speed.mul(speed));
    let is_steep = square.lt(slope.mul(slope).mul(W::Doubles::splat(token, STEEPEST_SQUARE)));
    let sign = W::splat(token, packet.sign);
    let shear =
        [W::load(token, &packet.slope[0]).mul(sign), W::load(token, &packet.slope[1]).mul(sign)];
    let ProjectedHit { inside, b1, b2 } = ProjectedHit::<W::Doubles>::new(
        token,
        [first, second, third],
        packet.projected(token),
        shear,
    );
    let mut decided = rays & is_steep & inside;
    if packet.kind.rounded {
        // Projected points also have the rounding error of the origin.
        let (start, one) = (*packet.axes.of(&origin)[2], W::Doubles::splat(token, 1.0));
        let [z0, z1, z2] = [
            W::Doubles::of(first[2]).sub(start),
            W::Doubles::of(second[2]).sub(start),
            W::Doubles::of(third[2]).sub(start),
        ];
        let place = dot([z0, z1, z2], [one.sub(b1).sub(b2), b1, b2]);
        let reach = place.abs().mul(W::Doubles::splat(token, PLACE_TOLERANCE * (1.0 - 1e-9)));
        decided &= place.sub(t.mul(speed)).abs().lt(reach);
    }
    t.rounded().store(&mut certain.t);
    b1.rounded().store(&mut certain.b1);
    b2.rounded().store(&mut certain.b2);
    let projected = rays & projected;
    let moved = if projected == 0 {
        0
    } else {
        projected & !in_box::<W>(token, &corners, &origin, &direction, t)
    };
    Decided { hits: decided & !moved, moved }
}

/// The rays whose point at `t` is in the box of their triangle, by the operations of
/// [`crate::exact::triangle::clamp_to_box`].
#[inline(always)]
fn in_box<W: Lanes16>(
    token: W::Token,
    [a, b, c]: &Corners<W>,
    origin: &[W::Doubles; 3],
    direction: &[W::Doubles; 3],
    t: W::Doubles,
) -> u32 {
    let (mut low, mut high, mut size) = (*origin, *origin, W::Doubles::splat(token, 0.0));
    for axis in 0..3 {
        // The least of the rounded differences is the rounded difference of the least.
        low[axis] = W::Doubles::of(a[axis].min(b[axis]).min(c[axis])).sub(origin[axis]);
        high[axis] = W::Doubles::of(a[axis].max(b[axis]).max(c[axis])).sub(origin[axis]);
        let side = high[axis].sub(low[axis]);
        size = size.replace(size.lt(side), side);
    }
    let (padding, small) =
        (size.mul(W::Doubles::splat(token, 0.8e-6)), W::Doubles::splat(token, 1e-8));
    // NaN is in no box.
    let mut inside = t.abs().lt(W::Doubles::splat(token, f64::INFINITY));
    for axis in 0..3 {
        let point = direction[axis].mul(t);
        let margin = point.abs().mul(small);
        let before = point.add(margin).lt(low[axis].sub(padding));
        inside &= !before & !high[axis].add(padding).lt(point.sub(margin));
    }
    inside
}

/// The coordinates in the order of the axes of a packet.
#[inline(always)]
fn turned<W: Lanes16>(v: [W; 3], packet: &Packet) -> [W; 3] {
    let [x, y, z] = packet.axes.of(&v);
    [*x, *y, *z]
}

/// The corners of a triangle for each ray. (Neighbouring rays mostly hit the same few triangles.)
#[inline(always)]
fn corners<W: Lanes16>(
    token: W::Token,
    blocks: &Blocks,
    mut rays: u32,
    places: &PerRay<u32>,
) -> Corners<W> {
    let mut corners = [[W::splat(token, 0.0); 3]; 3];
    while rays != 0 {
        let place = places[rays.trailing_zeros() as usize & (RAYS - 1)];
        let these = W::places_of(token, place, places);
        rays &= !these;
        let triangle = blocks.corners(place as usize >> 3, place as usize & 7);
        for (corner, from) in corners.iter_mut().zip(triangle) {
            for (axis, from) in corner.iter_mut().zip(from) {
                *axis = axis.replace(these, W::splat(token, from));
            }
        }
    }
    corners
}
