//! The layered surface of OpenPBR Surface 1.1: fuzz over coat over a mixture of metal, clear and scattering dielectrics.
//!
//! Layers are put together as the specification proposes ("Reduction to a mixture of lobes"): what lies below gets the share that a
//! layer does not reflect towards the viewer. So nothing is lost that is not absorbed, at the price of reciprocity: light that comes
//! from where the viewer is would be shared by its own direction.

use super::energy::DielectricReflection;
use super::fuzz::FuzzLobe;
use super::ggx::Ggx;
use super::mirror::mirror_branch;
use super::{
    BsdfSample, Choice, ConductorBsdf, DielectricBsdf, GlossyBsdf, Lobes, SheetBsdf, SpecularBranch, fresnel, lift,
    lower_like,
};
use snell_math::{Frame, SampledSpectrum, Vec2, Vec3, sampling};

/// The clear part of the base.
#[derive(Clone, Copy, Debug)]
pub enum Translucent {
    /// A boundary of a clear volume.
    Solid(DielectricBsdf),
    /// A thin sheet.
    Sheet(SheetBsdf),
}

impl Translucent {
    fn lobes(&self) -> &dyn Lobes {
        match self {
            Self::Solid(b) => b,
            Self::Sheet(b) => b,
        }
    }
}

/// The parts of the base, with the share of the surface that each has; the shares add up to 1.
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

/// A clear lacquer.
#[derive(Clone, Copy, Debug)]
pub struct Coat {
    /// Share of the surface that it covers, `[0, 1]`.
    pub weight: f32,
    /// Roughness of its surface.
    pub ggx: Ggx,
    /// Index of refraction over that of the outside.
    pub ior: f32,
    /// What is left of light that crosses it twice at a right angle.
    pub color: SampledSpectrum,
    /// How much of the darkening by reflections inside of the coat there is, `[0, 1]`.
    pub darkening: f32,
    /// Roughness of what lies below, `[0, 1]`, as far as darkening goes.
    pub base_roughness: f32,
}

/// Fibres on top.
#[derive(Clone, Copy, Debug)]
pub struct Fuzz {
    /// Share of the surface that it covers, `[0, 1]`.
    pub weight: f32,
    /// Tint of what it reflects.
    pub color: SampledSpectrum,
    /// 0 for straight fibres, 1 for dust.
    pub roughness: f32,
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

#[derive(Clone, Copy, Debug)]
struct CoatLobe {
    coat: Coat,
    albedo: DielectricReflection,
    frame: Frame,
    /// Of what lies below at a right angle, and the share of diffuse light that is reflected back inside of the coat.
    base_albedo: SampledSpectrum,
    diffuse_reflection: f32,
}

/// Names of the lobes in choices.
const METAL: usize = 0;
const OPAQUE: usize = 1;
const TRANSLUCENT: usize = 2;
const COAT: usize = 3;
const FUZZ: usize = 4;

impl OpenPbrBsdf {
    /// A base under its layers; the coat follows the base's normal.
    pub fn new(slabs: Slabs, coat: Option<Coat>, fuzz: Option<Fuzz>, unit: SampledSpectrum) -> Self {
        let bare = Self { slabs, coat: None, fuzz, unit };
        let coat = coat.map(|coat| CoatLobe::new(coat, bare.slab_albedos(Vec3::Z).into_iter().sum()));
        Self { coat, ..bare }
    }

    /// Gives the coat another frame (in that of the base) than the base: a smooth coat over rough grain, or the reverse. As with
    /// all shading normals, the cosine of incident light is then the one with that normal.
    pub fn with_coat_frame(mut self, frame: Frame) -> Self {
        if let Some(coat) = &mut self.coat {
            coat.frame = frame;
        }
        self
    }

    /// True if a coat covers the base.
    pub fn has_coat(&self) -> bool {
        self.coat.is_some()
    }

    /// True if the look is in the reflection.
    pub(crate) fn mirrors(&self) -> bool {
        self.slabs.opaque.is_none()
    }

    /// True if directions below are inside of something.
    fn has_inside(&self) -> bool {
        self.slabs.subsurface > 0.0 || matches!(self.slabs.translucent, Some((_, Translucent::Solid(_))))
    }

    fn is_inside(&self, wo: Vec3) -> bool {
        wo.z < 0.0 && self.has_inside()
    }

