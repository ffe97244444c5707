//! A thin sheet of glass: a window, a soap bubble.
//!
//! Light bounces between the two faces of the sheet; the sum over all bounces is reflected or goes straight on. Roughness spreads
//! what goes through as much as what is reflected.

use super::energy::{FacetLoss, bounced_pdf, sample_bounced};
use super::film::ThinFilm;
use super::ggx::Ggx;
use super::mirror::mirror_branch;
use super::{BsdfSample, Choice, Lobes, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{SampledSpectrum, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// The parameters of one point. Make it with [`SheetBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct SheetBsdf {
    ior: f32,
    tint: SampledSpectrum,
    /// What is left of light that crosses the sheet at a right angle.
    transmittance: SampledSpectrum,
    unit: SampledSpectrum,
    ggx: Ggx,
    film: Option<ThinFilm>,
    f0: SampledSpectrum,
    loss: FacetLoss,
    /// Reflected and let through of light that met several facets, over the mean loss.
    bounced: [SampledSpectrum; 2],
}

impl SheetBsdf {
    /// A sheet of this index of refraction over the outside; `tint` is a factor on what it reflects, `unit` is 1 in every lane in use.
    pub fn new(
        ior: f32,
        tint: SampledSpectrum,
        transmittance: SampledSpectrum,
        unit: SampledSpectrum,
        ggx: Ggx,
        film: Option<ThinFilm>,
    ) -> Self {
        let loss = FacetLoss::new(ggx);
        let f0 = SampledSpectrum::splat(fresnel::f0_from_ior(ior));
        let bounced = [SampledSpectrum::ZERO; 2];
        let mut sheet = Self { ior, tint, transmittance, unit, ggx, film, f0, loss, bounced };
        let lost = loss.average();
        if lost > 0.0 {
            // As at the mean angle of diffuse light.
            sheet.bounced = sheet.shares(2.0 / 3.0).map(|s| s * (1.0 / lost));
        }
        sheet
    }

    /// Reflected and let through at facets seen at this cosine.
    fn shares(&self, cos: f32) -> [SampledSpectrum; 2] {
        let f = SampledSpectrum::splat(fresnel::dielectric(cos, self.ior));
        let f = self.film.map_or(f, |film| film.reflectance(cos, self.f0, f));
        let sin2 = (1.0 - cos * cos).max(0.0) / (self.ior * self.ior);
        let inside = (1.0 - sin2).max(1e-4).sqrt();
        let left = self.transmittance.map(|t| if t >= 1.0 { 1.0 } else { t.max(0.0).powf(1.0 / inside) });
        let pass = SampledSpectrum::ONE - f;
        let ladder = SampledSpectrum::ONE - f * f * left * left;
        let over = |x: SampledSpectrum| x.zip(ladder, |x, l| if l > 1e-6 { x / l } else { 0.0 });
        let reflected = f + over(pass * pass * f * left * left);
        [reflected * self.tint, over(pass * pass * left) * self.unit]
    }

    fn choice(&self, wo: Vec3) -> Choice<4> {
        let lost = self.loss.towards(wo);
        let [r, t] = self.shares(wo.z);
        let [br, bt] = self.bounced.map(|b| b * (self.loss.average() * lost));
        Choice::new([r * (1.0 - lost), t * (1.0 - lost), br, bt])
    }

    /// Value for directions lifted above.
    fn value(&self, wo: Vec3, wi: Vec3, side: usize) -> SampledSpectrum {
        let once = match self.ggx.reflection(wo, wi) {
            Some((m, value)) => self.shares(wo.dot(m))[side] * value,
            None => SampledSpectrum::ZERO,
        };
        once + self.bounced[side] * (self.loss.towards(wo) * self.loss.towards(wi) * wi.z * FRAC_1_PI)
    }

    fn mixture_pdf(&self, choice: &Choice<4>, wo: Vec3, wi: Vec3, side: usize) -> f32 {
        let p = choice.probabilities;
        p[side] * self.ggx.reflection_pdf(wo, wi) + p[2 + side] * bounced_pdf(self.ggx, wi.z)
    }

    fn branches(&self, wo: Vec3) -> [SpecularBranch; 2] {
        let [r, t] = self.shares(wo.z.abs());
        [mirror_branch(wo, r), SpecularBranch { wi: -wo, weight: t, is_transmission: true }]
    }
}

impl Lobes for SheetBsdf {
    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if wo.z * wi.z == 0.0 || self.ggx.is_smooth() {
            return SampledSpectrum::ZERO;
        }
        self.value(lift(wo), lift(wi), usize::from(wo.z * wi.z < 0.0))
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z == 0.0 || self.ggx.is_smooth() {
            return 0.0;
        }
        self.mixture_pdf(&self.choice(lift(wo)), lift(wo), lift(wi), usize::from(wo.z * wi.z < 0.0))
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let up = lift(wo);
        let choice = self.choice(up);
        let lobe = choice.pick(u_lobe)?.0;
        let side = lobe % 2;
        if self.ggx.is_smooth() {
            return Some(self.branches(wo)[side].sample(choice.probabilities[lobe]));
        }
        let wi = if lobe < 2 { self.ggx.sample_reflection(up, u)? } else { sample_bounced(self.ggx, u) };
        let (value, pdf) = (self.value(up, wi, side), self.mixture_pdf(&choice, up, wi, side));
        let same_side = lower_like(wi, wo);
        let wi = if side == 1 { Vec3::new(same_side.x, same_side.y, -same_side.z) } else { same_side };
        BsdfSample::of(wi, value, pdf, side == 1)
    }

    fn is_delta(&self) -> bool {
        self.ggx.is_smooth()
    }

    fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        let [r, t] = self.shares(wo.z.abs());
        r + t
    }

    fn ambient(&self, _wo: Vec3) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        if self.is_delta() { self.branches(wo).map(Some) } else { [None, None] }
    }
}
