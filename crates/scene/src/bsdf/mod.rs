//! The lobes that materials are made of, in the local frame: `z` is the shading normal on the outer
//! side of the surface.
//!
//! Directions are unit vectors that point away from the surface. `wo` points towards the viewer
//! (the camera), `wi` towards the light. Opaque BSDFs reflect on both sides; dielectrics are
//! outside where `z > 0`.

mod batch;
mod beckmann;
mod black;
mod branchless;
mod coat;
mod conductor;
mod dielectric;
mod diffuse;
mod energy;
#[cfg(test)]
mod facet_walk;
mod film;
pub mod fresnel;
#[cfg(test)]
mod furnace;
mod fuzz;
mod ggx;
mod glossy;
mod hair;
mod microfacets;
mod mirror;
mod open_pbr;
mod phong;
mod sheet;
#[cfg(test)]
mod tests;
mod widths;

pub use batch::{BATCH, BatchBsdf, BatchInputs, BatchOutputs, BatchPoint, LobeSpectra};
pub use beckmann::Beckmann;
pub use black::BlackBsdf;
pub use coat::Coat;
pub use conductor::{ComplexIor, ConductorBsdf, ConductorSeen, F82, FacetReflectance};
pub use dielectric::{DielectricBsdf, DielectricSeen, Interface, Split};
pub use diffuse::DiffuseBsdf;
pub use film::ThinFilm;
pub use fuzz::{Fuzz, FuzzModel};
pub use ggx::Ggx;
pub use glossy::{Body, Gloss, GlossyBsdf, GlossySeen};
pub use hair::{HairBsdf, HairFiber, HairSeen};
pub use microfacets::{MicrofacetShape, Microfacets};
pub use mirror::MirrorBsdf;
pub use open_pbr::{OpenPbrBsdf, OpenPbrSeen, Slabs, Translucent, TranslucentSeen};
pub use phong::{PhongBsdf, PhongCoefficients};
pub use sheet::{SheetBsdf, SheetSeen};
pub use widths::Widths;

use snell_math::simd::{min, select};
use snell_math::{SampledSpectrum, Vec2, Vec3, angles};
use std::f32::consts::PI;

/// A direction sampled from a BSDF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// The direction in which the path continues.
    pub wi: Vec3,
    /// `f |cos| / pdf`; for a delta lobe its factor, divided by the probability of choosing the
    /// lobe.
    pub weight: SampledSpectrum,
    /// Density per steradian of this direction, summed over all lobes that are not delta lobes; 0
    /// if a delta lobe was sampled.
    pub pdf: f32,
    /// True if a delta lobe was sampled, which has a single direction (mirror, smooth refraction).
    /// No light sample could find that direction.
    pub is_delta: bool,
    /// True if the path crosses the surface.
    pub is_transmission: bool,
}

impl BsdfSample {
    /// A sample of a direction, from the value `f |cos|` and the density. `None` if the density is
    /// 0.
    fn of(wi: Vec3, value: SampledSpectrum, pdf: f32, is_transmission: bool) -> Option<Self> {
        (pdf > 0.0).then(|| Self { wi, weight: value / pdf, pdf, is_delta: false, is_transmission })
    }
}

/// Probabilities of choosing among `N` lobes. They add up to 1, or are all 0 if no lobe has any
/// energy.
#[derive(Clone, Copy, Debug)]
struct Choice<const N: usize> {
    probabilities: [f32; N],
}

impl<const N: usize> Choice<N> {
    /// Probabilities in proportion to the lobes' albedos.
    #[inline(always)]
    fn new(albedos: [SampledSpectrum; N]) -> Self {
        let (mut probabilities, mut total) = ([0.0; N], 0.0);
        for (probability, SampledSpectrum([a, b, c, d])) in probabilities.iter_mut().zip(&albedos) {
            *probability = (a + b + c + d).max(0.0);
            total += *probability;
        }
        let is_sound = (total > 0.0) & (total < f32::INFINITY);
        for probability in &mut probabilities {
            *probability = if is_sound { *probability / total } else { 0.0 };
        }
        Self { probabilities }
    }