    /// Shares of clear and of scattering insides among paths that come from inside.
    fn inside_shares(&self) -> (f32, f32) {
        let clear = match self.slabs.translucent {
            Some((share, Translucent::Solid(_))) => share,
            _ => 0.0,
        };
        let scattering = self.slabs.opaque.map_or(0.0, |(share, _)| share * self.slabs.subsurface);
        let total = clear + scattering;
        (clear / total, scattering / total)
    }

    /// What each slab reflects and lets through, by its share.
    fn slab_albedos(&self, wo: Vec3) -> [SampledSpectrum; 3] {
        let s = &self.slabs;
        [
            s.metal.as_ref().map_or(SampledSpectrum::ZERO, |(w, b)| b.albedo(wo) * *w),
            s.opaque.as_ref().map_or(SampledSpectrum::ZERO, |(w, b)| b.albedo(wo) * *w * self.unit),
            s.translucent.as_ref().map_or(SampledSpectrum::ZERO, |(w, b)| b.lobes().albedo(wo) * *w),
        ]
    }

    fn slabs(&self) -> [Option<(f32, &dyn Lobes)>; 3] {
        let s = &self.slabs;
        [
            s.metal.as_ref().map(|(w, b)| (*w, b as &dyn Lobes)),
            s.opaque.as_ref().map(|(w, b)| (*w, b as &dyn Lobes)),
            s.translucent.as_ref().map(|(w, b)| (*w, b.lobes())),
        ]
    }

    /// Fuzz seen from a direction on the outside.
    fn fuzz_lobe(&self, wo: Vec3) -> Option<(Fuzz, FuzzLobe)> {
        self.fuzz.map(|fuzz| (fuzz, FuzzLobe::new(fuzz.roughness, lift(wo))))
    }

    /// Share of light that passes the fuzz towards `wo`.
    fn under_fuzz(fuzz: &Option<(Fuzz, FuzzLobe)>) -> f32 {
        fuzz.as_ref().map_or(1.0, |(fuzz, lobe)| 1.0 - fuzz.weight * lobe.reflectance)
    }

    /// Factor on the base under the coat.
    fn under_coat(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.coat.as_ref().map_or(SampledSpectrum::ONE, |coat| coat.passed(wo, wi))
    }

    /// Probabilities of the lobes seen from outside.
    fn choice(&self, wo: Vec3, fuzz: &Option<(Fuzz, FuzzLobe)>) -> Choice<5> {
        let under = Self::under_fuzz(fuzz);
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        let base = self.under_coat(wo, mirror) * under;
        let [metal, opaque, translucent] = self.slab_albedos(wo).map(|albedo| albedo * base);
        let coat =
            self.coat.as_ref().map_or(SampledSpectrum::ZERO, |c| self.unit * (c.reflected(wo) * c.coat.weight * under));
        let fuzz = fuzz
            .as_ref()
            .map_or(SampledSpectrum::ZERO, |(fuzz, lobe)| fuzz.color * self.unit * (fuzz.weight * lobe.reflectance));
        Choice::new([metal, opaque, translucent, coat, fuzz])
    }

    /// Value and density for a pair seen from outside.
    fn value_and_pdf(
        &self,
        choice: &Choice<5>,
        wo: Vec3,
        wi: Vec3,
        fuzz: &Option<(Fuzz, FuzzLobe)>,
    ) -> (SampledSpectrum, f32) {
        let p = choice.probabilities;
        let (mut base, mut pdf) = (SampledSpectrum::ZERO, 0.0);
        for (slab, p) in self.slabs().into_iter().zip(p) {
            let Some((weight, lobe)) = slab else { continue };
            let (value, density) = lobe.eval_and_pdf(wo, wi);
            base += value * weight;
            pdf += if p > 0.0 { p * density } else { 0.0 };
        }
        let mut value = base * self.unit * self.under_coat(wo, wi);
        if let Some(coat) = &self.coat {
            let (reflected, density) = coat.value_and_pdf(wo, wi);
            value += self.unit * (reflected * coat.coat.weight);
            pdf += p[COAT] * density;
        }
        value *= Self::under_fuzz(fuzz);
        if let Some((fuzz, lobe)) = fuzz
            && wo.z * wi.z > 0.0
        {
            let density = lobe.pdf(lift(wi));
            value += fuzz.color * self.unit * (fuzz.weight * lobe.reflectance * density);
            pdf += p[FUZZ] * density;
        }
        (value, pdf)
    }

