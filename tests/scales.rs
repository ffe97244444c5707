//! All lengths of a scene may be multiplied by one number, and its picture stays the same: for each
//! kind of material, medium, light, pattern, shape and camera. A constant that is compared with a
//! length would have a unit, and so would change the picture.
//!
//! What is a length follows from the declared units of the parameters, so new kinds and parameters
//! take part without a change here.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;
use snell_intersect::shape::{AnyShape, Sphere};
use snell_intersect::{Curves, StrandBasis};
use snell_math::parameters::{Kind, Parameter, Value};
use snell_math::spectrum::ColorModel;
use snell_math::{DAffine3, DVec3, Rgb, Vec3, Vec4};
use snell_render::Settings;
use snell_scene::material::{
    BumpMap, ColorParam, Dielectric, Diffuse, Hair, HeightUnit, Interior, MaterialKind, NormalMap,
    OpenPbr,
};
use snell_scene::medium::{Grid, Homogeneous, ScalarGrid};
use snell_scene::texture::Pattern;
use snell_scene::{
    Camera, Encoding, Environment, Geometry, ImageTexture, Light, Material, MaterialId, Medium,
    Node, Projection, Scene, Surface,
};
use snell_tests::scenes::{at, facing, image, lamp, matte, put, put_mesh, quad, rectangle, sky};
use snell_tests::{colors, render};
use std::sync::Arc;

/// The power of the scale of lengths by which numbers of a unit grow, so that radiance stays.
fn power(unit: &str) -> i32 {
    match unit {
        "scene units" => 1,
        "W / sr" => 2,
        "per scene unit" | "W / (m^2 sr) per scene unit" => -1,
        "" | "W / m^2" | "W / (m^2 sr)" | "cd / m^2" | "radians" | "degrees" | "pixels"
        | "cells" | "micrometres" | "per radius" => 0,
        other => panic!("how does a number in {other} grow with the lengths?"),
    }
}

/// Multiplies all numbers of a written value; of one with a texture, only the factor.
fn multiply(value: &mut Json, by: f64) {
    match value {
        _ if by == 1.0 => {}
        Json::Number(x) => *value = (x.as_f64().expect("a number") * by).into(),
        Json::Array(items) => items.iter_mut().for_each(|item| multiply(item, by)),
        Json::Object(fields) => {
            fields.get_mut("factor").into_iter().for_each(|factor| multiply(factor, by));
        }
        _ => {}
    }
}

/// Multiplies the lengths in the written values of parameters.
fn grow_parameters(value: &mut Json, parameters: &[Parameter], scale: f64) {
    for parameter in parameters {
        let part = if parameter.name.is_empty() {
            &mut *value
        } else if let Some(part) = value.get_mut(parameter.name) {
            part
        } else {
            continue;
        };
        multiply(part, scale.powi(power(parameter.unit)));
        match (parameter.name, part) {
            // The denominator a + b d + c d^2 of an intensity.
            ("attenuation", Json::Array(terms)) => {
                multiply(&mut terms[0], scale * scale);
                multiply(&mut terms[1], scale);
            }
            ("world_from_grid" | "world_from_cloud", place) => multiply(place, scale),
            ("texture_from_world" | "st_from_world", Json::Array(rows)) => {
                let rows = rows.iter_mut().filter_map(Json::as_array_mut);
                rows.flat_map(|row| &mut row[..3]).for_each(|x| multiply(x, 1.0 / scale));
            }
            (_, part) => grow(part, parameter.kind, scale),
        }
    }
}

/// Multiplies the lengths in a written value of a kind.
fn grow(value: &mut Json, kind: Kind, scale: f64) {
    match kind {
        Kind::Optional(kind) => grow(value, *kind, scale),
        Kind::List(kind) => {
            value.as_array_mut().into_iter().flatten().for_each(|item| grow(item, *kind, scale));
        }
        Kind::Group(parameters) => grow_parameters(value, parameters, scale),
        Kind::OneOf(tag, kinds) => {
            for kind in kinds {
                if value.get(tag).is_some_and(|name| name == kind.name) {
                    grow_parameters(value, kind.fields(), scale);
                } else if let (true, Some(inner)) = (tag.is_empty(), value.get_mut(kind.name)) {
                    grow_parameters(inner, kind.fields(), scale);
                }
            }
        }
        _ => {}
    }
}

/// A thing with all of its lengths multiplied.
fn grown<T: Value + Serialize + DeserializeOwned>(thing: &T, scale: f64) -> T {
    let mut written = serde_json::to_value(thing).expect("it can be written");
    grow(&mut written, T::KIND, scale);
    serde_json::from_value(written).expect("it can be read")
}

fn grown_medium(medium: &Medium, scale: f64) -> Medium {
    let mut found = grown(medium, scale);
    found.keep_grids_of(medium);
    found
}