    /// The lobe that a number in `[0, 1)` chooses, and a new number in `[0, 1)` for use in that
    /// lobe. `None` if all probabilities are 0.
    fn pick(&self, u: f32) -> Option<(usize, f32)> {
        let mut rest = u;
        for (i, &p) in self.probabilities.iter().enumerate() {
            if rest < p {
                return Some((i, (rest / p).min(1.0 - f32::EPSILON)));
            }
            rest -= p;
        }
        // Rounding may leave a small remainder, which belongs to the last lobe.
        self.probabilities.iter().rposition(|&p| p > 0.0).map(|i| (i, 1.0 - f32::EPSILON))
    }
}

impl Choice<2> {
    /// Whether a number in `[0, 1)` chooses the first of two lobes, and whether it chooses any. The
    /// result is that of [`Self::pick`], without branches.
    #[inline(always)]
    fn picks_first(&self, u: f32) -> (bool, bool) {
        let [first, second] = self.probabilities;
        ((u < first) | (second <= 0.0), (first > 0.0) | (second > 0.0))
    }

    /// The result of [`Self::picks_first`], and a new number in `[0, 1)` for use in the lobe.
    #[inline(always)]
    fn picked(&self, u: f32) -> (bool, bool, f32) {
        let [first, second] = self.probabilities;
        let (is_first, exists) = self.picks_first(u);
        let (from, of) = if is_first { (u, first) } else { (u - first, second) };
        (
            is_first,
            exists,
            if from < of { min(from / of, 1.0 - f32::EPSILON) } else { 1.0 - f32::EPSILON },
        )
    }
}

/// A direction of perfect reflection or refraction with its factor. Whitted's recursion follows
/// these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularBranch {
    /// The direction.
    pub wi: Vec3,
    /// Factor on the radiance from that direction.
    pub weight: SampledSpectrum,
    /// True if the branch crosses the surface.
    pub is_transmission: bool,
}

/// A direction sampled from a BSDF, before its value and density are computed.
#[derive(Clone, Copy, Debug)]
pub enum Drawn {
    /// A direction of a delta lobe, with its weight.
    Delta(BsdfSample),
    /// Any other direction.
    Direction {
        /// The direction in which the path continues.
        wi: Vec3,
        /// True if the path crosses the surface.
        is_transmission: bool,
    },
}

/// The interface of all BSDFs.
///
/// Much of the work depends on `wo` alone. [`Self::seen`] does that work once, and the methods
/// whose names end in `_from` use its result for any number of evaluations. Methods that take `wo`
/// are for single evaluations.
pub trait Lobes: Sized {
    /// The precomputed state for `wo`.
    type Seen: Clone + std::fmt::Debug;

    /// The BSDF as seen from `wo`.
    fn seen(&self, wo: Vec3) -> Self::Seen;

    /// `f(wo, wi) |cos(wi)|`, and the density per steradian with which [`Self::sample_from`]
    /// samples `wi`. Both exclude delta lobes.
    fn value_and_pdf_from(&self, seen: &Self::Seen, wi: Vec3) -> (SampledSpectrum, f32);

    /// Samples a direction. `u_lobe` chooses the lobe, `u` the direction, all in `[0, 1)`. `None`
    /// if the path ends.
    fn draw_from(&self, seen: &Self::Seen, u_lobe: f32, u: Vec2) -> Option<Drawn>;

    /// Approximate fraction of light that is reflected or transmitted towards `wo`. The albedo AOV
    /// shows it.
    fn albedo_from(&self, seen: &Self::Seen) -> SampledSpectrum;

    /// [`Self::draw_from`], with the sample's weight and density.
    fn sample_from(&self, seen: &Self::Seen, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        match self.draw_from(seen, u_lobe, u)? {
            Drawn::Delta(sample) => Some(sample),
            Drawn::Direction { wi, is_transmission } => {
                let (value, pdf) = self.value_and_pdf_from(seen, wi);
                BsdfSample::of(wi, value, pdf, is_transmission)
            }
        }
    }

    /// [`Self::value_and_pdf_from`] for a single evaluation.
    fn eval_and_pdf(&self, wo: Vec3, wi: Vec3) -> (SampledSpectrum, f32) {
        self.value_and_pdf_from(&self.seen(wo), wi)
    }

    /// `f(wo, wi) |cos(wi)|` without delta lobes.
    fn eval(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.eval_and_pdf(wo, wi).0
    }

