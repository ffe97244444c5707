//! Russian roulette: which paths end early, and with which probability. A path that has lost
//! nothing goes on, so that what conserves light is free of noise (Arvo and Kirk, Particle
//! Transport and Image Synthesis, 1990; the weights of guided paths are those of Vorba and
//! Křivánek, Adjoint-driven Russian roulette and splitting in light transport simulation, 2016).
//!
//! The contribution of a path is known only where a guiding field is trained, before the first
//! sample. Roulette by what is learnt during the render, from the variance and cost of earlier
//! samples (Rath et al., EARS: Efficiency-aware Russian roulette and splitting, 2022) or from the
//! pixel's value so far, would make a path depend on other samples: the picture would change with
//! threads, tiles, and where a render is resumed or split. So would a first pass over the picture,
//! unless each part of a split render repeats it.

use snell_math::simd::{max, min};

/// The depth from which paths undergo roulette, unless the user gives one.
pub(crate) const EARLY: u32 = 1;
/// The same under a uniform sky, where roulette causes nearly all noise.
pub(crate) const LATE: u32 = 4;

/// From this depth on, paths that have lost nothing may end too.
const LONG: u32 = 4000;

/// Paths undergo roulette if their weight is this many times less than the initial one.
const WINDOW: f32 = 2.0;
/// The field may be wrong.
const LEAST_SURVIVAL: f32 = 0.2;

/// The largest survival probability at this depth; `None` without roulette. `start` is the depth
/// from which there is roulette.
///
/// Paths that lose nothing, in a closed white room, would never end. Of those with [`LONG`]
/// bounces the fraction `LONG / n` reaches `n`: slow enough for the rare long paths out of a thick
/// white cloud, the number of which falls with `n^(-3/2)`, to keep a finite variance.
pub(crate) fn most_survival(start: u32, depth: u32) -> Option<f32> {
    let most = || if depth < LONG { 1.0 } else { 1.0 - 1.0 / depth as f32 };
    (depth >= start).then(most)
}

/// The survival weight of a path where the field is trained, and
/// [`super::PathState::expected`] of its next ray. The expected contribution of the path is
/// compared with the first such value, so that paths on their way to light survive, however small
/// their throughput is, since many were sent there.
#[inline(always)]
pub fn expected_survival(expected: f32, first: f32) -> (f32, f32) {
    let first = if first > 0.0 { first } else { expected };
    (min(max(expected / first * WINDOW, LEAST_SURVIVAL), 1.0), first)
}

