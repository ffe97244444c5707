//! Animated scenes: the changes over time that a file describes, and the scene at one time.
//!
//! A [`Motion`] is a skeleton of [`Joint`]s (a tree in which each has a placement), [`Clip`]s of
//! keyframed curves that move them, and things attached to the joints: nodes of the scene graph,
//! cameras, lights, and deformed meshes ([`Deformed`]). A [`Player`] plays some of the clips and
//! computes the [`Pose`] at a time; [`Scene::apply`] applies the pose to the scene. Readers convert
//! the motion of their formats to this form.

mod curve;
mod deform;
mod mesh;
mod parameter;
mod player;
mod transform;

pub use curve::{Curve, CurveError, Interpolation};
pub use deform::{Deformed, InfluenceSet, Morph, MorphTarget, Skin, make_usable, morph_mesh};
pub use parameter::{Owner, ParameterTrack};
pub use player::{Player, Pose};
pub use transform::{AnimatedTransform, Placement};

use crate::graph::NodeId;
use std::collections::BTreeSet;

#[cfg(doc)]
use crate::graph::Scene;

/// The motion of a scene.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    /// The joints of the skeleton, parents before their children.
    pub joints: Vec<Joint>,
    /// The animations.
    pub clips: Vec<Clip>,
    /// Meshes that are deformed by joints or weights.
    pub deformed: Vec<Deformed>,
    /// Pairs of a camera, by its position in the scene's table, and its joint.
    pub cameras: Vec<(usize, u32)>,
    /// Pairs of a light, by its position in the scene's table, and its joint.
    pub lights: Vec<(usize, u32)>,
    /// Things that are present only while joints are visible.
    pub switches: Vec<Switch>,
}

/// Something that is present only while all of the given joints are visible ([`Joint::hidden`],
/// [`Track::Visible`]).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Switch {
    /// Numbers of the joints.
    pub joints: Vec<u32>,
    /// What the switch turns on and off.
    pub what: Switched,
}

/// What a [`Switch`] turns on and off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Switched {
    /// A parent and its last child, which is the switched node. The node has no other parent, and
    /// the parent has no other switched child.
    Node(NodeId, NodeId),
    /// A light, by its position in the scene's table.
    Light(usize),
}

/// A coordinate system of the skeleton.
#[derive(Clone, Debug, Default)]
pub struct Joint {
    /// A name for users.
    pub name: String,
    /// Number of the parent joint, smaller than that of this joint; `None` if the parent is the
    /// world.
    pub parent: Option<u32>,
    /// The joint's placement while no clip moves it.
    pub rest: Placement,
    /// The node of the scene graph whose transform is that of the joint.
    pub node: Option<NodeId>,
    /// True if the joint is invisible by default.
    pub hidden: bool,
}

/// An animation.
#[derive(Clone, Debug, Default)]
pub struct Clip {
    /// The clip's name in the file, which may be empty.
    pub name: String,
    /// The properties of joints that the clip animates.
    pub channels: Vec<Channel>,
    /// The other parameters that the clip animates.
    pub parameters: Vec<ParameterTrack>,
}

/// One property of one joint over time.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Number of the joint.
    pub joint: u32,
    /// The property and its values.
    pub track: Track,
}

/// A property of a joint over time.
#[derive(Clone, Debug)]
pub enum Track {
    /// Translation, 3 numbers.
    Translation(Curve),
    /// Rotation, a quaternion x y z w.
    Rotation(Curve),
    /// Scale, 3 numbers.
    Scale(Curve),
    /// Weights of the joint's morph targets, one number for each target.
    Weights(Curve),
    /// The whole placement.
    Transform(AnimatedTransform),
    /// Visibility of the joint, 1 number: visible from 0.5.
    Visible(Curve),
}

impl Track {
    /// The times of the first and the last key, in seconds.
    pub fn span(&self) -> [f64; 2] {
        match self {
            Self::Translation(c)
            | Self::Rotation(c)
            | Self::Scale(c)
            | Self::Weights(c)
            | Self::Visible(c) => c.span(),
            Self::Transform(t) => t.span(),
        }
    }

