use super::*;
use crate::{Limits, ReadOptions};
use snell_scene::Pixels;
use std::path::Path;

/// The words of a header for 4 x 4 pixels with these flags and letters.
fn header(flags: u32, letters: [u8; 4]) -> [u32; 32] {
    let mut words = [0u32; 32];
    words[0] = u32::from_le_bytes(*b"DDS ");
    (words[1], words[2], words[3], words[4]) = (124, 0x1007, 4, 4);
    (words[19], words[20], words[21]) = (32, flags, u32::from_le_bytes(letters));
    words[27] = 0x1000;
    words
}

fn file(words: &[u32], texels: &[u8]) -> Vec<u8> {
    let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    bytes.extend(texels);
    bytes
}

/// A file with a format of DXGI.
fn dxgi_file(format: u32, texels: &[u8]) -> Vec<u8> {
    let words = header(4, *b"DX10");
    file(&[&words[..], &[format, 3, 0, 1, 0]].concat(), texels)
}

fn input(bytes: Vec<u8>) -> Input {
    let limits = Limits { image_pixels: 1 << 12, ..Limits::default() };
    let options = ReadOptions { limits, ..ReadOptions::default() };
    Input::from_bytes("a.dds", bytes, Path::new("."), &options)
}

fn first(bytes: Vec<u8>) -> ([f32; 4], u32, Encoding) {
    let image = read(&input(bytes)).unwrap_or_else(|e| panic!("{e}"));
    (image.rgba_as(0, 0, Encoding::Linear), image.channels, image.encoding)
}

#[test]
fn formats_are_named_by_letters_numbers_and_masks() {
    let grey = [&[102, 102][..], &[0; 6]].concat();
    for letters in [*b"ATI1", *b"BC4U"] {
        let found = first(file(&header(4, letters), &grey));
        assert_eq!(found, ([0.4, 0.4, 0.4, 1.0], 1, Encoding::Srgb));
    }
    assert_eq!(first(dxgi_file(80, &grey)).0[0], 0.4);
    let float = file(
        &header(4, 113u32.to_le_bytes()),
        &[0x3c00u16, 0x4000, 0, 0x3c00].map(u16::to_le_bytes).concat().repeat(16),
    );
    assert_eq!(first(float), ([1.0, 2.0, 0.0, 1.0], 4, Encoding::Linear));
    let mut words = header(0x41, [0; 4]);
    words[22..27].copy_from_slice(&[32, 0xff_0000, 0xff00, 0xff, 0xff00_0000]);
    let bgra = file(&words, &[0, 51, 255, 102].repeat(16));
    assert_eq!(first(bgra), ([1.0, 0.2, 0.0, 0.4], 4, Encoding::Srgb));
    let mut words = header(0x2_0000, [0; 4]);
    words[22..24].copy_from_slice(&[8, 0xff]);
    assert_eq!(first(file(&words, &[51; 16])), ([0.2, 0.2, 0.2, 1.0], 1, Encoding::Srgb));
    // Alpha alone is shown as grey.
    let mut words = header(2, [0; 4]);
    (words[22], words[26]) = (8, 0xff);
    assert_eq!(first(file(&words, &[51; 16])).0, [0.2, 0.2, 0.2, 1.0]);
}

#[test]
fn two_channels_are_linear_and_get_the_blue_of_a_normal_map() {
    let middle = [&[128, 128][..], &[0; 6]].concat();
    let normals = [&middle[..], &middle].concat();
    let (color, channels, encoding) = first(file(&header(4, *b"ATI2"), &normals));
    assert_eq!((color[2], channels, encoding), (1.0, 3, Encoding::Linear));
    let ends = [&[255, 255][..], &[0; 6]].concat();
    assert_eq!(first(dxgi_file(83, &[&ends[..], &ends].concat())).0, [1.0, 1.0, 0.0, 1.0]);
    let signed = [&[0x81, 0x81][..], &[0; 6], &[0, 0], &[0; 6]].concat();
    let image = read(&input(dxgi_file(84, &signed))).unwrap();
    let Pixels::U16(values) = &image.pixels else { panic!("values with a sign have 16 bits") };
    assert_eq!(values[..3], [0, 32768, 32768 - 1 + 1]);
}

#[test]
fn pictures_that_are_not_shown_are_noted() {
    let texels = [0u8; 8];
    let noted = |bytes: Vec<u8>| {
        let input = input(bytes);
        read(&input).unwrap_or_else(|e| panic!("{e}"));
        input.take_notes().join("; ")
    };
    assert_eq!(noted(file(&header(4, *b"DXT1"), &texels)), "");
    let mut cube = header(4, *b"DXT1");
    cube[28] = 0xfe00;
    assert!(
        noted(file(&cube, &texels)).contains("a.dds: the DDS picture is a cube map; its first")
    );
    let mut array = dxgi_file(71, &texels);
    array[140] = 3;
    assert!(noted(array).contains("is an array"));
    let premultiplied = file(&header(4, *b"DXT2"), &[0; 16]);
    assert!(noted(premultiplied).contains("multiplied by alpha"));
}

#[test]
fn what_is_not_supported_or_cut_off_is_named() {
    let problem = |bytes| read(&input(bytes)).expect_err("it cannot be read").problem;
    assert!(problem(dxgi_file(107, &[])).contains("has the DXGI format 107"));
    assert!(problem(file(&header(4, *b"UYVY"), &[])).contains("the format \"UYVY\""));
    assert!(problem(file(&header(4, 63u32.to_le_bytes()), &[])).contains("63 of Direct3D 9"));
    assert!(
        problem(dxgi_file(98, &[0; 15])).contains("4 x 4 pixels take 16 bytes, and there are 15")
    );
    assert!(problem(file(&header(4, *b"DX10"), &[])).contains("damaged or cut off"));
    let mut large = header(4, *b"DXT1");
    large[3] = 1 << 20;
    assert!(problem(file(&large, &[])).contains("more than the limit"));
}
