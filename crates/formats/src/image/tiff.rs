//! TIFF pictures that the crate `image` does not know: with a palette, of one channel of floats, of
//! half floats, and of whole numbers of 32 bits. The crate `tiff`, on which `image` is built,
//! decodes their samples.

use super::picture::check_size;
use super::raster;
use crate::{Input, ReadError};
use snell_scene::{Encoding, Image, Pixels};
use std::borrow::Cow;
use std::io::Cursor;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};

/// Decodes the first page.
pub fn read(input: &Input) -> Result<Image, ReadError> {
    raster::read(input, ::image::ImageFormat::Tiff).or_else(|error| match read_samples(input) {
        Some(image) => image,
        None => Err(error),
    })
}

/// Decodes the samples of a picture of a kind that is known here; `None` for other pictures.
fn read_samples(input: &Input) -> Option<Result<Image, ReadError>> {
    let palette = Palette::of(&input.bytes);
    let bytes = palette.as_ref().map_or(Cow::Borrowed(&input.bytes[..]), Palette::indices);
    let mut decoder = Decoder::new(Cursor::new(&bytes[..])).ok()?;
    let (width, height) = decoder.dimensions().ok()?;
    let channels: u32 = match decoder.colortype().ok()? {
        ColorType::Gray(_) => 1,
        ColorType::GrayA(_) => 2,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        _ => return None,
    };
    if let Err(error) = check_size(input, width.into(), height.into(), u64::from(channels) * 4) {
        return Some(Err(error));
    }
    let decoded = decoder.read_image().ok()?;
    let pixels = width as usize * height as usize;
    let (channels, values) = match (decoded, palette) {
        (DecodingResult::U8(values), Some(palette)) => {
            (3, Pixels::U16(values.iter().flat_map(|&i| palette.color(i)).collect()))
        }
        (_, Some(_)) => return None,
        (DecodingResult::F16(v), _) => {
            (channels, Pixels::F32(v.iter().map(|x| x.to_f32()).collect()))
        }
        (DecodingResult::F32(v), _) => (channels, Pixels::F32(v)),
        (DecodingResult::F64(v), _) => {
            (channels, Pixels::F32(v.iter().map(|x| *x as f32).collect()))
        }
        (DecodingResult::U32(v), _) => {
            (channels, Pixels::U16(v.iter().map(|x| (x >> 16) as u16).collect()))
        }
        _ => return None,
    };
    let (encoding, count) = match &values {
        Pixels::F32(values) => (Encoding::Linear, values.len()),
        Pixels::U16(values) => (Encoding::Srgb, values.len()),
        Pixels::U8(values) => (Encoding::Srgb, values.len()),
    };
    let is_complete = count == pixels * channels as usize;
    is_complete.then_some(Ok(Image { width, height, channels, pixels: values, encoding }))
}

/// The palette of a picture.
struct Palette<'a> {
    bytes: &'a [u8],
    /// The place of the value that says that pixels are indices.
    interpretation: usize,
    is_big_endian: bool,
    /// All reds, then all greens, then all blues.
    colors: &'a [u8],
    /// True if the colours have 8 bits, as some programs write them, and not 16.
    has_bytes: bool,
}

impl<'a> Palette<'a> {
    /// The palette of the first page, if its pixels are indices of 8 bits (TIFF 6.0, section 5).
    fn of(bytes: &'a [u8]) -> Option<Self> {
        let is_big_endian = match bytes.get(..4)? {
            b"II*\0" => false,
            b"MM\0*" => true,
            _ => return None,
        };
        let short = |at: usize| Some(u16_at(bytes.get(at..at + 2)?, is_big_endian));
        let long = |at: usize| {
            let [a, b] = [short(at)?, short(at + 2)?].map(usize::from);
            Some(if is_big_endian { a << 16 | b } else { b << 16 | a })
        };
        let directory = long(4)?;
        let entries = usize::from(short(directory)?);
        let entry = |tag: u16| {
            let places = (0..entries).map(|i| directory + 2 + i * 12);
            places.clone().find(|at| short(*at) == Some(tag))
        };
        let interpretation = entry(262)? + 8;
        let has_indices = short(interpretation) == Some(3) && short(entry(258)? + 8) == Some(8);
        let map = entry(320)?;
        if !has_indices || long(map + 4) != Some(3 * 256) {
            return None;
        }
        let start = long(map + 8)?;
        let colors = bytes.get(start..start.checked_add(3 * 256 * 2)?)?;
        let has_bytes = colors.chunks_exact(2).all(|c| u16_at(c, is_big_endian) < 256);
        Some(Self { bytes, interpretation, is_big_endian, colors, has_bytes })
    }

