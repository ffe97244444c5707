//! A pool under a small sun. The rippled water gathers the light in bright lines on its tiles.

use super::palette::{matte, metal};
use super::quads::quads;
use crate::camera::{Camera, Projection};
use crate::graph::{Environment, Geometry, MaterialId, Node, Scene, Surface};
use crate::material::{Black, ColorParam, Dielectric, Diffuse, Interior, Material};
use crate::medium::Homogeneous;
use crate::texture::pattern::{Checkerboard, Pattern};
use crate::texture::{Mapping, Texture};
use snell_intersect::TriangleMesh;
use snell_intersect::shape::Sphere;
use snell_math::{DAffine3, DVec3, Rgb, Vec3, real};
use std::sync::Arc;

/// Half of the inner width and length of the pool, in metres.
const HALF: [f32; 2] = [2.0, 3.0];
/// Depth of the water.
const DEPTH: f32 = 1.3;
/// Height of the rim above the water.
const RIM: f32 = 0.12;
/// Width of the rim.
const BORDER: f32 = 1.5;
/// Side of a tile.
const TILE: f32 = 0.25;
/// Cells of the water's mesh per metre.
const CELLS: f32 = 32.0;
/// Waves: direction in radians, length and height in metres, phase in radians.
const WAVES: [[f32; 4]; 7] = [
    [0.3, 1.7, 0.011, 0.0],
    [1.9, 1.1, 0.008, 1.3],
    [-0.8, 0.8, 0.0055, 2.1],
    [2.7, 0.63, 0.004, 4.0],
    [0.9, 0.47, 0.0026, 5.2],
    [-1.7, 0.36, 0.0018, 0.7],
    [3.6, 0.29, 0.0012, 3.3],
];

/// The height of the water at a point, and its normal.
fn water_at(x: f32, z: f32) -> (f32, Vec3) {
    let (mut height, mut slope) = (0.0, [0.0; 2]);
    for [direction, length, amplitude, phase] in WAVES {
        let (sin, cos) = real::sin_cos(direction);
        let number = std::f32::consts::TAU / length;
        let (up, along) = real::sin_cos((x * cos + z * sin) * number + phase);
        height += amplitude * up;
        slope[0] += amplitude * number * along * cos;
        slope[1] += amplitude * number * along * sin;
    }
    (height, Vec3::new(-slope[0], 1.0, -slope[1]).normalize())
}

/// The rippled surface of the water, which reaches into the walls.
fn water(material: MaterialId) -> Surface {
    let half = HALF.map(|half| half + 0.01);
    let counts = half.map(|half| (2.0 * half * CELLS) as u32);
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for j in 0..=counts[1] {
        for i in 0..=counts[0] {
            let at =
                |i: u32, axis: usize| half[axis] * (2.0 * i as f32 / counts[axis] as f32 - 1.0);
            let (x, z) = (at(i, 0), at(j, 1));
            let (height, normal) = water_at(x, z);
            positions.push(Vec3::new(x, height, z));
            normals.push(normal);
        }
    }
    let row = counts[0] + 1;
    let corner = |i: u32, j: u32| j * row + i;
    let cells = (0..counts[1]).flat_map(|j| (0..counts[0]).map(move |i| (i, j)));
    let indices = cells
        .flat_map(|(i, j)| {
            let [a, b] = [corner(i, j), corner(i + 1, j)];
            let [c, d] = [corner(i, j + 1), corner(i + 1, j + 1)];
            [[a, c, b], [b, c, d]]
        })
        .collect();
    let mesh = TriangleMesh { positions, normals, indices, ..TriangleMesh::default() };
    Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material)
}

/// The tiles of a wall whose coordinates along these two axes are those of the world.
fn tiles(scene: &mut Scene, name: &str, axes: [usize; 2]) -> MaterialId {
    let row = |axis: usize| {
        let mut row = [0.0; 4];
        row[axis] = 1.0 / f64::from(TILE);
        // Tiles begin a little beside the walls that are at whole tiles.
        row[3] = 0.01;
        row
    };
    let mapping = Mapping::Planar { st_from_world: axes.map(row) };
    let even = ColorParam::from(Rgb::new(0.36, 0.62, 0.72));
    let odd = ColorParam::from(Rgb::new(0.52, 0.74, 0.8));
    let pattern = Pattern::Checkerboard(Checkerboard { even, odd, mapping });
    let texture = Some(scene.add_texture(Texture::Pattern(pattern)));
    let reflectance = ColorParam::textured(Rgb::WHITE, texture);
    scene.add_material(Material::new(name, Diffuse { reflectance }))
}

