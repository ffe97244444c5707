//! A matte surface.

use super::{ColorParam, ShadingPoint};
use crate::bsdf::{Bsdf, DiffuseBsdf, bounded};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Rgb, SampledSpectrum};

snell_math::declare! {
    /// A matte surface with Lambertian reflection.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Diffuse {
        /// Fraction of light that is reflected, `[0, 1]`; multiplied by the vertex colour.
        #[range(Range::SHARE)]
        pub reflectance: ColorParam,
    }
}

impl Diffuse {
    /// A matte surface of one colour.
    pub fn new(reflectance: Rgb) -> Self {
        Self { reflectance: reflectance.into() }
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self::new(Rgb::splat(0.5)), Self::new(Rgb::new(0.8, 0.1, 0.0)), Self::new(Rgb::WHITE)]
    }

    /// The reflectance, if it is constant except for the vertex colour.
    #[inline]
    pub fn uniform(&self) -> Option<Rgb> {
        let ColorParam { factor, texture, spectrum } = self.reflectance;
        (texture.is_none() && spectrum.is_none()).then(|| factor.map(|x| bounded(x, 1.0)))
    }

    /// The reflectance at a point.
    pub fn reflectance_at(&self, point: &ShadingPoint) -> SampledSpectrum {
        point.reflectance(self.reflectance.at(point) * point.vertex_color())
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        Bsdf::Diffuse(DiffuseBsdf::lambertian(self.reflectance_at(point)))
    }
}
