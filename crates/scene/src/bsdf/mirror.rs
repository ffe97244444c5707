//! Perfect mirror reflection.

use super::{BsdfSample, Drawn, Lobes, SpecularBranch};
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// The BSDF of a perfect mirror, which reflects light from the mirror direction only.
#[derive(Clone, Copy, Debug)]
pub struct MirrorBsdf {
    /// Fraction of light that is reflected, in `[0, 1]`.
    pub reflectance: SampledSpectrum,
}

/// The mirror direction of `wo` with this factor on the radiance.
pub(super) fn mirror_branch(wo: Vec3, weight: SampledSpectrum) -> SpecularBranch {
    SpecularBranch { wi: Vec3::new(-wo.x, -wo.y, wo.z), weight, is_transmission: false }
}

impl SpecularBranch {
    /// The sample of this branch, which was chosen with `probability` among the lobes.
    pub(super) fn drawn(self, probability: f32) -> Drawn {
        Drawn::Delta(BsdfSample {
            wi: self.wi,
            weight: self.weight / probability,
            pdf: 0.0,
            is_delta: true,
            is_transmission: self.is_transmission,
        })
    }
}

impl Lobes for MirrorBsdf {
    type Seen = Vec3;

    fn seen(&self, wo: Vec3) -> Vec3 {
        wo
    }

    fn value_and_pdf_from(&self, _wo: &Vec3, _wi: Vec3) -> (SampledSpectrum, f32) {
        (SampledSpectrum::ZERO, 0.0)
    }

    fn draw_from(&self, &wo: &Vec3, _u_lobe: f32, _u: Vec2) -> Option<Drawn> {
        (wo.z != 0.0).then(|| mirror_branch(wo, self.reflectance).drawn(1.0))
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn albedo_from(&self, _wo: &Vec3) -> SampledSpectrum {
        self.reflectance
    }

    fn ambient(&self, _wo: Vec3) -> SampledSpectrum {
        // The specular branch covers the whole reflection.
        SampledSpectrum::ZERO
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        [Some(mirror_branch(wo, self.reflectance)), None]
    }
}
