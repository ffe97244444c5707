//! Textures: values that vary over a surface. Images are looked up by texture coordinates,
//! bilinearly with mip maps and in all wrap modes; patterns are computed at the point of look-up.

mod image;
pub mod mapping;
mod missing;
pub mod pattern;
mod pyramid;
#[cfg(test)]
mod tests;
mod wrap;

pub use image::{Filtering, ImageTexture};
pub use mapping::Mapping;
pub use missing::missing_texture_image;
pub use pattern::Pattern;
pub use wrap::Wrap;

use crate::TextureId;
use crate::image::{Encoding, Image};
use crate::material::ShadingPoint;
use pyramid::Pyramid;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;
use snell_intersect::{SurfaceInteraction, UV_SETS};
use snell_math::{ColorMode, Vec2, Vec3, real};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A value that varies over a surface. In scenes, a pattern has its name in the field `pattern`; a
/// texture without that field is an image.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Texture {
    /// An image.
    Image(ImageTexture),
    /// A procedural texture.
    Pattern(Pattern),
}

impl<'de> Deserialize<'de> for Texture {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let read = match value.get("pattern") {
            Some(_) => serde_json::from_value(value).map(Self::Pattern),
            None => serde_json::from_value(value).map(Self::Image),
        };
        read.map_err(D::Error::custom)
    }
}

impl From<ImageTexture> for Texture {
    fn from(image: ImageTexture) -> Self {
        Self::Image(image)
    }
}

impl<P: Into<Pattern>> From<P> for Texture {
    fn from(pattern: P) -> Self {
        Self::Pattern(pattern.into())
    }
}

impl Texture {
    /// The texture as an image, if it is one.
    pub fn as_image(&self) -> Option<&ImageTexture> {
        match self {
            Self::Image(image) => Some(image),
            Self::Pattern(_) => None,
        }
    }

    /// Mutable access to the texture as an image, if it is one.
    pub fn as_image_mut(&mut self) -> Option<&mut ImageTexture> {
        match self {
            Self::Image(image) => Some(image),
            Self::Pattern(_) => None,
        }
    }

    /// The texture as a pattern, if it is one.
    pub fn as_pattern(&self) -> Option<&Pattern> {
        match self {
            Self::Image(_) => None,
            Self::Pattern(pattern) => Some(pattern),
        }
    }
}

/// Maximum number of textures that one texture combines. It counts the texture itself, and each
/// other texture as often as it is used.
pub const MAX_PARTS: usize = 256;

/// The reason why a texture of a table is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TextureError {
    /// The texture's image is not in the table.
    #[error("image is {id}, but there are {count}")]
    NoImage {
        /// The id of the image.
        id: u32,
        /// The length of the table of images.
        count: usize,
    },
    /// The texture refers to one that does not precede it in the table. (This rules out cycles.)
    #[error("it refers to texture {id}, which does not precede it")]
    NotAbove {
        /// The id of the texture that it refers to.
        id: u32,
    },
    /// The texture combines more than [`MAX_PARTS`] textures.
    #[error("it combines more than {MAX_PARTS} textures, the limit")]
    TooManyParts,
}

/// For each texture of a table, its error, or `None` if it is valid.
pub fn errors(textures: &[Texture], image_count: usize) -> Vec<Option<TextureError>> {
    let mut parts: Vec<usize> = Vec::with_capacity(textures.len());
    let errors = textures.iter().enumerate().map(|(i, texture)| {
        let (mut count, mut error) = (1usize, None);
        match texture {
            Texture::Image(image) if image.image.index() < image_count => {}
            Texture::Image(image) => {
                error = Some(TextureError::NoImage { id: image.image.0, count: image_count })
            }
            Texture::Pattern(pattern) => {
                for id in pattern.textures() {
                    match parts[..i].get(id.index()) {
                        Some(part) => count = count.saturating_add(*part),
                        None => error = Some(TextureError::NotAbove { id: id.0 }),
                    }
                }
                if count > MAX_PARTS {
                    error = error.or(Some(TextureError::TooManyParts));
                }
            }
        }
        // An invalid texture is only looked up for one colour.
        parts.push(if error.is_some() { 1 } else { count });
        error
    });
    errors.collect()
}

/// All textures of a scene, prepared for look-ups. Images that are used in one encoding share their
/// mip maps.
#[derive(Clone, Debug, Default)]
pub struct TextureSet {
    textures: Vec<Prepared>,
    pyramids: Vec<Arc<Pyramid>>,
}

/// A texture prepared for look-ups.
#[derive(Clone, Debug)]
enum Prepared {
    Image(PreparedImage),
    Pattern(Box<Pattern>),
    /// An invalid pattern, which is magenta.
    Broken,
}

