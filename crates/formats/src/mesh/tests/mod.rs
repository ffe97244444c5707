//! Real and broken files: requirements on every reader.

mod content;
mod digits;
mod found;
mod materials;
mod messages;
mod mutation;
mod strokes;

use super::*;
use crate::{ReadOptions, SCENE_READERS, read_scene_bytes};
use std::path::{Path, PathBuf};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
const MESHES: [&str; 5] = ["ply", "off", "stl", "ray", "obj"];

fn read(name: &str, content: impl Into<Vec<u8>>) -> Result<Scene, ReadError> {
    let options = ReadOptions { confine: true, ..ReadOptions::default() };
    read_scene_bytes(name, content.into(), Path::new("/nonexistent"), &options)
}

/// All mesh files below a folder, or none if the folder is absent.
fn files_below(folder: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![Path::new(DATA).join(folder)];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else {
            eprintln!("skipped: {} is absent", folder.display());
            continue;
        };
        for path in entries.flatten().map(|e| e.path()) {
            let extension =
                path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
            if path.is_dir() {
                folders.push(path);
            } else if MESHES.contains(&extension.as_str()) {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

fn meshes(scene: &Scene) -> Vec<&TriangleMesh> {
    let surfaces = scene.nodes.iter().flat_map(|n| &n.surfaces);
    surfaces
        .filter_map(|s| match &s.geometry {
            Geometry::Mesh(mesh) => Some(&**mesh),
            Geometry::Curves(_) => None,
            Geometry::Shape(_) => panic!("mesh files have no shapes"),
        })
        .collect()
}

/// The points and lines of a scene.
fn strokes(scene: &Scene) -> Vec<&Curves> {
    let surfaces = scene.nodes.iter().flat_map(|n| &n.surfaces);
    surfaces
        .filter_map(|s| match &s.geometry {
            Geometry::Curves(curves) => Some(&**curves),
            _ => None,
        })
        .collect()
}

fn triangles(scene: &Scene) -> usize {
    meshes(scene).iter().map(|m| m.indices.len()).sum()
}

fn check(scene: &Scene, what: &str) {
    scene.topological_order().expect(what);
    for mesh in meshes(scene) {
        mesh.validate().expect(what);
        assert!(
            mesh.normals.iter().all(|n| n.is_finite() && *n != Vec3::ZERO),
            "{what}: a normal without direction"
        );
        assert!(
            mesh.colors.iter().flatten().all(|c| c.is_finite()),
            "{what}: a colour that is not finite"
        );
    }
    let shown = triangles(scene) > 0 || !strokes(scene).is_empty();
    assert_eq!(shown, !scene.warnings.iter().any(|w| w.message.contains("no triangles")), "{what}");
}

#[test]
fn every_good_file_of_the_collection_is_read() {
    let folders = ["meshes", "other-formats", "bitterli", "pbrt", "scn", "minray"];
    for path in folders.into_iter().flat_map(files_below) {
        let what = path.display().to_string();
        // The element face has been lost from this file's header.
        if what.ends_with("issue623.ply") {
            continue;
        }
        let scene =
            crate::read_scene(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        check(&scene, &what);
        let input = Input::open(&path, &ReadOptions::default()).expect("it was read a moment ago");
        let mesh = read_mesh(&input).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(mesh.indices.len(), triangles(&scene), "{what}");
        eprintln!("{what}: {} triangles, {:?}", triangles(&scene), scene.warnings);
    }
}

#[test]
fn every_broken_file_of_the_collection_is_an_error_or_a_scene() {
    for folder in ["malformed/assimp", "malformed/ply-magnum", "malformed/stl-magnum"] {
        for path in files_below(folder) {
            match crate::read_scene(&path, &ReadOptions::default()) {
                Ok(scene) => {
                    check(&scene, &path.display().to_string());
                    eprintln!(
                        "{}: {} triangles, {:?}",
                        path.display(),
                        triangles(&scene),
                        scene.warnings
                    );
                }
                Err(error) => {
                    assert!(!error.problem.is_empty() && !error.remedy.is_empty(), "{error}");
                    eprintln!("{error}");
                }
            }
        }
    }
}
