//! Scenes that are written and read again give the same picture: bit for bit as `.snell`, and up to
//! noise as pbrt.

use snell_formats::{ReadOptions, read_scene, write_scene_as};
use snell_render::Settings;
use snell_scene::Scene;
use snell_scene::builtin::BUILTINS;
use snell_scene::framing::{FramingOptions, prepare};
use snell_tests::{bits, render, settings, shared_data};

/// The scene as it is read after it was written, and the number of losses.
fn round_trip(scene: &Scene, extension: &str) -> (Scene, usize) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(format!("scene.{extension}"));
    let written = write_scene_as(&path, scene, false).unwrap_or_else(|e| panic!("{e}"));
    (
        read_scene(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}")),
        written.losses.len(),
    )
}

fn picture(scene: &Scene) -> Vec<u32> {
    let mut scene = scene.clone();
    prepare(&mut scene, &FramingOptions { size: [24, 24], ..FramingOptions::default() })
        .expect("no cycle");
    let settings: Settings = settings(24, 2);
    bits(&render(&scene, &scene.cameras[0], &settings).image())
}

#[test]
fn every_built_in_scene_has_the_same_picture_after_a_round_trip() {
    for builtin in BUILTINS {
        let scene = (builtin.make)();
        let (again, losses) = round_trip(&scene, "snell");
        assert_eq!(losses, 0, "{}", builtin.name);
        assert!(picture(&again) == picture(&scene), "{}", builtin.name);
    }
}

#[test]
fn scenes_of_pbrt_have_the_same_picture_as_pbrt_again() {
    for name in ["cornell-box", "veach-mis"] {
        let Some(path) = shared_data(&format!("bitterli/{name}/pbrt/scene-v4.pbrt")) else {
            return;
        };
        let scene = read_scene(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let (again, losses) = round_trip(&scene, "pbrt");
        assert_eq!(losses, 0, "{name}");
        let values = |scene| {
            picture(scene).into_iter().map(|b| f64::from(f32::from_bits(b))).collect::<Vec<_>>()
        };
        let (a, b) = (values(&scene), values(&again));
        let sum = |v: &[f64]| v.iter().sum::<f64>();
        // The samples are the same: only numbers that were written as decimals may differ in their
        // last bits.
        let far =
            a.iter().zip(&b).filter(|(x, y)| (*x - *y).abs() > 1e-2 * (1.0 + x.abs())).count();
        assert!(
            far * 20 < a.len() && (sum(&a) / sum(&b) - 1.0).abs() < 0.02,
            "{name}: {far} of {} values",
            a.len()
        );
    }
}
