//! Images on surfaces.

use super::Wrap;
use crate::graph::ImageId;
use crate::image::Encoding;
use serde::{Deserialize, Serialize};
use snell_math::Vec2;

snell_math::declare! {
    /// The filter of texels.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Filtering {
        /// The nearest texel of the full image.
        "nearest" => Nearest,
        /// Bilinear in the two nearest mip levels.
        "trilinear" => #[default] Trilinear,
    }
}

snell_math::declare! {
    /// An image on a surface.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct ImageTexture {
        /// The image.
        pub image: ImageId,
        /// Encoding of its colour values: sRGB for base colours and emission, linear for normals,
        /// roughness and other data.
        pub encoding: Encoding,
        /// Wrap modes in u and v.
        pub wrap: [Wrap; 2],
        /// Filtering.
        pub filtering: Filtering,
        /// The set of coordinates: 0 or 1.
        pub uv_set: u32,
        /// Rows of the affine map of the coordinates: `u' = m[0] . (u, v, 1)`, likewise `v'`. Texel
        /// `(0, 0)` is the upper left one and `v'` grows downwards (as in glTF); readers of formats
        /// with `v` upwards flip here.
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
    /// The texture's own coordinates; `(0, 0)` for coordinates that are not finite.
    pub(super) fn coordinates(&self, uv: Vec2) -> Vec2 {
        let [[a, b, c], [d, e, f]] = self.uv_transform;
        let uv = Vec2::new(a * uv.x + b * uv.y + c, d * uv.x + e * uv.y + f);
        if uv.is_finite() { uv } else { Vec2::ZERO }
    }

    /// Area that a unit of area in coordinates covers after the transform.
    pub(crate) fn area_scale(&self) -> f32 {
        let [[a, b, _], [c, d, _]] = self.uv_transform;
        (a * d - b * c).abs()
    }
}
