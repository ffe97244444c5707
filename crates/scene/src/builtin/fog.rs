//! A dusty room with a window, in which sunlight makes shafts of light visible.

use super::palette::matte;
use crate::camera::{Camera, Projection};
use crate::graph::{Environment, Geometry, MaterialId, Node, Scene, Surface};
use crate::light::Directional;
use crate::material::Material;
use crate::medium::Homogeneous;
use snell_intersect::shape::{BoxShape, Sphere};
use snell_math::{DAffine3, DVec3, Rgb};
use std::sync::Arc;

/// Inner size of the room in metres. One corner is at the origin.
const ROOM: DVec3 = DVec3::new(4.0, 3.0, 6.0);
/// Thickness of the walls in metres.
const WALL: f64 = 0.25;

/// The built-in scene: a room of 4 m by 6 m with a barred window in its right wall, dust in the
/// air, and the sun outside.
pub fn scene() -> Scene {
    let mut scene = Scene::new("fog");
    let plaster = scene.add_material(matte("plaster", Rgb::new(0.72, 0.66, 0.58)));
    let floor = scene.add_material(matte("floor", Rgb::new(0.36, 0.22, 0.13)));
    let ball = scene.add_material(matte("ball", Rgb::new(0.15, 0.3, 0.62)));
    let dust = scene.add_medium(Homogeneous::scattering(Rgb::splat(0.09), Rgb::splat(0.92), 0.45));
    let air = scene.add_material(Material::interface("air", dust));
    let mut add =
        |name: &str, surfaces| scene.add_child(scene.root, Node { surfaces, ..Node::named(name) });
    let (x, y, z) = (ROOM.x, ROOM.y, ROOM.z);
    let slab = |min: [f64; 3], max: [f64; 3], material| {
        block(DVec3::from(min), DVec3::from(max), material)
    };
    add("floor", vec![slab([-WALL, -WALL, -WALL], [x + WALL, 0.0, z + WALL], floor)]);
    add("ceiling", vec![slab([-WALL, y, -WALL], [x + WALL, y + WALL, z + WALL], plaster)]);
    add("left wall", vec![slab([-WALL, 0.0, -WALL], [0.0, y, z + WALL], plaster)]);
    add("back wall", vec![slab([0.0, 0.0, -WALL], [x, y, 0.0], plaster)]);
    add("front wall", vec![slab([0.0, 0.0, z], [x, y, z + WALL], plaster)]);
    // These blocks are the right wall around the window, and the bars of the window.
    let (low, high, near, far) = (1.1, 2.5, 1.0, 2.9);
    add(
        "right wall",
        vec![
            slab([x, 0.0, -WALL], [x + WALL, low, z + WALL], plaster),
            slab([x, high, -WALL], [x + WALL, y, z + WALL], plaster),
            slab([x, low, -WALL], [x + WALL, high, near], plaster),
            slab([x, low, far], [x + WALL, high, z + WALL], plaster),
        ],
    );
    let bars = (1..4).map(|i| {
        let at = near + (far - near) * f64::from(i) / 4.0;
        slab([x + 0.08, low, at - 0.05], [x + 0.16, high, at + 0.05], plaster)
    });
    add("bars", bars.collect());
    // The air ends slightly inside of the outer faces of the walls.
    add("air", vec![block(DVec3::splat(-0.5 * WALL), ROOM + 0.9 * WALL, air)]);
    let place = DAffine3::from_translation(DVec3::new(1.25, 0.45, 1.9));
    let surfaces = vec![Surface::shape(Sphere { radius: 0.45 }, ball)];
    scene.add_child(scene.root, Node { transform: place, surfaces, ..Node::named("ball") });
    scene.add_light(Directional {
        direction: DVec3::new(-0.78, -0.55, 0.12).normalize(),
        irradiance: Rgb::new(30.0, 26.0, 20.0),
    });
    scene.environment = Some(Environment::Constant(Rgb::new(0.5, 0.7, 1.0)));
    let eye = DVec3::new(1.2, 1.35, 5.6);
    let projection = Projection::from_half_angle_x(0.55);
    scene.cameras.push(Camera {
        name: "main".into(),
        ..Camera::from_target(eye, DVec3::new(2.1, 1.25, 1.2), DVec3::Y, projection)
    });
    scene.settings.size = Some([640, 480]);
    scene
}

/// A box of one material.
fn block(min: DVec3, max: DVec3, material: MaterialId) -> Surface {
    Surface::with_material(Geometry::Shape(Arc::new(BoxShape { min, max }.into())), material)
}
