//! Tests of the shadow terminator on coarse meshes.

mod emission;

use crate::{CompiledScene, Filter, IntegratorKind, Job, Settings, Terminator};
use snell_intersect::{BuildOptions, Sphere, TriangleMesh};
use snell_math::{DVec3, Rgb, Vec3};
use snell_scene::builtin::builtin;
use snell_scene::light::{Attenuation, Directional, Point};
use snell_scene::material::{Diffuse, Plastic};
use snell_scene::{Camera, Environment, Geometry, Light, Material, Node, Scene, Surface};
use std::f32::consts::PI;
use std::sync::Arc;

/// The unit sphere as triangles, with the sphere's normals at the vertices. `around` and `down` are
/// the numbers of divisions around the axis and from pole to pole.
fn sphere(around: u32, down: u32) -> TriangleMesh {
    let point = |i: u32, j: u32| {
        let (phi, theta) =
            (2.0 * PI * (i % around) as f32 / around as f32, PI * j as f32 / down as f32);
        Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    };
    let positions: Vec<Vec3> =
        (0..=down).flat_map(|j| (0..around).map(move |i| point(i, j))).collect();
    let at = |i: u32, j: u32| j * around + i % around;
    let quads = (0..down).flat_map(|j| (0..around).map(move |i| (i, j)));
    let indices = quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            [(j + 1 < down).then_some([a, b, c]), (j > 0).then_some([a, c, d])]
        })
        .flatten()
        .collect();
    TriangleMesh { normals: positions.clone(), positions, indices, ..TriangleMesh::default() }
}

fn scene_of(mesh: TriangleMesh, material: Material, light: Light) -> Scene {
    let mut scene = Scene::new("sphere");
    let material = scene.add_material(material);
    let surfaces = vec![Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material)];
    scene.add_child(scene.root, Node { surfaces, ..Node::default() });
    scene.lights.push(light);
    scene
}

fn matte() -> Material {
    Material::new("matte", Diffuse::new(Rgb::splat(0.8)))
}

fn sun(direction: DVec3) -> Light {
    Light::Directional(Directional { direction: direction.normalize(), irradiance: Rgb::splat(PI) })
}

fn lamp(position: DVec3) -> Light {
    Light::Point(Point {
        position,
        intensity: Rgb::splat(30.0),
        attenuation: Attenuation::default(),
        body_radius: 0.0,
    })
}

fn pixels(scene: &Scene, eye: Vec3, settings: &Settings) -> Vec<f32> {
    let compiled = CompiledScene::new(scene, &BuildOptions::default()).expect("a valid scene");
    let camera = Camera::look_at(eye, Vec3::ZERO, Vec3::Z, 0.25);
    let image = Job::new(&compiled, &camera, settings).run(2, &|_| true).0.image();
    image.layers[0].values.chunks(4).map(|pixel| pixel[0]).collect()
}

/// Settings with one sample in the middle of each pixel, so that pictures differ by the surface
/// only.
fn settings(integrator: IntegratorKind, terminator: Terminator) -> Settings {
    let how = Settings { integrator, terminator, filter: Filter::Box, ..Settings::default() };
    Settings { size: [64, 64], spp: 1, pixel_position: Some([0.5, 0.5]), max_depth: 1, ..how }
}

