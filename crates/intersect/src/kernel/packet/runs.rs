//! Packets from runs of consecutive rays.

use super::MIN_RAYS;
use super::exact_rays::LaneRays;
use super::frustum::{Columns, Kind, Packet, RAYS};
use crate::kernel::columns::ray_columns;
use crate::kernel::packet::PacketTests;
use crate::precision::DoubleData;
use crate::precision::{Double, Real, Single};
use crate::search::{CULL_PADDING, padded};
use snell_math::simd::Lanes16;
use snell_math::{DRay, Ray};

/// The largest distance between the ends of the rays of two runs that are described relative to a
/// common point, relative to the length of the rays.
const NEAR: f64 = 1.0 / 64.0;

/// The ray relative to which a run is described: the first ray `before` of an earlier run if both
/// start at the same point or end at nearly the same point, otherwise the run's own first ray.
#[inline(always)]
pub(super) fn anchor<'a, P: PacketTests>(before: &'a P::Ray, rays: &'a [P::Ray]) -> &'a P::Ray {
    let [a, b] = [P::exact(before), P::exact(&rays[0])];
    if a.origin == b.origin {
        return before;
    }
    let c = P::exact(&rays[rays.len() - 1]);
    let (way_of_a, way_of_b) = (a.direction * a.t_max, b.direction * b.t_max);
    // Infinite and undefined lengths compare as false.
    let gap = (a.origin + way_of_a).distance_squared(b.origin + way_of_b);
    let is_near = gap <= NEAR * NEAR * way_of_b.length_squared() && b.t_max < f64::INFINITY;
    if is_near && b.origin != c.origin { before } else { &rays[0] }
}

/// Makes a packet of a run. The apex is the start or end of `anchor`, and triangles are tested
/// relative to its start. Returns false if the rays do not make a packet. Lanes without a ray
/// repeat the first ray, with a search that is over.
#[inline(always)]
pub(crate) fn set_up<W: Lanes16>(
    token: W::Token,
    packet: &mut Packet,
    rays: &[Ray],
    anchor: &Ray,
    backward: bool,
) -> bool {
    if rays.len() < MIN_RAYS {
        return false;
    }
    let first = &rays[0];
    let repeated;
    let all = match rays.first_chunk::<RAYS>() {
        Some(all) => all,
        None => {
            repeated = std::array::from_fn(|lane| *rays.get(lane).unwrap_or(first));
            &repeated
        }
    };
    packet.has_rays = false;
    // In registers of one size, because a value stored in halves cannot be loaded as a whole for
    // some time.
    let [ox, oy, oz, t_min, dx, dy, dz, t_max] = ray_columns::<W>(token, all);
    let zero = W::splat(token, 0.0);
    // The sum is zero if everything is finite, otherwise NaN.
    let mut sum = t_min.mul(zero);
    for column in [ox, oy, oz, dx, dy, dz] {
        sum = sum.add(column.mul(zero));
    }
    if sum.le(zero) & zero.le(t_min) & t_min.lt(t_max) != 0xffff {
        return false;
    }
    let ends = t_max.lt(W::splat(token, f32::INFINITY)) == 0xffff;
    let point = anchor.origin.to_array();
    let [x, y, z] = point;
    let from_point =
        [ox.sub(W::splat(token, x)), oy.sub(W::splat(token, y)), oz.sub(W::splat(token, z))];
    // Differences of finite numbers are zero exactly if the numbers are equal.
    let common =
        from_point[0].abs().max(from_point[1].abs()).max(from_point[2].abs()).le(zero) == 0xffff;
    let reversed = !common && ends;
    // The apex is a little beyond the ends, so that all rays end before it.
    let end = anchor.origin + anchor.direction * (anchor.t_max * (1.0 + 1.0 / 1024.0));
    let apex = if reversed { end } else { anchor.origin }.to_array();
    let kind =
        Kind { apex, reversed, common, backward: reversed && backward, rounded: false, slack: 0.0 };
    if !common {
        ox.store(&mut packet.projected_origin[0]);
        oy.store(&mut packet.projected_origin[1]);
        oz.store(&mut packet.projected_origin[2]);
    }
    dx.store(&mut packet.direction[0]);
    dy.store(&mut packet.direction[1]);
    dz.store(&mut packet.direction[2]);
    let from_apex = [
        ox.sub(W::splat(token, apex[0])),
        oy.sub(W::splat(token, apex[1])),
        oz.sub(W::splat(token, apex[2])),
    ];
    let unused = 0xffff << rays.len() & 0xffff;
    let cull = t_max
        .add(t_max.abs().mul(W::splat(token, CULL_PADDING)))
        .replace(unused, W::splat(token, -1.0));
    let direction = [dx, dy, dz];
    let columns = Columns { from_apex, from_point, direction, point, t_min, cull };
    packet.set_up::<W, Single>(token, &columns, first.direction.to_array(), kind)
}

/// Performs [`set_up`] in double precision.
#[inline(always)]
pub(crate) fn set_up_doubles<W: Lanes16>(
    token: W::Token,
    data: &DoubleData,
    packet: &mut Packet,
    rays: &[DRay],
    backward: bool,
) -> bool {
    if rays.len() < MIN_RAYS {
        return false;
    }
    let first = &rays[0];
    let ([mut t_min, mut cull], mut exact) = ([[0.0; RAYS]; 2], [[[0.0; RAYS]; 3]; 2]);
    let (mut is_fine, mut ends, mut common) = (true, true, true);
    for i in 0..RAYS {
        let ray = rays.get(i).unwrap_or(first);
        is_fine &= (ray.t_min >= 0.0) & (ray.t_min < ray.t_max);
        ends &= ray.t_max < f64::INFINITY;
        common &= ray.origin == first.origin;
        t_min[i] = ray.t_min.below();
        cull[i] = padded(ray.t_max.above());
        for (columns, vector) in exact.iter_mut().zip([ray.origin, ray.direction]) {
            columns[0][i] = vector.x;
            columns[1][i] = vector.y;
            columns[2][i] = vector.z;
        }
    }
    cull[rays.len()..].fill(-1.0);
    let reversed = !common && ends;
    // The apex is a little beyond the ends, so that all rays end before it.
    let end = first.origin + first.direction * (first.t_max * (1.0 + 1.0 / 1024.0));
    let apex = if reversed { end } else { first.origin };
    let kind = Kind {
        apex: [0.0; 3],
        reversed,
        common,
        backward: reversed && backward,
        rounded: true,
        slack: 0.0,
    };
    is_fine && {
        let (limits, points) =
            ([W::load(token, &t_min), W::load(token, &cull)], [apex, first.origin]);
        packet.set_up_exactly::<W, Double>(
            token,
            LaneRays::load(token, &exact),
            limits,
            data,
            0,
            points,
            &kind,
        )
    }
}
