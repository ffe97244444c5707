//! A sphere around the origin, with the lecture's two intersection tests.

use super::nearest::on_sphere;
use super::span::{Span, accurate_cross, crossings, roots};
use super::{
    AnyShape, Metric, Patch, Shape, ShapeError, ShapeHit, ShapePoint, ShapeSample, ShapeSurface,
    turn,
};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Bounds3d, DRay, DVec2, DVec3, real, robust};
use std::f64::consts::{PI, TAU};

snell_math::declare! {
    /// A sphere of given radius around the origin.
    ///
    /// `uv` is (longitude / 2 pi, angle from the +y pole / pi): longitude 0 is +z and grows towards
    /// +x, so with y up a picture is upright and not mirrored when seen from outside.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Sphere {
        /// Radius, positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub radius: f64,
    }
}

/// The roots of the sphere's quadratic, ascending (lecture: "ray-sphere intersection, algebraic
/// method"): `P = P0 + tV` substituted into `|P - O|^2 = r^2`. The direction may have any length,
/// and `t` is in units of it. This is the plain formula; [`Sphere`] itself uses a discriminant that
/// stays accurate for a sphere far away.
pub fn intersect_algebraic(sphere: &Sphere, ray: &DRay) -> Option<(f64, f64)> {
    let a = ray.direction.length_squared();
    let b = 2.0 * ray.direction.dot(ray.origin);
    let c = ray.origin.length_squared() - sphere.radius * sphere.radius;
    robust::quadratic(a, b, c)
}

/// The parameters where the line of the ray crosses the sphere, ascending (lecture: "ray-sphere
/// intersection, geometric method"): half a chord before and after the point of the ray nearest to
/// the centre. A centre behind the origin rejects only rays that start outside (such a ray has no
/// hit ahead). The direction is normalised here, and `t` is in units of the original one.
pub fn intersect_geometric(sphere: &Sphere, ray: &DRay) -> Option<(f64, f64)> {
    let length = ray.direction.length();
    let v = ray.direction / length;
    let to_center = -ray.origin;
    let nearest = to_center.dot(v);
    let r2 = sphere.radius * sphere.radius;
    let starts_outside = to_center.length_squared() > r2;
    if nearest < 0.0 && starts_outside {
        return None;
    }
    let d2 = (to_center - v * nearest).length_squared();
    let half_chord = (r2 - d2).sqrt();
    (d2 <= r2).then_some(((nearest - half_chord) / length, (nearest + half_chord) / length))
}

impl Sphere {
    /// Spheres for tests and galleries.
    pub fn examples() -> Vec<Self> {
        [1.0, 1e-3, 250.0].map(|radius| Self { radius }).to_vec()
    }

    /// The part of a line inside the sphere. The discriminant `b^2 - a c` is written
    /// `r^2 |d|^2 - |o x d|^2` (Lagrange's identity): the squared half chord as a difference of two
    /// squared lengths, without the cancellation that makes far or small spheres ragged (compare
    /// Haines et al., Precision improvements for ray/sphere intersection, Ray Tracing Gems, 2019).
    fn span(&self, o: DVec3, d: DVec3) -> Option<Span> {
        let (reach, distance) = (self.radius * d.length(), accurate_cross(o, d).length());
        if distance.is_nan() || distance > reach {
            return None;
        }
        let from_center = o.length();
        let c = (from_center - self.radius) * (from_center + self.radius);
        let (t0, t1) =
            roots(d.length_squared(), o.dot(d), c, (reach - distance) * (reach + distance));
        Span::new(t0, t1, [0, 0])
    }
}

impl Shape for Sphere {
    fn validate(&self) -> Result<(), ShapeError> {
        ShapeError::unless_positive("sphere", "radius", self.radius)
    }

