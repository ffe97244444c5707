//! Radiance HDR pictures in any of the eight orders of scan lines.
//!
//! The crate `image` decodes lines from the top with pixels from the left (`-Y 32 +X 48`) below a
//! header of plain lines. Other files are decoded as such, and the pixels then put into place.

use super::raster;
use crate::{Input, ReadError};
use snell_scene::{Image, Pixels};
use std::borrow::Cow;

/// The order of the pixels in a file: along which axes and in which directions.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Order {
    /// True if scan lines are columns.
    by_columns: bool,
    /// True if rows come from the bottom.
    from_bottom: bool,
    /// True if columns come from the right.
    from_right: bool,
}

/// Decodes a picture.
pub fn read(input: &Input) -> Result<Image, ReadError> {
    let Some((bytes, order)) = usual_form(&input.bytes) else {
        return raster::read_radiance(input, &input.bytes);
    };
    let image = raster::read_radiance(input, &bytes)?;
    let Pixels::F32(values) = &image.pixels else { return Ok(image) };
    let (lines, length) = (image.height as usize, image.width as usize);
    let (width, height) = if order.by_columns { (lines, length) } else { (length, lines) };
    let channels = image.channels as usize;
    let mut placed = vec![0.0; values.len()];
    for (at, pixel) in values.chunks_exact(channels).enumerate() {
        let (line, along) = (at / length, at % length);
        let (x, y) = if order.by_columns { (line, along) } else { (along, line) };
        let x = if order.from_right { width - 1 - x } else { x };
        let y = if order.from_bottom { height - 1 - y } else { y };
        let to = (y * width + x) * channels;
        placed[to..to + channels].copy_from_slice(pixel);
    }
    let (width, height) = (width as u32, height as u32);
    Ok(Image { width, height, pixels: Pixels::F32(placed), ..image })
}

/// The file with its header in the form that the decoder knows, and the order of its pixels; `None`
/// if the decoder knows the file as it is, or if the header is not one of Radiance.
fn usual_form(bytes: &[u8]) -> Option<(Cow<'_, [u8]>, Order)> {
    let mut at = 0;
    let mut header: Vec<&[u8]> = Vec::new();
    let resolution = loop {
        let length = bytes[at..].iter().take(1 << 16).position(|b| *b == b'\n')?;
        let line = bytes[at..at + length].strip_suffix(b"\r").unwrap_or(&bytes[at..at + length]);
        at += length + 1;
        match header.last() {
            Some([]) => break line,
            _ => header.push(line),
        }
    };
    let words: Vec<&str> = std::str::from_utf8(resolution).ok()?.split_ascii_whitespace().collect();
    let &[first, lines, second, length] = &words[..] else { return None };
    let _: (u32, u32) = (lines.parse().ok()?, length.parse().ok()?);
    let order = match (first, second) {
        ("-Y" | "+Y", "-X" | "+X") => {
            Order { by_columns: false, from_bottom: first == "+Y", from_right: second == "-X" }
        }
        ("-X" | "+X", "-Y" | "+Y") => {
            Order { by_columns: true, from_bottom: second == "+Y", from_right: first == "-X" }
        }
        _ => return None,
    };
    let is_plain = bytes[..at].iter().all(|b| *b != b'\r');
    if is_plain && order == (Order { by_columns: false, from_bottom: false, from_right: false }) {
        return None;
    }
    let mut usual = header.join(&b'\n');
    usual.extend(format!("\n-Y {lines} +X {length}\n").bytes());
    usual.extend(&bytes[at..]);
    Some((Cow::Owned(usual), order))
}

#[cfg(test)]
mod tests {
    use crate::image::read_image;
    use crate::{Input, ReadOptions};
    use std::path::Path;

    /// The first channel of each pixel of a file with this header, whose pixels are 1, 2, 3 ...
    fn picture(header: &str) -> ([u32; 2], Vec<f32>) {
        let mut bytes = header.as_bytes().to_vec();
        for value in 1..=6u8 {
            bytes.extend([value, 0, 0, 136]);
        }
        let input = Input::from_bytes("a.hdr", bytes, Path::new("."), &ReadOptions::default());
        let image = read_image(&input).unwrap_or_else(|e| panic!("{header:?}: {e}"));
        let (width, height) = (image.width, image.height);
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        ([width, height], pixels.map(|(x, y)| image.rgba(x, y)[0].floor()).collect())
    }

    #[test]
    fn pictures_may_begin_at_any_corner_and_go_either_way() {
        for (resolution, size, expected) in [
            ("-Y 2 +X 3", [3, 2], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
            ("-Y 2 -X 3", [3, 2], [3.0, 2.0, 1.0, 6.0, 5.0, 4.0]),
            ("+Y 2 +X 3", [3, 2], [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]),
            ("+Y 2 -X 3", [3, 2], [6.0, 5.0, 4.0, 3.0, 2.0, 1.0]),
            ("+X 3 -Y 2", [3, 2], [1.0, 3.0, 5.0, 2.0, 4.0, 6.0]),
            ("-X 3 -Y 2", [3, 2], [5.0, 3.0, 1.0, 6.0, 4.0, 2.0]),
            ("+X 3 +Y 2", [3, 2], [2.0, 4.0, 6.0, 1.0, 3.0, 5.0]),
            ("-X 3 +Y 2", [3, 2], [6.0, 4.0, 2.0, 5.0, 3.0, 1.0]),
        ] {
            let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{resolution}\n");
            assert_eq!(picture(&header), (size, expected.to_vec()), "{resolution}");
            assert_eq!(picture(&header.replace('\n', "\r\n")), (size, expected.to_vec()));
        }
    }
}
