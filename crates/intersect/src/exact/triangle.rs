//! The watertight ray-triangle test.
//!
//! The vertices are projected in `f32` along the ray (Woop, Benthin and Wald, Watertight
//! Ray/Triangle Intersection, JCGT 2013). The projection is a little inexact, but it is the same
//! for every triangle that shares a vertex, and every decision on projected vertices is exact:
//! products of `f32` have no error in `f64`, and where the ray passes exactly through a projected
//! edge or vertex, a symbolic shift of the ray decides. So a ray through a closed mesh crosses the
//! fan of triangles around a vertex exactly once.
//!
//! Filters that run before this test are conservative, so the hits are the same at every SIMD level
//! and with every structure.

use super::ray::{Axes, LocalRay, wide};
use snell_math::{DVec3, Vec2};

/// Twice the signed area of the projected triangle (ray, p, q), and its exact sign after the
/// symbolic shift of the ray. The sign is 0 only if the edge has no length or a coordinate is NaN.
#[inline(always)]
fn edge(p: [f32; 2], q: [f32; 2]) -> (f64, i32) {
    let (a, b) = (f64::from(p[0]) * f64::from(q[1]), f64::from(p[1]) * f64::from(q[0]));
    let sign = |less: bool, greater: bool| i32::from(greater) - i32::from(less);
    let decided = if a != b {
        sign(a < b, a > b)
    } else if p[1] != q[1] {
        sign(p[1] < q[1], p[1] > q[1])
    } else {
        sign(q[0] < p[0], q[0] > p[0])
    };
    (a - b, decided)
}

/// The data of a ray for the exact test: the `f64` ray decides distances, and the projection
/// decides which triangles the ray passes through.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExactRay {
    pub origin: DVec3,
    pub direction: DVec3,
    /// The projection of vertices.
    pub projection: Projection,
}

/// The sheared projection of vertices along a ray; see [`LocalRay`] for the fields.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projection {
    pub origin: [f32; 3],
    pub axes: Axes,
    pub shear: [f32; 2],
}

impl Projection {
    /// Projects a vertex. The result has the same bits in every triangle and at every SIMD level,
    /// because the subtraction, the product and the second subtraction are rounded and never fused.
    #[inline(always)]
    pub fn project(&self, v: &[f32; 3]) -> [f32; 2] {
        let ([vx, vy, vz], [ox, oy, oz]) = (self.axes.of(v), self.axes.of(&self.origin));
        let (x, y, z) = (vx - ox, vy - oy, vz - oz);
        [x - self.shear[0] * z, y - self.shear[1] * z]
    }
}

/// The exact test. Returns distance and barycentrics `(b1, b2)` if the line of the ray passes
/// through the triangle at `t > t_min`.
///
/// The distance comes from the plane of the triangle in `f64`, so it has the right sign for any
/// origin that is more than a few units in the last place (of `f64`) off the plane. It is then
/// clamped twice, which changes it only because of rounding: to the interval in which the ray is
/// inside the triangle's box, so that culling by boxes can never lose the hit, and to the
/// neighbourhood of the point given by the barycentrics, so that culling by boxes of pieces of the
/// triangle cannot either.
#[inline(always)]
pub(crate) fn exact_hit(
    ray: &LocalRay,
    corners: &[[f32; 3]; 3],
    t_min: f64,
) -> Option<(f64, Vec2)> {
    exact_hit_on(&ray.exact_ray(), corners, t_min)
}

/// Performs [`exact_hit`] for a ray that is given by its [`ExactRay`].
#[inline(always)]
pub(crate) fn exact_hit_on(
    ray: &ExactRay,
    corners: &[[f32; 3]; 3],
    t_min: f64,
) -> Option<(f64, Vec2)> {
    let plane = plane_distance(&ray.origin, &ray.direction, corners);
    if is_behind(plane, t_min) { None } else { hit_in_plane(ray, corners, plane, t_min) }
}

/// Performs [`exact_hit`] for a triangle of which some edges belong to it: those whose bits are set
/// in `closed`, where bit `i` is the edge opposite of corner `i`. Rays that pass exactly through
/// them hit.
pub(crate) fn exact_hit_closed(
    ray: &LocalRay,
    corners: &[[f32; 3]; 3],
    t_min: f64,
    closed: u32,
) -> Option<(f64, Vec2)> {
    let ray = ray.exact_ray();
    let plane = plane_distance(&ray.origin, &ray.direction, corners);
    let is_ahead = !is_behind(plane, t_min);
    is_ahead.then(|| hit_in_plane_closed(&ray, corners, plane, t_min, closed)).flatten()
}

