//! Degenerate, enormous and tiny scenes: every pixel is finite, and nothing panics.

use snell_intersect::shape::{BoxShape, Disk, Sphere};
use snell_intersect::{AnyShape, BuildOptions, TriangleMesh};
use snell_math::{DAffine3, DMat3, DVec3, Rgb, Vec2, Vec3};
use snell_render::{Aov, CompiledScene, IntegratorKind, Job, LightStrategy, Settings};
use snell_scene::builtin::BUILTINS;
use snell_scene::camera::Projection;
use snell_scene::light::{self, Attenuation, Directional, Point};
use snell_scene::material::{Conductor, Dielectric, Diffuse, MaterialKind};
use snell_scene::{Background, Camera, Environment, Material, Node, Scene};
use snell_tests::scenes::{
    at, everything, facing, ground, image, lamp, matte, put, put_mesh, quad, rectangle, sky,
};
use snell_tests::{colors, render, settings};
use std::sync::Arc;

/// Renders with every integrator and strategy; all values of all layers must be finite.
fn survives(what: &str, scene: &Scene, camera: &Camera) {
    let compiled = match CompiledScene::new(scene, &BuildOptions::default()) {
        Ok(compiled) => compiled,
        Err(error) => {
            eprintln!("{what}: {error}");
            return;
        }
    };
    for integrator in IntegratorKind::ALL {
        for light_strategy in LightStrategy::ALL {
            let aovs = Aov::ALL.to_vec();
            let settings = Settings {
                size: [13, 9],
                spp: 3,
                integrator,
                light_strategy,
                aovs,
                ..Settings::default()
            };
            let (film, statistics) = Job::new(&compiled, camera, &settings).run(1, &|_| true);
            assert_eq!(statistics.invalid_samples, 0, "{what}, {}", integrator.name());
            for layer in film.image().layers.iter().chain(&film.variance().layers) {
                let finite = layer.values.iter().all(|v| v.is_finite());
                assert!(finite, "{what}, {}, layer {:?}", integrator.name(), layer.name);
            }
        }
    }
}

fn front() -> Camera {
    Camera::look_at(Vec3::new(0.3, 0.4, 4.0), Vec3::ZERO, Vec3::Y, 0.5)
}

/// A scene with an illuminated ground.
fn lit() -> Scene {
    let mut scene = Scene::new("lit");
    ground(&mut scene, 0.5);
    let lamp = lamp(&mut scene, 3.0);
    put(&mut scene, rectangle(1.0, 1.0), facing(DVec3::new(0.0, 2.0, 0.0), DVec3::NEG_Y), lamp);
    scene.environment = Some(Environment::Constant(Rgb::splat(0.3)));
    scene
}

#[test]
fn built_in_scenes_give_finite_pictures_with_every_integrator() {
    for b in BUILTINS {
        let scene = (b.make)();
        survives(b.name, &scene, &scene.cameras[0]);
    }
}

#[test]
fn empty_scenes_are_pictures_of_the_background() {
    survives("empty", &Scene::new("empty"), &front());
    let sky =
        Scene { environment: Some(Environment::Constant(Rgb::splat(0.5))), ..Scene::new("sky") };
    survives("sky only", &sky, &front());
    survives(
        "transparent",
        &Scene { background: Background::Transparent, ..Scene::new("transparent") },
        &front(),
    );
    let mut mesh = Scene::new("empty mesh");
    let material = lamp(&mut mesh, 1.0);
    put_mesh(&mut mesh, TriangleMesh::default(), DAffine3::IDENTITY, material);
    survives("empty mesh", &mesh, &front());
    let picture = render(&mesh, &front(), &settings(4, 1)).image();
    assert!(colors(&picture).iter().all(|c| *c == [0.0; 3]));
}

