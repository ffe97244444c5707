//! The peer that Snell is compared with: `--peer embree=PATH`.

use crate::failure::Failure;
use snell_embree::{Device, Embree, Mode, PeerScene, SceneOptions};
use snell_intersect::World;
use std::path::PathBuf;
use std::sync::Arc;

/// A peer on the command line.
#[derive(Clone, Debug)]
pub struct PeerPath(PathBuf);

/// Reads `embree=PATH`.
pub fn parse_peer(text: &str) -> Result<PeerPath, String> {
    match text.split_once('=') {
        Some(("embree", path)) if !path.is_empty() => Ok(PeerPath(path.into())),
        _ => Err(format!(
            "\"{text}\" is not a peer; write embree=PATH, where PATH is the library of Embree \
                4 or the wheel `embreex` of PyPI"
        )),
    }
}

impl PeerPath {
    /// Loads the library.
    pub fn load(&self) -> Result<Arc<Embree>, Failure> {
        Embree::load(&self.0).map_err(|e| Failure::Other(e.to_string()))
    }
}

/// Embree, ready to build.
pub struct Peer {
    device: Arc<Device>,
}

impl Peer {
    /// Loads Embree with this many build threads. Only one device may exist at a time: see
    /// [`Device::new`].
    pub fn new(embree: &Arc<Embree>, threads: usize) -> Result<Self, Failure> {
        Ok(Self {
            device: Device::new(embree, threads).map_err(|e| Failure::Other(e.to_string()))?,
        })
    }

    /// The version, such as `4.4.0`.
    pub fn version(&self) -> String {
        self.device.version()
    }

    /// Builds a world with Embree.
    pub fn build(&self, world: &World, options: SceneOptions) -> Result<PeerScene, Failure> {
        PeerScene::build(&self.device, world, options).map_err(|e| Failure::Scene(e.to_string()))
    }
}

/// A scene, and the mode in which it is queried.
#[derive(Clone, Copy, Debug)]
pub struct Contender<'a> {
    pub scene: &'a PeerScene,
    pub mode: Mode,
}

impl Contender<'_> {
    /// A name such as `16 coherent, medium`.
    pub fn name(&self) -> String {
        let options = self.scene.options();
        let robust = if options.robust { ", robust" } else { "" };
        format!("{}, {}{robust}", self.mode.name(), options.quality.name())
    }

    /// True if the contender's scene was built robust.
    pub fn is_robust(&self) -> bool {
        self.scene.options().robust
    }
}

/// Every query mode for some scenes, or only those with one ray per call.
pub fn contenders(scenes: &[PeerScene], one_ray: bool) -> Vec<Contender<'_>> {
    let modes = if one_ray { &[Mode::ONE][..] } else { &Mode::ALL };
    scenes
        .iter()
        .flat_map(|scene| modes.iter().map(move |&mode| Contender { scene, mode }))
        .collect()
}
