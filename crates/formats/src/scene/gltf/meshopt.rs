//! `EXT_meshopt_compression` and `KHR_meshopt_compression` (the latter with one more filter):
//! buffer views that are decoded on first use.

use super::json::Json;
use crate::ReadError;
use ::meshopt::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat,
    decode_index_buffer, decode_index_sequence, decode_vertex_buffer,
};

/// The names of the extension.
pub(super) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Maximum decoded bytes per byte of the file; files with more are made to exhaust the memory.
const MAX_EXPANSION: usize = 1024;

/// Views of any size may decode to this many bytes.
const ALWAYS_ALLOWED_BYTES: usize = 1 << 16;

/// The compression of a buffer view.
pub(super) struct Compression<'a> {
    json: Json<'a>,
    /// Number of elements.
    count: usize,
    /// Bytes per element.
    stride: usize,
    mode: Mode,
    filter: Filter,
}

#[derive(Clone, Copy)]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, PartialEq)]
enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// The extension of a buffer view, if it is compressed.
pub(super) fn extension<'a>(view: &Json<'a>) -> Result<Option<Json<'a>>, ReadError> {
    for name in NAMES {
        if let Some(extension) = view.extension(name)? {
            return Ok(Some(extension));
        }
    }
    Ok(None)
}

impl<'a> Compression<'a> {
    /// Reads the extension of a view that takes `packed` bytes in the file and `length` bytes when
    /// it is decoded.
    pub fn read(json: Json<'a>, packed: usize, length: usize) -> Result<Self, ReadError> {
        let count = json.require("count")?.size()?;
        let stride_json = json.require("byteStride")?;
        let stride = stride_json.size()?;
        let mode = json.require("mode")?;
        let (mode, possible) = match mode.string()? {
            "ATTRIBUTES" => (Mode::Attributes, stride > 0 && stride <= 256 && stride % 4 == 0),
            "TRIANGLES" => (Mode::Triangles, (stride == 2 || stride == 4) && count % 3 == 0),
            "INDICES" => (Mode::Indices, stride == 2 || stride == 4),
            other => {
                return Err(mode.error(format!("\"{other}\" is not a mode of meshopt compression")));
            }
        };
        let filter = match json.get("filter")? {
            None => Filter::None,
            Some(name) => match name.string()? {
                "NONE" => Filter::None,
                "OCTAHEDRAL" => Filter::Octahedral,
                "QUATERNION" => Filter::Quaternion,
                "EXPONENTIAL" => Filter::Exponential,
                "COLOR" => Filter::Color,
                other => {
                    return Err(
                        name.error(format!("\"{other}\" is not a filter of meshopt compression"))
                    );
                }
            },
        };
        let fits = match filter {
            Filter::None | Filter::Exponential => true,
            Filter::Octahedral | Filter::Color => stride == 4 || stride == 8,
            Filter::Quaternion => stride == 8,
        };
        if !possible || !fits || (filter != Filter::None && !matches!(mode, Mode::Attributes)) {
            return Err(stride_json
                .error(format!("{count} elements of {stride} bytes are not possible here")));
        }
        let decoded = count.checked_mul(stride);
        if decoded.is_none_or(|decoded| decoded < length || decoded - length >= stride) {
            return Err(json.error(format!(
                "{count} elements of {stride} bytes are not the {length} of the view"
            )));
        }
        if length > packed.saturating_mul(MAX_EXPANSION).max(ALWAYS_ALLOWED_BYTES) {
            return Err(json.error(format!("{packed} bytes cannot expand to {length}")));
        }
        Ok(Self { json, count, stride, mode, filter })
    }

    /// Decodes the bytes of the file.
    pub fn decode(&self, packed: &[u8]) -> Result<Vec<u8>, ReadError> {
        let mut bytes = match (self.mode, self.stride) {
            (Mode::Attributes, stride) => attributes(packed, self.count, stride / 4),
            (Mode::Triangles, 2) => decode_index_buffer::<u16>(packed, self.count)
                .ok()
                .map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()),
            (Mode::Triangles, _) => decode_index_buffer::<u32>(packed, self.count)
                .ok()
                .map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()),
            (Mode::Indices, 2) => decode_index_sequence::<u16>(packed, self.count)
                .ok()
                .map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()),
            (Mode::Indices, _) => decode_index_sequence::<u32>(packed, self.count)
                .ok()
                .map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()),
        }
        .ok_or_else(|| {
            self.json.error_with(
                "the compressed data is damaged",
                "copy or export the file again, or without compression",
            )
        })?;
        match (self.filter, self.stride) {
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
        Ok(bytes)
    }
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
