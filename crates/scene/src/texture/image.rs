//! Images as textures of surfaces.

use super::Wrap;
use crate::graph::ImageId;
use crate::image::Encoding;
use serde::{Deserialize, Serialize};
use snell_math::Vec2;

snell_math::declare! {
    /// How texels are filtered.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Filtering {
        /// The nearest texel of the full image, without filtering.
        "nearest" => Nearest,
        /// Bilinear filtering of the full image, which keeps details that are smaller than a pixel.
        "bilinear" => Bilinear,
        /// Bilinear filtering in the two nearest mip levels.
        "trilinear" => #[default] Trilinear,
    }
}

snell_math::declare! {
    /// An image as a texture of a surface.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct ImageTexture {
        /// The image that is looked up.
        pub image: ImageId,
        /// Encoding of the image's colour values: sRGB for base colours and emission, linear for
        /// normals, roughness and other data.
        pub encoding: Encoding,
        /// Wrap modes in u and v.
        pub wrap: [Wrap; 2],
        /// How texels are filtered.
        pub filtering: Filtering,
        /// Number of the set of texture coordinates: 0 to 3.
        pub uv_set: u32,
        /// Rows of the affine map of texture coordinates: `u' = m[0] . (u, v, 1)`, and `v'`
        /// likewise with `m[1]`. Texel `(0, 0)` is the upper left one and `v'` grows downwards, as
        /// in glTF; readers of formats with `v` upwards flip it in this map.
        pub uv_transform: [[f32; 3]; 2],
    }
}

impl ImageTexture {
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

impl ImageTexture {
    /// The texture coordinates after the texture's map; `(0, 0)` for coordinates that are not
    /// finite.
    pub(super) fn coordinates(&self, uv: Vec2) -> Vec2 {
        let [[a, b, c], [d, e, f]] = self.uv_transform;
        let uv = Vec2::new(a * uv.x + b * uv.y + c, d * uv.x + e * uv.y + f);
        if uv.is_finite() { uv } else { Vec2::ZERO }
    }

    /// The area, after the map, of a unit of area in texture coordinates.
    pub(crate) fn area_scale(&self) -> f32 {
        let [[a, b, _], [c, d, _]] = self.uv_transform;
        (a * d - b * c).abs()
    }
}
