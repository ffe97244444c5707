//! Different methods of rendering a picture agree: strategies, light samplers, random samplers,
//! filters, and the textbook renderer.

use snell_intersect::BuildOptions;
use snell_intersect::shape::{BoxShape, Sphere};
use snell_math::{DAffine3, DVec2, DVec3, Rgb, Vec2, Vec3};
use snell_render::{
    Aov, CompiledScene, Filter, IntegratorKind, LightSamplerKind, LightStrategy, SamplerKind,
    Settings, Shadows, reference,
};
use snell_scene::builtin::builtin;
use snell_scene::material::{Black, ColorParam, Conductor, Dielectric, Mirror, Plastic};
use snell_scene::texture::Wrap;
use snell_scene::{
    Camera, CameraSample, Encoding, Environment, Geometry, ImageTexture, Material, Node, Scene,
    Surface,
};
use snell_tests::scenes::{
    at, everything, facing, ground, image, lamp, matte, put, put_mesh, quad, rectangle, sky,
};
use snell_tests::statistics::{compare, compare_exact};
use snell_tests::{colors, render, render_compiled, settings};
use std::sync::Arc;

/// A scene of rough objects under several lamps and a sky. Light arrives on many paths, none of
/// which is rarely sampled by any strategy.
fn lamps_and_sky() -> (Scene, Camera) {
    let mut scene = Scene::new("lamps and sky");
    ground(&mut scene, 0.6);
    let plastic =
        scene.add_material(Material::new("plastic", Plastic::new(Rgb::new(0.6, 0.2, 0.1), 0.6)));
    let metal = scene.add_material(Material::new("metal", Conductor::copper(0.6)));
    let (paper, warm, cold) =
        (matte(&mut scene, 0.7), lamp(&mut scene, 4.0), lamp(&mut scene, 1.5));
    put(&mut scene, Sphere { radius: 0.7 }, at(-1.0, 0.7, 0.0), plastic);
    put(&mut scene, Sphere { radius: 0.5 }, at(0.6, 0.5, 0.8), metal);
    put(
        &mut scene,
        BoxShape { min: DVec3::ZERO, max: DVec3::new(0.8, 1.2, 0.6) },
        at(0.6, 0.0, -1.0),
        paper,
    );
    put(
        &mut scene,
        rectangle(1.5, 1.0),
        facing(DVec3::new(0.0, 2.5, 0.0), DVec3::new(0.2, -1.0, 0.0)),
        warm,
    );
    put(&mut scene, Sphere { radius: 0.6 }, at(-2.5, 1.5, 1.0), cold);
    let placed = facing(DVec3::new(2.2, 1.0, 0.5), DVec3::new(-1.0, 0.0, 0.0))
        * DAffine3::from_scale(DVec3::splat(1.3));
    put_mesh(&mut scene, quad(), placed, cold);
    let image = sky(16, |d| [0.2, 0.3, 0.5 + 0.4 * d.y as f32]);
    scene.environment = Some(Environment::Image {
        image,
        scale: Rgb::splat(0.6),
        world_from_environment: DAffine3::IDENTITY,
    });
    (scene, Camera::look_at(Vec3::new(0.5, 2.0, 4.5), Vec3::new(0.0, 0.6, 0.0), Vec3::Y, 0.4))
}

#[test]
fn strategies_agree_on_direct_and_indirect_light() {
    let (scene, camera) = lamps_and_sky();
    for integrator in [IntegratorKind::Direct, IntegratorKind::Path] {
        let render = |light_strategy, seed, spp| {
            let settings =
                Settings { integrator, light_strategy, seed, max_depth: 6, ..settings(32, spp) };
            render(&scene, &camera, &settings)
        };
        let mis = render(LightStrategy::Mis, 1, 96);
        let name = |other: &str| format!("{}: mis against {other}", integrator.name());
        compare(&mis, &render(LightStrategy::Light, 2, 96)).check(&name("light"));
        compare(&mis, &render(LightStrategy::Bsdf, 3, 192)).check(&name("bsdf"));
    }
}

#[test]
fn strategies_agree_in_the_cornell_box() {
    let scene = builtin("cornell-box").expect("the scene is built in");
    let render = |light_strategy, seed, spp| {
        let settings = Settings { light_strategy, seed, ..settings(24, spp) };
        render(&scene, &scene.cameras[0], &settings)
    };
    let mis = render(LightStrategy::Mis, 1, 96);
    compare(&mis, &render(LightStrategy::Light, 2, 96)).check("cornell box: mis against light");
    compare(&mis, &render(LightStrategy::Bsdf, 3, 512)).check("cornell box: mis against bsdf");
}

