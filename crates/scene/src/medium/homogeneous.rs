//! The medium `homogeneous`.

use super::MediumProperties;
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{ColorMode, Rgb, Vec3};

snell_math::declare! {
    /// A medium that is the same everywhere.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default)]
    pub struct Homogeneous {
        /// Absorption coefficient per scene unit of length, at least 0.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        pub sigma_a: Rgb,
        /// Scattering coefficient per scene unit of length, at least 0.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        pub sigma_s: Rgb,
        /// Radiance emitted per scene unit of length, W / (m^2 sr). It does not depend on
        /// `sigma_a`, by which other programs often multiply it.
        #[range(LIGHT)]
        #[unit("W / (m^2 sr) per scene unit")]
        pub emission: Rgb,
        /// Mean cosine of the angle by which light is deflected, in `(-1, 1)`: 0 is isotropic,
        /// towards 1 light continues forwards.
        #[range(Range::Between(-1.0, 1.0))]
        pub g: f32,
    }
}

impl Homogeneous {
    /// A medium that only absorbs.
    pub fn absorbing(sigma_a: Rgb) -> Self {
        Self { sigma_a, sigma_s: Rgb::BLACK, emission: Rgb::BLACK, g: 0.0 }
    }

    /// A medium with extinction `sigma_t` and single-scattering albedo `albedo`, in `[0, 1]`.
    pub fn scattering(sigma_t: Rgb, albedo: Rgb, g: f32) -> Self {
        let sigma_s = sigma_t * albedo;
        Self { sigma_a: sigma_t - sigma_s, sigma_s, emission: Rgb::BLACK, g }
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![
            Self::absorbing(Rgb::new(0.1, 0.5, 2.0)),
            Self::scattering(Rgb::splat(1.0), Rgb::WHITE, 0.0),
            Self::scattering(Rgb::new(0.5, 1.0, 4.0), Rgb::new(0.9, 0.5, 1.0), 0.8),
            Self {
                emission: Rgb::new(2.0, 0.5, 0.1),
                ..Self::scattering(Rgb::splat(0.3), Rgb::splat(0.5), -0.6)
            },
            Self::scattering(Rgb::splat(1e6), Rgb::splat(0.9), 0.999),
        ]
    }

    /// The properties of the medium, which are the same at all points.
    pub fn properties(&self, _: Vec3, mode: ColorMode) -> MediumProperties {
        self.at_all(mode)
    }

    pub(super) fn at_all(&self, mode: ColorMode) -> MediumProperties {
        MediumProperties::from_colors(self.sigma_a, self.sigma_s, self.emission, self.g, mode)
    }
}
