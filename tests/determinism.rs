//! Renders give the same bits for any number of threads, order of tiles, passes, crops, instruction
//! set and accelerator.

use snell_intersect::AcceleratorKind;
use snell_intersect::BuildOptions;
use snell_intersect::shape::Sphere;
use snell_math::simd::Level;
use snell_math::{DVec3, Rgb, Vec3};
use snell_render::{
    Aov, CompiledScene, Crop, Film, Filter, IntegratorKind, LightSamplerKind, LightStrategy,
    SamplerKind, Settings, Shadows, TileOrder,
};
use snell_scene::light::Directional;
use snell_scene::material::Phong;
use snell_scene::{Camera, LayeredImage, Material, Scene};
use snell_tests::scenes::{at, everything, put};
use snell_tests::statistics::compare;
use snell_tests::{bits, render_compiled};

/// Settings with odd sizes, a sample count that is not a multiple of a block, and all extra layers.
fn settings() -> Settings {
    Settings {
        size: [37, 29],
        spp: 18,
        seed: 7,
        max_depth: 6,
        aovs: Aov::ALL.to_vec(),
        ..Settings::default()
    }
}

/// Variants of [`settings`], each with one difference in a setting that changes the picture.
fn variants() -> Vec<(String, Settings)> {
    let mut all = Vec::new();
    let mut add = |name: &str, settings: Settings| all.push((name.to_string(), settings));
    for integrator in IntegratorKind::ALL {
        add(integrator.name(), Settings { integrator, ..settings() });
    }
    for sampler in SamplerKind::ALL {
        add(sampler.name(), Settings { sampler, ..settings() });
    }
    for filter in Filter::ALL {
        add(filter.name(), Settings { filter, ..settings() });
    }
    for light_strategy in LightStrategy::ALL {
        add(light_strategy.name(), Settings { light_strategy, ..settings() });
    }
    for shadows in Shadows::ALL {
        add(
            shadows.name(),
            Settings { shadows, integrator: IntegratorKind::Whitted, ..settings() },
        );
    }
    add("uniform lights", Settings { light_sampler: LightSamplerKind::Uniform, ..settings() });
    all
}

/// Picture and variance of a film.
fn all_bits(film: &Film) -> Vec<u32> {
    [bits(&film.image()), bits(&film.variance())].concat()
}

