//! A clear coat over a glossy surface: varnish, car paint.
//!
//! The coat is a thin GGX layer with Schlick's reflectance and no colour. What lies below gets what the coat lets through on the way
//! in and on the way out, `(1 - E(wo)) (1 - E(wi))` with `E` the coat's albedo. That is reciprocal and makes no light, where the
//! specification of `KHR_materials_clearcoat` weights the base by `1 - F` of one direction alone. Light that bounces between coat and
//! base is left out.

use super::ggx::Ggx;
use super::ggx_albedo::LayerAlbedo;
use super::mirror::mirror_branch;
use super::{BsdfSample, GlossyBsdf, Lobes, SpecularBranch, fresnel, lift};
use snell_math::{Frame, SampledSpectrum, Vec2, Vec3};

/// Reflectance of the coat at normal incidence: an index of refraction of 1.5.
const F0: f32 = 0.04;

/// The parameters of one point. Make it with [`CoatedBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct CoatedBsdf {
    base: GlossyBsdf,
    ggx: Ggx,
    f0: SampledSpectrum,
    f90: SampledSpectrum,
    layer: LayerAlbedo,
    /// The coat's own frame in the base's.
    frame: Frame,
}

impl CoatedBsdf {
    /// `base` under a coat. `strength` is the share of the coat that is there, `[0, 1]` in every lane in use.
    pub fn new(base: GlossyBsdf, ggx: Ggx, strength: SampledSpectrum) -> Self {
        let frame = Frame { x: Vec3::X, y: Vec3::Y, z: Vec3::Z };
        Self { base, ggx, f0: strength * F0, f90: strength, layer: LayerAlbedo::new(ggx), frame }
    }

    /// Gives the coat another normal (unit, in the base's frame) than the base: a smooth coat over rough grain, or the reverse. As with
    /// all shading normals, the cosine of incident light is then the one with that normal.
    pub fn with_coat_normal(self, normal: Vec3) -> Self {
        Self { frame: Frame::from_z_and_x(normal, Vec3::X), ..self }
    }

    /// Share of light that the coat reflects towards (equally: from) a direction.
    fn coat_albedo(&self, w: Vec3) -> SampledSpectrum {
        self.layer.directional(self.frame.z.dot(w).abs(), self.f0, self.f90)
    }

    /// Share of light between two directions that crosses the coat twice.
    fn passed(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        (SampledSpectrum::ONE - self.coat_albedo(wo)) * (SampledSpectrum::ONE - self.coat_albedo(wi))
    }

    /// A pair on the upper side of the coat; `None` if the coat does not reflect one into the other.
    fn coat_pair(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, Vec3)> {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        (o.z * i.z > 0.0 && wo.z * wi.z > 0.0).then(|| (lift(o), lift(i)))
    }

    fn coat_value(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if self.ggx.is_smooth() {
            return SampledSpectrum::ZERO;
        }
        let reflection = self.coat_pair(wo, wi).and_then(|(o, i)| Some((o, self.ggx.reflection(o, i)?)));
        reflection
            .map_or(SampledSpectrum::ZERO, |(o, (m, value))| fresnel::schlick(o.dot(m), self.f0, self.f90) * value)
    }

    fn coat_pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if self.ggx.is_smooth() {
            return 0.0;
        }
        self.coat_pair(wo, wi).map_or(0.0, |(o, i)| self.ggx.reflection_pdf(o, i))
    }

    /// Share of the coat among the samples; `None` if nothing is reflected at all.
    fn coat_share(&self, wo: Vec3) -> Option<f32> {
        let sum = |s: SampledSpectrum| s.0.iter().sum::<f32>();
        let e = self.coat_albedo(wo);
        let (coat, base) = (sum(e), sum(self.base.albedo(wo) * (SampledSpectrum::ONE - e)));
        (coat + base > 0.0).then(|| coat / (coat + base))
    }

    /// The mirror image in a smooth coat.
    fn coat_branch(&self, wo: Vec3) -> Option<SpecularBranch> {
        let local = self.frame.to_local(wo);
        let branch = mirror_branch(local, fresnel::schlick(local.z.abs(), self.f0, self.f90));
        let wi = self.frame.from_local(branch.wi);
        (wo.z * wi.z > 0.0).then_some(SpecularBranch { wi, ..branch })
    }

    /// A direction by the coat, of a density that [`Self::coat_pdf`] tells.
    fn sample_coat(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let local = self.frame.to_local(wo);
        let up = self.ggx.sample_reflection(lift(local), u)?;
        let wi = self.frame.from_local(super::lower_like(up, local));
        (wo.z * wi.z > 0.0).then_some(wi)
    }

    fn mixture_pdf(&self, share: f32, wo: Vec3, wi: Vec3) -> f32 {
        share * self.coat_pdf(wo, wi) + (1.0 - share) * self.base.pdf(wo, wi)
    }
}

