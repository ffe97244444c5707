//! Materials, which map a surface point to a BSDF, emission and opacity. Each material has a file
//! here, with its parameters.

mod black;
mod bump;
mod caster;
mod coated_conductor;
mod coated_diffuse;
mod conductor;
mod dielectric;
mod diffuse;
mod hair;
mod interface;
mod interior;
mod metallic_roughness;
mod mirror;
mod normal;
mod open_pbr;
mod phong;
mod plastic;
mod prepared;
mod shading;
mod specular;
#[cfg(test)]
mod tests;

pub use crate::bsdf::FuzzModel;
pub use black::Black;
pub use bump::{BumpMap, HeightUnit};
pub use coated_conductor::CoatedConductor;
pub use coated_diffuse::CoatedDiffuse;
pub use conductor::{Conductor, ConductorSpectrum};
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use hair::Hair;
pub use interface::Interface;
pub use interior::Interior;
pub use metallic_roughness::{MetallicRoughness, reflectance_at_most_white};
pub use mirror::Mirror;
pub use normal::{Bend, FrameNeeds, reflecting_normal, visible_normal};
pub use open_pbr::{OpenPbr, TangentMap};
pub use phong::Phong;
pub use plastic::Plastic;
pub use prepared::Prepared;
pub use shading::ShadingBsdf;
pub use specular::Specular;

use crate::bsdf::{Bsdf, bounded, fresnel};
use crate::graph::{MediumId, TextureId};
use crate::ranges::LIGHT;
use crate::texture::TextureSet;
use serde::{Deserialize, Serialize};
use snell_intersect::SurfaceInteraction;
use snell_math::parameters::{Kind, Range, Step, Value, Visitor, references};
use snell_math::spectrum::{Color, Spectrum};
use snell_math::{ColorMode, Rgb, SampledSpectrum, Vec3};
use std::collections::BTreeSet;

/// A colour parameter: a factor, multiplied by a texture and a spectrum if there are any.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColorParam {
    /// Linear factor in Rec. 709.
    pub factor: Rgb,
    /// Texture whose RGB multiplies the factor.
    pub texture: Option<TextureId>,
    /// Spectrum that multiplies the factor, such as that of a black body. It is exact in spectral
    /// mode, and stands for its colour in RGB mode.
    #[serde(default)]
    pub spectrum: Option<Spectrum>,
}

impl ColorParam {
    /// A constant colour.
    pub const fn constant(factor: Rgb) -> Self {
        Self { factor, texture: None, spectrum: None }
    }

    /// A factor multiplied by a texture.
    pub const fn textured(factor: Rgb, texture: Option<TextureId>) -> Self {
        Self { factor, texture, spectrum: None }
    }

    /// The colour at a point.
    pub fn at(&self, point: &ShadingPoint) -> Color {
        let rgb = match self.texture {
            None => self.factor,
            Some(id) => {
                let [r, g, b, _] = point.textures.lookup(id, point.surface, point.footprint);
                self.factor * Rgb::new(r, g, b)
            }
        };
        Color { rgb, spectrum: self.spectrum }
    }
}

impl Value for ColorParam {
    const KIND: Kind = Kind::TexturedColor;

    fn visit(&self, visitor: &mut Visitor<'_>) {
        visitor.factor(self.texture.map(|id| id.0), self.spectrum.is_some(), &self.factor);
        if let Some(texture) = &self.texture {
            visitor.inside(Step::Name("texture"), texture);
        }
    }
}

impl From<Rgb> for ColorParam {
    fn from(factor: Rgb) -> Self {
        Self::constant(factor)
    }
}

/// A scalar parameter: a factor, multiplied by one channel of a texture if there is one. It may
/// also be written as a plain number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "WrittenScalar")]
pub struct ScalarParam {
    /// Number that is the value, or multiplies the texture.
    pub factor: f32,
    /// Texture and channel (0 red to 3 alpha) that multiply the factor.
    pub texture: Option<(TextureId, u8)>,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number, or {\"factor\": number, \"texture\": …}")]
