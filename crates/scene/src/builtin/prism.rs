//! A prism of flint glass in front of a lamp behind a slit. Seen through the prism, the slit is
//! spread into a spectrum.
//!
//! The camera looks at the prism at the angle of minimum deviation, and past it at the slit itself.
//! Light of each wavelength takes its own path, so the picture needs spectral rendering; in RGB the
//! slit is displaced, but stays white.

use super::palette::matte;
use super::quads::quads;
use crate::camera::Camera;
use crate::graph::{Environment, Geometry, MaterialId, Node, Scene, Surface};
use crate::material::{Black, Dielectric, Material};
use snell_intersect::TriangleMesh;
use snell_math::spectrum::{Glass, LINE_D};
use snell_math::{Rgb, Vec3, real};
use std::sync::Arc;

/// The angle in radians between the two faces that light passes through.
const APEX: f32 = 50.0_f32.to_radians();
/// Length of the sides next to the apex.
const SIDE: f32 = 2.4;
/// Height of the prism.
const HEIGHT: f32 = 2.2;
/// Distance from the camera to the prism.
const DISTANCE: f32 = 5.0;
/// Distance from the prism to the slit.
const TO_SLIT: f32 = 14.0;
/// Width and height of the slit.
const SLIT: [f32; 2] = [0.07, 7.0];

/// The minimum deviation in radians: that of light of the d line that passes the prism
/// symmetrically.
fn least_deviation() -> f32 {
    2.0 * real::asin(Glass::SF11.index(LINE_D) * real::sin(APEX / 2.0)) - APEX
}

/// A direction in the horizontal plane. The angle is in radians; 0 is straight ahead of the camera,
/// and positive angles are to its left.
fn towards(angle: f32) -> Vec3 {
    Vec3::new(-real::sin(angle), 0.0, -real::cos(angle))
}

/// The prism. Its apex points to the right, and the plane through the apex that bisects it is
/// perpendicular to the path of the light.
fn prism(material: MaterialId) -> Surface {
    // Inside the prism, light is parallel to the base, at half of the deviation to the left.
    let along = towards(least_deviation() / 2.0);
    let apex_direction = along.cross(Vec3::Y);
    let center = Vec3::new(0.0, 0.0, -DISTANCE);
    let depth = SIDE * real::cos(APEX / 2.0);
    let apex = center + apex_direction * (depth / 2.0);
    let half_base = along * (SIDE * real::sin(APEX / 2.0));
    let base = apex - apex_direction * depth;
    let corners = [apex, base + half_base, base - half_base];
    let at_height = |y: f32| corners.map(|p| p + Vec3::Y * y);
    let mesh = TriangleMesh {
        positions: [at_height(-HEIGHT / 2.0), at_height(HEIGHT / 2.0)].concat(),
        // The triangles of the floor and the ceiling, and two triangles for each side.
        indices: vec![
            [0, 2, 1],
            [3, 4, 5],
            [0, 1, 4],
            [0, 4, 3],
            [1, 2, 5],
            [1, 5, 4],
            [2, 0, 3],
            [2, 3, 5],
        ],
        ..TriangleMesh::default()
    };
    Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material)
}

/// A vertical rectangle that faces the camera.
fn screen(center: Vec3, [width, height]: [f32; 2], material: MaterialId) -> Surface {
    let away = Vec3::new(center.x, 0.0, center.z).normalize();
    let (right, up) = (away.cross(Vec3::Y) * (width / 2.0), Vec3::Y * (height / 2.0));
    let corner = |x: f32, y: f32| (center + right * x + up * y).to_array();
    quads(&[[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]], material)
}

/// The built-in scene of the prism and the slit.
pub fn scene() -> Scene {
    let mut scene = Scene::new("prism");
    let glass = scene.add_material(Material::new("glass", Dielectric::smooth(Glass::SF11)));
    let lamp = scene.add_material(Material::new("lamp", Black {}).emitting(Rgb::splat(25.0)));
    let table = scene.add_material(matte("table", Rgb::splat(0.5)));
    let slit = Vec3::new(0.0, 0.0, -DISTANCE) + towards(least_deviation()) * TO_SLIT;
    let floor = -HEIGHT / 2.0 - 0.01;
    let mut add = |name: &str, surface| {
        scene.add_child(scene.root, Node { surfaces: vec![surface], ..Node::named(name) })
    };
    add("prism", prism(glass));
    add("slit", screen(slit, SLIT, lamp));
    let (x, z) = (16.0, -24.0);
    add(
        "table",
        quads(&[[[-x, floor, 2.0], [x, floor, 2.0], [x, floor, z], [-x, floor, z]]], table),
    );
    let camera =
        Camera::look_at(Vec3::new(0.0, 0.35, 0.0), Vec3::new(-1.35, 0.0, -DISTANCE), Vec3::Y, 0.31);
    // Faint light from all directions makes the glass visible.
    scene.environment = Some(Environment::Constant(Rgb::splat(0.03)));
    scene.cameras.push(Camera { name: "main".into(), ..camera });
    scene.settings.size = Some([640, 400]);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prism_is_closed_and_its_sides_face_outwards() {
        let scene = scene();
        let node = scene.nodes.iter().find(|n| n.name == "prism").expect("the node exists");
        let Geometry::Mesh(mesh) = &node.surfaces[0].geometry else { panic!("a mesh") };
        let middle = mesh.positions.iter().sum::<Vec3>() / mesh.positions.len() as f32;
        let mut areas = Vec3::ZERO;
        for t in 0..mesh.indices.len() {
            let [a, b, c] = mesh.corners(t);
            let normal = (b - a).cross(c - a);
            assert!(normal.dot(a - middle) > 0.0, "triangle {t}");
            areas += normal;
        }
        assert!(areas.length() < 1e-4, "{areas}");
    }

    #[test]
    fn light_is_spread_over_some_degrees() {
        // Newton's minimum deviation: sin((apex + deviation) / 2) = n sin(apex / 2).
        let deviation =
            |lambda: f32| 2.0 * (Glass::SF11.index(lambda) * (APEX / 2.0).sin()).asin() - APEX;
        let spread = (deviation(430.0) - deviation(660.0)).to_degrees();
        assert!((3.0..6.0).contains(&spread), "{spread}");
        assert!((least_deviation().to_degrees() - 47.9).abs() < 0.5);
    }
}
