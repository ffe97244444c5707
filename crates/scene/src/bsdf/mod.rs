//! The lobes that materials are made of, in the local frame: `z` is the shading normal on the outer side of the surface.
//!
//! Directions are unit vectors that point away from the surface. `wo` goes to where light is gathered (the camera), `wi` to where
//! it comes from. Opaque BSDFs reflect on both sides; dielectrics are outside where `z > 0`.

mod black;
mod conductor;
mod dielectric;
mod diffuse;
mod energy;
mod film;
pub mod fresnel;
mod fuzz;
mod ggx;
mod glossy;
mod hair;
mod mirror;
mod open_pbr;
mod phong;
mod sheet;
#[cfg(test)]
mod tests;

pub use black::BlackBsdf;
pub use conductor::{ConductorBsdf, FacetReflectance};
pub use dielectric::{DielectricBsdf, Split};
pub use diffuse::DiffuseBsdf;
pub use film::ThinFilm;
pub use ggx::Ggx;
pub use glossy::{Body, Gloss, GlossyBsdf};
pub use hair::{HairBsdf, HairFiber};
pub use mirror::MirrorBsdf;
pub use open_pbr::{Coat, Fuzz, OpenPbrBsdf, Slabs, Translucent};
pub use phong::{PhongBsdf, PhongCoefficients};
pub use sheet::SheetBsdf;

use snell_math::{SampledSpectrum, Vec2, Vec3};

/// A direction drawn from a BSDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where the path goes on.
    pub wi: Vec3,
    /// `f |cos| / pdf` (for a delta lobe: its factor over the probability of choosing it).
    pub weight: SampledSpectrum,
    /// Density per steradian of this direction over all non-delta lobes; 0 for a delta direction.
    pub pdf: f32,
    /// True if the direction is the only one possible (mirror, smooth refraction): light samples cannot find it.
    pub is_delta: bool,
    /// True if the path crosses the surface.
    pub is_transmission: bool,
}

impl BsdfSample {
    /// The sample of a direction with its value (`f |cos|`) and density. `None` if the density is 0.
    fn of(wi: Vec3, value: SampledSpectrum, pdf: f32, is_transmission: bool) -> Option<Self> {
        (pdf > 0.0).then(|| Self { wi, weight: value / pdf, pdf, is_delta: false, is_transmission })
    }
}

/// Probabilities of `N` lobes. They add up to 1, or are all 0 if no lobe has anything to give.
#[derive(Clone, Copy, Debug)]
struct Choice<const N: usize> {
    probabilities: [f32; N],
}

impl<const N: usize> Choice<N> {
    /// In proportion to the lobes' albedos.
    fn new(albedos: [SampledSpectrum; N]) -> Self {
        let sums = albedos.map(|s| s.0.iter().sum::<f32>().max(0.0));
        let total: f32 = sums.iter().sum();
        Self { probabilities: if total > 0.0 && total.is_finite() { sums.map(|x| x / total) } else { [0.0; N] } }
    }

    /// The lobe that a number in `[0, 1)` stands for, and a number in `[0, 1)` for use in that lobe.
    fn pick(&self, u: f32) -> Option<(usize, f32)> {
        let mut rest = u;
        for (i, &p) in self.probabilities.iter().enumerate() {
            if rest < p {
                return Some((i, (rest / p).min(1.0 - f32::EPSILON)));
            }
            rest -= p;
        }
        // Rounding may leave a little over.
        self.probabilities.iter().rposition(|&p| p > 0.0).map(|i| (i, 1.0 - f32::EPSILON))
    }
}

/// One direction of perfect reflection or refraction with its factor: what Whitted's recursion follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularBranch {
    /// The direction.
    pub wi: Vec3,
    /// Factor on the radiance from there.
    pub weight: SampledSpectrum,
    /// True if the branch crosses the surface.
    pub is_transmission: bool,
}

/// What every BSDF answers.
pub trait Lobes {
    /// `f(wo, wi) |cos(wi)|` without delta lobes.
    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum;

    /// Density per steradian with which [`Self::sample`] draws `wi`, without delta lobes.
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32;

