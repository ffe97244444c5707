//! Small files that demand much: huge counts, deep nesting, files that name files. They are given
//! to the real command, with limits on its address space: an allocation from a declared count, or a
//! stack overflow, would end it by a signal.

use super::mutate::crc32;
use super::promise::{self, Ended};
use snell_formats::image::{WriteOptions, encode_image_as};
use snell_scene::{Layer, LayeredImage};
use std::fmt::Write;
use std::path::Path;
use tempfile::TempDir;

/// Runs the command, which must keep its promises.
pub fn survive(folder: &Path, words: &str) -> Ended {
    let words: Vec<_> = words.split_whitespace().map(String::from).collect();
    let scratch = TempDir::new().expect("temporary folders can be made");
    let ended =
        promise::run(Path::new(env!("CARGO_BIN_EXE_snell")), &words, folder, scratch.path());
    assert_eq!(ended.fault(&words), None, "{words:?}");
    let message: String = ended.messages.trim_end().chars().take(300).collect();
    eprintln!("{words:?}: {:?} in {:?}: {message}", ended.code, ended.time);
    ended
}

/// Runs `render`, `info` and `info --json` on the file; true for each that succeeds.
fn survive_scene(folder: &Path, name: &str) -> [bool; 3] {
    let render = format!("render {name} --size 8x8 --spp 1 -t 1 -q -o {name}.png");
    [render, format!("info {name}"), format!("info {name} --json")]
        .map(|w| survive(folder, &w).code == Some(0))
}

pub fn folder_with(files: &[(&str, Vec<u8>)]) -> TempDir {
    let folder = TempDir::new().expect("temporary folders can be made");
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).expect("the folder is writable");
    }
    folder
}

#[test]
fn huge_counts_are_refused() {
    let ply = |format: &str, vertices: &str, rest: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float \
                y\nproperty float z\n{rest}end_header\n"
        )
    };
    let faces = "element face 4000000000\nproperty list uint int vertex_indices\n";
    let mut list =
        ply("binary_little_endian", "1", "element face 1\nproperty list uint int vertex_indices\n")
            .into_bytes();
    list.extend([0; 12]);
    list.extend([0xff, 0xff, 0xff, 0x7f, 1, 2, 3]);
    let mut stl = vec![b' '; 80];
    stl.extend([0xff; 4]);
    let gltf = |accessor: &str| {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "accessors": [{{"componentType": 5126, "type": "VEC3", {accessor}}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 4000000000}}], "buffers": [{{"byteLength": 4000000000}}]}}"#
        )
        .into_bytes()
    };
    let files = [
        ("a.ply", ply("ascii", "499999999", "").into_bytes()),
        ("b.ply", ply("binary_big_endian", "499999999", "").into_bytes()),
        ("c.ply", ply("ascii", "0", faces).into_bytes()),
        ("d.ply", list),
        ("a.stl", stl),
        ("a.off", b"OFF\n499999999 499999999 0\n".to_vec()),
        ("b.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2147483647 0 1 2\n".to_vec()),
        ("a.obj", b"v 0 0 0\nf 1 -2147483648 99999999999999999999\n".to_vec()),
        ("a.gltf", gltf(r#""count": 499999998"#)),
        ("b.gltf", gltf(r#""count": 333333333, "bufferView": 0"#)),
        ("c.gltf", gltf(r#""count": 18446744073709551615"#)),
        ("a.glb", b"glTF\x02\0\0\0\xff\xff\xff\xff\xff\xff\xff\xffJSON{}".to_vec()),
        (
            "p.nff",
            b"v\nfrom 0 0 1\nat 0 0 0\nup 0 1 0\nangle 40\nhither 1\nresolution 20 20\np \
            2000000000\n0 0 0\n"
                .to_vec(),
        ),
        (
            "a.nff",
            b"v\nfrom 0 0 1\nat 0 0 0\nup 0 1 0\nangle 40\nhither 1\nresolution 2000000000 \
            2000000000\np 2000000000\n0 0 0\n"
                .to_vec(),
        ),
    ];
    let folder = folder_with(&files);
    for (name, _) in files {
        // The size of an STL file tells how many facets there are, and faces without corners are
        // left out.
        let is_drawn = ["a.stl", "a.obj"].contains(&name);
        assert_eq!(survive_scene(folder.path(), name), [is_drawn; 3], "{name}");
    }
}

#[test]
fn huge_pictures_are_refused() {
    let layer = Layer {
        name: String::new(),
        channels: ["R", "G", "B"].map(String::from).to_vec(),
        values: vec![0.5; 12],
    };
    let picture = LayeredImage { width: 2, height: 2, layers: vec![layer], metadata: Vec::new() };
    let encode = |f: &str| {
        encode_image_as(f, &picture, &WriteOptions::default()).unwrap_or_else(|e| panic!("{e}"))
    };
    let mut jpeg = encode("jpg");
    let frame = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).expect("a JPEG has a frame");
    jpeg[frame + 5..frame + 9].copy_from_slice(&[0xff; 4]);
    let mut exr = encode("exr");
    for window in ["dataWindow\0box2i\0\x10\0\0\0", "displayWindow\0box2i\0\x10\0\0\0"] {
        let at = exr
            .windows(window.len())
            .position(|w| w == window.as_bytes())
            .expect("an EXR has windows")
            + window.len();
        exr[at + 8..at + 16].copy_from_slice(&[0x3f, 0xff, 0, 0, 0x3f, 0xff, 0, 0]);
    }
    let files = [
        ("a.png", png(65_000, 65_000)),
        ("b.png", png(16_384, 16_384)),
        ("a.jpg", jpeg),
        ("a.exr", exr),
        (
            "a.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16000 +X \
            16000\n\x02\x02\x3e\x80"
                .to_vec(),
        ),
        ("a.pfm", b"PF\n16000 16000\n-1\n\0\0\0\0".to_vec()),
        ("a.ppm", b"P6\n16000 16000\n255\n\0\0\0\0".to_vec()),
        (
            "a.pam",
            b"P7\nWIDTH 4000000000\nHEIGHT 4000000000\nDEPTH 4\nMAXVAL 65535\nTUPLTYPE \
                RGB_ALPHA\nENDHDR\n"
                .to_vec(),
        ),
    ];
    let folder = folder_with(&files);
    for (name, _) in files {
        let words = format!("render --environment {name} --size 8x8 --spp 1 -t 1 -q -o out.png");
        for words in [words, format!("compare {name} {name}")] {
            let output = survive(folder.path(), &words);
            assert_eq!(output.code, Some(1), "{words}");
        }
    }
}

/// The start of a PNG of this size: its header, and a few bytes of data.
fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let header = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[16, 6, 0, 0, 0]].concat();
    for (kind, data) in [(b"IHDR", &header[..]), (b"IDAT", &[0x78, 0x9c, 0x63, 0x60])] {
        bytes.extend((data.len() as u32).to_be_bytes());
        let content = [&kind[..], data].concat();
        bytes.extend(&content);
        bytes.extend(crc32(&content).to_be_bytes());
    }
    bytes
}

#[test]
fn deep_nesting_is_no_overflow() {
    let depth = 100_000;
    let begin = "begin -1 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n";
    let nodes: Vec<_> = (0..depth).map(|i| format!("{{\"children\": [{}]}}", i + 1)).collect();
    let gltf = |nodes: &str| {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}, {{}}]}}"#
        )
    };
    let (open, close) = ("[".repeat(depth), "]".repeat(depth));
    let files = [
        ("groups.scn", format!("{}{}", begin.repeat(depth), "end\n".repeat(depth)).into_bytes()),
        ("open.scn", begin.repeat(depth).into_bytes()),
        ("nodes.gltf", gltf(&nodes.join(",")).into_bytes()),
        (
            "array.gltf",
            format!("{{\"asset\": {{\"version\": \"2.0\", \"extras\": {open}{close}}}}}")
                .into_bytes(),
        ),
        ("array.json", format!("{{\"name\": {open}{close}}}").into_bytes()),
        ("open.json", open.clone().into_bytes()),
    ];
    let folder = folder_with(&files);
    for (name, _) in files {
        assert_eq!(survive_scene(folder.path(), name), [false; 3], "{name}");
    }
}

