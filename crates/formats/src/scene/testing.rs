//! Shared helpers for the tests of scene readers.

use crate::{Input, ReadError, ReadOptions, SceneReader};
use snell_intersect::TriangleMesh;
use snell_scene::{Geometry, Scene};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Reads text as a file called `test` in the current folder.
pub fn read_text(reader: &SceneReader, text: &str) -> Result<Scene, ReadError> {
    read_in(reader, Path::new("."), text)
}

/// Reads text as a file called `test` in a folder.
pub fn read_in(reader: &SceneReader, folder: &Path, text: &str) -> Result<Scene, ReadError> {
    let options = ReadOptions { confine: true, ..ReadOptions::default() };
    let input = Input::from_bytes("test", text.as_bytes().to_vec(), folder, &options);
    (reader.read)(&input)
}

/// The error message for a text that must be refused.
pub fn error_of(reader: &SceneReader, text: &str) -> String {
    read_text(reader, text).expect_err("the text is broken").to_string()
}

/// A folder of public scenes, if it exists on this machine.
pub fn data(folder: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")).join(folder);
    if !path.is_dir() {
        eprintln!("skipped: there is no {}", path.display());
        return None;
    }
    Some(path)
}

/// The files of a folder with this extension, by name.
pub fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("the folder can be listed");
    let mut files: Vec<_> = entries.map(|e| e.expect("an entry").path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == extension));
    files.sort();
    files
}

/// All geometries of a scene in the order of the graph.
pub fn geometries(scene: &Scene) -> Vec<Geometry> {
    let order = scene.topological_order().expect("a graph without cycles");
    order
        .iter()
        .flat_map(|n| scene.nodes[n.index()].surfaces.iter().map(|s| s.geometry.clone()))
        .collect()
}

/// All meshes of a scene.
pub fn meshes(scene: &Scene) -> Vec<Arc<TriangleMesh>> {
    let mesh = |g| if let Geometry::Mesh(mesh) = g { Some(mesh) } else { None };
    geometries(scene).into_iter().filter_map(mesh).collect()
}

/// A one-line summary of a scene's contents.
pub fn summary(scene: &Scene) -> String {
    use snell_scene::Background;
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for geometry in geometries(scene) {
        match geometry {
            Geometry::Shape(shape) => *counts.entry(shape.name().to_string()).or_default() += 1,
            Geometry::Curves(curves) => {
                *counts.entry("strand".into()).or_default() += curves.strands().len()
            }
            Geometry::Mesh(mesh) => {
                *counts.entry("mesh".into()).or_default() += 1;
                *counts.entry("triangle".into()).or_default() += mesh.indices.len();
            }
        }
    }
    let mut parts: Vec<String> =
        counts.into_iter().map(|(name, n)| format!("{n} {name}")).collect();
    parts.push(format!("{} material", scene.materials.len()));
    let lights: Vec<_> = scene.lights.iter().map(|l| l.name()).collect();
    parts.push(format!("lights [{}]", lights.join(" ")));
    parts.push(format!("{} camera", scene.cameras.len()));
    if let Background::Color(color) = scene.background {
        parts.push(format!("background {} {} {}", color.r, color.g, color.b));
    }
    parts.extend(scene.warnings.iter().map(|w| format!("{}x \"{}\"", w.count, w.message)));
    parts.join(", ")
}

/// Reads thousands of broken versions of a text: truncated, with changed bytes, with words swapped
/// or repeated. A panic fails the calling test.
pub fn read_broken_versions(reader: &SceneReader, seed: &[u8], folder: &Path) {
    let read =
        |bytes: Vec<u8>| {
            let input = Input::from_bytes("broken", bytes, folder, &ReadOptions::default());
            if let Ok(scene) = (reader.read)(&input) {
                assert!(scene.bounds().is_ok());
                assert!(scene.cameras.iter().all(|c| c.eye.is_finite()
                    && c.towards.is_normalized()
                    && c.up.is_normalized()));
                assert!(meshes(&scene).iter().all(|m| m.validate().is_ok()));
            }
        };
    for length in 0..seed.len() {
        read(seed[..length].to_vec());
    }
    // A linear congruential generator (Knuth's MMIX constants): the same versions at each run.
    let mut state = 1u64;
    let mut random = |n: usize| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as usize % n
    };
    for _ in 0..10_000 {
        let mut bytes = seed.to_vec();
        for _ in 0..=random(3) {
            let at = random(bytes.len());
            let end = (at + random(30)).min(bytes.len());
            let to = random(bytes.len());
            match random(4) {
                0 => bytes[at] = random(256) as u8,
                1 => bytes[at] = b" -.09#\n\"{[\xff"[random(11)],
                2 if end - at < bytes.len() => drop(bytes.drain(at..end)),
                _ => {
                    let piece = bytes[at..end].to_vec();
                    bytes.splice(to..to, piece);
                }
            }
        }
        read(bytes);
    }
}
