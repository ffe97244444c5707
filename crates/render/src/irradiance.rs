//! Irradiance: the light that arrives at points of surfaces, for textures with baked light.
//!
//! The points are shaded as if they were white and matte: what leaves them is what arrives. All
//! that they see keeps its own material, so the light is that of a picture.

use crate::compile::CompiledScene;
use crate::integrator::camera_path::{WAVELENGTH, path_of};
use crate::integrator::{Context, SurfaceVertex, Vertex};
use crate::reference::{Media, leaving};
use crate::sampler::Sampler;
use crate::settings::Settings;
use rayon::prelude::*;
use snell_intersect::AcceptAll;
use snell_math::{Ray, Rgb, Vec3};
use snell_scene::material::{Diffuse, Prepared};
use snell_scene::{CameraRay, Material};
use std::f32::consts::PI;

/// How far from the surface the search for it begins, relative to the extent of the scene: a
/// hundred steps of single precision.
const STEP: f32 = 1e-5;

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The position in the world.
    pub position: Vec3,
    /// The unit normal of the side at which light arrives.
    pub normal: Vec3,
    /// The texel, which selects random numbers.
    pub texel: [u32; 2],
}

/// The irradiance at points: radiance from all directions of the side of the normal, multiplied by
/// the cosine, with all bounces that the settings allow. Used of the settings are the integrator
/// (`path` or `direct`), the number of samples, the seed, the bounces and the choice of lights. At
/// places where no surface is, the irradiance is 0. `None` if `keep_going` returns false.
pub fn irradiance(
    scene: &CompiledScene,
    places: &[Place],
    settings: &Settings,
    keep_going: &(dyn Fn() -> bool + Sync),
) -> Option<Vec<Rgb>> {
    let lights = scene.light_sampler(settings.light_sampler, settings.light_strategy);
    let context = Context { scene, settings, lights: &lights, field: None, wants_lobes: false };
    let white = Material::new("white", Diffuse::new(Rgb::WHITE));
    let prepared = Prepared::of(&white);
    let sampler = Sampler::of(settings);
    let farthest = |place: &Place| place.position.abs().max_element();
    let extent = places.iter().map(farthest).fold(0.0, f32::max);
    let step = STEP * extent.max(f32::MIN_POSITIVE / STEP);
    let of_place = |place: &Place| {
        if !keep_going() {
            return None;
        }
        let ray = Ray {
            t_max: 2.0 * step,
            ..Ray::new(place.position + place.normal * step, -place.normal)
        };
        let hit = scene.world.closest_one(&ray, &AcceptAll);
        if !hit.is_hit() {
            return Some(Rgb::BLACK);
        }
        let interaction = scene.interaction(&ray, 0.0, &hit);
        let mut sum = Rgb::BLACK;
        for number in 0..settings.spp {
            let random = sampler.random(place.texel, number);
            let mode = settings.color.mode(|| random.number(WAVELENGTH));
            let seen = CameraRay { ray, width: 0.0, spread: 0.0, weight: 1.0 };
            let state = path_of(&seen, mode, 0.0);
            let mut media = Media::new(&context, ray.origin, mode);
            let surface = SurfaceVertex {
                hit: &hit,
                interaction: &interaction,
                material: &white,
                prepared: &prepared,
                footprint: 0.0,
                mode,
                outside_ior: 1.0,
            };
            let vertex = Vertex {
                depth: 0,
                ray: &ray,
                state: &state,
                random: random.at_vertex(state.stream, 0),
                surface: Some(surface),
                medium: None,
            };
            sum = sum + mode.to_rgb(leaving(&context, &vertex, random, &mut media));
        }
        // A white matte surface reflects 1 / pi of its irradiance in each direction.
        Some(sum * (PI / settings.spp.max(1) as f32))
    };
    places.par_iter().map(of_place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::TriangleMesh;
    use snell_intersect::shape::{BoxShape, Disk};
    use snell_math::{DAffine3, DVec3};
    use snell_scene::light::{Attenuation, Point};
    use snell_scene::{Environment, Geometry, Node, Scene, Surface};
    use std::sync::Arc;

    fn at(scene: &Scene, position: Vec3, settings: &Settings) -> Rgb {
        let compiled = CompiledScene::new(scene, &settings.build).expect("a valid scene");
        let place = Place { position, normal: Vec3::Z, texel: [3, 5] };
        irradiance(&compiled, &[place], settings, &|| true).expect("it ends")[0]
    }

    fn settings(spp: u32, max_depth: u32) -> Settings {
        Settings { spp, max_depth, ..Settings::default() }
    }

    fn floor(scene: &mut Scene, reflectance: f32) {
        let grey = Diffuse::new(Rgb::splat(reflectance));
        let grey = scene.add_material(Material::new("grey", grey));
        let slab = BoxShape { min: DVec3::new(-9.0, -9.0, -1.0), max: DVec3::new(9.0, 9.0, 0.0) };
        let surfaces = vec![Surface::shape(slab, grey)];
        scene.add_child(scene.root, Node { surfaces, ..Node::default() });
    }

    fn is_near(found: Rgb, expected: f32, tolerance: f32) {
        for channel in found.to_array() {
            assert!((channel / expected - 1.0).abs() < tolerance, "{found:?} and not {expected}");
        }
    }

    #[test]
    fn lights_of_known_irradiance() {
        let (mut sky, mut lamp) = (Scene::new("sky"), Scene::new("lamp"));
        // The material of the place itself makes no difference.
        floor(&mut sky, 0.1);
        sky.environment = Some(Environment::Constant(Rgb::splat(2.0)));
        is_near(at(&sky, Vec3::ZERO, &settings(64, 4)), 2.0 * PI, 1e-3);

        floor(&mut lamp, 0.0);
        let position = DVec3::new(3.0, 0.0, 4.0);
        let bulb = Point {
            position,
            intensity: Rgb::splat(50.0),
            attenuation: Attenuation::default(),
            body_radius: 0.0,
        };
        lamp.add_light(bulb);
        is_near(at(&lamp, Vec3::ZERO, &settings(1, 4)), 50.0 * 0.8 / 25.0, 1e-4);

        let mut disk = Scene::new("disk");
        floor(&mut disk, 0.0);
        let shining = Material::new("lamp", Diffuse::new(Rgb::BLACK)).emitting(Rgb::splat(3.0));
        let shining = disk.add_material(shining);
        let transform = DAffine3::from_translation(DVec3::new(0.0, 0.0, 2.0))
            * DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let surfaces = vec![Surface::shape(Disk { radius: 1.5, inner_radius: 0.0 }, shining)];
        disk.add_child(disk.root, Node { transform, surfaces, ..Node::default() });
        let expected = PI * 3.0 * 1.5f32.powi(2) / (1.5f32.powi(2) + 4.0);
        is_near(at(&disk, Vec3::ZERO, &settings(4096, 4)), expected, 0.02);
    }

    /// A cube around zero whose walls look inwards.
    fn room(half: f32) -> TriangleMesh {
        let corner = |i: u8| {
            let side = |bit: u8| if i >> bit & 1 == 1 { half } else { -half };
            Vec3::new(side(2), side(1), side(0))
        };
        let indices = vec![
            [0, 3, 1],
            [0, 2, 3],
            [4, 7, 6],
            [4, 5, 7],
            [0, 5, 4],
            [0, 1, 5],
            [2, 7, 3],
            [2, 6, 7],
            [0, 6, 2],
            [0, 4, 6],
            [1, 7, 5],
            [1, 3, 7],
        ];
        TriangleMesh { positions: (0..8).map(corner).collect(), indices, ..TriangleMesh::default() }
    }

    #[test]
    fn bounces_add_up_in_a_closed_room() {
        let mut scene = Scene::new("furnace");
        let glowing = Material::new("wall", Diffuse::new(Rgb::splat(0.5)));
        let glowing = scene.add_material(glowing.emitting(Rgb::splat(1.0)));
        let walls = Geometry::Mesh(Arc::new(room(2.0)));
        let surfaces = vec![Surface::with_material(walls, glowing)];
        scene.add_child(scene.root, Node { surfaces, ..Node::default() });
        let place = Vec3::new(0.3, 0.2, -2.0);
        // 1 + 1/2 + 1/4 ... of what the walls shine.
        is_near(at(&scene, place, &settings(1024, 40)), 2.0 * PI, 0.03);
        is_near(at(&scene, place, &settings(1024, 1)), PI, 0.03);
    }

    #[test]
    fn places_in_the_air_get_none_and_work_can_be_stopped() {
        let mut scene = Scene::new("sky");
        floor(&mut scene, 0.5);
        scene.environment = Some(Environment::Constant(Rgb::WHITE));
        assert_eq!(at(&scene, Vec3::splat(5.0), &settings(4, 2)), Rgb::BLACK);
        let compiled = CompiledScene::new(&scene, &settings(4, 2).build).expect("a valid scene");
        let place = Place { position: Vec3::ZERO, normal: Vec3::Z, texel: [0, 0] };
        assert_eq!(irradiance(&compiled, &[place], &settings(4, 2), &|| false), None);
    }
}
