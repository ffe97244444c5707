//! Energy conservation: furnaces, in which every pixel has one value, and other limits on light.

use snell_intersect::shape::{BoxShape, Plane, Rectangle, Sphere};
use snell_intersect::{AnyShape, Shape};
use snell_math::{DAffine3, DVec2, DVec3, Rgb, Vec3};
use snell_render::{IntegratorKind, LightStrategy, Settings};
use snell_scene::material::{AlphaMode, Conductor, Dielectric, Diffuse, MaterialKind, Mirror};
use snell_scene::{Background, Camera, Environment, Material, MaterialId, Scene};
use snell_tests::scenes::{all_around, at, facing, ground, image, matte, put, put_mesh, quad};
use snell_tests::statistics::{Estimate, image_mean};
use snell_tests::{colors, render, settings};

/// A scene with light of radiance 1 from everywhere.
fn furnace() -> Scene {
    let mut scene = Scene::new("furnace");
    scene.environment = Some(Environment::Constant(Rgb::WHITE));
    scene
}

/// A furnace whose light is a picture, which is importance sampled.
fn sampled_furnace() -> Scene {
    let image = image(8, 4, 3, |_, _| vec![1.0; 3]);
    let world_from_environment = DAffine3::IDENTITY;
    let environment = Environment::Image { image, scale: Rgb::WHITE, world_from_environment };
    Scene { environment: Some(environment), ..Scene::new("sampled furnace") }
}

/// A camera framing a sphere of radius 1 around the origin.
fn portrait() -> Camera {
    Camera::look_at(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, Vec3::Y, 0.27)
}

fn mean(what: &str, scene: &Scene, camera: &Camera, settings: &Settings) -> Estimate {
    let [r, ..] = image_mean(&render(scene, camera, settings));
    eprintln!("{what}: {:.5} +- {:.5}", r.mean, r.error);
    r
}

/// Shapes of all kinds in a heap, each fitted into a box of unit size.
fn heap(scene: &mut Scene, material: MaterialId) {
    let mut place = 0;
    for shape in AnyShape::examples() {
        let bounds = shape.bounds();
        if !bounds.is_finite() || bounds.is_empty() {
            continue;
        }
        let scale = 1.0 / (bounds.max - bounds.min).max_element();
        let (x, z) = (f64::from(place % 6) * 0.8 - 2.0, f64::from(place / 6) * 0.8 - 2.0);
        let turned =
            DAffine3::from_axis_angle(DVec3::new(1.0, 0.3, 0.2).normalize(), f64::from(place));
        let fitted = DAffine3::from_scale(DVec3::splat(scale))
            * DAffine3::from_translation(-bounds.center());
        put(scene, shape, at(x, 0.5, z) * turned * fitted, material);
        place += 1;
    }
}

#[test]
fn a_white_furnace_shows_nothing() {
    for (what, scene) in [("constant", furnace()), ("image", sampled_furnace())] {
        for (seed, light_strategy) in (1..).zip(LightStrategy::ALL) {
            let mut scene = scene.clone();
            let white = matte(&mut scene, 1.0);
            heap(&mut scene, white);
            put(&mut scene, Plane {}, facing(DVec3::ZERO, DVec3::Y), white);
            put_mesh(&mut scene, quad(), at(0.3, 1.2, 0.1), white);
            let settings = Settings { light_strategy, seed, ..settings(48, 48) };
            let name = format!("white furnace, {what}, {}", light_strategy.name());
            let camera = Camera::look_at(Vec3::new(0.5, 3.0, 4.0), Vec3::ZERO, Vec3::Y, 0.7);
            let found = mean(&name, &scene, &camera, &settings);
            // Uniform samples of the whole sky rarely find its light: for these strategies, only
            // the noise is larger.
            if what == "constant" && light_strategy != LightStrategy::Light {
                assert!((found.mean - 1.0).abs() < 1e-3 && found.error < 1e-3, "{name}: {found:?}");
            } else {
                assert!(found.z(1.0).abs() < 3.0 && found.error < 0.01, "{name}: {found:?}");
            }
        }
    }
}

