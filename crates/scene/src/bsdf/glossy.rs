//! A dielectric gloss over a scattering body: plastics, paints, leaves, skin.
//!
//! The gloss is a microfacet lobe with Fresnel's law. The body gets the light that the gloss
//! transmits on the way in and out, `(1 - E(wo)) (1 - E(wi))` with `E` the albedo of the gloss,
//! over its mean in the body's directions (Kelemen and Szirmay-Kalos, A Microfacet Based Coupled
//! Specular-Matte BRDF Model, 2001): a white body loses nothing, and over a Lambertian body the
//! model is reciprocal. Light that bounces between facets enters the body.

mod batch;

pub(super) use batch::BatchGloss;

use super::batch::LobeSpectra;
use super::energy::{DielectricReflection, Directional};
use super::film::ThinFilm;
use super::mirror::mirror_branch;
use super::{
    Choice, DiffuseBsdf, Drawn, Lobes, Microfacets, SpecularBranch, fresnel, lift, lower_like,
};
use snell_math::{SampledSpectrum, Vec2, Vec3, sampling};
use std::f32::consts::FRAC_1_PI;

/// The interface on top.
#[derive(Clone, Copy, Debug)]
pub struct Gloss {
    /// Index of refraction over that of the outside. Below 1 the reflectance is that of its
    /// inverse, without total reflection, as OpenPBR suggests for a base under a denser coat.
    pub ior: f32,
    /// Factor on the reflection.
    pub tint: SampledSpectrum,
    /// Roughness.
    pub microfacets: Microfacets,
    /// A film on the interface.
    pub film: Option<ThinFilm>,
}

impl Gloss {
    /// True if this has no film and otherwise equals another one.
    fn is_plainly(&self, other: &Self) -> bool {
        self.film.is_none()
            && self.ior == other.ior
            && self.tint == other.tint
            && self.microfacets == other.microfacets
    }
}

/// The body below the interface: shares of the light that reaches it, with a sum of at most 1 in
/// each lane.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Share that is reflected diffusely.
    pub diffuse: DiffuseBsdf,
    /// Share that is transmitted diffusely to the other side, through an interface like the upper
    /// one.
    pub through: SampledSpectrum,
    /// Share that enters the medium inside diffusely.
    pub walk: SampledSpectrum,
}

impl Body {
    /// A body that only reflects.
    pub fn matte(diffuse: DiffuseBsdf) -> Self {
        Self { diffuse, through: SampledSpectrum::ZERO, walk: SampledSpectrum::ZERO }
    }
}

/// The parameters of one point. Make it with [`GlossyBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct GlossyBsdf {
    gloss: Gloss,
    body: Body,
    albedo: DielectricReflection,
    /// Reflectance of the interface at normal incidence, for the film.
    f0: SampledSpectrum,
    /// Share of diffuse light that the gloss transmits.
    passed_average: SampledSpectrum,
}

/// A glossy surface seen from a direction.
#[derive(Clone, Debug)]
pub struct GlossySeen {
    wo: Vec3,
    /// Share of light that the gloss reflects, and share that it transmits.
    gloss: SampledSpectrum,
    passed: SampledSpectrum,
    /// Mean transmittance of the gloss over the directions in which a white body scatters light
    /// towards `wo`.
    mean: SampledSpectrum,
    /// Share of the light reaching the body that it reflects.
    body: SampledSpectrum,
    /// Gloss, reflection and transmission by the body.
    choice: Choice<3>,
}

impl GlossyBsdf {
    /// As [`Microfacets::has_tangent`].
    pub(crate) fn has_tangent(&self) -> bool {
        self.gloss.microfacets.has_tangent()
    }

    /// A gloss over a body.
    pub fn new(gloss: Gloss, body: Body) -> Self {
        Self::like(None, gloss, body)
    }

    /// The same, reusing tables of another one with the same interface.
    pub(crate) fn like(other: Option<&Self>, gloss: Gloss, body: Body) -> Self {
        let ior = if gloss.ior < 1.0 { 1.0 / gloss.ior } else { gloss.ior };
        let gloss = Gloss { ior, ..gloss };
        if let Some(other) =
            other.filter(|other| gloss.film.is_none() && other.gloss.is_plainly(&gloss))
        {
            return Self { body, ..*other };
        }
        let mut made = Self {
            gloss,
            body,
            albedo: other.map_or_else(
                || DielectricReflection::new(gloss.microfacets, ior),
                |o| o.albedo.again(gloss.microfacets, ior),
            ),
            f0: SampledSpectrum::splat(fresnel::f0_from_ior(ior)),
            passed_average: SampledSpectrum::ZERO,
        };
        made.passed_average = made.mean_of_passed();
        made
    }

