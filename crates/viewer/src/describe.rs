//! The description of a scene for the page.

use crate::protocol::{NodeInfo, SceneInfo, Surroundings};
use crate::subject::Extents;
use serde_json::Value;
use snell_math::{Bounds3d, DVec3, Rgb};
use snell_scene::graph::ImageId;
use snell_scene::{
    Background, Encoding, Environment, Geometry, ImageTexture, NodeId, Scene, ShadowCatcher,
    Surface, Texture, overrides,
};
use std::collections::{BTreeSet, HashMap};

/// Maximum number of nodes listed: a longer list is useless.
const MAX_NODES: usize = 5000;
/// Maximum number of materials and of lights listed.
const MAX_LISTED: usize = 2000;

/// Describes a scene. `base` is the scene before nodes were hidden; `is_v_down` says that texture
/// coordinates grow downwards in pictures, as in glTF.
pub fn scene_info(
    base: &Scene,
    scene: &Scene,
    extents: &Extents,
    hidden: &BTreeSet<u32>,
    generation: u32,
    is_v_down: bool,
) -> SceneInfo {
    let (nodes, nodes_left_out) = nodes(base, hidden);
    let values = |list: Vec<Result<Value, serde_json::Error>>| {
        list.into_iter().map(Result::unwrap_or_default).collect()
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
        textures: values(
            scene.textures.iter().take(MAX_LISTED).map(serde_json::to_value).collect(),
        ),
        images: scene.images.len() as u32,
        new_texture: new_texture(scene, is_v_down),
        surroundings: surroundings(scene),
        isolated: None,
        motion: None,
        bounds: corners(&extents.bounds),
        subject: corners(&extents.subject),
        ground: extents.ground,
        up: scene.settings.up.unwrap_or(DVec3::Y).to_array(),
        triangles: 0,
        shapes: scene.nodes.iter().flat_map(|node| &node.surfaces).filter(is_shape).count() as u64,
        warnings: scene.warnings.iter().map(|w| w.message.clone()).collect(),
    }
}

fn is_shape(surface: &&Surface) -> bool {
    matches!(surface.geometry, Geometry::Shape(_))
}

/// The minimum and maximum corner of a box.
pub fn corners(bounds: &Bounds3d) -> [[f64; 3]; 2] {
    [bounds.min.to_array(), bounds.max.to_array()]
}

/// A texture of the next image, in the place of the scene's other textures.
fn new_texture(scene: &Scene, is_v_down: bool) -> Value {
    let next = ImageId(scene.images.len() as u32);
    let known = scene.textures.iter().find_map(Texture::as_image);
    let texture = match known {
        Some(known) => ImageTexture { image: next, ..known.clone() },
        None => {
            let mut texture = ImageTexture::new(next, Encoding::Srgb);
            if !is_v_down {
                texture.uv_transform = [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]];
            }
            texture
        }
    };
    serde_json::to_value(texture).unwrap_or_default()
}

fn surroundings(scene: &Scene) -> Surroundings {
    let up = scene.settings.up.unwrap_or(DVec3::Y);
    let (environment, light, rotation) = match &scene.environment {
        None => ("none", Rgb::BLACK, 0.0),
        Some(Environment::Constant(light)) => ("color", *light, 0.0),
        Some(Environment::Image { scale, world_from_environment, .. }) => {
            ("image", *scale, overrides::rotation(world_from_environment, up))
        }
    };
    let (background, color) = match scene.background {
        Background::Environment => ("environment", None),
        Background::Transparent => ("transparent", None),
        Background::Color(color) => ("color", Some(color)),
        Background::ShadowCatcher(ShadowCatcher { color, .. }) => ("studio", Some(color)),
    };
    Surroundings {
        environment: environment.into(),
        light: light.to_array(),
        rotation,
        background: background.into(),
        color: color.map(Rgb::to_array),
    }
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
    use crate::subject::extents;
    use snell_scene::Node;

    #[test]
    fn a_shared_node_stands_once_and_parents_come_first() {
        let mut scene = Scene::new("shared");
        let shared = scene.add_node(Node::named("shared"));
        for name in ["left", "right"] {
            scene.add_child(scene.root, Node { children: vec![shared], ..Node::named(name) });
        }
        let info = scene_info(
            &scene,
            &scene,
            &extents(&scene, DVec3::Y, None),
            &BTreeSet::from([shared.0]),
            1,
            true,
        );
        let names: Vec<&str> = info.nodes.iter().map(|n| n.name.as_str()).collect();
        assert_eq!(names, ["root", "left", "shared", "right"]);
        assert!(info.nodes.iter().all(|n| n.visible != (n.id == shared.0)));
    }
}
