//! A coloured diffuse base under a clear coat.

use super::{ColorParam, ScalarParam, ShadingPoint, positive_ior};
use crate::bsdf::{Body, Bsdf, DiffuseBsdf, Gloss, GlossyBsdf, MicrofacetShape};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;
use snell_math::parameters::Range;

snell_math::declare! {
    /// Plastic, varnish or glazed ceramics: a diffuse base under a dielectric layer. White plastic
    /// absorbs no light.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Plastic {
        /// Fraction of the light that reaches the base and comes back, `[0, 1]`; multiplied by the
        /// vertex colour.
        #[range(Range::SHARE)]
        pub diffuse: ColorParam,
        /// Factor on the reflection of the layer, `[0, 1]`; white for a real dielectric.
        #[range(Range::SHARE)]
        #[serde(default = "super::defaults::white")]
        pub specular: ColorParam,
        /// Index of refraction of the layer: 1.5 reflects 4 % at normal incidence. Positive,
        /// otherwise 1.
        #[range(Range::Positive)]
        #[usual(Range::Within(0.2, 6.0))]
        #[serde(default = "super::defaults::glass")]
        pub ior: f32,
        /// Roughness of the layer, `[0, 1]`; the distribution's `alpha` is its square.
        #[range(Range::SHARE)]
        #[serde(default = "super::defaults::smooth")]
        pub roughness: ScalarParam,
        /// Shape of the microfacet distribution.
        #[serde(default)]
        pub microfacets: MicrofacetShape,
    }
}

impl Plastic {
    /// Plastic whose layer has the index 1.5.
    pub fn new(diffuse: impl Into<ColorParam>, roughness: f32) -> Self {
        Self {
            diffuse: diffuse.into(),
            specular: Rgb::WHITE.into(),
            ior: 1.5,
            roughness: roughness.into(),
            microfacets: MicrofacetShape::Ggx,
        }
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![
            Self::new(Rgb::WHITE, 0.0),
            Self::new(Rgb::WHITE, 0.5),
            Self::new(Rgb::new(0.1, 0.3, 0.8), 0.2),
            Self { ior: 3.0, ..Self::new(Rgb::new(0.9, 0.9, 0.1), 1.0) },
            Self { specular: Rgb::BLACK.into(), ..Self::new(Rgb::splat(0.5), 0.3) },
            Self { microfacets: MicrofacetShape::Beckmann, ..Self::new(Rgb::WHITE, 0.6) },
        ]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        let gloss = Gloss {
            ior: positive_ior(self.ior),
            tint: point.reflectance(self.specular.at(point)),
            microfacets: self.microfacets.of_roughness(self.roughness.at(point)),
            film: None,
        };
        let diffuse = point.reflectance(self.diffuse.at(point) * point.vertex_color());
        Bsdf::Glossy(GlossyBsdf::new(gloss, Body::matte(DiffuseBsdf::lambertian(diffuse))))
    }
}
