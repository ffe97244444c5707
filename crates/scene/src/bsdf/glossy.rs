//! A glossy layer over a diffuse or transparent base: plastics, paints, and the metallic-roughness model of glTF.
//!
//! The layer is GGX with Schlick's reflectance. The base gets what the layer lets through on the way in and on the way out,
//! `(1 - E(wo)) (1 - E(wi)) / (1 - E_average)` with `E` the layer's albedo (Kelemen and Szirmay-Kalos, A Microfacet Based Coupled
//! Specular-Matte BRDF Model, 2001): reciprocal, and a white base loses nothing.

use super::ggx::Ggx;
use super::ggx_albedo::LayerAlbedo;
use super::mirror::mirror_branch;
use super::{BsdfSample, Lobes, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{SampledSpectrum, Vec2, Vec3, sampling};
use std::f32::consts::FRAC_1_PI;

/// The parameters of one point. Make it with [`GlossyBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct GlossyBsdf {
    f0: SampledSpectrum,
    f90: SampledSpectrum,
    ggx: Ggx,
    diffuse: SampledSpectrum,
    transmission: SampledSpectrum,
    layer: LayerAlbedo,
}

/// Shares of the three lobes among the samples; they add up to 1.
#[derive(Clone, Copy)]
struct Choice {
    layer: f32,
    diffuse: f32,
}

impl GlossyBsdf {
    /// A layer that reflects `f0` at normal and `f90` at grazing incidence, over a base of which `diffuse` comes back diffusely and
    /// `transmission` passes straight through (thin walls: no bending; roughness spreads it as much as the reflection). All in
    /// `[0, 1]`, and `diffuse + transmission <= 1`.
    pub fn new(
        f0: SampledSpectrum,
        f90: SampledSpectrum,
        ggx: Ggx,
        diffuse: SampledSpectrum,
        transmission: SampledSpectrum,
    ) -> Self {
        Self { f0, f90, ggx, diffuse, transmission, layer: LayerAlbedo::new(ggx) }
    }

    fn layer_albedo(&self, w: Vec3) -> SampledSpectrum {
        self.layer.directional(w.z.abs(), self.f0, self.f90)
    }

    fn choice(&self, wo: Vec3) -> Option<Choice> {
        let sum = |s: SampledSpectrum| s.0.iter().sum::<f32>();
        let e = self.layer_albedo(wo);
        let rest = SampledSpectrum::ONE - e;
        let [layer, diffuse, transmission] = [e, self.diffuse * rest, self.transmission * rest].map(sum);
        let total = layer + diffuse + transmission;
        (total > 0.0).then(|| Choice { layer: layer / total, diffuse: diffuse / total })
    }

    /// `f |cos(wi)|` of the diffuse base.
    fn diffuse_value(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if self.diffuse.is_black() {
            return SampledSpectrum::ZERO;
        }
        let lost = SampledSpectrum::ONE - self.layer.average(self.f0, self.f90);
        let (out, into) = (SampledSpectrum::ONE - self.layer_albedo(wo), SampledSpectrum::ONE - self.layer_albedo(wi));
        let coupling = (out * into).zip(lost, |x, lost| if lost > 1e-5 { x / lost } else { 0.0 });
        self.diffuse * coupling * (wi.z.abs() * FRAC_1_PI)
    }

    /// `f |cos(wi)|` of the facets: reflection for `wi` on the side of `wo`, else thin transmission, which is the same mirrored.
    fn facet_value(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if self.ggx.is_smooth() {
            return SampledSpectrum::ZERO;
        }
        let Some((m, value)) = self.ggx.reflection(lift(wo), lift(wi)) else { return SampledSpectrum::ZERO };
        let reflectance = fresnel::schlick(lift(wo).dot(m), self.f0, self.f90);
        if wo.z * wi.z > 0.0 {
            reflectance * value
        } else {
            self.transmission * (SampledSpectrum::ONE - reflectance) * value
        }
    }

    fn mixture_pdf(&self, choice: Choice, wo: Vec3, wi: Vec3) -> f32 {
        let facets = if self.ggx.is_smooth() { 0.0 } else { self.ggx.reflection_pdf(lift(wo), lift(wi)) };
        if wo.z * wi.z > 0.0 {
            choice.layer * facets + choice.diffuse * sampling::cosine_hemisphere_pdf(wi.z.abs())
        } else {
            (1.0 - choice.layer - choice.diffuse).max(0.0) * facets
        }
    }

    fn straight_through(&self, wo: Vec3) -> SpecularBranch {
        let reflectance = fresnel::schlick(wo.z.abs(), self.f0, self.f90);
        let weight = self.transmission * (SampledSpectrum::ONE - reflectance);
        SpecularBranch { wi: -wo, weight, is_transmission: true }
    }

    fn smooth_reflection(&self, wo: Vec3) -> SpecularBranch {
        mirror_branch(wo, fresnel::schlick(wo.z.abs(), self.f0, self.f90))
    }
}

impl Lobes for GlossyBsdf {
    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        let side = wo.z * wi.z;
        if side > 0.0 {
            self.facet_value(wo, wi) + self.diffuse_value(wo, wi)
        } else if side < 0.0 {
            self.facet_value(wo, wi)
        } else {
            SampledSpectrum::ZERO
        }
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z == 0.0 {
            return 0.0;
        }
        self.choice(wo).map_or(0.0, |choice| self.mixture_pdf(choice, wo, wi))
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let choice = self.choice(wo)?;
        let is_diffuse = u_lobe >= choice.layer && u_lobe < choice.layer + choice.diffuse;
        let is_transmission = u_lobe >= choice.layer + choice.diffuse;
        let transmission_share = 1.0 - choice.layer - choice.diffuse;
        if is_transmission && transmission_share <= 0.0 {
            return None;
        }
        if self.ggx.is_smooth() && !is_diffuse {
            return Some(if is_transmission {
                self.straight_through(wo).sample(transmission_share)
            } else {
                self.smooth_reflection(wo).sample(choice.layer)
            });
        }
        let up = if is_diffuse { sampling::cosine_hemisphere(u) } else { self.ggx.sample_reflection(lift(wo), u)? };
        if up.z <= 0.0 {
            return None;
        }
        let same_side = lower_like(up, wo);
        let wi = if is_transmission { Vec3::new(same_side.x, same_side.y, -same_side.z) } else { same_side };
        let pdf = self.mixture_pdf(choice, wo, wi);
        (pdf > 0.0).then(|| BsdfSample { wi, weight: self.eval(wo, wi) / pdf, pdf, is_delta: false, is_transmission })
    }

    fn is_delta(&self) -> bool {
        self.ggx.is_smooth() && self.diffuse.is_black()
    }

    fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        let e = self.layer_albedo(wo);
        e + (self.diffuse + self.transmission) * (SampledSpectrum::ONE - e)
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        // What smooth layers mirror and transmit comes with the branches.
        let e = self.layer_albedo(wo);
        let base = self.diffuse * (SampledSpectrum::ONE - e);
        if self.ggx.is_smooth() { base } else { base + e }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        if !self.ggx.is_smooth() {
            return [None, None];
        }
        let some = |b: SpecularBranch| (!b.weight.is_black()).then_some(b);
        [some(self.smooth_reflection(wo)), some(self.straight_through(wo))]
    }
}
