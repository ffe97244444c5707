//! Round trips through every format, and hostile files.

use super::*;
use crate::{Limits, ReadOptions};
use proptest::prelude::*;
use snell_scene::{Encoding, Pixels};
use std::time::{Duration, Instant};

fn input(name: &str, bytes: Vec<u8>) -> Input {
    Input::from_bytes(name, bytes, Path::new("."), &ReadOptions::default())
}

fn layer(name: &str, channels: &[&str], pixels: usize, value: impl Fn(usize) -> f32) -> Layer {
    let values = (0..pixels * channels.len()).map(value).collect();
    Layer { name: name.into(), channels: channels.iter().map(|c| (*c).into()).collect(), values }
}

/// A picture with alpha, two more layers and metadata.
fn picture(width: u32, height: u32) -> LayeredImage {
    let pixels = (width * height) as usize;
    let alpha = |i: usize| [0.25f32, 0.5, 1.0][i / 4 % 3];
    LayeredImage {
        width,
        height,
        layers: vec![
            layer("", &["R", "G", "B", "A"], pixels, |i| match i % 4 {
                3 => alpha(i),
                c => alpha(i) * [0.1, 0.5, 0.9][c] * ((i % 7) as f32 / 6.0),
            }),
            layer("depth", &["Z"], pixels, |i| i as f32 * 1000.3),
            layer("normal", &["X", "Y", "Z"], pixels, |i| (i as f32 * 0.7).sin()),
        ],
        metadata: vec![("samples".into(), "64".into()), ("Grüße".into(), "größer als ä".into())],
    }
}

fn opaque(width: u32, height: u32) -> LayeredImage {
    let pixels = (width * height) as usize;
    let values = |i: usize| (i % 97) as f32 / 96.0;
    LayeredImage {
        width,
        height,
        layers: vec![layer("", &["R", "G", "B"], pixels, values)],
        metadata: Vec::new(),
    }
}

fn float_values(image: &Image) -> &[f32] {
    match &image.pixels {
        Pixels::F32(values) => values,
        other => panic!("{other:?}"),
    }
}

#[test]
fn openexr_gives_back_every_layer_bit_by_bit() {
    let picture = picture(37, 23);
    let bytes = encode_image_as("exr", &picture, &WriteOptions::default()).unwrap();
    let back = read_layers(&input("a.exr", bytes)).unwrap();
    assert_eq!(back.layers, picture.layers);
    let mut metadata = picture.metadata.clone();
    metadata.sort();
    assert_eq!(back.metadata, metadata);
}

#[test]
fn openexr_with_half_colours_keeps_depth_in_float() {
    let mut picture = picture(8, 8);
    picture.layers[0].values[0] = 1e9;
    let bytes =
        encode_image_as("exr", &picture, &WriteOptions { exr_half: true, ..Default::default() })
            .unwrap();
    let back = read_layers(&input("a.exr", bytes)).unwrap();
    assert_eq!(back.layers[1..], picture.layers[1..]);
    assert_eq!(back.layers[0].values[0], 65504.0);
    for (a, b) in back.layers[0].values.iter().zip(&picture.layers[0].values).skip(1) {
        assert!((a - b).abs() <= b.abs() / 2048.0, "{a} {b}");
    }
}

#[test]
fn openexr_images_have_their_alpha_divided_out() {
    let bytes = encode_image_as("openexr", &picture(6, 5), &WriteOptions::default()).unwrap();
    let image = read_image(&input("no-extension", bytes)).unwrap();
    assert_eq!(
        (image.width, image.height, image.channels, image.encoding),
        (6, 5, 4, Encoding::Linear)
    );
    let [r, g, _, a] = image.rgba(0, 1);
    // Pixel 6: values 24 to 27, alpha of 0.25, and 24 % 7 = 3, 25 % 7 = 4.
    assert!(
        (r - 0.1 * 3.0 / 6.0).abs() < 1e-6 && (g - 0.5 * 4.0 / 6.0).abs() < 1e-6 && a == 0.25,
        "{r} {g} {a}"
    );
}

#[test]
fn every_writer_is_deterministic_and_its_files_are_recognised_without_extension() {
    for format in IMAGE_FORMATS.iter().filter(|f| f.writes()) {
        let encode =
            || encode_image_as(format.name, &picture(33, 18), &WriteOptions::default()).unwrap();
        let bytes = encode();
        assert!(bytes == encode(), "{} differs from run to run", format.name);
        let image = read_image(&input("x", bytes)).unwrap();
        assert_eq!((image.width, image.height), (33, 18), "{}", format.name);
    }
}

