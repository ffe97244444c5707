//! The gloss over an opaque Lambertian body, for batches of directions.

use super::super::batch::{BatchLobes, LobeSpectra};
use super::super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::super::energy::{DielectricReflectionBy, Directional, Line, Nodes};
use super::super::{Choice, Ggx, fresnel, lift, lower_like};
use super::GlossyBsdf;
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3, sampling};
use std::f32::consts::FRAC_1_PI;

/// A gloss of [`Ggx`] without a film, smooth or rough, over a Lambertian body.
#[derive(Clone, Debug)]
pub struct BatchGloss<const SMOOTH: bool, N = Line> {
    ior: f32,
    ggx: Ggx,
    albedo: DielectricReflectionBy<N>,
    /// The mean of the reflection.
    mean: f32,
    /// The spectra where they are the same everywhere.
    pub own: Colors,
}

/// Spectra of a lane.
#[derive(Clone, Copy, Debug)]
pub struct Colors {
    /// Reflectance of the body.
    pub body: SampledSpectrum,
    tint: SampledSpectrum,
    /// As in [`GlossyBsdf`].
    passed_average: SampledSpectrum,
}

impl Colors {
    #[inline(always)]
    fn new(body: SampledSpectrum, tint: SampledSpectrum, mean: f32) -> Self {
        Self { body, tint, passed_average: SampledSpectrum::ONE - tint * mean }
    }
}

/// As [`super::GlossySeen`].
pub struct Seen {
    wo: Vec3,
    gloss: SampledSpectrum,
    passed: SampledSpectrum,
    choice: Choice<2>,
}

impl<const SMOOTH: bool> BatchGloss<SMOOTH> {
    /// `None` for other glosses.
    pub fn of(bsdf: &GlossyBsdf) -> Option<Self> {
        let GlossyBsdf { gloss, body, albedo, .. } = bsdf;
        let mean = albedo.average();
        let ggx = gloss.microfacets.ggx()?;
        let is_matte =
            body.diffuse.is_lambertian() && body.through.is_black() && body.walk.is_black();
        (is_matte && gloss.film.is_none() && ggx.is_smooth() == SMOOTH).then(|| Self {
            ior: gloss.ior,
            ggx,
            albedo: albedo.line(),
            mean,
            own: Colors::new(body.diffuse.directional_albedo(1.0), gloss.tint, mean),
        })
    }
}

impl BatchGloss<false> {
    /// Index of refraction.
    #[inline(always)]
    pub fn ior(&self) -> f32 {
        self.ior
    }

    /// The same gloss with another roughness: with the reflection of that roughness and its mean
    /// albedo, without the tint.
    #[inline(always)]
    pub fn with<N>(&self, albedo: DielectricReflectionBy<N>, mean: f32) -> BatchGloss<false, N> {
        let own = Colors::new(self.own.body, self.own.tint, mean);
        BatchGloss { ior: self.ior, ggx: albedo.widths.into(), albedo, mean, own }
    }
}

impl<const SMOOTH: bool, N: Nodes> BatchGloss<SMOOTH, N> {
    /// As [`GlossyBsdf::gloss_albedo`].
    #[inline(always)]
    fn gloss_albedo(&self, colors: &Colors, w: Vec3) -> SampledSpectrum {
        colors.tint
            * if SMOOTH { fresnel::dielectric(w.z, self.ior) } else { self.albedo.towards(w) }
    }

    #[inline(always)]
    fn fresnel(&self, colors: &Colors, cos: f32) -> SampledSpectrum {
        SampledSpectrum::splat(fresnel::dielectric(cos, self.ior)) * colors.tint
    }

    /// As [`GlossyBsdf::body_value`].
    #[inline(always)]
    fn body_value(&self, colors: &Colors, seen: &Seen, wi: Vec3) -> SampledSpectrum {
        let passed = seen.passed * (SampledSpectrum::ONE - self.gloss_albedo(colors, wi));
        let coupling =
            passed.zip(colors.passed_average, |x, mean| if mean > 1e-5 { x / mean } else { 0.0 });
        colors.body * coupling * (wi.z * FRAC_1_PI)
    }
}

impl<const SMOOTH: bool, N: Nodes> BranchlessLobes for BatchGloss<SMOOTH, N> {
    type Seen = Seen;
    type Colors = Colors;

    #[inline(always)]
    fn seen(&self, colors: &Colors, wo: Vec3) -> Seen {
        let gloss = self.gloss_albedo(colors, lift(wo));
        let passed = SampledSpectrum::ONE - gloss;
        Seen { wo, gloss, passed, choice: Choice::new([gloss, colors.body * passed]) }
    }

    #[inline(always)]
    fn value_and_pdf_from(&self, colors: &Colors, seen: &Seen, wi: Vec3) -> (SampledSpectrum, f32) {
        let [gloss, diffuse] = seen.choice.probabilities;
        let is_seen = seen.wo.z * wi.z > 0.0;
        let wi = lift(wi);
        let (body, cosine) =
            (self.body_value(colors, seen, wi), sampling::cosine_hemisphere_pdf(wi.z));
        let (value, pdf) = if SMOOTH {
            (body, diffuse * cosine)
        } else {
            let wo = lift(seen.wo);
            let (m, value, pdf, exists) = self.ggx.reflected(wo, wi);
            let facets = self.fresnel(colors, wo.dot(m)) * value;
            let facets = facets.map(|x| if exists { x } else { 0.0 });
            (facets + body, gloss * if exists { pdf } else { 0.0 } + diffuse * cosine)
        };
        (value.map(|x| if is_seen { x } else { 0.0 }), if is_seen { pdf } else { 0.0 })
    }

    #[inline(always)]
    fn draw_from(&self, colors: &Colors, seen: &Seen, u_lobe: f32, u: Vec2) -> BranchlessDrawn {
        let wo = seen.wo;
        let (is_gloss, exists) = seen.choice.picks_first(u_lobe);
        let exists = exists & (wo.z != 0.0);
        let body = lower_like(sampling::cosine_hemisphere(u), wo);
        if SMOOTH {
            let delta = self.fresnel(colors, wo.z.abs()) / seen.choice.probabilities[0];
            let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
            return BranchlessDrawn::reflected(
                select(is_gloss, mirror, body),
                exists,
                Some((is_gloss, delta)),
            );
        }
        let (facet, is_above) = self.ggx.drawn_reflection(lift(wo), u);
        let wi = select(is_gloss, lower_like(facet, wo), body);
        BranchlessDrawn::reflected(wi, exists & (is_above | !is_gloss), None)
    }

    #[inline(always)]
    fn albedo_from(&self, colors: &Colors, seen: &Seen) -> SampledSpectrum {
        seen.gloss + colors.body * seen.passed
    }
}

impl<const SMOOTH: bool, N: Nodes> BatchLobes for BatchGloss<SMOOTH, N> {
    #[inline(always)]
    fn own_colors(&self, body: SampledSpectrum) -> Colors {
        Colors { body, ..self.own }
    }

    #[inline(always)]
    fn colors_of(&self, spectra: &LobeSpectra) -> Colors {
        Colors::new(spectra.base, spectra.specular, self.mean)
    }
}
