//! Distributions of microfacets of which one is chosen at run time.

use super::{Beckmann, Ggx, Widths};
use serde::{Deserialize, Serialize};
use snell_math::{Vec2, Vec3};

snell_math::declare! {
    /// Shape of a distribution of microfacets.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub enum MicrofacetShape {
        /// [`Ggx`], whose highlights have long tails, like those of measured surfaces.
        "ggx" => #[default] Ggx,
        /// [`Beckmann`], whose highlights have short tails.
        "beckmann" => Beckmann,
    }
}

impl MicrofacetShape {
    /// The distribution of this shape and a [perceptual roughness](Widths::from_roughness).
    pub fn of_roughness(self, roughness: f32) -> Microfacets {
        self.of_widths(Widths::from_roughness(roughness))
    }

    /// The distribution of this shape and these widths.
    pub fn of_widths(self, widths: Widths) -> Microfacets {
        match self {
            Self::Ggx => Microfacets::Ggx(widths.into()),
            Self::Beckmann => Microfacets::Beckmann(widths.into()),
        }
    }
}

/// A distribution of microfacets; [`Ggx`] documents the methods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Microfacets {
    /// The distribution [`Ggx`].
    Ggx(Ggx),
    /// The distribution [`Beckmann`].
    Beckmann(Beckmann),
}

impl From<Ggx> for Microfacets {
    fn from(ggx: Ggx) -> Self {
        Self::Ggx(ggx)
    }
}

/// Evaluates an expression for whichever distribution a value holds.
macro_rules! ask {
    ($microfacets:expr, $known:ident => $answer:expr) => {
        match $microfacets {
            Microfacets::Ggx($known) => $answer,
            Microfacets::Beckmann($known) => $answer,
        }
    };
}

/// What a [lobe without branches](super::branchless) asks of a distribution.
pub(super) trait FacetDistribution: Copy {
    /// The widths.
    fn widths(self) -> Widths;

    /// As [`Widths::is_smooth`].
    #[inline(always)]
    fn is_smooth(self) -> bool {
        self.widths().is_smooth()
    }

    /// As [`Ggx::reflected`].
    fn reflected(self, wo: Vec3, wi: Vec3) -> (Vec3, f32, f32, bool);

    /// As [`Ggx::drawn_reflection`].
    fn drawn_reflection(self, wo: Vec3, u: Vec2) -> (Vec3, bool);
}

/// What a lobe without branches that also refracts asks of the distribution of a rough surface.
pub(super) trait RefractingFacets: FacetDistribution {
    /// As [`Ggx::density`].
    fn density(self, m: Vec3) -> f32;

    /// As [`Ggx::visibility`].
    fn visibility(self, wo: Vec3, wi: Vec3) -> f32;

    /// As [`Ggx::visible_area`].
    fn visible_area(self, wo: Vec3) -> f32;

    /// As [`Ggx::visible_normal`].
    fn visible_normal(self, wo: Vec3, u: Vec2) -> Vec3;
}

impl RefractingFacets for Rough {
    #[inline(always)]
    fn density(self, m: Vec3) -> f32 {
        self.0.density(m)
    }

    #[inline(always)]
    fn visibility(self, wo: Vec3, wi: Vec3) -> f32 {
        self.0.visibility(wo, wi)
    }

    #[inline(always)]
    fn visible_area(self, wo: Vec3) -> f32 {
        self.0.visible_area(wo)
    }

    #[inline(always)]
    fn visible_normal(self, wo: Vec3, u: Vec2) -> Vec3 {
        self.0.visible_normal(wo, u)
    }
}

impl RefractingFacets for Microfacets {
    fn density(self, m: Vec3) -> f32 {
        ask!(self, known => known.density(m))
    }

    fn visibility(self, wo: Vec3, wi: Vec3) -> f32 {
        ask!(self, known => known.visibility(wo, wi))
    }

    fn visible_area(self, wo: Vec3) -> f32 {
        ask!(self, known => known.visible_area(wo))
    }

    fn visible_normal(self, wo: Vec3, u: Vec2) -> Vec3 {
        self.sample_visible_normal(wo, u)
    }
}

/// [`Ggx`] of a surface that is known to be rough when the program is compiled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rough(Ggx);

impl From<Widths> for Rough {
    #[inline(always)]
    fn from(widths: Widths) -> Self {
        Self(widths.into())
    }
}

/// A surface that is known to be smooth when the program is compiled: it has no facets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Smooth;

/// Distributions of which the compiler knows whether the surface is rough.
pub(super) trait KnownFacets: FacetDistribution {
    /// `None` for other distributions.
    fn of(microfacets: Microfacets) -> Option<Self>;
}

impl KnownFacets for Rough {
    fn of(microfacets: Microfacets) -> Option<Self> {
        microfacets.ggx().filter(|ggx| !ggx.is_smooth()).map(Self)
    }
}

impl KnownFacets for Smooth {
    fn of(microfacets: Microfacets) -> Option<Self> {
        microfacets.ggx().filter(|ggx| ggx.is_smooth()).map(|_| Self)
    }
}

