//! Animations: the nodes that move, and everything that depends on them.
//!
//! Every node of the file becomes a joint of the scene's motion, whether or not it is shown,
//! because skins refer to nodes. A channel that is not supported is left out with a warning,
//! because the scene can be shown without it.

use super::json::Json;
use super::node::Hierarchy;
use super::{Reader, morph, pointer};
use crate::ReadError;
use snell_math::DAffine3;
use snell_scene::motion::{
    Channel, Clip, Curve, Deformed, Interpolation, Joint, Motion, Player, Pose, Skin, Switch,
    Switched, Track,
};
use snell_scene::{NodeId, Scene};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// The motion of a file with animations; empty for other files.
pub(super) struct Rig {
    motion: Option<Motion>,
    /// Joint numbers, by node.
    joint_of: Vec<u32>,
    /// Nodes whose morph weights change.
    weighted: BTreeSet<usize>,
    /// Nodes whose visibility changes.
    switched: BTreeSet<usize>,
}

/// The cameras and lights of the scene, with the numbers that they have in the file.
#[derive(Default)]
pub(super) struct Placed {
    /// The number of each camera in the scene, and its number in the file.
    pub cameras: Vec<(usize, usize)>,
    /// The number of each light in the scene, its number in the file, and its node's
    /// `world_from_node`.
    pub lights: Vec<(usize, usize, DAffine3)>,
    /// The factor that was applied to the file's intensities.
    pub light_scale: f64,
}

impl Rig {
    /// Reads all animations.
    pub fn read(reader: &mut Reader, hierarchy: &Hierarchy) -> Result<Self, ReadError> {
        let animations = reader.root.items_of("animations")?;
        let joint_of = vec![0; hierarchy.len()];
        let mut rig =
            Self { motion: None, joint_of, weighted: BTreeSet::new(), switched: BTreeSet::new() };
        if animations.is_empty() {
            return Ok(rig);
        }
        let mut motion = Motion::default();
        for (i, parent, rest, node) in hierarchy.top_down() {
            rig.joint_of[i] = motion.joints.len() as u32;
            let parent = parent.map(|parent| rig.joint_of[parent]);
            motion.joints.push(Joint {
                name: node.name(),
                parent,
                rest,
                node: None,
                hidden: !is_visible(node)?,
            });
        }
        for animation in &animations {
            let mut clip = Clip { name: animation.name(), ..Clip::default() };
            // Any of this may be invalid; a channel that is not understood is not played.
            let channels = animation.items_of("channels").unwrap_or_default();
            for channel in &channels {
                match rig.channel(reader, animation, channel) {
                    Ok(channel) => clip.channels.extend(channel),
                    Err(error) => {
                        reader.scene.warn(format!(
                            "{}: {}; this is not animated",
                            channel.path(),
                            error.problem
                        ));
                    }
                }
            }
            motion.clips.push(clip);
        }
        // Pointers to nodes are handled here, and all other pointers once the scene is complete.
        for pointer in std::mem::take(&mut reader.pointers) {
            match rig.channels_of(reader, &pointer)? {
                Some(channels) => motion.clips[pointer.clip].channels.extend(channels),
                None => reader.pointers.push(pointer),
            }
        }
        rig.motion = Some(motion);
        Ok(rig)
    }

    /// Reads a channel; `None` if its target is not known.
    fn channel(
        &mut self,
        reader: &Reader,
        animation: &Json,
        channel: &Json,
    ) -> Result<Option<Channel>, ReadError> {
        let target = channel.require("target")?;
        let path = target.require("path")?;
        let Some(node) = target.get("node")?.filter(|_| path.string() != Ok("pointer")) else {
            return Ok(None);
        };
        let number = node.size()?;
        let json = reader.root.entry("nodes", &node)?;
        let width = match path.string()? {
            "translation" | "scale" => 3,
            "rotation" => 4,
            "weights" => match json.get("mesh")? {
                Some(mesh) => morph::count(&reader.root.entry("meshes", &mesh)?)?,
                None => 0,
            },
            other => {
                return Err(
                    path.error(format!("\"{other}\" is not a property that can be animated"))
                );
            }
        };
        let curve = curve(
            reader,
            &animation.entry("samplers", &channel.require("sampler")?)?,
            Some(width),
        )?;
        let track = match path.string()? {
            "translation" => Track::Translation(curve),
            "rotation" => Track::Rotation(curve),
            "scale" => Track::Scale(curve),
            _ => {
                self.weighted.insert(number);
                Track::Weights(curve)
            }
        };
        Ok(Some(Channel { joint: self.joint_of[number], track }))
    }

    /// The channels of a pointer to a node, or to the weights of a mesh; `None` for any other
    /// pointer.
    fn channels_of(
        &mut self,
        reader: &Reader,
        pointer: &pointer::Pointer,
    ) -> Result<Option<Vec<Channel>>, ReadError> {
        let steps: Vec<&str> = pointer.path.split('/').skip(1).collect();
        let (family, Some(number), property) = (
            steps.first().copied().unwrap_or_default(),
            steps.get(1).and_then(|n| n.parse().ok()),
            steps.get(2..).unwrap_or_default(),
        ) else {
            return Ok(None);
        };
        let curve = pointer.curve.clone();
        let width = curve.width();
        let nodes = reader.root.items_of("nodes")?;
        if (family, property) == ("meshes", &["weights"][..]) {
            let mut channels = Vec::new();
            for (i, node) in nodes.iter().enumerate() {
                let shows = node.get("mesh")?.is_some_and(|mesh| mesh.size() == Ok(number));
                if shows && node.get("weights")?.is_none() {
                    self.weighted.insert(i);
                    channels.push(Channel {
                        joint: self.joint_of[i],
                        track: Track::Weights(curve.clone()),
                    });
                }
            }
            return Ok(Some(channels));
        }
        if family != "nodes" || number >= nodes.len() {
            return Ok(None);
        }
        let track = match (property, width) {
            (["translation"], 3) => Track::Translation(curve),
            (["rotation"], 4) => Track::Rotation(curve),
            (["scale"], 3) => Track::Scale(curve),
            (["weights"], _) => {
                self.weighted.insert(number);
                Track::Weights(curve)
            }
            (["extensions", "KHR_node_visibility", "visible"], 1) => {
                self.switched.insert(number);
                Track::Visible(curve)
            }
            _ => return Ok(None),
        };
        Ok(Some(vec![Channel { joint: self.joint_of[number], track }]))
    }

