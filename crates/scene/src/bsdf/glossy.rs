//! A dielectric gloss over a scattering body: plastics, paints, leaves, skin.
//!
//! The gloss is a microfacet lobe with Fresnel's law. The body gets the light that the gloss
//! transmits on the way in and out, `(1 - E(wo)) (1 - E(wi))` with `E` the albedo of the gloss,
//! over its mean in the body's directions (Kelemen and Szirmay-Kalos, A Microfacet Based Coupled
//! Specular-Matte BRDF Model, 2001): a white body loses nothing, and over a Lambertian body the
//! model is reciprocal. Light that bounces between facets enters the body.

use super::batch::{BatchLobes, LobeSpectra};
use super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::energy::{DielectricReflection, DielectricReflectionBy, Directional, Line, Nodes};
use super::film::{NoFilm, ThinFilm};
use super::microfacets::{Facets, KnownFacets, Rough};
use super::mirror::mirror_branch;
use super::{
    Choice, DiffuseBsdf, Drawn, Lobes, Microfacets, SpecularBranch, fresnel, lift, lower_like,
};
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3, sampling};
use std::f32::consts::{FRAC_1_PI, FRAC_1_SQRT_2};

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

impl Body {
    /// True if no light goes through.
    #[inline(always)]
    fn is_opaque(&self) -> bool {
        self.through.is_black() && self.walk.is_black()
    }
}

/// A body that only reflects, and is known to be Lambertian when the program is compiled: its
/// reflectance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lambertian(SampledSpectrum);

impl From<Lambertian> for Body {
    #[inline(always)]
    fn from(Lambertian(reflectance): Lambertian) -> Self {
        Self::matte(DiffuseBsdf::lambertian(reflectance))
    }
}

/// A gloss with this distribution of facets, albedo and film over the reflection by a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct GlossLobe<M, A, F, B> {
    /// At least 1.
    ior: f32,
    microfacets: M,
    film: F,
    /// Albedo of the gloss without tint and film, and its mean for diffuse light.
    albedo: A,
    mean: f32,
    /// The spectra where they are the same everywhere.
    own: GlossColors<B>,
}

