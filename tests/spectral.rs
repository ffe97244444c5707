//! Spectral pictures: grey scenes equal those of RGB, white is white, colours are reproduced, and
//! the bits are deterministic.

use snell_intersect::BuildOptions;
use snell_intersect::shape::{BoxShape, Sphere};
use snell_math::spectrum::{Metal, RefractiveIndex};
use snell_math::{ColorModel, DAffine3, DVec3, Rgb, Vec3};
use snell_render::{CompiledScene, Crop, IntegratorKind, Settings, TileOrder};
use snell_scene::builtin::builtin;
use snell_scene::light::Directional;
use snell_scene::material::{
    Conductor, Dielectric, MaterialKind, MetallicRoughness, Mirror, Phong, Plastic,
};
use snell_scene::{Background, Camera, Environment, Material, Scene};
use snell_tests::scenes::{
    all_around, at, everything, facing, ground, lamp, matte, put, rectangle, sky,
};
use snell_tests::statistics::{compare, image_mean};
use snell_tests::{bits, colors, render, render_compiled, settings};

const GREY: Rgb = Rgb::splat(0.6);

/// Objects of these materials on a ground under a lamp and a grey sky.
fn display(kinds: Vec<MaterialKind>) -> (Scene, Camera) {
    let mut scene = Scene::new("display");
    ground(&mut scene, 0.5);
    for (i, kind) in kinds.into_iter().enumerate() {
        let material = scene.add_material(Material::new(format!("material {i}"), kind));
        put(&mut scene, Sphere { radius: 0.6 }, at(1.4 * i as f64 - 1.4, 0.6, 0.0), material);
    }
    let warm = lamp(&mut scene, 3.0);
    put(
        &mut scene,
        rectangle(1.5, 1.0),
        facing(DVec3::new(0.0, 2.5, 1.0), DVec3::new(0.1, -1.0, 0.0)),
        warm,
    );
    let image = sky(16, |d| [0.4 + 0.3 * d.y as f32; 3]);
    let world_from_environment = DAffine3::IDENTITY;
    scene.environment =
        Some(Environment::Image { image, scale: Rgb::splat(0.6), world_from_environment });
    (scene, Camera::look_at(Vec3::new(0.5, 2.0, 4.5), Vec3::new(0.0, 0.5, 0.0), Vec3::Y, 0.35))
}

fn grey_cornell_box() -> (Scene, Camera) {
    let mut scene = builtin("cornell-box").expect("the scene is built in");
    for material in &mut scene.materials {
        let luminance = Rgb::splat(material.emission.factor.luminance());
        material.emission.factor = luminance;
        if let MaterialKind::Diffuse(diffuse) = &mut material.kind {
            diffuse.reflectance.factor = Rgb::splat(diffuse.reflectance.factor.luminance());
        }
    }
    let camera = scene.cameras[0].clone();
    (scene, camera)
}

/// Classic materials under point and directional lights.
fn classic() -> (Scene, Camera) {
    let phong =
        Phong { diffuse: GREY.into(), specular: Rgb::splat(0.3).into(), ..Phong::default() };
    let glass = Phong {
        diffuse: Rgb::splat(0.1).into(),
        transmission: Rgb::splat(0.7).into(),
        reflection: Rgb::splat(0.2).into(),
        ior: 1.3,
        ..Phong::default()
    };
    let (mut scene, camera) = display(vec![phong.into(), glass.into(), Mirror::new(GREY).into()]);
    scene.ambient = Rgb::splat(0.2);
    scene.background = Background::Color(Rgb::splat(0.4));
    scene.add_light(Directional {
        direction: DVec3::new(-0.6, -0.8, 0.0),
        irradiance: Rgb::splat(2.0),
    });
    (scene, camera)
}

