//! Decodes by the library of the format's makers.

use super::{Compression, Filter, Mode};
use ::meshopt::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat,
    decode_index_buffer, decode_index_sequence, decode_vertex_buffer,
};

/// The bytes of a buffer view; `None` if they are damaged.
pub fn decode(of: &Compression, packed: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = match (of.mode, of.stride) {
        (Mode::Attributes, stride) => attributes(packed, of.count, stride / 4),
        (Mode::Triangles, 2) => decode_index_buffer::<u16>(packed, of.count)
            .ok()
            .map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        (Mode::Triangles, _) => decode_index_buffer::<u32>(packed, of.count)
            .ok()
            .map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        (Mode::Indices, 2) => decode_index_sequence::<u16>(packed, of.count)
            .ok()
            .map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        (Mode::Indices, _) => decode_index_sequence::<u32>(packed, of.count)
            .ok()
            .map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()),
    }?;
    match (of.filter, of.stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => decode_filter_oct(bytes.as_chunks_mut::<4>().0),
        (Filter::Octahedral, _) => bytes = with_halfwords(&bytes, decode_filter_oct),
        (Filter::Color, 4) => decode_filter_color(bytes.as_chunks_mut::<4>().0),
        (Filter::Color, _) => bytes = with_halfwords(&bytes, decode_filter_color),
        (Filter::Quaternion, _) => {
            bytes = with_halfwords(&bytes, |e| {
                let mut signed: Vec<[i16; 4]> = e.iter().map(|e| e.map(|x| x as i16)).collect();
                decode_filter_quat(&mut signed);
                e.iter_mut().zip(signed).for_each(|(e, s)| *e = s.map(|x| x as u16));
            });
        }
        (Filter::Exponential, _) => {
            let mut words: Vec<[u32; 1]> =
                bytes.as_chunks::<4>().0.iter().map(|b| [u32::from_le_bytes(*b)]).collect();
            decode_filter_exp(&mut words);
            bytes = words.iter().flat_map(|[word]| word.to_le_bytes()).collect();
        }
    }
    Some(bytes)
}

/// Applies a change to bytes as groups of four 16-bit numbers.
fn with_halfwords(bytes: &[u8], change: impl FnOnce(&mut [[u16; 4]])) -> Vec<u8> {
    let halfword = |e: &[u8; 8], i: usize| u16::from_le_bytes([e[2 * i], e[2 * i + 1]]);
    let mut elements: Vec<[u16; 4]> =
        bytes.as_chunks::<8>().0.iter().map(|e| std::array::from_fn(|i| halfword(e, i))).collect();
    change(&mut elements);
    elements.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// An element of an attribute: the decoder needs a type of the right size.
#[derive(Clone)]
struct Element<const N: usize>([u32; N]);

impl<const N: usize> Default for Element<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

/// Decodes elements of `words` 32-bit words; `None` if the data is damaged.
fn attributes(packed: &[u8], count: usize, words: usize) -> Option<Vec<u8>> {
    fn of<const N: usize>(packed: &[u8], count: usize) -> Option<Vec<u8>> {
        let elements = decode_vertex_buffer::<Element<N>>(packed, count).ok()?;
        // The decoder writes the bytes of the file, in order.
        Some(elements.iter().flat_map(|e| e.0).flat_map(u32::to_ne_bytes).collect())
    }
    macro_rules! by_size {
        ($($n:literal)*) => {
            match words {
                $($n => of::<$n>(packed, count),)*
                _ => None,
            }
        };
    }
    by_size!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32
             33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60
             61 62 63 64)
}
