//! An input file: its bytes, and the rules for finding the files that it names.

use crate::ReadOptions;
use crate::error::{Place, ReadError};
use crate::expansion::{Compression, Expansion, unpack};
use crate::json_place::line_and_column;
use crate::limits::Limits;
use crate::open::{self, NamedBy};
use crate::search::Search;
use snell_math::{DVec3, Vec3};
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// A file being read.
#[derive(Clone, Debug)]
pub struct Input {
    /// The name that the user or the naming file gave, for messages.
    pub name: String,
    /// The content, unpacked if it was compressed with gzip.
    pub bytes: Vec<u8>,
    /// The folder that relative names start from.
    pub directory: PathBuf,
    /// No file outside of this folder is opened if the options confine the scene.
    pub root: PathBuf,
    /// Options of reading.
    pub options: ReadOptions,
    /// The point that readers of meshes subtract from positions, in double precision: not zero
    /// only if a mesh lies so far from zero that single precision does not hold its shape.
    pub(crate) origin: DVec3,
    /// The memory charged for the files of the scene.
    pub(crate) expansion: Arc<Expansion>,
    /// The search for files whose names are not literally those of files.
    pub(crate) search: Arc<Search>,
    /// What was noted about the files of the scene: in the order of the alphabet, because files are
    /// read in parallel.
    pub(crate) notes: Arc<Mutex<BTreeSet<String>>>,
}

impl Input {
    /// Opens a file named by the user. Its folder becomes the root for files that it names; for a
    /// pipe, the current folder does.
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
            origin: DVec3::ZERO,
            expansion,
            search: Arc::default(),
            notes: Arc::default(),
        };
        input.charge(input.bytes.len() as u64, "its content")?;
        Ok(input)
    }

    /// An input from bytes that are in memory already.
    pub fn from_bytes(name: &str, bytes: Vec<u8>, directory: &Path, options: &ReadOptions) -> Self {
        let directory = directory.to_path_buf();
        let expansion = Arc::new(Expansion::of_bytes(bytes.len() as u64));
        Self {
            name: name.into(),
            bytes,
            root: directory.clone(),
            directory,
            options: options.clone(),
            origin: DVec3::ZERO,
            expansion,
            search: Arc::default(),
            notes: Arc::default(),
        }
    }

    /// Like [`Self::from_bytes`], but unpacks bytes that are compressed with gzip.
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

    /// An input from bytes embedded in this file.
    pub(crate) fn part(&self, name: &str, bytes: Vec<u8>) -> Self {
        Self {
            name: name.into(),
            bytes,
            directory: self.directory.clone(),
            root: self.root.clone(),
            options: self.options.clone(),
            origin: DVec3::ZERO,
            expansion: self.expansion.clone(),
            search: self.search.clone(),
            notes: self.notes.clone(),
        }
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

    /// Resolves the path of a file that this one names, relative to this one's folder. The file
    /// need not exist. Where no file has the literal name, [`Search::find`] looks for the one that
    /// it means, and the scene gets a note.
    ///
    /// # Errors
    /// If the scene is confined and the file lies outside of the root folder.
    pub fn resolve(&self, name: &str) -> Result<PathBuf, ReadError> {
        let literal = self.directory.join(name);
        let is_allowed = |path: &Path| !self.options.confine || stays_inside(&self.root, path);
        if !is_allowed(&literal) || !literal.exists() {
            let folders = [&*self.directory, &self.root];
            if let Some(path) = self.search.find(&folders, name, is_allowed) {
                self.search.record(name, &path);
                return Ok(path);
            }
        }
        if !is_allowed(&literal) {
            return Err(self.error(
                Place::Whole,
                format!("it names the file \"{name}\", which lies outside of the scene's folder"),
                CONFINED,
            ));
        }
        Ok(literal)
    }

    /// Adds line and column to an error at a JSON pointer, if it is about this file and this file
    /// is that JSON. (Searching the text takes a while, so this is done only for errors that a user
    /// sees, not for those that become warnings.)
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

    /// A position of the file relative to the origin of its coordinates here.
    pub(crate) fn near(&self, position: Vec3) -> Vec3 {
        match self.origin == DVec3::ZERO {
            true => position,
            false => (position.as_dvec3() - self.origin).as_vec3(),
        }
    }

    /// Notes something about a file that its user should know. A note is kept once. Readers of
    /// scenes make warnings of notes.
    pub(crate) fn note(&self, text: String) {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).insert(text);
    }

    /// All that was noted about this file and those that it names, and forgets it.
    pub fn take_notes(&self) -> Vec<String> {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *notes).into_iter().collect()
    }

    /// The extension in lower case, without the dot: `ply` for `a.ply.gz`.
    pub fn extension(&self) -> String {
        self.plain_name()
            .extension()
            .map(|e| e.to_string_lossy().to_lowercase())
            .unwrap_or_default()
    }

    /// The file name without folder and extension.
    pub fn stem(&self) -> String {
        self.plain_name().file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// The name without `.gz`.
    fn plain_name(&self) -> &Path {
        Path::new(self.name.strip_suffix(".gz").unwrap_or(&self.name))
    }
}

/// The remedy for a confined scene that names a file outside of its folder.
pub const CONFINED: &str = "move the file into the folder, or leave out --confine";

/// The magic bytes of gzip.
const GZIP: [u8; 3] = [0x1f, 0x8b, 8];
/// Unpacks content that is compressed with gzip; returns other content as it is.
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

/// True if `path`, with its existing links followed, lies in `root`.
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
