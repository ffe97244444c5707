//! Lobes without branches: the one form that [`super::Lobes`] calls for a single direction and a
//! [`BatchBsdf`](super::BatchBsdf) calls in loops that become vector code.
//!
//! A lobe is generic over what differs between the two. A single direction may meet any
//! distribution of microfacets, any law of reflection and a film: the lobe then holds the enums.
//! The lobe of a batch holds types that turn into one variant of these enums, such as
//! [`Rough`](super::microfacets::Rough) or [`NoFilm`](super::film::NoFilm), so that the compiler
//! removes the choice among variants.

use super::{BsdfSample, Drawn};
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// [`super::Lobes`] that always compute every result, even those that a flag then discards.
pub(super) trait BranchlessLobes {
    /// The precomputed state for `wo`.
    type Seen;
    /// The spectra, and values derived from them.
    type Colors;

    /// See [`super::Lobes::seen`].
    fn seen(&self, colors: &Self::Colors, wo: Vec3) -> Self::Seen;

    /// See [`super::Lobes::value_and_pdf_from`].
    fn value_and_pdf_from(
        &self,
        colors: &Self::Colors,
        seen: &Self::Seen,
        wi: Vec3,
    ) -> (SampledSpectrum, f32);

    /// See [`super::Lobes::draw_from`].
    fn draw_from(
        &self,
        colors: &Self::Colors,
        seen: &Self::Seen,
        u_lobe: f32,
        u: Vec2,
    ) -> BranchlessDrawn;

    /// See [`super::Lobes::albedo_from`].
    fn albedo_from(&self, colors: &Self::Colors, seen: &Self::Seen) -> SampledSpectrum;
}

/// A direction that was drawn, if `exists` is true.
pub(super) struct BranchlessDrawn {
    pub wi: Vec3,
    pub exists: bool,
    pub is_delta: bool,
    /// The weight of a delta lobe.
    pub delta: SampledSpectrum,
    pub is_transmission: bool,
    /// The value of [`super::Lobes::crossing_scale`] if the direction crosses the surface, 1 if
    /// not.
    pub crossing: f32,
}

impl BranchlessDrawn {
    /// A reflected direction, with the weight of a delta lobe where there is one.
    #[inline(always)]
    pub fn reflected(wi: Vec3, exists: bool, delta: Option<(bool, SampledSpectrum)>) -> Self {
        let (is_delta, delta) = delta.unwrap_or((false, SampledSpectrum::ZERO));
        Self { wi, exists, is_delta, delta, is_transmission: false, crossing: 1.0 }
    }

    /// The direction as [`super::Lobes::draw_from`] returns it.
    pub fn drawn(self) -> Option<Drawn> {
        let Self { wi, exists, is_delta, delta, is_transmission, .. } = self;
        exists.then_some(match is_delta {
            true => {
                Drawn::Delta(BsdfSample { wi, weight: delta, pdf: 0.0, is_delta, is_transmission })
            }
            false => Drawn::Direction { wi, is_transmission },
        })
    }
}