    /// Density per steradian with which [`Self::sample`] samples `wi`, without delta lobes.
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_and_pdf(wo, wi).1
    }

    /// [`Self::sample_from`] for a single evaluation.
    fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        self.sample_from(&self.seen(wo), u_lobe, u)
    }

    /// [`Self::albedo_from`] for a single evaluation.
    fn albedo(&self, wo: Vec3) -> SampledSpectrum {
        self.albedo_from(&self.seen(wo))
    }

    /// True if all lobes are delta lobes, so that light samples are useless.
    fn is_delta(&self) -> bool;

    /// True if [`Self::eval`] is 0 for directions on opposite sides, so that lights behind the
    /// surface need no samples. Delta lobes do not count.
    fn is_opaque(&self) -> bool {
        false
    }

    /// The diffuse part of [`Self::eval`], for AOVs that separate diffuse reflection.
    fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        let _ = (wo, wi);
        SampledSpectrum::ZERO
    }

    /// `pi f(wo, wi) |cos(wi)|`, or the classic formula in its place (Phong). For each light,
    /// `raycast` and `whitted` add this value times `irradiance / pi`, with the irradiance of a
    /// surface that faces the light.
    fn eval_classic(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
        self.eval(wo, wi) * PI
    }

    /// Reflectance for ambient light. `raycast` and `whitted` multiply the scene's ambient radiance
    /// by it.
    fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        self.albedo(wo)
    }

    /// The factor that undoes the change of radiance by refraction, for a path that arrives along
    /// `wo` and crosses the surface. Russian roulette needs it, because throughput inside glass is
    /// small without being unimportant.
    fn crossing_scale(&self, wo: Vec3) -> f32 {
        let _ = wo;
        1.0
    }

    /// The directions of perfect reflection and refraction, at most two.
    fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
        let _ = wo;
        [None, None]
    }
}

