//! Tests of media in pictures: closed forms, furnaces, agreement of strategies, and bits that
//! depend neither on threads nor on batches.

use crate::reference::ray_cast;
use crate::{CompiledScene, Filter, IntegratorKind, Job, LightStrategy, Settings};
use snell_intersect::shape::{BoxShape, Sphere};
use snell_math::{DAffine3, DVec3, Rgb, Vec3};
use snell_scene::light::{Attenuation, Directional, Point};
use snell_scene::material::{Dielectric, Diffuse, Interior};
use snell_scene::medium::{Grid, HeightFog, Homogeneous, ScalarGrid};
use snell_scene::{Camera, Environment, Material, MaterialId, Medium, Node, Scene, Surface};
use std::f64::consts::PI;

fn add_ball(scene: &mut Scene, center: DVec3, radius: f64, material: MaterialId) {
    let transform = DAffine3::from_translation(center);
    let surfaces = vec![Surface::shape(Sphere { radius }, material)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::default() });
}

fn add_box(scene: &mut Scene, min: DVec3, max: DVec3, material: MaterialId) {
    let surfaces = vec![Surface::shape(BoxShape { min, max }, material)];
    scene.add_child(scene.root, Node { surfaces, ..Node::default() });
}

/// Adds a material that is an interface around a medium.
fn around(scene: &mut Scene, medium: impl Into<Medium>) -> MaterialId {
    let medium = scene.add_medium(medium);
    scene.add_material(Material::interface("cloud", medium))
}

fn sky(scene: &mut Scene, radiance: Rgb) {
    scene.environment = Some(Environment::Constant(radiance));
}

fn camera(z: f32) -> Camera {
    Camera::look_at(Vec3::new(0.0, 0.0, z), Vec3::ZERO, Vec3::Y, 0.01)
}

/// The colours of all pixels of a render.
fn render(scene: &Scene, camera: &Camera, settings: &Settings) -> Vec<[f64; 3]> {
    let compiled = CompiledScene::new(scene, &settings.build).expect("a valid scene");
    let (film, statistics) = Job::new(&compiled, camera, settings).run(4, &|_| true);
    assert_eq!(statistics.invalid_samples, 0);
    let image = film.image();
    let pixels = image.layers[0].values.chunks(4);
    pixels.map(|p| std::array::from_fn(|c| f64::from(p[c]))).collect()
}

/// Mean and standard error of each channel over the pixels.
fn mean(pixels: &[[f64; 3]]) -> [(f64, f64); 3] {
    let n = pixels.len() as f64;
    std::array::from_fn(|c| {
        let mean = pixels.iter().map(|p| p[c]).sum::<f64>() / n;
        let variance = pixels.iter().map(|p| (p[c] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (variance / n).sqrt())
    })
}

/// Settings for pictures in which all pixels have the same expected value, so that their deviation
/// estimates the error.
fn settings(spp: u32) -> Settings {
    Settings { size: [16, 16], spp, filter: Filter::Box, ..Settings::default() }
}

#[track_caller]
fn assert_mean(pixels: &[[f64; 3]], expected: [f64; 3]) {
    for ((mean, error), expected) in mean(pixels).into_iter().zip(expected) {
        assert!(
            (mean - expected).abs() <= 4.0 * error + 2e-4 * expected,
            "{mean} +- {error} is not {expected}"
        );
    }
}

/// A ball of a medium whose density falls off outwards, in a box of side 2.
fn puff(sigma_a: Rgb, sigma_s: Rgb, g: f32) -> Grid {
    let n = 10;
    let value = |i: usize| {
        let [x, y, z] =
            [i % n, i / n % n, i / n / n].map(|c| (c as f32 + 0.5) / n as f32 * 2.0 - 1.0);
        (1.2 - (x * x + y * y + z * z)).max(0.0)
    };
    let density = ScalarGrid::new([n; 3], (0..n * n * n).map(value).collect())
        .expect("as many values as cells");
    let map =
        DAffine3::from_translation(DVec3::splat(-1.0)) * DAffine3::from_scale(DVec3::splat(2.0));
    Grid::new(sigma_a, sigma_s, g, density, map)
}

#[test]
fn clear_colours_of_glass_are_those_of_lambert_and_beer() {
    let mut scene = Scene::new("absorbing ball");
    sky(&mut scene, Rgb::new(1.0, 2.0, 3.0));
    let material = around(&mut scene, Homogeneous::absorbing(Rgb::new(0.1, 0.5, 2.0)));
    add_ball(&mut scene, DVec3::ZERO, 1.0, material);
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 1e-4);
    let expected = [(0.1, 1.0), (0.5, 2.0), (2.0, 3.0)]
        .map(|(sigma, radiance): (f64, f64)| radiance * (-2.0 * sigma).exp());
    for pixel in render(&scene, &camera, &settings(1)) {
        for c in 0..3 {
            assert!((pixel[c] - expected[c]).abs() < 1e-5, "{pixel:?} is not {expected:?}");
        }
    }
}

