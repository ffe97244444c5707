//! What every target for a reader does with its bytes.

#[cfg(feature = "render")]
pub mod saved;

use snell_formats::{Input, Limits, Place, ReadError, ReadOptions, image, read_scene_bytes};
use snell_scene::{Layer, Scene};
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Once};

/// What the errors of a format say about their place.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Places {
    /// A line, a byte or a path into JSON, always.
    Always,
    /// Sometimes it is the file as a whole that is wrong.
    Mostly,
}

/// Small limits: what is slow because it is large is no finding.
fn options() -> ReadOptions {
    let (file_bytes, elements, image_pixels) = (1 << 20, 20_000, 1 << 16);
    let limits =
        Limits { file_bytes, elements, image_pixels, depth: 32, files: 4, ..Limits::default() };
    ReadOptions { limits, ..ReadOptions::default() }
}

/// Reads bytes under the name of a file and asserts that they end in a scene without cycles or in
/// an error that says where, what and what to do. Returns the scene.
pub fn read(name: &str, bytes: Vec<u8>, places: Places) -> Option<Scene> {
    checked(read_scene_bytes(name, bytes, Path::new("/nonexistent"), &options()), places)
}

/// Reads the text of a scene that names a file with these bytes, in a folder of this process.
pub fn read_beside(main: &str, text: &str, name: &str, bytes: &[u8]) {
    static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
        let memory = Path::new("/dev/shm");
        let parent = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let folder = parent.join(format!("snell-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("the folder of temporary files is writable");
        folder
    });
    std::fs::write(FOLDER.join(name), bytes).expect("the folder is writable");
    checked(read_scene_bytes(main, text.into(), &FOLDER, &options()), Places::Mostly);
}

fn checked(read: Result<Scene, ReadError>, places: Places) -> Option<Scene> {
    match read {
        Ok(scene) => {
            assert!(scene.topological_order().is_ok());
            Some(scene)
        }
        Err(error) => {
            assert!(!error.problem.is_empty() && !error.remedy.is_empty(), "{error}");
            assert!(places == Places::Mostly || error.place != Place::Whole, "{error}");
            None
        }
    }
}

/// Reads bytes under the name of an image and asserts that they end in finite pixels, as many as it
/// says, or in an error.
pub fn read_image(name: &str, bytes: Vec<u8>) {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        // A panic of a decoder is an error of the file, by design; one of ours is a finding.
        let abort = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !panic.location().is_some_and(|place| place.file().contains("/registry/")) {
                abort(panic);
            }
        }));
    });
    let input = Input::from_bytes(name, bytes, Path::new("/nonexistent"), &options());
    match image::read_layers(&input) {
        Ok(picture) => {
            let pixels = picture.width as usize * picture.height as usize;
            let fits = |layer: &Layer| layer.values.len() == pixels * layer.channels.len();
            assert!(pixels > 0 && picture.layers.iter().all(fits));
        }
        Err(error) => assert!(!error.problem.is_empty() && !error.remedy.is_empty(), "{error}"),
    }
    if let Ok(image) = image::read_image(&input) {
        let finite = |x: u32, y: u32| image.rgba(x, y).iter().all(|v| v.is_finite());
        assert!((0..image.height).all(|y| (0..image.width).all(|x| finite(x, y))));
    }
}

/// The target `fuzz_target!` of a reader: the name of the file says the format, and `before` and
/// `after` stand around the bytes, so that they are always taken for it; not around whole files,
/// which hold what `before` says themselves.
#[macro_export]
macro_rules! reader_target {
    ($name:literal, $places:ident, $before:literal, $after:literal) => {
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
            let start = $before.trim_ascii_end();
            let is_whole =
                !start.is_empty() && bytes.windows(start.len()).any(|part| part == start);
            let bytes =
                if is_whole { bytes.to_vec() } else { [&$before[..], bytes, &$after[..]].concat() };
            $crate::read($name, bytes, $crate::Places::$places);
        });
    };
}

/// The target `fuzz_target!` of an image format: the file begins with `start`, if the bytes do not.
#[macro_export]
macro_rules! image_target {
    ($name:literal, $start:literal) => {
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
            let bytes = if bytes.starts_with($start) {
                bytes.to_vec()
            } else {
                [&$start[..], bytes].concat()
            };
            $crate::read_image($name, bytes);
        });
    };
}