#[test]
fn grey_scenes_look_as_they_do_in_rgb() {
    let glassy = vec![
        Dielectric::smooth(1.5).into(),
        Conductor::color(GREY, 0.4).into(),
        Dielectric::rough(1.4, 0.5).into(),
    ];
    let mixed =
        MetallicRoughness { clearcoat: 0.5.into(), ..MetallicRoughness::new(GREY, 0.5, 0.4) };
    let glossy = vec![
        Plastic::new(GREY, 0.3).into(),
        mixed.into(),
        MetallicRoughness::new(GREY, 0.0, 0.6).into(),
    ];
    let scenes = [
        ("cornell box", grey_cornell_box(), IntegratorKind::Path, 96),
        ("glass and metal", display(glassy), IntegratorKind::Path, 160),
        ("glossy", display(glossy), IntegratorKind::Path, 96),
        ("classic", classic(), IntegratorKind::Whitted, 64),
        ("direct", classic(), IntegratorKind::Direct, 64),
        ("flat", classic(), IntegratorKind::Flat, 64),
        ("ambient occlusion", classic(), IntegratorKind::Ao, 128),
    ];
    for (name, (scene, camera), integrator, spp) in scenes {
        let film = |color, seed| {
            let settings = Settings { integrator, color, seed, max_depth: 8, ..settings(24, spp) };
            render(&scene, &camera, &settings)
        };
        compare(&film(ColorModel::Rgb, 1), &film(ColorModel::Spectral, 2)).check(name);
    }
}

#[test]
fn a_path_of_one_wavelength_stands_for_four() {
    // The glass counts as dispersive, so that a path carries one wavelength, but its index is
    // nearly the same at all wavelengths.
    let scene = |ior: RefractiveIndex| {
        display(vec![Dielectric::smooth(ior).into(), Dielectric::rough(ior, 0.4).into()])
    };
    let film = |ior: RefractiveIndex, seed| {
        let (scene, camera) = scene(ior);
        let settings =
            Settings { color: ColorModel::Spectral, seed, max_depth: 8, ..settings(24, 160) };
        render(&scene, &camera, &settings)
    };
    let parting = RefractiveIndex::Cauchy { a: 1.5, b: 1e-9 };
    compare(&film(1.5.into(), 1), &film(parting, 2)).check("one wavelength for four");
}

#[test]
fn a_prism_shows_a_spectrum_and_in_rgb_a_white_line() {
    let scene = builtin("prism").expect("the scene is built in");
    let rows = |color| {
        let settings = Settings { size: [160, 100], spp: 64, color, ..settings(160, 64) };
        let crop = Some(Crop { min: [0, 50], max: [160, 51] });
        colors(&render(&scene, &scene.cameras[0], &Settings { crop, ..settings }).image())
    };
    let spectral = rows(ColorModel::Spectral);
    // The column in which channel `c` exceeds the others most.
    let place = |c: usize| {
        let lead = |p: &[f64; 3]| p[c] - p[(c + 1) % 3].max(p[(c + 2) % 3]);
        let best = (0..160)
            .max_by(|&a, &b| lead(&spectral[a]).total_cmp(&lead(&spectral[b])))
            .expect("pixels");
        assert!(lead(&spectral[best]) > 0.1, "channel {c}: {:?}", spectral[best]);
        best as i32
    };
    let [red, green, blue] = [0, 1, 2].map(place);
    assert!((green - red) * (blue - green) > 0 && (blue - red).abs() >= 3, "{red} {green} {blue}");
    for pixel in rows(ColorModel::Rgb) {
        assert!((pixel[0] - pixel[2]).abs() <= 1e-3 * pixel[0], "{pixel:?}");
    }
}

