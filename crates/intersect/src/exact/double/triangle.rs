//! The watertight ray-triangle test on `f64` vertices: the same rule as
//! [`crate::exact::triangle`], one precision higher.
//!
//! The vertices are projected in `f64` along the ray, by the same operations in every triangle that
//! shares a vertex. On the projected vertices every sign is exact (products are compared in
//! integers where rounding could matter), and where the ray passes exactly through a projected edge
//! or vertex, the same symbolic shift decides.

use super::plane::Estimate;
use crate::exact::triangle::{clamp_to_box, closed_signs};
use snell_math::exact::compare_products;
use snell_math::{DRay, DVec2, DVec3};

/// The sheared projection of vertices along a ray.
#[derive(Clone, Copy, Debug)]
struct Projection {
    /// The point relative to which vertices are projected.
    origin: [f64; 3],
    /// Axes x, y, z of the projection: z is the axis along which the direction is largest.
    axes: [usize; 3],
    /// The shear of the projection: projected x = x - shear[0] z, y = y - shear[1] z.
    shear: [f64; 2],
}

impl Projection {
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

    /// Projects a vertex; the subtraction, product and second subtraction are rounded and never
    /// fused.
    #[inline(always)]
    fn project(&self, v: DVec3) -> [f64; 2] {
        let [kx, ky, kz] = self.axes;
        let (x, y, z) = (v[kx] - self.origin[kx], v[ky] - self.origin[ky], v[kz] - self.origin[kz]);
        [x - self.shear[0] * z, y - self.shear[1] * z]
    }
}

/// Twice the signed area of the projected triangle (ray, p, q), and its exact sign after the
/// symbolic shift of the ray. The sign is 0 only if the edge has no length or a coordinate is NaN.
#[inline(always)]
fn edge(p: [f64; 2], q: [f64; 2]) -> (f64, i32) {
    let (a, b) = (p[0] * q[1], p[1] * q[0]);
    let value = a - b;
    // Each of the two products is off by at most half a unit in the last place, or by underflow.
    let certain = value.abs() > (a.abs() + b.abs()) * f64::EPSILON + f64::MIN_POSITIVE;
    let sign =
        if certain { i32::from(value > 0.0) - i32::from(value < 0.0) } else { exact_sign(p, q) };
    (value, sign)
}

/// The exact sign of [`edge`], for values that rounding makes uncertain.
#[cold]
#[inline(never)]
fn exact_sign(p: [f64; 2], q: [f64; 2]) -> i32 {
    let shifted =
        || p[1].partial_cmp(&q[1]).filter(|o| o.is_ne()).or_else(|| q[0].partial_cmp(&p[0]));
    let order = compare_products(p[0], q[1], p[1], q[0]).filter(|o| o.is_ne()).or_else(shifted);
    if [p, q].iter().flatten().all(|x| x.is_finite()) { order.map_or(0, |o| o as i32) } else { 0 }
}

/// True if the ray passes exactly through a projected edge, or the line of it.
#[cold]
fn is_on_edge(p: [f64; 2], q: [f64; 2]) -> bool {
    compare_products(p[0], q[1], p[1], q[0]).is_some_and(|order| order.is_eq())
}

/// The exact test. Returns distance and barycentrics `(b1, b2)` if the line of the ray passes
/// through the projected triangle at `t > t_min`.
///
/// The distance is that of the triangle's plane ([`Estimate::distance`]). A ray that grazes the
/// triangle may pass through the projected triangle and miss the true one; the intersection with
/// the plane may then be anywhere. So the distance is clamped to the interval in which the ray is
/// inside the triangle's box, and culling by boxes can never lose the hit.
#[inline(always)]
pub(crate) fn exact_hit(ray: &DRay, corners: &[DVec3; 3], t_min: f64) -> Option<(f64, DVec2)> {
    exact_hit_closed(ray, corners, t_min, 0)
}

/// Performs [`exact_hit`] for a triangle of which some edges belong to it: those whose bits are set
/// in `closed`, where bit `i` is the edge opposite of corner `i`. Rays that pass exactly through
/// them hit.
#[inline(always)]
pub(crate) fn exact_hit_closed(
    ray: &DRay,
    corners: &[DVec3; 3],
    t_min: f64,
    closed: u32,
) -> Option<(f64, DVec2)> {
    // This first step rejects the triangle on which the ray starts, the most frequent case.
    let estimate = Estimate::of(ray, corners, t_min)?;
    let projection = Projection::new(ray);
    let [p0, p1, p2] = [
        projection.project(corners[0]),
        projection.project(corners[1]),
        projection.project(corners[2]),
    ];
    let (w0, s0) = edge(p1, p2);
    let (w1, s1) = edge(p2, p0);
    let (w2, s2) = edge(p0, p1);
    let [s0, s1, s2] = if closed == 0 {
        [s0, s1, s2]
    } else {
        let is_on = [is_on_edge(p1, p2), is_on_edge(p2, p0), is_on_edge(p0, p1)];
        closed_signs([s0, s1, s2], is_on, closed)
    };
    if s0 == 0 || s0 != s1 || s0 != s2 {
        return None;
    }
    // All three edge values have the sign `s0`, or would have it without rounding.
    let side = f64::from(s0);
    // (`max` may return either zero, depending on the processor.)
    let positive = |w: f64| if w > 0.0 { w } else { 0.0 };
    let [w0, w1, w2] = [w0, w1, w2].map(|w| positive(w * side));
    let scale = 1.0 / (w0 + w1 + w2);
    let uv = if scale > 0.0 && scale.is_finite() {
        DVec2::new(w1, w2) * scale
    } else {
        DVec2::splat(1.0 / 3.0)
    };
    let relative = corners.map(|v| v - ray.origin);
    let plane = estimate.distance(ray, corners, t_min);
    let t = if plane.is_finite() {
        plane
    } else {
        let z = projection.axes[2];
        let depth =
            relative[0][z] * (1.0 - uv.x - uv.y) + relative[1][z] * uv.x + relative[2][z] * uv.y;
        depth / ray.direction[z]
    };
    if t.is_nan() || t <= t_min {
        return None;
    }
    Some((clamp_to_box(&ray.direction, &relative, t), uv))
}