/// The spectra of a gloss and its body.
#[derive(Clone, Copy, Debug)]
pub(super) struct GlossColors<B> {
    body: B,
    tint: SampledSpectrum,
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

impl<M: Facets, A: Directional, F: Into<Option<ThinFilm>> + Copy, B: Into<Body> + Copy>
    GlossLobe<M, A, F, B>
{
    #[inline(always)]
    fn colors(&self, body: B, tint: SampledSpectrum) -> GlossColors<B> {
        let average = if self.film.into().is_some() {
            NODES.iter().map(|&(cos, weight)| self.mean_albedo(tint, cos) * weight).sum()
        } else {
            tint * self.mean
        };
        GlossColors { body, tint, passed_average: SampledSpectrum::ONE - average }
    }

    /// Reflectance of a facet that is seen at this cosine.
    #[inline(always)]
    fn fresnel(&self, tint: SampledSpectrum, cos: f32) -> SampledSpectrum {
        let f = SampledSpectrum::splat(fresnel::dielectric(cos, self.ior));
        let film: Option<ThinFilm> = self.film.into();
        film.map_or(f, |film| film.reflectance(cos, self.f0(), f)) * tint
    }

    /// Reflectance at normal incidence.
    #[inline(always)]
    fn f0(&self) -> SampledSpectrum {
        SampledSpectrum::splat(fresnel::f0_from_ior(self.ior))
    }

    /// Share of light that the gloss reflects towards a direction above.
    #[inline(always)]
    fn gloss_albedo(&self, tint: SampledSpectrum, w: Vec3) -> SampledSpectrum {
        self.gloss_albedo_by::<16>(tint, w)
    }

    /// Does what [`Self::gloss_albedo`] does, with a film on this number of facets.
    #[inline(always)]
    fn gloss_albedo_by<const FACETS: u32>(
        &self,
        tint: SampledSpectrum,
        w: Vec3,
    ) -> SampledSpectrum {
        let plain = if self.microfacets.is_smooth() {
            fresnel::dielectric(w.z, self.ior)
        } else {
            self.albedo.towards(w)
        };
        let film: Option<ThinFilm> = self.film.into();
        let Some(film) = film else { return tint * plain };
        if self.microfacets.is_smooth() {
            return self.fresnel(tint, w.z);
        }
        (tint * plain + self.added_by_film::<FACETS>(film, tint, w)).clamp(0.0, 1.0)
    }

    /// What a film adds to the light that rough facets reflect towards a direction above, which may
    /// be negative.
    fn added_by_film<const FACETS: u32>(
        &self,
        film: ThinFilm,
        tint: SampledSpectrum,
        w: Vec3,
    ) -> SampledSpectrum {
        let facets = self.microfacets.get();
        let added = facets.mean_over_facets::<FACETS>(w, |w, u| {
            let (wi, is_above) = facets.drawn_reflection(w, u);
            let (m, value, pdf, exists) = facets.reflected(w, wi);
            if !(is_above && exists && pdf > 0.0) {
                return SampledSpectrum::ZERO;
            }
            let cos = w.dot(m);
            let plain = SampledSpectrum::splat(fresnel::dielectric(cos, self.ior));
            (film.reflectance(cos, self.f0(), plain) - plain) * (value / pdf)
        });
        added * tint
    }

    /// Mean of [`Self::gloss_albedo`] over the azimuths of directions of this cosine.
    #[inline(always)]
    fn mean_albedo(&self, tint: SampledSpectrum, cos: f32) -> SampledSpectrum {
        // Of an anisotropic gloss, by the midpoint rule over a quarter of the circle.
        const AZIMUTHS: [(f32, f32); 3] = [
            (0.965_925_8, 0.258_819_04),
            (FRAC_1_SQRT_2, FRAC_1_SQRT_2),
            (0.258_819_04, 0.965_925_8),
        ];
        let sin = (1.0 - cos * cos).sqrt();
        // The mean is over many directions, so that few facets of each are enough.
        let at = |&(x, y): &(f32, f32)| {
            self.gloss_albedo_by::<8>(tint, Vec3::new(sin * x, sin * y, cos))
        };
        if self.microfacets.get().widths().has_tangent() {
            AZIMUTHS.iter().map(at).sum::<SampledSpectrum>() * (1.0 / 3.0)
        } else {
            at(&(1.0, 0.0))
        }
    }

    /// Share of light that reaches the body from a direction above.
    #[inline(always)]
    fn passed(&self, colors: &GlossColors<B>, w: Vec3) -> SampledSpectrum {
        SampledSpectrum::ONE - self.gloss_albedo(colors.tint, w)
    }

    /// Mean of [`Self::passed`] over the directions in which a white body scatters light towards a
    /// direction above of this cosine.
    #[inline(always)]
    fn passed_by_body(&self, colors: &GlossColors<B>, cos_o: f32) -> SampledSpectrum {
        let Body { diffuse, .. } = colors.body.into();
        if diffuse.is_lambertian() || diffuse.is_black() {
            return colors.passed_average;
        }
        let difference = |&(cos, weight): &(f32, f32)| {
            let passed = SampledSpectrum::ONE - self.mean_albedo(colors.tint, cos);
            (passed - colors.passed_average) * (weight * (diffuse.white_mean(cos_o, cos) - 1.0))
        };
        colors.passed_average + NODES.iter().map(difference).sum::<SampledSpectrum>()
    }

    /// `(1 - E(wo)) (1 - E(wi)) / mean` for directions above.
    #[inline(always)]
    fn coupling(
        &self,
        colors: &GlossColors<B>,
        seen: &GlossySeen,
        wi: Vec3,
        mean: SampledSpectrum,
    ) -> SampledSpectrum {
        (seen.passed * self.passed(colors, wi)).zip(mean, over_mean)
    }

    /// `f |cos(wi)|` of reflection by the body, for a direction above.
    #[inline(always)]
    fn body_value(&self, colors: &GlossColors<B>, seen: &GlossySeen, wi: Vec3) -> SampledSpectrum {
        let coupling = self.coupling(colors, seen, wi, seen.mean);
        let Body { diffuse, .. } = colors.body.into();
        diffuse.value(lift(seen.wo), wi) * coupling * (wi.z * FRAC_1_PI)
    }
}

/// A share of light over its mean.
#[inline(always)]
fn over_mean(x: f32, mean: f32) -> f32 {
    if mean > 1e-5 { x / mean } else { 0.0 }
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

impl<M: Facets, A: Directional, F: Into<Option<ThinFilm>> + Copy, B: Into<Body> + Copy>
    BranchlessLobes for GlossLobe<M, A, F, B>
{
    type Seen = GlossySeen;
    type Colors = GlossColors<B>;

    #[inline(always)]
    fn seen(&self, colors: &GlossColors<B>, wo: Vec3) -> GlossySeen {
        let up = lift(wo);
        let gloss = self.gloss_albedo(colors.tint, up);
        let passed = SampledSpectrum::ONE - gloss;
        let below: Body = colors.body.into();
        let body = below.diffuse.directional_albedo(up.z);
        let through = match below.is_opaque() {
            true => SampledSpectrum::ZERO,
            false => (below.through + below.walk) * passed,
        };
        let choice = Choice::new([gloss, body * passed, through]);
        GlossySeen { wo, gloss, passed, mean: self.passed_by_body(colors, up.z), body, choice }
    }

    #[inline(always)]
    fn value_and_pdf_from(
        &self,
        colors: &GlossColors<B>,
        seen: &GlossySeen,
        wi: Vec3,
    ) -> (SampledSpectrum, f32) {
        let [gloss, diffuse, _] = seen.choice.probabilities;
        let is_seen = seen.wo.z * wi.z > 0.0;
        let wi = lift(wi);
        let (body, cosine) =
            (self.body_value(colors, seen, wi), sampling::cosine_hemisphere_pdf(wi.z));
        let (value, pdf) = if self.microfacets.is_smooth() {
            (body, diffuse * cosine)
        } else {
            let wo = lift(seen.wo);
            let (m, value, pdf, exists) = self.microfacets.get().reflected(wo, wi);
            let facets = self.fresnel(colors.tint, wo.dot(m)) * value;
            let facets = facets.map(|x| if exists { x } else { 0.0 });
            (facets + body, gloss * if exists { pdf } else { 0.0 } + diffuse * cosine)
        };
        (value.map(|x| if is_seen { x } else { 0.0 }), if is_seen { pdf } else { 0.0 })
    }

    /// Draws a reflection by the gloss or by the body.
    #[inline(always)]
    fn draw_from(
        &self,
        colors: &GlossColors<B>,
        seen: &GlossySeen,
        u_lobe: f32,
        u: Vec2,
    ) -> BranchlessDrawn {
        let (wo, [gloss, diffuse, _]) = (seen.wo, seen.choice.probabilities);
        let (is_gloss, exists) = Choice { probabilities: [gloss, diffuse] }.picks_first(u_lobe);
        let exists = exists & (wo.z != 0.0);
        let body = lower_like(sampling::cosine_hemisphere(u), wo);
        if self.microfacets.is_smooth() {
            let delta = self.fresnel(colors.tint, wo.z.abs()) / gloss;
            let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
            return BranchlessDrawn::reflected(
                select(is_gloss, mirror, body),
                exists,
                Some((is_gloss, delta)),
            );
        }
        let (facet, is_above) = if M::IS_KNOWN || is_gloss {
            self.microfacets.get().drawn_reflection(lift(wo), u)
        } else {
            (Vec3::Z, true)
        };
        let wi = select(is_gloss, lower_like(facet, wo), body);
        BranchlessDrawn::reflected(wi, exists & (is_above | !is_gloss), None)
    }

    /// The share that is reflected.
    #[inline(always)]
    fn albedo_from(&self, _colors: &GlossColors<B>, seen: &GlossySeen) -> SampledSpectrum {
        seen.gloss + seen.body * seen.passed
    }
}

/// A glossy surface: a [`GlossLobe`], and transmission by the body. Make it with
/// [`GlossyBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct GlossyBsdf {
    lobe: GlossLobe<Microfacets, DielectricReflection, Option<ThinFilm>, Body>,
}

impl GlossyBsdf {
    /// A gloss over a body.
    pub fn new(gloss: Gloss, body: Body) -> Self {
        Self::like(None, gloss, body)
    }