#[test]
fn long_names_of_layers_and_settings_survive_openexr() {
    let mut picture = opaque(2, 2);
    picture
        .layers
        .push(layer("ein-Licht-mit-einem-längeren-Namen-名前", &["R"], 4, |i| i as f32));
    picture.metadata = vec![("a setting with a name of more than 31 bytes".into(), String::new())];
    // Names that the format itself uses.
    picture.metadata.push(("channels".into(), "3".into()));
    let bytes = encode_image_as("exr", &picture, &WriteOptions::default()).unwrap();
    let back = read_layers(&input("a.exr", bytes)).unwrap();
    assert_eq!(back.layers, picture.layers);
    assert_eq!(back.metadata[1], ("snell.channels".into(), "3".into()));
}

/// Three parts as other programs write them: tiles of several sizes, three compressions, a channel
/// with a layer prefix, and one part that is smaller than the display window.
#[test]
fn openexr_files_of_several_parts_become_layers() {
    use exr::prelude as e;
    let part = |name: &str,
                channels: &[&str],
                compression,
                blocks,
                size: (usize, usize),
                at: (i32, i32)| {
        let values = |c: usize| (0..size.0 * size.1).map(|i| (i * 3 + c) as f32).collect();
        let list = channels
            .iter()
            .enumerate()
            .map(|(i, c)| e::AnyChannel::new(*c, e::FlatSamples::F32(values(i))));
        let mut attributes = e::LayerAttributes::named(name);
        attributes.layer_position = e::Vec2(at.0, at.1);
        let encoding = e::Encoding { compression, blocks, line_order: e::LineOrder::Increasing };
        e::Layer::new(size, attributes, encoding, e::AnyChannels::sort(list.collect()))
    };
    let tiles = e::Blocks::Tiles(e::Vec2(7, 5));
    let parts = vec![
        part("depth", &["Z"], e::Compression::RLE, e::Blocks::ScanLines, (20, 10), (0, 0)),
        part("beauty", &["R", "G", "B", "glow.R"], e::Compression::PIZ, tiles, (20, 10), (0, 0)),
        part("inset", &["G", "A"], e::Compression::ZIP1, tiles, (4, 3), (18, -1)),
    ];
    let window = e::IntegerBounds::from_dimensions((20, 10));
    let mut bytes = std::io::Cursor::new(Vec::new());
    let file = e::Image::from_layers(e::ImageAttributes::new(window), parts);
    e::WritableImage::write(&file).to_buffered(&mut bytes).unwrap();
    let input = input("a.exr", bytes.into_inner());

    let read = read_layers(&input).unwrap();
    let names: Vec<_> =
        read.layers.iter().map(|l| (l.name.as_str(), l.channels.concat())).collect();
    let expected = [("", "RGB"), ("depth", "Z"), ("beauty.glow", "R"), ("inset", "GA")];
    assert_eq!(names, expected.map(|(n, c)| (n, c.to_string())));
    let numbers = |count: usize| (0..count).map(|i| i as f32).collect::<Vec<_>>();
    assert_eq!(read.layers[0].values, numbers(600));
    assert_eq!(read.layers[1].values[199], 597.0);
    // Pixel (0, 1) of the inset lands at (18, 0) of the picture; most of the inset lies outside of
    // it.
    assert_eq!(read.layers[3].values[2 * 18..2 * 20], [12.0, 13.0, 15.0, 16.0]);
    assert_eq!(read.layers[3].values.iter().filter(|v| **v != 0.0).count(), 8);

    assert!(input.take_notes().is_empty());

    let image = read_image(&input).unwrap();
    assert_eq!((image.channels, float_values(&image)), (3, &numbers(600)[..]));
    let others = "\"depth\", \"beauty.glow\", \"inset\"";
    let said = format!("a.exr: the part \"beauty\" is the picture; not shown: {others}");
    assert_eq!(input.take_notes(), [said]);
}

#[test]
fn png_holds_display_values_to_half_a_level_with_alpha_divided_out() {
    let picture = picture(12, 9);
    for (bits, levels) in [(8, 255.0), (16, 65535.0)] {
        let bytes = encode_image_as(
            "png",
            &picture,
            &WriteOptions { png_bits: bits, ..Default::default() },
        )
        .unwrap();
        let image = read_image(&input("a.png", bytes)).unwrap();
        assert_eq!((image.channels, image.encoding), (4, Encoding::Srgb));
        assert_eq!(matches!(image.pixels, Pixels::U16(_)), bits == 16);
        for (i, stored) in picture.layers[0].values.chunks(4).enumerate() {
            let (x, y) = (i as u32 % 12, i as u32 / 12);
            let colour =
                display_value([0, 1, 2].map(|c| stored[c] / stored[3]), &Display::default());
            let expected = [colour[0], colour[1], colour[2], stored[3]];
            for c in 0..4 {
                let difference = (image.value(x, y, c) - expected[c as usize]).abs();
                assert!(
                    difference <= 0.5001 / levels,
                    "{bits} bits, pixel {i}, channel {c}: {difference}"
                );
            }
        }
    }
}