#[test]
fn of_a_medium_that_is_cut_open_only_what_is_left_absorbs() {
    let sigma = 0.5;
    let mut ball = Scene::new("absorbing ball");
    sky(&mut ball, Rgb::splat(1.0));
    let material = around(&mut ball, Homogeneous::absorbing(Rgb::splat(sigma)));
    add_ball(&mut ball, DVec3::ZERO, 1.0, material);
    let mut fog = Scene::new("fog");
    sky(&mut fog, Rgb::splat(1.0));
    fog.medium = Some(fog.add_medium(Homogeneous::absorbing(Rgb::splat(sigma))));
    let glow = fog.add_material(
        Material::new("wall", Diffuse { reflectance: Rgb::BLACK.into() }).emitting(Rgb::splat(1.0)),
    );
    add_box(&mut fog, DVec3::new(-9.0, -9.0, -3.0), DVec3::new(9.0, 9.0, -2.0), glow);
    // The camera looks from z = 5 towards -z; what is above z = 0.25 is cut away, or below it.
    for (scene, clip, length) in [
        (&ball, [0.0, 0.0, -1.0, 0.25], 1.25),
        (&ball, [0.0, 0.0, -2.0, 0.5], 1.25),
        (&fog, [0.0, 0.0, -1.0, 0.25], 2.25),
    ] {
        let camera = Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 1e-4);
        let camera = Camera { clip: Some(clip), ..camera };
        for spp in [1, 16] {
            for pixel in render(scene, &camera, &settings(spp)) {
                let expected = f64::exp(-f64::from(sigma) * length);
                assert!((pixel[0] - expected).abs() < 1e-4, "{} {pixel:?}", scene.name);
            }
        }
    }
}

#[test]
fn a_slab_scatters_once_what_the_integral_says() {
    // A directional light from the camera's side, 60 degrees off the normal.
    let (sigma_a, sigma_s, g) = (Rgb::new(0.2, 0.1, 0.0), Rgb::new(0.8, 0.4, 2.0), 0.4f32);
    let travelling = DVec3::new(0.75f64.sqrt(), 0.0, -0.5);
    let media = [
        Medium::from(Homogeneous { sigma_a, sigma_s, emission: Rgb::BLACK, g }),
        Grid::new(
            sigma_a,
            sigma_s,
            g,
            ScalarGrid::new([1, 2, 3], vec![1.0; 6]).expect("six values"),
            DAffine3::from_translation(DVec3::new(-50.0, -50.0, -1.5))
                * DAffine3::from_scale(DVec3::new(100.0, 100.0, 1.5)),
        )
        .into(),
    ];
    for medium in media {
        let mut scene = Scene::new("slab");
        let material = around(&mut scene, medium);
        add_box(&mut scene, DVec3::new(-50.0, -50.0, -1.5), DVec3::new(50.0, 50.0, 0.0), material);
        scene.add_light(Directional { direction: travelling, irradiance: Rgb::splat(PI as f32) });
        let settings = Settings { max_depth: 1, ..settings(64) };
        // Light that is deflected towards the camera, along +z.
        let cos = travelling.z;
        let gd = f64::from(g);
        let phase = (1.0 - gd * gd) / (4.0 * PI * (1.0 + gd * gd - 2.0 * gd * cos).powf(1.5));
        let expected = [0, 1, 2].map(|c| {
            let (a, s) = (f64::from(sigma_a.to_array()[c]), f64::from(sigma_s.to_array()[c]));
            let rate = (a + s) * (1.0 + 2.0);
            s * phase * PI / rate * (1.0 - (-rate * 1.5).exp())
        });
        assert_mean(&render(&scene, &camera(3.0), &settings), expected);
    }
}

