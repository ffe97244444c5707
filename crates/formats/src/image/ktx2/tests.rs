use super::*;
use crate::{Limits, ReadOptions};
use flate2::write::ZlibEncoder;
use snell_scene::Pixels;
use std::io::Write;
use std::path::Path;

/// What the header of a file says.
struct File<'a> {
    format: u32,
    size: [u32; 2],
    /// Depth, layers, faces.
    counts: [u32; 3],
    supercompression: u32,
    /// Transfer function (1 for linear, 2 for sRGB), and flags.
    transfer: [u8; 2],
    facts: &'a [(&'a str, &'a str)],
    level: &'a [u8],
}

const FILE: File = File {
    format: 37,
    size: [1, 2],
    counts: [0, 0, 1],
    supercompression: 0,
    transfer: [1, 0],
    facts: &[],
    level: &[255, 51, 0, 102, 1, 2, 3, 4],
};

impl File<'_> {
    fn bytes(&self) -> Vec<u8> {
        let mut facts = Vec::new();
        for (key, value) in self.facts {
            let entry = format!("{key}\0{value}\0");
            facts.extend((entry.len() as u32).to_le_bytes());
            facts.extend(entry.as_bytes());
            facts.resize(facts.len().next_multiple_of(4), 0);
        }
        // The descriptor follows the index of one level, then the facts and the level.
        const DESCRIPTOR: u32 = 80 + 24;
        let at = DESCRIPTOR + 28;
        let ([width, height], [depth, layers, faces]) = (self.size, self.counts);
        let mut words = vec![self.format, 1, width, height, depth, layers, faces, 1];
        words.extend([self.supercompression, DESCRIPTOR, 28, at, facts.len() as u32, 0, 0, 0, 0]);
        let level = at + facts.len() as u32;
        words.extend([level, 0, self.level.len() as u32, 0, self.level.len() as u32, 0]);
        let [transfer, flags] = self.transfer;
        words.extend([28, 0, 2 | 24 << 16, u32::from_le_bytes([1, 1, transfer, flags]), 0, 0, 0]);
        let mut bytes = IDENTIFIER.to_vec();
        bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        [&bytes, &facts[..], self.level].concat()
    }

    fn input(&self) -> Input {
        let limits = Limits { image_pixels: 1 << 12, ..Limits::default() };
        let options = ReadOptions { limits, ..ReadOptions::default() };
        Input::from_bytes("a.ktx2", self.bytes(), Path::new("."), &options)
    }

    fn read(&self) -> Image {
        read(&self.input()).unwrap_or_else(|e| panic!("{e}"))
    }

    fn problem(&self) -> String {
        read(&self.input()).expect_err("it cannot be read").problem
    }
}

#[test]
fn plain_formats_have_the_encoding_that_the_file_says() {
    let linear = FILE.read();
    assert_eq!((linear.channels, linear.encoding), (4, Encoding::Linear));
    assert_eq!(linear.rgba_as(0, 0, Encoding::Linear), [1.0, 0.2, 0.0, 0.4]);
    assert_eq!(File { transfer: [2, 0], ..FILE }.read().encoding, Encoding::Srgb);
    assert_eq!(File { format: 43, ..FILE }.read().encoding, Encoding::Srgb);
    let grey = File { format: 9, ..FILE }.read();
    assert_eq!((grey.channels, grey.pixels), (1, Pixels::U8(vec![255, 51])));
    let halves = [0x3c00u16, 0xc000].map(u16::to_le_bytes).concat();
    let floats = File { format: 76, level: &halves, ..FILE }.read();
    assert_eq!((floats.pixels, floats.encoding), (Pixels::F32(vec![1.0, -2.0]), Encoding::Linear));
    // A picture of one dimension has no height.
    assert_eq!(File { size: [2, 0], ..FILE }.read().height, 1);
}

#[test]
fn compressed_formats_are_read() {
    let white = [0xff, 0xff, 0, 0, 0, 0, 0, 0];
    for format in [131, 134] {
        let image = File { format, level: &white, ..FILE }.read();
        assert_eq!(image.rgba_as(0, 1, Encoding::Linear), [1.0; 4]);
        assert_eq!(image.encoding == Encoding::Srgb, format == 134);
    }
    let mut astc = vec![0xfc, 0xfd, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff];
    astc.extend([0xff; 8]);
    for format in [157, 170, 184] {
        let image = File { format, level: &astc, ..FILE }.read();
        assert_eq!(image.rgba_as(0, 1, Encoding::Linear), [1.0; 4], "{format}");
    }
    let etc = [0xff, 0xff, 0xff, 0, 0, 0, 0, 0];
    assert_eq!(File { format: 148, level: &etc, ..FILE }.read().rgba(0, 0)[0], 1.0);
}