enum WrittenScalar {
    Constant(f32),
    Whole { factor: f32, texture: Option<(TextureId, u8)> },
}

impl From<WrittenScalar> for ScalarParam {
    fn from(written: WrittenScalar) -> Self {
        match written {
            WrittenScalar::Constant(factor) => Self::constant(factor),
            WrittenScalar::Whole { factor, texture } => Self { factor, texture },
        }
    }
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
                self.factor
                    * point.textures.lookup(id, point.surface, point.footprint)
                        [usize::from(channel & 3)]
            }
        }
    }

    /// The values of two parameters at a point, with a single look-up if they are channels of the
    /// same texture.
    fn both_at(&self, other: &Self, point: &ShadingPoint) -> [f32; 2] {
        match (self.texture, other.texture) {
            (Some((id, first)), Some((same, second))) if id == same => {
                let texel = point.textures.lookup(id, point.surface, point.footprint);
                [
                    self.factor * texel[usize::from(first & 3)],
                    other.factor * texel[usize::from(second & 3)],
                ]
            }
            _ => [self.at(point), other.at(point)],
        }
    }
}

impl Value for ScalarParam {
    const KIND: Kind = Kind::TexturedNumber;

    fn visit(&self, visitor: &mut Visitor<'_>) {
        visitor.factor(self.texture.map(|(id, _)| id.0), false, &self.factor);
        if let Some((texture, _)) = &self.texture {
            visitor.inside(Step::Name("texture"), texture);
        }
    }
}

impl From<f32> for ScalarParam {
    fn from(factor: f32) -> Self {
        Self::constant(factor)
    }
}

/// Defaults of parameters.
mod defaults {
    use super::{ColorParam, ScalarParam};
    use snell_math::Rgb;

    /// Roughness of polished surfaces.
    pub fn smooth() -> ScalarParam {
        0.0.into()
    }

    /// True, for parameters that are set by default.
    pub fn yes() -> bool {
        true
    }

    /// No emission.
    pub fn black() -> ColorParam {
        Rgb::BLACK.into()
    }

    /// Full opacity.
    pub fn opaque() -> ScalarParam {
        1.0.into()
    }

    /// A colour that changes nothing as a factor.
    pub fn white() -> ColorParam {
        Rgb::WHITE.into()
    }

    /// A number that changes nothing as a factor.
    pub fn whole() -> f32 {
        1.0
    }

    /// Index of refraction of glass and varnish.
    pub fn glass() -> f32 {
        1.5
    }
}

/// The inputs of a material at a surface point.
#[derive(Clone, Copy, Debug)]
pub struct ShadingPoint<'a> {
    /// The point.
    pub surface: &'a SurfaceInteraction,
    /// Width of the ray cone at the point, in world units; 0 means no filtering.
    pub footprint: f32,
    /// The scene's textures.
    pub textures: &'a TextureSet,
    /// What the lanes of spectra stand for.
    pub mode: ColorMode,
    /// Index of refraction of the medium on the outer side; 1 except for nested objects.
    pub outside_ior: f32,
}

impl ShadingPoint<'_> {
    /// The lanes of a reflectance, clamped to `[0, 1]`, since more would create energy. NaN counts
    /// as 0.
    pub fn reflectance(&self, color: impl Into<Color>) -> SampledSpectrum {
        let color = color.into();
        let bounds = |x| bounded(x, 1.0);
        match color.spectrum {
            None => self.mode.reflectance(color.rgb.map(bounds)),
            Some(_) => self.mode.reflectance(color.map(|x| bounded(x, 1e6))).map(bounds),
        }
    }

    /// The lanes of a factor that may exceed 1. Negative values and NaN count as 0.
    pub fn coefficient(&self, color: impl Into<Color>) -> SampledSpectrum {
        self.mode.reflectance(color.into().map(|x| bounded(x, 1e20)))
    }

    /// Vertex colour of the mesh, white where there is none.
    pub fn vertex_color(&self) -> Rgb {
        let [r, g, b, _] = self.surface.color;
        Rgb::new(r, g, b)
    }
}

