//! Every way of choosing lights gives the same picture and the same bits, with every kind of light
//! in one scene; invalid lights do no harm.

use snell_intersect::BuildOptions;
use snell_intersect::shape::{BoxShape, Disk, Sphere, Triangle};
use snell_math::{DAffine3, DVec3, Rgb, Vec3};
use snell_render::{
    CompiledScene, Film, IntegratorKind, LightSamplerKind, LightStrategy, Moving, Settings,
};
use snell_scene::light::{self, Attenuation, Directional, Point, Spot, SpotFalloff};
use snell_scene::material::{Black, ColorParam, Conductor};
use snell_scene::medium::{Grid, ScalarGrid};
use snell_scene::{
    Camera, Encoding, Environment, Geometry, ImageTexture, Material, Node, Pose, Scene, Surface,
};
use snell_tests::scenes::{
    at, facing, ground, image, lamp, matte, put, put_mesh, quad, rectangle, sky,
};
use snell_tests::statistics::compare;
use snell_tests::{bits, colors, render, render_compiled, settings};
use std::sync::Arc;

/// A small room open to a sky, with surfaces and lamps of every kind.
fn every_light(with_points: bool) -> (Scene, Camera) {
    let mut scene = Scene::new("every light");
    ground(&mut scene, 0.6);
    let (paper, glow, dim) = (matte(&mut scene, 0.7), lamp(&mut scene, 6.0), lamp(&mut scene, 1.0));
    let metal = scene.add_material(Material::new("metal", Conductor::copper(0.5)));
    put(
        &mut scene,
        BoxShape { min: DVec3::ZERO, max: DVec3::new(0.7, 1.0, 0.7) },
        at(0.2, 0.0, -0.9),
        paper,
    );
    put(&mut scene, Sphere { radius: 0.4 }, at(-0.7, 0.4, 0.3), metal);
    put(&mut scene, rectangle(4.0, 3.0), facing(DVec3::new(0.0, 1.5, -1.6), DVec3::Z), paper);
    // Analytic lamps, one of which touches a wall.
    put(&mut scene, Sphere { radius: 0.15 }, at(-1.2, 1.2, -1.45), glow);
    put(
        &mut scene,
        Disk { radius: 0.4, inner_radius: 0.1 },
        facing(DVec3::new(1.0, 1.8, 0.0), DVec3::NEG_Y),
        glow,
    );
    put(
        &mut scene,
        rectangle(0.8, 0.2),
        facing(DVec3::new(-0.4, 2.0, 0.2), DVec3::new(0.2, -1.0, -0.3)),
        glow,
    );
    let corners =
        [DVec3::new(1.4, 0.1, 0.4), DVec3::new(1.5, 0.9, 0.2), DVec3::new(1.4, 0.2, -0.8)];
    put(&mut scene, Triangle { vertices: corners }, DAffine3::IDENTITY, dim);
    let stretched = at(0.9, 0.3, 0.8) * DAffine3::from_scale(DVec3::new(0.3, 0.1, 0.2));
    put(&mut scene, Sphere { radius: 0.8 }, stretched, dim);
    // An instanced mesh with a texture that emits on both sides.
    let picture = image(4, 4, 3, |x, y| vec![x as f32 * 2.0, f32::from(y == 1) * 9.0, 0.5]);
    let picture = scene.add_image(picture);
    let texture = Some(scene.add_texture(ImageTexture::new(picture, Encoding::Linear)));
    let emission = ColorParam::textured(Rgb::splat(1.0), texture);
    let screen =
        Material { emission, emits_on_both_sides: true, ..Material::new("screen", Black {}) };
    let screen = scene.add_material(screen);
    let surfaces = vec![Surface::with_material(Geometry::Mesh(Arc::new(quad())), screen)];
    let shared = scene.add_node(Node { surfaces, ..Node::default() });
    for (x, turn) in [(-1.5, 1.2), (0.1, -0.4)] {
        let transform = at(x, 0.8, 0.9)
            * DAffine3::from_rotation_y(turn)
            * DAffine3::from_scale(DVec3::splat(0.5));
        scene.add_child(scene.root, Node { transform, children: vec![shared], ..Node::default() });
    }
    put_mesh(&mut scene, quad(), at(0.5, 1.4, -1.5) * DAffine3::from_scale(DVec3::splat(0.3)), dim);
    if with_points {
        let attenuation = Attenuation::INVERSE_SQUARE;
        let falloff = SpotFalloff::Smooth { inner: 0.3, outer: 0.6 };
        let position = DVec3::new(0.5, 1.7, 0.7);
        scene.lights = vec![
            Point {
                position: DVec3::new(-0.2, 0.3, -0.6),
                intensity: Rgb::splat(0.1),
                attenuation,
                body_radius: 0.0,
            }
            .into(),
            Spot {
                position,
                direction: DVec3::NEG_Y,
                intensity: Rgb::splat(1.0),
                attenuation,
                falloff,
            }
            .into(),
            Directional {
                direction: DVec3::new(0.3, -0.9, -0.2).normalize(),
                irradiance: Rgb::splat(0.2),
            }
            .into(),
            Point {
                position,
                intensity: Rgb::splat(0.1),
                attenuation: Attenuation::NONE,
                body_radius: 0.0,
            }
            .into(),
        ];
    }
    let image = sky(32, |d| [0.1, 0.2, if d.y > 0.7 && d.x > 0.0 { 4.0 } else { 0.3 }]);
    scene.environment = Some(Environment::Image {
        image,
        scale: Rgb::splat(0.5),
        world_from_environment: DAffine3::IDENTITY,
    });
    (scene, Camera::look_at(Vec3::new(0.3, 1.4, 4.2), Vec3::new(0.0, 0.7, 0.0), Vec3::Y, 0.4))
}

