//! Rectangles as near points see them: sampled by solid angle, in double precision and without branches, so that many can be sampled at
//! once.

use super::outline::{LEAST, MOST};
use snell_math::spherical::SphericalRectangle;
use snell_math::{DVec2, DVec3, Vec2, Vec3};

/// A rectangle in the world.
#[derive(Clone, Copy, Debug)]
pub struct NearRectangle {
    /// Its middle.
    pub center: DVec3,
    /// Unit vectors along its sides.
    pub axes: [DVec3; 2],
    /// Half of the lengths of the sides.
    pub half: DVec2,
}

/// A point of a [`NearRectangle`] as a near point sees it. Only what [`Self::exists`] has a meaning.
#[derive(Clone, Copy, Debug)]
pub struct NearSample {
    /// The point.
    pub position: Vec3,
    /// Unit direction towards it.
    pub direction: Vec3,
    /// Density per steradian of the direction.
    pub pdf: f32,
    /// The solid angle is one that can be sampled.
    pub exists: bool,
}

impl NearRectangle {
    /// The rectangle around a point, and its coordinate along the normal.
    #[inline(always)]
    pub(super) fn seen_from(&self, from: DVec3) -> (SphericalRectangle, f64) {
        let center = self.center - from;
        let middle = DVec2::new(center.dot(self.axes[0]), center.dot(self.axes[1]));
        let z = center.dot(self.normal());
        (SphericalRectangle::new(middle - self.half, middle + self.half, z), z)
    }

    /// Unit normal: either.
    #[inline(always)]
    pub(super) fn normal(&self) -> DVec3 {
        self.axes[0].cross(self.axes[1])
    }

    /// A point uniform by solid angle.
    #[inline(always)]
    pub fn sample(&self, from: Vec3, u: Vec2) -> NearSample {
        let from = from.as_dvec3();
        let (seen, z) = self.seen_from(from);
        let p = seen.sample(u.as_dvec2());
        let offset = self.axes[0] * p.x + self.axes[1] * p.y + self.normal() * z;
        let scale = 1.0 / offset.length_squared().sqrt();
        NearSample {
            position: (from + offset).as_vec3(),
            direction: (offset * scale).as_vec3(),
            pdf: (1.0 / seen.solid_angle) as f32,
            exists: (seen.solid_angle > LEAST) & (seen.solid_angle < MOST) & (scale > 0.0) & (scale < f64::INFINITY),
        }
    }
}
