//! Finds and loads the shared library.

use crate::abi::Functions;
use std::fs::{self, File};
use std::io;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// Errors of loading Embree. Each message ends with a remedy.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The path does not exist, or cannot be read.
    #[error(
        "{path}: cannot read: {source}; give the shared library of Embree 4 (libembree4.so.4), the \
            wheel `embreex` of PyPI \
         (`pip download embreex`), or the folder it was unpacked to"
    )]
    Read {
        /// The path that the user named.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The folder or wheel does not contain the library.
    #[error(
        "{0}: there is no libembree4 in it; give the shared library itself, or the wheel `embreex` \
            of PyPI"
    )]
    NotFound(PathBuf),
    /// The system's loader rejected the library.
    #[error(
        "{path}: cannot be loaded: {source}; it must be the shared library of Embree 4 for this \
            machine, with libtbb beside it"
    )]
    Load {
        /// The library that was loaded.
        path: PathBuf,
        /// The loader's error.
        source: libloading::Error,
    },
    /// The library is not Embree 4.
    #[error("{path}: has no function {symbol}; it must be the shared library of Embree 4")]
    Symbol {
        /// The library that was loaded.
        path: PathBuf,
        /// The missing function.
        symbol: &'static str,
    },
    /// The library was loaded, but creating a device failed with this error number.
    #[error("Embree could not make a device (error {0}); it must be made for this machine")]
    Device(i32),
}

/// The loaded library.
pub struct Embree {
    pub(crate) functions: Functions,
    /// The library. It is never unloaded, because its threads continue for a while after the last
    /// device is released.
    _library: ManuallyDrop<libloading::Library>,
    /// The folder of an unpacked wheel, removed on drop.
    _folder: Option<TempDir>,
}

impl std::fmt::Debug for Embree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Embree")
    }
}

impl Embree {
    /// Loads the shared library at `path`, which may also be the wheel `embreex` from PyPI or a
    /// folder that contains the library at any depth.
    pub fn load(path: &Path) -> Result<Arc<Self>, LoadError> {
        let read = |source| LoadError::Read { path: path.into(), source };
        let kind = fs::metadata(path).map_err(read)?;
        if !kind.is_file() && !kind.is_dir() {
            return Err(read(io::Error::new(
                io::ErrorKind::InvalidInput,
                "this is a pipe or a device, not a file",
            )));
        }
        let is_wheel = path.extension().is_some_and(|e| e == "whl" || e == "zip");
        let folder = if is_wheel { Some(unpack(path).map_err(read)?) } else { None };
        let file = match &folder {
            Some(folder) => find_library(folder.path()),
            None if kind.is_dir() => find_library(path),
            None => Some(path.to_path_buf()),
        };
        let file = file.ok_or_else(|| LoadError::NotFound(path.into()))?;
        // SAFETY: the user chooses to run this library, like any program that they name; Embree's
        // initialisers have no preconditions.
        let library = unsafe { libloading::Library::new(&file) };
        let library = library.map_err(|source| LoadError::Load { path: file.clone(), source })?;
        // SAFETY: the user states that this is Embree 4; a library without all of its functions is
        // rejected. The functions are kept together with the library.
        let functions = unsafe { Functions::find(&library) };
        let functions = functions.map_err(|symbol| LoadError::Symbol { path: file, symbol })?;
        Ok(Arc::new(Self { functions, _library: ManuallyDrop::new(library), _folder: folder }))
    }
}

/// True for the name of the library: `libembree4.so.4`, `libembree4-4aef3270.so.4`, `embree4.dll`,
/// `libembree4.dylib`.
fn is_library_name(name: &str) -> bool {
    name.trim_start_matches("lib").starts_with("embree4")
        && [".so", ".dll", ".dylib"].iter().any(|e| name.contains(e))
}

/// Finds the library in a folder or its subfolders.
fn find_library(folder: &Path) -> Option<PathBuf> {
    let mut entries: Vec<_> = fs::read_dir(folder).ok()?.flatten().map(|e| e.path()).collect();
    entries.sort();
    let is_library = |p: &&PathBuf| {
        p.file_name().is_some_and(|n| is_library_name(&n.to_string_lossy())) && p.is_file()
    };
    let here = entries.iter().find(is_library);
    here.cloned().or_else(|| entries.iter().filter(|p| p.is_dir()).find_map(|p| find_library(p)))
}

/// Unpacks the shared libraries of a wheel. Libraries of one folder stay side by side, where the
/// loader expects them.
fn unpack(wheel: &Path) -> io::Result<TempDir> {
    let folder = TempDir::new()?;
    let mut archive = zip::ZipArchive::new(File::open(wheel)?).map_err(io::Error::other)?;
    for i in 0..archive.len() {
        let mut entry = archive.by_index(i).map_err(io::Error::other)?;
        // A name that leads out of the folder is skipped.
        let Some(name) = entry.enclosed_name() else { continue };
        let is_library = name.parent().is_some_and(|p| p.to_string_lossy().ends_with(".libs"));
        if entry.is_file() && is_library {
            let to = folder.path().join(&name);
            fs::create_dir_all(to.parent().unwrap_or(folder.path()))?;
            io::copy(&mut entry, &mut File::create(to)?)?;
        }
    }
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_embree_is_refused_with_a_remedy() {
        let folder = TempDir::new().expect("a temporary folder");
        let message = |path: &Path| Embree::load(path).expect_err("not Embree").to_string();
        assert!(
            message(&folder.path().join("none.so")).contains("give the shared library of Embree 4")
        );
        assert!(message(folder.path()).contains("there is no libembree4 in it"));
        let text = folder.path().join("libembree4.so.4");
        fs::write(&text, "no library").expect("the folder is writable");
        assert!(message(folder.path()).contains("must be the shared library of Embree 4"));
        let wheel = folder.path().join("a.whl");
        fs::write(&wheel, "no archive").expect("the folder is writable");
        assert!(message(&wheel).contains("cannot read"));
    }

    #[test]
    fn the_library_is_known_by_its_name() {
        for name in
            ["libembree4.so.4", "libembree4-4aef3270.so.4", "embree4.dll", "libembree4.4.dylib"]
        {
            assert!(is_library_name(name), "{name}");
        }
        for name in ["libtbb.so.12", "libembree3.so.3", "embree4.txt"] {
            assert!(!is_library_name(name), "{name}");
        }
    }
}