    /// The file with its indices as shades of grey.
    fn indices(&self) -> Cow<'a, [u8]> {
        let mut bytes = self.bytes.to_vec();
        let one = if self.is_big_endian { [0, 1] } else { [1, 0] };
        bytes[self.interpretation..self.interpretation + 2].copy_from_slice(&one);
        Cow::Owned(bytes)
    }

    fn color(&self, index: u8) -> [u16; 3] {
        [0, 256, 512].map(|first| {
            let at = (first + usize::from(index)) * 2;
            let value = u16_at(&self.colors[at..at + 2], self.is_big_endian);
            if self.has_bytes { value * 257 } else { value }
        })
    }
}

fn u16_at(bytes: &[u8], is_big_endian: bool) -> u16 {
    let bytes = [bytes[0], bytes[1]];
    if is_big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) }
}

#[cfg(test)]
mod tests {
    use crate::image::read_image;
    use crate::{Input, ReadOptions};
    use half::f16;
    use snell_scene::{Encoding, Image};
    use std::path::Path;

    /// A picture of 2 x 1 pixels with these tags, in their order, and this data at byte 8.
    fn tiff(tags: &[(u16, u16, u32, u32)], data: &[u8]) -> Image {
        let mut bytes = b"II*\0".to_vec();
        bytes.extend((8 + data.len() as u32).to_le_bytes());
        bytes.extend(data);
        let size: [(u16, u16, u32, u32); 2] = [(256, 3, 1, 2), (257, 3, 1, 1)];
        bytes.extend(((size.len() + tags.len()) as u16).to_le_bytes());
        for (tag, kind, count, value) in size.iter().chain(tags) {
            bytes.extend(tag.to_le_bytes());
            bytes.extend(kind.to_le_bytes());
            bytes.extend(count.to_le_bytes());
            bytes.extend(value.to_le_bytes());
        }
        bytes.extend([0; 4]);
        let input = Input::from_bytes("a.tif", bytes, Path::new("."), &ReadOptions::default());
        read_image(&input).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Tags of a strip of grey samples of so many bits and this format.
    fn grey(bits: u32, format: u32, length: u32) -> [(u16, u16, u32, u32); 7] {
        let strip = [(273, 4, 1, 8), (277, 3, 1, 1), (278, 3, 1, 1), (279, 4, 1, length)];
        let [a, b, c, d] = strip;
        [(258, 3, 1, bits), (262, 3, 1, 1), a, b, c, d, (339, 3, 1, format)]
    }

    #[test]
    fn floats_of_one_channel_and_whole_numbers_of_32_bits_are_read() {
        let floats: Vec<u8> = [0.25f32, 7.5].iter().flat_map(|x| x.to_le_bytes()).collect();
        let image = tiff(&grey(32, 3, 8), &floats);
        assert_eq!((image.channels, image.encoding), (1, Encoding::Linear));
        assert_eq!([image.rgba(0, 0)[0], image.rgba(1, 0)[0]], [0.25, 7.5]);
        let halves: Vec<u8> =
            [0.25f32, 7.5].iter().flat_map(|x| f16::from_f32(*x).to_le_bytes()).collect();
        assert_eq!(tiff(&grey(16, 3, 4), &halves).rgba(1, 0)[0], 7.5);
        let whole: Vec<u8> = [0, u32::MAX].iter().flat_map(|x| x.to_le_bytes()).collect();
        let image = tiff(&grey(32, 1, 8), &whole);
        assert_eq!([image.rgba(0, 0)[0], image.rgba(1, 0)[0]], [0.0, 1.0]);
    }

    #[test]
    fn palettes_are_read() {
        for scale in [257u16, 1] {
            let mut data = vec![1, 2];
            let mut map = vec![0u16; 3 * 256];
            (map[1], map[256 + 2]) = (255 * scale, 255 * scale);
            data.extend(map.iter().flat_map(|c| c.to_le_bytes()));
            let tags = [
                (258, 3, 1, 8),
                (262, 3, 1, 3),
                (273, 4, 1, 8),
                (277, 3, 1, 1),
                (278, 3, 1, 1),
                (279, 4, 1, 2),
                (320, 3, 768, 10),
            ];
            let image = tiff(&tags, &data);
            assert_eq!(image.rgba(0, 0)[..3], [1.0, 0.0, 0.0], "{scale}");
            assert_eq!(image.rgba(1, 0)[..3], [0.0, 1.0, 0.0], "{scale}");
        }
    }
}
