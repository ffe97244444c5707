//! `material`, and the default material.

use super::Builder;
use super::file::{File, named_path};
use crate::ReadError;
use crate::scene::tokens::Token;
use snell_math::Rgb;
use snell_scene::material::{ColorParam, Phong};
use snell_scene::{Encoding, ImageTexture, Material, TextureId};
use std::sync::Arc;

/// The default grey of COS 426.
pub fn default_material() -> Material {
    let phong = Phong {
        ambient: Rgb::splat(0.2).into(),
        diffuse: Rgb::splat(0.5).into(),
        specular: Rgb::splat(0.5).into(),
        reflection: Rgb::splat(0.5).into(),
        transmission: Rgb::BLACK.into(),
        shininess: 10.0,
        ior: 1.0,
    };
    Material::new("default", phong)
}

impl Builder {
    pub fn read_material(&mut self, file: &mut File) -> Result<(), ReadError> {
        let ambient = self.color(file, "the ambient reflectance")?;
        let diffuse = self.color(file, "the diffuse reflectance")?;
        let specular = self.color(file, "the specular reflectance")?;
        let transmission = self.color(file, "the transmission")?;
        let emission = self.color(file, "the emission")?;
        let shininess = file.tokens.number("the shininess")?.max(0.0) as f32;
        let mut ior = file.tokens.number("the index of refraction")? as f32;
        if ior <= 0.0 {
            self.scene.warn("an index of refraction that is not positive counts as 1");
            ior = 1.0;
        }
        let texture = self.read_texture(file)?;
        let phong = Phong {
            ambient: ambient.into(),
            diffuse: ColorParam::textured(diffuse, texture),
            // The assignments use one coefficient for highlights and mirror reflection.
            specular: specular.into(),
            reflection: specular.into(),
            transmission: transmission.into(),
            shininess,
            ior,
        };
        let name = format!("material {}", file.materials.len());
        let material =
            Material { emits_on_both_sides: true, ..Material::new(name, phong).emitting(emission) };
        let id = self.add_material(material);
        file.materials.push(id);
        Ok(())
    }

    /// Reads the texture of a material: `0` for none, otherwise the name of an image.
    fn read_texture(&mut self, file: &mut File) -> Result<Option<TextureId>, ReadError> {
        let name = file.tokens.expect("a texture file, or 0 for none,")?;
        if name.text() == "0" {
            return Ok(None);
        }
        let path = named_path(file, &name)?;
        if let Some(&known) = self.textures.get(&path) {
            return Ok(Some(known));
        }
        let id = self.load_texture(file, &name)?;
        self.textures.insert(path, id);
        Ok(Some(id))
    }

    fn load_texture(&mut self, file: &File, name: &Token) -> Result<TextureId, ReadError> {
        let (input, _) = self.open(file, name)?;
        let image = crate::image::read_image(&input)?;
        let image = self.scene.add_image(Arc::new(image));
        Ok(self.scene.add_texture(ImageTexture::new(image, Encoding::Srgb)))
    }
}
