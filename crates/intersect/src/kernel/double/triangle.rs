//! The watertight ray-triangle test on `f64` vertices: the same rule as [`crate::kernel::triangle`], one precision higher.
//!
//! The vertices are drawn on a plane across the ray in `f64`, with the same operations in every triangle of a vertex; on that
//! drawing every sign is exact (products are compared in integers where rounding could matter), and where the ray meets an edge
//! or vertex of it, the same symbolic shift decides.

use super::plane::plane_distance;
use crate::kernel::triangle::clamp_to_box;
use snell_math::exact::compare_products;
use snell_math::simd::{DoubleLanes8, Lanes8};
use snell_math::{DRay, DVec2, DVec3};

/// How vertices are drawn on the plane across a ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawing {
    /// All vertices are drawn relative to it.
    pub origin: [f64; 3],
    /// Axes x, y, z of the drawing: z is where the direction is largest.
    pub axes: [usize; 3],
    /// Drawn x = x - shear[0] z, y = y - shear[1] z.
    pub shear: [f64; 2],
    /// Distance along the ray per unit of the z axis; 0 if it has no useful value, then depths are not compared.
    pub depth_scale: f64,
}

impl Drawing {
    #[inline(always)]
    pub fn new(ray: &DRay) -> Self {
        let (a, d) = (ray.direction.abs(), ray.direction.to_array());
        let z = if a.x >= a.y && a.x >= a.z { 0 } else { 2 - usize::from(a.y >= a.z) };
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let per_z = 1.0 / d[z];
        let usable = per_z.abs() > 1e-100 && per_z.abs() < 1e100;
        Self {
            origin: ray.origin.to_array(),
            axes,
            shear: [d[axes[0]] * per_z, d[axes[1]] * per_z],
            depth_scale: if usable { per_z } else { 0.0 },
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

/// Up to eight triangles, ready for [`candidates`].
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct TriangleBlock {
    /// By vertex, axis, triangle.
    pub vertices: [[[f64; 8]; 3]; 3],
    /// Number of the triangle within its group.
    pub ids: [u32; 8],
}

impl TriangleBlock {
    pub const EMPTY: Self = Self { vertices: [[[0.0; 8]; 3]; 3], ids: [u32::MAX; 8] };

    /// The corners of one of the triangles.
    #[inline(always)]
    pub fn corners(&self, lane: usize) -> [DVec3; 3] {
        let (lane, v) = (lane & 7, &self.vertices);
        let corner = |i: usize| DVec3::new(v[i][0][lane], v[i][1][lane], v[i][2][lane]);
        [corner(0), corner(1), corner(2)]
    }

    /// Puts a triangle into a lane.
    pub fn set(&mut self, lane: usize, corners: &[DVec3; 3], id: u32) {
        for (vertex, corner) in self.vertices.iter_mut().zip(corners) {
            for (axis, x) in vertex.iter_mut().zip(corner.to_array()) {
                axis[lane] = x;
            }
        }
        self.ids[lane] = id;
    }
}

/// Bound of the rounding of an edge value, relative to the largest drawn |x| times the largest drawn |y|: two products and a
/// difference are off by at most `2^-51` of it. Doubled.
const EDGE_ERROR: f64 = 1.0 / (1u64 << 50) as f64;

/// Which triangles of the block the ray may hit between `t_min` and `cull` (inclusive). Both may be rounded to `f32`, and `cull`
/// must be padded by a relative `1e-6`.
///
/// # Safety
/// The machine must have the instructions of `L`.
#[inline(always)]
pub(crate) unsafe fn candidates<L: Lanes8>(block: &TriangleBlock, ray: &Drawing, t_min: f32, cull: f32) -> u32 {
    // SAFETY: passed on to the caller.
    let ([x0, y0, z0], [x1, y1, z1], [x2, y2, z2], zero, bound_scale, tiny) = unsafe {
        let [v0, v1, v2] = &block.vertices;
        (
            draw::<L::Double>(ray, v0),
            draw::<L::Double>(ray, v1),
            draw::<L::Double>(ray, v2),
            L::Double::splat(0.0),
            L::Double::splat(EDGE_ERROR),
            L::Double::splat(f64::MIN_POSITIVE),
        )
    };
    let u = x1.mul(y2).sub(y1.mul(x2));
    let v = x2.mul(y0).sub(y2.mul(x0));
    let w = x0.mul(y1).sub(y0.mul(x1));
    // Surely outside: two edges whose signs are certain and differ. NaN is never sure.
    let extent = x0.abs().max(x1.abs()).max(x2.abs()).mul(y0.abs().max(y1.abs()).max(y2.abs()));
    let bound = extent.mul(bound_scale).add(tiny);
    let outside = u.min(v).min(w).add(bound).lt(zero) & bound.lt(u.max(v).max(w));
    // Surely too near or too far: all three corners are. (With `depth_scale` 0 all depths are 0 and prove nothing.)
    if ray.depth_scale == 0.0 {
        return !outside & 0xff;
    }
    let start = t_min - t_min.abs() * 1e-6;
    // SAFETY: passed on to the caller.
    let (scale, cull, start) =
        unsafe { (L::Double::splat(ray.depth_scale), L::Double::splat(cull.into()), L::Double::splat(start.into())) };
    let (d0, d1, d2) = (z0.mul(scale), z1.mul(scale), z2.mul(scale));
    let beyond = cull.lt(d0.min(d1).min(d2)) | d0.max(d1).max(d2).lt(start);
    !(outside | beyond) & 0xff
}

/// [`Drawing::draw`] for eight vertices at a time, the same operations; and their depths.
///
/// # Safety
/// The machine must have the instructions of `L`.
#[inline(always)]
unsafe fn draw<L: DoubleLanes8>(ray: &Drawing, v: &[[f64; 8]; 3]) -> [L; 3] {
    let [kx, ky, kz] = ray.axes;
    // SAFETY: passed on to the caller; axes are below 3.
    unsafe {
        let x = L::load(v.get_unchecked(kx)).sub(L::splat(*ray.origin.get_unchecked(kx)));
        let y = L::load(v.get_unchecked(ky)).sub(L::splat(*ray.origin.get_unchecked(ky)));
        let z = L::load(v.get_unchecked(kz)).sub(L::splat(*ray.origin.get_unchecked(kz)));
        [x.sub(L::splat(ray.shear[0]).mul(z)), y.sub(L::splat(ray.shear[1]).mul(z)), z]
    }
}

/// Twice the signed area of the drawn triangle (ray, p, q), and its exact sign after the symbolic shift of the ray: 0 only if
/// the edge is a point or not a number.
#[inline(always)]
fn edge(p: [f64; 2], q: [f64; 2]) -> (f64, i32) {
    let (a, b) = (p[0] * q[1], p[1] * q[0]);
    let value = a - b;
    // Two products are off by half a unit in the last place each, or by underflow.
    let sure = value.abs() > (a.abs() + b.abs()) * f64::EPSILON + f64::MIN_POSITIVE;
    let sign = if sure { i32::from(value > 0.0) - i32::from(value < 0.0) } else { exact_sign(p, q) };
    (value, sign)
}

/// The sign of [`edge`] where rounding leaves it open.
#[cold]
#[inline(never)]
fn exact_sign(p: [f64; 2], q: [f64; 2]) -> i32 {
    let shifted = || p[1].partial_cmp(&q[1]).filter(|o| o.is_ne()).or_else(|| q[0].partial_cmp(&p[0]));
    let order = compare_products(p[0], q[1], p[1], q[0]).filter(|o| o.is_ne()).or_else(shifted);
    if [p, q].iter().flatten().all(|x| x.is_finite()) { order.map_or(0, |o| o as i32) } else { 0 }
}

/// The exact test: distance and barycentrics `(b1, b2)` if the line of the ray passes through the drawn triangle at `t > t_min`.
///
/// The distance is that of the triangle's plane ([`plane_distance`]). Rays that graze the triangle may meet the drawing without
/// meeting the triangle; then the plane may be met anywhere, and the distance is moved into the interval in which the ray is
/// inside the triangle's box, so that skipping boxes can never lose it.
#[inline(always)]
pub(crate) fn exact_hit(ray: &DRay, drawing: &Drawing, corners: &[DVec3; 3], t_min: f64) -> Option<(f64, DVec2)> {
    let [p0, p1, p2] = [drawing.draw(corners[0]), drawing.draw(corners[1]), drawing.draw(corners[2])];
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
    let uv = if scale > 0.0 && scale.is_finite() { DVec2::new(w1, w2) * scale } else { DVec2::splat(1.0 / 3.0) };
    let relative = corners.map(|v| v - ray.origin);
    let plane = plane_distance(ray, corners);
    let t = if plane.is_finite() {
        plane
    } else {
        let z = drawing.axes[2];
        let depth = relative[0][z] * (1.0 - uv.x - uv.y) + relative[1][z] * uv.x + relative[2][z] * uv.y;
        depth / ray.direction[z]
    };
    if t.is_nan() || t <= t_min {
        return None;
    }
    Some((clamp_to_box(&ray.direction, &relative, t), uv))
}
