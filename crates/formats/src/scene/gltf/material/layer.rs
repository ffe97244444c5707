//! Extensions that change the reflection: index of refraction, specular, clear coat, sheen,
//! iridescence, anisotropy.

use super::{fraction, normal_map, rgb, texture_of};
use crate::ReadError;
use crate::scene::gltf::Reader;
use crate::scene::gltf::json::Json;
use crate::scene::gltf::texture::Use;
use snell_math::Rgb;
use snell_scene::TextureId;
use snell_scene::material::{
    ColorParam, FuzzModel, OpenPbr, ScalarParam, TangentMap, reflectance_at_most_white,
};

pub(super) fn read(
    reader: &mut Reader,
    json: &Json,
    surface: &mut OpenPbr,
) -> Result<(), ReadError> {
    specular(reader, json, surface)?;
    clearcoat(reader, json, surface)?;
    sheen(reader, json, surface)?;
    iridescence(reader, json, surface)?;
    anisotropy(reader, json, surface)
}

/// A factor with one texture channel.
pub(super) fn scalar(
    reader: &mut Reader,
    json: &Json,
    factor: f32,
    map: &str,
    channel: u8,
) -> Result<ScalarParam, ReadError> {
    let texture = texture_of(reader, json, map, Use::Data)?.map(|t| (t, channel));
    Ok(ScalarParam { factor, texture })
}

/// Reads a colour with a texture.
pub(super) fn color(
    reader: &mut Reader,
    json: &Json,
    factor: Rgb,
    map: &str,
) -> Result<ColorParam, ReadError> {
    let texture = texture_of(reader, json, map, Use::Color)?;
    Ok(ColorParam { texture, ..ColorParam::constant(factor) })
}

fn specular(reader: &mut Reader, json: &Json, surface: &mut OpenPbr) -> Result<(), ReadError> {
    let mut ior = 1.5;
    if let Some(extension) = json.extension("KHR_materials_ior")? {
        ior = extension.number_or("ior", 1.5)? as f32;
    }
    let mut tint = ColorParam::from(Rgb::WHITE);
    if let Some(extension) = json.extension("KHR_materials_specular")? {
        let factor = fraction(reader, &extension, "specularFactor", 1.0)?;
        surface.specular_weight = scalar(reader, &extension, factor, "specularTexture", 3)?;
        let factor = rgb(extension.numbers_or("specularColorFactor", [1.0; 3])?);
        tint = color(reader, &extension, factor, "specularColorTexture")?;
    }
    let (ior, tint) = reflectance_at_most_white(ior, tint);
    surface.specular_ior = ior.into();
    // In OpenPBR the tint also darkens the edges of metals, but not in glTF.
    if surface.base_metalness.factor < 1.0 || surface.base_metalness.texture.is_some() {
        surface.specular_color = tint;
    }
    Ok(())
}

fn clearcoat(reader: &mut Reader, json: &Json, surface: &mut OpenPbr) -> Result<(), ReadError> {
    let Some(coat) = json.extension("KHR_materials_clearcoat")? else { return Ok(()) };
    let factor = fraction(reader, &coat, "clearcoatFactor", 0.0)?;
    surface.coat_weight = scalar(reader, &coat, factor, "clearcoatTexture", 0)?;
    let factor = fraction(reader, &coat, "clearcoatRoughnessFactor", 0.0)?;
    surface.coat_roughness = scalar(reader, &coat, factor, "clearcoatRoughnessTexture", 1)?;
    surface.geometry_coat_normal = normal_map(reader, &coat, "clearcoatNormalTexture")?;
    Ok(())
}

