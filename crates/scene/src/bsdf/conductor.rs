//! Metals: reflection by microfacets of a conductor.

use super::batch::{BatchLobes, LobeSpectra};
use super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::energy::{BouncedLobe, Directional, FacetLoss, FacetLossBy, Line, Nodes};
use super::film::{NoFilm, ThinFilm};
use super::microfacets::{Facets, KnownFacets, Rough};
use super::mirror::mirror_branch;
use super::{Choice, Drawn, Lobes, Microfacets, SpecularBranch, Widths, fresnel, lift, lower_like};
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3, real};
use std::f32::consts::FRAC_1_PI;

/// Reflectance of a facet.
#[derive(Clone, Copy, Debug)]
pub enum FacetReflectance {
    /// Fresnel's law for a complex index of refraction.
    Complex(ComplexIor),
    /// Schlick's approximation with a factor at the edge.
    F82(F82),
}

/// Complex index of refraction `eta + i k` relative to the outside.
#[derive(Clone, Copy, Debug)]
pub struct ComplexIor {
    /// Real part.
    pub eta: SampledSpectrum,
    /// Imaginary part (absorption).
    pub k: SampledSpectrum,
}

/// Schlick's approximation between this reflectance at normal and white at grazing incidence, less
/// a dip (Kutz, Hasan and Edmondson, Novel aspects of the Adobe Standard Material, 2021): times
/// `edge` at about 82 degrees.
#[derive(Clone, Copy, Debug)]
pub struct F82 {
    /// Reflectance at normal incidence.
    pub f0: SampledSpectrum,
    /// Factor on Schlick's reflectance at the edge, `[0, 1]`.
    pub edge: SampledSpectrum,
}

impl From<ComplexIor> for FacetReflectance {
    #[inline(always)]
    fn from(ior: ComplexIor) -> Self {
        Self::Complex(ior)
    }
}

impl From<F82> for FacetReflectance {
    #[inline(always)]
    fn from(f82: F82) -> Self {
        Self::F82(f82)
    }
}

/// Cosine of the angle of [`F82`], and the height of the dip's shape `mu (1 - mu)^6` there.
const EDGE: f32 = 1.0 / 7.0;
const DIP: f32 =
    EDGE * (6.0 / 7.0) * (6.0 / 7.0) * (6.0 / 7.0) * (6.0 / 7.0) * (6.0 / 7.0) * (6.0 / 7.0);

impl F82 {
    /// Factor of the dip.
    #[inline(always)]
    fn dip(&self) -> SampledSpectrum {
        fresnel::schlick(EDGE, self.f0, SampledSpectrum::ONE)
            * (SampledSpectrum::ONE - self.edge)
            * (1.0 / DIP)
    }
}

impl FacetReflectance {
    /// The spectra of a metal with this factor on all it reflects.
    pub(crate) fn spectra(&self, unit: SampledSpectrum) -> LobeSpectra {
        let (base, specular) = match *self {
            Self::Complex(ComplexIor { eta, k }) => (eta, k),
            Self::F82(F82 { f0, edge }) => (f0, edge),
        };
        LobeSpectra { base, specular, other: unit }
    }

    /// Reflectance of a facet that is seen at this cosine.
    #[inline(always)]
    fn at(&self, cos: f32) -> SampledSpectrum {
        match self {
            Self::Complex(ComplexIor { eta, k }) => {
                eta.zip(*k, |eta, k| fresnel::conductor(cos, eta, k))
            }
            Self::F82(f82) => {
                let schlick = fresnel::schlick(cos, f82.f0, SampledSpectrum::ONE);
                let rest = (1.0 - cos).clamp(0.0, 1.0);
                (schlick - f82.dip() * (cos * real::powi(rest, 6))).clamp(0.0, 1.0)
            }
        }
    }

