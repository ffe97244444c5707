//! Portable float maps: a text header of three words, then raw floats, bottom row first.
//!
//! Format: Debevec, "PFM Portable FloatMap Image Format". The sign of the third number gives the
//! byte order (negative: little endian), its magnitude scales the values.

use super::WriteOptions;
use super::picture::{Picture, Unfit, check_size};
use crate::{Input, Place, ReadError};
use snell_scene::{Image, LayeredImage};

/// True for `PF` or `Pf` and white space.
pub fn recognises(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'F' | b'f', space, ..] if space.is_ascii_whitespace())
}

/// Decodes RGB (`PF`) or grey (`Pf`).
pub fn read(input: &Input) -> Result<Image, ReadError> {
    let mut header = Header { input, at: 0 };
    let channels = match header.word()? {
        "PF" => 3,
        "Pf" => 1,
        other => return Err(header.error(format!("found \"{other}\" where PF or Pf was expected"))),
    };
    let width: u32 = header.number("the width")?;
    let height: u32 = header.number("the height")?;
    let scale: f32 = header.number("the scale")?;
    if scale == 0.0 || !scale.is_finite() {
        return Err(
            header.error(format!("the scale is {scale}, expected a finite number other than 0"))
        );
    }
    check_size(input, width.into(), height.into(), u64::from(channels) * 4)?;
    let row = width as usize * channels as usize;
    let data = &input.bytes[header.at..];
    let expected = row * height as usize * 4;
    if data.len() < expected {
        return Err(header
            .error(format!("{} bytes of pixels follow, {expected} were expected", data.len())));
    }
    let (floats, _) = data[..expected].as_chunks::<4>();
    let decode = |bytes: &[u8; 4]| match scale < 0.0 {
        true => f32::from_le_bytes(*bytes),
        false => f32::from_be_bytes(*bytes),
    };
    let mut values = Vec::with_capacity(floats.len());
    for line in floats.chunks_exact(row).rev() {
        values.extend(line.iter().map(|b| decode(b) * scale.abs()));
    }
    Ok(Image::from_f32(width, height, channels, values))
}

/// Reads the words of the header.
struct Header<'a> {
    input: &'a Input,
    /// Number of bytes read so far.
    at: usize,
}

impl<'a> Header<'a> {
    /// Returns the next word, and skips one white-space byte after it (pixels may start with bytes
    /// that look like white space).
    fn word(&mut self) -> Result<&'a str, ReadError> {
        let rest = &self.input.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let length = rest[start..].iter().take(32).position(u8::is_ascii_whitespace);
        let Some(length) = length else {
            return Err(self.error("the header ends early or has an overlong word".into()));
        };
        let word = std::str::from_utf8(&rest[start..start + length]);
        let word = word.map_err(|_| self.error("the header is not text".into()))?;
        self.at += start + length + 1;
        Ok(word)
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, ReadError> {
        let word = self.word()?;
        word.parse().map_err(|_| self.error(format!("found \"{word}\" where {what} was expected")))
    }

    fn error(&self, problem: String) -> ReadError {
        self.input.error(
            Place::Byte(self.at as u64),
            problem,
            "the file is damaged: export the image again",
        )
    }
}

/// Encodes RGB, or grey if the picture has one channel, in little endian. Alpha is dropped: colours
/// are composited over black. Values that are not finite are written as they are.
pub fn encode(image: &LayeredImage, _: &WriteOptions) -> Result<Vec<u8>, Unfit> {
    let picture = Picture::of(image)?;
    let (name, channels) = if picture.is_grey() { ("Pf", 1) } else { ("PF", 3) };
    let mut bytes = format!("{name}\n{} {}\n-1.0\n", picture.width, picture.height).into_bytes();
    bytes.reserve(picture.width * picture.height * channels * 4);
    for y in (0..picture.height).rev() {
        for x in 0..picture.width {
            let rgba = picture.rgba(y * picture.width + x);
            bytes.extend(rgba[..channels].iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    Ok(bytes)
}
