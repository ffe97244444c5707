//! Whatever the bytes are, reading them as a Mitsuba scene ends in a scene without cycles or in an error with a place.

#![no_main]

use libfuzzer_sys::fuzz_target;
use snell_formats::{Limits, Place, ReadOptions, read_scene_bytes};
use std::path::Path;

fuzz_target!(|bytes: &[u8]| {
    // Small limits: what is slow because it is large is no finding.
    let limits = Limits { file_bytes: 1 << 20, elements: 20_000, image_pixels: 1 << 16, depth: 32, files: 4 };
    let options = ReadOptions { limits, ..ReadOptions::default() };
    // The element around it first, so that the content is always taken for Mitsuba's.
    let text = [b"<scene version=\"3.0.0\">\n", bytes, b"</scene>"].concat();
    match read_scene_bytes("fuzz.xml", text, Path::new("/nonexistent"), &options) {
        Ok(scene) => assert!(scene.topological_order().is_ok()),
        Err(error) => assert!(error.place != Place::Whole && !error.problem.is_empty() && !error.remedy.is_empty(), "{error}"),
    }
});
