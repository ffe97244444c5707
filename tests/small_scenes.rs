//! Twenty small scenes, each of one kind of material, light or medium. Every way of rendering a
//! scene gives the same picture, by z-tests of the means, and of every pixel where both ways are
//! efficient; each family of tests is judged at a significance of 0.01 (Sidak).

use snell_intersect::BuildOptions;
use snell_intersect::shape::{BoxShape, Disk, Sphere};
use snell_math::statistics::sidak_deviation;
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb, Vec3};
use snell_render::{
    CompiledScene, Film, Guiding, IntegratorKind, LightSamplerKind, LightStrategy, Settings,
};
use snell_scene::light::{
    Attenuation, Directional, IntensityTable, Point, Profile, Projector, Slide, Spot, SpotFalloff,
};
use snell_scene::material::{
    Conductor, Dielectric, Diffuse, Interior, MaterialKind, MetallicRoughness, OpenPbr, Phong,
    Plastic,
};
use snell_scene::medium::{Grid, HeightFog, Homogeneous, Medium, ScalarGrid};
use snell_scene::{Camera, Environment, Material, Scene};
use snell_tests::render_compiled;
use snell_tests::scenes::{
    at, facing, ground, image, lamp, matte, put, put_mesh, quad, rectangle, sky,
};
use snell_tests::statistics::{image_mean, pixel_z};

/// A scene with a ground and a box beside the place for objects, without light.
fn stage(name: &str) -> Scene {
    let mut scene = Scene::new(name);
    ground(&mut scene, 0.6);
    let paper = matte(&mut scene, 0.7);
    put(
        &mut scene,
        BoxShape { min: DVec3::ZERO, max: DVec3::new(0.7, 1.3, 0.6) },
        at(0.8, 0.0, -0.8),
        paper,
    );
    scene
}

/// Adds a lamp above, and a sky.
fn light_up(scene: &mut Scene) {
    let glow = lamp(scene, 5.0);
    put(
        scene,
        rectangle(1.5, 1.0),
        facing(DVec3::new(-0.3, 2.4, 0.4), DVec3::new(0.1, -1.0, 0.0)),
        glow,
    );
    put_sky(scene, |d| [0.2, 0.3, 0.4 + 0.3 * d.y as f32]);
}

fn put_sky(scene: &mut Scene, radiance: impl Fn(DVec3) -> [f32; 3]) {
    let world_from_environment = DAffine3::from_rotation_y(0.4);
    scene.environment = Some(Environment::Image {
        image: sky(32, radiance),
        scale: Rgb::splat(0.7),
        world_from_environment,
    });
}

fn ball(name: &str, kind: impl Into<MaterialKind>) -> Scene {
    let mut scene = stage(name);
    let material = scene.add_material(Material::new(name, kind));
    put(&mut scene, Sphere { radius: 0.7 }, at(-0.3, 0.7, 0.0), material);
    light_up(&mut scene);
    scene
}

/// A ball of grey plastic under one light.
fn lit(name: &str, light: impl FnOnce(&mut Scene)) -> Scene {
    let mut scene = stage(name);
    let grey = scene.add_material(Material::new("grey", Plastic::new(Rgb::splat(0.5), 0.5)));
    put(&mut scene, Sphere { radius: 0.6 }, at(-0.3, 0.6, 0.0), grey);
    light(&mut scene);
    scene
}

/// A medium in a box that is visible only by its contents.
fn filled(name: &str, medium: impl Into<Medium>) -> Scene {
    let mut scene = stage(name);
    let medium = scene.add_medium(medium);
    let air = scene.add_material(Material::interface("air", medium));
    put(
        &mut scene,
        BoxShape { min: DVec3::ZERO, max: DVec3::new(1.4, 1.2, 1.2) },
        at(-1.1, 0.05, -0.4),
        air,
    );
    light_up(&mut scene);
    scene
}

/// A ball of glass with coloured water and a denser ball in it.
fn nested() -> Scene {
    let mut scene = stage("things in things");
    let water = Homogeneous::scattering(Rgb::new(0.8, 1.0, 2.0), Rgb::splat(0.7), 0.3);
    let water = scene.add_medium(water);
    let mut add = |name: &str, ior, medium, priority, radius| {
        let interior = Some(Interior { medium, priority });
        let material = scene.add_material(Material {
            interior,
            ..Material::new(name, Dielectric::rough(ior, 0.4))
        });
        put(&mut scene, Sphere { radius }, at(-0.3, 0.75, 0.0), material);
    };
    add("glass", 1.5, None, 1, 0.7);
    add("water", 1.33, Some(water), 2, 0.6);
    add("stone", 1.7, None, 3, 0.25);
    light_up(&mut scene);
    scene
}

