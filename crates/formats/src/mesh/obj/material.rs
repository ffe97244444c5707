//! From MTL materials to materials of the scene.
//!
//! Without the PBR extension (`Pr`, `Pm`): a material without `Ks` is diffuse.

use super::mtl::{self, Library, Map, Mtl};
use super::parse::ObjFile;
use crate::mesh::notes::Notes;
use crate::textures::Textures;
use crate::{Input, ReadError};
use snell_math::Rgb;
use snell_scene::material::{AlphaMode, ColorParam, Diffuse, MaterialKind, NormalMap, ScalarParam};
use snell_scene::texture::Wrap;
use snell_scene::{Encoding, Material, MaterialId, Scene, TextureId};

/// Reflectance where a material says nothing about its colour.
const DEFAULT_DIFFUSE: Rgb = Rgb::splat(0.8);

/// The materials that an OBJ file uses, by the number of their name; undefined ones are `None`.
pub fn materials(
    input: &Input,
    file: &ObjFile,
    scene: &mut Scene,
    notes: &mut Notes,
) -> Result<Vec<Option<MaterialId>>, ReadError> {
    let library = mtl::read(input, file, notes)?;
    let mut maker = Maker { library: &library, scene, notes, textures: Textures::default() };
    let mut materials = Vec::with_capacity(file.materials.len());
    for (name, _) in &file.materials {
        let Some(mtl) = library.materials.get(name) else {
            // Without any library its absence has been said, or everyone knows.
            if !library.inputs.is_empty() {
                maker.notes.add("undefined material", || {
                    format!("{}: the material \"{name}\" is not defined; the default material was used", input.name)
                });
            }
            materials.push(None);
            continue;
        };
        let material = maker.material(name, mtl)?;
        materials.push(Some(maker.scene.add_material(material)));
    }
    Ok(materials)
}

struct Maker<'a> {
    library: &'a Library,
    scene: &'a mut Scene,
    notes: &'a mut Notes,
    textures: Textures,
}

impl Maker<'_> {
    fn material(&mut self, name: &str, mtl: &Mtl) -> Result<Material, ReadError> {
        let mut material = Material::new(name, self.kind(name, mtl)?);
        if mtl.emission.is_some_and(|e| !e.is_black()) || mtl.emission_map.is_some() {
            material.emission = self.color(mtl.emission, Rgb::WHITE, &mtl.emission_map, mtl)?;
            material.emits_on_both_sides = false;
        }
        if let Some(map) = &mtl.normal_map {
            let texture = self.texture(map, Encoding::Linear, mtl)?;
            material.normal_map = Some(NormalMap { texture, scale: map.strength });
        }
        self.alpha(name, mtl, &mut material)?;
        Ok(material)
    }

    fn kind(&mut self, _name: &str, mtl: &Mtl) -> Result<MaterialKind, ReadError> {
        Ok(Diffuse { reflectance: self.diffuse(mtl)? }.into())
    }

    fn diffuse(&mut self, mtl: &Mtl) -> Result<ColorParam, ReadError> {
        // Exporters write black where a texture is meant to say it all.
        let factor = mtl.diffuse.filter(|c| mtl.diffuse_map.is_none() || !c.is_black());
        let default = if mtl.diffuse_map.is_some() { Rgb::WHITE } else { DEFAULT_DIFFUSE };
        self.color(factor.map(|c| c.map(|x| x.min(1.0))), default, &mtl.diffuse_map, mtl)
    }

    /// Opacity: `d`, or one minus `Tr`, times the map.
    fn alpha(&mut self, name: &str, mtl: &Mtl, material: &mut Material) -> Result<(), ReadError> {
        let mut alpha = mtl.dissolve.or(mtl.transparency.map(|t| 1.0 - t)).unwrap_or(1.0).clamp(0.0, 1.0);
        if alpha == 0.0 && mtl.dissolve.is_none() {
            // Some programs write Tr where they mean d.
            self.notes.add("Tr 1", || {
                format!("material \"{name}\": Tr 1 without d would make it invisible; it was taken as opaque")
            });
            alpha = 1.0;
        }
        material.alpha = ScalarParam::constant(alpha);
        if let Some(map) = &mtl.alpha_map {
            let texture = self.texture(map, Encoding::Linear, mtl)?;
            let image = &self.scene.images[self.scene.textures[texture.index()].image.index()];
            // An image with an alpha channel means that; others mean their brightness.
            let channel = if image.channels == 2 || image.channels == 4 { 3 } else { 0 };
            material.alpha.texture = Some((texture, channel));
        }
        if alpha < 1.0 || material.alpha.texture.is_some() {
            material.alpha_mode = AlphaMode::Blend;
        }
        Ok(())
    }

    fn color(
        &mut self,
        factor: Option<Rgb>,
        default: Rgb,
        map: &Option<Map>,
        mtl: &Mtl,
    ) -> Result<ColorParam, ReadError> {
        let texture = map.as_ref().map(|map| self.texture(map, Encoding::Srgb, mtl)).transpose()?;
        Ok(ColorParam { factor: factor.unwrap_or(default), texture })
    }

    fn texture(&mut self, map: &Map, encoding: Encoding, mtl: &Mtl) -> Result<TextureId, ReadError> {
        let input = &self.library.inputs[mtl.library];
        let mut texture = self.textures.texture(self.scene, input, &map.file, encoding)?;
        // v' = 1 - (scale v + offset).
        let ([su, sv], [ou, ov]) = (map.scale, map.offset);
        texture.uv_transform = [[su, 0.0, ou], [0.0, -sv, 1.0 - ov]];
        if map.clamp {
            texture.wrap = [Wrap::Clamp; 2];
        }
        if let Some(known) = self.scene.textures.iter().position(|t| *t == texture) {
            return Ok(TextureId(known as u32));
        }
        Ok(self.scene.add_texture(texture))
    }
}