/// A valid index of refraction: `ior`, or 1 if that is invalid.
fn positive_ior(ior: f32) -> f32 {
    if ior > 1e-3 && ior < 1e3 { ior } else { 1.0 }
}

/// An index of refraction divided by that of the outside.
fn relative_ior(ior: f32, outside_ior: f32) -> f32 {
    positive_ior(ior / outside_ior)
}

snell_math::declare! {
    /// How a material uses its alpha.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub enum AlphaMode {
        /// Alpha is ignored.
        "opaque" => #[default] Opaque,
        /// The surface is opaque where alpha is at least the cut-off, and absent elsewhere.
        "mask" => Mask(cutoff: f32),
        /// The surface is present with probability alpha.
        "blend" => Blend,
        /// The surface is present with the probability with which a thin clear sheet of this index
        /// of refraction reflects, times alpha; else light goes straight on. A mirror that is
        /// present so is a pane of glass through which lights are sampled.
        "sheet" => Sheet(ior: f32),
    }
}

snell_math::declare! {
    /// The direction that the green channel of a normal map stands for.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Bitangent {
        /// Up in the picture as it lies on the surface, or what the tangents of the mesh say; the
        /// rule of glTF.
        "upwards" => #[default] Upwards,
        /// The shading normal times the derivative of the position by u, however the picture lies
        /// on the surface; the rule of pbrt and Mitsuba.
        "crossed" => Crossed,
        /// The opposite of `crossed`, for scenes that were mirrored.
        "crossed-mirrored" => CrossedMirrored,
    }
}

snell_math::declare! {
    /// A normal map.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct NormalMap {
        /// Linear texture in which `2 rgb - 1` is the normal in the tangent frame.
        pub texture: TextureId,
        /// Factor on the x and y of the normals.
        #[serde(default = "defaults::whole")]
        pub scale: f32,
        /// The direction of its green.
        #[serde(default)]
        pub bitangent: Bitangent,
    }
}

impl Bitangent {
    /// The direction in a mirrored scene, or on a surface that is turned over.
    pub fn mirrored(self) -> Self {
        match self {
            Self::Upwards => Self::Upwards,
            Self::Crossed => Self::CrossedMirrored,
            Self::CrossedMirrored => Self::Crossed,
        }
    }
}

impl NormalMap {
    /// A normal map with this factor on x and y, whose green is up in the picture.
    pub fn new(texture: TextureId, scale: f32) -> Self {
        Self { texture, scale, bitangent: Bitangent::Upwards }
    }
}

snell_math::declare! {
    /// A material: how a surface reflects, transmits and emits light.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Material {
        /// Name of the material for users.
        #[serde(default)]
        pub name: String,
        /// Model of reflection and transmission, with its parameters.
        pub kind: MaterialKind,
        /// Emitted radiance, W / (m^2 sr), on the sides that are visible.
        #[range(LIGHT)]
        #[unit("W / (m^2 sr)")]
        #[serde(default = "defaults::black")]
        pub emission: ColorParam,
        /// True if the vertex colour multiplies the emission, as for surfaces that show their base
        /// colour unlit.
        #[serde(default)]
        pub emission_takes_vertex_color: bool,
        /// True if the inner side emits too.
        #[serde(default)]
        pub emits_on_both_sides: bool,
        /// False if the emission is visible only to the camera and in mirrors, because another
        /// light takes its place in illuminating surfaces.
        #[serde(default = "defaults::yes")]
        pub illuminates: bool,
        /// False for a surface that rays pass through as if it were not there. Of a lamp, the light
        /// remains: only light samples find it.
        #[serde(default = "defaults::yes")]
        pub visible: bool,
        /// False for a surface that camera rays pass through. It is seen in mirrors and through
        /// glass, casts shadows and shines.
        #[serde(default = "defaults::yes")]
        pub visible_to_camera: bool,
        /// The use of `alpha`.
        #[serde(default)]
        pub alpha_mode: AlphaMode,
        /// Opacity, `[0, 1]`; multiplied by the vertex alpha.
        #[range(Range::SHARE)]
        #[serde(default = "defaults::opaque")]
        pub alpha: ScalarParam,
        /// False if rays from the inner side pass through unchanged.
        #[serde(default = "defaults::yes")]
        pub double_sided: bool,
        /// Normal map, which perturbs the shading normal.
        #[serde(default)]
        pub normal_map: Option<NormalMap>,
        /// Bump map, which perturbs the normal further. Coats do not follow it.
        #[serde(default)]
        pub bump_map: Option<BumpMap>,
        /// Interior of a closed surface; without it, the one that the kind implies.
        #[serde(default)]
        pub interior: Option<Interior>,
    }
}