#[test]
fn colours_that_are_seen_once_are_those_of_rgb() {
    let mut scene = Scene::new("colours");
    let colors = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.8, 0.7, 0.1],
        [0.02, 0.3, 0.4],
        [1.0; 3],
    ];
    for (i, color) in colors.into_iter().enumerate() {
        let material = matte(&mut scene, 0.0);
        scene.materials[material.index()].kind =
            snell_scene::material::Diffuse::new(Rgb::from(color)).into();
        let x = i as f64 * 2.0 - 5.0;
        let shape =
            BoxShape { min: DVec3::new(x - 0.9, -0.9, -0.1), max: DVec3::new(x + 0.9, 0.9, 0.0) };
        put(&mut scene, shape, DAffine3::IDENTITY, material);
    }
    // Every surface has an irradiance of pi, first in white and then in a colour.
    for light in [Rgb::WHITE, Rgb::new(2.0, 1.0, 0.3)] {
        let irradiance = light * std::f32::consts::PI;
        scene.lights = vec![Directional { direction: DVec3::NEG_Z, irradiance }.into()];
        let camera = Camera::look_at(Vec3::new(0.0, 0.0, 100.0), Vec3::ZERO, Vec3::Y, 0.01);
        let settings = Settings {
            integrator: IntegratorKind::Direct,
            color: ColorModel::Spectral,
            ..settings(60, 1024)
        };
        let settings = Settings { size: [60, 10], ..settings };
        let image = snell_tests::colors(&render(&scene, &camera, &settings).image());
        for (i, color) in colors.into_iter().enumerate() {
            let pixel = image[5 * 60 + 5 + 10 * i];
            // Under coloured light only white must be reproduced exactly: other colours depend on
            // the spectra.
            let tolerance = if light == Rgb::WHITE || i == 5 { 0.02 } else { 0.4 };
            for c in 0..3 {
                let expected = f64::from(color[c] * light.to_array()[c]);
                assert!((pixel[c] - expected).abs() < tolerance, "{light:?} {color:?}: {pixel:?}");
            }
        }
    }
}

#[test]
fn a_furnace_of_all_colours_of_light_stays_white() {
    let mut scene =
        Scene { environment: Some(Environment::Constant(Rgb::WHITE)), ..Scene::new("furnace") };
    let white = matte(&mut scene, 1.0);
    put(&mut scene, Sphere { radius: 1.0 }, at(0.0, 0.0, 0.0), white);
    let settings = Settings { color: ColorModel::Spectral, ..settings(16, 512) };
    let camera = all_around(DVec3::new(0.0, 0.0, 3.0));
    for estimate in image_mean(&render(&scene, &camera, &settings)) {
        assert!((estimate.mean - 1.0).abs() < 2e-3, "{estimate:?}");
    }
}

#[test]
fn spectral_pictures_do_not_depend_on_threads_order_or_the_textbook() {
    let (mut scene, camera) = everything();
    for material in &mut scene.materials {
        match &mut material.kind {
            MaterialKind::Dielectric(glass) => glass.ior = RefractiveIndex::from_abbe(1.6, 20.0),
            MaterialKind::Conductor(metal) => {
                *metal = Conductor::metal(Metal::named("Cu").expect("known"), 0.3)
            }
            _ => {}
        }
    }
    let compiled =
        CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles");
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let plain = Settings {
            size: [25, 21],
            spp: 18,
            seed: 3,
            max_depth: 6,
            color: ColorModel::Spectral,
            integrator,
            ..Settings::default()
        };
        let expected = bits(&render_compiled(&compiled, &camera, &plain, 1).image());
        for (threads, tile_order, progressive) in [
            (4, TileOrder::Rows, false),
            (3, TileOrder::Shuffled(5), true),
            (2, TileOrder::Reversed, true),
        ] {
            let settings = Settings { tile_order, progressive, ..plain.clone() };
            let found = bits(&render_compiled(&compiled, &camera, &settings, threads).image());
            assert!(found == expected, "{integrator:?} with {threads} threads");
        }
        let image = colors(&render_compiled(&compiled, &camera, &plain, 2).image());
        let textbook = snell_render::reference::ray_cast(&compiled, &camera, &plain);
        for (a, b) in image.iter().zip(&textbook) {
            for c in 0..3 {
                let b = f64::from(b.to_array()[c]);
                assert!((a[c] - b).abs() < 1e-4 * b.abs().max(1.0), "{integrator:?}: {a:?} {b:?}");
            }
        }
    }
}
