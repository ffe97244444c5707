//! Lights.

use super::*;
use snell_math::DVec3;
use snell_scene::light::{Directional, Point, Spot, SpotFalloff};
use snell_scene::{Environment, Light};

#[test]
fn power_that_is_not_positive_is_ignored_with_a_note() {
    for light in [
        "LightSource \"point\" \"float power\" -3",
        "LightSource \"distant\" \"float illuminance\" -3",
        "AreaLightSource \"diffuse\" \"float power\" -3 Shape \"sphere\"",
    ] {
        let said = warnings(&format!("WorldBegin {light}"));
        assert!(said.contains("-3 of ") && said.contains("was ignored, as in pbrt"), "{said}");
    }
}

#[test]
fn goniometric_lights_take_the_mean_of_their_colours() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = b"PF\n1 1\n-1.0\n".iter().copied();
    let texel = [6.0f32, 3.0, 0.0].map(f32::to_le_bytes).concat();
    std::fs::write(folder.path().join("g.pfm"), picture.chain(texel).collect::<Vec<_>>())
        .expect("written");
    let intensity = |power: &str| {
        let text =
            format!("WorldBegin LightSource \"goniometric\" \"string filename\" \"g.pfm\" {power}");
        let scene =
            testing::read_in(&READER, folder.path(), &text).unwrap_or_else(|e| panic!("{e}"));
        let Light::Profile(profile) = &scene.lights[0] else { panic!("{:?}", scene.lights) };
        profile.table.at(DVec3::Z) * profile.scale
    };
    colors_are(intensity(""), [3.0; 3]);
    let power = 4.0 * std::f32::consts::PI;
    colors_are(intensity(&format!("\"float power\" {power}")), [1.0; 3]);
}

#[test]
fn pictures_of_the_lights_of_version_3_are_stored_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let grey = ::image::RgbImage::from_pixel(2, 1, ::image::Rgb([128; 3]));
    grey.save(folder.path().join("a.png")).expect("written");
    let read = |text: &str| {
        let text = format!("WorldBegin LightSource {text} \"a.png\"");
        testing::read_in(&READER, folder.path(), &text).unwrap_or_else(|e| panic!("{e}"))
    };
    let [stored, decoded] = [128.0 / 255.0, 0.2158605];
    for (name, expected) in [("mapname", stored), ("filename", decoded)] {
        let scene = read(&format!("\"goniometric\" \"string {name}\""));
        let Light::Profile(profile) = &scene.lights[0] else { panic!("{:?}", scene.lights) };
        colors_are(profile.table.at(DVec3::Z) * profile.scale, [expected; 3]);
        let scene = read(&format!("\"projection\" \"string {name}\""));
        let Light::Projector(projector) = &scene.lights[0] else { panic!("{:?}", scene.lights) };
        colors_are(projector.slide.at(DVec3::Z), [expected; 3]);
    }
    let scene = read("\"infinite\" \"string mapname\"");
    let Some(Environment::Image { image, .. }) = &scene.environment else {
        panic!("{:?}", scene.environment)
    };
    assert!(close(image.rgba(0, 0)[0], stored));
}

#[test]
fn goniometric_lights_without_a_picture_shine_evenly() {
    let text = "WorldBegin LightSource \"goniometric\" \"rgb I\" [ 1 2 3 ]";
    let scene = testing::read_text(&READER, text).unwrap_or_else(|e| panic!("{e}"));
    let Light::Profile(profile) = &scene.lights[0] else { panic!("{:?}", scene.lights) };
    for direction in [DVec3::X, DVec3::Y, DVec3::NEG_Z] {
        colors_are(profile.table.at(direction) * profile.scale, [1.0, 2.0, 3.0]);
    }
    assert!(scene.warnings[0].message.contains("it shines evenly"), "{:?}", scene.warnings);
}

#[test]
fn power_in_ply_files_is_that_of_each_face() {
    let folder = tempfile::tempdir().expect("a folder");
    let ply = |faces: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n\
            property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
            0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0\n{faces}"
        )
    };
    let radiance = |faces: &str| {
        std::fs::write(folder.path().join("a.ply"), ply(faces)).expect("written");
        let text = "WorldBegin AreaLightSource \"diffuse\" \"float power\" 1 \
            Shape \"plymesh\" \"string filename\" \"a.ply\"";
        let scene =
            testing::read_in(&READER, folder.path(), text).unwrap_or_else(|e| panic!("{e}"));
        let said: Vec<_> = scene.warnings.iter().map(|w| w.message.clone()).collect();
        (scene.materials[0].emission.factor, said.join("\n"))
    };
    let of_mean = |area: f32| [1.0 / (std::f32::consts::PI * area); 3];
    let (color, said) = radiance("3 0 1 2\n3 0 2 3\n");
    colors_are(color, of_mean(0.5));
    assert_eq!(said, "");
    // A quadrilateral is one light.
    let (color, said) = radiance("4 0 1 2 3\n3 1 4 2\n");
    colors_are(color, of_mean(0.75));
    assert!(said.contains("power\" is that of each bilinear patch"), "{said}");
}