impl Material {
    /// A white matte material without a name, which shows the colours of vertices as they are.
    pub fn white() -> Self {
        Self::new("", Diffuse::new(Rgb::WHITE))
    }

    /// A material with the parameters of `kind` and defaults for all others. Emission, opacity and
    /// normals of an [`OpenPbr`] are moved to the material.
    pub fn new(name: impl Into<String>, kind: impl Into<MaterialKind>) -> Self {
        let kind = kind.into();
        let mut material = Self::plain(name.into(), kind);
        material.follow_kind(&MaterialKind::OpenPbr(OpenPbr::default()));
        material
    }

    /// Moves emission, opacity and normals of an [`OpenPbr`] to the material, where they differ
    /// from those of `before`, the previous kind.
    pub fn follow_kind(&mut self, before: &MaterialKind) {
        let MaterialKind::OpenPbr(surface) = &self.kind else { return };
        let plain = OpenPbr::default();
        let before = if let MaterialKind::OpenPbr(before) = before { before } else { &plain };
        if (surface.emission_luminance, surface.emission_color)
            != (before.emission_luminance, before.emission_color)
        {
            let (luminance, color) = (surface.emission_luminance, surface.emission_color);
            let texture = color.texture.or(luminance.texture.map(|t| t.0));
            self.emission =
                ColorParam { factor: color.factor * luminance.factor, texture, ..color };
        }
        if surface.geometry_opacity != before.geometry_opacity {
            let is_whole = surface.geometry_opacity == ScalarParam::constant(1.0);
            self.alpha = surface.geometry_opacity;
            self.alpha_mode = if is_whole { AlphaMode::Opaque } else { AlphaMode::Blend };
        }
        if surface.geometry_normal != before.geometry_normal {
            self.normal_map = surface.geometry_normal;
        }
    }

    fn plain(name: String, kind: MaterialKind) -> Self {
        Self {
            name,
            kind,
            emission: ColorParam::constant(Rgb::BLACK),
            emission_takes_vertex_color: false,
            emits_on_both_sides: false,
            illuminates: true,
            visible: true,
            visible_to_camera: true,
            alpha_mode: AlphaMode::Opaque,
            alpha: ScalarParam::constant(1.0),
            double_sided: true,
            normal_map: None,
            bump_map: None,
            interior: None,
        }
    }

    /// A material that is only the boundary of a medium.
    pub fn interface(name: impl Into<String>, medium: MediumId) -> Self {
        let interior = Some(Interior { medium: Some(medium), priority: 0 });
        Self { interior, ..Self::new(name, Interface {}) }
    }

    /// The same material with this emission.
    pub fn emitting(self, radiance: Rgb) -> Self {
        Self { emission: ColorParam::constant(radiance), ..self }
    }

    /// True if the material disperses light, so that only the path's hero wavelength continues
    /// ([`ColorMode::hero_only`]).
    pub fn is_dispersive(&self) -> bool {
        match &self.kind {
            MaterialKind::Dielectric(glass) => glass.ior.is_dispersive(),
            MaterialKind::OpenPbr(surface) => surface.is_dispersive(),
            _ => false,
        }
    }

    /// The textures that the material looks up.
    pub fn textures(&self) -> BTreeSet<TextureId> {
        references(self, TextureId::TABLE).into_iter().map(TextureId).collect()
    }