impl FacetDistribution for Smooth {
    #[inline(always)]
    fn widths(self) -> Widths {
        Widths::both(0.0)
    }

    #[inline(always)]
    fn is_smooth(self) -> bool {
        true
    }

    #[inline(always)]
    fn reflected(self, _wo: Vec3, _wi: Vec3) -> (Vec3, f32, f32, bool) {
        (Vec3::Z, 0.0, 0.0, false)
    }

    #[inline(always)]
    fn drawn_reflection(self, _wo: Vec3, _u: Vec2) -> (Vec3, bool) {
        (Vec3::Z, false)
    }
}

impl FacetDistribution for Rough {
    #[inline(always)]
    fn widths(self) -> Widths {
        self.0.widths()
    }

    #[inline(always)]
    fn is_smooth(self) -> bool {
        false
    }

    #[inline(always)]
    fn reflected(self, wo: Vec3, wi: Vec3) -> (Vec3, f32, f32, bool) {
        self.0.reflected(wo, wi)
    }

    #[inline(always)]
    fn drawn_reflection(self, wo: Vec3, u: Vec2) -> (Vec3, bool) {
        self.0.drawn_reflection(wo, u)
    }
}

impl FacetDistribution for Microfacets {
    #[inline(always)]
    fn widths(self) -> Widths {
        ask!(self, known => known.widths())
    }

    #[inline]
    fn reflected(self, wo: Vec3, wi: Vec3) -> (Vec3, f32, f32, bool) {
        match self {
            Self::Ggx(ggx) => ggx.reflected(wo, wi),
            Self::Beckmann(beckmann) => beckmann
                .reflection_and_pdf(wo, wi)
                .map_or((Vec3::Z, 0.0, 0.0, false), |(m, value, pdf)| (m, value, pdf, true)),
        }
    }

    fn drawn_reflection(self, wo: Vec3, u: Vec2) -> (Vec3, bool) {
        match self {
            Self::Ggx(ggx) => ggx.drawn_reflection(wo, u),
            Self::Beckmann(beckmann) => {
                beckmann.sample_reflection(wo, u).map_or((Vec3::Z, false), |wi| (wi, true))
            }
        }
    }
}

impl Microfacets {
    /// The distribution if it is [`Ggx`].
    pub fn ggx(self) -> Option<Ggx> {
        if let Self::Ggx(ggx) = self { Some(ggx) } else { None }
    }

    /// The shape of the distribution.
    pub fn shape(self) -> MicrofacetShape {
        match self {
            Self::Ggx(_) => MicrofacetShape::Ggx,
            Self::Beckmann(_) => MicrofacetShape::Beckmann,
        }
    }

    /// The widths of the distribution.
    #[inline(always)]
    pub fn widths(self) -> Widths {
        ask!(self, known => known.widths())
    }

    /// True if the distribution depends on tangents; see [`Widths::has_tangent`].
    pub fn has_tangent(self) -> bool {
        self.widths().has_tangent()
    }

    /// True if the surface counts as perfectly smooth; see [`Widths::is_smooth`].
    #[inline(always)]
    pub fn is_smooth(self) -> bool {
        self.widths().is_smooth()
    }

    /// See [`Ggx::shadowing`].
    pub fn shadowing(self, wo: Vec3, wi: Vec3) -> f32 {
        ask!(self, known => known.shadowing(wo, wi))
    }

    /// See [`Ggx::sample_visible_normal`].
    pub fn sample_visible_normal(self, wo: Vec3, u: Vec2) -> Vec3 {
        ask!(self, known => known.sample_visible_normal(wo, u))
    }

    /// See [`Ggx::visible_normal_pdf`].
    pub fn visible_normal_pdf(self, wo: Vec3, m: Vec3) -> f32 {
        ask!(self, known => known.visible_normal_pdf(wo, m))
    }

    /// See [`Ggx::reflection`].
    pub fn reflection(self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
        self.reflection_and_pdf(wo, wi).map(|(m, value, _)| (m, value))
    }

    /// See [`Ggx::reflection_and_pdf`].
    #[inline]
    pub fn reflection_and_pdf(self, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32, f32)> {
        ask!(self, known => known.reflection_and_pdf(wo, wi))
    }

    /// See [`Ggx::sample_reflection`].
    pub fn sample_reflection(self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        ask!(self, known => known.sample_reflection(wo, u))
    }

    /// See [`Ggx::visible_reflection_pdf`].
    pub fn visible_reflection_pdf(self, wo: Vec3, wi: Vec3) -> f32 {
        match self {
            Self::Ggx(ggx) => ggx.visible_reflection_pdf(wo, wi),
            // Beckmann's reflections are sampled at visible normals anyway.
            Self::Beckmann(beckmann) => {
                beckmann.reflection_and_pdf(wo, wi).map_or(0.0, |(.., pdf)| pdf)
            }
        }
    }

    /// See [`Ggx::refraction_flux`].
    pub fn refraction_flux(self, wo: Vec3, wi: Vec3, m: Vec3) -> f32 {
        ask!(self, known => known.refraction_flux(wo, wi, m))
    }
}
