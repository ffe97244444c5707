//! No reflection at all.

use super::{BsdfSample, Lobes};
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// Absorbs everything: surfaces that only emit.
#[derive(Clone, Copy, Debug, Default)]
pub struct BlackBsdf;

impl Lobes for BlackBsdf {
    fn eval(&self, _wo: Vec3, _wi: Vec3) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }

    fn pdf(&self, _wo: Vec3, _wi: Vec3) -> f32 {
        0.0
    }

    fn sample(&self, _wo: Vec3, _u_lobe: f32, _u: Vec2) -> Option<BsdfSample> {
        None
    }

    fn is_delta(&self) -> bool {
        // Light samples are as useless here as on a mirror.
        true
    }

    fn albedo(&self, _wo: Vec3) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }
}
