//! Princeton `.scn` scenes, the language of the ray tracing assignments of COS 426 and COS 526.
//!
//! Whitespace-separated commands: a keyword and a fixed number of arguments. Where the two readers
//! of these courses differ, the defaults are those of COS 426 and the checks and additional
//! commands those of COS 526. This reader differs as follows:
//!
//! * Colours of lights are multiplied by pi: the assignments have no `1 / pi` in their diffuse
//!   term, but Snell does.
//! * `line` has no surface and is not drawn; a group with a singular matrix has none either and is
//!   left out. Both are warnings.
//! * Unclosed groups, cyclic includes and projective matrices are errors.

mod command;
mod environment;
mod file;
mod light;
mod material;
#[cfg(test)]
mod tests;

use crate::scene::shapes::ShapeTable;
use crate::scene::tokens::{Token, Tokens};
use crate::{Input, ReadError, SceneReader};
use snell_intersect::TriangleMesh;
use snell_math::{Bounds3d, DVec3};
use snell_scene::{Camera, Material, MaterialId, Scene, TextureId};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// The reader of Princeton scenes.
pub const READER: SceneReader = SceneReader {
    name: "scn",
    description: "Princeton scene of the COS 426 and COS 526 assignments",
    extensions: &["scn"],
    recognises,
    read,
};

/// The state after some commands, over all included files.
struct Builder {
    scene: Scene,
    shapes: ShapeTable,
    /// Meshes by the path they were read from, and the places of their zeros.
    meshes: BTreeMap<PathBuf, (Arc<TriangleMesh>, DVec3)>,
    /// Textures by the path of their image.
    textures: BTreeMap<PathBuf, TextureId>,
    default_material: Option<MaterialId>,
    camera: Option<Camera>,
    /// World bounds of lines, which have no surface but count for the default camera.
    line_bounds: Bounds3d,
    /// Files that are being read, the innermost last.
    open_files: Vec<PathBuf>,
    files: usize,
    commands: usize,
    /// The number of open groups and files.
    depth: usize,
}

fn read(input: &Input) -> Result<Scene, ReadError> {
    let mut builder = Builder {
        scene: Scene::new(""),
        shapes: ShapeTable::default(),
        meshes: BTreeMap::new(),
        textures: BTreeMap::new(),
        default_material: None,
        camera: None,
        line_bounds: Bounds3d::EMPTY,
        open_files: Vec::new(),
        files: 1,
        commands: 0,
        depth: 0,
    };
    builder.read_file(input, builder.scene.root, snell_math::DAffine3::IDENTITY)?;
    builder.add_defaults();
    Ok(builder.scene)
}

impl Builder {
    /// The grey default material.
    fn default_material(&mut self) -> MaterialId {
        *self
            .default_material
            .get_or_insert_with(|| self.scene.add_material(material::default_material()))
    }

    fn add_material(&mut self, material: Material) -> MaterialId {
        self.scene.add_material(material)
    }

    /// Counts a command against the limit.
    fn count_command(&mut self, tokens: &Tokens, token: &Token) -> Result<(), ReadError> {
        self.commands += 1;
        let limit = tokens.input().options.limits.elements;
        if self.commands <= limit {
            return Ok(());
        }
        Err(tokens.error(
            token,
            format!("the scene has more than {limit} commands, the limit"),
            "split the scene",
        ))
    }

    /// Enters a group or file.
    fn descend(&mut self, tokens: &Tokens, token: &Token) -> Result<(), ReadError> {
        self.depth += 1;
        let limit = tokens.input().options.limits.depth;
        if self.depth <= limit {
            return Ok(());
        }
        let problem = format!("groups and includes are nested deeper than {limit}, the limit");
        Err(tokens.error(token, problem, "flatten the scene"))
    }
}

/// True if the text starts, after comments, with a command that no other format has.
fn recognises(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]);
    let mut lines =
        text.lines().map(str::trim_start).filter(|l| !l.is_empty() && !l.starts_with('#'));
    let mut words = lines.next().unwrap_or_default().split_whitespace();
    let is_command =
        words.next().is_some_and(|keyword| command::NUMERIC_KEYWORDS.contains(&keyword));
    is_command && words.next().is_none_or(|w| w.parse::<f64>().is_ok())
}
