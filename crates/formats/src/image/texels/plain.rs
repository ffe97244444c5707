//! Texels that are not compressed.

use super::Kind;
use half::f16;
use snell_math::real;
use snell_scene::Pixels;

/// Decodes values one after the other. Returns the number of channels too.
pub fn decode(kind: Kind, order: &[u8], bytes: &[u8]) -> (u32, Pixels) {
    let pixels = match kind {
        Kind::U8 => Pixels::U8(values(order, bytes, |[b]: [u8; 1]| b)),
        Kind::I8 => {
            Pixels::U16(values(order, bytes, |b| unsigned(f32::from(i8::from_le_bytes(b)) / 127.0)))
        }
        Kind::U16 => Pixels::U16(values(order, bytes, u16::from_le_bytes)),
        Kind::I16 => Pixels::U16(values(order, bytes, |b| {
            unsigned(f32::from(i16::from_le_bytes(b)) / 32767.0)
        })),
        Kind::F16 => Pixels::F32(values(order, bytes, |b| f16::from_le_bytes(b).to_f32())),
        Kind::F32 => Pixels::F32(values(order, bytes, f32::from_le_bytes)),
    };
    (channels(order) as u32, pixels)
}

fn channels(order: &[u8]) -> usize {
    order.iter().filter(|place| **place < 4).count()
}

/// The values of all pixels, in the order of the picture's channels.
fn values<const N: usize, T: Copy + Default>(
    order: &[u8],
    bytes: &[u8],
    value: impl Fn([u8; N]) -> T,
) -> Vec<T> {
    let channels = channels(order);
    let mut values = Vec::with_capacity(bytes.len() / (N * order.len()) * channels);
    for pixel in bytes.as_chunks::<N>().0.chunks_exact(order.len()) {
        let start = values.len();
        values.resize(start + channels, T::default());
        for (bytes, place) in pixel.iter().zip(order) {
            if let Some(slot) = values[start..].get_mut(usize::from(*place)) {
                *slot = value(*bytes);
            }
        }
    }
    values
}

/// A value of -1 to 1 as one of 0 to 65535.
pub fn unsigned(value: f32) -> u16 {
    ((value.max(-1.0) * 0.5 + 0.5) * 65535.0 + 0.5) as u16
}

/// Takes the channels from the bits of words. Returns the number of channels too.
pub fn unpack(each: usize, masks: [u32; 4], bytes: &[u8]) -> (u32, Pixels) {
    let [_, green, blue, alpha] = masks;
    let chosen: &[u32] = match (green | blue, alpha) {
        (0, 0) => &masks[..1],
        (0, _) => &[masks[0], alpha],
        (_, 0) if blue == 0 => &masks[..2],
        (_, 0) => &masks[..3],
        _ => &masks,
    };
    let words = bytes.chunks_exact(each).map(|bytes| {
        let mut word = [0; 4];
        word[..each].copy_from_slice(bytes);
        u32::from_le_bytes(word)
    });
    let channels = chosen.len() as u32;
    let share = |word: u32, mask: u32, most: u64| {
        let shift = mask.trailing_zeros() % 32;
        let (value, range) = (u64::from((word & mask) >> shift), u64::from((mask >> shift).max(1)));
        (value * most + range / 2) / range
    };
    let pixels = if chosen.iter().all(|mask| mask.count_ones() <= 8) {
        Pixels::U8(
            words.flat_map(|w| chosen.iter().map(move |m| share(w, *m, 255) as u8)).collect(),
        )
    } else {
        Pixels::U16(
            words.flat_map(|w| chosen.iter().map(move |m| share(w, *m, 65535) as u16)).collect(),
        )
    };
    (channels, pixels)
}

/// Colours that are encoded in words.
pub fn floats_of_words(bytes: &[u8], color: impl Fn(u32) -> [f32; 3]) -> (u32, Pixels) {
    let words = bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b));
    (3, Pixels::F32(words.flat_map(color).collect()))
}

/// Nine bits for red, green and blue, then five for the exponent, whose bias is 15; the numbers
/// have nine bits after the point.
pub fn shared_exponent(word: u32) -> [f32; 3] {
    let scale = real::powi(2f32, (word >> 27) as i32 - 15 - 9);
    [0, 9, 18].map(|shift| (word >> shift & 0x1ff) as f32 * scale)
}

/// Floats without sign, of 5 bits for the exponent and 6, 6 and 5 for the rest: those are halves
/// without their last bits.
pub fn small_floats(word: u32) -> [f32; 3] {
    let half = |bits: u32| f16::from_bits(bits as u16).to_f32();
    [half((word & 0x7ff) << 4), half((word >> 11 & 0x7ff) << 4), half((word >> 22) << 5)]
}
