//! Files that once broke a promise, in `found/`, and small files of the same kinds. None may break
//! a promise.

use super::promise::Case;
use std::collections::BTreeMap;
use std::path::Path;

/// The commands for a scene.
const SCENE: [&str; 7] = [
    "render FILE --size 8x6 --spp 1 -t 1 -q -o out.pfm",
    "render FILE --size 8x6 --spp 1 -t 1 -q -i whitted -o out.pfm",
    "info FILE --json",
    "doctor FILE",
    "explain FILE --pixel 4,3 -- --size 8x6 --spp 1",
    "convert FILE out.snell --force",
    "convert FILE out.glb",
];
/// The commands for a picture.
const PICTURE: [&str; 2] = [
    "render minray --environment FILE --size 8x6 --spp 1 -t 1 -q -o out.pfm",
    "compare FILE FILE --json",
];

#[test]
fn what_once_broke_a_promise_does_not_any_more() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hostile/found");
    let named =
        |path: &Path| path.file_name().expect("it is a file").to_string_lossy().into_owned();
    let paths = std::fs::read_dir(folder)
        .expect("the folder is there")
        .map(|e| e.expect("an entry").path());
    let read = |path: &Path| (named(path), std::fs::read(path).expect("the file is readable"));
    let files: BTreeMap<_, _> = paths.map(|path| read(&path)).collect();
    let scratch = tempfile::TempDir::new().expect("temporary folders can be made");
    let mut faults = Vec::new();
    for name in files.keys() {
        let is_picture = snell_formats::image::IMAGE_FORMATS
            .iter()
            .any(|f| f.extensions.iter().any(|e| name.ends_with(e)));
        for line in if is_picture { &PICTURE[..] } else { &SCENE } {
            let case = Case::new(files.clone(), name, line);
            if let Err(fault) = case.try_in(Path::new(env!("CARGO_BIN_EXE_snell")), scratch.path())
            {
                faults.push(format!("{name}: {line}: {fault}"));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}
