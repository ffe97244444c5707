//! glTF 2.0: `.gltf` (JSON beside its buffers and images) and `.glb` (all in one file). Documents
//! of glTF 1.0 are converted first (`version1.rs`).
//!
//! The document is read as plain JSON through `json::Json`, which knows its path and so can report
//! where a file is wrong. A file that violates the standard in a way that would change the picture
//! (dangling references, data that does not fit, cycles) is refused with an error that names this
//! path; a file that is merely odd loads, and anything changed or left out is a warning of the
//! scene.
//!
//! glTF maps to a scene as follows. Each node is a node; each mesh is a node with one surface per
//! primitive, stored once and shared by all nodes that show it. Morph targets are applied with
//! their default weights, skins at the pose of the nodes; animations become the scene's motion,
//! which has no effect until it is played. `+y` is up, lengths are metres.
//!
//! # Units of light
//! glTF gives light in photometric units (cd, lx, cd/m²), without spectra. Their numbers are used
//! as radiometric ones (W/sr, W/m², W/(m² sr)) for each channel, as common viewers do: a white wall
//! under 3.14 lx shows as 1, and an emissive factor of 1 as 1. So lights and emission keep the
//! standard's proportion. One exception: Blender writes its watts times 683 lm/W (by default), but
//! emission without that factor. Lights in Blender's files with a light of at least 100 cd or 50 lx
//! are divided by 683 again, as Blender's own importer does.

mod accessor;
mod animation;
mod camera;
mod container;
mod draco;
mod extension;
mod instancing;
mod json;
mod light;
mod material;
mod mesh;
mod meshopt;
mod morph;
mod node;
mod none;
mod pointer;
mod reference;
mod skin;
mod texture;
mod topology;
mod tree;
mod version1;

#[cfg(test)]
mod tests;

use crate::scene::{LEAST_LAMP, keep_dark};
use crate::{Input, ReadError, SceneReader};
use accessor::Accessors;
use container::{Buffers, Container, GLB_MAGIC};
use json::Json;
use snell_intersect::UV_SETS;
use snell_scene::{MaterialId, Scene, TextureId, WarningKind};
use std::collections::BTreeMap;
use texture::Textures;

/// Reader of glTF 2.0.
pub const READER: SceneReader = SceneReader {
    name: "gltf",
    description: "glTF 2.0 scenes, with their materials, textures, cameras and lights",
    extensions: &["gltf", "glb", "vrm"],
    recognises,
    read,
};

/// Recognises a GLB by its magic bytes, and a `.gltf` by an `asset` with a version near the start
/// or the end.
fn recognises(bytes: &[u8]) -> bool {
    const WINDOW: usize = 4096;
    let starts_as_object =
        bytes.iter().find(|b| !b.is_ascii_whitespace() && !b"\xef\xbb\xbf".contains(b))
            == Some(&b'{');
    let names_version = |part: &[u8]| {
        let text = String::from_utf8_lossy(part);
        let asset = text.split_once("\"asset\"").map(|(_, rest)| rest.trim_start());
        asset
            .and_then(|rest| rest.strip_prefix(':'))
            .is_some_and(|rest| rest.contains("\"version\""))
    };
    bytes.starts_with(GLB_MAGIC)
        || starts_as_object
            && (names_version(&bytes[..bytes.len().min(WINDOW)])
                || names_version(&bytes[bytes.len().saturating_sub(WINDOW)..]))
}

/// End of the warning about an image that cannot be shown.
const REPLACED_BY_CHECKER: &str = "a magenta checker is shown instead";

/// State that the parts of the reader share.
struct Reader<'a> {
    input: &'a Input,
    root: Json<'a>,
    accessors: Accessors<'a>,
    textures: Textures,
    scene: Scene,
    /// Material of primitives without one; `None` until the first such primitive.
    default_material: Option<MaterialId>,
    /// The selected material variant.
    variant: Option<usize>,
    /// Sets of texture coordinates that the material being read uses, in the order in which its
    /// meshes store them.
    uv_sets: [usize; UV_SETS],
    /// Vertices read so far, counted against the limit.
    vertices: usize,
    /// Properties that animations name by JSON pointer.
    pointers: Vec<pointer::Pointer>,
    /// Textures whose placement changes, by the path of their `textureInfo`. They are not shared.
    moving_textures: BTreeMap<String, TextureId>,
    /// True if a material emits with a strength of 0: a lamp that is off.
    has_lamps_off: bool,
    /// The message about the first primitive of points or lines that was drawn, and the number of
    /// all.
    drawn: Option<(String, u64)>,
}