#[test]
fn nothing_is_seen_of_a_medium_that_only_scatters_in_a_furnace() {
    let (white, chromatic) = (Rgb::splat(1.5), Rgb::new(0.3, 1.0, 3.0));
    let fog = |sigma_s, g| {
        Medium::from(Homogeneous { sigma_a: Rgb::BLACK, sigma_s, emission: Rgb::BLACK, g })
    };
    let media = [
        fog(white, 0.0),
        fog(white, 0.9),
        fog(chromatic, -0.5),
        fog(chromatic, 0.7),
        puff(Rgb::BLACK, white, 0.0).into(),
        puff(Rgb::BLACK, chromatic, 0.8).into(),
        puff(Rgb::BLACK, chromatic, -0.4).into(),
        HeightFog {
            sigma_a: Rgb::BLACK,
            sigma_s: chromatic,
            g: 0.5,
            base: DVec3::ZERO,
            up: DVec3::new(0.3, 1.0, 0.2),
            scale_height: 0.7,
        }
        .into(),
    ];
    for medium in media {
        for (strategy, inside) in
            [(LightStrategy::Mis, false), (LightStrategy::Light, false), (LightStrategy::Mis, true)]
        {
            let mut scene = Scene::new("furnace");
            sky(&mut scene, Rgb::new(1.0, 0.5, 0.25));
            let material = around(&mut scene, medium.clone());
            add_ball(&mut scene, DVec3::ZERO, 1.0, material);
            let settings = Settings { size: [8, 8], light_strategy: strategy, ..settings(64) };
            let camera = camera(if inside { 0.5 } else { 5.0 });
            let pixels = render(&scene, &camera, &settings);
            for ((mean, error), expected) in mean(&pixels).into_iter().zip([1.0, 0.5, 0.25]) {
                let what = (medium.name(), strategy, inside);
                assert!(
                    (mean - expected).abs() <= 4.0 * error + 1e-4,
                    "{what:?}: {mean} +- {error} is not {expected}"
                );
                let noise = if strategy == LightStrategy::Mis { 0.02 } else { 0.1 };
                assert!(error < noise, "{what:?}: {mean} +- {error}");
            }
        }
    }
}

/// A scene of fog with a lamp in it, a cloud, a ball of coloured glass with a bubble, and a matte
/// floor.
fn everything() -> (Scene, Camera) {
    let mut scene = Scene::new("everything");
    sky(&mut scene, Rgb::new(0.1, 0.2, 0.3));
    let floor = scene.add_material(Material::new("floor", Diffuse::new(Rgb::splat(0.6))));
    let lamp = scene.add_material(
        Material::new("lamp", Diffuse::new(Rgb::BLACK)).emitting(Rgb::new(9.0, 6.0, 3.0)),
    );
    let fog =
        around(&mut scene, Homogeneous::scattering(Rgb::new(0.1, 0.15, 0.3), Rgb::splat(0.9), 0.5));
    let mut cloud = puff(Rgb::splat(0.1), Rgb::new(2.0, 3.0, 4.0), 0.3);
    cloud.emission = Rgb::new(0.2, 0.05, 0.0);
    let cloud = around(&mut scene, cloud);
    let green = scene.add_medium(Homogeneous::absorbing(Rgb::new(1.0, 0.1, 1.5)));
    let milk = scene.add_medium(Homogeneous::scattering(Rgb::splat(3.0), Rgb::splat(0.95), 0.0));
    let interior = |medium, priority| Some(Interior { medium, priority });
    let glass = scene.add_material(Material {
        interior: interior(Some(green), 1),
        ..Material::new("glass", Dielectric::smooth(1.5))
    });
    let drink = scene.add_material(Material {
        interior: interior(Some(milk), 0),
        ..Material::new("drink", Dielectric::rough(1.33, 0.4))
    });
    let bubble = scene.add_material(Material {
        interior: interior(None, 2),
        ..Material::new("bubble", Dielectric::smooth(1.0))
    });
    add_box(&mut scene, DVec3::new(-9.0, -2.0, -9.0), DVec3::new(9.0, -1.0, 9.0), floor);
    add_box(&mut scene, DVec3::splat(-4.0), DVec3::splat(4.0), fog);
    add_box(&mut scene, DVec3::splat(-1.0), DVec3::splat(1.0), cloud);
    add_ball(&mut scene, DVec3::new(1.6, 0.2, 1.0), 0.7, glass);
    add_ball(&mut scene, DVec3::new(1.6, 0.2, 1.0), 0.3, bubble);
    // The drink reaches into the glass, which hides a part of it.
    add_ball(&mut scene, DVec3::new(2.6, 0.2, 1.0), 0.5, drink);
    add_ball(&mut scene, DVec3::new(-1.5, 1.8, 1.0), 0.4, lamp);
    (scene, Camera::look_at(Vec3::new(0.4, 0.8, 3.9), Vec3::new(0.4, 0.0, 0.0), Vec3::Y, 0.8))
}

