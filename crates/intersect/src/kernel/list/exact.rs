//! The exact test of four rays at once, each with a triangle of its own.
//!
//! The same operations in the same order as in [`super::super::triangle::hit_in_plane`], so the same bits. Vectors are in the order of the axes
//! that the ray draws on, so rays of all directions are worked on together; the drawing is rounded to `f32` after every
//! operation, which gives the bits of `f32`. What is rare (ties, points outside of the box of the triangle by rounding) counts as no hit here,
//! and is tested again by itself.

use super::contents::Row;
use crate::kernel::triangle::PLACE_TOLERANCE;
use snell_math::simd::Lanes4;

/// What became of four rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub b1: [f32; 4],
    pub b2: [f32; 4],
    /// One bit per ray that surely hits its triangle, at the distance of the plane.
    pub hits: u32,
}

/// Vectors of four rays by axis, as each of them draws: `row[axis]` is the first.
///
/// # Safety
/// The machine must have the instructions of `D`; axes must be below 3.
#[inline(always)]
unsafe fn columns<D: Lanes4>(rows: [&Row; 4], axes: [u32; 4]) -> [D; 3] {
    // SAFETY: passed on to the caller: a row has six numbers.
    unsafe {
        let from = |i: usize| &*rows[i].as_ptr().add(axes[i] as usize).cast::<[f64; 4]>();
        let [x, y, z, _] = D::load_columns([from(0), from(1), from(2), from(3)]);
        [x, y, z]
    }
}

/// Tests four rays, each with a triangle (`corners` by vertex and ray) whose plane it meets at a finite distance within its interval.
///
/// # Safety
/// The machine must have the instructions of `D`; axes must be below 3.
#[inline(always)]
pub(super) unsafe fn test<D: Lanes4>(
    origin: [&Row; 4],
    direction: [&Row; 4],
    corners: [[&Row; 4]; 3],
    axes: [u32; 4],
    distances: &[f64; 4],
) -> Found {
    // SAFETY: passed on to the caller.
    unsafe {
        let (o, d) = (columns::<D>(origin, axes), columns::<D>(direction, axes));
        let relative = [
            minus(columns::<D>(corners[0], axes), o),
            minus(columns::<D>(corners[1], axes), o),
            minus(columns::<D>(corners[2], axes), o),
        ];
        let shear = [d[0].div(d[2]).rounded(), d[1].div(d[2]).rounded()];
        let [p0, p1, p2] = [draw(relative[0], shear), draw(relative[1], shear), draw(relative[2], shear)];
        let (w0, s0) = edge(p1, p2);
        let (w1, s1) = edge(p2, p0);
        let (w2, s2) = edge(p0, p1);
        let inside = (s0[0] & s1[0] & s2[0]) | (s0[1] & s1[1] & s2[1]);
        let scale = D::splat(1.0).div(w0.add(w1).add(w2));
        let (b1, b2) = (w1.mul(scale), w2.mul(scale));
        let t = D::load_columns([&[distances[0]; 4], &[distances[1]; 4], &[distances[2]; 4], &[distances[3]; 4]])[0];
        // Surely near the drawn place: without divisions, so a little stricter.
        let [r0, r1, r2] = relative;
        let low = [r0[0].min(r1[0]).min(r2[0]), r0[1].min(r1[1]).min(r2[1]), r0[2].min(r1[2]).min(r2[2])];
        let high = [r0[0].max(r1[0]).max(r2[0]), r0[1].max(r1[1]).max(r2[1]), r0[2].max(r1[2]).max(r2[2])];
        let size = high[0].sub(low[0]).max(high[1].sub(low[1])).max(high[2].sub(low[2]));
        let b0 = D::splat(1.0).sub(b1).sub(b2);
        let place = r0[2].mul(b0).add(r1[2].mul(b1)).add(r2[2].mul(b2));
        let reach = place.abs().add(size).mul(D::splat(PLACE_TOLERANCE * (1.0 - 1e-9)));
        let mut in_place = place.sub(t.mul(d[2])).abs().le(reach);
        // And in the box.
        let padding = size.mul(D::splat(0.8e-6));
        for axis in 0..3 {
            let point = d[axis].mul(t);
            let margin = point.abs().mul(D::splat(1e-8));
            in_place &= low[axis].sub(padding).le(point.add(margin)) & point.sub(margin).le(high[axis].add(padding));
        }
        let mut found = Found { b1: [0.0; 4], b2: [0.0; 4], hits: inside & in_place };
        b1.store_rounded(&mut found.b1);
        b2.store_rounded(&mut found.b2);
        found
    }
}

/// As [`super::super::triangle::Drawing::draw`]. (A difference of numbers of single precision that is rounded from `f64` is the one of `f32`; so are
/// products and quotients.)
#[inline(always)]
fn draw<D: Lanes4>(relative: [D; 3], shear: [D; 2]) -> [D; 2] {
    let [x, y, z] = [relative[0].rounded(), relative[1].rounded(), relative[2].rounded()];
    [x.sub(shear[0].mul(z).rounded()).rounded(), y.sub(shear[1].mul(z).rounded()).rounded()]
}

/// As the function of the same name of the exact test: the area, and where it is positive and negative.
#[inline(always)]
fn edge<D: Lanes4>(p: [D; 2], q: [D; 2]) -> (D, [u32; 2]) {
    let (a, b) = (p[0].mul(q[1]), p[1].mul(q[0]));
    (a.sub(b), [b.lt(a), a.lt(b)])
}

#[inline(always)]
fn minus<D: Lanes4>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}
