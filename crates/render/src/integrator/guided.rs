//! Sampling of directions at a vertex: by the BSDF alone, or by a mixture of the BSDF and a trained
//! guiding field.

use super::carried::Expected;
use super::roulette::{expected_survival, unknown_survival};
use crate::guiding::{Cell, Choice, Field, Guide};
use crate::light_sampler::Receiver;
use snell_math::rng::ONE_MINUS_EPSILON;
use snell_math::{SampledSpectrum, Vec2, Vec3};
use snell_scene::bsdf::BsdfSample;
use snell_scene::material::ShadingBsdf;

/// Density of a direction in the mixture of BSDF and field, given the fraction of BSDF samples.
#[inline(always)]
pub fn mixed_pdf(bsdf_share: f32, bsdf_pdf: f32, density: f32) -> f32 {
    bsdf_share * bsdf_pdf + (1.0 - bsdf_share) * density
}

/// A BSDF and the field's cell that helps it to find light.
pub struct GuidedBsdf<'a> {
    /// The BSDF alone.
    pub shading: &'a ShadingBsdf<'a>,
    /// The field's cell at the point, if there is a field and a lobe that can be guided.
    cell: Option<&'a Cell>,
    guide: Option<Guide<'a>>,
    is_guided: bool,
    is_learning: bool,
}

impl<'a> GuidedBsdf<'a> {
    /// The BSDF at a point with the guidance of the field, if there is a field.
    pub fn new(field: Option<&'a Field>, shading: &'a ShadingBsdf<'a>, point: &Receiver) -> Self {
        let cell =
            field.filter(|_| !shading.is_delta()).map(|f| f.cell(point.position, point.normal));
        let guide = cell.and_then(|cell| cell.guide(point.position));
        Self {
            shading,
            cell,
            guide,
            is_guided: field.is_some(),
            is_learning: field.is_some_and(Field::is_learning),
        }
    }

    /// `f(wo, wi) |cos(wi)|`, and the density per steradian with which [`Self::sample`] samples
    /// `wi`. Both exclude delta lobes.
    pub fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        let (value, pdf) = self.shading.eval_and_pdf(wo, wi);
        (value, self.mixed_pdf(wi, pdf))
    }

    /// The fraction of BSDF samples, and the density from which the other directions are sampled;
    /// `None` without guidance.
    fn mixture(&self) -> Option<(f32, &Guide<'a>)> {
        Some((self.cell?.bsdf_share, self.guide.as_ref()?))
    }

    fn mixed_pdf(&self, wi: Vec3, bsdf_pdf: f32) -> f32 {
        match self.mixture() {
            Some((share, guide)) => mixed_pdf(share, bsdf_pdf, guide.pdf(wi)),
            None => bsdf_pdf,
        }
    }

    /// Samples a direction, like [`ShadingBsdf::sample`]; `u_quad` is one more random number. Delta
    /// lobes are sampled by the BSDF only.
    pub fn sample(
        &self,
        wo: Vec3,
        u_lobe: f32,
        u: Vec2,
        u_quad: impl FnOnce() -> f32,
    ) -> Option<BsdfSample> {
        let Some((share, guide)) = self.mixture() else {
            return self.shading.sample(wo, u_lobe, u);
        };
        if u_lobe < share {
            let sample = self.shading.sample(wo, (u_lobe / share).min(ONE_MINUS_EPSILON), u)?;
            if sample.is_delta {
                return Some(BsdfSample { weight: sample.weight * (1.0 / share), ..sample });
            }
            let pdf = self.mixed_pdf(sample.wi, sample.pdf);
            let weight = sample.weight * (sample.pdf / pdf);
            return Some(BsdfSample { weight, pdf, ..sample });
        }
        let wi = guide.sample(u_quad(), u);
        let (value, pdf) = self.eval_and_pdf(wo, wi);
        if value.is_black() {
            return None;
        }
        let is_transmission =
            self.shading.geometric_normal.dot(wo) * self.shading.geometric_normal.dot(wi) < 0.0;
        let weight = value * (1.0 / pdf);
        (pdf > 0.0).then_some(BsdfSample { wi, weight, pdf, is_delta: false, is_transmission })
    }

    /// The survival weight of a path for Russian roulette. Without guiding it is that of the `next`
    /// throughput (see [`unknown_survival`]). The throughput of a guided path is small where much
    /// light is expected, because many paths go there; so its weight is the expected light (see
    /// [`expected_survival`]), or where the field is not trained, the share of light that this
    /// bounce keeps. `crossing` is [`ShadingBsdf::crossing_scale`] of the sample. Takes
    /// [`super::PathState::expected`] of this ray and also returns that of the next.
    pub fn survival(
        &self,
        wo: Vec3,
        sample: &BsdfSample,
        crossing: f32,
        (throughput, first): (SampledSpectrum, Expected),
        next: f32,
    ) -> (f32, Expected) {
        if !self.is_guided {
            return (unknown_survival(next), first);
        }
        let Some(cell) = self.cell else { return (sample.weight.max_element() * crossing, first) };
        let expected = throughput.max_element() * cell.expected;
        if !cell.is_known() || expected.is_nan() || expected <= 0.0 {
            return (self.shading.albedo(wo).max_element(), first);
        }
        let (survival, first) = expected_survival(expected, first.get());
        (survival, Expected::of(first))
    }

    /// The training record of a sampled direction, if the field is learning. `survival` is the
    /// survival probability of the path.
    pub fn choice(
        &self,
        point: &Receiver,
        wo: Vec3,
        sample: &BsdfSample,
        survival: f32,
    ) -> Option<Choice> {
        let cell = self.cell.filter(|_| self.is_learning && !sample.is_delta)?;
        let bsdf_share = match cell.is_known() {
            true => cell.bsdf_share * self.shading.pdf(wo, sample.wi) / sample.pdf,
            false => 1.0,
        };
        let &Receiver { position, normal, .. } = point;
        Some(Choice {
            position,
            normal,
            direction: sample.wi,
            pdf: sample.pdf * survival,
            bsdf_share,
        })
    }
}