/// An image with its mip maps.
#[derive(Clone, Debug)]
struct PreparedImage {
    texture: ImageTexture,
    pyramid: usize,
    /// The value of the texture, if it is the same everywhere.
    constant: Option<[f32; 4]>,
}

/// The colour of textures whose id is invalid.
const MISSING: [f32; 4] = [1.0, 0.0, 1.0, 1.0];

/// A point of a surface with what textures need: its position in the world, its unit normal, and
/// both sets of texture coordinates, which grow by 1 per unit of the world.
pub fn surface_at(position: Vec3, normal: Vec3, uv: Vec2) -> SurfaceInteraction {
    SurfaceInteraction {
        uv: [uv; UV_SETS],
        dpdv: Vec3::Z,
        ..SurfaceInteraction::plain(position, normal)
    }
}

impl TextureSet {
    /// The same textures with other maps of texture coordinates. `textures` must differ from those
    /// of the set in these maps only.
    pub fn placed(mut set: Arc<Self>, textures: &[Texture]) -> Arc<Self> {
        let is_there = |(prepared, now): (&Prepared, &Texture)| match (prepared, now) {
            (Prepared::Image(prepared), Texture::Image(now)) => {
                prepared.texture.uv_transform == now.uv_transform
            }
            _ => true,
        };
        if set.textures.iter().zip(textures).all(is_there) {
            return set;
        }
        for (prepared, now) in Arc::make_mut(&mut set).textures.iter_mut().zip(textures) {
            if let (Prepared::Image(prepared), Texture::Image(now)) = (prepared, now) {
                prepared.texture.uv_transform = now.uv_transform;
            }
        }
        set
    }

    /// Prepares textures, which includes building mip maps. A texture whose image is missing, or
    /// has fewer values than its size requires, shows [`missing_texture_image`]; a pattern for
    /// which [`errors`] has an error is magenta.
    pub fn new(textures: &[Texture], images: &[Arc<Image>]) -> Self {
        let mut set = Self::default();
        // The mip maps that are needed, by image and encoding. The value is false if only the
        // nearest texel is looked up, which needs no further levels.
        let mut wanted: BTreeMap<(usize, bool), bool> = BTreeMap::new();
        let key =
            |t: &ImageTexture| (t.image.index().min(images.len()), t.encoding == Encoding::Srgb);
        for texture in textures.iter().filter_map(Texture::as_image) {
            *wanted.entry(key(texture)).or_default() |= texture.filtering == Filtering::Trilinear;
        }
        let mut places = BTreeMap::new();
        for ((image, is_srgb), with_levels) in wanted {
            let encoding = if is_srgb { Encoding::Srgb } else { Encoding::Linear };
            let pyramid = images
                .get(image)
                .and_then(|image| Pyramid::new(image, encoding, with_levels))
                .or_else(|| {
                    Pyramid::new(&Arc::new(missing_texture_image()), Encoding::Srgb, with_levels)
                });
            places.insert((image, is_srgb), set.pyramids.len());
            set.pyramids.push(Arc::new(pyramid.expect("the missing-texture image is well formed")));
        }
        for (texture, error) in textures.iter().zip(errors(textures, images.len())) {
            set.textures.push(match texture {
                Texture::Image(texture) => {
                    let pyramid = places[&key(texture)];
                    let is_constant = set.pyramids[pyramid].size() == (1, 1)
                        && !texture.wrap.contains(&Wrap::Black);
                    let constant = is_constant.then(|| set.pyramids[pyramid].texel(0, 0, 0));
                    Prepared::Image(PreparedImage { texture: texture.clone(), pyramid, constant })
                }
                Texture::Pattern(_) if error.is_some() => Prepared::Broken,
                Texture::Pattern(pattern) => Prepared::Pattern(Box::new(pattern.clone())),
            });
        }
        set
    }

    /// The image texture with this id; `None` if the id is that of a pattern or invalid.
    pub fn image(&self, texture: TextureId) -> Option<&ImageTexture> {
        match self.textures.get(texture.index()) {
            Some(Prepared::Image(prepared)) => Some(&prepared.texture),
            _ => None,
        }
    }

    /// The size of a texel along the first two texture coordinates of a surface; infinite where the
    /// texture does not change along one. `None` for textures without texels.
    pub fn texel_steps(&self, texture: TextureId) -> Option<[f32; 2]> {
        let Some(Prepared::Image(PreparedImage { texture, pyramid, .. })) =
            self.textures.get(texture.index())
        else {
            return None;
        };
        let (width, height) = self.pyramids[*pyramid].size();
        let [across, down] = texture.uv_transform;
        Some(
            [0, 1]
                .map(|i| 1.0 / (across[i].abs() * width as f32).max(down[i].abs() * height as f32)),
        )
    }

