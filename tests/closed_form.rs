//! Scenes with closed-form solutions: every picture is compared with the formula, pixel by pixel,
//! in standard errors.

use snell_intersect::TriangleMesh;
use snell_intersect::shape::{BoxShape, Disk, Polygon, Sphere};
use snell_math::{DAffine3, DVec2, DVec3, Rgb, Vec3};
use snell_render::{IntegratorKind, LightStrategy, Settings};
use snell_scene::light::{self, Attenuation, Directional, Point, Rectangle, Spot, SpotFalloff};
use snell_scene::material::{AlphaMode, Black};
use snell_scene::{Camera, CameraSample, Environment, Material, Scene};
use snell_tests::scenes::{
    at, facing, ground, image, lamp, over_ground, put, put_mesh, rectangle, sky,
};
use snell_tests::statistics::{compare_exact, image_mean};
use snell_tests::{render, settings};
use std::f64::consts::PI;

/// Width and height of the pictures in pixels.
const SIZE: u32 = 32;

const REFLECTANCE: f32 = 0.6;

/// The points of the ground that the pixels of `camera` see.
fn ground_points(camera: &Camera, settings: &Settings) -> Vec<DVec3> {
    let [width, height] = settings.size;
    let point = |x: u32, y: u32| {
        let film = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let ray = camera.ray(&CameraSample { film, lens: Default::default() }, settings.size).ray;
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        o - d * (o.y / d.y)
    };
    (0..height).flat_map(|y| (0..width).map(move |x| point(x, y))).collect()
}

/// Renders the ground with every light strategy, by `direct` or `path`, and compares the radiance
/// with its reflectance / pi times `irradiance`.
fn check(what: &str, scene: &Scene, camera: &Camera, spp: u32, irradiance: impl Fn(DVec3) -> f64) {
    for (seed, strategy) in (1..).zip(LightStrategy::ALL) {
        check_strategy(what, scene, camera, spp, strategy, seed, &irradiance);
    }
}

fn check_strategy(
    what: &str,
    scene: &Scene,
    camera: &Camera,
    spp: u32,
    light_strategy: LightStrategy,
    seed: u32,
    irradiance: impl Fn(DVec3) -> f64,
) {
    // Each integrator makes half of the checks: both are the same vertex function.
    let integrator =
        if seed.is_multiple_of(2) { IntegratorKind::Direct } else { IntegratorKind::Path };
    let settings =
        Settings { integrator, max_depth: 1, light_strategy, seed, ..settings(SIZE, spp) };
    let radiance = |p: DVec3| f64::from(REFLECTANCE) / PI * irradiance(p);
    let expected: Vec<_> =
        ground_points(camera, &settings).into_iter().map(|p| [radiance(p); 3]).collect();
    let agreement = compare_exact(&render(scene, camera, &settings), &expected);
    agreement.check(&format!("{what}, {}", light_strategy.name()));
}

fn scene() -> Scene {
    let mut scene = Scene::new("closed form");
    ground(&mut scene, REFLECTANCE);
    scene
}

/// Irradiance on the ground at `p` from a polygon of radiance 1, all of it above the horizon
/// (Lambert, 1760). The corners turn counterclockwise seen from its bright side.
fn polygon_irradiance(p: DVec3, corners: &[DVec3]) -> f64 {
    let towards: Vec<DVec3> = corners.iter().map(|c| (*c - p).normalize()).collect();
    let edge = |i: usize| {
        let (a, b) = (towards[i], towards[(i + 1) % corners.len()]);
        a.angle_between(b) * b.cross(a).normalize().y
    };
    (0.5 * (0..corners.len()).map(edge).sum::<f64>()).max(0.0)
}

/// Irradiance on the ground at a distance `r` from the axis of a disk of radius `a` and radiance 1
/// that faces it from height `h`.
fn disk_irradiance(r: f64, a: f64, h: f64) -> f64 {
    let (s, d) = (h * h + r * r + a * a, h * h + r * r - a * a);
    PI * 0.5 * (1.0 - d / (s * s - 4.0 * a * a * r * r).sqrt())
}