    /// The same as [`Self::new`], but tables of `other` are reused if it has the same interface.
    pub(crate) fn like(other: Option<&Self>, gloss: Gloss, body: Body) -> Self {
        let Gloss { ior, tint, microfacets, film } = gloss;
        let ior = if ior < 1.0 { 1.0 / ior } else { ior };
        if let Some(Self { lobe }) = other
            && (lobe.ior, lobe.own.tint, lobe.microfacets) == (ior, tint, microfacets)
            && lobe.film == film
        {
            return Self { lobe: GlossLobe { own: GlossColors { body, ..lobe.own }, ..*lobe } };
        }
        let albedo = match other {
            None => DielectricReflection::new(microfacets, ior),
            Some(Self { lobe }) => lobe.albedo.again(microfacets, ior),
        };
        let own = GlossColors { body, tint, passed_average: SampledSpectrum::ZERO };
        let lobe = GlossLobe { ior, microfacets, film, albedo, mean: albedo.average(), own };
        Self { lobe: GlossLobe { own: lobe.colors(body, tint), ..lobe } }
    }

    /// True if the gloss depends on tangents; see [`Microfacets::has_tangent`].
    pub(crate) fn has_tangent(&self) -> bool {
        self.lobe.microfacets.has_tangent()
    }

    /// The distribution of facets.
    pub(super) fn microfacets(&self) -> Microfacets {
        self.lobe.microfacets
    }

