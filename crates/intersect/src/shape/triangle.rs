//! A single triangle, the lecture's two inside tests, and a watertight test. (Meshes have a
//! separate, faster kernel.)

use super::nearest::on_triangle;
use super::plane::intersect_plane;
use super::span::{accurate_cross, scaled_direction};
use super::winding;
use super::{
    AnyShape, Metric, Patch, Shape, ShapeError, ShapeHit, ShapePoint, ShapeSample, ShapeSurface,
};
use serde::{Deserialize, Serialize};
use snell_math::{Bounds3d, DRay, DVec2, DVec3, robust};

snell_math::declare! {
    /// A triangle. The right-hand rule on its vertices gives the normal; it is hit from both sides.
    ///
    /// `uv` are the barycentric coordinates of the second and third vertex.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Triangle {
        /// The corners.
        #[unit("scene units")]
        pub vertices: [DVec3; 3],
    }
}

/// The intersection of a ray with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Ray parameter.
    pub t: f64,
    /// Barycentric coordinates of the second and third vertex.
    pub barycentrics: DVec2,
}

/// True if a line along `direction` through `p`, a point of the triangle's plane, passes through
/// the triangle (lecture: "ray-triangle intersection, algebraic"). For each side, the test finds on
/// which side of the plane through that side and the eye point `p - direction` the point `p` lies.
/// `p` is inside if all three answers agree, so neither winding nor facing matters.
pub fn inside_algebraic([t1, t2, t3]: &[DVec3; 3], p: DVec3, direction: DVec3) -> bool {
    let side = |a: &DVec3, b: &DVec3| direction.dot((*b - p).cross(*a - p));
    let sides = [side(t1, t2), side(t2, t3), side(t3, t1)];
    sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
}

/// True if `p`, a point of the triangle's plane, is inside, by its barycentric coordinates
/// (lecture: "ray-triangle intersection, parametric"): `p = T1 + u (T2 - T1) + v (T3 - T1)` with
/// `u, v >= 0` and `u + v <= 1`. Degenerate triangles hold no point.
pub fn inside_parametric([t1, t2, t3]: &[DVec3; 3], p: DVec3) -> bool {
    let (e1, e2, q) = (*t2 - *t1, *t3 - *t1, p - *t1);
    let normal = e1.cross(e2);
    let area2 = normal.length_squared();
    let (u, v) = (q.cross(e2).dot(normal), e1.cross(q).dot(normal));
    area2 > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= area2
}

/// The ray parameter of the hit by the ray-plane test followed by [`inside_algebraic`]; `None` for
/// a miss.
pub fn intersect_algebraic(vertices: &[DVec3; 3], ray: &DRay) -> Option<f64> {
    let t = intersect_plane(ray, vertices[0], normal(vertices))?;
    inside_algebraic(vertices, ray.at(t), ray.direction).then_some(t)
}

/// The ray parameter of the hit by the ray-plane test followed by [`inside_parametric`]; `None` for
/// a miss.
pub fn intersect_parametric(vertices: &[DVec3; 3], ray: &DRay) -> Option<f64> {
    let t = intersect_plane(ray, vertices[0], normal(vertices))?;
    inside_parametric(vertices, ray.at(t)).then_some(t)
}

/// The watertight test (Woop, Benthin and Wald, Watertight ray/triangle intersection, JCGT 2013),
/// in double precision, with exact edge signs and for either winding: a ray through a shared edge
/// or vertex hits exactly one of the triangles that close around it.
pub fn intersect_watertight(vertices: &[DVec3; 3], ray: &DRay) -> Option<TriangleHit> {
    RaySpace::new(ray)?.intersect(vertices)
}

/// The sheared coordinates of the watertight test, in which the ray is the third axis: points of
/// the ray's line have 0 in the first two coordinates.
pub(super) struct RaySpace<'a> {
    ray: &'a DRay,
    direction: DVec3,
    axes: [usize; 3],
    shear: DVec3,
    scale: f64,
}