#[test]
fn broken_meshes_leave_the_rest_of_the_scene_alone() {
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -f32::MAX, 1e-45, 0.0];
    let expected = colors(&render(&lit(), &front(), &settings(8, 16)).image());
    for value in bad {
        for emissive in [false, true] {
            let mut scene = lit();
            let material = if emissive { lamp(&mut scene, 2.0) } else { matte(&mut scene, 0.5) };
            // Every triangle has a NaN corner or coincident corners.
            let mut mesh = quad();
            for p in &mut mesh.positions {
                *p =
                    if value.abs() < 1.0 { Vec3::splat(value) } else { Vec3::new(p.x, value, p.z) };
            }
            put_mesh(&mut scene, mesh.clone(), at(0.0, 0.5, 0.0), material);
            survives(&format!("positions {value}"), &scene, &front());
            if !value.is_finite() {
                // A lamp that cannot be hit or sampled changes nothing, whatever it emits.
                let found = colors(&render(&scene, &front(), &settings(8, 16)).image());
                assert_eq!(found, expected, "{value} {emissive}");
            }

            let mut scene = lit();
            let material = if emissive { lamp(&mut scene, 2.0) } else { matte(&mut scene, 0.5) };
            let mut mesh = quad();
            mesh.normals[1] = Vec3::splat(value);
            mesh.normals[2] = Vec3::new(0.0, value, 1.0);
            mesh.uvs[0][0] = Vec2::splat(value);
            mesh.colors = vec![[value; 4]; 4];
            put_mesh(&mut scene, mesh, at(0.0, 0.5, 0.0), material);
            survives(&format!("attributes {value}"), &scene, &front());
        }
    }
}

#[test]
fn emitters_without_area_give_no_light_and_do_no_harm() {
    let shapes: [AnyShape; 6] = [
        Sphere { radius: 0.0 }.into(),
        Sphere { radius: f64::NAN }.into(),
        Disk { radius: 0.0, inner_radius: 0.0 }.into(),
        rectangle(0.0, 1.0).into(),
        BoxShape { min: DVec3::ZERO, max: DVec3::ZERO }.into(),
        Sphere { radius: 1e-30 }.into(),
    ];
    for shape in shapes {
        let mut scene = lit();
        let material = lamp(&mut scene, 10.0);
        let what = format!("{shape:?}");
        put(&mut scene, shape, at(0.0, 1.0, 0.0), material);
        survives(&what, &scene, &front());
    }
}

#[test]
fn singular_and_broken_transforms_do_no_harm() {
    let columns = |x, y, z| DAffine3::from_mat3(DMat3::from_cols(x, y, z));
    for transform in [
        DAffine3::ZERO,
        columns(DVec3::X, DVec3::X, DVec3::Z),
        columns(DVec3::X, DVec3::Y, DVec3::ZERO),
        columns(DVec3::X, DVec3::Y, DVec3::Z * 1e-300),
        columns(DVec3::X * 1e300, DVec3::Y, DVec3::Z),
        columns(DVec3::X * 1e-12, DVec3::Y * 1e12, DVec3::Z),
        DAffine3::from_translation(DVec3::new(f64::NAN, 0.0, 0.0)),
        DAffine3::from_translation(DVec3::splat(f64::INFINITY)),
        DAffine3::from_translation(DVec3::splat(1e300)),
        DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)),
    ] {
        let mut scene = lit();
        let (paper, glow) = (matte(&mut scene, 0.5), lamp(&mut scene, 2.0));
        put(&mut scene, Sphere { radius: 0.5 }, transform, paper);
        put(&mut scene, Sphere { radius: 0.5 }, transform, glow);
        put_mesh(&mut scene, quad(), transform, glow);
        survives(&format!("{transform:?}"), &scene, &front());
    }
}

