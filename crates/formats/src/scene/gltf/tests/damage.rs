//! Damaged files yield a scene or an error. This is the third line of defence, after checked
//! arithmetic and the tests of messages.

use super::{assert_sound, data};
use crate::{ReadOptions, read_scene_bytes};
use std::path::Path;

/// Small files of different kinds, with embedded images and buffers.
const SEEDS: &[&str] = &[
    "gltf-transform/Box_glTF-Binary/Box.glb",
    "gltf-transform/Box_glTF-Embedded/Box.gltf",
    "gltf-rs/box_sparse.glb",
    "magnum-valid/mesh-embedded.gltf",
    "magnum-valid/skin-embedded.gltf",
    "magnum-valid/light.gltf",
    "magnum-valid/camera.gltf",
    "magnum-valid/material-metallicroughness.gltf",
];

/// A deterministic sequence of numbers (splitmix64).
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Reads damaged bytes; true if they still make a scene.
fn survives(bytes: Vec<u8>, folder: &Path) -> bool {
    let options = ReadOptions::default();
    match read_scene_bytes("damaged.glb", bytes, folder, &options) {
        Ok(scene) => {
            assert_sound(&scene, folder);
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    }
}

#[test]
fn damaged_files_never_panic() {
    let Some(folder) = data("gltf") else { return };
    let mut state = 1;
    let (mut read, mut refused) = (0, 0);
    for seed in SEEDS {
        let bytes = std::fs::read(folder.join(seed)).expect("the file is in the collection");
        for round in 0..400 {
            let mut damaged = bytes.clone();
            let mut at = || next(&mut state) as usize;
            for _ in 0..=round % 4 {
                let (place, value) = (at() % bytes.len(), at());
                // Changing digits keeps the JSON valid and reaches deeper than random bytes.
                damaged[place] = match damaged[place] {
                    b'0'..=b'9' => b'0' + (value % 10) as u8,
                    old => old ^ (1 << (value % 8)),
                };
            }
            if round % 8 == 7 {
                damaged.truncate(at() % bytes.len());
            }
            if survives(damaged, &folder) { read += 1 } else { refused += 1 }
        }
    }
    assert!(
        read > 100 && refused > 100,
        "the damage should do something, but not everything: {read} {refused}"
    );
}

#[test]
fn every_truncation_of_a_small_file_is_refused() {
    let Some(folder) = data("gltf") else { return };
    let bytes = std::fs::read(folder.join(SEEDS[0])).expect("the file is in the collection");
    for length in 0..bytes.len() {
        assert!(!survives(bytes[..length].to_vec(), &folder), "{length} of {} bytes", bytes.len());
    }
}

#[test]
fn a_short_file_cannot_ask_for_many_vertices() {
    let primitive = r#"{"attributes": {"POSITION": 0}}"#;
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "accessors": [{{"componentType": 5126, "type": "VEC3", "count": 4194304}}],
        "nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{}]}}]}}"#,
        vec![primitive; 1000].join(",")
    );
    let error = super::read_text(&json).expect_err("4 billion vertices");
    assert!(error.problem.contains("too many"), "{error}");
}
