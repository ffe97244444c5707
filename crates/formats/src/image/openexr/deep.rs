//! Deep parts, which the crate `exr` does not read: any number of samples at a pixel, each with its
//! depth. They are flattened as they are read ("Interpreting OpenEXR Deep Pixels"): colours and
//! alpha are composited from front to back, other channels are those of the nearest sample.

use super::attributes::{attribute, is_multipart};
use exr::block::chunk::{
    Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates,
};
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::attribute::{IntegerBounds, SampleType};
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData};
use half::f16;
use std::io::Read;

/// A chunk of a file with deep parts.
pub enum Stored<'a> {
    Flat(Chunk),
    Deep(DeepChunk<'a>),
}

/// Deep samples of some lines or of a tile, compressed.
pub struct DeepChunk<'a> {
    pub part: usize,
    /// Where it is, in pixels of its part.
    pub bounds: IntegerBounds,
    /// How many samples the pixels have.
    counts: &'a [u8],
    samples: &'a [u8],
    /// Bytes of the samples, unpacked.
    pub unpacked_bytes: usize,
}

/// A flattened chunk.
pub struct Flat {
    /// For each channel of the part the values of all pixels, if the channel is wanted.
    pub channels: Vec<Option<Vec<f32>>>,
    /// True if samples overlap in depth: then their order is not all there is to it.
    pub overlaps: bool,
}

/// The chunks of the largest levels of the wanted parts, in the order of the file's tables.
pub fn chunks<'a>(
    bytes: &'a [u8],
    meta: &MetaData,
    is_wanted: impl Fn(usize) -> bool,
) -> Result<Vec<Stored<'a>>, String> {
    let mut at = tables(bytes).ok_or("its header is cut off")?;
    let mut chunks = Vec::new();
    // Chunks that share their bytes must not be copied any number of times.
    let mut left = bytes.len();
    for (part, header) in meta.headers.iter().enumerate() {
        let table = (header.chunk_count.checked_mul(8))
            .and_then(|length| bytes.get(at..at.checked_add(length)?))
            .ok_or("the table of its chunks is cut off")?;
        at += table.len();
        if !is_wanted(part) {
            continue;
        }
        for (index, offset) in table.as_chunks::<8>().0.iter().enumerate() {
            let Some(bounds) = bounds(header, index) else { break };
            let rest = usize::try_from(u64::from_le_bytes(*offset)).ok();
            let rest = rest.and_then(|offset| bytes.get(offset..)).filter(|rest| !rest.is_empty());
            let chunk = rest
                .and_then(|rest| chunk(rest, &mut left, is_multipart(bytes), part, header, bounds));
            chunks.push(chunk.ok_or("a chunk is cut off or not where it should be")?);
        }
    }
    // Each byte can unpack to some thousand, but chunks that share their bytes would do so again.
    let unpacked = chunks.iter().map(|chunk| match chunk {
        Stored::Deep(deep) => deep.unpacked_bytes as u64,
        Stored::Flat(_) => 0,
    });
    match unpacked.fold(0, u64::saturating_add) <= (bytes.len() as u64).saturating_mul(2048) {
        true => Ok(chunks),
        false => Err("it declares more samples than its bytes can hold".into()),
    }
}

/// Where the tables of chunks begin: after all headers.
fn tables(bytes: &[u8]) -> Option<usize> {
    let mut at = 8;
    loop {
        while *bytes.get(at)? != 0 {
            attribute(bytes, &mut at)?;
        }
        at += 1;
        if !is_multipart(bytes) {
            return Some(at);
        }
        if *bytes.get(at)? == 0 {
            return Some(at + 1);
        }
    }
}

/// The pixels of a chunk of the largest level. `None` for those of smaller levels.
fn bounds(header: &Header, index: usize) -> Option<IntegerBounds> {
    let size = header.layer_size;
    let block = match header.blocks {
        BlockDescription::ScanLines => Vec2(size.0, header.compression.scan_lines_per_block()),
        BlockDescription::Tiles(tiles) => tiles.tile_size,
    };
    let columns = size.0.div_ceil(block.0);
    let start = Vec2(index % columns * block.0, index / columns * block.1);
    let size = Vec2(block.0.min(size.0 - start.0), block.1.min(size.1.checked_sub(start.1)?));
    let position = Vec2(i32::try_from(start.0).ok()?, i32::try_from(start.1).ok()?);
    (size.1 > 0).then_some(IntegerBounds { position, size })
}

