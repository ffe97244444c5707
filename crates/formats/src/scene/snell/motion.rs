//! Motion: joints, clips and deformed meshes.

use super::document::{Flaw, Meshes, flat, vectors};
use super::numbers::Numbers;
use serde::{Deserialize, Serialize};
use snell_intersect::TriangleMesh;
use snell_math::glam::DQuat;
use snell_math::{DVec3, Vec3};
use snell_scene::graph::NodeId;
use snell_scene::motion::{
    AnimatedTransform, Channel, Clip, Curve, Deformed, InfluenceSet, Interpolation, Joint, Morph,
    MorphTarget, Motion, Owner, ParameterTrack, Placement, Skin, Switch, Switched, Track,
};
use snell_scene::written::{Rows, affine, rows};
use snell_scene::{Geometry, Node};
use std::collections::HashMap;
use std::sync::Arc;

/// The motion of a scene.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionForm {
    #[serde(default)]
    joints: Vec<JointForm>,
    #[serde(default)]
    clips: Vec<ClipForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    skins: Vec<SkinForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    deformed: Vec<DeformedForm>,
    /// Pairs of camera and joint.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    cameras: Vec<(usize, u32)>,
    /// Pairs of light and joint.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    lights: Vec<(usize, u32)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    switches: Vec<SwitchForm>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SwitchForm {
    joints: Vec<u32>,
    what: Switched,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JointForm {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    parent: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    node: Option<NodeId>,
    rest: PlacementForm,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    hidden: bool,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum PlacementForm {
    Parts { translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3] },
    Matrix(Rows),
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ClipForm {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    name: String,
    channels: Vec<ChannelForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    parameters: Vec<ParameterForm>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterForm {
    owner: Owner,
    path: String,
    curve: CurveForm,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ChannelForm {
    joint: u32,
    track: TrackForm,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum TrackForm {
    Translation(CurveForm),
    Rotation(CurveForm),
    Scale(CurveForm),
    Weights(CurveForm),
    Transform(Vec<(f64, Rows)>),
    Visible(CurveForm),
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CurveForm {
    interpolation: InterpolationForm,
    width: usize,
    times: Numbers<f64>,
    values: Numbers<f32>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum InterpolationForm {
    Step,
    Linear,
    Cubic,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SkinForm {
    joints: Vec<u32>,
    inverse_bind: Vec<Rows>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DeformedForm {
    node: NodeId,
    surface: usize,
    /// The rest mesh, by its number in the table.
    rest: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    morph: Option<MorphForm>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    skin: Option<u32>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    influences: Vec<InfluenceForm>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MorphForm {
    joint: u32,
    weights: Vec<f64>,
    targets: Vec<TargetForm>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TargetForm {
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    positions: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    normals: Numbers<f32>,
    #[serde(default, skip_serializing_if = "Numbers::is_empty")]
    tangents: Numbers<f32>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct InfluenceForm {
    joints: Numbers<u16>,
    weights: Numbers<f32>,
}

impl MotionForm {
    /// Converts a motion; meshes are added to the table.
    pub fn of(motion: &Motion, meshes: &mut Meshes) -> Self {
        let (mut skins, mut known) = (Vec::new(), HashMap::new());
        let mut skin_number = |skin: &Arc<Skin>| {
            *known.entry(Arc::as_ptr(skin)).or_insert_with(|| {
                skins.push(SkinForm {
                    joints: skin.joints.clone(),
                    inverse_bind: skin.inverse_bind.iter().map(rows).collect(),
                });
                skins.len() as u32 - 1
            })
        };
        let deformed = motion.deformed.iter().map(|d| DeformedForm {
            node: d.node,
            surface: d.surface,
            rest: meshes.number(&d.rest),
            morph: d.morph.as_ref().map(MorphForm::of),
            skin: d.skin.as_ref().map(|(skin, _)| skin_number(skin)),
            influences: d
                .skin
                .iter()
                .flat_map(|(_, sets)| sets.iter().map(InfluenceForm::of))
                .collect(),
        });
        let deformed = deformed.collect();
        Self {
            joints: motion.joints.iter().map(JointForm::of).collect(),
            clips: motion.clips.iter().map(ClipForm::of).collect(),
            skins,
            deformed,
            cameras: motion.cameras.clone(),
            lights: motion.lights.clone(),
            switches: motion
                .switches
                .iter()
                .map(|s| SwitchForm { joints: s.joints.clone(), what: s.what })
                .collect(),
        }
    }

    /// False if a number is not finite: JSON cannot express that.
    pub fn is_sayable(&self) -> bool {
        let finite = |map: &Rows| map.as_flattened().iter().all(|x| x.is_finite());
        let joints = self.joints.iter().all(|joint| match &joint.rest {
            PlacementForm::Parts { translation, rotation, scale } => {
                translation.iter().chain(rotation).chain(scale).all(|x| x.is_finite())
            }
            PlacementForm::Matrix(map) => finite(map),
        });
        let channels = self.clips.iter().flat_map(|clip| &clip.channels);
        let transforms = channels.filter_map(|c| {
            if let TrackForm::Transform(keys) = &c.track { Some(keys) } else { None }
        });
        let weights = self.deformed.iter().flat_map(|d| &d.morph).flat_map(|morph| &morph.weights);
        joints
            && transforms.flatten().all(|(_, map)| finite(map))
            && self.skins.iter().flat_map(|skin| &skin.inverse_bind).all(finite)
            && weights.into_iter().all(|w| w.is_finite())
    }

    /// The motion of a scene with these nodes and meshes, and these numbers of cameras and lights.
    pub fn motion(
        self,
        nodes: &[Node],
        meshes: &[Arc<TriangleMesh>],
        [cameras, lights]: [usize; 2],
    ) -> Result<Motion, Flaw> {
        let count = self.joints.len();
        let mut joints = Vec::with_capacity(count);
        for (i, joint) in self.joints.into_iter().enumerate() {
            joints
                .push(joint.joint(i, nodes.len()).map_err(|flaw| (format!("/joints/{i}"), flaw))?);
        }
        let mut clips = Vec::with_capacity(self.clips.len());
        for (i, clip) in self.clips.into_iter().enumerate() {
            let clip =
                clip.clip(count).map_err(|(place, flaw)| (format!("/clips/{i}{place}"), flaw))?;
            clips.push(clip);
        }
        let mut skins = Vec::with_capacity(self.skins.len());
        for (i, skin) in self.skins.into_iter().enumerate() {
            skins.push(Arc::new(skin.skin(count).map_err(|flaw| (format!("/skins/{i}"), flaw))?));
        }
        let mut deformed = Vec::with_capacity(self.deformed.len());
        for (i, form) in self.deformed.into_iter().enumerate() {
            let made = form.deformed(nodes, meshes, &skins, count);
            deformed.push(made.map_err(|flaw| (format!("/deformed/{i}"), flaw))?);
        }
        for (what, carried, things) in
            [("cameras", &self.cameras, cameras), ("lights", &self.lights, lights)]
        {
            for (i, &(thing, joint)) in carried.iter().enumerate() {
                let place = || format!("/{what}/{i}");
                is_there(what, thing, things).map_err(|flaw| (place(), flaw))?;
                is_there("joint", joint as usize, count).map_err(|flaw| (place(), flaw))?;
            }
        }
        let mut switches = Vec::with_capacity(self.switches.len());
        for (i, form) in self.switches.into_iter().enumerate() {
            let made = form.switch(nodes.len(), lights, count);
            switches.push(made.map_err(|flaw| (format!("/switches/{i}"), flaw))?);
        }
        Ok(Motion { joints, clips, deformed, cameras: self.cameras, lights: self.lights, switches })
    }
}

/// Fails for an index past the end of its table.
fn is_there(what: &str, number: usize, count: usize) -> Result<(), String> {
    if number < count { Ok(()) } else { Err(format!("{what} is {number}, but there are {count}")) }
}

impl JointForm {
    fn of(joint: &Joint) -> Self {
        let rest = match &joint.rest {
            Placement::Parts { translation, rotation, scale } => PlacementForm::Parts {
                translation: translation.to_array(),
                rotation: rotation.to_array(),
                scale: scale.to_array(),
            },
            Placement::Matrix(map) => PlacementForm::Matrix(rows(map)),
        };
        Self {
            name: joint.name.clone(),
            parent: joint.parent,
            node: joint.node,
            rest,
            hidden: joint.hidden,
        }
    }

    fn joint(self, number: usize, nodes: usize) -> Result<Joint, String> {
        if let Some(parent) = self.parent.filter(|&p| p as usize >= number) {
            return Err(format!("parent is {parent}, but parents come before their children"));
        }
        self.node.map_or(Ok(()), |node| is_there("node", node.index(), nodes))?;
        let rest = match self.rest {
            PlacementForm::Parts { translation, rotation, scale } => Placement::Parts {
                translation: DVec3::from_array(translation),
                rotation: DQuat::from_array(rotation),
                scale: DVec3::from_array(scale),
            },
            PlacementForm::Matrix(map) => Placement::Matrix(affine(&map)),
        };
        Ok(Joint {
            name: self.name,
            parent: self.parent,
            rest,
            node: self.node,
            hidden: self.hidden,
        })
    }
}

impl SwitchForm {
    fn switch(self, nodes: usize, lights: usize, joints: usize) -> Result<Switch, String> {
        self.joints.iter().try_for_each(|&joint| is_there("joint", joint as usize, joints))?;
        match self.what {
            Switched::Light(light) => is_there("light", light, lights)?,
            Switched::Node(parent, node) => {
                is_there("node", parent.index(), nodes)?;
                is_there("node", node.index(), nodes)?;
            }
        }
        Ok(Switch { joints: self.joints, what: self.what })
    }
}

impl ClipForm {
    fn of(clip: &Clip) -> Self {
        let channels = clip
            .channels
            .iter()
            .map(|c| ChannelForm { joint: c.joint, track: TrackForm::of(&c.track) });
        let parameters = clip.parameters.iter().map(|p| ParameterForm {
            owner: p.owner,
            path: p.path.clone(),
            curve: CurveForm::of(&p.curve),
        });
        Self {
            name: clip.name.clone(),
            channels: channels.collect(),
            parameters: parameters.collect(),
        }
    }

    fn clip(self, joints: usize) -> Result<Clip, Flaw> {
        let mut channels = Vec::with_capacity(self.channels.len());
        for (i, channel) in self.channels.into_iter().enumerate() {
            let place = |flaw| (format!("/channels/{i}"), flaw);
            is_there("joint", channel.joint as usize, joints).map_err(place)?;
            channels.push(Channel {
                joint: channel.joint,
                track: channel.track.track().map_err(place)?,
            });
        }
        let mut parameters = Vec::with_capacity(self.parameters.len());
        for (i, form) in self.parameters.into_iter().enumerate() {
            let curve =
                form.curve.curve(None).map_err(|flaw| (format!("/parameters/{i}"), flaw))?;
            parameters.push(ParameterTrack { owner: form.owner, path: form.path, curve });
        }
        Ok(Clip { name: self.name, channels, parameters })
    }
}

impl TrackForm {
    fn of(track: &Track) -> Self {
        match track {
            Track::Translation(curve) => Self::Translation(CurveForm::of(curve)),
            Track::Rotation(curve) => Self::Rotation(CurveForm::of(curve)),
            Track::Scale(curve) => Self::Scale(CurveForm::of(curve)),
            Track::Weights(curve) => Self::Weights(CurveForm::of(curve)),
            Track::Transform(map) => {
                Self::Transform(map.keys().map(|(time, map)| (time, rows(&map))).collect())
            }
            Track::Visible(curve) => Self::Visible(CurveForm::of(curve)),
        }
    }

    fn track(self) -> Result<Track, String> {
        Ok(match self {
            Self::Translation(form) => Track::Translation(form.curve(Some(3))?),
            Self::Rotation(form) => Track::Rotation(form.curve(Some(4))?),
            Self::Scale(form) => Track::Scale(form.curve(Some(3))?),
            Self::Weights(form) => Track::Weights(form.curve(None)?),
            Self::Transform(keys) => {
                let keys = keys.iter().map(|(time, map)| (*time, affine(map)));
                Track::Transform(AnimatedTransform::new(keys))
            }
            Self::Visible(form) => Track::Visible(form.curve(Some(1))?),
        })
    }
}

impl CurveForm {
    fn of(curve: &Curve) -> Self {
        let interpolation = match curve.interpolation() {
            Interpolation::Step => InterpolationForm::Step,
            Interpolation::Linear => InterpolationForm::Linear,
            Interpolation::Cubic => InterpolationForm::Cubic,
        };
        let (times, values) = (Numbers(curve.times().to_vec()), Numbers(curve.values().to_vec()));
        Self { interpolation, width: curve.width(), times, values }
    }

    /// The curve; fails unless it has `width` numbers per key.
    fn curve(self, width: Option<usize>) -> Result<Curve, String> {
        let interpolation = match self.interpolation {
            InterpolationForm::Step => Interpolation::Step,
            InterpolationForm::Linear => Interpolation::Linear,
            InterpolationForm::Cubic => Interpolation::Cubic,
        };
        if let Some(width) = width.filter(|&w| w != self.width) {
            return Err(format!("width is {}, expected {width}", self.width));
        }
        Curve::new(self.times.0, self.values.0, self.width, interpolation)
            .map_err(|error| error.to_string())
    }
}

impl SkinForm {
    fn skin(self, joints: usize) -> Result<Skin, String> {
        self.joints.iter().try_for_each(|&joint| is_there("joint", joint as usize, joints))?;
        if self.joints.len() != self.inverse_bind.len() {
            return Err(format!(
                "{} joints and {} inverse_bind",
                self.joints.len(),
                self.inverse_bind.len()
            ));
        }
        Ok(Skin {
            joints: self.joints,
            inverse_bind: self.inverse_bind.iter().map(affine).collect(),
        })
    }
}

impl DeformedForm {
    fn deformed(
        self,
        nodes: &[Node],
        meshes: &[Arc<TriangleMesh>],
        skins: &[Arc<Skin>],
        joints: usize,
    ) -> Result<Deformed, String> {
        is_there("node", self.node.index(), nodes.len())?;
        let surfaces = &nodes[self.node.index()].surfaces;
        is_there("surface", self.surface, surfaces.len())?;
        if !matches!(surfaces[self.surface].geometry, Geometry::Mesh(_)) {
            return Err(format!("surface {} of node {} is not a mesh", self.surface, self.node.0));
        }
        is_there("rest", self.rest as usize, meshes.len())?;
        let rest = meshes[self.rest as usize].clone();
        let vertices = rest.positions.len();
        let morph = self.morph.map(|form| form.morph(vertices, joints)).transpose()?;
        let skin = match self.skin {
            Some(number) => {
                is_there("skin", number as usize, skins.len())?;
                let skin = skins[number as usize].clone();
                let sets = self
                    .influences
                    .into_iter()
                    .map(|form| form.influences(vertices, skin.joints.len()));
                Some((skin.clone(), sets.collect::<Result<Vec<_>, _>>()?))
            }
            None => None,
        };
        Ok(Deformed { node: self.node, surface: self.surface, rest, morph, skin })
    }
}

impl MorphForm {
    fn of(morph: &Morph) -> Self {
        let parts = |v: &[Vec3]| flat(v, |v: Vec3| v.to_array());
        let targets = morph.targets.iter().map(|t| TargetForm {
            positions: parts(&t.positions),
            normals: parts(&t.normals),
            tangents: parts(&t.tangents),
        });
        Self { joint: morph.joint, weights: morph.weights.clone(), targets: targets.collect() }
    }

    fn morph(self, vertices: usize, joints: usize) -> Result<Morph, String> {
        is_there("joint", self.joint as usize, joints)?;
        let differences = |key, numbers: Numbers<f32>| {
            let found = vectors(key, numbers, Vec3::from_array)
                .map_err(|(key, flaw)| format!("{key}: {flaw}"))?;
            if found.is_empty() || found.len() == vertices {
                return Ok(found);
            }
            Err(format!("{} {key} of a target for {vertices} vertices", found.len()))
        };
        let target = |form: TargetForm| {
            Ok(MorphTarget {
                positions: differences("positions", form.positions)?,
                normals: differences("normals", form.normals)?,
                tangents: differences("tangents", form.tangents)?,
            })
        };
        let targets = self.targets.into_iter().map(target).collect::<Result<_, String>>()?;
        Ok(Morph { targets, weights: self.weights, joint: self.joint })
    }
}

impl InfluenceForm {
    fn of(set: &InfluenceSet) -> Self {
        Self { joints: Numbers(set.joints.concat()), weights: Numbers(set.weights.concat()) }
    }

    fn influences(self, vertices: usize, joints: usize) -> Result<InfluenceSet, String> {
        let (joint, weight) = (self.joints.0.as_chunks::<4>().0, self.weights.0.as_chunks::<4>().0);
        if self.joints.0.len() != 4 * vertices || self.weights.0.len() != 4 * vertices {
            let (joints, weights) = (self.joints.0.len(), self.weights.0.len());
            return Err(format!(
                "{joints} joints and {weights} weights, expected 4 of each for {vertices} vertices"
            ));
        }
        let pairs = joint.as_flattened().iter().zip(weight.as_flattened());
        for (&joint, _) in pairs.filter(|(_, weight)| **weight > 0.0) {
            is_there("influence of joint", usize::from(joint), joints)?;
        }
        Ok(InfluenceSet { joints: joint.to_vec(), weights: weight.to_vec() })
    }
}
