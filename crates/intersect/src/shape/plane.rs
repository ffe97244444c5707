//! The infinite plane, and the ray-plane intersection that all flat shapes start from.

use super::nearest::on_plane;
use super::span::scaled_direction;
use super::{Metric, Patch, Shape, ShapeHit, ShapePoint, ShapeSample, ShapeSurface};
use serde::{Deserialize, Serialize};
use snell_math::{Bounds3d, DRay, DVec2, DVec3};

snell_math::declare! {
    /// The plane z = 0, infinite, with normal +z. Cannot be sampled.
    ///
    /// `uv` is `(x, -y)` and runs on beyond `[0, 1]`: textures repeat once per unit, upright with y
    /// up.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub struct Plane {}
}

/// The parameter where the ray crosses the plane through `point` with `normal` (of any length), if
/// it is in the ray's open interval: `t = (Q - P0) . N / (V . N)` (lecture: "ray-plane
/// intersection"). Rays parallel to the plane, or in it, miss.
pub fn intersect_plane(ray: &DRay, point: DVec3, normal: DVec3) -> Option<f64> {
    let (direction, scale) = scaled_direction(ray)?;
    let t = (point - ray.origin).dot(normal) / direction.dot(normal) * scale;
    (t.is_finite() && ray.contains(t)).then_some(t)
}

/// The intersection of the ray with the plane z = 0, if the point there satisfies `inside`.
pub(super) fn closest_in_z0(ray: &DRay, inside: impl FnOnce(DVec2) -> bool) -> Option<ShapeHit> {
    let (direction, scale) = scaled_direction(ray)?;
    let t = -ray.origin.z / direction.z;
    let p = ray.origin.truncate() + direction.truncate() * t;
    let hit = ShapeHit { t: t * scale, face: 0 };
    (hit.t.is_finite() && ray.contains(hit.t) && inside(p)).then_some(hit)
}

impl Plane {
    /// The plane.
    pub fn examples() -> Vec<Self> {
        vec![Self {}]
    }
}

impl Shape for Plane {
    fn bounds(&self) -> Bounds3d {
        let side = DVec3::new(f64::INFINITY, f64::INFINITY, 0.0);
        Bounds3d { min: -side, max: side }
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        closest_in_z0(ray, |_| true)
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        [self.closest(ray), None]
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.closest(ray));
    }

    fn surface(&self, position: DVec3, _face: u32) -> ShapeSurface {
        ShapeSurface {
            position: position.with_z(0.0),
            normal: DVec3::Z,
            uv: DVec2::new(position.x, -position.y),
            dpdu: DVec3::X,
            dpdv: DVec3::NEG_Y,
        }
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        metric.nearest(point, [ShapePoint { position: on_plane(metric, point), face: 0 }])
    }

    fn winding_number(&self, point: DVec3, _metric: &Metric) -> f64 {
        if point.z == 0.0 || point.is_nan() { 0.0 } else { -0.5_f64.copysign(point.z) }
    }

    fn area(&self) -> f64 {
        f64::INFINITY
    }

    fn sample(&self, _u: DVec2) -> Option<ShapeSample> {
        None
    }

    fn is_closed(&self) -> bool {
        false
    }

    fn patches(&self) -> Vec<Patch> {
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parallel_rays_miss_and_others_hit_from_both_sides() {
        assert_eq!(Plane {}.closest(&DRay::new(DVec3::Z, DVec3::X)), None);
        assert_eq!(Plane {}.closest(&DRay::new(DVec3::ZERO, DVec3::X)), None);
        for z in [-2.0, 2.0] {
            let ray = DRay::new(DVec3::new(5.0, 6.0, z), DVec3::new(0.3, 0.0, -z));
            assert_eq!(Plane {}.closest(&ray), Some(ShapeHit { t: 1.0, face: 0 }));
            assert_eq!(intersect_plane(&ray, DVec3::new(9.0, 9.0, 0.0), DVec3::Z * 7.0), Some(1.0));
            let away = DRay { direction: -ray.direction, ..ray };
            assert_eq!(intersect_plane(&away, DVec3::ZERO, DVec3::Z), None);
        }
    }
}