#[test]
fn point_light_over_a_plane() {
    let mut scene = scene();
    let position = DVec3::new(0.3, 1.5, -0.2);
    let (intensity, attenuation) = (Rgb::splat(7.0), Attenuation::INVERSE_SQUARE);
    scene.add_light(Point { position, intensity, attenuation, body_radius: 0.0 });
    check("point light", &scene, &over_ground(0.4, 0.1), 4, |p| {
        7.0 * 1.5 / (position - p).length().powi(3)
    });
}

#[test]
fn directional_light_on_a_plane() {
    let mut scene = scene();
    let direction = DVec3::new(-0.6, -0.8, 0.0);
    scene.add_light(Directional { direction, irradiance: Rgb::splat(3.0) });
    check("directional light", &scene, &over_ground(0.0, 0.0), 4, |_| 3.0 * 0.8);
}

#[test]
fn spot_light_on_a_plane() {
    let position = DVec3::new(0.0, 2.0, 0.0);
    let direction = DVec3::new(0.1, -1.0, 0.2).normalize();
    let (inner, outer) = (0.1_f64, 0.25_f64);
    let falloffs = [
        SpotFalloff::Power { cutoff: 0.3, exponent: 20.0 },
        SpotFalloff::Smooth { inner, outer },
        SpotFalloff::Step { inner, outer },
        SpotFalloff::Fourth { inner, outer },
    ];
    for falloff in falloffs {
        let mut scene = scene();
        let (intensity, attenuation) = (Rgb::splat(5.0), Attenuation::INVERSE_SQUARE);
        scene.add_light(Spot { position, direction, intensity, attenuation, falloff });
        let ramp = |cos: f64| ((cos - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
        let factor = |cos: f64| match falloff {
            SpotFalloff::Power { .. } => {
                if cos.acos() > 0.3 {
                    0.0
                } else {
                    cos.powi(20)
                }
            }
            SpotFalloff::Smooth { .. } => ramp(cos).powi(2),
            SpotFalloff::Step { .. } => ramp(cos).powi(2) * (3.0 - 2.0 * ramp(cos)),
            SpotFalloff::Fourth { .. } => ramp(cos).powi(4),
        };
        check("spot light", &scene, &over_ground(0.0, 0.0), 4, |p| {
            let to_light = position - p;
            let d = to_light.length();
            5.0 * factor(-to_light.dot(direction) / d) * 2.0 / d.powi(3)
        });
    }
}

#[test]
fn panels_on_a_plane() {
    // The expected value follows the definition, by the midpoint rule: the mean over the panel of 2
    // emission cos cos / distance^2.
    let (center, normal) = (DVec3::new(0.2, 1.2, -0.1), DVec3::new(0.3, -1.0, 0.1).normalize());
    let (x, y) = normal.any_orthonormal_pair();
    let arriving = |p: DVec3, q: DVec3| {
        let to_light = q - p;
        let d = to_light.length();
        2.0 * 4.0 * (-to_light.dot(normal) / d).max(0.0) * (to_light.y / d) / (d * d)
    };
    let n = 60;
    let middle = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    let cells = move || (0..n).flat_map(move |i| (0..n).map(move |j| (middle(i), middle(j))));
    let (emission, attenuation) = (Rgb::splat(4.0), Attenuation::INVERSE_SQUARE);

    let mut with_disk = scene();
    with_disk.add_light(light::Disk {
        position: center,
        direction: normal,
        radius: 0.5,
        emission,
        attenuation,
    });
    check("disk panel", &with_disk, &over_ground(0.0, 0.0), 64, |p| {
        let point = |(u, v): (f64, f64)| {
            let (sin, cos) = (v * 2.0 * PI).sin_cos();
            center + (x * cos + y * sin) * (0.5 * u.sqrt())
        };
        cells().map(|c| arriving(p, point(c))).sum::<f64>() / f64::from(n * n)
    });

    let mut with_rectangle = scene();
    let lengths = [0.8, 0.4];
    with_rectangle.add_light(Rectangle { center, axes: [x, y], lengths, emission, attenuation });
    assert!(x.cross(y).dot(normal) > 0.999);
    check("rectangle panel", &with_rectangle, &over_ground(0.0, 0.0), 64, |p| {
        let point = |(u, v): (f64, f64)| center + x * ((u - 0.5) * 0.8) + y * ((v - 0.5) * 0.4);
        cells().map(|c| arriving(p, point(c))).sum::<f64>() / f64::from(n * n)
    });
}

#[test]
fn sphere_light_over_a_plane() {
    // At the same solid angle and angle of incidence, a sphere illuminates like the disk that it
    // appears as: pi L sin^2 cos.
    let (center, radius) = (DVec3::new(0.5, 2.0, 0.0), 0.7);
    let mut scene = scene();
    let material = lamp(&mut scene, 3.0);
    put(&mut scene, Sphere { radius }, DAffine3::from_translation(center), material);
    check("sphere light", &scene, &over_ground(0.0, 0.0), 128, |p| {
        let d = (center - p).length();
        3.0 * PI * (radius / d).powi(2) * 2.0 / d
    });
}

#[test]
fn stretched_sphere_light_has_the_power_of_its_shape() {
    // A sphere that is flattened almost completely is two disks.
    let mut scene = scene();
    let material = lamp(&mut scene, 3.0);
    let flat = at(0.0, 1.0, 0.0) * DAffine3::from_scale(DVec3::new(0.6, 1e-4, 0.6));
    put(&mut scene, Sphere { radius: 1.0 }, flat, material);
    check("flattened sphere light", &scene, &over_ground(0.2, 0.2), 128, |p| {
        3.0 * disk_irradiance(p.x.hypot(p.z), 0.6, 1.0)
    });
}

#[test]
fn disk_light_over_a_plane() {
    let mut scene = scene();
    let material = lamp(&mut scene, 4.0);
    let disk = Disk { radius: 0.5, inner_radius: 0.2 };
    put(&mut scene, disk, facing(DVec3::new(0.0, 0.8, 0.0), DVec3::NEG_Y), material);
    check("ring light", &scene, &over_ground(0.3, 0.0), 128, |p| {
        let r = p.x.hypot(p.z);
        4.0 * (disk_irradiance(r, 0.5, 0.8) - disk_irradiance(r, 0.2, 0.8))
    });
}

/// Corners of a tilted rectangle above the ground, bright side down.
fn tilted() -> (DAffine3, [DVec3; 4]) {
    let placed = facing(DVec3::new(-0.4, 1.0, 0.3), DVec3::new(0.5, -1.0, 0.2));
    let corners = [(-0.4, -0.25), (0.4, -0.25), (0.4, 0.25), (-0.4, 0.25)];
    (placed, corners.map(|(x, y)| placed.transform_point3(DVec3::new(x, y, 0.0))))
}

#[test]
fn rectangle_light_over_a_plane() {
    let (placed, corners) = tilted();
    let mut scene = scene();
    let material = lamp(&mut scene, 4.0);
    put(&mut scene, rectangle(0.8, 0.5), placed, material);
    check("rectangle light", &scene, &over_ground(0.0, 0.0), 128, |p| {
        4.0 * polygon_irradiance(p, &corners)
    });
}

#[test]
fn mesh_light_over_a_plane() {
    // The triangles are of very different sizes, and a transform that mirrors and stretches moves
    // them.
    let placed = at(-0.2, 1.0, 0.1) * DAffine3::from_scale(DVec3::new(-0.5, 1.0, 0.7));
    let corners = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 0.9)];
    let positions: Vec<Vec3> = corners.iter().map(|&(x, z)| Vec3::new(x, 0.0, z)).collect();
    // The triangles are counterclockwise as seen from below, the bright side, because the mirrored
    // mesh is reversed.
    let indices = vec![[0, 4, 1], [4, 2, 1], [4, 3, 2]];
    let mut scene = scene();
    let lamp = Material {
        emits_on_both_sides: false,
        ..Material::new("lamp", Black {}).emitting(Rgb::splat(2.0))
    };
    let material = scene.add_material(lamp);
    let mesh = TriangleMesh { positions: positions.clone(), indices, ..TriangleMesh::default() };
    put_mesh(&mut scene, mesh, placed, material);
    let outline: Vec<DVec3> = [0, 1, 2, 3]
        .map(|i: usize| placed.transform_point3(positions[i].as_dvec3()))
        .into_iter()
        .collect();
    check("mesh light", &scene, &over_ground(0.0, 0.0), 128, |p| {
        2.0 * polygon_irradiance(p, &outline)
    });
}

