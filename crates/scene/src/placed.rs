//! The surfaces of a scene graph as a flat list, each with its transform to the world.

use crate::graph::{Geometry, MaterialId, Node, NodeId, Scene, Surface};
use snell_math::{DAffine3, Transform};
use std::collections::HashSet;
use std::sync::Arc;

/// Maximum number of placements in one list, since a small file can place one surface an unlimited
/// number of times.
pub const MAX_PLACED: u64 = 10_000_000;

/// A surface at one place in the world.
#[derive(Clone, Debug)]
pub struct Placed<'a> {
    /// The node that holds the surface.
    pub node: NodeId,
    /// Name of the nearest node at or above `node` that has a name; may be empty.
    pub name: &'a str,
    /// The surface's transform to the world.
    pub world_from_surface: Transform,
    /// The surface itself.
    pub surface: &'a Surface,
    /// The material of slots that have none of their own.
    inherited: Option<MaterialId>,
}

impl Placed<'_> {
    /// The material of a slot.
    pub fn material(&self, slot: usize) -> Option<MaterialId> {
        self.surface.materials.get(slot).copied().flatten().or(self.inherited)
    }

    /// The slots that the surface's triangles use, ascending, with their materials.
    pub fn slots(&self) -> Vec<(u16, Option<MaterialId>)> {
        let slots = match &self.surface.geometry {
            Geometry::Mesh(mesh) if !mesh.material_slots.is_empty() => {
                let mut seen = vec![false; 1 << 16];
                mesh.material_slots.iter().for_each(|&s| seen[usize::from(s)] = true);
                (0..=u16::MAX).filter(|&s| seen[usize::from(s)]).collect()
            }
            _ => vec![0],
        };
        slots.into_iter().map(|slot| (slot, self.material(usize::from(slot)))).collect()
    }
}

/// The number of nodes and surfaces in the graph, with each instance counted; at most `u64::MAX`.
pub fn placement_count(scene: &Scene) -> Result<u64, String> {
    total(scene, |node| 1 + node.surfaces.len() as u64)
}

/// The number of triangles of all meshes, where each mesh is counted once. It measures the work on
/// the meshes themselves.
pub fn distinct_triangles(scene: &Scene) -> u64 {
    let mut seen = HashSet::new();
    let surfaces = scene.nodes.iter().flat_map(|node| &node.surfaces);
    let triangles = surfaces.map(|surface| match &surface.geometry {
        Geometry::Mesh(mesh) if seen.insert(Arc::as_ptr(mesh)) => mesh.indices.len() as u64,
        _ => 0,
    });
    triangles.sum()
}

/// The sum of a function over all nodes, with each instance counted; at most `u64::MAX`.
pub fn total(scene: &Scene, of_node: impl Fn(&Node) -> u64) -> Result<u64, String> {
    let mut counts = vec![0u64; scene.nodes.len()];
    for id in scene.topological_order().map_err(|error| error.to_string())? {
        let node = &scene.nodes[id.index()];
        let below =
            node.children.iter().fold(0u64, |sum, child| sum.saturating_add(counts[child.index()]));
        counts[id.index()] = below.saturating_add(of_node(node));
    }
    Ok(counts[scene.root.index()])
}

/// All surfaces, in the order of the graph. Surfaces under a singular transform are left out, as in
/// rendering. It fails for cycles, for ids out of range, and for more than [`MAX_PLACED`] nodes and
/// surfaces.
pub fn placed(scene: &Scene) -> Result<Vec<Placed<'_>>, String> {
    let count = placement_count(scene)?;
    if count > MAX_PLACED {
        return Err(format!(
            "it is {count} nodes and surfaces, instances counted each; the limit is {MAX_PLACED}"
        ));
    }
    let surfaces = total(scene, |node| node.surfaces.len() as u64)?;
    let mut all = Vec::new();
    all.try_reserve_exact(usize::try_from(surfaces).unwrap_or(usize::MAX)).map_err(|_| {
        format!(
            "it is {surfaces} surfaces, instances counted each, and there is no memory for a \
            list of them"
        )
    })?;
    // For each node on the path: the children that are left, and the state that they inherit.
    let mut stack = vec![(std::slice::from_ref(&scene.root).iter(), DAffine3::IDENTITY, None, "")];
    while let Some((children, world_from_parent, material, name)) = stack.last_mut() {
        let Some(&id) = children.next() else {
            stack.pop();
            continue;
        };
        let node = &scene.nodes[id.index()];
        let world_from_node = *world_from_parent * node.transform;
        let material = node.material.or(*material);
        let name = if node.name.is_empty() { *name } else { &node.name };
        if let Some(world_from_surface) = Transform::new(world_from_node) {
            all.extend(node.surfaces.iter().map(|surface| Placed {
                node: id,
                name,
                world_from_surface,
                surface,
                inherited: material,
            }));
        }
        stack.push((node.children.iter(), world_from_node, material, name));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Node;
    use snell_intersect::shape::Sphere;
    use snell_math::DVec3;

    #[test]
    fn a_shared_surface_is_listed_at_each_place_with_the_material_it_inherits() {
        let mut scene = Scene::new("two balls");
        let ball = Surface::new(Geometry::Shape(Arc::new(Sphere { radius: 1.0 }.into())));
        let ball = scene.add_node(Node { surfaces: vec![ball], ..Node::default() });
        for i in 0..2 {
            let transform = DAffine3::from_translation(DVec3::X * f64::from(i));
            let material = Some(MaterialId(i));
            let root = scene.root;
            scene.materials.push(crate::Material::new("", crate::material::Black {}));
            scene.add_child(
                root,
                Node { transform, material, children: vec![ball], ..Node::named(format!("{i}")) },
            );
        }
        let all = placed(&scene).expect("a small scene");
        let shown: Vec<_> = all
            .iter()
            .map(|p| (p.name, p.slots(), p.world_from_surface.point(DVec3::ZERO).x))
            .collect();
        assert_eq!(
            shown,
            [
                ("0", vec![(0, Some(MaterialId(0)))], 0.0),
                ("1", vec![(0, Some(MaterialId(1)))], 1.0)
            ]
        );
    }

    #[test]
    fn a_graph_of_billions_of_instances_is_counted_and_refused_at_once() {
        let mut scene = Scene::new("doubled");
        let mut below = scene.root;
        for _ in 0..100 {
            below = scene.add_node(Node { children: vec![below, below], ..Node::default() });
        }
        scene.root = below;
        assert_eq!(placement_count(&scene), Ok(u64::MAX));
        assert!(placed(&scene).is_err());
    }
}
