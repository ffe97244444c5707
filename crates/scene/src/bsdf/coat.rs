//! A clear coat over a base: the coat of [`super::OpenPbrBsdf`].

mod batch;

use super::energy::{DielectricReflection, Directional};
use super::ggx::Ggx;
use super::microfacets::Facets;
use super::mirror::mirror_branch;
use super::{Microfacets, SpecularBranch, fresnel, lift, lower_like};
use snell_math::{Frame, SampledSpectrum, Vec2, Vec3, real};

pub(super) use batch::BatchCoated;

/// A clear coat.
#[derive(Clone, Copy, Debug)]
pub struct Coat {
    /// Share of the surface that it covers, `[0, 1]`.
    pub weight: f32,
    /// Roughness of its surface.
    pub ggx: Ggx,
    /// Index of refraction over that of the outside.
    pub ior: f32,
    /// Transmittance for light that crosses it twice at normal incidence.
    pub color: SampledSpectrum,
    /// Strength of the darkening by reflections inside the coat, `[0, 1]`.
    pub darkening: f32,
    /// Roughness of the base, `[0, 1]`, for the darkening.
    pub base_roughness: f32,
}

impl Coat {
    /// Share of light from below that passes it once, towards a direction of this cosine.
    pub(crate) fn passed_once(&self, cos: f32) -> SampledSpectrum {
        let ior = self.outer_ior();
        let w = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        let reflected = DielectricReflection::new(self.ggx.into(), ior).towards(w);
        let left = transmitted(self.color, 0.5 * way(cos, ior));
        SampledSpectrum::ONE.lerp(left * (1.0 - reflected), self.weight)
    }

    /// Its index of refraction, or the inverse if it is below 1.
    fn outer_ior(&self) -> f32 {
        if self.ior < 1.0 { 1.0 / self.ior } else { self.ior }
    }
}

/// Path length through a coat of this index over its thickness, from a direction of this cosine.
fn way(cos: f32, ior: f32) -> f32 {
    1.0 / (1.0 - (1.0 - cos * cos).max(0.0) / (ior * ior)).max(1e-4).sqrt()
}

/// The transmittance of a coat over this many thicknesses, by that over one.
fn transmitted(color: SampledSpectrum, thicknesses: f32) -> SampledSpectrum {
    color.map(|c| if c >= 1.0 { 1.0 } else { real::powf(c.max(0.0), thicknesses) })
}

/// The upper side of a coat with this distribution of facets and albedo, without its colour and in
/// its own frame.
#[derive(Clone, Copy, Debug)]
struct CoatInterface<M, A> {
    /// As in [`Coat`].
    weight: f32,
    /// At least 1.
    ior: f32,
    microfacets: M,
    /// Share of light that a coat of weight 1 reflects.
    albedo: A,
    /// As in [`Coat`].
    darkening: f32,
    base_roughness: f32,
    /// Share of diffuse light that is reflected back inside the coat.
    diffuse_reflection: f32,
}

impl<M: Facets, A: Directional> CoatInterface<M, A> {
    /// Share of light that a coat of weight 1 reflects towards a direction above.
    #[inline(always)]
    fn reflected(&self, w: Vec3) -> f32 {
        if self.microfacets.is_smooth() {
            fresnel::dielectric(w.z, self.ior)
        } else {
            self.albedo.towards(w)
        }
    }

    /// Factor on a base of this albedo, by reflections inside the coat, seen at this cosine.
    #[inline(always)]
    fn darkened(&self, base_albedo: SampledSpectrum, cos: f32) -> SampledSpectrum {
        let smooth = fresnel::dielectric(cos, self.ior);
        let k = smooth + (self.diffuse_reflection - smooth) * self.base_roughness;
        let darkened = base_albedo.map(|e| (1.0 - k) / (1.0 - e.min(1.0) * k).max(1e-4));
        SampledSpectrum::ONE.lerp(darkened, self.weight * self.darkening)
    }

    /// Factor on the base for reflection by the coat, and for absorption in it that leaves this
    /// share.
    #[inline(always)]
    fn passed(&self, reflected: f32, left: SampledSpectrum) -> SampledSpectrum {
        SampledSpectrum::ONE.lerp(left * (1.0 - reflected), self.weight)
    }

    /// Value for a rough coat of weight 1, and density, for directions above.
    #[inline(always)]
    fn value_and_pdf(&self, wo: Vec3, wi: Vec3) -> (f32, f32) {
        let (m, value, pdf, exists) = self.microfacets.get().reflected(wo, wi);
        let value = if exists { fresnel::dielectric(wo.dot(m), self.ior) * value } else { 0.0 };
        (value, if exists { pdf } else { 0.0 })
    }
}

