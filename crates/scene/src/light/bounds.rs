//! Where a light is, which way it shines and how strongly: what a light BVH knows of it (Conty Estevez and Kulla, Importance
//! Sampling of Many Lights with Adaptive Tree Splitting, 2018; Pharr, Jakob and Humphreys, 4th edition, section 12.6.3).

use super::{Attenuation, Light};
use snell_math::{Bounds3d, DVec3, Rgb, Vec3};

/// Bounds of a light, or of an emissive triangle, in space and direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// Box around the points that emit.
    pub bounds: Bounds3d,
    /// Unit axis of the cone that holds all directions of main emission (the normals of a surface).
    pub axis: Vec3,
    /// Cosine of the half-angle of that cone.
    pub cos_spread: f32,
    /// Cosine of the angle around each direction of main emission outside of which nothing is emitted: 0 for a surface.
    pub cos_emission: f32,
    /// True if the opposite of each direction counts too.
    pub is_two_sided: bool,
    /// Greatest radiant intensity in a main direction, W / sr (luminance). Finite, not negative.
    pub intensity: f64,
}

impl Light {
    /// Bounds of a light with a place that obeys the inverse square law. `None` for all others: their light does not fade as the
    /// choice by distance expects.
    pub fn bounds(&self) -> Option<LightBounds> {
        let around = |center: DVec3, reach: DVec3| Bounds3d { min: center - reach.abs(), max: center + reach.abs() };
        let (bounds, axis, cos_spread, cos_emission, intensity) = match self {
            Self::Directional { .. } => return None,
            Self::Point { position, intensity, attenuation, .. } => {
                let intensity = strength(intensity, attenuation)?;
                (around(*position, DVec3::ZERO), DVec3::Z, -1.0, 0.0, intensity)
            }
            Self::Spot { position, direction, intensity, attenuation, falloff } => {
                let intensity = strength(intensity, attenuation)?;
                (around(*position, DVec3::ZERO), *direction, falloff.widest().cos(), 1.0, intensity)
            }
            Self::Profile { position, world_from_light, scale, table } => {
                let mean = mean_intensity(scale, table.power(), table.widest());
                (around(*position, DVec3::ZERO), world_from_light.z_axis, table.widest().cos(), 1.0, mean)
            }
            Self::Projector { position, world_from_light, scale, slide } => {
                let mean = mean_intensity(scale, slide.power(), slide.widest());
                (around(*position, DVec3::ZERO), world_from_light.z_axis, slide.widest().cos(), 1.0, mean)
            }
            Self::Disk { position, direction, radius, emission, attenuation } => {
                let intensity = 2.0 * strength(emission, attenuation)?;
                (around(*position, DVec3::splat(*radius)), *direction, 1.0, 0.0, intensity)
            }
            Self::Rectangle { center, axes, lengths, emission, attenuation } => {
                let intensity = 2.0 * strength(emission, attenuation)?;
                let reach = (axes[0] * lengths[0]).abs() * 0.5 + (axes[1] * lengths[1]).abs() * 0.5;
                (around(*center, reach), axes[0].cross(axes[1]), 1.0, 0.0, intensity)
            }
        };
        let axis = axis.as_vec3().try_normalize()?;
        let usable = bounds.is_finite() && !bounds.is_empty() && (-1.0..=1.0).contains(&cos_spread);
        usable.then_some(LightBounds {
            bounds,
            axis,
            cos_spread: cos_spread as f32,
            cos_emission,
            is_two_sided: false,
            intensity,
        })
    }
}

/// Mean intensity in a cone of this half-angle that holds all of the power.
fn mean_intensity(scale: &Rgb, power: f64, widest: f64) -> f64 {
    let mean = f64::from(scale.map(f32::abs).luminance()) * power / (std::f64::consts::TAU * (1.0 - widest.cos()));
    if mean > 0.0 { mean.min(1e300) } else { 0.0 }
}

/// Luminance of an intensity; `None` unless it falls with the square of the distance.
fn strength(intensity: &Rgb, attenuation: &Attenuation) -> Option<f64> {
    let [constant, linear, quadratic] = attenuation.0;
    if constant != 0.0 || linear != 0.0 || quadratic.is_nan() || quadratic <= 0.0 {
        return None;
    }
    let strength = f64::from(intensity.map(f32::abs).luminance()) / f64::from(quadratic);
    Some(if strength.is_nan() { 0.0 } else { strength.min(1e300) })
}