#[test]
fn png_carries_the_metadata() {
    let bytes = encode_image_as("png", &picture(2, 2), &WriteOptions::default()).unwrap();
    let reader = ::png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let info = reader.info();
    assert!(info.srgb.is_some());
    assert_eq!(
        (
            info.uncompressed_latin1_text[0].keyword.as_str(),
            info.uncompressed_latin1_text[0].text.as_str()
        ),
        ("samples", "64")
    );
    assert_eq!(info.utf8_text[0].keyword, "Gr??e");
    assert_eq!(info.utf8_text[0].get_text().unwrap(), "größer als ä");
}

#[test]
fn transparent_pictures_lie_over_black_in_formats_without_alpha() {
    let picture = picture(4, 1);
    let linear = Display { srgb: false, ..Display::default() };
    let bytes =
        encode_image_as("ppm", &picture, &WriteOptions { display: linear, ..Default::default() })
            .unwrap();
    assert!(bytes.starts_with(b"P6\n4 1\n255\n"));
    let expected = picture.layers[0].values.chunks(4).flat_map(|p| [p[0], p[1], p[2]]);
    let expected: Vec<u8> = expected.map(|v| (v * 255.0).round() as u8).collect();
    assert_eq!(bytes[11..], expected);
}

#[test]
fn jpeg_is_near_and_quality_counts() {
    let smooth = LayeredImage {
        layers: vec![layer("", &["R", "G", "B"], 1024, |i| i as f32 / 3072.0)],
        ..opaque(32, 32)
    };
    let with = |jpeg_quality| {
        encode_image_as("jpg", &smooth, &WriteOptions { jpeg_quality, ..Default::default() })
            .unwrap()
    };
    assert!(with(10).len() < with(95).len());
    let image = read_image(&input("a.jpg", with(95))).unwrap();
    let centre = display_value([(16.0 * 32.0 + 16.0) / 1024.0; 3], &Display::default());
    assert!((image.value(16, 16, 1) - centre[1]).abs() < 0.03);
}

#[test]
fn float_maps_and_radiance_keep_high_values() {
    let mut bright = opaque(9, 7);
    bright.layers[0].values.iter_mut().for_each(|v| *v *= 900.0);
    let pfm = read_image(&input(
        "a.pfm",
        encode_image_as("pfm", &bright, &WriteOptions::default()).unwrap(),
    ))
    .unwrap();
    assert_eq!(float_values(&pfm), bright.layers[0].values);
    let hdr = read_image(&input(
        "a.hdr",
        encode_image_as("hdr", &bright, &WriteOptions::default()).unwrap(),
    ))
    .unwrap();
    for (pixel, expected) in float_values(&hdr).chunks(3).zip(bright.layers[0].values.chunks(3)) {
        let tolerance = expected.iter().fold(0.0, |m: f32, v| m.max(*v)) / 127.0;
        assert!(
            (0..3).all(|c| (pixel[c] - expected[c]).abs() <= tolerance),
            "{pixel:?} {expected:?}"
        );
    }
}

#[test]
fn grey_float_maps_in_both_byte_orders_start_at_the_bottom() {
    let mut little = b"Pf\n1 2\n-1.0\n".to_vec();
    little.extend([1.0f32, 2.0].iter().flat_map(|v| v.to_le_bytes()));
    let mut big = b"Pf 1 2 2.0\n".to_vec();
    big.extend([0.5f32, 1.0].iter().flat_map(|v| v.to_be_bytes()));
    for bytes in [little, big] {
        let image = read_image(&input("a.pfm", bytes)).unwrap();
        assert_eq!((image.channels, float_values(&image)), (1, &[2.0, 1.0][..]));
    }
}

#[test]
fn portable_maps_of_all_kinds() {
    let files: [(&[u8], u32, [f32; 2]); 6] = [
        (b"P2\n# comment\n2 1\n15\n0 15\n", 1, [0.0, 1.0]),
        (b"P3\n2 1\n255\n0 0 0 255 0 0\n", 3, [0.0, 1.0]),
        (b"P5 2 1 255\n\x00\xff", 1, [0.0, 1.0]),
        (b"P5 2 1 65535\n\x00\x00\x80\x00", 1, [0.0, 32768.0 / 65535.0]),
        (b"P6 2 1 255\n\x00\x00\x00\x33\x00\x00", 3, [0.0, 0.2]),
        (b"P1 2 1\n1 0\n", 1, [0.0, 1.0]),
    ];
    for (bytes, channels, expected) in files {
        let image = read_image(&input("x", bytes.to_vec())).unwrap();
        assert_eq!((image.width, image.height, image.channels), (2, 1, channels));
        let found = [image.value(0, 0, 0), image.value(1, 0, 0)];
        assert!((0..2).all(|i| (found[i] - expected[i]).abs() < 1e-6), "{found:?} {expected:?}");
    }
}