fn grown_light(light: &Light, scale: f64) -> Light {
    let mut found = grown(light, scale);
    // The factor on a table of intensities has no unit of its own.
    if let Light::Profile(_) | Light::Projector(_) = found {
        *found.color_mut() = found.color() * (scale * scale) as f32;
    }
    found
}

fn grown_place(place: DAffine3, scale: f64) -> DAffine3 {
    DAffine3 { translation: place.translation * scale, ..place }
}

/// A scene whose lengths are multiplied by `scale` as it is filled.
struct Stage {
    scene: Scene,
    camera: Camera,
    scale: f64,
}

impl Stage {
    /// A ground under a sky; the place of what is tested is around `(0.5, 0.5, 0.5)`.
    fn empty(scale: f64) -> Self {
        let mut scene = Scene::new("stage");
        let paper = matte(&mut scene, 0.6);
        let image = sky(8, |d| [0.3, 0.4, 0.5 + 0.3 * d.y as f32]);
        scene.environment = Some(Environment::Image {
            image,
            scale: Rgb::WHITE,
            world_from_environment: DAffine3::IDENTITY,
        });
        let eye = Vec3::new(1.5, 1.5, 4.0);
        let camera = Camera::look_at(eye, Vec3::new(0.5, 0.4, 0.5), Vec3::Y, 0.2);
        let mut stage = Self { scene, camera: grown(&camera, scale), scale };
        stage.put(rectangle(8.0, 8.0), facing(DVec3::new(0.0, -0.3, 0.0), DVec3::Y), paper);
        stage
    }

    /// The same with a lamp.
    fn lit(scale: f64) -> Self {
        let mut stage = Self::empty(scale);
        let glow = lamp(&mut stage.scene, 4.0);
        stage.put(rectangle(1.0, 1.0), facing(DVec3::new(0.5, 2.5, 0.5), DVec3::NEG_Y), glow);
        stage
    }

    fn put(&mut self, shape: impl Into<AnyShape>, place: DAffine3, material: MaterialId) {
        let shape = grown(&shape.into(), self.scale);
        put(&mut self.scene, shape, grown_place(place, self.scale), material);
    }

    /// Puts a ball and a square of a material into the middle.
    fn put_samples(&mut self, material: &Material) {
        let material = self.scene.add_material(grown(material, self.scale));
        self.put(Sphere { radius: 0.4 }, at(0.2, 0.5, 0.5), material);
        let scale = DAffine3::from_scale(DVec3::splat(self.scale));
        put_mesh(&mut self.scene, quad(), scale * at(1.1, 0.5, 0.5), material);
    }

    fn picture(&self, settings: &Settings) -> Vec<[f64; 3]> {
        let settings = Settings { size: [14, 10], spp: 8, max_depth: 12, ..settings.clone() };
        colors(&render(&self.scene, &self.camera, &settings).image())
    }
}

/// Renders a stage at several scales, and compares the pictures with that at scale 1.
fn check(what: &str, make: impl Fn(f64) -> Stage) {
    check_with(what, &Settings::default(), make);
}

fn check_with(what: &str, settings: &Settings, make: impl Fn(f64) -> Stage) {
    let expected = make(1.0).picture(settings);
    let mean = |picture: &[[f64; 3]]| picture.iter().flatten().sum::<f64>() / picture.len() as f64;
    let brightness = mean(&expected);
    // Powers of two change no digit of a product.
    for exponent in [-36, -20, 20, 36] {
        let found = make(2f64.powi(exponent)).picture(settings);
        let is_off = |(a, b): &(&[f64; 3], &[f64; 3])| {
            (0..3).any(|c| (a[c] - b[c]).abs() > 1e-5 * brightness)
        };
        let off = found.iter().zip(&expected).filter(is_off).count();
        assert_eq!(off, 0, "{what} at scale 2^{exponent}: mean {} of {brightness}", mean(&found));
    }
    // Others round each length, and so send some paths another way.
    for scale in [1e-6, 1e6] {
        let found = mean(&make(scale).picture(settings));
        let change = (found - brightness).abs();
        assert!(change <= 0.03 * brightness, "{what} at scale {scale:e}: {found} of {brightness}");
    }
}

