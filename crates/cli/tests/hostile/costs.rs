//! Small files of large cost: they are refused before they fill the memory or take minutes.

use super::limits::{folder_with, survive};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write;
use std::time::{Duration, Instant};

/// Bytes that are all the same, compressed.
fn packed(byte: u8, count: usize) -> Vec<u8> {
    let mut packer = ZlibEncoder::new(Vec::new(), Compression::best());
    let piece = vec![byte; 1 << 20];
    for start in (0..count).step_by(piece.len()) {
        packer.write_all(&piece[..piece.len().min(count - start)]).expect("memory");
    }
    packer.finish().expect("memory")
}

/// A black PNG of one byte a pixel.
fn black(width: usize, height: usize) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let header =
        [&(width as u32).to_be_bytes()[..], &(height as u32).to_be_bytes(), &[8, 0, 0, 0, 0]]
            .concat();
    for (kind, data) in
        [(b"IHDR", header), (b"IDAT", packed(0, (width + 1) * height)), (b"IEND", Vec::new())]
    {
        bytes.extend((data.len() as u32).to_be_bytes());
        let content = [&kind[..], &data].concat();
        bytes.extend(&content);
        bytes.extend(super::mutate::crc32(&content).to_be_bytes());
    }
    bytes
}

/// Asserts that a command refuses files quickly, in one line that contains `expected`.
fn is_refused(name: &str, files: &[(&str, Vec<u8>)], words: &str, expected: &str) {
    let folder = folder_with(files);
    let start = Instant::now();
    let messages = survive(folder.path(), words).messages;
    assert!(messages.contains(expected) && messages.lines().count() == 1, "{name}: {messages}");
    assert!(start.elapsed() < Duration::from_secs(30), "{name}: {:?}", start.elapsed());
}

#[test]
fn an_environment_of_one_colour_does_not_fill_the_memory() {
    let words = "render cornell-box --environment a.png --size 8x8 --spp 1 -t 1 -q -o out.png";
    let expected = "light from the environment's image would take 1.2 GB";
    is_refused("environment", &[("a.png", black(10_000, 10_000))], words, expected);
}

#[test]
fn an_image_whose_decoder_panics_is_one_line() {
    // The palette has four bytes, which is not a whole number of colours.
    let hex = "89504e470d0a1a0a0000000d49484452000000020000000208030000004568fd1600000004504c5445\
        ff0000011da1981d0000000174524e5380ad5e5b460000000b49444154789c636000010000060001fe8c67c800\
        00000049454e44ae426082";
    let image = (0..hex.len())
        .step_by(2)
        .map(|i| u8::from_str_radix(&hex[i..i + 2], 16).expect("hex"))
        .collect();
    let words = "render cornell-box --environment a.png --size 8x8 --spp 1 -t 1 -q -o out.png";
    is_refused("palette", &[("a.png", image)], words, "error: a.png: ");
}

#[test]
fn a_hundred_thousand_attributes_take_no_time() {
    let attributes: String = (0..150_000).map(|i| format!(" a{i:x}=''")).collect();
    let scene = format!("<scene version='3.0.0'><shape type='sphere'{attributes}/></scene>");
    let words = "render a.xml --size 8x8 --spp 1 -t 1 -q -o out.png";
    is_refused("attributes", &[("a.xml", scene.into_bytes())], words, "more than 256 attributes");
}

#[test]
fn a_compressed_mesh_that_unpacks_to_a_thousand_times_its_size_is_refused() {
    let scene = "<scene version='3.0.0'><shape type='serialized'>\
                 <string name='filename' value='a.serialized'/></shape></scene>";
    let mut mesh = vec![0x1c, 4, 4, 0];
    // The name of the mesh is not terminated.
    mesh.extend(packed(1, 70 << 20));
    mesh.extend(0u64.to_le_bytes());
    mesh.extend(1u32.to_le_bytes());
    let files = [("a.xml", scene.as_bytes().to_vec()), ("a.serialized", mesh)];
    is_refused(
        "serialized",
        &files,
        "render a.xml --size 8x8 --spp 1 -t 1 -q -o out.png",
        "unpacks to more than",
    );
}