#[test]
fn the_batched_renderer_agrees_with_the_textbook_in_media() {
    let (scene, camera) = everything();
    for max_depth in [0, 1, 12] {
        let settings = Settings { size: [20, 16], spp: 4, max_depth, ..Settings::default() };
        let compiled = CompiledScene::new(&scene, &settings.build).expect("a valid scene");
        let image = Job::new(&compiled, &camera, &settings).run(2, &|_| true).0.image();
        for (i, expected) in ray_cast(&compiled, &camera, &settings).iter().enumerate() {
            for c in 0..3 {
                let (a, b) = (image.layers[0].values[i * 4 + c], expected.to_array()[c]);
                assert!(
                    (a - b).abs() <= 1e-5 * b.abs().max(1.0),
                    "depth {max_depth} pixel {i}: {a} {b}"
                );
            }
        }
    }
}

#[test]
fn threads_and_passes_change_no_bit_of_media() {
    let (scene, camera) = everything();
    let picture = |threads, progressive, size| {
        let crop = Some(crate::Crop { min: [3, 2], max: [36, 25] });
        let settings = Settings { size, spp: 20, progressive, crop, ..Settings::default() };
        let compiled = CompiledScene::new(&scene, &settings.build).expect("a valid scene");
        let image = Job::new(&compiled, &camera, &settings).run(threads, &|_| true).0.image();
        image.layers[0].values.iter().map(|x| x.to_bits()).collect::<Vec<u32>>()
    };
    let expected = picture(1, false, [40, 30]);
    for (threads, progressive) in [(4, false), (3, true)] {
        assert!(
            picture(threads, progressive, [40, 30]) == expected,
            "{threads} threads, progressive {progressive}"
        );
    }
}

#[test]
fn strategies_agree_on_light_in_media() {
    let (scene, camera) = everything();
    // Light directly from smooth glass can be found by one strategy only and is noisy in all, so it
    // is left out.
    let estimate = |light_strategy, seed| {
        let settings = Settings {
            size: [10, 8],
            spp: 64,
            light_strategy,
            seed,
            max_depth: 6,
            ..Settings::default()
        };
        render(&scene, &camera, &settings)
    };
    let runs = |strategy| (0..4).map(|seed| estimate(strategy, seed)).collect::<Vec<_>>();
    let all = [LightStrategy::Mis, LightStrategy::Light, LightStrategy::Bsdf].map(runs);
    // The mean of the picture for each run.
    let of = |runs: &Vec<Vec<[f64; 3]>>| {
        let means: Vec<[f64; 3]> = runs.iter().map(|r| mean(r).map(|(m, _)| m)).collect();
        mean(&means)
    };
    let [mis, light, bsdf] = [of(&all[0]), of(&all[1]), of(&all[2])];
    for c in 0..3 {
        for (other, name) in [(light[c], "light"), (bsdf[c], "bsdf")] {
            let z = (mis[c].0 - other.0) / (mis[c].1.hypot(other.1) + 1e-4 * mis[c].0);
            assert!(z.abs() < 5.0, "channel {c}: mis {:?}, {name} {other:?}", mis[c]);
        }
    }
}

