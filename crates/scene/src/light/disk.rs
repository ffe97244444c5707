//! The light `disk`, which emits to one side.

use super::{Attenuation, Emitter, Incident, LightBounds, panel, turned, unit};
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{DAffine3, DVec3, Rgb, Vec2, sampling};

snell_math::declare! {
    /// An invisible disk that emits to one side. A surface that faces it receives the average over
    /// the disk of `emission * attenuation(d) * 2 cos(angle at the light)`.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Disk {
        /// Centre of the disk.
        #[unit("scene units")]
        pub position: DVec3,
        /// Normal of the side that emits; its length has no meaning.
        #[range(Range::Direction)]
        pub direction: DVec3,
        /// Radius of the disk, at least 0.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        pub radius: f64,
        /// Half of the radiant intensity of the whole disk along its normal, W / sr (with the
        /// inverse square law).
        #[range(LIGHT)]
        #[unit("W / sr")]
        pub emission: Rgb,
        /// Attenuation by distance from the light.
        #[range(Range::AMOUNT)]
        #[serde(default)]
        pub attenuation: Attenuation,
    }
}

impl Disk {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let disk = Self {
            position: DVec3::new(0.5, 3.0, 1.0),
            direction: DVec3::NEG_Y,
            radius: 0.7,
            emission: Rgb::new(8.0, 7.0, 6.0),
            attenuation: Attenuation::default(),
        };
        vec![disk.clone(), Self { radius: 0.0, ..disk }]
    }
}

impl Emitter for Disk {
    fn color(&self) -> Rgb {
        self.emission
    }

    fn color_mut(&mut self) -> &mut Rgb {
        &mut self.emission
    }

    fn position(&self) -> Option<DVec3> {
        Some(self.position)
    }

    fn cone(&self) -> Option<(DVec3, f64)> {
        Some((unit(self.direction), panel::WIDEST))
    }

    fn transform(&mut self, by: &DAffine3) {
        self.position = by.transform_point3(self.position);
        self.direction = turned(by, self.direction);
    }

    fn sample_li(&self, p: DVec3, u: Vec2) -> Option<Incident> {
        let normal = unit(self.direction);
        let (x, y) = normal.any_orthonormal_pair();
        let on_disk = sampling::concentric_disk(u).as_dvec2() * self.radius;
        let point = self.position + x * on_disk.x + y * on_disk.y;
        panel::arriving(p, point, normal, self.emission, &self.attenuation)
    }

    fn power(&self, scene_radius: f64) -> f64 {
        panel::power(self.emission, &self.attenuation, scene_radius)
    }

    fn bounds(&self) -> Option<LightBounds> {
        let intensity = 2.0 * self.attenuation.strength(self.emission)?;
        LightBounds::of_panel(
            self.position,
            DVec3::splat(self.radius),
            unit(self.direction),
            intensity,
        )
    }
}