#[test]
fn broken_lights_materials_and_environments_do_no_harm() {
    for value in [f32::NAN, f32::INFINITY, -1.0, f32::MAX, 1e-40] {
        let mut scene = lit();
        let wide = f64::from(value);
        let (intensity, attenuation) = (Rgb::new(value, 1.0, 0.0), Attenuation::INVERSE_SQUARE);
        let (position, body_radius) = (DVec3::new(0.0, 1.0, 0.0), wide);
        scene.add_light(Point { position, intensity, attenuation, body_radius });
        let position = DVec3::new(0.0, wide, 0.0);
        scene.add_light(Point { position, intensity: Rgb::WHITE, attenuation, body_radius: 0.0 });
        scene.add_light(Directional {
            direction: DVec3::new(wide, -1.0, 0.0),
            irradiance: intensity,
        });
        scene.add_light(light::Disk {
            position,
            direction: DVec3::ZERO,
            radius: wide,
            emission: intensity,
            attenuation,
        });
        scene.ambient = intensity;
        let kinds: [MaterialKind; 4] = [
            Diffuse::new(Rgb::new(value, 0.5, value)).into(),
            Dielectric::rough(value, value).into(),
            Conductor::color(Rgb::splat(value), value).into(),
            Conductor::measured(Rgb::splat(value), Rgb::splat(value), 0.3).into(),
        ];
        for (x, kind) in [-1.0, -0.3, 0.4, 1.1].into_iter().zip(kinds) {
            let material =
                Material::new("broken", kind).emitting(Rgb::new(value.min(1e6), 0.1, 0.0));
            let material = scene.add_material(Material { alpha: value.into(), ..material });
            put(&mut scene, Sphere { radius: 0.3 }, at(x, 0.3, 0.5), material);
        }
        let image = image(4, 2, 3, |x, _| vec![if x == 1 { value } else { 0.2 }; 3]);
        let scale = Rgb::new(1.0, value.min(1e6), 1.0);
        let world_from_environment = DAffine3::IDENTITY;
        scene.environment = Some(Environment::Image { image, scale, world_from_environment });
        if value != f32::MAX {
            survives(&format!("numbers {value}"), &scene, &front());
        } else {
            // Sums of such numbers overflow, and the samples then count as black: the test is that
            // pixels are finite.
            let settings = Settings { spp: 3, ..settings(9, 3) };
            let compiled = CompiledScene::new(&scene, &settings.build).expect("the scene compiles");
            let (film, _) = Job::new(&compiled, &front(), &settings).run(1, &|_| true);
            assert!(colors(&film.image()).iter().flatten().all(|v| v.is_finite()));
        }
    }
}

#[test]
fn broken_cameras_give_finite_pictures() {
    let (scene, _) = everything();
    let broken = [
        Camera::look_at(Vec3::ZERO, Vec3::ZERO, Vec3::Y, 0.5),
        Camera::look_at(Vec3::ZERO, Vec3::Y, Vec3::Y, 0.5),
        Camera::look_at(Vec3::NAN, Vec3::ZERO, Vec3::Y, 0.5),
        Camera::look_at(Vec3::splat(1e30), Vec3::ZERO, Vec3::Y, 0.5),
        Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 0.0),
        Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, f64::NAN),
        Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1e300),
        front().with_lens(1e30, 1e-30),
        front().with_lens(f64::NAN, f64::NAN),
        Camera::from_direction(
            DVec3::Z,
            DVec3::NEG_Z,
            DVec3::Y,
            Projection::Fisheye { max_angle: 0.0 },
        ),
        Camera::from_direction(
            DVec3::Z,
            DVec3::NEG_Z,
            DVec3::Y,
            Projection::Orthographic { half_size: [None, Some(f64::INFINITY)] },
        ),
    ];
    for camera in broken {
        survives(&format!("{camera:?}"), &scene, &camera);
    }
}

