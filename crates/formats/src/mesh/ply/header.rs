//! The header: the elements and their properties.

use crate::mesh::notes::Notes;
use crate::mesh::text::{Reader, Text, Word};
use crate::search::text_of;
use crate::{Input, ReadError};

/// The encoding of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    fn of(name: &[u8]) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_slice() {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes in binary files.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// True for the integer types.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// The divisor for colours of this type.
    pub fn color_scale(self) -> f32 {
        match self {
            Self::U16 | Self::I16 => 65535.0,
            Self::F32 | Self::F64 => 1.0,
            _ => 255.0,
        }
    }
}

/// A property of an element.
#[derive(Clone, Debug)]
pub struct Property {
    pub name: String,
    /// Type of the value, or of the list's items.
    pub value: Type,
    /// Type of the list's length, for lists.
    pub length: Option<Type>,
}

/// A kind of element.
#[derive(Clone, Debug)]
pub struct Element {
    /// Offset of the line that declares the element.
    pub start: usize,
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl Element {
    /// The minimum size of one element in the body: bytes, or characters with their separators.
    pub fn least_size(&self, format: Format) -> usize {
        let of = |p: &Property| {
            if format == Format::Ascii { 2 } else { p.length.unwrap_or(p.value).size() }
        };
        self.properties.iter().map(of).sum()
    }
}

/// A header.
#[derive(Clone, Debug)]
pub struct Header {
    pub format: Format,
    pub elements: Vec<Element>,
    /// The names of pictures in `comment TextureFile` lines, which MeshLab and others write.
    pub textures: Vec<String>,
    /// True to read texture coordinates of corners and colours of faces, for which vertices are
    /// split. Scene formats that name PLY files do not, and match attributes to the vertices of the
    /// file.
    pub reads_corners: bool,
    /// Offset of the first byte after the header.
    pub end: usize,
}

impl Header {
    /// Reads the header. Lines of unknown words are skipped with a warning.
    pub fn read(input: &Input, notes: &mut Notes) -> Result<Self, ReadError> {
        let bytes = &input.bytes[..];
        let mut reader = Reader::new(input, bytes, Text::new(bytes, 0));
        if reader.text.word().is_none_or(|w| !w.bytes.eq_ignore_ascii_case(b"ply")) {
            return Err(reader.error(
                0,
                "the file does not begin with \"ply\"",
                "this is not a PLY file",
            ));
        }
        reader.text.next_line();
        let mut format = None;
        let mut elements: Vec<Element> = Vec::new();
        let mut textures = Vec::new();
        loop {
            let Some(word) = reader.text.word() else {
                if reader.text.is_at_end() {
                    return Err(reader.missing("end_header"));
                }
                reader.text.next_line();
                continue;
            };
            match word.bytes.to_ascii_lowercase().as_slice() {
                b"comment" | b"obj_info" => {
                    if reader.text.word().is_some_and(|w| w.bytes.eq_ignore_ascii_case(TEXTURE)) {
                        let name = reader.text.rest_of_line().bytes;
                        textures.push(text_of(name));
                    }
                    reader.text.next_line();
                    continue;
                }
                b"format" => format = Some(read_format(&mut reader)?),
                b"element" => elements.push(read_element(&mut reader)?),
                b"property" => match elements.last_mut() {
                    Some(element) => {
                        let property = read_property(&mut reader)?;
                        if element.name == "vertex"
                            && property.length.is_some()
                            && is_index_list(&property.name)
                        {
                            let problem = "the element vertex has a list of vertex numbers, which \
                                belongs to faces";
                            let remedy =
                                "a line such as \"element face 12\" seems to be missing before it";
                            return Err(reader.error(word.start, problem, remedy));
                        }
                        element.properties.push(property);
                    }
                    None => {
                        return Err(reader.error(
                            word.start,
                            "a property before the first element",
                            EXPORT_AGAIN,
                        ));
                    }
                },
                b"end_header" => break,
                _ => {
                    notes.add("header", || {
                        format!(
                            "{}: {} is not a word of a header (format, comment, obj_info, element, \
                            property or end_header); such lines were skipped",
                            reader.location(word.start),
                            word.quoted()
                        )
                    });
                    reader.text.next_line();
                    continue;
                }
            }
            expect_line_end(&mut reader)?;
        }
        expect_line_end(&mut reader)?;
        let end = body_start(bytes, reader.text.position());
        let Some(format) = format else {
            return Err(reader.error(0, "the header has no line \"format\"", EXPORT_AGAIN));
        };
        Ok(Self { format, elements, textures, reads_corners: false, end })
    }
}

/// The word after `comment` before the name of a picture.
const TEXTURE: &[u8] = b"TextureFile";

const EXPORT_AGAIN: &str = "correct the header, or export the file again";

/// Skips exactly one line end of the kind that the first line has, because a binary body may itself
/// begin with a line feed.
fn body_start(bytes: &[u8], at: usize) -> usize {
    let first = bytes.iter().position(|b| b"\r\n".contains(b)).unwrap_or(0);
    let lone_return = bytes.get(first) == Some(&b'\r') && bytes.get(first + 1) != Some(&b'\n');
    match bytes.get(at..) {
        Some([b'\r', b'\n', ..]) if !lone_return => at + 2,
        Some([_, ..]) => at + 1,
        _ => bytes.len(),
    }
}

fn expect_line_end(reader: &mut Reader) -> Result<(), ReadError> {
    match reader.text.word() {
        None => Ok(()),
        Some(word) => Err(reader.error(
            word.start,
            format!("found {}, expected the end of the line", word.quoted()),
            EXPORT_AGAIN,
        )),
    }
}

fn next<'a>(reader: &mut Reader<'a>, what: &str) -> Result<Word<'a>, ReadError> {
    reader.text.word().ok_or_else(|| reader.missing(what))
}

