//! Rays: `P = P0 + t V`. Directions need not be unit vectors; `t` is always in units of the given
//! direction.

use glam::{DVec3, Vec3};

/// A single-precision ray with an open parameter interval `(t_min, t_max)`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Ray {
    /// Start point, `t = 0`.
    pub origin: Vec3,
    /// Hits at `t <= t_min` are ignored.
    pub t_min: f32,
    /// Direction of any non-zero length. `t` is in units of that length.
    pub direction: Vec3,
    /// Hits at `t >= t_max` are ignored. Infinite by default.
    pub t_max: f32,
}

impl Ray {
    /// The ray from `origin` along `direction` over `(0, inf)`.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }

    /// The same ray with its interval ended at `t_max` (exclusive).
    #[inline]
    pub fn with_t_max(self, t_max: f32) -> Self {
        Self { t_max, ..self }
    }

    /// The point at parameter `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }

    /// True if the ray can hit anything: its origin is finite, its direction finite and not zero,
    /// and its interval not empty or NaN. Every other ray misses.
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != Vec3::ZERO
            && self.t_min < self.t_max
    }
}

/// A double-precision ray, for analytic shapes and for worlds in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DRay {
    /// Start point, `t = 0`.
    pub origin: DVec3,
    /// Direction of any non-zero length.
    pub direction: DVec3,
    /// Hits at `t <= t_min` are ignored.
    pub t_min: f64,
    /// Hits at `t >= t_max` are ignored.
    pub t_max: f64,
}

impl DRay {
    /// The ray from `origin` along `direction` over `(0, inf)`.
    #[inline]
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f64::INFINITY }
    }

    /// The point at parameter `t`.
    #[inline]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// The same ray with its interval ended at `t_max` (exclusive).
    #[inline]
    pub fn with_t_max(self, t_max: f64) -> Self {
        Self { t_max, ..self }
    }

    /// True if the ray can hit anything: the condition of [`Ray::is_valid`].
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != DVec3::ZERO
            && self.t_min < self.t_max
    }

    /// True if `t` lies inside the open interval of the ray (false for NaN).
    #[inline]
    pub fn contains(&self, t: f64) -> bool {
        t > self.t_min && t < self.t_max
    }
}

impl From<&Ray> for DRay {
    #[inline]
    fn from(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.as_dvec3(),
            direction: ray.direction.as_dvec3(),
            t_min: ray.t_min.into(),
            t_max: ray.t_max.into(),
        }
    }
}
