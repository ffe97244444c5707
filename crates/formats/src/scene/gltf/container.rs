//! Splits a file into the JSON document and its buffers: GLB chunks, data URIs, and files next to
//! the scene.

use super::json::{Json, REPAIR};
use super::meshopt::{self, Compression};
use crate::mesh::text::decoded;
use crate::{Input, Place, ReadError};
use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use serde_json::Value;
use std::borrow::Cow;
use std::cell::{OnceCell, RefCell};

/// Magic bytes of a binary glTF file.
pub(super) const GLB_MAGIC: &[u8] = b"glTF";

/// The parts of a file before they are interpreted.
pub(super) struct Container<'a> {
    /// The document.
    pub json: Value,
    /// The GLB's binary chunk: content of buffer 0 if that has no URI.
    pub binary: Option<&'a [u8]>,
}

impl<'a> Container<'a> {
    /// Splits a `.glb` or parses a `.gltf`.
    pub fn open(input: &'a Input) -> Result<Self, ReadError> {
        if input.bytes.starts_with(GLB_MAGIC) {
            return open_glb(input);
        }
        let is_named_binary = input.name.to_lowercase().ends_with(".glb");
        if is_named_binary && input.bytes.trim_ascii_start().first() != Some(&b'{') {
            let problem = "this is not a binary glTF (.glb) file: it does not begin with glTF";
            return Err(input.error(Place::Byte(0), problem, OTHER));
        }
        Ok(Self { json: parse_json(input, &input.bytes)?, binary: None })
    }
}

fn parse_json(input: &Input, text: &[u8]) -> Result<Value, ReadError> {
    // The standard forbids a byte order mark and UTF-16, but some editors and shells write them. It
    // pads with blanks; some programs pad with zeros.
    let text = decoded(text);
    let end = text.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1);
    serde_json::from_slice(&text[..end]).map_err(|e| {
        let message = e.to_string();
        let problem = message.split(" at line ").next().unwrap_or(&message);
        input.error(
            Place::Column(e.line(), e.column()),
            format!("not valid JSON: {problem}"),
            REPAIR,
        )
    })
}

/// Splits the chunks of a GLB (glTF 2.0, section 4.4).
fn open_glb(input: &Input) -> Result<Container<'_>, ReadError> {
    let bytes = input.bytes.as_slice();
    let truncated = |at: usize, what: &str| {
        let place = Place::Byte(at as u64);
        input.error(place, format!("the file ends inside of {what}"), CUT_OFF)
    };
    let word =
        |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(truncated(bytes.len(), "its header"));
    };
    if version == 1 {
        return open_glb_1(input);
    }
    if version != 2 {
        return Err(input.error(
            Place::Byte(4),
            format!("this is binary glTF version {version}, expected version 2"),
            "convert it to glTF 2.0, for example with gltf-pipeline or Blender",
        ));
    }
    if length as usize > bytes.len() {
        return Err(input.error(
            Place::Byte(8),
            format!("the header promises {length} bytes, but the file has {}", bytes.len()),
            CUT_OFF,
        ));
    }
    let end = (length as usize).max(12);
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < end {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(truncated(at, "a chunk's header"));
        };
        let start = at + 8;
        let stop = start + size as usize;
        let chunk = bytes
            .get(start..stop)
            .filter(|_| stop <= end)
            .ok_or_else(|| truncated(at, "a chunk"))?;
        // Chunks of other kinds, and further chunks of the same kind, belong to extensions and are
        // skipped.
        match &kind.to_le_bytes() {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at = stop;
    }
    let Some(json) = json else {
        return Err(input.error(Place::Byte(12), "this binary glTF has no JSON chunk", REPAIR));
    };
    Ok(Container { json: parse_json(input, json)?, binary })
}

/// Splits a binary file of glTF 1.0 (`KHR_binary_glTF`): after the lengths of the file and of the
/// document comes the format of the document, 0 for JSON; the body is the rest.
fn open_glb_1(input: &Input) -> Result<Container<'_>, ReadError> {
    let bytes = input.bytes.as_slice();
    let word =
        |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (Some(length), Some(format)) = (word(12), word(16)) else {
        let place = Place::Byte(bytes.len() as u64);
        return Err(input.error(place, "the file ends inside of its header", CUT_OFF));
    };
    if format != 0 {
        let problem = format!("its document has format {format}, expected 0, which is JSON");
        return Err(input.error(Place::Byte(16), problem, REPAIR));
    }
    let Some((text, body)) = bytes[20..].split_at_checked(length as usize) else {
        let found = bytes.len() - 20;
        let problem = format!("its document should have {length} bytes, but there are {found}");
        return Err(input.error(Place::Byte(12), problem, CUT_OFF));
    };
    let text = text.trim_ascii_end();
    Ok(Container { json: parse_json(input, text)?, binary: Some(body) })
}