#[test]
fn materials_look_the_same_at_all_scales() {
    let more: Vec<MaterialKind> = vec![
        Dielectric { absorption: Rgb::new(0.5, 1.0, 2.0), ..Dielectric::smooth(1.5) }.into(),
        Dielectric { absorption: Rgb::new(0.5, 1.0, 2.0), ..Dielectric::rough(1.5, 0.3) }.into(),
        OpenPbr {
            transmission_weight: 1.0.into(),
            transmission_color: Rgb::new(0.9, 0.5, 0.2).into(),
            transmission_depth: 0.5.into(),
            transmission_scatter: Rgb::splat(0.4).into(),
            ..OpenPbr::default()
        }
        .into(),
        OpenPbr {
            subsurface_weight: 1.0.into(),
            subsurface_radius: 0.1.into(),
            ..OpenPbr::default()
        }
        .into(),
        OpenPbr { thin_film_weight: 1.0.into(), ..OpenPbr::default() }.into(),
    ];
    for kind in MaterialKind::examples().into_iter().chain(more) {
        if matches!(kind, MaterialKind::Interface(_)) {
            continue;
        }
        let material = Material::new("sample", kind);
        check(&format!("{:?}", material.kind), |scale| {
            let mut stage = Stage::lit(scale);
            stage.put_samples(&material);
            stage
        });
    }
}

#[test]
fn maps_of_normals_and_heights_look_the_same_at_all_scales() {
    let waves = image(16, 16, 3, |x, y| {
        let slope = |k: u32| 0.5 + 0.2 * (k as f32 * 0.8).sin();
        vec![slope(x), slope(y), 1.0]
    });
    let maps = |stage: &mut Stage, which: usize| {
        let waves = stage.scene.add_image(waves.clone());
        let texture = stage.scene.add_texture(ImageTexture::new(waves, Encoding::Linear));
        let pattern = Pattern::examples()
            .into_iter()
            .find(|pattern| pattern.name() == "fbm")
            .map(|pattern| grown(&pattern, stage.scale))
            .expect("there are patterns of noise");
        let pattern = stage.scene.add_texture(pattern);
        let bumps = |texture, unit, height: f64| {
            let height = height as f32;
            Some(BumpMap { texture, channel: None, height, unit })
        };
        let plain = Material::new("bumpy", OpenPbr::default());
        match which {
            0 => Material { normal_map: Some(NormalMap::new(texture, 1.0)), ..plain },
            1 => Material { bump_map: bumps(texture, HeightUnit::Picture, 0.1), ..plain },
            2 => Material {
                bump_map: bumps(texture, HeightUnit::Scene, 0.05 * stage.scale),
                ..plain
            },
            _ => Material {
                bump_map: bumps(pattern, HeightUnit::Scene, 0.05 * stage.scale),
                ..plain
            },
        }
    };
    for which in 0..4 {
        check(&format!("map {which}"), |scale| {
            let mut stage = Stage::lit(scale);
            let material = maps(&mut stage, which);
            stage.put_samples(&material);
            stage
        });
    }
}

#[test]
fn patterns_look_the_same_at_all_scales() {
    for pattern in Pattern::examples() {
        check(&format!("{pattern:?}"), |scale| {
            let mut stage = Stage::lit(scale);
            let texture = stage.scene.add_texture(grown(&pattern, scale));
            let reflectance = ColorParam::textured(Rgb::splat(0.8), Some(texture));
            stage.put_samples(&Material::new("pattern", Diffuse { reflectance }));
            stage
        });
    }
}

#[test]
fn media_look_the_same_at_all_scales() {
    let glowing = Grid {
        emission: Rgb::new(3.0, 1.0, 0.2),
        temperature: ScalarGrid::new([2; 3], (0..8).map(|i| 1500.0 + 200.0 * i as f32).collect())
            .map(Arc::new),
        ..match Medium::examples().into_iter().find(|m| matches!(m, Medium::Grid(_))) {
            Some(Medium::Grid(grid)) => grid,
            _ => Grid::default(),
        }
    };
    let more: Vec<Medium> = vec![
        glowing.into(),
        Homogeneous::scattering(Rgb::new(5.0, 20.0, 80.0), Rgb::new(0.99, 0.9, 0.5), 0.5).into(),
    ];
    for medium in Medium::examples().into_iter().chain(more) {
        for fills_scene in [false, true] {
            let what = format!("{:?}", medium.without_grids());
            check(&format!("{what}, everywhere: {fills_scene}"), |scale| {
                let mut stage = Stage::lit(scale);
                let id = stage.scene.add_medium(grown_medium(&medium, scale));
                if fills_scene {
                    stage.scene.medium = Some(id);
                } else {
                    let hull = stage.scene.add_material(Material::interface("hull", id));
                    stage.put(Sphere { radius: 0.7 }, at(0.5, 0.5, 0.5), hull);
                }
                let (grey, glow) = (matte(&mut stage.scene, 0.5), lamp(&mut stage.scene, 6.0));
                stage.put(Sphere { radius: 0.15 }, at(0.3, 0.4, 0.6), grey);
                stage.put(Sphere { radius: 0.08 }, at(0.7, 0.6, 0.5), glow);
                stage.scene.add_light(grown_light(&Light::examples()[1], scale));
                stage
            });
        }
    }
    check("glass full of milk", |scale| {
        let mut stage = Stage::lit(scale);
        let milk = Homogeneous::scattering(Rgb::splat(30.0), Rgb::splat(0.98), 0.2);
        let medium = Some(stage.scene.add_medium(grown_medium(&milk.into(), scale)));
        let glass = Material {
            interior: Some(Interior { medium, priority: 1 }),
            ..Material::new("glass", Dielectric::rough(1.5, 0.2))
        };
        stage.put_samples(&glass);
        stage
    });
}

