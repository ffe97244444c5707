use super::super::{read_image, read_layers};
use crate::{Input, ReadOptions};
use snell_scene::{Image, Pixels};
use std::io::Write;
use std::path::Path;

/// A sample: the values of the channels of its part.
type Sample = [f32; 5];

/// The channels of deep parts, in the order of files.
const NAMES: [&str; 5] = ["A", "B", "G", "R", "Z"];

/// A part of a file: 5 x 4 pixels with deep samples, or 0 in one flat channel.
#[derive(Clone, Copy)]
struct Part<'a> {
    name: &'a str,
    is_deep: bool,
    /// 0 for none, 1 for runs, 2 for zlib.
    compression: u8,
    /// Pixels of a tile, if it has tiles.
    tile: Option<[usize; 2]>,
}

const LINES: Part = Part { name: "left", is_deep: true, compression: 0, tile: None };

const SIZE: [usize; 2] = [5, 4];

/// The samples of a pixel. They are not in the order of their depths.
fn samples(x: usize, y: usize) -> Vec<Sample> {
    let near = [0.5, 0.1 * x as f32, 0.25, 0.5, 1.0];
    let far = [1.0, 1.0, 0.5, 0.1 * y as f32, 3.0];
    let behind = [1.0, 7.0, 7.0, 7.0, 4.0];
    match (x + y) % 4 {
        0 => vec![],
        1 => vec![far],
        2 => vec![far, near],
        _ => vec![behind, far, near],
    }
}

/// The first channels of a pixel as it must become: red, green, blue and alpha, multiplied.
fn flattened(x: usize, y: usize) -> [f32; 4] {
    let ([ba, ra], blue) = ([1.0f32, 0.1 * y as f32], 0.1 * x as f32);
    match (x + y) % 4 {
        0 => [0.0; 4],
        1 => [ra, 0.5, 1.0, ba],
        _ => [0.5 + 0.5 * ra, 0.25 + 0.25, blue + 0.5, 1.0],
    }
}

fn ints(values: &[i32]) -> Vec<u8> {
    values.iter().flat_map(|i| i.to_le_bytes()).collect()
}

/// Packs bytes as files do: the differences of the bytes at even and at odd places.
fn packed(how: u8, bytes: &[u8]) -> Vec<u8> {
    let places = (0..bytes.len()).step_by(2).chain((1..bytes.len()).step_by(2));
    let mut sorted: Vec<u8> = places.map(|at| bytes[at]).collect();
    for at in (1..sorted.len()).rev() {
        sorted[at] = sorted[at].wrapping_sub(sorted[at - 1]).wrapping_add(128);
    }
    let packed = match how {
        0 => return bytes.to_vec(),
        1 => {
            // A run of two, or two bytes as they are.
            let pairs = sorted.chunks(2).flat_map(|pair| match *pair {
                [a, b] if a == b => vec![1, a],
                [a, b] => vec![(-2i8).cast_unsigned(), a, b],
                _ => vec![0, pair[0]],
            });
            pairs.collect()
        }
        _ => {
            let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), Default::default());
            packer.write_all(&sorted).expect("memory");
            packer.finish().expect("memory")
        }
    };
    if packed.len() < bytes.len() { packed } else { bytes.to_vec() }
}

/// A file of these parts.
fn file(parts: &[Part]) -> Vec<u8> {
    let has_parts = parts.len() > 1;
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0x08 | u8::from(has_parts) << 4, 0, 0];
    for part in parts {
        header(part, &mut bytes);
        bytes.push(0);
    }
    if has_parts {
        bytes.push(0);
    }
    let chunks: Vec<Vec<u8>> = (parts.iter().enumerate())
        .flat_map(|(number, part)| blocks(part).into_iter().map(move |block| (number, part, block)))
        .map(|(number, part, block)| {
            let number = if has_parts { ints(&[number as i32]) } else { Vec::new() };
            [number, chunk(part, block)].concat()
        })
        .collect();
    let mut offset = bytes.len() + 8 * chunks.len();
    for chunk in &chunks {
        bytes.extend((offset as u64).to_le_bytes());
        offset += chunk.len();
    }
    [bytes, chunks.concat()].concat()
}