    /// True if the material can emit somewhere.
    pub fn is_emissive(&self) -> bool {
        !self.emission.factor.is_black()
    }

    /// The kind of a material that is [`Diffuse`] and does not emit; `None` for others.
    #[inline]
    pub fn as_matte(&self) -> Option<&Diffuse> {
        match &self.kind {
            MaterialKind::Diffuse(diffuse) if !self.is_emissive() => Some(diffuse),
            _ => None,
        }
    }

    /// The reflectance of a matte surface at a point, and its shading normal before it is bent
    /// towards the viewer. `None` for other materials.
    pub fn matte_at(&self, point: &ShadingPoint) -> Option<(SampledSpectrum, Vec3)> {
        Some((self.as_matte()?.reflectance_at(point), self.shading_normal(point)))
    }

    /// The shading normal at a point with maps applied, before it is bent towards the viewer.
    pub fn shading_normal(&self, point: &ShadingPoint) -> Vec3 {
        let (smooth, flat) = (point.surface.shading_normal, point.surface.geometric_normal);
        self.bend(point).map_or(smooth, |bend| bend.normal(smooth, flat))
    }

    /// True if maps perturb the shading normal.
    pub fn is_bent(&self) -> bool {
        self.normal_map.is_some() || self.bump_map.is_some()
    }

    /// The result of the normal and bump maps at a point; `None` without maps.
    #[inline]
    pub fn bend(&self, point: &ShadingPoint) -> Option<Bend> {
        Bend::of(self.normal_map.as_ref(), self.bump_map.as_ref(), point)
    }

    /// True if hits need an opacity test ([`Self::is_present`]).
    pub fn needs_filter(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque
            || !self.double_sided
            || !self.visible
            || !self.visible_to_camera
            || self.is_interface()
    }

