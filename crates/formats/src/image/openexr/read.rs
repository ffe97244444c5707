//! Reads OpenEXR: parts and dotted channel names become layers, and data windows are placed into
//! the display window.
//!
//! The file is decompressed chunk by chunk with the crate's low-level interface: sizes are checked
//! before anything is allocated, chunks are decompressed in parallel, and a panic of the decoder
//! becomes an error of the file.

use super::super::picture::check_size;
use super::chromaticities::to_rec709;
use crate::guard::guarded;
use crate::{Input, Place, ReadError};
use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, SampleType, Text};
use exr::meta::header::Header;
use half::f16;
use rayon::prelude::*;
use snell_scene::{Image, Layer, LayeredImage};
use std::io::Cursor;

/// Chunks decompressed at a time: enough for all cores, few enough to bound the memory.
const BATCH: usize = 64;

/// Reads all layers. The first is the picture. Colours with primaries other than Rec. 709 are
/// converted; all other values are as stored.
pub fn read_layers(input: &Input) -> Result<LayeredImage, ReadError> {
    read(input, false)
}

/// Reads the picture: `R G B` or `Y` with or without `A`, otherwise the first channels. Alpha is
/// divided out.
pub fn read_image(input: &Input) -> Result<Image, ReadError> {
    let LayeredImage { width, height, mut layers, .. } = read(input, true)?;
    let layer = layers.swap_remove(0);
    let chosen = image_channels(&layer.channels);
    let stride = layer.channels.len();
    let identity = chosen.len() == stride && chosen.iter().enumerate().all(|(i, c)| i == *c);
    let mut values = match identity {
        true => layer.values,
        false => layer
            .values
            .chunks_exact(stride)
            .flat_map(|pixel| chosen.iter().map(|c| pixel[*c]))
            .collect(),
    };
    if matches!(chosen.len(), 2 | 4) {
        values.par_chunks_exact_mut(chosen.len()).for_each(unpremultiply);
    }
    Ok(Image::from_f32(width, height, chosen.len() as u32, values))
}

/// Divides the colours by alpha. Emission without coverage (alpha of 0) is unchanged.
fn unpremultiply(pixel: &mut [f32]) {
    if let [colours @ .., alpha] = pixel
        && *alpha > 0.0
        && *alpha != 1.0
    {
        colours.iter_mut().for_each(|c| *c /= *alpha);
    }
}

/// The indices of the channels of a layer that make an image of 1 to 4 channels.
fn image_channels(names: &[String]) -> Vec<usize> {
    let find = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
    let alpha = find("A");
    let colours = match (find("R"), find("G"), find("B"), find("Y")) {
        (Some(r), Some(g), Some(b), _) => vec![r, g, b],
        (_, _, _, Some(y)) => vec![y],
        _ => {
            let others: Vec<usize> = (0..names.len()).filter(|i| Some(*i) != alpha).collect();
            match others.len() {
                0 => return vec![0],
                1 | 2 => others[..1].to_vec(),
                _ => others[..3].to_vec(),
            }
        }
    };
    colours.into_iter().chain(alpha).collect()
}

fn damaged(input: &Input, problem: impl std::fmt::Display) -> ReadError {
    input.error(
        Place::Whole,
        format!("the OpenEXR file is damaged or of an unsupported kind: {problem}"),
        "render or export it again as scan lines with ZIP compression",
    )
}

fn read(input: &Input, only_picture: bool) -> Result<LayeredImage, ReadError> {
    let reader = exr::block::read(Cursor::new(input.bytes.as_slice()), false)
        .map_err(|e| damaged(input, e))?;
    let meta = reader.meta_data().clone();
    let mut target = Target::plan(input, &meta, only_picture)?;
    let mut chunks = reader.all_chunks(false).map_err(|e| damaged(input, e))?;
    loop {
        let batch = chunks.by_ref().take(BATCH).collect::<exr::error::Result<Vec<Chunk>>>();
        let batch = batch.map_err(|e| damaged(input, e))?;
        if batch.is_empty() {
            break;
        }
        let blocks: Vec<_> = batch.into_par_iter().map(|chunk| decompress(chunk, &meta)).collect();
        for block in blocks {
            target.place(&meta, &block.map_err(|e| damaged(input, e))?);
        }
    }
    convert_colours(&meta, &mut target.image);
    Ok(target.image)
}

/// Converts to Rec. 709 primaries, in layers of `R G B`.
fn convert_colours(meta: &MetaData, image: &mut LayeredImage) {
    let named = meta.headers.first().and_then(|h| h.shared_attributes.chromaticities.as_ref());
    let Some(matrix) = named.and_then(to_rec709) else { return };
    for layer in image
        .layers
        .iter_mut()
        .filter(|l| l.channels.starts_with(&["R", "G", "B"].map(String::from)))
    {
        layer.values.par_chunks_exact_mut(layer.channels.len()).for_each(|pixel| {
            let converted =
                matrix.map(|row| row[0] * pixel[0] + row[1] * pixel[1] + row[2] * pixel[2]);
            pixel[..3].copy_from_slice(&converted);
        });
    }
}

