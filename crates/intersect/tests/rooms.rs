//! Tests which rooms of the sources use which others, against the rules in ARCHITECTURE.md.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Each room of `src/` and the rooms that it may use, all of them earlier ones.
const ROOMS: [(&str, &str); 15] = [
    ("morton", ""),
    ("prefetch", ""),
    ("mesh", ""),
    ("shape", "mesh"),
    ("hit", "mesh"),
    ("geometry", "prefetch shape mesh hit"),
    ("precision", "prefetch mesh hit geometry"),
    ("search", "prefetch hit precision"),
    ("exact", "mesh hit precision search"),
    ("group", "shape mesh geometry precision search exact"),
    ("tree", "shape group exact"),
    ("build", "morton prefetch mesh exact group tree"),
    ("lecture", "precision search exact group"),
    ("kernel", "prefetch hit precision search exact group tree"),
    ("world", "shape mesh hit geometry precision search exact group tree build lecture"),
];

/// The last room, which uses all others.
const LAST: &str = "query";

#[test]
fn no_room_uses_one_that_it_may_not() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut earlier = BTreeSet::new();
    for (room, may_use) in ROOMS {
        let may_use: BTreeSet<&str> = may_use.split_whitespace().collect();
        assert!(may_use.is_subset(&earlier), "{room} may only use rooms above it");
        earlier.insert(room);
        let files = sources(&src, room);
        assert!(!files.is_empty(), "there is no room {room}");
        for file in files {
            let code = code_of(&file);
            let out_of_room = "super::".repeat(depth(&src, &file));
            assert!(!code.contains(&out_of_room), "{}: `{out_of_room}`", file.display());
            for used in used_rooms(&code) {
                assert!(
                    used == room || may_use.contains(used.as_str()),
                    "{} uses `{used}`, which `{room}` may not",
                    file.display()
                );
            }
        }
    }
    earlier.extend([LAST, "lib"]);
    let folder = std::fs::read_dir(&src).expect("the sources");
    let found = folder.map(|entry| entry.expect("an entry").path());
    let found: BTreeSet<_> = found
        .map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned())
        .collect();
    let known: BTreeSet<_> = earlier.into_iter().map(String::from).collect();
    assert_eq!(found, known, "a room that is not in the table");
}

/// The files of a room except its tests, which may use the whole crate.
fn sources(src: &Path, room: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut left = vec![src.join(room), src.join(format!("{room}.rs"))];
    while let Some(path) = left.pop() {
        let name = path.file_stem().unwrap_or_default();
        if name == "tests" {
        } else if let Ok(entries) = std::fs::read_dir(&path) {
            left.extend(entries.map(|entry| entry.expect("an entry").path()));
        } else if path.extension().is_some_and(|e| e == "rs") && path.exists() {
            files.push(path);
        }
    }
    files
}

/// The nesting depth of the module in a file, itself included.
fn depth(src: &Path, file: &Path) -> usize {
    let within = file.strip_prefix(src).expect("within").components().count();
    if file.ends_with("mod.rs") { within - 1 } else { within }
}

/// The code of a file, without comments and the tests at its end.
fn code_of(file: &Path) -> String {
    let text = std::fs::read_to_string(file).expect("a source");
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    code.collect::<Vec<_>>().join("\n")
}

/// The rooms that code names as `crate::room`.
fn used_rooms(code: &str) -> impl Iterator<Item = String> {
    let is_of_name = |c: &char| c.is_alphanumeric() || *c == '_';
    code.split("crate::").skip(1).map(move |path| path.chars().take_while(is_of_name).collect())
}
