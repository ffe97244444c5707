//! Textures: images sampled by coordinates, bilinear with mip maps, all wrap modes.

mod missing;
mod pyramid;
#[cfg(test)]
mod tests;
mod wrap;

pub use missing::missing_texture_image;
pub use wrap::Wrap;

use crate::TextureId;
use crate::graph::ImageId;
use crate::image::{Encoding, Image};
use pyramid::Pyramid;
use serde::{Deserialize, Serialize};
use snell_intersect::SurfaceInteraction;
use snell_math::Vec2;
use std::collections::BTreeMap;
use std::sync::Arc;

/// How texels are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Filtering {
    /// The nearest texel of the full image.
    Nearest,
    /// Bilinear in the two nearest mip levels.
    #[default]
    Trilinear,
}

/// An image on a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Texture {
    /// Which image.
    pub image: ImageId,
    /// How its colour values are meant here: sRGB for base colours and emission, linear for normals, roughness and other data.
    pub encoding: Encoding,
    /// Wrap modes in u and v.
    pub wrap: [Wrap; 2],
    /// Filtering.
    pub filtering: Filtering,
    /// Which set of coordinates: 0 or 1.
    pub uv_set: u32,
    /// Rows of the affine map of the coordinates: `u' = m[0] . (u, v, 1)`, likewise `v'`. Texel `(0, 0)` is the upper left one and
    /// `v'` grows downwards (as in glTF); readers of formats with `v` upwards flip here.
    pub uv_transform: [[f32; 3]; 2],
}

impl Texture {
    /// A repeating, trilinear texture on coordinate set 0.
    pub fn new(image: ImageId, encoding: Encoding) -> Self {
        Self {
            image,
            encoding,
            wrap: [Wrap::Repeat; 2],
            filtering: Filtering::Trilinear,
            uv_set: 0,
            uv_transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        }
    }
}

impl Texture {
    /// The texture's own coordinates; `(0, 0)` for coordinates that are not finite.
    fn coordinates(&self, uv: Vec2) -> Vec2 {
        let [[a, b, c], [d, e, f]] = self.uv_transform;
        let uv = Vec2::new(a * uv.x + b * uv.y + c, d * uv.x + e * uv.y + f);
        if uv.is_finite() { uv } else { Vec2::ZERO }
    }

    /// Area that a unit of area in coordinates covers after the transform.
    fn area_scale(&self) -> f32 {
        let [[a, b, _], [c, d, _]] = self.uv_transform;
        (a * d - b * c).abs()
    }
}

/// All textures of a scene, ready for lookups. Images used in one encoding share their mip maps.
#[derive(Clone, Debug, Default)]
pub struct TextureSet {
    textures: Vec<Prepared>,
    pyramids: Vec<Arc<Pyramid>>,
}

/// A texture and its mip maps.
#[derive(Clone, Debug)]
struct Prepared {
    texture: Texture,
    pyramid: usize,
    /// The value of a texture that is the same everywhere.
    constant: Option<[f32; 4]>,
}

/// Shown for ids that mean nothing.
const MISSING: [f32; 4] = [1.0, 0.0, 1.0, 1.0];

impl TextureSet {
    /// The same textures where they lie now: `textures` differ from those that the set was made of by their maps of coordinates alone.
    pub fn placed(mut set: Arc<Self>, textures: &[Texture]) -> Arc<Self> {
        let is_there = |(prepared, now): (&Prepared, &Texture)| prepared.texture.uv_transform == now.uv_transform;
        if set.textures.iter().zip(textures).all(is_there) {
            return set;
        }
        for (prepared, now) in Arc::make_mut(&mut set).textures.iter_mut().zip(textures) {
            prepared.texture.uv_transform = now.uv_transform;
        }
        set
    }