fn header(part: &Part, bytes: &mut Vec<u8>) {
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        bytes.extend([name.as_bytes(), &[0], kind.as_bytes(), &[0]].concat());
        bytes.extend((value.len() as i32).to_le_bytes());
        bytes.extend(value);
    };
    let names: &[&str] = if part.is_deep { &NAMES } else { &["Y"] };
    // The types: 1 for half, 2 for float.
    let kind = |name: &str| if name == "G" { 1 } else { 2 };
    let channel = |name: &&str| [name.as_bytes(), &[0], &ints(&[kind(name), 0, 1, 1])].concat();
    let list = names.iter().flat_map(channel).chain([0]);
    attribute("channels", "chlist", &list.collect::<Vec<u8>>());
    attribute("chunkCount", "int", &ints(&[blocks(part).len() as i32]));
    attribute("compression", "compression", &[part.compression]);
    // The data are one pixel right of and below the corner of the picture.
    let [width, height] = SIZE.map(|n| n as i32);
    attribute("dataWindow", "box2i", &ints(&[1, 1, width, height]));
    attribute("displayWindow", "box2i", &ints(&[0, 0, width, height]));
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("name", "string", part.name.as_bytes());
    attribute("pixelAspectRatio", "float", &1f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1f32.to_le_bytes());
    if let Some(tile) = part.tile {
        attribute("tiles", "tiledesc", &[ints(&tile.map(|n| n as i32)), vec![0]].concat());
    }
    let kind = match (part.is_deep, part.tile) {
        (true, None) => "deepscanline",
        (true, Some(_)) => "deeptile",
        (false, _) => "scanlineimage",
    };
    attribute("type", "string", kind.as_bytes());
    attribute("version", "int", &ints(&[1]));
}

/// The corner and the size of each block of a part.
fn blocks(part: &Part) -> Vec<[[usize; 2]; 2]> {
    let step = part.tile.unwrap_or([SIZE[0], 1]);
    let rows = (0..SIZE[1]).step_by(step[1]);
    let corners = rows.flat_map(|y| (0..SIZE[0]).step_by(step[0]).map(move |x| [x, y]));
    corners
        .map(|corner| [corner, [0, 1].map(|axis| step[axis].min(SIZE[axis] - corner[axis]))])
        .collect()
}

fn chunk(part: &Part, [[left, top], [width, height]]: [[usize; 2]; 2]) -> Vec<u8> {
    let place = match part.tile {
        Some(tile) => ints(&[(left / tile[0]) as i32, (top / tile[1]) as i32, 0, 0]),
        None => ints(&[top as i32 + 1]),
    };
    if !part.is_deep {
        return [place, ints(&[4 * width as i32]), vec![0; 4 * width]].concat();
    }
    let (mut counts, mut values) = (Vec::new(), Vec::new());
    for y in top..top + height {
        let line: Vec<Vec<Sample>> = (left..left + width).map(|x| samples(x, y)).collect();
        counts.extend(line.iter().scan(0, |sum, samples| {
            *sum += samples.len() as i32;
            Some(*sum)
        }));
        for (channel, name) in NAMES.iter().enumerate() {
            for sample in line.iter().flatten() {
                match *name {
                    "G" => values.extend(half::f16::from_f32(sample[channel]).to_le_bytes()),
                    _ => values.extend(sample[channel].to_le_bytes()),
                }
            }
        }
    }
    let [counts, packed_values] = [&ints(&counts), &values].map(|b| packed(part.compression, b));
    let sizes = [counts.len(), packed_values.len(), values.len()].map(|n| (n as u64).to_le_bytes());
    [place, sizes.concat(), counts, packed_values].concat()
}