    fn sample_inside(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let (clear, scattering) = self.inside_shares();
        let wi = if u_lobe < scattering {
            sampling::cosine_hemisphere(u)
        } else {
            let (_, Translucent::Solid(b)) = self.slabs.translucent? else { return None };
            let sample = b.sample(wo, ((u_lobe - scattering) / clear).min(1.0 - f32::EPSILON), u)?;
            if sample.is_delta {
                return Some(BsdfSample { weight: sample.weight * self.unit, ..sample });
            }
            sample.wi
        };
        let (value, pdf) = self.inside(wo, wi);
        BsdfSample::of(wi, value, pdf, wi.z > 0.0)
    }

    /// Value and density for a direction inside.
    fn inside(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        let (clear, scattering) = self.inside_shares();
        let (mut value, mut pdf) = (SampledSpectrum::ZERO, 0.0);
        if let Some((_, Translucent::Solid(b))) = &self.slabs.translucent {
            let (through, density) = b.eval_and_pdf(wo, wi);
            value += through * clear;
            pdf += density * clear;
        }
        if wi.z > 0.0 {
            if let Some((_, b)) = &self.slabs.opaque {
                value += b.exit_value(wi) * scattering;
            }
            pdf += scattering * sampling::cosine_hemisphere_pdf(wi.z);
        }
        (value * self.unit, pdf)
    }
}

impl CoatLobe {
    fn new(coat: Coat, base_albedo: SampledSpectrum) -> Self {
        let ior = if coat.ior < 1.0 { 1.0 / coat.ior } else { coat.ior };
        let coat = Coat { ior, ..coat };
        let frame = Frame { x: Vec3::X, y: Vec3::Y, z: Vec3::Z };
        let diffuse_reflection = 1.0 - (1.0 - fresnel::dielectric_average(ior)) / (ior * ior);
        Self { coat, albedo: DielectricReflection::new(coat.ggx, ior), frame, base_albedo, diffuse_reflection }
    }

    /// Share of light that the coat reflects towards a direction.
    fn reflected(&self, w: Vec3) -> f32 {
        self.albedo.towards(lift(self.frame.to_local(w)))
    }

    /// The cosine inside of the coat.
    fn inner_cosine(&self, w: Vec3) -> f32 {
        let cos = self.frame.z.dot(w);
        (1.0 - (1.0 - cos * cos).max(0.0) / (self.coat.ior * self.coat.ior)).max(1e-4).sqrt()
    }

    /// Factor on what lies below: reflected by the coat, absorbed in it, and darkened by reflections inside of it.
    fn passed(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        // Light that goes through the base crosses the coat once.
        let way = 1.0 / self.inner_cosine(wo) + if wo.z * wi.z > 0.0 { 1.0 / self.inner_cosine(wi) } else { 0.0 };
        let left = self.coat.color.map(|c| if c >= 1.0 { 1.0 } else { c.max(0.0).powf(0.5 * way) });
        let smooth = fresnel::dielectric(self.frame.z.dot(wo).abs(), self.coat.ior);
        let k = smooth + (self.diffuse_reflection - smooth) * self.coat.base_roughness;
        let darkened = self.base_albedo.map(|e| (1.0 - k) / (1.0 - e.min(1.0) * k).max(1e-4));
        let covered = left * (1.0 - self.reflected(wo));
        SampledSpectrum::ONE.lerp(covered, self.coat.weight)
            * SampledSpectrum::ONE.lerp(darkened, self.coat.weight * self.coat.darkening)
    }

    /// A pair on one side of the coat, lifted above; `None` if the coat does not reflect one into the other.
    fn pair(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, Vec3)> {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        (o.z * i.z > 0.0 && wo.z * wi.z > 0.0).then(|| (lift(o), lift(i)))
    }

    /// Value for a coat of weight 1, and density.
    fn value_and_pdf(&self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let Some((o, i)) = self.pair(wo, wi).filter(|_| !self.coat.ggx.is_smooth()) else { return (0.0, 0.0) };
        let reflection = self.coat.ggx.reflection_and_pdf(o, i);
        reflection.map_or((0.0, 0.0), |(m, value, pdf)| (fresnel::dielectric(o.dot(m), self.coat.ior) * value, pdf))
    }

    fn sample(&self, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let local = self.frame.to_local(wo);
        let up = self.coat.ggx.sample_reflection(lift(local), u)?;
        let wi = self.frame.from_local(lower_like(up, local));
        (wo.z * wi.z > 0.0).then_some(wi)
    }

