//! Phong's model in two forms: the classic formula for local illumination, and an energy-conserving
//! BSDF for path tracing.
//!
//! The classic formula is that of `.scn` and `.mtl` files: `kd (N.L) + ks (V.R)^n` for each light,
//! `reflection` times the radiance of the mirror direction, and `transmission` times that of the
//! refracted direction, without Fresnel's law. The BSDF is the modified Phong model of Lafortune
//! and Willems (Using the Modified Phong Reflectance Model for Physically Based Rendering, 1994)
//! with a glossy lobe of albedo `specular`. Mirror reflection beyond that (`reflection - specular`)
//! and transmission are delta lobes.

use super::mirror::mirror_branch;
use super::{Drawn, Lobes, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{SampledSpectrum, Vec2, Vec3, real, sampling};
use std::f32::consts::{FRAC_1_PI, PI};

/// Maximum exponent: higher ones are too sharp for single precision and look like a mirror.
const MAX_EXPONENT: f32 = 1e6;

/// Phong's model at one point. Make it with [`PhongBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct PhongBsdf {
    ambient: SampledSpectrum,
    diffuse: SampledSpectrum,
    specular: SampledSpectrum,
    reflection: SampledSpectrum,
    transmission: SampledSpectrum,
    exponent: f32,
    ior: f32,
    /// Factor on the BSDF that makes it energy-conserving.
    scale: f32,
}

/// Coefficients of a [`PhongBsdf`], none negative.
#[derive(Clone, Copy, Debug)]
pub struct PhongCoefficients {
    /// Reflectance for ambient light.
    pub ambient: SampledSpectrum,
    /// Diffuse reflectance, `kd`.
    pub diffuse: SampledSpectrum,
    /// Reflectance of the highlight, `ks`.
    pub specular: SampledSpectrum,
    /// Factor on the mirrored radiance.
    pub reflection: SampledSpectrum,
    /// Factor on the refracted radiance.
    pub transmission: SampledSpectrum,
    /// Exponent of the highlight.
    pub exponent: f32,
    /// Index of refraction inside divided by that outside; 1 does not refract.
    pub ior: f32,
}

impl PhongBsdf {
    /// The BSDF with these coefficients. If they add up to more than 1 in a channel, the BSDF (but
    /// not the classic formula) scales all of them down by the same factor.
    pub fn new(c: PhongCoefficients) -> Self {
        let mirror = c.reflection.zip(c.specular, |r, s| (r - s).max(0.0));
        let most = (c.diffuse + c.specular + mirror + c.transmission).max_element();
        Self {
            ambient: c.ambient,
            diffuse: c.diffuse,
            specular: c.specular,
            reflection: c.reflection,
            transmission: c.transmission,
            exponent: super::bounded(c.exponent, MAX_EXPONENT),
            ior: c.ior,
            scale: if most > 1.0 { 1.0 / most } else { 1.0 },
        }
    }

    fn mirror_excess(&self) -> SampledSpectrum {
        self.reflection.zip(self.specular, |r, s| (r - s).max(0.0))
    }

    /// `cos^n` of the angle between `wi` and the mirror direction of `wo`, both above the surface.
    fn highlight(&self, wo: Vec3, wi: Vec3) -> f32 {
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        // The cosine is computed from the chord, because the cosine of a small angle is imprecise,
        // which matters for large exponents.
        let one_minus_cos = 0.5 * (mirror - wi).length_squared();
        if one_minus_cos >= 1.0 {
            0.0
        } else {
            real::exp(self.exponent * real::ln_1p(-one_minus_cos))
        }
    }

    fn sample_highlight(&self, wo: Vec3, u: Vec2) -> Vec3 {
        let one_minus_cos = -real::exp_m1(real::ln(1.0 - u.x) / (self.exponent + 1.0));
        let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
        let (s, c) = real::sin_cos(2.0 * PI * u.y);
        let frame = snell_math::Frame::from_z(Vec3::new(-wo.x, -wo.y, wo.z));
        frame.from_local(Vec3::new(sin * c, sin * s, 1.0 - one_minus_cos)).normalize_or(frame.z)
    }

