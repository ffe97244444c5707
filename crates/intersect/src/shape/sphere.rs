//! A sphere around the origin.

use super::{Shape, ShapeHit, ShapeSample, ShapeSurface};
use serde::{Deserialize, Serialize};
use snell_math::{Bounds3d, DRay, DVec2, DVec3, robust};

/// A sphere of given radius around the origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// Radius, positive.
    pub radius: f64,
}

impl Sphere {
    /// Spheres for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self { radius: 1.0 }, Self { radius: 1e-3 }, Self { radius: 250.0 }]
    }
}

impl Shape for Sphere {
    fn bounds(&self) -> Bounds3d {
        Bounds3d { min: DVec3::splat(-self.radius), max: DVec3::splat(self.radius) }
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        let a = ray.direction.length_squared();
        let b = 2.0 * ray.direction.dot(ray.origin);
        let c = ray.origin.length_squared() - self.radius * self.radius;
        let (t0, t1) = robust::quadratic(a, b, c)?;
        [t0, t1].into_iter().find(|&t| ray.contains(t)).map(|t| ShapeHit { t, face: 0 })
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.closest(ray));
    }

    fn surface(&self, position: DVec3, _face: u32) -> ShapeSurface {
        let normal = position.normalize_or(DVec3::Z);
        let position = normal * self.radius;
        ShapeSurface { position, normal, uv: DVec2::ZERO, dpdu: normal.any_orthonormal_vector(), dpdv: DVec3::X }
    }

    fn area(&self) -> f64 {
        4.0 * std::f64::consts::PI * self.radius * self.radius
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        let z = 1.0 - 2.0 * u.x;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (s, c) = (std::f64::consts::TAU * u.y).sin_cos();
        let normal = DVec3::new(r * c, r * s, z);
        Some(ShapeSample { position: normal * self.radius, normal, uv: DVec2::ZERO, face: 0 })
    }

    fn is_closed(&self) -> bool {
        true
    }
}
