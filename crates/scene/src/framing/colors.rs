//! Surfaces that bring colours but no material.

use crate::graph::{Geometry, MaterialId, Node, Scene};
use crate::material::Material;

/// Gives a white material to surfaces with colours of their own (of vertices or control points) and
/// no material, so that the colours are shown as they are. Materials that nodes hand down win.
pub fn show_colors(scene: &mut Scene) {
    let colored = |node: &Node| node.surfaces.iter().any(|s| s.geometry.has_colors());
    if !scene.nodes.iter().any(colored) {
        return;
    }
    // A cycle is refused when the scene is used.
    let Ok(order) = scene.topological_order() else { return };
    let mut is_given = vec![false; scene.nodes.len()];
    let mut white = None;
    for id in order.into_iter().rev() {
        let node = &scene.nodes[id.index()];
        if is_given[id.index()] || node.material.is_some() {
            let children = node.children.iter();
            children.for_each(|child| is_given[child.index()] = true);
            continue;
        }
        for number in 0..node.surfaces.len() {
            let surface = &scene.nodes[id.index()].surfaces[number];
            if !surface.geometry.has_colors() {
                continue;
            }
            let slots = match &surface.geometry {
                Geometry::Mesh(mesh) => mesh.material_slots.iter().max().map_or(0, |&m| m.into()),
                _ => 0,
            };
            let mut materials = surface.materials.clone();
            materials.resize(materials.len().max(slots + 1), None);
            if materials.iter().all(Option::is_some) {
                continue;
            }
            let white = *white.get_or_insert_with(|| {
                let white = Material::white();
                let known = scene.materials.iter().position(|material| *material == white);
                known.map_or_else(|| scene.add_material(white), |at| MaterialId(at as u32))
            });
            materials.iter_mut().for_each(|material| *material = material.or(Some(white)));
            scene.nodes[id.index()].surfaces[number].materials = materials;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Surface;
    use snell_intersect::TriangleMesh;
    use snell_math::Vec3;
    use std::sync::Arc;

    fn triangle(colors: Vec<[f32; 4]>, material_slots: Vec<u16>) -> Surface {
        Surface::new(Geometry::Mesh(Arc::new(TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            indices: vec![[0, 1, 2]],
            colors,
            material_slots,
            ..TriangleMesh::default()
        })))
    }

    #[test]
    fn colours_without_a_material_are_shown_over_white() {
        let red = vec![[1.0, 0.0, 0.0, 1.0]; 3];
        let mut scene = Scene::new("colours");
        let own = scene.add_material(crate::framing::default_material());
        let surfaces = vec![
            triangle(red.clone(), Vec::new()),
            triangle(red.clone(), vec![2]),
            Surface { materials: vec![Some(own)], ..triangle(red.clone(), Vec::new()) },
            triangle(Vec::new(), Vec::new()),
        ];
        scene.add_child(scene.root, Node { surfaces, ..Node::named("free") });
        let given = Node { material: Some(own), ..Node::named("given") };
        let given = scene.add_child(scene.root, given);
        let surfaces = vec![triangle(red, Vec::new())];
        let below = scene.add_child(given, Node { surfaces, ..Node::named("below") });
        show_colors(&mut scene);
        let white = Some(MaterialId(1));
        assert_eq!(scene.materials.len(), 2);
        assert_eq!(scene.materials[1], Material::white());
        let free = &scene.nodes[1].surfaces;
        assert_eq!(free[0].materials, [white]);
        assert_eq!(free[1].materials, [white; 3]);
        assert_eq!(free[2].materials, [Some(own)]);
        assert!(free[3].materials.is_empty());
        assert!(scene.nodes[below.index()].surfaces[0].materials.is_empty());
    }
}