    /// Memory use of the mip maps in bytes, without the images themselves: 2 bytes per value for
    /// 8-bit and 16-bit images and 4 for floating-point ones, for a third as many values as the
    /// image has.
    pub fn bytes(&self) -> usize {
        self.pyramids.iter().map(|pyramid| pyramid.bytes()).sum()
    }

    /// Linear RGB and alpha at a surface point; always finite. `footprint` is the width of the ray
    /// cone at the point, in world units.
    ///
    /// The mip level of an image is that at which the footprint covers one texel by area
    /// (Akenine-Moeller et al., Improved Shader and Texture Level of Detail Using Ray Cones, JCGT
    /// 2021). The second coordinate set is filtered like the first. Patterns leave out details
    /// finer than the footprint.
    #[inline]
    pub fn lookup(&self, texture: TextureId, at: &SurfaceInteraction, footprint: f32) -> [f32; 4] {
        match self.textures.get(texture.index()) {
            Some(Prepared::Image(prepared)) => {
                if let Some(value) = prepared.constant {
                    return value;
                }
                let uv = at.uv[(prepared.texture.uv_set as usize).min(UV_SETS - 1)];
                let level = if footprint > 0.0 { self.level(prepared, at, footprint) } else { 0.0 };
                self.filtered(prepared, uv, level)
            }
            Some(Prepared::Pattern(pattern)) => self.computed(pattern, at, footprint),
            Some(Prepared::Broken) | None => MISSING,
        }
    }

    /// Linear RGB and alpha at coordinates (before the texture's transform), at a mip level: 0 is
    /// the full image, and each further level has half the resolution. Between two levels the
    /// values are mixed; levels outside of the range, and NaN, are clamped to the nearest level.
    /// Patterns are evaluated at the origin of the world, unfiltered.
    pub fn lookup_at(&self, texture: TextureId, uv: Vec2, level: f32) -> [f32; 4] {
        match self.textures.get(texture.index()) {
            Some(Prepared::Image(prepared)) => self.filtered(prepared, uv, level),
            Some(Prepared::Pattern(pattern)) => {
                self.computed(pattern, &surface_at(Vec3::ZERO, Vec3::Y, uv), 0.0)
            }
            Some(Prepared::Broken) | None => MISSING,
        }
    }

    /// The colour of a pattern, with alpha 1. It is a function of its own, because images are
    /// looked up far more often.
    #[inline(never)]
    fn computed(
        &self,
        pattern: &Pattern,
        surface: &SurfaceInteraction,
        footprint: f32,
    ) -> [f32; 4] {
        let footprint = if footprint > 0.0 { footprint } else { 0.0 };
        let point = ShadingPoint {
            surface,
            footprint,
            textures: self,
            mode: ColorMode::Rgb,
            outside_ior: 1.0,
        };
        let [r, g, b] = pattern.rgb(&point).to_array().map(|x| if x.is_finite() { x } else { 0.0 });
        [r, g, b, 1.0]
    }

    fn filtered(
        &self,
        PreparedImage { texture, pyramid, .. }: &PreparedImage,
        uv: Vec2,
        level: f32,
    ) -> [f32; 4] {
        let pyramid = &self.pyramids[*pyramid];
        let uv = texture.coordinates(uv);
        if texture.filtering == Filtering::Nearest {
            return pyramid.nearest(uv, texture.wrap);
        }
        let uv = Vec2::new(texture.wrap[0].reduce(uv.x), texture.wrap[1].reduce(uv.y));
        let level = if texture.filtering == Filtering::Bilinear { 0.0 } else { level };
        let level = crate::bsdf::bounded(level, (pyramid.level_count() - 1) as f32);
        let fine = level as usize;
        let t = level - fine as f32;
        let value = pyramid.bilinear(fine, uv, texture.wrap);
        if t == 0.0 {
            value
        } else {
            pyramid::lerp(value, pyramid.bilinear(fine + 1, uv, texture.wrap), t)
        }
    }

    fn level(
        &self,
        PreparedImage { texture, pyramid, .. }: &PreparedImage,
        at: &SurfaceInteraction,
        footprint: f32,
    ) -> f32 {
        let (width, height) = self.pyramids[*pyramid].size();
        // The square of an area overflows single precision from lengths of 4e9 on.
        let world_per_uv = at.dpdu.cross(at.dpdv).as_dvec3().length() as f32;
        let texels_per_world = texture.area_scale() * width as f32 * height as f32 / world_per_uv;
        // Half the logarithm of the area is the logarithm of the width. Infinity and NaN become a
        // defined level in `filtered`.
        real::log2(footprint) + 0.5 * real::log2(texels_per_world)
    }
}
