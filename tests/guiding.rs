//! Path guiding changes only the noise, gives the same bits for any number of threads, order and
//! crop, and works on any scene.

use snell_intersect::BuildOptions;
use snell_intersect::shape::{BoxShape, Sphere};
use snell_math::{DAffine3, DVec3, Rgb, Vec3};
use snell_render::{CompiledScene, Crop, Guiding, Job, Settings, TileOrder};
use snell_scene::light::Directional;
use snell_scene::material::{Dielectric, Diffuse, Mirror};
use snell_scene::{Camera, Environment, Material, Scene};
use snell_tests::scenes::{at, everything, facing, lamp, matte, put, rectangle};
use snell_tests::statistics::{compare, image_mean};
use snell_tests::{bits, render, render_compiled, settings};

fn guided(settings: Settings, passes: u32) -> Settings {
    Settings { guiding: Some(Guiding { passes, photons: 1 << 14 }), ..settings }
}

/// A closed room with a ball of clear glass, one of frosted glass and a mirror, under a large lamp.
fn room_with_glass() -> (Scene, Camera) {
    let mut scene = Scene::new("glass");
    let walls = matte(&mut scene, 0.6);
    let inside = BoxShape { min: DVec3::new(-3.0, 0.0, -3.0), max: DVec3::new(3.0, 3.2, 5.0) };
    put(&mut scene, inside, DAffine3::IDENTITY, walls);
    let glass = scene.add_material(Material::new("glass", Dielectric::smooth(1.5)));
    let frosted = scene.add_material(Material::new("frosted", Dielectric::rough(1.5, 0.5)));
    let mirror = scene.add_material(Material::new("mirror", Mirror::new(Rgb::splat(0.9))));
    let glow = lamp(&mut scene, 1.0);
    put(&mut scene, Sphere { radius: 0.6 }, at(-0.9, 0.7, 0.0), glass);
    put(&mut scene, Sphere { radius: 0.6 }, at(0.9, 0.7, 0.0), frosted);
    put(
        &mut scene,
        rectangle(3.0, 2.0),
        facing(DVec3::new(0.0, 1.0, -1.5), DVec3::new(0.0, 0.2, 1.0)),
        mirror,
    );
    put(&mut scene, rectangle(3.0, 3.0), facing(DVec3::new(0.0, 3.0, 0.0), DVec3::NEG_Y), glow);
    (scene, Camera::look_at(Vec3::new(0.0, 1.6, 4.0), Vec3::new(0.0, 0.5, 0.0), Vec3::Y, 0.4))
}

/// Two rooms with a gap in the wall between them. The camera sees one room, and the lamp is in the
/// other.
fn two_rooms() -> (Scene, Camera) {
    let mut scene = Scene::new("two rooms");
    let walls = matte(&mut scene, 0.7);
    let put_box = |scene: &mut Scene, min: [f64; 3], max: [f64; 3]| {
        let shape = BoxShape { min: DVec3::from(min), max: DVec3::from(max) };
        put(scene, shape, DAffine3::IDENTITY, walls);
    };
    put_box(&mut scene, [-3.0, 0.0, -2.0], [3.0, 2.5, 2.0]);
    put_box(&mut scene, [-0.1, 0.0, -2.0], [0.1, 2.5, 1.4]);
    let glow = lamp(&mut scene, 60.0);
    put(&mut scene, rectangle(1.0, 1.0), facing(DVec3::new(-1.5, 2.4, -1.0), DVec3::NEG_Y), glow);
    (scene, Camera::look_at(Vec3::new(2.7, 1.3, -1.5), Vec3::new(0.5, 1.0, 0.0), Vec3::Y, 0.6))
}

#[test]
fn guided_and_unguided_pictures_agree() {
    let all =
        [("everything", everything()), ("glass", room_with_glass()), ("two rooms", two_rooms())];
    for (name, (scene, camera)) in all {
        let plain = Settings { seed: 1, max_depth: 12, ..settings(24, 64) };
        let other = guided(Settings { seed: 2, ..plain.clone() }, 3);
        compare(&render(&scene, &camera, &other), &render(&scene, &camera, &plain)).check(name);
    }
}

