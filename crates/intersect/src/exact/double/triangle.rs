//! The watertight ray-triangle test on `f64` vertices: the same rule as
//! [`crate::exact::triangle`], one precision higher.
//!
//! The vertices are projected on a plane across the ray in `f64`, with the same operations in every
//! triangle of a vertex; on that projection every sign is exact (products are compared in integers
//! where rounding could matter), and where the ray meets an edge or vertex of it, the same symbolic
//! shift decides.

use super::plane::Estimate;
use crate::exact::triangle::clamp_to_box;
use snell_math::exact::compare_products;
use snell_math::{DRay, DVec2, DVec3};

/// The projection of vertices to the plane perpendicular to a ray.
#[derive(Clone, Copy, Debug)]
struct Projection {
    /// All vertices are projected relative to it.
    origin: [f64; 3],
    /// Axes x, y, z of the projection: z is where the direction is largest.
    axes: [usize; 3],
    /// Projected x = x - shear[0] z, y = y - shear[1] z.
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

    /// The vertex as projected: rounded subtraction, product, subtraction, never fused.
    #[inline(always)]
    fn project(&self, v: DVec3) -> [f64; 2] {
        let [kx, ky, kz] = self.axes;
        let (x, y, z) = (v[kx] - self.origin[kx], v[ky] - self.origin[ky], v[kz] - self.origin[kz]);
        [x - self.shear[0] * z, y - self.shear[1] * z]
    }
}

/// Twice the signed area of the projected triangle (ray, p, q), and its exact sign after the
/// symbolic shift of the ray: 0 only if the edge is a point or not a number.
#[inline(always)]
fn edge(p: [f64; 2], q: [f64; 2]) -> (f64, i32) {
    let (a, b) = (p[0] * q[1], p[1] * q[0]);
    let value = a - b;
    // Two products are off by half a unit in the last place each, or by underflow.
    let certain = value.abs() > (a.abs() + b.abs()) * f64::EPSILON + f64::MIN_POSITIVE;
    let sign =
        if certain { i32::from(value > 0.0) - i32::from(value < 0.0) } else { exact_sign(p, q) };
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
/// projected triangle at `t > t_min`.
///
/// The distance is that of the triangle's plane ([`Estimate::distance`]). Rays that graze the
/// triangle may meet the projection without meeting the triangle; then the plane may be met
/// anywhere, and the distance is moved into the interval in which the ray is inside the triangle's
/// box, so that skipping boxes can never lose it.
#[inline(always)]
pub(crate) fn exact_hit(ray: &DRay, corners: &[DVec3; 3], t_min: f64) -> Option<(f64, DVec2)> {
    // First what drops the triangle that the ray starts on: most that are tested.
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