fn input(bytes: Vec<u8>) -> Input {
    Input::from_bytes("a.exr", bytes, Path::new("."), &ReadOptions::default())
}

fn assert_flattened(image: &Image) {
    let Pixels::F32(values) = &image.pixels else { panic!("floats") };
    assert_eq!([image.width, image.height, image.channels], [6, 5, 4]);
    for (at, pixel) in values.chunks_exact(4).enumerate() {
        let expected = match [at % 6, at / 6] {
            [0, _] | [_, 0] => [0.0; 4],
            [x, y] => flattened(x - 1, y - 1),
        };
        for (found, expected) in pixel.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{at}: {pixel:?}, {expected}");
        }
    }
}

#[test]
fn deep_lines_and_tiles_are_flattened() {
    for compression in [0, 1, 2] {
        for tile in [None, Some([2, 3]), Some([16, 16])] {
            let input = input(file(&[Part { compression, tile, ..LINES }]));
            assert_flattened(&read_image(&input).unwrap_or_else(|e| panic!("{tile:?}: {e}")));
            assert_eq!(input.take_notes(), Vec::<String>::new());
        }
    }
}

#[test]
fn other_channels_are_those_of_the_nearest_sample() {
    let layers = read_layers(&input(file(&[LINES]))).unwrap_or_else(|e| panic!("{e}")).layers;
    assert_eq!(layers[0].channels, ["R", "G", "B", "A", "Z"]);
    let depth = |x: usize, y: usize| layers[0].values[((y + 1) * 6 + x + 1) * 5 + 4];
    assert_eq!([depth(0, 0), depth(1, 0), depth(2, 0), depth(3, 0)], [0.0, 3.0, 1.0, 1.0]);
}

#[test]
fn deep_and_flat_parts_stand_in_one_file_and_are_named() {
    let flat = Part { name: "mask", is_deep: false, ..LINES };
    let right = Part { name: "right", compression: 2, tile: Some([3, 3]), ..LINES };
    let input = input(file(&[flat, LINES, right]));
    assert_flattened(&read_image(&input).unwrap_or_else(|e| panic!("{e}")));
    let said = "a.exr: the part \"left\" is the picture; not shown: \"mask\", \"right\"";
    assert_eq!(input.take_notes(), [said]);
    let layers = read_layers(&input).unwrap_or_else(|e| panic!("{e}")).layers;
    let names: Vec<&str> = layers.iter().map(|layer| layer.name.as_str()).collect();
    assert_eq!(names, ["", "mask", "right"]);
    assert_eq!(layers[0].values, layers[2].values);
    assert!(input.take_notes().is_empty());
}

#[test]
fn samples_that_overlap_in_depth_are_noted() {
    let names = ["A", "Z", "ZBack"].map(String::from);
    let composite = |back: f32| {
        let values = [vec![0.5, 0.5], vec![1.0, 2.0], vec![back, 3.0]];
        super::composite(&names, &values, &[0, 2], |_| true)
    };
    let apart = composite(1.5);
    assert_eq!((apart.channels[0].as_deref(), apart.overlaps), (Some(&[0.75f32][..]), false));
    assert!(composite(2.5).overlaps);
}

#[test]
fn damaged_deep_files_are_errors_or_pictures() {
    let right = Part { name: "right", compression: 1, tile: Some([3, 3]), ..LINES };
    for bytes in [file(&[LINES]), file(&[right]), file(&[Part { compression: 2, ..LINES }, right])]
    {
        for at in 0..bytes.len() {
            let is_cut = read_image(&input(bytes[..at].to_vec())).is_err();
            // Of two parts the second is not needed.
            assert!(is_cut || bytes[5] & 0x10 != 0, "{at}");
            for value in [0, 1, 0x7f, 0xff] {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                if let Ok(image) = read_image(&input(damaged)) {
                    assert!(image.width > 0 && image.height > 0);
                }
            }
        }
    }
}