    /// The widths of the distribution.
    pub(super) fn microfacets(&self) -> Microfacets {
        self.gloss.microfacets
    }

    /// The albedo of its gloss at another roughness, without the tint.
    pub(super) fn albedo_at(&self, microfacets: Microfacets) -> DielectricReflection {
        self.albedo.again(microfacets, self.gloss.ior)
    }

    /// Its spectra, as [`BatchGloss`] needs them.
    pub(super) fn spectra(&self) -> LobeSpectra {
        let base = self.body.diffuse.directional_albedo(1.0);
        LobeSpectra { base, specular: self.gloss.tint, ..LobeSpectra::default() }
    }

    fn mean_of_passed(&self) -> SampledSpectrum {
        let average = if self.gloss.film.is_some() {
            NODES.iter().map(|&(cos, weight)| self.gloss_albedo(along(cos)) * weight).sum()
        } else {
            self.gloss.tint * self.albedo.average()
        };
        SampledSpectrum::ONE - average
    }

    fn fresnel(&self, cos: f32) -> SampledSpectrum {
        let f = SampledSpectrum::splat(fresnel::dielectric(cos, self.gloss.ior));
        let f = self.gloss.film.map_or(f, |film| film.reflectance(cos, self.f0, f));
        f * self.gloss.tint
    }

    /// Share of light that the gloss reflects towards a direction above.
    fn gloss_albedo(&self, w: Vec3) -> SampledSpectrum {
        let plain = self.albedo.towards(w);
        let Some(film) = self.gloss.film else { return self.gloss.tint * plain };
        // The film changes the albedo by the same factor as the reflectance of a typical facet.
        let cos = self.gloss.microfacets.widths().facet_cosine(w);
        let f = fresnel::dielectric(cos, self.gloss.ior);
        let ratio = if f > 0.0 { plain / f } else { 1.0 };
        (film.reflectance(cos, self.f0, SampledSpectrum::splat(f)) * ratio).clamp(0.0, 1.0)
            * self.gloss.tint
    }

    /// Share of light that reaches the body from a direction above.
    fn passed(&self, w: Vec3) -> SampledSpectrum {
        SampledSpectrum::ONE - self.gloss_albedo(w)
    }

    /// Mean of [`Self::passed`] over the directions in which a white body scatters light towards a
    /// direction above of this cosine.
    fn passed_by_body(&self, cos_o: f32) -> SampledSpectrum {
        let diffuse = &self.body.diffuse;
        if diffuse.is_lambertian() || diffuse.is_black() {
            return self.passed_average;
        }
        let difference = |&(cos, weight): &(f32, f32)| {
            (self.passed(along(cos)) - self.passed_average)
                * (weight * (diffuse.white_mean(cos_o, cos) - 1.0))
        };
        self.passed_average + NODES.iter().map(difference).sum::<SampledSpectrum>()
    }

    /// `(1 - E(wo)) (1 - E(wi)) / mean` for directions above.
    fn coupling(&self, seen: &GlossySeen, wi: Vec3, mean: SampledSpectrum) -> SampledSpectrum {
        (seen.passed * self.passed(wi))
            .zip(mean, |x, mean| if mean > 1e-5 { x / mean } else { 0.0 })
    }

    /// `f |cos(wi)|` of the gloss for directions above, and its density.
    fn gloss_value_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        if self.gloss.microfacets.is_smooth() {
            return (SampledSpectrum::ZERO, 0.0);
        }
        let reflection = self.gloss.microfacets.reflection_and_pdf(wo, wi);
        reflection.map_or((SampledSpectrum::ZERO, 0.0), |(m, value, pdf)| {
            (self.fresnel(wo.dot(m)) * value, pdf)
        })
    }

    /// `f |cos(wi)|` of the body for a direction lifted above.
    fn body_value(&self, seen: &GlossySeen, wi: Vec3, is_transmission: bool) -> SampledSpectrum {
        let cos = wi.z * FRAC_1_PI;
        if !is_transmission {
            if self.body.diffuse.is_black() {
                return SampledSpectrum::ZERO;
            }
            return self.body.diffuse.value(lift(seen.wo), wi)
                * self.coupling(seen, wi, seen.mean)
                * cos;
        }
        let mut value = SampledSpectrum::ZERO;
        if !self.body.through.is_black() {
            value += self.body.through * self.coupling(seen, wi, self.passed_average) * cos;
        }
        if !self.body.walk.is_black() {
            value += self.body.walk * seen.passed * cos;
        }
        value
    }

    /// `f |cos(wi)|` where light of the medium inside, gathered along `wo`, comes out: `wi` is
    /// outside and above, for a share of 1.
    pub(super) fn exit_value(&self, wi: Vec3) -> SampledSpectrum {
        self.passed(wi).zip(self.passed_average, |x, mean| if mean > 1e-5 { x / mean } else { 0.0 })
            * (wi.z * FRAC_1_PI)
    }

    fn mirror(&self, wo: Vec3) -> SpecularBranch {
        mirror_branch(wo, self.fresnel(wo.z.abs()))
    }
}

