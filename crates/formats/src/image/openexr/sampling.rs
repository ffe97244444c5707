//! Channels with fewer samples than pixels, which the crate `exr` does not read by itself: of the
//! colours of a luminance-chroma picture a file often keeps every second one in x and y.
//!
//! The header is given to the crate as if all channels were whole; blocks are then decompressed
//! with the true sampling, and the samples between are interpolated.

use super::attributes::{attribute, is_multipart};
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{ChannelDescription, IntegerBounds, SampleType};
use exr::meta::header::Header;
use std::borrow::Cow;

/// Distance between samples in x and y, by part and channel.
pub type Sampling = Vec<Vec<Vec2<usize>>>;

/// The file with a header in which every channel has a sample at each pixel, and the sampling that
/// it has in truth; empty if its channels are whole.
pub fn as_whole(bytes: &[u8]) -> (Cow<'_, [u8]>, Sampling) {
    match patched(bytes) {
        Some((patched, sampling)) => (patched.into(), sampling),
        None => (bytes.into(), Sampling::new()),
    }
}

fn patched(bytes: &[u8]) -> Option<(Vec<u8>, Sampling)> {
    let mut found: Option<Vec<u8>> = None;
    let mut sampling = Sampling::new();
    let mut at = 8;
    loop {
        let mut part = Vec::new();
        while *bytes.get(at)? != 0 {
            let (name, value) = attribute(bytes, &mut at)?;
            if name != "channels" {
                continue;
            }
            // Each channel: its name, a zero byte, its type, whether it is linear, the sampling in
            // x and in y; after the last, a zero byte.
            let mut channel = value.start;
            while *bytes.get(channel)? != 0 {
                let name = bytes.get(channel..value.end)?.iter().position(|b| *b == 0)?;
                let steps = channel + name + 9;
                let step = |at: usize| {
                    let step = i32::from_le_bytes(*bytes.get(at..)?.first_chunk()?);
                    usize::try_from(step).ok().filter(|step| (1..=64).contains(step))
                };
                let (x, y) = (step(steps)?, step(steps + 4)?);
                if (x, y) != (1, 1) {
                    let copy = found.get_or_insert_with(|| bytes.to_vec());
                    copy[steps..steps + 4].copy_from_slice(&1i32.to_le_bytes());
                    copy[steps + 4..steps + 8].copy_from_slice(&1i32.to_le_bytes());
                }
                part.push(Vec2(x, y));
                channel = steps + 8;
            }
        }
        sampling.push(part);
        at += 1;
        if !is_multipart(bytes) || *bytes.get(at)? == 0 {
            return Some((found?, sampling));
        }
    }
}

/// Decompresses a block of scan lines of a part with such channels. The samples of each line and in
/// it of each channel follow one another; channels have none on lines between their samples.
pub fn decompress(
    chunk: Chunk,
    meta: &MetaData,
    sampling: &[Vec2<usize>],
) -> Result<(IntegerBounds, Vec<u8>), String> {
    let mut header = meta.headers.get(chunk.layer_index).ok_or("a block of no part")?.clone();
    let place = header.get_block_data_indices(&chunk.compressed_block);
    let bounds = place
        .and_then(|place| header.get_absolute_block_pixel_coordinates(place))
        .map_err(|e| e.to_string())?;
    bounds.validate(Some(header.layer_size)).map_err(|e| e.to_string())?;
    let CompressedBlock::ScanLine(block) = chunk.compressed_block else {
        return Err("a tile has channels with fewer samples than pixels".into());
    };
    for (channel, step) in header.channels.list.iter_mut().zip(sampling) {
        channel.sampling = *step;
    }
    // The crate multiplies the pixels of the block by this to find the size of its data.
    let size = block_size(&header.channels.list, bounds);
    let pixels = bounds.size.area();
    if pixels == 0 || !size.is_multiple_of(pixels) {
        return Err(format!("{size} bytes for {pixels} pixels"));
    }
    header.channels.bytes_per_pixel = size / pixels;
    let compressed = block.compressed_pixels_le;
    let is_b44 = matches!(header.compression, Compression::B44 | Compression::B44A);
    let data = if is_b44 && compressed.len() != size {
        b44(&header, &compressed, bounds)?
    } else {
        let method = header.compression;
        method
            .decompress_image_section_from_le(&header, compressed, bounds, false)
            .map_err(|e| e.to_string())?
    };
    if data.len() != size { Err("a block of the wrong size".into()) } else { Ok((bounds, data)) }
}

