//! Where all rays of a bundle are in the drawing of one triangle, which decides what they hit.
//!
//! Areas of what is seen from one point ([`super::leaf`]) are off by the distance of a triangle
//! times its length: too much for slivers. What a ray draws is small near that ray, and so are the
//! errors.

use super::bundle::Bundle;
use crate::exact::ray::Axes;
use crate::exact::triangle::{TriangleBlock, edge_error};
use snell_math::simd::{Lanes8, Lanes16};

/// The rays that are inside and outside of the drawing of a triangle, a bit for each; neither where
/// single precision does not tell.
#[inline(always)]
pub(super) fn sides<W: Lanes16>(
    token: W::Token,
    block: &TriangleBlock,
    triangle: usize,
    bundle: &Bundle,
) -> [u32; 2] {
    let sign = W::splat(token, bundle.sign);
    let shear =
        [W::load(token, &bundle.slope[0]).mul(sign), W::load(token, &bundle.slope[1]).mul(sign)];
    let origin = bundle.drawn::<W>(token);
    let ([x0, y0], [x1, y1], [x2, y2]) = (
        draw(token, &block.vertices[0], triangle, bundle.axes, origin, shear),
        draw(token, &block.vertices[1], triangle, bundle.axes, origin, shear),
        draw(token, &block.vertices[2], triangle, bundle.axes, origin, shear),
    );
    let (pu, pv, pw) = (y1.mul(x2), y2.mul(x0), y0.mul(x1));
    let (u, v, w) = (x1.mul_sub(y2, pu), x2.mul_sub(y0, pv), x0.mul_sub(y1, pw));
    let error = W::splat(token, edge_error(W::Half::FUSED));
    let bound =
        pu.abs().max(pv.abs()).max(pw.abs()).mul_add(error, W::splat(token, f32::MIN_POSITIVE));
    let (low, high, other) = (u.min(v).min(w), u.max(v).max(w), W::splat(token, 0.0).sub(bound));
    // (Nothing overflows: bundles have no coordinates for that.)
    [bound.lt(low) | high.lt(other), low.lt(other) & bound.lt(high)]
}

/// A corner of a triangle as rays draw it: [`crate::exact::triangle::Drawing::draw`].
#[inline(always)]
fn draw<W: Lanes16>(
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