    /// The albedo of the gloss at another roughness, without the tint.
    pub(super) fn albedo_at(&self, microfacets: Microfacets) -> DielectricReflection {
        self.lobe.albedo.again(microfacets, self.lobe.ior)
    }

    /// The spectra of the surface by their role in [`BatchGloss`].
    pub(super) fn spectra(&self) -> LobeSpectra {
        let GlossColors { body, tint, .. } = &self.lobe.own;
        let base = body.diffuse.directional_albedo(1.0);
        LobeSpectra { base, specular: *tint, ..LobeSpectra::default() }
    }

    /// `f |cos(wi)|` of transmission by the body, for a direction lifted above.
    fn through_value(&self, seen: &GlossySeen, wi: Vec3) -> SampledSpectrum {
        let colors = &self.lobe.own;
        let (Body { through, walk, .. }, cos) = (&colors.body, wi.z * FRAC_1_PI);
        let mut value = SampledSpectrum::ZERO;
        if !through.is_black() {
            value += *through * self.lobe.coupling(colors, seen, wi, colors.passed_average) * cos;
        }
        if !walk.is_black() {
            value += *walk * seen.passed * cos;
        }
        value
    }

    /// `f |cos(wi)|` where light of the medium inside, gathered along `wo`, comes out: `wi` is
    /// outside and above, for a share of 1.
    pub(super) fn exit_value(&self, wi: Vec3) -> SampledSpectrum {
        let colors = &self.lobe.own;
        self.lobe.passed(colors, wi).zip(colors.passed_average, over_mean) * (wi.z * FRAC_1_PI)
    }
}

impl Lobes for GlossyBsdf {
    type Seen = GlossySeen;

    fn seen(&self, wo: Vec3) -> GlossySeen {
        self.lobe.seen(&self.lobe.own, wo)
    }

    fn value_and_pdf_from(&self, seen: &GlossySeen, wi: Vec3) -> (SampledSpectrum, f32) {
        if seen.wo.z * wi.z >= 0.0 {
            return self.lobe.value_and_pdf_from(&self.lobe.own, seen, wi);
        }
        let ([.., through], wi) = (seen.choice.probabilities, lift(wi));
        (self.through_value(seen, wi), through * sampling::cosine_hemisphere_pdf(wi.z))
    }

