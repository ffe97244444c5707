//! Tests of layers that hold parts of the light.

use super::twins::{assert_same_at_every_level, every_second_node};
use crate::compile::Moving;
use crate::integrator::aov::Aov;
use crate::integrator::light_part::{LightPart, LightSource};
use crate::settings::LightGroup;
use crate::{IntegratorKind, Settings};
use snell_math::{ColorModel, DVec3, Rgb};
use snell_scene::MaterialId;
use snell_scene::builtin::builtin;
use snell_scene::framing::studio_background;
use snell_scene::material::Diffuse;
use snell_scene::medium::Homogeneous;

#[test]
fn parts_of_the_light_are_the_bits_of_one_vertex_at_a_time() {
    let of_lobes: Vec<Aov> =
        Aov::ALL.into_iter().filter(|aov| matches!(aov, Aov::Light(_))).collect();
    let counts = |aov: &&Aov| matches!(aov, Aov::Light(part) if part.lobe.is_none());
    let of_counts: Vec<Aov> = of_lobes.iter().filter(counts).copied().collect();
    for name in
        ["cornell-box", "teapot", "spheres", "caustic", "night-town", "fog", "drink", "smoke"]
    {
        let mut scene = builtin(name).expect("the scene is built in");
        if name == "cornell-box" {
            scene.materials[0].kind = Diffuse::new(Rgb::new(0.9, 0.6, 0.0)).into();
            let colors = (Rgb::splat(1e-4), Rgb::splat(1e-3));
            scene.medium = Some(scene.add_medium(Homogeneous::scattering(colors.0, colors.1, 0.4)));
        }
        let sources = vec![LightSource::Environment, LightSource::Material(MaterialId(0))];
        let groups = vec![LightGroup { name: "some".into(), sources }];
        let group = Aov::Light(LightPart { lobe: None, scatterings: None, group: Some(0) });
        let ways = [
            (of_lobes.clone(), None, ColorModel::Rgb),
            (of_counts.clone(), Some(0.5), ColorModel::Rgb),
            (vec![group, Aov::Albedo], None, ColorModel::Spectral),
            (vec![], Some(0.2), ColorModel::Rgb),
        ];
        for (aovs, clamp, color) in ways {
            let is_direct = clamp == Some(0.5);
            let integrator = if is_direct { IntegratorKind::Direct } else { IntegratorKind::Path };
            let how = Settings {
                size: [32, 24],
                spp: 4,
                max_depth: 6,
                integrator,
                ..Settings::default()
            };
            let settings = Settings { aovs, clamp, color, light_groups: groups.clone(), ..how };
            assert_same_at_every_level(&scene, &Moving::default(), &settings);
            if color == ColorModel::Spectral {
                assert_same_at_every_level(&scene, &every_second_node(&scene), &settings);
            }
        }
    }
}

#[test]
fn lamps_that_are_not_visible_and_any_roulette_give_the_bits_of_one_at_a_time() {
    for (visible, roulette_depth) in [(false, None), (false, Some(0)), (true, Some(9))] {
        let mut scene = builtin("cornell-box").expect("the scene is built in");
        for lamp in scene.materials.iter_mut().filter(|material| material.is_emissive()) {
            lamp.visible = visible;
        }
        for integrator in [IntegratorKind::Direct, IntegratorKind::Path] {
            let how = Settings { size: [32, 24], spp: 4, integrator, ..Settings::default() };
            let settings = Settings { max_depth: 9, roulette_depth, ..how };
            let picture = assert_same_at_every_level(&scene, &Moving::default(), &settings);
            assert!(picture.iter().step_by(4).any(|&x| x > 0.1));
        }
    }
}

#[test]
fn a_background_that_catches_shadows_gives_the_bits_of_one_at_a_time() {
    let mut scene = builtin("teapot").expect("the scene is built in");
    scene.background = studio_background(&scene, DVec3::Y);
    let groups = vec![LightGroup { name: "sky".into(), sources: vec![LightSource::Environment] }];
    for color in ColorModel::ALL {
        let how = Settings { size: [32, 24], spp: 4, color, ..Settings::default() };
        let aovs = vec![Aov::Light(LightPart::default()), Aov::Albedo];
        let settings = Settings { aovs, light_groups: groups.clone(), ..how };
        assert_same_at_every_level(&scene, &Moving::default(), &settings);
    }
}