/// Remedy for files of another format.
const OTHER: &str = "copy or export it again, or give it the extension of its format";
/// Remedy for files that end too early.
const CUT_OFF: &str = "the file is cut off: copy or export it again";

/// A part of a buffer, which lies within the buffer's declared length.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// Number of the view.
    number: usize,
    buffer: usize,
    offset: usize,
    /// Bytes that the compressed data takes in the buffer, if the view is compressed.
    packed: Option<usize>,
    /// Length in bytes.
    pub length: usize,
    /// Bytes from one element to the next, if the file gives them.
    pub stride: Option<usize>,
}

/// The buffers of a document, each loaded on first use.
pub(super) struct Buffers<'a> {
    input: &'a Input,
    binary: Option<&'a [u8]>,
    declared: Vec<Json<'a>>,
    views: Vec<Json<'a>>,
    loaded: Vec<OnceCell<Cow<'a, [u8]>>>,
    /// Decoded contents of compressed views.
    decoded: Vec<OnceCell<Vec<u8>>>,
    /// Warnings about what was loaded.
    warnings: RefCell<Vec<String>>,
}

/// Buffers may lack this many bytes at their end: some writers declare a length that is rounded up,
/// or count a last element that they do not write.
const MAX_MISSING_BYTES: usize = 15;

impl<'a> Buffers<'a> {
    /// Prepares the buffers; nothing is read yet.
    pub fn new(
        input: &'a Input,
        root: &Json<'a>,
        binary: Option<&'a [u8]>,
    ) -> Result<Self, ReadError> {
        let declared = root.items_of("buffers")?;
        let views = root.items_of("bufferViews")?;
        let loaded = declared.iter().map(|_| OnceCell::new()).collect();
        let decoded = views.iter().map(|_| OnceCell::new()).collect();
        let warnings = RefCell::default();
        Ok(Self { input, binary, declared, views, loaded, decoded, warnings })
    }

    /// Warnings about the buffers that have been loaded.
    pub fn take_warnings(&self) -> Vec<String> {
        self.warnings.take()
    }

    /// The glTF file.
    pub fn input(&self) -> &'a Input {
        self.input
    }

    /// Locates a buffer view, checked against its buffer's declared length, without reading any
    /// buffer.
    pub fn view(&self, index: &Json) -> Result<View, ReadError> {
        let view = entry(&self.views, index, "buffer views")?;
        let number = index.size()?;
        let length = view.require("byteLength")?.size()?;
        let stride = view.get("byteStride")?.map(|s| s.size()).transpose()?;
        // The uncompressed fallback location of a compressed view is ignored.
        let Some(extension) = meshopt::extension(view)? else {
            let (buffer, offset) = self.place(view, length)?;
            return Ok(View { number, buffer, offset, packed: None, length, stride });
        };
        let packed = extension.require("byteLength")?.size()?;
        let (buffer, offset) = self.place(&extension, packed)?;
        Compression::read(extension, packed, length)?;
        Ok(View { number, buffer, offset, packed: Some(packed), length, stride })
    }

    /// The buffer of a view, and the checked offset of the view's `length` bytes.
    fn place(&self, view: &Json, length: usize) -> Result<(usize, usize), ReadError> {
        let index = view.require("buffer")?;
        let buffer = entry(&self.declared, &index, "buffers")?;
        let offset = view.size_or("byteOffset", 0)?;
        let total = buffer.require("byteLength")?.size()?;
        match offset.checked_add(length) {
            Some(end) if end <= total => Ok((index.size()?, offset)),
            _ => Err(view.error(format!(
                "the buffer view takes {length} bytes from byte {offset}, but its buffer has \
                    {total} bytes"
            ))),
        }
    }

    /// The bytes of a buffer view, decoded.
    pub fn bytes(&self, view: &View) -> Result<&[u8], ReadError> {
        let Some(packed) = view.packed else {
            return self.stored(view.buffer, view.offset, view.length);
        };
        let cell = &self.decoded[view.number];
        let decoded = match cell.get() {
            Some(decoded) => decoded,
            None => {
                let json = &self.views[view.number];
                let bytes = self.stored(view.buffer, view.offset, packed)?;
                let extension = meshopt::extension(json)?
                    .ok_or_else(|| json.error("the view is not compressed"))?;
                let compression = Compression::read(extension, packed, view.length)?;
                self.input.charge(view.length as u64, "a compressed buffer view")?;
                let decoded =
                    crate::guard::guarded(|| compression.decode(bytes)).ok_or_else(|| {
                        json.error("the compressed data is damaged: its decoder failed")
                    })??;
                cell.get_or_init(|| decoded)
            }
        };
        Ok(&decoded[..view.length])
    }

    /// Bytes of a buffer, as stored in the file.
    fn stored(&self, buffer: usize, offset: usize, length: usize) -> Result<&[u8], ReadError> {
        let (json, cell) = (&self.declared[buffer], &self.loaded[buffer]);
        let bytes = match cell.get() {
            Some(bytes) => bytes,
            None => {
                let bytes = self.load(json, buffer == 0)?;
                cell.get_or_init(|| bytes)
            }
        };
        Ok(&bytes[offset..offset + length])
    }

    /// The bytes of the buffer view that `index` refers to.
    pub fn view_bytes(&self, index: &Json) -> Result<&[u8], ReadError> {
        self.bytes(&self.view(index)?)
    }

    /// Loads a buffer, with at least as many bytes as it declares. A few bytes that are missing at
    /// its end become zeros, with a warning.
    fn load(&self, buffer: &Json<'a>, is_first: bool) -> Result<Cow<'a, [u8]>, ReadError> {
        let bytes = self.fetch(buffer, is_first)?;
        let length = buffer.require("byteLength")?.size()?;
        let missing = length.saturating_sub(bytes.len());
        if missing > 0 && missing <= MAX_MISSING_BYTES.min(length / 2) {
            self.warnings.borrow_mut().push(format!(
                "the buffer at {} should have {length} bytes, but has {}; the missing ones are \
                    taken as 0",
                buffer.path(),
                bytes.len()
            ));
            let mut bytes = bytes.into_owned();
            bytes.resize(length, 0);
            return Ok(Cow::Owned(bytes));
        }
        if missing > 0 {
            return Err(buffer.error_with(
                format!("the buffer should have {length} bytes, but has only {}", bytes.len()),
                "the file with the buffer is cut off or not the right one: copy or export it again",
            ));
        }
        Ok(bytes)
    }

    fn fetch(&self, buffer: &Json<'a>, is_first: bool) -> Result<Cow<'a, [u8]>, ReadError> {
        match buffer.get("uri")? {
            Some(uri) => Ok(Cow::Owned(fetch_uri(self.input, &uri)?)),
            None => self.binary.filter(|_| is_first).map(Cow::Borrowed).ok_or_else(|| {
                buffer.error_with(
                    "the buffer has no \"uri\", and there is no binary chunk for it",
                    "export the file again with its buffers",
                )
            }),
        }
    }
}

/// The entry of a table that `index` refers to.
fn entry<'t, T>(table: &'t [T], index: &Json, what: &str) -> Result<&'t T, ReadError> {
    let i = index.size()?;
    table.get(i).ok_or_else(|| {
        index.error(format!("it refers to number {i} of the {what}, but there are {}", table.len()))
    })
}

