//! Materials: metallic-roughness with its extensions, as OpenPBR surfaces.

mod layer;
mod note;
mod specular_glossiness;
pub(super) mod variant;
mod volume;

use super::Reader;
use super::json::Json;
use super::texture::{self, Use};
use crate::ReadError;
use serde_json::Value;
use snell_intersect::UV_SETS;
use snell_math::Rgb;
use snell_scene::material::{
    AlphaMode, Black, ColorParam, MaterialKind, NormalMap, OpenPbr, ScalarParam,
};
use snell_scene::{Material, MaterialId};
use std::collections::BTreeSet;

/// Reads all materials, in file order: number `i` there is material `i` of the scene.
pub(super) fn read_all(reader: &mut Reader) -> Result<(), ReadError> {
    variant::choose(reader)?;
    for json in reader.root.items_of("materials")? {
        let material = read(reader, &json)?;
        reader.scene.add_material(material);
    }
    Ok(())
}

/// The material of primitives that name none. Unlike in the standard, this material is
/// double-sided: a file without materials did not choose to hide back faces, and culling would only
/// leave holes.
pub(super) fn default_material(reader: &mut Reader) -> MaterialId {
    if let Some(id) = reader.default_material {
        return id;
    }
    let material = Material::new("default", Pbr::default().surface);
    let id = reader.scene.add_material(material);
    reader.default_material = Some(id);
    id
}

/// The sets of texture coordinates that meshes store for materials that use no others.
pub(super) const FIRST_UV_SETS: [usize; UV_SETS] = [0, 1, 2, 3];

/// The sets of texture coordinates that a material's meshes store: the first ones that its textures
/// use, and others where there is room.
pub(super) fn uv_sets(material: &Json) -> [usize; UV_SETS] {
    fn collect(value: &Value, sets: &mut BTreeSet<usize>) {
        let Some(map) = value.as_object() else { return };
        let number = |value: Option<&Value>| value.and_then(Value::as_f64).map(|x| x as usize);
        if map.contains_key("index") {
            let transformed = value.pointer("/extensions/KHR_texture_transform/texCoord");
            sets.insert(number(transformed).or_else(|| number(map.get("texCoord"))).unwrap_or(0));
        } else {
            map.iter().filter(|(key, _)| *key != "extras").for_each(|(_, v)| collect(v, sets));
        }
    }
    let mut sets = BTreeSet::new();
    collect(material.value(), &mut sets);
    if sets.last().is_none_or(|&last| last < UV_SETS) {
        return FIRST_UV_SETS;
    }
    let rest: Vec<usize> = (0..UV_SETS).filter(|set| !sets.contains(set)).collect();
    let mut all = sets.into_iter().chain(rest);
    FIRST_UV_SETS.map(|_| all.next().unwrap_or(0))
}

/// Reflection and transmission, in glTF's terms.
struct Pbr {
    surface: OpenPbr,
    /// Opacity from the base colour.
    alpha: ScalarParam,
    /// True if the surface bounds a volume; false if it transmits as a thin sheet.
    is_boundary: bool,
}

impl Default for Pbr {
    /// The defaults of glTF: a rough white metal, thin-walled if it transmits.
    fn default() -> Self {
        let surface = OpenPbr {
            base_color: Rgb::WHITE.into(),
            base_metalness: 1.0.into(),
            specular_roughness: 1.0.into(),
            coat_ior: 1.5.into(),
            coat_darkening: 0.0.into(),
            thin_film_ior: 1.3.into(),
            geometry_thin_walled: true,
            ..OpenPbr::default()
        };
        Self { surface, alpha: 1.0.into(), is_boundary: false }
    }
}

/// Reads one material.
pub(super) fn read(reader: &mut Reader, json: &Json) -> Result<Material, ReadError> {
    note::add(reader, json)?;
    reader.uv_sets = uv_sets(json);
    let pbr = match json.extension("KHR_materials_pbrSpecularGlossiness")? {
        Some(extension) => specular_glossiness::read(reader, &extension)?,
        None => metallic_roughness(reader, json)?,
    };
    let alpha = pbr.alpha;
    // A boundary of a volume is always hit from both sides (KHR_materials_volume).
    let double_sided = json.boolean_or("doubleSided", false)? || pbr.is_boundary;
    let is_unlit = json.extension("KHR_materials_unlit")?.is_some();
    let (kind, emission): (MaterialKind, _) = if is_unlit {
        (Black {}.into(), pbr.surface.base_color)
    } else {
        (pbr.surface.into(), emission(reader, json)?)
    };
    Ok(Material {
        emission,
        emission_takes_vertex_color: is_unlit,
        // Unlit surfaces look the same in any light, but do not illuminate others.
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
        (pbr.surface.base_color, pbr.alpha) =
            color_with_alpha(reader, &core, "baseColorFactor", "baseColorTexture")?;
        pbr.surface.base_metalness.factor = fraction(reader, &core, "metallicFactor", 1.0)?;
        pbr.surface.specular_roughness.factor = fraction(reader, &core, "roughnessFactor", 1.0)?;
        if let Some(map) = texture_of(reader, &core, "metallicRoughnessTexture", Use::Data)? {
            pbr.surface.base_metalness.texture = Some((map, 2));
            pbr.surface.specular_roughness.texture = Some((map, 1));
        }
    }
    layer::read(reader, json, &mut pbr.surface)?;
    volume::read(reader, json, &mut pbr.surface, &mut pbr.is_boundary)?;
    Ok(pbr)
}

/// A colour of four numbers with its texture, separated into colour and alpha.
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
    reader.has_lamps_off |= strength == 0.0 && factor.max_element() > 0.0;
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
        other => {
            Err(mode
                .error(format!("\"{other}\" is not an alpha mode; expected OPAQUE, MASK or BLEND")))
        }
    }
}

fn normal_map(reader: &mut Reader, json: &Json, key: &str) -> Result<Option<NormalMap>, ReadError> {
    let Some(info) = json.get(key)? else { return Ok(None) };
    let scale = info.number_or("scale", 1.0)? as f32;
    Ok(texture::read(reader, &info, Use::Data)?.map(|texture| NormalMap::new(texture, scale)))
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

/// Reads a factor in `[0, 1]`; values outside are clamped.
fn fraction(reader: &mut Reader, json: &Json, key: &str, default: f64) -> Result<f32, ReadError> {
    let value = json.number_or(key, default)?;
    if !(0.0..=1.0).contains(&value) {
        reader.scene.warn(OUT_OF_RANGE);
    }
    Ok(value.clamp(0.0, 1.0) as f32)
}

/// A colour; negative components become 0.
fn rgb([r, g, b]: [f64; 3]) -> Rgb {
    Rgb::new(r.max(0.0) as f32, g.max(0.0) as f32, b.max(0.0) as f32)
}