    /// Opacity at a point, `[0, 1]`; 0 or 1 for a mask.
    pub fn opacity(&self, point: &ShadingPoint) -> f32 {
        let alpha = || self.alpha.at(point) * point.surface.color[3];
        match self.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask(cutoff) => f32::from(alpha() >= cutoff),
            AlphaMode::Blend | AlphaMode::Sheet(_) => bounded(alpha(), 1.0),
        }
    }

    /// The fraction of light that a sheet reflects, all bounces between its faces included; 1 for
    /// other surfaces.
    fn sheet_reflectance(&self, ray_direction: Vec3, point: &ShadingPoint) -> f32 {
        let AlphaMode::Sheet(ior) = self.alpha_mode else { return 1.0 };
        let cos = ray_direction.normalize_or_zero().dot(point.surface.shading_normal).abs();
        let of_one_face = fresnel::dielectric(cos.min(1.0), positive_ior(ior));
        2.0 * of_one_face / (1.0 + of_one_face)
    }

    /// True if a ray hits the surface at a point. `u` in `[0, 1)` is a hash of the hit; it must be
    /// the same for the same hit, or light leaks.
    pub fn is_present(&self, ray_direction: Vec3, point: &ShadingPoint, u: f32) -> bool {
        u < self.presence(ray_direction, point)
    }

    /// The probability that a ray hits the surface at a point: its opacity, but 0 on the inner side
    /// of a single-sided surface, for interfaces and for what is not visible.
    pub fn presence(&self, ray_direction: Vec3, point: &ShadingPoint) -> f32 {
        if self.is_interface() || !self.visible {
            return 0.0;
        }
        if self.double_sided || point.surface.is_front_facing(ray_direction) {
            self.opacity(point) * self.sheet_reflectance(ray_direction, point)
        } else {
            0.0
        }
    }

    /// The fraction of the radiance [emitted](Self::emitted) at a point that reaches a light sample
    /// whose direction towards it is `ray_direction`: the probability that a ray hits the surface,
    /// or the opacity of one that is not visible.
    pub fn emitting_share(&self, ray_direction: Vec3, point: &ShadingPoint) -> f32 {
        if self.visible { self.presence(ray_direction, point) } else { self.opacity(point) }
    }

    /// The constant radiance that the surface emits in all directions of its emitting sides; `None`
    /// if that depends on the point, or if the surface is not opaque or not visible.
    pub fn uniform_emission(&self) -> Option<Color> {
        let is_uniform = self.is_emissive()
            && self.emission.texture.is_none()
            && !self.emission_takes_vertex_color
            && !self.has_layers_above_emission();
        let is_solid = self.alpha_mode == AlphaMode::Opaque && self.visible && !self.is_interface();
        let is_there = is_solid && (self.double_sided || !self.emits_on_both_sides);
        let ColorParam { factor: rgb, spectrum, .. } = self.emission;
        (is_uniform && is_there).then(|| Color { rgb, spectrum }.map(emitted_part))
    }

    /// Radiance emitted at a point towards `wo` (a unit vector in world space).
    pub fn emitted(&self, point: &ShadingPoint, wo: Vec3) -> SampledSpectrum {
        if !self.is_emissive()
            || (!self.emits_on_both_sides && wo.dot(point.surface.geometric_normal) <= 0.0)
        {
            return SampledSpectrum::ZERO;
        }
        let tint = if self.emission_takes_vertex_color { point.vertex_color() } else { Rgb::WHITE };
        let radiance = point.mode.illuminant((self.emission.at(point) * tint).map(emitted_part));
        self.passed_by_layers(point, wo).map_or(radiance, |passed| radiance * passed)
    }

    /// True if a coat or fuzz may dim what the surface emits.
    fn has_layers_above_emission(&self) -> bool {
        match &self.kind {
            MaterialKind::OpenPbr(surface) => {
                surface.coat_weight.factor > 0.0 || surface.fuzz_weight.factor > 0.0
            }
            MaterialKind::MetallicRoughness(surface) => surface.clearcoat.factor > 0.0,
            _ => false,
        }
    }

    /// The share of emitted light that passes coat and fuzz towards `wo` (unit, world space);
    /// `None` if there are none. The surface emits below them, as in OpenPBR Surface 1.1
    /// ("Emission") and in `KHR_materials_clearcoat` and `KHR_materials_sheen`.
    fn passed_by_layers(&self, point: &ShadingPoint, wo: Vec3) -> Option<SampledSpectrum> {
        if !self.has_layers_above_emission() {
            return None;
        }
        let cos = |normal: Vec3| wo.dot(normal).abs().min(1.0);
        let base = cos(self.shading_normal(point));
        let coat = self
            .coat_map(point)
            .map_or(base, |(map, _)| cos(normal::shading_frame(map.as_ref(), None, point).z));
        match &self.kind {
            MaterialKind::OpenPbr(surface) => Some(surface.passed_by_layers(point, base, coat)),
            MaterialKind::MetallicRoughness(surface) => {
                Some(surface.open_pbr().passed_by_layers(point, base, coat))
            }
            _ => None,
        }
    }
}

/// The emitted light, or 0 where it is negative or undefined, which would spoil every pixel that it
/// reaches.
fn emitted_part(x: f32) -> f32 {
    if x.is_finite() { x.max(0.0) } else { 0.0 }
}

snell_math::kinds! {
    /// Any of the materials with its parameters.
    pub enum MaterialKind tagged "material" by match_material! {
        "black" => Black,
        "diffuse" => Diffuse,
        "phong" => Phong,
        "mirror" => Mirror,
        "conductor" => Conductor,
        "dielectric" => Dielectric,
        "plastic" => Plastic,
        "metallic-roughness" => MetallicRoughness,
        "interface" => Interface,
        "open-pbr" => OpenPbr,
        "coated-diffuse" => CoatedDiffuse,
        "coated-conductor" => CoatedConductor,
        "hair" => Hair,
    }
}

impl MaterialKind {
    /// The BSDF at a point.
    pub fn bsdf(&self, point: &ShadingPoint) -> Bsdf {
        match_material!(self, material => material.bsdf(point))
    }
}
