//! Balls of several materials under a sky.

use super::palette::{glass, gold, matte, metal, plastic};
use super::quads::ground;
use crate::camera::{Camera, Projection};
use crate::framing::sky_seen_by;
use crate::graph::{Background, MaterialId, Node, Scene, Surface};
use snell_intersect::shape::Sphere;
use snell_math::{DAffine3, DVec3, Rgb};

/// The built-in scene: balls on a ground, in focus from the front row backwards.
pub fn scene() -> Scene {
    let mut scene = Scene::new("spheres");
    let floor = scene.add_material(matte("floor", Rgb::new(0.42, 0.43, 0.45)));
    scene.add_child(
        scene.root,
        Node { surfaces: vec![ground(0.0, 60.0, floor)], ..Node::named("ground") },
    );
    let materials = [
        gold("gold", 0.15),
        glass("glass"),
        plastic("red plastic", Rgb::new(0.62, 0.05, 0.04), 0.1),
        metal("brushed steel", Rgb::splat(0.62), 0.4),
        plastic("blue plastic", Rgb::new(0.04, 0.14, 0.5), 0.3),
        matte("clay", Rgb::new(0.62, 0.4, 0.26)),
        metal("mirror", Rgb::splat(0.95), 0.0),
        matte("chalk", Rgb::splat(0.8)),
    ]
    .map(|m| scene.add_material(m));
    let [gold, glass, red, steel, blue, clay, mirror, chalk] = materials;
    for (x, z, radius, material) in [
        (0.0, 0.0, 1.0, glass),
        (-2.15, -0.35, 1.0, gold),
        (2.15, -0.35, 1.0, red),
        (-1.15, -2.3, 1.0, blue),
        (1.15, -2.3, 1.0, mirror),
        (-3.4, -2.5, 1.0, chalk),
        (3.4, -2.6, 1.0, steel),
        (-1.05, 1.15, 0.35, clay),
        (1.05, 1.25, 0.35, gold),
        (0.15, 1.65, 0.25, red),
        (-2.2, 1.2, 0.25, mirror),
        (2.25, 1.3, 0.3, blue),
        (0.0, -4.8, 1.0, clay),
        (-2.6, -5.0, 1.0, red),
        (2.6, -5.0, 1.0, chalk),
    ] {
        add_ball(&mut scene, x, z, radius, material);
    }
    let eye = DVec3::new(0.6, 2.3, 9.5);
    let target = DVec3::new(0.0, 0.75, 0.0);
    let camera = Camera::from_target(eye, target, DVec3::Y, Projection::from_half_angle_x(0.33));
    let focus = camera.focus_distance - 0.8;
    let camera = Camera { name: "main".into(), ..camera.with_lens(0.07, focus) };
    scene.environment = Some(sky_seen_by(&camera, DVec3::Y));
    scene.background = Background::Environment;
    scene.cameras.push(camera);
    scene.settings.size = Some([800, 450]);
    scene
}

fn add_ball(scene: &mut Scene, x: f64, z: f64, radius: f64, material: MaterialId) {
    let transform = DAffine3::from_translation(DVec3::new(x, radius, z));
    let surfaces = vec![Surface::shape(Sphere { radius }, material)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::named("ball") });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balls_rest_on_the_ground_and_do_not_overlap() {
        let scene = scene();
        let balls: Vec<DVec3> = scene
            .nodes
            .iter()
            .filter(|n| n.name == "ball")
            .map(|n| n.transform.translation)
            .collect();
        assert!(balls.len() > 10);
        for (i, a) in balls.iter().enumerate() {
            // The height of each centre is the ball's radius.
            assert!(balls[..i].iter().all(|b| a.distance(*b) > a.y + b.y), "ball {i} at {a}");
        }
    }
}
