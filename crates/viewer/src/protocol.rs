//! The messages between page and server over the WebSocket: JSON text both ways, and pictures as
//! binary messages to the page. The TypeScript types in `web/src/protocol.gen.ts` are generated
//! from these; a test checks that they are up to date.

use crate::explain::Report;
use crate::forms::{Form, SettingForm};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// The version, which changes when old pages become incompatible with new servers.
pub const VERSION: u32 = 2;

/// A message from the page.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ToServer {
    /// The camera has moved.
    Camera {
        /// Number of the message, which increases with each; frames name the last message that they
        /// show.
        seq: u32,
        /// All parameters of the camera.
        #[cfg_attr(test, ts(type = "Camera"))]
        camera: Value,
        /// Number of the gesture: moves of one gesture are undone together.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<u32>", optional))]
        gesture: u32,
    },
    /// Puts the camera where one of the scene's cameras is, so that the picture shows all that the
    /// file shows.
    Home {
        /// Number of the scene's camera; `None` for the one of the first picture.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        camera: Option<u32>,
        /// Number of the gesture.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<u32>", optional))]
        gesture: u32,
    },
    /// Size of the picture in pixels.
    Size {
        /// Width and height.
        size: [u32; 2],
    },
    /// Changes render settings. Absent settings stay unchanged.
    Render {
        /// Name of an integrator.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        integrator: Option<String>,
        /// Samples per pixel at rest.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        spp: Option<u32>,
        /// Maximum number of bounces.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        max_depth: Option<u32>,
        /// Layer to show instead of light, empty for light.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        aov: Option<String>,
        /// Name of an acceleration structure.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        accelerator: Option<String>,
    },
    /// Changes another setting of the render, one of [`Choices::settings`].
    Set {
        /// The name of the setting.
        name: String,
        /// A name or number; null for the value when the scene was opened.
        #[cfg_attr(test, ts(type = "unknown"))]
        value: Value,
    },
    /// Sets exposure and tone map of frames while something moves (at rest the page applies them).
    Display {
        /// Exposure in stops.
        exposure: f64,
        /// Name of a tone map.
        tonemap: String,
    },
    /// Changes the scene, as `key=value` of `snell render -D`.
    Edit {
        /// Path of the parameter in the scene.
        key: String,
        /// New value.
        #[cfg_attr(test, ts(type = "unknown"))]
        value: Value,
    },
    /// Several changes of the scene, as one step of the history.
    Edits {
        /// Pairs of a key and a value, as in [`Self::Edit`].
        #[cfg_attr(test, ts(type = "[string, unknown][]"))]
        edits: Vec<(String, Value)>,
        /// The number of the gesture that makes the changes: those of one gesture are one step.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        gesture: Option<u32>,
    },
    /// Shows another moment of the scene's motion.
    Time {
        /// The name of the animation; `None` for those that are usually played.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        clip: Option<String>,
        /// The time in seconds.
        time: f64,
    },
    /// Hides or shows a node and its descendants.
    Show {
        /// Number of the node.
        node: u32,
        /// True to show the node.
        visible: bool,
    },
    /// Undoes the last change of the scene or move of the camera.
    Undo,
    /// Redoes what was undone last.
    Redo,
    /// Reloads the scene's file.
    Reload,
    /// Asks which surface is at a pixel (from the upper left corner).
    Pick {
        /// Number that the answer repeats.
        id: u32,
        /// Position in pixels.
        pixel: [f64; 2],
        /// How far away another surface may be if none is there, in pixels.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<f64>", optional))]
        reach: f64,
    },
    /// Asks where something stands, and which pixels show it.
    Select {
        /// Number that the answer repeats.
        id: u32,
        /// Numbers of the nodes from the root to the selected one.
        path: Vec<u32>,
        /// Width of the mask in pixels; 0 for none.
        width: u32,
        /// The number of a surface of the last node, and of one of its primitives, to be told their
        /// material.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        surface: Option<[u32; 2]>,
    },
    /// Asks for an explanation of a pixel of the picture at rest.
    Explain {
        /// Number that the answer repeats.
        id: u32,
        /// Column and row of the pixel.
        pixel: [u32; 2],
        /// Number of the sample to show; `None` for a typical one.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        sample: Option<u32>,
        /// True to follow rays through all structures, even if it takes long to build them.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<bool>", optional))]
        all: bool,
    },
    /// A frame has been shown.
    Ack {
        /// Number of the frame.
        frame: u32,
    },
    /// Requests control of the view.
    Steer,
}

