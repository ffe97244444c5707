//! Image files, through well-kept crates.

use crate::{Input, ReadError, WriteError};
use snell_scene::{Image, LayeredImage};
use std::path::Path;

/// How to turn scene-linear values into display values, for formats that hold display values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Display {
    /// Exposure in stops.
    pub exposure: f64,
    /// Curve.
    pub tonemap: Tonemap,
    /// False for formats that want the clamped linear values as they are.
    pub srgb: bool,
}

/// Tone maps for display formats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tonemap {
    /// Clamp only.
    #[default]
    None,
    /// ACES filmic.
    Aces,
    /// AgX.
    Agx,
}

/// Settings of the writers.
#[derive(Clone, Debug, PartialEq)]
pub struct WriteOptions {
    /// For display formats.
    pub display: Display,
    /// Bits per channel of PNG: 8 or 16.
    pub png_bits: u8,
    /// Half instead of float channels in OpenEXR.
    pub exr_half: bool,
    /// Quality of JPEG, 1 to 100.
    pub jpeg_quality: u8,
}

/// Decodes an image file; the content decides the format.
pub fn read_image(input: &Input) -> Result<Image, ReadError> {
    let _ = input;
    unreachable_for_now()
}

fn unreachable_for_now() -> Result<Image, ReadError> {
    Err(ReadError { file: String::new(), place: crate::Place::Whole, problem: String::new(), remedy: String::new() })
}

/// Encodes a picture in the format that `path`'s extension names.
pub fn encode_image(path: &Path, image: &LayeredImage, options: &WriteOptions) -> Result<Vec<u8>, WriteError> {
    let _ = (image, options);
    Err(WriteError::Format { path: path.into(), problem: String::new(), remedy: String::new() })
}

/// Encodes and writes a picture: to a temporary file first, then renamed.
pub fn write_image(path: &Path, image: &LayeredImage, options: &WriteOptions) -> Result<(), WriteError> {
    crate::atomic::write(path, &encode_image(path, image, options)?)
}
