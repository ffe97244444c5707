//! Reads scene files into scene graphs, and reads and writes images.
//!
//! A *reader* turns bytes into a [`Scene`] (a mesh file is a scene with one node). The reader is
//! chosen by the content, then by the extension. To add a format: one new file with a
//! [`SceneReader`] in `mesh/` or `scene/`, and its two lines in the `mod.rs` there.

#![cfg_attr(
    test,
    expect(clippy::disallowed_methods, reason = "tests compare with the standard library")
)]
#![forbid(unsafe_code)]

pub mod atomic;
pub mod error;
mod expansion;
mod fence;
mod guard;
pub mod ies;
pub mod image;
pub mod input;
mod json_place;
pub mod limits;
pub mod memory;
pub mod mesh;
pub mod open;
pub mod points;
pub mod reference;
pub mod scene;
mod search;
mod sources;
mod stranger;
mod strip;
mod strokes;
pub mod textures;
pub mod write;

pub use error::{Place, ReadError, WriteError};
pub use input::Input;
pub use limits::Limits;
pub use points::{PointTable, read_points};
pub use sources::Sources;
pub use write::{SceneWriter, Written, check_scene_path, write_scene, write_scene_as};

use snell_scene::{Environment, Scene, WarningKind};
use std::path::Path;

/// A reader of scene or mesh files.
#[derive(Clone, Copy)]
pub struct SceneReader {
    /// Short name, such as `gltf`.
    pub name: &'static str,
    /// One line for `snell formats`.
    pub description: &'static str,
    /// Extensions in lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// True if the bytes can only be this format. The function gets the whole file and must be
    /// quick: it looks at the first few KiB.
    pub recognises: fn(&[u8]) -> bool,
    /// Reads the scene.
    pub read: fn(&Input) -> Result<Scene, ReadError>,
}

const READER_COUNT: usize = scene::READERS.len() + mesh::FORMATS.len();

/// All readers, in the order in which contents are tried: those of `scene`, then those of `mesh`.
pub const SCENE_READERS: &[SceneReader] = &{
    let mut all = [scene::READERS[0]; READER_COUNT];
    let (mut i, scenes) = (0, scene::READERS.len());
    while i < READER_COUNT {
        all[i] = if i < scenes { scene::READERS[i] } else { mesh::FORMATS[i - scenes].0 };
        i += 1;
    }
    all
};

/// Options of reading.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// True if no file outside of the scene's folder is opened, whatever the scene names.
    pub confine: bool,
    /// Limits on sizes and counts.
    pub limits: Limits,
    /// The material variant to use, by name or number (from 0), in files with several. Formats
    /// without variants ignore it.
    pub variant: Option<String>,
    /// The scene to use, by name or number (from 0), in files with several. Formats with only one
    /// ignore it.
    pub scene: Option<String>,
    /// Values of the file's parameters, by name: `$name` in Mitsuba scenes. Other names are
    /// ignored.
    pub parameters: Vec<(String, String)>,
    /// True if meshes keep their vertices in double precision, where single precision does not hold
    /// all digits of the file: for queries and for writing. Pictures need them not.
    pub exact: bool,
    /// Records the files that are read, with hashes of their contents. `None` saves the time for
    /// hashing.
    pub sources: Option<Sources>,
}

impl ReadOptions {
    /// Records a file that was read, if sources are recorded.
    fn record(&self, path: &Path, content: &[u8]) {
        if let Some(sources) = &self.sources {
            sources.add(path, content);
        }
    }
}

/// Reads a scene file.
pub fn read_scene(path: &Path, options: &ReadOptions) -> Result<Scene, ReadError> {
    read_input(Input::open(path, options)?)
}

/// Reads a scene from bytes, such as standard input. `name` is for messages; files that the scene
/// names are searched in `directory`.
pub fn read_scene_bytes(
    name: &str,
    bytes: Vec<u8>,
    directory: &Path,
    options: &ReadOptions,
) -> Result<Scene, ReadError> {
    let input = Input::from_packed(name, bytes, directory, options)?;
    options.record(Path::new(name), &input.bytes);
    read_input(input)
}

/// Reads a USD stage that the Python modules `snell.usd` converted to Snell's own format. `name` is
/// the name of the stage. Stages are made for viewers with lighting of their own, so a scene that
/// only its own weak emission would light gets the default sky.
pub fn read_stage(
    name: &str,
    bytes: Vec<u8>,
    directory: &Path,
    options: &ReadOptions,
) -> Result<Scene, ReadError> {
    let mut scene = read_scene_bytes(name, bytes, directory, options)?;
    snell_scene::framing::light_unless_lit(&mut scene, snell_math::DVec3::Y, scene::LEAST_LAMP);
    Ok(scene)
}

/// Refuses a large file if there is too little memory to read it: numbers in text take several
/// times their size while they are read. The factors were measured on meshes.
fn check_memory(input: &Input) -> Result<(), ReadError> {
    const LARGE: usize = 16 << 20;
    if input.bytes.len() < LARGE {
        return Ok(());
    }
    let is_text = !input.bytes[..4096].contains(&0);
    let needed = input.bytes.len() as u64 * if is_text { 5 } else { 2 };
    let admitted = memory::Available::now().admit("to read this file", needed);
    admitted.map_err(|problem| {
        input.error(Place::Whole, problem, "give it more memory, or split the scene")
    })
}

fn read_input(mut input: Input) -> Result<Scene, ReadError> {
    let extension = input.extension();
    let recognised = SCENE_READERS.iter().find(|r| (r.recognises)(&input.bytes));
    if recognised.is_none()
        && let Some((problem, remedy)) = stranger::known_kind(&input.bytes, &extension)
    {
        return Err(input.error(Place::Whole, problem, remedy));
    }
    let reader = recognised
        .or_else(|| SCENE_READERS.iter().find(|r| r.extensions.contains(&extension.as_str())));
    let Some(reader) = reader else {
        let known: Vec<_> = SCENE_READERS.iter().map(|r| r.name).collect();
        return Err(input.error(
            Place::Whole,
            "this is not a scene or mesh format that Snell knows, neither by its content nor by \
                its extension",
            format!("use one of: {} (`snell formats` says more)", known.join(", ")),
        ));
    };
    check_memory(&input)?;
    let mut scene = (reader.read)(&input).map_err(|error| input.located(error))?;
    if mesh::FORMATS.iter().any(|(format, _)| format.name == reader.name) {
        mesh::read_again_if_far(&mut input, reader, &mut scene)?;
    }
    snell_scene::framing::show_colors(&mut scene);
    if let Some(Environment::Image { image, .. }) = &scene.environment {
        image::charge_environment(&input, image)?;
    }
    if scene.name.is_empty() {
        scene.name = input.stem();
    }
    for (name, found) in input.search.take_found() {
        let reason = if found.was_refused {
            format!("\"{name}\" lies outside of the scene's folder (--confine, confine=True)")
        } else {
            format!("there is no file \"{name}\"")
        };
        let path = found.path.display();
        scene.warn_of(
            WarningKind::Choice,
            format!("{}: {reason}; {path} was taken for it", input.name),
        );
    }
    for note in input.take_notes() {
        scene.warn_of(WarningKind::Choice, note);
    }
    scene.limit_light();
    Ok(scene)
}
