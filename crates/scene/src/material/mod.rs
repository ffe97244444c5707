//! Materials: from a surface point to a BSDF, emission and opacity. One file per material, with its parameters.

mod diffuse;

pub use diffuse::Diffuse;

use crate::bsdf::{Bsdf, BsdfSample, Lobes, SpecularBranch};
use crate::graph::TextureId;
use crate::texture::TextureSet;
use serde::{Deserialize, Serialize};
use snell_intersect::SurfaceInteraction;
use snell_math::{ColorMode, Frame, Rgb, SampledSpectrum, Vec2, Vec3};

/// A colour parameter: a factor, times a texture if there is one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColorParam {
    /// Linear factor.
    pub factor: Rgb,
    /// Its RGB multiplies the factor.
    pub texture: Option<TextureId>,
}

impl ColorParam {
    /// A constant colour.
    pub const fn constant(factor: Rgb) -> Self {
        Self { factor, texture: None }
    }

    /// The colour at a point.
    pub fn at(&self, point: &ShadingPoint) -> Rgb {
        match self.texture {
            None => self.factor,
            Some(id) => {
                let [r, g, b, _] = point.textures.lookup(id, point.surface, point.footprint);
                self.factor * Rgb::new(r, g, b)
            }
        }
    }
}

impl From<Rgb> for ColorParam {
    fn from(factor: Rgb) -> Self {
        Self::constant(factor)
    }
}

/// A scalar parameter: a factor, times one channel of a texture if there is one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScalarParam {
    /// Factor.
    pub factor: f32,
    /// Texture and channel (0 red to 3 alpha) that multiplies the factor.
    pub texture: Option<(TextureId, u8)>,
}

impl ScalarParam {
    /// A constant.
    pub const fn constant(factor: f32) -> Self {
        Self { factor, texture: None }
    }

    /// The value at a point.
    pub fn at(&self, point: &ShadingPoint) -> f32 {
        match self.texture {
            None => self.factor,
            Some((id, channel)) => {
                self.factor * point.textures.lookup(id, point.surface, point.footprint)[usize::from(channel & 3)]
            }
        }
    }
}

impl From<f32> for ScalarParam {
    fn from(factor: f32) -> Self {
        Self::constant(factor)
    }
}

/// Everything a material may look at.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint<'a> {
    /// The point.
    pub surface: &'a SurfaceInteraction,
    /// Width of the ray's cone at the point, in world units (0: no filtering).
    pub footprint: f32,
    /// The scene's textures.
    pub textures: &'a TextureSet,
    /// What spectra mean.
    pub mode: ColorMode,
}

/// How opacity works.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Opaque where alpha is at least the cut-off, absent elsewhere.
    Mask(f32),
    /// Present with probability alpha.
    Blend,
}

/// A normal map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NormalMap {
    /// Linear texture with `2 rgb - 1` the normal in the tangent frame.
    pub texture: TextureId,
    /// Factor on its x and y.
    pub scale: f32,
}

/// A material: what light does at a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// For people.
    pub name: String,
    /// Reflection and transmission.
    pub kind: MaterialKind,
    /// Emitted radiance, W / (m^2 sr), on the sides that are visible.
    pub emission: ColorParam,
    /// True if the inner side emits too.
    pub emits_on_both_sides: bool,
    /// How `alpha` counts.
    pub alpha_mode: AlphaMode,
    /// Opacity, `[0, 1]`; multiplied by the vertex alpha.
    pub alpha: ScalarParam,
    /// False if rays from the inner side pass through as if nothing were there.
    pub double_sided: bool,
    /// Bends the shading normal.
    pub normal_map: Option<NormalMap>,
}

/// A BSDF and the frame it lives in.
#[derive(Clone, Debug)]
pub struct ShadingBsdf {
    /// The lobes.
    pub bsdf: Bsdf,
    /// Local frame; `z` is the shading normal (normal map applied) on the outer side.
    pub frame: Frame,
}

