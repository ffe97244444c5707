//! Lambertian reflection.

use super::{BsdfSample, Lobes};
use snell_math::{SampledSpectrum, Vec2, Vec3, sampling};
use std::f32::consts::FRAC_1_PI;

/// Light leaves in all directions with equal radiance.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseBsdf {
    /// Share of light reflected, `[0, 1]`.
    pub reflectance: SampledSpectrum,
}

impl Lobes for DiffuseBsdf {
    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        if wo.z * wi.z <= 0.0 { SampledSpectrum::ZERO } else { self.reflectance * (wi.z.abs() * FRAC_1_PI) }
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.eval(wo, wi)
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z <= 0.0 { 0.0 } else { sampling::cosine_hemisphere_pdf(wi.z.abs()) }
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let mut wi = sampling::cosine_hemisphere(u);
        let pdf = sampling::cosine_hemisphere_pdf(wi.z);
        if wo.z < 0.0 {
            wi.z = -wi.z;
        }
        (pdf > 0.0 && wo.z != 0.0).then_some(BsdfSample {
            wi,
            weight: self.reflectance,
            pdf,
            is_delta: false,
            is_transmission: false,
        })
    }

    fn is_delta(&self) -> bool {
        false
    }

    fn is_opaque(&self) -> bool {
        true
    }

    fn albedo(&self, _wo: Vec3) -> SampledSpectrum {
        self.reflectance
    }
}