#[test]
fn every_shape_alone_vanishes_in_a_white_furnace() {
    for shape in AnyShape::examples() {
        let bounds = shape.bounds();
        let mut scene = furnace();
        let white = matte(&mut scene, 1.0);
        let (scale, center) = if bounds.is_finite() && !bounds.is_empty() {
            (1.0 / bounds.radius().max(1e-9), bounds.center())
        } else {
            (1.0, DVec3::ZERO)
        };
        let turned = DAffine3::from_axis_angle(DVec3::new(1.0, 0.4, 0.2).normalize(), 0.8);
        put(
            &mut scene,
            shape.clone(),
            turned
                * DAffine3::from_scale(DVec3::splat(scale))
                * DAffine3::from_translation(-center),
            white,
        );
        let settings = settings(24, 16);
        let found = mean(shape.name(), &scene, &portrait(), &settings);
        assert!((found.mean - 1.0).abs() < 1e-3, "{shape:?}: {found:?}");
    }
}

/// A material of this reflectance that emits 1 on both sides.
fn glowing(scene: &mut Scene, reflectance: f32) -> MaterialId {
    let material =
        Material::new("glowing", Diffuse::new(Rgb::splat(reflectance))).emitting(Rgb::WHITE);
    scene.add_material(Material { emits_on_both_sides: true, ..material })
}

#[test]
fn a_glowing_cavity_has_the_radiance_of_the_geometric_series() {
    let reflectance = 0.6;
    let eye = DVec3::new(0.2, -0.1, 0.3);
    for light_strategy in LightStrategy::ALL {
        let mut in_sphere = Scene::new("sphere");
        let material = glowing(&mut in_sphere, reflectance);
        put(&mut in_sphere, Sphere { radius: 1.0 }, DAffine3::IDENTITY, material);
        let mut in_box = Scene::new("box");
        let material = glowing(&mut in_box, reflectance);
        put(
            &mut in_box,
            BoxShape { min: DVec3::splat(-1.0), max: DVec3::new(1.0, 1.5, 2.0) },
            DAffine3::IDENTITY,
            material,
        );
        for (what, scene) in [("sphere", in_sphere), ("box", in_box)] {
            let settings = Settings { light_strategy, seed: 3, ..settings(32, 64) };
            let name = format!("cavity, {what}, {}", light_strategy.name());
            let found = mean(&name, &scene, &all_around(eye), &settings);
            assert!(found.z(2.5).abs() < 3.0, "{name}: {found:?}");
            assert!(found.error < 0.04, "{name}: {found:?}");
        }
    }
}

#[test]
fn roulette_keeps_the_radiance_of_a_bright_cavity() {
    // Nine of ten bounces continue, so most of the light comes after roulette has begun.
    let mut scene = Scene::new("cavity");
    let material = glowing(&mut scene, 0.9);
    put(&mut scene, Sphere { radius: 1.0 }, DAffine3::IDENTITY, material);
    for light_strategy in LightStrategy::ALL {
        let settings = Settings { light_strategy, seed: 5, ..settings(32, 128) };
        let name = format!("bright cavity, {}", light_strategy.name());
        let found = mean(&name, &scene, &all_around(DVec3::new(0.2, -0.1, 0.3)), &settings);
        assert!(found.z(10.0).abs() < 3.0 && found.error < 0.05, "{name}: {found:?}");
    }
}

#[test]
fn the_depth_counts_bounces() {
    let mut scene = Scene::new("cavity");
    let material = glowing(&mut scene, 0.5);
    put(&mut scene, Sphere { radius: 1.0 }, DAffine3::IDENTITY, material);
    for (max_depth, expected) in [(0, 1.0), (1, 1.5), (2, 1.75), (3, 1.875), (4, 1.9375)] {
        for light_strategy in LightStrategy::ALL {
            let settings = Settings { max_depth, light_strategy, ..settings(16, 64) };
            let found =
                mean(&format!("depth {max_depth}"), &scene, &all_around(DVec3::ZERO), &settings);
            // Without weights and roulette, every sample is exactly the partial sum of the series.
            let is_exact = light_strategy != LightStrategy::Mis && max_depth < 2;
            let tolerance = if is_exact { 1e-4 } else { 4.0 * found.error + 1e-4 };
            assert!(found.error < 0.01, "{max_depth} {light_strategy:?}: {found:?}");
            assert!(
                (found.mean - expected).abs() < tolerance,
                "{max_depth} {light_strategy:?}: {found:?}"
            );
        }
    }
    let settings =
        Settings { integrator: IntegratorKind::Direct, max_depth: 50, ..settings(16, 64) };
    let found = mean("direct", &scene, &all_around(DVec3::ZERO), &settings);
    assert!(
        (found.mean - 1.5).abs() < 4.0 * found.error + 1e-4,
        "direct light is one bounce: {found:?}"
    );
}

