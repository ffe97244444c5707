//! The albedos of surfaces, without a picture: the values of the layer `albedo`.

use super::first_surface::in_white_light;
use crate::compile::materials_of;
use snell_intersect::SurfaceInteraction;
use snell_math::{ColorMode, Rgb, Vec3};
use snell_scene::material::{Prepared, ShadingPoint};
use snell_scene::{Material, MaterialId, Scene, TextureSet};

/// The materials and textures of a scene, ready to be asked for the albedos of points.
#[derive(Debug)]
pub struct Albedos {
    /// The materials of the scene, and the default material.
    materials: Vec<Material>,
    prepared: Vec<Prepared>,
    textures: TextureSet,
}

impl Albedos {
    /// Prepares the materials and textures of a scene.
    pub fn new(scene: &Scene) -> Self {
        let materials = materials_of(scene);
        Self {
            prepared: materials.iter().map(Prepared::of).collect(),
            textures: TextureSet::new(&scene.textures, &scene.images),
            materials,
        }
    }

    /// The fraction of white light that a surface of this material (the default one, if the scene
    /// has no such material) reflects or transmits towards `outgoing`, a unit vector, in linear
    /// RGB: what a picture without filtering shows in the layer `albedo`.
    pub fn at(
        &self,
        material: Option<MaterialId>,
        surface: &SurfaceInteraction,
        outgoing: Vec3,
    ) -> Rgb {
        let default = self.materials.len() - 1;
        let id = material.map_or(default, |id| id.index().min(default));
        let point = ShadingPoint {
            surface,
            footprint: 0.0,
            textures: &self.textures,
            mode: ColorMode::Rgb,
            outside_ior: 1.0,
        };
        let albedo = self.materials[id].albedo(&self.prepared[id], &point, outgoing);
        in_white_light(ColorMode::Rgb, albedo)
    }
}
