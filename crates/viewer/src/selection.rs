//! What was selected on the page: where it stands, for the gizmo, and the pixels that show it, for
//! its outline.

use crate::protocol::{Mask, Placement};
use crate::session::Snapshot;
use rayon::prelude::*;
use snell_math::{DAffine3, DVec2, Vec2};
use snell_render::CompiledScene;
use snell_scene::written::rows;
use snell_scene::{CameraSample, Geometry, NodeId, Scene};
use std::collections::HashMap;

/// Maximum width of a mask in pixels.
const MAX_WIDTH: u32 = 1280;

/// The length of the part of a path, given from the root, that leads to the node that moves: the
/// last one that stands in one place only. Parts that are used several times stand in all of their
/// places, and moving one would move all.
fn movable(scene: &Scene, path: &[NodeId]) -> usize {
    let mut uses: HashMap<NodeId, u32> = HashMap::new();
    for node in &scene.nodes {
        node.children.iter().for_each(|child| *uses.entry(*child).or_default() += 1);
    }
    let is_single = |id: &&NodeId| uses.get(*id).is_none_or(|count| *count == 1);
    path.iter().take_while(is_single).count().max(1)
}

/// Where the selected thing stands; `None` if the path is not one of the scene.
pub fn placement(scene: &Scene, path: &[u32]) -> Option<Placement> {
    let path: Vec<NodeId> = path.iter().map(|id| NodeId(*id)).collect();
    let is_path = path.first() == Some(&scene.root)
        && path.windows(2).all(|pair| {
            scene.nodes.get(pair[0].index()).is_some_and(|node| node.children.contains(&pair[1]))
        });
    if !is_path {
        return None;
    }
    let length = movable(scene, &path);
    let id = path[length - 1];
    let above = path[..length - 1].iter();
    let world_from_parent = above
        .map(|id| scene.nodes[id.index()].transform)
        .fold(DAffine3::IDENTITY, |map, next| map * next);
    let bounds = scene.node_bounds().ok()?.get(&id).copied().filter(|b| b.is_finite());
    let bounds = bounds.filter(|b| !b.is_empty());
    Some(Placement {
        node: id.0,
        name: scene.nodes[id.index()].name.clone(),
        depth: length as u32,
        world_from_parent: rows(&world_from_parent),
        parent_from_node: rows(&scene.nodes[id.index()].transform),
        bounds: bounds.map(|b| [b.min.to_array(), b.max.to_array()]),
    })
}

/// The number of the material of a surface of the last node of a path, given by its number there
/// and that of a primitive; `None` if it has none.
pub fn material(scene: &Scene, path: &[u32], [surface, primitive]: [u32; 2]) -> Option<u32> {
    let node = |id: &u32| scene.nodes.get(*id as usize);
    let surface = node(path.last()?)?.surfaces.get(surface as usize)?;
    let slot = match &surface.geometry {
        Geometry::Mesh(mesh) => mesh.material_slots.get(primitive as usize).copied().unwrap_or(0),
        _ => 0,
    };
    let own = surface.materials.get(usize::from(slot)).copied().flatten();
    let handed = || path.iter().rev().find_map(|id| node(id)?.material);
    own.or_else(handed).map(|id| id.0).filter(|&id| (id as usize) < scene.materials.len())
}

/// The pixels of the picture, in a size of at most this width, that show what stands at a path.
pub fn mask(snapshot: &Snapshot, compiled: &CompiledScene, path: &[u32], width: u32) -> Mask {
    let [w, h] = snapshot.settings.size;
    let width = width.clamp(1, MAX_WIDTH.min(w));
    let height = ((u64::from(width) * u64::from(h)).div_ceil(u64::from(w)) as u32).max(1);
    let share = [f64::from(w) / f64::from(width), f64::from(h) / f64::from(height)];
    let filter = snell_render::job::camera_filter(compiled);
    let row = |y: u32| {
        let mut known: HashMap<(u32, u32), bool> = HashMap::new();
        let shows = |x: u32| {
            let film = DVec2::new((f64::from(x) + 0.5) * share[0], (f64::from(y) + 0.5) * share[1]);
            let sample = CameraSample { film, lens: Vec2::splat(0.5) };
            let ray = snapshot.camera.ray(&sample, snapshot.settings.size).ray;
            let hit = compiled.world.closest_one(&ray, filter.at(0));
            hit.is_hit()
                && *known.entry((hit.instance, hit.geometry)).or_insert_with(|| {
                    let found = compiled.node_path(&hit);
                    found.len() >= path.len() && found.iter().zip(path).all(|(a, b)| a.0 == *b)
                })
        };
        (0..width).map(shows).collect::<Vec<bool>>()
    };
    let rows: Vec<Vec<bool>> = (0..height).into_par_iter().map(row).collect();
    Mask { size: [width, height], runs: runs(rows.into_iter().flatten()) }
}