/// The value of a ball of this material in the furnace.
fn ball_in_furnace(scene: &Scene, kind: MaterialKind) -> Estimate {
    let mut scene = scene.clone();
    let name = format!("{} in {}", kind.name(), scene.name);
    let material = scene.add_material(Material::new("ball", kind));
    put(&mut scene, Sphere { radius: 1.0 }, DAffine3::IDENTITY, material);
    mean(&name, &scene, &portrait(), &settings(32, 64))
}

#[test]
fn glass_and_mirrors_vanish_in_a_white_furnace() {
    let (white, smooth_metal) = (Mirror::new(Rgb::WHITE), Conductor::color(Rgb::WHITE, 0.0));
    for scene in [furnace(), sampled_furnace()] {
        for kind in [
            MaterialKind::from(white.clone()),
            smooth_metal.clone().into(),
            Dielectric::smooth(1.5).into(),
            Dielectric::smooth(2.4).into(),
            Dielectric::smooth(0.75).into(),
            Dielectric::smooth(1.0).into(),
        ] {
            let found = ball_in_furnace(&scene, kind.clone());
            assert!(
                (found.mean - 1.0).abs() < 1e-3 || found.z(1.0).abs() < 3.0,
                "{kind:?}: {found:?}"
            );
            assert!(found.error < 2e-3, "{kind:?}: {found:?}");
        }
    }
}

#[test]
fn rough_white_metal_and_rough_glass_lose_nothing() {
    for scene in [furnace(), sampled_furnace()] {
        for roughness in [0.1, 0.3, 0.6, 1.0] {
            for kind in [
                MaterialKind::from(Conductor::color(Rgb::WHITE, roughness)),
                Dielectric::rough(1.5, roughness).into(),
            ] {
                let found = ball_in_furnace(&scene, kind.clone());
                assert!(
                    (found.mean - 1.0).abs() < 0.002 || found.z(1.0).abs() < 3.0,
                    "{kind:?}: {found:?}"
                );
                assert!(found.error < 0.005, "{kind:?}: {found:?}");
            }
        }
    }
}

#[test]
fn no_material_makes_light_out_of_nothing_whether_the_sky_is_sampled_or_not() {
    for kind in MaterialKind::examples() {
        let [a, b] =
            [furnace(), sampled_furnace()].map(|scene| ball_in_furnace(&scene, kind.clone()));
        for found in [a, b] {
            assert!(
                found.mean < 1.0 + 3.0 * found.error + 1e-4 && found.mean >= 0.0,
                "{kind:?}: {found:?}"
            );
        }
        assert!(a.z_against(&b).abs() < 3.5, "{kind:?}: {a:?} {b:?}");
    }
}

/// A ground beside a bright ball, and a mirror that shows the ball.
fn beside_a_lamp(illuminates: bool) -> Scene {
    let mut scene = Scene::new("lamp");
    ground(&mut scene, 0.8);
    let lamp = Material {
        illuminates,
        ..Material::new("lamp", Diffuse::new(Rgb::BLACK)).emitting(Rgb::splat(5.0))
    };
    let lamp = scene.add_material(lamp);
    put(&mut scene, Sphere { radius: 0.5 }, at(0.0, 1.0, 0.0), lamp);
    let mirror = scene.add_material(Material::new("mirror", Mirror::new(Rgb::splat(0.5))));
    put(&mut scene, Rectangle { half_size: DVec2::splat(2.0) }, at(0.0, 1.0, -2.0), mirror);
    scene
}

/// The pixel that looks from `eye` to `target`.
fn look(scene: &Scene, eye: DVec3, target: DVec3, light_strategy: LightStrategy) -> f64 {
    let camera = Camera::look_at(eye.as_vec3(), target.as_vec3(), Vec3::Y, 0.01);
    let settings = Settings { light_strategy, ..settings(1, 4096) };
    colors(&render(scene, &camera, &settings).image())[0][0]
}

