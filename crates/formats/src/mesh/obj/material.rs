//! Converts MTL materials to materials of the scene.
//!
//! * With `Pr` or `Pm` (the PBR extension): metallic-roughness.
//! * `illum` 6 and 7, and 4 and 9 unless `d 1` makes it opaque: glass of index `Ni` (default 1.5),
//!   tinted by `Tf`.
//! * With `Ks` and `Ns` above 0, and not `illum` 0 or 1: Phong; it has a mirror reflection, by
//!   `Ks`, if `illum` is 3, 5 or 8.
//! * Everything else is diffuse.
//!
//! Bump maps are heights relative to the size that the image has on the surface, unless the image
//! is a normal map.
//!
//! Colours are linear, those of textures sRGB.

use super::file::ObjFile;
use super::mtl::{self, Library, Map, Mtl};
use crate::mesh::notes::{Notes, listed};
use crate::textures::Textures;
use crate::{Input, ReadError};
use snell_math::Rgb;
use snell_scene::material::{
    AlphaMode, BumpMap, ColorParam, Dielectric, Diffuse, HeightUnit, MaterialKind,
    MetallicRoughness, NormalMap, Phong, ScalarParam,
};
use snell_scene::texture::Wrap;
use snell_scene::{Encoding, Material, MaterialId, Scene, TextureId, WarningKind};

/// The height of a bump map of strength 1 where it is brightest, in widths of its image. (The
/// format does not specify the height.)
pub const HEIGHT_OF_BUMPS: f32 = 0.02;

/// Reflectance of a material that names no colour.
const DEFAULT_DIFFUSE: Rgb = Rgb::splat(0.8);

/// The materials that an OBJ file uses, by the number of their name; `None` if undefined.
pub fn materials(
    input: &Input,
    file: &ObjFile,
    scene: &mut Scene,
    notes: &mut Notes,
) -> Result<Vec<Option<MaterialId>>, ReadError> {
    let library = mtl::read(input, file, notes)?;
    let (textures, made_opaque) = (Textures::default(), Vec::new());
    let mut maker = Maker { library: &library, scene, textures, made_opaque };
    let mut materials = Vec::with_capacity(file.materials.len());
    let mut undefined: Vec<&str> = Vec::new();
    for (name, _) in &file.materials {
        let Some(mtl) = library.materials.get(name) else {
            undefined.push(name);
            materials.push(None);
            continue;
        };
        let material = maker.material(name, mtl);
        materials.push(Some(maker.scene.add_material(material)));
    }
    let made_opaque = maker.made_opaque;
    // Without any library, a warning was given already or there was no `mtllib`.
    if !undefined.is_empty() && !library.inputs.is_empty() {
        let libraries: Vec<&str> = library.inputs.iter().map(|input| &input.name[..]).collect();
        let remedy = if library.materials.is_empty() {
            format!("; no newmtl is in {}: is it a material library?", libraries.join(", "))
        } else {
            String::new()
        };
        let message = format!(
            "{}: the default material was used for materials that are not defined: {}{remedy}",
            input.name,
            listed(&undefined)
        );
        notes.say(WarningKind::Changed, message);
    }
    if !made_opaque.is_empty() {
        let message = format!(
            "{}: Tr 1 without d would make materials invisible; they were taken as opaque: {}",
            input.name,
            listed(&made_opaque)
        );
        notes.say(WarningKind::Choice, message);
    }
    Ok(materials)
}

/// Exponent of highlights of a material without `Ns`.
const DEFAULT_SHININESS: f32 = 32.0;

fn is_glass(mtl: &Mtl) -> bool {
    match mtl.illum {
        Some(6 | 7) => true,
        Some(4 | 9) => mtl.dissolve.is_none_or(|d| d < 1.0),
        _ => false,
    }
}

struct Maker<'a> {
    library: &'a Library,
    scene: &'a mut Scene,
    textures: Textures,
    /// The names of the materials that are opaque although the file makes them invisible.
    made_opaque: Vec<&'a str>,
}

