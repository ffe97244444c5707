//! A clear coat over one slab, for batches of directions.

use super::super::batch::{BatchLobes, LobeSpectra};
use super::super::branchless::{BranchlessDrawn, BranchlessLobes};
use super::super::energy::{DielectricReflectionBy, Directional, Line};
use super::super::{Choice, Ggx, fresnel, lift, lower_like};
use super::CoatLobe;
use snell_math::simd::select;
use snell_math::{SampledSpectrum, Vec2, Vec3};

/// A colourless coat, smooth or rough, in the frame of the base.
#[derive(Clone, Debug)]
pub struct BatchCoated<B, const SMOOTH: bool> {
    pub base: B,
    weight: f32,
    ggx: Ggx,
    ior: f32,
    darkening: f32,
    base_roughness: f32,
    albedo: DielectricReflectionBy<Line>,
    diffuse_reflection: f32,
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
    darkened: SampledSpectrum,
    choice: Choice<2>,
}

impl<B, const SMOOTH: bool> BatchCoated<B, SMOOTH> {
    /// `None` for other coats.
    pub fn of(lobe: &CoatLobe, unit: SampledSpectrum, base: B) -> Option<Self> {
        let CoatLobe { coat, albedo, frame, base_albedo, diffuse_reflection } = lobe;
        let has_frame = [frame.x, frame.y, frame.z] == [Vec3::X, Vec3::Y, Vec3::Z];
        (lobe.is_clear(unit) && has_frame && coat.ggx.is_smooth() == SMOOTH).then(|| Self {
            base,
            weight: coat.weight,
            ggx: coat.ggx,
            ior: coat.ior,
            darkening: coat.darkening,
            base_roughness: coat.base_roughness,
            albedo: albedo.line(),
            diffuse_reflection: *diffuse_reflection,
            own: Colors { base: (), unit, base_albedo: *base_albedo },
        })
    }

    /// As [`CoatLobe::passed`].
    #[inline(always)]
    fn passed(&self, reflected: f32, darkened: SampledSpectrum) -> SampledSpectrum {
        SampledSpectrum::ONE.lerp(SampledSpectrum::splat(1.0 - reflected), self.weight) * darkened
    }
}

impl<B: BranchlessLobes, const SMOOTH: bool> BranchlessLobes for BatchCoated<B, SMOOTH> {
    type Seen = Seen<B::Seen>;
    type Colors = Colors<B::Colors>;

    #[inline(always)]
    fn seen(&self, colors: &Self::Colors, wo: Vec3) -> Seen<B::Seen> {
        let up = lift(wo);
        let smooth = fresnel::dielectric(up.z, self.ior);
        let k = smooth + (self.diffuse_reflection - smooth) * self.base_roughness;
        let darkened = colors.base_albedo.map(|e| (1.0 - k) / (1.0 - e.min(1.0) * k).max(1e-4));
        let darkened = SampledSpectrum::ONE.lerp(darkened, self.weight * self.darkening);
        let reflected = if SMOOTH { smooth } else { self.albedo.towards(up) };
        let base = self.base.seen(&colors.base, wo);
        let below = self.base.albedo_from(&colors.base, &base)
            * colors.unit
            * self.passed(reflected, darkened);
        let choice = Choice::new([below, colors.unit * (reflected * self.weight)]);
        Seen { wo, base, reflected, darkened, choice }
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
        let value = value * colors.unit * self.passed(seen.reflected, seen.darkened);
        let pdf = if below > 0.0 { below * density } else { 0.0 };
        if SMOOTH {
            return (value, pdf);
        }
        let is_seen = seen.wo.z * wi.z > 0.0;
        let (o, i) = (lift(seen.wo), lift(wi));
        let (m, reflection, density, exists) = self.ggx.reflected(o, i);
        let exists = exists & is_seen;
        let reflection =
            if exists { fresnel::dielectric(o.dot(m), self.ior) * reflection } else { 0.0 };
        let density = if exists { density } else { 0.0 };
        (value + colors.unit * (reflection * self.weight), pdf + coat * density)
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
        if SMOOTH {
            let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
            let delta =
                colors.unit * (fresnel::dielectric(wo.z.abs(), self.ior) * self.weight) / coat;
            let wi = select(is_below, base.wi, mirror);
            return BranchlessDrawn::reflected(
                wi,
                exists & (base.exists | !is_below),
                Some((!is_below, delta)),
            );
        }
        let (facet, is_above) = self.ggx.drawn_reflection(lift(wo), u);
        let facet = lower_like(facet, wo);
        let is_sound = if is_below { base.exists } else { is_above & (wo.z * facet.z > 0.0) };
        BranchlessDrawn::reflected(select(is_below, base.wi, facet), exists & is_sound, None)
    }

    #[inline(always)]
    fn albedo_from(&self, colors: &Self::Colors, seen: &Seen<B::Seen>) -> SampledSpectrum {
        let below = self.base.albedo_from(&colors.base, &seen.base) * colors.unit;
        below * self.passed(seen.reflected, seen.darkened)
            + colors.unit * (seen.reflected * self.weight)
    }
}

impl<B: BatchLobes, const SMOOTH: bool> BatchLobes for BatchCoated<B, SMOOTH> {
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