#[test]
fn display_formats_never_show_what_is_not_finite() {
    let mut odd = opaque(3, 1);
    odd.layers[0].values[..4].copy_from_slice(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.0]);
    let bytes = encode_image_as("ppm", &odd, &WriteOptions::default()).unwrap();
    assert_eq!(bytes[11..15], [0, 0, 0, 255]);
    let exr = encode_image_as("exr", &odd, &WriteOptions::default()).unwrap();
    assert!(read_layers(&input("a.exr", exr.clone())).unwrap().layers[0].values[0].is_nan());
    assert_eq!(
        float_values(&read_image(&input("a.exr", exr)).unwrap())[..3],
        [0.0, 65504.0, -65504.0]
    );
}

#[test]
fn unknown_extensions_are_errors_that_list_the_known_ones() {
    for name in ["a.gif", "a", "a.bmp"] {
        let message = encode_image(Path::new(name), &opaque(1, 1), &WriteOptions::default())
            .unwrap_err()
            .to_string();
        assert!(message.contains(".exr .png .jpg .hdr .pfm .ppm"), "{message}");
    }
    let message = read_image(&input("a.xcf", b"gimp xcf".to_vec())).unwrap_err().to_string();
    assert!(message.contains("67 69 6d") && message.contains("openexr"), "{message}");
}

#[test]
fn pictures_that_contradict_themselves_are_errors() {
    let mut wrong = opaque(2, 2);
    wrong.layers[0].values.pop();
    let twice = LayeredImage { layers: vec![opaque(2, 2).layers[0].clone(); 2], ..opaque(2, 2) };
    for format in IMAGE_FORMATS.iter().filter(|f| f.writes()) {
        assert!(encode_image_as(format.name, &wrong, &WriteOptions::default()).is_err());
        assert!(
            encode_image_as(format.name, &LayeredImage::default(), &WriteOptions::default())
                .is_err()
        );
    }
    assert!(encode_image_as("exr", &twice, &WriteOptions::default()).is_err());
}

#[test]
fn sizes_over_the_limit_and_sizes_that_the_file_cannot_hold_are_errors() {
    let png = encode_image_as("png", &opaque(20, 20), &WriteOptions::default()).unwrap();
    let limits = Limits { image_pixels: 399, ..Limits::default() };
    let options = ReadOptions { limits, ..ReadOptions::default() };
    let small = Input::from_bytes("a.png", png, Path::new("."), &options);
    assert!(read_image(&small).unwrap_err().to_string().contains("limit of 399"));

    for header in [
        "PF 16000 16000 -1.0\n",
        "P6 16000 16000 255\n",
        "#?RADIANCE\n\n-Y 16000 +X 16000\n",
        "PF 4000000000 4000000000 1\n",
    ] {
        let message = read_image(&input("x", header.into())).unwrap_err().to_string();
        assert!(message.contains("pixels"), "{message}");
    }
}

