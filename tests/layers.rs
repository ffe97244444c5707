//! Layers that show parts of the light add up to the picture in any kind of scene.

use snell_render::integrator::light_part::{LightPart, LightSource, Lobe, Scatterings};
use snell_render::{Aov, IntegratorKind, LightGroup, Settings};
use snell_scene::LayeredImage;
use snell_tests::scenes::everything;
use snell_tests::{render, settings};

fn part(lobe: Option<Lobe>, scatterings: Scatterings) -> Aov {
    Aov::Light(LightPart { lobe, scatterings: Some(scatterings), group: None })
}

/// Checks that layers add up to the picture, and returns the mean of each layer.
fn check_sum(image: &LayeredImage, layers: std::ops::Range<usize>, name: &str) -> Vec<f32> {
    let picture = &image.layers[0].values;
    let mut means = vec![0.0; layers.len()];
    for (pixel, color) in picture.chunks(4).enumerate() {
        for (channel, &expected) in color.iter().take(3).enumerate() {
            let values = layers.clone().map(|l| image.layers[l].values[pixel * 3 + channel]);
            values.clone().zip(&mut means).for_each(|(v, mean)| *mean += v);
            let sum: f32 = values.sum();
            let allowed = 1e-4 * expected.abs() + 1e-6;
            assert!((sum - expected).abs() <= allowed, "{name}, pixel {pixel}: {sum} {expected}");
        }
    }
    means
}

#[test]
fn lobes_and_bounces_add_up_to_the_picture() {
    let (scene, camera) = everything();
    let mut aovs = vec![part(None, Scatterings::None)];
    for lobe in Lobe::ALL {
        aovs.extend([Scatterings::One, Scatterings::Many].map(|s| part(Some(lobe), s)));
    }
    let split = aovs.len();
    aovs.extend([Scatterings::None, Scatterings::One, Scatterings::Many].map(|s| part(None, s)));
    for integrator in [IntegratorKind::Path, IntegratorKind::Direct] {
        let settings =
            Settings { integrator, max_depth: 5, aovs: aovs.clone(), ..settings(24, 16) };
        let image = render(&scene, &camera, &settings).image();
        let means = check_sum(&image, 1..split + 1, integrator.name());
        check_sum(&image, split + 1..split + 4, integrator.name());
        let there: Vec<bool> = means.iter().map(|&m| m > 0.0).collect();
        let many = integrator == IntegratorKind::Path;
        // Light through glass needs two bounces: one to enter and one to leave.
        assert_eq!(there[..7], [true, true, many, true, many, false, many], "{means:?}");
        assert!(!there[7] && !there[8], "no medium, no scattering in it");
    }
}

#[test]
fn light_groups_add_up_to_the_picture_and_hold_their_lights_alone() {
    let (mut scene, camera) = everything();
    let emissive = (0..scene.materials.len()).filter(|&m| scene.materials[m].is_emissive());
    let materials =
        emissive.map(|m| LightSource::Material(snell_scene::MaterialId(m as u32))).collect();
    let group = |name: &str, sources| LightGroup { name: name.into(), sources };
    let light_groups =
        vec![group("lamps", materials), group("sky", vec![LightSource::Environment])];
    let of = |group| Aov::Light(LightPart { group: Some(group), ..LightPart::default() });
    let settings = Settings {
        light_groups,
        aovs: vec![of(0), of(1), of(2)],
        max_depth: 3,
        ..settings(24, 64)
    };
    let image = render(&scene, &camera, &settings).image();
    check_sum(&image, 1..4, "groups");
    // This scene has only the lamps, which must give the same light as their group.
    scene.environment = None;
    scene.lights.clear();
    scene.background = snell_scene::Background::Environment;
    let alone =
        render(&scene, &camera, &Settings { aovs: Vec::new(), seed: 1, ..settings }).image();
    let mean = |values: &[f32], stride: usize| {
        values.chunks(stride).map(|p| f64::from(p[0] + p[1] + p[2]).min(30.0)).sum::<f64>()
    };
    let (group, alone) = (mean(&image.layers[1].values, 3), mean(&alone.layers[0].values, 4));
    assert!(group > 0.0 && (group / alone - 1.0).abs() < 0.1, "{group} {alone}");
}

#[test]
fn the_clamp_dims_indirect_light_alone() {
    let (scene, camera) = everything();
    let aovs: Vec<Aov> =
        [Scatterings::None, Scatterings::One, Scatterings::Many].map(|s| part(None, s)).to_vec();
    let free = Settings { max_depth: 5, aovs, ..settings(24, 16) };
    let clamped = Settings { clamp: Some(0.2), ..free.clone() };
    let [free, clamped] = [free, clamped].map(|s| render(&scene, &camera, &s).image());
    check_sum(&clamped, 1..4, "clamped");
    assert_eq!(free.layers[1..3], clamped.layers[1..3], "direct light stays");
    let sum = |image: &LayeredImage| image.layers[3].values.iter().sum::<f32>();
    assert!(sum(&clamped) < sum(&free));
    assert!(free.layers[3].values.iter().zip(&clamped.layers[3].values).all(|(f, c)| c <= f));
}

#[test]
fn what_covers_a_pixel_adds_up_to_its_alpha() {
    let (mut scene, camera) = everything();
    scene.background = snell_scene::Background::Transparent;
    let aovs = vec![Aov::CryptoObject, Aov::Depth, Aov::CryptoMaterial];
    let film =
        render(&scene, &camera, &Settings { aovs, pixel_position: None, ..settings(24, 10) });
    let image = film.image();
    assert_eq!(image.layers.len(), 2, "coverage is no layer");
    for aov in [Aov::CryptoObject, Aov::CryptoMaterial] {
        let coverage = film.coverage(aov);
        let most = coverage.iter().map(|(things, _)| things.len()).max();
        assert!(most > Some(1), "some pixels have an edge");
        for ((things, samples), color) in coverage.iter().zip(image.layers[0].values.chunks(4)) {
            let covered: u32 = things.iter().map(|t| t.1).sum();
            assert!(
                *samples == 10 && (covered as f32 / 10.0 - color[3]).abs() < 1e-6,
                "{things:?} {color:?}"
            );
        }
    }
    assert!(film.coverage(Aov::Albedo).is_empty());
}