    /// Probabilities of sampling the diffuse lobe, the highlight, the mirror and the transmission.
    fn choice(&self) -> Option<[f32; 4]> {
        let sum = |s: SampledSpectrum| s.0.iter().sum::<f32>();
        let weights =
            [self.diffuse, self.specular, self.mirror_excess(), self.transmission].map(sum);
        let total: f32 = weights.iter().sum();
        (total > 0.0).then(|| weights.map(|w| w / total))
    }

    /// Density of a direction above the surface, given its [`Self::highlight`].
    fn mixture_pdf(&self, [diffuse, glossy, ..]: [f32; 4], highlight: f32, wi: Vec3) -> f32 {
        diffuse * sampling::cosine_hemisphere_pdf(wi.z)
            + glossy * (self.exponent + 1.0) * 0.5 * FRAC_1_PI * highlight
    }

    fn refraction(&self, wo: Vec3) -> Option<SpecularBranch> {
        let eta = if wo.z > 0.0 { self.ior } else { 1.0 / self.ior };
        let wi = if self.ior == 1.0 {
            -wo
        } else {
            lower_like(fresnel::refract(lift(wo), Vec3::Z, eta)?, wo)
        };
        Some(SpecularBranch { wi, weight: self.transmission, is_transmission: true })
    }
}

impl Lobes for PhongBsdf {
    type Seen = Vec3;

    fn seen(&self, wo: Vec3) -> Vec3 {
        wo
    }

    fn value_and_pdf_from(&self, &wo: &Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        if wo.z * wi.z <= 0.0 {
            return (SampledSpectrum::ZERO, 0.0);
        }
        let wi = lift(wi);
        let highlight = self.highlight(lift(wo), wi);
        let glossy = (self.exponent + 2.0) * 0.5 * FRAC_1_PI * highlight;
        let value = (self.diffuse * FRAC_1_PI + self.specular * glossy) * (wi.z * self.scale);
        (value, self.choice().map_or(0.0, |choice| self.mixture_pdf(choice, highlight, wi)))
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if wo.z * wi.z > 0.0 {
            self.diffuse * (FRAC_1_PI * wi.z.abs() * self.scale)
        } else {
            SampledSpectrum::ZERO
        }
    }

    fn draw_from(&self, &wo: &Vec3, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        if wo.z == 0.0 {
            return None;
        }
        let [diffuse, highlight, mirror, transmission] = self.choice()?;
        let up = if u_lobe < diffuse {
            sampling::cosine_hemisphere(u)
        } else if u_lobe < diffuse + highlight {
            self.sample_highlight(lift(wo), u)
        } else if u_lobe < diffuse + highlight + mirror {
            return Some(mirror_branch(wo, self.mirror_excess() * self.scale).drawn(mirror));
        } else if transmission > 0.0 {
            return self.refraction(wo).map(|b| {
                SpecularBranch { weight: b.weight * self.scale, ..b }.drawn(transmission)
            });
        } else {
            return None;
        };
        (up.z > 0.0).then(|| Drawn::Direction { wi: lower_like(up, wo), is_transmission: false })
    }

    fn is_delta(&self) -> bool {
        self.diffuse.is_black() && self.specular.is_black()
    }

    fn is_opaque(&self) -> bool {
        true
    }

    fn albedo_from(&self, _wo: &Vec3) -> SampledSpectrum {
        (self.diffuse + self.specular + self.mirror_excess() + self.transmission) * self.scale
    }

    fn eval_classic(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if wo.z * wi.z <= 0.0 {
            return SampledSpectrum::ZERO;
        }
        self.diffuse * wi.z.abs() + self.specular * self.highlight(lift(wo), lift(wi))
    }

    fn ambient(&self, _wo: Vec3) -> SampledSpectrum {
        self.ambient
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        let reflection = (!self.reflection.is_black()).then(|| mirror_branch(wo, self.reflection));
        [reflection, if self.transmission.is_black() { None } else { self.refraction(wo) }]
    }
}
