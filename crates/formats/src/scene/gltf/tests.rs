//! Whole files: the collection, numbers in known files, messages, damaged files.

use crate::{ReadOptions, read_scene, read_scene_bytes};
use std::path::{Path, PathBuf};

fn data(folder: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(folder);
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return None;
    }
    Some(path)
}

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

#[test]
fn every_file_of_the_collection_loads_unless_it_requires_what_is_not_supported() {
    let Some(folder) = data("gltf") else { return };
    let mut failures = Vec::new();
    for file in files(&folder) {
        let result = read_scene(&file, &ReadOptions::default());
        if std::env::var("SHOW").is_ok() {
            match &result {
                Ok(s) => eprintln!("{}: ok {:?}", file.display(), s.warnings),
                Err(e) => eprintln!("{}: ERR {e}", file.display()),
            }
        }
        match result {
            Ok(scene) => assert!(scene.topological_order().is_ok()),
            Err(error) if file.to_string_lossy().contains("requires-unsupported") => {
                assert!(error.problem.contains("KHR_"), "{error}")
            }
            Err(error) => failures.push(error.to_string()),
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}
#[test]
fn mal() {
    for f in ["gltf-validator", "gltf-magnum", "gltf-rs", "gltf-assimp"] {
        let Some(folder) = data("malformed") else { return };
        for file in files(&folder.join(f)) {
            match read_scene(&file, &ReadOptions::default()) {
                Ok(s) => {
                    println!("{}: ok {:?}", file.display(), s.warnings.iter().map(|w| &w.message).collect::<Vec<_>>())
                }
                Err(e) => println!("ERR {e}"),
            }
        }
    }
}