#[test]
fn all_choices_of_lights_give_the_same_picture() {
    let (scene, camera) = every_light(true);
    let picture = |light_sampler, light_strategy, seed, spp| {
        let settings =
            Settings { light_sampler, light_strategy, seed, max_depth: 3, ..settings(24, spp) };
        render(&scene, &camera, &settings)
    };
    let tree = picture(LightSamplerKind::Bvh, LightStrategy::Mis, 11, 512);
    let cases = [
        (LightSamplerKind::Uniform, LightStrategy::Mis, 512),
        (LightSamplerKind::Power, LightStrategy::Mis, 512),
        (LightSamplerKind::Bvh, LightStrategy::Light, 256),
        (LightSamplerKind::Bvh, LightStrategy::Bsdf, 1024),
    ];
    for (seed, (sampler, strategy, spp)) in (12..).zip(cases) {
        let name = format!("bvh, mis against {}, {}", sampler.name(), strategy.name());
        compare(&tree, &picture(sampler, strategy, seed, spp)).check(&name);
    }
}

#[test]
fn threads_do_not_change_a_bit_of_a_scene_of_many_lights() {
    let (scene, camera) = every_light(true);
    let settings = Settings { max_depth: 4, integrator: IntegratorKind::Path, ..settings(24, 17) };
    let compiled = CompiledScene::new(&scene, &settings.build).expect("the scene compiles");
    let one = bits(&render_compiled(&compiled, &camera, &settings, 1).image());
    for threads in 2..=4 {
        assert_eq!(
            bits(&render_compiled(&compiled, &camera, &settings, threads).image()),
            one,
            "{threads} threads"
        );
    }
}

