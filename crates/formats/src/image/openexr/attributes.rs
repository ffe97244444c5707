//! Text attributes in the header of an OpenEXR file.
//!
//! The crate `exr` keeps custom attributes in a hash map and writes them in an order that changes
//! from run to run. The same picture must give the same bytes, so they are put into the finished
//! header here: attributes are a plain list that ends with a zero byte, and the table of chunk
//! offsets follows (OpenEXR, "File Layout").

use std::ops::Range;

/// Flag in the version field: names may have up to 255 bytes instead of 31.
const LONG_NAMES: u8 = 0x04;

/// Adds the metadata to a file of a single part. Names in use get a prefix; names that cannot be
/// used are left out.
pub fn insert(mut bytes: Vec<u8>, metadata: &[(String, String)], long_names: bool) -> Vec<u8> {
    let Some((end, mut names)) = header_end(&bytes) else { return bytes };
    let mut added = Vec::new();
    let mut long = long_names;
    for (key, value) in metadata {
        let key = key.replace('\0', " ");
        let name = if names.contains(&key) { format!("snell.{key}") } else { key };
        if name.is_empty() || name.len() > 255 || names.contains(&name) {
            continue;
        }
        let Ok(length) = i32::try_from(value.len()) else { continue };
        long |= name.len() > 31;
        added.extend_from_slice(name.as_bytes());
        added.extend_from_slice(b"\0string\0");
        added.extend_from_slice(&length.to_le_bytes());
        added.extend_from_slice(value.as_bytes());
        names.push(name);
    }
    shift_offsets(&mut bytes, end + 1, added.len() as u64);
    if long {
        bytes[5] |= LONG_NAMES;
    }
    bytes.splice(end..end, added);
    bytes
}

/// Finds the zero byte that ends the attributes, and the names before it.
fn header_end(bytes: &[u8]) -> Option<(usize, Vec<String>)> {
    let mut at = 8;
    let mut names = Vec::new();
    while *bytes.get(at)? != 0 {
        names.push(attribute(bytes, &mut at)?.0);
    }
    Some((at, names))
}

/// Reads an attribute and moves past it: its name, and where the bytes of its value are.
pub fn attribute(bytes: &[u8], at: &mut usize) -> Option<(String, Range<usize>)> {
    let name = text(bytes, at)?;
    text(bytes, at)?;
    let size = i32::from_le_bytes(*bytes.get(*at..)?.first_chunk()?);
    let start = *at + 4;
    let end = start.checked_add(usize::try_from(size).ok()?)?;
    *at = end;
    Some((name, start..end.min(bytes.len())))
}

/// True if a part of the file has several samples at a pixel, each with its depth.
pub fn is_deep(bytes: &[u8]) -> bool {
    bytes.get(5).is_some_and(|flags| flags & 0x08 != 0)
}

/// True if the file may have several parts, each with a header.
pub fn is_multipart(bytes: &[u8]) -> bool {
    bytes.get(5).is_some_and(|flags| flags & 0x10 != 0)
}

/// Reads text up to a zero byte, and moves past it.
fn text(bytes: &[u8], at: &mut usize) -> Option<String> {
    let length = bytes.get(*at..)?.iter().position(|b| *b == 0)?;
    let text = String::from_utf8_lossy(&bytes[*at..*at + length]).into_owned();
    *at += length + 1;
    Some(text)
}

/// Adds `by` to every entry of the table of chunk offsets. The lowest offset is that of the first
/// chunk, which follows the table directly, so it marks the table's end.
fn shift_offsets(bytes: &mut [u8], table: usize, by: u64) {
    let mut end = bytes.len();
    let mut at = table;
    while at + 8 <= end {
        let entry: [u8; 8] = std::array::from_fn(|i| bytes[at + i]);
        let offset = u64::from_le_bytes(entry);
        end = end.min(usize::try_from(offset).unwrap_or(end));
        bytes[at..at + 8].copy_from_slice(&(offset + by).to_le_bytes());
        at += 8;
    }
}
