//! pbrt's coated diffuse material.

use super::{ColorParam, ScalarParam, ShadingPoint, positive_ior};
use crate::bsdf::{Body, Bsdf, DiffuseBsdf, Gloss, GlossyBsdf, MicrofacetShape, fresnel};
use serde::{Deserialize, Serialize};
use snell_math::Rgb;
use snell_math::parameters::Range;

snell_math::declare! {
    /// A diffuse base under a dielectric layer, given by the colour of the base itself: the
    /// `coateddiffuse` of pbrt-v4 without a medium in the layer. Light that the inner side of the
    /// layer reflects back hits the base again, so the surface looks darker and more saturated than
    /// the base (`plastic` is given by the visible colour).
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct CoatedDiffuse {
        /// Reflectance of the base, `[0, 1]`; multiplied by the vertex colour.
        #[range(Range::SHARE)]
        pub reflectance: ColorParam,
        /// Index of refraction of the layer. Positive, otherwise 1.
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

impl CoatedDiffuse {
    /// A material whose layer has the index 1.5.
    pub fn new(reflectance: impl Into<ColorParam>, roughness: f32) -> Self {
        Self {
            reflectance: reflectance.into(),
            ior: 1.5,
            roughness: roughness.into(),
            microfacets: MicrofacetShape::Ggx,
        }
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self::new(Rgb::WHITE, 0.3), Self::new(Rgb::new(0.8, 0.3, 0.1), 0.0)]
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        let ior = positive_ior(self.ior).max(1.0);
        let body = point.reflectance(self.reflectance.at(point) * point.vertex_color());
        // The fraction of diffuse light in the layer that the layer's outer side reflects back.
        let back = 1.0 - (1.0 - fresnel::dielectric_average(ior)) / (ior * ior);
        let seen = body.map(|r| r * (1.0 - back) / (1.0 - r * back));
        let microfacets = self.microfacets.of_roughness(self.roughness.at(point));
        let gloss = Gloss { ior, tint: point.mode.unit(), microfacets, film: None };
        Bsdf::Glossy(GlossyBsdf::new(gloss, Body::matte(DiffuseBsdf::lambertian(seen))))
    }
}
