//! `EXT_meshopt_compression` and `KHR_meshopt_compression` (the latter with one more filter):
//! buffer views that are decoded on first use.

#[cfg(not(target_family = "wasm"))]
mod decoder;

use super::json::Json;
use crate::ReadError;

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
    #[cfg(not(target_family = "wasm"))]
    pub fn decode(&self, packed: &[u8]) -> Result<Vec<u8>, ReadError> {
        decoder::decode(self, packed).ok_or_else(|| {
            self.json.error_with(
                "the compressed data is damaged",
                "copy or export the file again, or without compression",
            )
        })
    }

    /// The decoder is C++, which is not compiled for the browser.
    #[cfg(target_family = "wasm")]
    pub fn decode(&self, _: &[u8]) -> Result<Vec<u8>, ReadError> {
        let _ = (self.count, self.stride, self.mode, self.filter);
        Err(self.json.error_with(
            "meshopt compression is not read in a page without a server",
            "open the file with `snell view`, or export it without this compression",
        ))
    }
}