/// The built-in scene of the pool, in metres.
pub fn scene() -> Scene {
    let mut scene = Scene::new("pool");
    let [w, l] = HALF;
    let (bottom, top) = (-DEPTH, RIM);
    let floor = tiles(&mut scene, "floor", [0, 2]);
    let sides = tiles(&mut scene, "sides", [1, 2]);
    let ends = tiles(&mut scene, "ends", [0, 1]);
    let stone = scene.add_material(matte("stone", Rgb::new(0.62, 0.56, 0.48)));
    let steel = scene.add_material(metal("steel", Rgb::splat(0.75), 0.1));
    let clear = scene.add_medium(Homogeneous::absorbing(Rgb::new(0.35, 0.06, 0.03)));
    let water_material = scene.add_material(Material {
        interior: Some(Interior { medium: Some(clear), priority: 0 }),
        ..Material::new("water", Dielectric::smooth(1.333))
    });
    let sun =
        scene.add_material(Material::new("sun", Black {}).emitting(Rgb::new(1.0e5, 0.9e5, 0.75e5)));
    let mut add =
        |name: &str, surfaces| scene.add_child(scene.root, Node { surfaces, ..Node::named(name) });
    add(
        "floor",
        vec![quads(&[[[-w, bottom, l], [w, bottom, l], [w, bottom, -l], [-w, bottom, -l]]], floor)],
    );
    let left = [[-w, bottom, l], [-w, bottom, -l], [-w, top, -l], [-w, top, l]];
    let right = [[w, bottom, -l], [w, bottom, l], [w, top, l], [w, top, -l]];
    let back = [[-w, bottom, -l], [w, bottom, -l], [w, top, -l], [-w, top, -l]];
    let front = [[w, bottom, l], [-w, bottom, l], [-w, top, l], [w, top, l]];
    add("sides", vec![quads(&[left, right], sides)]);
    add("ends", vec![quads(&[back, front], ends)]);
    let (x, z) = (w + BORDER, l + BORDER);
    let slab = |x0: f32, x1: f32, z0: f32, z1: f32| {
        [[x0, top, z1], [x1, top, z1], [x1, top, z0], [x0, top, z0]]
    };
    let rim = [slab(-x, -w, -z, z), slab(w, x, -z, z), slab(-w, w, -z, -l), slab(-w, w, l, z)];
    add("rim", vec![quads(&rim, stone)]);
    add("water", vec![water(water_material)]);
    let mut ball = |name: &str, center: DVec3, radius, material| {
        let surfaces = vec![Surface::shape(Sphere { radius }, material)];
        let transform = DAffine3::from_translation(center);
        scene.add_child(scene.root, Node { transform, surfaces, ..Node::named(name) });
    };
    ball("ball", DVec3::new(-0.5, -0.85, -0.6), 0.45, steel);
    // As large in the sky as the sun.
    let direction = DVec3::new(-0.45, 0.8, -0.4).normalize();
    ball("sun", direction * 30.0, 0.14, sun);
    let (eye, target) = (DVec3::new(0.6, 2.6, 5.2), DVec3::new(-0.05, -0.6, -0.4));
    let projection = Projection::from_half_angle_x(0.44);
    scene.environment = Some(Environment::Constant(Rgb::new(0.28, 0.36, 0.5)));
    scene.cameras.push(Camera {
        name: "main".into(),
        ..Camera::from_target(eye, target, DVec3::Y, projection)
    });
    scene.settings.size = Some([640, 480]);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_water_faces_up_and_its_normals_are_those_of_the_waves() {
        let Geometry::Mesh(mesh) = water(MaterialId(0)).geometry else { panic!("a mesh") };
        for triangle in (0..mesh.indices.len()).step_by(97) {
            let [a, b, c] = mesh.corners(triangle);
            let normal = (b - a).cross(c - a).normalize();
            let smooth = mesh.normals[mesh.indices[triangle][0] as usize];
            assert!(normal.y > 0.9 && normal.dot(smooth) > 0.99, "{normal} {smooth}");
        }
    }
}
