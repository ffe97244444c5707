//! DirectDraw surfaces: the largest level of the first picture of a file, in any layout of
//! [`texels`]. Formats are named in three ways: by masks for the bits of a pixel, by four letters
//! (or a number of Direct3D 9), or by a number of DXGI in a second header.

use super::picture::check_size;
use super::texels::{self, Kind, Layout};
use crate::{Input, Place, ReadError};
use snell_scene::{Encoding, Image};

/// The first bytes of every file.
pub const IDENTIFIER: &[u8] = b"DDS ";

const REMEDY: &str = "save it as PNG, or with BC1 to BC7";

/// Decodes the largest level of the first picture.
pub fn read(input: &Input) -> Result<Image, ReadError> {
    let header = Header::read(&input.bytes).ok_or_else(|| {
        input.error(Place::Whole, "the DDS picture is damaged or cut off", "export it again")
    })?;
    let Some((layout, encoding)) = header.format.layout() else {
        let problem =
            format!("the DDS picture has {}, which is not supported", header.format.in_words());
        return Err(input.error(Place::Whole, problem, REMEDY));
    };
    let [width, height] = header.size;
    check_size(input, width.into(), height.into(), layout.pixel_bytes())?;
    let bytes = &input.bytes[header.length..];
    let mut image = texels::decode(layout, encoding, header.size, bytes).map_err(|why| {
        let problem = format!("the DDS picture is damaged or cut off: {why}");
        input.error(Place::Whole, problem, "copy or export it again")
    })?;
    if layout.has_two_channels() {
        texels::complete(&mut image);
    }
    if let Some(others) = header.others {
        input.note(format!("{}: {others}", input.name));
    }
    if header.format.is_premultiplied() {
        input.note(format!(
            "{}: the colours of the DDS picture are multiplied by alpha, which is not undone",
            input.name
        ));
    }
    Ok(image)
}

struct Header {
    size: [u32; 2],
    format: Format,
    /// What else than one picture the file has, in words.
    others: Option<&'static str>,
    /// Bytes before the texels.
    length: usize,
}

/// The name of a format.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Format {
    Dxgi(u32),
    /// Four letters, or a number of Direct3D 9.
    Letters([u8; 4]),
    /// Bits of a pixel, and the masks of red, green, blue and alpha; true if values have a sign.
    Masks(u32, [u32; 4], bool),
}

impl Header {
    fn read(bytes: &[u8]) -> Option<Self> {
        let word = |index: usize| Some(u32::from_le_bytes(*bytes.get(index * 4..)?.first_chunk()?));
        if !bytes.starts_with(IDENTIFIER) || word(1)? != 124 || word(19)? != 32 {
            return None;
        }
        const CUBE: u32 = 0x200;
        const VOLUME: u32 = 0x20_0000;
        let (flags, capabilities) = (word(20)?, word(28)?);
        let (mut is_cube, mut is_volume) = (capabilities & CUBE != 0, capabilities & VOLUME != 0);
        let (mut pictures, mut length) = (1, 128);
        let letters = word(21)?.to_le_bytes();
        let format = if flags & 4 == 0 {
            const ALPHA: u32 = 1 | 2;
            const COLORS: u32 = 0x40 | 0x2_0000;
            const SIGNED: u32 = 0x8_0000;
            let [red, green, blue, alpha] = [word(23)?, word(24)?, word(25)?, word(26)?];
            let alpha = if flags & ALPHA == 0 { 0 } else { alpha };
            let masks = match flags & (COLORS | SIGNED) {
                0 => [alpha, 0, 0, 0],
                _ => [red, green, blue, alpha],
            };
            Format::Masks(word(22)?, masks, flags & SIGNED != 0)
        } else if letters == *b"DX10" {
            const DXGI_CUBE: u32 = 4;
            const DXGI_VOLUME: u32 = 4;
            is_cube |= word(34)? & DXGI_CUBE != 0;
            is_volume |= word(33)? == DXGI_VOLUME;
            pictures = word(35)?;
            length = 148;
            word(36)?;
            Format::Dxgi(word(32)?)
        } else {
            Format::Letters(letters)
        };
        word(31)?;
        let others = match (is_cube, is_volume, pictures) {
            (true, ..) => Some("the DDS picture is a cube map; its first face is shown"),
            (_, true, _) => Some("the DDS picture is a volume; its first slice is shown"),
            (_, _, 2..) => Some("the DDS picture is an array; its first picture is shown"),
            _ => None,
        };
        Some(Self { size: [word(4)?, word(3)?], format, others, length })
    }
}

impl Format {
    /// The layout, and the encoding of its colours: values that can be display values are taken for
    /// such, because older files do not say what they are; two channels hold other data.
    fn layout(self) -> Option<(Layout, Encoding)> {
        let layout = match self {
            Self::Dxgi(number) => dxgi(number)?,
            Self::Letters(letters) => by_letters(letters)?,
            Self::Masks(bits, masks, signed) => by_masks(bits, masks, signed)?,
        };
        let is_linear = layout.is_linear() || layout.has_two_channels();
        Some((layout, if is_linear { Encoding::Linear } else { Encoding::Srgb }))
    }

    fn is_premultiplied(self) -> bool {
        matches!(self, Self::Letters([b'D', b'X', b'T', b'2' | b'4']))
    }