    fn bounds(&self) -> Bounds3d {
        Bounds3d { min: DVec3::splat(-self.radius), max: DVec3::splat(self.radius) }
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        self.nearest_two(ray)[0]
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        crossings(ray, |o, d| self.span(o, d), |_| true)
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.nearest_two(ray).into_iter().flatten());
    }

    fn normal(&self, position: DVec3, _face: u32) -> (DVec3, DVec3) {
        let normal = position.try_normalize().unwrap_or(DVec3::Y);
        (normal * self.radius, normal)
    }

    fn surface(&self, position: DVec3, face: u32) -> ShapeSurface {
        let (position, normal) = self.normal(position, face);
        let around = DVec2::new(normal.z, normal.x);
        let sin_theta = around.length();
        // At the poles, where all longitudes meet, longitude 0 is used.
        let (along, dpdu) = match around.try_normalize() {
            Some(d) => (d, DVec3::new(position.z, 0.0, -position.x) * TAU),
            None => (DVec2::X, DVec3::X * self.radius),
        };
        let theta = real::atan2(sin_theta, normal.y);
        let dpdv =
            DVec3::new(along.y * normal.y, -sin_theta, along.x * normal.y) * (PI * self.radius);
        ShapeSurface { position, normal, uv: DVec2::new(turn(along), theta / PI), dpdu, dpdv }
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        metric.nearest(
            point,
            [ShapePoint { position: on_sphere(metric, point, self.radius), face: 0 }],
        )
    }

    fn winding_number(&self, point: DVec3, _metric: &Metric) -> f64 {
        f64::from(point.length() < self.radius)
    }

    fn contains(&self, point: DVec3) -> bool {
        point.length() <= self.radius
    }

    fn area(&self) -> f64 {
        4.0 * PI * self.radius * self.radius
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        let y = 1.0 - 2.0 * u.x;
        // sin(theta) from 1 - y^2 = 4 u (1 - u), which does not cancel at the poles.
        let r = 2.0 * (u.x * (1.0 - u.x)).max(0.0).sqrt();
        let (sin, cos) = real::sin_cos(TAU * u.y);
        Some(ShapeSample::at(self, DVec3::new(r * sin, y, r * cos) * self.radius, 0))
    }

    fn is_closed(&self) -> bool {
        true
    }

    fn patches(&self) -> Vec<Patch> {
        let radius = self.radius;
        let position = move |u: f64, v: f64| {
            let ((sin, cos), (sin_phi, cos_phi)) = (real::sin_cos(v * PI), real::sin_cos(u * TAU));
            // A pole is one point, bit for bit, so that the triangles without area there are left
            // out.
            let sin = if v == 1.0 { 0.0 } else { sin };
            DVec3::new(sin * sin_phi, cos, sin * cos_phi) * radius
        };
        vec![Patch::round(0, 0.5, position)]
    }

    fn to_any(&self) -> Option<AnyShape> {
        Some((*self).into())
    }

    fn as_sphere(&self) -> Option<&Sphere> {
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Sphere = Sphere { radius: 1.0 };

    fn pair_is(found: Option<(f64, f64)>, expected: (f64, f64)) {
        let (t0, t1) = found.expect("the line meets the sphere");
        assert!((t0 - expected.0).abs() < 1e-12 && (t1 - expected.1).abs() < 1e-12, "{t0} {t1}");
    }

    #[test]
    fn errata_e1_the_constant_term_is_the_squared_distance_to_the_centre_less_the_squared_radius() {
        // From distance 3: `c = 9 - 1`, and the product of the roots 2 and 4 is `c / a`.
        pair_is(
            intersect_algebraic(&UNIT, &DRay::new(DVec3::new(0.0, 0.0, -3.0), DVec3::Z)),
            (2.0, 4.0),
        );
        pair_is(
            intersect_algebraic(&Sphere { radius: 2.0 }, &DRay::new(DVec3::X * -5.0, DVec3::X)),
            (3.0, 7.0),
        );
    }

    #[test]
    fn errata_e2_a_ray_from_inside_with_the_centre_behind_hits() {
        let ray = DRay::new(DVec3::new(0.0, 0.0, 0.5), DVec3::Z);
        pair_is(intersect_geometric(&UNIT, &ray), (-1.5, 0.5));
        assert_eq!(UNIT.closest(&ray), Some(ShapeHit { t: 0.5, face: 0 }));
        let outside = DRay::new(DVec3::new(0.0, 0.0, 1.5), DVec3::Z);
        assert_eq!(intersect_geometric(&UNIT, &outside), None);
    }

    #[test]
    fn errata_e3_directions_have_any_length_and_t_is_in_units_of_them() {
        let ray = DRay::new(DVec3::new(0.0, 0.0, -3.0), DVec3::Z * 4.0);
        pair_is(intersect_geometric(&UNIT, &ray), (0.5, 1.0));
        pair_is(intersect_algebraic(&UNIT, &ray), (0.5, 1.0));
        for scale in [1e-300, 1e-30, 1e30, 1e300] {
            let hit = UNIT
                .closest(&DRay::new(DVec3::new(0.0, 0.0, -3.0), DVec3::Z * scale))
                .expect("straight at it");
            assert!((hit.t * scale - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_tiny_sphere_far_away_is_hit_on_its_front() {
        let (far, s) = (1e8, Sphere { radius: 1e-3 });
        let hit = s
            .closest(&DRay::new(DVec3::new(0.0, 0.9e-3, -far), DVec3::Z))
            .expect("within the radius");
        let front = far - (1.0_f64 - 0.81).sqrt() * 1e-3;
        assert!((hit.t - front).abs() < 5e-8);
        assert_eq!(s.closest(&DRay::new(DVec3::new(0.0, 1.0001e-3, -far), DVec3::Z)), None);
    }

    #[test]
    fn the_seen_side_is_upright_and_not_mirrored() {
        let uv = |p: DVec3| UNIT.surface(p, 0).uv;
        let right = uv(DVec3::new(0.1, 0.0, 1.0)) - uv(DVec3::new(0.05, 0.0, 1.0));
        let up = uv(DVec3::new(0.1, 0.1, 1.0)) - uv(DVec3::new(0.1, 0.0, 1.0));
        assert!(right.x > 0.0 && up.y < 0.0);
    }
}