/// A message to the page.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum ToPage {
    /// The first message of a connection.
    Welcome {
        /// Version of the protocol: [`VERSION`].
        version: u32,
        /// Number of this page among the connected ones.
        client: u32,
        /// Names to choose from.
        choices: Choices,
        /// True if no scene was named: the page offers some.
        is_gallery: bool,
    },
    /// The current scene.
    Scene {
        /// The contents of the scene.
        scene: Box<SceneInfo>,
    },
    /// The current render settings.
    View {
        /// The settings and the camera.
        view: ViewInfo,
    },
    /// Tells which page has control.
    Steering {
        /// Number of the page.
        client: u32,
        /// Number of connected pages.
        watching: u32,
    },
    /// Answers which surface is at a pixel.
    Picked {
        /// The number of the request.
        id: u32,
        /// The surface; `None` if the ray leaves the scene.
        hit: Option<PickedHit>,
    },
    /// Where something stands, and which pixels show it.
    Selected {
        /// The number of the request.
        id: u32,
        /// The place; `None` if the scene has no such path.
        place: Option<Placement>,
        /// The pixels; `None` if they were not asked for, or the scene is still being prepared.
        mask: Option<Mask>,
        /// Number of the material of the surface that was asked for, if it has one.
        material: Option<u32>,
    },
    /// Explains a pixel.
    Explained {
        /// The number of the request.
        id: u32,
        /// The answer; `None` after an error, which was reported before.
        report: Option<Box<Report>>,
    },
    /// An error; the previous state is kept.
    Error {
        /// Message for the user.
        message: String,
    },
    /// Something to know, which is no error.
    Notice {
        /// Message for the user.
        message: String,
    },
    /// Tells what the server is doing; the message is empty when the work is done.
    Busy {
        /// Message for the user.
        message: String,
    },
}

/// Names to choose from.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Choices {
    /// Names of integrators.
    pub integrators: Vec<String>,
    /// Names of layers.
    pub aovs: Vec<String>,
    /// Names of tone maps.
    pub tonemaps: Vec<String>,
    /// Names of acceleration structures.
    pub accelerators: Vec<String>,
    /// Built-in scenes.
    pub scenes: Vec<SceneChoice>,
    /// The parameters of materials, lights and patterns, by the name of their family.
    pub forms: BTreeMap<String, Form>,
    /// A thing of each kind with its defaults, by family and kind.
    #[cfg_attr(test, ts(type = "Record<string, Record<string, Record<string, unknown>>>"))]
    pub examples: BTreeMap<String, BTreeMap<String, Value>>,
    /// Settings of the render that have no control of their own.
    pub settings: Vec<SettingForm>,
    /// Maximum size in bytes of a file that is dropped on the page.
    #[cfg_attr(test, ts(type = "number"))]
    pub max_upload: u64,
}

/// A built-in scene.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SceneChoice {
    /// The name of the scene.
    pub name: String,
    /// What the scene shows.
    pub description: String,
}

