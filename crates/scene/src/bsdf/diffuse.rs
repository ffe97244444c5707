//! Matte reflection: the energy-preserving Oren-Nayar model.

use super::{BsdfSample, Drawn, Lobes};
use snell_math::{SampledSpectrum, Vec2, Vec3, real, sampling};
use std::f32::consts::{FRAC_1_PI, PI};

/// A matte surface. Smooth ones are Lambertian; rough ones look flatter and reflect more light back
/// towards where it came from (Portsmouth, Kutz and Hill, EON: A practical energy-preserving rough
/// diffuse BRDF, 2024). A white one absorbs nothing at any roughness.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseBsdf {
    /// The fraction of light that a facet reflects, in `[0, 1]`: the albedo where the surface is
    /// smooth.
    reflectance: SampledSpectrum,
    roughness: f32,
    /// `A` of the model, and the factor on the lobe of light that bounces off several facets.
    level: f32,
    bounced: SampledSpectrum,
}

/// Constants of Fujii's model: the loss of level, and the gain of the mean albedo, both per unit of
/// roughness.
const LEVEL: f32 = 0.5 - 2.0 / (3.0 * PI);
const MEAN: f32 = 2.0 / 3.0 - 28.0 / (15.0 * PI);

impl DiffuseBsdf {
    /// Lambertian reflection with this reflectance.
    #[inline(always)]
    pub fn lambertian(reflectance: SampledSpectrum) -> Self {
        Self::new(reflectance, 0.0)
    }

    /// A matte surface of this reflectance and roughness, both in `[0, 1]`.
    #[inline(always)]
    pub fn new(reflectance: SampledSpectrum, roughness: f32) -> Self {
        let roughness = super::bounded(roughness, 1.0);
        let level = 1.0 / (1.0 + LEVEL * roughness);
        let mean = level * (1.0 + MEAN * roughness);
        let lost = 1.0 - mean;
        let bounced = if roughness > 0.0 {
            reflectance * reflectance * (mean / lost) / (SampledSpectrum::ONE - reflectance * lost)
        } else {
            SampledSpectrum::ZERO
        };
        Self { reflectance, roughness, level, bounced }
    }

    /// The same surface where it covers these fractions of a mixture. Unlike a darker colour, a
    /// smaller fraction does not change what bounces between facets.
    pub(crate) fn scaled(self, share: SampledSpectrum) -> Self {
        Self { reflectance: self.reflectance * share, bounced: self.bounced * share, ..self }
    }

    /// True if the surface reflects nothing.
    pub(super) fn is_black(&self) -> bool {
        self.reflectance.is_black()
    }

    /// True if all directions receive the same radiance.
    #[inline(always)]
    pub(crate) fn is_lambertian(&self) -> bool {
        self.roughness == 0.0
    }

    /// The fraction of light that a white surface does not reflect by single facets, towards a
    /// direction with this cosine.
    fn lost(&self, cos: f32) -> f32 {
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let g = sin * (real::acos(cos.clamp(-1.0, 1.0)) - sin * cos)
            + (2.0 / 3.0) * (sin * cos * (1.0 + sin + sin * sin) / (1.0 + sin) - sin);
        (1.0 - self.level * (1.0 + self.roughness * FRAC_1_PI * g)).max(0.0)
    }

    /// `pi f` for directions above the surface.
    #[inline(always)]
    pub(super) fn value(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if self.is_lambertian() {
            return self.reflectance;
        }
        let s = wo.x * wi.x + wo.y * wi.y;
        let s = if s > 0.0 { s / wo.z.max(wi.z) } else { s };
        let once = (self.level * (1.0 + self.roughness * s)).max(0.0);
        self.reflectance * once + self.bounced * (self.lost(wo.z) * self.lost(wi.z))
    }

    /// `pi f` of a white surface, averaged over the azimuth.
    pub(super) fn white_mean(&self, cos_o: f32, cos_i: f32) -> f32 {
        let [so, si] = [cos_o, cos_i].map(|c| (1.0 - c * c).max(0.0).sqrt());
        let s = FRAC_1_PI * so * si * (1.0 / cos_o.max(cos_i).max(1e-6) - 1.0);
        let mean = self.level * (1.0 + MEAN * self.roughness);
        self.level * (1.0 + self.roughness * s)
            + self.lost(cos_o) * self.lost(cos_i) / (1.0 - mean).max(1e-6)
    }

    /// The fraction of light that is reflected, for a direction with this cosine.
    #[inline(always)]
    pub(super) fn directional_albedo(&self, cos: f32) -> SampledSpectrum {
        if self.is_lambertian() {
            return self.reflectance;
        }
        let (lost, mean) = (self.lost(cos), self.level * (1.0 + MEAN * self.roughness));
        self.reflectance * (1.0 - lost) + self.bounced * (lost * (1.0 - mean))
    }
}

impl Lobes for DiffuseBsdf {
    type Seen = Vec3;

    fn seen(&self, wo: Vec3) -> Vec3 {
        wo
    }

    fn value_and_pdf_from(&self, &wo: &Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        if wo.z * wi.z <= 0.0 {
            return (SampledSpectrum::ZERO, 0.0);
        }
        let value = self.value(super::lift(wo), super::lift(wi)) * (wi.z.abs() * FRAC_1_PI);
        (value, sampling::cosine_hemisphere_pdf(wi.z.abs()))
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.eval(wo, wi)
    }

    fn draw_from(&self, &wo: &Vec3, _u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let wi = super::lower_like(sampling::cosine_hemisphere(u), wo);
        (wo.z != 0.0).then_some(Drawn::Direction { wi, is_transmission: false })
    }

    /// The weight is the value without the cosine, so no division is needed.
    fn sample_from(&self, wo: &Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let Drawn::Direction { wi, is_transmission } = self.draw_from(wo, u_lobe, u)? else {
            return None;
        };
        let up = super::lift(wi);
        let (weight, pdf) =
            (self.value(super::lift(*wo), up), sampling::cosine_hemisphere_pdf(up.z));
        (pdf > 0.0).then_some(BsdfSample { wi, weight, pdf, is_delta: false, is_transmission })
    }

    fn is_delta(&self) -> bool {
        false
    }

    fn is_opaque(&self) -> bool {
        true
    }

    fn albedo_from(&self, wo: &Vec3) -> SampledSpectrum {
        self.directional_albedo(wo.z.abs())
    }
}
