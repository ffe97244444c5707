//! The filter of triangles in double precision, conservative and in `f32`, on their shadow.

use super::single::{ProjectionFrame, place_margin};
use crate::exact::prepared::PreparedRay;
use crate::exact::ray::LocalRay;
use crate::tree::block::TriangleBlock;
use snell_math::simd::Lanes8;

/// Bound on the rounding error of an edge value of the shadow, relative to the largest projected
/// |x| times the largest projected |y|: four times `2^-22`, to cover also the roundings of the
/// projection that grow with |x| and |y|.
const EDGE_ERROR: f32 = 1.0 / (1u32 << 20) as f32;

/// Twice the error of a projected vertex per unit of its depth: the roundings of depth, shear and
/// their product, and of the difference. A generous bound on `2 * 4 u`, with `u = 2^-24`, half a
/// unit in the last place of `f32`.
const DEPTH_ERROR: f32 = 10.0 / (1u32 << 24) as f32;

/// Performs [`super::single::candidates`] on the shadow of the triangles. The test allows for the
/// errors of the vertices, the ray's origin and the projection.
#[inline(always)]
pub(crate) fn candidates<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    ray: &LocalRay,
    t_min: f32,
    cull: f32,
) -> u32 {
    let farthest = ray.origin[0].abs().max(ray.origin[1].abs()).max(ray.origin[2].abs());
    let slack = ray.slack + farthest * (f32::EPSILON * 0.5) + f32::MIN_POSITIVE;
    let (outside, sides, [z0, z1, z2]) =
        outside(token, block, &ProjectionFrame::<L>::new(token, ray), slack);
    if ray.depth_scale == 0.0 {
        return !outside & 0xff;
    }
    let margin = slack * 2.0 * ray.depth_scale.abs();
    let (scale, cull, start) = (
        L::splat(token, ray.depth_scale),
        L::splat(token, cull + margin),
        L::splat(token, t_min - t_min.abs() * 1e-6 - margin),
    );
    let (d0, d1, d2) = (z0.mul(scale), z1.mul(scale), z2.mul(scale));
    let (nearest, farthest) = (d0.min(d1).min(d2), d0.max(d1).max(d2));
    let margin = place_margin(token, nearest.abs().max(farthest.abs()), sides, ray.depth_scale);
    let beyond = cull.add(margin).lt(nearest) | farthest.add(margin).lt(start);
    !(outside | beyond) & 0xff
}

/// Performs [`super::single::lines_through`] on the shadow of the triangles. Unused lanes are
/// unspecified.
#[inline(always)]
pub(crate) fn lines_through<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    ray: &PreparedRay,
) -> u32 {
    let (outside, ..) =
        outside(token, block, &ProjectionFrame::<L>::of_prepared(token, ray), ray.slack);
    !outside & 0xff
}

/// The triangles that the line of the ray certainly does not pass through, because two of their
/// edges have signs that are certain and differ; also the projected sizes and the depths. Each
/// coordinate of a vertex relative to the origin may be off by `slack`.
#[inline(always)]
fn outside<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    frame: &ProjectionFrame<L>,
    slack: f32,
) -> (u32, L, [L; 3]) {
    let [v0, v1, v2] = &block.vertices;
    let ([x0, y0, z0], [x1, y1, z1], [x2, y2, z2]) =
        (frame.project(token, v0), frame.project(token, v1), frame.project(token, v2));
    let (zero, slack, depth_error, edge_error, tiny) = (
        L::splat(token, 0.0),
        L::splat(token, slack * 4.0),
        L::splat(token, DEPTH_ERROR),
        L::splat(token, EDGE_ERROR),
        L::splat(token, f32::MIN_POSITIVE),
    );
    let u = x1.mul(y2).sub(y1.mul(x2));
    let v = x2.mul(y0).sub(y2.mul(x0));
    let w = x0.mul(y1).sub(y0.mul(x1));
    let x = x0.abs().max(x1.abs()).max(x2.abs());
    let y = y0.abs().max(y1.abs()).max(y2.abs());
    let z = z0.abs().max(z1.abs()).max(z2.abs());
    // If each projected coordinate is off by at most `e` (an error along x or z moves it by at most
    // `slack`), an edge value is off by at most `2 e (x + y) + 2 e^2`.
    let twice = z.mul(depth_error).add(slack);
    let bound = x.mul(y).mul(edge_error).add(twice.mul(x.add(y).add(twice))).add(tiny);
    (u.min(v).min(w).add(bound).lt(zero) & bound.lt(u.max(v).max(w)), x.add(y), [z0, z1, z2])
}