/// The survival weight of a path where the field is not trained: the largest channel of its
/// throughput, without the scaling by refraction. Most of a path's contribution often comes from a
/// single event, as through frosted glass to a lamp; so paths that lost little are not ended.
#[inline(always)]
pub fn unknown_survival(throughput: f32) -> f32 {
    throughput * WINDOW
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CompiledScene, Job, LightStrategy, Settings};
    use snell_intersect::{BuildOptions, Sphere};
    use snell_math::{Rgb, Vec3};
    use snell_scene::material::Diffuse;
    use snell_scene::medium::Homogeneous;
    use snell_scene::{Camera, Environment, Material, MediumId, Node, Scene, Surface};

    /// The first channel of all pixels of a picture of a scene from `(0, 0, 5)`.
    fn pixels(scene: &Scene, settings: &Settings) -> Vec<f32> {
        let compiled = CompiledScene::new(scene, &BuildOptions::default()).expect("a valid scene");
        let camera = Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 0.15);
        let image = Job::new(&compiled, &camera, settings).run(1, &|_| true).0.image();
        image.layers[0].values.chunks(4).map(|pixel| pixel[0]).collect()
    }

    /// A sphere of this radius and material.
    fn ball(radius: f64, material: Material) -> Scene {
        let mut scene = Scene::new("ball");
        let material = scene.add_material(material);
        let surfaces = vec![Surface::shape(Sphere { radius }, material)];
        scene.add_child(scene.root, Node { surfaces, ..Node::default() });
        scene
    }

    fn settings(spp: u32) -> Settings {
        Settings { size: [6, 6], spp, ..Settings::default() }
    }

    #[test]
    fn only_paths_that_lost_light_or_are_very_long_undergo_roulette() {
        assert_eq!(most_survival(EARLY, 0), None);
        assert_eq!(most_survival(LATE, 3), None);
        assert_eq!(most_survival(LATE, 4), Some(1.0));
        assert!(unknown_survival(1.0) >= 1.0 && unknown_survival(0.25) == 0.5);
        assert_eq!(expected_survival(1.0, 1.0), (1.0, 1.0));
        let survivors = |to: u32| -> f64 {
            (0..to).map(|depth| f64::from(most_survival(EARLY, depth).unwrap_or(1.0))).product()
        };
        assert_eq!(survivors(LONG), 1.0);
        let fraction = survivors(10 * LONG);
        assert!((fraction - 0.1).abs() < 1e-3, "{fraction}");
    }

    #[test]
    fn a_thick_white_cloud_in_a_white_furnace_is_not_seen_and_has_no_noise() {
        let mut scene = ball(1.0, Material::interface("cloud", MediumId(0)));
        scene.add_medium(Homogeneous::scattering(Rgb::splat(12.0), Rgb::WHITE, 0.0));
        scene.environment = Some(Environment::Constant(Rgb::WHITE));
        for roulette_depth in [None, Some(0)] {
            let settings = Settings { roulette_depth, ..settings(4) };
            for pixel in pixels(&scene, &settings) {
                assert!((pixel - 1.0).abs() < 1e-3, "{pixel}");
            }
        }
    }

    #[test]
    fn paths_that_are_cut_short_are_counted() {
        let mut scene = ball(1.0, Material::interface("cloud", MediumId(0)));
        scene.add_medium(Homogeneous::scattering(Rgb::splat(12.0), Rgb::WHITE, 0.0));
        scene.environment = Some(Environment::Constant(Rgb::WHITE));
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        let camera = Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 0.15);
        let cut = |max_depth| {
            let settings = Settings { max_depth, ..settings(16) };
            let (film, statistics) = Job::new(&compiled, &camera, &settings).run(2, &|_| true);
            let image = film.image();
            let values = image.layers[0].values.chunks(4).map(|pixel| f64::from(pixel[0]));
            let missing = 1.0 - values.sum::<f64>() / 36.0;
            (statistics.cut_paths as f64 / statistics.samples as f64, missing)
        };
        let (share, missing) = cut(20);
        assert!(share > 0.2 && (missing - share).abs() < 1e-3, "{share} {missing}");
        assert_eq!(cut(Settings::MAX_DEPTH).0, 0.0);
    }

    #[test]
    fn without_roulette_a_glowing_cavity_has_no_noise() {
        // Radiance 1 + 1/2 + 1/4 + ... at every point.
        let mut wall = Material::new("wall", Diffuse::new(Rgb::splat(0.5)));
        (wall.emission, wall.emits_on_both_sides) = (Rgb::WHITE.into(), true);
        let scene = ball(10.0, wall);
        let noise = |roulette_depth| {
            let settings = Settings {
                light_strategy: LightStrategy::Bsdf,
                max_depth: 60,
                roulette_depth,
                ..settings(4)
            };
            let off = pixels(&scene, &settings).into_iter().map(|pixel| (pixel - 2.0).abs());
            off.fold(0.0, f32::max)
        };
        let [without, with] = [Some(60), Some(0)].map(noise);
        assert!(without < 1e-4 && with > 1e-2, "{without} {with}");
    }

    #[test]
    fn paths_in_a_closed_white_room_end() {
        let mut room = ball(10.0, Material::new("wall", Diffuse::new(Rgb::WHITE)));
        let lamp = Material::new("lamp", Diffuse::new(Rgb::WHITE)).emitting(Rgb::WHITE);
        let lamp = room.add_material(lamp);
        let surfaces = vec![Surface::shape(Sphere { radius: 0.5 }, lamp)];
        room.add_child(room.root, Node { surfaces, ..Node::default() });
        let settings = Settings { max_depth: Settings::DEEPEST, size: [1, 1], ..settings(2) };
        assert!(pixels(&room, &settings)[0] > 1.5);
    }
}
