//! Metals: reflection by GGX microfacets of a conductor.

use super::ggx::Ggx;
use super::mirror::mirror_branch;
use super::{BsdfSample, Lobes, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// Reflectance of a facet.
#[derive(Clone, Copy, Debug)]
pub enum FacetReflectance {
    /// Complex index of refraction `eta + i k` relative to the outside.
    Complex {
        /// Real part.
        eta: SampledSpectrum,
        /// Imaginary part (absorption).
        k: SampledSpectrum,
    },
    /// Schlick's approximation with this reflectance at normal and white at grazing incidence.
    Schlick(SampledSpectrum),
}

/// A metal. Light that bounces between facets is lost, as in most renderers: rough metals are a little too dark.
#[derive(Clone, Copy, Debug)]
pub struct ConductorBsdf {
    /// Fresnel's law.
    pub facets: FacetReflectance,
    /// 1 in every lane in use, 0 elsewhere.
    pub unit: SampledSpectrum,
    /// Roughness; smooth surfaces are mirrors.
    pub ggx: Ggx,
}

impl ConductorBsdf {
    fn reflectance(&self, cos: f32) -> SampledSpectrum {
        self.unit
            * match self.facets {
                FacetReflectance::Complex { eta, k } => eta.zip(k, |eta, k| fresnel::conductor(cos, eta, k)),
                FacetReflectance::Schlick(f0) => fresnel::schlick(cos, f0, SampledSpectrum::ONE),
            }
    }
}

impl Lobes for ConductorBsdf {
    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if wo.z * wi.z <= 0.0 || self.ggx.is_smooth() {
            return SampledSpectrum::ZERO;
        }
        let (wo, wi) = (lift(wo), lift(wi));
        match self.ggx.reflection(wo, wi) {
            Some((m, value)) => self.reflectance(wo.dot(m)) * value,
            None => SampledSpectrum::ZERO,
        }
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z <= 0.0 || self.ggx.is_smooth() { 0.0 } else { self.ggx.reflection_pdf(lift(wo), lift(wi)) }
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        if self.ggx.is_smooth() {
            return Some(mirror_branch(wo, self.reflectance(wo.z.abs())).sample(1.0));
        }
        let up = lift(wo);
        let m = self.ggx.sample_visible_normal(up, u);
        let wi = fresnel::reflect(up, m);
        if wi.z <= 0.0 {
            return None;
        }
        let pdf = self.ggx.reflection_pdf(up, wi);
        (pdf > 0.0).then(|| BsdfSample {
            wi: lower_like(wi, wo),
            weight: self.reflectance(up.dot(m)) * self.ggx.shadowing(up, wi),
            pdf,
            is_delta: false,
            is_transmission: false,
        })
    }

    fn is_delta(&self) -> bool {
        self.ggx.is_smooth()
    }

    fn is_opaque(&self) -> bool {
        true
    }

    fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        self.reflectance(wo.z.abs())
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        // What a mirror shows comes with the branch.
        if self.is_delta() { SampledSpectrum::ZERO } else { self.albedo(wo) }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        [self.is_delta().then(|| mirror_branch(wo, self.reflectance(wo.z.abs()))), None]
    }
}