impl ShadingBsdf {
    /// [`Lobes::eval`] for world directions. Light does not leak through the surface whose geometric normal is `ng`.
    pub fn eval(&self, wo: Vec3, wi: Vec3, ng: Vec3) -> SampledSpectrum {
        let _ = ng;
        self.bsdf.eval(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// [`Lobes::pdf`] for world directions.
    pub fn pdf(&self, wo: Vec3, wi: Vec3, ng: Vec3) -> f32 {
        let _ = ng;
        self.bsdf.pdf(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// [`Lobes::sample`] for world directions.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2, ng: Vec3) -> Option<BsdfSample> {
        let _ = ng;
        let sample = self.bsdf.sample(self.frame.to_local(wo), u_lobe, u)?;
        Some(BsdfSample { wi: self.frame.from_local(sample.wi), ..sample })
    }

    /// [`Lobes::eval_classic`] for world directions.
    pub fn eval_classic(&self, wo: Vec3, wi: Vec3, ng: Vec3) -> SampledSpectrum {
        let _ = ng;
        self.bsdf.eval_classic(self.frame.to_local(wo), self.frame.to_local(wi))
    }

    /// [`Lobes::ambient`] for world directions.
    pub fn ambient(&self, wo: Vec3) -> SampledSpectrum {
        self.bsdf.ambient(self.frame.to_local(wo))
    }

    /// [`Lobes::is_delta`].
    pub fn is_delta(&self) -> bool {
        self.bsdf.is_delta()
    }

    /// [`Lobes::specular_branches`] in world directions.
    pub fn specular_branches(&self, wo: Vec3, ng: Vec3) -> [Option<SpecularBranch>; 2] {
        let _ = ng;
        let branches = self.bsdf.specular_branches(self.frame.to_local(wo));
        branches.map(|b| b.map(|b| SpecularBranch { wi: self.frame.from_local(b.wi), ..b }))
    }
}

impl Material {
    /// A material that does nothing but what `kind` says.
    pub fn new(name: impl Into<String>, kind: impl Into<MaterialKind>) -> Self {
        Self {
            name: name.into(),
            kind: kind.into(),
            emission: ColorParam::constant(Rgb::BLACK),
            emits_on_both_sides: false,
            alpha_mode: AlphaMode::Opaque,
            alpha: ScalarParam::constant(1.0),
            double_sided: true,
            normal_map: None,
        }
    }

    /// The same material, emitting this radiance.
    pub fn emitting(self, radiance: Rgb) -> Self {
        Self { emission: ColorParam::constant(radiance), ..self }
    }

    /// True if it can emit anywhere.
    pub fn is_emissive(&self) -> bool {
        !self.emission.factor.is_black()
    }

    /// True if hits must be asked about ([`Self::is_present`]).
    pub fn needs_filter(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque || !self.double_sided
    }

    /// Opacity at a point, `[0, 1]`: 0 or 1 for a mask.
    pub fn opacity(&self, point: &ShadingPoint) -> f32 {
        let alpha = || self.alpha.at(point) * point.surface.color[3];
        match self.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask(cutoff) => f32::from(alpha() >= cutoff),
            AlphaMode::Blend => alpha().clamp(0.0, 1.0),
        }
    }

    /// True if a ray of this direction meets the surface, false if it passes through: single-sided surfaces seen from inside,
    /// holes of a mask, and the share `1 - alpha` of blended ones, as decided by the uniform number `u`.
    pub fn is_present(&self, point: &ShadingPoint, ray_direction: Vec3, u: f32) -> bool {
        (self.double_sided || point.surface.is_front_facing(ray_direction)) && u < self.opacity(point)
    }

    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> ShadingBsdf {
        let frame = Frame::from_z_and_x(point.surface.shading_normal, point.surface.dpdu);
        ShadingBsdf { bsdf: self.kind.bsdf(point), frame }
    }

    /// Radiance emitted at a point towards `wo` (unit, world space).
    pub fn emitted(&self, point: &ShadingPoint, wo: Vec3) -> SampledSpectrum {
        if !self.is_emissive() || (!self.emits_on_both_sides && wo.dot(point.surface.geometric_normal) <= 0.0) {
            return SampledSpectrum::ZERO;
        }
        point.mode.illuminant(self.emission.at(point))
    }
}

/// Makes [`MaterialKind`] from the list of materials: the enum, its names, its dispatch.
macro_rules! materials {
    ($($name:literal => $kind:ident,)*) => {
        /// Any of the materials.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "material", rename_all = "kebab-case")]
        pub enum MaterialKind {
            $(#[doc = concat!("See [`", stringify!($kind), "`].")] $kind($kind),)*
        }

        impl MaterialKind {
            /// The names of all materials.
            pub const NAMES: &[&str] = &[$($name),*];

            /// The name of this kind.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$kind(_) => $name,)* }
            }

            /// A few of each kind, extremes included: what tests and galleries run over.
            pub fn examples() -> Vec<Self> {
                let mut all = Vec::new();
                $(all.extend($kind::examples().into_iter().map(Self::$kind));)*
                all
            }

            /// The BSDF at a point.
            pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
                match self { $(Self::$kind(m) => m.bsdf(point),)* }
            }
        }

        $(impl From<$kind> for MaterialKind {
            fn from(kind: $kind) -> Self { Self::$kind(kind) }
        })*
    };
}

materials! {
    "diffuse" => Diffuse,
}
