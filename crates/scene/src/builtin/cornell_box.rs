//! The Cornell box.
//!
//! Geometry and camera are the measurements published by the Cornell University Program of Computer
//! Graphics ("Cornell Box Data", 1998), in millimetres. The reflectances and the lamp are published
//! as spectra; the linear Rec. 709 colours here are the approximations in common use for them. The
//! lamp hangs a tenth of a millimetre under the ceiling, instead of in a hole in the ceiling.

use super::palette::matte;
use super::quads::quads;
use crate::camera::{Camera, Projection};
use crate::graph::{Node, Scene};
use snell_math::{DVec3, Rgb};

const WHITE: Rgb = Rgb::new(0.725, 0.71, 0.68);
const RED: Rgb = Rgb::new(0.57, 0.043, 0.044);
const GREEN: Rgb = Rgb::new(0.105, 0.378, 0.076);
/// Radiance of the lamp: the colour of its spectrum, at a level for the default exposure.
const LAMP: Rgb = Rgb::new(31.0, 24.0, 11.5);

type Quad = [[f32; 3]; 4];

const FLOOR: Quad = [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]];
const CEILING: Quad =
    [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]];
const BACK: Quad =
    [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]];
const RIGHT: Quad = [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]];
const LEFT: Quad =
    [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]];
const LIGHT: Quad =
    [[343.0, 548.7, 227.0], [343.0, 548.7, 332.0], [213.0, 548.7, 332.0], [213.0, 548.7, 227.0]];

const SHORT_BLOCK: [Quad; 5] = [
    [[130.0, 165.0, 65.0], [82.0, 165.0, 225.0], [240.0, 165.0, 272.0], [290.0, 165.0, 114.0]],
    [[290.0, 0.0, 114.0], [290.0, 165.0, 114.0], [240.0, 165.0, 272.0], [240.0, 0.0, 272.0]],
    [[130.0, 0.0, 65.0], [130.0, 165.0, 65.0], [290.0, 165.0, 114.0], [290.0, 0.0, 114.0]],
    [[82.0, 0.0, 225.0], [82.0, 165.0, 225.0], [130.0, 165.0, 65.0], [130.0, 0.0, 65.0]],
    [[240.0, 0.0, 272.0], [240.0, 165.0, 272.0], [82.0, 165.0, 225.0], [82.0, 0.0, 225.0]],
];

const TALL_BLOCK: [Quad; 5] = [
    [[423.0, 330.0, 247.0], [265.0, 330.0, 296.0], [314.0, 330.0, 456.0], [472.0, 330.0, 406.0]],
    [[423.0, 0.0, 247.0], [423.0, 330.0, 247.0], [472.0, 330.0, 406.0], [472.0, 0.0, 406.0]],
    [[472.0, 0.0, 406.0], [472.0, 330.0, 406.0], [314.0, 330.0, 456.0], [314.0, 0.0, 456.0]],
    [[314.0, 0.0, 456.0], [314.0, 330.0, 456.0], [265.0, 330.0, 296.0], [265.0, 0.0, 296.0]],
    [[265.0, 0.0, 296.0], [265.0, 330.0, 296.0], [423.0, 330.0, 247.0], [423.0, 0.0, 247.0]],
];

/// The built-in scene of the Cornell box.
pub fn scene() -> Scene {
    let mut scene = Scene::new("cornell-box");
    let white = scene.add_material(matte("white", WHITE));
    let red = scene.add_material(matte("red", RED));
    let green = scene.add_material(matte("green", GREEN));
    let lamp = scene.add_material(matte("lamp", Rgb::splat(0.78)).emitting(LAMP));
    let mut add =
        |name: &str, surfaces| scene.add_child(scene.root, Node { surfaces, ..Node::named(name) });
    add("room", vec![quads(&[FLOOR, CEILING, BACK], white)]);
    add("left wall", vec![quads(&[LEFT], red)]);
    add("right wall", vec![quads(&[RIGHT], green)]);
    add("short block", vec![quads(&SHORT_BLOCK, white)]);
    add("tall block", vec![quads(&TALL_BLOCK, white)]);
    add("lamp", vec![quads(&[LIGHT], lamp)]);
    // The camera has a focal length of 35 mm and a film of 25 mm.
    let projection = Projection::Perspective { tan_half_fov: [Some(0.025 / 2.0 / 0.035), None] };
    let eye = DVec3::new(278.0, 273.0, -800.0);
    scene.cameras.push(Camera {
        name: "main".into(),
        focus_distance: 1080.0,
        ..Camera::from_direction(eye, DVec3::Z, DVec3::Y, projection)
    });
    scene.settings.size = Some([512, 512]);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Geometry;
    use snell_math::{DVec2, Vec3};

    fn normals(scene: &Scene, node: &str) -> Vec<Vec3> {
        let node = scene.nodes.iter().find(|n| n.name == node).expect("the node exists");
        let Geometry::Mesh(mesh) = &node.surfaces[0].geometry else { panic!("a mesh") };
        (0..mesh.indices.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                (b - a).cross(c - a).normalize()
            })
            .collect()
    }

    #[test]
    fn walls_face_inwards_and_the_lamp_down() {
        let scene = scene();
        let room = normals(&scene, "room");
        assert!(room[0].y > 0.99 && room[2].y < -0.99 && room[4].z < -0.99);
        assert!(normals(&scene, "left wall").iter().all(|n| n.x < -0.99));
        assert!(normals(&scene, "right wall").iter().all(|n| n.x > 0.99));
        assert!(normals(&scene, "lamp").iter().all(|n| *n == Vec3::NEG_Y));
        for (block, center) in
            [(&SHORT_BLOCK, [186.0, 82.0, 169.0]), (&TALL_BLOCK, [368.0, 165.0, 351.0])]
        {
            for quad in block {
                let [a, b, c, _] = quad.map(Vec3::from);
                assert!((b - a).cross(c - a).dot(a - Vec3::from(center)) > 0.0, "{quad:?}");
            }
        }
    }

    #[test]
    fn the_opening_fills_the_picture_and_red_is_on_the_left() {
        let camera = &scene().cameras[0];
        let pixel =
            |x: f64, y: f64| camera.project(DVec3::new(x, y, 0.0), [512, 512]).expect("in front");
        assert!(pixel(552.8, 0.0).x < 20.0 && pixel(0.0, 0.0).x > 492.0);
        assert!((pixel(278.0, 273.0) - DVec2::splat(256.0)).length() < 1e-9);
    }
}