    /// Prepares textures (builds mip maps). A texture of an image that is not there, or holds fewer values than it says, shows
    /// [`missing_texture_image`].
    pub fn new(textures: &[Texture], images: &[Arc<Image>]) -> Self {
        let mut set = Self::default();
        // By image and encoding; false for those only ever looked up by nearest texel, which need no levels.
        let mut wanted: BTreeMap<(usize, bool), bool> = BTreeMap::new();
        let key = |t: &Texture| (t.image.index().min(images.len()), t.encoding == Encoding::Srgb);
        for texture in textures {
            *wanted.entry(key(texture)).or_default() |= texture.filtering == Filtering::Trilinear;
        }
        let mut places = BTreeMap::new();
        for ((image, is_srgb), with_levels) in wanted {
            let encoding = if is_srgb { Encoding::Srgb } else { Encoding::Linear };
            let pyramid = images
                .get(image)
                .and_then(|image| Pyramid::new(image, encoding, with_levels))
                .or_else(|| Pyramid::new(&Arc::new(missing_texture_image()), Encoding::Srgb, with_levels));
            places.insert((image, is_srgb), set.pyramids.len());
            set.pyramids.push(Arc::new(pyramid.expect("the missing-texture image is well formed")));
        }
        for texture in textures {
            let pyramid = places[&key(texture)];
            let is_constant = set.pyramids[pyramid].size() == (1, 1) && !texture.wrap.contains(&Wrap::Black);
            let constant = is_constant.then(|| set.pyramids[pyramid].texel(0, 0, 0));
            set.textures.push(Prepared { texture: texture.clone(), pyramid, constant });
        }
        set
    }

    /// The texture of this id.
    pub fn get(&self, texture: TextureId) -> Option<&Texture> {
        self.textures.get(texture.index()).map(|p| &p.texture)
    }

    /// Memory of the mip maps in bytes, without the images themselves: 2 bytes per value for 8-bit and 16-bit images and 4 for
    /// floating-point ones, on a third of the image's values.
    pub fn bytes(&self) -> usize {
        self.pyramids.iter().map(|pyramid| pyramid.bytes()).sum()
    }

    /// Linear RGB and alpha at a surface point. `footprint` is the width of the ray's cone there, in world units.
    ///
    /// The mip level is that at which the footprint covers one texel by area (Akenine-Moeller et al., Improved Shader and Texture
    /// Level of Detail Using Ray Cones, JCGT 2021); the second coordinate set is filtered as the first. Always finite.
    pub fn lookup(&self, texture: TextureId, at: &SurfaceInteraction, footprint: f32) -> [f32; 4] {
        let Some(prepared) = self.textures.get(texture.index()) else { return MISSING };
        if let Some(value) = prepared.constant {
            return value;
        }
        let uv = at.uv[(prepared.texture.uv_set as usize).min(1)];
        let level = if footprint > 0.0 { self.level(prepared, at, footprint) } else { 0.0 };
        self.filtered(prepared, uv, level)
    }

    /// Linear RGB and alpha at coordinates (before the texture's transform), at a mip level: 0 is the full image, each further level
    /// has half the resolution. Levels between two are mixed; those outside the range, and NaN, mean the nearest there is.
    pub fn lookup_at(&self, texture: TextureId, uv: Vec2, level: f32) -> [f32; 4] {
        self.textures.get(texture.index()).map_or(MISSING, |prepared| self.filtered(prepared, uv, level))
    }

    fn filtered(&self, Prepared { texture, pyramid, .. }: &Prepared, uv: Vec2, level: f32) -> [f32; 4] {
        let pyramid = &self.pyramids[*pyramid];
        let uv = texture.coordinates(uv);
        if texture.filtering == Filtering::Nearest {
            return pyramid.nearest(uv, texture.wrap);
        }
        let level = crate::bsdf::bounded(level, (pyramid.level_count() - 1) as f32);
        let (fine, t) = (level as usize, level.fract());
        let value = pyramid.bilinear(fine, uv, texture.wrap);
        if t == 0.0 { value } else { pyramid::lerp(value, pyramid.bilinear(fine + 1, uv, texture.wrap), t) }
    }

    fn level(&self, Prepared { texture, pyramid, .. }: &Prepared, at: &SurfaceInteraction, footprint: f32) -> f32 {
        let (width, height) = self.pyramids[*pyramid].size();
        let world_per_uv = at.dpdu.cross(at.dpdv).length();
        let texels_per_world = texture.area_scale() * width as f32 * height as f32 / world_per_uv;
        // Half the logarithm of the area is the logarithm of the width; infinity and NaN end up at a defined level in `filtered`.
        footprint.log2() + 0.5 * texels_per_world.log2()
    }
}
