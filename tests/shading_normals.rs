//! Shading normals deflect light, but they neither create nor leak any, and leave no black rims.

use snell_intersect::TriangleMesh;
use snell_intersect::shape::Sphere;
use snell_math::{DAffine3, DVec3, Rgb, Vec3};
use snell_render::{IntegratorKind, Settings};
use snell_scene::light::{Attenuation, Point};
use snell_scene::material::{
    BumpMap, Conductor, Dielectric, Diffuse, HeightUnit, MaterialKind, Mirror, NormalMap, OpenPbr,
    Plastic,
};
use snell_scene::{Camera, Encoding, Environment, ImageTexture, Material, Scene};
use snell_tests::scenes::{image, put, put_mesh, quad};
use snell_tests::{colors, render, settings};

/// Materials that reflect (or transmit) all light.
fn lossless() -> Vec<(&'static str, MaterialKind)> {
    let white = Rgb::WHITE;
    let coated =
        OpenPbr { base_color: white.into(), coat_weight: 1.0.into(), ..OpenPbr::default() };
    vec![
        ("matte", Diffuse::new(white).into()),
        ("mirror", Mirror::new(white).into()),
        ("metal", Conductor::color(white, 0.3).into()),
        ("rough metal", Conductor::color(white, 0.8).into()),
        ("glass", Dielectric::smooth(1.5).into()),
        ("rough glass", Dielectric::rough(1.5, 0.4).into()),
        ("plastic", Plastic::new(white, 0.2).into()),
        ("coated", coated.into()),
    ]
}

/// A ball covered with waves, from a normal map or a height map, in a furnace.
fn bumpy_ball(kind: MaterialKind, scale: f32, as_heights: bool) -> (Scene, Camera) {
    let mut scene = Scene::new("bumpy ball");
    scene.environment = Some(Environment::Constant(Rgb::WHITE));
    let waves = image(256, 128, 3, |x, y| {
        if as_heights {
            let wave = |k: u32| 0.25 + 0.25 * (k as f32 * 0.6).sin();
            return vec![wave(x) + wave(y + x / 3); 3];
        }
        let slope = |k: u32| (k as f32 * 0.6).sin();
        let n = Vec3::new(slope(x), slope(y + x / 3), 1.0).normalize();
        (n * 0.5 + 0.5).to_array().to_vec()
    });
    let waves = scene.add_image(waves);
    let texture = scene.add_texture(ImageTexture::new(waves, Encoding::Linear));
    let normal_map = (!as_heights).then_some(NormalMap::new(texture, scale));
    // The heights are waves of ten texels, each texel a fortieth of the radius wide.
    let heights = BumpMap { texture, channel: None, height: 0.12 * scale, unit: HeightUnit::Scene };
    let bump_map = as_heights.then_some(heights);
    let material =
        scene.add_material(Material { normal_map, bump_map, ..Material::new("bumpy", kind) });
    put(&mut scene, Sphere { radius: 1.0 }, DAffine3::from_rotation_x(0.5), material);
    (scene, Camera::look_at(Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO, Vec3::Y, 0.27))
}

/// Mean brightness of the ball, and of the ring at its rim.
fn brightness(scene: &Scene, camera: &Camera) -> [f64; 2] {
    const SIZE: u32 = 40;
    let picture =
        colors(&render(scene, camera, &Settings { max_depth: 64, ..settings(SIZE, 32) }).image());
    let radius = |i: usize| {
        let at = |k: usize| (k as f64 + 0.5) / f64::from(SIZE) * 2.0 - 1.0;
        // The radius relative to the ball's silhouette in the picture.
        at(i % SIZE as usize).hypot(at(i / SIZE as usize)) * 0.27f64.tan()
            / (1.0f64 / 4.0).asin().tan()
    };
    let mean = |from: f64, to: f64| {
        let inside: Vec<f64> = picture
            .iter()
            .enumerate()
            .filter(|(i, _)| (from..to).contains(&radius(*i)))
            .map(|(_, c)| c[1])
            .collect();
        inside.iter().sum::<f64>() / inside.len() as f64
    };
    [mean(0.0, 1.0), mean(0.93, 1.0)]
}

#[test]
fn bumps_make_no_light_and_no_black_rims() {
    for (scale, as_heights) in [(0.3, false), (1.0, false), (0.3, true), (1.0, true)] {
        for (name, kind) in lossless() {
            let (scene, camera) = bumpy_ball(kind, scale, as_heights);
            let [all, rim] = brightness(&scene, &camera);
            eprintln!(
                "{name} (heights: {as_heights}) with bumps of {scale}: {all:.4}, at the rim \
                    {rim:.4}"
            );
            assert!(
                all < 1.005 && rim < 1.02,
                "{name} with bumps of {scale} makes light: {all} {rim}"
            );
            // Light deflected below the surface is lost. At grazing angles, that is a large share.
            let least = if scale < 0.5 { [0.9, 0.65] } else { [0.7, 0.4] };
            assert!(
                all > least[0] && rim > least[1],
                "{name} with bumps of {scale} is too dark: {all} {rim}"
            );
        }
    }
}

#[test]
fn light_from_behind_a_face_does_not_reach_it_whatever_its_normals() {
    let tilted = TriangleMesh { normals: vec![Vec3::new(0.9, 0.0, 0.435_89); 4], ..quad() };
    for (name, kind) in lossless() {
        if matches!(kind, MaterialKind::Dielectric(_)) {
            continue;
        }
        let mut scene = Scene::new("terminator");
        let material = scene.add_material(Material::new(name, kind));
        put_mesh(&mut scene, tilted.clone(), DAffine3::IDENTITY, material);
        // The light is under the face, but above the plane of its shading normals.
        scene.add_light(Point {
            position: DVec3::new(3.0, 0.0, -0.2),
            intensity: Rgb::splat(100.0),
            attenuation: Attenuation::INVERSE_SQUARE,
            body_radius: 0.0,
        });
        let camera = Camera::look_at(Vec3::new(0.2, 0.1, 2.0), Vec3::ZERO, Vec3::Y, 0.3);
        for integrator in [IntegratorKind::Path, IntegratorKind::Raycast] {
            let settings = Settings { integrator, ..settings(16, 16) };
            let leaked = colors(&render(&scene, &camera, &settings).image())
                .iter()
                .flatten()
                .fold(0.0, |a: f64, b| a.max(*b));
            assert_eq!(leaked, 0.0, "{name} by {integrator:?}");
        }
    }
}