fn read(input: &Input) -> Result<Scene, ReadError> {
    let Container { mut json, binary } = Container::open(input)?;
    let mut scene = Scene::new(input.stem());
    if version1::is(&json) {
        scene
            .note("glTF 1.0: converted to glTF 2.0; the values of materials are read, not shaders");
        let warnings = version1::convert(&mut json, binary.map_or(0, <[u8]>::len));
        warnings.into_iter().for_each(|warning| scene.warn(warning));
    }
    none::remove(&mut json).into_iter().for_each(|warning| scene.warn(warning));
    none::spell(&mut json).into_iter().for_each(|warning| scene.warn(warning));
    tree::untangle(input, &mut json)?.into_iter().for_each(|warning| scene.warn(warning));
    let root = Json::root(input, &json);
    check_version(&root, &mut scene)?;
    extension::check(&root, &mut scene)?;
    reference::check(&root)?;

    let accessors =
        Accessors::new(&root, Buffers::new(input, &root, binary)?, input.options.limits.elements)?;
    accessors.check()?;
    let textures = Textures::default();
    let mut reader = Reader {
        input,
        root,
        accessors,
        textures,
        scene,
        default_material: None,
        variant: None,
        uv_sets: material::FIRST_UV_SETS,
        vertices: 0,
        pointers: Vec::new(),
        moving_textures: BTreeMap::new(),
        has_lamps_off: false,
        drawn: None,
    };
    reader.textures = texture::decode_images(&reader)?;
    reader.pointers = pointer::read_all(&mut reader)?;
    material::read_all(&mut reader)?;
    node::read_scene(&mut reader)?;
    if let Some((message, count)) = reader.drawn.take() {
        let others = match count - 1 {
            0 => String::new(),
            1 => "; and 1 more primitive likewise".into(),
            more => format!("; and {more} more primitives likewise"),
        };
        reader.scene.warn_of(WarningKind::Choice, message + &others);
    }
    for warning in reader.accessors.buffers().take_warnings() {
        reader.scene.warn(warning);
    }
    // Lamps need `KHR_materials_emissive_strength`.
    snell_scene::framing::light_unless_lit(&mut reader.scene, snell_math::DVec3::Y, LEAST_LAMP);
    if reader.has_lamps_off {
        keep_dark(&mut reader.scene);
    }
    light::tell_of_black_surroundings(&mut reader)?;
    name_file(input, &mut reader.scene);
    Ok(reader.scene)
}

/// Begins every warning with the name of the file, unless it has it already.
fn name_file(input: &Input, scene: &mut Scene) {
    for warning in &mut scene.warnings {
        if !warning.message.contains(&input.name) {
            warning.message = format!("{}: {}", input.name, warning.message);
        }
    }
}

/// Refuses versions other than glTF 2. A version that is a number instead of text is a warning.
fn check_version(root: &Json, scene: &mut Scene) -> Result<(), ReadError> {
    let asset = root.require("asset")?;
    let version = asset.require("version")?;
    let text = match version.value().as_f64() {
        Some(number) => {
            scene.warn(format!("the version of glTF is the number {number}, not text"));
            number.to_string()
        }
        None => version.string()?.to_owned(),
    };
    let remedy = "convert it to glTF 2.0, for example with gltf-pipeline or Blender";
    if text.split('.').next() != Some("2") {
        return Err(version.error_with(format!("this is glTF \"{text}\", expected 2.0"), remedy));
    }
    if let Some(minimum) = asset.get("minVersion")?
        && minimum.value().as_f64() != Some(2.0)
        && minimum.string()? != "2.0"
    {
        let found = minimum.string()?;
        return Err(minimum.error_with(
            format!("it needs a reader of glTF \"{found}\", but this is one of 2.0"),
            remedy,
        ));
    }
    Ok(())
}
