//! Writes scenes: one file per format, and its line in [`WRITERS`].
//!
//! A writer produces bytes and touches no file. It fills an [`Output`]: the file itself, files
//! beside it (meshes, pictures), and notes on what the format could not hold. [`write_scene_as`]
//! then puts all files in place, or none.

mod flat;
mod gltf;
mod material;
mod obj;
mod off;
mod patterns;
mod pbrt;
mod picture;
mod ply;
mod stl;
#[cfg(test)]
pub(crate) use picture::encoded as encoded_picture;
#[cfg(test)]
mod tests;

use crate::error::WriteError;
use crate::memory::Available;
use crate::{atomic, scene};
use snell_math::DVec3;
use snell_scene::placed::distinct_triangles;
use snell_scene::texture::Pattern;
use snell_scene::{Material, Scene, SceneSettings, Warning};
use std::path::{Path, PathBuf};

/// Pieces around a circle, where shapes become triangles.
const AROUND: u32 = 96;

/// A writer of scene files.
#[derive(Clone, Copy)]
pub struct SceneWriter {
    /// Short name, the same as that of the format's reader.
    pub name: &'static str,
    /// Extensions in lower case, without the dot; the preferred one first.
    pub extensions: &'static [&'static str],
    /// True for patterns that the format can express; others are converted to pictures.
    pub knows: fn(&Pattern) -> bool,
    /// Fills the output; fails if the scene cannot be written.
    pub write: fn(&Scene, &mut Output) -> Result<(), String>,
}

/// The writers of scene files.
pub const WRITERS: &[SceneWriter] = &[
    scene::snell::WRITER,
    gltf::WRITER,
    pbrt::WRITER,
    obj::WRITER,
    ply::WRITER,
    stl::WRITER,
    off::WRITER,
];

/// The output of a writer.
#[derive(Debug)]
pub struct Output {
    /// Name of the file without folder and extension.
    stem: String,
    /// Extension in lower case, for writers of several kinds of files.
    extension: String,
    /// The file itself.
    main: Vec<u8>,
    /// Files in the folder beside the main file: name and content.
    files: Vec<(String, Vec<u8>)>,
    losses: Vec<Warning>,
    /// The memory that may be used for the output.
    available: Available,
}

impl Output {
    fn new(path: &Path, available: Available) -> Self {
        let part = |part: Option<&std::ffi::OsStr>| {
            part.map(|p| p.to_string_lossy().into_owned()).unwrap_or_default()
        };
        Self {
            stem: part(path.file_stem()),
            extension: part(path.extension()).to_lowercase(),
            main: Vec::new(),
            files: Vec::new(),
            losses: Vec::new(),
            available,
        }
    }

    /// Sets the content of the main file.
    pub fn set(&mut self, bytes: Vec<u8>) {
        self.main = bytes;
    }

    /// Notes that the file omits or changes something; equal notes are counted.
    pub fn lose(&mut self, what: impl Into<String>) {
        Warning::note(&mut self.losses, what.into(), 1);
    }

    /// Adds a file beside the main one; returns the name by which the main file refers to it, with
    /// slashes.
    pub fn file(&mut self, name: &str, bytes: Vec<u8>) -> String {
        self.files.push((name.to_string(), bytes));
        format!("{}/{name}", self.folder())
    }

    /// The name of the folder for the files beside the main one. Its characters need no quoting in
    /// any format.
    fn folder(&self) -> String {
        format!("{}-files", plain_name(&self.stem))
    }

    /// Notes settings that no format but Snell's own can hold.
    fn lose_settings(&mut self, scene: &Scene) {
        if !scene.ambient.is_black() {
            self.lose("the ambient light of local illumination is left out");
        }
        if !scene.portals.is_empty() {
            self.lose("the environment is seen everywhere, not through portals alone");
        }
        if matches!(
            scene.background,
            snell_scene::Background::Color(_) | snell_scene::Background::Transparent
        ) {
            self.lose("the background is left out");
        }
        let up = scene.settings.up.filter(|up| up.normalize_or_zero() != DVec3::Y);
        // Programs take the z axis of STL for up.
        if let Some(up) =
            up.filter(|up| self.extension != "stl" || up.normalize_or_zero() != DVec3::Z)
        {
            self.lose(format!("that {} {} {} is up is left out", up.x, up.y, up.z));
        }
        let others = SceneSettings { up: None, ..scene.settings.clone() };
        if others != SceneSettings::default() {
            self.lose(
                "what the scene asks of the renderer (size, samples, integrator, …) is left out",
            );
        }
    }

    /// Notes everything that formats of bare meshes leave out. White materials stand only for the
    /// colours of vertices.
    fn lose_all_but_surfaces(&mut self, scene: &Scene) {
        if scene.materials.iter().any(|material| *material != Material::white()) {
            self.lose("materials are left out");
        }
        let kinds = [
            (scene.cameras.len(), "camera"),
            (scene.lights.len(), "light"),
            (usize::from(scene.environment.is_some()), "environment"),
            (scene.media.len(), "medium"),
        ];
        for (count, what) in kinds.into_iter().filter(|(count, _)| *count > 0) {
            let plural = if count == 1 { "is" } else { "are" };
            self.lose(format!(
                "{count} {what}{} {plural} left out",
                if count == 1 { "" } else { "s" }
            ));
        }
        self.lose_settings(scene);
    }
}

/// The name with every character replaced that some format would have to quote.
fn plain_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(plain).collect();
    if name.is_empty() { "scene".into() } else { name }
}

/// The result of writing a scene.
#[derive(Debug)]
pub struct Written {
    /// Name of the format.
    pub format: &'static str,
    /// All files, the main one first.
    pub files: Vec<PathBuf>,
    /// A list of what the format could not hold, and of what was written instead.
    pub losses: Vec<Warning>,
}