/// Cosines and weights for means with the weight `2 mu` on [0, 1]: Gauss's points in the root of
/// the cosine, as rough matte bodies and Fresnel's law change most at grazing angles.
const NODES: [(f32, f32); 8] = [
    (0.000_394_22, 0.000_001_58),
    (0.010_336_13, 0.000_467_37),
    (0.056_279_87, 0.008_376_90),
    (0.166_694_75, 0.049_367_48),
    (0.350_129_39, 0.150_279_93),
    (0.581_812_28, 0.278_437_70),
    (0.807_002_61, 0.322_433_49),
    (0.960_684_08, 0.190_635_53),
];

/// A direction of this cosine.
fn along(cos: f32) -> Vec3 {
    Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
}

impl Lobes for GlossyBsdf {
    type Seen = GlossySeen;

    fn seen(&self, wo: Vec3) -> GlossySeen {
        let up = lift(wo);
        let gloss = self.gloss_albedo(up);
        let passed = SampledSpectrum::ONE - gloss;
        let Body { diffuse, through, walk } = &self.body;
        let body = diffuse.directional_albedo(up.z);
        let choice = Choice::new([gloss, body * passed, (*through + *walk) * passed]);
        GlossySeen { wo, gloss, passed, mean: self.passed_by_body(up.z), body, choice }
    }

    fn value_and_pdf_from(&self, seen: &GlossySeen, wi: Vec3) -> (SampledSpectrum, f32) {
        let [gloss, diffuse, through] = seen.choice.probabilities;
        let side = seen.wo.z * wi.z;
        if side == 0.0 {
            return (SampledSpectrum::ZERO, 0.0);
        }
        let wi = lift(wi);
        let (body, cosine) =
            (self.body_value(seen, wi, side < 0.0), sampling::cosine_hemisphere_pdf(wi.z));
        if side < 0.0 {
            return (body, through * cosine);
        }
        let (value, facets) = self.gloss_value_and_pdf(lift(seen.wo), wi);
        (value + body, gloss * facets + diffuse * cosine)
    }

    fn draw_from(&self, seen: &GlossySeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let wo = seen.wo;
        if wo.z == 0.0 {
            return None;
        }
        let lobe = seen.choice.pick(u_lobe)?.0;
        if lobe == 0 && self.gloss.microfacets.is_smooth() {
            return Some(self.mirror(wo).drawn(seen.choice.probabilities[0]));
        }
        let up = if lobe == 0 {
            self.gloss.microfacets.sample_reflection(lift(wo), u)?
        } else {
            sampling::cosine_hemisphere(u)
        };
        let is_transmission = lobe == 2;
        let up = if is_transmission { Vec3::new(up.x, up.y, -up.z) } else { up };
        Some(Drawn::Direction { wi: lower_like(up, wo), is_transmission })
    }

    fn albedo_from(&self, seen: &GlossySeen) -> SampledSpectrum {
        seen.gloss + (seen.body + self.body.through + self.body.walk) * seen.passed
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        match wo.z * wi.z > 0.0 {
            true => self.body_value(&self.seen(wo), lift(wi), false),
            false => SampledSpectrum::ZERO,
        }
    }

    fn is_delta(&self) -> bool {
        self.gloss.microfacets.is_smooth()
            && self.body.diffuse.is_black()
            && self.body.through.is_black()
            && self.body.walk.is_black()
    }

    fn is_opaque(&self) -> bool {
        self.body.through.is_black() && self.body.walk.is_black()
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        // The mirror reflection of smooth layers is left to the branch.
        let e = self.gloss_albedo(lift(wo));
        let base = self.body.diffuse.directional_albedo(wo.z.abs()) * (SampledSpectrum::ONE - e);
        if self.gloss.microfacets.is_smooth() { base } else { base + e }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        let mirror = self
            .gloss
            .microfacets
            .is_smooth()
            .then(|| self.mirror(wo))
            .filter(|b| !b.weight.is_black());
        [mirror, None]
    }
}
