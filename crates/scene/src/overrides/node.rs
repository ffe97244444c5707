//! Changes of nodes: `node.NAME.visible`, `transform`, `material` and `isolated`.

use super::{OverrideError, error, find, from_value};
use crate::written::{Rows, affine};
use crate::{MaterialId, NodeId, Scene, Surface};
use serde_json::Value;
use std::collections::BTreeSet;

/// Applies a change to the node that `rest` names.
pub(super) fn edit(
    scene: &mut Scene,
    key: &str,
    rest: &str,
    value: Value,
) -> Result<(), OverrideError> {
    let names: Vec<String> = scene.nodes.iter().map(|n| n.name.clone()).collect();
    // Numbers are tried first, because nodes in many files have numbers as names.
    let numbered =
        rest.split_once('.').and_then(|(number, path)| Some((number.parse::<usize>().ok()?, path)));
    let (index, path) = match numbered.filter(|(index, _)| *index < names.len()) {
        Some(numbered) => numbered,
        None => find(key, "node", &names, rest)?,
    };
    match path {
        "visible" => {
            if !from_value::<bool>(key, value)? {
                let node = &mut scene.nodes[index];
                (node.surfaces, node.children) = (Vec::new(), Vec::new());
            }
        }
        "isolated" => {
            if from_value::<bool>(key, value)? {
                isolate(scene, NodeId(index as u32));
            }
        }
        "transform" => {
            let wanted: Option<Rows> = serde_json::from_value(value).ok();
            let is_possible = |x: &f64| x.abs() <= crate::ranges::FARTHEST;
            let wanted = wanted.filter(|rows| rows.iter().flatten().all(is_possible));
            let expected = "expected three rows of four numbers, such as \
                [[1,0,0,0],[0,1,0,0],[0,0,1,0]]: the map from the node to its parent";
            scene.nodes[index].transform = affine(&wanted.ok_or_else(|| error(key, expected))?);
        }
        "material" => {
            let wanted: Option<Option<MaterialId>> = serde_json::from_value(value).ok();
            let count = scene.materials.len();
            let is_there = |id: &Option<MaterialId>| id.is_none_or(|id| id.index() < count);
            let problem = format!("expected null, or the number of a material: there are {count}");
            let wanted = wanted.filter(is_there).ok_or_else(|| error(key, problem))?;
            let node = &mut scene.nodes[index];
            node.material = wanted;
            node.surfaces.iter_mut().for_each(|surface| surface.materials.clear());
        }
        _ => {
            let known = "visible, isolated, transform, material";
            return Err(error(key, format!("there is no parameter \"{path}\" (known: {known})")));
        }
    }
    Ok(())
}

/// Removes all surfaces but those of a node and of what is below it, and those that shine: they
/// light what remains.
fn isolate(scene: &mut Scene, chosen: NodeId) {
    let below = reachable(scene, chosen);
    let shining = shining(scene);
    let nodes = scene.nodes.iter_mut().enumerate();
    for (i, node) in nodes.filter(|(i, _)| !below.contains(&NodeId(*i as u32))) {
        let mut number = 0;
        node.surfaces.retain(|_| {
            number += 1;
            shining.contains(&(i, number - 1))
        });
        // A part that is used elsewhere too is shown in its place below the chosen node only.
        node.children.retain(|child| *child == chosen || !below.contains(child));
    }
}

/// A node and all nodes below it.
fn reachable(scene: &Scene, from: NodeId) -> BTreeSet<NodeId> {
    let (mut found, mut open) = (BTreeSet::from([from]), vec![from]);
    while let Some(id) = open.pop() {
        let children = scene.nodes.get(id.index()).map_or(&[][..], |node| &node.children);
        open.extend(children.iter().filter(|child| found.insert(**child)));
    }
    found
}

/// The surfaces that shine, as pairs of a node and a position in its list.
fn shining(scene: &Scene) -> BTreeSet<(usize, usize)> {
    let mut found = BTreeSet::new();
    let mut seen = BTreeSet::new();
    let mut open = vec![(scene.root, None)];
    while let Some((id, inherited)) = open.pop() {
        if !seen.insert((id, inherited)) {
            continue;
        }
        let Some(node) = scene.nodes.get(id.index()) else { continue };
        let inherited: Option<MaterialId> = node.material.or(inherited);
        let shines =
            |id: MaterialId| scene.materials.get(id.index()).is_some_and(|m| m.is_emissive());
        let of_surface = |surface: &Surface| match surface.materials.as_slice() {
            [] => inherited.is_some_and(shines),
            slots => slots.iter().any(|slot| slot.or(inherited).is_some_and(shines)),
        };
        let numbers = (0..node.surfaces.len()).filter(|&i| of_surface(&node.surfaces[i]));
        found.extend(numbers.map(|i| (id.index(), i)));
        open.extend(node.children.iter().map(|child| (*child, inherited)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::apply;
    use super::*;
    use crate::material::Diffuse;
    use crate::{Geometry, Material, Node};
    use snell_intersect::shape::Sphere;
    use snell_math::{DVec3, Rgb};
    use std::sync::Arc;

    fn ball() -> Surface {
        Surface::new(Geometry::Shape(Arc::new(Sphere { radius: 1.0 }.into())))
    }

    /// A shared ball at two places, and a lamp.
    fn scene() -> Scene {
        let mut scene = Scene::new("parts");
        let lamp = Material::new("lamp", Diffuse::new(Rgb::WHITE)).emitting(Rgb::WHITE);
        let lamp = scene.add_material(lamp);
        let part = scene.add_node(Node { surfaces: vec![ball()], ..Node::named("part") });
        for name in ["left", "right"] {
            scene.add_child(scene.root, Node { children: vec![part], ..Node::named(name) });
        }
        let surfaces = vec![ball()];
        scene.add_child(scene.root, Node { surfaces, material: Some(lamp), ..Node::named("lamp") });
        scene
    }

    #[test]
    fn an_isolated_node_keeps_its_parts_and_the_lamps() {
        let mut scene = scene();
        apply(&mut scene, "node.left.isolated=true").expect("there is such a node");
        let children = |name: &str| {
            let node = scene.nodes.iter().find(|node| node.name == name).expect(name);
            (node.children.len(), node.surfaces.len())
        };
        assert_eq!((children("left"), children("part")), ((1, 0), (0, 1)));
        assert_eq!((children("right"), children("lamp")), ((0, 0), (0, 1)));
    }

    #[test]
    fn a_node_is_moved_and_dressed() {
        let mut scene = scene();
        apply(&mut scene, "node.right.transform=[[1,0,0,5],[0,1,0,0],[0,0,1,0]]").expect("rows");
        assert_eq!(scene.nodes[3].transform.translation, DVec3::new(5.0, 0.0, 0.0));
        apply(&mut scene, "node.part.material=0").expect("there is such a material");
        assert_eq!(scene.nodes[1].material, Some(MaterialId(0)));
        for wrong in ["node.part.material=1", "node.part.transform=[1,2]", "node.part.mass=1"] {
            let problem = apply(&mut scene, wrong).expect_err(wrong).to_string();
            assert!(problem.contains("expected") || problem.contains("known"), "{problem}");
        }
    }
}
