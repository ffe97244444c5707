//! A room that is lit through a door left ajar, with the lamp in the next room, after an idea of
//! Veach (1997).

use super::palette::{glass, matte, metal, plastic};
use super::quads::quads;
use crate::camera::{Camera, Projection};
use crate::graph::{MaterialId, Node, Scene, Surface};
use crate::material::{Black, Material};
use snell_intersect::shape::{BoxShape, Sphere};
use snell_math::{DAffine3, DVec3, Rgb, rotation};

/// Height of the rooms in metres.
const HEIGHT: f64 = 2.8;
/// Thickness of the wall between the rooms, in metres.
const WALL: f64 = 0.15;
/// The opening in the wall at `x = 0`: its extent along z, from 0, and its height, in metres.
const DOOR: [f64; 2] = [1.0, 2.05];
/// The angle by which the door is open, in radians.
const OPEN: f64 = 0.35;

/// The built-in scene of the two rooms.
pub fn scene() -> Scene {
    let mut scene = Scene::new("door-ajar");
    let walls = scene.add_material(matte("walls", Rgb::new(0.74, 0.72, 0.68)));
    let floor = scene.add_material(matte("floor", Rgb::new(0.45, 0.3, 0.19)));
    let wood = scene.add_material(plastic("door", Rgb::new(0.36, 0.2, 0.1), 0.3));
    let table = scene.add_material(plastic("table", Rgb::new(0.3, 0.16, 0.08), 0.2));
    let white = scene.add_material(plastic("china", Rgb::new(0.75, 0.75, 0.73), 0.05));
    let steel = scene.add_material(metal("steel", Rgb::splat(0.7), 0.15));
    let clear = scene.add_material(glass("glass"));
    let lamp = scene
        .add_material(Material::new("lamp", Black {}).emitting(Rgb::new(9000.0, 8200.0, 6900.0)));
    rooms(&mut scene, walls, floor);
    let depth = DOOR[0];
    let hinge = DAffine3::from_mat3_translation(
        rotation::about(DVec3::Y, OPEN),
        DVec3::new(0.0, 0.0, depth),
    );
    // The door hangs at the far end of the opening, and opens into the visible room.
    put(&mut scene, "door", [0.0, 0.005, -depth], [0.05, DOOR[1] - 0.01, 0.0], hinge, wood);
    let still = DAffine3::IDENTITY;
    put(&mut scene, "table top", [1.3, 0.68, -0.6], [2.7, 0.74, 1.4], still, table);
    for (x, z) in [(1.36, -0.54), (2.58, -0.54), (1.36, 1.28), (2.58, 1.28)] {
        put(&mut scene, "leg", [x, 0.0, z], [x + 0.06, 0.68, z + 0.06], still, table);
    }
    ball(&mut scene, "china", DVec3::new(1.75, 0.9, 0.75), 0.16, white);
    ball(&mut scene, "steel", DVec3::new(2.1, 0.86, 0.3), 0.12, steel);
    ball(&mut scene, "glass", DVec3::new(1.8, 0.88, -0.15), 0.14, clear);
    // The lamp faces the far wall of the next room.
    let lamp_quad = [[-1.9, 0.9, 2.4], [-1.9, 2.1, 2.4], [-1.5, 2.1, 2.4], [-1.5, 0.9, 2.4]];
    scene.add_child(
        scene.root,
        Node { surfaces: vec![quads(&[lamp_quad], lamp)], ..Node::named("lamp") },
    );
    let (eye, target) = (DVec3::new(4.6, 1.65, 1.2), DVec3::new(0.9, 0.95, 0.35));
    let projection = Projection::from_half_angle_x(0.5);
    scene.cameras.push(Camera {
        name: "main".into(),
        ..Camera::from_target(eye, target, DVec3::Y, projection)
    });
    scene.settings.size = Some([640, 480]);
    scene
}

/// Adds two closed rooms from `x = -3` to `x = 5`, and the wall between them with its opening.
fn rooms(scene: &mut Scene, walls: MaterialId, floor: MaterialId) {
    let (left, right, back, front, h) = (-3.0, 5.0, -2.0, 3.0, HEIGHT as f32);
    let ground = [[left, 0.0, front], [right, 0.0, front], [right, 0.0, back], [left, 0.0, back]];
    let faces = [
        [[left, 0.0, back], [right, 0.0, back], [right, h, back], [left, h, back]],
        [[left, h, back], [right, h, back], [right, h, front], [left, h, front]],
        [[right, 0.0, front], [left, 0.0, front], [left, h, front], [right, h, front]],
        [[left, 0.0, front], [left, 0.0, back], [left, h, back], [left, h, front]],
        [[right, 0.0, back], [right, 0.0, front], [right, h, front], [right, h, back]],
    ];
    scene.add_child(
        scene.root,
        Node { surfaces: vec![quads(&[ground], floor)], ..Node::named("floor") },
    );
    scene.add_child(
        scene.root,
        Node { surfaces: vec![quads(&faces, walls)], ..Node::named("rooms") },
    );
    let (back, front) = (f64::from(back), f64::from(front));
    let still = DAffine3::IDENTITY;
    put(scene, "wall", [-WALL, 0.0, back], [0.0, HEIGHT, 0.0], still, walls);
    put(scene, "wall", [-WALL, 0.0, DOOR[0]], [0.0, HEIGHT, front], still, walls);
    put(scene, "lintel", [-WALL, DOOR[1], 0.0], [0.0, HEIGHT, DOOR[0]], still, walls);
}

fn put(
    scene: &mut Scene,
    name: &str,
    min: [f64; 3],
    max: [f64; 3],
    transform: DAffine3,
    material: MaterialId,
) {
    let shape = BoxShape { min: DVec3::from(min), max: DVec3::from(max) };
    let surfaces = vec![Surface::shape(shape, material)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::named(name) });
}

fn ball(scene: &mut Scene, name: &str, center: DVec3, radius: f64, material: MaterialId) {
    let transform = DAffine3::from_translation(center);
    let surfaces = vec![Surface::shape(Sphere { radius }, material)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::named(name) });
}
