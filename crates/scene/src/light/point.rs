//! The light `point`, with the same intensity in all directions.

use super::{Attenuation, Emitter, LightBounds, PunctualLight, luminance};
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{DAffine3, DVec3, Rgb};
use std::f64::consts::TAU;

snell_math::declare! {
    /// Light from a point, with the same intensity in all directions.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Point {
        /// Position of the light.
        #[unit("scene units")]
        pub position: DVec3,
        /// Radiant intensity, W / sr (with the inverse square law).
        #[range(LIGHT)]
        #[unit("W / sr")]
        pub intensity: Rgb,
        /// Attenuation by distance from the light.
        #[range(Range::AMOUNT)]
        #[serde(default)]
        pub attenuation: Attenuation,
        /// Radius of a sphere in the scene that is the lamp's body: shadow rays end where they
        /// first hit it. 0 if there is none.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        #[serde(default)]
        pub body_radius: f64,
    }
}

impl Point {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let position = DVec3::new(0.5, 3.0, 1.0);
        let lamp = Self {
            position,
            intensity: Rgb::splat(10.0),
            attenuation: Attenuation::default(),
            body_radius: 0.0,
        };
        let body = Self {
            intensity: Rgb::WHITE,
            attenuation: Attenuation::NONE,
            body_radius: 0.25,
            ..lamp.clone()
        };
        vec![lamp, body]
    }
}

impl Emitter for Point {
    fn color(&self) -> Rgb {
        self.intensity
    }

    fn color_mut(&mut self) -> &mut Rgb {
        &mut self.intensity
    }

    fn position(&self) -> Option<DVec3> {
        Some(self.position)
    }

    fn has_body(&self) -> bool {
        self.body_radius > 0.0
    }

    fn transform(&mut self, by: &DAffine3) {
        self.position = by.transform_point3(self.position);
    }

    fn punctual(&self) -> Option<PunctualLight> {
        let light = PunctualLight::at(self.position, self.intensity, self.attenuation);
        Some(PunctualLight { body_radius: self.body_radius, ..light })
    }

    fn power(&self, scene_radius: f64) -> f64 {
        2.0 * TAU * luminance(self.intensity) * self.attenuation.over_sphere(scene_radius)
    }

    fn bounds(&self) -> Option<LightBounds> {
        LightBounds::of_point(self.position, self.attenuation.strength(self.intensity)?)
    }
}