#[test]
fn a_point_light_in_fog_has_the_closed_form_of_its_halo_in_the_limit_of_thin_fog() {
    // Expected: single scattering in isotropic fog so thin that it hardly absorbs, sigma_s I / (4
    // pi) times the angle divided by the distance to the ray.
    let mut scene = Scene::new("halo");
    let fog = Homogeneous::scattering(Rgb::splat(1e-4), Rgb::WHITE, 0.0);
    scene.medium = Some(scene.add_medium(fog));
    let position = DVec3::new(0.5, 0.0, 0.0);
    let attenuation = Attenuation::INVERSE_SQUARE;
    scene.add_light(Point {
        position,
        intensity: Rgb::splat(4e4 * PI as f32),
        attenuation,
        body_radius: 0.0,
    });
    // A wall at z = -2 ends the rays.
    let wall = scene.add_material(Material::new("wall", snell_scene::material::Black {}));
    add_box(&mut scene, DVec3::new(-9.0, -9.0, -3.0), DVec3::new(9.0, 9.0, -2.0), wall);
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 1e-3);
    let settings =
        Settings { integrator: IntegratorKind::Direct, size: [32, 32], ..settings(1024) };
    let angle = 2.0 * (2.0f64 / 0.5).atan();
    // Nearly all rays pass, so the noise is that of the few that do not.
    for (mean, error) in mean(&render(&scene, &camera, &settings)) {
        assert!(
            (mean - angle / 0.5).abs() < 4.0 * error + 1e-3 * mean,
            "{mean} +- {error} is not {}",
            angle / 0.5
        );
    }
}

#[test]
fn a_lamp_in_fog_looks_the_same_with_less_noise_where_distances_are_drawn_near_it() {
    // Height fog without a scale height has the same density everywhere, but its distances are
    // sampled without equiangular sampling.
    let (sigma_a, sigma_s, g) = (Rgb::splat(0.01), Rgb::new(0.05, 0.06, 0.1), 0.3);
    let plain =
        HeightFog { sigma_a, sigma_s, g, base: DVec3::ZERO, up: DVec3::Y, scale_height: 0.0 };
    let media =
        [Medium::from(Homogeneous { sigma_a, sigma_s, emission: Rgb::BLACK, g }), plain.into()];
    let lamp = |scene: &mut Scene, is_ball: bool| {
        let position = DVec3::new(0.1, 0.0, -1.0);
        if is_ball {
            let mut glowing = Material::new("lamp", snell_scene::material::Black {});
            glowing.emission = Rgb::splat(800.0).into();
            let glowing = scene.add_material(glowing);
            add_ball(scene, position, 0.04, glowing);
        } else {
            let (intensity, attenuation) = (Rgb::splat(4.0), Attenuation::INVERSE_SQUARE);
            scene.add_light(Point { position, intensity, attenuation, body_radius: 0.0 });
        }
    };
    for (is_ball, max_depth) in [(false, 1), (true, 1), (false, 4), (true, 4)] {
        let [near, plain] = media.clone().map(|medium| {
            let mut scene = Scene::new("lamp in fog");
            scene.medium = Some(scene.add_medium(medium));
            lamp(&mut scene, is_ball);
            let wall = scene.add_material(Material::new("wall", Diffuse::new(Rgb::splat(0.05))));
            add_box(&mut scene, DVec3::new(-9.0, -9.0, -4.0), DVec3::new(9.0, 9.0, -3.0), wall);
            let camera = Camera::look_at(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, Vec3::Y, 1e-4);
            mean(&render(&scene, &camera, &Settings { max_depth, size: [64, 64], ..settings(256) }))
        });
        for c in 0..3 {
            let ((a, error_a), (b, error_b)) = (near[c], plain[c]);
            assert!(
                (a - b).abs() < 4.5 * error_a.hypot(error_b),
                "channel {c}: {near:?} {plain:?}"
            );
            // Where light is scattered again, a part of the noise comes from the later scatterings.
            let gain = if max_depth == 1 { 3.0 } else { 2.0 };
            assert!(error_a * gain < error_b, "channel {c}: {near:?} {plain:?}");
        }
    }
}

/// A scene of two balls of radius 1 around `x = -0.5` and `x = 0.5`, seen along x.
fn overlapping(priorities: [i32; 2], eye: f32) -> (Scene, Camera) {
    let mut scene = Scene::new("overlap");
    sky(&mut scene, Rgb::WHITE);
    for (x, sigma_a, priority) in [(-0.5, 1.0, priorities[0]), (0.5, 0.25, priorities[1])] {
        let material = around(&mut scene, Homogeneous::absorbing(Rgb::splat(sigma_a)));
        scene.materials[material.index()].interior.as_mut().expect("an inside").priority = priority;
        add_ball(&mut scene, DVec3::new(x, 0.0, 0.0), 1.0, material);
    }
    (scene, Camera::look_at(Vec3::new(eye, 0.0, 0.0), Vec3::new(99.0, 0.0, 0.0), Vec3::Y, 1e-4))
}

