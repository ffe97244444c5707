//! The description of a scene for the page.

use crate::protocol::{NodeInfo, SceneInfo};
use serde_json::Value;
use snell_math::{Bounds3d, DVec3};
use snell_scene::{Environment, NodeId, Scene, overrides};
use std::collections::{BTreeSet, HashMap};

/// Maximum number of nodes listed: a longer list is useless.
const MAX_NODES: usize = 5000;
/// Maximum number of materials and of lights listed.
const MAX_LISTED: usize = 2000;

/// Describes a scene. `base` is the scene before nodes were hidden.
pub fn scene_info(
    base: &Scene,
    scene: &Scene,
    hidden: &BTreeSet<u32>,
    generation: u32,
) -> SceneInfo {
    let (nodes, nodes_left_out) = nodes(base, hidden);
    let values = |list: Vec<Result<Value, serde_json::Error>>| {
        list.into_iter().map(Result::unwrap_or_default).collect()
    };
    let bounds = base.bounds().unwrap_or(Bounds3d::EMPTY);
    let bounds = if bounds.is_empty() || !bounds.is_finite() {
        [[-1.0; 3], [1.0; 3]]
    } else {
        [bounds.min.to_array(), bounds.max.to_array()]
    };
    SceneInfo {
        name: scene.name.clone(),
        generation,
        nodes,
        nodes_left_out,
        materials: values(
            scene.materials.iter().take(MAX_LISTED).map(serde_json::to_value).collect(),
        ),
        lights: values(scene.lights.iter().take(MAX_LISTED).map(serde_json::to_value).collect()),
        cameras: values(scene.cameras.iter().take(MAX_LISTED).map(serde_json::to_value).collect()),
        environment_rotation: environment_rotation(scene),
        bounds,
        up: scene.settings.up.unwrap_or(DVec3::Y).to_array(),
        triangles: 0,
        warnings: scene.warnings.iter().map(|w| w.message.clone()).collect(),
        history: [false; 2],
    }
}

/// The rotation of the environment about the up direction, in degrees; `None` unless the
/// environment is an image.
fn environment_rotation(scene: &Scene) -> Option<f64> {
    let Some(Environment::Image { world_from_environment, .. }) = &scene.environment else {
        return None;
    };
    Some(overrides::rotation(world_from_environment, scene.settings.up.unwrap_or(DVec3::Y)))
}

/// The reachable nodes, parents first, and the number of nodes left out.
fn nodes(scene: &Scene, hidden: &BTreeSet<u32>) -> (Vec<NodeInfo>, u32) {
    let mut list = Vec::new();
    let mut parents: HashMap<NodeId, Option<u32>> = HashMap::from([(scene.root, None)]);
    let mut open = vec![scene.root];
    let mut left_out = 0;
    while let Some(id) = open.pop() {
        let Some(node) = scene.nodes.get(id.index()) else { continue };
        for &child in node.children.iter().rev() {
            if let std::collections::hash_map::Entry::Vacant(place) = parents.entry(child) {
                place.insert(Some(id.0));
                open.push(child);
            }
        }
        if list.len() >= MAX_NODES {
            left_out += 1;
            continue;
        }
        list.push(NodeInfo {
            id: id.0,
            parent: parents[&id],
            name: node.name.clone(),
            surfaces: node.surfaces.iter().take(20).map(|s| s.geometry.describe()).collect(),
            visible: !hidden.contains(&id.0),
        });
    }
    (list, left_out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_scene::Node;

    #[test]
    fn a_shared_node_stands_once_and_parents_come_first() {
        let mut scene = Scene::new("shared");
        let shared = scene.add_node(Node::named("shared"));
        for name in ["left", "right"] {
            scene.add_child(scene.root, Node { children: vec![shared], ..Node::named(name) });
        }
        let info = scene_info(&scene, &scene, &BTreeSet::from([shared.0]), 1);
        let names: Vec<&str> = info.nodes.iter().map(|n| n.name.as_str()).collect();
        assert_eq!(names, ["root", "left", "shared", "right"]);
        assert!(info.nodes.iter().all(|n| n.visible != (n.id == shared.0)));
    }
}