#[test]
fn direct_is_a_path_of_one_bounce() {
    let (scene, camera) = everything();
    let [direct, path] = [IntegratorKind::Direct, IntegratorKind::Path].map(|integrator| {
        render(&scene, &camera, &Settings { integrator, max_depth: 1, ..settings(32, 8) }).image()
    });
    assert_eq!(direct, path);
}

#[test]
fn light_samplers_agree() {
    let (scene, camera) = lamps_and_sky();
    let [uniform, power, bvh] = LightSamplerKind::ALL.map(|light_sampler| {
        let seed = light_sampler as u32 + 10;
        render(
            &scene,
            &camera,
            &Settings { light_sampler, seed, max_depth: 3, ..settings(32, 192) },
        )
    });
    compare(&uniform, &power).check("uniform against power");
    compare(&uniform, &bvh).check("uniform against bvh");
}

#[test]
fn samplers_agree_and_the_good_ones_are_less_noisy() {
    let (scene, camera) = lamps_and_sky();
    let render = |sampler, seed, spp| {
        let settings =
            Settings { sampler, seed, integrator: IntegratorKind::Direct, ..settings(32, spp) };
        render(&scene, &camera, &settings)
    };
    let best = render(SamplerKind::Sobol, 1, 512);
    let mut errors = Vec::new();
    for (sampler, seed) in SamplerKind::ALL.into_iter().zip(2..) {
        let film = render(sampler, seed, 64);
        // For samplers better than the independent one, the spread of the samples overestimates the
        // error.
        compare(&film, &best).check(sampler.name());
        let (a, b) = (colors(&film.image()), colors(&best.image()));
        errors.push(
            a.iter().zip(&b).map(|(a, b)| (a[1] - b[1]).powi(2)).sum::<f64>() / a.len() as f64,
        );
    }
    eprintln!("mean squared errors {errors:?}");
    assert!(errors[1] < 0.8 * errors[0] && errors[2] < 0.6 * errors[0], "{errors:?}");
}

#[test]
fn filters_agree_on_a_ramp() {
    // Any symmetric filter preserves a picture that is linear in the position.
    let mut scene = Scene::new("ramp");
    let ramp =
        scene.add_image(image(2, 1, 3, |x, _| vec![x as f32, 2.0 * x as f32, 1.0 - x as f32]));
    let texture = scene.add_texture(ImageTexture {
        wrap: [Wrap::Clamp; 2],
        ..ImageTexture::new(ramp, Encoding::Linear)
    });
    let emission = ColorParam::textured(Rgb::WHITE, Some(texture));
    let material = scene.add_material(Material { emission, ..Material::new("ramp", Black {}) });
    put_mesh(&mut scene, quad(), DAffine3::from_scale(DVec3::splat(4.0)), material);
    let projection = snell_scene::Projection::Orthographic { half_size: [Some(0.6), Some(0.6)] };
    let camera = Camera::from_direction(DVec3::Z, DVec3::NEG_Z, DVec3::Y, projection);
    // The ramp spans one texel, which is half of the quad's width of 4.
    let value = |x: u32| (f64::from(x) + 0.5 - 16.0) / 16.0 * 0.6 / 2.0 + 0.5;
    let expected: Vec<_> =
        (0..32 * 32).map(|i| value(i % 32)).map(|v| [v, 2.0 * v, 1.0 - v]).collect();
    for (filter, seed) in Filter::ALL.into_iter().zip(1..) {
        for sampler in [SamplerKind::Independent, SamplerKind::Sobol] {
            let settings =
                Settings { filter, seed, sampler, pixel_position: None, ..settings(32, 64) };
            let film = render(&scene, &camera, &settings);
            compare_exact(&film, &expected).check(&format!(
                "{} filter, {}",
                filter.name(),
                sampler.name()
            ));
        }
    }
}

