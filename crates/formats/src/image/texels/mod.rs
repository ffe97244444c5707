//! Texels as files of textures store them (DDS, KTX2): plain values, values packed into words, and
//! the compressed blocks of graphics cards. [`Layout`] names the way, [`decode`] makes a picture.
//!
//! The crates `bcdec_rs` and `texture2ddecoder` decode blocks. What a container says (sizes,
//! levels, cube maps) is not known here.

mod block;
mod eac;
mod plain;

use rayon::prelude::*;
use snell_scene::{Encoding, Image, Pixels};

/// How the texels of a picture are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Values one after the other. `order` has the place of red (0), green (1), blue (2) and alpha
    /// (3) in the picture for each value of a pixel; a single value is grey.
    Plain {
        /// The type of the values.
        kind: Kind,
        /// The place in the picture of each value of a pixel; 4 for values that are left out.
        order: &'static [u8],
    },
    /// The bits of a little-endian word of 1 to 4 bytes, by masks for red, green, blue and alpha.
    /// Without masks for green and blue the pixel is grey.
    Packed {
        /// Bytes of a pixel.
        bytes: u8,
        /// Bits of each channel, 0 for those that are absent.
        masks: [u32; 4],
    },
    /// Nine bits for each colour and five for an exponent that they share.
    SharedExponent,
    /// Floating-point numbers of 11, 11 and 10 bits without sign.
    SmallFloats,
    /// Four colours between two, and at most one bit of transparency (DXT1).
    Bc1,
    /// [`Self::Bc1`] with four bits of alpha (DXT2, DXT3).
    Bc2,
    /// [`Self::Bc1`] with interpolated alpha (DXT4, DXT5).
    Bc3,
    /// One interpolated channel; true if its values have a sign.
    Bc4(bool),
    /// Two interpolated channels; true if their values have a sign.
    Bc5(bool),
    /// Half floats; true if they have a sign.
    Bc6(bool),
    /// Colours, also with alpha, in eight modes.
    Bc7,
    /// ETC2, or ETC1, without alpha.
    Etc2,
    /// ETC2 with one bit of alpha.
    Etc2Punched,
    /// ETC2 with alpha of eight bits.
    Etc2Alpha,
    /// One channel of 11 bits; true if its values have a sign.
    EacR(bool),
    /// Two channels of 11 bits; true if their values have a sign.
    EacRg(bool),
    /// ASTC of low dynamic range, with the pixels of a block in x and y.
    Astc(u8, u8),
}

/// A type of plain values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// 0 to 1 in 8 bits.
    U8,
    /// -1 to 1 in 8 bits.
    I8,
    /// 0 to 1 in 16 bits.
    U16,
    /// -1 to 1 in 16 bits.
    I16,
    /// Half floats.
    F16,
    /// Floats.
    F32,
}

impl Kind {
    fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::F32 => 4,
        }
    }
}

impl Layout {
    /// Pixels of a block in x and y, and its bytes.
    fn block(self) -> [usize; 3] {
        match self {
            Self::Plain { kind, order } => [1, 1, kind.bytes() * order.len()],
            Self::Packed { bytes, .. } => [1, 1, bytes.into()],
            Self::SharedExponent | Self::SmallFloats => [1, 1, 4],
            Self::Bc1 | Self::Bc4(_) | Self::Etc2 | Self::Etc2Punched | Self::EacR(_) => [4, 4, 8],
            Self::Bc2 | Self::Bc3 | Self::Bc5(_) | Self::Bc6(_) | Self::Bc7 => [4, 4, 16],
            Self::Etc2Alpha | Self::EacRg(_) => [4, 4, 16],
            Self::Astc(x, y) => [x.into(), y.into(), 16],
        }
    }

    /// Bytes that a picture of this size takes in the file.
    pub fn stored_bytes(self, width: u32, height: u32) -> u64 {
        let [x, y, bytes] = self.block().map(|n| n as u64);
        let blocks = u64::from(width).div_ceil(x).saturating_mul(u64::from(height).div_ceil(y));
        blocks.saturating_mul(bytes)
    }

    /// The most bytes that a decoded pixel takes.
    pub fn pixel_bytes(self) -> u64 {
        match self {
            Self::Plain { kind: Kind::F16 | Kind::F32, .. } => 16,
            Self::SharedExponent | Self::SmallFloats | Self::Bc6(_) => 12,
            Self::Plain { .. } | Self::Packed { .. } => 8,
            Self::Bc4(_) | Self::Bc5(_) | Self::EacR(_) | Self::EacRg(_) => 6,
            _ => 4,
        }
    }

    /// True if the values are numbers without limit, or with a sign: they are never display values.
    pub fn is_linear(self) -> bool {
        match self {
            Self::Plain { kind, .. } => !matches!(kind, Kind::U8 | Kind::U16),
            Self::SharedExponent | Self::SmallFloats | Self::Bc6(_) => true,
            Self::Bc4(signed) | Self::Bc5(signed) => signed,
            Self::EacR(signed) | Self::EacRg(signed) => signed,
            _ => false,
        }
    }

    /// True if there are two channels, which mostly are those of a normal map.
    pub fn has_two_channels(self) -> bool {
        match self {
            Self::Plain { order, .. } => order == [0, 1],
            Self::Packed { masks, .. } => masks[1] != 0 && masks[2] == 0 && masks[3] == 0,
            Self::Bc5(_) | Self::EacRg(_) => true,
            _ => false,
        }
    }
}

