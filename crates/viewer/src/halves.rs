//! Lossless compression of pictures at rest: 16-bit floats, which a browser unpacks by itself
//! (`web/src/halves.ts`).
//!
//! Neighbouring values are alike, and so are the channels. Each value is therefore predicted from
//! those to its left and above, after green was subtracted from red and blue (both in steps of the
//! floats, which are nearly logarithms). The differences, small numbers of either sign, are stored
//! by channel, all low bytes before all high bytes, and deflated (RFC 1950).

use flate2::Compression;
use flate2::write::ZlibEncoder;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::io::Write;

/// Level of compression: higher ones take much longer, and noise becomes no smaller.
const LEVEL: u32 = 3;

/// The last bits of the floats that slow lines do not get: with the others, a step is less than one
/// level of 255.
const ROUNDED: u16 = 4;

/// Compresses linear RGB values (three per pixel) as half floats, after the bytes in `out`. On
/// request, the floats are rounded, for slow lines.
pub fn compress(
    rgb: &[f32],
    width: usize,
    is_rounded: bool,
    out: Vec<u8>,
) -> std::io::Result<Vec<u8>> {
    let mut halves = vec![f16::ZERO; rgb.len()];
    halves.par_chunks_mut(1 << 15).zip(rgb.par_chunks(1 << 15)).for_each(|(to, from)| {
        to.convert_from_f32_slice(from);
        if is_rounded {
            to.iter_mut().for_each(|half| *half = rounded(*half));
        }
    });
    let count = rgb.len() / 3;
    let green = |i: usize| halves[i * 3 + 1].to_bits();
    let plane = |channel: usize| {
        let value = |i: usize| match channel {
            1 => green(i),
            c => halves[i * 3 + c].to_bits().wrapping_sub(green(i)),
        };
        let values: Vec<u16> = (0..count).map(value).collect();
        let mut bytes = vec![0; 2 * count];
        let (low, high) = bytes.split_at_mut(count);
        for i in 0..count {
            let (x, y) = (i % width, i / width);
            let left = || values[i - 1];
            let above = || values[i - width];
            let guess = match (x, y) {
                (0, 0) => 0,
                (_, 0) => left(),
                (0, _) => above(),
                // The mean of two numbers that may be on both sides of zero.
                _ => left().wrapping_add(
                    (above().wrapping_sub(left()).cast_signed() >> 1).cast_unsigned(),
                ),
            };
            let difference = values[i].wrapping_sub(guess).cast_signed();
            // Small numbers of either sign become small ones.
            let folded = ((difference << 1) ^ (difference >> 15)).cast_unsigned();
            [low[i], high[i]] = folded.to_le_bytes();
        }
        bytes
    };
    let planes: Vec<Vec<u8>> = (0..3).into_par_iter().map(plane).collect();
    let mut encoder = ZlibEncoder::new(out, Compression::new(LEVEL));
    planes.iter().try_for_each(|plane| encoder.write_all(plane))?;
    encoder.finish()
}

/// The nearest float whose last bits are zero.
fn rounded(half: f16) -> f16 {
    const STEP: u16 = 1 << ROUNDED;
    let near = f16::from_bits(half.to_bits().wrapping_add(STEP / 2) & !(STEP - 1));
    // The largest ones would become infinite.
    if near.is_finite() { near } else { half }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use flate2::read::ZlibDecoder;
    use std::io::Read;

    /// The inverse, as in the page.
    pub fn unpack(bytes: &[u8], width: usize, count: usize) -> Vec<u16> {
        let mut all = Vec::new();
        ZlibDecoder::new(bytes).read_to_end(&mut all).expect("it was compressed here");
        assert_eq!(all.len(), 6 * count);
        let mut planes = vec![vec![0_u16; count]; 3];
        for (channel, plane) in planes.iter_mut().enumerate() {
            let bytes = &all[channel * 2 * count..];
            for i in 0..count {
                let folded = u16::from_le_bytes([bytes[i], bytes[count + i]]);
                let difference = (folded >> 1) ^ (folded & 1).wrapping_neg();
                let guess = match (i % width, i / width) {
                    (0, 0) => 0,
                    (_, 0) => plane[i - 1],
                    (0, _) => plane[i - width],
                    _ => {
                        let (left, above) = (plane[i - 1], plane[i - width]);
                        let apart = above.wrapping_sub(left).cast_signed() >> 1;
                        left.wrapping_add(apart.cast_unsigned())
                    }
                };
                plane[i] = guess.wrapping_add(difference);
            }
        }
        let value = |i: usize, c: usize| match c {
            1 => planes[1][i],
            c => planes[c][i].wrapping_add(planes[1][i]),
        };
        (0..count).flat_map(|i| [0, 1, 2].map(|c| value(i, c))).collect()
    }

    #[test]
    fn every_bit_of_every_value_comes_back() {
        for (width, height) in [(1, 1), (1, 5), (7, 1), (13, 9)] {
            let value = |i: usize| match i % 11 {
                0 => f32::NAN,
                1 => f32::INFINITY,
                2 => -1.5,
                _ => (i as f32 * 0.37).sin().abs() * 10_f32.powi(i as i32 % 5 - 2),
            };
            let rgb: Vec<f32> = (0..width * height * 3).map(value).collect();
            let bytes =
                compress(&rgb, width, false, b"head".to_vec()).expect("memory takes everything");
            assert_eq!(bytes[..4], *b"head");
            let wanted: Vec<u16> = rgb.iter().map(|&v| f16::from_f32(v).to_bits()).collect();
            assert_eq!(unpack(&bytes[4..], width, width * height), wanted);
        }
    }

    #[test]
    fn smooth_pictures_become_small() {
        let value = |i: usize| 0.5 + 0.3 * ((i / 3 % 200) as f32 * 0.02).sin();
        let rgb: Vec<f32> = (0..200 * 100 * 3).map(value).collect();
        let bytes = compress(&rgb, 200, false, Vec::new()).expect("memory takes everything");
        assert!(bytes.len() < rgb.len() / 4, "{} bytes", bytes.len());
    }

    #[test]
    fn rounded_values_take_less_and_look_the_same() {
        let value = |i: usize| 0.4 + 0.3 * (i as f32 * 12.9898).sin();
        let rgb: Vec<f32> = (0..200 * 100 * 3).map(value).collect();
        let all = |is_rounded| compress(&rgb, 200, is_rounded, Vec::new()).expect("memory");
        let bytes = all(true);
        assert!(bytes.len() < all(false).len() * 3 / 4);
        let level = |v: f32| 255.0 * v.powf(1.0 / 2.2);
        for (bits, wanted) in unpack(&bytes, 200, 200 * 100).into_iter().zip(&rgb) {
            let shown = f16::from_bits(bits).to_f32();
            assert!((level(shown) - level(*wanted)).abs() < 1.0, "{wanted}: {shown}");
        }
        for value in [f16::INFINITY, f16::MAX, f16::MIN, f16::ZERO] {
            assert_eq!(rounded(value), value);
        }
        assert!(rounded(f16::NAN).is_nan());
    }
}
