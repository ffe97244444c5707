//! Whole files: the shared collection, numbers in known files, messages, damaged files.

mod compression;
mod damage;
mod loaders;
mod message;
mod motion;
mod numbers;
mod pointer;
mod version1;

use crate::{ReadError, ReadOptions, read_scene, read_scene_bytes};
use serde_json::Value;
use snell_intersect::TriangleMesh;
use snell_scene::{Geometry, Scene};
use std::path::{Path, PathBuf};

/// A folder of the shared collection; prints a line and returns `None` if it is absent.
fn data(folder: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(folder);
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return None;
    }
    Some(path)
}

/// All glTF files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("the folder is readable").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

fn open(path: &Path) -> Result<Scene, ReadError> {
    read_scene(path, &ReadOptions::default())
}

/// Reads a scene from JSON text.
fn read_text(json: &str) -> Result<Scene, ReadError> {
    let options = ReadOptions { confine: true, ..ReadOptions::default() };
    read_scene_bytes("test.gltf", json.as_bytes().to_vec(), Path::new("."), &options)
}

/// All meshes of the scene's nodes, in the order of the nodes.
fn meshes(scene: &Scene) -> Vec<&TriangleMesh> {
    let surfaces = scene.nodes.iter().flat_map(|n| &n.surfaces);
    surfaces
        .filter_map(|surface| match &surface.geometry {
            Geometry::Mesh(mesh) => Some(mesh.as_ref()),
            Geometry::Shape(_) | Geometry::Curves(_) => None,
        })
        .collect()
}

/// Checks that hold for every scene that a reader returns.
fn assert_sound(scene: &Scene, file: &Path) {
    assert!(scene.topological_order().is_ok(), "{}", file.display());
    for mesh in meshes(scene) {
        assert_eq!(mesh.validate(), Ok(()), "{}", file.display());
        assert!(
            mesh.normals.iter().all(|n| n.is_finite() && n.length() > 0.0),
            "{}",
            file.display()
        );
    }
    for texture in &scene.textures {
        assert!(
            texture.as_image().expect("an image").image.index() < scene.images.len(),
            "{}",
            file.display()
        );
    }
}

#[test]
fn every_file_of_the_collection_loads() {
    let Some(folder) = data("gltf") else { return };
    for file in files(&folder) {
        let scene = open(&file).unwrap_or_else(|error| panic!("{error}"));
        assert_sound(&scene, &file);
        let requires_techniques = file.to_string_lossy().contains("box-techniques-webgl");
        let warns = scene.warnings.iter().any(|w| w.message.contains("KHR_techniques_webgl"));
        assert_eq!(warns, requires_techniques, "{}", file.display());
    }
}

/// Codes of the glTF validator for faults that affect the picture.
const SERIOUS: &[&str] = &[
    "ACCESSOR_SMALL_BYTESTRIDE",
    "ACCESSOR_SPARSE_COUNT_OUT_OF_RANGE",
    "GLB_EMPTY_CHUNK",
    "GLB_INVALID_MAGIC",
    "GLB_INVALID_VERSION",
    "GLB_LENGTH_MISMATCH",
    "GLB_UNEXPECTED_END_OF_CHUNK_DATA",
    "INVALID_IBM_ACCESSOR_COUNT",
    "INVALID_JSON",
    "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT",
    "MESH_PRIMITIVE_INDICES_ACCESSOR_INVALID_FORMAT",
    "MESH_PRIMITIVE_UNEQUAL_ACCESSOR_COUNT",
    "SKIN_IBM_INVALID_FORMAT",
    "UNKNOWN_ASSET_MAJOR_VERSION",
    "UNRESOLVED_REFERENCE",
];

/// Codes and pointers of the errors (severity 0), or of the errors and warnings (1), in the
/// validator's report on a file.
fn reported(file: &Path, severity: u64) -> Vec<(String, String)> {
    let report =
        std::fs::read(format!("{}.report.json", file.display())).expect("each file has its report");
    let report: Value = serde_json::from_slice(&report).expect("reports are JSON");
    let messages = report["issues"]["messages"].as_array().cloned().unwrap_or_default();
    let errors = messages.iter().filter(|m| m["severity"].as_u64().is_some_and(|s| s <= severity));
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    errors.map(|m| (text(&m["code"]), text(&m["pointer"]))).collect()
}

#[test]
fn what_the_validator_finds_serious_is_refused_and_valid_files_load() {
    let Some(folder) = data("malformed/gltf-validator") else { return };
    for file in files(&folder) {
        let errors = reported(&file, 0);
        let is_serious = |(code, pointer): &(String, String)| {
            // The validator knows no glTF 1.0.
            let is_1 = file.ends_with("1_0_version.gltf");
            SERIOUS.contains(&code.as_str()) && !pointer.starts_with("/animations") && !is_1
        };
        match open(&file) {
            Ok(scene) => {
                assert_sound(&scene, &file);
                assert!(
                    !errors.iter().any(is_serious),
                    "{} should be refused: {errors:?}",
                    file.display()
                );
            }
            // A file may declare that it needs a newer reader.
            Err(error) if error.problem.contains("needs a reader") => {}
            Err(error) => assert!(!reported(&file, 1).is_empty(), "{error}"),
        }
    }
}

#[test]
fn odd_files_of_other_readers_end_in_a_scene_or_an_error() {
    for folder in ["gltf-magnum", "gltf-rs", "gltf-assimp"] {
        let Some(folder) = data(&format!("malformed/{folder}")) else { return };
        for file in files(&folder) {
            match open(&file) {
                Ok(scene) => assert_sound(&scene, &file),
                Err(error) => assert!(!error.problem.is_empty()),
            }
        }
    }
}

#[test]
fn contents_are_recognised_without_an_extension() {
    let recognises = super::READER.recognises;
    assert!(recognises(b"glTF\x02\0\0\0"));
    assert!(recognises(b"\xef\xbb\xbf {\"nodes\": [], \"asset\" : {\"version\": \"2.0\"}}"));
    let long =
        format!("{{\"nodes\": [{}], \"asset\": {{\"version\": \"2.0\"}}}}", " ".repeat(100_000));
    assert!(recognises(long.as_bytes()));
    for other in [
        &b""[..],
        b"{",
        b"{\"assets\": 1}",
        b"{\"asset\": \"version\"",
        b"ply\nformat",
        b"[\"asset\"]",
    ] {
        assert!(!recognises(other) || other.starts_with(b"{\"asset\":"), "{other:?}");
    }
}
