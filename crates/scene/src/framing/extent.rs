//! How far the surfaces of a scene reach in some directions: what a tight view needs to know of them.

use super::fit::Extent;
use crate::graph::{Geometry, NodeId, Scene};
use snell_intersect::{AnyShape, Shape, TriangleMesh};
use snell_math::{Bounds3d, DAffine3, DVec3, Vec3};
use std::collections::BTreeMap;

/// After this many vertices, triangles and nodes the boxes of nodes have to do: instances of instances may stand for any number.
const BUDGET: usize = 50_000_000;

/// The extent of all bounded surfaces in world coordinates. `bounds` are those of the nodes, each in its own coordinates.
pub fn extent_of_scene(scene: &Scene, bounds: &BTreeMap<NodeId, Bounds3d>, directions: &[DVec3; 4]) -> Extent {
    let mut extent = Extent::EMPTY;
    let mut budget = BUDGET;
    let mut open = vec![(scene.root, DAffine3::IDENTITY)];
    while let Some((id, parent)) = open.pop() {
        let node = &scene.nodes[id.index()];
        let world = parent * node.transform;
        if !world.is_finite() || world.matrix3.determinant() == 0.0 {
            continue;
        }
        let local = directions.map(|d| world.matrix3.transpose() * d);
        let add = |e: Extent| {
            let placed = e.moved(world.translation, directions);
            if placed.reach.iter().all(|r| r.is_finite()) { placed } else { Extent::EMPTY }
        };
        let elements: usize = node.surfaces.iter().map(|s| work(&s.geometry)).sum();
        let cost = 1 + elements + node.children.len();
        if cost > budget {
            extent = extent.union(add(Extent::of_box(&bounds[&id], &local)));
            continue;
        }
        budget -= cost;
        for surface in &node.surfaces {
            extent = extent.union(add(extent_of_geometry(&surface.geometry, &local)));
        }
        open.extend(node.children.iter().map(|&child| (child, world)));
    }
    extent
}

fn work(geometry: &Geometry) -> usize {
    match geometry {
        Geometry::Mesh(mesh) => mesh.positions.len() + mesh.indices.len(),
        Geometry::Shape(_) => 1,
    }
}

fn extent_of_geometry(geometry: &Geometry, directions: &[DVec3; 4]) -> Extent {
    match geometry {
        Geometry::Mesh(mesh) => extent_of_mesh(mesh, directions),
        Geometry::Shape(shape) => match &**shape {
            AnyShape::Sphere(sphere) => Extent { reach: directions.map(|d| d.length() * sphere.radius) },
            shape => Extent::of_box(&shape.bounds(), directions),
        },
    }
}

fn extent_of_mesh(mesh: &TriangleMesh, directions: &[DVec3; 4]) -> Extent {
    if !Bounds3d::from(mesh.bounds()).is_finite() {
        return Extent::EMPTY;
    }
    let mut reach = [f64::NEG_INFINITY; 4];
    let include = |p: &Vec3| {
        let p = p.as_dvec3();
        for (reach, d) in reach.iter_mut().zip(directions) {
            *reach = reach.max(d.dot(p));
        }
    };
    mesh.positions.iter().filter(|p| p.is_finite()).for_each(include);
    Extent { reach }
}
