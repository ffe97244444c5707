//! A clear coat over one slab, for batches of directions.
//!
//! The coat and the slab are those of [`super::super::OpenPbrBsdf`]. Only their layering is written
//! again: there any layer may be missing and is left out, here both are computed in all lanes.

use super::super::batch::{BatchLobes, LobeSpectra};
use super::super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::super::energy::{DielectricReflectionBy, Line};
use super::super::microfacets::{Facets, KnownFacets};
use super::super::{Choice, lift, lower_like};
use super::{CoatInterface, CoatLobe};
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// A colourless coat, smooth or rough, in the frame of the base.
#[derive(Clone, Debug)]
pub struct BatchCoated<B, M> {
    pub base: B,
    coat: CoatInterface<M, DielectricReflectionBy<Line>>,
    /// The spectra where they are the same everywhere, without the base.
    own: Colors<()>,
}

/// Spectra of a lane.
#[derive(Clone, Copy, Debug)]
pub struct Colors<C> {
    base: C,
    /// 1 in every lane in use, 0 elsewhere.
    unit: SampledSpectrum,
    base_albedo: SampledSpectrum,
}

/// As [`super::super::OpenPbrSeen`].
pub struct Seen<S> {
    wo: Vec3,
    base: S,
    /// As in [`super::CoatSeen`].
    reflected: f32,
    /// Factor on the base: for reflection by the coat, and darkening by reflections inside it.
    passed: SampledSpectrum,
    choice: Choice<2>,
}

impl<B, M: KnownFacets> BatchCoated<B, M> {
    /// `None` for other coats.
    pub fn of(lobe: &CoatLobe, unit: SampledSpectrum, base: B) -> Option<Self> {
        let &CoatLobe { interface, frame, base_albedo, .. } = lobe;
        if !lobe.is_clear(unit) || [frame.x, frame.y, frame.z] != [Vec3::X, Vec3::Y, Vec3::Z] {
            return None;
        }
        let CoatInterface { weight, ior, darkening, base_roughness, .. } = interface;
        let coat = CoatInterface {
            weight,
            ior,
            microfacets: M::of(interface.microfacets)?,
            albedo: interface.albedo.line(),
            darkening,
            base_roughness,
            diffuse_reflection: interface.diffuse_reflection,
        };
        Some(Self { base, coat, own: Colors { base: (), unit, base_albedo } })
    }
}

impl<B: BranchlessLobes, M: Facets> BranchlessLobes for BatchCoated<B, M> {
    type Seen = Seen<B::Seen>;
    type Colors = Colors<B::Colors>;

    #[inline(always)]
    fn seen(&self, colors: &Self::Colors, wo: Vec3) -> Seen<B::Seen> {
        let up = lift(wo);
        let reflected = self.coat.reflected(up);
        let passed = self.coat.passed(reflected, SampledSpectrum::ONE)
            * self.coat.darkened(colors.base_albedo, up.z);
        let base = self.base.seen(&colors.base, wo);
        let below = self.base.albedo_from(&colors.base, &base) * colors.unit * passed;
        let choice = Choice::new([below, colors.unit * (reflected * self.coat.weight)]);
        Seen { wo, base, reflected, passed, choice }
    }

    #[inline(always)]
    fn value_and_pdf_from(
        &self,
        colors: &Self::Colors,
        seen: &Seen<B::Seen>,
        wi: Vec3,
    ) -> (SampledSpectrum, f32) {
        let [below, coat] = seen.choice.probabilities;
        let (value, density) = self.base.value_and_pdf_from(&colors.base, &seen.base, wi);
        let value = value * colors.unit * seen.passed;
        let pdf = if below > 0.0 { below * density } else { 0.0 };
        if self.coat.microfacets.is_smooth() {
            return (value, pdf);
        }
        let is_seen = seen.wo.z * wi.z > 0.0;
        let (reflection, density) = self.coat.value_and_pdf(lift(seen.wo), lift(wi));
        let (reflection, density) = if is_seen { (reflection, density) } else { (0.0, 0.0) };
        (value + colors.unit * (reflection * self.coat.weight), pdf + coat * density)
    }

    #[inline(always)]
    fn draw_from(
        &self,
        colors: &Self::Colors,
        seen: &Seen<B::Seen>,
        u_lobe: f32,
        u: Vec2,
    ) -> BranchlessDrawn {
        let wo = seen.wo;
        let [_, coat] = seen.choice.probabilities;
        let (is_below, exists, rest) = seen.choice.picked(u_lobe);
        let base = self.base.draw_from(&colors.base, &seen.base, rest, u);
        let exists = exists & (wo.z != 0.0);
        if self.coat.microfacets.is_smooth() {
            let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
            let delta = colors.unit * (seen.reflected * self.coat.weight) / coat;
            let wi = select(is_below, base.wi, mirror);
            return BranchlessDrawn::reflected(
                wi,
                exists & (base.exists | !is_below),
                Some((!is_below, delta)),
            );
        }
        let (facet, is_above) = self.coat.microfacets.get().drawn_reflection(lift(wo), u);
        let facet = lower_like(facet, wo);
        let is_sound = if is_below { base.exists } else { is_above & (wo.z * facet.z > 0.0) };
        BranchlessDrawn::reflected(select(is_below, base.wi, facet), exists & is_sound, None)
    }

    #[inline(always)]
    fn albedo_from(&self, colors: &Self::Colors, seen: &Seen<B::Seen>) -> SampledSpectrum {
        let below = self.base.albedo_from(&colors.base, &seen.base) * colors.unit;
        below * seen.passed + colors.unit * (seen.reflected * self.coat.weight)
    }
}

impl<B: BatchLobes, M: Facets> BatchLobes for BatchCoated<B, M> {
    #[inline(always)]
    fn own_colors(&self, body: SampledSpectrum) -> Self::Colors {
        let Colors { base: (), unit, base_albedo } = self.own;
        Colors { base: self.base.own_colors(body), unit, base_albedo }
    }

    #[inline(always)]
    fn colors_of(&self, spectra: &LobeSpectra) -> Self::Colors {
        let base = self.base.colors_of(spectra);
        // As in the layering: the reflectance of the base at normal incidence.
        let base_albedo = self.base.albedo_from(&base, &self.base.seen(&base, Vec3::Z));
        Colors { base, unit: SampledSpectrum::ONE, base_albedo }
    }
}
