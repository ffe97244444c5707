//! Players of clips, which compute the scene at a time.

use super::{Motion, ParameterTrack, Placement, Switched, Track, together};
use crate::camera::Camera;
use crate::graph::{Geometry, NodeId, Scene};
use crate::light::{Directional, Light};
use snell_intersect::TriangleMesh;
use snell_math::{DAffine3, DVec3, Rgb};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The differences between the scene at a time and the scene as it was read.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    /// Transforms of nodes ([`crate::Node::transform`]).
    pub transforms: BTreeMap<NodeId, DAffine3>,
    /// Deformed meshes, by node and index of the surface.
    pub meshes: BTreeMap<(NodeId, usize), Arc<TriangleMesh>>,
    /// Movements of cameras in the world, relative to where they were read.
    pub cameras: Vec<(usize, DAffine3)>,
    /// Movements of lights in the world, relative to where they were read.
    pub lights: Vec<(usize, DAffine3)>,
    /// Animated parameters with their numbers.
    pub parameters: Vec<(ParameterTrack, Vec<f64>)>,
    /// Switched things, and whether they are present.
    pub switched: Vec<(Switched, bool)>,
}

/// Plays clips of a motion. It keeps the last pose, so that unchanged meshes are not computed again
/// and keep their address.
#[derive(Clone, Debug)]
pub struct Player {
    motion: Arc<Motion>,
    clips: Vec<usize>,
    /// The rest placement of each joint in the world.
    rest: Vec<DAffine3>,
    /// For each deformed surface, the last mesh and the inputs from which it was made.
    made: Vec<Option<Made>>,
}

#[derive(Clone, Debug)]
struct Made {
    weights: Vec<f64>,
    matrices: Vec<DAffine3>,
    mesh: Arc<TriangleMesh>,
}

impl Player {
    /// A player of these clips together. If two of them animate the same thing, the later one
    /// counts. Numbers of clips that do not exist are ignored.
    pub fn new(motion: Arc<Motion>, clips: Vec<usize>) -> Self {
        let clips = clips.into_iter().filter(|&i| i < motion.clips.len()).collect();
        let rest = worlds(&motion, motion.joints.iter().map(|j| j.rest.matrix()));
        let made = vec![None; motion.deformed.len()];
        Self { motion, clips, rest, made }
    }

    /// The times of the first and the last key over all clips, in seconds.
    pub fn span(&self) -> [f64; 2] {
        together(self.clips().map(|clip| clip.span()).filter(|span| *span != [0.0; 2]))
    }

    fn clips(&self) -> impl Iterator<Item = &super::Clip> {
        self.clips.iter().map(|&i| &self.motion.clips[i])
    }

    /// The nodes whose transforms or meshes change. Their descendants move with them and are not
    /// listed.
    pub fn moving_nodes(&self) -> BTreeSet<NodeId> {
        let (moved, weighted) = self.moving_joints();
        let nodes = moved.iter().filter_map(|&j| self.motion.joints.get(j as usize)?.node);
        let bent = self.motion.deformed.iter().filter(|d| {
            let morphs = d.morph.as_ref().is_some_and(|m| weighted.contains(&m.joint));
            morphs || (d.skin.is_some() && !moved.is_empty())
        });
        nodes.chain(bent.map(|d| d.node)).collect()
    }

    /// Joints whose placement a clip changes, and joints whose weights a clip changes.
    fn moving_joints(&self) -> (BTreeSet<u32>, BTreeSet<u32>) {
        let channels = self.clips().flat_map(|clip| &clip.channels);
        let channels = channels.filter(|c| !matches!(c.track, Track::Visible(_)));
        let (weights, others): (Vec<_>, Vec<_>) =
            channels.partition(|c| matches!(c.track, Track::Weights(_)));
        let joints = |channels: Vec<&super::Channel>| channels.iter().map(|c| c.joint).collect();
        (joints(others), joints(weights))
    }

