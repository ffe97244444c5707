//! Transposes sixteen records of eight numbers to eight columns.
//!
//! Nothing here uses `map` or `from_fn`: a closure that is not inlined is compiled without the SIMD
//! instructions of its caller.

use snell_math::Ray;
use snell_math::simd::{Lanes16, WideLanes};

const _: () = assert!(
    std::mem::offset_of!(Ray, t_min) == 12
        && std::mem::offset_of!(Ray, direction) == 16
        && std::mem::offset_of!(Ray, t_max) == 28
);

/// The eight columns of sixteen rows of eight numbers.
#[inline(always)]
pub(super) fn columns<W: Lanes16>(
    token: W::Token,
    low: [&[f32; 8]; 8],
    high: [&[f32; 8]; 8],
) -> [W; 8] {
    let half = W::half_token(token);
    let [a, b, c, d, e, f, g, h] = W::Half::load_columns(half, low);
    let [i, j, k, l, m, n, o, p] = W::Half::load_columns(half, high);
    [
        W::from_halves(token, a, i),
        W::from_halves(token, b, j),
        W::from_halves(token, c, k),
        W::from_halves(token, d, l),
        W::from_halves(token, e, m),
        W::from_halves(token, f, n),
        W::from_halves(token, g, o),
        W::from_halves(token, h, p),
    ]
}

/// The columns of sixteen rays: origin, `t_min`, direction, `t_max`.
#[inline(always)]
pub(super) fn ray_columns<W: Lanes16>(token: W::Token, rays: &[Ray; 16]) -> [W; 8] {
    columns(token, rows(rays, 0), rows(rays, 8))
}

/// Eight of the rays, starting at `from`, as rows of numbers.
#[inline(always)]
fn rows(rays: &[Ray; 16], from: usize) -> [&[f32; 8]; 8] {
    [
        row(&rays[from]),
        row(&rays[from + 1]),
        row(&rays[from + 2]),
        row(&rays[from + 3]),
        row(&rays[from + 4]),
        row(&rays[from + 5]),
        row(&rays[from + 6]),
        row(&rays[from + 7]),
    ]
}

#[inline(always)]
fn row(ray: &Ray) -> &[f32; 8] {
    // SAFETY: a ray is eight numbers in this order (`repr(C)`).
    unsafe { &*(&raw const *ray).cast::<[f32; 8]>() }
}
