//! Caustics by photons: they change only the noise where paths find the same light, and bring what
//! paths cannot find; the bits do not depend on threads, order, splitting or instructions.

use snell_intersect::shape::{BoxShape, Sphere};
use snell_intersect::{BuildOptions, TriangleMesh};
use snell_math::simd::Level;
use snell_math::spectrum::Glass;
use snell_math::{ColorModel, DAffine3, DVec3, Rgb, Vec3};
use snell_render::{
    CausticsMode, CompiledScene, Crop, Guiding, Job, Moving, PhotonCounts, Settings, Split,
    TileOrder,
};
use snell_scene::light::{Directional, Point, Spot, SpotFalloff};
use snell_scene::material::{
    CoatedConductor, Conductor, Dielectric, Diffuse, Interior, MaterialKind, Mirror, OpenPbr,
};
use snell_scene::medium::{Grid, HeightFog, Homogeneous, Medium, ScalarGrid};
use snell_scene::{Camera, Environment, Material, Node, Pose, Projection, Scene, Surface};
use snell_tests::scenes::{at, facing, lamp, matte, put, put_mesh, rectangle, sky};
use snell_tests::{bits, colors, settings};

const ON: CausticsMode = CausticsMode::On;

/// A white ground with a wall, and a ball of this material over it, without light.
fn ball(kind: impl Into<MaterialKind>) -> Scene {
    let mut scene = Scene::new("ball");
    let white = matte(&mut scene, 0.7);
    put(&mut scene, rectangle(20.0, 20.0), facing(DVec3::ZERO, DVec3::Y), white);
    put(&mut scene, rectangle(6.0, 4.0), facing(DVec3::new(0.0, 2.0, -2.5), DVec3::Z), white);
    let material = scene.add_material(Material::new("ball", kind));
    put(&mut scene, Sphere { radius: 0.8 }, at(0.0, 1.1, 0.0), material);
    scene
}

/// A ball under a lamp that is small, but large enough to be met by paths.
fn under_a_lamp(kind: impl Into<MaterialKind>) -> Scene {
    let mut scene = ball(kind);
    let glow = lamp(&mut scene, 30.0);
    put(&mut scene, Sphere { radius: 0.5 }, at(-1.2, 4.2, 0.6), glow);
    scene
}

fn camera() -> Camera {
    Camera::look_at(Vec3::new(0.4, 3.4, 6.5), Vec3::new(0.2, 0.7, 0.0), Vec3::Y, 0.42)
}

/// The mean of a picture over all pixels and some seeds, with its standard error: pixels of a
/// picture share their photons, so only whole pictures are independent.
fn mean(scene: &CompiledScene, camera: &Camera, settings: &Settings, seeds: u32) -> [f64; 2] {
    means(scene, camera, settings, seeds, &[Crop::full(settings.size)])[0]
}

/// The mean of a picture over each of some regions, as [`mean`].
fn means(
    scene: &CompiledScene,
    camera: &Camera,
    settings: &Settings,
    seeds: u32,
    regions: &[Crop],
) -> Vec<[f64; 2]> {
    let one = |seed| -> Vec<f64> {
        let settings = Settings { seed, ..settings.clone() };
        let (film, _) = Job::new(scene, camera, &settings).run(2, &|_| true);
        let pixels = colors(&film.image());
        let [width, _] = settings.size;
        let of = |region: &Crop| {
            let [w, h] = region.size();
            let inside = (region.min[1]..region.max[1]).flat_map(|y| {
                (region.min[0]..region.max[0]).map(move |x| (y * width + x) as usize)
            });
            let sum: f64 = inside.map(|i| pixels[i].iter().sum::<f64>()).sum();
            sum / f64::from(3 * w * h)
        };
        regions.iter().map(of).collect()
    };
    let all: Vec<Vec<f64>> = (0..seeds).map(one).collect();
    let of = |region: usize| {
        let values = || all.iter().map(|values| values[region]);
        let mean = values().sum::<f64>() / f64::from(seeds);
        let spread = values().map(|x| (x - mean) * (x - mean)).sum::<f64>();
        [mean, (spread / f64::from(seeds * (seeds - 1))).sqrt()]
    };
    (0..regions.len()).map(of).collect()
}

/// Settings of pictures with these photons.
fn by(caustics: CausticsMode, spp: u32) -> Settings {
    Settings { caustics, photons: Some(1 << 16), max_depth: 12, ..settings(56, spp) }
}

fn compiled(scene: &Scene) -> CompiledScene {
    CompiledScene::new(scene, &BuildOptions::default()).expect("the scene compiles")
}

