//! Bounds of a light's position, directions and intensity for a light BVH (Conty Estevez and Kulla,
//! Importance Sampling of Many Lights with Adaptive Tree Splitting, 2018; Pharr, Jakob and
//! Humphreys, 4th edition, section 12.6.3).

use super::{Attenuation, luminance};
use snell_math::{Bounds3d, DVec3, Rgb, Vec3, real};

/// Bounds of a light, or of an emissive triangle, in space and direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// Box around the points that emit.
    pub bounds: Bounds3d,
    /// Unit axis of the cone that contains all main directions of emission (for a surface, its
    /// normals).
    pub axis: Vec3,
    /// Cosine of the half-angle of the cone around `axis`.
    pub cos_spread: f32,
    /// Cosine of the maximum angle between a main direction and light that is emitted: 0 for a
    /// surface.
    pub cos_emission: f32,
    /// True if light is emitted around the opposite directions too.
    pub is_two_sided: bool,
    /// Greatest radiant intensity in a main direction, W / sr (luminance); finite and not negative.
    pub intensity: f64,
}

impl LightBounds {
    /// Bounds of a point light that emits in all directions.
    pub(super) fn of_point(position: DVec3, intensity: f64) -> Option<Self> {
        Self::checked(position, DVec3::ZERO, DVec3::Z, [-1.0, 0.0], intensity)
    }

    /// Bounds of a point light that emits into a cone with this half-angle, in radians.
    pub(super) fn of_cone(
        position: DVec3,
        axis: DVec3,
        widest: f64,
        intensity: f64,
    ) -> Option<Self> {
        Self::checked(position, DVec3::ZERO, axis, [real::cos(widest), 1.0], intensity)
    }

    /// Bounds of a flat source that emits to one side, with this extent from its centre along each
    /// axis.
    pub(super) fn of_panel(
        center: DVec3,
        reach: DVec3,
        normal: DVec3,
        intensity: f64,
    ) -> Option<Self> {
        Self::checked(center, reach, normal, [1.0, 0.0], intensity)
    }

    /// The bounds, or `None` if position or direction is not finite.
    fn checked(
        center: DVec3,
        reach: DVec3,
        axis: DVec3,
        cosines: [f64; 2],
        intensity: f64,
    ) -> Option<Self> {
        let bounds = Bounds3d { min: center - reach.abs(), max: center + reach.abs() };
        let [cos_spread, cos_emission] = cosines;
        let axis = axis.as_vec3().try_normalize()?;
        let usable = bounds.is_finite() && !bounds.is_empty() && (-1.0..=1.0).contains(&cos_spread);
        usable.then_some(Self {
            bounds,
            axis,
            cos_spread: cos_spread as f32,
            cos_emission: cos_emission as f32,
            is_two_sided: false,
            intensity,
        })
    }
}

/// The mean intensity in a cone with this half-angle, in radians, that contains all of the power.
pub(super) fn mean_intensity(power: f64, widest: f64) -> f64 {
    let mean = power / (std::f64::consts::TAU * (1.0 - real::cos(widest)));
    if mean > 0.0 { mean.min(1e300) } else { 0.0 }
}

impl Attenuation {
    /// The luminance of an intensity; `None` unless the attenuation is the inverse square law.
    pub(super) fn strength(&self, intensity: Rgb) -> Option<f64> {
        let [constant, linear, quadratic] = self.0;
        if constant != 0.0 || linear != 0.0 || quadratic.is_nan() || quadratic <= 0.0 {
            return None;
        }
        let strength = luminance(intensity) / f64::from(quadratic);
        Some(if strength.is_nan() { 0.0 } else { strength.min(1e300) })
    }
}
