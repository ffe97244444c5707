use super::*;
use crate::bsdf::Lobes;
use crate::image::{Encoding, Image};
use crate::texture::ImageTexture;
use snell_math::{Vec2, rng, sampling};
use std::sync::Arc;

pub(super) fn surface() -> SurfaceInteraction {
    SurfaceInteraction {
        uv: [Vec2::splat(0.5); snell_intersect::UV_SETS],
        dpdu: Vec3::X * 3.0,
        dpdv: Vec3::Y * 2.0,
        t: 1.0,
        ..SurfaceInteraction::plain(Vec3::ZERO, Vec3::Z)
    }
}

fn at<'a>(surface: &'a SurfaceInteraction, textures: &'a TextureSet) -> ShadingPoint<'a> {
    ShadingPoint { surface, footprint: 0.0, textures, mode: ColorMode::Rgb, outside_ior: 1.0 }
}

/// A texture of one texel that holds this normal.
fn normal_texture(n: Vec3, uv_transform: [[f32; 3]; 2]) -> TextureSet {
    let image = Image::from_f32(1, 1, 3, (n * 0.5 + 0.5).to_array().to_vec());
    let texture = ImageTexture {
        uv_transform,
        ..ImageTexture::new(crate::graph::ImageId(0), Encoding::Linear)
    };
    TextureSet::new(&[texture.into()], &[Arc::new(image)])
}

const IDENTITY: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn mapped(scale: f32) -> Material {
    let normal_map = Some(NormalMap::new(TextureId(0), scale));
    Material { normal_map, ..Material::new("bumpy", Diffuse::new(Rgb::WHITE)) }
}

fn mapped_normal(n: Vec3, uv_transform: [[f32; 3]; 2], surface: &SurfaceInteraction) -> Vec3 {
    mapped(1.0).bsdf(&at(surface, &normal_texture(n, uv_transform))).frame.z
}

#[track_caller]
fn assert_near(a: Vec3, b: Vec3) {
    assert!((a - b).length() < 1e-3, "{a} is not {b}");
}

#[test]
fn every_material_survives_json_and_has_its_name_there() {
    for kind in MaterialKind::examples() {
        let json = serde_json::to_string(&kind).expect("serialises");
        assert!(json.contains(&format!("\"material\":\"{}\"", kind.name())), "{json}");
        assert_eq!(serde_json::from_str::<MaterialKind>(&json).expect("reads back"), kind);
    }
    let names: Vec<_> = MaterialKind::examples().iter().map(MaterialKind::name).collect();
    assert!(MaterialKind::NAMES.iter().all(|n| names.contains(n)), "each kind has examples");
}

