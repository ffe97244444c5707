//! Lights: sources that are not part of a surface ([`Light`]), emissive surfaces ([`area::AreaLight`]) and light from all
//! directions ([`environment::EnvironmentLight`]).

pub mod area;
pub mod environment;

use serde::{Deserialize, Serialize};
use snell_math::{ColorMode, DVec3, Rgb, SampledSpectrum, Vec2, Vec3};

/// Light arriving at a point from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub direction: Vec3,
    /// How far a shadow ray has to see: the distance to the light, infinite for directional lights.
    pub distance: f32,
    /// For a delta light: irradiance on a surface that faces it. Otherwise incident radiance.
    pub radiance: SampledSpectrum,
    /// Density per steradian with which the direction was chosen; 1 for delta lights.
    pub pdf: f32,
    /// True if no other technique can find this direction (point and directional lights, and lights without a visible body).
    pub is_delta: bool,
}

/// Factor on a light's intensity by distance `d`: `1 / (c0 + c1 d + c2 d^2)`. Physical light has `[0, 0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attenuation(pub [f32; 3]);

impl Attenuation {
    /// The inverse square law.
    pub const INVERSE_SQUARE: Self = Self([0.0, 0.0, 1.0]);
    /// No change by distance.
    pub const NONE: Self = Self([1.0, 0.0, 0.0]);

    /// The factor at distance `d > 0`. A denominator of 0 counts as 1.
    pub fn at(&self, d: f32) -> f32 {
        let [c0, c1, c2] = self.0;
        let denominator = c0 + c1 * d + c2 * d * d;
        if denominator > 0.0 { 1.0 / denominator } else { 1.0 }
    }
}

/// A light that is not a surface, in world coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "light", rename_all = "kebab-case")]
pub enum Light {
    /// Parallel light from infinitely far.
    Directional {
        /// Unit direction in which the light travels.
        direction: DVec3,
        /// Irradiance on a surface that faces the light, W / m^2.
        irradiance: Rgb,
    },
    /// Light from a point, equal in all directions.
    Point {
        /// Where.
        position: DVec3,
        /// Radiant intensity, W / sr (with the inverse square law).
        intensity: Rgb,
        /// By distance.
        attenuation: Attenuation,
        /// Radius of a surrounding sphere in the scene that is the lamp's body: shadow rays end where they first meet it. 0 for
        /// none.
        body_radius: f64,
    },
}

impl Light {
    /// Light arriving at `p`. `u` in `[0, 1)^2` chooses a point of an extended light. `None` if nothing arrives.
    pub fn sample(&self, p: Vec3, u: Vec2, mode: ColorMode) -> Option<LightSample> {
        let _ = u;
        let sample = |direction: Vec3, distance: f32, irradiance: Rgb| LightSample {
            direction,
            distance,
            radiance: mode.illuminant(irradiance),
            pdf: 1.0,
            is_delta: true,
        };
        match self {
            Self::Directional { direction, irradiance } => {
                Some(sample(-direction.as_vec3(), f32::INFINITY, *irradiance))
            }
            Self::Point { position, intensity, attenuation, .. } => {
                let to_light = (*position - p.as_dvec3()).as_vec3();
                let distance = to_light.length();
                (distance > 0.0).then(|| sample(to_light / distance, distance, *intensity * attenuation.at(distance)))
            }
        }
    }

    /// Approximate emitted power in W over a scene of this radius: what the choice among lights goes by.
    pub fn power(&self, scene_radius: f64) -> f64 {
        use std::f64::consts::PI;
        match self {
            Self::Directional { irradiance, .. } => {
                f64::from(irradiance.luminance()) * PI * scene_radius * scene_radius
            }
            Self::Point { intensity, .. } => 4.0 * PI * f64::from(intensity.luminance()),
        }
    }
}