impl<'a> Maker<'a> {
    fn material(&mut self, name: &'a str, mtl: &Mtl) -> Material {
        let mut material = Material::new(name, self.kind(mtl));
        let emission = mtl.emission.filter(|e| !e.is_black());
        if emission.is_some() || mtl.emission_map.is_some() {
            material.emission = self.color(emission, Rgb::WHITE, &mtl.emission_map, mtl);
            // MTL knows no sides, and faces wind either way.
            material.emits_on_both_sides = true;
        }
        if let Some(map) = &mtl.normal_map {
            let texture = self.texture(map, Encoding::Linear, mtl);
            material.normal_map = Some(NormalMap::new(texture, map.strength));
        }
        if let Some(map) = &mtl.bump_map {
            let texture = self.texture(map, Encoding::Linear, mtl);
            // Many programs write their normal maps as bump maps.
            if self.shows_normals(texture) {
                material.normal_map.get_or_insert(NormalMap::new(texture, map.strength));
            } else {
                let height = map.strength * HEIGHT_OF_BUMPS;
                material.bump_map =
                    Some(BumpMap { texture, channel: None, height, unit: HeightUnit::Picture });
            }
        }
        // The transmission of glass is not opacity.
        if !matches!(material.kind, MaterialKind::Dielectric(_)) {
            self.alpha(name, mtl, &mut material);
        }
        material
    }

    fn kind(&mut self, mtl: &Mtl) -> MaterialKind {
        let is_pbr = mtl.roughness.is_some() || mtl.metallic.is_some();
        if is_pbr || mtl.roughness_map.is_some() || mtl.metallic_map.is_some() {
            return MetallicRoughness {
                base_color: self.diffuse(mtl),
                metallic: self.scalar(mtl.metallic, 0.0, &mtl.metallic_map, mtl),
                roughness: self.scalar(mtl.roughness, 0.5, &mtl.roughness_map, mtl),
                ior: mtl.ior.filter(|n| (1.0..10.0).contains(n)).unwrap_or(1.5),
                ..MetallicRoughness::default()
            }
            .into();
        }
        if is_glass(mtl) {
            let ior = mtl.ior.filter(|&n| n > 0.0).unwrap_or(1.5);
            // Some programs write black for no filter.
            let tint = mtl
                .transmission
                .filter(|c| !c.is_black())
                .unwrap_or(Rgb::WHITE)
                .map(|x| x.min(1.0));
            return Dielectric { tint: tint.into(), ..Dielectric::smooth(ior) }.into();
        }
        let diffuse = self.diffuse(mtl);
        let is_glossy =
            mtl.specular.is_some_and(|c| !c.is_black()) && !matches!(mtl.illum, Some(0 | 1));
        let mirrors = matches!(mtl.illum, Some(3 | 5 | 8));
        let shininess = mtl.shininess.unwrap_or(DEFAULT_SHININESS).max(0.0);
        // An exponent of 0 would not be a highlight but a veil over everything.
        if !is_glossy || (shininess == 0.0 && !mirrors) {
            return Diffuse { reflectance: diffuse }.into();
        }
        let specular = self.color(
            mtl.specular.map(|c| c.map(|x| x.min(1.0))),
            Rgb::BLACK,
            &mtl.specular_map,
            mtl,
        );
        Phong {
            ambient: mtl.ambient.unwrap_or(Rgb::BLACK).into(),
            diffuse,
            specular,
            reflection: if mirrors { specular } else { Rgb::BLACK.into() },
            shininess,
            ..Phong::default()
        }
        .into()
    }

    fn scalar(
        &mut self,
        factor: Option<f32>,
        default: f32,
        map: &Option<Map>,
        mtl: &Mtl,
    ) -> ScalarParam {
        let Some(map) = map else {
            return ScalarParam::constant(factor.unwrap_or(default).clamp(0.0, 1.0));
        };
        let texture = self.texture(map, Encoding::Linear, mtl);
        // A factor of 0 beside a map means that only the map counts.
        let factor = factor.filter(|&f| f > 0.0).unwrap_or(1.0).min(1.0);
        ScalarParam { factor, texture: Some((texture, 0)) }
    }

