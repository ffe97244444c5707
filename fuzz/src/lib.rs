//! What every target for a reader does with its bytes.

use snell_formats::{Limits, Place, ReadOptions, read_scene_bytes};
use std::path::Path;

/// What the errors of a format say about their place.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Places {
    /// A line, a byte or a path into JSON, always.
    Always,
    /// Sometimes it is the file as a whole that is wrong.
    Mostly,
}

/// Reads bytes under the name of a file and asserts that they end in a scene without cycles or in an error that says where, what and
/// what to do.
pub fn read(name: &str, bytes: Vec<u8>, places: Places) {
    // Small limits: what is slow because it is large is no finding.
    let limits = Limits { file_bytes: 1 << 20, elements: 20_000, image_pixels: 1 << 16, depth: 32, files: 4 };
    let options = ReadOptions { limits, ..ReadOptions::default() };
    match read_scene_bytes(name, bytes, Path::new("/nonexistent"), &options) {
        Ok(scene) => assert!(scene.topological_order().is_ok()),
        Err(error) => {
            assert!(!error.problem.is_empty() && !error.remedy.is_empty(), "{error}");
            assert!(places == Places::Mostly || error.place != Place::Whole, "{error}");
        }
    }
}

/// The target `fuzz_target!` of a reader: the name of the file says the format, and `before` and `after` stand around the bytes, so
/// that they are always taken for it; not around whole files, which hold what `before` says themselves.
#[macro_export]
macro_rules! reader_target {
    ($name:literal, $places:ident, $before:literal, $after:literal) => {
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
            let start = $before.trim_ascii_end();
            let is_whole = !start.is_empty() && bytes.windows(start.len()).any(|part| part == start);
            let bytes = if is_whole { bytes.to_vec() } else { [&$before[..], bytes, &$after[..]].concat() };
            $crate::read($name, bytes, $crate::Places::$places);
        });
    };
}