fn compiled() -> (CompiledScene, Camera) {
    let (scene, camera) = everything();
    (CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles"), camera)
}

#[test]
fn threads_order_and_passes_do_not_change_a_bit() {
    let (scene, camera) = compiled();
    for (name, settings) in variants() {
        let expected = all_bits(&render_compiled(&scene, &camera, &settings, 1));
        for (threads, tile_order, progressive) in [
            (2, TileOrder::Rows, false),
            (3, TileOrder::Reversed, true),
            (4, TileOrder::Shuffled(3), false),
            (1, TileOrder::Shuffled(4), true),
        ] {
            let other = Settings { tile_order, progressive, ..settings.clone() };
            let film = render_compiled(&scene, &camera, &other, threads);
            assert!(
                all_bits(&film) == expected,
                "{name}, {threads} threads, {tile_order:?}, progressive {progressive}"
            );
        }
    }
}

/// Renders the picture in pieces and joins them.
fn assembled(scene: &CompiledScene, camera: &Camera, settings: &Settings) -> LayeredImage {
    let [width, height] = settings.size;
    let columns = [0, 1, 14, 33, width];
    let rows = [0, 13, 16, height];
    let mut whole = Film::new(Crop::full(settings.size), &settings.aovs).image();
    for x in columns.windows(2) {
        for y in rows.windows(2) {
            let crop = Crop { min: [x[0], y[0]], max: [x[1], y[1]] };
            let part = Settings { crop: Some(crop), ..settings.clone() };
            let part = render_compiled(scene, camera, &part, 2).image();
            assert_eq!([part.width, part.height], crop.size());
            paste(&mut whole, &part, crop.min);
        }
    }
    whole
}

fn paste(whole: &mut LayeredImage, part: &LayeredImage, [x0, y0]: [u32; 2]) {
    for (to, from) in whole.layers.iter_mut().zip(&part.layers) {
        let row = part.width as usize * to.channels.len();
        for y in 0..part.height as usize {
            let start =
                ((y + y0 as usize) * whole.width as usize + x0 as usize) * to.channels.len();
            to.values[start..start + row].copy_from_slice(&from.values[y * row..(y + 1) * row]);
        }
    }
}

#[test]
fn crops_add_up_to_the_whole_picture() {
    let (scene, camera) = compiled();
    for (name, settings) in variants() {
        let whole = render_compiled(&scene, &camera, &settings, 2).image();
        assert!(assembled(&scene, &camera, &settings) == whole, "{name}");
    }
}

/// Nested balls whose surfaces all reflect and refract: ray trees with far more rays than pixels
/// have samples.
fn onion() -> (Scene, Camera) {
    let mut scene = Scene::new("onion");
    let grey = |x| Rgb::splat(x).into();
    for (i, ior) in [1.1, 0.9, 1.2, 1.05].into_iter().enumerate() {
        let kind = Phong {
            ambient: grey(0.3),
            reflection: grey(0.6),
            transmission: grey(0.4),
            ior,
            ..Phong::default()
        };
        let material =
            scene.add_material(Material::new("layer", kind).emitting(Rgb::new(0.1, 0.23, 0.37)));
        put(&mut scene, Sphere { radius: 1.0 - 0.2 * i as f64 }, at(0.01, 0.02, 0.0), material);
    }
    let direction = DVec3::new(-0.6, -0.8, 0.0);
    scene.add_light(Directional { direction, irradiance: Rgb::new(1.0, 0.77, 0.3) });
    scene.ambient = Rgb::splat(0.1);
    (scene, Camera::look_at(Vec3::new(0.0, 0.1, 0.05), Vec3::NEG_Z, Vec3::Y, 0.5))
}

#[test]
fn ray_trees_with_more_rays_than_a_batch_holds_do_not_change_a_bit() {
    let (scene, camera) = onion();
    let scene = CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles");
    let integrator = IntegratorKind::Whitted;
    let settings =
        Settings { size: [16, 16], spp: 16, integrator, max_depth: 6, ..Settings::default() };
    let whole = render_compiled(&scene, &camera, &settings, 1);
    let progressive = Settings { progressive: true, ..settings.clone() };
    assert!(
        all_bits(&render_compiled(&scene, &camera, &progressive, 2)) == all_bits(&whole),
        "passes"
    );
    let crops = [[[0, 0], [5, 16]], [[5, 0], [16, 16]]];
    let mut pasted = Film::new(Crop::full(settings.size), &[]).image();
    for [min, max] in crops {
        let part = Settings { crop: Some(Crop { min, max }), ..settings.clone() };
        paste(&mut pasted, &render_compiled(&scene, &camera, &part, 1).image(), min);
    }
    assert!(bits(&pasted) == bits(&whole.image()), "crops");
}

#[test]
fn instructions_and_accelerators_do_not_change_a_bit() {
    let (scene, camera) = everything();
    // Layers that count the work of an accelerator are left out, because the counts differ.
    let aovs: Vec<Aov> = Aov::ALL.into_iter().filter(|a| !a.needs_counters()).collect();
    let levels: Vec<Level> = Level::ALL.into_iter().filter(|l| l.is_supported()).collect();
    for integrator in IntegratorKind::ALL {
        let settings = Settings { integrator, spp: 5, aovs: aovs.clone(), ..settings() };
        let mut expected = None;
        for &simd in &levels {
            let kinds = AcceleratorKind::ALL.map(|accelerator| (accelerator, false));
            for (accelerator, compact) in kinds.into_iter().chain([(AcceleratorKind::Bvh, true)]) {
                let build = BuildOptions { accelerator, compact, simd, ..BuildOptions::default() };
                let compiled = CompiledScene::new(&scene, &build).expect("the scene compiles");
                let found = all_bits(&render_compiled(&compiled, &camera, &settings, 2));
                let expected = expected.get_or_insert_with(|| found.clone());
                assert!(
                    *expected == found,
                    "{} {accelerator:?} (compact: {compact}) {simd}",
                    integrator.name()
                );
            }
        }
    }
}

#[test]
fn seeds_change_the_noise_and_nothing_else() {
    let (scene, camera) = compiled();
    let [a, b] =
        [1, 2].map(|seed| render_compiled(&scene, &camera, &Settings { seed, ..settings() }, 2));
    assert!(bits(&a.image()) != bits(&b.image()));
    compare(&a, &b).check("two seeds");
}