/// Decompresses B44, whose decoder in the crate is wrong for such channels: each channel, which is
/// compressed by itself, is given to it as a whole one.
fn b44(header: &Header, compressed: &[u8], bounds: IntegerBounds) -> Result<Vec<u8>, String> {
    let mut rest = compressed;
    let mut channels = Vec::new();
    for channel in &header.channels.list {
        let size = channel.subsampled_resolution(bounds.size);
        let bytes = size.area() * channel.sample_type.bytes_per_sample();
        let length = match channel.sample_type {
            SampleType::F16 => b44_length(rest, size).ok_or("a block is cut off")?,
            SampleType::F32 | SampleType::U32 => bytes,
        };
        let (own, others) = rest.split_at_checked(length).ok_or("a block is cut off")?;
        rest = others;
        let mut single = header.clone();
        single.channels.list = std::iter::once(channel.clone()).collect();
        single.channels.list[0].sampling = Vec2(1, 1);
        single.channels.bytes_per_pixel = channel.sample_type.bytes_per_sample();
        let place = IntegerBounds::new(Vec2(0, 0), size);
        let data = header
            .compression
            .decompress_image_section_from_le(&single, own.to_vec(), place, false)
            .map_err(|e| e.to_string())?;
        channels.push((size.0 * channel.sample_type.bytes_per_sample(), data, 0));
    }
    let mut lines = Vec::new();
    let top = bounds.position.1.max(0) as usize;
    for y in top..top + bounds.size.1 {
        for (channel, (line, data, at)) in header.channels.list.iter().zip(&mut channels) {
            if has_line(channel, y) {
                let end = *at + *line;
                lines.extend_from_slice(data.get(*at..end).ok_or("a block of the wrong size")?);
                *at = end;
            }
        }
    }
    Ok(lines)
}

/// The number of bytes of a channel of half floats in B44: squares of 4 x 4 samples take 14 bytes,
/// or 3 if all samples are equal, which a large shift in the third byte says.
fn b44_length(bytes: &[u8], size: Vec2<usize>) -> Option<usize> {
    let squares = size.0.div_ceil(4) * size.1.div_ceil(4);
    (0..squares).try_fold(0, |at, _| Some(at + if *bytes.get(at + 2)? >= 13 << 2 { 3 } else { 14 }))
}

/// True if a channel has samples on a line of its part.
pub fn has_line(channel: &ChannelDescription, y: usize) -> bool {
    y.is_multiple_of(channel.sampling.1)
}

fn block_size(channels: &[ChannelDescription], bounds: IntegerBounds) -> usize {
    let lines = bounds.position.1.max(0) as usize..;
    lines
        .take(bounds.size.1)
        .flat_map(|y| channels.iter().filter(move |channel| has_line(channel, y)))
        .map(|c| bounds.size.0 / c.sampling.0 * c.sample_type.bytes_per_sample())
        .sum()
}

/// The samples of a channel that has fewer of them than its part has pixels.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Distance between samples in pixels.
    pub step: Vec2<usize>,
    /// Samples in x and y.
    size: Vec2<usize>,
    values: Vec<f32>,
}

impl Plane {
    /// A black plane of a channel with this step in a part with these pixels.
    pub fn new(pixels: Vec2<usize>, step: Vec2<usize>) -> Self {
        let size = Vec2(pixels.0 / step.0, pixels.1 / step.1);
        Self { step, size, values: vec![0.0; size.area()] }
    }

