//! A glass of iced tea: nested objects with different indices of refraction, with priorities where
//! objects overlap.

use super::palette::matte;
use super::quads::ground;
use crate::camera::{Camera, Projection};
use crate::framing::sky_seen_by;
use crate::graph::{Node, Scene, Surface};
use crate::material::{Dielectric, Interior, Material};
use crate::medium::{Homogeneous, Medium};
use snell_intersect::AnyShape;
use snell_intersect::shape::{BoxShape, Cylinder};
use snell_math::{DAffine3, DVec3, Rgb, rotation};

/// The built-in scene: a tumbler of tea with two cubes of ice on a table, in centimetres.
pub fn scene() -> Scene {
    let mut scene = Scene::new("drink");
    let table = scene.add_material(matte("table", Rgb::new(0.62, 0.6, 0.57)));
    scene.add_child(
        scene.root,
        Node { surfaces: vec![ground(0.0, 400.0, table)], ..Node::named("table") },
    );
    let mut add =
        |name: &str, ior: f32, medium: Option<Medium>, priority, shape: AnyShape, transform| {
            let medium = medium.map(|medium| scene.add_medium(medium));
            let interior = Some(Interior { medium, priority });
            let material = scene.add_material(Material {
                interior,
                ..Material::new(name, Dielectric::smooth(ior))
            });
            let surfaces = vec![Surface::shape(shape, material)];
            scene.add_child(scene.root, Node { transform, surfaces, ..Node::named(name) });
        };
    let cylinder = |radius, height| AnyShape::from(Cylinder { radius, height, caps: true });
    let at = |x, y, z| DAffine3::from_translation(DVec3::new(x, y, z));
    // Each object displaces those of lower priority, so no two surfaces need to coincide.
    let green = Homogeneous::absorbing(Rgb::new(0.02, 0.005, 0.015));
    add("glass", 1.5, Some(green.into()), 1, cylinder(3.6, 11.0), at(0.0, 5.51, 0.0));
    add("hollow", 1.0, None, 2, cylinder(3.3, 11.0), at(0.0, 6.7, 0.0));
    let tea = Homogeneous {
        sigma_a: Rgb::new(0.03, 0.16, 0.9),
        sigma_s: Rgb::splat(0.01),
        emission: Rgb::BLACK,
        g: 0.8,
    };
    add("tea", 1.333, Some(tea.into()), 3, cylinder(3.35, 7.4), at(0.0, 4.85, 0.0));
    let cube =
        |half: f64| AnyShape::from(BoxShape { min: DVec3::splat(-half), max: DVec3::splat(half) });
    let turned = |axis: DVec3, angle, x, y, z| {
        at(x, y, z) * DAffine3::from_mat3(rotation::about(axis.normalize(), angle))
    };
    add("ice", 1.31, None, 4, cube(1.2), turned(DVec3::new(1.0, 0.4, 0.2), 0.6, -1.1, 8.0, 0.5));
    add("ice", 1.31, None, 4, cube(1.1), turned(DVec3::new(-0.3, 1.0, 0.5), 0.9, 1.3, 7.9, -0.6));
    let eye = DVec3::new(2.0, 14.0, 27.0);
    let projection = Projection::from_half_angle_x(0.26);
    let camera = Camera::from_target(eye, DVec3::new(0.0, 5.2, 0.0), DVec3::Y, projection);
    let camera = Camera { name: "main".into(), ..camera };
    scene.environment = Some(sky_seen_by(&camera, DVec3::Y));
    scene.cameras.push(camera);
    scene.settings.size = Some([560, 560]);
    scene
}
