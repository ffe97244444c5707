//! Media.

use super::*;
use snell_math::{Rgb, Vec3};

#[test]
fn media_fill_what_their_interface_says() {
    use snell_scene::medium::Medium;
    let scene = world(
        "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [1 2 3] \"rgb \
            sigma_s\" [4 5 6] \"float scale\" 2 \"rgb Le\" [1 1 1]\n\
         MediumInterface \"fog\" \"\"\nMaterial \"interface\" Shape \"sphere\"\nMediumInterface \
         \"\" \"fog\"\nMaterial \"dielectric\" Shape \"sphere\" \"float radius\" 0.5",
    );
    let Medium::Homogeneous(fog) = &scene.media[0] else { panic!("not homogeneous") };
    assert_eq!((fog.sigma_a, fog.sigma_s), (Rgb::new(2.0, 4.0, 6.0), Rgb::new(8.0, 10.0, 12.0)));
    // Emission is proportional to absorption.
    assert_eq!(fog.emission, Rgb::new(2.0, 4.0, 6.0));
    let insides: Vec<_> =
        scene.materials.iter().map(|m| m.interior.map(|i| i.medium.map(|m| m.0))).collect();
    assert_eq!(insides, [Some(Some(0)), Some(None)]);
    let around = super::scene(
        "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\"\nMediumInterface \"\" \
            \"fog\"\nCamera \"perspective\"\nWorldBegin",
    );
    assert_eq!(around.medium.map(|m| m.0), Some(0));
}

#[test]
fn media_may_be_named_before_they_are_defined() {
    let insides = |scene: &Scene| -> Vec<Option<u32>> {
        let medium = |m: &Material| m.interior.map(|i| i.medium.map(|m| m.0));
        scene.materials.iter().filter_map(medium).collect()
    };
    let [fog, smoke] = ["fog", "smoke"]
        .map(|name| format!("MakeNamedMedium \"{name}\" \"string type\" \"homogeneous\"\n"));
    let ball =
        |media: &str| format!("MediumInterface {media} Material \"dielectric\" Shape \"sphere\"\n");
    // The interface, surfaces and the camera before the media.
    let scene = world(&format!(
        "{}{}{}{smoke}{fog}{}",
        ball("\"fog\" \"\""),
        ball("\"smoke\" \"fog\""),
        ball("\"\" \"fog\""),
        ball("\"fog\" \"\"")
    ));
    assert_eq!(insides(&scene), [Some(1), Some(0), None, Some(1)]);
    let scene = super::scene(&format!(
        "MediumInterface \"\" \"fog\" {fog} Camera \"perspective\"\nWorldBegin"
    ));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(scene.medium.map(|m| m.0), Some(0));
    // A medium that is never defined is empty, with a warning.
    let text = format!("WorldBegin\n{}{fog}", ball("\"mist\" \"fog\""));
    assert_eq!(insides(&super::scene(&text)), [None]);
    assert_eq!(
        warnings(&text),
        "test:2:17: there is no medium \"mist\" in the scene; it is empty: define it with \
            MakeNamedMedium (1x)\n"
    );
}

#[test]
fn media_on_grids_have_the_colours_of_their_cells() {
    use snell_math::ColorMode;
    use snell_scene::medium::Medium;
    let grid = |text: &str| {
        let scene = world(&format!(
            "MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"point3 p0\" [ 1 0 0 ] \"point3 \
                p1\" [ 5 1 1 ] \"integer nx\" 2 {text}\n\
             MediumInterface \"m\" \"\"\nMaterial \"interface\" Shape \"sphere\""
        ));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
        // The centres of the cells; mirrored in x, as pbrt's scenes are.
        [-2.0, -4.0].map(|x| grid.properties(Vec3::new(x, 0.5, 0.5), ColorMode::Rgb))
    };
    let colors = "\"rgb sigma_a\" [ 1 2 3 0 8 1 ] \"rgb sigma_s\" [ 5 0 1 2 0 4 ] \"rgb Le\" [ 1 1 \
        1 7 0 2 ]";
    let [a, b] =
        grid(&format!("{colors} \"float scale\" 2 \"float Lescale\" 0.5 \"float g\" 0.25"));
    let close = |found: snell_math::SampledSpectrum, expected: [f32; 3]| {
        assert!(
            (0..3).all(|c| (found[c] - expected[c]).abs() < 1e-5),
            "{found:?} is not {expected:?}"
        );
    };
    close(a.sigma_a, [2.0, 4.0, 6.0]);
    close(b.sigma_a, [0.0, 16.0, 2.0]);
    close(a.sigma_s, [10.0, 0.0, 2.0]);
    close(b.sigma_s, [4.0, 0.0, 8.0]);
    // Emission is proportional to absorption.
    close(a.emission, [1.0, 2.0, 3.0]);
    close(b.emission, [0.0, 0.0, 2.0]);
    // Missing grids are 1.
    let [a, b] = grid("\"rgb sigma_s\" [ 5 0 1 0 0 0 ]");
    close(a.sigma_a, [1.0; 3]);
    close(b.sigma_t(), [1.0; 3]);
    for wrong in
        ["\"rgb sigma_s\" [ 5 0 1 ]", "", "\"rgb sigma_a\" [ 1 2 3 0 8 1 ] \"rgb Le\" [ 1 1 1 ]"]
    {
        let text = format!(
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"integer nx\" 2 {wrong}"
        );
        let error = fault(&text);
        assert!(error.contains("give one for each cell"), "{error}");
    }
    let error =
        fault("WorldBegin MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"integer nx\" -2");
    assert!(
        error.contains("nx is -2, but a grid has at least one cell; write a whole number above 0"),
        "{error}"
    );
}

#[test]
fn grids_of_version_3_are_grids() {
    use snell_scene::medium::Medium;
    let grid = |text: &str| {
        let scene = world(&format!(
            "MakeNamedMedium \"m\" \"string type\" \"heterogeneous\" \"integer nx\" 2 \
                \"point p1\" [ 4 1 1 ] \"float density\" [ 1 3 ] {text}\n\
             MediumInterface \"m\" \"\"\nMaterial \"interface\" Shape \"sphere\""
        ));
        let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
        grid.clone()
    };
    let plain = grid("");
    assert_eq!(plain.world_from_grid.matrix3.x_axis.length(), 4.0);
    assert_eq!((plain.sigma_a, plain.sigma_s.r), (Rgb::new(0.0011, 0.0024, 0.014), 2.55));
    assert_eq!(
        grid("\"rgb sigma_s\" [ 1 2 3 ] \"float scale\" 2").sigma_s.to_array(),
        [2.0, 4.0, 6.0]
    );
}