/// The contents of a scene.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SceneInfo {
    /// The name of the scene.
    pub name: String,
    /// Increases with every change of the scene.
    pub generation: u32,
    /// The tree, parents before children; a node that several nodes share is listed once.
    pub nodes: Vec<NodeInfo>,
    /// Number of nodes left out because there are too many.
    pub nodes_left_out: u32,
    /// Materials with their parameters.
    #[cfg_attr(test, ts(type = "Record<string, unknown>[]"))]
    pub materials: Vec<Value>,
    /// Lights with their parameters.
    #[cfg_attr(test, ts(type = "Record<string, unknown>[]"))]
    pub lights: Vec<Value>,
    /// Cameras with their parameters.
    #[cfg_attr(test, ts(type = "Camera[]"))]
    pub cameras: Vec<Value>,
    /// Textures with their parameters.
    #[cfg_attr(test, ts(type = "Record<string, unknown>[]"))]
    pub textures: Vec<Value>,
    /// Number of images.
    pub images: u32,
    /// A texture of an image, placed as those of the scene are: what a new one begins with.
    #[cfg_attr(test, ts(type = "Record<string, unknown>"))]
    pub new_texture: Value,
    /// Light from all around.
    pub surroundings: Surroundings,
    /// The node that alone is shown, if there is one.
    pub isolated: Option<u32>,
    /// The motion of the scene; none if nothing moves.
    pub motion: Option<MotionInfo>,
    /// Minimum and maximum corner of the box around everything finite.
    pub bounds: [[f64; 3]; 2],
    /// Minimum and maximum corner of the box around the subject: everything but the ground, walls
    /// and sky around it.
    pub subject: [[f64; 3]; 2],
    /// Height of the ground under the subject, along the up direction; `None` without one.
    pub ground: Option<f64>,
    /// The up direction.
    pub up: [f64; 3],
    /// Number of triangles; a mesh counts once per instance.
    #[cfg_attr(test, ts(type = "number"))]
    pub triangles: u64,
    /// Number of shapes, such as spheres, and of pieces of curves.
    #[cfg_attr(test, ts(type = "number"))]
    pub shapes: u64,
    /// Warnings from reading and compiling.
    pub warnings: Vec<String>,
}

/// The motion of a scene.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct MotionInfo {
    /// The animations.
    pub clips: Vec<ClipInfo>,
    /// First and last time of those that are usually played, in seconds.
    pub usual: [f64; 2],
    /// The animation that is shown; none for those that are usually played.
    pub clip: Option<String>,
    /// The time that is shown, in seconds; none while the scene rests as its file has it.
    pub time: Option<f64>,
}

/// An animation.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct ClipInfo {
    /// The name, or the number of one that has none.
    pub name: String,
    /// First and last time in seconds.
    pub span: [f64; 2],
}

/// Light from all around, and what is seen behind the scene.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Surroundings {
    /// The sort of environment: `none`, `color`, or `image`.
    pub environment: String,
    /// The radiance of an environment of one colour, or the factor on that of an image.
    pub light: [f32; 3],
    /// Rotation of an image about the up direction, in degrees.
    pub rotation: f64,
    /// The sort of background: `environment`, `color`, `transparent`, or `studio`, a colour with
    /// the scene's shadow on a floor.
    pub background: String,
    /// The colour of the background, if it has one.
    pub color: Option<[f32; 3]>,
}

/// A node.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct NodeInfo {
    /// Number of the node.
    pub id: u32,
    /// Number of the parent under which the node is listed; none for the root.
    pub parent: Option<u32>,
    /// The name of the node.
    pub name: String,
    /// Descriptions of the node's surfaces.
    pub surfaces: Vec<String>,
    /// False if the node was hidden.
    pub visible: bool,
}

/// The render settings and camera of the picture.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct ViewInfo {
    /// The camera.
    #[cfg_attr(test, ts(type = "Camera"))]
    pub camera: Value,
    /// Increases when the camera changes other than by [`ToServer::Camera`]: by an undo, a request
    /// for one of the scene's cameras, another size, another scene. The page then takes the camera.
    pub camera_changes: u32,
    /// Whether there is a step to undo, and one to redo.
    pub history: [bool; 2],
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Integrator at rest.
    pub integrator: String,
    /// Layer shown instead of light; empty for light.
    pub aov: String,
    /// Samples per pixel at rest.
    pub spp: u32,
    /// Maximum number of bounces.
    pub max_depth: u32,
    /// Acceleration structure.
    pub accelerator: String,
    /// The values of [`Choices::settings`] that are set, by name.
    pub settings: BTreeMap<String, String>,
    /// Exposure in stops.
    pub exposure: f64,
    /// Tone map.
    pub tonemap: String,
    /// True if display values have the sRGB curve.
    pub srgb: bool,
    /// The command that renders the picture at rest.
    pub command: String,
}