impl Lobes for CoatedBsdf {
    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.coat_value(wo, wi) + self.base.eval(wo, wi) * self.passed(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.coat_share(wo).map_or(0.0, |share| self.mixture_pdf(share, wo, wi))
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let share = self.coat_share(wo)?;
        let (wi, is_transmission) = if u_lobe < share {
            if self.ggx.is_smooth() {
                return self.coat_branch(wo).map(|branch| branch.sample(share));
            }
            (self.sample_coat(wo, u)?, false)
        } else {
            let rest = 1.0 - share;
            // Rounding must not reach 1.
            let below = self.base.sample(wo, ((u_lobe - share) / rest).min(1.0 - f32::EPSILON), u)?;
            if below.is_delta {
                let weight = below.weight * self.passed(wo, below.wi) * (1.0 / rest);
                return Some(BsdfSample { weight, ..below });
            }
            (below.wi, below.is_transmission)
        };
        let pdf = self.mixture_pdf(share, wo, wi);
        (pdf > 0.0).then(|| BsdfSample { wi, weight: self.eval(wo, wi) / pdf, pdf, is_delta: false, is_transmission })
    }

    fn is_delta(&self) -> bool {
        self.ggx.is_smooth() && self.base.is_delta()
    }

    fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        let e = self.coat_albedo(wo);
        e + self.base.albedo(wo) * (SampledSpectrum::ONE - e)
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        let e = self.coat_albedo(wo);
        let base = self.base.ambient(wo) * (SampledSpectrum::ONE - e);
        if self.ggx.is_smooth() { base } else { base + e }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        let below = self.base.specular_branches(wo);
        let [reflection, transmission] =
            below.map(|b| b.map(|b| SpecularBranch { weight: b.weight * self.passed(wo, b.wi), ..b }));
        let coat = if self.ggx.is_smooth() { self.coat_branch(wo) } else { None };
        // Two mirror images in nearly the same direction count as one.
        let reflection = match (coat, reflection) {
            (Some(coat), Some(below)) => Some(SpecularBranch { weight: coat.weight + below.weight, ..coat }),
            (coat, below) => coat.or(below),
        };
        [reflection, transmission]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng;

    fn tilted() -> CoatedBsdf {
        let half = SampledSpectrum::splat(0.5);
        let ggx = Ggx::from_roughness(0.5);
        let base = GlossyBsdf::new(half * 0.1, SampledSpectrum::ONE, ggx, half, half * 0.5);
        CoatedBsdf::new(base, Ggx::from_roughness(0.3), SampledSpectrum::ONE)
            .with_coat_normal(Vec3::new(0.4, -0.2, 0.9).normalize())
    }

    #[test]
    fn a_coat_with_its_own_normal_makes_no_light_and_is_sampled_as_it_says() {
        let bsdf = tilted();
        for wo in [Vec3::Z, Vec3::new(0.8, 0.1, 0.5), Vec3::new(-0.9, 0.2, 0.2), Vec3::new(0.3, 0.3, -0.7)] {
            let (wo, n) = (wo.normalize(), 40_000);
            let mut sum = 0.0;
            for i in 0..n {
                let [a, b] = [rng::uniform2([i, 1, 0, 0]), rng::uniform2([i, 2, 0, 0])];
                let Some(s) = bsdf.sample(wo, b.x, a) else { continue };
                sum += s.weight[0];
                assert!((s.pdf - bsdf.pdf(wo, s.wi)).abs() <= 1e-3 * s.pdf);
                assert!((s.weight[0] * s.pdf - bsdf.eval(wo, s.wi)[0]).abs() <= 1e-3 * s.weight[0] * s.pdf);
            }
            assert!(sum / (n as f32) < 1.0, "{wo}: {}", sum / n as f32);
        }
    }

    #[test]
    fn a_coat_of_no_strength_changes_nothing() {
        let base = tilted().base;
        let bare = CoatedBsdf::new(base, Ggx::from_roughness(0.3), SampledSpectrum::ZERO);
        let (wo, wi) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, -0.6, 0.8));
        assert_eq!(bare.eval(wo, wi), base.eval(wo, wi));
        assert_eq!(bare.pdf(wo, wi), base.pdf(wo, wi));
    }
}
