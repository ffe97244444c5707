//! Where all rays of a bundle are in the drawing of one triangle, which decides what they hit.
//!
//! Areas of what is seen from one point ([`super::leaf`]) are off by the distance of a triangle
//! times its length: too much for slivers. What a ray draws is small near that ray, and so are the
//! errors.

use super::bundle::Bundle;
use crate::exact::triangle::{TriangleBlock, edge_error};
use snell_math::simd::{Lanes8, Lanes16};

/// The rays that are inside and outside of the drawing of a triangle, a bit for each; neither where
/// single precision does not tell.
///
/// # Safety
/// The machine must have the instructions of `W`; the triangle must be below 8. All rays of the
/// bundle must be drawn along its z axis ([`Bundle::is_aligned`]).
#[inline(always)]
pub(super) unsafe fn sides<W: Lanes16>(
    block: &TriangleBlock,
    triangle: usize,
    bundle: &Bundle,
) -> [u32; 2] {
    // SAFETY: passed on to the caller.
    unsafe {
        let sign = W::splat(bundle.sign);
        let shear = [W::load(&bundle.slope[0]).mul(sign), W::load(&bundle.slope[1]).mul(sign)];
        let origin = bundle.drawn::<W>();
        let ([x0, y0], [x1, y1], [x2, y2]) = (
            draw(&block.vertices[0], triangle, bundle.axes, origin, shear),
            draw(&block.vertices[1], triangle, bundle.axes, origin, shear),
            draw(&block.vertices[2], triangle, bundle.axes, origin, shear),
        );
        let (pu, pv, pw) = (y1.mul(x2), y2.mul(x0), y0.mul(x1));
        let (u, v, w) = (x1.mul_sub(y2, pu), x2.mul_sub(y0, pv), x0.mul_sub(y1, pw));
        let error = W::splat(edge_error(W::Half::FUSED));
        let bound =
            pu.abs().max(pv.abs()).max(pw.abs()).mul_add(error, W::splat(f32::MIN_POSITIVE));
        let (low, high, other) = (u.min(v).min(w), u.max(v).max(w), W::splat(0.0).sub(bound));
        // (Nothing overflows: bundles have no coordinates for that.)
        [bound.lt(low) | high.lt(other), low.lt(other) & bound.lt(high)]
    }
}

/// A corner of a triangle as rays draw it: [`crate::exact::triangle::Drawing::draw`].
///
/// # Safety
/// The machine must have the instructions of `W`; axes must be below 3, and the triangle below 8.
#[inline(always)]
unsafe fn draw<W: Lanes16>(
    corner: &[[f32; 8]; 3],
    triangle: usize,
    [kx, ky, kz]: [usize; 3],
    origin: [W; 3],
    shear: [W; 2],
) -> [W; 2] {
    // SAFETY: passed on to the caller.
    unsafe {
        let x = W::splat(*corner.get_unchecked(kx).get_unchecked(triangle)).sub(origin[0]);
        let y = W::splat(*corner.get_unchecked(ky).get_unchecked(triangle)).sub(origin[1]);
        let z = W::splat(*corner.get_unchecked(kz).get_unchecked(triangle)).sub(origin[2]);
        [x.sub(shear[0].mul(z)), y.sub(shear[1].mul(z))]
    }
}