/// The surface at a pixel.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct PickedHit {
    /// Position of the hit in the world.
    pub position: [f64; 3],
    /// Shading normal at the hit.
    pub normal: [f64; 3],
    /// Distance from the camera.
    pub distance: f64,
    /// The node that holds the surface; none if it is not known.
    pub node: Option<u32>,
    /// Names of the nodes from the root to the one that holds the surface.
    pub path: Vec<String>,
    /// Numbers of these nodes.
    pub nodes: Vec<u32>,
    /// Number of the material, if it is one of the scene's.
    pub material: Option<u32>,
    /// The name of the material.
    pub material_name: String,
    /// Number of the surface among those of the node.
    pub surface: u32,
    /// Number of the triangle or face.
    pub primitive: u32,
    /// Minimum and maximum corner of the box around the node, in the world.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Geometric normal at the hit, on the side that is seen.
    pub facing: [f64; 3],
    /// Length of the ray from the hit against the normal to the opposite side of the body; none if
    /// there is no opposite side.
    pub thickness: Option<f64>,
    /// Corners of the face in the world, in order; empty for shapes, which have none.
    pub corners: Vec<[f64; 3]>,
    /// For each corner, whether the edge to the next corner is a border or sharp.
    pub sharp: Vec<bool>,
}

/// The beginning of a binary message, little endian, [`PartHeader::SIZE`] bytes. A picture is sent
/// in parts, which are joined in order, so that another can take its place on a slow line. Each
/// part is acknowledged, the last one when the picture is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartHeader {
    /// Number of the frame. A part of another frame ends one that is not complete.
    pub frame: u32,
    /// Position of the part in the frame in bytes.
    pub offset: u32,
    /// Bytes of the whole frame.
    pub total: u32,
}

impl PartHeader {
    /// Size in bytes.
    pub const SIZE: usize = 12;

    /// The header as bytes.
    pub fn to_bytes(self) -> [u8; Self::SIZE] {
        bytes_of([self.frame, self.offset, self.total])
    }
}

/// Words as little-endian bytes.
fn bytes_of<const WORDS: usize, const SIZE: usize>(words: [u32; WORDS]) -> [u8; SIZE] {
    let mut bytes = [0; SIZE];
    for (place, word) in bytes.chunks_exact_mut(4).zip(words) {
        place.copy_from_slice(&word.to_le_bytes());
    }
    bytes
}

/// Where a selected node stands.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Placement {
    /// The node that moves: the last of the path that stands in one place only.
    pub node: u32,
    /// The name of the node.
    pub name: String,
    /// Number of nodes from the root to the node, which counts.
    pub depth: u32,
    /// Map from the node's parent to the world, in rows.
    pub world_from_parent: [[f64; 4]; 3],
    /// The node's transform, in rows.
    pub parent_from_node: [[f64; 4]; 3],
    /// Minimum and maximum corner of the box around the node's surfaces and those below it, in its
    /// own coordinates; none if there are none, or they are infinite.
    pub bounds: Option<[[f64; 3]; 2]>,
}

/// Pixels of a picture that show something.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Mask {
    /// Width and height.
    pub size: [u32; 2],
    /// Lengths of runs of pixels, row by row: some that do not show it, some that do, and so on.
    pub runs: Vec<u32>,
}