#[test]
fn a_normal_map_follows_the_picture_right_and_up() {
    // v runs down the picture, so green, which points up, points in the direction of decreasing v.
    let s = surface();
    assert_near(mapped_normal(Vec3::new(0.6, 0.0, 0.8), IDENTITY, &s), Vec3::new(0.6, 0.0, 0.8));
    assert_near(mapped_normal(Vec3::new(0.0, 0.6, 0.8), IDENTITY, &s), Vec3::new(0.0, -0.6, 0.8));
    assert_near(mapped_normal(Vec3::Z, IDENTITY, &s), Vec3::Z);
    // A picture that is mirrored or rotated takes its normals along.
    let flipped_v = [[1.0, 0.0, 0.0], [0.0, -1.0, 1.0]];
    assert_near(mapped_normal(Vec3::new(0.0, 0.6, 0.8), flipped_v, &s), Vec3::new(0.0, 0.6, 0.8));
    let mirrored_u = [[-1.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
    assert_near(mapped_normal(Vec3::new(0.6, 0.0, 0.8), mirrored_u, &s), Vec3::new(-0.6, 0.0, 0.8));
    // With u' = v and v' = -u, right in the picture is dpdv, and down is -dpdu.
    let turned = [[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0]];
    assert_near(mapped_normal(Vec3::new(0.6, 0.0, 0.8), turned, &s), Vec3::new(0.0, 0.6, 0.8));
    assert_near(mapped_normal(Vec3::new(0.0, 0.6, 0.8), turned, &s), Vec3::new(0.6, 0.0, 0.8));
    assert_near(
        mapped_normal(Vec3::new(0.6, 0.0, 0.8), [[0.0; 3]; 2], &s),
        Vec3::new(0.6, 0.0, 0.8),
    );
}

#[test]
fn stored_tangents_come_first_and_their_sign_turns_the_bitangent() {
    let n = Vec3::new(0.36, 0.48, 0.8);
    for sign in [1.0, -1.0] {
        let s = SurfaceInteraction { tangent: Some((Vec3::Y, sign)), ..surface() };
        // The bitangent is sign * (z x y) = -sign x.
        assert_near(mapped_normal(n, IDENTITY, &s), Vec3::new(-sign * 0.48, 0.36, 0.8));
    }
}

#[test]
fn stored_tangents_turn_with_the_picture() {
    // What the derivatives of the coordinates give (dpdu along x, dpdv against y: three and two
    // units), the stored tangents of the same coordinates give too.
    let plain = SurfaceInteraction { dpdv: -Vec3::Y * 2.0, ..surface() };
    let stored = SurfaceInteraction { tangent: Some((Vec3::X, 1.0)), ..plain };
    let mirrored = SurfaceInteraction { dpdv: Vec3::Y * 2.0, ..surface() };
    let stored_mirrored = SurfaceInteraction { tangent: Some((Vec3::X, -1.0)), ..mirrored };
    let n = Vec3::new(0.36, 0.48, 0.8);
    for turn in [0.0f32, 0.4, 1.5, -2.0, 3.0] {
        let (sin, cos) = turn.sin_cos();
        for [x, y] in [[1.0, 1.0], [2.0, 0.5], [-1.0, 1.0], [1.0, -3.0]] {
            let transform = [[cos * x, sin * y, 0.1], [-sin * x, cos * y, 0.2]];
            for (by_derivatives, by_tangents) in [(&plain, &stored), (&mirrored, &stored_mirrored)]
            {
                assert_near(
                    mapped_normal(n, transform, by_tangents),
                    mapped_normal(n, transform, by_derivatives),
                );
            }
        }
    }
}

#[test]
fn green_may_be_the_normal_times_u() {
    let textures = normal_texture(Vec3::new(0.0, 0.6, 0.8), IDENTITY);
    for dpdv in [Vec3::Y, -Vec3::Y] {
        for (bitangent, y) in [(Bitangent::Crossed, 0.6), (Bitangent::CrossedMirrored, -0.6)] {
            let s = SurfaceInteraction { dpdv, ..surface() };
            let map = NormalMap { bitangent, ..NormalMap::new(TextureId(0), 1.0) };
            let material = Material { normal_map: Some(map), ..mapped(1.0) };
            assert_near(material.bsdf(&at(&s, &textures)).frame.z, Vec3::new(0.0, y, 0.8));
        }
    }
}

#[test]
fn scale_flattens_a_normal_map() {
    let (s, textures) = (surface(), normal_texture(Vec3::new(0.6, 0.0, 0.8), IDENTITY));
    assert_near(mapped(0.0).bsdf(&at(&s, &textures)).frame.z, Vec3::Z);
    assert_near(mapped(0.5).bsdf(&at(&s, &textures)).frame.z, Vec3::new(0.3, 0.0, 0.8).normalize());
}

/// A picture that increases evenly from 0 at the left edge to 1 at the right edge.
fn ramp(uv_transform: [[f32; 3]; 2]) -> TextureSet {
    let image = Image::from_f32(8, 2, 1, (0..16).map(|i| ((i % 8) as f32 + 0.5) / 8.0).collect());
    let texture = ImageTexture {
        uv_transform,
        ..ImageTexture::new(crate::graph::ImageId(0), Encoding::Linear)
    };
    TextureSet::new(&[texture.into()], &[Arc::new(image)])
}

fn bumpy(height: f32, unit: HeightUnit) -> Material {
    let bump_map = Some(BumpMap { texture: TextureId(0), channel: Some(0), height, unit });
    Material { bump_map, ..Material::new("bumpy", Diffuse::new(Rgb::WHITE)) }
}

#[test]
fn bumps_bend_the_normal_as_the_moved_surface_would_have_it() {
    // The height is `height * (a x + b y)`, with `a` and `b` from the texture coordinates, their
    // transform, and the ray cone of the pixel.
    let uv = Vec2::new(0.5, 0.5);
    for (dpdu, dpdv, uv_transform, slope) in [
        (Vec3::X, Vec3::Y, IDENTITY, Vec3::X),
        (Vec3::X * 4.0, Vec3::Y, IDENTITY, Vec3::X / 4.0),
        (Vec3::X, -Vec3::Y, IDENTITY, Vec3::X),
        (-Vec3::X * 2.0, Vec3::Y, IDENTITY, -Vec3::X / 2.0),
        // Sheared coordinates: u = x - y, v = y.
        (Vec3::X, Vec3::new(1.0, 1.0, 0.0), IDENTITY, Vec3::new(1.0, -1.0, 0.0)),
        // The picture is rotated: its u is the surface's v.
        (Vec3::X, Vec3::Y * 2.0, [[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0]], Vec3::Y / 2.0),
        // The picture is smaller, too.
        (Vec3::X, Vec3::Y, [[0.5, 0.0, 0.25], [0.0, 3.0, 0.0]], Vec3::X / 2.0),
    ] {
        let s = SurfaceInteraction { dpdu, dpdv, uv: [uv; snell_intersect::UV_SETS], ..surface() };
        let textures = ramp(uv_transform);
        for (height, footprint) in [(0.7, 0.0), (-0.3, 1e-3), (2.0, 0.01)] {
            let point = ShadingPoint { footprint, ..at(&s, &textures) };
            let normal = bumpy(height, HeightUnit::Scene).bsdf(&point).frame.z;
            assert_near(normal, (Vec3::Z - slope * height).normalize());
        }
    }
}

#[test]
fn heights_by_the_width_of_the_picture_look_alike_on_things_of_any_size() {
    for size in [1e-3, 1.0, 1e4] {
        let s = SurfaceInteraction {
            dpdu: Vec3::X * size,
            dpdv: Vec3::Y * size,
            uv: [Vec2::splat(0.5); snell_intersect::UV_SETS],
            ..surface()
        };
        let textures = ramp([[2.0, 0.0, -0.5], [0.0, 2.0, 0.0]]);
        let normal = bumpy(0.5, HeightUnit::Picture).bsdf(&at(&s, &textures)).frame.z;
        assert_near(normal, Vec3::new(-0.5, 0.0, 1.0).normalize());
    }
}

#[test]
fn slopes_of_bumps_and_of_a_normal_map_add_up_and_never_leave_the_side_of_the_surface() {
    let slope = |x: f32| Vec3::new(-x, 0.0, 1.0).normalize();
    let normals = Image::from_f32(1, 1, 3, (slope(0.5) * 0.5 + 0.5).to_array().to_vec());
    let heights = Image::from_f32(8, 1, 1, (0..8).map(|i| (i as f32 + 0.5) / 8.0).collect());
    let texture = |i| ImageTexture::new(crate::graph::ImageId(i), Encoding::Linear).into();
    let textures =
        TextureSet::new(&[texture(1), texture(0)], &[Arc::new(normals), Arc::new(heights)]);
    let s = SurfaceInteraction { dpdu: Vec3::X, ..surface() };
    let normal_map = Some(NormalMap::new(TextureId(1), 1.0));
    let both = Material { normal_map, ..bumpy(0.25, HeightUnit::Scene) };
    assert_near(both.bsdf(&at(&s, &textures)).frame.z, slope(0.75));
    for height in [1e9, -1e9, f32::INFINITY, f32::NAN] {
        let z = bumpy(height, HeightUnit::Scene).bsdf(&at(&s, &textures)).frame.z;
        assert!(z.z > 0.0 && z.is_normalized(), "{height} gave {z}");
    }
}

#[test]
fn mapped_normals_stay_on_the_side_of_the_surface() {
    for n in [Vec3::new(0.6, 0.0, -0.8), -Vec3::Z, Vec3::new(1.0, 0.0, 0.0), Vec3::ZERO] {
        let z = mapped_normal(n, IDENTITY, &surface());
        assert!(z.z > 0.0 && z.is_normalized(), "{n} gave {z}");
    }
}

#[test]
fn what_is_seen_shades_from_the_side_it_is_seen_from_and_mirrors_reflect_away() {
    for i in 0..2000u32 {
        let mut shading = sampling::uniform_sphere(rng::uniform2([i, 1, 8, 0]));
        shading.z = shading.z.abs();
        let wo = sampling::uniform_sphere(rng::uniform2([i, 2, 8, 0]));
        if wo.z.abs() < 1e-4 {
            continue;
        }
        let s = SurfaceInteraction { shading_normal: shading, ..surface() };
        let textures = TextureSet::default();
        for material in [
            Material::new("m", Mirror::new(Rgb::WHITE)),
            Material::new("d", Diffuse::new(Rgb::WHITE)),
        ] {
            let bsdf = material.bsdf_towards(&at(&s, &textures), wo);
            assert!(
                bsdf.frame.z.dot(wo) * wo.z > 0.0 && bsdf.frame.z.z > 0.0,
                "{shading} {wo} {}",
                bsdf.frame.z
            );
            if bsdf.is_delta() {
                let sample =
                    bsdf.sample(wo, 0.5, Vec2::splat(0.5)).expect("a mirror always reflects");
                assert!(sample.wi.z * wo.z > 0.0, "{shading} {wo} {sample:?}");
            }
        }
    }
}

#[test]
fn a_normal_that_is_fine_is_left_alone() {
    let s =
        SurfaceInteraction { shading_normal: Vec3::new(0.1, 0.0, 1.0).normalize(), ..surface() };
    for kind in [MaterialKind::from(Mirror::new(Rgb::WHITE)), Diffuse::new(Rgb::WHITE).into()] {
        for wo in [Vec3::Z, -Vec3::Z, Vec3::new(0.8, 0.0, 0.6)] {
            let bsdf =
                Material::new("m", kind.clone()).bsdf_towards(&at(&s, &TextureSet::default()), wo);
            assert_eq!(bsdf.frame.z, s.shading_normal);
        }
    }
}

#[test]
fn light_does_not_leak_through_the_surface() {
    let s = SurfaceInteraction { shading_normal: Vec3::new(0.8, 0.0, 0.6), ..surface() };
    let textures = TextureSet::default();
    let wo = Vec3::new(0.6, 0.0, 0.8);
    for (i, kind) in MaterialKind::examples().into_iter().enumerate() {
        let bsdf = Material::new("m", kind).bsdf(&at(&s, &textures));
        // A direction above the horizon of the shading normal, but below the surface.
        let leak = Vec3::new(0.9, 0.0, -0.19f32.sqrt());
        let shading_side = bsdf.frame.z.dot(leak);
        assert!(shading_side > 0.0 && leak.z < 0.0);
        assert_eq!(bsdf.eval(wo, leak), SampledSpectrum::ZERO, "example {i}");
        assert_eq!(bsdf.eval_classic(wo, leak), SampledSpectrum::ZERO, "example {i}");
        assert_eq!(bsdf.pdf(wo, leak), 0.0, "example {i}");
        for k in 0..300u32 {
            let u = rng::uniform2([k, i as u32, 9, 0]);
            if let Some(sample) = bsdf.sample(wo, u.x, rng::uniform2([k, i as u32, 10, 0])) {
                assert_eq!(sample.is_transmission, sample.wi.z < 0.0, "example {i}: {sample:?}");
            }
        }
        assert!(
            bsdf.specular_branches(wo)
                .iter()
                .flatten()
                .all(|b| b.is_transmission == (b.wi.z < 0.0))
        );
    }
}

#[test]
fn world_and_local_answers_are_the_same() {
    let normal = Vec3::new(0.48, 0.6, 0.64);
    let s = SurfaceInteraction { geometric_normal: normal, shading_normal: normal, ..surface() };
    let textures = TextureSet::default();
    let bsdf = Material::new("m", Plastic::new(Rgb::splat(0.5), 0.5)).bsdf(&at(&s, &textures));
    let (wo, wi) = (Vec3::Z, Vec3::Y);
    let (o, i) = (bsdf.frame.to_local(wo), bsdf.frame.to_local(wi));
    assert_eq!(bsdf.eval(wo, wi), bsdf.bsdf.eval(o, i));
    assert!(bsdf.eval(wo, wi)[0] > 0.0);
    assert_eq!(bsdf.pdf(wo, wi), bsdf.bsdf.pdf(o, i));
}

#[test]
fn presence_follows_side_mask_and_alpha() {
    let (s, textures) = (surface(), TextureSet::default());
    let (down, up) = (-Vec3::Z, Vec3::Z);
    let solid = Material::new("m", Diffuse::new(Rgb::WHITE));
    assert!(!solid.needs_filter() && solid.is_present(up, &at(&s, &textures), 0.99));
    let one_sided = Material { double_sided: false, ..solid.clone() };
    assert!(one_sided.needs_filter());
    assert!(
        one_sided.is_present(down, &at(&s, &textures), 0.5)
            && !one_sided.is_present(up, &at(&s, &textures), 0.5)
    );
    let alpha = |alpha_mode| Material { alpha_mode, alpha: 0.5.into(), ..solid.clone() };
    let blend = alpha(AlphaMode::Blend);
    assert!(
        blend.is_present(down, &at(&s, &textures), 0.49)
            && !blend.is_present(down, &at(&s, &textures), 0.5)
    );
    assert!(alpha(AlphaMode::Mask(0.5)).is_present(down, &at(&s, &textures), 0.99));
    assert!(!alpha(AlphaMode::Mask(0.51)).is_present(down, &at(&s, &textures), 0.0));
    // Glass of index 1.5 reflects 4 % at each face, and 2 r / (1 + r) of both.
    let pane = Material { alpha: 1.0.into(), ..alpha(AlphaMode::Sheet(1.5)) };
    assert!((pane.presence(down, &at(&s, &textures)) - 0.08 / 1.04).abs() < 1e-6);
    assert!(pane.presence(Vec3::new(1.0, 0.0, -0.1), &at(&s, &textures)) > 0.6);
    let faded = SurfaceInteraction { color: [1.0, 1.0, 1.0, 0.5], ..s };
    assert!(!alpha(AlphaMode::Mask(0.5)).is_present(down, &at(&faded, &textures), 0.0));
}

#[test]
fn nonsense_parameters_still_give_sane_light() {
    let bad = Rgb::new(f32::NAN, -1.0, f32::INFINITY);
    let kinds: Vec<MaterialKind> = vec![
        Diffuse::new(bad).into(),
        Mirror::new(bad).into(),
        Conductor::measured(bad, bad, f32::NAN).into(),
        Conductor::color(bad, -3.0).into(),
        Dielectric { tint: bad.into(), ..Dielectric::rough(f32::NAN, 7.0) }.into(),
        Dielectric::rough(0.0, 0.5).into(),
        Plastic { ior: -1.0, specular: bad.into(), ..Plastic::new(bad, f32::INFINITY) }.into(),
        MetallicRoughness {
            ior: f32::NAN,
            specular_color: bad.into(),
            ..MetallicRoughness::new(bad, f32::NAN, 2.0)
        }
        .into(),
        Phong {
            diffuse: bad.into(),
            specular: bad.into(),
            transmission: bad.into(),
            shininess: f32::NAN,
            ior: -2.0,
            ..Phong::default()
        }
        .into(),
        Phong {
            diffuse: Rgb::WHITE.into(),
            specular: Rgb::WHITE.into(),
            shininess: f32::INFINITY,
            ..Phong::default()
        }
        .into(),
    ];
    let (s, textures) = (surface(), TextureSet::default());
    for kind in kinds {
        let bsdf = kind.bsdf(&at(&s, &textures));
        for i in 0..500u32 {
            let wo = sampling::uniform_sphere(rng::uniform2([i, 3, 8, 0]));
            let u = rng::uniform2([i, 4, 8, 0]);
            if let Some(sample) = bsdf.sample(wo, rng::uniform2([i, 5, 8, 0]).x, u) {
                assert!(
                    sample.wi.is_finite() && sample.weight.0.iter().all(|w| (0.0..1e3).contains(w)),
                    "{kind:?} {sample:?}"
                );
            }
            let wi = sampling::uniform_sphere(rng::uniform2([i, 6, 8, 0]));
            let value = bsdf.eval(wo, wi);
            assert!(
                value.is_finite()
                    && value.0.iter().all(|&v| v >= 0.0)
                    && bsdf.pdf(wo, wi).is_finite(),
                "{kind:?}"
            );
        }
    }
}

#[test]
fn emission_is_one_sided_unless_asked_and_never_nonsense() {
    let (s, textures) = (surface(), TextureSet::default());
    let lamp = Material::new("lamp", Black {}).emitting(Rgb::new(2.0, -1.0, f32::NAN));
    let point = at(&s, &textures);
    assert_eq!(lamp.emitted(&point, Vec3::Z), SampledSpectrum([2.0, 0.0, 0.0, 0.0]));
    assert_eq!(lamp.emitted(&point, -Vec3::Z), SampledSpectrum::ZERO);
    assert_eq!(Material { emits_on_both_sides: true, ..lamp }.emitted(&point, -Vec3::Z)[0], 2.0);
}

#[test]
fn coat_and_fuzz_dim_emission_by_what_they_do_not_let_pass() {
    let (s, textures) = (surface(), TextureSet::default());
    let point = at(&s, &textures);
    let glow = |kind: MaterialKind, cos: f32| {
        let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let lamp = Material::new("lamp", kind).emitting(Rgb::WHITE);
        assert!(lamp.uniform_emission().is_none());
        lamp.emitted(&point, wo)[0]
    };
    let coated = |weight: f32, color: f32| OpenPbr {
        coat_weight: weight.into(),
        coat_color: Rgb::splat(color).into(),
        coat_ior: 1.5.into(),
        ..OpenPbr::default()
    };
    for cos in [0.2f32, 0.6, 1.0] {
        let fresnel = crate::bsdf::fresnel::dielectric(cos, 1.5);
        let inside = (1.0 - (1.0 - cos * cos) / 2.25).sqrt();
        for (weight, color) in [(1.0f32, 1.0f32), (0.5, 1.0), (1.0, 0.25), (0.7, 0.04)] {
            // Once through half of what the colour stands for, along the refracted ray.
            let passed = (1.0 - fresnel) * color.powf(0.5 / inside);
            let expected = 1.0 - weight + weight * passed;
            let found = glow(coated(weight, color).into(), cos);
            assert!((found - expected).abs() < 1e-5, "{cos} {weight} {color}: {found} {expected}");
        }
        let clearcoat = MetallicRoughness { clearcoat: 1.0.into(), ..Default::default() };
        assert!((glow(clearcoat.into(), cos) - (1.0 - fresnel)).abs() < 1e-5);
    }
    // At a cosine of 0.2 a clear coat lets 0.66 pass (0.65 by Schlick's law).
    assert!((glow(coated(1.0, 1.0).into(), 0.2) - 0.66).abs() < 0.01);
    for fuzz_model in [FuzzModel::Flakes, FuzzModel::Charlie] {
        let fuzzy = OpenPbr { fuzz_weight: 0.5.into(), fuzz_model, ..OpenPbr::default() };
        let [straight, grazing] = [1.0, 0.1].map(|cos| glow(fuzzy.clone().into(), cos));
        assert!(grazing < straight && straight < 1.0 && grazing > 0.5, "{straight} {grazing}");
    }
    let bare = Material::new("lamp", OpenPbr::default()).emitting(Rgb::WHITE);
    assert!(bare.uniform_emission().is_some());
}

#[test]
fn a_coat_covers_the_sheen_of_gltf_and_lies_under_the_fuzz_of_open_pbr() {
    let (s, textures) = (surface(), TextureSet::default());
    let point = at(&s, &textures);
    let (wo, wi) = (Vec3::new(0.8, 0.0, 0.6), Vec3::new(-0.6, 0.48, 0.64));
    let value = |fuzz_model, coat: f32, fuzz: f32| {
        let cloth = OpenPbr {
            base_color: Rgb::BLACK.into(),
            specular_weight: 0.0.into(),
            fuzz_weight: fuzz.into(),
            fuzz_roughness: 0.5.into(),
            fuzz_model,
            coat_weight: coat.into(),
            coat_ior: 1.5.into(),
            coat_roughness: 0.4.into(),
            coat_darkening: 0.0.into(),
            ..OpenPbr::default()
        };
        cloth.bsdf(&point).eval(wo, wi)[0]
    };
    for (model, is_under) in [(FuzzModel::Charlie, true), (FuzzModel::Flakes, false)] {
        let (fuzz, coat, both) =
            (value(model, 0.0, 1.0), value(model, 1.0, 0.0), value(model, 1.0, 1.0));
        assert!(fuzz > 1e-3 && coat > 1e-3, "{fuzz} {coat}");
        // The layer on top is seen as if it was alone, and dims the other.
        let (top, below) = if is_under { (coat, fuzz) } else { (fuzz, coat) };
        let share = (both - top) / below;
        assert!((0.5..0.99).contains(&share), "{model:?}: {fuzz} {coat} {both}");
    }
}

#[test]
fn subsurface_scattering_knows_no_unit() {
    let textures = TextureSet::default();
    let wax = |radius: f32| OpenPbr {
        subsurface_weight: 1.0.into(),
        subsurface_radius: radius.into(),
        subsurface_radius_scale: Rgb::new(1.0, 0.5, 0.0).into(),
        ..OpenPbr::default()
    };
    for scale in [1e-30f32, 1e-6, 1.0, 1e6, 1e30] {
        let position = Vec3::splat(scale);
        let s = SurfaceInteraction {
            position_error: position * 2.0f32.powi(-22),
            ..SurfaceInteraction::plain(position, Vec3::Z)
        };
        let medium = wax(0.3 * scale).medium(&at(&s, &textures)).expect("a medium");
        let paths = (medium.sigma_a + medium.sigma_s).map(|sigma_t| 1.0 / sigma_t);
        for (path, expected) in [(paths[0], 0.3 * scale), (paths[1], 0.15 * scale)] {
            assert!((path / expected - 1.0).abs() < 1e-5, "{scale}: {paths:?}");
        }
        // What rays do not resolve is as long as they resolve.
        let medium = wax(1e-12 * scale).medium(&at(&s, &textures)).expect("a medium");
        let path = 1.0 / (medium.sigma_a[0] + medium.sigma_s[0]);
        assert!(path > scale * 1e-6 && path < scale * 1e-5, "{scale}: {path}");
    }
    // Channels that do not scatter below are matte.
    let s = surface();
    let point = at(&s, &textures);
    let (up, aside, below) = (Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, -0.8));
    let wax = wax(1.0).bsdf(&point);
    let [reflected, entering] = [aside, below].map(|wi| wax.eval(up, wi));
    assert!(entering[0] > 0.1 && entering[1] == entering[0] && entering[2] == 0.0, "{entering:?}");
    assert!(reflected[2] > 2.0 * reflected[0] && reflected[1] == reflected[0], "{reflected:?}");
    let matte = OpenPbr {
        subsurface_weight: 1.0.into(),
        subsurface_radius: 0.0.into(),
        subsurface_color: Rgb::new(0.8, 0.4, 0.2).into(),
        ..OpenPbr::default()
    };
    let plain = OpenPbr { base_color: Rgb::new(0.8, 0.4, 0.2).into(), ..OpenPbr::default() };
    assert_eq!(matte.bsdf(&point).eval(up, aside), plain.bsdf(&point).eval(up, aside));
    assert!(matte.bsdf(&point).eval(up, below).is_black());
}

#[test]
fn names_are_no_textures() {
    assert!(
        Material::new("TextureId(77)", Diffuse::new(snell_math::Rgb::WHITE)).textures().is_empty()
    );
}

#[test]
fn what_is_known_beforehand_changes_no_bit() {
    let textures = normal_texture(Vec3::new(0.2, -0.4, 0.6), IDENTITY);
    let texture = Some(TextureId(0));
    let red = OpenPbr {
        base_color: ColorParam::textured(Rgb::new(0.9, 0.2, 0.1), texture),
        ..OpenPbr::default()
    };
    let mut kinds = MaterialKind::examples();
    kinds.extend([
        Dielectric { absorption: Rgb::new(0.1, 0.4, 2.0), ..Dielectric::smooth(1.5) }.into(),
        OpenPbr {
            specular_roughness: ScalarParam { factor: 0.9, texture: Some((TextureId(0), 1)) },
            ..red.clone()
        }
        .into(),
        OpenPbr { coat_weight: 0.5.into(), base_metalness: 0.5.into(), ..red.clone() }.into(),
        MaterialKind::from(red),
    ]);
    let far = SurfaceInteraction { t: 3.0, ..surface() };
    let green = SurfaceInteraction { color: [0.2, 0.9, 0.3, 1.0], ..surface() };
    for (i, kind) in kinds.into_iter().enumerate() {
        let material = Material::new("m", kind);
        let prepared = Prepared::of(&material);
        for (surface, outside_ior) in [(surface(), 1.0), (far, 1.0), (green, 1.0), (surface(), 1.2)]
        {
            let point = ShadingPoint { outside_ior, ..at(&surface, &textures) };
            for wo in [Vec3::new(0.3, 0.4, 0.8).normalize(), Vec3::new(-0.5, 0.1, -0.6).normalize()]
            {
                let known = material.prepared_towards(&prepared, &point, wo);
                let made = material.bsdf_towards(&point, wo);
                assert_eq!(known.albedo(wo), made.albedo(wo), "{i}");
                assert_eq!(known.crossing_scale(wo), made.crossing_scale(wo), "{i}");
                let local = |w: Vec3| made.frame.to_local(w);
                for k in 0..20u32 {
                    let u = |d| rng::uniform2([k, d, i as u32, 11]);
                    let wi = sampling::uniform_sphere(u(1));
                    let found = known.eval_and_pdf(wo, wi);
                    assert_eq!(found, made.eval_and_pdf(wo, wi), "{i} from {wo}");
                    if !found.0.is_black() {
                        assert_eq!(
                            found,
                            made.bsdf.eval_and_pdf(local(wo), local(wi)),
                            "{i} from {wo}"
                        );
                    }
                    assert_eq!(
                        known.sample(wo, u(2).x, u(3)),
                        made.sample(wo, u(2).x, u(3)),
                        "{i} from {wo}"
                    );
                }
            }
        }
    }
}
