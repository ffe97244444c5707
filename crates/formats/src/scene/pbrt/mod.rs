//! pbrt-v4 scenes, and those of pbrt-v3 where the meaning is clear.
//!
//! The format is that of <https://pbrt.org/fileformat-v4>. `lexer.rs` and `params.rs` read the
//! syntax, `directive.rs` executes the directives, and one file or folder each builds cameras,
//! shapes, materials, textures, lights and media. Features that Snell lacks are approximated with a
//! warning that names file, line and column; unused parameters are reported, too.
//!
//! Coordinates of pbrt are left-handed: its cameras look along `+z` with `+x` to the right and `+y`
//! up. If the camera's own transform does not mirror these coordinates, the whole scene is mirrored
//! in x (by the root node), so that pictures are not mirrored.

mod camera;
mod directive;
mod environment;
mod legacy;
mod lens;
mod lexer;
mod light;
mod material;
mod medium;
mod motion;
mod options;
mod params;
mod shape;
mod spectrum;
mod state;
#[cfg(test)]
mod tests;
mod texture;
mod transform;

use crate::scene::fault::{Fault, Spot};
use crate::scene::keep_dark;
use crate::scene::notes::Notes;
use crate::textures::Textures;
use crate::{Input, ReadError, SceneReader};
use material::Materials;
use medium::Media;
use options::RenderOptions;
use params::{Params, Type};
use shape::Shapes;
use snell_math::DAffine3;
use snell_scene::{NodeId, Scene, WarningKind};
use state::{Stack, State};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use texture::Patterns;

/// The reader of pbrt scenes.
pub const READER: SceneReader = SceneReader {
    name: "pbrt",
    description: "pbrt-v4 and pbrt-v3 scene",
    extensions: &["pbrt"],
    recognises,
    read,
};

/// The state of reading after some directives. It covers all files of the scene.
struct Builder<'a> {
    /// The file that the user named; names in all files are relative to its folder.
    main: &'a Input,
    scene: Scene,
    state: State,
    stack: Stack,
    options: RenderOptions,
    coordinate_systems: HashMap<String, state::Motion>,
    /// Transform from the file's world to the scene's: a mirror or the identity.
    world_from_file: DAffine3,
    materials: Materials,
    patterns: Patterns,
    images: Textures,
    shapes: Shapes,
    media: Media,
    /// Nodes of finished object definitions by name.
    objects: HashMap<String, NodeId>,
    /// The object being defined.
    object: Option<(String, NodeId)>,
    /// True after `WorldBegin`.
    in_world: bool,
    /// True if something identified the file as pbrt-v3.
    is_v3: bool,
    /// Names of all files so far.
    files: Vec<String>,
    /// Paths of the files that are being read, the innermost last.
    open_files: Vec<PathBuf>,
    /// The other folders of included files, each as a file without content.
    included: Vec<Input>,
    directives: usize,
    notes: Notes,
    /// Everything that moves.
    moving: motion::Moving,
    /// True if the file has lights, even if they are off.
    has_lamps: bool,
}

fn read(input: &Input) -> Result<Scene, ReadError> {
    let mut builder = Builder {
        main: input,
        scene: Scene::new(""),
        state: State::default(),
        stack: Stack::default(),
        options: RenderOptions::default(),
        coordinate_systems: HashMap::new(),
        world_from_file: DAffine3::IDENTITY,
        materials: Materials::default(),
        patterns: Patterns::default(),
        images: Textures::default(),
        shapes: Shapes::default(),
        media: Media::default(),
        objects: HashMap::new(),
        object: None,
        in_world: false,
        is_v3: false,
        files: Vec::new(),
        open_files: Vec::new(),
        included: Vec::new(),
        directives: 0,
        notes: Notes::default(),
        moving: motion::Moving::default(),
        has_lamps: false,
    };
    match builder.read_scene() {
        Ok(()) => Ok(builder.scene),
        Err(fault) => Err(fault.into_error(&builder.files)),
    }
}

/// The file from whose folder a name leads to a file: the main file, or else an included one whose
/// folder has it. (pbrt does not look there, but other programs write such names.)
fn home<'a>(main: &'a Input, included: &'a [Input], name: &str) -> &'a Input {
    let is_home = |folder: &&Input| folder.has_file(name);
    match main.has_file(name) {
        true => main,
        false => included.iter().rev().find(is_home).unwrap_or(main),
    }
}

