//! Reads OpenEXR: parts and dotted channel names become layers, and data windows are placed into
//! the display window.
//!
//! The file is decompressed chunk by chunk with the crate's low-level interface: sizes are checked
//! before anything is allocated, chunks are decompressed in parallel, and a panic of the decoder
//! becomes an error of the file.

use super::super::picture::check_size;
use super::attributes::is_deep;
use super::chromaticities::{luminance_weights, to_rec709};
use super::deep::{self, Stored};
use super::sampling::{self, Plane, Sampling};
use crate::guard::guarded;
use crate::{Input, Place, ReadError};
use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, EnvironmentMap, IntegerBounds, SampleType, Text,
};
use exr::meta::header::Header;
use half::f16;
use rayon::prelude::*;
use snell_scene::{Image, Layer, LayeredImage};
use std::collections::BTreeMap;
use std::io::Cursor;

/// Chunks decompressed at a time: enough for all cores, few enough to bound the memory.
const BATCH: usize = 64;

/// Reads all layers. The first is the picture. Colours with primaries other than Rec. 709 are
/// converted; all other values are as stored.
pub fn read_layers(input: &Input) -> Result<LayeredImage, ReadError> {
    read(input, false)
}

/// Reads the picture: `R G B`, `Y RY BY` or `Y` with or without `A`, otherwise the first channels.
/// Alpha is divided out.
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
    let find_one = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
    let find = |name: &str, word: &str| find_one(name).or_else(|| find_one(word));
    let alpha = find("A", "alpha");
    let [red, green, blue] =
        [("R", "red"), ("G", "green"), ("B", "blue")].map(|(name, word)| find(name, word));
    let colours = match (red, green, blue, find_one("Y")) {
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
    if is_deep(&input.bytes) {
        return read_deep(input, only_picture);
    }
    let (bytes, sampling) = sampling::as_whole(&input.bytes);
    let reader = exr::block::read(Cursor::new(&bytes[..]), false).map_err(|e| damaged(input, e))?;
    let meta = reader.meta_data().clone();
    let mut target = Target::plan(input, &meta, &sampling, only_picture)?;
    let mut chunks = reader.all_chunks(false).map_err(|e| damaged(input, e))?;
    loop {
        let batch = chunks.by_ref().take(BATCH).collect::<exr::error::Result<Vec<Chunk>>>();
        let batch = batch.map_err(|e| damaged(input, e))?;
        if batch.is_empty() {
            break;
        }
        let decompress = |chunk| target.decompress(chunk, &meta);
        let blocks: Vec<_> = batch.into_par_iter().map(decompress).collect();
        for block in blocks {
            match block.map_err(|e| damaged(input, e))? {
                Block::Whole(block) => target.place(&meta, &block),
                Block::Sampled(part, bounds, data) => target.place_sampled(part, bounds, &data),
            }
        }
    }
    target.fill(&meta);
    Ok(target.finish(input, &meta))
}

