//! The watertight ray-triangle test on `f64` vertices: the same rule as
//! [`crate::exact::triangle`], one precision higher.
//!
//! The vertices are drawn on a plane across the ray in `f64`, with the same operations in every
//! triangle of a vertex; on that drawing every sign is exact (products are compared in integers
//! where rounding could matter), and where the ray meets an edge or vertex of it, the same symbolic
//! shift decides.

use super::plane::Estimate;
use crate::exact::quick::QuickRay;
use crate::exact::ray::LocalRay;
use crate::exact::triangle::{DrawingFrame, TriangleBlock, clamp_to_box, place_margin};
use snell_math::exact::compare_products;
use snell_math::simd::Lanes8;
use snell_math::{DRay, DVec2, DVec3};

/// How vertices are drawn on the plane across a ray.
#[derive(Clone, Copy, Debug)]
struct Drawing {
    /// All vertices are drawn relative to it.
    origin: [f64; 3],
    /// Axes x, y, z of the drawing: z is where the direction is largest.
    axes: [usize; 3],
    /// Drawn x = x - shear[0] z, y = y - shear[1] z.
    shear: [f64; 2],
}

impl Drawing {
    #[inline(always)]
    fn new(ray: &DRay) -> Self {
        let (a, d) = (ray.direction.abs(), ray.direction.to_array());
        let z = if a.x >= a.y && a.x >= a.z { 0 } else { 2 - usize::from(a.y >= a.z) };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let per_z = 1.0 / d[z];
        Self {
            origin: ray.origin.to_array(),
            axes,
            shear: [d[axes[0]] * per_z, d[axes[1]] * per_z],
        }
    }

    /// The vertex as drawn: rounded subtraction, product, subtraction, never fused.
    #[inline(always)]
    fn draw(&self, v: DVec3) -> [f64; 2] {
        let [kx, ky, kz] = self.axes;
        let (x, y, z) = (v[kx] - self.origin[kx], v[ky] - self.origin[ky], v[kz] - self.origin[kz]);
        [x - self.shear[0] * z, y - self.shear[1] * z]
    }
}

/// Bound of the rounding of an edge value of the shadow, relative to the largest drawn |x| times
/// the largest drawn |y|: `2^-22`, and as much again four times for the roundings of the drawing
/// that grow with |x| and |y|. (`u`, half a unit in the last place of `f32`, is `2^-24`.)
const EDGE_ERROR: f32 = 1.0 / (1u32 << 20) as f32;

/// Twice what a drawn vertex may be off by per unit of its depth: the roundings of depth, shear and
/// their product, and of the difference. `2 * 4 u`, with room to spare.
const DEPTH_ERROR: f32 = 10.0 / (1u32 << 24) as f32;

/// [`crate::exact::triangle::candidates`] on the shadow of the triangles: allows for what the
/// vertices, the ray's origin and the drawing are off by.
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
        outside(token, block, &DrawingFrame::<L>::new(token, ray), slack);
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

/// [`crate::exact::triangle::lines_through`] on the shadow of the triangles. Unused lanes are
/// unspecified.
#[inline(always)]
pub(crate) fn lines_through<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    ray: &QuickRay,
) -> u32 {
    let (outside, ..) = outside(token, block, &DrawingFrame::<L>::of_quick(token, ray), ray.slack);
    !outside & 0xff
}

/// Which triangles the line of the ray surely does not pass through: two of their edges have signs
/// that are certain and differ. Also the drawn size and the depths. A vertex relative to the origin
/// may be off by `slack` on each axis.
#[inline(always)]
fn outside<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    frame: &DrawingFrame<L>,
    slack: f32,
) -> (u32, L, [L; 3]) {
    let [v0, v1, v2] = &block.vertices;
    let ([x0, y0, z0], [x1, y1, z1], [x2, y2, z2]) =
        (frame.draw(token, v0), frame.draw(token, v1), frame.draw(token, v2));
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
    // With each drawn coordinate off by `e` (an error along x or z each moves it by `slack` at
    // most), an edge value is off by at most `2 e (x + y) + 2 e^2`.
    let twice = z.mul(depth_error).add(slack);
    let bound = x.mul(y).mul(edge_error).add(twice.mul(x.add(y).add(twice))).add(tiny);
    (u.min(v).min(w).add(bound).lt(zero) & bound.lt(u.max(v).max(w)), x.add(y), [z0, z1, z2])
}