fn decompress(chunk: Chunk, meta: &MetaData) -> Result<UncompressedBlock, String> {
    match guarded(|| UncompressedBlock::decompress_chunk(chunk, meta, false)) {
        Some(block) => block.map_err(|e| e.to_string()),
        None => Err("its decoder failed".into()),
    }
}

/// The picture being decoded.
struct Target {
    image: LayeredImage,
    /// For each part and each channel of the file, the layer and channel that it fills, if any.
    slots: Vec<Vec<Option<Slot>>>,
    /// Top left of the display window.
    origin: [i64; 2],
}

#[derive(Clone, Copy)]
struct Slot {
    layer: usize,
    channel: usize,
}

impl Target {
    /// Checks all sizes, names the layers and allocates.
    fn plan(input: &Input, meta: &MetaData, only_picture: bool) -> Result<Self, ReadError> {
        let first = meta.headers.first().ok_or_else(|| damaged(input, "it has no parts"))?;
        let mut window = first.shared_attributes.display_window;
        if window.size.0 == 0 || window.size.1 == 0 {
            window = first.data_window();
        }
        let (width, height) = (window.size.0 as u64, window.size.1 as u64);
        for header in &meta.headers {
            check_part(input, header)?;
        }
        let (layers, slots) = name_layers(&meta.headers, only_picture);
        let values_per_pixel: usize = layers.iter().map(|l| l.channels.len()).sum();
        check_size(input, width, height, values_per_pixel as u64 * 4)?;
        let pixels = (width * height) as usize;
        if (pixels * values_per_pixel) as u64 > input.options.limits.image_pixels.saturating_mul(4)
        {
            let limit = input.options.limits.image_pixels;
            return Err(input.error(
                Place::Whole,
                format!(
                    "the file has {values_per_pixel} channels of {width} x {height} pixels, \
                    more than four times the limit of {limit}"
                ),
                "split the layers into several files",
            ));
        }
        let fill = |l: Layer| Layer { values: vec![0.0; pixels * l.channels.len()], ..l };
        let layers = layers.into_iter().map(fill).collect();
        let metadata = text_attributes(first);
        Ok(Self {
            image: LayeredImage { width: width as u32, height: height as u32, layers, metadata },
            slots,
            origin: [window.position.0.into(), window.position.1.into()],
        })
    }

    /// Copies the part of a block that lies in the display window.
    fn place(&mut self, meta: &MetaData, block: &UncompressedBlock) {
        if block.index.level.0 != 0 || block.index.level.1 != 0 {
            return;
        }
        let header = &meta.headers[block.index.layer];
        let position = header.own_attributes.layer_position;
        let (width, height) = (i64::from(self.image.width), i64::from(self.image.height));
        for line in block.lines(&header.channels) {
            let Some(slot) = self.slots[block.index.layer][line.location.channel] else { continue };
            let x = line.location.position.0 as i64 + i64::from(position.0) - self.origin[0];
            let y = line.location.position.1 as i64 + i64::from(position.1) - self.origin[1];
            let begin = (-x).max(0);
            let end = (width - x).min(line.location.sample_count as i64);
            if y < 0 || y >= height || begin >= end {
                continue;
            }
            let layer = &mut self.image.layers[slot.layer];
            let stride = layer.channels.len();
            let start = ((y * width + x + begin) as usize) * stride + slot.channel;
            let values = layer.values[start..].iter_mut().step_by(stride);
            let samples = begin as usize..end as usize;
            copy_samples(
                header.channels.list[line.location.channel].sample_type,
                line.value,
                samples,
                values,
            );
        }
    }
}

/// Converts samples to floats. The crate returns samples in native byte order.
fn copy_samples<'a>(
    kind: SampleType,
    bytes: &[u8],
    samples: std::ops::Range<usize>,
    values: impl Iterator<Item = &'a mut f32>,
) {
    match kind {
        SampleType::F16 => {
            let (source, _) = bytes.as_chunks::<2>();
            source[samples]
                .iter()
                .zip(values)
                .for_each(|(s, v)| *v = f16::from_ne_bytes(*s).to_f32());
        }
        SampleType::F32 => {
            let (source, _) = bytes.as_chunks::<4>();
            source[samples].iter().zip(values).for_each(|(s, v)| *v = f32::from_ne_bytes(*s));
        }
        SampleType::U32 => {
            let (source, _) = bytes.as_chunks::<4>();
            source[samples]
                .iter()
                .zip(values)
                .for_each(|(s, v)| *v = u32::from_ne_bytes(*s) as f32);
        }
    }
}

