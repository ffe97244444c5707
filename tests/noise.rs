//! Adaptive sampling is correct: the interval covers the truth as often as stated, and the bits do
//! not depend on threads or order.

use snell_intersect::BuildOptions;
use snell_render::film::noise::NoiseMap;
use snell_render::{Aov, CompiledScene, Crop, Job, SamplerKind, Settings, TileOrder};
use snell_scene::Camera;
use snell_scene::builtin::builtin;
use snell_tests::scenes::everything;
use snell_tests::{bits, render_compiled};

fn cornell_box() -> (CompiledScene, Camera) {
    let mut scene = builtin("cornell-box").expect("the scene is built in");
    let camera = scene.cameras.remove(0);
    (CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles"), camera)
}

/// Number of renders in the long test, of 64 pixels each.
const TRIALS: u32 = 1000;

/// The share of pixels in `trials` renders whose intervals contain the truth, and the mean number
/// of samples.
fn coverage(
    (scene, camera): &(CompiledScene, Camera),
    side: u32,
    noise: f64,
    trials: u32,
    truth_spp: u32,
) -> (f64, f64) {
    let settings =
        Settings { size: [side, side], max_depth: 5, spp: 1 << 16, ..Settings::default() };
    let truth = Settings {
        spp: truth_spp,
        seed: 1_000_000,
        sampler: SamplerKind::Sobol,
        ..settings.clone()
    };
    let truth = NoiseMap::new(&render_compiled(scene, camera, &truth, 4));
    let pixels = (side * side) as usize;
    let (mut covered, mut samples) = (0, 0.0);
    for seed in 0..trials {
        let film = render_compiled(
            scene,
            camera,
            &Settings { noise: Some(noise), seed, ..settings.clone() },
            4,
        );
        let map = NoiseMap::new(&film);
        let holds = |&p: &usize| (map.intensity(p) - truth.intensity(p)).abs() <= map.half_width(p);
        covered += (0..pixels).filter(holds).count();
        samples += film.mean_samples() / f64::from(trials);
        assert!(
            (0..pixels).all(|p| map.error(p, settings.noise_floor) <= noise * 1.000_001),
            "every pixel is as good as asked"
        );
    }
    (covered as f64 / f64::from(trials) / pixels as f64, samples)
}

#[test]
fn the_stated_interval_covers_the_truth_as_often_as_stated() {
    let (share, samples) = coverage(&cornell_box(), 12, 0.2, 12, 4096);
    eprintln!(
        "Cornell box: {:.2} % of the pixels are covered, with {samples:.0} samples",
        share * 100.0
    );
    assert!((0.93..=0.97).contains(&share), "{share}");
}

#[test]
#[ignore = "takes minutes"]
fn the_stated_interval_covers_the_truth_in_a_thousand_trials() {
    let (scene, camera) = everything();
    let everything =
        (CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles"), camera);
    for (name, scene) in [("Cornell box", cornell_box()), ("everything", everything)] {
        for noise in [0.1, 0.2] {
            let (share, samples) = coverage(&scene, 8, noise, TRIALS, 1 << 16);
            eprintln!(
                "{name}, {noise}: {:.2} % of the pixels are covered, with {samples:.0} samples",
                share * 100.0
            );
            assert!((0.93..=0.97).contains(&share), "{name} {noise}: {share}");
        }
    }
}

#[test]
fn threads_order_and_crop_of_tiles_do_not_change_a_bit_of_an_adaptive_render() {
    let (scene, camera) = cornell_box();
    let aovs = vec![Aov::Noise, Aov::Samples, Aov::Depth];
    let settings = Settings {
        size: [40, 36],
        noise: Some(0.3),
        spp: 1000,
        max_depth: 4,
        aovs,
        ..Settings::default()
    };
    let film = render_compiled(&scene, &camera, &settings, 1);
    assert!(film.least_samples() < film.most_samples(), "{} samples", film.most_samples());
    let expected = bits(&film.image());
    for (threads, tile_order) in
        [(2, TileOrder::Rows), (3, TileOrder::Reversed), (4, TileOrder::Shuffled(3))]
    {
        let settings = Settings { tile_order, ..settings.clone() };
        assert_eq!(
            bits(&render_compiled(&scene, &camera, &settings, threads).image()),
            expected,
            "{threads} threads"
        );
    }
}

#[test]
fn caps_hold() {
    let (scene, camera) = cornell_box();
    let settings = Settings {
        size: [20, 20],
        noise: Some(1e-3),
        spp: 100,
        max_depth: 3,
        ..Settings::default()
    };
    let (film, statistics) = Job::new(&scene, &camera, &settings).run(2, &|_| true);
    assert_eq!((film.most_samples(), statistics.is_complete), (100, true));
    assert!(statistics.converged_pixels < 400 && statistics.samples <= 40_000);
    let stopped = Settings { spp: 1 << 20, ..settings.clone() };
    let (film, statistics) =
        Job::new(&scene, &camera, &stopped).run(2, &|p| p.passes == 0 || p.done < 60_000);
    assert!(film.least_samples() >= 1 && !statistics.is_complete && film.most_samples() < 1 << 20);
    let crop =
        Settings { crop: Some(Crop { min: [3, 5], max: [19, 6] }), noise: Some(0.5), ..settings };
    assert_eq!(
        Job::new(&scene, &camera, &crop).run(2, &|_| true).0.image().layers[0].values.len(),
        16 * 4
    );
}
