//! Tests which modules of this crate use which. The modules of light transport ("rooms") are
//! ordered in [`ROOMS`].

use std::path::{Path, PathBuf};

/// The modules of light transport. Each may use those in its own line and in the lines before.
const ROOMS: [&[&str]; 5] = [
    &["compile", "guiding", "lanes", "light_sampler", "sampler"],
    &["integrator"],
    &["volume"],
    &["batch"],
    &["job"],
];

/// All Rust files of a module: those in its folder, or the file of its name.
fn files(room: &str) -> Vec<PathBuf> {
    fn add(folder: &Path, files: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("the folder is readable") {
            let path = entry.expect("the folder is readable").path();
            match path.is_dir() {
                true => add(&path, files),
                false => files.push(path),
            }
        }
    }
    let (source, mut files) = (Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), Vec::new());
    match source.join(room) {
        folder if folder.is_dir() => add(&folder, &mut files),
        file => files.push(file.with_extension("rs")),
    }
    files
}

/// The text of a file that is compiled outside of tests, without comments.
fn code(file: &Path) -> String {
    let text = std::fs::read_to_string(file).expect("the file is readable");
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

#[test]
fn no_room_uses_one_that_comes_later() {
    let is_test = |file: &PathBuf| {
        file.components().any(|part| {
            ["tests", "tests.rs", "twins.rs"].iter().any(|name| part.as_os_str() == *name)
        })
    };
    for (line, rooms) in ROOMS.iter().enumerate() {
        for file in rooms.iter().flat_map(|room| files(room)).filter(|file| !is_test(file)) {
            let code = code(&file);
            for later in ROOMS[line + 1..].iter().copied().flatten() {
                let path = format!("crate::{later}::");
                let item = format!("crate::{later};");
                assert!(
                    !code.contains(&path) && !code.contains(&item),
                    "{} uses {later}, which is built on it",
                    file.display()
                );
            }
        }
    }
}