/// Refuses unsupported parts, before anything is allocated.
fn check_part(input: &Input, header: &Header) -> Result<(), ReadError> {
    if header.deep {
        return Err(input.error(
            Place::Whole,
            "this OpenEXR file holds deep data, which is not supported",
            "flatten it (for example with `oiiotool --flatten`)",
        ));
    }
    if header.channels.list.is_empty() {
        return Err(damaged(input, "a part has no channels"));
    }
    if let Some(channel) =
        header.channels.list.iter().find(|c| c.sampling.0 != 1 || c.sampling.1 != 1)
    {
        return Err(input.error(
            Place::Whole,
            format!(
                "channel \"{}\" has fewer samples than pixels (luminance and chroma), which is not \
                    supported",
                text(&channel.name)
            ),
            "save the file with full R, G and B channels",
        ));
    }
    let size = header.layer_size;
    check_size(input, size.0 as u64, size.1 as u64, header.channels.bytes_per_pixel as u64)
}

/// Groups the channels of all parts into layers by part name and by the prefix before the last dot
/// of the channel name, and puts the picture first.
fn name_layers(headers: &[Header], only_picture: bool) -> (Vec<Layer>, Vec<Vec<Option<Slot>>>) {
    /// Part, prefix, and the indices of the channels in the part.
    struct Group {
        part: usize,
        prefix: String,
        members: Vec<(usize, String)>,
    }
    let mut groups: Vec<Group> = Vec::new();
    for (part, header) in headers.iter().enumerate() {
        let first_of_part = groups.len();
        for (index, channel) in header.channels.list.iter().enumerate() {
            let name = text(&channel.name);
            let (prefix, short) = name.rsplit_once('.').unwrap_or(("", &name));
            let member = (index, short.to_string());
            match groups[first_of_part..].iter_mut().find(|g| g.prefix == prefix) {
                Some(group) => group.members.push(member),
                None => groups.push(Group { part, prefix: prefix.into(), members: vec![member] }),
            }
        }
    }
    for group in &mut groups {
        group.members.sort_by_key(|(_, name)| channel_rank(name));
    }
    let is_rgb =
        |g: &Group| ["R", "G", "B"].iter().all(|c| g.members.iter().any(|(_, name)| name == c));
    let is_plain = |g: &Group| g.prefix.is_empty();
    // The sort is stable, so parts of equal rank keep the order of the file.
    groups.sort_by_key(|g| match (is_rgb(g), is_plain(g)) {
        (true, true) => 0,
        (true, false) => 1,
        (false, true) => 2,
        (false, false) => 3,
    });
    // Only the first group is the picture; the other groups keep the order of the file.
    groups[1..].sort_by_key(|g| g.part);
    if only_picture {
        groups.truncate(1);
    }

    let mut slots: Vec<Vec<Option<Slot>>> =
        headers.iter().map(|h| vec![None; h.channels.list.len()]).collect();
    let mut layers = Vec::new();
    for (layer, group) in groups.into_iter().enumerate() {
        for (channel, (index, _)) in group.members.iter().enumerate() {
            slots[group.part][*index] = Some(Slot { layer, channel });
        }
        let part_name = headers[group.part].own_attributes.layer_name.as_ref().map(text);
        let part_name = part_name.filter(|_| headers.len() > 1).unwrap_or_default();
        let name = match (layer, part_name.is_empty(), group.prefix.is_empty()) {
            (0, ..) => String::new(),
            (_, true, _) => group.prefix,
            (_, false, true) => part_name,
            (_, false, false) => format!("{part_name}.{}", group.prefix),
        };
        layers.push(Layer {
            name,
            channels: group.members.into_iter().map(|m| m.1).collect(),
            values: Vec::new(),
        });
    }
    (layers, slots)
}

/// Sort key of a channel name: files list channels alphabetically, but readers expect `R G B A`.
/// Unknown names keep their order after the known ones.
fn channel_rank(name: &str) -> usize {
    ["R", "G", "B", "Y", "A"]
        .iter()
        .position(|c| *c == name)
        .map_or(if name == "X" { 2 } else { 5 }, |i| i)
}

/// Decodes text of the file: UTF-8 by custom, otherwise Latin-1.
fn text(text: &Text) -> String {
    std::str::from_utf8(text.bytes()).map_or_else(|_| text.to_string(), String::from)
}

/// Text attributes, by name.
fn text_attributes(header: &Header) -> Vec<(String, String)> {
    let own = &header.own_attributes;
    let standard =
        [("owner", &own.owner), ("comments", &own.comments), ("software", &own.software_name)];
    let standard = standard
        .into_iter()
        .filter_map(|(name, value)| Some((name.to_string(), text(value.as_ref()?))));
    let others =
        header.shared_attributes.other.iter().chain(&own.other).filter_map(|(name, value)| {
            match value {
                AttributeValue::Text(value) => Some((text(name), text(value))),
                _ => None,
            }
        });
    let mut all: Vec<_> = standard.chain(others).collect();
    all.sort();
    all
}