/// The scenes in which paths find all light, with names.
fn scenes() -> Vec<(&'static str, Scene)> {
    let clear = OpenPbr {
        transmission_weight: 1.0.into(),
        specular_roughness: 0.1.into(),
        ..OpenPbr::default()
    };
    let pane = OpenPbr { geometry_thin_walled: true, ..clear.clone() };
    let metal = OpenPbr {
        base_metalness: 1.0.into(),
        specular_roughness: 0.2.into(),
        ..OpenPbr::default()
    };
    let mut all = vec![
        ("smooth glass", under_a_lamp(Dielectric::smooth(1.5))),
        ("tinted water", {
            let tint = Rgb::new(0.9, 0.5, 0.7).into();
            under_a_lamp(Dielectric {
                tint,
                absorption: Rgb::new(0.3, 0.1, 0.2),
                ..Dielectric::smooth(1.33)
            })
        }),
        ("rough glass", under_a_lamp(Dielectric::rough(1.5, 0.25))),
        ("less dense than air", under_a_lamp(Dielectric::smooth(0.8))),
        ("mirror", under_a_lamp(Mirror::new(Rgb::new(0.9, 0.8, 0.7)))),
        ("gold", under_a_lamp(Conductor::gold(0.2))),
        ("coated metal", under_a_lamp(CoatedConductor::examples().remove(0))),
        ("clear OpenPBR", under_a_lamp(clear)),
        ("thin OpenPBR", under_a_lamp(pane)),
        ("metal OpenPBR", under_a_lamp(metal)),
        ("flint glass", under_a_lamp(Dielectric::smooth(Glass::SF11))),
    ];
    let mut spot = ball(Dielectric::smooth(1.5));
    spot.environment = Some(Environment::Image {
        image: sky(32, |d| {
            let sun = DVec3::new(0.3, 0.9, 0.3).normalize();
            if d.normalize().dot(sun) > 0.975 { [60.0, 50.0, 40.0] } else { [0.2, 0.3, 0.5] }
        }),
        scale: Rgb::WHITE,
        world_from_environment: DAffine3::IDENTITY,
    });
    all.push(("bright spot in the sky", spot));
    let mut sheet = ball(Dielectric::smooth(1.5));
    let glow = Material::new("glow", Diffuse::new(Rgb::BLACK)).emitting(Rgb::splat(20.0));
    let glow = sheet.add_material(Material { emits_on_both_sides: true, ..glow });
    put(
        &mut sheet,
        rectangle(0.8, 0.9),
        facing(DVec3::new(1.2, 3.4, 0.0), DVec3::new(-0.3, 1.0, 0.1)),
        glow,
    );
    all.push(("lamp of two sides", sheet));
    let mut shade = Scene::new("lamp in a shade");
    let white = matte(&mut shade, 0.7);
    put(&mut shade, rectangle(20.0, 20.0), facing(DVec3::ZERO, DVec3::Y), white);
    let glass = shade.add_material(Material::new("glass", Dielectric::smooth(1.5)));
    let air = shade.add_material(Material::new("air", Dielectric::smooth(1.0 / 1.5)));
    let glow = lamp(&mut shade, 20.0);
    put(&mut shade, Sphere { radius: 0.9 }, at(0.0, 1.5, 0.0), glass);
    put(&mut shade, Sphere { radius: 0.8 }, at(0.0, 1.5, 0.0), air);
    put(&mut shade, Sphere { radius: 0.4 }, at(0.1, 1.5, 0.0), glow);
    all.push(("lamp in a shade", shade));
    let mut nested = ball(Dielectric::smooth(1.0));
    nested.nodes.truncate(nested.nodes.len() - 1);
    nested.nodes[0].children.pop();
    let tea = nested.add_medium(Homogeneous::absorbing(Rgb::new(0.2, 0.5, 1.0)));
    let mut add = |name: &str, ior, medium, priority, radius| {
        let interior = Some(Interior { medium, priority });
        let material = nested
            .add_material(Material { interior, ..Material::new(name, Dielectric::smooth(ior)) });
        put(&mut nested, Sphere { radius }, at(0.0, 1.1, 0.0), material);
    };
    add("glass", 1.5, None, 1, 0.8);
    add("tea", 1.33, Some(tea), 2, 0.65);
    let glow = lamp(&mut nested, 30.0);
    put(&mut nested, Sphere { radius: 0.5 }, at(-1.2, 4.2, 0.6), glow);
    all.push(("tea in glass", nested));
    let mut milk = under_a_lamp(Dielectric::smooth(1.33));
    let medium = milk.add_medium(Homogeneous::scattering(Rgb::splat(0.6), Rgb::splat(0.8), 0.4));
    for material in milk.materials.iter_mut().filter(|material| material.name == "ball") {
        material.interior = Some(Interior { medium: Some(medium), priority: 0 });
    }
    all.push(("cloudy water", milk));
    all
}

