//! The Cornell box as Mitsuba 3 renders it: absolute radiance of another renderer, with known
//! noise.

use serde_json::Value;
use snell_formats::image::read_image;
use snell_formats::{Input, ReadOptions, read_scene_bytes};
use snell_render::{Filter, IntegratorKind, Settings};
use snell_scene::Scene;
use snell_tests::statistics::image_mean;
use snell_tests::{colors, render, shared_data};
use std::path::Path;

/// The XML of an object of Mitsuba's scene dictionary.
fn xml(name: &str, object: &Value) -> String {
    let kind = object["type"].as_str().expect("a type");
    let list = |values: &Value| {
        values
            .as_array()
            .expect("a list")
            .iter()
            .map(Value::to_string)
            .collect::<Vec<_>>()
            .join(" ")
    };
    let tag = match kind {
        "scene" => "scene",
        "path" => "integrator",
        "perspective" => "sensor",
        "hdrfilm" => "film",
        "box" => "rfilter",
        "diffuse" => "bsdf",
        "area" => "emitter",
        "rgb" => return format!("<rgb name=\"{name}\" value=\"{}\"/>", list(&object["value"])),
        "ref" => return format!("<ref id={}/>", object["id"]),
        _ => "shape",
    };
    let mut members = String::new();
    for (key, value) in
        object.as_object().expect("a dictionary").iter().filter(|(key, _)| *key != "type")
    {
        members += &match value {
            Value::Number(n) if n.is_f64() => format!("<float name=\"{key}\" value=\"{n}\"/>"),
            Value::Number(n) => format!("<integer name=\"{key}\" value=\"{n}\"/>"),
            Value::String(text) => format!("<string name=\"{key}\" value=\"{text}\"/>"),
            Value::Object(map) if map.contains_key("matrix_row_major") => {
                let rows: Vec<_> =
                    map["matrix_row_major"].as_array().expect("rows").iter().map(list).collect();
                format!(
                    "<transform name=\"{key}\"><matrix value=\"{}\"/></transform>",
                    rows.join(" ")
                )
            }
            Value::Object(_) => xml(key, value),
            _ => panic!("{key} of {name}"),
        };
    }
    match tag {
        "scene" => format!("<scene version=\"3.9.1\">{members}</scene>"),
        _ => format!("<{tag} type=\"{kind}\" id=\"{name}\">{members}</{tag}>"),
    }
}

/// The scene of Mitsuba's dictionary, read as the equivalent file.
fn scene(description: &Value) -> Scene {
    let text = xml("scene", description).into_bytes();
    let scene = read_scene_bytes("cbox.xml", text, Path::new("."), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    scene
}

/// Linear colours of a reference, reduced to `size` by averaging squares of pixels.
fn reference(name: &str, size: usize) -> Option<Vec<[f64; 3]>> {
    let input =
        Input::open(&shared_data(name)?, &ReadOptions::default()).expect("the file can be read");
    let image = read_image(&input).expect("the image is fine");
    assert_eq!((image.width, image.height), (256, 256));
    let step = 256 / size;
    let block = |i: usize| {
        let mut sum = [0.0; 3];
        for (x, y) in
            (0..step * step).map(|k| (i % size * step + k % step, i / size * step + k / step))
        {
            let [r, g, b, _] = image.rgba(x as u32, y as u32);
            sum = [sum[0] + f64::from(r), sum[1] + f64::from(g), sum[2] + f64::from(b)];
        }
        sum.map(|s| s / (step * step) as f64)
    };
    Some((0..size * size).map(block).collect())
}

/// Width and height in pixels of the pictures compared.
const SIZE: usize = 64;

fn check(integrator: IntegratorKind, name: &str, spp: u32) {
    let Some(path) = shared_data("mitsuba-cbox/cbox.json") else { return };
    let Some(expected) = reference(name, SIZE) else { return };
    let text = std::fs::read_to_string(path).expect("the file can be read");
    let scene = scene(&serde_json::from_str(&text).expect("JSON"));
    let size = [SIZE as u32; 2];
    let settings = Settings { size, spp, integrator, filter: Filter::Box, ..Settings::default() };
    let film = render(&scene, &scene.cameras[0], &settings);
    for (c, found) in image_mean(&film).iter().enumerate() {
        let mean = expected.iter().map(|e| e[c]).sum::<f64>() / expected.len() as f64;
        let ratio = found.mean / mean;
        eprintln!(
            "{name} channel {c}: {:.5} +- {:.5}, Mitsuba {mean:.5}, ratio {ratio:.4}",
            found.mean, found.error
        );
        assert!((ratio - 1.0).abs() < 0.005, "{name} channel {c}: {ratio}");
    }
    let relative = |a: f64, b: f64| (a - b).powi(2) / (b * b + 0.01);
    let found = colors(&film.image());
    let errors: Vec<f64> = found
        .iter()
        .zip(&expected)
        .flat_map(|(a, b)| [0, 1, 2].map(|c| relative(a[c], b[c])))
        .collect();
    let by_pixel = errors.iter().sum::<f64>() / errors.len() as f64;
    // Means of 8 x 8 pixels are compared: there noise averages out, but incorrect light does not.
    let squares = |values: &[[f64; 3]]| -> Vec<[f64; 3]> {
        let mut sums = vec![[0.0; 3]; SIZE * SIZE / 64];
        for (i, value) in values.iter().enumerate() {
            let sum = &mut sums[i / SIZE / 8 * (SIZE / 8) + i % SIZE / 8];
            *sum = [0, 1, 2].map(|c| sum[c] + value[c] / 64.0);
        }
        sums
    };
    let (a, b) = (squares(&found), squares(&expected));
    let errors: Vec<f64> =
        a.iter().zip(&b).flat_map(|(a, b)| [0, 1, 2].map(|c| relative(a[c], b[c]))).collect();
    let by_square = errors.iter().sum::<f64>() / errors.len() as f64;
    let largest = errors.iter().fold(0.0f64, |m, &e| m.max(e)).sqrt();
    eprintln!(
        "{name}: relative MSE {by_pixel:.5}, of 8 x 8 pixels {by_square:.6}, largest {:.2} %",
        largest * 100.0
    );
    assert!(by_square < 1e-4, "{name}: {by_square}");
    assert!(largest < 0.05, "{name}: {largest}");
}

#[test]
fn global_illumination_of_the_cornell_box_equals_that_of_mitsuba() {
    check(IntegratorKind::Path, "mitsuba-cbox/cbox-path.exr", 96);
}

#[test]
fn direct_light_in_the_cornell_box_equals_that_of_mitsuba() {
    check(IntegratorKind::Direct, "mitsuba-cbox/cbox-direct.exr", 96);
}
