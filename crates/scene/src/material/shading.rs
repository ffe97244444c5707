//! A BSDF in the world: the local frame around it, and the real surface under it.

use crate::bsdf::{Bsdf, BsdfSample, Lobes, SpecularBranch};
use snell_math::{Frame, SampledSpectrum, Vec2, Vec3};

/// A BSDF and the frame it lives in. The methods take and give unit directions in world space that point away from the surface.
///
/// The shading normal may differ from the surface's own, so a direction above one may lie below the other. Light that would be
/// reflected through the surface, or transmitted without crossing it, is dropped here (Veach, Robust Monte Carlo Methods for Light
/// Transport Simulation, section 5.3).
#[derive(Clone, Debug)]
pub struct ShadingBsdf {
    /// The lobes.
    pub bsdf: Bsdf,
    /// Local frame; `z` is the shading normal (normal map applied) on the outer side.
    pub frame: Frame,
    /// Unit normal of the surface itself, on the outer side.
    pub geometric_normal: Vec3,
}

impl ShadingBsdf {
    /// True if shading and geometry agree on whether light goes through.
    fn agrees(&self, wo: Vec3, wi: Vec3, is_transmission: bool) -> bool {
        let sides = self.geometric_normal.dot(wo) * self.geometric_normal.dot(wi);
        if is_transmission { sides < 0.0 } else { sides > 0.0 }
    }

    /// Local directions of a pair that does not leak.
    fn local(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, Vec3)> {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        self.agrees(wo, wi, o.z * i.z < 0.0).then_some((o, i))
    }

    /// `f(wo, wi) |cos(wi)|` without delta lobes; the cosine is with the shading normal.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.local(wo, wi).map_or(SampledSpectrum::ZERO, |(o, i)| self.bsdf.eval(o, i))
    }

    /// What diffuse reflection adds to [`Self::eval`].
    pub fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.local(wo, wi).map_or(SampledSpectrum::ZERO, |(o, i)| self.bsdf.diffuse(o, i))
    }

    /// Density per steradian with which [`Self::sample`] draws `wi`, without delta lobes.
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.local(wo, wi).map_or(0.0, |(o, i)| self.bsdf.pdf(o, i))
    }

    /// [`Self::eval`] and [`Self::pdf`].
    pub fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        self.local(wo, wi).map_or((SampledSpectrum::ZERO, 0.0), |(o, i)| self.bsdf.eval_and_pdf(o, i))
    }

    /// See [`Lobes::crossing_scale`].
    pub fn crossing_scale(&self, wo: Vec3) -> f32 {
        self.bsdf.crossing_scale(self.frame.to_local(wo))
    }

    /// Draws a direction, see [`Lobes::sample`].
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let local = self.bsdf.sample(self.frame.to_local(wo), u_lobe, u)?;
        let wi = self.frame.from_local(local.wi).try_normalize()?;
        self.agrees(wo, wi, local.is_transmission).then_some(BsdfSample { wi, ..local })
    }

    /// `pi f |cos(wi)|` or the classic formula in its place, see [`Lobes::eval_classic`].
    pub fn eval_classic(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.local(wo, wi).map_or(SampledSpectrum::ZERO, |(o, i)| self.bsdf.eval_classic(o, i))
    }

    /// Reflectance for ambient light.
    pub fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        self.bsdf.ambient(self.frame.to_local(wo))
    }

    /// Approximate share of light that is reflected or transmitted towards `wo`.
    pub fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        self.bsdf.albedo(self.frame.to_local(wo))
    }

    /// True if there is no lobe but delta lobes.
    pub fn is_delta(&self) -> bool {
        self.bsdf.is_delta()
    }

    /// True if [`Self::eval`] is 0 for directions on opposite sides of the shading normal.
    pub fn is_opaque(&self) -> bool {
        self.bsdf.is_opaque()
    }

    /// Perfect reflection and refraction, at most two.
    pub fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        self.bsdf.specular_branches(self.frame.to_local(wo)).map(|branch| {
            let branch = branch?;
            let wi = self.frame.from_local(branch.wi).try_normalize()?;
            self.agrees(wo, wi, branch.is_transmission).then_some(SpecularBranch { wi, ..branch })
        })
    }
}
