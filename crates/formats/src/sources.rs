//! An optional record of the files that were read and hashes of their contents.

use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// A record of files. Clones share the same record.
#[derive(Clone, Debug, Default)]
pub struct Sources(Arc<Mutex<BTreeMap<PathBuf, [u8; 32]>>>);

impl Sources {
    /// Records a file. Hashing takes about a second per gigabyte.
    pub(crate) fn add(&self, path: &Path, content: &[u8]) {
        let hash = Sha256::digest(content).into();
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_path_buf(), hash);
    }

    /// The files read so far, by name, with the SHA-256 of their content (unpacked, if it was
    /// compressed with gzip).
    pub fn list(&self) -> BTreeMap<PathBuf, [u8; 32]> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, read_scene, read_scene_bytes};

    #[test]
    fn every_file_of_a_scene_is_on_record_whatever_names_it() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let write = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).expect("it is writable")
        };
        write(
            "a.obj",
            "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n",
        );
        write("a.mtl", "newmtl m\nmap_Kd a.ppm\n");
        write("a.ppm", "P3 1 1 255 9 9 9\n");
        let read = |name: &str| {
            let options =
                ReadOptions { sources: Some(Sources::default()), ..ReadOptions::default() };
            read_scene(&folder.path().join(name), &options).expect("a scene");
            options.sources.expect("it was asked for").list()
        };
        let before = read("a.obj");
        let names: Vec<_> =
            before.keys().map(|p| p.file_name().expect("a file").to_os_string()).collect();
        assert_eq!(names, ["a.mtl", "a.obj", "a.ppm"]);
        write("a.ppm", "P3 1 1 255 9 9 8\n");
        let after = read("a.obj");
        let changed: Vec<_> = before
            .iter()
            .filter(|(path, hash)| after[*path] != **hash)
            .map(|(path, _)| path)
            .collect();
        assert_eq!(changed, [&folder.path().join("a.ppm")]);
    }

    #[test]
    fn bytes_that_are_a_scene_are_on_record_too() {
        let options = ReadOptions { sources: Some(Sources::default()), ..ReadOptions::default() };
        let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec();
        read_scene_bytes("standard input.obj", text, Path::new("."), &options).expect("a scene");
        assert_eq!(options.sources.expect("it was asked for").list().len(), 1);
    }
}