#[test]
fn brightness_means_what_it_means_in_pbrt() {
    let light = |text: &str| world(&format!("LightSource {text}")).lights[0].clone();
    let Light::Point(Point { intensity, .. }) =
        light("\"point\" \"rgb I\" [1 2 3] \"float scale\" 2")
    else {
        panic!("no point")
    };
    colors_are(intensity, [2.0, 4.0, 6.0]);
    let Light::Point(Point { intensity, .. }) = light("\"point\" \"float power\" 100") else {
        panic!("no point")
    };
    colors_are(intensity, [100.0 / (4.0 * std::f32::consts::PI); 3]);
    let Light::Directional(Directional { irradiance, direction }) = light(
        "\"distant\" \"float illuminance\" 50 \"point3 from\" [0 0 0] \"point3 to\" [0 0 -2]",
    ) else {
        panic!("no distant light")
    };
    colors_are(irradiance, [50.0; 3]);
    assert_eq!(direction, DVec3::NEG_Z);
    let Light::Spot(Spot { falloff, position, direction, .. }) =
        light("\"spot\" \"float coneangle\" 40 \"point3 from\" [1 0 0] \"point3 to\" [1 0 5]")
    else {
        panic!("no spot")
    };
    // With the default camera, the world is mirrored in x.
    assert_eq!((position, direction), (DVec3::NEG_X, DVec3::Z));
    assert!(
        (falloff.at(34f64.to_radians().cos()), falloff.at(41f64.to_radians().cos())) == (1.0, 0.0),
        "{falloff:?}"
    );
    assert!(matches!(falloff, SpotFalloff::Step { .. }));
    let old = super::scene("Film \"image\"\nWorldBegin\nLightSource \"spot\"\nWorldEnd");
    let Light::Spot(Spot { falloff, .. }) = &old.lights[0] else { panic!("no spot") };
    assert!(matches!(falloff, SpotFalloff::Fourth { .. }), "{falloff:?}");
    // A black body has luminance 1 whatever its temperature.
    let Light::Point(Point { intensity, .. }) = light("\"point\" \"blackbody I\" 3000") else {
        panic!("no point")
    };
    assert!(
        (intensity.luminance() - 1.0).abs() < 0.02 && intensity.r > 2.0 * intensity.b,
        "{intensity:?}"
    );
}

#[test]
fn area_lights_emit_their_radiance_or_their_power() {
    let emission = |light: &str, shape: &str| {
        let scene = world(&format!("AreaLightSource \"diffuse\" {light} Shape {shape}"));
        let material = material(&scene);
        (material.emission.factor, material.emits_on_both_sides)
    };
    colors_are(emission("\"rgb L\" [4 5 6] \"float scale\" 0.5", "\"sphere\"").0, [2.0, 2.5, 3.0]);
    // The area is 4 pi, and each unit of area emits its radiance times pi.
    let power = 4.0 * std::f32::consts::PI * std::f32::consts::PI;
    colors_are(emission(&format!("\"float power\" {power}"), "\"sphere\"").0, [1.0; 3]);
    let (color, both) =
        emission(&format!("\"float power\" {power} \"bool twosided\" true"), "\"sphere\"");
    colors_are(color, [0.5; 3]);
    assert!(both);
    // Each triangle of a mesh emits the power.
    let square =
        "\"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0] \"integer indices\" [0 1 2 0 2 3]";
    colors_are(emission(&format!("\"float power\" {}", std::f32::consts::PI), square).0, [2.0; 3]);
}

#[test]
fn power_is_that_of_a_whole_shape_or_of_each_patch() {
    let radiance = |shape: &str| {
        let scene = world(&format!("AreaLightSource \"diffuse\" \"float power\" 1 {shape}"));
        material(&scene).emission.factor
    };
    let of_area = |area: f64| [1.0 / (std::f64::consts::PI * area) as f32; 3];
    let turn = std::f64::consts::TAU;
    let [low, half] = ["\"float zmin\" -0.25", "\"float phimax\" 180"];
    for (shape, area) in [
        (format!("Shape \"sphere\" \"float radius\" 0.5 {low}"), turn * 0.5 * 0.75),
        (format!("Shape \"sphere\" {half}"), turn),
        ("ReverseOrientation Shape \"sphere\"".into(), 2.0 * turn),
        (format!("Shape \"disk\" \"float innerradius\" 0.5 {half}"), turn * 0.25 * 0.75),
        ("ReverseOrientation Shape \"disk\"".into(), turn * 0.5),
        (format!("Shape \"cylinder\" \"float radius\" 0.5 {half}"), turn * 0.5),
        ("Shape \"cone\" \"float height\" 2".into(), turn * 0.5 * 5f64.sqrt()),
        ("Shape \"paraboloid\"".into(), turn / 12.0 * (5f64.powf(1.5) - 1.0)),
    ] {
        colors_are(radiance(&shape), of_area(area));
    }
    // Each of two patches of the area 2 has the power; the bent one is of many triangles.
    let patches = "Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0 0 2 0 2 2 0] \
        \"integer indices\" [0 1 2 3 2 3 4 5]";
    colors_are(radiance(patches), of_area(2.0));
    let text = "WorldBegin AreaLightSource \"diffuse\" \"float power\" 1 \
        Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0 0 3 0 1 3 0] \
        \"integer indices\" [0 1 2 3 2 3 4 5]";
    assert!(warnings(text).contains("power\" is that of each bilinear patch"));
}

#[test]
fn infinite_lights_without_a_picture_are_constant() {
    let environment =
        |text: &str| match world(&format!("LightSource \"infinite\" {text}")).environment {
            Some(Environment::Constant(color)) => color,
            other => panic!("{other:?}"),
        };
    colors_are(environment("\"rgb L\" [.4 .5 .6] \"float scale\" 2"), [0.8, 1.0, 1.2]);
    colors_are(environment("\"float illuminance\" 10"), [10.0 / std::f32::consts::PI; 3]);
}