impl<'a> RaySpace<'a> {
    /// The space of a ray; `None` if the ray is not finite or has no direction.
    pub fn new(ray: &'a DRay) -> Option<Self> {
        let (d, scale) = scaled_direction(ray)?;
        let z = d.abs().max_position();
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let shear = DVec3::new(d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]);
        Some(Self { ray, direction: d, axes, shear, scale })
    }

    /// Transforms a point: the first two coordinates are its position across the ray, the third is
    /// the parameter along the scaled direction. The result has the same bits for every triangle
    /// that shares the point.
    fn point(&self, p: DVec3) -> DVec3 {
        let p = p - self.ray.origin;
        let z = p[self.axes[2]];
        DVec3::new(
            p[self.axes[0]] - self.shear.x * z,
            p[self.axes[1]] - self.shear.y * z,
            self.shear.z * z,
        )
    }

    /// Parameter of the triangle's plane along the scaled direction. Unlike the depths of the
    /// corners it is exactly 0 for a ray that starts in a triangle parallel to an axis. `None` for
    /// a ray nearly in the plane, for which this formula is ill-conditioned and the depths are more
    /// accurate.
    fn plane_parameter(&self, vertices: &[DVec3; 3]) -> Option<f64> {
        let n = normal(vertices);
        let cos = self.direction.dot(n);
        (cos.abs() > 1e-6 * n.length()).then(|| (vertices[0] - self.ray.origin).dot(n) / cos)
    }

    /// Intersects the ray with a triangle; see [`intersect_watertight`].
    pub fn intersect(&self, vertices: &[DVec3; 3]) -> Option<TriangleHit> {
        let p = vertices.map(|v| self.point(v));
        let sides = [edge_side(p[1], p[2])?, edge_side(p[2], p[0])?, edge_side(p[0], p[1])?];
        if sides[0] != sides[1] || sides[1] != sides[2] || normal(vertices) == DVec3::ZERO {
            return None;
        }
        let edge = |a: DVec3, b: DVec3| robust::difference_of_products(a.x, b.y, a.y, b.x);
        let weights = DVec3::new(edge(p[1], p[2]), edge(p[2], p[0]), edge(p[0], p[1]));
        let b = weights / weights.element_sum();
        let t = match self.plane_parameter(vertices) {
            Some(t) => t,
            None => b.dot(DVec3::new(p[0].z, p[1].z, p[2].z)),
        } * self.scale;
        let barycentrics = DVec2::new(b.y, b.z).clamp(DVec2::ZERO, DVec2::ONE);
        let found = barycentrics.is_finite() && t.is_finite() && self.ray.contains(t);
        found.then_some(TriangleHit { t, barycentrics })
    }
}

/// True if the origin lies to the left of the edge from `p` to `q` (in x and y), decided exactly.
/// An origin on the edge counts as moved by (s, s^2) for an infinitesimal s > 0, so that exactly
/// one of the two triangles at an edge contains it. `None` for an edge without length.
fn edge_side(p: DVec3, q: DVec3) -> Option<bool> {
    // Rounding is monotonic: if the rounded products differ, so do the exact ones. Otherwise their
    // rounding errors, which a fused operation gives exactly, decide.
    let (left, right) = (p.x * q.y, p.y * q.x);
    let difference = if left == right {
        p.x.mul_add(q.y, -left) - p.y.mul_add(q.x, -right)
    } else {
        left - right
    };
    let moved = [difference, p.y - q.y, q.x - p.x];
    moved.into_iter().find(|&x| x != 0.0).map(|x| x > 0.0)
}

/// Normal of any length by the right-hand rule, accurate also for slivers.
fn normal([a, b, c]: &[DVec3; 3]) -> DVec3 {
    accurate_cross(*b - *a, *c - *a)
}

/// Maps `u` in `[0, 1)^2` to barycentric coordinates of the second and third vertex, uniformly by
/// area (Heitz, A low-distortion map between triangle and square, 2019).
pub(super) fn sample_barycentrics(u: DVec2) -> DVec2 {
    if u.y > u.x {
        DVec2::new(u.x * 0.5, u.y - u.x * 0.5)
    } else {
        DVec2::new(u.x - u.y * 0.5, u.y * 0.5)
    }
}

impl Triangle {
    /// Triangles for tests and galleries: right-angled, oblique, sliver, tiny.
    pub fn examples() -> Vec<Self> {
        let v = DVec3::new;
        [
            [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)],
            [v(1.0, -2.0, 0.5), v(-0.3, 4.0, 2.0), v(5.0, 1.0, -3.0)],
            [v(-20.0, 0.0, 1.0), v(20.0, 0.015, 1.0), v(19.0, 0.0, 1.01)],
            [v(1.0, 1.0, 1.0), v(1.0001, 1.0, 1.0), v(1.0, 1.0002, 1.0001)],
        ]
        .map(|vertices| Self { vertices })
        .to_vec()
    }
}

impl Shape for Triangle {
    fn validate(&self) -> Result<(), ShapeError> {
        ShapeError::unless(
            "triangle",
            "area",
            self.area(),
            "a positive number (vertices finite, not on a line)",
            |a| a > 0.0,
        )
    }