#[test]
fn lights_look_the_same_at_all_scales() {
    for (i, light) in Light::examples().into_iter().enumerate() {
        // The name is not enough: there are several of most kinds.
        let what = format!("light {i}, {}", light.name());
        check(&what, |scale| {
            let mut stage = Stage::empty(scale);
            stage.scene.environment = None;
            let grey = matte(&mut stage.scene, 0.5);
            stage.put(rectangle(8.0, 8.0), facing(DVec3::Y * 4.0, DVec3::NEG_Y), grey);
            stage.put(Sphere { radius: 0.3 }, at(0.5, 0.5, 0.5), grey);
            stage.scene.add_light(grown_light(&light, scale));
            stage
        });
    }
    check("all lights", |scale| {
        let mut stage = Stage::lit(scale);
        let grey = matte(&mut stage.scene, 0.5);
        stage.put(Sphere { radius: 0.3 }, at(0.5, 0.5, 0.5), grey);
        for light in Light::examples() {
            stage.scene.add_light(grown_light(&light, scale));
        }
        stage
    });
}

#[test]
fn shapes_and_lamps_of_all_shapes_look_the_same_at_all_scales() {
    for shape in AnyShape::examples() {
        for emits in [false, true] {
            check(&format!("{shape:?}, a lamp: {emits}"), |scale| {
                let mut stage = Stage::lit(scale);
                let material = match emits {
                    true => lamp(&mut stage.scene, 2.0),
                    false => matte(&mut stage.scene, 0.5),
                };
                let shrunk = DAffine3::from_scale(DVec3::splat(0.4));
                stage.put(shape.clone(), at(0.5, 0.4, 0.5) * shrunk, material);
                stage
            });
        }
    }
}

#[test]
fn hair_looks_the_same_at_all_scales() {
    for hair in Hair::examples() {
        check(&format!("{hair:?}"), |scale| {
            let mut stage = Stage::lit(scale);
            let strand = |i: usize| {
                let x = i as f32 * 0.1;
                [[x, 0.0, 0.5], [x, 0.4, 0.6], [x, 0.8, 0.4], [x + 0.1, 1.0, 0.5]]
                    .map(|[x, y, z]| Vec4::new(x, y, z, 0.04) * stage.scale as f32)
            };
            let points = (0..10).flat_map(strand).collect();
            let curves =
                Curves::new(StrandBasis::Bezier, points, vec![4; 10]).expect("ten strands");
            let hair = stage.scene.add_material(Material::new("hair", hair.clone()));
            let surfaces = vec![Surface::with_material(Geometry::Curves(Arc::new(curves)), hair)];
            stage.scene.add_child(stage.scene.root, Node { surfaces, ..Node::default() });
            stage
        });
    }
}

#[test]
fn cameras_see_the_same_at_all_scales() {
    for projection in Projection::examples() {
        check(&format!("{projection:?}"), |scale| {
            let mut stage = Stage::lit(scale);
            stage.put_samples(&Material::new("grey", Diffuse::new(Rgb::splat(0.5))));
            let eye = DVec3::new(1.5, 1.5, 4.0);
            let camera = Camera::from_target(eye, DVec3::new(0.5, 0.4, 0.5), DVec3::Y, projection);
            stage.camera = grown(&camera.with_lens(0.05, 3.0), scale);
            stage
        });
    }
}

#[test]
fn spectra_do_not_depend_on_the_scale() {
    let settings = Settings { color: ColorModel::Spectral, ..Settings::default() };
    let marble = OpenPbr {
        subsurface_weight: 1.0.into(),
        subsurface_radius: 0.1.into(),
        subsurface_color: Rgb::new(0.9, 0.5, 0.2).into(),
        ..OpenPbr::default()
    };
    check_with("spectral", &settings, |scale| {
        let mut stage = Stage::lit(scale);
        stage.put_samples(&Material::new("marble", marble.clone()));
        let fog = Homogeneous::scattering(Rgb::new(0.1, 0.2, 0.3), Rgb::splat(0.9), 0.0);
        stage.scene.medium = Some(stage.scene.add_medium(grown_medium(&fog.into(), scale)));
        stage
    });
}