/// The lengths of runs of equal values, beginning with one of `false`.
fn runs(values: impl Iterator<Item = bool>) -> Vec<u32> {
    let (mut runs, mut now) = (vec![0], false);
    for value in values {
        if value != now {
            runs.push(0);
            now = value;
        }
        if let Some(last) = runs.last_mut() {
            *last += 1;
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_formats::image::Display;
    use snell_intersect::shape::Sphere;
    use snell_render::Settings;
    use snell_scene::material::Diffuse;
    use snell_scene::{Material, Node, Surface};
    use std::sync::Arc;
    use std::time::Instant;

    #[test]
    fn a_mask_is_written_in_runs() {
        assert_eq!(runs([true, true, false, true].into_iter()), [0, 2, 1, 1]);
        assert_eq!(runs([false, false].into_iter()), [2]);
    }

    #[test]
    fn a_part_that_stands_in_two_places_moves_in_the_chosen_one_only() {
        let mut scene = Scene::new("shared");
        let ball = Geometry::Shape(Arc::new(Sphere { radius: 1.0 }.into()));
        let surfaces = vec![Surface::new(ball)];
        let part = scene.add_node(Node { surfaces, ..Node::named("part") });
        let transform = DAffine3::from_translation([3.0, 0.0, 0.0].into());
        let place = |name: &str| Node { children: vec![part], transform, ..Node::named(name) };
        let left = scene.add_child(scene.root, place("left"));
        scene.add_child(scene.root, place("right"));
        let found = placement(&scene, &[0, left.0, part.0]).expect("it is a path");
        assert_eq!((found.node, &*found.name, found.depth), (left.0, "left", 2));
        assert_eq!(found.parent_from_node[0][3], 3.0);
        assert_eq!(found.bounds, Some([[-1.0; 3], [1.0; 3]]));
        assert!(placement(&scene, &[0, part.0]).is_none(), "the root has no such child");
    }

    #[test]
    fn a_surface_has_its_own_material_or_that_of_the_nearest_node_above() {
        let white = || Material::new("white", Diffuse::new(snell_math::Rgb::WHITE));
        let mut scene = Scene::new("bare");
        let ball = Geometry::Shape(Arc::new(Sphere { radius: 1.0 }.into()));
        let surfaces = vec![Surface::new(ball)];
        let part = scene.add_child(scene.root, Node { surfaces, ..Node::named("part") });
        let path = [scene.root.0, part.0];
        assert_eq!(material(&scene, &path, [0, 0]), None);
        let grey = scene.add_material(white());
        scene.nodes[scene.root.index()].material = Some(grey);
        assert_eq!(material(&scene, &path, [0, 0]), Some(0));
        let own = scene.add_material(white());
        scene.nodes[part.index()].surfaces[0].materials = vec![Some(own)];
        assert_eq!(material(&scene, &path, [0, 7]), Some(1));
        assert_eq!(material(&scene, &path, [3, 0]), None);
        assert_eq!(material(&scene, &[], [0, 0]), None);
    }

    #[test]
    fn the_mask_shows_the_selected_node_and_no_other() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        let compiled = CompiledScene::new(&scene, &Default::default()).expect("valid");
        let snapshot = Snapshot {
            version: 0,
            generation: 0,
            geometry: 0,
            placement: 0,
            light: 0,
            moving: Arc::default(),
            scene: Arc::new(scene.clone()),
            camera: scene.cameras[0].clone(),
            seq: 0,
            settings: Settings { size: [64, 48], ..Settings::default() },
            display: Display::default(),
            moved: Instant::now(),
        };
        let picked = crate::pick::pick(&snapshot, &compiled, [22.0, 30.0]).expect("a surface");
        let mask = mask(&snapshot, &compiled, &picked.nodes, 64);
        let shown: u32 = mask.runs.iter().skip(1).step_by(2).sum();
        assert_eq!(mask.size, [64, 48]);
        assert_eq!(mask.runs.iter().sum::<u32>(), 64 * 48);
        assert!((1..64 * 40).contains(&shown), "{shown}");
    }
}
