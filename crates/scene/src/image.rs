//! Pixels in memory: images that come from files ([`Image`]) and pictures that go to files
//! ([`LayeredImage`]).

use serde::{Deserialize, Serialize};

snell_math::declare! {
    /// The encoding of stored colour values.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Encoding {
        /// Colour channels are encoded with the sRGB curve; alpha is linear.
        "srgb" => Srgb,
        /// Values are linear, either data or scene-linear radiance.
        "linear" => Linear,
    }
}

/// The stored values: `channels` for each pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// 0 to 255 stand for 0 to 1.
    U8(Vec<u8>),
    /// 0 to 65535 stand for 0 to 1.
    U16(Vec<u16>),
    /// Floating-point numbers that stand for themselves.
    F32(Vec<f32>),
}

/// An image with 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA) channels; alpha is not
/// premultiplied.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels, at least 1.
    pub width: u32,
    /// Height in pixels, at least 1.
    pub height: u32,
    /// Channels per pixel, 1 to 4.
    pub channels: u32,
    /// The stored values.
    pub pixels: Pixels,
    /// The encoding of colour values, unless users of the image override it.
    pub encoding: Encoding,
}

impl Image {
    /// A floating-point image.
    ///
    /// # Panics
    /// If the number of values is not `width * height * channels`.
    pub fn from_f32(width: u32, height: u32, channels: u32, values: Vec<f32>) -> Self {
        assert_eq!(
            values.len(),
            width as usize * height as usize * channels as usize,
            "one value per channel and pixel"
        );
        Self { width, height, channels, pixels: Pixels::F32(values), encoding: Encoding::Linear }
    }

    /// The stored value of a channel, still encoded; integer values are scaled to 0 to 1.
    pub fn value(&self, x: u32, y: u32, channel: u32) -> f32 {
        let i = (y as usize * self.width as usize + x as usize) * self.channels as usize
            + channel as usize;
        match &self.pixels {
            Pixels::U8(v) => f32::from(v[i]) / 255.0,
            Pixels::U16(v) => f32::from(v[i]) / 65535.0,
            Pixels::F32(v) => v[i],
        }
    }

    /// Linear RGB and alpha of a pixel, decoded by `encoding`. Grey is copied to all three colour
    /// channels; alpha is 1 if the image has none.
    pub fn rgba_as(&self, x: u32, y: u32, encoding: Encoding) -> [f32; 4] {
        let c = |i| self.value(x, y, i);
        let [r, g, b, a] = match self.channels {
            1 => [c(0), c(0), c(0), 1.0],
            2 => [c(0), c(0), c(0), c(1)],
            3 => [c(0), c(1), c(2), 1.0],
            _ => [c(0), c(1), c(2), c(3)],
        };
        match encoding {
            Encoding::Linear => [r, g, b, a],
            Encoding::Srgb => {
                let [r, g, b] = [r, g, b].map(snell_math::spectrum::srgb_to_linear);
                [r, g, b, a]
            }
        }
    }

    /// Linear RGB and alpha of a pixel, decoded by the image's own encoding.
    pub fn rgba(&self, x: u32, y: u32) -> [f32; 4] {
        self.rgba_as(x, y, self.encoding)
    }
}

/// One layer of a picture, with some named channels of 32-bit floats.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Empty for the picture itself, otherwise the name of the AOV, such as `depth`.
    pub name: String,
    /// Names of the channels, such as `R G B A` or `X Y Z`.
    pub channels: Vec<String>,
    /// One value per channel and pixel, row by row from the top.
    pub values: Vec<f32>,
}

/// A picture with any number of layers. The first layer is the picture itself: `R G B` or `R G B A`
/// (premultiplied alpha), scene-linear Rec. 709.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LayeredImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The layers, the picture itself first.
    pub layers: Vec<Layer>,
    /// Settings and statistics that are stored with the picture, as keys and values.
    pub metadata: Vec<(String, String)>,
}

impl LayeredImage {
    /// The layer of this name; `None` if there is none.
    pub fn layer(&self, name: &str) -> Option<&Layer> {
        self.layers.iter().find(|l| l.name == name)
    }
}