#[test]
fn photons_and_paths_agree_where_paths_find_all_light() {
    let mut failed = Vec::new();
    for (name, scene) in scenes() {
        let scene = compiled(&scene);
        for color in ColorModel::ALL {
            if color == ColorModel::Spectral && !["flint glass", "tinted water"].contains(&name) {
                continue;
            }
            let of = |caustics, spp, seeds| {
                let settings = Settings { color, ..by(caustics, spp) };
                mean(&scene, &camera(), &settings, seeds)
            };
            let [on, off] = [of(ON, 32, 5), of(CausticsMode::Off, 96, 5)];
            let z = (on[0] - off[0]) / on[1].hypot(off[1]);
            let ratio = on[0] / off[0];
            eprintln!("{name}, {color:?}: {on:?} {off:?}, z {z:+.2}, ratio {ratio:.4}");
            // Kernels carry a little light beyond edges.
            let bias = 0.004;
            let limit = bias + 3.5 * on[1].hypot(off[1]) / off[0];
            if (ratio - 1.0).abs() > limit {
                failed.push(format!("{name}, {color:?}: {ratio}"));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn photons_find_the_light_of_points_and_of_the_sun_as_that_of_tiny_lamps() {
    let mut by_lamp = ball(Dielectric::smooth(1.5));
    let (place, radius) = (DVec3::new(-1.2, 4.2, 0.6), 0.02);
    let glow = lamp(&mut by_lamp, 1e4);
    put(&mut by_lamp, Sphere { radius }, at(place.x, place.y, place.z), glow);
    let intensity = Rgb::splat(1e4 * std::f32::consts::PI * (radius * radius) as f32);
    let mut by_point = ball(Dielectric::smooth(1.5));
    by_point.add_light(Point { position: place, intensity, ..Point::examples().remove(0) });
    let mut by_spot = ball(Dielectric::smooth(1.5));
    // A cone around the ball that leaves nothing of it out.
    let falloff = SpotFalloff::Power { cutoff: 0.5, exponent: 0.0 };
    let direction = DVec3::new(0.0, 1.1, 0.0) - place;
    let spot = Spot { position: place, intensity, direction, falloff, ..spot_example() };
    by_spot.add_light(spot);
    let of = |scene: &Scene| mean(&compiled(scene), &camera(), &by(ON, 32), 4);
    let agree = |a: [f64; 2], b: [f64; 2]| {
        eprintln!("{a:?} {b:?}");
        assert!((a[0] / b[0] - 1.0).abs() < 0.01 + 3.0 * a[1].hypot(b[1]) / b[0], "{a:?} {b:?}");
    };
    let point = of(&by_point);
    agree(point, of(&by_lamp));
    // What the ball gathers is that of the point.
    let under = |scene: &Scene| {
        let (off, on) = (by(CausticsMode::Off, 32), by(ON, 32));
        let [on, off] = [on, off].map(|how| mean(&compiled(scene), &camera(), &how, 4));
        [on[0] - off[0], on[1].hypot(off[1])]
    };
    let gathered = under(&by_spot);
    assert!(gathered[0] > 0.0);
    agree(gathered, under(&by_point));
    let mut by_sun = ball(Dielectric::smooth(1.5));
    let (direction, irradiance) = (-place, Rgb::splat(2.0));
    by_sun.add_light(Directional { direction, irradiance });
    let mut by_far_point = ball(Dielectric::smooth(1.5));
    let position = place * 200.0;
    let intensity = irradiance * position.length_squared() as f32;
    by_far_point.add_light(Point { position, intensity, ..Point::examples().remove(0) });
    agree(of(&by_sun), of(&by_far_point));
}

fn spot_example() -> Spot {
    Spot::examples().remove(0)
}

/// The sun stands over a ball of glass over a ground. By Snell's and Fresnel's laws, the light
/// that enters at a distance from the axis lands at another one; a camera that does not see the
/// ball sees the sum of what falls into a disk.
#[test]
fn a_ball_gathers_the_light_that_the_integral_says() {
    const IOR: f64 = 1.5;
    /// Of the centre of the ball of radius 1 over the ground.
    const HEIGHT: f64 = 1.6;
    let fresnel = |cos_i: f64, cos_t: f64| {
        let parallel = (IOR * cos_i - cos_t) / (IOR * cos_i + cos_t);
        let across = (cos_i - IOR * cos_t) / (cos_i + IOR * cos_t);
        0.5 * (parallel * parallel + across * across)
    };
    let disk = 0.45;
    // Light that is not reflected inside, and that is reflected there once or twice, in which case
    // it may still go down.
    let gathered: f64 = {
        const N: usize = 200_000;
        (0..N)
            .map(|i| {
                let b = (i as f64 + 0.5) / N as f64;
                let (into, within) = (b.asin(), (b / IOR).asin());
                let f = fresnel(into.cos(), within.cos());
                let annulus = 2.0 * std::f64::consts::PI * b / N as f64;
                (0..30)
                    .map(|inside| {
                        let weight = (1.0 - f) * (1.0 - f) * f.powi(inside);
                        trace(b, inside as u32, IOR, HEIGHT)
                            .filter(|x| x.abs() < disk)
                            .map_or(0.0, |_| weight * annulus)
                    })
                    .sum::<f64>()
            })
            .sum()
    };
    let mut scene = Scene::new("ball");
    let white = matte(&mut scene, 1.0);
    put(&mut scene, rectangle(30.0, 30.0), facing(DVec3::ZERO, DVec3::Y), white);
    let glass = Material::new("glass", Dielectric::smooth(IOR as f32));
    let glass = scene.add_material(Material { visible_to_camera: false, ..glass });
    put(&mut scene, Sphere { radius: 1.0 }, at(0.0, HEIGHT, 0.0), glass);
    scene.add_light(Directional { direction: DVec3::NEG_Y, irradiance: Rgb::splat(1.0) });
    let half = 0.6;
    let camera = Camera {
        projection: Projection::Orthographic { half_size: [Some(half), Some(half)] },
        ..Camera::look_at(Vec3::new(0.0, 6.0, 0.0), Vec3::ZERO, Vec3::Z, 0.5)
    };
    let size = 120;
    let settings =
        Settings { caustics: ON, photons: Some(1 << 17), max_depth: 40, ..settings(size, 16 * 12) };
    let (film, _) = Job::new(&compiled(&scene), &camera, &settings).run(2, &|_| true);
    let pixel = 2.0 * half / f64::from(size);
    let pixels = colors(&film.image());
    let coordinate = |i: usize| (i as f64 + 0.5) * pixel - half;
    let inside = pixels.iter().enumerate().filter(|(i, _)| {
        let (x, y) = (i % size as usize, i / size as usize);
        coordinate(x).hypot(coordinate(y)) < disk
    });
    let seen: f64 = inside.map(|(_, color)| color[0] * std::f64::consts::PI * pixel * pixel).sum();
    eprintln!("{seen} seen, {gathered} gathered");
    // (Light that the ground sends back to the ball, and the ball to the ground, is seen too.)
    assert!(seen > 0.99 * gathered && seen < 1.06 * gathered, "{seen} {gathered}");
}

/// Where light that enters the ball at a distance from the axis lands after some reflections
/// inside; `None` if it does not go down.
fn trace(b: f64, inside: u32, ior: f64, height: f64) -> Option<f64> {
    use snell_math::DVec2;
    let mut point = DVec2::new(b, (1.0 - b * b).sqrt());
    let refract = |d: DVec2, n: DVec2, eta: f64| -> DVec2 {
        let cos = -d.dot(n);
        let under = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt();
        (d / eta + n * (cos / eta - under)).normalize()
    };
    let mut direction = refract(DVec2::NEG_Y, point, ior);
    for bounce in 0..=inside {
        point = (point - direction * (2.0 * point.dot(direction))).normalize();
        if bounce < inside {
            direction = (direction - point * (2.0 * direction.dot(point))).normalize();
        }
    }
    let out = refract(direction, -point, 1.0 / ior);
    (out.y < 0.0).then(|| point.x + out.x / -out.y * (point.y + height))
}

#[test]
fn threads_order_passes_crops_and_instructions_do_not_change_a_bit_of_caustics() {
    let mut scene = under_a_lamp(Dielectric::smooth(1.5));
    let gold = scene.add_material(Material::new("gold", Conductor::gold(0.1)));
    put(&mut scene, Sphere { radius: 0.4 }, at(1.4, 0.4, 0.8), gold);
    scene.add_light(Point { position: DVec3::new(2.0, 3.0, 1.0), ..Point::examples().remove(0) });
    assert_that_no_way_to_render_changes_a_bit(&scene);
}

#[test]
fn threads_order_passes_crops_and_instructions_do_not_change_a_bit_of_shafts_in_fog() {
    let mut scene = under_a_lamp(Dielectric::smooth(1.5));
    scene.medium = Some(scene.add_medium(fog()));
    let gold = scene.add_material(Material::new("gold", Conductor::gold(0.1)));
    put(&mut scene, Sphere { radius: 0.4 }, at(1.4, 0.4, 0.8), gold);
    scene.add_light(Point { position: DVec3::new(2.0, 3.0, 1.0), ..Point::examples().remove(0) });
    let settings = by(ON, 16);
    let photons = {
        let compiled = compiled(&scene);
        let camera = camera();
        let job = Job::new(&compiled, &camera, &settings);
        job.run(1, &|_| true);
        job.photons()
    };
    assert!(photons.is_some_and(|photons| photons.in_media > 1000), "{photons:?}");
    assert_that_no_way_to_render_changes_a_bit(&scene);
}

fn assert_that_no_way_to_render_changes_a_bit(scene: &Scene) {
    for color in ColorModel::ALL {
        let base = Settings {
            size: [37, 29],
            spp: 40,
            seed: 7,
            caustics: ON,
            photons: Some(10_000),
            color,
            ..Settings::default()
        };
        // (Photons are kept with the compiled scene, so each picture has one of its own.)
        let picture = |settings: &Settings, threads| {
            Job::new(&compiled(scene), &camera(), settings).run(threads, &|_| true).0.image()
        };
        let whole = picture(&base, 1);
        for (threads, tile_order, progressive) in [
            (2, TileOrder::Rows, false),
            (3, TileOrder::Reversed, true),
            (4, TileOrder::Shuffled(3), false),
        ] {
            let other = Settings { tile_order, progressive, ..base.clone() };
            assert!(bits(&picture(&other, threads)) == bits(&whole), "{threads} {tile_order:?}");
        }
        let crop = Crop { min: [5, 3], max: [21, 19] };
        let part = picture(&Settings { crop: Some(crop), ..base.clone() }, 2);
        let pixel = |image: &snell_scene::LayeredImage, x: u32, y: u32| {
            let start = (y * image.width + x) as usize * 4;
            image.layers[0].values[start..start + 4].to_vec()
        };
        for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
            assert_eq!(pixel(&part, x, y), pixel(&whole, x + 5, y + 3), "pixel {x}, {y}");
        }
        for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            let build = BuildOptions { simd: level, ..BuildOptions::default() };
            let other = CompiledScene::new(scene, &build).expect("the scene compiles");
            let settings = Settings { build, ..base.clone() };
            let image = Job::new(&other, &camera(), &settings).run(2, &|_| true).0.image();
            assert!(bits(&image) == bits(&whole), "{level:?} {color:?}");
        }
        let camera = camera();
        let compiled = compiled(scene);
        let job = Job::new(&compiled, &camera, &base);
        let mut film = job.empty_film();
        for until in [1, 7, 20, 33, 40] {
            film = job.extend(film, until, 2, &|_| true).0;
        }
        assert!(bits(&film.image()) == bits(&whole), "step by step");
        let mut underway = job.begin(1, &|_| true);
        let mut tasks = underway.tasks(&base, Split { tiles: 2, samples: Some(16) });
        tasks.reverse();
        for task in tasks {
            let result = job.perform(&mut underway, task, 1, &|_| true).expect("nothing ends it");
            assert!(underway.add(result));
        }
        assert!(bits(&underway.film.image()) == bits(&whole), "by tasks");
    }
}

#[test]
fn pixels_that_stop_by_their_error_and_guided_paths_have_photons_too() {
    let scene = compiled(&under_a_lamp(Dielectric::smooth(1.5)));
    let plain = by(CausticsMode::Off, 256);
    let guiding = Some(Guiding { passes: 2, photons: 1 << 13 });
    let expected = mean(&scene, &camera(), &plain, 4);
    for settings in [
        Settings { noise: Some(0.02), ..by(ON, 512) },
        Settings { guiding, ..by(ON, 64) },
        Settings { later_cameras: vec![camera()], ..by(ON, 64) },
    ] {
        let found = mean(&scene, &camera(), &settings, 4);
        let error = expected[1].hypot(found[1]);
        let ratio = found[0] / expected[0];
        eprintln!("{found:?} {expected:?} {ratio}");
        assert!((ratio - 1.0).abs() < 0.01 + 3.5 * error / expected[0]);
    }
}

#[test]
fn photons_are_taken_where_they_help_only() {
    let photons = |scene: &Scene, settings: Settings| -> Option<PhotonCounts> {
        Job::new(&compiled(scene), &camera(), &settings).photons()
    };
    let auto = || by(CausticsMode::Auto, 16);
    let mut tiny = ball(Dielectric::smooth(1.5));
    tiny.add_light(Point { position: DVec3::new(0.0, 4.0, 0.0), ..Point::examples().remove(0) });
    assert!(photons(&tiny, auto()).is_some());
    assert!(photons(&tiny, by(CausticsMode::Off, 16)).is_none());
    assert!(photons(&tiny, Settings { max_depth: 1, ..by(ON, 16) }).is_none());
    // Fog alone receives light.
    let mut lost = Scene::new("ball in fog");
    let glass = lost.add_material(Material::new("ball", Dielectric::smooth(1.5)));
    put(&mut lost, Sphere { radius: 0.8 }, at(0.0, 1.1, 0.0), glass);
    lost.add_light(Point { position: DVec3::new(0.0, 4.0, 0.0), ..Point::examples().remove(0) });
    assert!(photons(&lost, auto()).is_none());
    lost.medium = Some(lost.add_medium(Homogeneous::absorbing(Rgb::splat(0.1))));
    assert!(photons(&lost, auto()).is_none());
    lost.medium = Some(lost.add_medium(fog()));
    assert!(photons(&lost, auto()).is_some());
    // A large lamp is met by paths.
    let mut large = ball(Dielectric::smooth(1.5));
    let glow = lamp(&mut large, 1.0);
    put(&mut large, rectangle(4.0, 4.0), facing(DVec3::new(0.0, 4.0, 0.0), DVec3::NEG_Y), glow);
    assert!(photons(&large, auto()).is_none());
    assert!(photons(&large, by(ON, 16)).is_some_and(|photons| photons.of_pass == 1 << 16));
    // Nothing gathers light.
    let mut matte = ball(Diffuse::new(Rgb::splat(0.5)));
    matte.add_light(Point { position: DVec3::new(0.0, 4.0, 0.0), ..Point::examples().remove(0) });
    assert!(photons(&matte, by(ON, 16)).is_none());
    let even = Scene {
        environment: Some(Environment::Constant(Rgb::WHITE)),
        ..ball(Dielectric::smooth(1.5))
    };
    assert!(photons(&even, by(ON, 16)).is_none());
    assert!(photons(&Scene::new("empty"), by(ON, 16)).is_none());
}

#[test]
fn mirrors_of_the_sun_on_meshes_light_what_they_face() {
    // A sheet of mirror lights a wall in the direction of reflection, as the sun behind it would.
    let mut scene = Scene::new("mirror");
    let white = matte(&mut scene, 0.8);
    put(&mut scene, rectangle(30.0, 30.0), facing(DVec3::new(0.0, 0.0, -3.0), DVec3::Z), white);
    let mirror = scene.add_material(Material::new("mirror", Mirror::new(Rgb::splat(0.5))));
    let corners = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    let mesh = TriangleMesh {
        positions: corners.map(Vec3::from).to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    put_mesh(&mut scene, mesh, DAffine3::IDENTITY, mirror);
    let direction = DVec3::new(0.0, -1.0, -1.0);
    scene.add_light(Directional { direction, irradiance: Rgb::splat(3.0) });
    let camera =
        Camera::look_at(Vec3::new(0.0, 3.0, 4.0), Vec3::new(0.0, 3.0, -3.0), Vec3::Y, 0.02);
    let lit = |caustics| {
        mean(&compiled(&scene), &camera, &Settings { size: [8, 8], ..by(caustics, 64) }, 3)[0]
    };
    // The wall has the sun itself, and half of it again from the mirror.
    let (plain, both) = (lit(CausticsMode::Off), lit(ON));
    let ratio = both / plain;
    assert!((ratio - 1.5).abs() < 0.02, "{both} {plain}");
}

/// A ball of this material high over a white ground, without light, and how fog fills it all.
fn high_ball(kind: impl Into<MaterialKind>, medium: impl Into<Medium>) -> Scene {
    let mut scene = Scene::new("ball in a medium");
    let white = matte(&mut scene, 0.5);
    put(&mut scene, rectangle(20.0, 20.0), facing(DVec3::ZERO, DVec3::Y), white);
    let material = scene.add_material(Material::new("ball", kind));
    put(&mut scene, Sphere { radius: 0.7 }, at(0.0, 2.2, 0.0), material);
    scene.medium = Some(scene.add_medium(medium));
    scene
}

/// A place above the ball, and the radius of a lamp there that paths find.
const LAMP: (DVec3, f64) = (DVec3::new(-0.9, 4.6, 0.3), 0.45);

/// The same with a lamp that is small, but large enough to be met by paths.
fn high_ball_under_a_lamp(kind: impl Into<MaterialKind>, medium: impl Into<Medium>) -> Scene {
    let mut scene = high_ball(kind, medium);
    add_lamp(&mut scene);
    scene
}

fn add_lamp(scene: &mut Scene) {
    let glow = lamp(scene, 40.0);
    let (place, radius) = LAMP;
    put(scene, Sphere { radius }, DAffine3::from_translation(place), glow);
}

/// A camera that sees the ball and the shaft of light below it.
fn camera_of_the_shaft() -> Camera {
    Camera::look_at(Vec3::new(0.3, 2.4, 6.0), Vec3::new(0.2, 1.6, 0.0), Vec3::Y, 0.3)
}

/// The shaft in a picture of 56 x 56 pixels of [`camera_of_the_shaft`].
const SHAFT: Crop = Crop { min: [22, 32], max: [38, 46] };

fn fog() -> Homogeneous {
    Homogeneous::scattering(Rgb::splat(0.15), Rgb::new(0.9, 0.8, 0.7), 0.3)
}

/// Scenes with media that scatter light after casters, in which paths find all light, with names.
fn scenes_with_media() -> Vec<(&'static str, CompiledScene)> {
    let glass = || Dielectric::smooth(1.5);
    let thick = Homogeneous::scattering(Rgb::new(0.8, 1.0, 1.2), Rgb::splat(0.9), -0.3);
    let up = HeightFog {
        sigma_a: Rgb::splat(0.02),
        sigma_s: Rgb::splat(0.4),
        g: 0.5,
        base: DVec3::ZERO,
        up: DVec3::Y,
        scale_height: 1.5,
    };
    let mut all = vec![
        ("fog", compiled(&high_ball_under_a_lamp(glass(), fog()))),
        ("thick fog", compiled(&high_ball_under_a_lamp(glass(), thick))),
        ("height fog", compiled(&high_ball_under_a_lamp(glass(), up))),
        (
            "rough glass in fog",
            compiled(&high_ball_under_a_lamp(Dielectric::rough(1.5, 0.2), fog())),
        ),
        ("gold in fog", compiled(&high_ball_under_a_lamp(Conductor::gold(0.1), fog()))),
        (
            "flint glass in fog",
            compiled(&high_ball_under_a_lamp(Dielectric::smooth(Glass::SF11), fog())),
        ),
    ];
    // The fog of the scene is clear air, and the ball is in a box of smoke.
    let mut smoke = high_ball_under_a_lamp(glass(), Homogeneous::default());
    let n = 6;
    let value = |i: usize| {
        let [x, y, z] = [i % n, i / n % n, i / n / n].map(|c| c as f32 / (n - 1) as f32);
        0.1 + 0.9 * (1.0 - y) * (0.5 + 0.5 * x) + 0.3 * z
    };
    let density = ScalarGrid::new([n; 3], (0..n * n * n).map(value).collect());
    let (min, max) = (DVec3::new(-1.5, 0.2, -1.2), DVec3::new(1.6, 3.4, 1.3));
    let place = DAffine3 { translation: min, ..DAffine3::from_scale(max - min) };
    let (thin, thick) = (Rgb::splat(0.05), Rgb::splat(0.5));
    let grid = Grid::new(thin, thick, 0.4, density.expect("as many as cells"), place);
    let grid = smoke.add_medium(grid);
    let air = smoke.add_material(Material::interface("smoke", grid));
    put(&mut smoke, BoxShape { min, max }, DAffine3::IDENTITY, air);
    all.push(("glass in smoke", compiled(&smoke)));
    // Milk in glass in fog.
    let mut milk = high_ball(glass(), fog());
    let white = milk.add_medium(Homogeneous::scattering(Rgb::splat(1.5), Rgb::splat(0.9), 0.5));
    let interior = Some(Interior { medium: Some(white), priority: 1 });
    let material = Material { interior, ..Material::new("milk", Dielectric::smooth(1.33)) };
    let material = milk.add_material(material);
    put(&mut milk, Sphere { radius: 0.55 }, at(0.0, 2.2, 0.0), material);
    add_lamp(&mut milk);
    all.push(("milk in glass in fog", compiled(&milk)));
    let mut moving = high_ball_under_a_lamp(glass(), fog());
    let material = moving.materials.iter().position(|material| material.name == "ball");
    let material = snell_scene::MaterialId(material.expect("it is there") as u32);
    let small = Surface::shape(Sphere { radius: 0.4 }, material);
    let [from, to] = [at(0.9, 1.2, 0.6), at(0.9, 2.2, 0.6)];
    let node = Node { surfaces: vec![small], transform: from, ..Node::named("moving") };
    let node = moving.add_child(moving.root, node);
    let pose = Pose { transforms: [(node, to)].into(), ..Pose::default() };
    let motion = Moving { nodes: [node].into(), later: vec![pose] };
    let moving = CompiledScene::moving(&moving, &motion, &BuildOptions::default(), None);
    all.push(("moving glass in fog", moving.expect("the scene compiles")));
    all
}

#[test]
fn photons_and_paths_agree_about_light_that_media_scatter() {
    let mut failed = Vec::new();
    for (name, scene) in scenes_with_media() {
        for color in ColorModel::ALL {
            if color == ColorModel::Spectral && name != "flint glass in fog" {
                continue;
            }
            let regions = [Crop::full([56; 2]), SHAFT];
            let of = |caustics, spp, seeds| {
                let settings = Settings { color, ..by(caustics, spp) };
                means(&scene, &camera_of_the_shaft(), &settings, seeds, &regions)
            };
            let [on, off] = [of(ON, 32, 5), of(CausticsMode::Off, 160, 5)];
            for (region, (on, off)) in ["whole", "shaft"].iter().zip(on.iter().zip(&off)) {
                let error = on[1].hypot(off[1]) / off[0];
                let ratio = on[0] / off[0];
                let z = (ratio - 1.0) / error;
                eprintln!(
                    "{name}, {color:?}, {region}: {on:?} {off:?}, z {z:+.2}, ratio {ratio:.4}"
                );
                if (ratio - 1.0).abs() > 0.004 + 3.5 * error {
                    failed.push(format!("{name}, {color:?}, {region}: {ratio}"));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

/// A box of a medium in the shadow of a ball, in the light of a spot. A ball that bends no light
/// changes nothing, but only photons bring light through it.
#[test]
fn a_ball_of_air_casts_no_shadow_into_media() {
    let (min, max) = (DVec3::new(-0.5, 0.2, -0.4), DVec3::new(0.4, 1.4, 0.5));
    let n = 5;
    let density = (0..n * n * n).map(|i| (i % n + i / n % n) as f32 / n as f32).collect();
    let density = ScalarGrid::new([n; 3], density).expect("as many as cells");
    let place = DAffine3 { translation: min, ..DAffine3::from_scale(max - min) };
    let (dim, bright) = (Rgb::new(0.1, 0.2, 0.4), Rgb::new(0.5, 0.4, 0.3));
    let media: [Medium; 5] = [
        fog().into(),
        Homogeneous::scattering(Rgb::new(2.0, 4.0, 8.0), Rgb::splat(0.9), -0.2).into(),
        HeightFog { scale_height: 0.3, ..HeightFog::examples().remove(0) }.into(),
        Grid::new(dim, bright, 0.6, density, place).into(),
        Homogeneous { g: 0.8, ..fog() }.into(),
    ];
    let camera = Camera::look_at(Vec3::new(0.5, 1.8, 3.5), Vec3::new(0.0, 0.8, 0.0), Vec3::Y, 0.25);
    for medium in media {
        let mut without = Scene::new("box");
        let medium = without.add_medium(medium);
        let interface = without.add_material(Material::interface("box", medium));
        put(&mut without, BoxShape { min, max }, DAffine3::IDENTITY, interface);
        let position = DVec3::new(0.0, 5.0, 0.0);
        let intensity = Rgb::splat(30.0);
        // The cone ends within the box, at whose sides photons are missing.
        let falloff = SpotFalloff::Power { cutoff: 0.07, exponent: 0.0 };
        let direction = DVec3::NEG_Y;
        without.add_light(Spot { position, intensity, direction, falloff, ..spot_example() });
        let mut with = without.clone();
        let air = with.add_material(Material::new("ball", Dielectric::smooth(1.0)));
        put(&mut with, Sphere { radius: 0.7 }, at(0.0, 2.2, 0.0), air);
        for color in ColorModel::ALL {
            let of = |scene: &Scene, caustics, spp| {
                let settings = Settings { color, max_depth: 60, ..by(caustics, spp) };
                mean(&compiled(scene), &camera, &settings, 4)
            };
            let expected = of(&without, CausticsMode::Off, 64);
            let [on, off] = [of(&with, CausticsMode::Auto, 64), of(&with, CausticsMode::Off, 8)];
            let error = on[1].hypot(expected[1]) / expected[0];
            let ratio = on[0] / expected[0];
            eprintln!(
                "{}, {color:?}: {on:?} {off:?} {expected:?} {ratio} {error}",
                with.media[0].name()
            );
            assert!((ratio - 1.0).abs() < 0.004 + 3.5 * error, "{on:?} {expected:?}");
            assert!(off[0] == 0.0, "{off:?}");
        }
    }
}
