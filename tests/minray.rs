//! Heckbert's business card ray tracer: `whitted` gives the picture that the original program
//! prints.

use snell_formats::{ReadOptions, read_scene};
use snell_render::{CompiledScene, IntegratorKind, Job, Settings, reference};
use snell_scene::{Scene, builtin::builtin};
use snell_tests::{colors, render, shared_data};

/// The settings of the original program, as the scene specifies them.
fn settings(scene: &Scene) -> Settings {
    let asked = &scene.settings;
    assert_eq!(asked.integrator.as_deref(), Some("whitted"));
    Settings {
        size: asked.size.expect("the scene says its size"),
        spp: asked.spp.expect("one sample"),
        pixel_position: asked.pixel_position,
        integrator: IntegratorKind::Whitted,
        max_depth: asked.max_depth.expect("the scene says its depth"),
        ..Settings::default()
    }
}

/// The colours of an `.ap` file, which holds `width height`, then `r g b` per pixel, where 255 is
/// 1.
fn read_ap(text: &str) -> Vec<[f64; 3]> {
    let numbers: Vec<f64> = text.split_whitespace().map(|w| w.parse().expect("a number")).collect();
    assert_eq!((numbers[0], numbers[1]), (32.0, 32.0));
    numbers[2..].chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

/// The share of pixels within `tolerance` levels of 255, and the largest difference.
fn agreement(
    rendered: &[[f64; 3]],
    reference: &[[f64; 3]],
    levels: impl Fn(f64) -> f64,
    tolerance: f64,
) -> (f64, f64) {
    assert_eq!(rendered.len(), reference.len());
    let difference = |(a, b): (&[f64; 3], &[f64; 3])| {
        (0..3).map(|c| (levels(a[c] * 255.0) - b[c]).abs()).fold(0.0, f64::max)
    };
    let differences: Vec<f64> = rendered.iter().zip(reference).map(difference).collect();
    let equal = differences.iter().filter(|&&d| d <= tolerance).count() as f64;
    (equal / differences.len() as f64, differences.iter().fold(0.0, |a, &d| a.max(d)))
}

#[test]
fn the_picture_equals_the_output_of_the_original_program() {
    let Some(path) = shared_data("minray/test1.rounded.ap") else { return };
    let reference = read_ap(&std::fs::read_to_string(path).expect("the file can be read"));
    let scene = builtin("minray").expect("the scene is built in");
    let picture = colors(&render(&scene, &scene.cameras[0], &settings(&scene)).image());
    let (equal, _) = agreement(&picture, &reference, f64::round, 0.0);
    let (within_one, largest) = agreement(&picture, &reference, f64::round, 1.0);
    eprintln!(
        "equal {:.2} %, within one level {:.2} %, largest difference {largest}",
        equal * 100.0,
        within_one * 100.0
    );
    assert!(within_one == 1.0 && equal >= 0.99, "{equal} {within_one} {largest}");
}

#[test]
fn the_picture_is_within_a_level_of_the_posting_of_1987() {
    // The program in the posting of 1987 truncated fractions instead of rounding them.
    let Some(path) = shared_data("minray/test1.heckbert1987.ap") else { return };
    let reference = read_ap(&std::fs::read_to_string(path).expect("the file can be read"));
    let scene = builtin("minray").expect("the scene is built in");
    let picture = colors(&render(&scene, &scene.cameras[0], &settings(&scene)).image());
    let (equal, largest) = agreement(&picture, &reference, f64::floor, 1.0);
    eprintln!("within one level {:.2} %, largest difference {largest}", equal * 100.0);
    assert_eq!(equal, 1.0, "largest difference {largest}");
}

#[test]
fn the_scene_file_gives_the_same_picture_as_the_built_in_scene() {
    let Some(path) = shared_data("minray/test1.json") else { return };
    let read = read_scene(&path, &ReadOptions::default()).expect("the file is fine");
    let built_in = builtin("minray").expect("the scene is built in");
    let [a, b] =
        [read, built_in].map(|scene| render(&scene, &scene.cameras[0], &settings(&scene)).image());
    assert_eq!(a, b);
}

#[test]
fn the_textbook_renderer_gives_the_same_picture() {
    let scene = builtin("minray").expect("the scene is built in");
    let settings = settings(&scene);
    let compiled = CompiledScene::new(&scene, &settings.build).expect("the scene compiles");
    let textbook = reference::ray_cast(&compiled, &scene.cameras[0], &settings);
    let (film, _) = Job::new(&compiled, &scene.cameras[0], &settings).run(1, &|_| true);
    for (i, (a, b)) in colors(&film.image()).iter().zip(&textbook).enumerate() {
        let largest = (0..3).map(|c| (a[c] - f64::from(b.to_array()[c])).abs()).fold(0.0, f64::max);
        assert!(largest < 1e-6, "pixel {i}: {a:?} {b:?}");
    }
}