    fn in_words(self) -> String {
        match self {
            Self::Dxgi(number) => format!("the DXGI format {number}"),
            Self::Letters(letters) if letters.iter().all(u8::is_ascii_graphic) => {
                format!("the format \"{}\"", String::from_utf8_lossy(&letters))
            }
            Self::Letters(letters) => {
                format!("the format {} of Direct3D 9", u32::from_le_bytes(letters))
            }
            Self::Masks(bits, ..) => format!("pixels of {bits} bits of an unusual kind"),
        }
    }
}

const R: &[u8] = &[0];
const RG: &[u8] = &[0, 1];
const RGB: &[u8] = &[0, 1, 2];
const RGBA: &[u8] = &[0, 1, 2, 3];
const BGRA: &[u8] = &[2, 1, 0, 3];
const BGR_: &[u8] = &[2, 1, 0, 4];

const fn plain(kind: Kind, order: &'static [u8]) -> Layout {
    Layout::Plain { kind, order }
}

const fn packed(bytes: u8, masks: [u32; 4]) -> Layout {
    Layout::Packed { bytes, masks }
}

/// The layout of a `DXGI_FORMAT`.
fn dxgi(number: u32) -> Option<Layout> {
    use Kind::{F16, F32, I8, I16, U8, U16};
    Some(match number {
        2 => plain(F32, RGBA),
        6 => plain(F32, RGB),
        10 => plain(F16, RGBA),
        11 => plain(U16, RGBA),
        13 => plain(I16, RGBA),
        16 => plain(F32, RG),
        24 => packed(4, [0x3ff, 0x3ff << 10, 0x3ff << 20, 3 << 30]),
        26 => Layout::SmallFloats,
        27..=29 => plain(U8, RGBA),
        31 => plain(I8, RGBA),
        34 => plain(F16, RG),
        35 => plain(U16, RG),
        37 => plain(I16, RG),
        41 => plain(F32, R),
        49 => plain(U8, RG),
        51 => plain(I8, RG),
        54 => plain(F16, R),
        56 => plain(U16, R),
        58 => plain(I16, R),
        // The second holds alpha alone.
        61 | 65 => plain(U8, R),
        63 => plain(I8, R),
        67 => Layout::SharedExponent,
        70..=72 => Layout::Bc1,
        73..=75 => Layout::Bc2,
        76..=78 => Layout::Bc3,
        79 | 80 => Layout::Bc4(false),
        81 => Layout::Bc4(true),
        82 | 83 => Layout::Bc5(false),
        84 => Layout::Bc5(true),
        85 => packed(2, [0x1f << 11, 0x3f << 5, 0x1f, 0]),
        86 => packed(2, [0x1f << 10, 0x1f << 5, 0x1f, 1 << 15]),
        87 | 90 | 91 => plain(U8, BGRA),
        88 | 92 | 93 => plain(U8, BGR_),
        94 | 95 => Layout::Bc6(false),
        96 => Layout::Bc6(true),
        97..=99 => Layout::Bc7,
        115 => packed(2, [0xf << 8, 0xf << 4, 0xf, 0xf << 12]),
        _ => return None,
    })
}

/// The layout of a `FourCC`, or of a `D3DFMT` in its place.
fn by_letters(letters: [u8; 4]) -> Option<Layout> {
    Some(match &letters {
        b"DXT1" => Layout::Bc1,
        b"DXT2" | b"DXT3" => Layout::Bc2,
        b"DXT4" | b"DXT5" => Layout::Bc3,
        b"ATI1" | b"BC4U" => Layout::Bc4(false),
        b"BC4S" => Layout::Bc4(true),
        b"ATI2" | b"BC5U" => Layout::Bc5(false),
        b"BC5S" => Layout::Bc5(true),
        b"BC6H" => Layout::Bc6(false),
        b"BC7L" | b"BC7\0" => Layout::Bc7,
        _ => match u32::from_le_bytes(letters) {
            36 => plain(Kind::U16, RGBA),
            110 => plain(Kind::I16, RGBA),
            111 => plain(Kind::F16, R),
            112 => plain(Kind::F16, RG),
            113 => plain(Kind::F16, RGBA),
            114 => plain(Kind::F32, R),
            115 => plain(Kind::F32, RG),
            116 => plain(Kind::F32, RGBA),
            _ => return None,
        },
    })
}

/// The layout of pixels whose bits the file describes by masks.
fn by_masks(bits: u32, masks: [u32; 4], signed: bool) -> Option<Layout> {
    let bytes = bits.is_multiple_of(8).then_some(bits / 8).filter(|n| (1..=4).contains(n))?;
    let fits = |mask: &u32| bits == 32 || *mask < 1 << bits;
    if masks[0] == 0 || !masks.iter().all(fits) {
        return None;
    }
    Some(match (bits, masks, signed) {
        (32, [0xff, 0xff00, 0xff_0000, 0xff00_0000], false) => plain(Kind::U8, RGBA),
        (32, [0xff_0000, 0xff00, 0xff, 0xff00_0000], false) => plain(Kind::U8, BGRA),
        (16, [0xff, 0xff00, 0, 0], true) => plain(Kind::I8, RG),
        (32, [0xffff, 0xffff_0000, 0, 0], true) => plain(Kind::I16, RG),
        (32, [0xff, 0xff00, 0xff_0000, 0xff00_0000], true) => plain(Kind::I8, RGBA),
        (_, _, true) => return None,
        _ => packed(bytes as u8, masks),
    })
}

#[cfg(test)]
mod tests;