    fn draw_from(&self, seen: &GlossySeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let wo = seen.wo;
        if seen.choice.pick(u_lobe)?.0 < 2 {
            return self.lobe.draw_from(&self.lobe.own, seen, u_lobe, u).drawn();
        }
        let up = sampling::cosine_hemisphere(u);
        let wi = lower_like(Vec3::new(up.x, up.y, -up.z), wo);
        (wo.z != 0.0).then_some(Drawn::Direction { wi, is_transmission: true })
    }

    fn albedo_from(&self, seen: &GlossySeen) -> SampledSpectrum {
        let Body { through, walk, .. } = &self.lobe.own.body;
        seen.gloss + (seen.body + *through + *walk) * seen.passed
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        match wo.z * wi.z > 0.0 {
            true => self.lobe.body_value(&self.lobe.own, &self.seen(wo), lift(wi)),
            false => SampledSpectrum::ZERO,
        }
    }

    fn is_delta(&self) -> bool {
        let body = &self.lobe.own.body;
        self.lobe.microfacets.is_smooth() && body.diffuse.is_black() && body.is_opaque()
    }

    fn is_opaque(&self) -> bool {
        self.lobe.own.body.is_opaque()
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        // The mirror reflection of smooth layers is left to the branch.
        let GlossColors { body, tint, .. } = &self.lobe.own;
        let e = self.lobe.gloss_albedo(*tint, lift(wo));
        let base = body.diffuse.directional_albedo(wo.z.abs()) * (SampledSpectrum::ONE - e);
        if self.lobe.microfacets.is_smooth() { base } else { base + e }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        let mirror = || mirror_branch(wo, self.lobe.fresnel(self.lobe.own.tint, wo.z.abs()));
        let mirror = self.lobe.microfacets.is_smooth().then(mirror);
        [mirror.filter(|branch| !branch.weight.is_black()), None]
    }
}

/// A gloss of [`super::Ggx`] without a film, smooth or rough, over a Lambertian body, for batches
/// of directions.
pub(super) type BatchGloss<M, N = Line> =
    GlossLobe<M, DielectricReflectionBy<N>, NoFilm, Lambertian>;

impl<M: KnownFacets> BatchGloss<M> {
    /// The lobe of a gloss with such facets; `None` for other ones.
    pub fn of(bsdf: &GlossyBsdf) -> Option<Self> {
        let GlossLobe { ior, microfacets, film, albedo, mean, own } = &bsdf.lobe;
        let microfacets = M::of(*microfacets)?;
        let is_matte = own.body.diffuse.is_lambertian() && bsdf.is_opaque();
        let body = Lambertian(own.body.diffuse.directional_albedo(1.0));
        let own = GlossColors { body, tint: own.tint, passed_average: own.passed_average };
        let (ior, albedo, mean) = (*ior, albedo.line(), *mean);
        (is_matte && film.is_none()).then_some(Self {
            ior,
            microfacets,
            film: NoFilm,
            albedo,
            mean,
            own,
        })
    }

    /// Reflectance of the body where it is the same everywhere.
    pub fn body(&self) -> SampledSpectrum {
        self.own.body.0
    }
}

impl BatchGloss<Rough> {
    /// Index of refraction.
    #[inline(always)]
    pub fn ior(&self) -> f32 {
        self.ior
    }

    /// The same gloss with another roughness: with the reflection of that roughness and its mean
    /// albedo, without the tint.
    #[inline(always)]
    pub fn with<N: Nodes>(
        &self,
        albedo: DielectricReflectionBy<N>,
        mean: f32,
    ) -> BatchGloss<Rough, N> {
        let microfacets = Rough::from(albedo.widths);
        let lobe =
            GlossLobe { ior: self.ior, microfacets, film: NoFilm, albedo, mean, own: self.own };
        GlossLobe { own: lobe.colors(self.own.body, self.own.tint), ..lobe }
    }
}

impl<M: Facets, N: Nodes> BatchLobes for BatchGloss<M, N> {
    #[inline(always)]
    fn own_colors(&self, body: SampledSpectrum) -> GlossColors<Lambertian> {
        GlossColors { body: Lambertian(body), ..self.own }
    }

    #[inline(always)]
    fn colors_of(&self, spectra: &LobeSpectra) -> GlossColors<Lambertian> {
        self.colors(Lambertian(spectra.base), spectra.specular)
    }
}