#[test]
fn things_that_touch_and_coincide_give_finite_pictures() {
    let mut scene = lit();
    let glass = scene.add_material(Material::new("glass", Dielectric::smooth(1.5)));
    let white = matte(&mut scene, 1.0);
    let glow = lamp(&mut scene, 1.0);
    for material in [glass, white, glow, glass] {
        put(&mut scene, Sphere { radius: 0.5 }, at(0.0, 0.5, 0.0), material);
        put_mesh(&mut scene, quad(), at(1.0, 0.5, 0.0), material);
    }
    // One camera lies on a surface, and one in a corner.
    survives("touching", &scene, &front());
    survives(
        "on the ground",
        &scene,
        &Camera::look_at(Vec3::new(1.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 0.5),
    );
    survives(
        "on the ball",
        &scene,
        &Camera::look_at(Vec3::new(0.0, 0.5, 0.5), Vec3::ZERO, Vec3::Y, 0.5),
    );
}

/// Rough and clear objects under area lights and a sky, with all lengths multiplied by `scale`,
/// which must not change the picture.
fn scaled(scale: f64) -> (Scene, Camera) {
    let mut scene = Scene::new("scaled");
    let grow = DAffine3::from_scale(DVec3::splat(scale));
    let (paper, glow) = (matte(&mut scene, 0.6), lamp(&mut scene, 5.0));
    let glass = scene.add_material(Material::new("glass", Dielectric::smooth(1.5)));
    let gold = scene.add_material(Material::new("gold", Conductor::gold(0.4)));
    let world = scene.add_child(scene.root, Node { transform: grow, ..Node::named("world") });
    let mut add = |shape: AnyShape, transform, material| {
        let surfaces = vec![snell_scene::Surface::shape(shape, material)];
        scene.add_child(world, Node { transform, surfaces, ..Node::default() });
    };
    add(rectangle(20.0, 20.0).into(), facing(DVec3::ZERO, DVec3::Y), paper);
    add(Sphere { radius: 0.5 }.into(), at(-0.8, 0.5, 0.0), glass);
    add(Sphere { radius: 0.5 }.into(), at(0.4, 0.5, -0.4), gold);
    add(BoxShape { min: DVec3::ZERO, max: DVec3::splat(0.6) }.into(), at(0.6, 0.0, 0.5), paper);
    add(rectangle(1.0, 1.0).into(), facing(DVec3::new(0.0, 2.5, 0.0), DVec3::NEG_Y), glow);
    let mesh = snell_scene::Geometry::Mesh(Arc::new(quad()));
    let surfaces = vec![snell_scene::Surface::with_material(mesh, glow)];
    scene.add_child(
        world,
        Node {
            transform: facing(DVec3::new(-2.0, 1.0, 0.5), DVec3::X),
            surfaces,
            ..Node::default()
        },
    );
    let image = sky(16, |d| [0.3, 0.4, 0.5 + 0.3 * d.y as f32]);
    scene.environment = Some(Environment::Image {
        image,
        scale: Rgb::WHITE,
        world_from_environment: DAffine3::IDENTITY,
    });
    let projection = Projection::Perspective { tan_half_fov: [None, Some(0.4)] };
    let eye = DVec3::new(0.5, 1.5, 4.0) * scale;
    (scene, Camera::from_target(eye, DVec3::new(0.0, 0.5, 0.0) * scale, DVec3::Y, projection))
}

#[test]
fn the_picture_does_not_depend_on_the_unit_of_length() {
    let picture = |scale: f64, integrator| {
        let (scene, camera) = scaled(scale);
        let settings =
            Settings { integrator, max_depth: 6, spp: 16, size: [32, 24], ..Settings::default() };
        colors(&render(&scene, &camera, &settings).image())
    };
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted, IntegratorKind::Ao] {
        let expected = picture(1.0, integrator);
        let brightness = expected.iter().flatten().sum::<f64>() / (3 * expected.len()) as f64;
        for exponent in [-60, -40, -20, 20, 40, 60] {
            let found = picture(2f64.powi(exponent), integrator);
            // Powers of two change no digit; rounding may still differ where constants are added to
            // lengths.
            let difference = |(a, b): (&[f64; 3], &[f64; 3])| {
                (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f64::max)
            };
            let different =
                found.iter().zip(&expected).filter(|p| difference(*p) > 1e-3 * brightness).count();
            let mean = found.iter().flatten().sum::<f64>() / (3 * found.len()) as f64;
            eprintln!(
                "{} 2^{exponent}: mean {mean:.5} of {brightness:.5}, {different} pixels differ",
                integrator.name()
            );
            assert!((mean / brightness - 1.0).abs() < 1e-3, "{} 2^{exponent}", integrator.name());
            assert!(
                different * 50 < expected.len(),
                "{} 2^{exponent}: {different}",
                integrator.name()
            );
        }
    }
}