    /// [`Self::eval`] and [`Self::pdf`]: much of the work is the same.
    fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        (self.eval(wo, wi), self.pdf(wo, wi))
    }

    /// Draws a direction. `u_lobe` chooses the lobe, `u` the direction, all in `[0, 1)`. `None` if the path ends.
    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample>;

    /// True if there is no lobe but delta lobes: light samples are useless.
    fn is_delta(&self) -> bool;

    /// True if [`Self::eval`] is 0 for directions on opposite sides: lights behind the surface need no samples. Delta lobes do not count.
    fn is_opaque(&self) -> bool {
        false
    }

    /// Approximate share of light that is reflected or transmitted towards `wo`: what the albedo AOV shows.
    fn albedo(&self, wo: Vec3) -> SampledSpectrum;

    /// What diffuse reflection adds to [`Self::eval`]: for layers that show it apart.
    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        let _ = (wo, wi);
        SampledSpectrum::ZERO
    }

    /// `pi f(wo, wi) |cos(wi)|`, or what a classic formula has in its place (Phong): `raycast` and `whitted` add this times
    /// `irradiance / pi` per light, with the irradiance of a surface that faces the light.
    fn eval_classic(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.eval(wo, wi) * std::f32::consts::PI
    }

    /// Reflectance for ambient light: what `raycast` and `whitted` multiply the scene's ambient radiance by.
    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        self.albedo(wo)
    }

    /// Factor that undoes the change of radiance by refraction, for a path that crosses the surface as seen from `wo`. Russian
    /// roulette needs it: throughput inside glass is small without being unimportant.
    fn crossing_scale(&self, wo: Vec3) -> f32 {
        let _ = wo;
        1.0
    }

    /// Perfect reflection and refraction, at most two.
    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        let _ = wo;
        [None, None]
    }
}

/// Makes [`Bsdf`] from the list of BSDFs: the enum and its dispatch.
macro_rules! bsdfs {
    ($($kind:ident => $type:ty,)*) => {
        /// Any BSDF, with parameters fixed for one point.
        #[derive(Clone, Debug)]
        pub enum Bsdf {
            $(#[doc = concat!("`", stringify!($type), "`.")] $kind($type),)*
        }

        impl Lobes for Bsdf {
            fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum { match self { $(Self::$kind(b) => b.eval(wo, wi),)* } }
            fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum { match self { $(Self::$kind(b) => b.diffuse(wo, wi),)* } }
            fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 { match self { $(Self::$kind(b) => b.pdf(wo, wi),)* } }
            fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) { match self { $(Self::$kind(b) => b.eval_and_pdf(wo, wi),)* } }
            fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> { match self { $(Self::$kind(b) => b.sample(wo, u_lobe, u),)* } }
            fn is_delta(&self) -> bool { match self { $(Self::$kind(b) => b.is_delta(),)* } }
            fn is_opaque(&self) -> bool { match self { $(Self::$kind(b) => b.is_opaque(),)* } }
            fn albedo(&self, wo: Vec3) -> SampledSpectrum { match self { $(Self::$kind(b) => b.albedo(wo),)* } }
            fn eval_classic(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum { match self { $(Self::$kind(b) => b.eval_classic(wo, wi),)* } }
            fn ambient(&self, wo: Vec3) -> SampledSpectrum { match self { $(Self::$kind(b) => b.ambient(wo),)* } }
            fn crossing_scale(&self, wo: Vec3) -> f32 { match self { $(Self::$kind(b) => b.crossing_scale(wo),)* } }
            fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] { match self { $(Self::$kind(b) => b.specular_branches(wo),)* } }
        }
    };
}

bsdfs! {
    Black => BlackBsdf,
    Diffuse => DiffuseBsdf,
    Phong => PhongBsdf,
    Mirror => MirrorBsdf,
    Conductor => ConductorBsdf,
    Dielectric => DielectricBsdf,
    Glossy => GlossyBsdf,
    OpenPbr => Box<OpenPbrBsdf>,
    Hair => HairBsdf,
}

/// `x` in `[0, most]`; NaN counts as 0.
pub(crate) fn bounded(x: f32, most: f32) -> f32 {
    if x > 0.0 { x.min(most) } else { 0.0 }
}

/// The direction, mirrored to the upper side if it lies below.
#[inline(always)]
fn lift(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, w.z.abs())
}

/// Undoes [`lift`] for a direction found with `wo` lifted: mirrored if `wo` lies below.
#[inline(always)]
fn lower_like(w: Vec3, wo: Vec3) -> Vec3 {
    if wo.z < 0.0 { Vec3::new(w.x, w.y, -w.z) } else { w }
}
