//! Scene graphs that no file format can express, but the library can: very deep ones, and small
//! ones that expand to billions.

#![expect(clippy::disallowed_methods, reason = "tests need no certain bits")]

use super::render::{End, render};
use super::watch::Report;
use snell_intersect::{TriangleMesh, shape::Sphere};
use snell_math::{DAffine3, DVec3, Rgb, Vec3};
use snell_scene::material::Diffuse;
use snell_scene::{Geometry, Material, Node, NodeId, Scene, Surface};
use std::sync::Arc;

fn moved(x: f64, child: NodeId) -> Node {
    Node {
        transform: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)),
        children: vec![child],
        ..Node::default()
    }
}

/// A scene of `levels` levels, each of which holds two copies of the level below, with `surface` at
/// the bottom.
fn doubled(levels: u32, surface: impl FnOnce(&mut Scene) -> Surface) -> Scene {
    let mut scene = Scene::new("doubled");
    let surfaces = vec![surface(&mut scene)];
    let mut below = scene.add_node(Node { surfaces, ..Node::default() });
    for level in 0..levels {
        // The copies lie side by side: a ray through a million coincident balls would have to test
        // them all.
        let places = [0.0, 3.0 * f64::from(level).exp2()].map(|x| scene.add_node(moved(x, below)));
        below = scene.add_node(Node { children: places.to_vec(), ..Node::default() });
    }
    scene.nodes[scene.root.index()].children.push(below);
    scene
}

fn ball(scene: &mut Scene) -> Surface {
    let material = scene.add_material(Material::new("grey", Diffuse::new(Rgb::splat(0.5))));
    Surface::shape(Sphere { radius: 1.0 }, material)
}

fn lamp(scene: &mut Scene) -> Surface {
    let material = Material::new("lamp", Diffuse::new(Rgb::BLACK));
    let material = scene.add_material(Material { emission: Rgb::WHITE.into(), ..material });
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let mesh = TriangleMesh { positions, indices: vec![[0, 1, 2]; 100], ..TriangleMesh::default() };
    Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material)
}

/// Renders one case, which must not panic; true if it gave a picture.
fn is_rendered(name: &str, scene: Scene) -> bool {
    let mut report = Report::default();
    report.case(name, || {
        let end = render(scene);
        if let End::Refused(message) = &end {
            eprintln!("{name}: {message}");
        }
        end
    });
    let rendered = report.pictures == 1;
    assert_eq!(report.conclude(name), [""; 0]);
    rendered
}

#[test]
fn a_hundred_thousand_nested_nodes_are_rendered() {
    let mut scene = Scene::new("deep");
    let surfaces = vec![ball(&mut scene)];
    let mut last = scene.root;
    for _ in 0..100_000 {
        last = scene.add_child(last, Node::default());
    }
    scene.nodes[last.index()].surfaces = surfaces;
    assert!(is_rendered("deep chain", scene));
}

#[test]
fn a_million_copies_by_doubling_are_rendered() {
    assert!(is_rendered("2^20 balls", doubled(20, ball)));
}

#[test]
fn billions_of_lamps_are_rendered_in_bounded_memory() {
    assert!(is_rendered("2^29 lamps", doubled(29, lamp)));
}

#[test]
fn more_copies_than_can_be_numbered_are_refused() {
    assert!(!is_rendered("2^40 balls", doubled(40, ball)));
    assert!(!is_rendered("2^600 balls", doubled(600, ball)));
}
