//! A scene that is ready to be rendered: compiled, and with a camera and light if it had none. It
//! is kept between renders.

use crate::contents::Contents;
use crate::graph::{Purpose, graph_with_origins};
use crate::memory::admit;
use crate::origins::Origins;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use snell_intersect::BuildOptions;
use snell_math::DVec3;
use snell_render::{CompiledScene, Moving};
use snell_scene::framing::{FramingOptions, bring_near, prepare};
use snell_scene::{Player, Scene};
use std::sync::OnceLock;

/// The options that decide, together with the scene, what is prepared.
#[derive(Clone, Debug)]
pub struct Request {
    /// The options of building acceleration structures.
    pub build: BuildOptions,
    /// Size of the picture, for a camera that frames the scene.
    pub size: [u32; 2],
    /// The times at which the shutter opens and closes; `None` for a picture of the scene at rest.
    pub shutter: Option<[f64; 2]>,
}

impl PartialEq for Request {
    fn eq(&self, other: &Self) -> bool {
        let what = |r: &Self| {
            (r.build.quality, r.build.accelerator, r.build.cache.clone(), r.size, r.shutter)
        };
        what(self) == what(other)
    }
}

/// A scene ready to be rendered.
#[derive(Debug)]
pub struct Prepared {
    /// The compiled scene.
    pub compiled: CompiledScene,
    /// The scene graph that was compiled, with at least one camera. (Its meshes and textures are
    /// not copied, but shared with the Python scene.)
    pub scene: Scene,
    /// The objects that the nodes of the scene graph stand for.
    pub origins: Origins,
    /// By how much the scene was moved, because it is far from zero for its size.
    pub moved_by: DVec3,
    /// The warnings of the reader and the compiler.
    pub warnings: Vec<String>,
    /// The hash of the file that holds the scene, once it is known.
    pub file_hash: OnceLock<String>,
}

impl Prepared {
    /// Prepares the contents of a scene.
    pub fn new(contents: &Contents, request: &Request) -> PyResult<Self> {
        let failed = |error: &dyn std::fmt::Display| PyValueError::new_err(error.to_string());
        let (mut scene, origins) =
            graph_with_origins(contents, Purpose::Picture).map_err(PyValueError::new_err)?;
        scene.limit_light();
        let moving = match request.shutter {
            None => {
                scene.motion = None;
                Moving::default()
            }
            Some(shutter) => open_shutter(&mut scene, shutter)?,
        };
        // Positions from Python are moved when they come, and those of pictures are moved back.
        let moved_by = bring_near(&mut scene).map_err(|e| failed(&e))?.unwrap_or_default();
        let framing = FramingOptions { size: request.size, ..FramingOptions::default() };
        prepare(&mut scene, &framing).map_err(|e| failed(&e))?;
        admit("the scene ready to be rendered", snell_render::memory::of_scene(&scene))?;
        let compiled = CompiledScene::moving(&scene, &moving, &request.build, None);
        let compiled = compiled.map_err(|e| failed(&e))?;
        let warnings = scene.warnings.iter().chain(&compiled.warnings);
        let warnings = warnings.map(snell_scene::Warning::to_string).collect();
        Ok(Self { compiled, scene, origins, moved_by, warnings, file_hash: OnceLock::new() })
    }
}

/// Poses a scene as it is when the shutter opens; returns how it moves until the shutter closes.
fn open_shutter(scene: &mut Scene, [open, close]: [f64; 2]) -> PyResult<Moving> {
    let Some(motion) = scene.motion.clone() else {
        return Err(PyValueError::new_err(
            "shutter: nothing in the scene moves; update_transform(id, transforms, times) lets an \
                object move",
        ));
    };
    let clips = motion.usual_clips();
    let mut player = Player::new(motion, clips);
    let mut poses = player.poses_between(open, close);
    let later = poses.split_off(1);
    poses.iter().for_each(|pose| scene.apply(pose));
    Ok(Moving { nodes: player.moving_nodes(), later })
}