/// Twice the signed area of the drawn triangle (ray, p, q), and its exact sign after the symbolic
/// shift of the ray: 0 only if the edge is a point or not a number.
#[inline(always)]
fn edge(p: [f64; 2], q: [f64; 2]) -> (f64, i32) {
    let (a, b) = (p[0] * q[1], p[1] * q[0]);
    let value = a - b;
    // Two products are off by half a unit in the last place each, or by underflow.
    let sure = value.abs() > (a.abs() + b.abs()) * f64::EPSILON + f64::MIN_POSITIVE;
    let sign =
        if sure { i32::from(value > 0.0) - i32::from(value < 0.0) } else { exact_sign(p, q) };
    (value, sign)
}

/// The sign of [`edge`] where rounding leaves it open.
#[cold]
#[inline(never)]
fn exact_sign(p: [f64; 2], q: [f64; 2]) -> i32 {
    let shifted =
        || p[1].partial_cmp(&q[1]).filter(|o| o.is_ne()).or_else(|| q[0].partial_cmp(&p[0]));
    let order = compare_products(p[0], q[1], p[1], q[0]).filter(|o| o.is_ne()).or_else(shifted);
    if [p, q].iter().flatten().all(|x| x.is_finite()) { order.map_or(0, |o| o as i32) } else { 0 }
}

/// The exact test: distance and barycentrics `(b1, b2)` if the line of the ray passes through the
/// drawn triangle at `t > t_min`.
///
/// The distance is that of the triangle's plane ([`Estimate::distance`]). Rays that graze the
/// triangle may meet the drawing without meeting the triangle; then the plane may be met anywhere,
/// and the distance is moved into the interval in which the ray is inside the triangle's box, so
/// that skipping boxes can never lose it.
#[inline(always)]
pub(crate) fn exact_hit(ray: &DRay, corners: &[DVec3; 3], t_min: f64) -> Option<(f64, DVec2)> {
    // First what drops the triangle that the ray starts on: most that are tested.
    let estimate = Estimate::of(ray, corners, t_min)?;
    let drawing = Drawing::new(ray);
    let [p0, p1, p2] =
        [drawing.draw(corners[0]), drawing.draw(corners[1]), drawing.draw(corners[2])];
    let (w0, s0) = edge(p1, p2);
    let (w1, s1) = edge(p2, p0);
    let (w2, s2) = edge(p0, p1);
    if s0 == 0 || s0 != s1 || s0 != s2 {
        return None;
    }
    // All have the sign `s0`, or would have without rounding.
    let side = f64::from(s0);
    let [w0, w1, w2] = [w0, w1, w2].map(|w| (w * side).max(0.0));
    let scale = 1.0 / (w0 + w1 + w2);
    let uv = if scale > 0.0 && scale.is_finite() {
        DVec2::new(w1, w2) * scale
    } else {
        DVec2::splat(1.0 / 3.0)
    };
    let relative = corners.map(|v| v - ray.origin);
    let plane = estimate.distance(ray, corners);
    let t = if plane.is_finite() {
        plane
    } else {
        let z = drawing.axes[2];
        let depth =
            relative[0][z] * (1.0 - uv.x - uv.y) + relative[1][z] * uv.x + relative[2][z] * uv.y;
        depth / ray.direction[z]
    };
    if t.is_nan() || t <= t_min {
        return None;
    }
    Some((clamp_to_box(&ray.direction, &relative, t), uv))
}
