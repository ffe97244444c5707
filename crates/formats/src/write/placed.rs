//! The surfaces of a scene graph, one after the other, each where it is in the world.

use super::tessellate::tessellate;
use snell_intersect::TriangleMesh;
use snell_math::{DAffine3, Transform};
use snell_scene::{Geometry, MaterialId, NodeId, Scene, Surface};
use std::borrow::Cow;

/// Most placements of surfaces that are written out: a small file can place one surface any number of times.
const MAX_PLACED: usize = 10_000_000;

/// A surface at one place.
#[derive(Debug)]
pub struct Placed<'a> {
    /// Of the nearest node above that has one, or of the surface's kind.
    pub name: &'a str,
    /// Where it is.
    pub world_from_surface: Transform,
    /// What it is.
    pub surface: &'a Surface,
    /// The material of slots that have none of their own.
    inherited: Option<MaterialId>,
}

impl<'a> Placed<'a> {
    /// The material of a slot.
    pub fn material(&self, slot: usize) -> Option<MaterialId> {
        self.surface.materials.get(slot).copied().flatten().or(self.inherited)
    }

    /// The slots that triangles have, ascending, and their materials.
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

    /// Its triangles in its own coordinates; `None` for what no finite number of triangles shows.
    pub fn triangles(&self) -> Option<Cow<'a, TriangleMesh>> {
        match &self.surface.geometry {
            Geometry::Mesh(mesh) => Some(Cow::Borrowed(mesh)),
            Geometry::Shape(shape) => tessellate(shape).map(Cow::Owned),
        }
    }
}

/// All surfaces, in the order of the graph. Those flattened by a singular transform are left out, as when the scene is rendered.
pub fn placed(scene: &Scene) -> Result<Vec<Placed<'_>>, String> {
    scene.topological_order().map_err(|error| error.to_string())?;
    let mut all = Vec::new();
    let mut steps = 0;
    let mut stack: Vec<(NodeId, DAffine3, Option<MaterialId>, &str)> = vec![(scene.root, DAffine3::IDENTITY, None, "")];
    while let Some((id, world_from_parent, material, name)) = stack.pop() {
        let node = &scene.nodes[id.index()];
        let world_from_node = world_from_parent * node.transform;
        let material = node.material.or(material);
        let name = if node.name.is_empty() { name } else { &node.name };
        steps += 1 + node.surfaces.len();
        if steps > MAX_PLACED {
            return Err(format!("more than {MAX_PLACED} surfaces, instances counted each, which is the limit"));
        }
        if let Some(world_from_surface) = Transform::new(world_from_node) {
            all.extend(node.surfaces.iter().map(|surface| Placed {
                name,
                world_from_surface: world_from_surface.clone(),
                surface,
                inherited: material,
            }));
        }
        stack.extend(node.children.iter().rev().map(|&child| (child, world_from_node, material, name)));
    }
    Ok(all)
}

/// All surfaces as meshes in the world, as the simplest formats have them.
pub fn world_meshes<'a>(
    scene: &'a Scene,
    output: &mut super::Output,
) -> Result<Vec<(Placed<'a>, TriangleMesh)>, String> {
    let mut meshes = Vec::new();
    let mut triangles = 0;
    for placed in placed(scene)? {
        if let Geometry::Shape(shape) = &placed.surface.geometry {
            note_shape(shape.name(), output);
        }
        let Some(mesh) = placed.triangles() else { continue };
        triangles += mesh.indices.len();
        if triangles > u32::MAX as usize / 3 {
            return Err("more triangles than 32-bit numbers can count, instances counted each".into());
        }
        let mesh = match placed.world_from_surface.is_identity() {
            true => mesh.into_owned(),
            false => mesh.transformed(&placed.world_from_surface),
        };
        meshes.push((placed, mesh));
    }
    Ok(meshes)
}

/// Says what became of an analytic shape.
pub fn note_shape(name: &str, output: &mut super::Output) {
    match name {
        "plane" => output.lose("an infinite plane is left out"),
        "box" | "rectangle" | "triangle" | "polygon" => output.lose(format!("a {name} became triangles")),
        _ => output.lose(format!("a {name} became triangles, and is round no more")),
    }
}