/// Reads a file with deep parts, and flattens these.
fn read_deep(input: &Input, only_picture: bool) -> Result<LayeredImage, ReadError> {
    let meta = guarded(|| MetaData::read_from_buffered(Cursor::new(&input.bytes[..]), false));
    let meta = meta.ok_or_else(|| damaged(input, "its header"))?.map_err(|e| damaged(input, e))?;
    let is_whole = |channel: &ChannelDescription| channel.sampling == Vec2(1, 1);
    if !meta.headers.iter().all(|header| header.channels.list.iter().all(is_whole)) {
        return Err(damaged(input, "channels with fewer samples than pixels beside deep data"));
    }
    let mut target = Target::plan(input, &meta, &Sampling::new(), only_picture)?;
    let is_wanted = |part: usize| target.slots[part].iter().any(Option::is_some);
    let chunks = deep::chunks(&input.bytes, &meta, is_wanted).map_err(|e| damaged(input, e))?;
    let (mut charged, mut overlaps) = (0, false);
    for batch in chunks.chunks(BATCH) {
        let needed = batch.iter().map(|chunk| match chunk {
            // The bytes, and the values made of them.
            Stored::Deep(deep) => 3 * deep.unpacked_bytes as u64,
            Stored::Flat(_) => 0,
        });
        let needed = needed.fold(0, u64::saturating_add);
        input.charge(needed.saturating_sub(charged), "the deep samples of the picture")?;
        charged = charged.max(needed);
        let flatten = |stored: &Stored| match stored {
            Stored::Flat(chunk) => target.decompress(chunk.clone(), &meta).map(Flattened::Block),
            Stored::Deep(deep) => {
                let slots = &target.slots[deep.part];
                let header = &meta.headers[deep.part];
                let flat = deep::flatten(deep, header, |channel| slots[channel].is_some());
                flat.map(|flat| Flattened::Deep(deep.part, deep.bounds, flat))
            }
        };
        let blocks: Vec<_> = batch.par_iter().map(flatten).collect();
        for block in blocks {
            match block.map_err(|e| damaged(input, e))? {
                Flattened::Block(Block::Whole(block)) => target.place(&meta, &block),
                Flattened::Block(Block::Sampled(..)) => {}
                Flattened::Deep(part, bounds, flat) => {
                    overlaps |= flat.overlaps;
                    target.place_flat(&meta.headers[part], part, bounds, &flat.channels);
                }
            }
        }
    }
    if overlaps {
        input.note(format!(
            "{}: its deep samples overlap in depth; they are composited in the order of their \
            nearest points",
            input.name
        ));
    }
    Ok(target.finish(input, &meta))
}

