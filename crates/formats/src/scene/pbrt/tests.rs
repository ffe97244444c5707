//! Tests of the conversion of files.

mod files;
mod light;
mod material;
mod medium;
mod messages;
mod motion;
mod shape;
mod state;
mod texture;
mod view;

use super::*;
use crate::scene::testing::{self, data, meshes, read_text, summary};
use snell_math::{DVec3, Rgb, Vec2, Vec3};
use snell_scene::Material;
use snell_scene::material::MaterialKind;

fn scene(text: &str) -> Scene {
    read_text(&READER, text).unwrap_or_else(|e| panic!("{e}"))
}

/// The scene for directives in the world; they must not cause a warning.
fn world(text: &str) -> Scene {
    let scene = scene(&format!("WorldBegin\n{text}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    scene
}

fn warnings(text: &str) -> String {
    scene(text).warnings.iter().map(|w| format!("{} ({}x)\n", w.message, w.count)).collect()
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-4 * b.abs().max(1e-3)
}

fn colors_are(color: Rgb, expected: [f32; 3]) {
    let found = color.to_array();
    assert!(
        found.iter().zip(expected).all(|(a, b)| close(*a, b)),
        "{found:?} instead of {expected:?}"
    );
}

/// The only material in use.
fn material(scene: &Scene) -> &Material {
    assert_eq!(scene.materials.len(), 1);
    &scene.materials[0]
}

fn diffuse(material: &Material) -> Rgb {
    match &material.kind {
        MaterialKind::Diffuse(diffuse) => diffuse.reflectance.factor,
        other => panic!("expected a diffuse material, found {}", other.name()),
    }
}

/// The value of texture 0 of a scene at a point of the file's world, on a surface that faces up.
fn shown(scene: &Scene, place: [f64; 3], footprint: f32) -> [f32; 3] {
    let position =
        scene.nodes[scene.root.index()].transform.transform_point3(DVec3::from(place)).as_vec3();
    let set = snell_scene::TextureSet::new(&scene.textures, &scene.images);
    let surface = snell_scene::texture::surface_at(position, Vec3::Y, Vec2::ZERO);
    let [r, g, b, _] =
        set.lookup(snell_scene::TextureId(scene.textures.len() as u32 - 1), &surface, footprint);
    [r, g, b]
}

/// The error of a text.
fn fault(text: &str) -> String {
    read_text(&READER, text).expect_err(text).to_string()
}
