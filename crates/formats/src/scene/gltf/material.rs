//! Materials: metallic-roughness with its extensions.

use super::Reader;
use super::json::Json;
use super::texture::{self, Use};
use crate::ReadError;
use snell_math::Rgb;
use snell_scene::material::{
    AlphaMode, Black, ColorParam, Dielectric, MaterialKind, MetallicRoughness, NormalMap, ScalarParam,
};
use snell_scene::{Material, MaterialId};

/// Reads all materials, in the order of the file: number `i` there is material `i` of the scene.
pub(super) fn read_all(reader: &mut Reader) -> Result<(), ReadError> {
    for json in reader.root.items_of("materials")? {
        let material = read(reader, &json)?;
        reader.scene.add_material(material);
    }
    Ok(())
}

/// The material of primitives that name none. It is seen from both sides, unlike in the standard: where a file says nothing about
/// materials, nobody chose to hide the back, and faces that look away from the camera would only be missed.
pub(super) fn default_material(reader: &mut Reader) -> MaterialId {
    if let Some(id) = reader.default_material {
        return id;
    }
    let material = Material::new("default", kind(Pbr::default()));
    let id = reader.scene.add_material(material);
    reader.default_material = Some(id);
    id
}

/// What reflects and transmits, as glTF tells it.
struct Pbr {
    base_color: ColorParam,
    /// Opacity that belongs to the base colour.
    alpha: ScalarParam,
    metallic: ScalarParam,
    roughness: ScalarParam,
    ior: f32,
    specular: ScalarParam,
    specular_color: ColorParam,
    transmission: ScalarParam,
    clearcoat: ScalarParam,
    clearcoat_roughness: ScalarParam,
    clearcoat_normal_map: Option<NormalMap>,
    /// True if the surface bounds a volume; false if it is a thin sheet where it transmits.
    is_boundary: bool,
    /// What the volume absorbs per unit of length.
    absorption: Rgb,
}

impl Default for Pbr {
    fn default() -> Self {
        Self {
            base_color: Rgb::WHITE.into(),
            alpha: 1.0.into(),
            metallic: 1.0.into(),
            roughness: 1.0.into(),
            ior: 1.5,
            specular: 1.0.into(),
            specular_color: Rgb::WHITE.into(),
            transmission: 0.0.into(),
            clearcoat: 0.0.into(),
            clearcoat_roughness: 0.0.into(),
            clearcoat_normal_map: None,
            is_boundary: false,
            absorption: Rgb::BLACK,
        }
    }
}

/// The material of the scene that comes nearest.
fn kind(pbr: Pbr) -> MaterialKind {
    // Clear volumes refract; what is only partly clear or metallic is a thin wall.
    let is_clear = pbr.transmission.factor >= 0.5 && pbr.transmission.texture.is_none();
    if pbr.is_boundary && is_clear && pbr.metallic.factor == 0.0 {
        let Pbr { ior, roughness, base_color: tint, absorption, .. } = pbr;
        return Dielectric { ior: ior.into(), roughness, tint, absorption }.into();
    }
    MetallicRoughness {
        base_color: pbr.base_color,
        metallic: pbr.metallic,
        roughness: pbr.roughness,
        ior: pbr.ior,
        specular: pbr.specular,
        specular_color: pbr.specular_color,
        transmission: pbr.transmission,
        clearcoat: pbr.clearcoat,
        clearcoat_roughness: pbr.clearcoat_roughness,
        clearcoat_normal_map: pbr.clearcoat_normal_map,
    }
    .into()
}

fn read(reader: &mut Reader, json: &Json) -> Result<Material, ReadError> {
    let pbr = match json.extension("KHR_materials_pbrSpecularGlossiness")? {
        Some(extension) => specular_glossiness(reader, &extension)?,
        None => metallic_roughness(reader, json)?,
    };
    let alpha = pbr.alpha;
    // A boundary of a volume is always met from both sides (KHR_materials_volume).
    let double_sided = json.boolean_or("doubleSided", false)? || pbr.is_boundary;
    let is_unlit = json.extension("KHR_materials_unlit")?.is_some();
    let (kind, emission) =
        if is_unlit { (Black {}.into(), pbr.base_color) } else { (kind(pbr), emission(reader, json)?) };
    Ok(Material {
        emission,
        emission_takes_vertex_color: is_unlit,
        // Unlit surfaces look the same in any light, but give none.
        illuminates: !is_unlit,
        emits_on_both_sides: double_sided,
        alpha_mode: alpha_mode(json)?,
        alpha,
        double_sided,
        normal_map: if is_unlit { None } else { normal_map(reader, json, "normalTexture")? },
        ..Material::new(json.name(), kind)
    })
}