#[test]
fn levels_are_unpacked() {
    let mut packer = ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(FILE.level).expect("memory");
    let packed = packer.finish().expect("memory");
    let unpacked = File { supercompression: ZLIB, level: &packed, ..FILE }.read();
    assert_eq!(unpacked, FILE.read());
    // A frame of zstd: its number, one segment of 8 bytes, and one raw block that is the last.
    let frame = [&[0x28, 0xb5, 0x2f, 0xfd, 0x20, 8, 1 | 8 << 3, 0, 0], FILE.level].concat();
    assert_eq!(File { supercompression: ZSTD, level: &frame, ..FILE }.read(), FILE.read());
    let cut = File { supercompression: ZSTD, level: &frame[..12], ..FILE };
    assert!(cut.problem().contains("damaged or cut off"));
    let other = File { supercompression: 9, ..FILE };
    assert!(other.problem().contains("the supercompression 9"));
}

#[test]
fn a_small_stream_with_a_large_window_is_refused() {
    // A window of 8 GB, and blocks of one byte repeated.
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0, 23 << 3];
    for _ in 0..64 {
        frame.extend([0x02, 0, 0x10, 7]);
    }
    let problem = File { supercompression: ZSTD, level: &frame, ..FILE }.problem();
    assert!(problem.contains("compression would take 8.6 GB"), "{problem}");
    let problem =
        File { format: 0, supercompression: ZSTD, level: &frame, size: [64, 64], ..FILE }.problem();
    assert!(problem.contains("compression would take 8.6 GB"), "{problem}");
}

#[test]
fn orientation_and_order_of_channels_are_those_of_the_file() {
    let turned = File { facts: &[("KTXorientation", "ru")], ..FILE }.read();
    assert_eq!(turned.rgba_as(0, 1, Encoding::Linear), [1.0, 0.2, 0.0, 0.4]);
    let facts = [("KTXorientation", "rd"), ("KTXwriter", "me"), ("KTXswizzle", "bgr1")];
    let image = File { facts: &facts, ..FILE }.read();
    assert_eq!(image.pixels, Pixels::U8(vec![0, 51, 255, 3, 2, 1]));
    let unknown = File { facts: &[("KTXswizzle", "xyzw")], ..FILE };
    assert!(unknown.problem().contains("KTXswizzle"));
    let two = File { format: 16, size: [1, 1], level: &[128, 128], ..FILE };
    assert_eq!(two.read().pixels, Pixels::U8(vec![128, 128, 255]));
    let grey_alpha = File { facts: &[("KTXswizzle", "rrrg")], ..two }.read();
    assert_eq!((grey_alpha.channels, grey_alpha.pixels), (2, Pixels::U8(vec![128; 2])));
}

#[test]
fn pictures_that_are_not_shown_are_noted() {
    let noted = |file: File| {
        let input = file.input();
        read(&input).unwrap_or_else(|e| panic!("{e}"));
        input.take_notes().join("; ")
    };
    assert_eq!(noted(FILE), "");
    assert!(
        noted(File { counts: [0, 0, 6], ..FILE }).contains("a.ktx2: the KTX2 picture is a cube")
    );
    assert!(noted(File { counts: [0, 7, 1], ..FILE }).contains("an array of 7 pictures"));
    assert!(noted(File { counts: [0, 7, 6], ..FILE }).contains("an array of 7 cube maps"));
    assert!(noted(File { counts: [5, 0, 1], ..FILE }).contains("a volume of 5 slices"));
    assert!(noted(File { transfer: [1, 1], ..FILE }).contains("multiplied by alpha"));
}

#[test]
fn the_cause_of_an_error_is_the_right_one() {
    let cut = File { size: [1, 3], ..FILE };
    assert!(cut.problem().contains("1 x 3 pixels take 12 bytes, and there are 8"));
    let unknown = File { format: 999, ..FILE };
    assert!(unknown.problem().contains("the Vulkan format 999"), "{}", unknown.problem());
    // A level of Basis Universal that is larger than its pixels, and one beyond the memory.
    let mut bytes = File { format: 0, ..FILE }.bytes();
    bytes[96..104].copy_from_slice(&1_000u64.to_le_bytes());
    let of = |bytes: &[u8], memory_bytes| {
        let limits = Limits { memory_bytes, expansion: 0, ..Limits::default() };
        let options = ReadOptions { limits, ..ReadOptions::default() };
        let input = Input::from_bytes("a.ktx2", bytes.to_vec(), Path::new("."), &options);
        read(&input).expect_err("it cannot be read").problem
    };
    let problem = of(&bytes, 1 << 20);
    assert!(problem.contains("declares 1000 bytes for its largest level"), "{problem}");
    bytes[96..104].copy_from_slice(&90u64.to_le_bytes());
    let problem = of(&bytes, 50);
    assert!(problem.contains("faces and layers would take 90 bytes"), "{problem}");
}
