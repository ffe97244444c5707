//! Tests of the conversion of files.

mod content;
mod messages;

use super::*;
use crate::scene::testing::{self, data, meshes, read_text, summary};

/// A scene around some elements.
fn scene_of(text: &str) -> Scene {
    let text = format!("<scene version=\"3.0.0\">\n{text}\n</scene>");
    read_text(&READER, &text).unwrap_or_else(|e| panic!("{e}"))
}

/// The scene around some elements, which must give no warning.
fn clean(text: &str) -> Scene {
    let scene = scene_of(text);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    scene
}

fn warnings(text: &str) -> String {
    scene_of(text).warnings.iter().map(|w| format!("{} ({}x)\n", w.message, w.count)).collect()
}