/// The writer for the extension of `path`.
fn writer_for(path: &Path) -> Result<SceneWriter, WriteError> {
    let extension =
        path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let writer = WRITERS.iter().find(|w| w.extensions.contains(&extension.as_str()));
    writer.copied().ok_or_else(|| {
        let known: Vec<_> =
            WRITERS.iter().flat_map(|w| w.extensions).map(|e| format!(".{e}")).collect();
        let problem = match extension.as_str() {
            "" => "the name has no extension that says which scene format to write".to_string(),
            _ => format!("\"{extension}\" is not a scene format that Snell writes"),
        };
        WriteError::Format {
            path: path.into(),
            problem,
            remedy: format!("use {}", known.join(" ")),
        }
    })
}

/// Checks, before any work is done, whether a scene can be written to `path`: its extension must be
/// known and, unless `overwrite`, no file may exist there.
pub fn check_scene_path(path: &Path, overwrite: bool) -> Result<(), WriteError> {
    writer_for(path)?;
    if !overwrite && path.exists() {
        return Err(exists(path));
    }
    atomic::check(path)
}

fn exists(path: &Path) -> WriteError {
    WriteError::Format {
        path: path.into(),
        problem: "the file exists".into(),
        remedy: "give another name, or --force to replace it".into(),
    }
}

/// Memory per triangle of a mesh, including its vertices, while a file is written. This was
/// measured; it covers the output in growing buffers.
const BYTES_OF_TRIANGLE: u64 = 220;

/// The size of a scene that is written without instances.
struct Expansion {
    /// The number of things, each counted in every instance.
    count: u64,
    /// The maximum number that the format holds.
    limit: u64,
    /// Name of what is counted, in plural.
    what: &'static str,
    /// Memory that each takes while the file is written, in bytes.
    bytes_of_each: u64,
    /// Advice for messages.
    remedy: &'static str,
}

impl Expansion {
    /// Refuses more than the format or the memory of this process can hold.
    fn check(&self, output: &Output) -> Result<(), String> {
        let Self { count, limit, what, remedy, .. } = self;
        if count > limit {
            return Err(format!(
                "it is {count} {what}, instances counted each, and the limit is {limit}; {remedy}"
            ));
        }
        let what = format!("the scene as {count} {what}, instances counted each,");
        let admitted = output.available.admit(&what, count.saturating_mul(self.bytes_of_each));
        admitted.map_err(|problem| format!("{problem}; {remedy}"))
    }
}

/// Writes a scene in the format that the extension of `path` names; the file appears whole or not
/// at all. Replaces files.
pub fn write_scene(path: &Path, scene: &Scene) -> Result<(), WriteError> {
    write_scene_as(path, scene, true).map(drop)
}

/// Writes a scene in the format of `path`'s extension, with the files that belong to it in the
/// folder `NAME-files`. Unless `overwrite`, existing files with other contents are an error, and
/// nothing is written. All files are created under temporary names; only when all of them exist are
/// they renamed, the one at `path` last.
pub fn write_scene_as(path: &Path, scene: &Scene, overwrite: bool) -> Result<Written, WriteError> {
    let writer = writer_for(path)?;
    let mut output = Output::new(path, Available::now());
    let triangles = distinct_triangles(scene);
    let admitted = output
        .available
        .admit(&format!("to write {triangles} triangles"), triangles * BYTES_OF_TRIANGLE);
    admitted.map_err(|problem| WriteError::Format {
        path: path.into(),
        problem,
        remedy: "give it more memory, or split the scene".into(),
    })?;
    lose_choices(scene, writer.name, &mut output);
    let drawn = patterns::drawn(scene, writer.knows, &mut output);
    (writer.write)(&drawn, &mut output).map_err(|problem| WriteError::Format {
        path: path.into(),
        problem,
        remedy: "change the scene, or write another format".into(),
    })?;
    let folder = path.with_file_name(output.folder());
    let beside = output.files.into_iter().map(|(name, bytes)| (folder.join(name), bytes));
    let files: Vec<_> = beside.chain([(path.to_path_buf(), output.main)]).collect();
    if !overwrite
        && let Some((path, _)) =
            files.iter().find(|(path, bytes)| holds_something_else(path, bytes))
    {
        return Err(exists(path));
    }
    if files.len() > 1 {
        std::fs::create_dir_all(&folder)
            .map_err(|source| WriteError::Io { path: folder.clone(), source })?;
    }
    atomic::write_all(&files)?;
    let mut files: Vec<_> = files.into_iter().map(|(path, _)| path).collect();
    files.rotate_right(1);
    Ok(Written { format: writer.name, files, losses: output.losses })
}

/// Notes what is left out because the scene is written in its present state: its other material
/// variants and scenes and, except in Snell's own format, its motion.
fn lose_choices(scene: &Scene, format: &str, output: &mut Output) {
    if scene.motion.is_some() && format != crate::scene::snell::READER.name {
        output.lose("what moves is written as it stands; its motion is left out");
    }
    if scene.variants.len() > 1 {
        output.lose(format!(
            "of {} variants of materials only the one that is shown is written",
            scene.variants.len()
        ));
    }
    if scene.scenes.len() > 1 {
        output
            .lose(format!("of {} scenes of the file only this one is written", scene.scenes.len()));
    }
}

fn holds_something_else(path: &Path, bytes: &[u8]) -> bool {
    let Ok(known) = std::fs::metadata(path) else { return false };
    known.is_file()
        && !(known.len() == bytes.len() as u64
            && std::fs::read(path).is_ok_and(|found| found == bytes))
}
