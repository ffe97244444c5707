//! The extent of a scene's surfaces in some directions, for a tight view.

use super::fit::Extent;
use crate::graph::{Geometry, NodeId, Scene, Surface};
use snell_intersect::{AnyShape, Shape, TriangleMesh};
use snell_math::{Bounds3d, DAffine3, DVec3, Transform};
use std::collections::BTreeMap;

/// The number of vertices, triangles and nodes after which the bounding boxes of nodes are used:
/// instances of instances may expand to any number.
const BUDGET: usize = 12_000_000;

/// A node costs as much as this number of vertices or triangles.
const NODE_COST: usize = 32;

/// The extent of all bounded surfaces in world coordinates. `bounds` has the bounds of each node,
/// in the node's own coordinates.
pub fn extent_of_scene(
    scene: &Scene,
    bounds: &BTreeMap<NodeId, Bounds3d>,
    directions: &[DVec3; 4],
) -> Extent {
    let mut extent = Extent::EMPTY;
    let mut budget = BUDGET;
    let mut open = vec![(scene.root, DAffine3::IDENTITY)];
    while let Some((id, parent)) = open.pop() {
        let node = &scene.nodes[id.index()];
        let world = parent * node.transform;
        // Geometry under a singular transform is invisible and is skipped.
        let Some(transform) = Transform::new(world) else { continue };
        let local = directions.map(|d| world.matrix3.transpose() * d);
        let placed = |e: Extent| e.moved(world.translation, directions);
        let elements: usize = node.surfaces.iter().map(|s| work(&s.geometry)).sum();
        let cost = NODE_COST + elements + node.children.len();
        if cost > budget {
            extent = extent.union(placed(Extent::of_box(&bounds[&id], &local)));
            continue;
        }
        budget -= cost;
        let is_bounded = |s: &&Surface| transform.bounds(&s.geometry.bounds()).is_finite();
        for surface in node.surfaces.iter().filter(is_bounded) {
            extent = extent.union(placed(extent_of_geometry(&surface.geometry, &local)));
        }
        open.extend(node.children.iter().map(|&child| (child, world)));
    }
    extent
}

/// The number of vertices and triangles to visit.
fn work(geometry: &Geometry) -> usize {
    match geometry {
        Geometry::Mesh(mesh) => mesh.positions.len() + mesh.indices.len(),
        Geometry::Shape(_) => 1,
        Geometry::Curves(curves) => curves.points().len(),
    }
}

fn extent_of_geometry(geometry: &Geometry, directions: &[DVec3; 4]) -> Extent {
    match geometry {
        Geometry::Mesh(mesh) => extent_of_mesh(mesh, directions),
        Geometry::Shape(shape) => match &**shape {
            AnyShape::Sphere(sphere) => {
                Extent { reach: directions.map(|d| d.length() * sphere.radius) }
            }
            shape => Extent::of_box(&shape.bounds(), directions),
        },
        Geometry::Curves(curves) => {
            let points = curves.points().iter().filter(|p| p.is_finite());
            extent_of_balls(
                points.map(|p| (p.truncate().as_dvec3(), f64::from(p.w.max(0.0)))),
                directions,
            )
        }
    }
}

fn extent_of_mesh(mesh: &TriangleMesh, directions: &[DVec3; 4]) -> Extent {
    extent_of_balls(
        mesh.positions.iter().filter(|p| p.is_finite()).map(|p| (p.as_dvec3(), 0.0)),
        directions,
    )
}

