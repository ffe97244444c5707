//! Whether the emission of surfaces is enough to see the scene by.

use crate::graph::{Geometry, MaterialId, NodeId, Scene, Surface};
use snell_intersect::TriangleMesh;
use snell_math::{Bounds3d, DAffine3, DVec3};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// The radiance of grey surfaces below which a picture is nearly black.
const DIM: f64 = 0.01;

/// The number of triangles and nodes after which a scene counts as lit: instances of instances may
/// expand to any number.
const BUDGET: usize = 20_000_000;

/// True if surfaces that emit light make the other surfaces visible. Emission that is dimmer than
/// `least` (a radiance) counts as displays and the like, which are to be seen, not to light.
///
/// The measure is the radiance of grey walls at the scene's radius from all emitted power, without
/// occlusion. Textures count as white. `bounds` has the bounds of each node, in its coordinates.
pub fn lights_scene(scene: &Scene, bounds: &BTreeMap<NodeId, Bounds3d>, least: f32) -> bool {
    let brightness: Vec<f64> = scene
        .materials
        .iter()
        .map(|material| {
            let brightest = material.emission.factor.max_element();
            let is_lamp = material.illuminates && material.is_emissive() && brightest > least;
            if is_lamp { f64::from(material.emission.factor.luminance()) } else { 0.0 }
        })
        .collect();
    if brightness.iter().all(|&b| b == 0.0) {
        return false;
    }
    let of = |id: Option<MaterialId>| id.map_or(0.0, |id| brightness[id.index()]);
    let radius = bounds.get(&scene.root).map_or(0.0, Bounds3d::radius);
    let (mut power, mut budget) = (0.0, BUDGET);
    let mut open = vec![(scene.root, DAffine3::IDENTITY, None)];
    while let Some((id, parent, inherited)) = open.pop() {
        let node = &scene.nodes[id.index()];
        let (world, material) = (parent * node.transform, node.material.or(inherited));
        for surface in &node.surfaces {
            let slots =
                |slot: usize| of(surface.materials.get(slot).copied().flatten().or(material));
            power += PI * emitted(surface, &world, slots, &mut budget);
        }
        if budget < node.children.len() + 1 {
            return true;
        }
        budget -= node.children.len() + 1;
        open.extend(node.children.iter().map(|&child| (child, world, material)));
    }
    let seen = 0.5 * power / (4.0 * PI * radius * radius) / PI;
    // The emission of a scene without extent is all that there is to see.
    seen >= DIM || seen.is_nan()
}

/// The integral of the brightness of the surface's slots over its area in the world.
fn emitted(
    surface: &Surface,
    world: &DAffine3,
    brightness: impl Fn(usize) -> f64,
    budget: &mut usize,
) -> f64 {
    let slots = surface.materials.len().max(1);
    if (0..slots).all(|slot| brightness(slot) == 0.0) {
        return 0.0;
    }
    match &surface.geometry {
        Geometry::Mesh(mesh) if mesh.indices.len() <= *budget => {
            *budget -= mesh.indices.len();
            let slot = |i: usize| mesh.material_slots.get(i).map_or(0, |&slot| slot as usize);
            (0..mesh.indices.len()).map(|i| brightness(slot(i)) * area(mesh, i, world)).sum()
        }
        geometry => {
            let [x, y, z] = (world.matrix3.abs() * geometry.bounds().size()).to_array();
            2.0 * (x * y + y * z + z * x) * brightness(0)
        }
    }
}

/// The area of a triangle of a mesh in the world; 0 for one with missing vertices.
fn area(mesh: &TriangleMesh, triangle: usize, world: &DAffine3) -> f64 {
    let corner = |i: u32| mesh.positions.get(i as usize).map(|p| p.as_dvec3());
    let [a, b, c] = mesh.indices[triangle].map(|i| corner(i).unwrap_or(DVec3::NAN));
    let doubled = (world.matrix3 * (b - a)).cross(world.matrix3 * (c - a)).length();
    if doubled.is_finite() { doubled / 2.0 } else { 0.0 }
}
