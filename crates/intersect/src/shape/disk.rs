//! A disk or ring in the plane z = 0.

use super::nearest::on_ring;
use super::plane::closest_in_z0;
use super::winding;
use super::{
    AnyShape, Metric, Patch, Shape, ShapeError, ShapeHit, ShapePoint, ShapeSample, ShapeSurface,
    turn,
};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Bounds3d, DRay, DVec2, DVec3, rotation};
use std::f64::consts::{PI, TAU};

snell_math::declare! {
    /// A disk in the plane z = 0 around the origin, with normal +z; with an inner radius, a ring.
    ///
    /// `uv` is (angle from +x towards +y / 2 pi, 0 at the outer and 1 at the inner edge or centre),
    /// as in pbrt.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Disk {
        /// Outer radius, positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub radius: f64,
        /// Inner radius, from 0 (the default: no hole) to below the outer.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        #[serde(default)]
        pub inner_radius: f64,
    }
}

impl Disk {
    /// Disks for tests and galleries: full, ring, thin ring, small.
    pub fn examples() -> Vec<Self> {
        [(1.0, 0.0), (2.0, 0.5), (100.0, 99.0), (1e-3, 0.0)]
            .map(|(radius, inner_radius)| Self { radius, inner_radius })
            .to_vec()
    }
}

/// Returns the point of the ring nearest to `p` (in the plane of the ring), its `uv`, and the
/// derivatives of the point by `u` and by `v`. At the centre the direction is taken as +x, and the
/// derivative by `u` is an arbitrary tangent.
pub(super) fn polar(p: DVec2, radius: f64, inner_radius: f64) -> (DVec2, DVec2, DVec2, DVec2) {
    let (along, rho) = on_ring_at(p, radius, inner_radius);
    let width = radius - inner_radius;
    let dpdu = if rho > 0.0 { along.perp() * (TAU * rho) } else { along.perp() * radius };
    (along * rho, DVec2::new(turn(along), (radius - rho) / width), dpdu, -along * width)
}

/// Polar coordinates of the point of the ring nearest to `p`: the unit direction from the centre
/// (+x at the centre itself) and the distance from the centre.
pub(super) fn on_ring_at(p: DVec2, radius: f64, inner_radius: f64) -> (DVec2, f64) {
    (p.try_normalize().unwrap_or(DVec2::X), p.length().max(inner_radius).min(radius))
}

/// Maps `u` in `[0, 1)^2` to a point of the ring, in its plane, uniformly by area.
pub(super) fn sample_ring(u: DVec2, radius: f64, inner_radius: f64) -> DVec2 {
    let rho = (inner_radius * inner_radius * (1.0 - u.x) + radius * radius * u.x).sqrt();
    rotation::unit_vector(TAU * u.y) * rho
}

impl Shape for Disk {
    fn validate(&self) -> Result<(), ShapeError> {
        ShapeError::unless_positive("disk", "radius", self.radius)?;
        ShapeError::unless(
            "disk",
            "inner_radius",
            self.inner_radius,
            "at least 0 and below radius",
            |r| r >= 0.0 && r < self.radius,
        )
    }

    fn bounds(&self) -> Bounds3d {
        let side = DVec3::new(self.radius, self.radius, 0.0);
        Bounds3d { min: -side, max: side }
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        let (r2, inner2) = (self.radius * self.radius, self.inner_radius * self.inner_radius);
        closest_in_z0(ray, |p| (inner2..=r2).contains(&p.length_squared()))
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        [self.closest(ray), None]
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.closest(ray));
    }

    fn surface(&self, position: DVec3, _face: u32) -> ShapeSurface {
        let (p, uv, dpdu, dpdv) = polar(position.truncate(), self.radius, self.inner_radius);
        ShapeSurface {
            position: p.extend(0.0),
            normal: DVec3::Z,
            uv,
            dpdu: dpdu.extend(0.0),
            dpdv: dpdv.extend(0.0),
        }
    }

    fn normal(&self, position: DVec3, _face: u32) -> (DVec3, DVec3) {
        let (along, rho) = on_ring_at(position.truncate(), self.radius, self.inner_radius);
        ((along * rho).extend(0.0), DVec3::Z)
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        let position = on_ring(metric, point, 2, 0.0, self.radius, self.inner_radius);
        metric.nearest(point, [ShapePoint { position, face: 0 }])
    }

    fn winding_number(&self, point: DVec3, metric: &Metric) -> f64 {
        let disk = |radius| winding::of_disk(metric, point, 2, 0.0, radius);
        disk(self.radius) - disk(self.inner_radius)
    }

    fn area(&self) -> f64 {
        PI * (self.radius - self.inner_radius) * (self.radius + self.inner_radius)
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        Some(ShapeSample::at(self, sample_ring(u, self.radius, self.inner_radius).extend(0.0), 0))
    }

    fn is_closed(&self) -> bool {
        false
    }

    fn patches(&self) -> Vec<Patch> {
        let Self { radius, inner_radius } = *self;
        let position = move |u: f64, v: f64| {
            let radius = radius + (inner_radius - radius) * v;
            (rotation::unit_vector(u * TAU) * radius).extend(0.0)
        };
        vec![Patch::round(0, 0.0, position)]
    }

    fn to_any(&self) -> Option<AnyShape> {
        Some((*self).into())
    }
}