#[test]
fn a_room_lit_through_a_gap_is_less_noisy_when_guided() {
    let (scene, camera) = two_rooms();
    let plain = settings(24, 32);
    let error = |settings: &Settings| image_mean(&render(&scene, &camera, settings))[0].error;
    let (plain, guided) = (error(&plain), error(&guided(plain.clone(), 5)));
    eprintln!("standard error {plain} unguided, {guided} guided");
    assert!(guided * 1.5 < plain, "{guided} {plain}");
}

#[test]
fn threads_order_passes_and_crops_do_not_change_a_bit_of_guided_pictures() {
    let (scene, camera) = everything();
    let scene = CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles");
    let base = Settings { size: [37, 29], spp: 6, seed: 7, max_depth: 6, ..Settings::default() };
    let base = guided(base, 3);
    let whole = render_compiled(&scene, &camera, &base, 1).image();
    for (threads, tile_order, progressive) in [
        (2, TileOrder::Rows, false),
        (3, TileOrder::Reversed, true),
        (4, TileOrder::Shuffled(3), false),
    ] {
        let other = Settings { tile_order, progressive, ..base.clone() };
        let film = render_compiled(&scene, &camera, &other, threads);
        assert!(
            bits(&film.image()) == bits(&whole),
            "{threads} threads, {tile_order:?}, progressive {progressive}"
        );
    }
    let crop = Crop { min: [5, 3], max: [21, 19] };
    let part =
        render_compiled(&scene, &camera, &Settings { crop: Some(crop), ..base.clone() }, 2).image();
    for y in 0..16 {
        for x in 0..16 {
            let pixel = |image: &snell_scene::LayeredImage, x: u32, y: u32| {
                let layer = &image.layers[0];
                let start = (y * image.width + x) as usize * layer.channels.len();
                layer.values[start..start + layer.channels.len()].to_vec()
            };
            assert_eq!(pixel(&part, x, y), pixel(&whole, x + 5, y + 3), "pixel {x}, {y}");
        }
    }
}

#[test]
fn training_that_is_interrupted_leaves_whole_passes() {
    let (scene, camera) = two_rooms();
    let scene = CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles");
    let picture = |passes: u32, keep_going: &(dyn Fn(&snell_render::Progress) -> bool + Sync)| {
        let settings = guided(settings(16, 4), passes);
        let (film, statistics) = Job::new(&scene, &camera, &settings).run(2, keep_going);
        (bits(&film.image()), statistics.training_passes)
    };
    let interrupted =
        picture(9, &|progress| progress.training.is_none_or(|t| t.pass < 2 || t.begun < 5));
    assert_eq!(interrupted.1, 2);
    assert!(interrupted == picture(2, &|_| true), "the same bits");
}

#[test]
fn scenes_that_make_no_sense_are_survived() {
    let ball = |radiance: f32| {
        let mut scene = Scene::new("ball");
        let floor = matte(&mut scene, 0.9);
        let glow = scene.add_material(
            Material::new("glow", Diffuse::new(Rgb::WHITE)).emitting(Rgb::splat(radiance)),
        );
        put(&mut scene, Sphere { radius: 1.0 }, DAffine3::IDENTITY, glow);
        put(&mut scene, rectangle(8.0, 8.0), facing(DVec3::new(0.0, -1.5, 0.0), DVec3::Y), floor);
        scene
    };
    let mut all = vec![("empty", Scene::new("empty"))];
    for radiance in [0.0, 1.0, 1e-30, 1e18, 1e30, f32::MAX, f32::INFINITY, f32::NAN] {
        all.push(("ball", ball(radiance)));
    }
    for environment in [0.5, f32::NAN, 1e30] {
        let mut scene = ball(0.0);
        scene.environment = Some(Environment::Constant(Rgb::splat(environment)));
        all.push(("environment", scene));
    }
    for direction in [DVec3::NEG_Y, DVec3::splat(f64::NAN)] {
        let mut scene = ball(0.0);
        scene.add_light(Directional { direction, irradiance: Rgb::splat(3.0) });
        all.push(("directional", scene));
    }
    let camera = Camera::look_at(Vec3::new(0.3, 0.4, 6.0), Vec3::ZERO, Vec3::Y, 0.5);
    for (name, scene) in all {
        let compiled =
            CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles");
        let settings = guided(Settings { size: [13, 9], spp: 3, ..Settings::default() }, 1);
        let (film, _) = Job::new(&compiled, &camera, &settings).run(2, &|_| true);
        assert!(film.image().layers[0].values.iter().all(|v| v.is_finite()), "{name}");
    }
}