/// A block of a file with deep parts.
enum Flattened {
    Block(Block),
    Deep(usize, IntegerBounds, deep::Flat),
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

/// Converts luminance and chroma to colours, in layers of `Y RY BY`.
fn convert_chroma(meta: &MetaData, image: &mut LayeredImage) {
    let named = meta.headers.first().and_then(|h| h.shared_attributes.chromaticities.as_ref());
    let weights = luminance_weights(named);
    for layer in &mut image.layers {
        if let Some(names) = sampling::to_rgb(&layer.channels, &mut layer.values, weights) {
            layer.channels = names;
        }
    }
}

/// A decompressed block.
enum Block {
    Whole(UncompressedBlock),
    /// Lines of a part with channels that have fewer samples than pixels: the part, the bounds in
    /// its pixels, and the samples.
    Sampled(usize, IntegerBounds, Vec<u8>),
}

/// The picture being decoded.
struct Target {
    image: LayeredImage,
    /// For each part and each channel of the file, the layer and channel that it fills, if any.
    slots: Vec<Vec<Option<Slot>>>,
    /// Top left of the display window.
    origin: [i64; 2],
    /// The parts with channels that have fewer samples than pixels, by number.
    sampled: BTreeMap<usize, Sampled>,
    /// Which of several parts or layers is the picture, if only that is read.
    note: Option<String>,
}

/// A part with channels that have fewer samples than pixels.
struct Sampled {
    steps: Vec<Vec2<usize>>,
    channels: Vec<ChannelDescription>,
    /// The samples of each such channel that fills one of the picture.
    planes: BTreeMap<usize, Plane>,
    /// Top left of the part.
    position: [i64; 2],
}

#[derive(Clone, Copy)]
struct Slot {
    layer: usize,
    channel: usize,
}

impl Target {
    /// Checks all sizes, names the layers and allocates.
    fn plan(
        input: &Input,
        meta: &MetaData,
        sampling: &Sampling,
        only_picture: bool,
    ) -> Result<Self, ReadError> {
        let first = meta.headers.first().ok_or_else(|| damaged(input, "it has no parts"))?;
        let mut window = first.shared_attributes.display_window;
        if window.size.0 == 0 || window.size.1 == 0 {
            window = first.data_window();
        }
        let (width, height) = (window.size.0 as u64, window.size.1 as u64);
        for header in &meta.headers {
            check_part(input, header)?;
        }
        let (mut layers, mut slots, picture) = name_layers(&meta.headers);
        let mut note = None;
        if only_picture {
            note = choice(&picture, &layers, meta.headers.len());
            layers.truncate(1);
            slots.iter_mut().flatten().for_each(|slot| *slot = slot.filter(|s| s.layer == 0));
        }
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
        let sampled = sampled_parts(input, meta, sampling, &slots)?;
        Ok(Self {
            sampled,
            note,
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
        for line in block.lines(&header.channels) {
            let Some(slot) = self.slots[block.index.layer][line.location.channel] else { continue };
            let x = line.location.position.0 as i64 + i64::from(position.0) - self.origin[0];
            let y = line.location.position.1 as i64 + i64::from(position.1) - self.origin[1];
            let kind = header.channels.list[line.location.channel].sample_type;
            self.place_line(slot, [x, y], line.location.sample_count, kind, line.value);
        }
    }

    /// Copies a flattened block, which is at `bounds` of its part.
    fn place_flat(
        &mut self,
        header: &Header,
        part: usize,
        bounds: IntegerBounds,
        channels: &[Option<Vec<f32>>],
    ) {
        let position = header.own_attributes.layer_position;
        for (channel, values) in channels.iter().enumerate() {
            let (Some(slot), Some(values)) = (self.slots[part][channel], values) else { continue };
            for (line, values) in values.chunks_exact(bounds.size.0).enumerate() {
                let x = i64::from(bounds.position.0) + i64::from(position.0) - self.origin[0];
                let y = i64::from(bounds.position.1) + i64::from(position.1) - self.origin[1];
                let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
                let at = [x, y + line as i64];
                self.place_line(slot, at, bounds.size.0, SampleType::F32, &bytes);
            }
        }
    }

    /// The picture, with colours as all readers return them.
    fn finish(mut self, input: &Input, meta: &MetaData) -> LayeredImage {
        if let Some(note) = &self.note {
            input.note(format!("{}: {note}", input.name));
        }
        let is_cube =
            |header: &Header| header.own_attributes.environment_map == Some(EnvironmentMap::Cube);
        if meta.headers.iter().any(is_cube) {
            input.note(format!(
                "{}: the picture is a cube map, six faces one below the other; it is taken as \
                    it is",
                input.name
            ));
        }
        convert_chroma(meta, &mut self.image);
        convert_colours(meta, &mut self.image);
        self.image
    }

    /// Copies the samples of a line that begins at a pixel of the picture or beside it.
    fn place_line(
        &mut self,
        slot: Slot,
        [x, y]: [i64; 2],
        count: usize,
        kind: SampleType,
        bytes: &[u8],
    ) {
        let (width, height) = (i64::from(self.image.width), i64::from(self.image.height));
        let begin = (-x).max(0);
        let end = (width - x).min(count as i64);
        if y < 0 || y >= height || begin >= end {
            return;
        }
        let layer = &mut self.image.layers[slot.layer];
        let stride = layer.channels.len();
        let start = ((y * width + x + begin) as usize) * stride + slot.channel;
        let values = layer.values[start..].iter_mut().step_by(stride);
        copy_samples(kind, bytes, begin as usize..end as usize, values);
    }

    fn decompress(&self, chunk: Chunk, meta: &MetaData) -> Result<Block, String> {
        let part = chunk.layer_index;
        check_dwa(&chunk, meta)?;
        let block = guarded(|| match self.sampled.get(&part) {
            Some(sampled) => sampling::decompress(chunk, meta, &sampled.steps)
                .map(|(bounds, data)| Block::Sampled(part, bounds, data)),
            None => UncompressedBlock::decompress_chunk(chunk, meta, false)
                .map(Block::Whole)
                .map_err(|e| e.to_string()),
        });
        block.unwrap_or_else(|| Err("its decoder failed".into()))
    }

    /// Copies the samples of a block: those of whole channels to the picture, the others to their
    /// planes.
    fn place_sampled(&mut self, part: usize, bounds: IntegerBounds, mut data: &[u8]) {
        let Some(mut sampled) = self.sampled.remove(&part) else { return };
        let top = bounds.position.1.max(0) as usize;
        for y in top..top + bounds.size.1 {
            for (index, channel) in sampled.channels.iter().enumerate() {
                if !sampling::has_line(channel, y) {
                    continue;
                }
                let count = bounds.size.0 / channel.sampling.0;
                let kind = channel.sample_type;
                let (line, rest) = data.split_at(count * kind.bytes_per_sample());
                data = rest;
                if let Some(plane) = sampled.planes.get_mut(&index) {
                    copy_samples(kind, line, 0..count, plane.row(y).iter_mut());
                } else if let Some(slot) = self.slots[part][index] {
                    let [left, above] = sampled.position;
                    let at = [left - self.origin[0], above + y as i64 - self.origin[1]];
                    self.place_line(slot, at, count, kind, line);
                }
            }
        }
        self.sampled.insert(part, sampled);
    }

    /// Interpolates the channels that have fewer samples than pixels.
    fn fill(&mut self, meta: &MetaData) {
        for (part, sampled) in &self.sampled {
            let size = meta.headers[*part].layer_size;
            let [left, above] = [0, 1].map(|axis| sampled.position[axis] - self.origin[axis]);
            for (channel, plane) in &sampled.planes {
                let Some(slot) = self.slots[*part][*channel] else { continue };
                let layer = &mut self.image.layers[slot.layer];
                let stride = layer.channels.len();
                let width = self.image.width as usize;
                let lines = layer.values.par_chunks_exact_mut(width * stride);
                lines.enumerate().for_each(|(y, line)| {
                    let y = y as i64 - above;
                    if !(0..size.1 as i64).contains(&y) {
                        return;
                    }
                    let values = line.iter_mut().skip(slot.channel).step_by(stride);
                    for (x, value) in values.enumerate() {
                        let x = x as i64 - left;
                        if (0..size.0 as i64).contains(&x) {
                            *value = plane.at(x as usize, y as usize);
                        }
                    }
                });
            }
        }
    }
}

/// Refuses a block of DWA that declares more data than its pixels can have: its decoder allocates
/// what the block declares, and a process without that memory ends.
fn check_dwa(chunk: &Chunk, meta: &MetaData) -> Result<(), String> {
    /// The 64-bit numbers before the data that are lengths of unpacked data; those of the last two
    /// count halves (OpenEXR, `internal_dwa.h`).
    const LENGTHS: [(usize, u64); 5] = [(1, 1), (6, 1), (7, 1), (8, 2), (9, 2)];
    let header = meta.headers.get(chunk.layer_index).ok_or("a block of no part")?;
    let bytes = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => return Ok(()),
    };
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    // Blocks of 8 x 8 pixels reach beyond the edges.
    let (most, own) = (header.max_block_pixel_size(), header.layer_size);
    let sides = [most.0.min(own.0), most.1.min(own.1)].map(|side| side as u64 + 8);
    let pixel = header.channels.bytes_per_pixel as u64 * 4;
    let limit = sides[0].saturating_mul(sides[1]).saturating_mul(pixel);
    let fits = |(index, each): (usize, u64)| {
        let word = bytes.get(index * 8..).and_then(|rest| rest.first_chunk());
        word.is_none_or(|word| u64::from_le_bytes(*word).saturating_mul(each) <= limit)
    };
    match LENGTHS.into_iter().all(fits) {
        true => Ok(()),
        false => Err("a block declares more data than its pixels can have".into()),
    }
}

/// The parts with channels that have fewer samples than pixels, with room for the samples.
fn sampled_parts(
    input: &Input,
    meta: &MetaData,
    sampling: &Sampling,
    slots: &[Vec<Option<Slot>>],
) -> Result<BTreeMap<usize, Sampled>, ReadError> {
    let mut parts = BTreeMap::new();
    for (part, (header, steps)) in meta.headers.iter().zip(sampling).enumerate() {
        if steps.iter().all(|step| *step == Vec2(1, 1)) {
            continue;
        }
        let (size, position) = (header.layer_size, header.own_attributes.layer_position);
        let fits = |step: &Vec2<usize>| {
            size.0.is_multiple_of(step.0)
                && size.1.is_multiple_of(step.1)
                && i64::from(position.0).rem_euclid(step.0 as i64) == 0
                && i64::from(position.1).rem_euclid(step.1 as i64) == 0
        };
        if steps.len() != header.channels.list.len() || !steps.iter().all(fits) {
            return Err(damaged(input, "the samples of a channel do not fit its pixels"));
        }
        let mut channels = header.channels.list.to_vec();
        let mut planes = BTreeMap::new();
        for (index, (channel, step)) in channels.iter_mut().zip(steps).enumerate() {
            channel.sampling = *step;
            if *step != Vec2(1, 1) && slots[part][index].is_some() {
                planes.insert(index, Plane::new(size, *step));
            }
        }
        let position = [position.0.into(), position.1.into()];
        parts.insert(part, Sampled { steps: steps.clone(), channels, planes, position });
    }
    Ok(parts)
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
    if header.channels.list.is_empty() {
        return Err(damaged(input, "a part has no channels"));
    }
    let size = header.layer_size;
    check_size(input, size.0 as u64, size.1 as u64, header.channels.bytes_per_pixel as u64)
}

/// Groups the channels of all parts into layers by part name and by the prefix before the last dot
/// of the channel name, and puts the picture first.
/// Returns what each channel of each part fills, and the name of the picture, which as a layer has
/// none.
fn name_layers(headers: &[Header]) -> (Vec<Layer>, Vec<Vec<Option<Slot>>>, String) {
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
    let has = |g: &Group, names: [&str; 3]| {
        names.iter().all(|c| g.members.iter().any(|(_, name)| name == c))
    };
    let is_rgb = |g: &Group| has(g, ["R", "G", "B"]) || has(g, ["Y", "RY", "BY"]);
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

    let mut slots: Vec<Vec<Option<Slot>>> =
        headers.iter().map(|h| vec![None; h.channels.list.len()]).collect();
    let (mut layers, mut picture) = (Vec::new(), String::new());
    for (layer, group) in groups.into_iter().enumerate() {
        for (channel, (index, _)) in group.members.iter().enumerate() {
            slots[group.part][*index] = Some(Slot { layer, channel });
        }
        let part_name = headers[group.part].own_attributes.layer_name.as_ref().map(text);
        let part_name = part_name.filter(|_| headers.len() > 1).unwrap_or_default();
        let mut name = match (part_name.is_empty(), group.prefix.is_empty()) {
            (true, _) => group.prefix,
            (false, true) => part_name,
            (false, false) => format!("{part_name}.{}", group.prefix),
        };
        if layer == 0 {
            picture = std::mem::take(&mut name);
        }
        layers.push(Layer {
            name,
            channels: group.members.into_iter().map(|m| m.1).collect(),
            values: Vec::new(),
        });
    }
    (layers, slots, picture)
}

/// The most names of layers that a note has.
const MOST_NAMES: usize = 12;

/// Which of several parts or layers is the picture, in words, if that is a choice: the layer
/// without a name of a file with one part is the picture by custom.
fn choice(picture: &str, layers: &[Layer], parts: usize) -> Option<String> {
    let others = &layers[1..];
    if others.is_empty() || (picture.is_empty() && parts == 1) {
        return None;
    }
    let quoted = |name: &str| match name {
        "" => "one without a name".to_string(),
        name => format!("\"{name}\""),
    };
    let mut names: Vec<_> = others.iter().take(MOST_NAMES).map(|l| quoted(&l.name)).collect();
    if others.len() > MOST_NAMES {
        names.push(format!("{} more", others.len() - MOST_NAMES));
    }
    let kind = if parts > 1 { "part" } else { "layer" };
    Some(format!("the {kind} {} is the picture; not shown: {}", quoted(picture), names.join(", ")))
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

#[cfg(test)]
mod tests {
    use super::image_channels;

    #[test]
    fn colours_may_have_their_names_in_full_or_in_lower_case() {
        for (names, expected) in [
            (&["A", "B", "G", "R"][..], &[3, 2, 1, 0][..]),
            (&["b", "g", "r"], &[2, 1, 0]),
            (&["blue", "green", "red"], &[2, 1, 0]),
            (&["Alpha", "Blue", "Depth", "Green", "Red"], &[4, 3, 1, 0]),
            (&["Z"], &[0]),
        ] {
            let names: Vec<String> = names.iter().map(|name| (*name).into()).collect();
            assert_eq!(image_channels(&names), expected, "{names:?}");
        }
    }
}
