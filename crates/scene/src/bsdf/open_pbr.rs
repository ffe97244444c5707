//! The layered surface of OpenPBR Surface 1.1: fuzz over coat over a mixture of metal, clear and
//! scattering dielectrics.
//!
//! Layers are combined as the specification proposes ("Reduction to a mixture of lobes"): the
//! layers below get the share that a layer does not reflect towards the viewer. This conserves
//! energy but is not reciprocal: with the directions exchanged, the share would follow from the
//! other direction. The fuzz of glTF lies under the coat ([`Fuzz::is_under_coat`]).

mod batch;

pub(super) use batch::BatchMixed;

use super::batch::LobeSpectra;
use super::coat::{Coat, CoatLobe, CoatSeen};
use super::fuzz::{Fuzz, FuzzLobe};
use super::{
    BsdfSample, Choice, ConductorBsdf, ConductorSeen, DielectricBsdf, DielectricSeen, Drawn,
    GlossyBsdf, GlossySeen, Lobes, SheetBsdf, SheetSeen, SpecularBranch, bsdfs, lift, lower_like,
};
use snell_math::{ColorMode, Frame, SampledSpectrum, Vec2, Vec3, sampling};

bsdfs! {
    /// The clear part of the base: a boundary of a clear volume, or a thin sheet.
    #[derive(Clone, Copy, Debug)]
    Translucent,
    /// The precomputed state of the clear part for a direction.
    TranslucentSeen,
    Solid => DielectricBsdf, DielectricSeen;
    Sheet => SheetBsdf, SheetSeen;
}

/// The parts of the base, each with its share of the surface; the shares add up to 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct Slabs {
    /// Metal.
    pub metal: Option<(f32, ConductorBsdf)>,
    /// Opaque dielectric.
    pub opaque: Option<(f32, GlossyBsdf)>,
    /// Clear dielectric.
    pub translucent: Option<(f32, Translucent)>,
    /// Share of the opaque dielectric that scatters in a medium inside, `[0, 1]`.
    pub subsurface: f32,
}

/// The parameters of one point. Make it with [`OpenPbrBsdf::new`].
#[derive(Clone, Copy, Debug)]
pub struct OpenPbrBsdf {
    slabs: Slabs,
    coat: Option<CoatLobe>,
    fuzz: Option<Fuzz>,
    /// 1 in every lane in use (or more in the only one), 0 elsewhere: a factor on everything.
    unit: SampledSpectrum,
}

/// A layered surface seen from a direction.
#[derive(Clone, Debug)]
pub struct OpenPbrSeen {
    wo: Vec3,
    /// The precomputed state of the slabs; from inside, only of the clear one.
    metal: Option<ConductorSeen>,
    opaque: Option<GlossySeen>,
    translucent: Option<TranslucentSeen>,
    coat: Option<CoatSeen>,
    fuzz: Option<(Fuzz, FuzzLobe)>,
    /// Share of light that passes the fuzz, and of that what passes it above the coat.
    under_fuzz: f32,
    above_coat: f32,
    /// Reflection and transmission of each slab, times its share.
    slabs: [SampledSpectrum; 3],
    choice: Choice<5>,
}

