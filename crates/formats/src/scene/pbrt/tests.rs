//! Tests of the conversion of files.

mod content;
mod files;
mod messages;
mod motion;

use super::*;
use crate::scene::testing::{self, data, meshes, read_text, summary};

fn scene(text: &str) -> Scene {
    read_text(&READER, text).unwrap_or_else(|e| panic!("{e}"))
}

/// The scene for directives in the world; they must not cause a warning.
fn world(text: &str) -> Scene {
    let scene = scene(&format!("WorldBegin\n{text}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    scene
}

fn warnings(text: &str) -> String {
    scene(text).warnings.iter().map(|w| format!("{} ({}x)\n", w.message, w.count)).collect()
}