fn open_pbr(set: impl FnOnce(&mut OpenPbr)) -> OpenPbr {
    let mut surface = OpenPbr { base_color: Rgb::new(0.7, 0.4, 0.2).into(), ..OpenPbr::default() };
    surface.specular_roughness = 0.4.into();
    set(&mut surface);
    surface
}

/// Lights without a body: spot, point, sun, a measured profile and a slide.
fn point_lights(scene: &mut Scene) {
    let (attenuation, position) = (Attenuation::INVERSE_SQUARE, DVec3::new(0.4, 2.2, 1.2));
    let falloff = SpotFalloff::Smooth { inner: 0.3, outer: 0.6 };
    let direction = DVec3::new(-0.3, -0.9, -0.4).normalize();
    let world_from_light = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y);
    let table = IntensityTable::from_picture(&image(8, 4, 3, |x, y| {
        vec![x as f32 * 0.2, 0.5, y as f32 * 0.2]
    }));
    let slide =
        Slide::new(&image(4, 4, 3, |x, y| vec![((x + y) % 2) as f32, 0.3, 0.6]), DVec2::splat(0.5));
    let scale = Rgb::splat(1.5);
    scene.lights.extend([
        Spot { position, direction, intensity: Rgb::splat(5.0), attenuation, falloff }.into(),
        Point {
            position: DVec3::new(-1.5, 1.5, 1.0),
            intensity: scale,
            attenuation,
            body_radius: 0.0,
        }
        .into(),
        Directional { direction, irradiance: Rgb::new(0.3, 0.2, 0.1) }.into(),
        Profile { position, world_from_light, scale, table: table.expect("a picture") }.into(),
        Projector {
            position,
            world_from_light,
            scale,
            even: false,
            slide: slide.expect("a picture"),
        }
        .into(),
    ]);
}

fn small_scenes() -> Vec<Scene> {
    let density = (0..512).map(|i| f32::from((i / 3 + i / 64) % 3 != 0) * 0.8 + 0.1).collect();
    let density = ScalarGrid::new([8; 3], density).expect("as many as cells");
    let place = at(-1.1, 0.05, -0.4) * DAffine3::from_scale(DVec3::new(1.4, 1.2, 1.2));
    let smoke = Grid::new(Rgb::new(0.3, 0.5, 1.0), Rgb::new(2.0, 1.5, 1.0), 0.5, density, place);
    vec![
        ball("rough matte", Diffuse::new(Rgb::new(0.8, 0.5, 0.3))),
        ball("oren nayar", open_pbr(|p| p.base_diffuse_roughness = 1.0.into())),
        ball("rough gold", Conductor::gold(0.5)),
        ball(
            "brushed metal",
            open_pbr(|p| {
                p.base_metalness = 1.0.into();
                p.specular_roughness_anisotropy = 0.8.into();
            }),
        ),
        ball("frosted glass", Dielectric::rough(1.5, 0.6)),
        ball(
            "metallic roughness",
            MetallicRoughness {
                clearcoat: 0.8.into(),
                ..MetallicRoughness::new(Rgb::new(0.2, 0.6, 0.3), 0.5, 0.5)
            },
        ),
        ball(
            "coat",
            open_pbr(|p| {
                p.coat_weight = 1.0.into();
                p.coat_roughness = 0.3.into();
            }),
        ),
        ball("fuzz", open_pbr(|p| p.fuzz_weight = 1.0.into())),
        ball(
            "thin film",
            open_pbr(|p| {
                p.thin_film_weight = 1.0.into();
                p.base_metalness = 0.5.into();
            }),
        ),
        ball(
            "wax",
            open_pbr(|p| {
                p.subsurface_weight = 1.0.into();
                p.subsurface_radius = 0.2.into();
            }),
        ),
        ball(
            "phong",
            Phong { specular: Rgb::splat(0.3).into(), shininess: 12.0, ..Phong::default() },
        ),
        lit("ball lamp", |scene| {
            let glow = lamp(scene, 15.0);
            put(scene, Sphere { radius: 0.2 }, at(-1.2, 1.5, 0.6), glow);
        }),
        lit("disk and mesh lamps", |scene| {
            let glow = lamp(scene, 8.0);
            put(
                scene,
                Disk { radius: 0.4, inner_radius: 0.2 },
                facing(DVec3::new(-1.0, 1.8, 0.3), DVec3::NEG_Y),
                glow,
            );
            put_mesh(
                scene,
                quad(),
                facing(DVec3::new(1.2, 1.8, 0.9), DVec3::new(-1.0, -1.0, -0.4)),
                glow,
            );
        }),
        lit("lights without a body", point_lights),
        lit("sunny sky", |scene| {
            put_sky(
                scene,
                |d| if d.y > 0.6 && d.x > 0.4 { [9.0, 8.0, 6.0] } else { [0.3, 0.4, 0.6] },
            )
        }),
        lit("even sky", |scene| {
            scene.environment = Some(Environment::Constant(Rgb::new(0.5, 0.6, 0.7)))
        }),
        filled(
            "coloured fog",
            Homogeneous {
                sigma_a: Rgb::new(0.1, 0.2, 0.4),
                sigma_s: Rgb::new(1.0, 0.8, 0.6),
                emission: Rgb::new(0.0, 0.05, 0.2),
                g: 0.4,
            },
        ),
        filled("fire and smoke", Grid { emission: Rgb::new(2.0, 0.8, 0.2), ..smoke }),
        filled("ground fog", HeightFog::examples().remove(0)),
        nested(),
    ]
}

