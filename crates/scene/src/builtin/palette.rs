//! The materials of the built-in scenes.

use crate::material::{Diffuse, Material};
use snell_math::Rgb;

/// Matte paint.
pub fn matte(name: &str, reflectance: Rgb) -> Material {
    Material::new(name, Diffuse::new(reflectance))
}

/// A sphere of a minimal ray tracer's scene.
pub fn classic(name: &str, sphere: &super::MinraySphere) -> Material {
    let color = Rgb::new(sphere.r, sphere.g, sphere.b);
    let material = Material::new(name, Diffuse::new(color * sphere.kd)).emitting(color * sphere.kl);
    Material { emits_on_both_sides: true, ..material }
}

/// A clear glass.
pub fn glass(name: &str) -> Material {
    Material::new(name, Diffuse::new(Rgb::splat(0.9)))
}

/// Gold of this roughness.
pub fn gold(name: &str, _roughness: f32) -> Material {
    Material::new(name, Diffuse::new(Rgb::new(0.9, 0.6, 0.2)))
}

/// A metal of this colour and roughness.
pub fn metal(name: &str, color: Rgb, _roughness: f32) -> Material {
    Material::new(name, Diffuse::new(color))
}

/// Coloured plastic: matte under a clear coat.
pub fn plastic(name: &str, color: Rgb, _roughness: f32) -> Material {
    Material::new(name, Diffuse::new(color))
}