    /// The mean of the reflectance over directions weighted by the cosine.
    #[inline(always)]
    fn average(&self) -> SampledSpectrum {
        // Gauss's points for the weight `2 mu` on [0, 1].
        const POINTS: [(f32, f32); 3] = [
            (0.212_340_54, 0.139_653_96),
            (0.590_533_14, 0.458_482_21),
            (0.911_412_04, 0.401_863_83),
        ];
        match self {
            Self::Complex(_) => {
                let [a, b, c] = POINTS.map(|(mu, weight)| self.at(mu) * weight);
                a + b + c
            }
            // 2 int (1 - mu)^5 mu dmu = 1 / 21, and 2 int mu (1 - mu)^6 mu dmu = 1 / 126.
            Self::F82(f82) => (f82.f0.lerp(SampledSpectrum::ONE, 1.0 / 21.0)
                - f82.dip() * (1.0 / 126.0))
                .clamp(0.0, 1.0),
        }
    }
}

/// Facets of a metal with this law of reflection and this distribution, and a diffuse lobe for the
/// light that bounces between facets, so that a white metal loses nothing at any roughness (Kulla
/// and Conty, Revisiting Physically Based Shading at Imageworks, SIGGRAPH 2017 course).
#[derive(Clone, Copy, Debug)]
pub(super) struct ConductorLobe<R, F, M, L> {
    film: F,
    microfacets: M,
    /// Share of light lost by single facets.
    loss: L,
    /// Loss of diffuse light.
    mean_loss: f32,
    bounced_lobe: BouncedLobe,
    /// The spectra where they are the same everywhere.
    own: ConductorColors<R>,
}

/// The spectra of a metal.
#[derive(Clone, Copy, Debug)]
pub(super) struct ConductorColors<R> {
    facets: R,
    /// Factor on all that is reflected: at most 1 in every lane in use, 0 elsewhere.
    unit: SampledSpectrum,
    /// The share left of light that bounces off several facets, over the mean loss.
    bounced: SampledSpectrum,
}

/// A metal seen from a direction.
#[derive(Clone, Debug)]
pub struct ConductorSeen {
    wo: Vec3,
    /// Share of light lost by single facets.
    lost: f32,
    /// Albedos of single and of multiple bounces.
    albedos: [SampledSpectrum; 2],
    choice: Choice<2>,
}

impl<R: Into<FacetReflectance> + Copy> ConductorColors<R> {
    #[inline(always)]
    fn new(facets: R, unit: SampledSpectrum, mean_loss: f32) -> Self {
        // Each further bounce reflects the mean reflectance, and loses `mean_loss` to the next.
        let (f, lost) = (facets.into().average(), mean_loss);
        let bounced =
            f * f * (1.0 - lost) / (SampledSpectrum::ONE - f * lost) * unit * (1.0 / lost);
        Self { facets, unit, bounced: bounced.map(|x| if lost > 0.0 { x } else { 0.0 }) }
    }
}

impl<R, F, M, L> ConductorLobe<R, F, M, L>
where
    R: Into<FacetReflectance> + Copy,
    F: Into<Option<ThinFilm>> + Copy,
{
    /// Reflectance of a facet that is seen at this cosine.
    #[inline(always)]
    fn reflectance(&self, colors: &ConductorColors<R>, cos: f32) -> SampledSpectrum {
        let (facets, film): (FacetReflectance, Option<ThinFilm>) =
            (colors.facets.into(), self.film.into());
        let plain = facets.at(cos);
        // `Option::map_or` would stay a call, and loops over batches would not become vector code.
        let reflectance = match film {
            None => plain,
            Some(film) => film.reflectance(cos, facets.at(1.0), plain),
        };
        colors.unit * reflectance
    }
}