#[test]
fn the_terminator_of_a_coarse_sphere_is_that_of_a_fine_one() {
    let eye = Vec3::new(0.0, -5.0, 0.0);
    // Only pixels away from the outline are compared, because coarse triangles cannot make the
    // outline round.
    let is_inside = |i: &usize| {
        let [x, y] = [i % 64, i / 64].map(|c| (c as f32 + 0.5) / 32.0 - 1.0);
        x.hypot(y) < 0.7
    };
    let plastic = Material::new("plastic", Plastic::new(Rgb::splat(0.5), 0.6));
    let lights = [
        sun(DVec3::new(1.0, 0.3, -0.2)),
        sun(DVec3::new(0.9, -0.4, 0.3)),
        lamp(DVec3::new(-4.0, 0.5, 1.0)),
    ];
    for material in [matte(), plastic] {
        for integrator in [IntegratorKind::Path, IntegratorKind::Direct, IntegratorKind::Raycast] {
            let picture = |light: &Light, [around, down]: [u32; 2], terminator| {
                let scene = scene_of(sphere(around, down), material.clone(), light.clone());
                pixels(&scene, eye, &settings(integrator, terminator))
            };
            // The number of pixels that are in shadow and should not be.
            let dark = |light: &Light, terminator| {
                let fine = picture(light, [192, 96], Terminator::Faceted);
                let coarse = picture(light, [12, 6], terminator);
                (0..coarse.len())
                    .filter(is_inside)
                    .filter(|&i| fine[i] > 0.1 && coarse[i] < 0.2 * fine[i])
                    .count()
            };
            let counts =
                |terminator| lights.iter().map(|light| dark(light, terminator)).sum::<usize>();
            let (smooth, faceted) = (counts(Terminator::Smooth), counts(Terminator::Faceted));
            assert!(
                smooth == 0 && faceted > 10,
                "{integrator:?} {}: {smooth}, and {faceted} without",
                material.name
            );
        }
    }
}

#[test]
fn no_light_comes_through_a_closed_coarse_mesh() {
    for integrator in [IntegratorKind::Path, IntegratorKind::Direct, IntegratorKind::Raycast] {
        let how = Settings {
            max_depth: 6,
            spp: 16,
            pixel_position: None,
            ..settings(integrator, Terminator::Smooth)
        };
        for (around, down) in [(3, 2), (5, 3), (12, 6)] {
            // Lamps inside of the sphere must not be seen outside, even near the surface.
            for inside in [DVec3::ZERO, DVec3::new(0.1, -0.2, 0.3), DVec3::new(0.0, 0.0, 0.9)] {
                let mut scene = scene_of(sphere(around, down), matte(), lamp(inside));
                let outside = pixels(&scene, Vec3::new(1.0, -5.0, 2.0), &how);
                assert!(outside.iter().all(|&x| x == 0.0), "{integrator:?} {around} {inside}");
                // Light from outside of the sphere must not be seen inside.
                scene.lights =
                    vec![sun(DVec3::new(1.0, 0.3, -0.2)), lamp(DVec3::new(0.0, 1.3, 0.0))];
                if integrator == IntegratorKind::Path {
                    scene.environment = Some(Environment::Constant(Rgb::WHITE));
                }
                let inside = pixels(&scene, Vec3::new(0.02, -0.1, 0.03), &how);
                assert!(inside.iter().all(|&x| x == 0.0), "{integrator:?} {around}");
            }
        }
    }
}

#[test]
fn flat_triangles_and_shapes_are_as_they_were() {
    let pictures = |scene: &Scene| {
        let picture = |terminator| {
            let how =
                Settings { max_depth: 5, spp: 4, ..settings(IntegratorKind::Path, terminator) };
            pixels(scene, Vec3::new(1.0, -5.0, 2.0), &how)
        };
        [picture(Terminator::Smooth), picture(Terminator::Faceted)]
    };
    let light = || lamp(DVec3::new(-4.0, 0.5, 1.0));
    let round = scene_of(sphere(12, 6), matte(), light());
    let [smooth, faceted] = pictures(&round);
    assert_ne!(smooth, faceted);
    let flat = TriangleMesh { normals: Vec::new(), ..sphere(12, 6) };
    let mut shape = round.clone();
    shape.nodes[1].surfaces = vec![Surface::shape(
        Sphere { radius: 1.0 },
        shape.nodes[1].surfaces[0].materials[0].expect("it has one"),
    )];
    for scene in [
        scene_of(flat, matte(), light()),
        shape,
        builtin("cornell-box").expect("the scene is built in"),
    ] {
        let [smooth, faceted] = pictures(&scene);
        assert_eq!(smooth, faceted);
    }
}
