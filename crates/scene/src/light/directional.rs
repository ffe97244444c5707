//! The light `directional`: parallel light.

use super::{Emitter, PunctualLight, luminance, turned, unit};
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{DAffine3, DVec3, Rgb};
use std::f64::consts::PI;

snell_math::declare! {
    /// Parallel light from infinitely far.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Directional {
        /// Direction in which the light travels; its length has no meaning.
        #[range(Range::Direction)]
        pub direction: DVec3,
        /// Irradiance on a surface that faces the light, W / m^2.
        #[range(LIGHT)]
        #[unit("W / m^2")]
        pub irradiance: Rgb,
    }
}

impl Directional {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self { direction: DVec3::new(-0.6, -0.8, 0.0), irradiance: Rgb::splat(3.0) }]
    }
}

impl Emitter for Directional {
    fn color(&self) -> Rgb {
        self.irradiance
    }

    fn color_mut(&mut self) -> &mut Rgb {
        &mut self.irradiance
    }

    fn position(&self) -> Option<DVec3> {
        None
    }

    fn transform(&mut self, by: &DAffine3) {
        self.direction = turned(by, self.direction);
    }

    fn punctual(&self) -> Option<PunctualLight> {
        Some(PunctualLight::parallel(unit(self.direction), self.irradiance))
    }

    fn power(&self, scene_radius: f64) -> f64 {
        luminance(self.irradiance) * PI * scene_radius * scene_radius
    }
}