impl<R, F, M: Facets, L: Directional> BranchlessLobes for ConductorLobe<R, F, M, L>
where
    R: Into<FacetReflectance> + Copy,
    F: Into<Option<ThinFilm>> + Copy,
{
    type Seen = ConductorSeen;
    type Colors = ConductorColors<R>;

    #[inline(always)]
    fn seen(&self, colors: &ConductorColors<R>, wo: Vec3) -> ConductorSeen {
        let up = lift(wo);
        let (reflectance, lost) = (self.reflectance(colors, up.z), self.loss.towards(up));
        let albedos = [reflectance * (1.0 - lost), colors.bounced * self.mean_loss * lost];
        ConductorSeen { wo, lost, albedos, choice: Choice::new(albedos) }
    }

    #[inline(always)]
    fn value_and_pdf_from(
        &self,
        colors: &ConductorColors<R>,
        seen: &ConductorSeen,
        wi: Vec3,
    ) -> (SampledSpectrum, f32) {
        let is_seen = seen.wo.z * wi.z > 0.0;
        let (wo, wi) = (lift(seen.wo), lift(wi));
        let [facets, diffuse] = seen.choice.probabilities;
        let (m, value, pdf, exists) = self.microfacets.get().reflected(wo, wi);
        let once =
            (self.reflectance(colors, wo.dot(m)) * value).map(|x| if exists { x } else { 0.0 });
        let value = once + colors.bounced * (seen.lost * self.loss.towards(wi) * wi.z * FRAC_1_PI);
        let pdf = facets * if exists { pdf } else { 0.0 } + diffuse * self.bounced_lobe.pdf(wi.z);
        (value.map(|x| if is_seen { x } else { 0.0 }), if is_seen { pdf } else { 0.0 })
    }

    #[inline(always)]
    fn draw_from(
        &self,
        _colors: &ConductorColors<R>,
        seen: &ConductorSeen,
        u_lobe: f32,
        u: Vec2,
    ) -> BranchlessDrawn {
        let wo = seen.wo;
        let (is_once, exists) = seen.choice.picks_first(u_lobe);
        let (facet, is_above) = if M::IS_KNOWN || is_once {
            self.microfacets.get().drawn_reflection(lift(wo), u)
        } else {
            (Vec3::Z, true)
        };
        let wi = lower_like(select(is_once, facet, self.bounced_lobe.sample(u)), wo);
        let exists = exists & (is_above | !is_once) & (wo.z != 0.0);
        BranchlessDrawn::reflected(wi, exists, None)
    }

    #[inline(always)]
    fn albedo_from(&self, _colors: &ConductorColors<R>, seen: &ConductorSeen) -> SampledSpectrum {
        let [facets, bounced] = seen.albedos;
        facets + bounced
    }
}

/// A metal: a [`ConductorLobe`] if it is rough, a mirror if it is smooth. Make it with
/// [`ConductorBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct ConductorBsdf {
    lobe: ConductorLobe<FacetReflectance, Option<ThinFilm>, Microfacets, FacetLoss>,
}

impl ConductorBsdf {
    /// A metal of this law of reflection and roughness; smooth ones are mirrors. `unit` is a factor
    /// on all it reflects, at most 1 in every lane in use and 0 elsewhere.
    pub fn new(
        facets: FacetReflectance,
        unit: SampledSpectrum,
        microfacets: impl Into<Microfacets>,
    ) -> Self {
        let microfacets = microfacets.into();
        let (loss, bounced_lobe) =
            (FacetLoss::new(microfacets), BouncedLobe::new(microfacets.widths()));
        let mean_loss = loss.average();
        let own = ConductorColors::new(facets, unit, mean_loss);
        Self { lobe: ConductorLobe { film: None, microfacets, loss, mean_loss, bounced_lobe, own } }
    }

    /// The same metal under a film.
    pub fn with_film(mut self, film: Option<ThinFilm>) -> Self {
        self.lobe.film = film;
        self
    }

    /// True if the metal depends on tangents; see [`Microfacets::has_tangent`].
    pub(crate) fn has_tangent(&self) -> bool {
        self.lobe.microfacets.has_tangent()
    }

    /// The spectra of the metal by their role in [`BatchMetal`].
    pub(super) fn spectra(&self) -> LobeSpectra {
        let ConductorColors { facets, unit, .. } = self.lobe.own;
        facets.spectra(unit)
    }

    fn mirror(&self, wo: Vec3) -> SpecularBranch {
        mirror_branch(wo, self.lobe.reflectance(&self.lobe.own, wo.z.abs()))
    }
}

impl Lobes for ConductorBsdf {
    type Seen = ConductorSeen;

    fn seen(&self, wo: Vec3) -> ConductorSeen {
        self.lobe.seen(&self.lobe.own, wo)
    }

    fn value_and_pdf_from(&self, seen: &ConductorSeen, wi: Vec3) -> (SampledSpectrum, f32) {
        if self.is_delta() || seen.wo.z * wi.z <= 0.0 {
            return (SampledSpectrum::ZERO, 0.0);
        }
        self.lobe.value_and_pdf_from(&self.lobe.own, seen, wi)
    }