#[test]
fn where_media_overlap_the_higher_priority_is_there_or_the_one_entered_last() {
    // From x = -1.5 to -0.5 only the first ball fills the space, up to 0.5 both do, and up to 1.5
    // only the second.
    for (priorities, eye, thickness) in [
        ([0, 0], -3.0, 1.0 + 0.25 + 0.25),
        ([1, 0], -3.0, 1.0 + 1.0 + 0.25),
        ([0, 1], -3.0, 1.0 + 0.25 + 0.25),
        // The camera is inside one ball, inside both, or on the way out.
        ([1, 0], -1.0, 0.5 + 1.0 + 0.25),
        ([1, 0], 0.0, 0.5 + 0.25),
        ([0, 1], 0.0, 0.125 + 0.25),
        ([1, 0], 1.0, 0.125),
    ] {
        let (scene, camera) = overlapping(priorities, eye);
        let expected = f64::exp(-thickness);
        for pixel in render(&scene, &camera, &settings(1)) {
            assert!(
                (pixel[0] - expected).abs() < 1e-4,
                "{priorities:?} from {eye}: {pixel:?} is not {expected}"
            );
        }
    }
}

#[test]
fn a_furnace_shows_nothing_in_spectral_colours_either() {
    let chromatic = Rgb::new(0.3, 1.0, 3.0);
    let fog = Homogeneous { sigma_a: Rgb::BLACK, sigma_s: chromatic, emission: Rgb::BLACK, g: 0.5 };
    for medium in [Medium::from(fog), puff(Rgb::BLACK, chromatic, 0.2).into()] {
        let mut scene = Scene::new("furnace");
        sky(&mut scene, Rgb::splat(0.5));
        let material = around(&mut scene, medium);
        add_ball(&mut scene, DVec3::ZERO, 1.0, material);
        let settings =
            Settings { size: [8, 8], color: snell_math::ColorModel::Spectral, ..settings(64) };
        for (mean, error) in mean(&render(&scene, &camera(5.0), &settings)) {
            assert!((mean - 0.5).abs() <= 4.0 * error + 2e-3, "{mean} +- {error}");
        }
    }
}

#[test]
fn wild_media_end_soon_in_finite_pixels() {
    let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e30, 1e-30];
    let mut media: Vec<Medium> = Medium::examples();
    for x in wild {
        let color = Rgb::new(x, 1.0, 0.5);
        media.push(Homogeneous { sigma_a: color, sigma_s: color, emission: color, g: x }.into());
        media.push(Grid { emission: color, ..puff(color, color, x) }.into());
        media.push(
            Grid {
                world_from_grid: DAffine3::from_scale(DVec3::splat(f64::from(x))),
                ..puff(color, color, x)
            }
            .into(),
        );
        let up = DVec3::new(f64::from(x), 1.0, 0.0);
        let fog = HeightFog {
            sigma_a: color,
            sigma_s: color,
            g: x,
            base: up,
            up,
            scale_height: f64::from(x),
        };
        media.push(fog.into());
    }
    for medium in media {
        for is_everywhere in [false, true] {
            let mut scene = Scene::new("wild");
            sky(&mut scene, Rgb::WHITE);
            if is_everywhere {
                scene.medium = Some(scene.add_medium(medium.clone()));
            } else {
                let material = around(&mut scene, medium.clone());
                add_ball(&mut scene, DVec3::ZERO, 1.0, material);
            }
            let position = DVec3::new(0.0, 3.0, 0.0);
            let attenuation = Attenuation::INVERSE_SQUARE;
            scene.add_light(Point {
                position,
                intensity: Rgb::WHITE,
                attenuation,
                body_radius: 0.0,
            });
            let settings = Settings { size: [3, 3], max_depth: 20, ..settings(2) };
            for pixel in render(&scene, &camera(4.0), &settings) {
                assert!(pixel.iter().all(|x| x.is_finite() && *x >= 0.0), "{medium:?}: {pixel:?}");
            }
        }
    }
}