/// The signs of the edges of a triangle, in which edges that belong to the triangle and that the
/// ray passes through agree with the others.
#[cold]
pub(crate) fn closed_signs(mut signs: [i32; 3], is_on: [bool; 3], closed: u32) -> [i32; 3] {
    let is_free = |edge: usize| closed >> edge & 1 == 1 && is_on[edge];
    if let Some(other) = (0..3).find(|&edge| !is_free(edge)) {
        let sign = signs[other];
        (0..3).filter(|&edge| is_free(edge)).for_each(|edge| signs[edge] = sign);
    }
    signs
}

/// The ray parameter of the plane of a triangle: the first part of [`exact_hit`]. Infinite or NaN
/// if the ray is parallel to the plane or the triangle has no area.
#[inline(always)]
pub(crate) fn plane_distance(origin: &DVec3, direction: &DVec3, corners: &[[f32; 3]; 3]) -> f64 {
    let [height, speed] = height_and_speed(origin, direction, corners);
    height / speed
}

/// The height of a triangle's plane above the origin of the ray, and the rate at which the ray
/// rises to it, both as products with the unnormalised normal.
#[inline(always)]
pub(crate) fn height_and_speed(
    origin: &DVec3,
    direction: &DVec3,
    corners: &[[f32; 3]; 3],
) -> [f64; 2] {
    let corners = [wide(corners[0]), wide(corners[1]), wide(corners[2])];
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    [normal.dot(corners[0] - *origin), normal.dot(*direction)]
}

/// True if a triangle with this [`plane_distance`] cannot be hit beyond `t_min`. Most triangles
/// that reach the exact test are rejected here: the ray starts on them.
#[inline(always)]
pub(crate) fn is_behind(plane: f64, t_min: f64) -> bool {
    plane <= t_min && plane > f64::NEG_INFINITY
}

/// The second part of [`exact_hit`], for a triangle whose plane is at the parameter `plane`.
#[inline(always)]
pub(crate) fn hit_in_plane(
    ray: &ExactRay,
    corners: &[[f32; 3]; 3],
    plane: f64,
    t_min: f64,
) -> Option<(f64, Vec2)> {
    hit_in_plane_closed(ray, corners, plane, t_min, 0)
}

/// Performs [`hit_in_plane`] for a triangle of which some edges belong to it; see
/// [`exact_hit_closed`].
#[inline(always)]
fn hit_in_plane_closed(
    ray: &ExactRay,
    corners: &[[f32; 3]; 3],
    plane: f64,
    t_min: f64,
    closed: u32,
) -> Option<(f64, Vec2)> {
    let [p0, p1, p2] = [
        ray.projection.project(&corners[0]),
        ray.projection.project(&corners[1]),
        ray.projection.project(&corners[2]),
    ];
    let (w0, s0) = edge(p1, p2);
    let (w1, s1) = edge(p2, p0);
    let (w2, s2) = edge(p0, p1);
    // Products of `f32` are exact, so an edge that the ray passes through has the value 0.
    let [s0, s1, s2] = match closed {
        0 => [s0, s1, s2],
        closed => closed_signs([s0, s1, s2], [w0, w1, w2].map(|w| w == 0.0), closed),
    };
    if s0 == 0 || s0 != s1 || s0 != s2 {
        return None;
    }
    let sum = w0 + w1 + w2;
    let scale = 1.0 / sum;
    let (b1, b2) = if sum != 0.0 { (w1 * scale, w2 * scale) } else { (1.0 / 3.0, 1.0 / 3.0) };
    let relative = corners.map(|corner| wide(corner) - ray.origin);
    let z = ray.projection.axes.z();
    let place = (relative[0][z] * (1.0 - b1 - b2) + relative[1][z] * b1 + relative[2][z] * b2)
        / ray.direction[z];
    let t = if plane.is_finite() { plane } else { place };
    if t.is_nan() || t <= t_min {
        return None;
    }
    let t = near_place(t, place, ray.direction[z], &relative);
    let t = clamp_to_box(&ray.direction, &relative, t);
    Some((t, Vec2::new(b1 as f32, b2 as f32)))
}

