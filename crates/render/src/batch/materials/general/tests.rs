use crate::batch::twins::{assert_same_at_every_level, every_second_node};
use crate::compile::Moving;
use crate::sampler::SamplerKind;
use crate::{Guiding, IntegratorKind, LightStrategy, Settings};
use snell_math::{ColorModel, Rgb};
use snell_scene::Texture;
use snell_scene::builtin::builtin;
use snell_scene::material::{AlphaMode, MaterialKind, NormalMap, OpenPbr};
use snell_scene::texture::Pattern;

#[test]
fn many_vertices_at_once_give_the_bits_of_one_at_a_time() {
    let guiding = Some(Guiding { passes: 2, photons: 1 << 13 });
    let mut kinds = MaterialKind::examples();
    for (metalness, rough) in [(0.0, 0.0), (1.0, 0.3)] {
        let slab = OpenPbr {
            base_metalness: metalness.into(),
            specular_roughness: 0.4.into(),
            ..OpenPbr::default()
        };
        kinds
            .push(OpenPbr { coat_weight: 0.8.into(), coat_roughness: rough.into(), ..slab }.into());
    }
    let metal = OpenPbr {
        base_metalness: 1.0.into(),
        specular_roughness: 0.7.into(),
        ..OpenPbr::default()
    };
    kinds.extend([metal.clone().into(), OpenPbr { geometry_thin_walled: true, ..metal }.into()]);
    let mut first = 0;
    for name in [
        "cornell-box",
        "teapot",
        "spheres",
        "caustic",
        "night-town",
        "fog",
        "drink",
        "hair",
        "smoke",
    ] {
        let mut scene = builtin(name).expect("the scene is built in");
        let bumps = Pattern::examples()
            .into_iter()
            .find(|p| p.textures().is_empty())
            .expect("there is one");
        let texture = scene.add_texture(Texture::Pattern(bumps));
        // One lamp gets a material that also reflects.
        if let Some(lamp) = scene.materials.iter_mut().find(|m| m.is_emissive()) {
            lamp.kind = kinds[first % kinds.len()].clone();
        }
        let ways = [
            (IntegratorKind::Path, SamplerKind::ZSobol, LightStrategy::Mis, None),
            (IntegratorKind::Path, SamplerKind::Independent, LightStrategy::Mis, None),
            (IntegratorKind::Path, SamplerKind::Independent, LightStrategy::Mis, guiding),
            (IntegratorKind::Path, SamplerKind::ZSobol, LightStrategy::Light, None),
            (IntegratorKind::Direct, SamplerKind::Stratified, LightStrategy::Bsdf, None),
        ];
        for (way, (integrator, sampler, light_strategy, guiding)) in ways.into_iter().enumerate() {
            let materials =
                scene.materials.iter_mut().filter(|m| !m.is_emissive() && m.interior.is_none());
            for (i, material) in
                materials.enumerate().take(if name == "night-town" { 12 } else { 4 })
            {
                let number = first + i;
                material.kind = kinds[number % kinds.len()].clone();
                if let MaterialKind::OpenPbr(surface) = &mut material.kind
                    && number % 2 == 0
                {
                    surface.base_color.texture = Some(texture);
                    let channels = (number % 4 == 0).then_some([(texture, 1), (texture, 2)]);
                    surface.specular_roughness.texture = channels.map(|[roughness, _]| roughness);
                    surface.base_metalness.texture = channels.map(|[_, metalness]| metalness);
                }
                if let MaterialKind::MetallicRoughness(surface) = &mut material.kind {
                    (surface.metallic.texture, surface.roughness.texture) =
                        (Some((texture, 2)), Some((texture, 1)));
                }
                let is_bent = number % 3 == 0;
                material.normal_map = is_bent.then_some(NormalMap::new(texture, 0.3));
                material.alpha_mode =
                    if number % 5 == 0 { AlphaMode::Blend } else { AlphaMode::Opaque };
                material.alpha = 0.7.into();
            }
            first += 4;
            // Every second combination of settings is also rendered in spectral mode.
            let colors = if way % 2 == 0 { &ColorModel::ALL[..] } else { &ColorModel::ALL[..1] };
            for &color in colors {
                let how = Settings {
                    max_depth: 7,
                    sampler,
                    integrator,
                    light_strategy,
                    ..Settings::default()
                };
                let settings = Settings { size: [32, 24], spp: 4, guiding, color, ..how };
                let picture = assert_same_at_every_level(&scene, &Moving::default(), &settings);
                assert!(picture.iter().any(|&x| x != 0.0) || way > 2, "{name}");
                if sampler == SamplerKind::Independent && guiding.is_none() {
                    assert_same_at_every_level(&scene, &every_second_node(&scene), &settings);
                }
            }
        }
    }
}

#[test]
fn every_material_gives_the_same_bits_by_its_spectra() {
    let mut kinds = MaterialKind::examples();
    let (base, tint) = (Rgb::new(0.9, 0.2, 0.1), Rgb::new(0.9, 0.7, 0.5));
    for (metal, rough, coat, color) in [
        (0.0, 0.0, 0.0, Rgb::WHITE),
        (0.0, 0.4, 0.7, Rgb::WHITE),
        (1.0, 0.4, 0.7, Rgb::WHITE),
        (1.0, 0.3, 0.7, tint),
        (0.3, 0.5, 0.0, Rgb::WHITE),
        (1.0, 0.5, 0.0, Rgb::WHITE),
    ] {
        let slab = OpenPbr {
            base_metalness: f32::into(metal),
            specular_roughness: f32::into(rough),
            ..Default::default()
        };
        let slab = OpenPbr {
            base_color: base.into(),
            specular_color: tint.into(),
            specular_weight: 0.6.into(),
            ..slab
        };
        kinds.push(
            OpenPbr { coat_weight: f32::into(coat), coat_color: color.into(), ..slab }.into(),
        );
    }
    for name in ["spheres", "teapot"] {
        let scene = builtin(name).expect("the scene is built in");
        for kind in &kinds {
            let mut scene = scene.clone();
            scene
                .materials
                .iter_mut()
                .filter(|m| !m.is_emissive())
                .for_each(|m| m.kind = kind.clone());
            let how = Settings { max_depth: 4, color: ColorModel::Spectral, ..Settings::default() };
            let settings = Settings { size: [24, 16], spp: 2, ..how };
            assert_same_at_every_level(&scene, &Moving::default(), &settings);
        }
    }
}