/// The only slab of a layered surface, apart from a coat.
pub(super) enum OnlySlab<'a> {
    Metal(&'a ConductorBsdf),
    Opaque(&'a GlossyBsdf),
}

/// Indices of the lobes in the choice among them.
const METAL: usize = 0;
const OPAQUE: usize = 1;
const TRANSLUCENT: usize = 2;
const COAT: usize = 3;
const FUZZ: usize = 4;

impl OpenPbrBsdf {
    /// A base under its layers; the coat follows the base's normal.
    pub fn new(
        slabs: Slabs,
        coat: Option<Coat>,
        fuzz: Option<Fuzz>,
        unit: SampledSpectrum,
    ) -> Self {
        let bare = Self { slabs, coat: None, fuzz: None, unit };
        let coat = coat.map(|coat| {
            CoatLobe::new(coat, bare.seen_from_outside(Vec3::Z).slabs.into_iter().sum())
        });
        Self { coat, fuzz, ..bare }
    }

    /// As [`super::Ggx::has_tangent`] of any of the layers.
    pub(crate) fn has_tangent(&self) -> bool {
        let Slabs { metal, opaque, translucent, .. } = &self.slabs;
        metal.is_some_and(|(_, metal)| metal.has_tangent())
            || opaque.is_some_and(|(_, opaque)| opaque.has_tangent())
            || self.coat.is_some_and(|coat| coat.has_tangent())
            || match translucent {
                Some((_, Translucent::Solid(solid))) => solid.has_tangent(),
                Some((_, Translucent::Sheet(sheet))) => sheet.has_tangent(),
                None => false,
            }
    }

    /// The opaque slab, if there is one.
    pub(crate) fn opaque(&self) -> Option<&GlossyBsdf> {
        self.slabs.opaque.as_ref().map(|(_, b)| b)
    }

    /// The slab of solid glass, if there is one.
    pub(crate) fn solid(&self) -> Option<&DielectricBsdf> {
        match &self.slabs.translucent {
            Some((_, Translucent::Solid(solid))) => Some(solid),
            _ => None,
        }
    }

    /// The slab if it is the only one apart from a coat, in [`snell_math::ColorMode::Rgb`]: without
    /// a coat, the surface equals the slab.
    pub(super) fn only_slab(&self) -> Option<(OnlySlab<'_>, Option<&CoatLobe>)> {
        let Slabs { metal, opaque, translucent, subsurface } = &self.slabs;
        let is_bare = self.fuzz.is_none() && translucent.is_none() && *subsurface == 0.0;
        if !is_bare || self.unit != ColorMode::Rgb.unit() {
            return None;
        }
        let slab = match (metal, opaque) {
            (Some((1.0, metal)), None) => OnlySlab::Metal(metal),
            (None, Some((1.0, opaque))) => OnlySlab::Opaque(opaque),
            _ => return None,
        };
        Some((slab, self.coat.as_ref()))
    }

    /// The spectra of its metal or opaque slab, or of both, under a clear coat or none.
    pub(super) fn spectra(&self) -> Option<LobeSpectra> {
        let is_clear = self.coat.as_ref().is_none_or(|coat| coat.is_clear(self.unit));
        let of_metal = self.slabs.metal.as_ref().map(|(_, metal)| metal.spectra());
        let of_opaque = self.slabs.opaque.as_ref().map(|(_, opaque)| opaque.spectra());
        of_metal.or(of_opaque).filter(|_| is_clear)
    }

    /// Metal and opaque dielectric where there is nothing else, in [`snell_math::ColorMode::Rgb`].
    pub(super) fn only_mixture(&self) -> Option<(&(f32, ConductorBsdf), &(f32, GlossyBsdf))> {
        let Slabs { metal, opaque, translucent, subsurface } = &self.slabs;
        let is_bare = self.fuzz.is_none()
            && self.coat.is_none()
            && translucent.is_none()
            && *subsurface == 0.0;
        metal
            .as_ref()
            .zip(opaque.as_ref())
            .filter(|_| is_bare && self.unit == ColorMode::Rgb.unit())
    }

    /// Gives the coat its own frame, relative to that of the base: a smooth coat over rough grain,
    /// or the reverse. As with all shading normals, the cosine of incident light is then the one
    /// with that normal.
    pub fn with_coat_frame(mut self, frame: Frame) -> Self {
        self.coat = self.coat.map(|coat| coat.with_frame(frame));
        self
    }

    /// True if a coat covers the base.
    pub fn has_coat(&self) -> bool {
        self.coat.is_some()
    }

    /// True if reflection dominates the look.
    pub(crate) fn mirrors(&self) -> bool {
        self.slabs.opaque.is_none()
    }

    /// True if directions below are inside a medium.
    fn has_inside(&self) -> bool {
        self.slabs.subsurface > 0.0
            || matches!(self.slabs.translucent, Some((_, Translucent::Solid(_))))
    }

    fn is_inside(&self, wo: Vec3) -> bool {
        wo.z < 0.0 && self.has_inside()
    }

    /// Shares of the clear and of the scattering interior among paths from inside.
    fn inside_shares(&self) -> (f32, f32) {
        let clear = match self.slabs.translucent {
            Some((share, Translucent::Solid(_))) => share,
            _ => 0.0,
        };
        let scattering = self.slabs.opaque.map_or(0.0, |(share, _)| share * self.slabs.subsurface);
        let total = clear + scattering;
        (clear / total, scattering / total)
    }

    /// The square of the index of refraction of the interior, by which radiance is larger there.
    /// Where clear and scattering parts share the interior, light crosses both with this factor:
    /// it may enter by one and leave by the other.
    fn compression(&self) -> f32 {
        match &self.slabs.translucent {
            Some((_, Translucent::Solid(solid))) => solid.crossing_scale(Vec3::Z),
            _ => 1.0,
        }
    }

    /// Fuzz seen from a direction on the outside.
    fn fuzz_lobe(&self, wo: Vec3) -> Option<(Fuzz, FuzzLobe)> {
        self.fuzz.map(|fuzz| (fuzz, FuzzLobe::new(&fuzz, lift(wo))))
    }

    /// Share of light that passes the fuzz towards `wo`.
    fn under_fuzz(fuzz: &Option<(Fuzz, FuzzLobe)>) -> f32 {
        fuzz.as_ref().map_or(1.0, |(fuzz, lobe)| 1.0 - fuzz.weight * lobe.reflectance())
    }

    /// Share of light that passes what is above the coat, where the share `under_fuzz` passes the
    /// fuzz.
    fn above_coat(&self, under_fuzz: f32) -> f32 {
        if self.fuzz.is_some_and(|fuzz| fuzz.is_under_coat()) { 1.0 } else { under_fuzz }
    }

    /// Factor on the reflection of the fuzz.
    fn above_fuzz(&self, coat: &Option<CoatSeen>, wi: Vec3) -> SampledSpectrum {
        match self.fuzz {
            Some(fuzz) if fuzz.is_under_coat() => self.under_coat(coat, wi),
            _ => SampledSpectrum::ONE,
        }
    }

    /// Factor on the base under the coat.
    fn under_coat(&self, coat: &Option<CoatSeen>, wi: Vec3) -> SampledSpectrum {
        self.coat
            .as_ref()
            .zip(coat.as_ref())
            .map_or(SampledSpectrum::ONE, |(coat, seen)| coat.passed(seen, wi))
    }

    fn coat_seen(&self, wo: Vec3) -> Option<CoatSeen> {
        self.coat.as_ref().map(|coat| coat.seen(wo))
    }

    fn seen_from_outside(&self, wo: Vec3) -> OpenPbrSeen {
        let (fuzz, coat) = (self.fuzz_lobe(wo), self.coat_seen(wo));
        let under_fuzz = Self::under_fuzz(&fuzz);
        let above_coat = self.above_coat(under_fuzz);
        let s = &self.slabs;
        let (metal, opaque, translucent) =
            (seen(&s.metal, wo), seen(&s.opaque, wo), seen(&s.translucent, wo));
        let slabs = [
            albedo(&s.metal, &metal),
            albedo(&s.opaque, &opaque) * self.unit,
            albedo(&s.translucent, &translucent),
        ];
        let base = self.under_coat(&coat, mirrored(wo)) * under_fuzz;
        let [m, o, t] = slabs.map(|albedo| albedo * base);
        let c =
            self.coat.as_ref().zip(coat.as_ref()).map_or(SampledSpectrum::ZERO, |(coat, seen)| {
                self.unit * (seen.reflected * coat.weight() * above_coat)
            });
        let f = fuzz.as_ref().map_or(SampledSpectrum::ZERO, |(fuzz, lobe)| {
            let above = self.above_fuzz(&coat, mirrored(wo));
            fuzz.color * self.unit * above * (fuzz.weight * lobe.reflectance())
        });
        let choice = Choice::new([m, o, t, c, f]);
        OpenPbrSeen {
            wo,
            metal,
            opaque,
            translucent,
            coat,
            fuzz,
            under_fuzz,
            above_coat,
            slabs,
            choice,
        }
    }

    fn seen_from_inside(&self, wo: Vec3) -> OpenPbrSeen {
        let none = SampledSpectrum::ZERO;
        OpenPbrSeen {
            wo,
            metal: None,
            opaque: None,
            translucent: seen(&self.slabs.translucent, wo),
            coat: None,
            fuzz: None,
            under_fuzz: 1.0,
            above_coat: 1.0,
            slabs: [none; 3],
            choice: Choice::new([none; 5]),
        }
    }

    fn draw_inside(&self, seen: &OpenPbrSeen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let (clear, scattering) = self.inside_shares();
        if u_lobe < scattering {
            let wi = sampling::cosine_hemisphere(u);
            return Some(Drawn::Direction { wi, is_transmission: wi.z > 0.0 });
        }
        let rest = ((u_lobe - scattering) / clear).min(1.0 - f32::EPSILON);
        let (_, drawn) = draw(&self.slabs.translucent, &seen.translucent, rest, u)?;
        Some(match drawn {
            Drawn::Delta(sample) => {
                Drawn::Delta(BsdfSample { weight: sample.weight * self.unit, ..sample })
            }
            direction => direction,
        })
    }

    /// Value and density for a direction inside.
    fn inside(&self, seen: &OpenPbrSeen, wi: Vec3) -> (SampledSpectrum, f32) {
        let (clear, scattering) = self.inside_shares();
        let (mut value, mut pdf) = (SampledSpectrum::ZERO, 0.0);
        if let Some((_, through, density)) =
            value_and_pdf(&self.slabs.translucent, &seen.translucent, wi)
        {
            value += through * clear;
            pdf += density * clear;
        }
        if wi.z > 0.0 {
            if let Some((_, b)) = &self.slabs.opaque {
                value += b.exit_value(wi) * (scattering * self.compression());
            }
            pdf += scattering * sampling::cosine_hemisphere_pdf(wi.z);
        }
        (value * self.unit, pdf)
    }
}

/// The precomputed state of a slab for a direction.
fn seen<B: Lobes>(slab: &Option<(f32, B)>, wo: Vec3) -> Option<B::Seen> {
    slab.as_ref().map(|(_, b)| b.seen(wo))
}

/// Reflection and transmission of a slab, times its share.
fn albedo<B: Lobes>(slab: &Option<(f32, B)>, seen: &Option<B::Seen>) -> SampledSpectrum {
    let both = slab.as_ref().zip(seen.as_ref());
    both.map_or(SampledSpectrum::ZERO, |((share, b), seen)| b.albedo_from(seen) * *share)
}

/// Share, value and density of a slab.
fn value_and_pdf<B: Lobes>(
    slab: &Option<(f32, B)>,
    seen: &Option<B::Seen>,
    wi: Vec3,
) -> Option<(f32, SampledSpectrum, f32)> {
    let ((share, b), seen) = slab.as_ref().zip(seen.as_ref())?;
    let (value, pdf) = b.value_and_pdf_from(seen, wi);
    Some((*share, value, pdf))
}

/// The share of a slab, and a direction drawn from it.
fn draw<B: Lobes>(
    slab: &Option<(f32, B)>,
    seen: &Option<B::Seen>,
    u_lobe: f32,
    u: Vec2,
) -> Option<(f32, Drawn)> {
    let ((share, b), seen) = slab.as_ref().zip(seen.as_ref())?;
    Some((*share, b.draw_from(seen, u_lobe, u)?))
}

/// The direction of perfect reflection.
fn mirrored(wo: Vec3) -> Vec3 {
    Vec3::new(-wo.x, -wo.y, wo.z)
}

impl Lobes for OpenPbrBsdf {
    type Seen = Box<OpenPbrSeen>;

    fn seen(&self, wo: Vec3) -> Box<OpenPbrSeen> {
        Box::new(if self.is_inside(wo) {
            self.seen_from_inside(wo)
        } else {
            self.seen_from_outside(wo)
        })
    }

    fn value_and_pdf_from(&self, seen: &Box<OpenPbrSeen>, wi: Vec3) -> (SampledSpectrum, f32) {
        let (wo, s) = (seen.wo, &self.slabs);
        if wo.z * wi.z == 0.0 {
            return (SampledSpectrum::ZERO, 0.0);
        }
        if self.is_inside(wo) {
            return self.inside(seen, wi);
        }
        let p = seen.choice.probabilities;
        let slabs = [
            value_and_pdf(&s.metal, &seen.metal, wi),
            value_and_pdf(&s.opaque, &seen.opaque, wi),
            value_and_pdf(&s.translucent, &seen.translucent, wi),
        ];
        let (mut base, mut pdf) = (SampledSpectrum::ZERO, 0.0);
        let entering = if wo.z * wi.z < 0.0 { 1.0 / self.compression() } else { 1.0 };
        for (i, (slab, p)) in slabs.into_iter().zip(p).enumerate() {
            let Some((share, value, density)) = slab else { continue };
            // (Glass has that factor itself.)
            base += value * if i == OPAQUE { share * entering } else { share };
            pdf += if p > 0.0 { p * density } else { 0.0 };
        }
        let mut value = base * self.unit * self.under_coat(&seen.coat, wi) * seen.under_fuzz;
        if let Some((coat, known)) = self.coat.as_ref().zip(seen.coat.as_ref()) {
            let (reflected, density) = coat.value_and_pdf(known, wi);
            value += self.unit * (reflected * coat.weight() * seen.above_coat);
            pdf += p[COAT] * density;
        }
        if let Some((fuzz, lobe)) = &seen.fuzz
            && wo.z * wi.z > 0.0
        {
            let (reflected, density) = lobe.value_and_pdf(lift(wi));
            let above = self.above_fuzz(&seen.coat, wi);
            value += fuzz.color * self.unit * above * (fuzz.weight * reflected);
            pdf += p[FUZZ] * density;
        }
        (value, pdf)
    }

    fn draw_from(&self, seen: &Box<OpenPbrSeen>, u_lobe: f32, u: Vec2) -> Option<Drawn> {
        let (wo, s) = (seen.wo, &self.slabs);
        if wo.z == 0.0 {
            return None;
        }
        if self.is_inside(wo) {
            return self.draw_inside(seen, u_lobe, u);
        }
        let (lobe, rest) = seen.choice.pick(u_lobe)?;
        let (p, under) = (seen.choice.probabilities[lobe], seen.under_fuzz);
        let reflected = |wi| Some(Drawn::Direction { wi, is_transmission: false });
        let (share, drawn) = match lobe {
            METAL => draw(&s.metal, &seen.metal, rest, u)?,
            OPAQUE => draw(&s.opaque, &seen.opaque, rest, u)?,
            TRANSLUCENT => draw(&s.translucent, &seen.translucent, rest, u)?,
            COAT => {
                let (coat, known) = self.coat.as_ref().zip(seen.coat.as_ref())?;
                return match coat.branch(wo, self.unit) {
                    Some(branch) => {
                        let weight = branch.weight * seen.above_coat;
                        Some(SpecularBranch { weight, ..branch }.drawn(p))
                    }
                    None => reflected(coat.sample(known, u)?),
                };
            }
            _ => return reflected(lower_like(seen.fuzz.as_ref()?.1.sample(u), wo)),
        };
        Some(match drawn {
            Drawn::Delta(below) => {
                let factor =
                    self.unit * self.under_coat(&seen.coat, below.wi) * (under * share / p);
                Drawn::Delta(BsdfSample { weight: below.weight * factor, ..below })
            }
            direction => direction,
        })
    }

    fn albedo_from(&self, seen: &Box<OpenPbrSeen>) -> SampledSpectrum {
        if self.is_inside(seen.wo) {
            return self.unit;
        }
        let base: SampledSpectrum = seen.slabs.into_iter().sum();
        let coat = self
            .coat
            .as_ref()
            .zip(seen.coat.as_ref())
            .map_or(0.0, |(c, seen)| seen.reflected * c.weight());
        let mirror = mirrored(seen.wo);
        let base = base * self.under_coat(&seen.coat, mirror) * seen.under_fuzz;
        let fuzz = seen
            .fuzz
            .as_ref()
            .map_or(SampledSpectrum::ZERO, |(f, lobe)| f.color * (f.weight * lobe.reflectance()));
        let fuzz = fuzz * self.above_fuzz(&seen.coat, mirror);
        base + self.unit * (fuzz + SampledSpectrum::splat(coat * seen.above_coat))
    }

    fn is_delta(&self) -> bool {
        let s = &self.slabs;
        self.fuzz.is_none()
            && self.coat.as_ref().is_none_or(|c| c.is_smooth())
            && s.metal.as_ref().is_none_or(|(_, b)| b.is_delta())
            && s.opaque.as_ref().is_none_or(|(_, b)| b.is_delta())
            && s.translucent.as_ref().is_none_or(|(_, b)| b.is_delta())
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        let Some((share, body)) = self.slabs.opaque.as_ref().filter(|_| !self.is_inside(wo)) else {
            return SampledSpectrum::ZERO;
        };
        let under_fuzz = Self::under_fuzz(&self.fuzz_lobe(wo));
        body.diffuse(wo, wi)
            * (self.unit * self.under_coat(&self.coat_seen(wo), wi) * (share * under_fuzz))
    }

    fn is_opaque(&self) -> bool {
        // Metal always is.
        let s = &self.slabs;
        !self.has_inside()
            && s.opaque.as_ref().is_none_or(|(_, b)| b.is_opaque())
            && s.translucent.as_ref().is_none_or(|(_, b)| b.is_opaque())
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        let s = &self.slabs;
        let slabs = [
            s.metal.as_ref().map(|(share, b)| b.ambient(wo) * *share),
            s.opaque.as_ref().map(|(share, b)| b.ambient(wo) * *share),
            s.translucent.as_ref().map(|(share, b)| b.ambient(wo) * *share),
        ];
        let base: SampledSpectrum = slabs.into_iter().flatten().sum();
        let under_coat = self.under_coat(&self.coat_seen(wo), mirrored(wo));
        base * self.unit * under_coat * Self::under_fuzz(&self.fuzz_lobe(wo))
    }

    fn crossing_scale(&self, wo: Vec3) -> f32 {
        match &self.slabs.translucent {
            Some((_, Translucent::Solid(b))) => b.crossing_scale(wo),
            _ => 1.0,
        }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        let (under, s) = (Self::under_fuzz(&self.fuzz_lobe(wo)), &self.slabs);
        let mut found: [Option<SpecularBranch>; 2] = [None, None];
        let seen = self.coat_seen(wo);
        let above_coat = self.unit * self.above_coat(under);
        let coat = self.coat.as_ref().and_then(|coat| coat.branch(wo, above_coat));
        let slabs = [
            s.metal.as_ref().map(|(share, b)| (*share, b.specular_branches(wo))),
            s.opaque.as_ref().map(|(share, b)| (*share, b.specular_branches(wo))),
            s.translucent.as_ref().map(|(share, b)| (*share, b.specular_branches(wo))),
        ];
        let below = slabs.into_iter().flatten().flat_map(|(share, branches)| {
            let seen = &seen;
            branches.into_iter().flatten().map(move |b| {
                let factor = self.unit * self.under_coat(seen, b.wi) * (share * under);
                SpecularBranch { weight: b.weight * factor, ..b }
            })
        });
        // Mirror images in nearly the same direction count as one.
        for branch in coat.into_iter().chain(below) {
            let place = &mut found[usize::from(branch.is_transmission)];
            *place = Some(match *place {
                Some(first) => SpecularBranch { weight: first.weight + branch.weight, ..first },
                None => branch,
            });
        }
        found
    }
}