/// With zero size, infinite power or NaN, the picture stays finite, and valid lights still
/// illuminate.
#[test]
fn lights_that_make_no_sense_do_no_harm() {
    let (mut scene, camera) = every_light(false);
    let attenuation = Attenuation::INVERSE_SQUARE;
    for x in [0.0, 1e-30, 1e30, f64::INFINITY, f64::NAN] {
        let position = DVec3::new(x, 1.0, 0.5);
        for strength in [0.0, f32::INFINITY, f32::NAN, -1.0, f32::MAX] {
            let intensity = Rgb::splat(strength);
            scene.add_light(Point { position, intensity, attenuation, body_radius: x });
            let direction = DVec3::new(x, 0.0, 0.0);
            scene.add_light(light::Disk {
                position,
                direction,
                radius: x,
                emission: intensity,
                attenuation,
            });
            let falloff = SpotFalloff::Smooth { inner: x, outer: x };
            scene.add_light(Spot { position, direction, intensity, attenuation, falloff });
        }
        let broken = lamp(&mut scene, x as f32);
        put(&mut scene, Sphere { radius: 1e-30 }, at(0.1, 0.5, 0.1), broken);
        put(&mut scene, rectangle(0.0, 1.0), at(0.1, 0.5, 0.1), broken);
        put(&mut scene, rectangle(1e-20, 1.0), at(0.1, 0.5, 0.1), broken);
    }
    for light_sampler in LightSamplerKind::ALL {
        let film =
            render(&scene, &camera, &Settings { light_sampler, max_depth: 2, ..settings(12, 8) });
        assert!(colors(&film.image()).iter().flatten().all(|c| c.is_finite()), "{light_sampler:?}");
    }
}

/// Variance of one sample in the median pixel.
fn typical_noise(film: &Film, spp: u32) -> f64 {
    let mut variances: Vec<f64> =
        colors(&film.variance()).iter().map(|c| c[1] * f64::from(spp)).collect();
    variances.sort_by(f64::total_cmp);
    variances[variances.len() / 2]
}

/// A rotating lamp of triangles and a ball flying by, within a group that moves too; and their
/// poses while the shutter is open.
fn moving_lamps() -> (Scene, Camera, Moving) {
    let mut scene = Scene::new("moving lamps");
    ground(&mut scene, 0.6);
    let (paper, glow) = (matte(&mut scene, 0.7), lamp(&mut scene, 6.0));
    put(
        &mut scene,
        BoxShape { min: DVec3::ZERO, max: DVec3::new(0.5, 0.8, 0.5) },
        at(0.3, 0.0, -0.6),
        paper,
    );
    let panel = Surface::with_material(Geometry::Mesh(Arc::new(quad())), glow);
    let small = DAffine3::from_scale(DVec3::splat(0.7));
    let panel_at = |x: f64, angle: f64| at(x, 0.6, 0.4) * DAffine3::from_rotation_x(angle) * small;
    let ball = Surface::shape(Sphere { radius: 0.3 }, glow);
    let ball_at = |x: f64, y: f64| at(x, y, 0.0);
    let turning = scene.add_node(Node {
        surfaces: vec![panel],
        transform: panel_at(-0.9, 1.2),
        ..Node::named("turning")
    });
    let flying = scene.add_node(Node {
        surfaces: vec![ball],
        transform: ball_at(-0.4, 1.2),
        ..Node::named("flying")
    });
    let group = Node { children: vec![turning, flying], ..Node::named("group") };
    let group = scene.add_child(scene.root, group);
    let pose = |k: f64| Pose {
        transforms: [
            (turning, panel_at(-0.9 + 0.5 * k, 1.2 + 0.8 * k)),
            (flying, ball_at(-0.4 + 1.4 * k, 1.2 - 0.3 * k * k)),
            (group, at(0.0, 0.1 * k, 0.3 * k)),
        ]
        .into(),
        ..Pose::default()
    };
    let moving =
        Moving { nodes: [turning, flying, group].into(), later: vec![pose(0.5), pose(1.0)] };
    (
        scene,
        Camera::look_at(Vec3::new(0.2, 3.6, 2.0), Vec3::new(0.0, 0.2, 0.0), Vec3::Y, 0.3),
        moving,
    )
}