/// Reads a chunk, which must be that of these pixels. Bytes that are copied are taken off `left`.
fn chunk<'a>(
    bytes: &'a [u8],
    left: &mut usize,
    has_part: bool,
    part: usize,
    header: &Header,
    bounds: IntegerBounds,
) -> Option<Stored<'a>> {
    let mut rest = bytes;
    let mut word = || {
        let (word, after) = rest.split_first_chunk()?;
        rest = after;
        Some(i32::from_le_bytes(*word))
    };
    if has_part && usize::try_from(word()?).ok()? != part {
        return None;
    }
    let Vec2(x, y) = bounds.position;
    let place = match header.blocks {
        BlockDescription::ScanLines => {
            (word()? == y.checked_add(header.own_attributes.layer_position.1)?).then_some(None)?
        }
        BlockDescription::Tiles(tiles) => {
            let [column, row, level_x, level_y] = [word()?, word()?, word()?, word()?];
            let index = Vec2(x as usize / tiles.tile_size.0, y as usize / tiles.tile_size.1);
            let found = Vec2(usize::try_from(column).ok()?, usize::try_from(row).ok()?);
            (found == index && [level_x, level_y] == [0, 0]).then_some(Some(index))?
        }
    };
    if !header.deep {
        let length = usize::try_from(word()?).ok()?;
        *left = left.checked_sub(length)?;
        let compressed_pixels_le = rest.get(..length)?.to_vec();
        let compressed_block = match place {
            None => CompressedBlock::ScanLine(CompressedScanLineBlock {
                y_coordinate: y + header.own_attributes.layer_position.1,
                compressed_pixels_le,
            }),
            Some(tile_index) => CompressedBlock::Tile(CompressedTileBlock {
                coordinates: TileCoordinates { tile_index, level_index: Vec2(0, 0) },
                compressed_pixels_le,
            }),
        };
        return Some(Stored::Flat(Chunk { layer_index: part, compressed_block }));
    }
    let mut long = || {
        let (long, after) = rest.split_first_chunk()?;
        rest = after;
        usize::try_from(u64::from_le_bytes(*long)).ok()
    };
    let [counts, samples, unpacked_bytes] = [long()?, long()?, long()?];
    let (counts, rest) = rest.split_at_checked(counts)?;
    let samples = rest.get(..samples)?;
    Some(Stored::Deep(DeepChunk { part, bounds, counts, samples, unpacked_bytes }))
}

/// Unpacks a chunk and composites its samples. `is_wanted` says of a channel whether its values are
/// needed.
pub fn flatten(
    chunk: &DeepChunk,
    header: &Header,
    is_wanted: impl Fn(usize) -> bool,
) -> Result<Flat, String> {
    let Vec2(width, height) = chunk.bounds.size;
    let counts = unpack(header.compression, chunk.counts, width * height * 4)?;
    // On each line the table says how many samples there are up to and with a pixel.
    let mut starts = vec![0usize];
    for line in counts.chunks_exact(width * 4) {
        let mut before = 0;
        for count in line.as_chunks::<4>().0 {
            let count = i32::from_le_bytes(*count);
            let samples = count.checked_sub(before).and_then(|n| usize::try_from(n).ok());
            starts.push(starts[starts.len() - 1] + samples.ok_or("its sample counts decrease")?);
            before = count;
        }
    }
    let total = starts[width * height];
    let channels = &header.channels.list;
    let bytes: usize = channels.iter().map(|c| c.sample_type.bytes_per_sample()).sum();
    if total.checked_mul(bytes) != Some(chunk.unpacked_bytes) {
        return Err(format!("{total} samples do not take {} bytes", chunk.unpacked_bytes));
    }
    let samples = unpack(header.compression, chunk.samples, chunk.unpacked_bytes)?;
    // Channels follow each other on every line.
    let mut values: Vec<Vec<f32>> = vec![Vec::with_capacity(total); channels.len()];
    let mut rest = &samples[..];
    for line in 0..height {
        let count = starts[(line + 1) * width] - starts[line * width];
        for (channel, values) in channels.iter().zip(&mut values) {
            let (own, others) = rest.split_at(count * channel.sample_type.bytes_per_sample());
            rest = others;
            append(channel.sample_type, own, values);
        }
    }
    let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
    Ok(composite(&names, &values, &starts, is_wanted))
}

/// What happens to the samples of a channel.
enum Rule {
    /// They are composited with the alpha of this channel, if there is one.
    Over(Option<usize>),
    /// The nearest counts.
    Nearest,
}

