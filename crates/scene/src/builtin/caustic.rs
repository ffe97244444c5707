//! A ball of glass under a small lamp. Nearly all light on the floor below has passed through the
//! glass.

use super::palette::{glass, gold, matte};
use super::quads::quads;
use crate::camera::{Camera, Projection};
use crate::graph::{MaterialId, Node, Scene, Surface};
use crate::material::{Black, Material};
use snell_intersect::shape::Sphere;
use snell_math::{DAffine3, DVec3, Rgb};

/// Half of the room's width.
const HALF: f32 = 3.0;
/// Height of the room.
const HEIGHT: f32 = 4.0;
/// The z coordinate of the room's front end.
const FRONT: f32 = 8.0;

/// The built-in scene of the room with the ball.
pub fn scene() -> Scene {
    let mut scene = Scene::new("caustic");
    let walls = scene.add_material(matte("walls", Rgb::new(0.72, 0.7, 0.66)));
    let floor = scene.add_material(matte("floor", Rgb::new(0.55, 0.5, 0.45)));
    let blue = scene.add_material(matte("blue wall", Rgb::new(0.12, 0.24, 0.5)));
    let clear = scene.add_material(glass("glass"));
    let gold = scene.add_material(gold("gold", 0.2));
    let lamp = scene
        .add_material(Material::new("lamp", Black {}).emitting(Rgb::new(1500.0, 1240.0, 900.0)));
    let (w, h, f, b) = (HALF, HEIGHT, FRONT, -HALF);
    let ground = [[-w, 0.0, f], [w, 0.0, f], [w, 0.0, b], [-w, 0.0, b]];
    let back = [[-w, 0.0, b], [w, 0.0, b], [w, h, b], [-w, h, b]];
    let ceiling = [[-w, h, b], [w, h, b], [w, h, f], [-w, h, f]];
    let front = [[w, 0.0, f], [-w, 0.0, f], [-w, h, f], [w, h, f]];
    let left = [[-w, 0.0, f], [-w, 0.0, b], [-w, h, b], [-w, h, f]];
    let right = [[w, 0.0, b], [w, 0.0, f], [w, h, f], [w, h, b]];
    let mut add =
        |name: &str, surfaces| scene.add_child(scene.root, Node { surfaces, ..Node::named(name) });
    add("floor", vec![quads(&[ground], floor)]);
    add("room", vec![quads(&[back, ceiling, front, right], walls)]);
    add("left wall", vec![quads(&[left], blue)]);
    ball(&mut scene, "glass ball", DVec3::new(-0.3, 1.0, 0.0), 1.0, clear);
    ball(&mut scene, "gold ball", DVec3::new(1.7, 0.5, 0.9), 0.5, gold);
    ball(&mut scene, "lamp", DVec3::new(-1.9, 3.5, -1.2), 0.06, lamp);
    let (eye, target) = (DVec3::new(1.0, 2.4, 7.2), DVec3::new(0.15, 0.85, 0.2));
    let projection = Projection::from_half_angle_x(0.36);
    scene.cameras.push(Camera {
        name: "main".into(),
        ..Camera::from_target(eye, target, DVec3::Y, projection)
    });
    scene.settings.size = Some([640, 480]);
    scene
}

fn ball(scene: &mut Scene, name: &str, center: DVec3, radius: f64, material: MaterialId) {
    let transform = DAffine3::from_translation(center);
    let surfaces = vec![Surface::shape(Sphere { radius }, material)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::named(name) });
}
