//! KTX2 pictures: the largest level of the first picture of a file. What is compressed by Basis
//! Universal is transcoded by the crate `basisu` ([`basis`]); all else is named by a format of
//! Vulkan ([`vulkan`]) and decoded by [`texels`], from data that may be compressed by zstd or zlib.

mod basis;
mod vulkan;

use super::picture::check_size;
use super::texels;
use crate::{Input, Place, ReadError};
use snell_scene::{Encoding, Image};
use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;

/// The first bytes of every KTX2 file.
pub const IDENTIFIER: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Supercompression by zstd.
const ZSTD: u32 = 2;

/// Supercompression by zlib.
const ZLIB: u32 = 3;

const REMEDY: &str = "save it as PNG, or as KTX2 with Basis Universal compression";

/// Decodes the largest level of the first picture of a file.
pub fn read(input: &Input) -> Result<Image, ReadError> {
    let header =
        Header::read(&input.bytes).ok_or_else(|| damaged(input, "its header is incomplete"))?;
    let mut image = match vulkan::format(header.format) {
        Some((layout, encoding)) => read_texels(input, &header, layout, encoding)?,
        None => basis::read(input, &header)?,
    };
    let orientation = header.text(&input.bytes, "KTXorientation").unwrap_or_default();
    if orientation.as_bytes().get(1) == Some(&b'u') {
        texels::flip(&mut image);
    }
    if let Some(others) = header.others() {
        input.note(format!("{}: {others}", input.name));
    }
    if header.is_premultiplied {
        input.note(format!(
            "{}: the colours of the KTX2 picture are multiplied by alpha, which is not undone",
            input.name
        ));
    }
    Ok(image)
}

fn damaged(input: &Input, why: &str) -> ReadError {
    let problem = format!("the KTX2 picture is damaged or cut off: {why}");
    input.error(Place::Whole, problem, "copy or export it again")
}

/// The facts before the texels (KTX 2.0, section 3).
struct Header {
    /// The `VkFormat`; 0 for most of what Basis Universal compresses.
    format: u32,
    size: [u32; 2],
    /// 0 if the picture is no volume.
    depth: u32,
    /// 0 if the picture is no array.
    layers: u32,
    faces: u32,
    /// 0, or 1 for BasisLZ, 2 for zstd, 3 for zlib.
    supercompression: u32,
    /// Where the keys and values are.
    facts: Range<usize>,
    /// Where the largest level is.
    level: Range<usize>,
    /// Bytes of the largest level without supercompression, of all pictures together.
    level_bytes: u64,
    /// The colour model of the Khronos data format, which names kinds of compression.
    model: u8,
    /// True if the values are display values.
    is_srgb: bool,
    is_premultiplied: bool,
}

impl Header {
    fn read(bytes: &[u8]) -> Option<Self> {
        if !bytes.starts_with(IDENTIFIER) {
            return None;
        }
        let word = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        let long = |at: usize| Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
        let range = |start: u64, length: u64| {
            Some(usize::try_from(start).ok()?..usize::try_from(start.checked_add(length)?).ok()?)
        };
        let facts = range(word(56)?.into(), word(60)?.into())?;
        let level = range(long(80)?, long(88)?)?;
        // The basic descriptor: colour model, primaries, transfer function and flags.
        let descriptor = word(48)? as usize;
        let [model, _, transfer, flags] =
            word(descriptor.checked_add(12)?).unwrap_or_default().to_le_bytes();
        Some(Self {
            format: word(12)?,
            size: [word(20)?, word(24)?.max(1)],
            depth: word(28)?,
            layers: word(32)?,
            faces: word(36)?,
            supercompression: word(44)?,
            facts,
            level,
            level_bytes: long(96)?,
            model,
            is_srgb: transfer == 2,
            is_premultiplied: flags & 1 != 0,
        })
    }

    /// The number of pictures of each level; of volumes, the slices.
    fn pictures(&self) -> u64 {
        let count = |n: u32| u64::from(n.max(1));
        count(self.layers).saturating_mul(count(self.faces)).saturating_mul(count(self.depth))
    }