    fn draw_from(&self, seen: &ConductorSeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        if self.is_delta() {
            return (seen.wo.z != 0.0).then(|| self.mirror(seen.wo).drawn(1.0));
        }
        self.lobe.draw_from(&self.lobe.own, seen, u_lobe, u).drawn()
    }

    fn albedo_from(&self, seen: &ConductorSeen) -> SampledSpectrum {
        self.lobe.albedo_from(&self.lobe.own, seen)
    }

    fn is_delta(&self) -> bool {
        self.lobe.microfacets.is_smooth()
    }

    fn is_opaque(&self) -> bool {
        true
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        // The reflection of a mirror is left to its branch.
        if self.is_delta() { SampledSpectrum::ZERO } else { self.albedo(wo) }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        [self.is_delta().then(|| self.mirror(wo)), None]
    }
}

/// A rough metal of [`super::Ggx`] without a film, for batches of directions.
pub(super) type BatchMetal<R, N = Line> = ConductorLobe<R, NoFilm, Rough, FacetLossBy<N>>;

/// A law of reflection that is known at compile time.
pub(super) trait BatchLaw: Into<FacetReflectance> + Copy {
    /// The law if it is this one.
    fn of(facets: FacetReflectance) -> Option<Self>;

    /// The law with the spectra of a lane.
    fn with_spectra(spectra: &LobeSpectra) -> Self;
}

impl BatchLaw for ComplexIor {
    fn of(facets: FacetReflectance) -> Option<Self> {
        if let FacetReflectance::Complex(law) = facets { Some(law) } else { None }
    }

    #[inline(always)]
    fn with_spectra(&LobeSpectra { base: eta, specular: k, .. }: &LobeSpectra) -> Self {
        Self { eta, k }
    }
}

impl BatchLaw for F82 {
    fn of(facets: FacetReflectance) -> Option<Self> {
        if let FacetReflectance::F82(law) = facets { Some(law) } else { None }
    }

    #[inline(always)]
    fn with_spectra(&LobeSpectra { base: f0, specular: edge, .. }: &LobeSpectra) -> Self {
        Self { f0, edge }
    }
}

impl<R: BatchLaw> BatchMetal<R> {
    /// The lobe of a metal that has this law; `None` for other metals.
    pub fn of(bsdf: &ConductorBsdf) -> Option<Self> {
        let ConductorLobe { film, microfacets, loss, mean_loss, bounced_lobe, own } = &bsdf.lobe;
        if film.is_some() {
            return None;
        }
        let (microfacets, facets) = (Rough::of(*microfacets)?, R::of(own.facets)?);
        let own = ConductorColors::new(facets, own.unit, *mean_loss);
        let (mean_loss, bounced_lobe) = (*mean_loss, *bounced_lobe);
        Some(Self { film: NoFilm, microfacets, loss: loss.line(), mean_loss, bounced_lobe, own })
    }
}

impl BatchMetal<F82> {
    /// The same metal with another roughness and the loss of that roughness. The spectra must be
    /// computed anew.
    #[inline(always)]
    pub fn with<N>(
        &self,
        loss: FacetLossBy<N>,
        bounced_lobe: BouncedLobe,
        mean_loss: f32,
    ) -> BatchMetal<F82, N> {
        let microfacets = Rough::from(loss.widths);
        ConductorLobe { film: NoFilm, microfacets, loss, mean_loss, bounced_lobe, own: self.own }
    }

    /// Width of the facet distribution.
    pub fn widths(&self) -> Widths {
        self.microfacets.get().widths()
    }
}

impl<N> BatchMetal<F82, N> {
    /// The spectra of this metal, with another reflectance at normal incidence.
    #[inline(always)]
    pub fn spectra(&self, f0: SampledSpectrum) -> LobeSpectra {
        LobeSpectra { base: f0, specular: self.own.facets.edge, other: self.own.unit }
    }
}

impl<R: BatchLaw, N: Nodes> BatchLobes for BatchMetal<R, N> {
    #[inline(always)]
    fn own_colors(&self, _body: SampledSpectrum) -> ConductorColors<R> {
        self.own
    }

    #[inline(always)]
    fn colors_of(&self, spectra: &LobeSpectra) -> ConductorColors<R> {
        ConductorColors::new(R::with_spectra(spectra), spectra.other, self.mean_loss)
    }
}
