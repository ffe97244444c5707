//! Every broken file of the collection.

use super::render;
use super::seeds::DATA;
use super::watch::Report;
use std::path::{Path, PathBuf};

/// Scene or image files below a folder of the collection, or none if it is absent.
fn files_below(folder: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![Path::new(DATA).join(folder)];
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(&folder) else {
            eprintln!("skipped: {} is absent", folder.display());
            continue;
        };
        for path in entries.flatten().map(|e| e.path()) {
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    files
}

#[test]
fn broken_scenes_end_in_pictures_or_errors() {
    let mut report = Report::default();
    for path in
        files_below("malformed").into_iter().filter(|p| !p.to_string_lossy().contains("openexr"))
    {
        let bytes = std::fs::read(&path).expect("the file is readable");
        let folder = path.parent().expect("the file is in a folder");
        let name = path.display().to_string();
        report.case(&name, || render::scene(&name, bytes, folder));
    }
    assert_eq!(report.conclude("broken scenes"), [""; 0]);
}

#[test]
fn broken_images_end_in_pictures_or_errors() {
    let mut report = Report::default();
    let files = ["malformed/openexr-damaged", "images"].into_iter().flat_map(files_below);
    for path in files {
        let bytes = std::fs::read(&path).expect("the file is readable");
        let name = path.display().to_string();
        report.case(&name, || render::environment(&name, bytes, Path::new(".")));
    }
    assert_eq!(report.conclude("broken images"), [""; 0]);
}