/// All files below a folder beside the repository; empty if it is absent.
fn corpus(folder: &str) -> Vec<std::path::PathBuf> {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(folder);
    let mut folders = vec![root.clone()];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else { continue };
        for path in entries.flatten().map(|e| e.path()) {
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    if files.is_empty() {
        eprintln!("skipped: no {}", root.display());
    }
    files.sort();
    files
}

fn is_text(path: &Path) -> bool {
    let name = path.file_name().unwrap().to_string_lossy().to_string();
    name.starts_with("LICENSE") || name.starts_with("README")
}

#[test]
fn sound_images_are_read_and_hold_finite_values() {
    for path in corpus("images")
        .into_iter()
        .filter(|p| !is_text(p) && !p.to_string_lossy().contains("/bad/"))
    {
        let input = Input::open(&path, &ReadOptions::default()).unwrap();
        let image = read_image(&input).unwrap_or_else(|e| panic!("{e}"));
        if let Pixels::F32(values) = &image.pixels {
            assert!(values.iter().all(|v| v.is_finite()), "{}", path.display());
        }
        let layers = read_layers(&input).unwrap();
        assert_eq!((layers.width, layers.height), (image.width, image.height));
    }
}

#[test]
fn damaged_images_are_errors_or_images_and_quick() {
    let files =
        corpus("malformed/openexr-damaged").into_iter().chain(corpus("images/image-rs/bad"));
    for path in files.filter(|p| !is_text(p)) {
        let start = Instant::now();
        let input = Input::open(&path, &ReadOptions::default()).unwrap();
        for error in [read_image(&input).err(), read_layers(&input).err()].into_iter().flatten() {
            assert!(!error.problem.is_empty() && !error.remedy.is_empty());
            // The message is plain text, not Rust's debug form.
            assert!(
                !error.problem.contains(['{', '}']) && !error.problem.contains("Format error"),
                "{error}"
            );
        }
        assert!(
            start.elapsed() < Duration::from_secs(10),
            "{} took {:?}",
            path.display(),
            start.elapsed()
        );
    }
}

/// All files of this set hold the same pixels; the windows differ.
#[test]
fn data_windows_are_placed_into_display_windows() {
    // Name; left, top, right and bottom of the display window; left and top of the data window.
    let windows = [
        ("t02", [1, 1, 400, 300], [0, 0]),
        ("t03", [30, 20, 399, 299], [0, 0]),
        ("t04", [0, 0, 369, 279], [0, 0]),
        ("t05", [30, 20, 369, 279], [0, 0]),
        ("t06", [-1, -1, 400, 300], [0, 0]),
        ("t07", [-40, -40, 440, 330], [0, 0]),
        ("t08", [0, 0, 500, 400], [30, 40]),
    ];
    let files = corpus("images/openexr/DisplayWindow");
    let load = |name: &str| {
        let path = files.iter().find(|p| p.file_stem().is_some_and(|s| s == name))?;
        Some(read_image(&Input::open(path, &ReadOptions::default()).unwrap()).unwrap())
    };
    let Some(data) = load("t01") else { return };
    assert_eq!((data.width, data.height), (400, 300));
    for (name, [left, top, right, bottom], origin) in windows {
        let image = load(name).unwrap();
        assert_eq!(
            (image.width as i32, image.height as i32),
            (right - left + 1, bottom - top + 1),
            "{name}"
        );
        for (x, y) in (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y))) {
            let (u, v) = (x as i32 + left - origin[0], y as i32 + top - origin[1]);
            let inside = (0..400).contains(&u) && (0..300).contains(&v);
            let expected =
                if inside { data.rgba(u as u32, v as u32)[..3].to_vec() } else { vec![0.0; 3] };
            assert_eq!(image.rgba(x, y)[..3], expected, "{name}: {x} {y}");
        }
    }
}

/// Colours beyond Rec. 709 are negative in the file and clamped in the rendition.
#[test]
fn openexr_images_look_like_their_renditions() {
    let files = corpus("images/openexr");
    let load = |name: String| {
        let path = files.iter().find(|p| p.ends_with(&name))?;
        Some(read_image(&Input::open(path, &ReadOptions::default()).unwrap()).unwrap())
    };
    for name in ["WideColorGamut", "Rec709"] {
        let (Some(scene), Some(shown)) = (load(format!("{name}.exr")), load(format!("{name}.jpg")))
        else {
            return;
        };
        let mut sum = 0.0;
        for (x, y) in (0..scene.height).flat_map(|y| (0..scene.width).map(move |x| (x, y))) {
            let [r, g, b, _] = scene.rgba(x, y);
            let display = display_value([r, g, b], &Display::default());
            sum += (0..3)
                .map(|c| f64::from((display[c as usize] - shown.value(x, y, c)).abs()))
                .sum::<f64>();
        }
        let mean = sum / (3.0 * f64::from(scene.width * scene.height));
        // Two and a half levels: the loss of JPEG.
        assert!(mean < 0.01, "{name}: {mean}");
    }
}

#[test]
fn other_primaries_are_converted_to_rec709() {
    use exr::prelude as e;
    // The red of ACES AP0 is more saturated than Rec. 709 can be; its white is white.
    let pixels = [[1.0f32, 1.0, 1.0], [1.0, 0.0, 0.0]];
    let channel = |(i, c)| {
        e::AnyChannel::new(c, e::FlatSamples::F32(pixels.map(|p: [f32; 3]| p[i]).to_vec()))
    };
    let list = ["R", "G", "B"].into_iter().enumerate().map(channel).collect();
    let mut file = e::Image::from_channels((2, 1), e::AnyChannels::sort(list));
    file.attributes.chromaticities = Some(e::attribute::Chromaticities {
        red: e::Vec2(0.7347, 0.2653),
        green: e::Vec2(0.0, 1.0),
        blue: e::Vec2(0.0001, -0.077),
        white: e::Vec2(0.32168, 0.33767),
    });
    let mut bytes = std::io::Cursor::new(Vec::new());
    e::WritableImage::write(&file).to_buffered(&mut bytes).unwrap();
    let image = read_image(&input("a.exr", bytes.into_inner())).unwrap();
    let expected = [1.0, 1.0, 1.0, 2.5217, -0.2765, -0.0154];
    assert!(
        float_values(&image).iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3),
        "{image:?}"
    );
}

