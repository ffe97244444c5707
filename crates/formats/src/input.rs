//! The bytes of a file, and the way to the files it names.

use crate::ReadOptions;
use crate::error::{Place, ReadError};
use crate::expansion::{Compression, Expansion, unpack};
use crate::json_place::line_and_column;
use crate::limits::Limits;
use crate::open::{self, NamedBy};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// A file being read.
#[derive(Clone, Debug)]
pub struct Input {
    /// As the user or the naming file wrote it: for messages.
    pub name: String,
    /// The content, unpacked if it was compressed with gzip.
    pub bytes: Vec<u8>,
    /// Where relative names start.
    pub directory: PathBuf,
    /// No file outside of this folder is opened, unless allowed.
    pub root: PathBuf,
    /// How to read.
    pub options: ReadOptions,
    /// What the files of the scene have become in memory.
    pub(crate) expansion: Arc<Expansion>,
}

impl Input {
    /// Opens a file named by the user. Its folder becomes the root for files that it names; that of
    /// a pipe is the current one.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let name = path.display().to_string();
        let bytes = read_limited(path, &name, NamedBy::User, &options.limits)?;
        options.record(path, &bytes);
        let folder =
            path.parent().filter(|p| !p.as_os_str().is_empty() && !open::is_own_descriptor(path));
        let directory = folder.unwrap_or(Path::new(".")).to_path_buf();
        let expansion = Arc::new(Expansion::default());
        expansion.open(path);
        let input = Self {
            name,
            bytes,
            root: directory.clone(),
            directory,
            options: options.clone(),
            expansion,
        };
        input.charge(input.bytes.len() as u64, "its content")?;
        Ok(input)
    }

    /// Bytes that are already here.
    pub fn from_bytes(name: &str, bytes: Vec<u8>, directory: &Path, options: &ReadOptions) -> Self {
        let directory = directory.to_path_buf();
        let expansion = Arc::new(Expansion::of_bytes(bytes.len() as u64));
        Self {
            name: name.into(),
            bytes,
            root: directory.clone(),
            directory,
            options: options.clone(),
            expansion,
        }
    }

    /// The same, unpacked if they are compressed with gzip.
    pub fn from_packed(
        name: &str,
        bytes: Vec<u8>,
        directory: &Path,
        options: &ReadOptions,
    ) -> Result<Self, ReadError> {
        let mut input = Self::from_bytes(name, bytes, directory, options);
        if input.bytes.starts_with(&GZIP) {
            input.bytes = input.unpack(&input.bytes, Compression::Gzip, Place::Whole)?;
        }
        Ok(input)
    }

    /// Bytes that this file holds, as a file of their own.
    pub(crate) fn part(&self, name: &str, bytes: Vec<u8>) -> Self {
        let (directory, root, expansion) =
            (self.directory.clone(), self.root.clone(), self.expansion.clone());
        Self { name: name.into(), bytes, directory, root, options: self.options.clone(), expansion }
    }

    /// Opens a file that this one names; see [`Self::resolve`].
    pub fn open_relative(&self, name: &str) -> Result<Self, ReadError> {
        let path = self.resolve(name)?;
        let shown = path.display().to_string();
        self.count_file(&path)?;
        let bytes = read_limited(&path, &shown, NamedBy::File, &self.options.limits)?;
        self.options.record(&path, &bytes);
        let directory = path.parent().unwrap_or(Path::new(".")).to_path_buf();
        let opened = Self { directory, ..self.part(&shown, bytes) };
        opened.charge(opened.bytes.len() as u64, "its content")?;
        Ok(opened)
    }

    /// The path of a file that this one names, relative to this one's folder; whether it exists is
    /// not said. Absolute names, and names that lead out of the root folder, need
    /// `--allow-outside`. Backslashes count as slashes where no file of the literal name exists.
    pub fn resolve(&self, name: &str) -> Result<PathBuf, ReadError> {
        let literal = Path::new(name);
        let mut path = self.directory.join(literal);
        if !path.exists() && name.contains('\\') {
            path = self.directory.join(name.replace('\\', "/"));
        }
        if !self.options.allow_outside && !stays_inside(&self.root, &path) {
            return Err(self.error(
                Place::Whole,
                format!("it names the file \"{name}\", which lies outside of the scene's folder"),
                "move the file into the folder, or give --allow-outside if you trust the scene",
            ));
        }
        Ok(path)
    }

    /// The error with line and column beside a path into JSON, if it is about this file and this
    /// file is that JSON. (Searching the text takes a while, so it is done for errors that a user
    /// sees, and not for those that become warnings.)
    pub fn located(&self, mut error: ReadError) -> ReadError {
        if let Place::Json(path) = &error.place
            && error.file == self.name
            && let Some((line, column)) = line_and_column(&self.bytes, path)
        {
            error.place = Place::JsonAt(path.clone(), line, column);
        }
        error
    }

    /// An error about this file.
    pub fn error(
        &self,
        place: Place,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> ReadError {
        ReadError { file: self.name.clone(), place, problem: problem.into(), remedy: remedy.into() }
    }

    /// Extension in lower case, without the dot: of `a.ply.gz`, `ply`.
    pub fn extension(&self) -> String {
        self.plain_name()
            .extension()
            .map(|e| e.to_string_lossy().to_lowercase())
            .unwrap_or_default()
    }

    /// File name without folder and extension.
    pub fn stem(&self) -> String {
        self.plain_name().file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// The name without `.gz`.
    fn plain_name(&self) -> &Path {
        Path::new(self.name.strip_suffix(".gz").unwrap_or(&self.name))
    }
}

/// How gzip files begin.
const GZIP: [u8; 3] = [0x1f, 0x8b, 8];
/// The content of a file that was compressed with gzip; others as they are.
fn unpacked(bytes: Vec<u8>, name: &str, limits: &Limits) -> Result<Vec<u8>, ReadError> {
    if !bytes.starts_with(&GZIP) {
        return Ok(bytes);
    }
    unpack(&bytes, Compression::Gzip, limits).map_err(|(problem, remedy)| ReadError {
        file: name.into(),
        place: Place::Whole,
        problem,
        remedy: remedy.into(),
    })
}

/// True if `path`, links followed where it exists, lies in `root`.
fn stays_inside(root: &Path, path: &Path) -> bool {
    if let (Ok(root), Ok(path)) = (root.canonicalize(), path.canonicalize()) {
        return path.starts_with(root);
    }
    // The file does not exist: judge by the names alone.
    let Ok(rest) = path.strip_prefix(root) else { return false };
    let mut depth = 0i64;
    for component in rest.components() {
        match component {
            Component::ParentDir => depth -= 1,
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return false,
        }
        if depth < 0 {
            return false;
        }
    }
    true
}

fn read_limited(
    path: &Path,
    name: &str,
    named_by: NamedBy,
    limits: &Limits,
) -> Result<Vec<u8>, ReadError> {
    let bytes = open::read(path, named_by, limits.file_bytes).map_err(|refused| ReadError {
        file: name.into(),
        place: Place::Whole,
        problem: refused.problem,
        remedy: refused.remedy.into(),
    })?;
    unpacked(bytes, name, limits)
}
