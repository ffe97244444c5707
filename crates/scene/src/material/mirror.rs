//! A perfect mirror.

use super::{ColorParam, ShadingPoint};
use crate::bsdf::{Bsdf, MirrorBsdf};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;
use snell_math::parameters::Range;

snell_math::declare! {
    /// A perfect mirror, which reflects in the mirror direction only, equally at all angles.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Mirror {
        /// Fraction of light that is reflected, `[0, 1]`.
        #[range(Range::SHARE)]
        pub reflectance: ColorParam,
    }
}

impl Mirror {
    /// A mirror of one colour.
    pub fn new(reflectance: Rgb) -> Self {
        Self { reflectance: reflectance.into() }
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self::new(Rgb::WHITE), Self::new(Rgb::new(0.9, 0.6, 0.3))]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        Bsdf::Mirror(MirrorBsdf { reflectance: point.reflectance(self.reflectance.at(point)) })
    }
}
