//! The materials of the built-in scenes.

use super::MinraySphere;
use crate::material::{Conductor, Dielectric, Diffuse, Material, Phong, Plastic};
use snell_math::Rgb;

/// Matte paint of this reflectance.
pub fn matte(name: &str, reflectance: Rgb) -> Material {
    Material::new(name, Diffuse::new(reflectance))
}

/// Coloured plastic or glaze: a diffuse base under a clear coat.
pub fn plastic(name: &str, color: Rgb, roughness: f32) -> Material {
    Material::new(name, Plastic::new(color, roughness))
}

/// Gold of this roughness.
pub fn gold(name: &str, roughness: f32) -> Material {
    Material::new(name, Conductor::gold(roughness))
}

/// A metal of this colour; with roughness 0 it is a mirror.
pub fn metal(name: &str, color: Rgb, roughness: f32) -> Material {
    Material::new(name, Conductor::color(color, roughness))
}

/// Clear glass.
pub fn glass(name: &str) -> Material {
    Material::new(name, Dielectric::smooth(1.5))
}

/// The material of a sphere of the minimal ray tracer. It has no highlights, because the lights are
/// visible objects that mirrors show.
pub fn minimal(name: &str, sphere: &MinraySphere) -> Material {
    let color = Rgb::new(sphere.r, sphere.g, sphere.b);
    let phong = Phong {
        ambient: (color * sphere.kd).into(),
        diffuse: (color * sphere.kd).into(),
        specular: Rgb::BLACK.into(),
        reflection: Rgb::splat(sphere.ks).into(),
        transmission: Rgb::splat(sphere.kt).into(),
        ior: sphere.ir,
        ..Phong::default()
    };
    let material = Material::new(name, phong).emitting(color * sphere.kl);
    Material { emits_on_both_sides: true, illuminates: false, ..material }
}