/// Decodes a picture of at least one pixel. Values with a sign are moved from -1 to 1 to 0 to 1, as
/// users of normal maps expect. Two channels are left as they are, for [`complete`] or [`swizzle`];
/// they are red and green, not grey and alpha. An error says why the bytes are no such picture.
pub fn decode(
    layout: Layout,
    encoding: Encoding,
    [width, height]: [u32; 2],
    bytes: &[u8],
) -> Result<Image, String> {
    let stored = layout.stored_bytes(width, height);
    let bytes =
        usize::try_from(stored).ok().and_then(|stored| bytes.get(..stored)).ok_or_else(|| {
            format!("{width} x {height} pixels take {stored} bytes, and there are {}", bytes.len())
        })?;
    let (channels, pixels) = match layout {
        Layout::Plain { kind, order } => plain::decode(kind, order, bytes),
        Layout::Packed { bytes: each, masks } => plain::unpack(each.into(), masks, bytes),
        Layout::SharedExponent => plain::floats_of_words(bytes, plain::shared_exponent),
        Layout::SmallFloats => plain::floats_of_words(bytes, plain::small_floats),
        _ => block::decode(layout, [width as usize, height as usize], bytes)
            .ok_or("a block of its texels cannot be decoded")?,
    };
    Ok(Image { width, height, channels, pixels, encoding })
}

/// Makes three channels of two, red and green. If every pixel can be x and y of a unit vector, the
/// picture is taken for a normal map, and blue becomes its z; otherwise blue is 0. Returns true if
/// it was taken for a normal map.
pub fn complete(image: &mut Image) -> bool {
    let is_normal_map = match &mut image.pixels {
        Pixels::U8(values) => with_blue(values, 1.0 / 255.0, |v| (v * 255.0 + 0.5) as u8),
        Pixels::U16(values) => with_blue(values, 1.0 / 65535.0, |v| (v * 65535.0 + 0.5) as u16),
        Pixels::F32(values) => {
            // Nobody writes normals as floats from 0 to 1.
            *values = values.chunks_exact(2).flat_map(|rg| [rg[0], rg[1], 0.0]).collect();
            false
        }
    };
    image.channels = 3;
    is_normal_map
}

fn with_blue<T: Copy + Into<f64> + Default + Send + Sync>(
    values: &mut Vec<T>,
    scale: f64,
    stored: impl Fn(f64) -> T + Sync,
) -> bool {
    // The corners of a square around the circle are far outside of it; errors of rounding and of
    // compression are not.
    const TOLERANCE: f64 = 1.1;
    let squares = |rg: &[T]| {
        let [x, y] = [rg[0], rg[1]].map(|v| v.into() * scale * 2.0 - 1.0);
        x * x + y * y
    };
    let is_normal_map = values.par_chunks_exact(2).all(|rg| squares(rg) <= TOLERANCE);
    let blue = |rg: &[T]| match is_normal_map {
        true => stored((1.0 - squares(rg)).max(0.0).sqrt() * 0.5 + 0.5),
        false => T::default(),
    };
    *values = values.par_chunks_exact(2).flat_map_iter(|rg| [rg[0], rg[1], blue(rg)]).collect();
    is_normal_map
}

/// Rearranges the channels: for each of red, green, blue and alpha the one that it is taken from
/// (`r`, `g`, `b`, `a`), or `0` or `1`. Absent colours are 0, absent alpha is 1. `None` if the
/// text has other letters.
pub fn swizzle(image: Image, text: &str) -> Option<Image> {
    let letters: [u8; 4] = text.as_bytes().try_into().ok()?;
    if !letters.iter().all(|letter| b"rgba01".contains(letter)) {
        return None;
    }
    let is_grey = letters[0] == letters[1] && letters[0] == letters[2];
    let kept: &[usize] = match (is_grey, letters[3] == b'1') {
        (true, true) => &[0],
        (true, false) => &[0, 3],
        (false, true) => &[0, 1, 2],
        (false, false) => &[0, 1, 2, 3],
    };
    fn rearranged<T: Copy>(values: &[T], from: usize, letters: &[u8], ends: [T; 2]) -> Vec<T> {
        let value = |pixel: &[T], letter: u8| match letter {
            b'0' => ends[0],
            b'1' => ends[1],
            _ => {
                let place = b"rgba".iter().position(|l| *l == letter).unwrap_or(0);
                pixel.get(place).copied().unwrap_or(ends[usize::from(place == 3)])
            }
        };
        let pixels = values.chunks_exact(from);
        pixels.flat_map(|pixel| letters.iter().map(move |letter| value(pixel, *letter))).collect()
    }
    let letters: Vec<u8> = kept.iter().map(|place| letters[*place]).collect();
    let from = image.channels as usize;
    let pixels = match &image.pixels {
        Pixels::U8(values) => Pixels::U8(rearranged(values, from, &letters, [0, u8::MAX])),
        Pixels::U16(values) => Pixels::U16(rearranged(values, from, &letters, [0, u16::MAX])),
        Pixels::F32(values) => Pixels::F32(rearranged(values, from, &letters, [0.0, 1.0])),
    };
    Some(Image { channels: letters.len() as u32, pixels, ..image })
}

/// Turns a picture upside down.
pub fn flip(image: &mut Image) {
    fn flipped<T: Copy>(values: &mut Vec<T>, line: usize) {
        *values = values.chunks_exact(line).rev().flatten().copied().collect();
    }
    let line = image.width as usize * image.channels as usize;
    match &mut image.pixels {
        Pixels::U8(values) => flipped(values, line),
        Pixels::U16(values) => flipped(values, line),
        Pixels::F32(values) => flipped(values, line),
    }
}

#[cfg(test)]
mod tests;