    /// The pose at a time in seconds. A property is constant before its first key and after its
    /// last.
    pub fn pose(&mut self, time: f64) -> Pose {
        let motion = self.motion.clone();
        let (local, weights) = self.placements(time);
        let (moved, _) = self.moving_joints();
        let mut pose = Pose::default();
        for &joint in &moved {
            let node = motion.joints.get(joint as usize).and_then(|j| j.node);
            pose.transforms.extend(node.map(|node| (node, local[joint as usize])));
        }
        let world = worlds(&motion, local.into_iter());
        for (number, deformed) in motion.deformed.iter().enumerate() {
            let morph = deformed.morph.as_ref();
            let weights = morph.map_or(&[][..], |m| weights.get(&m.joint).unwrap_or(&m.weights));
            let matrices: Vec<DAffine3> = deformed.skin.as_ref().map_or(Vec::new(), |(skin, _)| {
                let joints = skin.joints.iter().map(|&j| world[j as usize]);
                joints.zip(&skin.inverse_bind).map(|(joint, bind)| joint * *bind).collect()
            });
            let made = &mut self.made[number];
            if made.as_ref().is_none_or(|made| made.weights != weights || made.matrices != matrices)
            {
                let mesh = deformed.mesh(weights, &matrices).ok();
                *made = mesh.map(|mesh| Made {
                    weights: weights.to_vec(),
                    matrices,
                    mesh: Arc::new(mesh),
                });
            }
            pose.meshes.extend(
                made.iter().map(|made| ((deformed.node, deformed.surface), made.mesh.clone())),
            );
        }
        let moves = |carried: &[(usize, u32)]| {
            let change = |&(i, joint): &(usize, u32)| {
                let (rest, now) = (self.rest[joint as usize], world[joint as usize]);
                let change = now * rest.inverse();
                (rest != now && change.is_finite()).then_some((i, change))
            };
            carried.iter().filter_map(change).collect()
        };
        (pose.cameras, pose.lights) = (moves(&motion.cameras), moves(&motion.lights));
        let parameters = self.clips().flat_map(|clip| &clip.parameters);
        pose.parameters = parameters.map(|track| (track.clone(), track.curve.at(time))).collect();
        let hidden = self.hidden_joints(time);
        let switches = motion.switches.iter();
        pose.switched = switches
            .map(|s| (s.what, !s.joints.iter().any(|joint| hidden.contains(joint))))
            .collect();
        pose
    }

    /// The joints that are hidden at a time in seconds: by a clip, or by default where no clip
    /// decides.
    fn hidden_joints(&self, time: f64) -> BTreeSet<u32> {
        let joints = (0..).zip(&self.motion.joints);
        let mut hidden: BTreeSet<u32> =
            joints.filter(|(_, joint)| joint.hidden).map(|(i, _)| i).collect();
        for channel in self.clips().flat_map(|clip| &clip.channels) {
            if let Track::Visible(curve) = &channel.track {
                let is_visible = curve.at(time).first().is_none_or(|v| *v >= 0.5);
                if is_visible {
                    hidden.remove(&channel.joint)
                } else {
                    hidden.insert(channel.joint)
                };
            }
        }
        hidden
    }

    /// The poses while a shutter is open, at equal times from its opening to its closing. Intervals
    /// are halved until linear interpolation between the poses is accurate, up to 32 intervals.
    /// There is only one pose if no clip is played, or if the shutter closes at once.
    pub fn poses_between(&mut self, open: f64, close: f64) -> Vec<Pose> {
        const MOST: u32 = 32;
        let mut intervals = 0;
        if close > open && !self.clips.is_empty() {
            intervals = 1;
            while intervals < MOST && !self.is_straight(open, close, intervals) {
                intervals *= 2;
            }
        }
        let time = |i: u32| open + (close - open) * f64::from(i) / f64::from(intervals.max(1));
        (0..=intervals).map(|i| self.pose(time(i))).collect()
    }

    /// True if, in the middle of each interval, joints and weights are close to linear
    /// interpolation between the interval's ends.
    fn is_straight(&self, open: f64, close: f64, intervals: u32) -> bool {
        /// Largest difference of a translation, a rotation, or a weight.
        const TOLERANCE: f64 = 0.01;
        let at = |half: u32| {
            let time = open + (close - open) * f64::from(half) / f64::from(2 * intervals);
            let (local, weights) = self.placements(time);
            (worlds(&self.motion, local.into_iter()), weights)
        };
        let is_near = |a: &DAffine3, middle: &DAffine3, b: &DAffine3| {
            let way = (b.translation - a.translation).length();
            let aside = (middle.translation - (a.translation + b.translation) * 0.5).length();
            let turned = |m: &DAffine3| m.matrix3.to_cols_array();
            let sides = turned(a).into_iter().zip(turned(middle)).zip(turned(b));
            let bend = sides.fold(0.0f64, |most, ((a, m), b)| most.max((m - (a + b) * 0.5).abs()));
            let size = turned(middle).into_iter().fold(0.0f64, |most, x| most.max(x.abs()));
            aside <= way * TOLERANCE && bend <= size * TOLERANCE * 0.1
        };
        (0..intervals).all(|i| {
            let ((a, wa), (middle, wm), (b, wb)) = (at(2 * i), at(2 * i + 1), at(2 * i + 2));
            let joints = a.iter().zip(&middle).zip(&b).all(|((a, m), b)| is_near(a, m, b));
            let weights = wm.iter().all(|(joint, m)| {
                let ends = wa[joint].iter().zip(&wb[joint]);
                m.iter().zip(ends).all(|(m, (a, b))| (m - (a + b) * 0.5).abs() <= TOLERANCE)
            });
            joints && weights
        })
    }