#[test]
fn filters_agree_in_the_mean() {
    // The background is black, so no light that a filter moves between pixels is lost.
    let mut scene = Scene::new("ball");
    let material = lamp(&mut scene, 1.0);
    put(&mut scene, Sphere { radius: 1.0 }, DAffine3::IDENTITY, material);
    let camera = Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 0.3);
    let mut films = Filter::ALL.into_iter().zip(1..).map(|(filter, seed)| {
        let settings = Settings { filter, seed, pixel_position: None, ..settings(48, 256) };
        (filter, snell_tests::statistics::image_mean(&render(&scene, &camera, &settings))[0])
    });
    let (_, expected) = films.next().expect("there are filters");
    for (filter, found) in films {
        let z = found.z_against(&expected);
        eprintln!("{}: {:.5}, z {z:+.2}", filter.name(), found.mean);
        assert!(z.abs() < 3.0, "{filter:?} {found:?} {expected:?}");
    }
}

#[test]
fn the_batched_renderer_agrees_with_the_textbook_on_everything() {
    let (scene, camera) = everything();
    let scene = CompiledScene::new(&scene, &BuildOptions::default()).expect("the scene compiles");
    let base = Settings { size: [23, 17], spp: 3, max_depth: 5, ..Settings::default() };
    let mut all = Vec::new();
    for integrator in IntegratorKind::ALL.into_iter().filter(|i| *i != IntegratorKind::Aov) {
        all.push(Settings { integrator, ..base.clone() });
    }
    for light_strategy in LightStrategy::ALL {
        all.push(Settings {
            light_strategy,
            light_sampler: LightSamplerKind::Uniform,
            ..base.clone()
        });
    }
    for shadows in Shadows::ALL {
        all.push(Settings {
            shadows,
            integrator: IntegratorKind::Whitted,
            filter: Filter::Mitchell,
            ..base.clone()
        });
    }
    for settings in all {
        let batched = colors(&render_compiled(&scene, &camera, &settings, 2).image());
        for (i, (a, b)) in
            batched.iter().zip(&reference::ray_cast(&scene, &camera, &settings)).enumerate()
        {
            let b = b.to_array().map(f64::from);
            let scale = b.iter().fold(1.0, |s: f64, x| s.max(x.abs()));
            let largest = (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f64::max);
            assert!(largest < 2e-5 * scale, "{:?} pixel {i}: {a:?} {b:?}", settings.integrator);
        }
    }
}

#[test]
fn strategies_agree_behind_glass() {
    // Through smooth glass only bounces find the lamp; through frosted glass and on metal, both
    // methods do. The lamp is large, so none of these paths is rare.
    let mut scene = Scene::new("caustics");
    let walls = matte(&mut scene, 0.6);
    put(
        &mut scene,
        BoxShape { min: DVec3::new(-3.0, 0.0, -3.0), max: DVec3::new(3.0, 3.2, 5.0) },
        DAffine3::IDENTITY,
        walls,
    );
    let glass = scene.add_material(Material::new("glass", Dielectric::smooth(1.5)));
    let frosted = scene.add_material(Material::new("frosted", Dielectric::rough(1.5, 0.5)));
    let mirror = scene.add_material(Material::new("mirror", Mirror::new(Rgb::splat(0.9))));
    let glow = lamp(&mut scene, 1.0);
    put(&mut scene, Sphere { radius: 0.6 }, at(-0.9, 0.7, 0.0), glass);
    put(&mut scene, Sphere { radius: 0.6 }, at(0.9, 0.7, 0.0), frosted);
    put(
        &mut scene,
        rectangle(3.0, 2.0),
        facing(DVec3::new(0.0, 1.0, -1.5), DVec3::new(0.0, 0.2, 1.0)),
        mirror,
    );
    put(&mut scene, rectangle(4.0, 4.0), facing(DVec3::new(0.0, 3.0, 0.0), DVec3::NEG_Y), glow);
    let camera = Camera::look_at(Vec3::new(0.0, 1.6, 4.0), Vec3::new(0.0, 0.5, 0.0), Vec3::Y, 0.4);
    let render = |light_strategy, seed| {
        render(
            &scene,
            &camera,
            &Settings { light_strategy, seed, max_depth: 12, ..settings(32, 256) },
        )
    };
    let mis = render(LightStrategy::Mis, 1);
    compare(&mis, &render(LightStrategy::Light, 2)).check("behind glass: mis against light");
    compare(&mis, &render(LightStrategy::Bsdf, 3)).check("behind glass: mis against bsdf");
}

