//! The medium `height-fog`, whose density falls with height.

use super::analytic::Profile;
use super::{MediumProperties, Segment};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{ColorMode, DVec3, Rgb, Vec3, real};

/// Limit of the exponent of the density. Beyond it, fog is opaque or absent.
const MAX_EXPONENT: f64 = 60.0;

snell_math::declare! {
    /// Fog, haze, or air whose density falls exponentially with height:
    /// `exp(-height / scale_height)`.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct HeightFog {
        /// Absorption coefficient per scene unit of length at height 0.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        pub sigma_a: Rgb,
        /// Scattering coefficient per scene unit of length at height 0.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        pub sigma_s: Rgb,
        /// Mean cosine of the angle by which light is deflected, in `(-1, 1)`.
        #[range(Range::Between(-1.0, 1.0))]
        pub g: f32,
        /// A point at height 0.
        #[unit("scene units")]
        pub base: DVec3,
        /// The up direction, which may have any length.
        #[range(Range::Direction)]
        pub up: DVec3,
        /// The height at which the density has fallen to 1 / e, in scene units. Positive, otherwise
        /// the density is 1 everywhere.
        #[unit("scene units")]
        pub scale_height: f64,
    }
}

impl HeightFog {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let fog = Self {
            sigma_a: Rgb::splat(0.02),
            sigma_s: Rgb::new(0.3, 0.4, 0.5),
            g: 0.6,
            base: DVec3::ZERO,
            up: DVec3::Y,
            scale_height: 0.5,
        };
        vec![
            Self { scale_height: 0.0, ..fog.clone() },
            Self { up: DVec3::new(1.0, 2.0, 0.5), ..fog.clone() },
            fog,
        ]
    }

    /// The up direction, divided by the scale height.
    fn gradient(&self) -> DVec3 {
        let gradient = self.up.normalize_or_zero() / self.scale_height;
        if self.scale_height > 0.0 && gradient.is_finite() { gradient } else { DVec3::ZERO }
    }

    fn density(&self, p: Vec3) -> f64 {
        let height = (p.as_dvec3() - self.base).dot(self.gradient());
        if height.is_nan() { 0.0 } else { real::exp((-height).clamp(-MAX_EXPONENT, MAX_EXPONENT)) }
    }

    /// The properties of the fog at height 0.
    pub(super) fn at_base(&self, mode: ColorMode) -> MediumProperties {
        MediumProperties::from_colors(self.sigma_a, self.sigma_s, Rgb::BLACK, self.g, mode)
    }

    /// The density along a segment.
    pub(super) fn profile(&self, segment: &Segment) -> Profile {
        Profile {
            density: self.density(segment.origin),
            slope: segment.direction.as_dvec3().dot(self.gradient()),
        }
    }

    /// The properties of the fog at a point of the world.
    pub fn properties(&self, p: Vec3, mode: ColorMode) -> MediumProperties {
        let density = self.density(p) as f32;
        MediumProperties::from_colors(
            self.sigma_a * density,
            self.sigma_s * density,
            Rgb::BLACK,
            self.g,
            mode,
        )
    }
}
