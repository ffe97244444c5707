//! The messages between page and server over the WebSocket: JSON text both ways, and pictures as
//! binary messages to the page. The TypeScript types in `web/src/protocol.gen.ts` are generated
//! from these; a test checks that they are up to date.

use crate::explain::Report;
use crate::forms::{Form, SettingForm};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// The version, which changes when old pages become incompatible with new servers.
pub const VERSION: u32 = 1;

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
    /// Hides or shows a node and its descendants.
    Show {
        /// Number of the node.
        node: u32,
        /// True to show the node.
        visible: bool,
    },
    /// Undoes the last change of the scene.
    Undo,
    /// Redoes the last change that was undone.
    Redo,
    /// Reloads the scene's file.
    Reload,
    /// Asks which surface is at a pixel (from the upper left corner).
    Pick {
        /// Number that the answer repeats.
        id: u32,
        /// Position in pixels.
        pixel: [f64; 2],
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
        scene: SceneInfo,
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
    /// The parameters of materials and lights, by the name of their family.
    pub forms: BTreeMap<String, Form>,
    /// Settings of the render that have no control of their own.
    pub settings: Vec<SettingForm>,
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
    /// Rotation of the environment about the up direction, in degrees; `None` without an
    /// environment, or for a uniform one.
    pub environment_rotation: Option<f64>,
    /// Minimum and maximum corner of the box around everything finite.
    pub bounds: [[f64; 3]; 2],
    /// The up direction.
    pub up: [f64; 3],
    /// Number of triangles; a mesh counts once per instance.
    #[cfg_attr(test, ts(type = "number"))]
    pub triangles: u64,
    /// Warnings from reading and compiling.
    pub warnings: Vec<String>,
    /// Whether there is a change to undo, and one to redo.
    pub history: [bool; 2],
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
    /// Number of the material, if it is one of the scene's.
    pub material: Option<u32>,
    /// The name of the material.
    pub material_name: String,
    /// Number of the triangle or face.
    pub primitive: u32,
}

/// The header before the bytes of a picture, little endian, [`FrameHeader::SIZE`] bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameHeader {
    /// 0: JPEG of display values. 1: red, green, blue as 16-bit floats, scene-linear.
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
}

impl FrameHeader {
    /// Size in bytes.
    pub const SIZE: usize = 40;

    /// The header as bytes.
    pub fn to_bytes(self) -> [u8; Self::SIZE] {
        let words = [
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
        ];
        let mut bytes = [0; Self::SIZE];
        for (place, word) in bytes.chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        bytes
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
            "export const VERSION = {VERSION};\nexport const HEADER_SIZE = {};\n",
            FrameHeader::SIZE
        );
        let declarations = [
            ToServer::decl(&config),
            ToPage::decl(&config),
            Choices::decl(&config),
            Form::decl(&config),
            SceneChoice::decl(&config),
            SceneInfo::decl(&config),
            NodeInfo::decl(&config),
            SettingForm::decl(&config),
            ViewInfo::decl(&config),
            PickedHit::decl(&config),
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