    /// The row of samples on a line of the part.
    pub fn row(&mut self, y: usize) -> &mut [f32] {
        let start = (y / self.step.1 * self.size.0).min(self.values.len());
        let end = (start + self.size.0).min(self.values.len());
        &mut self.values[start..end]
    }

    /// The value at a pixel of the part, interpolated between the samples around it; 0 if there
    /// are none.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        if self.values.is_empty() {
            return 0.0;
        }
        let place = |at: usize, step: usize, size: usize| {
            let first = (at / step).min(size - 1);
            (first, (first + 1).min(size - 1), (at % step) as f32 / step as f32)
        };
        let (x0, x1, u) = place(x, self.step.0, self.size.0);
        let (y0, y1, v) = place(y, self.step.1, self.size.1);
        let value = |x: usize, y: usize| self.values[y * self.size.0 + x];
        let line = |y: usize| mix(value(x0, y), value(x1, y), u);
        mix(line(y0), line(y1), v)
    }
}

fn mix(a: f32, b: f32, share: f32) -> f32 {
    if share == 0.0 { a } else { a + (b - a) * share }
}

/// Converts a layer of luminance `Y` and chroma `RY` and `BY` to `R G B`, in place: red is
/// `(RY + 1) Y`, blue is `(BY + 1) Y`, and green follows from the weights of the luminance
/// (OpenEXR, "Technical Introduction", "Luminance/Chroma Images"). Returns the channels of the
/// layer after the conversion; the first three are the colours.
pub fn to_rgb(channels: &[String], values: &mut [f32], weights: [f32; 3]) -> Option<Vec<String>> {
    let find = |name: &str| channels.iter().position(|c| c == name);
    let (y, ry, by) = (find("Y")?, find("RY")?, find("BY")?);
    if find("R").is_some() {
        return None;
    }
    let others: Vec<usize> = (0..channels.len()).filter(|c| ![y, ry, by].contains(c)).collect();
    let mut pixel = vec![0.0; channels.len()];
    for values in values.chunks_exact_mut(channels.len()) {
        pixel.copy_from_slice(values);
        let (red, blue) = ((pixel[ry] + 1.0) * pixel[y], (pixel[by] + 1.0) * pixel[y]);
        let green = (pixel[y] - red * weights[0] - blue * weights[2]) / weights[1];
        values[..3].copy_from_slice(&[red, green, blue]);
        others.iter().zip(&mut values[3..]).for_each(|(c, value)| *value = pixel[*c]);
    }
    let colours = ["R", "G", "B"].map(String::from);
    Some(colours.into_iter().chain(others.iter().map(|c| channels[*c].clone())).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::meta::BlockDescription;
    use exr::prelude::{LineOrder, Text};
    use half::f16;

    #[test]
    fn channels_of_b44_are_decompressed_one_by_one() {
        let channel = |name, step| ChannelDescription {
            sampling: Vec2(step, step),
            quantize_linearly: false,
            ..ChannelDescription::named(Text::from(name), SampleType::F16)
        };
        let channels = [channel("BY", 2), channel("Y", 1)].into_iter().collect();
        let header = Header::new(Text::from(""), Vec2(4, 4), channels).with_encoding(
            Compression::B44,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        );
        // A square of equal samples: the bits of the number with its sign turned, and 0xfc.
        let square = |value: f32| {
            let [high, low] = (f16::from_f32(value).to_bits() | 0x8000).to_be_bytes();
            [high, low, 0xfc]
        };
        let compressed = [square(0.25), square(3.0)].concat();
        let bounds = IntegerBounds::new(Vec2(0, 0), Vec2(4, 4));
        let data = b44(&header, &compressed, bounds).unwrap();
        let values: Vec<f32> =
            data.chunks_exact(2).map(|b| f16::from_ne_bytes([b[0], b[1]]).to_f32()).collect();
        let line = [[0.25; 2].as_slice(), &[3.0; 4], &[3.0; 4]].concat();
        assert_eq!(values, [line.clone(), line].concat());
        assert!(b44(&header, &compressed[..5], bounds).is_err());
    }
}
