//! Animations: which nodes move, and what moves with them.
//!
//! Every node of the file becomes a joint of the scene's motion, whether or not it is shown: skins refer to nodes. A channel that cannot be
//! played is left out with a warning, because the scene can be shown without it.

use super::json::Json;
use super::node::Hierarchy;
use super::{Reader, morph};
use crate::ReadError;
use snell_scene::NodeId;
use snell_scene::motion::{Channel, Clip, Curve, Deformed, Interpolation, Joint, Motion, Skin, Track};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// The motion of a file that has animations; keeps nothing for others.
pub(super) struct Rig {
    motion: Option<Motion>,
    /// By number of the node.
    joint_of: Vec<u32>,
    /// Nodes whose morph weights change.
    weighted: BTreeSet<usize>,
}

impl Rig {
    /// Reads all animations.
    pub fn read(reader: &mut Reader, hierarchy: &Hierarchy) -> Result<Self, ReadError> {
        let animations = reader.root.items_of("animations")?;
        let mut rig = Self { motion: None, joint_of: vec![0; hierarchy.len()], weighted: BTreeSet::new() };
        if animations.is_empty() {
            return Ok(rig);
        }
        let mut motion = Motion::default();
        for (i, parent, rest, node) in hierarchy.top_down() {
            rig.joint_of[i] = motion.joints.len() as u32;
            let parent = parent.map(|parent| rig.joint_of[parent]);
            motion.joints.push(Joint { name: node.name(), parent, rest, node: None });
        }
        for animation in &animations {
            let mut clip = Clip { name: animation.name(), channels: Vec::new() };
            // Anything may be wrong here; what is not understood is not played.
            let channels = animation.items_of("channels").unwrap_or_default();
            for channel in &channels {
                match rig.channel(reader, animation, channel) {
                    Ok(channel) => clip.channels.extend(channel),
                    Err(error) => {
                        reader.scene.warn(format!("{}: {}; this is not animated", channel.path(), error.problem));
                    }
                }
            }
            motion.clips.push(clip);
        }
        rig.motion = Some(motion);
        Ok(rig)
    }

    /// A channel; `None` for one that asks for nothing that is known.
    fn channel(&mut self, reader: &Reader, animation: &Json, channel: &Json) -> Result<Option<Channel>, ReadError> {
        let target = channel.require("target")?;
        let path = target.require("path")?;
        let Some(node) = target.get("node")? else {
            let is_pointer = path.string()? == "pointer";
            return if is_pointer { Err(path.error("KHR_animation_pointer is not supported")) } else { Ok(None) };
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
            other => return Err(path.error(format!("\"{other}\" is not a property that can be animated"))),
        };
        let curve = curve(reader, &animation.entry("samplers", &channel.require("sampler")?)?, width)?;
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
        Skin { joints: skin.joints.iter().map(|&node| self.joint_of[node as usize]).collect(), ..skin }
    }

    /// Notes that a node of the scene is where a node of the file is.
    pub fn carries_node(&mut self, node: usize, shown: NodeId) {
        let joint = self.joint_of[node] as usize;
        if let Some(joint) = self.motion.as_mut().and_then(|m| m.joints.get_mut(joint)) {
            joint.node = Some(shown);
        }
    }

    /// Notes that cameras of the scene are at a node.
    pub fn carries_cameras(&mut self, node: usize, cameras: Range<usize>) {
        let joint = self.joint_of[node];
        self.motion.iter_mut().for_each(|m| m.cameras.extend(cameras.clone().map(|i| (i, joint))));
    }

    /// Notes that lights of the scene are at a node.
    pub fn carries_lights(&mut self, node: usize, lights: Range<usize>) {
        let joint = self.joint_of[node];
        self.motion.iter_mut().for_each(|m| m.lights.extend(lights.clone().map(|i| (i, joint))));
    }

    /// Notes a surface that is bent.
    pub fn bends(&mut self, deformed: Deformed) {
        self.motion.iter_mut().for_each(|m| m.deformed.push(deformed.clone()));
    }

    /// What was collected.
    pub fn into_motion(self) -> Option<Arc<Motion>> {
        self.motion.map(Arc::new)
    }
}

/// A sampler, for values of `width` numbers.
fn curve(reader: &Reader, sampler: &Json, width: usize) -> Result<Curve, ReadError> {
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
        3 => values.vectors::<3>()?.into_iter().flatten().collect(),
        4 => values.vectors::<4>()?.into_iter().flatten().collect(),
        other => return Err(output.error(format!("its values have {other} components"))),
    };
    let times = times.into_iter().map(|[t]| f64::from(t)).collect();
    Curve::new(times, values, width, interpolation).map_err(|e| sampler.error(e.to_string()))
}