/// Two clusters of a mesh and balls: with `shared` one node below two parents, otherwise two
/// copies.
fn clusters(shared: bool) -> (Scene, Camera) {
    let mut scene = Scene::new("clusters");
    let (paper, glow) = (matte(&mut scene, 0.7), lamp(&mut scene, 3.0));
    let cluster = |scene: &mut Scene| {
        let ball = Node {
            transform: at(0.0, 1.0, 0.0),
            surfaces: vec![Surface::shape(Sphere { radius: 0.4 }, glow)],
            ..Node::default()
        };
        let quad = Surface::with_material(Geometry::Mesh(Arc::new(quad())), paper);
        let children = vec![scene.add_node(ball)];
        scene.add_node(Node { surfaces: vec![quad], children, ..Node::default() })
    };
    let mut common = None;
    for transform in [
        at(-0.8, 0.0, 0.0),
        at(0.7, 0.1, 0.2)
            * DAffine3::from_rotation_y(0.7)
            * DAffine3::from_scale(DVec3::new(1.1, 0.7, 1.3)),
    ] {
        let child = match common {
            Some(child) if shared => child,
            _ => cluster(&mut scene),
        };
        common = Some(child);
        scene.add_child(scene.root, Node { transform, children: vec![child], ..Node::default() });
    }
    scene.environment = Some(Environment::Constant(Rgb::splat(0.3)));
    (scene, Camera::look_at(Vec3::new(0.0, 0.8, 4.0), Vec3::new(0.0, 0.5, 0.0), Vec3::Y, 0.3))
}

#[test]
fn instances_look_like_copies() {
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted, IntegratorKind::Ao] {
        let picture = |shared, seed| {
            let (scene, camera) = clusters(shared);
            render(
                &scene,
                &camera,
                &Settings { integrator, seed, max_depth: 4, ..settings(48, 32) },
            )
        };
        compare(&picture(true, 1), &picture(false, 2))
            .check(&format!("instances, {}", integrator.name()));
    }
}

#[test]
fn layers_of_the_first_hit_are_what_geometry_says() {
    let mut scene = Scene::new("ball");
    let material = matte(&mut scene, 0.25);
    let (center, radius) = (DVec3::new(0.2, -0.1, 0.0), 0.8);
    put(&mut scene, Sphere { radius }, DAffine3::from_translation(center), material);
    let eye = DVec3::new(0.0, 0.0, 3.0);
    let camera = Camera::look_at(eye.as_vec3(), Vec3::ZERO, Vec3::Y, 0.4);
    let aovs = vec![
        Aov::Depth,
        Aov::Distance,
        Aov::Position,
        Aov::Normal,
        Aov::Facing,
        Aov::Albedo,
        Aov::MaterialId,
    ];
    let settings = Settings { integrator: IntegratorKind::Aov, aovs, ..settings(24, 3) };
    let image = render(&scene, &camera, &settings).image();
    let layer = |aov: Aov| image.layer(aov.name()).expect("the layer was asked for");
    let mut hits = 0;
    for i in 0..24 * 24 {
        let film = DVec2::new(f64::from(i % 24) + 0.5, f64::from(i / 24) + 0.5);
        let d =
            camera.ray(&CameraSample { film, lens: Vec2::ZERO }, [24, 24]).ray.direction.as_dvec3();
        let to_center = center - eye;
        let (b, i) = (to_center.dot(d), i as usize);
        let discriminant = b * b - to_center.length_squared() + radius * radius;
        let distance = b - discriminant.max(0.0).sqrt();
        let close = |aov: Aov, expected: &[f64]| {
            let n = expected.len();
            for (found, expected) in layer(aov).values[i * n..][..n].iter().zip(expected) {
                assert!(
                    (f64::from(*found) - expected).abs() < 1e-4,
                    "{aov:?} of pixel {i}: {found}, not {expected}"
                );
            }
        };
        if discriminant < 0.0 {
            close(Aov::Distance, &[0.0]);
            close(Aov::MaterialId, &[-1.0]);
            continue;
        }
        hits += 1;
        let position = eye + d * distance;
        let normal = (position - center) / radius;
        close(Aov::Distance, &[distance]);
        close(Aov::Depth, &[eye.z - position.z]);
        close(Aov::Position, &position.to_array());
        close(Aov::Normal, &normal.to_array());
        close(Aov::Facing, &[-d.dot(normal)]);
        close(Aov::Albedo, &[0.25; 3]);
        close(Aov::MaterialId, &[0.0]);
    }
    assert!(hits > 100, "{hits}");
}