fn sheen(reader: &mut Reader, json: &Json, surface: &mut OpenPbr) -> Result<(), ReadError> {
    let Some(sheen) = json.extension("KHR_materials_sheen")? else { return Ok(()) };
    let factor = rgb(sheen.numbers_or("sheenColorFactor", [0.0; 3])?);
    let most = factor.max_element().min(1.0);
    if most > 0.0 {
        // The largest channel becomes the coverage, and the quotient the tint.
        surface.fuzz_weight = most.into();
        surface.fuzz_color = color(reader, &sheen, factor * (1.0 / most), "sheenColorTexture")?;
    }
    let factor = fraction(reader, &sheen, "sheenRoughnessFactor", 0.0)?;
    surface.fuzz_roughness = scalar(reader, &sheen, factor, "sheenRoughnessTexture", 3)?;
    surface.fuzz_model = FuzzModel::Charlie;
    Ok(())
}

fn iridescence(reader: &mut Reader, json: &Json, surface: &mut OpenPbr) -> Result<(), ReadError> {
    let Some(film) = json.extension("KHR_materials_iridescence")? else { return Ok(()) };
    let factor = fraction(reader, &film, "iridescenceFactor", 0.0)?;
    surface.thin_film_weight = scalar(reader, &film, factor, "iridescenceTexture", 0)?;
    surface.thin_film_ior = (film.number_or("iridescenceIor", 1.3)? as f32).into();
    let [least, most] =
        [("iridescenceThicknessMinimum", 100.0), ("iridescenceThicknessMaximum", 400.0)]
            .map(|(key, default)| film.number_or(key, default).map(|nm| nm.max(0.0) as f32 * 1e-3));
    let (least, most) = (least?, most?);
    surface.thin_film_thickness = scalar(reader, &film, most, "iridescenceThicknessTexture", 1)?;
    if let Some((texture, _)) = surface.thin_film_thickness.texture
        && least != 0.0
    {
        surface.thin_film_thickness.texture =
            Some((thickness_texture(reader, texture, least, most), 1));
        surface.thin_film_thickness.factor = least.max(most);
    }
    Ok(())
}

/// Makes a texture of the film's thickness, which is `least` where the original texture is 0 and
/// `most` where it is 1, in units of the larger of the two.
fn thickness_texture(reader: &mut Reader, texture: TextureId, least: f32, most: f32) -> TextureId {
    let Some(texture) = reader.scene.textures[texture.index()].as_image().cloned() else {
        return texture;
    };
    let image = &reader.scene.images[texture.image.index()];
    let unit = least.max(most).max(1e-6);
    let mut values = Vec::with_capacity(image.width as usize * image.height as usize * 3);
    for y in 0..image.height {
        for x in 0..image.width {
            let green = image.rgba(x, y)[1];
            values.extend([(least + (most - least) * green) / unit; 3]);
        }
    }
    let image = snell_scene::Image::from_f32(image.width, image.height, 3, values);
    let image = reader.scene.add_image(std::sync::Arc::new(image));
    reader.scene.add_texture(snell_scene::texture::ImageTexture { image, ..texture })
}

/// Reads `KHR_materials_anisotropy`. glTF stretches the highlight only along the tangent: the width
/// `alpha` grows towards 1 with the square of the strength. OpenPBR instead preserves the mean
/// square of both widths.
fn anisotropy(reader: &mut Reader, json: &Json, surface: &mut OpenPbr) -> Result<(), ReadError> {
    let Some(extension) = json.extension("KHR_materials_anisotropy")? else { return Ok(()) };
    let strength = fraction(reader, &extension, "anisotropyStrength", 0.0)?;
    let texture = texture_of(reader, &extension, "anisotropyTexture", Use::Data)?;
    let rotation = extension.number_or("anisotropyRotation", 0.0)? as f32;
    let alpha = (surface.specular_roughness.factor * surface.specular_roughness.factor).max(1e-4);
    let stretched = alpha + (1.0 - alpha) * strength * strength;
    let mean = (0.5 * (alpha * alpha + stretched * stretched)).sqrt();
    surface.specular_roughness.factor = mean.sqrt().min(1.0);
    surface.specular_roughness_anisotropy =
        ScalarParam { factor: 1.0 - alpha / stretched, texture: texture.map(|t| (t, 2)) };
    surface.geometry_tangent = Some(TangentMap { rotation, texture });
    Ok(())
}
