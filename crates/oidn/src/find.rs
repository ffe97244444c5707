//! Locates the shared library.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Files to try, the best first. For a file, that file; for a folder, the library in it or in its
/// subfolders; otherwise that of the active Python or conda environment, and names that the
/// system's loader searches.
pub fn candidates(named: Option<&Path>) -> Vec<PathBuf> {
    match named {
        None => {
            let by_loader = [
                "libOpenImageDenoise.so.2",
                "libOpenImageDenoise.so",
                "libOpenImageDenoise.dylib",
                "OpenImageDenoise.dll",
            ];
            let active = of_environment(|name| std::env::var_os(name));
            active.into_iter().chain(by_loader.map(PathBuf::from)).collect()
        }
        Some(folder) if folder.is_dir() => in_folder(folder).into_iter().collect(),
        Some(file) => file.is_file().then(|| file.to_path_buf()).into_iter().collect(),
    }
}

/// The libraries of the package `pyoidn` in an active virtual environment, and of an active conda
/// environment, by what their variables say.
fn of_environment(variable: impl Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for root in ["VIRTUAL_ENV", "CONDA_PREFIX"].into_iter().filter_map(&variable) {
        let root = Path::new(&root);
        let versions = std::fs::read_dir(root.join("lib")).into_iter().flatten().flatten();
        let mut pythons: Vec<_> = versions.map(|entry| entry.path()).collect();
        pythons.retain(|path| {
            path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"python"))
        });
        pythons.sort();
        // Windows has no folder for each version.
        pythons.push(root.join("Lib"));
        let packages = pythons.iter().map(|python| python.join("site-packages/pyoidn"));
        found.extend(packages.filter_map(|package| in_folder(&package)));
        let own = ["lib/libOpenImageDenoise.so.2", "lib/libOpenImageDenoise.dylib"];
        found.extend(own.map(|name| root.join(name)).into_iter().filter(|path| path.is_file()));
    }
    found
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
    fn an_active_environment_has_it_first() {
        let root = tempfile::tempdir().expect("a temporary folder");
        let file =
            root.path().join("lib/python3.12/site-packages/pyoidn/lib/libOpenImageDenoise.so.2");
        std::fs::create_dir_all(file.parent().expect("it has one")).expect("it is writable");
        std::fs::write(&file, "").expect("it is writable");
        let active = |name: &str| (name == "VIRTUAL_ENV").then(|| root.path().into());
        assert_eq!(of_environment(active), [file]);
        assert!(of_environment(|_| None).is_empty());
    }

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
