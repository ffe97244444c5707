//! The placeholder for missing textures.

use crate::image::{Encoding, Image, Pixels};

/// A conspicuous image of 8 x 8 magenta and black squares. Readers use it in place of images that
/// cannot be read.
pub fn missing_texture_image() -> Image {
    let magenta = |i: u32| (i % 8 + i / 8).is_multiple_of(2);
    let pixels = (0..64).flat_map(|i| if magenta(i) { [255, 0, 255] } else { [0, 0, 0] }).collect();
    Image { width: 8, height: 8, channels: 3, pixels: Pixels::U8(pixels), encoding: Encoding::Srgb }
}
