//! Princeton `.scn` scenes are compared with the pictures of a student's program of 2012: geometry,
//! cameras, Phong shading and shadows are the same.
//!
//! The pictures hold sRGB display values of 8 bits, with one sample per pixel at its lower left
//! corner. Pictures of effects that the program simplifies are left out: straight light through
//! glass, shadows of objects beyond a lamp, area lights that are points.

use snell_formats::image::compare::LinearImage;
use snell_formats::image::{Display, display_value, read_image};
use snell_formats::{Input, ReadOptions, read_scene};
use snell_render::{IntegratorKind, Settings, Shadows};
use snell_scene::framing::{FramingOptions, prepare};
use snell_tests::{render, shared_data};
use std::path::Path;

/// Width and height of the pictures in pixels.
const SIZE: u32 = 256;

/// The difference between two pictures.
struct Difference {
    /// Mean absolute difference of all values, in levels of 255.
    mean: f64,
    /// Share of pixels with a channel that differs by more than 16 levels.
    far: f64,
}

/// Display values from 0 to 255.
fn shown(image: &LinearImage) -> impl Iterator<Item = [f32; 3]> {
    image.pixels.iter().map(|p| display_value(*p, &Display::default()).map(|v| v * 255.0))
}

fn difference(scene: &Path, reference: &Path, settings: &Settings) -> Difference {
    let mut scene = read_scene(scene, &ReadOptions::default()).expect("the scene is fine");
    prepare(&mut scene, &FramingOptions { size: settings.size, ..FramingOptions::default() })
        .expect("no cycles");
    let picture = render(&scene, &scene.cameras[0], settings).image();
    let picture = LinearImage::from_layer(&picture, &picture.layers[0]);
    let reference = Input::open(reference, &ReadOptions::default()).expect("the file can be read");
    let reference = LinearImage::from_image(&read_image(&reference).expect("the image is fine"));
    assert_eq!((reference.width, reference.height), (SIZE, SIZE));
    let levels =
        shown(&picture).zip(shown(&reference)).map(|(a, b)| [0, 1, 2].map(|c| (a[c] - b[c]).abs()));
    let (mut sum, mut far) = (0.0, 0.0);
    for pixel in levels {
        sum += pixel.iter().map(|d| f64::from(*d)).sum::<f64>() / 3.0;
        far += f64::from(u8::from(pixel.iter().any(|d| *d > 16.0)));
    }
    let pixels = f64::from(SIZE * SIZE);
    Difference { mean: sum / pixels, far: far / pixels }
}

/// Renders each scene and compares it with its picture of this kind.
fn check(scenes: &[&str], kind: &str, shadows: Shadows, max_depth: u32) {
    let settings = Settings {
        size: [SIZE, SIZE],
        spp: 1,
        pixel_position: Some([0.0, 1.0]),
        integrator: IntegratorKind::Whitted,
        shadows,
        max_depth,
        ..Settings::default()
    };
    let mut failed = Vec::new();
    for name in scenes {
        let Some(scene) = shared_data(&format!("scn/scenes/{name}.scn")) else { return };
        let Some(reference) = shared_data(&format!("scn/ref/{name}.student2012-{kind}.png")) else {
            return;
        };
        let Difference { mean, far } = difference(&scene, &reference, &settings);
        eprintln!("{name} {kind}: mean {mean:.3} levels, {:.2} % over 16", far * 100.0);
        if mean >= 1.0 || far >= 0.02 {
            failed.push(*name);
        }
    }
    assert!(failed.is_empty(), "too far from the references: {failed:?}");
}

#[test]
fn phong_shading_without_shadows_is_that_of_the_student_program() {
    let scenes = [
        "box",
        "cornell",
        "cylinder",
        "dirlight1",
        "dirlight2",
        "fourspheres",
        "glass_spheres",
        "ico",
        "lights",
        "pointlight1",
        "pointlight2",
        "refraction",
        "shininess",
        "specular",
        "sphere",
        "spotlight1",
        "spotlight2",
        "stack",
        "teapot",
        "transform",
        "transmission",
    ];
    check(&scenes, "phong-depth0", Shadows::None, 0);
}

#[test]
fn hard_shadows_and_mirrors_are_those_of_the_student_program() {
    let scenes = [
        "box",
        "cylinder",
        "dirlight1",
        "dirlight2",
        "fourspheres",
        "ico",
        "pointlight1",
        "pointlight2",
        "shininess",
        "specular",
        "sphere",
        "spotlight1",
        "transform",
    ];
    check(&scenes, "shadow-depth2", Shadows::Hard, 2);
}
