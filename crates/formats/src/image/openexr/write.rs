//! Writes OpenEXR: one part of scan lines, ZIP; the picture's channels have plain names, those of
//! other layers `layer.channel`.
//!
//! The crate `exr` would start a thread pool for each file; here blocks are compressed on the
//! current rayon pool, straight from the layers.

use super::super::WriteOptions;
use super::super::picture::{Unfit, check_layers};
use super::attributes;
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::{Header, LayerAttributes};
use exr::prelude::{Compression, LineOrder, Text, Vec2};
use half::f16;
use rayon::prelude::*;
use snell_scene::{Layer, LayeredImage};
use std::io::Cursor;

/// Number of blocks that are compressed before the next ones are begun.
const BATCH: usize = 64;

/// A channel of the file.
struct Channel<'a> {
    name: String,
    layer: &'a Layer,
    /// Index of the channel in its layer.
    index: usize,
    is_half: bool,
}

/// Encodes all layers, and the metadata as text attributes. The output is deterministic.
pub fn encode(image: &LayeredImage, options: &WriteOptions) -> Result<Vec<u8>, Unfit> {
    check_layers(image)?;
    let mut channels = Vec::new();
    for layer in &image.layers {
        for (index, name) in layer.channels.iter().enumerate() {
            let name =
                if layer.name.is_empty() { name.clone() } else { format!("{}.{name}", layer.name) };
            check_name(&name)?;
            let is_half = options.exr_half && is_color(layer, index);
            channels.push(Channel { name, layer, index, is_half });
        }
    }
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    if let Some(twice) = channels.windows(2).find(|w| w[0].name == w[1].name) {
        return Err(Unfit::new(
            format!("two channels have the name \"{}\"", twice[0].name),
            "rename one of the layers",
        ));
    }
    let long_names = channels.iter().any(|c| c.name.len() > 31);
    let size = Vec2(image.width as usize, image.height as usize);
    let described = channels
        .iter()
        .map(|c| ChannelDescription::named(text(&c.name), c.sample_type()))
        .collect();
    let header = Header::new(text(""), size, described)
        .with_attributes(LayerAttributes::default())
        .with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing);
    let mut bytes = Cursor::new(Vec::new());
    exr::block::write(&mut bytes, [header].into_iter().collect(), true, |meta, writer| {
        let compressed = |&(number, index): &(usize, BlockIndex)| {
            let block = UncompressedBlock { index, data: block_bytes(&channels, size.0, &index) };
            Ok((number, block.compress_to_chunk(&meta.headers)?))
        };
        let blocks: Vec<_> = enumerate_ordered_header_block_indices(&meta.headers).collect();
        for batch in blocks.chunks(BATCH) {
            let chunks =
                batch.par_iter().map(compressed).collect::<exr::error::Result<Vec<_>>>()?;
            chunks.into_iter().try_for_each(|(number, chunk)| writer.write_chunk(number, chunk))?;
        }
        Ok(())
    })
    .map_err(|e| {
        Unfit::new(format!("the picture cannot be encoded as OpenEXR: {e}"), "try another format")
    })?;
    Ok(attributes::insert(bytes.into_inner(), &image.metadata, long_names))
}

impl Channel<'_> {
    fn sample_type(&self) -> SampleType {
        if self.is_half { SampleType::F16 } else { SampleType::F32 }
    }
}

/// The values of a block in the format's layout: line by line, and in each line channel by channel.
fn block_bytes(channels: &[Channel], width: usize, block: &BlockIndex) -> Vec<u8> {
    let (Vec2(left, top), Vec2(columns, rows)) = (block.pixel_position, block.pixel_size);
    let mut bytes = Vec::with_capacity(columns * rows * channels.len() * 4);
    for row in top..top + rows {
        for Channel { layer, index, is_half, .. } in channels {
            let stride = layer.channels.len();
            let line = &layer.values[(row * width + left) * stride..][..columns * stride];
            for value in line.iter().skip(*index).step_by(stride) {
                match is_half {
                    true => bytes.extend(to_half(*value).to_ne_bytes()),
                    false => bytes.extend(value.to_ne_bytes()),
                }
            }
        }
    }
    bytes
}

/// The format treats names as bytes; UTF-8 is customary.
fn text(name: &str) -> Text {
    Text::from_slice_unchecked(name.as_bytes())
}

fn check_name(name: &str) -> Result<(), Unfit> {
    if name.is_empty() || name.len() > 255 || name.contains('\0') {
        return Err(Unfit::new(
            format!("\"{name}\" cannot be the name of a channel in OpenEXR"),
            "use a name of 1 to 255 bytes",
        ));
    }
    Ok(())
}

/// True if half precision suffices for a channel, which is so only for colours: 11 bits are too few
/// for depth, positions and ids.
fn is_color(layer: &Layer, index: usize) -> bool {
    match layer.channels[index].as_str() {
        "R" | "G" | "B" | "A" => true,
        // Y is luminance, unless the layer holds coordinates.
        "Y" => !layer.channels.iter().any(|c| c == "X"),
        _ => false,
    }
}

/// Rounds to nearest; finite values stay finite.
fn to_half(value: f32) -> f16 {
    let limit = f16::MAX.to_f32();
    f16::from_f32(if value.is_finite() { value.clamp(-limit, limit) } else { value })
}
