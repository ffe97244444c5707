//! The animation of a scene: it is prepared for its motion when a time is first asked for.

use crate::protocol::{ClipInfo, MotionInfo};
use snell_scene::{Motion, NodeId, Player, Pose, Scene};
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

/// A scene whose motion is prepared: what is made for it, such as a camera, suits all of its poses.
pub struct Animated {
    /// The scene before any pose.
    pub scene: Scene,
    /// The player of the chosen animations.
    player: Mutex<Player>,
}

/// Prepares a scene for an animation by name, or for those that are usually played. The error is a
/// message for the user.
pub type Prepare = dyn Fn(Option<&str>) -> Result<Animated, String> + Send + Sync;

impl Animated {
    /// A scene with the player of its motion.
    pub fn new(scene: Scene, player: Player) -> Self {
        Self { scene, player: Mutex::new(player) }
    }

    /// The pose at a time in seconds.
    pub fn pose(&self, time: f64) -> Pose {
        self.player.lock().unwrap_or_else(PoisonError::into_inner).pose(time)
    }

    /// The nodes that move.
    pub fn moving_nodes(&self) -> BTreeSet<NodeId> {
        self.player.lock().unwrap_or_else(PoisonError::into_inner).moving_nodes()
    }
}

/// The moment that is shown.
#[derive(Clone)]
pub struct Moment {
    /// The name of the animation; none for those that are usually played.
    pub clip: Option<String>,
    /// The time in seconds.
    pub time: f64,
    /// The scene, prepared for the animation.
    pub animated: Arc<Animated>,
}

/// What the page needs to play the motion of a scene; `None` if nothing moves.
pub fn motion_info(motion: Option<&Motion>, moment: Option<&Moment>) -> Option<MotionInfo> {
    let motion = motion?;
    let usual: Vec<_> = motion.usual_clips().iter().map(|&i| motion.clips[i].span()).collect();
    let span = usual.into_iter().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])?;
    let name = |i: usize, name: &str| match name {
        "" => i.to_string(),
        name => name.to_string(),
    };
    let clips = motion.clips.iter().enumerate();
    let clips = clips.map(|(i, clip)| ClipInfo { name: name(i, &clip.name), span: clip.span() });
    Some(MotionInfo {
        clips: clips.collect(),
        usual: span,
        clip: moment.and_then(|moment| moment.clip.clone()),
        time: moment.map(|moment| moment.time),
    })
}
