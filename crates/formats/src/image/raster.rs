//! Formats that are decoded by the crate `image`.

use super::picture::check_size;
use crate::{Input, Place, ReadError};
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader, Limits};
use snell_scene::{Encoding, Image, Pixels};
use std::error::Error;
use std::io::Cursor;

/// Decodes a format of display values. They are taken as sRGB; any gamma or colour profile in the
/// file is ignored.
pub fn read(input: &Input, format: image::ImageFormat) -> Result<Image, ReadError> {
    let mut reader = ImageReader::with_format(Cursor::new(input.bytes.as_slice()), format);
    reader.limits(decoder_limits(input));
    let decoder = reader.into_decoder().map_err(|e| decode_error(input, &e))?;
    decode(input, decoder)
}

/// Decodes Radiance HDR of the usual order of pixels, also with a missing or unusual signature.
/// `bytes` are those of the input with its header in the usual form.
pub fn read_radiance(input: &Input, bytes: &[u8]) -> Result<Image, ReadError> {
    let decoder =
        HdrDecoder::new_nonstrict(Cursor::new(bytes)).map_err(|e| decode_error(input, &e))?;
    decode(input, decoder)
}

/// Limits on what decoders may allocate in addition to the pixels, such as for profiles and
/// comments, which are compressed as well: twice the size to which the file's bytes may expand.
fn decoder_limits(input: &Input) -> Limits {
    let mut limits = Limits::default();
    let crate::Limits { memory_bytes, expansion, .. } = input.options.limits;
    let allowed = (input.bytes.len() as u64).saturating_mul(expansion).saturating_add(memory_bytes);
    limits.max_alloc = Some(allowed.saturating_mul(2));
    limits
}

fn decode(input: &Input, decoder: impl ImageDecoder) -> Result<Image, ReadError> {
    let (width, height) = decoder.dimensions();
    check_size(input, width.into(), height.into(), decoder.color_type().bytes_per_pixel().into())?;
    let decoded = DynamicImage::from_decoder(decoder).map_err(|e| decode_error(input, &e))?;
    let (channels, pixels) = match decoded {
        DynamicImage::ImageLuma8(p) => (1, Pixels::U8(p.into_raw())),
        DynamicImage::ImageLumaA8(p) => (2, Pixels::U8(p.into_raw())),
        DynamicImage::ImageRgb8(p) => (3, Pixels::U8(p.into_raw())),
        DynamicImage::ImageRgba8(p) => (4, Pixels::U8(p.into_raw())),
        DynamicImage::ImageLuma16(p) => (1, Pixels::U16(p.into_raw())),
        DynamicImage::ImageLumaA16(p) => (2, Pixels::U16(p.into_raw())),
        DynamicImage::ImageRgb16(p) => (3, Pixels::U16(p.into_raw())),
        DynamicImage::ImageRgba16(p) => (4, Pixels::U16(p.into_raw())),
        DynamicImage::ImageRgb32F(p) => (3, Pixels::F32(p.into_raw())),
        other => (4, Pixels::F32(other.into_rgba32f().into_raw())),
    };
    let encoding = if matches!(pixels, Pixels::F32(_)) { Encoding::Linear } else { Encoding::Srgb };
    Ok(Image { width, height, channels, pixels, encoding })
}

fn decode_error(input: &Input, error: &ImageError) -> ReadError {
    match error {
        ImageError::Unsupported(e) => input.error(
            Place::Whole,
            format!("the image uses a feature that is not supported: {e}"),
            "save it as PNG or OpenEXR",
        ),
        ImageError::Limits(_) => input.error(
            Place::Whole,
            format!(
                "the image declares more than the limit of {} pixels",
                input.options.limits.image_pixels
            ),
            "scale the image down, or cut it into parts",
        ),
        other => {
            let problem = format!("the image is damaged or cut off: {}", in_words(other));
            input.error(Place::Whole, problem, "export the image again")
        }
    }
}

/// A decoder's message, without the names of the format and of internal types.
fn in_words(error: &ImageError) -> String {
    let text = match error {
        ImageError::Decoding(error) => {
            error.source().map_or_else(|| error.to_string(), ToString::to_string)
        }
        other => other.to_string(),
    };
    let words = text.split(" while decoding ChunkType").next().unwrap_or_default();
    words.trim_end_matches('.').to_string()
}

/// The texts of a PNG file, by their keywords; none if the file is another or is damaged.
/// Compressed texts are left out.
pub fn png_metadata(bytes: &[u8]) -> Vec<(String, String)> {
    let limits = ::png::Limits { bytes: bytes.len().saturating_mul(2) };
    let decoder = ::png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    let Ok(reader) = decoder.read_info() else { return Vec::new() };
    let info = reader.info();
    let plain = info.uncompressed_latin1_text.iter();
    let plain = plain.map(|chunk| (chunk.keyword.clone(), chunk.text.clone()));
    let wide = info.utf8_text.iter().filter(|chunk| !chunk.compressed);
    let wide = wide.filter_map(|chunk| Some((chunk.keyword.clone(), chunk.get_text().ok()?)));
    plain.chain(wide).collect()
}