/// The largest difference along the ray between a hit and the point given by the barycentrics,
/// relative to the sum of the distance and the size of the triangle. Only the projection is
/// inexact, by about `1e-7`, so the limit matters only for rays at less than about a tenth of a
/// degree to the triangle.
pub(crate) const PLACE_TOLERANCE: f64 = 5e-5;

/// The value nearest to `t` that is within [`PLACE_TOLERANCE`] of `place`. `z` is the component of
/// the direction with the largest magnitude.
#[inline(always)]
fn near_place(t: f64, place: f64, z: f64, relative: &[DVec3; 3]) -> f64 {
    let low = relative[0].min(relative[1]).min(relative[2]);
    let high = relative[0].max(relative[1]).max(relative[2]);
    let reach = (place.abs() + (high - low).max_element() / z.abs()) * PLACE_TOLERANCE;
    // If one operand is NaN, `max` and `min` return the other.
    if (t - place).abs() <= reach { t } else { t.max(place - reach).min(place + reach) }
}

/// The value nearest to `t` at which the ray is in the box of the three corners (given relative to
/// the ray's origin). The box is padded by a little less than in structures
/// ([`crate::mesh::padded_bounds`]). Returns `t` itself if the ray is inside there, up to an error
/// that the padding of distances covers.
#[inline(always)]
pub(crate) fn clamp_to_box(direction: &DVec3, relative: &[DVec3; 3], t: f64) -> f64 {
    let low = relative[0].min(relative[1]).min(relative[2]);
    let high = relative[0].max(relative[1]).max(relative[2]);
    let padding = (high - low).max_element() * 0.8e-6;
    let (low, high) = (low - padding, high + padding);
    let point = *direction * t;
    let margin = point.abs() * 1e-8;
    if (point + margin).cmpge(low).all() && (point - margin).cmple(high).all() {
        return t;
    }
    clamp_to_slabs(direction, low, high, t)
}

/// The slow part of [`clamp_to_box`], for rays that graze the triangle.
#[cold]
fn clamp_to_slabs(direction: &DVec3, low: DVec3, high: DVec3, t: f64) -> f64 {
    let inverse = direction.recip();
    let (low, high) = (low * inverse, high * inverse);
    // An axis along which the ray does not move gives 0 / 0 or x / 0, and does not limit the
    // interval.
    let usable = inverse.is_finite_mask();
    let enter = DVec3::select(usable, low.min(high), DVec3::NEG_INFINITY).max_element();
    let leave = DVec3::select(usable, low.max(high), DVec3::INFINITY).min_element();
    t.min(leave).max(enter)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::DRay;

    fn ray(o: [f32; 3], d: [f32; 3]) -> LocalRay {
        LocalRay::new(&DRay::new(wide(o), wide(d)))
    }

    #[test]
    fn an_edge_shared_by_two_triangles_belongs_to_one_of_them() {
        let (a, b, c, d) = ([0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]);
        for i in 0..=16 {
            let s = i as f32 / 16.0;
            // The vertices a and c have other neighbours outside this fan, so only the inner points
            // must count exactly once.
            let ray = ray([s, s, 0.0], [0.0, 0.0, 1.0]);
            let count =
                [[a, b, c], [a, c, d]].iter().filter(|t| exact_hit(&ray, t, 0.0).is_some()).count();
            assert!(count == 1 || ((i == 0 || i == 16) && count == 0), "{i}: {count}");
        }
    }

    #[test]
    fn distance_and_barycentrics_describe_the_point() {
        let t = [[0.0, 0.0, 2.0], [4.0, 0.0, 2.0], [0.0, 4.0, 2.0]];
        let (distance, uv) =
            exact_hit(&ray([1.0, 2.0, 0.0], [0.0, 0.0, 0.5]), &t, 0.0).expect("a hit");
        assert_eq!((distance, uv), (4.0, Vec2::new(0.25, 0.5)));
        assert!(
            exact_hit(&ray([1.0, 2.0, 0.0], [0.0, 0.0, 0.5]), &t, 4.0).is_none(),
            "the interval is open"
        );
    }
}
