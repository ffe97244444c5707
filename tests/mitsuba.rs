//! The Cornell box as Mitsuba 3 renders it: absolute radiance of another renderer, noise known.

use serde_json::Value;
use snell_formats::image::read_image;
use snell_formats::{Input, ReadOptions};
use snell_intersect::AnyShape;
use snell_intersect::shape::{BoxShape, Rectangle};
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb};
use snell_render::{Filter, IntegratorKind, Settings};
use snell_scene::camera::{FovAxis, Projection};
use snell_scene::material::Diffuse;
use snell_scene::{Camera, Material, Node, Scene, Surface};
use snell_tests::statistics::image_mean;
use snell_tests::{colors, render, shared_data};

/// Row-major 4 x 4 matrix of a thing's `to_world`.
fn matrix(thing: &Value) -> DAffine3 {
    let entry =
        |row: usize, column: usize| thing["to_world"]["matrix_row_major"][row][column].as_f64().expect("a number");
    let column = |c: usize| DVec3::new(entry(0, c), entry(1, c), entry(2, c));
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

fn rgb(value: &Value) -> Rgb {
    let [r, g, b] = [0, 1, 2].map(|i| value["value"][i].as_f64().expect("a number") as f32);
    Rgb::new(r, g, b)
}

/// The subset of Mitsuba's scene dictionary that the Cornell box needs.
fn scene(description: &Value) -> Scene {
    let mut scene = Scene::new("Mitsuba's Cornell box");
    for (name, thing) in description.as_object().expect("a dictionary") {
        let shape: AnyShape = match thing["type"].as_str() {
            Some("rectangle") => Rectangle { half_size: DVec2::ONE }.into(),
            Some("cube") => BoxShape { min: DVec3::NEG_ONE, max: DVec3::ONE }.into(),
            _ => continue,
        };
        let reflectance = rgb(&description[thing["bsdf"]["id"].as_str().expect("a name")]["reflectance"]);
        let mut material = Material::new(name, Diffuse::new(reflectance));
        if let Some(emitter) = thing.get("emitter") {
            material = material.emitting(rgb(&emitter["radiance"]));
        }
        let material = scene.add_material(material);
        let surfaces = vec![Surface::shape(shape, material)];
        scene.add_child(scene.root, Node { transform: matrix(thing), surfaces, ..Node::named(name) });
    }
    let sensor = &description["sensor"];
    let world_from_sensor = matrix(sensor);
    let fov = sensor["fov"].as_f64().expect("an angle");
    let projection = Projection::from_fov_degrees(fov, FovAxis::Smaller, [256, 256]);
    let DMat3 { y_axis, z_axis, .. } = world_from_sensor.matrix3;
    scene.cameras.push(Camera::from_direction(world_from_sensor.translation, z_axis, y_axis, projection));
    scene
}

/// Linear colours of a reference, reduced to `size` by averaging squares of pixels.
fn reference(name: &str, size: usize) -> Option<Vec<[f64; 3]>> {
    let input = Input::open(&shared_data(name)?, &ReadOptions::default()).expect("the file can be read");
    let image = read_image(&input).expect("the image is fine");
    assert_eq!((image.width, image.height), (256, 256));
    let step = 256 / size;
    let block = |i: usize| {
        let mut sum = [0.0; 3];
        for (x, y) in (0..step * step).map(|k| (i % size * step + k % step, i / size * step + k / step)) {
            let [r, g, b, _] = image.rgba(x as u32, y as u32);
            sum = [sum[0] + f64::from(r), sum[1] + f64::from(g), sum[2] + f64::from(b)];
        }
        sum.map(|s| s / (step * step) as f64)
    };
    Some((0..size * size).map(block).collect())
}

/// Pixels along the sides of the pictures compared.
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
        eprintln!("{name} channel {c}: {:.5} +- {:.5}, Mitsuba {mean:.5}, ratio {ratio:.4}", found.mean, found.error);
        assert!((ratio - 1.0).abs() < 0.005, "{name} channel {c}: {ratio}");
    }
    let relative = |a: f64, b: f64| (a - b).powi(2) / (b * b + 0.01);
    let found = colors(&film.image());
    let errors: Vec<f64> =
        found.iter().zip(&expected).flat_map(|(a, b)| [0, 1, 2].map(|c| relative(a[c], b[c]))).collect();
    let by_pixel = errors.iter().sum::<f64>() / errors.len() as f64;
    // Of squares of 8 x 8 pixels: noise averages out, wrong light does not.
    let squares = |values: &[[f64; 3]]| -> Vec<[f64; 3]> {
        let mut sums = vec![[0.0; 3]; SIZE * SIZE / 64];
        for (i, value) in values.iter().enumerate() {
            let sum = &mut sums[i / SIZE / 8 * (SIZE / 8) + i % SIZE / 8];
            *sum = [0, 1, 2].map(|c| sum[c] + value[c] / 64.0);
        }
        sums
    };
    let (a, b) = (squares(&found), squares(&expected));
    let errors: Vec<f64> = a.iter().zip(&b).flat_map(|(a, b)| [0, 1, 2].map(|c| relative(a[c], b[c]))).collect();
    let by_square = errors.iter().sum::<f64>() / errors.len() as f64;
    let largest = errors.iter().fold(0.0f64, |m, &e| m.max(e)).sqrt();
    eprintln!("{name}: relative MSE {by_pixel:.5}, of 8 x 8 pixels {by_square:.6}, largest {:.2} %", largest * 100.0);
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
