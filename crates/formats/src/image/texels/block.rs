//! Compressed blocks of texels.

use super::{Layout, eac, plain};
use crate::guard::guarded;
use half::f16;
use rayon::prelude::*;
use snell_scene::Pixels;

/// The most pixels of a block: 12 x 12.
const MOST_PIXELS: usize = 144;

/// Decodes all blocks of a picture. Returns the number of channels too. Colours lose an alpha that
/// is 1 everywhere. `None` if a decoder fails.
pub fn decode(layout: Layout, size: [usize; 2], bytes: &[u8]) -> Option<(u32, Pixels)> {
    let grid = Grid { size, block: layout.block() };
    let rgba = |decode: fn(&[u8], &mut [u8])| grid.decode(4, bytes, decode).map(opaque_as_rgb);
    let packed = |decode: fn(&[u8], &mut [u32])| {
        rgba_of(|block, values| words(block, values, decode), &grid, bytes)
    };
    match layout {
        Layout::Bc1 => rgba(|block, values| bcdec_rs::bc1(block, values, 16)),
        Layout::Bc2 => rgba(|block, values| bcdec_rs::bc2(block, values, 16)),
        Layout::Bc3 => rgba(|block, values| bcdec_rs::bc3(block, values, 16)),
        Layout::Bc7 => rgba(|block, values| bcdec_rs::bc7(block, values, 16)),
        Layout::Bc4(false) => {
            let decode = |block: &[u8], values: &mut [u8]| bcdec_rs::bc4(block, values, 4, false);
            grid.decode(1, bytes, decode).map(|values| (1, Pixels::U8(values)))
        }
        Layout::Bc5(false) => {
            let decode = |block: &[u8], values: &mut [u8]| bcdec_rs::bc5(block, values, 8, false);
            grid.decode(2, bytes, decode).map(|values| (2, Pixels::U8(values)))
        }
        Layout::Bc4(true) => {
            grid.decode(1, bytes, signed::<1>).map(|values| (1, Pixels::U16(values)))
        }
        Layout::Bc5(true) => {
            grid.decode(2, bytes, signed::<2>).map(|values| (2, Pixels::U16(values)))
        }
        Layout::Bc6(is_signed) => {
            let decode = |block: &[u8], values: &mut [f32]| {
                let mut halves = [0; 48];
                bcdec_rs::bc6h_half(block, &mut halves, 12, is_signed);
                for (half, value) in halves.iter().zip(values) {
                    *value = f16::from_bits(*half).to_f32();
                }
            };
            grid.decode(3, bytes, decode).map(|values| (3, Pixels::F32(values)))
        }
        Layout::EacR(is_signed) => {
            let decode =
                |block: &[u8], values: &mut [u16]| eac::decode(block, is_signed, values, 1);
            grid.decode(1, bytes, decode).map(|values| (1, Pixels::U16(values)))
        }
        Layout::EacRg(is_signed) => {
            let decode = |block: &[u8], values: &mut [u16]| {
                eac::decode(&block[..8], is_signed, values, 2);
                eac::decode(&block[8..], is_signed, &mut values[1..], 2);
            };
            grid.decode(2, bytes, decode).map(|values| (2, Pixels::U16(values)))
        }
        Layout::Etc2 => packed(texture2ddecoder::decode_etc2_rgb_block),
        Layout::Etc2Punched => packed(texture2ddecoder::decode_etc2_rgba1_block),
        Layout::Etc2Alpha => packed(texture2ddecoder::decode_etc2_rgba8_block),
        Layout::Astc(x, y) => {
            let [x, y] = [x, y].map(usize::from);
            let decode = |block: &[u8], values: &mut [u8]| {
                let decode = |block: &[u8], values: &mut [u32]| {
                    texture2ddecoder::decode_astc_block(block, x, y, values);
                };
                words(block, values, decode);
            };
            rgba_of(decode, &grid, bytes)
        }
        Layout::Plain { .. }
        | Layout::Packed { .. }
        | Layout::SharedExponent
        | Layout::SmallFloats => unreachable!("these have no blocks"),
    }
}

/// Pixels in x and y of a picture; pixels in x and y, and bytes, of its blocks.
struct Grid {
    size: [usize; 2],
    block: [usize; 3],
}

impl Grid {
    /// Decodes blocks in parallel, and cuts those that reach beyond the picture. `None` if
    /// `decode` panics.
    fn decode<T: Copy + Default + Send>(
        &self,
        channels: usize,
        bytes: &[u8],
        decode: impl Fn(&[u8], &mut [T]) + Sync,
    ) -> Option<Vec<T>> {
        let ([width, height], [wide, high, length]) = (self.size, self.block);
        let mut values = vec![T::default(); width * height * channels];
        let line = width * channels;
        let rows = values.par_chunks_mut(line * high);
        let rows = rows.zip(bytes.par_chunks_exact(width.div_ceil(wide) * length));
        let decode_row = |row: &mut [T], blocks: &[u8]| {
            let mut pixels = [T::default(); MOST_PIXELS * 4];
            for (index, block) in blocks.chunks_exact(length).enumerate() {
                decode(block, &mut pixels[..wide * high * channels]);
                let start = index * wide * channels;
                let end = line.min(start + wide * channels);
                let lines = row.chunks_exact_mut(line);
                for (line, pixels) in lines.zip(pixels.chunks_exact(wide * channels)) {
                    line[start..end].copy_from_slice(&pixels[..end - start]);
                }
            }
        };
        rows.map(|(row, blocks)| guarded(|| decode_row(row, blocks))).collect::<Option<()>>()?;
        Some(values)
    }
}

fn rgba_of(
    decode: impl Fn(&[u8], &mut [u8]) + Sync,
    grid: &Grid,
    bytes: &[u8],
) -> Option<(u32, Pixels)> {
    grid.decode(4, bytes, decode).map(opaque_as_rgb)
}

/// Leaves out alpha if it is 1 everywhere.
fn opaque_as_rgb(values: Vec<u8>) -> (u32, Pixels) {
    if values.as_chunks::<4>().0.iter().any(|pixel| pixel[3] != u8::MAX) {
        return (4, Pixels::U8(values));
    }
    let colors = values.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]);
    (3, Pixels::U8(colors.collect()))
}

/// A block of a decoder that makes words with blue in the lowest byte and alpha in the highest.
fn words(block: &[u8], values: &mut [u8], decode: impl Fn(&[u8], &mut [u32])) {
    let mut words = [0u32; MOST_PIXELS];
    let pixels = values.as_chunks_mut::<4>().0;
    decode(block, &mut words[..pixels.len()]);
    for (pixel, word) in pixels.iter_mut().zip(words) {
        let [b, g, r, a] = word.to_le_bytes();
        *pixel = [r, g, b, a];
    }
}

/// A block of one or two interpolated channels with sign.
fn signed<const CHANNELS: usize>(block: &[u8], values: &mut [u16]) {
    let mut floats = [0.0; 32];
    match CHANNELS {
        1 => bcdec_rs::bc4_float(block, &mut floats, 4, true),
        _ => bcdec_rs::bc5_float(block, &mut floats, 8, true),
    }
    floats.iter().zip(values).for_each(|(float, value)| *value = plain::unsigned(*float));
}