    /// The mirror image in a smooth coat.
    fn branch(&self, wo: Vec3, unit: SampledSpectrum) -> Option<SpecularBranch> {
        if !self.coat.ggx.is_smooth() {
            return None;
        }
        let local = self.frame.to_local(wo);
        let reflectance = fresnel::dielectric(local.z.abs(), self.coat.ior) * self.coat.weight;
        let branch = mirror_branch(local, unit * reflectance);
        let wi = self.frame.from_local(branch.wi);
        (wo.z * wi.z > 0.0).then_some(SpecularBranch { wi, ..branch })
    }
}

impl Lobes for OpenPbrBsdf {
    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.eval_and_pdf(wo, wi).0
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_and_pdf(wo, wi).1
    }

    fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        if wo.z * wi.z == 0.0 {
            return (SampledSpectrum::ZERO, 0.0);
        }
        if self.is_inside(wo) {
            return self.inside(wo, wi);
        }
        let fuzz = self.fuzz_lobe(wo);
        self.value_and_pdf(&self.choice(wo, &fuzz), wo, wi, &fuzz)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        if self.is_inside(wo) {
            return self.sample_inside(wo, u_lobe, u);
        }
        let fuzz = self.fuzz_lobe(wo);
        let choice = self.choice(wo, &fuzz);
        let (lobe, rest) = choice.pick(u_lobe)?;
        let (p, under) = (choice.probabilities[lobe], Self::under_fuzz(&fuzz));
        let wi = match lobe {
            FUZZ => lower_like(fuzz.as_ref()?.1.sample(u), wo),
            COAT => {
                let coat = self.coat.as_ref()?;
                if let Some(branch) = coat.branch(wo, self.unit) {
                    return Some(SpecularBranch { weight: branch.weight * under, ..branch }.sample(p));
                }
                coat.sample(wo, u)?
            }
            METAL | OPAQUE | TRANSLUCENT => {
                let (weight, slab) = self.slabs()[lobe]?;
                let below = slab.sample(wo, rest, u)?;
                if below.is_delta {
                    let weight = below.weight * self.unit * self.under_coat(wo, below.wi) * (under * weight / p);
                    return Some(BsdfSample { weight, ..below });
                }
                below.wi
            }
            _ => return None,
        };
        let (value, pdf) = self.value_and_pdf(&choice, wo, wi, &fuzz);
        BsdfSample::of(wi, value, pdf, wo.z * wi.z < 0.0)
    }

    fn is_delta(&self) -> bool {
        self.fuzz.is_none()
            && self.coat.as_ref().is_none_or(|c| c.coat.ggx.is_smooth())
            && self.slabs().iter().flatten().all(|(_, slab)| slab.is_delta())
    }

    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        let Some((share, body)) = self.slabs.opaque.as_ref().filter(|_| !self.is_inside(wo)) else {
            return SampledSpectrum::ZERO;
        };
        let factor = self.unit * self.under_coat(wo, wi) * (share * Self::under_fuzz(&self.fuzz_lobe(wo)));
        body.diffuse(wo, wi) * factor
    }

    fn is_opaque(&self) -> bool {
        !self.has_inside() && self.slabs().iter().flatten().all(|(_, slab)| slab.is_opaque())
    }

    fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        if self.is_inside(wo) {
            return self.unit;
        }
        let fuzz = self.fuzz_lobe(wo);
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        let base: SampledSpectrum = self.slab_albedos(wo).into_iter().sum();
        let coat = self.coat.as_ref().map_or(0.0, |c| c.reflected(wo) * c.coat.weight);
        let coated = base * self.under_coat(wo, mirror) + self.unit * coat;
        let top = fuzz.as_ref().map_or(SampledSpectrum::ZERO, |(f, lobe)| f.color * (f.weight * lobe.reflectance));
        coated * Self::under_fuzz(&fuzz) + top * self.unit
    }

    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        let base: SampledSpectrum = self.slabs().into_iter().flatten().map(|(w, slab)| slab.ambient(wo) * w).sum();
        base * self.unit * self.under_coat(wo, mirror) * Self::under_fuzz(&self.fuzz_lobe(wo))
    }

    fn crossing_scale(&self, wo: Vec3) -> f32 {
        match &self.slabs.translucent {
            Some((_, Translucent::Solid(b))) => b.crossing_scale(wo),
            _ => 1.0,
        }
    }

    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        let under = Self::under_fuzz(&self.fuzz_lobe(wo));
        let mut found: [Option<SpecularBranch>; 2] = [None, None];
        let coat = self.coat.as_ref().and_then(|coat| coat.branch(wo, self.unit * under));
        let below = self.slabs().into_iter().flatten().flat_map(|(weight, slab)| {
            slab.specular_branches(wo).into_iter().flatten().map(move |b| {
                let factor = self.unit * self.under_coat(wo, b.wi) * (weight * under);
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