const SIDE: u32 = 16;

/// The deviations of all comparisons, in standard errors. They are judged together by the largest.
#[derive(Default)]
struct Deviations {
    tests: u32,
    worst: (f64, String),
}

impl Deviations {
    fn add(&mut self, z: f64, what: &str) {
        self.tests += 1;
        if z.abs() > self.worst.0 {
            self.worst = (z.abs(), what.into());
        }
    }

    fn judge(&self, name: &str) {
        // Deviations of both signs count, which doubles the number of tests.
        let limit = sidak_deviation(0.01, 2 * self.tests);
        let (worst, what) = &self.worst;
        eprintln!(
            "{name}: {} z-tests, the worst {worst:.2} of at most {limit:.2} ({what})",
            self.tests
        );
        assert!(*worst < limit, "{name}: {what}: {worst} exceeds {limit}");
    }
}

fn camera() -> Camera {
    Camera::look_at(Vec3::new(0.2, 1.6, 4.2), Vec3::new(-0.1, 0.6, 0.0), Vec3::Y, 0.3)
}

#[test]
fn all_ways_to_render_twenty_small_scenes_agree() {
    let (start, mut pixels, mut means) =
        (std::time::Instant::now(), Deviations::default(), Deviations::default());
    let mut check = |what: &str, a: &Film, b: &Film| {
        // If the few samples of an inefficient way missed some light in a pixel, its estimated
        // spread is too small: there only the means are compared.
        if what.ends_with("guided") || what.ends_with("direct") {
            pixel_z(a, b).into_iter().for_each(|z| pixels.add(z, what));
        }
        let (a, b) = (image_mean(a), image_mean(b));
        (0..3).for_each(|c| means.add(a[c].z_against(&b[c]), what));
    };
    let scenes = small_scenes();
    assert_eq!(scenes.len(), 20);
    for (number, scene) in (0u32..).zip(&scenes) {
        let compiled =
            CompiledScene::new(scene, &BuildOptions::default()).expect("the scene compiles");
        let plain = Settings { max_depth: 6, ..snell_tests::settings(SIDE, 64) };
        let mut seed = 100 * number;
        let mut film = |settings: Settings| {
            seed += 1;
            render_compiled(&compiled, &camera(), &Settings { seed, ..settings }, 4)
        };
        let path = film(plain.clone());
        let guiding = Some(Guiding { passes: 2, photons: 1 << 13 });
        let mut ways = vec![
            (
                "light samples alone",
                Settings { light_strategy: LightStrategy::Light, ..plain.clone() },
            ),
            ("uniform", Settings { light_sampler: LightSamplerKind::Uniform, ..plain.clone() }),
            ("power", Settings { light_sampler: LightSamplerKind::Power, ..plain.clone() }),
            ("guided", Settings { guiding, ..plain.clone() }),
        ];
        if scene.lights.is_empty() {
            ways.push((
                "chance alone",
                Settings { light_strategy: LightStrategy::Bsdf, spp: 128, ..plain.clone() },
            ));
        }
        for (way, settings) in ways {
            check(&format!("{}: path against {way}", scene.name), &path, &film(settings));
        }
        let one = film(Settings { max_depth: 1, ..plain.clone() });
        let direct = film(Settings { max_depth: 1, integrator: IntegratorKind::Direct, ..plain });
        check(&format!("{}: path against direct", scene.name), &one, &direct);
    }
    eprintln!("{:.1} s", start.elapsed().as_secs_f64());
    means.judge("means of small scenes");
    pixels.judge("pixels of small scenes");
}