#[test]
fn as_deep_as_allowed_is_rendered() {
    let begin = "begin -1 1 0 0 0.001 0 1 0 0 0 0 1 0 0 0 0 1\n";
    let material = "material .1 .1 .1 .5 .5 .5 0 0 0 0 0 0 0 0 0 1 1 0\n";
    let groups =
        format!("{material}{}sphere 0 0 0 0 1\n{}", begin.repeat(500), "end\n".repeat(500));
    let mut files: Vec<(String, Vec<u8>)> = vec![("groups.scn".into(), groups.into_bytes())];
    for i in 0..500 {
        let content = if i == 499 {
            format!("{material}sphere 0 0 0 0 1\n")
        } else {
            format!("include i{}.scn\n", i + 1)
        };
        files.push((format!("i{i}.scn"), content.into_bytes()));
    }
    let files: Vec<_> = files.iter().map(|(n, c)| (n.as_str(), c.clone())).collect();
    let folder = folder_with(&files);
    for name in ["groups.scn", "i0.scn"] {
        assert_eq!(survive_scene(folder.path(), name), [true; 3], "{name}");
    }
}

#[test]
fn files_that_name_files_without_end_are_refused() {
    let mut files = vec![("self.scn".to_string(), "include self.scn\n".to_string())];
    files.push(("pair.scn".into(), "include other.scn\n".into()));
    files.push(("other.scn".into(), "include ./pair.scn\n".into()));
    // Ten files that each include the next ten times: ten billion spheres.
    for i in 0..10 {
        files.push((format!("laugh{i}.scn"), format!("include laugh{}.scn\n", i + 1).repeat(10)));
    }
    let mut last = String::from("material .1 .1 .1 .5 .5 .5 0 0 0 0 0 0 0 0 0 1 1 0\n");
    for _ in 0..10 {
        writeln!(last, "sphere 0 0 0 0 1").expect("text grows");
    }
    files.push(("laugh10.scn".into(), last));
    let bytes: Vec<_> = files.iter().map(|(n, c)| (n.as_str(), c.clone().into_bytes())).collect();
    let folder = folder_with(&bytes);
    for name in ["self.scn", "pair.scn", "laugh0.scn"] {
        assert_eq!(survive_scene(folder.path(), name), [false; 3], "{name}");
    }
}

#[test]
fn many_different_warnings_are_no_flood() {
    let nodes: Vec<_> = (1..=50_000)
        .map(|i| format!("{{\"name\": \"n{i}\", \"scale\": [0, 1, 1], \"mesh\": 0}}"))
        .collect();
    let children: Vec<_> = (1..=50_000).map(|i| i.to_string()).collect();
    let gltf = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{"children": [{}]}}, {}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
        "accessors": [{{"componentType": 5126, "type": "VEC3", "count": 3}}]}}"#,
        children.join(","),
        nodes.join(",")
    );
    let folder = folder_with(&[("a.gltf", gltf.into_bytes())]);
    let output = survive(folder.path(), "render a.gltf --size 8x8 --spp 1 -t 1");
    let lines = output.messages.lines().count();
    assert!(output.code == Some(0) && lines < 2000, "{lines} lines");
}