/// The header before the bytes of a picture, little endian, [`FrameHeader::SIZE`] bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameHeader {
    /// 0: JPEG of display values. 1: red, green, blue as 16-bit floats, scene-linear, compressed
    /// (see `crates/viewer/src/halves.rs`).
    pub kind: u32,
    /// Number of the frame, to be acknowledged.
    pub frame: u32,
    /// Number of the last camera that the frame shows.
    pub seq: u32,
    /// Generation of the scene that the frame shows.
    pub generation: u32,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// Requested samples per pixel; 0 while something moves.
    pub wanted: u32,
    /// Milliseconds spent on the picture: on this frame while moving, on all samples at rest.
    pub milliseconds: f32,
    /// Estimated relative noise: the square root of the mean variance, over the mean. NaN if
    /// unknown.
    pub noise: f32,
    /// Share of a denoised picture in what is shown, from 0 to 1; 0 for the true samples.
    pub denoised: f32,
}

impl FrameHeader {
    /// Size in bytes.
    pub const SIZE: usize = 44;

    /// The header as bytes.
    pub fn to_bytes(self) -> [u8; Self::SIZE] {
        bytes_of([
            self.kind,
            self.frame,
            self.seq,
            self.generation,
            self.size[0],
            self.size[1],
            self.samples,
            self.wanted,
            self.milliseconds.to_bits(),
            self.noise.to_bits(),
            self.denoised.to_bits(),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain;
    use ts_rs::TS;

    /// The text of `web/src/protocol.gen.ts`.
    fn typescript() -> String {
        let config = ts_rs::Config::default();
        let mut text = String::from(
            "// Generated from crates/viewer/src/protocol.rs by `SNELL_PROTOCOL=accept cargo test \
                -p snell-viewer protocol`.\n\
             import type { Camera } from \"./camera\";\n\n",
        );
        text += &format!(
            "export const VERSION = {VERSION};\nexport const HEADER_SIZE = {};\n\
                export const PART_SIZE = {};\n",
            FrameHeader::SIZE,
            PartHeader::SIZE,
        );
        let declarations = [
            ToServer::decl(&config),
            ToPage::decl(&config),
            Choices::decl(&config),
            Form::decl(&config),
            SceneChoice::decl(&config),
            SceneInfo::decl(&config),
            MotionInfo::decl(&config),
            ClipInfo::decl(&config),
            Surroundings::decl(&config),
            NodeInfo::decl(&config),
            SettingForm::decl(&config),
            ViewInfo::decl(&config),
            PickedHit::decl(&config),
            Placement::decl(&config),
            Mask::decl(&config),
            Report::decl(&config),
            explain::Point::decl(&config),
            explain::PathClass::decl(&config),
            explain::SampleReport::decl(&config),
            explain::VertexReport::decl(&config),
            explain::LightReport::decl(&config),
            explain::TraceReport::decl(&config),
            explain::StepReport::decl(&config),
        ];
        for declaration in declarations {
            text += &format!("\nexport {declaration}\n");
        }
        text
    }

    #[test]
    fn the_types_of_the_page_are_those_of_the_server() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../web/src/protocol.gen.ts");
        let text = typescript();
        if std::env::var_os("SNELL_PROTOCOL").is_some_and(|v| v == "accept") {
            std::fs::write(path, &text).expect("the file can be written");
        }
        let there = std::fs::read_to_string(path).unwrap_or_default();
        assert!(
            there == text,
            "web/src/protocol.gen.ts is out of date: run with SNELL_PROTOCOL=accept, then build \
                the page"
        );
    }

    #[test]
    fn messages_are_understood_and_unknown_parameters_refused() {
        let message: ToServer =
            serde_json::from_str(r#"{"type":"render","spp":5}"#).expect("a message");
        assert!(matches!(message, ToServer::Render { spp: Some(5), integrator: None, .. }));
        assert!(serde_json::from_str::<ToServer>(r#"{"type":"render","sp":5}"#).is_err());
        assert!(serde_json::from_str::<ToServer>(r#"{"type":"nonsense"}"#).is_err());
    }
}