fn metallic_roughness(reader: &mut Reader, json: &Json) -> Result<Pbr, ReadError> {
    let mut pbr = Pbr::default();
    if let Some(core) = json.get("pbrMetallicRoughness")? {
        (pbr.base_color, pbr.alpha) = color_with_alpha(reader, &core, "baseColorFactor", "baseColorTexture")?;
        pbr.metallic.factor = fraction(reader, &core, "metallicFactor", 1.0)?;
        pbr.roughness.factor = fraction(reader, &core, "roughnessFactor", 1.0)?;
        if let Some(map) = texture_of(reader, &core, "metallicRoughnessTexture", Use::Data)? {
            pbr.metallic.texture = Some((map, 2));
            pbr.roughness.texture = Some((map, 1));
        }
    }
    if let Some(ior) = json.extension("KHR_materials_ior")? {
        pbr.ior = ior.number_or("ior", 1.5)? as f32;
    }
    if let Some(specular) = json.extension("KHR_materials_specular")? {
        pbr.specular.factor = fraction(reader, &specular, "specularFactor", 1.0)?;
        pbr.specular.texture = texture_of(reader, &specular, "specularTexture", Use::Data)?.map(|t| (t, 3));
        pbr.specular_color.factor = rgb(specular.numbers_or("specularColorFactor", [1.0; 3])?);
        pbr.specular_color.texture = texture_of(reader, &specular, "specularColorTexture", Use::Color)?;
    }
    if let Some(transmission) = json.extension("KHR_materials_transmission")? {
        pbr.transmission.factor = fraction(reader, &transmission, "transmissionFactor", 0.0)?;
        pbr.transmission.texture = texture_of(reader, &transmission, "transmissionTexture", Use::Data)?.map(|t| (t, 0));
    }
    if let Some(coat) = json.extension("KHR_materials_clearcoat")? {
        pbr.clearcoat.factor = fraction(reader, &coat, "clearcoatFactor", 0.0)?;
        pbr.clearcoat.texture = texture_of(reader, &coat, "clearcoatTexture", Use::Data)?.map(|t| (t, 0));
        pbr.clearcoat_roughness.factor = fraction(reader, &coat, "clearcoatRoughnessFactor", 0.0)?;
        pbr.clearcoat_roughness.texture =
            texture_of(reader, &coat, "clearcoatRoughnessTexture", Use::Data)?.map(|t| (t, 1));
        pbr.clearcoat_normal_map = normal_map(reader, &coat, "clearcoatNormalTexture")?;
    }
    if let Some(volume) = json.extension("KHR_materials_volume")? {
        let thickness = volume.number_or("thicknessFactor", 0.0)?;
        pbr.is_boundary = thickness > 0.0;
        pbr.absorption = absorption(&volume)?;
    }
    Ok(pbr)
}

/// What a volume absorbs per unit of length: after the attenuation distance, the attenuation colour is left.
fn absorption(volume: &Json) -> Result<Rgb, ReadError> {
    /// Stands for black, whose logarithm is infinite.
    const DARKEST: f64 = 1e-6;
    let color = volume.numbers_or("attenuationColor", [1.0; 3])?;
    let distance = volume.number_or("attenuationDistance", f64::INFINITY)?;
    Ok(if distance > 0.0 { rgb(color.map(|c| (-c.clamp(DARKEST, 1.0).ln() / distance).min(1e6))) } else { Rgb::BLACK })
}