    /// The placement of each joint relative to its parent, and the weights that clips set, at a
    /// time in seconds.
    fn placements(&self, time: f64) -> (Vec<DAffine3>, BTreeMap<u32, Vec<f64>>) {
        let mut placements: Vec<Placement> = self.motion.joints.iter().map(|j| j.rest).collect();
        let mut weights = BTreeMap::new();
        for channel in self.clips().flat_map(|clip| &clip.channels) {
            let Some(placement) = placements.get_mut(channel.joint as usize) else { continue };
            let (mut translation, mut rotation, mut scale) = placement.parts();
            match &channel.track {
                Track::Translation(curve) => translation = curve.vector_at(time).into(),
                Track::Rotation(curve) => rotation = curve.rotation_at(time),
                Track::Scale(curve) => scale = curve.vector_at(time).into(),
                Track::Weights(curve) => {
                    weights.insert(channel.joint, curve.at(time));
                    continue;
                }
                Track::Transform(transform) => {
                    *placement = Placement::Matrix(transform.at(time));
                    continue;
                }
                Track::Visible(_) => continue,
            }
            *placement = Placement::Parts { translation, rotation, scale };
        }
        (placements.iter().map(Placement::matrix).collect(), weights)
    }
}

/// The transform of each joint to the world.
fn worlds(motion: &Motion, local: impl Iterator<Item = DAffine3>) -> Vec<DAffine3> {
    let mut world: Vec<DAffine3> = Vec::with_capacity(motion.joints.len());
    for (joint, local) in motion.joints.iter().zip(local) {
        let parent = joint.parent.and_then(|p| world.get(p as usize).copied());
        world.push(parent.map_or(local, |parent| parent * local));
    }
    world
}

impl Scene {
    /// Applies a pose. The scene must be as it was read.
    pub fn apply(&mut self, pose: &Pose) {
        for (id, transform) in &pose.transforms {
            if let Some(node) = self.nodes.get_mut(id.index()) {
                node.transform = *transform;
            }
        }
        for ((id, surface), mesh) in &pose.meshes {
            let surface =
                self.nodes.get_mut(id.index()).and_then(|node| node.surfaces.get_mut(*surface));
            if let Some(surface) = surface {
                surface.geometry = Geometry::Mesh(mesh.clone());
            }
        }
        for &(i, by) in &pose.cameras {
            if let Some(camera) = self.cameras.get_mut(i) {
                *camera = camera.moved(&by);
            }
        }
        for &(i, by) in &pose.lights {
            if let Some(light) = self.lights.get_mut(i) {
                *light = light.moved(&by);
            }
        }
        // Parameters are set first, so that cameras and lights are moved with their new numbers.
        for (track, numbers) in &pose.parameters {
            track.set(self, numbers);
        }
        for &(what, is_there) in &pose.switched {
            self.switch(what, is_there);
        }
    }

    fn switch(&mut self, what: Switched, is_there: bool) {
        match what {
            Switched::Node(parent, node) => {
                if let Some(parent) = self.nodes.get_mut(parent.index()) {
                    parent.children.retain(|child| *child != node);
                    parent.children.extend(is_there.then_some(node));
                }
            }
            Switched::Light(i) => {
                if let Some(light) = self.lights.get_mut(i).filter(|_| !is_there) {
                    *light = Self::dark();
                }
            }
        }
    }

    /// A light without emission, which takes the place of one that is switched off.
    fn dark() -> Light {
        Light::Directional(Directional { direction: DVec3::NEG_Y, irradiance: Rgb::BLACK })
    }
}