#[test]
fn polygon_light_over_a_plane() {
    let corners =
        [(-0.5, -0.4), (0.6, -0.3), (0.3, 0.5), (-0.3, 0.4)].map(|(x, y)| DVec3::new(x, y, 0.0));
    let placed = facing(DVec3::new(0.1, 0.9, 0.0), DVec3::new(-0.2, -1.0, 0.1));
    let mut scene = scene();
    let material = lamp(&mut scene, 2.5);
    let polygon = Polygon::new(corners.to_vec()).expect("the corners lie in a plane");
    put(&mut scene, polygon, placed, material);
    let outline = corners.map(|c| placed.transform_point3(c));
    check("polygon light", &scene, &over_ground(0.0, 0.0), 128, |p| {
        2.5 * polygon_irradiance(p, &outline)
    });
}

#[test]
fn box_light_over_a_plane() {
    let (min, max) = (DVec3::new(-0.3, 0.7, -0.2), DVec3::new(0.3, 1.3, 0.4));
    let mut scene = scene();
    let material = lamp(&mut scene, 2.0);
    put(&mut scene, BoxShape { min, max }, DAffine3::IDENTITY, material);
    let corner = |x: usize, y: usize, z: usize| {
        DVec3::new([min, max][x].x, [min, max][y].y, [min, max][z].z)
    };
    let faces: [[[usize; 3]; 4]; 5] = [
        [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
        [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
        [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    ];
    let outlines = faces.map(|f| f.map(|[x, y, z]| corner(x, y, z)));
    check("box light", &scene, &over_ground(0.0, 0.0), 128, |p| {
        let visible = outlines.iter().filter(|f| {
            let normal = (f[1] - f[0]).cross(f[2] - f[0]);
            normal.dot(p - f[0]) > 0.0
        });
        visible.map(|f| 2.0 * polygon_irradiance(p, f)).sum()
    });
}

#[test]
fn many_lights_add_up() {
    let (placed, corners) = tilted();
    let (center, radius) = (DVec3::new(0.7, 1.5, 0.4), 0.3);
    let mut scene = scene();
    let (rectangle_lamp, sphere_lamp) = (lamp(&mut scene, 4.0), lamp(&mut scene, 9.0));
    put(&mut scene, rectangle(0.8, 0.5), placed, rectangle_lamp);
    put(&mut scene, Sphere { radius }, DAffine3::from_translation(center), sphere_lamp);
    let (position, attenuation) = (DVec3::new(0.3, 1.2, -0.5), Attenuation::INVERSE_SQUARE);
    scene.add_light(Point { position, intensity: Rgb::splat(0.8), attenuation, body_radius: 0.0 });
    scene.add_light(Directional {
        direction: DVec3::new(0.0, -0.8, 0.6),
        irradiance: Rgb::splat(0.5),
    });
    // The lamps cast shadows in the directional light, so the camera looks where there are none.
    check("many lights", &scene, &over_ground(0.0, -1.5), 256, |p| {
        let d = (center - p).length();
        let sphere = 9.0 * PI * (radius / d).powi(2) * center.y / d;
        let point = 0.8 * position.y / (position - p).length().powi(3);
        4.0 * polygon_irradiance(p, &corners) + sphere + point + 0.5 * 0.8
    });
}

#[test]
fn a_sphere_hides_its_share_of_the_sky() {
    let (center, radius) = (DVec3::new(0.2, 1.2, 0.1), 0.8);
    let mut scene = scene();
    let black = scene.add_material(Material::new("black", Black {}));
    put(&mut scene, Sphere { radius }, DAffine3::from_translation(center), black);
    scene.environment = Some(Environment::Constant(Rgb::splat(2.0)));
    let hidden =
        |p: DVec3| (radius / (center - p).length()).powi(2) * center.y / (center - p).length();
    check("sphere before the sky", &scene, &over_ground(0.0, 0.0), 128, |p| {
        2.0 * PI * (1.0 - hidden(p))
    });

    // Ambient occlusion equals this without the reflectance.
    let camera = over_ground(0.0, 0.0);
    let settings = Settings {
        integrator: IntegratorKind::Ao,
        ao_distance: Some(100.0),
        seed: 5,
        ..settings(SIZE, 256)
    };
    let expected: Vec<_> =
        ground_points(&camera, &settings).into_iter().map(|p| [1.0 - hidden(p); 3]).collect();
    compare_exact(&render(&scene, &camera, &settings), &expected)
        .check("ambient occlusion by a sphere");
}

/// A rotation that moves every axis.
fn turned() -> DAffine3 {
    DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1)
}

#[test]
fn a_smooth_environment_image_lights_by_its_harmonics() {
    // For radiance 1 + a . d, a surface with normal n gets pi + 2 pi / 3 a . n.
    let a = [DVec3::new(0.6, -0.3, 0.2), DVec3::new(-0.2, 0.5, 0.6), DVec3::new(0.0, 0.0, -0.9)];
    let image = sky(256, |d| a.map(|a| (1.0 + a.dot(d)) as f32));
    let mut scene = scene();
    let world_from_environment = turned();
    let scale = Rgb::new(1.0, 2.0, 0.5);
    scene.environment = Some(Environment::Image { image, scale, world_from_environment });
    let up = world_from_environment.inverse().transform_vector3(DVec3::Y);
    let irradiance =
        [0, 1, 2].map(|c| f64::from(scale.to_array()[c]) * (PI + 2.0 * PI / 3.0 * a[c].dot(up)));
    for (seed, light_strategy) in (1..).zip(LightStrategy::ALL) {
        let settings = Settings {
            integrator: IntegratorKind::Direct,
            light_strategy,
            seed,
            ..settings(SIZE, 256)
        };
        let expected =
            vec![irradiance.map(|e| e * f64::from(REFLECTANCE) / PI); (SIZE * SIZE) as usize];
        let agreement =
            compare_exact(&render(&scene, &over_ground(0.0, 0.0), &settings), &expected);
        agreement.check(&format!("smooth environment, {}", light_strategy.name()));
    }
}

#[test]
fn a_sun_in_an_environment_image_lights_by_quadrature() {
    // The sky has one bright texel among dark ones. Its radiance follows from the definition of
    // bilinear interpolation, independently of the renderer's lookups.
    let (width, height, sun) = (32, 16, (20, 5));
    let image = image(width, height, 3, |x, y| vec![if (x, y) == sun { 300.0 } else { 0.1 }; 3]);
    let mut scene = scene();
    scene.environment = Some(Environment::Image {
        image,
        scale: Rgb::WHITE,
        world_from_environment: DAffine3::IDENTITY,
    });
    let radiance = |u: f64, v: f64| {
        let tent = |x: f64, center: u32| (1.0 - (x - f64::from(center) - 0.5).abs()).max(0.0);
        0.1 + 299.9 * tent(u * f64::from(width), sun.0) * tent(v * f64::from(height), sun.1)
    };
    let n = 1024;
    let middle = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
    let cell = |(u, v): (f64, f64)| {
        let (sin, cos) = (v * PI).sin_cos();
        radiance(u, v) * cos.max(0.0) * sin * 2.0 * PI * PI / f64::from(n * n)
    };
    let irradiance: f64 = (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .map(|(i, j)| cell((middle(i), middle(j))))
        .sum();
    for strategy in [LightStrategy::Mis, LightStrategy::Light] {
        check_strategy("sun in an image", &scene, &over_ground(0.0, 0.0), 256, strategy, 3, |_| {
            irradiance
        });
    }
    // BSDF samples rarely find the sun: many are needed for a valid test.
    check_strategy(
        "sun in an image",
        &scene,
        &over_ground(0.0, 0.0),
        2000,
        LightStrategy::Bsdf,
        4,
        |_| irradiance,
    );
}

/// A black sheet between the light and the ground, with the opacity `alpha`.
fn veiled(alpha: f32, alpha_mode: AlphaMode) -> Scene {
    let mut scene = scene();
    let veil = Material { alpha_mode, alpha: alpha.into(), ..Material::new("veil", Black {}) };
    let veil = scene.add_material(veil);
    put(&mut scene, rectangle(20.0, 20.0), facing(DVec3::new(0.0, 1.0, 0.0), DVec3::Y), veil);
    scene
}

#[test]
fn blended_surfaces_let_their_share_of_light_through() {
    let direction = DVec3::new(-0.6, -0.8, 0.0);
    let blended = |alpha: f32| 1.0 - f64::from(alpha);
    let masked = |alpha: f32| if alpha >= 0.5 { 0.0 } else { 1.0 };
    for alpha in [0.0, 0.3, 0.5, 0.8, 1.0] {
        for (mode, share) in [
            (AlphaMode::Blend, blended(alpha)),
            (AlphaMode::Mask(0.5), masked(alpha)),
            (AlphaMode::Opaque, 0.0),
        ] {
            let mut under_sun = veiled(alpha, mode);
            under_sun.add_light(Directional { direction, irradiance: Rgb::splat(2.0) });
            let mut under_sky = veiled(alpha, mode);
            under_sky.environment = Some(Environment::Constant(Rgb::splat(1.0)));
            for (scene, irradiance) in [(under_sun, 2.0 * 0.8 * share), (under_sky, PI * share)] {
                let settings = Settings {
                    pixel_position: None,
                    integrator: IntegratorKind::Direct,
                    ..settings(SIZE, 32)
                };
                let film = render(&scene, &over_ground(0.0, 0.0), &settings);
                let expected =
                    vec![[f64::from(REFLECTANCE) / PI * irradiance; 3]; (SIZE * SIZE) as usize];
                // The sheet is finite: its 20 units do not cover the whole sky, so less than half a
                // percent of the light passes below.
                let missing =
                    if scene.environment.is_some() { 0.01 * f64::from(REFLECTANCE) } else { 0.0 };
                let found = image_mean(&film)[0];
                let high = expected[0][0] + missing + 3.0 * found.error + 1e-5;
                let low = expected[0][0] - 3.0 * found.error - 1e-5;
                assert!(
                    low <= found.mean && found.mean <= high,
                    "{mode:?} {alpha}: {found:?}, not {}",
                    expected[0][0]
                );
            }
        }
    }
}

#[test]
fn the_camera_sees_through_a_blended_surface() {
    let mut scene = Scene::new("veil");
    let veil = Material {
        alpha_mode: AlphaMode::Blend,
        alpha: 0.3.into(),
        ..Material::new("veil", Black {})
    };
    let veil = scene.add_material(veil.emitting(Rgb::splat(2.0)));
    put(&mut scene, rectangle(20.0, 20.0), DAffine3::IDENTITY, veil);
    scene.environment = Some(Environment::Constant(Rgb::splat(0.5)));
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 0.5);
    let expected = vec![[0.3 * 2.0 + 0.7 * 0.5; 3]; (SIZE * SIZE) as usize];
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted, IntegratorKind::Raycast] {
        let settings = Settings { integrator, pixel_position: None, ..settings(SIZE, 64) };
        compare_exact(&render(&scene, &camera, &settings), &expected)
            .check(&format!("veil, {}", integrator.name()));
    }
}
