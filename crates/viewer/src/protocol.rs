//! What page and server say to each other over the WebSocket: JSON text both ways, and pictures as
//! binary messages to the page. The TypeScript types in `web/src/protocol.gen.ts` are generated
//! from these; a test proves them fresh.

use crate::explain::Report;
use crate::forms::Form;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Changes when old pages cannot talk to new servers.
pub const VERSION: u32 = 1;

/// From the page.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ToServer {
    /// The camera has moved.
    Camera {
        /// Counts up; frames name the last one that they show.
        seq: u32,
        /// All of the camera.
        #[cfg_attr(test, ts(type = "Camera"))]
        camera: Value,
    },
    /// Size of the picture in pixels.
    Size {
        /// Width and height.
        size: [u32; 2],
    },
    /// How light is computed. What is absent stays.
    Render {
        /// Name of an integrator.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        integrator: Option<String>,
        /// Samples per pixel at rest.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        spp: Option<u32>,
        /// Bounces.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        max_depth: Option<u32>,
        /// Layer to show instead of light, empty for light.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        aov: Option<String>,
        /// Acceleration structure.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        accelerator: Option<String>,
    },
    /// Exposure and tone map of frames while something moves (at rest the page does it).
    Display {
        /// Stops.
        exposure: f64,
        /// Name of a tone map.
        tonemap: String,
    },
    /// Changes the scene: the `key=value` of `snell render -D`.
    Edit {
        /// Path into the scene.
        key: String,
        /// New value.
        #[cfg_attr(test, ts(type = "unknown"))]
        value: Value,
    },
    /// Hides or shows a node with all below it.
    Show {
        /// Its number.
        node: u32,
        /// Whether it is seen.
        visible: bool,
    },
    /// Takes back the last change of the scene.
    Undo,
    /// Makes it again.
    Redo,
    /// Reads the scene's file again.
    Reload,
    /// What is at a pixel (from the upper left corner)?
    Pick {
        /// Returned with the answer.
        id: u32,
        /// Position in pixels.
        pixel: [f64; 2],
    },
    /// Why does a pixel of the picture at rest look as it does?
    Explain {
        /// Returned with the answer.
        id: u32,
        /// The pixel.
        pixel: [u32; 2],
        /// The sample to show; none for a typical one.
        #[serde(default)]
        #[cfg_attr(test, ts(optional = nullable))]
        sample: Option<u32>,
        /// Whether rays are followed through all structures, however long it takes to build them.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<bool>", optional))]
        all: bool,
    },
    /// A frame has been shown.
    Ack {
        /// Its number.
        frame: u32,
    },
    /// This page wants to steer.
    Steer,
}

/// To the page.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum ToPage {
    /// First message of a connection.
    Welcome {
        /// [`VERSION`].
        version: u32,
        /// Number of this page among those that watch.
        client: u32,
        /// Names to choose from.
        choices: Choices,
        /// True if nobody has named a scene: the page offers some.
        is_gallery: bool,
    },
    /// The scene as it is now.
    Scene {
        /// What is in it.
        scene: SceneInfo,
    },
    /// How it is rendered now.
    View {
        /// The state.
        view: ViewInfo,
    },
    /// Who steers now.
    Steering {
        /// Number of the page.
        client: u32,
        /// Number of pages that watch.
        watching: u32,
    },
    /// What is at a pixel.
    Picked {
        /// The number of the question.
        id: u32,
        /// Nothing if the ray leaves the scene.
        hit: Option<PickedHit>,
    },
    /// Why a pixel looks as it does.
    Explained {
        /// The number of the question.
        id: u32,
        /// The answer; none if there is an error, which was told before.
        report: Option<Box<Report>>,
    },
    /// Something went wrong; what was there before still is.
    Error {
        /// For people.
        message: String,
    },
    /// Something that is being done, or empty.
    Busy {
        /// For people.
        message: String,
    },
}

/// Names to choose from.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Choices {
    /// Integrators.
    pub integrators: Vec<String>,
    /// Layers.
    pub aovs: Vec<String>,
    /// Tone maps.
    pub tonemaps: Vec<String>,
    /// Acceleration structures.
    pub accelerators: Vec<String>,
    /// Built-in scenes.
    pub scenes: Vec<SceneChoice>,
    /// The parameters of materials and lights, by the name of their family.
    pub forms: BTreeMap<String, Form>,
}