/// An OpenEXR file of uncompressed scan lines: channels of floats with their name and their step in
/// x and y, in alphabetical order, and the values of each line and channel.
fn sampled_openexr(
    size: [i32; 2],
    channels: &[(&str, [i32; 2])],
    value: impl Fn(usize, i32, i32) -> f32,
) -> Vec<u8> {
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: Vec<u8>| {
        bytes.extend([name.as_bytes(), &[0], kind.as_bytes(), &[0]].concat());
        bytes.extend((value.len() as i32).to_le_bytes());
        bytes.extend(value);
    };
    let ints = |values: &[i32]| values.iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<u8>>();
    let mut list = Vec::new();
    for (name, [x, y]) in channels {
        list.extend([name.as_bytes(), &[0], &ints(&[2, 0, *x, *y])].concat());
    }
    list.push(0);
    attribute("channels", "chlist", list);
    attribute("compression", "compression", vec![0]);
    let window = ints(&[0, 0, size[0] - 1, size[1] - 1]);
    attribute("dataWindow", "box2i", window.clone());
    attribute("displayWindow", "box2i", window);
    attribute("lineOrder", "lineOrder", vec![0]);
    attribute("pixelAspectRatio", "float", 1f32.to_le_bytes().to_vec());
    attribute("screenWindowCenter", "v2f", vec![0; 8]);
    attribute("screenWindowWidth", "float", 1f32.to_le_bytes().to_vec());
    bytes.push(0);
    let mut chunks = Vec::new();
    for y in 0..size[1] {
        bytes.extend(
            ((bytes.len() + (size[1] - y) as usize * 8 + chunks.len()) as u64).to_le_bytes(),
        );
        let mut line = Vec::new();
        for (c, (_, step)) in channels.iter().enumerate().filter(|(_, (_, step))| y % step[1] == 0)
        {
            let samples = (0..size[0]).step_by(step[0] as usize);
            line.extend(samples.flat_map(|x| value(c, x, y).to_le_bytes()));
        }
        chunks.extend([ints(&[y, line.len() as i32]), line].concat());
    }
    bytes.extend(chunks);
    bytes
}

#[test]
fn luminance_and_chroma_of_openexr_become_colours() {
    let colour = [0.8f32, 0.4, 0.2];
    let luminance = 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2];
    let scale = |x: i32, y: i32| 1.0 + x as f32 + 10.0 * y as f32;
    for step in [[1, 1], [2, 2], [2, 1], [4, 2]] {
        let channels = [("BY", step), ("RY", step), ("Y", [1, 1])];
        let bytes = sampled_openexr([8, 4], &channels, |c, x, y| match c {
            0 => colour[2] / luminance - 1.0,
            1 => colour[0] / luminance - 1.0,
            _ => luminance * scale(x, y),
        });
        let image = read_image(&input("a.exr", bytes.clone())).unwrap();
        assert_eq!((image.width, image.height, image.channels), (8, 4, 3));
        let expected =
            (0..4).flat_map(|y| (0..8).flat_map(move |x| colour.map(|c| c * scale(x, y))));
        for (found, expected) in float_values(&image).iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-5, "{step:?}: {found} {expected}");
        }
        let layers = read_layers(&input("a.exr", bytes)).unwrap().layers;
        assert_eq!(layers[0].channels, ["R", "G", "B"]);
    }
}