    fn diffuse(&mut self, mtl: &Mtl) -> ColorParam {
        // Exporters write black where only the texture is meant to count.
        let factor = mtl.diffuse.filter(|c| mtl.diffuse_map.is_none() || !c.is_black());
        let default = if mtl.diffuse_map.is_some() { Rgb::WHITE } else { DEFAULT_DIFFUSE };
        self.color(factor.map(|c| c.map(|x| x.min(1.0))), default, &mtl.diffuse_map, mtl)
    }

    /// Sets the opacity: `d`, or one minus `Tr`, times the map.
    fn alpha(&mut self, name: &'a str, mtl: &Mtl, material: &mut Material) {
        let mut alpha =
            mtl.dissolve.or(mtl.transparency.map(|t| 1.0 - t)).unwrap_or(1.0).clamp(0.0, 1.0);
        if alpha == 0.0 && mtl.dissolve.is_none() {
            // Some programs write Tr where they mean d.
            self.made_opaque.push(name);
            alpha = 1.0;
        }
        material.alpha = ScalarParam::constant(alpha);
        if let Some(map) = &mtl.alpha_map {
            let texture = self.texture(map, Encoding::Linear, mtl);
            let picture = self.scene.textures[texture.index()].as_image();
            let image = picture.and_then(|picture| self.scene.images.get(picture.image.index()));
            // If the image has an alpha channel, alpha is the opacity; otherwise the brightness is.
            let channel =
                if image.is_some_and(|image| matches!(image.channels, 2 | 4)) { 3 } else { 0 };
            material.alpha.texture = Some((texture, channel));
        }
        if alpha < 1.0 || material.alpha.texture.is_some() {
            material.alpha_mode = AlphaMode::Blend;
        }
    }

    fn color(
        &mut self,
        factor: Option<Rgb>,
        default: Rgb,
        map: &Option<Map>,
        mtl: &Mtl,
    ) -> ColorParam {
        let texture = map.as_ref().map(|map| self.texture(map, Encoding::Srgb, mtl));
        ColorParam::textured(factor.unwrap_or(default), texture)
    }

    /// True if the image has the light blue of normal maps.
    fn shows_normals(&self, texture: TextureId) -> bool {
        let texture = self.scene.textures[texture.index()].as_image();
        let Some(image) = texture.and_then(|texture| self.scene.images.get(texture.image.index()))
        else {
            return false;
        };
        let (mut sum, mut count) = ([0.0f32; 3], 0.0);
        let apart = |size: u32| (size / 64).max(1) as usize;
        for y in (0..image.height).step_by(apart(image.height)) {
            for x in (0..image.width).step_by(apart(image.width)) {
                let [r, g, b, _] = image.rgba_as(x, y, Encoding::Linear);
                sum = [sum[0] + r, sum[1] + g, sum[2] + b];
                count += 1.0;
            }
        }
        let [r, g, b] = sum.map(|s| s / count);
        image.channels >= 3 && (r - 0.5).abs() < 0.15 && (g - 0.5).abs() < 0.15 && b > 0.7
    }

    fn texture(&mut self, map: &Map, encoding: Encoding, mtl: &Mtl) -> TextureId {
        let input = &self.library.inputs[mtl.library];
        let mut texture = self.textures.texture(self.scene, input, &map.file, encoding);
        // v' = 1 - (scale v + offset).
        let ([su, sv], [ou, ov]) = (map.scale, map.offset);
        texture.uv_transform = [[su, 0.0, ou], [0.0, -sv, 1.0 - ov]];
        if map.clamp {
            texture.wrap = [Wrap::Clamp; 2];
        }
        if let Some(known) = self.scene.textures.iter().position(|t| t.as_image() == Some(&texture))
        {
            return TextureId(known as u32);
        }
        self.scene.add_texture(texture)
    }
}