/// Makes, from a list of BSDFs, the enum of the BSDFs, the enum of their precomputed states for a
/// direction, and the implementation of [`Lobes`] that dispatches.
macro_rules! bsdfs {
    ($(#[$doc:meta])* $name:ident, $(#[$seen_doc:meta])* $seen:ident,
        $($kind:ident => $type:ty, $known:ty;)*) => {
        $(#[$doc])*
        #[allow(
            clippy::large_enum_variant,
            reason = "BSDFs are short-lived or prepared once, and hold places in tables"
        )]
        pub enum $name {
            $(#[doc = concat!("`", stringify!($type), "`.")] $kind($type),)*
        }

        $(#[$seen_doc])*
        #[derive(Clone, Debug)]
        pub enum $seen {
            $(#[doc = concat!("By `", stringify!($type), "`.")] $kind($known),)*
        }

        impl Lobes for $name {
            type Seen = $seen;

            fn seen(&self, wo: Vec3) -> $seen {
                match self { $(Self::$kind(b) => $seen::$kind(b.seen(wo)),)* }
            }
            fn value_and_pdf_from(&self, seen: &$seen, wi: Vec3) -> (SampledSpectrum, f32) {
                match (self, seen) {
                    $((Self::$kind(b), $seen::$kind(seen)) => b.value_and_pdf_from(seen, wi),)*
                    _ => unreachable!("a BSDF is asked with what it has seen itself"),
                }
            }
            fn draw_from(&self, seen: &$seen, u_lobe: f32, u: Vec2) -> Option<Drawn> {
                match (self, seen) {
                    $((Self::$kind(b), $seen::$kind(seen)) => b.draw_from(seen, u_lobe, u),)*
                    _ => unreachable!("a BSDF is asked with what it has seen itself"),
                }
            }
            fn sample_from(&self, seen: &$seen, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
                match (self, seen) {
                    $((Self::$kind(b), $seen::$kind(seen)) => b.sample_from(seen, u_lobe, u),)*
                    _ => unreachable!("a BSDF is asked with what it has seen itself"),
                }
            }
            fn albedo_from(&self, seen: &$seen) -> SampledSpectrum {
                match (self, seen) {
                    $((Self::$kind(b), $seen::$kind(seen)) => b.albedo_from(seen),)*
                    _ => unreachable!("a BSDF is asked with what it has seen itself"),
                }
            }
            fn albedo(&self, wo: Vec3) -> SampledSpectrum {
                match self { $(Self::$kind(b) => b.albedo(wo),)* }
            }
            fn diffuse(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
                match self { $(Self::$kind(b) => b.diffuse(wo, wi),)* }
            }
            fn is_delta(&self) -> bool {
                match self { $(Self::$kind(b) => b.is_delta(),)* }
            }
            fn is_opaque(&self) -> bool {
                match self { $(Self::$kind(b) => b.is_opaque(),)* }
            }
            fn eval_classic(&self, wo: Vec3, wi: Vec3) -> SampledSpectrum {
                match self { $(Self::$kind(b) => b.eval_classic(wo, wi),)* }
            }
            fn ambient(&self, wo: Vec3) -> SampledSpectrum {
                match self { $(Self::$kind(b) => b.ambient(wo),)* }
            }
            fn crossing_scale(&self, wo: Vec3) -> f32 {
                match self { $(Self::$kind(b) => b.crossing_scale(wo),)* }
            }
            fn specular_branches(&self, wo: Vec3) -> [Option<SpecularBranch>; 2] {
                match self { $(Self::$kind(b) => b.specular_branches(wo),)* }
            }
        }
    };
}
use bsdfs;

bsdfs! {
    /// Any BSDF, with parameters fixed for one point.
    #[derive(Clone, Debug)]
    Bsdf,
    /// The precomputed state of a BSDF for a direction.
    BsdfSeen,
    Black => BlackBsdf, Vec3;
    Diffuse => DiffuseBsdf, Vec3;
    Phong => PhongBsdf, Vec3;
    Mirror => MirrorBsdf, Vec3;
    Conductor => ConductorBsdf, ConductorSeen;
    Dielectric => DielectricBsdf, DielectricSeen;
    Glossy => GlossyBsdf, GlossySeen;
    OpenPbr => Box<OpenPbrBsdf>, Box<OpenPbrSeen>;
    Hair => HairBsdf, HairSeen;
}

impl Bsdf {
    /// True if tangents matter.
    pub(crate) fn has_tangent(&self) -> bool {
        match self {
            Self::Black(_) | Self::Diffuse(_) | Self::Phong(_) | Self::Mirror(_) => false,
            Self::Dielectric(dielectric) => dielectric.has_tangent(),
            Self::Conductor(conductor) => conductor.has_tangent(),
            Self::Glossy(glossy) => glossy.has_tangent(),
            Self::OpenPbr(layers) => layers.has_tangent(),
            Self::Hair(_) => true,
        }
    }

    /// [`Lobes::albedo`], if it is the same from all directions.
    pub fn albedo_from_anywhere(&self) -> Option<SampledSpectrum> {
        match self {
            Self::Diffuse(diffuse) if diffuse.is_lambertian() => Some(diffuse.albedo(Vec3::Z)),
            _ => None,
        }
    }
}

/// `x` clamped to `[0, most]`; NaN counts as 0.
pub(crate) fn bounded(x: f32, most: f32) -> f32 {
    if x > 0.0 { x.min(most) } else { 0.0 }
}

/// Sine and cosine of the angle that is the fraction `share`, in `[0, 1]`, of a full turn.
#[inline(always)]
fn turn(share: f32) -> (f32, f32) {
    let (sin, cos) = angles::sin_cos(f64::from(2.0 * PI * share));
    (sin as f32, cos as f32)
}

/// The vector normalised, or `other` if it has no direction. It has no branches.
#[inline(always)]
pub(crate) fn unit_or(v: Vec3, other: Vec3) -> Vec3 {
    let scale = 1.0 / v.length();
    select((scale > 0.0) & (scale < f32::INFINITY), v * scale, other)
}

/// The direction, mirrored to the upper side if it lies below.
#[inline(always)]
fn lift(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, w.z.abs())
}

/// Undoes [`lift`] for a direction found for the lifted `wo`: mirrors it if `wo` lies below.
#[inline(always)]
fn lower_like(w: Vec3, wo: Vec3) -> Vec3 {
    if wo.z < 0.0 { Vec3::new(w.x, w.y, -w.z) } else { w }
}
