//! The light `rectangle`, which emits to one side.

use super::{Attenuation, Emitter, Incident, LightBounds, panel, turned, unit};
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{DAffine3, DVec2, DVec3, Rgb, Vec2};

snell_math::declare! {
    /// An invisible rectangle that emits to one side, like a `disk`.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Rectangle {
        /// Centre of the rectangle.
        #[unit("scene units")]
        pub center: DVec3,
        /// Directions along the sides, whose lengths have no meaning; the side that emits is that
        /// of `axes[0] x axes[1]`.
        #[range(Range::Direction)]
        pub axes: [DVec3; 2],
        /// Full lengths of the sides, at least 0.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        pub lengths: [f64; 2],
        /// Half of the radiant intensity of the whole rectangle along its normal, W / sr (with the
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

impl Rectangle {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self {
            center: DVec3::new(0.5, 3.0, 1.0),
            axes: [DVec3::Z, DVec3::X],
            lengths: [2.0, 0.5],
            emission: Rgb::new(8.0, 7.0, 6.0),
            attenuation: Attenuation::default(),
        }]
    }

    fn normal(&self) -> DVec3 {
        let [x, y] = self.axes.map(unit);
        unit(x.cross(y))
    }
}

impl Emitter for Rectangle {
    fn color(&self) -> Rgb {
        self.emission
    }

    fn color_mut(&mut self) -> &mut Rgb {
        &mut self.emission
    }

    fn position(&self) -> Option<DVec3> {
        Some(self.center)
    }

    fn cone(&self) -> Option<(DVec3, f64)> {
        Some((self.normal(), panel::WIDEST))
    }

    fn transform(&mut self, by: &DAffine3) {
        self.center = by.transform_point3(self.center);
        // A shear would turn the rectangle into a parallelogram, so the second axis is made
        // orthogonal.
        let [x, y] = self.axes.map(|axis| turned(by, axis));
        let across = (y - x * x.dot(y)).try_normalize();
        self.axes = across.map_or(self.axes, |y| [x, y]);
    }

    fn sample_li(&self, p: DVec3, u: Vec2) -> Option<Incident> {
        let place = (u.as_dvec2() - 0.5) * DVec2::from(self.lengths);
        let [x, y] = self.axes.map(unit);
        let point = self.center + x * place.x + y * place.y;
        panel::arriving(p, point, self.normal(), self.emission, &self.attenuation)
    }

    fn power(&self, scene_radius: f64) -> f64 {
        panel::power(self.emission, &self.attenuation, scene_radius)
    }

    fn bounds(&self) -> Option<LightBounds> {
        let intensity = 2.0 * self.attenuation.strength(self.emission)?;
        let [x, y] = self.axes.map(unit);
        let reach = (x * self.lengths[0]).abs() * 0.5 + (y * self.lengths[1]).abs() * 0.5;
        LightBounds::of_panel(self.center, reach, self.normal(), intensity)
    }
}
