//! Locates the shared library.

use std::path::{Path, PathBuf};

/// Files to try, the best first. For a file, that file; for a folder, the library in it or in its
/// subfolders; otherwise names that the system's loader searches.
pub fn candidates(named: Option<&Path>) -> Vec<PathBuf> {
    match named {
        None => [
            "libOpenImageDenoise.so.2",
            "libOpenImageDenoise.so",
            "libOpenImageDenoise.dylib",
            "OpenImageDenoise.dll",
        ]
        .map(PathBuf::from)
        .to_vec(),
        Some(folder) if folder.is_dir() => in_folder(folder).into_iter().collect(),
        Some(file) => file.is_file().then(|| file.to_path_buf()).into_iter().collect(),
    }
}

/// The library in a folder or its subfolders.
fn in_folder(folder: &Path) -> Option<PathBuf> {
    let mut entries: Vec<_> = std::fs::read_dir(folder).ok()?.flatten().map(|e| e.path()).collect();
    entries.sort();
    let is_library = |p: &&PathBuf| {
        p.file_name().is_some_and(|n| is_library_name(&n.to_string_lossy())) && p.is_file()
    };
    let here = entries.iter().find(is_library);
    let is_folder = |p: &&PathBuf| p.is_dir() && !p.is_symlink();
    here.cloned().or_else(|| entries.iter().filter(is_folder).find_map(|p| in_folder(p)))
}

/// True for the name of the library itself, but not for its device modules.
fn is_library_name(name: &str) -> bool {
    let rest = name.trim_start_matches("lib").strip_prefix("OpenImageDenoise");
    rest.is_some_and(|rest| {
        rest == ".dll"
            || rest.starts_with(".so")
            || (rest.starts_with('.') && rest.ends_with(".dylib"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_known_by_its_name() {
        for name in [
            "libOpenImageDenoise.so.2",
            "libOpenImageDenoise.so.2.5.1",
            "OpenImageDenoise.dll",
            "libOpenImageDenoise.2.dylib",
        ] {
            assert!(is_library_name(name), "{name}");
        }
        for name in ["libOpenImageDenoise_core.so.2.5.1", "libtbb.so.12", "OpenImageDenoise.lib"] {
            assert!(!is_library_name(name), "{name}");
        }
    }
}
