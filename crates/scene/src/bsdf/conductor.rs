//! Metals: reflection by microfacets of a conductor.

mod batch;

pub(super) use batch::BatchMetal;

use super::batch::LobeSpectra;
use super::energy::{BouncedLobe, FacetLoss};
use super::film::ThinFilm;
use super::mirror::mirror_branch;
use super::{Choice, Drawn, Lobes, Microfacets, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{SampledSpectrum, Vec2, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Reflectance of a facet.
#[derive(Clone, Copy, Debug)]
pub enum FacetReflectance {
    /// Complex index of refraction `eta + i k` relative to the outside.
    Complex {
        /// Real part.
        eta: SampledSpectrum,
        /// Imaginary part (absorption).
        k: SampledSpectrum,
    },
    /// Schlick's approximation between this reflectance at normal and white at grazing incidence,
    /// less a dip (Kutz, Hasan and Edmondson, Novel aspects of the Adobe Standard Material, 2021):
    /// times `edge` at about 82 degrees.
    F82 {
        /// Reflectance at normal incidence.
        f0: SampledSpectrum,
        /// Factor on Schlick's reflectance at the edge, `[0, 1]`.
        edge: SampledSpectrum,
    },
}

/// Cosine of the angle of [`FacetReflectance::F82`], and the height of the dip's shape
/// `mu (1 - mu)^6` there.
const EDGE: f32 = 1.0 / 7.0;
const DIP: f32 =
    EDGE * (6.0 / 7.0) * (6.0 / 7.0) * (6.0 / 7.0) * (6.0 / 7.0) * (6.0 / 7.0) * (6.0 / 7.0);

/// [`FacetReflectance::Complex`] at this cosine.
#[inline(always)]
fn complex(cos: f32, eta: SampledSpectrum, k: SampledSpectrum) -> SampledSpectrum {
    eta.zip(k, |eta, k| fresnel::conductor(cos, eta, k))
}

/// The mean of [`complex`] over directions weighted by the cosine.
#[inline(always)]
fn complex_average(eta: SampledSpectrum, k: SampledSpectrum) -> SampledSpectrum {
    // Gauss's points for the weight `2 mu` on [0, 1].
    const POINTS: [(f32, f32); 3] =
        [(0.212_340_54, 0.139_653_96), (0.590_533_14, 0.458_482_21), (0.911_412_04, 0.401_863_83)];
    let [a, b, c] = POINTS.map(|(mu, weight)| complex(mu, eta, k) * weight);
    a + b + c
}

/// [`FacetReflectance::F82`] at this cosine.
#[inline(always)]
fn f82(cos: f32, f0: SampledSpectrum, edge: SampledSpectrum) -> SampledSpectrum {
    let schlick = fresnel::schlick(cos, f0, SampledSpectrum::ONE);
    let rest = (1.0 - cos).clamp(0.0, 1.0);
    (schlick - dip(f0, edge) * (cos * rest.powi(6))).clamp(0.0, 1.0)
}

/// The mean of [`f82`] over directions weighted by the cosine.
#[inline(always)]
fn f82_average(f0: SampledSpectrum, edge: SampledSpectrum) -> SampledSpectrum {
    // 2 int (1 - mu)^5 mu dmu = 1 / 21, and 2 int mu (1 - mu)^6 mu dmu = 1 / 126.
    (f0.lerp(SampledSpectrum::ONE, 1.0 / 21.0) - dip(f0, edge) * (1.0 / 126.0)).clamp(0.0, 1.0)
}

/// The share left of light that bounces off several facets of this mean reflectance, over the mean
/// loss.
#[inline(always)]
fn bounced(f: SampledSpectrum, unit: SampledSpectrum, lost: f32) -> SampledSpectrum {
    // Each further bounce reflects the mean reflectance, and loses `lost` to the next.
    let bounced = f * f * (1.0 - lost) / (SampledSpectrum::ONE - f * lost) * unit * (1.0 / lost);
    bounced.map(|x| if lost > 0.0 { x } else { 0.0 })
}

/// Factor of the dip.
#[inline(always)]
fn dip(f0: SampledSpectrum, edge: SampledSpectrum) -> SampledSpectrum {
    fresnel::schlick(EDGE, f0, SampledSpectrum::ONE) * (SampledSpectrum::ONE - edge) * (1.0 / DIP)
}

impl FacetReflectance {
    fn at(&self, cos: f32) -> SampledSpectrum {
        match *self {
            Self::Complex { eta, k } => complex(cos, eta, k),
            Self::F82 { f0, edge } => f82(cos, f0, edge),
        }
    }

    /// The mean over directions weighted by the cosine.
    fn average(&self) -> SampledSpectrum {
        match *self {
            Self::F82 { f0, edge } => f82_average(f0, edge),
            Self::Complex { eta, k } => complex_average(eta, k),
        }
    }
}

/// A metal. A diffuse lobe adds the light that bounces between facets, so that a white metal loses
/// nothing at any roughness (Kulla and Conty, Revisiting Physically Based Shading at Imageworks,
/// SIGGRAPH 2017 course). Make it with [`ConductorBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct ConductorBsdf {
    facets: FacetReflectance,
    /// At most 1 in every lane in use, 0 elsewhere.
    unit: SampledSpectrum,
    microfacets: Microfacets,
    loss: FacetLoss,
    lobe: BouncedLobe,
    /// Loss of diffuse light.
    mean_loss: f32,
    film: Option<ThinFilm>,
    /// Reflectance at normal incidence, for the film.
    f0: SampledSpectrum,
    /// The share left of light that bounces off several facets, over the mean loss.
    bounced: SampledSpectrum,
}

/// A metal seen from a direction.
#[derive(Clone, Debug)]
pub struct ConductorSeen {
    wo: Vec3,
    /// Reflectance of a facet along the surface.
    reflectance: SampledSpectrum,
    /// Share of light lost by single facets.
    lost: f32,
    /// Albedos of single and of multiple bounces.
    albedos: [SampledSpectrum; 2],
    choice: Choice<2>,
}

impl ConductorBsdf {
    /// As [`Microfacets::has_tangent`].
    pub(crate) fn has_tangent(&self) -> bool {
        self.microfacets.has_tangent()
    }

    /// A metal of this law of reflection and roughness; smooth ones are mirrors. `unit` is a factor
    /// on all it reflects, at most 1 in every lane in use and 0 elsewhere.
    pub fn new(
        facets: FacetReflectance,
        unit: SampledSpectrum,
        microfacets: impl Into<Microfacets>,
    ) -> Self {
        let microfacets = microfacets.into();
        let loss = FacetLoss::new(microfacets);
        let lost = loss.average();
        let bounced = bounced(facets.average(), unit, lost);
        let (lobe, f0) = (BouncedLobe::new(microfacets.widths()), facets.at(1.0));
        Self { facets, unit, microfacets, loss, lobe, mean_loss: lost, film: None, f0, bounced }
    }

    /// Its spectra, as [`BatchMetal`] needs them.
    pub(super) fn spectra(&self) -> LobeSpectra {
        let (base, specular) = match self.facets {
            FacetReflectance::Complex { eta, k } => (eta, k),
            FacetReflectance::F82 { f0, edge } => (f0, edge),
        };
        LobeSpectra { base, specular, other: self.unit }
    }

    /// The same metal under a film.
    pub fn with_film(self, film: Option<ThinFilm>) -> Self {
        Self { film, ..self }
    }

    fn reflectance(&self, cos: f32) -> SampledSpectrum {
        let plain = self.facets.at(cos);
        self.unit * self.film.map_or(plain, |film| film.reflectance(cos, self.f0, plain))
    }
}

impl Lobes for ConductorBsdf {
    type Seen = ConductorSeen;

    fn seen(&self, wo: Vec3) -> ConductorSeen {
        let up = lift(wo);
        let (reflectance, lost) = (self.reflectance(up.z), self.loss.towards(up));
        let albedos = [reflectance * (1.0 - lost), self.bounced * self.mean_loss * lost];
        ConductorSeen { wo, reflectance, lost, albedos, choice: Choice::new(albedos) }
    }

    fn value_and_pdf_from(&self, seen: &ConductorSeen, wi: Vec3) -> (SampledSpectrum, f32) {
        if seen.wo.z * wi.z <= 0.0 || self.microfacets.is_smooth() {
            return (SampledSpectrum::ZERO, 0.0);
        }
        let (wo, wi) = (lift(seen.wo), lift(wi));
        let [facets, diffuse] = seen.choice.probabilities;
        let (once, pdf) = match self.microfacets.reflection_and_pdf(wo, wi) {
            Some((m, value, pdf)) => (self.reflectance(wo.dot(m)) * value, pdf),
            None => (SampledSpectrum::ZERO, 0.0),
        };
        let value = once + self.bounced * (seen.lost * self.loss.towards(wi) * wi.z * FRAC_1_PI);
        (value, facets * pdf + diffuse * self.lobe.pdf(wi.z))
    }

    fn draw_from(&self, seen: &ConductorSeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let wo = seen.wo;
        if wo.z == 0.0 {
            return None;
        }
        if self.microfacets.is_smooth() {
            return Some(mirror_branch(wo, seen.reflectance).drawn(1.0));
        }
        let wi = match seen.choice.pick(u_lobe)? {
            (0, _) => self.microfacets.sample_reflection(lift(wo), u)?,
            _ => self.lobe.sample(u),
        };
        Some(Drawn::Direction { wi: lower_like(wi, wo), is_transmission: false })
    }

    fn is_delta(&self) -> bool {
        self.microfacets.is_smooth()
    }

    fn is_opaque(&self) -> bool {
        true
    }

    fn albedo_from(&self, seen: &ConductorSeen) -> SampledSpectrum {
        let [facets, bounced] = seen.albedos;
        facets + bounced
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        // The reflection of a mirror is left to its branch.
        if self.is_delta() { SampledSpectrum::ZERO } else { self.albedo(wo) }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        [self.is_delta().then(|| mirror_branch(wo, self.reflectance(wo.z.abs()))), None]
    }
}
