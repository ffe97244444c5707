//! Writers of formats without layers: PNG, JPEG and PPM hold display values, Radiance HDR
//! scene-linear ones.

use super::picture::{Picture, Unfit, finite};
use super::{Display, WriteOptions, display_value};
use image::codecs::hdr::HdrEncoder;
use image::codecs::jpeg::JpegEncoder;
use rayon::prelude::*;
use snell_scene::LayeredImage;

/// Encodes PNG of 8 or 16 bits, with the metadata, and with alpha if the picture has it (not
/// premultiplied, as the format requires).
pub fn png(image: &LayeredImage, options: &WriteOptions) -> Result<Vec<u8>, Unfit> {
    let picture = Picture::of(image)?;
    let has_alpha = picture.has_alpha();
    let data = match options.png_bits {
        8 => display_bytes::<1>(&picture, &options.display, has_alpha),
        16 => display_bytes::<2>(&picture, &options.display, has_alpha),
        other => {
            return Err(Unfit::new(
                format!("PNG of {other} bits per channel is not supported"),
                "use 8 or 16",
            ));
        }
    };
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_color(if has_alpha { ::png::ColorType::Rgba } else { ::png::ColorType::Rgb });
    encoder.set_depth(if options.png_bits == 8 {
        ::png::BitDepth::Eight
    } else {
        ::png::BitDepth::Sixteen
    });
    if options.display.srgb {
        encoder.set_source_srgb(::png::SrgbRenderingIntent::RelativeColorimetric);
    }
    add_metadata(&mut encoder, &image.metadata).map_err(|e| failed("PNG", &e))?;
    let mut writer = encoder.write_header().map_err(|e| failed("PNG", &e))?;
    writer.write_image_data(&data).map_err(|e| failed("PNG", &e))?;
    writer.finish().map_err(|e| failed("PNG", &e))?;
    Ok(bytes)
}

/// Adds text chunks. A keyword has 1 to 79 printable characters.
fn add_metadata(
    encoder: &mut ::png::Encoder<'_, &mut Vec<u8>>,
    metadata: &[(String, String)],
) -> Result<(), ::png::EncodingError> {
    for (key, value) in metadata {
        let keyword: String = key
            .chars()
            .map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' })
            .take(79)
            .collect();
        let keyword = keyword.trim().to_string();
        let value = value.replace('\0', " ");
        match (keyword.is_empty(), value.is_ascii()) {
            (true, _) => {}
            (false, true) => encoder.add_text_chunk(keyword, value)?,
            (false, false) => encoder.add_itxt_chunk(keyword, value)?,
        }
    }
    Ok(())
}

/// Encodes JPEG. Transparent pixels are composited over black.
pub fn jpeg(image: &LayeredImage, options: &WriteOptions) -> Result<Vec<u8>, Unfit> {
    let picture = Picture::of(image)?;
    if image.width.max(image.height) > 65535 {
        return Err(Unfit::new(
            "JPEG holds at most 65535 pixels a side",
            "write PNG or OpenEXR instead",
        ));
    }
    let data = display_bytes::<1>(&picture, &options.display, false);
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, options.jpeg_quality.clamp(1, 100))
        .encode(&data, image.width, image.height, image::ExtendedColorType::Rgb8)
        .map_err(|e| failed("JPEG", &e))?;
    Ok(bytes)
}

/// Encodes binary PPM of 8 bits. Transparent pixels are composited over black.
pub fn ppm(image: &LayeredImage, options: &WriteOptions) -> Result<Vec<u8>, Unfit> {
    let picture = Picture::of(image)?;
    let mut bytes = format!("P6\n{} {}\n255\n", picture.width, picture.height).into_bytes();
    bytes.extend(display_bytes::<1>(&picture, &options.display, false));
    Ok(bytes)
}

/// Encodes Radiance HDR: three 8-bit mantissas with a shared exponent; negative values become 0.
/// Alpha is dropped.
pub fn radiance(image: &LayeredImage, _: &WriteOptions) -> Result<Vec<u8>, Unfit> {
    let picture = Picture::of(image)?;
    let pixel = |i| {
        let [r, g, b, _] = picture.rgba(i);
        image::Rgb([r, g, b].map(|v| finite(v).max(0.0)))
    };
    let pixels: Vec<_> = (0..picture.width * picture.height).map(pixel).collect();
    let mut bytes = Vec::new();
    HdrEncoder::new(&mut bytes)
        .encode(&pixels, picture.width, picture.height)
        .map_err(|e| failed("Radiance HDR", &e))?;
    Ok(bytes)
}

fn failed(format: &str, error: &dyn std::error::Error) -> Unfit {
    Unfit::new(format!("the picture cannot be encoded as {format}: {error}"), "try another format")
}

/// Display values as integers of `BYTES` bytes, big endian, rounded to nearest, RGB or RGBA.
fn display_bytes<const BYTES: usize>(
    picture: &Picture<'_>,
    display: &Display,
    with_alpha: bool,
) -> Vec<u8> {
    let channels = if with_alpha { 4 } else { 3 };
    let row_bytes = picture.width * channels * BYTES;
    let mut bytes = vec![0; row_bytes * picture.height];
    bytes.par_chunks_exact_mut(row_bytes).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(channels * BYTES).enumerate() {
            let values = display_rgba(picture.rgba(y * picture.width + x), display, with_alpha);
            for (bytes, value) in pixel.chunks_exact_mut(BYTES).zip(values) {
                match BYTES {
                    1 => bytes[0] = (value * 255.0).round() as u8,
                    _ => bytes.copy_from_slice(&((value * 65535.0).round() as u16).to_be_bytes()),
                }
            }
        }
    });
    bytes
}

/// Display values of a premultiplied colour: composited over black, or divided by alpha.
fn display_rgba([r, g, b, a]: [f32; 4], display: &Display, with_alpha: bool) -> [f32; 4] {
    let alpha = if a.is_nan() { 0.0 } else { a.clamp(0.0, 1.0) };
    let divisor = if with_alpha && alpha > 0.0 { alpha } else { 1.0 };
    // An infinite value is a renderer's error: it counts as 0, like NaN.
    let [r, g, b] =
        display_value([r, g, b].map(|v| if v.is_finite() { v / divisor } else { 0.0 }), display);
    [r, g, b, alpha]
}
