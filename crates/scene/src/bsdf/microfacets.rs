//! Distributions of microfacets of which one is chosen at run time.

use super::{Beckmann, Ggx, Widths};
use serde::{Deserialize, Serialize};
use snell_math::{SampledSpectrum, Vec2, Vec3};

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

/// The facets of a [lobe without branches](super::branchless): any distribution, or one that is
/// known when the program is compiled.
pub(super) trait Facets: Copy {
    /// True if the distribution is known when the program is compiled. Lobes then draw from it even
    /// if another lobe was picked, without branches; else only if needed, as it may be expensive.
    const IS_KNOWN: bool = true;

    /// The distribution.
    fn get(self) -> Microfacets;

    /// True if the surface counts as perfectly smooth; see [`Widths::is_smooth`].
    #[inline(always)]
    fn is_smooth(self) -> bool {
        self.get().is_smooth()
    }
}

/// Facets that are known to be those of a smooth or of a rough surface when the program is
/// compiled.
pub(super) trait KnownFacets: Facets {
    /// These facets, or `None` if the distribution is another one.
    fn of(microfacets: Microfacets) -> Option<Self>;
}

/// Facets of a rough surface with the distribution [`Ggx`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Rough(Ggx);

/// A smooth surface, which has no facets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Smooth;

impl From<Widths> for Rough {
    #[inline(always)]
    fn from(widths: Widths) -> Self {
        Self(widths.into())
    }
}

impl Facets for Microfacets {
    const IS_KNOWN: bool = false;

    #[inline(always)]
    fn get(self) -> Microfacets {
        self
    }
}

impl Facets for Rough {
    #[inline(always)]
    fn get(self) -> Microfacets {
        Microfacets::Ggx(self.0)
    }

    #[inline(always)]
    fn is_smooth(self) -> bool {
        false
    }
}

impl Facets for Smooth {
    #[inline(always)]
    fn get(self) -> Microfacets {
        Microfacets::Ggx(Widths::both(0.0).into())
    }

    #[inline(always)]
    fn is_smooth(self) -> bool {
        true
    }
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
    #[inline(always)]
    pub fn sample_visible_normal(self, wo: Vec3, u: Vec2) -> Vec3 {
        ask!(self, known => known.sample_visible_normal(wo, u))
    }

    /// The mean of a function of a direction like `w` and of numbers by which facets visible from
    /// it are drawn, over a Fibonacci lattice of `POINTS`. The direction is `w`, or for isotropic
    /// facets of [`Ggx`], whose halves left and right of it are alike, `w` turned to the azimuth of
    /// x.
    pub(super) fn mean_over_facets<const POINTS: u32>(
        self,
        w: Vec3,
        of: impl Fn(Vec3, Vec2) -> SampledSpectrum,
    ) -> SampledSpectrum {
        let has_halves = matches!(self, Self::Ggx(_)) && !self.has_tangent();
        let (w, turns) = if has_halves {
            (Vec3::new((1.0 - w.z * w.z).max(0.0).sqrt(), 0.0, w.z), 0.5)
        } else {
            (w, 1.0)
        };
        let share = 1.0 / POINTS as f32;
        let at = |i: u32| {
            let turn = (i as f32 * 0.618_034 + 0.5).fract();
            of(w, Vec2::new(turns * turn, (i as f32 + 0.5) * share))
        };
        (0..POINTS).map(at).sum::<SampledSpectrum>() * share
    }

    /// See [`Ggx::density`].
    #[inline(always)]
    pub(super) fn density(self, m: Vec3) -> f32 {
        ask!(self, known => known.density(m))
    }

    /// See [`Ggx::visibility`].
    #[inline(always)]
    pub(super) fn visibility(self, wo: Vec3, wi: Vec3) -> f32 {
        ask!(self, known => known.visibility(wo, wi))
    }

    /// See [`Ggx::visible_area`].
    #[inline(always)]
    pub(super) fn visible_area(self, wo: Vec3) -> f32 {
        ask!(self, known => known.visible_area(wo))
    }

    /// See [`Ggx::reflected`].
    #[inline(always)]
    pub(super) fn reflected(self, wo: Vec3, wi: Vec3) -> (Vec3, f32, f32, bool) {
        ask!(self, known => known.reflected(wo, wi))
    }

    /// See [`Ggx::drawn_reflection`].
    #[inline(always)]
    pub(super) fn drawn_reflection(self, wo: Vec3, u: Vec2) -> (Vec3, bool) {
        ask!(self, known => known.drawn_reflection(wo, u))
    }
}