    /// True if animations show and hide the node.
    pub fn is_switched(&self, node: usize) -> bool {
        self.switched.contains(&node)
    }

    /// Records objects of the scene that are visible only while all of some nodes are.
    pub fn switches(&mut self, nodes: &[usize], what: Switched) {
        let joints: Vec<u32> = nodes.iter().map(|node| self.joint_of[*node]).collect();
        if !joints.is_empty() {
            self.motion
                .iter_mut()
                .for_each(|m| m.switches.push(Switch { joints: joints.clone(), what }));
        }
    }

    /// The number of a node's joint.
    pub fn joint(&self, node: usize) -> u32 {
        self.joint_of[node]
    }

    /// True if animations change the weights of the node's morph targets.
    pub fn has_weights(&self, node: usize) -> bool {
        self.weighted.contains(&node)
    }

    /// A skin whose joints are nodes, with the numbers of their joints.
    pub fn with_joints(&self, skin: Skin) -> Skin {
        Skin {
            joints: skin.joints.iter().map(|&node| self.joint_of[node as usize]).collect(),
            ..skin
        }
    }

    /// Records that a node of the scene follows a node of the file.
    pub fn carries_node(&mut self, node: usize, shown: NodeId) {
        let joint = self.joint_of[node] as usize;
        if let Some(joint) = self.motion.as_mut().and_then(|m| m.joints.get_mut(joint)) {
            joint.node = Some(shown);
        }
    }

    /// Records that cameras of the scene follow a node.
    pub fn carries_cameras(&mut self, node: usize, cameras: Range<usize>) {
        let joint = self.joint_of[node];
        self.motion.iter_mut().for_each(|m| m.cameras.extend(cameras.clone().map(|i| (i, joint))));
    }

    /// Records that lights of the scene follow a node.
    pub fn carries_lights(&mut self, node: usize, lights: Range<usize>) {
        let joint = self.joint_of[node];
        self.motion.iter_mut().for_each(|m| m.lights.extend(lights.clone().map(|i| (i, joint))));
    }

    /// Records a surface that is deformed.
    pub fn bends(&mut self, deformed: Deformed) {
        self.motion.iter_mut().for_each(|m| m.deformed.push(deformed.clone()));
    }

    /// Adds the motion to the scene, once everything else is in place.
    pub fn finish(self, reader: &mut Reader, placed: &Placed) -> Result<(), ReadError> {
        let Some(mut motion) = self.motion else { return Ok(()) };
        for (clip, track) in pointer::tracks(reader, placed)? {
            motion.clips[clip].parameters.push(track);
        }
        let motion = Arc::new(motion);
        hide(&mut reader.scene, &motion);
        reader.scene.motion = Some(motion);
        Ok(())
    }
}

/// Hides nodes of the scene that are invisible while no animation is played. (Lights stay.)
fn hide(scene: &mut Scene, motion: &Arc<Motion>) {
    let mut switched = Player::new(motion.clone(), Vec::new()).pose(0.0).switched;
    switched.retain(|(what, _)| matches!(what, Switched::Node(..)));
    scene.apply(&Pose { switched, ..Pose::default() });
}

/// True if `KHR_node_visibility` does not hide the node.
pub(super) fn is_visible(node: &Json) -> Result<bool, ReadError> {
    node.extension("KHR_node_visibility")?
        .map_or(Ok(true), |extension| extension.boolean_or("visible", true))
}

/// Reads a sampler for values of `width` numbers, or of any number.
pub(super) fn curve(
    reader: &Reader,
    sampler: &Json,
    width: Option<usize>,
) -> Result<Curve, ReadError> {
    let interpolation = match sampler.get("interpolation")? {
        None => Interpolation::Linear,
        Some(name) => match name.string()? {
            "LINEAR" => Interpolation::Linear,
            "STEP" => Interpolation::Step,
            "CUBICSPLINE" => Interpolation::Cubic,
            other => return Err(name.error(format!("\"{other}\" is not a way to interpolate"))),
        },
    };
    let times = reader.accessors.get(&sampler.require("input")?)?.vectors::<1>()?;
    let output = sampler.require("output")?;
    let values = reader.accessors.get(&output)?;
    let values: Vec<f32> = match values.width {
        1 => values.vectors::<1>()?.into_iter().flatten().collect(),
        2 => values.vectors::<2>()?.into_iter().flatten().collect(),
        3 => values.vectors::<3>()?.into_iter().flatten().collect(),
        4 => values.vectors::<4>()?.into_iter().flatten().collect(),
        other => return Err(output.error(format!("its values have {other} components"))),
    };
    let times: Vec<f64> = times.into_iter().map(|[t]| f64::from(t)).collect();
    let parts = if interpolation == Interpolation::Cubic { 3 } else { 1 };
    let width = width.unwrap_or(values.len() / (times.len() * parts).max(1));
    Curve::new(times, values, width, interpolation).map_err(|e| sampler.error(e.to_string()))
}