/// A coat on a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoatLobe {
    interface: CoatInterface<Microfacets, DielectricReflection>,
    /// As in [`Coat`].
    color: SampledSpectrum,
    frame: Frame,
    /// Albedo of the base at normal incidence.
    base_albedo: SampledSpectrum,
}

/// A coat seen from a direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoatSeen {
    wo: Vec3,
    /// The direction in the frame of the coat.
    local: Vec3,
    /// Share of light that a coat of weight 1 reflects.
    pub(super) reflected: f32,
    /// Path length through the coat over its thickness.
    way: f32,
    /// Factor on the base, by reflections inside the coat.
    darkened: SampledSpectrum,
}

impl CoatLobe {
    /// A coat over a base of this albedo at normal incidence.
    pub(super) fn new(coat: Coat, base_albedo: SampledSpectrum) -> Self {
        let Coat { weight, ggx, color, darkening, base_roughness, .. } = coat;
        let ior = coat.outer_ior();
        let interface = CoatInterface {
            weight,
            ior,
            microfacets: ggx.into(),
            albedo: DielectricReflection::new(ggx.into(), ior),
            darkening,
            base_roughness,
            diffuse_reflection: 1.0 - (1.0 - fresnel::dielectric_average(ior)) / (ior * ior),
        };
        let frame = Frame { x: Vec3::X, y: Vec3::Y, z: Vec3::Z };
        Self { interface, color, frame, base_albedo }
    }

    /// True if it has no colour, in the lanes in use: those where `unit` is not 0.
    pub(super) fn is_clear(&self, unit: SampledSpectrum) -> bool {
        self.color
            .zip(unit, |c, unit| if unit == 0.0 { 1.0 } else { c })
            .0
            .iter()
            .all(|&c| c >= 1.0)
    }

    /// As [`Ggx::has_tangent`].
    pub(super) fn has_tangent(&self) -> bool {
        self.interface.microfacets.has_tangent()
    }

    /// The coat in another frame.
    pub(super) fn with_frame(self, frame: Frame) -> Self {
        Self { frame, ..self }
    }

    /// Share of the surface that it covers.
    pub(super) fn weight(&self) -> f32 {
        self.interface.weight
    }

    /// True if its reflection is a delta lobe.
    pub(super) fn is_smooth(&self) -> bool {
        self.interface.microfacets.is_smooth()
    }

    /// Path length through the coat over its thickness.
    fn way(&self, w: Vec3) -> f32 {
        way(self.frame.z.dot(w), self.interface.ior)
    }

    pub(super) fn seen(&self, wo: Vec3) -> CoatSeen {
        let local = self.frame.to_local(wo);
        CoatSeen {
            wo,
            local,
            reflected: self.interface.reflected(lift(local)),
            way: self.way(wo),
            darkened: self.interface.darkened(self.base_albedo, self.frame.z.dot(wo).abs()),
        }
    }

    /// Factor on the base: for reflection by the coat, absorption in it, and darkening by
    /// reflections inside it.
    pub(super) fn passed(&self, seen: &CoatSeen, wi: Vec3) -> SampledSpectrum {
        // Light that goes through the base crosses the coat once.
        let way = seen.way + if seen.wo.z * wi.z > 0.0 { self.way(wi) } else { 0.0 };
        let left = transmitted(self.color, 0.5 * way);
        self.interface.passed(seen.reflected, left) * seen.darkened
    }

    /// Value for a coat of weight 1, and density.
    pub(super) fn value_and_pdf(&self, seen: &CoatSeen, wi: Vec3) -> (f32, f32) {
        let (o, i) = (seen.local, self.frame.to_local(wi));
        if o.z * i.z <= 0.0 || seen.wo.z * wi.z <= 0.0 || self.is_smooth() {
            return (0.0, 0.0);
        }
        self.interface.value_and_pdf(lift(o), lift(i))
    }

    /// Draws a direction of reflection.
    pub(super) fn sample(&self, seen: &CoatSeen, u: Vec2) -> Option<Vec3> {
        let (up, exists) = self.interface.microfacets.drawn_reflection(lift(seen.local), u);
        let wi = self.frame.from_local(lower_like(up, seen.local));
        (exists && seen.wo.z * wi.z > 0.0).then_some(wi)
    }

    /// The mirror image in a smooth coat.
    pub(super) fn branch(&self, wo: Vec3, unit: SampledSpectrum) -> Option<SpecularBranch> {
        if !self.is_smooth() {
            return None;
        }
        let local = self.frame.to_local(wo);
        let reflectance = self.interface.reflected(lift(local)) * self.weight();
        let branch = mirror_branch(local, unit * reflectance);
        let wi = self.frame.from_local(branch.wi);
        (wo.z * wi.z > 0.0).then_some(SpecularBranch { wi, ..branch })
    }
}