#[test]
fn emission_that_does_not_illuminate_is_seen_directly_and_in_mirrors_only() {
    let eye = DVec3::new(2.0, 1.0, 2.0);
    let (ball, floor, in_mirror) =
        (DVec3::new(0.0, 1.0, 0.0), DVec3::new(1.0, 0.0, 0.5), DVec3::new(2.0 / 3.0, 1.0, -2.0));
    for strategy in LightStrategy::ALL {
        let (dim, bright) = (beside_a_lamp(false), beside_a_lamp(true));
        assert_eq!(look(&dim, eye, ball, strategy), 5.0);
        assert_eq!(look(&dim, eye, floor, strategy), 0.0);
        assert!(look(&bright, eye, floor, strategy) > 0.1);
        let seen = look(&dim, eye, in_mirror, strategy);
        assert!((seen - 2.5).abs() < 1e-5, "{seen}");
    }
}

#[test]
fn a_background_colour_is_seen_and_lights_nothing() {
    let mut scene = Scene::new("background");
    ground(&mut scene, 0.8);
    scene.background = Background::Color(Rgb::splat(0.7));
    let eye = DVec3::new(0.0, 1.0, 2.0);
    assert_eq!(look(&scene, eye, DVec3::new(0.0, 2.0, 0.0), LightStrategy::Mis), f64::from(0.7f32));
    assert_eq!(look(&scene, eye, DVec3::ZERO, LightStrategy::Mis), 0.0);
}

#[test]
fn the_dark_side_of_a_lamp_is_dark_unless_both_sides_emit() {
    for (both, expected) in [(false, 0.0), (true, 5.0)] {
        let mut scene = Scene::new("panel");
        let lamp = Material::new("lamp", Diffuse::new(Rgb::BLACK)).emitting(Rgb::splat(5.0));
        let lamp = scene.add_material(Material { emits_on_both_sides: both, ..lamp });
        put(&mut scene, Rectangle { half_size: DVec2::ONE }, DAffine3::IDENTITY, lamp);
        let (front, back) = (DVec3::new(0.1, 0.2, 3.0), DVec3::new(0.1, 0.2, -3.0));
        assert_eq!(look(&scene, front, DVec3::ZERO, LightStrategy::Mis), 5.0);
        assert_eq!(look(&scene, back, DVec3::ZERO, LightStrategy::Mis), expected);
    }
}

#[test]
fn a_cut_out_or_blended_lamp_gives_as_much_light_as_is_there() {
    let look_at_floor = |alpha_mode, opacity: f32, double_sided, strategy| {
        let mut scene = Scene::new("lamp");
        ground(&mut scene, 0.8);
        let lamp = Material::new("lamp", Diffuse::new(Rgb::BLACK)).emitting(Rgb::splat(5.0));
        let lamp = Material { alpha_mode, double_sided, emits_on_both_sides: true, ..lamp };
        let lamp = scene.add_material(Material { alpha: opacity.into(), ..lamp });
        put(&mut scene, Sphere { radius: 0.5 }, at(0.0, 1.0, 0.0), lamp);
        look(&scene, DVec3::new(2.0, 1.0, 2.0), DVec3::new(0.3, 0.0, 0.3), strategy)
    };
    for strategy in LightStrategy::ALL {
        let whole = look_at_floor(AlphaMode::Opaque, 0.3, true, strategy);
        assert!(whole > 0.5, "{strategy:?}: {whole}");
        assert_eq!(
            look_at_floor(AlphaMode::Mask(0.5), 0.3, true, strategy),
            0.0,
            "{strategy:?}: nothing is there"
        );
        // The outer surface blocks half of the light, and through it the inner one blocks half of
        // the rest.
        let half = look_at_floor(AlphaMode::Blend, 0.5, true, strategy);
        assert!((half / whole - 0.75).abs() < 0.03, "{strategy:?}: {half} of {whole}");
        let outside = look_at_floor(AlphaMode::Blend, 0.5, false, strategy);
        assert!((outside / whole - 0.5).abs() < 0.03, "{strategy:?}: {outside} of {whole}");
    }
}