impl Builder<'_> {
    fn read_scene(&mut self) -> Result<(), Fault> {
        self.read_file(self.main, Spot::default())?;
        self.note_world();
        self.finish_options()?;
        self.finish_media();
        self.finish_curves();
        self.scene.nodes[self.scene.root.index()].transform = self.world_from_file;
        self.finish_motion();
        if self.has_lamps {
            keep_dark(&mut self.scene);
        }
        self.notes.finish(&mut self.scene, &self.files);
        Ok(())
    }

    /// Notes a file that pbrt refuses, because no world begins in it.
    fn note_world(&mut self) {
        let start = Spot { file: 0, line: 1, column: 1 };
        if self.directives == 0 {
            self.note("nothing", start, || {
                "there is nothing to show: the file has no directive; export it again".into()
            });
        } else if !self.in_world {
            self.note("no world", start, || {
                "there is no WorldBegin, without which pbrt stops: everything in the file was \
                taken as the world, and its places are relative to the camera; write WorldBegin \
                after the options"
                    .into()
            });
        }
    }

    /// Adds a warning: what was found, and what was done instead. Only the first of each kind is
    /// reported.
    fn note(&mut self, kind: impl Into<String>, at: Spot, message: impl FnOnce() -> String) {
        self.notes.add(WarningKind::Changed, kind.into(), at, message);
    }

    /// Adds a note about a choice that the file leaves open, or about a feature of another program,
    /// where nothing is wrong.
    fn mention(&mut self, kind: impl Into<String>, at: Spot, message: impl FnOnce() -> String) {
        self.notes.add(WarningKind::Choice, kind.into(), at, message);
    }

    /// Warns of unused parameters.
    fn note_unused(&mut self, params: &Params) {
        for param in params.unused() {
            let what = format!("\"{} {}\" of {}", param.kind.name(), param.name, params.owner);
            self.note(format!("unused {what}"), param.at, || {
                format!("{what} is not known; it was ignored")
            });
        }
    }

    /// Marks parameters of other programs as used, and notes the reason.
    fn mention_ignored(&mut self, params: &Params, names: &[&str], reason: &str) {
        for name in names {
            if let Some(param) = params.get(name) {
                let what = format!("\"{} {}\" of {}", param.kind.name(), param.name, params.owner);
                let at = param.at;
                self.mention(format!("ignored {what}"), at, || {
                    format!("{what} was ignored: {reason}")
                });
            }
        }
    }

    /// Marks ignored parameters as used, and warns with the reason.
    fn note_ignored(&mut self, params: &Params, names: &[&str], reason: &str) {
        for name in names {
            if let Some(param) = params.get(name) {
                let what = format!("\"{} {}\" of {}", param.kind.name(), param.name, params.owner);
                let at = param.at;
                self.note(format!("ignored {what}"), at, || {
                    format!("{what} was ignored: {reason}")
                });
            }
        }
    }

    /// The file from whose folder a name leads to a file.
    fn home(&self, name: &str) -> &Input {
        home(self.main, &self.included, name)
    }

    /// Opens a file that the scene names in a parameter or directive at `at`.
    fn open(&mut self, name: &str, at: Spot) -> Result<Input, Fault> {
        let limit = self.main.options.limits.files;
        if self.files.len() >= limit {
            return Err(Fault::new(
                at,
                format!("the scene names more than {limit} files, the limit"),
                "split it",
            ));
        }
        self.home(name).open_relative(name).map_err(|error| {
            // The error is either about the main file, which refers to the outside, or about the
            // other one, which cannot be opened.
            let is_own = error.file == self.main.name;
            let problem =
                if is_own { error.problem } else { format!("{}: {}", error.file, error.problem) };
            Fault::new(at, problem, error.remedy)
        })
    }

    /// The name of a file in a parameter.
    fn file_name<'p>(
        &self,
        params: &'p Params,
        name: &str,
    ) -> Result<Option<(&'p str, Spot)>, Fault> {
        let Some(param) = params.typed(name, &[Type::String, Type::Spectrum])? else {
            return Ok(None);
        };
        match param.strings() {
            [file] => Ok(Some((file, param.at))),
            _ => Err(param.fault("one file name was expected", "give one")),
        }
    }

    /// The transform from the current object space to the file's world, at the start of the motion.
    fn placement(&mut self, at: Spot) -> DAffine3 {
        let [start, end] = self.state.transform.0;
        if start != end {
            self.note("motion", at, || {
                "a transform that changes over time; the one at the start was used".into()
            });
        }
        start
    }
}

/// A path that is the same for every name of a file.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

/// True if the text starts, after comments, with a directive that no other format has, followed by
/// valid arguments.
fn recognises(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let mut lines = text.trim_start_matches('\u{feff}').lines().map(str::trim_start);
    let Some(line) = lines.find(|l| !l.is_empty() && !l.starts_with('#')) else { return false };
    let word = line.split_ascii_whitespace().next().unwrap_or_default();
    directive::NAMES.contains(&word)
}
