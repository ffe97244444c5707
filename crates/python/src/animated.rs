//! The animation of the nodes of a file as the motion of objects, so that queries see it.

use crate::motion::Motion;
use snell_math::Transform;
use snell_scene::graph::NodeId;
use snell_scene::motion::{AnimatedTransform, Channel, Clip, Joint, Track};
use snell_scene::{Motion as FileMotion, Player, Scene};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// The largest difference from the animation of the file, relative to the entries of the map.
const TOLERANCE: f64 = 1e-5;
/// The most pieces that the time between two keys of a curve is cut into.
const MOST_PIECES: u32 = 64;
/// The most keys of an object.
const MOST_KEYS: usize = 1 << 16;

/// The animation of a file.
#[derive(Default)]
pub struct Animation {
    /// The nodes that move, in the coordinates of their parents.
    pub nodes: HashMap<NodeId, Motion>,
    /// The part that objects do not have: the animation of cameras, lights and parameters.
    pub rest: Option<Arc<FileMotion>>,
}

impl Animation {
    /// The animation that pictures of a scene show. `None` if objects cannot have it: if it deforms
    /// meshes, hides things, jumps, makes something flat, or if the file at rest is not as at the
    /// first keys (queries without times show these, and pictures the file at rest).
    pub fn of(scene: &Scene) -> Option<Self> {
        let Some(motion) = &scene.motion else { return Some(Self::default()) };
        if !motion.deformed.is_empty() || !motion.switches.is_empty() {
            return None;
        }
        let mut tracks: BTreeMap<u32, Vec<&Track>> = BTreeMap::new();
        for channel in motion.usual_clips().iter().flat_map(|&i| &motion.clips[i].channels) {
            if !matches!(channel.track, Track::Weights(_) | Track::Visible(_)) {
                tracks.entry(channel.joint).or_default().push(&channel.track);
            }
        }
        let mut nodes = HashMap::new();
        for (joint, tracks) in tracks {
            let joint = motion.joints.get(joint as usize)?;
            let Some(node) = joint.node else { continue };
            let moved = object_motion(joint, &tracks)?;
            let at_rest = Transform::new(scene.nodes.get(node.index())?.transform)?;
            if !are_near(&moved.maps()[0], &at_rest) || nodes.insert(node, moved).is_some() {
                return None;
            }
        }
        Some(Self { nodes, rest: without_nodes(motion) })
    }
}

/// True if a part of this animation moves or changes surfaces.
pub fn changes_surfaces(motion: &FileMotion) -> bool {
    let has_nodes = motion.joints.iter().any(|joint| joint.node.is_some());
    has_nodes || !motion.deformed.is_empty() || !motion.switches.is_empty()
}

/// The animation of cameras, lights and parameters; `None` if there is none.
fn without_nodes(motion: &FileMotion) -> Option<Arc<FileMotion>> {
    let is_empty = motion.cameras.is_empty()
        && motion.lights.is_empty()
        && motion.clips.iter().all(|clip| clip.parameters.is_empty());
    let mut rest = FileMotion::clone(motion);
    rest.joints.iter_mut().for_each(|joint| joint.node = None);
    (!is_empty).then(|| Arc::new(rest))
}

/// The motion of a joint.
fn object_motion(joint: &Joint, tracks: &[&Track]) -> Option<Motion> {
    if let [Track::Transform(transform)] = tracks {
        let keys: Option<Vec<_>> =
            transform.keys().map(|(time, map)| Some((time, Transform::new(map)?))).collect();
        return from_keys(keys?);
    }
    let mut times: Vec<f64> = Vec::new();
    for track in tracks {
        match track {
            Track::Translation(curve) | Track::Rotation(curve) | Track::Scale(curve) => {
                times.extend(curve.times());
            }
            Track::Transform(transform) => times.extend(transform.keys().map(|key| key.0)),
            Track::Weights(_) | Track::Visible(_) => {}
        }
    }
    times.sort_by(f64::total_cmp);
    times.dedup();
    let joint = Joint { parent: None, node: Some(NodeId(0)), ..joint.clone() };
    let channels = tracks.iter().map(|track| Channel { joint: 0, track: Track::clone(track) });
    let clip = Clip { channels: channels.collect(), ..Clip::default() };
    let alone = FileMotion { joints: vec![joint], clips: vec![clip], ..FileMotion::default() };
    let mut player = Player::new(Arc::new(alone), vec![0]);
    let mut map_at = |time: f64| {
        let map = player.pose(time).transforms.get(&NodeId(0)).copied();
        Some((time, Transform::new(map?)?))
    };
    let mut keys = vec![map_at(*times.first()?)?];
    for pair in times.windows(2) {
        let between =
            |piece: f64, pieces: u32| pair[0] + (pair[1] - pair[0]) * piece / f64::from(pieces);
        let mut pieces = 1;
        let cut = loop {
            let mut cut = vec![keys[keys.len() - 1]];
            for piece in 1..=pieces {
                let time = if piece == pieces { pair[1] } else { between(piece.into(), pieces) };
                cut.push(map_at(time)?);
            }
            let smooth =
                AnimatedTransform::new(cut.iter().map(|(time, map)| (*time, *map.matrix())));
            let mut is_near = |piece: u32, share: f64| {
                let time = between(f64::from(piece) + share, pieces);
                Some(are_near(&map_at(time)?.1, &Transform::new(smooth.at(time))?))
            };
            let mut all_near = true;
            for piece in 0..pieces {
                all_near &= is_near(piece, 0.5)? && is_near(piece, 0.2)?;
            }
            if all_near {
                break cut;
            }
            pieces *= 2;
            if pieces > MOST_PIECES {
                return None;
            }
        };
        keys.extend(&cut[1..]);
        if keys.len() > MOST_KEYS {
            return None;
        }
    }
    from_keys(keys)
}

fn from_keys(keys: Vec<(f64, Transform)>) -> Option<Motion> {
    let (times, maps): (Vec<f64>, Vec<Transform>) = keys.into_iter().unzip();
    (!maps.is_empty()).then(|| Motion::new(times, maps).ok()).flatten()
}

fn are_near(a: &Transform, b: &Transform) -> bool {
    let [a, b] = [a, b].map(|map| map.matrix());
    let size = |entries: &[f64]| entries.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    let linear = (a.matrix3 - b.matrix3).to_cols_array();
    let shift = (a.translation - b.translation).to_array();
    let scale = size(&a.matrix3.to_cols_array());
    size(&linear) <= TOLERANCE * scale
        && size(&shift) <= TOLERANCE * scale.max(size(&a.translation.to_array()))
}