    /// What else than one picture the file has, in words.
    fn others(&self) -> Option<String> {
        let Self { depth, layers, faces, .. } = self;
        Some(match (depth, layers, faces) {
            (2.., ..) => {
                format!("the KTX2 picture is a volume of {depth} slices; the first is shown")
            }
            (_, 2.., 2..) => {
                format!("the KTX2 picture is an array of {layers} cube maps; one face is shown")
            }
            (_, _, 2..) => "the KTX2 picture is a cube map; its first face (+X) is shown".into(),
            (_, 2.., _) => {
                format!("the KTX2 picture is an array of {layers} pictures; the first is shown")
            }
            _ => return None,
        })
    }

    /// The text of a key. (Each entry: its length, the key, a zero byte, the value, and bytes up to
    /// a multiple of four.)
    fn text<'a>(&self, bytes: &'a [u8], key: &str) -> Option<&'a str> {
        let mut rest = bytes.get(self.facts.clone())?;
        loop {
            let (length, after) = rest.split_first_chunk()?;
            let length = u32::from_le_bytes(*length) as usize;
            let entry = after.get(..length)?;
            let end = entry.iter().position(|b| *b == 0)?;
            if &entry[..end] == key.as_bytes() {
                let value = std::str::from_utf8(&entry[end + 1..]).ok()?;
                return Some(value.trim_end_matches('\0')).filter(|value| value.is_ascii());
            }
            rest = after.get(length.checked_next_multiple_of(4)?..)?;
        }
    }
}

fn read_texels(
    input: &Input,
    header: &Header,
    layout: texels::Layout,
    encoding: Option<Encoding>,
) -> Result<Image, ReadError> {
    let [width, height] = header.size;
    check_size(input, width.into(), height.into(), layout.pixel_bytes())?;
    let stored = layout.stored_bytes(width, height);
    let bytes = level(input, header, stored)?;
    let by_descriptor = if header.is_srgb { Encoding::Srgb } else { Encoding::Linear };
    let encoding = encoding.unwrap_or(by_descriptor);
    let mut image = texels::decode(layout, encoding, header.size, &bytes)
        .map_err(|why| damaged(input, &why))?;
    match header.text(&input.bytes, "KTXswizzle") {
        Some(letters) => {
            image = texels::swizzle(image, letters)
                .ok_or_else(|| damaged(input, "its KTXswizzle has unknown letters"))?;
        }
        None if layout.has_two_channels() => {
            texels::complete(&mut image);
        }
        None => {}
    }
    Ok(image)
}

/// The first bytes of the largest level, without supercompression.
fn level<'a>(input: &'a Input, header: &Header, length: u64) -> Result<Cow<'a, [u8]>, ReadError> {
    let packed = input.bytes.get(header.level.clone());
    let packed =
        packed.ok_or_else(|| damaged(input, "its largest level is outside of the file"))?;
    if header.supercompression == 0 {
        return Ok(packed.into());
    }
    input.charge(length, "the unpacked KTX2 picture")?;
    let mut bytes = Vec::new();
    let read = match header.supercompression {
        ZSTD => {
            charge_window(input, packed)?;
            ruzstd::StreamingDecoder::new(packed)
                .map_err(|e| damaged(input, &e.to_string()))?
                .take(length)
                .read_to_end(&mut bytes)
        }
        ZLIB => flate2::read::ZlibDecoder::new(packed).take(length).read_to_end(&mut bytes),
        other => {
            let problem = format!(
                "the KTX2 picture has the supercompression {other}, which is not supported"
            );
            return Err(input.error(Place::Whole, problem, REMEDY));
        }
    };
    read.map_err(|e| damaged(input, &e.to_string()))?;
    Ok(bytes.into())
}

/// Charges the bytes that a zstd stream may refer back to: its decoder unpacks as many before it
/// returns the first.
fn charge_window(input: &Input, packed: &[u8]) -> Result<(), ReadError> {
    let (frame, _) = ruzstd::frame::read_frame_header(packed)
        .map_err(|_| damaged(input, "it has no data that are compressed by zstd"))?;
    let window = frame.header.window_size();
    let window = window.map_err(|e| damaged(input, &e.to_string()))?;
    input.charge(window, "the window of the KTX2 picture's compression")
}

#[cfg(test)]
mod tests;
