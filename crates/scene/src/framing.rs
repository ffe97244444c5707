//! A camera and a sky for scenes that have none.

use crate::Material;
use crate::material::Diffuse;
use snell_math::Rgb;

/// The material of surfaces that have none.
pub fn default_material() -> Material {
    Material::new("default", Diffuse::new(Rgb::splat(0.7)))
}