/// Converts the older model: its diffuse colour is the base colour of a non-metal with the given reflectance at normal incidence,
/// unless that reflectance is one that only metals have.
fn specular_glossiness(reader: &mut Reader, extension: &Json) -> Result<Pbr, ReadError> {
    /// Reflectance of a dielectric with an index of refraction of 1.5.
    const DIELECTRIC: f32 = 0.04;
    let (base_color, alpha) = color_with_alpha(reader, extension, "diffuseFactor", "diffuseTexture")?;
    let glossiness = fraction(reader, extension, "glossinessFactor", 1.0)?;
    let specular = rgb(extension.numbers_or("specularFactor", [1.0; 3])?);
    if extension.get("specularGlossinessTexture")?.is_some() {
        reader.scene.warn("specular-glossiness maps are not supported; a surface of medium roughness is shown instead");
        return Ok(Pbr { base_color, alpha, metallic: 0.0.into(), roughness: 0.5.into(), ..Pbr::default() });
    }
    let diffuse = if base_color.texture.is_some() { 1.0 } else { base_color.factor.max_element() };
    let roughness = (1.0 - glossiness).into();
    if specular.max_element() > 0.2 && diffuse < specular.max_element() {
        return Ok(Pbr { base_color: specular.into(), alpha, roughness, ..Pbr::default() });
    }
    let specular_color = ColorParam::constant(specular * (1.0 / DIELECTRIC));
    Ok(Pbr { base_color, alpha, metallic: 0.0.into(), roughness, specular_color, ..Pbr::default() })
}

/// A colour of four numbers with its texture, apart into colour and alpha.
fn color_with_alpha(
    reader: &mut Reader,
    json: &Json,
    factor: &str,
    map: &str,
) -> Result<(ColorParam, ScalarParam), ReadError> {
    let rgba = json.numbers_or(factor, [1.0; 4])?;
    if rgba.iter().any(|c| !(0.0..=1.0).contains(c)) {
        reader.scene.warn(OUT_OF_RANGE);
    }
    let [r, g, b, a] = rgba.map(|c| c.clamp(0.0, 1.0));
    let texture = texture_of(reader, json, map, Use::Color)?;
    let color = ColorParam::textured(rgb([r, g, b]), texture);
    Ok((color, ScalarParam { factor: a as f32, texture: texture.map(|t| (t, 3)) }))
}

fn emission(reader: &mut Reader, json: &Json) -> Result<ColorParam, ReadError> {
    let factor = rgb(json.numbers_or("emissiveFactor", [0.0; 3])?);
    let strength = match json.extension("KHR_materials_emissive_strength")? {
        Some(extension) => extension.number_or("emissiveStrength", 1.0)?.max(0.0) as f32,
        None => 1.0,
    };
    let factor = factor * strength;
    if !factor.is_finite() {
        return Err(json.error("the emission is too large to be computed"));
    }
    let texture = texture_of(reader, json, "emissiveTexture", Use::Color)?;
    Ok(ColorParam::textured(factor, texture))
}

fn alpha_mode(json: &Json) -> Result<AlphaMode, ReadError> {
    let Some(mode) = json.get("alphaMode")? else { return Ok(AlphaMode::Opaque) };
    match mode.string()? {
        "OPAQUE" => Ok(AlphaMode::Opaque),
        "MASK" => Ok(AlphaMode::Mask(json.number_or("alphaCutoff", 0.5)? as f32)),
        "BLEND" => Ok(AlphaMode::Blend),
        other => Err(mode.error(format!("\"{other}\" is not an alpha mode; expected OPAQUE, MASK or BLEND"))),
    }
}

fn normal_map(reader: &mut Reader, json: &Json, key: &str) -> Result<Option<NormalMap>, ReadError> {
    let Some(info) = json.get(key)? else { return Ok(None) };
    let scale = info.number_or("scale", 1.0)? as f32;
    Ok(texture::read(reader, &info, Use::Data)?.map(|texture| NormalMap { texture, scale }))
}

fn texture_of(
    reader: &mut Reader,
    json: &Json,
    key: &str,
    used_for: Use,
) -> Result<Option<snell_scene::TextureId>, ReadError> {
    match json.get(key)? {
        Some(info) => texture::read(reader, &info, used_for),
        None => Ok(None),
    }
}

const OUT_OF_RANGE: &str = "material factors outside of 0 to 1 are clamped";

/// A factor in `[0, 1]`.
fn fraction(reader: &mut Reader, json: &Json, key: &str, default: f64) -> Result<f32, ReadError> {
    let value = json.number_or(key, default)?;
    if !(0.0..=1.0).contains(&value) {
        reader.scene.warn(OUT_OF_RANGE);
    }
    Ok(value.clamp(0.0, 1.0) as f32)
}

/// A colour; negative parts count as 0.
fn rgb([r, g, b]: [f64; 3]) -> Rgb {
    Rgb::new(r.max(0.0) as f32, g.max(0.0) as f32, b.max(0.0) as f32)
}
