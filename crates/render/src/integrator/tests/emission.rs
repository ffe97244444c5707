//! Emission is one function: light samples, samples of BSDFs and both together find the same light
//! of every lamp, whatever its shape, picture and opacity.

use crate::sampler::SamplerKind;
use crate::{CompiledScene, Filter, IntegratorKind, Job, LightStrategy, Settings};
use snell_intersect::shape::Disk;
use snell_intersect::{AnyShape, BuildOptions, Shape, TriangleMesh};
use snell_math::{DAffine3, DVec3, Rgb, Vec2, Vec3};
use snell_scene::image::{Encoding, Image};
use snell_scene::material::{AlphaMode, Black, ColorParam, Diffuse, ScalarParam};
use snell_scene::texture::ImageTexture;
use snell_scene::{
    Camera, Environment, Geometry, Light, Material, Node, Scene, Surface, TextureId,
};
use std::sync::Arc;

/// The numbers of independent pictures, and of samples in each of their pixels.
const PICTURES: u32 = 16;
const SPP: u32 = 24;

/// A white floor, and textures 0, a picture of which most is black, and 1, stripes for alpha.
fn stage() -> Scene {
    let mut scene = Scene::new("stage");
    let floor = scene.add_material(Material::new("floor", Diffuse::new(Rgb::WHITE)));
    let flat = DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    add(&mut scene, Surface::shape(Disk { radius: 9.0, inner_radius: 0.0 }, floor), flat);
    let size = 32;
    let pixels = |value: &dyn Fn(u32, u32) -> f32| {
        let values = (0..size * size).flat_map(|i| [value(i % size, i / size); 3]).collect();
        Arc::new(Image::from_f32(size, size, 3, values))
    };
    let lit = |x: u32, y: u32| f32::from(x > 20 && y % 16 < 9) * 6.0;
    for image in [pixels(&lit), pixels(&|x, _| f32::from(x % 8 < 4))] {
        let image = scene.add_image(image);
        scene.add_texture(ImageTexture::new(image, Encoding::Linear));
    }
    scene
}

fn add(scene: &mut Scene, surface: Surface, transform: DAffine3) {
    scene.add_child(scene.root, Node { transform, surfaces: vec![surface], ..Node::default() });
}

/// Brings bounds to a width of 4 above the floor, tilted, so that both sides of flat shapes light
/// it.
fn hung(shape: &AnyShape) -> DAffine3 {
    let bounds = shape.bounds();
    let (center, size) = ((bounds.min + bounds.max) * 0.5, bounds.max - bounds.min);
    DAffine3::from_translation(DVec3::new(0.0, 3.2, 0.0))
        * DAffine3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 2.2)
        * DAffine3::from_scale(DVec3::splat(4.0 / size.length()))
        * DAffine3::from_translation(-center)
}

/// The mean of the pixels of the floor, and its standard error.
fn light(scene: &CompiledScene, light_strategy: LightStrategy) -> (f64, f64) {
    let camera = Camera::look_at(Vec3::new(0.0, 0.7, 6.0), Vec3::ZERO, Vec3::Y, 0.1);
    let mean = |seed: u32| {
        let settings = Settings {
            size: [8, 8],
            spp: SPP,
            seed: seed + 100 * light_strategy as u32,
            light_strategy,
            integrator: IntegratorKind::Direct,
            max_depth: 1,
            sampler: SamplerKind::Independent,
            filter: Filter::Box,
            ..Settings::default()
        };
        let image = Job::new(scene, &camera, &settings).run(1, &|_| true).0.image();
        let values = &image.layers[0].values;
        values.iter().step_by(4).map(|&x| f64::from(x)).sum::<f64>() * 4.0 / values.len() as f64
    };
    let means: Vec<f64> = (0..PICTURES).map(mean).collect();
    let count = f64::from(PICTURES);
    let all = means.iter().sum::<f64>() / count;
    let variance = means.iter().map(|m| (m - all).powi(2)).sum::<f64>() / (count - 1.0);
    (all, (variance / count).sqrt())
}

/// Compares the strategies; returns the light that they find and their largest difference in
/// standard errors.
fn compared(scene: &Scene, name: &str) -> (f64, f64) {
    let compiled = CompiledScene::new(scene, &BuildOptions::default()).expect("a valid scene");
    let found = LightStrategy::ALL.map(|strategy| light(&compiled, strategy));
    let mut worst = 0.0f64;
    for (i, (a, a_error)) in found.iter().enumerate() {
        for (b, b_error) in &found[..i] {
            let error = a_error.hypot(*b_error) + 1e-6 * a.abs();
            let apart = if a == b { 0.0 } else { (a - b).abs() / error };
            assert!(apart < 5.0, "{name}: {found:?} of {:?}", LightStrategy::ALL);
            worst = worst.max(apart);
        }
    }
    (found[0].0, worst)
}

