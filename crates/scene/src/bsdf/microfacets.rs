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
