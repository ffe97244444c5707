//! A camp fire: flames of hot gas below a plume of smoke, both stored in grids.

use super::palette::matte;
use super::quads::ground;
use crate::camera::{Camera, Projection};
use crate::graph::{Environment, Node, Scene, Surface};
use crate::light::Directional;
use crate::material::Material;
use crate::medium::{Grid, ScalarGrid};
use crate::noise::fractal_noise;
use snell_intersect::shape::{BoxShape, Sphere};
use snell_math::{DAffine3, DVec3, Rgb, Vec3, real};
use std::f64::consts::TAU;

/// The number of cells of the grids along x, y and z.
const CELLS: [usize; 3] = [64, 160, 64];
/// Half of the width of the grids' box, in metres.
const HALF_WIDTH: f64 = 1.2;
/// Height of the grids' box, in metres.
const HEIGHT: f64 = 6.0;

/// The built-in scene: smoke over a fire within a ring of stones, in the evening.
pub fn scene() -> Scene {
    let mut scene = Scene::new("smoke");
    let earth = scene.add_material(matte("earth", Rgb::new(0.3, 0.24, 0.18)));
    let stone = scene.add_material(matte("stone", Rgb::new(0.4, 0.4, 0.42)));
    scene.add_child(
        scene.root,
        Node { surfaces: vec![ground(0.0, 40.0, earth)], ..Node::named("ground") },
    );
    for i in 0..9 {
        let (sin, cos) = real::sin_cos(TAU * f64::from(i) / 9.0);
        let radius = 0.2 + 0.05 * f64::from(i * 7 % 4);
        let transform =
            DAffine3::from_translation(DVec3::new(0.95 * cos, 0.6 * radius, 0.95 * sin));
        let surfaces = vec![Surface::shape(Sphere { radius }, stone)];
        scene.add_child(scene.root, Node { transform, surfaces, ..Node::named("stone") });
    }
    let (min, max) =
        (DVec3::new(-HALF_WIDTH, 0.02, -HALF_WIDTH), DVec3::new(HALF_WIDTH, HEIGHT, HALF_WIDTH));
    let grid = Grid {
        emission: Rgb::new(14.0, 4.2, 0.9),
        emission_scale: Some(std::sync::Arc::new(sampled(flame))),
        ..Grid::new(
            Rgb::splat(1.2),
            Rgb::new(2.6, 2.7, 2.9),
            0.3,
            sampled(smoke),
            DAffine3::from_translation(min) * DAffine3::from_scale(max - min),
        )
    };
    let medium = scene.add_medium(grid);
    let boundary = scene.add_material(Material::interface("fire and smoke", medium));
    let surfaces = vec![Surface::shape(BoxShape { min, max }, boundary)];
    scene.add_child(scene.root, Node { surfaces, ..Node::named("fire and smoke") });
    scene.add_light(Directional {
        direction: DVec3::new(0.75, -0.35, -0.45).normalize(),
        irradiance: Rgb::new(2.4, 1.7, 1.1),
    });
    scene.environment = Some(Environment::Constant(Rgb::new(0.12, 0.17, 0.28)));
    let projection = Projection::from_half_angle_x(0.32);
    scene.cameras.push(Camera {
        name: "main".into(),
        ..Camera::from_target(
            DVec3::new(2.0, 1.7, 9.5),
            DVec3::new(0.0, 2.5, 0.0),
            DVec3::Y,
            projection,
        )
    });
    scene.settings.size = Some([480, 640]);
    scene
}

/// A grid of samples of a function of the position in metres.
fn sampled(f: impl Fn(Vec3) -> f32) -> ScalarGrid {
    let [nx, ny, nz] = CELLS;
    let middle = |i: usize, n: usize| (i as f32 + 0.5) / n as f32;
    let position = |i: usize| {
        let p = Vec3::new(middle(i % nx, nx), middle(i / nx % ny, ny), middle(i / nx / ny, nz));
        let side = 2.0 * HALF_WIDTH as f32;
        Vec3::new((p.x - 0.5) * side, p.y * HEIGHT as f32, (p.z - 0.5) * side)
    };
    ScalarGrid::new(CELLS, (0..nx * ny * nz).map(|i| f(position(i))).collect()).unwrap_or_default()
}

/// The point from which rising and swirling air has come to `p`.
fn curled(p: Vec3) -> Vec3 {
    let swirl = |seed| fractal_noise(Vec3::new(p.x, 0.8 * p.y, p.z) * 1.1, 3, seed);
    p + Vec3::new(swirl(11), 0.4 * swirl(12), swirl(13)) * (0.25 * p.y).clamp(0.05, 0.55)
}

fn smoke(p: Vec3) -> f32 {
    let q = curled(p);
    // The plume leans with the wind, and widens towards the top.
    let middle = Vec3::new(0.04 * p.y * p.y * 0.3, p.y, 0.0);
    let width = 0.22 + 0.13 * p.y;
    let away = (Vec3::new(q.x - middle.x, 0.0, q.z - middle.z)).length() / width;
    let lumps = fractal_noise(q * 3.0, 4, 5);
    let body = (1.2 - away + 0.9 * lumps).clamp(0.0, 1.0);
    let fades_in = ((p.y - 0.8) / 1.2).clamp(0.0, 1.0);
    let fades_out = ((HEIGHT as f32 - p.y) / 2.0).clamp(0.0, 1.0);
    body * body * fades_in * fades_out * (0.5 / width)
}

fn flame(p: Vec3) -> f32 {
    let tongue = fractal_noise(Vec3::new(p.x * 3.0, p.y * 1.1, p.z * 3.0), 3, 21);
    let height = 1.7 + 0.9 * tongue;
    let rest = (1.0 - p.y / height).max(0.0);
    let width = 0.5 * rest.sqrt() + 0.02;
    let away = Vec3::new(p.x + 0.15 * tongue, 0.0, p.z - 0.15 * tongue).length() / width;
    // Hot gas emits in a shell around the fuel.
    let shell = (1.0 - away).clamp(0.0, 1.0) * (0.25 + away);
    3.0 * shell * rest.min(0.8)
}
