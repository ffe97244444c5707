//! Uniform sampling of the solid angle of triangles, rectangles and spheres, with densities.
//! Everything is in double precision, because the solid angle of a small object is a difference of
//! angles.

use crate::angles;
use crate::simd::{self, max, min};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Solid angle of the triangle of these unit vectors, in `[0, 2 pi]` (Van Oosterom and Strackee,
/// The Solid Angle of a Plane Triangle, 1983).
#[inline(always)]
pub fn triangle_solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let volume = a.dot(b.cross(c)).abs();
    2.0 * angles::turn_to(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// A unit vector that is uniform in the spherical triangle of three unit vectors with the given
/// solid angle (Arvo, Stratified Sampling of Spherical Triangles, 1995, in the form of Pharr, Jakob
/// and Humphreys, 4th edition, section 6.5.4). Returns false and an arbitrary vector if the
/// triangle is degenerate. The function has no branches, so that loops over it are vectorised.
#[inline(always)]
pub fn sample_triangle([a, b, c]: [DVec3; 3], solid_angle: f64, u: DVec2) -> (DVec3, bool) {
    let (n_ab, has_ab) = unit(a.cross(b));
    let (n_ca, has_ca) = unit(c.cross(a));
    let cos_alpha = -n_ab.dot(n_ca);
    let sin_alpha = n_ab.cross(n_ca).length();
    // The area of the part of the triangle up to the new side b c', minus the angle alpha at corner
    // a.
    let (sin_part, cos_part) = angles::sin_cos(u.x * solid_angle);
    let (sin_phi, cos_phi) =
        (sin_part * cos_alpha - cos_part * sin_alpha, cos_part * cos_alpha + sin_part * sin_alpha);
    let k1 = cos_phi - cos_alpha;
    let k2 = sin_phi + sin_alpha * a.dot(b);
    let numerator = (k2 * cos_phi - k1 * sin_phi) * cos_alpha - k2;
    let denominator = (k2 * sin_phi + k1 * cos_phi) * sin_alpha;
    let ratio = numerator / denominator;
    let cos_side = max(min(ratio, 1.0), -1.0);
    let sin_side = (1.0 - cos_side * cos_side).sqrt();
    let (across, has_side) = unit(c - a * c.dot(a));
    let third = a * cos_side + across * sin_side;
    let z = 1.0 - u.y * (1.0 - third.dot(b));
    let (side, _) = unit(third - b * third.dot(b));
    let is_number = (ratio >= 0.0) | (ratio < 0.0);
    (b * z + side * max((1.0 - z) * (1.0 + z), 0.0).sqrt(), has_ab & has_ca & has_side & is_number)
}

/// The normalised vector and true, or zero and false if `v` has no direction.
#[inline(always)]
fn unit(v: DVec3) -> (DVec3, bool) {
    let scale = 1.0 / v.length();
    let exists = (scale > 0.0) & (scale < f64::INFINITY);
    let one = |x: f64| if exists { x * scale } else { 0.0 };
    (DVec3::new(one(v.x), one(v.y), one(v.z)), exists)
}

/// A rectangle seen from the origin, prepared for uniform sampling by solid angle (Ureña, Fajardo
/// and King, An Area-Preserving Parametrization for Spherical Rectangles, 2013). The methods have
/// no branches, so that loops over them are vectorised.
#[derive(Clone, Copy, Debug)]
pub struct SphericalRectangle {
    min: DVec2,
    max: DVec2,
    z: f64,
    b: [f64; 2],
    /// Sine and cosine of the angle `k` in the paper.
    k: [f64; 2],
    /// The solid angle, in `[0, 2 pi]`. A rectangle seen exactly edge-on gives 0 or `2 pi`.
    pub solid_angle: f64,
}

impl SphericalRectangle {
    /// The rectangle from `min` to `max` in the plane at this `z`, in coordinates relative to the
    /// viewpoint.
    #[inline(always)]
    pub fn new(min: DVec2, max: DVec2, z: f64) -> Self {
        let z = z.abs();
        let z2 = z * z;
        // The function gives the z components of the normals of the planes through the origin and
        // each side.
        let along_z = |side: f64| side / (side * side + z2).sqrt();
        let (b0, b1, n3) = (-along_z(min.y), along_z(max.y), -along_z(min.x));
        // Two of the interior angles of the spherical rectangle, by their cosines.
        let (cos_g2, cos_g3) = (-b1 * n3, -n3 * b0);
        let sin = |cos: f64| simd::max(1.0 - cos * cos, 0.0).sqrt();
        let (sin_g2, sin_g3) = (sin(cos_g2), sin(cos_g3));
        let k = [-(sin_g2 * cos_g3 + cos_g2 * sin_g3), cos_g2 * cos_g3 - sin_g2 * sin_g3];
        // The solid angle is the sum of the arguments of these complex numbers, one per corner, so
        // it is the argument of their product.
        let corner = |x: f64, y: f64| (z * (x * x + y * y + z2).sqrt(), x * y);
        let times = |a: (f64, f64), b: (f64, f64)| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
        let conjugate = |a: (f64, f64)| (a.0, -a.1);
        let straight = times(corner(min.x, min.y), corner(max.x, max.y));
        let crossed = times(corner(min.x, max.y), corner(max.x, min.y));
        let (re, im) = times(straight, conjugate(crossed));
        Self { min, max, z, b: [b0, b1], k, solid_angle: angles::turn_to(im, re) }
    }

    /// The point `(x, y)` of the rectangle in a direction uniform by solid angle.
    #[inline(always)]
    pub fn sample(&self, u: DVec2) -> DVec2 {
        let (sin_u, cos_u) = angles::sin_cos(u.x * self.solid_angle);
        let [sin_k, cos_k] = self.k;
        let (sin, cos) = (sin_u * cos_k + cos_u * sin_k, cos_u * cos_k - sin_u * sin_k);
        let over = cos * self.b[0] - self.b[1];
        let part = sin * self.b[0];
        let c = (if over < 0.0 { -sin } else { sin }) / (over * over + part * part).sqrt();
        let c = max(min(c, 1.0), -1.0);
        let within = |x: f64, from: f64, to: f64| max(min(x, to), from);
        let x = within(c * self.z / ((1.0 - c) * (1.0 + c)).sqrt(), self.min.x, self.max.x);
        let d2 = x * x + self.z * self.z;
        let height = |y: f64| y / (d2 + y * y).sqrt();
        let (h0, h1) = (height(self.min.y), height(self.max.y));
        let h = h0 + u.y * (h1 - h0);
        let y = h * (d2 / max((1.0 - h) * (1.0 + h), 1e-300)).sqrt();
        DVec2::new(x, within(y, self.min.y, self.max.y))
    }
}

/// Solid angle of a sphere with this squared radius, whose centre is at this squared distance from
/// the viewpoint. The viewpoint is outside of the sphere.
#[inline(always)]
pub fn sphere_solid_angle(radius_squared: f64, distance_squared: f64) -> f64 {
    let sin2 = radius_squared / distance_squared;
    // This is `2 pi (1 - cos)`, without cancellation.
    TAU * sin2 / (1.0 + max(1.0 - sin2, 0.0).sqrt())
}

/// A point on the sphere around `center`, in a direction from the origin that is uniform in the
/// cone that the sphere fills. The origin is outside of the sphere.
#[inline]
pub fn sample_sphere(center: DVec3, radius: f64, u: DVec2) -> DVec3 {
    let towards = -center / center.length();
    center + around(towards, near_side_of_sphere(center, radius, u.x), u.y) * radius
}

/// A cosine for sampling the sphere of [`sample_sphere`]: that of the angle at the sphere's centre
/// between the directions to the origin and to the sampled point. The function has no branches, so
/// that loops over it are vectorised.
#[inline(always)]
pub fn near_side_of_sphere(center: DVec3, radius: f64, u: f64) -> f64 {
    let d2 = center.length_squared();
    let d = d2.sqrt();
    let sin2_max = radius * radius / d2;
    let one_minus_cos = u * sin2_max / (1.0 + max(1.0 - sin2_max, 0.0).sqrt());
    let cos = 1.0 - one_minus_cos;
    let sin2 = one_minus_cos * (2.0 - one_minus_cos);
    let distance = d * cos - max(radius * radius - d2 * sin2, 0.0).sqrt();
    let cos_alpha = (d2 + radius * radius - distance * distance) / (2.0 * d * radius);
    max(min(cos_alpha, 1.0), -1.0)
}

/// The unit vector at an angle with this cosine to the unit vector `axis`, rotated about it by the
/// fraction `u` of a turn. The function has no branches.
#[inline(always)]
pub fn around(axis: DVec3, cos: f64, u: f64) -> DVec3 {
    let sign = 1f64.copysign(axis.z);
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    let x = DVec3::new(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x);
    let y = DVec3::new(b, sign + axis.y * axis.y * a, -axis.y);
    let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
    let (s, c) = angles::sin_cos(TAU * u);
    x * (sin * c) + y * (sin * s) + axis * cos
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::uniform2;
    use std::f64::consts::PI;

    fn number(i: u32, k: u32) -> f64 {
        f64::from(uniform2([i, k, 1, 1]).x) * 2.0 - 1.0
    }

    fn vector(i: u32, k: u32) -> DVec3 {
        DVec3::new(number(i, 3 * k), number(i, 3 * k + 1), number(i, 3 * k + 2))
    }

    /// Compares means over the samples with integrals over the area, divided by the solid angle,
    /// for three moments.
    fn check(
        name: &str,
        solid_angle: f64,
        sample: impl Fn(DVec2) -> DVec3,
        point: impl Fn(DVec2) -> (DVec3, DVec3),
    ) {
        let n = 120;
        let (mut moments, mut expected, mut area) = ([DVec3::ZERO; 2], [DVec3::ZERO; 2], 0.0);
        for i in 0..n {
            for j in 0..n {
                let u = (DVec2::new(f64::from(i), f64::from(j)) + 0.5) / f64::from(n);
                let w = sample(u);
                assert!(w.is_normalized(), "{name}: {w}");
                moments[0] += w / f64::from(n * n);
                moments[1] += w * w / f64::from(n * n);
                let (p, d_area) = point(u);
                let w = p.normalize();
                let weight = d_area.dot(w).abs() / p.length_squared() / f64::from(n * n);
                area += weight;
                expected[0] += w * weight;
                expected[1] += w * w * weight;
            }
        }
        assert!((area / solid_angle - 1.0).abs() < 5e-3, "{name}: {area} {solid_angle}");
        for k in 0..2 {
            assert!(
                (moments[k] - expected[k] / area).length() < 4e-3,
                "{name}: {} {}",
                moments[k],
                expected[k] / area
            );
        }
    }

    #[test]
    fn directions_to_triangles_are_uniform() {
        for i in 0..30 {
            let p: [DVec3; 3] =
                std::array::from_fn(|k| vector(i, k as u32) + DVec3::new(0.0, 0.0, 1.3));
            let unit = p.map(|p| p.normalize());
            let solid_angle = triangle_solid_angle(unit[0], unit[1], unit[2]);
            if !(0.05..3.0).contains(&solid_angle) {
                continue;
            }
            let normal = (p[1] - p[0]).cross(p[2] - p[0]);
            check(
                &format!("triangle {i}"),
                solid_angle,
                |u| {
                    let (direction, exists) = sample_triangle(unit, solid_angle, u);
                    assert!(exists, "it has area");
                    direction
                },
                |u| {
                    let s = u.x.sqrt();
                    (p[0] * (1.0 - s) + p[1] * (s * (1.0 - u.y)) + p[2] * (s * u.y), normal * 0.5)
                },
            );
        }
    }

    #[test]
    fn directions_to_rectangles_are_uniform() {
        for i in 0..30 {
            let (a, b) = (vector(i, 1), vector(i, 2));
            let (min, max) = (a.min(b).truncate(), a.max(b).truncate());
            let z = a.z.abs() + 0.2;
            let r = SphericalRectangle::new(min, max, z);
            let size = max - min;
            check(
                &format!("rectangle {i}"),
                r.solid_angle,
                |u| r.sample(u).extend(-z).normalize(),
                |u| ((min + size * u).extend(-z), DVec3::Z * (size.x * size.y)),
            );
        }
    }

    #[test]
    fn directions_to_spheres_are_uniform_in_their_cone() {
        for (distance, radius) in [(1.1, 1.0), (3.0, 1.0), (1e4, 1e-3), (5.0, 4.99)] {
            let center = DVec3::new(0.6, -0.48, 0.64) * distance;
            let sin2: f64 = radius * radius / (distance * distance);
            let cos_max = (1.0 - sin2).sqrt();
            let solid_angle = sphere_solid_angle(radius * radius, distance * distance);
            assert!((solid_angle / (PI * sin2) - 2.0 / (1.0 + cos_max)).abs() < 1e-9);
            let n = 4000;
            for i in 0..n {
                let u = uniform2([i, 2, 2, 2]).as_dvec2();
                let p = sample_sphere(center, radius, u);
                assert!(((p - center).length() / radius - 1.0).abs() < 1e-9);
                // The fraction of the cone that is closer to the axis than the sample must be
                // `u.x`.
                let one_minus = (p.normalize() - center.normalize()).length_squared() * 0.5;
                assert!(
                    (one_minus * TAU / solid_angle - u.x).abs() < 1e-5,
                    "{distance}: {one_minus} {u}"
                );
                assert!(p.dot(p - center) <= 1e-9 * distance * radius + 1e-12, "the near side");
            }
        }
    }

    #[test]
    fn degenerate_triangles_have_no_directions_or_finite_ones() {
        let line = [DVec3::X, DVec3::new(0.6, 0.8, 0.0), DVec3::Y];
        assert!(triangle_solid_angle(line[0], line[1], line[2]) < 1e-12);
        for corners in [line, [DVec3::X; 3], [DVec3::NAN; 3], [DVec3::X, DVec3::NEG_X, DVec3::Y]] {
            let [a, b, c] = corners;
            let solid_angle = triangle_solid_angle(a, b, c);
            let (direction, exists) = sample_triangle(corners, solid_angle, DVec2::splat(0.3));
            assert!(!exists || direction.is_finite());
        }
    }
}
