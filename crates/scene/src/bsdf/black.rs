//! A BSDF that reflects nothing.

use super::{Drawn, Lobes};
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// The BSDF of surfaces that absorb all light and at most emit some.
#[derive(Clone, Copy, Debug, Default)]
pub struct BlackBsdf;

impl Lobes for BlackBsdf {
    type Seen = Vec3;

    fn seen(&self, wo: Vec3) -> Vec3 {
        wo
    }

    fn value_and_pdf_from(&self, _wo: &Vec3, _wi: Vec3) -> (SampledSpectrum, f32) {
        (SampledSpectrum::ZERO, 0.0)
    }

    fn draw_from(&self, _wo: &Vec3, _u_lobe: f32, _u: Vec2) -> Option<Drawn> {
        None
    }

    fn is_delta(&self) -> bool {
        // Light samples are as useless here as on a mirror.
        true
    }

    fn albedo_from(&self, _wo: &Vec3) -> SampledSpectrum {
        SampledSpectrum::ZERO
    }
}