/// The extent of balls, each given by centre and radius.
fn extent_of_balls(balls: impl Iterator<Item = (DVec3, f64)>, directions: &[DVec3; 4]) -> Extent {
    let mut reach = [f64::NEG_INFINITY; 4];
    let lengths = directions.map(|d| d.length());
    for (center, radius) in balls {
        for ((reach, d), length) in reach.iter_mut().zip(directions).zip(lengths) {
            *reach = reach.max(d.dot(center) + length * radius);
        }
    }
    Extent { reach }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framing::{FramingOptions, prepare};
    use crate::graph::Node;
    use proptest::prelude::*;
    use snell_intersect::shape::Sphere;
    use snell_math::{DVec2, Vec3};
    use std::sync::Arc;

    const SIZE: [u32; 2] = [640, 480];

    /// Minimum and maximum of the projected points, from -1 to 1 across the picture.
    fn projected(scene: &Scene, points: &[DVec3]) -> (DVec2, DVec2) {
        let half = DVec2::new(SIZE[0].into(), SIZE[1].into()) / 2.0;
        let shown = points
            .iter()
            .map(|p| (scene.cameras[0].project(*p, SIZE).expect("in front") - half) / half);
        shown.fold((DVec2::MAX, DVec2::MIN), |(least, most), p| (least.min(p), most.max(p)))
    }

    fn assert_fits((least, most): (DVec2, DVec2), extent: f64) {
        assert!(least.min_element() > -0.9 && most.max_element() < 0.9, "{least} {most}");
        assert!((most - least).max_element() > extent, "{least} {most}");
    }

    /// Asserts that the points are centred as far as perspective allows, which excludes slivers
    /// that point at the camera.
    fn assert_is_centred((least, most): (DVec2, DVec2)) {
        let middle = (least + most) / 2.0;
        assert!(middle.abs().max_element() < 0.01, "{middle}");
    }

    proptest! {
        #[test]
        fn the_vertices_of_placed_meshes_fill_the_picture(
            corners in prop::collection::vec(prop::array::uniform3(-5.0..5.0f32), 3..20),
            offset in prop::array::uniform3(-9.0..9.0f64),
            scale in 0.1..10.0f64,
            angle in 0.0..6.0f64,
        ) {
            let positions: Vec<Vec3> = corners.iter().map(|c| Vec3::from(*c)).collect();
            let transform = DAffine3::from_translation(offset.into())
                * DAffine3::from_rotation_z(angle)
                * DAffine3::from_scale(DVec3::splat(scale));
            let placed = |p: &Vec3| transform.transform_point3(p.as_dvec3());
            let points: Vec<DVec3> = positions.iter().map(placed).collect();
            let indices = vec![[0, 1, 2]];
            let mesh = TriangleMesh { positions, indices, ..TriangleMesh::default() };
            let mut scene = Scene::new("mesh");
            let surfaces = vec![Surface::new(Geometry::Mesh(Arc::new(mesh)))];
            let child = scene.add_node(Node { surfaces, ..Node::named("mesh") });
            let place = Node { transform, children: vec![child], ..Node::named("place") };
            scene.add_child(scene.root, place);
            let options = FramingOptions { size: SIZE, ..Default::default() };
            prepare(&mut scene, &options).expect("no cycle");
            // Slivers that point at the camera cannot fill the picture.
            assert_fits(projected(&scene, &points), 0.5);
        }
    }

    #[test]
    fn a_sphere_fills_the_picture_from_top_to_bottom() {
        let mut scene = Scene::new("ball");
        let sphere = Geometry::Shape(Arc::new(Sphere { radius: 2.0 }.into()));
        scene.add_child(
            scene.root,
            Node { surfaces: vec![Surface::new(sphere)], ..Node::named("ball") },
        );
        prepare(&mut scene, &FramingOptions { size: SIZE, ..Default::default() })
            .expect("no cycle");
        let around = |i: usize| {
            let d = snell_math::sampling::uniform_sphere(snell_math::rng::uniform2([
                i as u32, 0, 0, 0,
            ]));
            d.as_dvec3() * 2.0
        };
        let shown = projected(&scene, &(0..5000).map(around).collect::<Vec<_>>());
        assert_fits(shown, 1.7);
        assert_is_centred(shown);
    }

    #[test]
    fn instances_of_instances_end_soon() {
        let mut scene = Scene::new("tower");
        let sphere = Geometry::Shape(Arc::new(Sphere { radius: 1.0 }.into()));
        let mut node =
            scene.add_node(Node { surfaces: vec![Surface::new(sphere)], ..Node::named("ball") });
        // The nodes expand to 2^60 spheres.
        for level in 0..60 {
            let shift = |x: f64| DAffine3::from_translation(DVec3::X * x);
            let [a, b] = [0.0, 1.0 + f64::from(level)].map(|x| {
                scene.add_node(Node {
                    transform: shift(x),
                    children: vec![node],
                    ..Node::default()
                })
            });
            node = scene.add_node(Node { children: vec![a, b], ..Node::default() });
        }
        let root = scene.root;
        scene.nodes[root.index()].children.push(node);
        prepare(&mut scene, &FramingOptions::default()).expect("no cycle");
        assert!(scene.cameras[0].eye.is_finite());
    }
}
