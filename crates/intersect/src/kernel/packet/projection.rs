//! The edge tests of all rays of a packet with the projected corners of one triangle.
//!
//! The error of areas relative to a common point ([`super::leaf`]) is proportional to the distance
//! of the triangle times the length of its edges, which is too large for slivers. Corners projected
//! along a ray are small near that ray, and so are their errors.

use super::frustum::Packet;
use crate::exact::ray::Axes;
use crate::kernel::single::filter::single::edge_error;
use crate::tree::block::TriangleBlock;
use snell_math::simd::{Lanes8, Lanes16};

/// The rays that are certainly inside and certainly outside of the projected triangle, a bit for
/// each; a ray is in neither where single precision cannot decide.
#[inline(always)]
pub(super) fn sides<W: Lanes16>(
    token: W::Token,
    block: &TriangleBlock,
    triangle: usize,
    packet: &Packet,
) -> [u32; 2] {
    let sign = W::splat(token, packet.sign);
    let shear =
        [W::load(token, &packet.slope[0]).mul(sign), W::load(token, &packet.slope[1]).mul(sign)];
    let origin = packet.projected::<W>(token);
    let ([x0, y0], [x1, y1], [x2, y2]) = (
        project(token, &block.vertices[0], triangle, packet.axes, origin, shear),
        project(token, &block.vertices[1], triangle, packet.axes, origin, shear),
        project(token, &block.vertices[2], triangle, packet.axes, origin, shear),
    );
    let (pu, pv, pw) = (y1.mul(x2), y2.mul(x0), y0.mul(x1));
    let (u, v, w) = (x1.mul_sub(y2, pu), x2.mul_sub(y0, pv), x0.mul_sub(y1, pw));
    let error = W::splat(token, edge_error(W::Half::FUSED));
    let bound =
        pu.abs().max(pv.abs()).max(pw.abs()).mul_add(error, W::splat(token, f32::MIN_POSITIVE));
    let (low, high, other) = (u.min(v).min(w), u.max(v).max(w), W::splat(token, 0.0).sub(bound));
    // Nothing overflows, because the coordinates of packets are limited.
    [bound.lt(low) | high.lt(other), low.lt(other) & bound.lt(high)]
}

/// A corner of a triangle projected by each ray: [`crate::exact::triangle::Projection::project`].
#[inline(always)]
fn project<W: Lanes16>(
    token: W::Token,
    corner: &[[f32; 8]; 3],
    triangle: usize,
    axes: Axes,
    origin: [W; 3],
    shear: [W; 2],
) -> [W; 2] {
    let ([x, y, z], i) = (axes.of(corner), triangle & 7);
    let x = W::splat(token, x[i]).sub(origin[0]);
    let y = W::splat(token, y[i]).sub(origin[1]);
    let z = W::splat(token, z[i]).sub(origin[2]);
    [x.sub(shear[0].mul(z)), y.sub(shear[1].mul(z))]
}