fn read_format(reader: &mut Reader) -> Result<Format, ReadError> {
    let expected = "ascii, binary_little_endian or binary_big_endian";
    let word = next(reader, expected)?;
    let format = match word.bytes.to_ascii_lowercase().as_slice() {
        b"ascii" => Format::Ascii,
        b"binary_little_endian" => Format::LittleEndian,
        b"binary_big_endian" => Format::BigEndian,
        _ => {
            let problem = format!("found format {}, expected {expected}", word.quoted());
            return Err(reader.error(word.start, problem, EXPORT_AGAIN));
        }
    };
    let version = next(reader, "the version 1.0")?;
    if version.bytes != b"1.0" {
        let problem = format!("found version {}, expected 1.0", version.quoted());
        return Err(reader.error(version.start, problem, EXPORT_AGAIN));
    }
    Ok(format)
}

fn read_element(reader: &mut Reader) -> Result<Element, ReadError> {
    let name = next(reader, "the name of an element")?;
    let start = name.start;
    let name = String::from_utf8_lossy(name.bytes).to_ascii_lowercase();
    let count = reader.count("the number of elements", false)?;
    Ok(Element { start, name, count, properties: Vec::new() })
}

fn read_property(reader: &mut Reader) -> Result<Property, ReadError> {
    let word = next(reader, "a type")?;
    let (value, length) = if word.bytes.eq_ignore_ascii_case(b"list") {
        let word = next(reader, "the type of a list's length")?;
        let length = type_of(reader, word)?;
        if !length.is_integer() {
            let problem =
                format!("found {}, expected an integer type for a list's length", word.quoted());
            return Err(reader.error(word.start, problem, EXPORT_AGAIN));
        }
        let word = next(reader, "the type of a list's items")?;
        (word, Some(length))
    } else {
        (word, None)
    };
    let type_word = value;
    let value = type_of(reader, type_word)?;
    let name = String::from_utf8_lossy(next(reader, "the name of a property")?.bytes).into_owned();
    if is_index_list(&name) && length.is_some() && !value.is_integer() {
        let problem =
            format!("found {}, expected an integer type for vertex numbers", type_word.quoted());
        return Err(reader.error(type_word.start, problem, EXPORT_AGAIN));
    }
    Ok(Property { name, value, length })
}

/// True for the names of the list that makes a face.
pub fn is_index_list(name: &str) -> bool {
    name.eq_ignore_ascii_case("vertex_indices") || name.eq_ignore_ascii_case("vertex_index")
}

fn type_of(reader: &Reader, word: Word) -> Result<Type, ReadError> {
    Type::of(word.bytes).ok_or_else(|| {
        let problem = format!(
            "found type {}, expected one such as uchar, int, float or double",
            word.quoted()
        );
        reader.error(word.start, problem, EXPORT_AGAIN)
    })
}
