//! Motion: transforms that differ at the two ends of the motion, and the shutter interval.

use super::Builder;
use super::params::Params;
use crate::scene::fault::Fault;
use snell_math::DAffine3;
use snell_scene::NodeId;
use snell_scene::motion::{AnimatedTransform, Channel, Clip, Joint, Motion, Placement, Track};
use std::sync::Arc;

/// The motion read so far.
#[derive(Debug)]
pub struct Moving {
    /// Times of the transforms of `ActiveTransform StartTime` and `EndTime`.
    pub times: [f64; 2],
    shutter: [f64; 2],
    nodes: Vec<(NodeId, [DAffine3; 2])>,
    camera: Option<[DAffine3; 2]>,
}

impl Default for Moving {
    fn default() -> Self {
        Self { times: [0.0, 1.0], shutter: [0.0, 1.0], nodes: Vec::new(), camera: None }
    }
}

impl Builder<'_> {
    /// True if the current transform changes over time.
    pub(super) fn moves(&self) -> bool {
        let [start, end] = self.state.transform.0;
        start != end
    }

    /// Records the motion of a node, if the current transform moves. `object_from_shown` is the
    /// node's constant transform within the current one.
    pub(super) fn note_motion(&mut self, node: NodeId, object_from_shown: DAffine3) {
        let [start, end] = self.state.transform.0;
        if start != end {
            self.moving.nodes.push((node, [start, end].map(|m| m * object_from_shown)));
        }
    }

    /// Records the camera's transforms at both ends of the motion, and its shutter.
    pub(super) fn note_camera_motion(
        &mut self,
        params: &Params,
        file_from_camera: [DAffine3; 2],
    ) -> Result<(), Fault> {
        self.moving.shutter =
            [params.float_or("shutteropen", 0.0)?, params.float_or("shutterclose", 1.0)?];
        self.moving.camera = Some(file_from_camera).filter(|[start, end]| start != end);
        Ok(())
    }

    /// Adds the motion to the scene, if anything moves.
    pub(super) fn finish_motion(&mut self) {
        let Moving { times, shutter: [open, close], nodes, camera } =
            std::mem::take(&mut self.moving);
        let mut motion = Motion { clips: vec![Clip::default()], ..Motion::default() };
        let mut add = |node: Option<NodeId>, [start, end]: [DAffine3; 2]| {
            let joint = motion.joints.len() as u32;
            motion.joints.push(Joint { node, rest: Placement::Matrix(start), ..Joint::default() });
            let track =
                Track::Transform(AnimatedTransform::new(times.into_iter().zip([start, end])));
            motion.clips[0].channels.push(Channel { joint, track });
            joint
        };
        nodes.into_iter().for_each(|(node, maps)| {
            add(Some(node), maps);
        });
        let camera = camera.map(|maps| add(None, maps.map(|m| self.world_from_file * m)));
        motion.cameras.extend(camera.map(|joint| (0, joint)));
        if motion.joints.is_empty() {
            return;
        }
        self.scene.motion = Some(Arc::new(motion));
        self.scene.settings.shutter = Some([open, close.max(open)]);
    }
}