    /// The properties that the track sets, as bits.
    fn properties(&self) -> u8 {
        match self {
            Self::Translation(_) => 1,
            Self::Rotation(_) => 2,
            Self::Scale(_) => 4,
            Self::Weights(_) => 8,
            Self::Transform(_) => 7,
            Self::Visible(_) => 16,
        }
    }
}

impl Clip {
    /// The times of the first and the last key over all channels and parameters, in seconds;
    /// `[0, 0]` for an empty clip.
    pub fn span(&self) -> [f64; 2] {
        let parameters = self.parameters.iter().map(|p| p.curve.span());
        together(self.channels.iter().map(|c| c.track.span()).chain(parameters))
    }

    /// The properties and parameters that the clip sets.
    fn targets(&self) -> BTreeSet<Aim<'_>> {
        let bits = |c: &Channel| {
            let (joint, properties) = (c.joint, c.track.properties());
            (0..5)
                .map(|i| 1 << i)
                .filter(move |bit| properties & bit != 0)
                .map(move |bit| Aim::Joint(joint, bit))
        };
        let parameters = self.parameters.iter().map(|p| Aim::Parameter(p.owner, &p.path));
        self.channels.iter().flat_map(bits).chain(parameters).collect()
    }
}

/// Something that a clip sets: a property of a joint, or a parameter.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Aim<'a> {
    Joint(u32, u8),
    Parameter(Owner, &'a str),
}

/// The interval from the earliest start to the latest end; `[0, 0]` without intervals.
fn together(spans: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    spans.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or([0.0; 2])
}

impl Motion {
    /// The clips that are played by default: the first that moves anything, and each further clip
    /// that moves only things which no earlier one moves. (Some files have one clip for each
    /// object, others have one for each gait.)
    pub fn usual_clips(&self) -> Vec<usize> {
        let mut taken = BTreeSet::new();
        let mut clips = Vec::new();
        for (i, clip) in self.clips.iter().enumerate() {
            let targets = clip.targets();
            if !targets.is_empty() && taken.is_disjoint(&targets) {
                taken.extend(targets);
                clips.push(i);
            }
        }
        clips
    }

    /// The clips that a user asks for: `all`, or one clip by name or by number (from 0). `None` if
    /// there is no such clip.
    pub fn find_clips(&self, name: &str) -> Option<Vec<usize>> {
        if let Some(i) = self.clips.iter().position(|c| c.name == name) {
            return Some(vec![i]);
        }
        if name == "all" {
            return Some((0..self.clips.len()).collect());
        }
        name.parse().ok().filter(|&i| i < self.clips.len()).map(|i| vec![i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(name: &str, joints: &[u32]) -> Clip {
        let curve = || {
            Curve::new(vec![0.0, 2.0], vec![0.0; 6], 3, Interpolation::Linear)
                .expect("a valid curve")
        };
        let channels =
            joints.iter().map(|&joint| Channel { joint, track: Track::Translation(curve()) });
        Clip { name: name.into(), channels: channels.collect(), ..Clip::default() }
    }

    #[test]
    fn clips_that_move_different_things_are_played_together() {
        let clips = vec![
            clip("nothing", &[]),
            clip("walk", &[0, 1]),
            clip("run", &[1]),
            clip("lamp", &[2]),
        ];
        let motion = Motion { clips, ..Motion::default() };
        assert_eq!(motion.usual_clips(), [1, 3]);
        assert_eq!(motion.find_clips("run"), Some(vec![2]));
        assert_eq!(motion.find_clips("3"), Some(vec![3]));
        assert_eq!(motion.find_clips("all"), Some(vec![0, 1, 2, 3]));
        assert_eq!((motion.find_clips("4"), motion.find_clips("jump")), (None, None));
        assert_eq!((motion.clips[1].span(), motion.clips[0].span()), ([0.0, 2.0], [0.0, 0.0]));
    }
}