/// Found by a fuzzer: the decoder allocated four terabytes, and the process ended.
#[test]
fn a_block_of_dwa_that_declares_more_than_its_pixels_is_refused() {
    use exr::prelude as e;
    let values: Vec<half::f16> =
        (0..256).map(|i| half::f16::from_f32((i * 37 % 101) as f32)).collect();
    let channel = |n| e::AnyChannel::new(n, e::FlatSamples::F16(values.clone()));
    let channels = ["R", "G", "B"].map(channel);
    let encoding = e::Encoding {
        compression: e::Compression::DWAA(Some(45.0)),
        blocks: e::Blocks::ScanLines,
        line_order: e::LineOrder::Increasing,
    };
    let channels = e::AnyChannels::sort(channels.into_iter().collect());
    let layer = e::Layer::new((16, 16), e::LayerAttributes::default(), encoding, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    e::WritableImage::write(&e::Image::from_layer(layer)).to_buffered(&mut bytes).unwrap();
    let bytes = bytes.into_inner();
    read_image(&input("a.exr", bytes.clone())).unwrap();
    // The only block: its line, its length, and the version of its kind.
    let is_start = |at: &usize| {
        let length = (bytes.len() - at - 8) as u32;
        bytes[*at..*at + 8] == [[0; 4], length.to_le_bytes()].concat() && bytes[at + 8] == 2
    };
    let start = (0..bytes.len() - 16).find(is_start).expect("one block") + 8;
    for word in [1, 6, 7, 8, 9] {
        let mut damaged = bytes.clone();
        damaged[start + word * 8 + 5] = 2;
        let error = read_image(&input("a.exr", damaged)).expect_err("terabytes");
        assert!(error.problem.contains("declares more data than its pixels"), "{error}");
    }
}

#[test]
fn cube_maps_of_openexr_are_noted() {
    use exr::prelude as e;
    let channel = e::AnyChannel::new("Y", e::FlatSamples::F32(vec![1.0; 6]));
    let attributes = e::LayerAttributes {
        environment_map: Some(exr::meta::attribute::EnvironmentMap::Cube),
        ..Default::default()
    };
    let channels = e::AnyChannels::sort(std::iter::once(channel).collect());
    let layer = e::Layer::new((1, 6), attributes, e::Encoding::UNCOMPRESSED, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    e::WritableImage::write(&e::Image::from_layer(layer)).to_buffered(&mut bytes).unwrap();
    let input = input("a.exr", bytes.into_inner());
    read_image(&input).unwrap();
    assert!(input.take_notes()[0].contains("is a cube map, six faces one below the other"));
}

#[test]
fn channels_of_openexr_with_few_samples_are_interpolated() {
    let bytes = sampled_openexr([4, 4], &[("A", [2, 2]), ("Y", [1, 1])], |c, x, y| match c {
        0 => (x + y) as f32 * 0.125,
        _ => 1.0,
    });
    let layers = read_layers(&input("a.exr", bytes)).unwrap().layers;
    assert_eq!(layers[0].channels, ["Y", "A"]);
    let alpha = |x: usize, y: usize| layers[0].values[(y * 4 + x) * 2 + 1];
    let found = [(0, 0), (1, 0), (2, 0), (3, 0), (1, 1), (2, 2), (3, 3)].map(|(x, y)| alpha(x, y));
    assert_eq!(found, [0.0, 0.125, 0.25, 0.25, 0.25, 0.5, 0.5]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn damaged_copies_of_our_own_files_never_panic(
        format in 0usize..6,
        cut in 0.0f64..1.5,
        flips in prop::collection::vec((0.0f64..1.0, any::<u8>()), 0..4),
    ) {
        let format = IMAGE_FORMATS.iter().filter(|f| f.writes()).nth(format).unwrap();
        let options = WriteOptions::default();
        let mut bytes = encode_image_as(format.name, &picture(13, 20), &options).unwrap();
        for (place, value) in flips {
            let index = (place * bytes.len() as f64) as usize;
            bytes[index] ^= value;
        }
        bytes.truncate((cut * bytes.len() as f64) as usize);
        let extension = format.extensions[0];
        if let Ok(image) = read_image(&input(&format!("a.{extension}"), bytes)) {
            prop_assert!(image.width > 0 && image.height > 0);
        }
    }
}

#[test]
fn a_small_file_cannot_declare_a_picture_that_fills_the_memory() {
    let check = super::picture::check_size;
    // Deflate could pack the first picture into two megabytes, but real pictures of that size do
    // not compress so well.
    let small = input("a.png", vec![0; 2 << 20]);
    assert!(check(&small, 16_000, 16_000, 8).is_err());
    assert!(check(&small, 8_192, 8_192, 4).is_ok());
    let large = input("a.png", vec![0; 20 << 20]);
    assert!(check(&large, 16_000, 16_000, 8).is_ok());
}

/// The only pixel of a picture of one format, and its encoding.
fn first_pixel(name: &str, bytes: Vec<u8>) -> ([f32; 4], Encoding) {
    let image = read_image(&input(name, bytes)).unwrap_or_else(|e| panic!("{e}"));
    (image.rgba_as(0, 0, Encoding::Linear), image.encoding)
}

/// A GIF of two frames of one pixel: red, then green.
fn two_frames() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = gif::Encoder::new(&mut bytes, 1, 1, &[255, 0, 0, 0, 255, 0]).unwrap();
    for color in 0..2 {
        let frame =
            gif::Frame { width: 1, height: 1, buffer: vec![color].into(), ..Default::default() };
        encoder.write_frame(&frame).unwrap();
    }
    drop(encoder);
    bytes
}

/// A TIFF of one grey pixel of 8 bits.
fn tiff(grey: u8) -> Vec<u8> {
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    let entries: [(u16, u32); 8] =
        [(256, 1), (257, 1), (258, 8), (259, 1), (262, 1), (273, 110), (278, 1), (279, 1)];
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, value) in entries {
        bytes.extend(tag.to_le_bytes());
        bytes.extend(4u16.to_le_bytes());
        bytes.extend([1, value].map(u32::to_le_bytes).concat());
    }
    bytes.extend([0; 4]);
    assert_eq!(bytes.len(), 110);
    bytes.push(grey);
    bytes
}

/// A DDS of one block of DXT1 in this colour (RGB 565).
fn dds(color: u16) -> Vec<u8> {
    let mut words = [0u32; 32];
    words[0] = u32::from_le_bytes(*b"DDS ");
    (words[1], words[2], words[3], words[4]) = (124, 0x1007, 4, 4);
    (words[19], words[20], words[21]) = (32, 4, u32::from_le_bytes(*b"DXT1"));
    words[27] = 0x1000;
    let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    bytes.extend([color, color].map(u16::to_le_bytes).concat());
    bytes.extend([0; 4]);
    bytes
}

/// A KTX2 of one block of UASTC that has one colour (mode 8 of its specification).
fn ktx2(color: [u8; 4]) -> Vec<u8> {
    let mut words =
        vec![0, 1, 4, 4, 0, 0, 1, 1, 0, 104, 44, 0, 0, 0, 0, 0, 0, 148, 0, 16, 0, 16, 0];
    // The data format: UASTC with the primaries and the curve of sRGB, 4 x 4 pixels, RGBA.
    words.extend([44, 0, 2 | 40 << 16, 166 | 1 << 8 | 2 << 16, 0x0303, 16, 0]);
    words.extend([127 << 16 | 3 << 24, 0, 0, u32::MAX]);
    let mut bytes = ktx2::IDENTIFIER.to_vec();
    bytes.extend(words.iter().flat_map(|word: &u32| word.to_le_bytes()));
    assert_eq!(bytes.len(), 148);
    let bits = u128::from(u32::from_le_bytes(color)) << 5 | 0b10111;
    bytes.extend(bits.to_le_bytes());
    bytes
}

#[test]
fn formats_that_are_known_but_not_read_are_named() {
    let cases: [(&[u8], &str, &str); 5] = [
        (b"\0\0\0\x20ftypavif\0\0\0\0", "AVIF is not supported", "avifdec"),
        (b"\0\0\0\x18ftypheic\0\0\0\0", "HEIF is not supported", "magick"),
        (b"\xff\x0a\0\0", "JPEG XL is not supported", "djxl"),
        (b"\xabKTX 11\xbb\r\n\x1a\n", "KTX of version 1 is not supported", "ktx2ktx2"),
        (b"what else", "it starts with the bytes 77 68", "convert it to one of: openexr"),
    ];
    for (bytes, problem, remedy) in cases {
        let error = read_image(&input("a.picture", bytes.to_vec())).expect_err("it is not read");
        assert!(error.problem.contains(problem) && error.remedy.contains(remedy), "{error}");
    }
}

#[test]
fn textures_of_games_and_archives_are_read() {
    assert_eq!(first_pixel("a.gif", two_frames()), ([1.0, 0.0, 0.0, 1.0], Encoding::Srgb));
    assert_eq!(first_pixel("a.tif", tiff(51)), ([0.2, 0.2, 0.2, 1.0], Encoding::Srgb));
    assert_eq!(first_pixel("a.dds", dds(0x07e0)).0[..3], [0.0, 1.0, 0.0]);
    let color = [255, 51, 0, 102];
    assert_eq!(first_pixel("a.ktx2", ktx2(color)), ([1.0, 0.2, 0.0, 0.4], Encoding::Srgb));
}

#[test]
fn damaged_textures_of_games_and_archives_are_errors_or_pictures() {
    let limits = Limits { image_pixels: 1 << 12, ..Limits::default() };
    let options = ReadOptions { limits, ..ReadOptions::default() };
    let read = |name, bytes| read_image(&Input::from_bytes(name, bytes, Path::new("."), &options));
    for (name, bytes) in
        [("a.gif", two_frames()), ("a.tif", tiff(1)), ("a.dds", dds(1)), ("a.ktx2", ktx2([9; 4]))]
    {
        for at in 0..bytes.len() {
            let _ = read(name, bytes[..at].to_vec());
            for value in [0, 1, 0x7f, 0xff] {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                if let Ok(image) = read(name, damaged) {
                    assert!(image.width > 0 && image.height > 0);
                }
            }
        }
    }
    // An exabyte of decompressed data, and a format that is not Basis Universal.
    let mut huge = ktx2([9; 4]);
    huge[44] = 2;
    huge[103] = 0x10;
    assert!(read("a.ktx2", huge).is_err());
    let mut other = ktx2([9; 4]);
    other[12] = 1;
    let error = read("a.ktx2", other).expect_err("a format of Vulkan");
    assert!(error.problem.contains("the Vulkan format 1,"), "{error}");
}