    fn bounds(&self) -> Bounds3d {
        Bounds3d::of(self.vertices)
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        intersect_watertight(&self.vertices, ray).map(|hit| ShapeHit { t: hit.t, face: 0 })
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        [self.closest(ray), None]
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.closest(ray));
    }

    fn surface(&self, position: DVec3, _face: u32) -> ShapeSurface {
        let [a, b, c] = self.vertices;
        let (e1, e2, q) = (b - a, c - a, position - a);
        let n = normal(&self.vertices);
        let area2 = n.length_squared().max(f64::MIN_POSITIVE);
        let u = (q.cross(e2).dot(n) / area2).clamp(0.0, 1.0);
        let v = (e1.cross(q).dot(n) / area2).clamp(0.0, 1.0 - u);
        ShapeSurface {
            position: a + e1 * u + e2 * v,
            normal: n.try_normalize().unwrap_or(DVec3::Z),
            uv: DVec2::new(u, v),
            dpdu: e1,
            dpdv: e2,
        }
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        metric.nearest(
            point,
            [ShapePoint { position: on_triangle(metric, point, &self.vertices).0, face: 0 }],
        )
    }

    fn winding_number(&self, point: DVec3, metric: &Metric) -> f64 {
        winding::of_triangles(metric, point, [self.vertices])
    }

    fn area(&self) -> f64 {
        0.5 * normal(&self.vertices).length()
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        let b = sample_barycentrics(u);
        let [p0, p1, p2] = self.vertices;
        Some(ShapeSample::at(self, p0 + (p1 - p0) * b.x + (p2 - p0) * b.y, 0))
    }

    fn is_closed(&self) -> bool {
        false
    }

    fn patches(&self) -> Vec<Patch> {
        vec![Patch::flat(0, self.vertices)]
    }

    fn to_any(&self) -> Option<AnyShape> {
        Some((*self).into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: [DVec3; 3] = [DVec3::ZERO, DVec3::X, DVec3::Y];

    #[test]
    fn errata_e4_winding_and_facing_do_not_matter() {
        let reversed = [CORNER[0], CORNER[2], CORNER[1]];
        for z in [-1.0, 1.0] {
            let hit = DRay::new(DVec3::new(0.25, 0.25, z), DVec3::new(0.0, 0.0, -z));
            let miss = DRay::new(DVec3::new(0.75, 0.75, z), DVec3::new(0.0, 0.0, -z));
            for vertices in [CORNER, reversed] {
                assert_eq!(intersect_algebraic(&vertices, &hit), Some(1.0));
                assert_eq!(intersect_parametric(&vertices, &hit), Some(1.0));
                assert_eq!(intersect_watertight(&vertices, &hit).map(|h| h.t), Some(1.0));
                assert_eq!(intersect_algebraic(&vertices, &miss), None);
                assert_eq!(intersect_parametric(&vertices, &miss), None);
                assert_eq!(intersect_watertight(&vertices, &miss), None);
            }
        }
    }

    #[test]
    fn errata_e4_each_edge_and_vertex_belongs_to_one_triangle_of_a_fan() {
        let center = DVec3::new(0.1, -0.2, 0.3);
        let ring: Vec<DVec3> = (0..7)
            .map(|i| DVec2::from_angle(f64::from(i)).extend(0.1 * f64::from(i % 3)))
            .collect();
        for k in 0..=100 {
            for i in 0..7 {
                let target = center + (ring[i] - center) * (f64::from(k) * 0.0099);
                for origin in
                    [DVec3::new(0.3, 0.2, 5.0), target + DVec3::Z, DVec3::new(-4.0, 0.0, 9.0)]
                {
                    let ray = DRay::new(origin, target - origin);
                    let hits = (0..7).filter(|&j| {
                        intersect_watertight(&[center, ring[j], ring[(j + 1) % 7]], &ray).is_some()
                    });
                    assert_eq!(hits.count(), 1, "{ray:?}");
                }
            }
        }
    }

    #[test]
    fn degenerate_triangles_are_never_hit() {
        let line = [DVec3::ZERO, DVec3::ONE, DVec3::splat(2.0)];
        let point = [DVec3::ZERO; 3];
        let broken = [DVec3::NAN, DVec3::X, DVec3::Y];
        for vertices in [line, point, broken] {
            assert!(Triangle { vertices }.validate().is_err());
            for target in [DVec3::ZERO, DVec3::splat(0.5), DVec3::new(0.2, 0.2, 0.0)] {
                let origin = DVec3::new(0.3, -0.4, 3.0);
                assert_eq!(
                    intersect_watertight(&vertices, &DRay::new(origin, target - origin)),
                    None
                );
            }
        }
    }
}
