//! A scene made ready to be rendered: compiled, with a camera and light if it has none. Kept between renders.

use crate::contents::Contents;
use crate::graph::graph;
use snell_intersect::{BuildOptions, Quality};
use snell_render::CompiledScene;
use snell_scene::framing::{FramingOptions, prepare};
use snell_scene::{Camera, Scene, SceneSettings};

/// What the result depends on, beside the scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// How the structures are built.
    pub quality: Quality,
    /// Size of the picture, for a camera that frames the scene.
    pub size: [u32; 2],
}

/// A scene ready to be rendered.
#[derive(Debug)]
pub struct Prepared {
    /// What is compiled.
    pub scene: Scene,
    /// What is rendered.
    pub compiled: CompiledScene,
    /// At least one.
    pub cameras: Vec<Camera>,
    /// What the scene's file asks for.
    pub hints: SceneSettings,
    /// Usually the file's name.
    pub name: String,
    /// What the reader and the compiler had to say.
    pub warnings: Vec<String>,
}

impl Prepared {
    /// Prepares what a scene holds.
    pub fn new(contents: &Contents, request: &Request) -> Result<Self, String> {
        let mut scene = graph(contents)?;
        prepare(&mut scene, &FramingOptions { size: request.size, ..FramingOptions::default() })
            .map_err(|e| e.to_string())?;
        let options = BuildOptions { quality: request.quality, ..BuildOptions::default() };
        let compiled = CompiledScene::new(&scene, &options).map_err(|e| e.to_string())?;
        let shown = |warning: &snell_scene::Warning| match warning.count {
            1 => warning.message.clone(),
            n => format!("{} ({n} times)", warning.message),
        };
        let mut warnings: Vec<String> = scene.warnings.iter().chain(&compiled.warnings).map(shown).collect();
        warnings.extend(compiled.world.warnings().iter().map(ToString::to_string));
        let (cameras, hints, name) = (scene.cameras.clone(), scene.settings.clone(), scene.name.clone());
        Ok(Self { scene, compiled, cameras, hints, name, warnings })
    }
}