/// Lamps that differ in picture, opacity, sides and visibility.
fn lamps() -> Vec<(String, Material)> {
    let mut lamps = Vec::new();
    let emissions = [
        ("plain", ColorParam::constant(Rgb::splat(2.0))),
        ("picture", ColorParam::textured(Rgb::WHITE, Some(TextureId(0)))),
    ];
    let alphas = [
        ("opaque", AlphaMode::Opaque, ScalarParam::constant(1.0)),
        (
            "cut out",
            AlphaMode::Mask(0.5),
            ScalarParam { factor: 1.0, texture: Some((TextureId(1), 0)) },
        ),
        ("faint", AlphaMode::Blend, ScalarParam::constant(0.4)),
    ];
    for (emission_name, emission) in emissions {
        for (alpha_name, alpha_mode, alpha) in alphas {
            for (side_name, both, double_sided, visible) in [
                ("one side", false, true, true),
                ("both sides", true, true, true),
                ("no back", true, false, true),
                ("not visible", true, true, false),
            ] {
                let material = Material {
                    emission,
                    alpha_mode,
                    alpha,
                    emits_on_both_sides: both,
                    double_sided,
                    visible,
                    ..Material::new("lamp", Black {})
                };
                lamps.push((format!("{emission_name}, {alpha_name}, {side_name}"), material));
            }
        }
    }
    lamps
}

#[test]
fn strategies_find_the_same_light_of_every_lamp() {
    let mut shapes: Vec<AnyShape> = Vec::new();
    for shape in AnyShape::examples() {
        let is_finite = shape.bounds().is_finite();
        if is_finite && shapes.iter().all(|other| other.name() != shape.name()) {
            shapes.push(shape);
        }
    }
    let (mut count, mut worst) = (0, 0.0f64);
    // Each shape with some of the lamps, so that each lamp is of several shapes.
    for (i, shape) in shapes.iter().enumerate() {
        for (name, lamp) in lamps().into_iter().skip(i % 3).step_by(3) {
            let mut scene = stage();
            let lamp = scene.add_material(lamp);
            add(&mut scene, Surface::shape(shape.clone(), lamp), hung(shape));
            let name = format!("{}: {name}", shape.name());
            let (light, apart) = compared(&scene, &name);
            assert!(light > 0.0, "{name} is dark");
            (count, worst) = (count + 1, worst.max(apart));
        }
    }
    eprintln!("{count} lamps, the largest difference is {worst:.1} standard errors");
}

/// A square with all of these coordinates of its texture, and dark vertex colours at one side.
fn square(uv: [Vec2; 2]) -> TriangleMesh {
    let corner = |x: f32, y: f32| Vec3::new(x, 3.0, y) * Vec3::new(2.0, 1.0, 2.0);
    let [a, b] = uv;
    TriangleMesh {
        positions: vec![corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        uvs: snell_intersect::first_uv_set(vec![a, Vec2::new(b.x, a.y), b, Vec2::new(a.x, b.y)]),
        colors: [1.0, 0.2, 0.0, 0.5].map(|c| [c, c, c, 1.0]).to_vec(),
        ..TriangleMesh::default()
    }
}

fn under_square(uv: [Vec2; 2], takes_color: bool) -> Scene {
    let mut scene = stage();
    let lamp = scene.add_material(Material {
        emission: ColorParam::textured(Rgb::WHITE, Some(TextureId(0))),
        emission_takes_vertex_color: takes_color,
        emits_on_both_sides: true,
        ..Material::new("lamp", Black {})
    });
    let mesh = Geometry::Mesh(Arc::new(square(uv)));
    add(&mut scene, Surface::with_material(mesh, lamp), DAffine3::IDENTITY);
    scene
}

#[test]
fn strategies_find_the_same_light_of_pictures_on_meshes_and_none_of_their_black_parts() {
    for takes_color in [false, true] {
        let whole = [Vec2::ZERO, Vec2::ONE];
        let edge = [Vec2::new(0.3, 0.0), Vec2::new(0.7, 0.5)];
        for (name, uv) in [("whole", whole), ("edge", edge)] {
            let (light, _) = compared(&under_square(uv, takes_color), name);
            assert!(light > 0.0, "{name} is dark");
        }
        // Beside the bright part, and further from it than a texel.
        let black = [Vec2::new(0.1, 0.1), Vec2::new(0.6, 0.9)];
        assert_eq!(compared(&under_square(black, takes_color), "black").0, 0.0);
    }
}

#[test]
fn strategies_find_the_same_light_of_what_is_no_surface() {
    for lamp in Light::examples() {
        let mut scene = stage();
        let name = lamp.name();
        scene.add_light(lamp);
        compared(&scene, name);
    }
    let mut scene = stage();
    let image = scene.images[0].clone();
    let world_from_environment = DAffine3::from_rotation_z(0.7);
    scene.environment =
        Some(Environment::Image { image, scale: Rgb::WHITE, world_from_environment });
    assert!(compared(&scene, "environment").0 > 0.0);
}