impl Camera {
    /// The camera, moved by a map of the world. Scale affects only its position.
    pub fn moved(&self, by: &DAffine3) -> Self {
        let eye = by.transform_point3(self.eye);
        let (towards, up) = (by.transform_vector3(self.towards), by.transform_vector3(self.up));
        let placed = Self::from_direction(eye, towards, up, self.projection);
        Self { eye: placed.eye, towards: placed.towards, up: placed.up, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Material;
    use crate::graph::{Node, Surface};
    use crate::material::{Diffuse, MaterialKind};
    use crate::motion::{
        Channel, Clip, Curve, Deformed, InfluenceSet, Interpolation, Joint, Morph, MorphTarget,
        Owner, Skin,
    };
    use snell_math::Vec3;

    /// A scene with an arm of two joints, 1 apart on x; the second rotates by 90 degrees about z
    /// between 0 s and 1 s. A triangle has a vertex at each end of the arm, and one that follows
    /// both joints equally. A camera and a light are at the second joint.
    fn arm() -> Scene {
        let mut scene = Scene::new("arm");
        let mesh = Arc::new(TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::X],
            indices: vec![[0, 1, 2]],
            ..TriangleMesh::default()
        });
        let surfaces = vec![Surface::new(Geometry::Mesh(mesh.clone()))];
        let skinned = scene.add_child(scene.root, Node { surfaces, ..Node::default() });
        let node = scene.add_child(scene.root, Node::named("hand"));
        let joint = |x: f64, parent, node| {
            let rest = Placement::Matrix(DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)));
            Joint { parent, node, rest, ..Joint::default() }
        };
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let turn = Curve::new(
            vec![0.0, 1.0],
            vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half],
            4,
            Interpolation::Linear,
        );
        let weights = Curve::new(vec![0.0, 2.0], vec![0.0, 1.0], 1, Interpolation::Linear);
        let skin = Skin {
            joints: vec![0, 1],
            inverse_bind: vec![
                DAffine3::IDENTITY,
                DAffine3::from_translation(DVec3::new(-1.0, 0.0, 0.0)),
            ],
        };
        let influences = InfluenceSet {
            joints: vec![[0, 1, 0, 0]; 3],
            weights: vec![[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]],
        };
        let up = MorphTarget { positions: vec![Vec3::Z; 3], ..MorphTarget::default() };
        scene.cameras.push(Camera::look_at(Vec3::X, Vec3::new(2.0, 0.0, 0.0), Vec3::Z, 0.5));
        scene.add_light(Directional { direction: DVec3::X, irradiance: Rgb::WHITE });
        scene.motion = Some(Arc::new(Motion {
            joints: vec![joint(0.0, None, None), joint(1.0, Some(0), Some(node))],
            clips: vec![Clip {
                name: "wave".into(),
                channels: vec![
                    Channel { joint: 1, track: Track::Rotation(turn.expect("valid")) },
                    Channel { joint: 0, track: Track::Weights(weights.expect("valid")) },
                ],
                parameters: Vec::new(),
            }],
            deformed: vec![Deformed {
                node: skinned,
                surface: 0,
                rest: mesh,
                morph: Some(Morph { targets: vec![up], weights: Vec::new(), joint: 0 }),
                skin: Some((Arc::new(skin), vec![influences])),
            }],
            cameras: vec![(0, 1)],
            lights: vec![(0, 1)],
            switches: Vec::new(),
        }));
        scene
    }

    #[test]
    fn joints_bend_meshes_and_carry_nodes_cameras_and_lights() {
        let scene = arm();
        let motion = scene.motion.clone().expect("it moves");
        let mut player = Player::new(motion.clone(), motion.usual_clips());
        assert_eq!(player.span(), [0.0, 2.0]);
        assert_eq!(player.moving_nodes().into_iter().map(|n| n.0).collect::<Vec<_>>(), [1, 2]);
        let mut posed = scene.clone();
        posed.apply(&player.pose(1.0));
        let Geometry::Mesh(mesh) = &posed.nodes[1].surfaces[0].geometry else { panic!("a mesh") };
        // Half of the target is added. The end of the arm points up, and the shared vertex stays in
        // the joint.
        let expected =
            [Vec3::new(0.0, 0.0, 0.5), Vec3::new(1.0, 1.0, 0.5), Vec3::new(1.0, 0.0, 0.5)];
        for (found, expected) in mesh.positions.iter().zip(expected) {
            assert!((*found - expected).length() < 1e-6, "{found} and not {expected}");
        }
        let hand = posed.nodes[2].transform;
        assert!((hand.transform_point3(DVec3::X) - DVec3::new(1.0, 1.0, 0.0)).length() < 1e-6);
        assert!(
            (posed.cameras[0].towards - DVec3::Y).length() < 1e-6
                && (posed.cameras[0].eye - DVec3::X).length() < 1e-6
        );
        let Light::Directional(Directional { direction, .. }) = posed.lights[0] else {
            panic!("no directional light");
        };
        assert!((direction - DVec3::Y).length() < 1e-6);
    }

    #[test]
    fn parameters_have_their_numbers_and_what_is_hidden_comes_back() {
        let mut scene = arm();
        scene.add_material(Material::new("paint", Diffuse::new(Rgb::WHITE)));
        let curve = |values: &[f32], width, interpolation| {
            Curve::new(vec![0.0, 1.0], values.to_vec(), width, interpolation).expect("valid")
        };
        let track = |owner, path: &str, curve| ParameterTrack { owner, path: path.into(), curve };
        let red = curve(&[1.0, 1.0, 1.0, 1.0, 0.0, 0.0], 3, Interpolation::Linear);
        let wide = curve(&[0.5, 1.5], 1, Interpolation::Linear);
        let mut motion = Motion::clone(scene.motion.as_ref().expect("it moves"));
        motion.clips[0].parameters = vec![
            track(Owner::Material(0), "reflectance.factor", red),
            track(Owner::Camera(0), "projection.tan_half_fov.1", wide.clone()),
            track(Owner::Material(0), "no_such_thing", wide),
        ];
        let visible = Track::Visible(curve(&[1.0, 0.0], 1, Interpolation::Step));
        motion.clips[0].channels.push(Channel { joint: 1, track: visible });
        let hand = Switched::Node(scene.root, NodeId(2));
        motion.switches = [hand, Switched::Light(0)]
            .map(|what| super::super::Switch { joints: vec![0, 1], what })
            .to_vec();
        let lights = scene.lights.clone();
        let mut player = Player::new(Arc::new(motion), vec![0]);
        for (time, reflectance, width, is_there) in [
            (0.5, Rgb::new(1.0, 0.5, 0.5), 1.0, true),
            (1.0, Rgb::new(1.0, 0.0, 0.0), 1.5, false),
            (0.0, Rgb::WHITE, 0.5, true),
        ] {
            scene.lights.clone_from(&lights);
            scene.apply(&player.pose(time));
            let MaterialKind::Diffuse(diffuse) = &scene.materials[0].kind else {
                panic!("still diffuse")
            };
            assert_eq!(diffuse.reflectance.factor, reflectance);
            let crate::Projection::Perspective { tan_half_fov } = scene.cameras[0].projection
            else {
                panic!()
            };
            assert_eq!(tan_half_fov[1], Some(width));
            assert_eq!(scene.nodes[0].children.contains(&NodeId(2)), is_there);
            assert_eq!(scene.lights[0].power(1.0) > 0.0, is_there);
        }
    }

    #[test]
    fn a_shutter_has_as_many_poses_as_the_motion_is_bent() {
        let mut player = Player::new(arm().motion.expect("it moves"), vec![0]);
        let mut count = |open, close| player.poses_between(open, close).len();
        assert_eq!((count(0.2, 0.2), count(0.5, 0.4)), (1, 1));
        assert_eq!(count(3.0, 4.0), 2, "nothing moves there");
        let (short, long) = (count(0.4, 0.41), count(0.0, 1.0));
        assert!(short == 2 && long > 8 && long <= 33, "{short} {long}");
    }

    #[test]
    fn what_does_not_change_is_not_made_again() {
        let scene = arm();
        let motion = scene.motion.clone().expect("it moves");
        let mut player = Player::new(motion, vec![0, 7]);
        let mesh = |pose: &Pose| pose.meshes.values().next().cloned().expect("a mesh");
        let (a, b, c) = (player.pose(2.0), player.pose(3.0), player.pose(0.5));
        assert!(Arc::ptr_eq(&mesh(&a), &mesh(&b)), "nothing moves after the end");
        assert!(!Arc::ptr_eq(&mesh(&b), &mesh(&c)));
        assert!(Player::new(Arc::default(), vec![0]).pose(1.0).meshes.is_empty());
    }
}