/// The bytes that a URI names: a data URI, or a file relative to the scene's.
pub(super) fn fetch_uri(input: &Input, uri: &Json) -> Result<Vec<u8>, ReadError> {
    let text = uri.string()?;
    if let Some(data) = text.strip_prefix("data:") {
        return decode_data_uri(data).map_err(|problem| uri.error(problem));
    }
    if text.is_empty() {
        return Err(uri.error("the name of the file is empty"));
    }
    let decoded =
        percent_encoding::percent_decode_str(text).decode_utf8().unwrap_or(Cow::Borrowed(text));
    if text.contains("://") && !input.resolve(&decoded).is_ok_and(|path| path.exists()) {
        return Err(uri.error_with(
            format!("\"{text}\" is not a file next to the scene"),
            "download it, and put it beside the scene",
        ));
    }
    let opened = match input.open_relative(&decoded) {
        // Some exporters do not encode: "50%25.bin" may be the literal name.
        Err(first) if decoded != text => input.open_relative(text).map_err(|_| first),
        result => result,
    };
    let named = |e: ReadError| {
        uri.error_with(format!("the file \"{decoded}\" cannot be used: {}", e.problem), e.remedy)
    };
    opened.map(|file| file.bytes).map_err(named)
}

/// Decodes the part of a data URI after `data:`.
fn decode_data_uri(data: &str) -> Result<Vec<u8>, String> {
    let Some((header, body)) = data.split_once(',') else {
        return Err("the data URI has no comma before its data".into());
    };
    if !header.ends_with(";base64") {
        return Ok(percent_encoding::percent_decode_str(body).collect());
    }
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    let engine = GeneralPurpose::new(&base64::alphabet::STANDARD, config);
    // Lines may be broken, and `-` and `_` are written for `+` and `/` in addresses.
    let is_odd = |c: char| c.is_ascii_whitespace() || matches!(c, '-' | '_');
    let body: Cow<str> = if body.contains(is_odd) {
        let plain = body.chars().filter(|c| !c.is_ascii_whitespace());
        let usual = |c| match c {
            '-' => '+',
            '_' => '/',
            c => c,
        };
        Cow::Owned(plain.map(usual).collect())
    } else {
        Cow::Borrowed(body)
    };
    engine.decode(body.as_bytes()).map_err(|e| format!("the data URI is not valid base64: {e}"))
}