/// A built-in scene.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SceneChoice {
    /// Its name.
    pub name: String,
    /// What is to be seen.
    pub description: String,
}

/// What is in a scene.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SceneInfo {
    /// Its name.
    pub name: String,
    /// Counts up with every change of the scene.
    pub generation: u32,
    /// The tree, parents before children; a node that several nodes share stands once.
    pub nodes: Vec<NodeInfo>,
    /// Nodes that are not listed because there are too many.
    pub nodes_left_out: u32,
    /// Materials with their parameters.
    #[cfg_attr(test, ts(type = "Record<string, unknown>[]"))]
    pub materials: Vec<Value>,
    /// Lights with their parameters.
    #[cfg_attr(test, ts(type = "Record<string, unknown>[]"))]
    pub lights: Vec<Value>,
    /// Cameras.
    #[cfg_attr(test, ts(type = "Camera[]"))]
    pub cameras: Vec<Value>,
    /// How far its environment is turned about up, in degrees; none if there is none, or one that
    /// is the same all around.
    pub environment_rotation: Option<f64>,
    /// Corners of the box around all that is finite.
    pub bounds: [[f64; 3]; 2],
    /// Direction that is up.
    pub up: [f64; 3],
    /// Triangles, each mesh counted as often as it is seen.
    #[cfg_attr(test, ts(type = "number"))]
    pub triangles: u64,
    /// What reading and compiling had to say.
    pub warnings: Vec<String>,
    /// Whether there is a change to take back, and one to make again.
    pub history: [bool; 2],
}

/// A node.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct NodeInfo {
    /// Its number.
    pub id: u32,
    /// Number of the parent it is listed under; none for the root.
    pub parent: Option<u32>,
    /// Its name.
    pub name: String,
    /// What it holds.
    pub surfaces: Vec<String>,
    /// False if it was hidden.
    pub visible: bool,
}

/// How the scene is rendered.
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
    /// Bounces.
    pub max_depth: u32,
    /// Acceleration structure.
    pub accelerator: String,
    /// Exposure in stops.
    pub exposure: f64,
    /// Tone map.
    pub tonemap: String,
    /// True if display values have the sRGB curve.
    pub srgb: bool,
    /// The command that makes the picture at rest.
    pub command: String,
}

/// What a pixel shows.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct PickedHit {
    /// Where, in the world.
    pub position: [f64; 3],
    /// Shading normal.
    pub normal: [f64; 3],
    /// Distance from the camera.
    pub distance: f64,
    /// The node that holds the surface, if it is known.
    pub node: Option<u32>,
    /// Names from the root to it.
    pub path: Vec<String>,
    /// Number of the material, if it is one of the scene's.
    pub material: Option<u32>,
    /// Its name.
    pub material_name: String,
    /// Triangle or face.
    pub primitive: u32,
}

/// What comes before the bytes of a picture, little endian, [`FrameHeader::SIZE`] bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameHeader {
    /// 0: JPEG of display values. 1: red, green, blue as 16-bit floats, scene-linear.
    pub kind: u32,
    /// Number of the frame, to be acknowledged.
    pub frame: u32,
    /// The last camera that it shows.
    pub seq: u32,
    /// Generation of the scene that it shows.
    pub generation: u32,
    /// Pixels.
    pub size: [u32; 2],
    /// Samples per pixel.
    pub samples: u32,
    /// Samples per pixel that are asked for; 0 while something moves.
    pub wanted: u32,
    /// Milliseconds spent on the picture: on this frame while moving, on all samples at rest.
    pub milliseconds: f32,
    /// Estimated relative noise: the root of the mean variance over the mean. Not a number where
    /// unknown.
    pub noise: f32,
}

impl FrameHeader {
    /// Bytes.
    pub const SIZE: usize = 40;

    /// The bytes.
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
            ViewInfo::decl(&config),
            PickedHit::decl(&config),
            Report::decl(&config),
            explain::Point::decl(&config),
            explain::PathClass::decl(&config),
            explain::SampleReport::decl(&config),
            explain::VertexReport::decl(&config),
            explain::LightReport::decl(&config),
            explain::JourneyReport::decl(&config),
            explain::StopReport::decl(&config),
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
