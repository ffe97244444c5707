//! pbrt's coated conductor material.

use super::{Conductor, ScalarParam, ShadingPoint, positive_ior};
use crate::bsdf::{Bsdf, Coat, Ggx, OpenPbrBsdf, Slabs, bounded};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Rgb, SampledSpectrum};

snell_math::declare! {
    /// A metal under a clear dielectric layer. It is the `coatedconductor` of pbrt-v4 without a
    /// medium in the layer, made of the coat and the metal of `open-pbr` with a measured metal.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct CoatedConductor {
        /// The metal, given by its index of refraction relative to air, or by its colour under the
        /// coat.
        pub conductor: Conductor,
        /// Index of refraction of the coat. Positive, otherwise 1.
        #[range(Range::Positive)]
        #[usual(Range::Within(0.2, 6.0))]
        #[serde(default = "super::defaults::glass")]
        pub ior: f32,
        /// Roughness of the coat, `[0, 1]`; the distribution's `alpha` is its square.
        #[range(Range::SHARE)]
        #[serde(default = "super::defaults::smooth")]
        pub roughness: ScalarParam,
    }
}

impl CoatedConductor {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![
            Self { conductor: Conductor::copper(0.4), ior: 1.5, roughness: 0.2.into() },
            Self { conductor: Conductor::color(Rgb::WHITE, 0.3), ior: 1.5, roughness: 0.0.into() },
        ]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        let ior = positive_ior(self.ior).max(1.0);
        let unit = point.mode.unit();
        let metal = self.conductor.lobe(point, ior);
        let coat = Coat {
            weight: 1.0,
            ggx: Ggx::from_roughness(self.roughness.at(point)),
            ior,
            color: SampledSpectrum::ONE,
            darkening: 1.0,
            base_roughness: bounded(self.conductor.roughness.at(point), 1.0),
        };
        let slabs = Slabs { metal: Some((1.0, metal)), ..Slabs::default() };
        Bsdf::OpenPbr(Box::new(OpenPbrBsdf::new(slabs, Some(coat), None, unit)))
    }
}