/// Composites the samples of all pixels, whose first samples are at `starts`.
fn composite(
    names: &[String],
    values: &[Vec<f32>],
    starts: &[usize],
    is_wanted: impl Fn(usize) -> bool,
) -> Flat {
    let find = |name: &str| names.iter().position(|n| n == name);
    let rule = |name: &String| {
        let (prefix, short) = name.rsplit_once('.').map_or(("", &name[..]), |(p, s)| (p, s));
        let alpha = find(&format!("{prefix}.A")).or_else(|| find("A"));
        match short {
            "R" | "G" | "B" | "A" | "Y" | "RY" | "BY" => Rule::Over(alpha),
            _ => Rule::Nearest,
        }
    };
    let rules: Vec<Rule> = names.iter().map(rule).collect();
    let pixels = starts.len() - 1;
    let wanted = |channel| is_wanted(channel).then(|| vec![0.0; pixels]);
    let mut flat = Flat { channels: (0..names.len()).map(wanted).collect(), overlaps: false };
    let (front, back) = (find("Z"), find("ZBack"));
    let mut order: Vec<usize> = Vec::new();
    for (pixel, range) in starts.windows(2).enumerate() {
        order.clear();
        order.extend(range[0]..range[1]);
        if let Some(front) = front.map(|z| &values[z]) {
            let back = back.map_or(front, |z| &values[z]);
            order.sort_by(|a, b| {
                front[*a].total_cmp(&front[*b]).then(back[*a].total_cmp(&back[*b]))
            });
            flat.overlaps |= order.windows(2).any(|near| back[near[0]] > front[near[1]]);
        }
        for ((rule, values_of), target) in rules.iter().zip(values).zip(&mut flat.channels) {
            let Some(target) = target else { continue };
            target[pixel] = match rule {
                Rule::Over(Some(alpha)) => over(&order, values_of, &values[*alpha]),
                Rule::Over(None) | Rule::Nearest => {
                    order.first().map_or(0.0, |first| values_of[*first])
                }
            };
        }
    }
    flat
}

/// Composites samples from front to back. Colours are multiplied by alpha already.
fn over(order: &[usize], values: &[f32], alphas: &[f32]) -> f32 {
    let (mut sum, mut through) = (0.0, 1.0);
    for sample in order {
        sum += values[*sample] * through;
        through *= 1.0 - alphas[*sample].clamp(0.0, 1.0);
    }
    sum
}

fn append(kind: SampleType, bytes: &[u8], values: &mut Vec<f32>) {
    match kind {
        SampleType::F16 => {
            let halves = bytes.as_chunks::<2>().0.iter();
            values.extend(halves.map(|b| f16::from_le_bytes(*b).to_f32()));
        }
        SampleType::F32 => {
            values.extend(bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)));
        }
        SampleType::U32 => {
            let words = bytes.as_chunks::<4>().0.iter();
            values.extend(words.map(|b| u32::from_le_bytes(*b) as f32));
        }
    }
}

/// Unpacks bytes, which are as they are if that is shorter.
fn unpack(how: Compression, packed: &[u8], length: usize) -> Result<Vec<u8>, String> {
    if packed.len() == length {
        return Ok(packed.to_vec());
    }
    let mut bytes = match how {
        Compression::ZIP1 | Compression::ZIP16 => {
            let mut bytes = Vec::new();
            let unpacker = flate2::read::ZlibDecoder::new(packed);
            unpacker.take(length as u64).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
            bytes
        }
        Compression::RLE => runs(packed, length).ok_or("its runs are cut off")?,
        Compression::Uncompressed => Vec::new(),
        other => return Err(format!("deep data with the compression {other}")),
    };
    if bytes.len() != length {
        return Err("a chunk unpacks to another size than it says".into());
    }
    // Each byte is the difference to the one before, and the first half has those at even places.
    for at in 1..length {
        bytes[at] = bytes[at].wrapping_add(bytes[at - 1]).wrapping_sub(128);
    }
    let (even, odd) = bytes.split_at(length.div_ceil(2));
    Ok((0..length).map(|at| if at % 2 == 0 { even[at / 2] } else { odd[at / 2] }).collect())
}

/// Unpacks runs: a count below zero says how many bytes follow, another how often the next one is
/// repeated, less one.
fn runs(mut packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    while let Some((count, rest)) = packed.split_first() {
        let count = count.cast_signed();
        if count < 0 {
            let (own, rest) = rest.split_at_checked(count.unsigned_abs().into())?;
            bytes.extend_from_slice(own);
            packed = rest;
        } else {
            let (byte, rest) = rest.split_first()?;
            bytes.resize(bytes.len() + count as usize + 1, *byte);
            packed = rest;
        }
        if bytes.len() > length {
            return None;
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests;