#[test]
fn lamps_that_move_while_the_shutter_is_open_are_sampled_where_they_are() {
    let (scene, camera, moving) = moving_lamps();
    let compiled = CompiledScene::moving(&scene, &moving, &BuildOptions::default(), None)
        .expect("the scene compiles");
    let picture = |light_sampler, light_strategy, seed, spp| {
        let settings =
            Settings { light_sampler, light_strategy, seed, max_depth: 2, ..settings(24, spp) };
        render_compiled(&compiled, &camera, &settings, 2)
    };
    let by_chance = picture(LightSamplerKind::Bvh, LightStrategy::Bsdf, 30, 1024);
    let cases = [
        (LightSamplerKind::Bvh, LightStrategy::Mis),
        (LightSamplerKind::Bvh, LightStrategy::Light),
        (LightSamplerKind::Power, LightStrategy::Mis),
    ];
    for (seed, (sampler, strategy)) in (31..).zip(cases) {
        let sampled = picture(sampler, strategy, seed, 256);
        compare(&by_chance, &sampled)
            .check(&format!("moving lamps by {}, {strategy:?}", sampler.name()));
        let (noise, noise_by_chance) =
            (typical_noise(&sampled, 256), typical_noise(&by_chance, 1024));
        eprintln!("variance of a sample {noise:.4}, by chance {noise_by_chance:.4}");
        assert!(noise < 0.6 * noise_by_chance, "lamps were not sampled");
    }
}

/// A flame over the ground, part of whose emission lies outside of its bounds, seen through a pane
/// of glass.
fn flame() -> (Scene, Camera) {
    let mut scene = Scene::new("flame");
    ground(&mut scene, 0.6);
    let paper = matte(&mut scene, 0.7);
    put(
        &mut scene,
        BoxShape { min: DVec3::ZERO, max: DVec3::new(0.4, 0.8, 0.4) },
        at(0.5, 0.0, -0.6),
        paper,
    );
    let n = 16;
    let value = |i: usize| {
        let [x, y, z] = [i % n, i / n % n, i / n / n].map(|c| (c as f32 + 0.5) / n as f32 - 0.5);
        (1.0 - 9.0 * (x * x + z * z + 0.3 * y * y)).max(0.0)
    };
    let density =
        ScalarGrid::new([n; 3], (0..n * n * n).map(value).collect()).expect("as many as cells");
    let place = at(-0.9, 0.05, -0.4) * DAffine3::from_scale(DVec3::new(0.8, 1.2, 0.8));
    let grid = Grid::new(Rgb::new(0.3, 0.6, 1.2), Rgb::new(1.0, 0.8, 0.5), 0.3, density, place);
    let fire = scene.add_medium(Grid { emission: Rgb::new(9.0, 4.0, 1.0), ..grid });
    let air = scene.add_material(Material::interface("flame", fire));
    put(
        &mut scene,
        BoxShape { min: DVec3::ZERO, max: DVec3::new(0.8, 0.9, 0.6) },
        at(-0.9, 0.05, -0.3),
        air,
    );
    (scene, Camera::look_at(Vec3::new(0.2, 3.6, 2.0), Vec3::new(0.0, 0.2, 0.0), Vec3::Y, 0.3))
}

#[test]
fn media_that_glow_are_sampled_as_lights() {
    let (scene, camera) = flame();
    let compiled =
        CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles");
    let picture = |light_sampler, light_strategy, seed, spp| {
        let settings =
            Settings { light_sampler, light_strategy, seed, max_depth: 3, ..settings(24, spp) };
        render_compiled(&compiled, &camera, &settings, 2)
    };
    let by_chance = picture(LightSamplerKind::Bvh, LightStrategy::Bsdf, 40, 512);
    for (seed, sampler) in (41..).zip([LightSamplerKind::Bvh, LightSamplerKind::Uniform]) {
        let both = picture(sampler, LightStrategy::Mis, seed, 256);
        compare(&by_chance, &both).check(&format!("flame by {}", sampler.name()));
        let (noise, noise_by_chance) = (typical_noise(&both, 256), typical_noise(&by_chance, 512));
        eprintln!("variance of a sample {noise:.5}, by chance {noise_by_chance:.5}");
        assert!(noise < 0.6 * noise_by_chance, "the flame was not sampled");
    }
}
