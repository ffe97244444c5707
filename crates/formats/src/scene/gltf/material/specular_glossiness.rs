//! `KHR_materials_pbrSpecularGlossiness`, converted to metallic-roughness.

use super::{ColorParam, Pbr, ScalarParam, Use, color_with_alpha, fraction, rgb, texture_of};
use crate::ReadError;
use crate::scene::gltf::Reader;
use crate::scene::gltf::json::Json;
use snell_math::Rgb;
use snell_math::spectrum::linear_to_srgb;
use snell_scene::material::{OpenPbr, reflectance_at_most_white};
use snell_scene::texture::ImageTexture;
use snell_scene::{Encoding, Image, Pixels, TextureId};
use std::sync::Arc;

/// Reflectance of a dielectric with an index of refraction of 1.5.
const DIELECTRIC: f32 = 0.04;

/// Reads the specular-glossiness model: its diffuse colour is the base colour of a dielectric with
/// the given reflectance at normal incidence, unless only metals have such a reflectance.
pub(super) fn read(reader: &mut Reader, extension: &Json) -> Result<Pbr, ReadError> {
    let (diffuse, alpha) = color_with_alpha(reader, extension, "diffuseFactor", "diffuseTexture")?;
    let glossiness = fraction(reader, extension, "glossinessFactor", 1.0)?;
    let specular = rgb(extension.numbers_or("specularFactor", [1.0; 3])?);
    if let Some(map) = texture_of(reader, extension, "specularGlossinessTexture", Use::Color)? {
        let [base, metallic_roughness] =
            convert(reader, extension, diffuse, specular, glossiness, map)?;
        let surface = OpenPbr {
            base_color: ColorParam::textured(Rgb::WHITE, Some(base)),
            base_metalness: ScalarParam { factor: 1.0, texture: Some((metallic_roughness, 2)) },
            specular_roughness: ScalarParam { factor: 1.0, texture: Some((metallic_roughness, 1)) },
            ..Pbr::default().surface
        };
        return Ok(Pbr { surface, alpha, ..Pbr::default() });
    }
    let brightest = if diffuse.texture.is_some() { 1.0 } else { diffuse.factor.max_element() };
    let roughness = 1.0 - glossiness;
    if specular.max_element() > 0.2 && brightest < specular.max_element() {
        let surface = OpenPbr {
            base_color: specular.into(),
            specular_roughness: roughness.into(),
            ..Pbr::default().surface
        };
        return Ok(Pbr { surface, alpha, ..Pbr::default() });
    }
    let specular_color = ColorParam::constant(specular * (1.0 / DIELECTRIC));
    let (ior, specular_color) = reflectance_at_most_white(1.5, specular_color);
    let surface = OpenPbr {
        base_color: diffuse,
        base_metalness: 0.0.into(),
        specular_roughness: roughness.into(),
        specular_color,
        specular_ior: ior.into(),
        ..Pbr::default().surface
    };
    Ok(Pbr { surface, alpha, ..Pbr::default() })
}

/// Makes textures of the base colour, and of the roughness (green) and metalness (blue), from the
/// diffuse colour and a map of specular colour and glossiness. Both are as large as the larger of
/// the two images, and lie on the surface as the map does.
fn convert(
    reader: &mut Reader,
    extension: &Json,
    diffuse: ColorParam,
    specular: Rgb,
    glossiness: f32,
    map: TextureId,
) -> Result<[TextureId; 2], ReadError> {
    if let Some(&known) = reader.textures.converted.get(extension.path()) {
        return Ok(known);
    }
    let image_texture = |id: TextureId| reader.scene.textures[id.index()].as_image().cloned();
    let (placed, base) = (image_texture(map), diffuse.texture.and_then(image_texture));
    let Some(placed) = placed else { return Ok([map; 2]) };
    let key = |t: &ImageTexture| (t.uv_set, t.uv_transform.map(|row| row.map(f32::to_bits)));
    if base.as_ref().is_some_and(|base| key(base) != key(&placed)) {
        reader.scene.warn(
            "the maps of a specular-glossiness material are placed differently; its diffuse map \
                is shown where the other one is",
        );
    }
    let image_of = |texture: &ImageTexture| reader.scene.images[texture.image.index()].clone();
    let (image, base) = (image_of(&placed), base.as_ref().map(image_of));
    let large = base.as_ref().map_or([1; 2], |base| [base.width, base.height]);
    let [width, height] = [image.width.max(large[0]), image.height.max(large[1])];
    let pixels = u64::from(width) * u64::from(height);
    reader.input.charge(6 * pixels, "the maps of a specular-glossiness material")?;
    let mut colors = Vec::with_capacity(3 * pixels as usize);
    let mut others = Vec::with_capacity(3 * pixels as usize);
    for y in 0..height {
        for x in 0..width {
            let [r, g, b, alpha] = texel(&image, [x, y], [width, height]);
            let [dr, dg, db, _] =
                base.as_ref().map_or([1.0; 4], |base| texel(base, [x, y], [width, height]));
            let (color, metalness) =
                metallic(diffuse.factor * Rgb::new(dr, dg, db), specular * Rgb::new(r, g, b));
            let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
            colors.extend([color.r, color.g, color.b].map(|c| byte(linear_to_srgb(c))));
            others.extend([0, byte(1.0 - glossiness * alpha), byte(metalness)]);
        }
    }
    let made = [(colors, Encoding::Srgb), (others, Encoding::Linear)].map(|(values, encoding)| {
        let pixels = Pixels::U8(values);
        let image = Image { width, height, channels: 3, pixels, encoding };
        let image = reader.scene.add_image(Arc::new(image));
        reader.scene.add_texture(ImageTexture { image, encoding, ..placed.clone() })
    });
    reader.textures.converted.insert(extension.path().to_owned(), made);
    Ok(made)
}

/// Linear colour and alpha of an sRGB image where the pixel `at` of a picture of this size lies.
fn texel(image: &Image, at: [u32; 2], size: [u32; 2]) -> [f32; 4] {
    let place =
        |at: u32, size: u32, own: u32| (u64::from(at) * u64::from(own) / u64::from(size)) as u32;
    let x = place(at[0], size[0], image.width);
    let y = place(at[1], size[1], image.height);
    image.rgba_as(x, y, Encoding::Srgb)
}

/// Base colour and metalness of a surface with this diffuse colour and reflectance at normal
/// incidence, by the conversion that Khronos publishes with the extension
/// (`examples/convert-between-workflows`): the metalness for which both models are equally bright.
fn metallic(diffuse: Rgb, specular: Rgb) -> (Rgb, f32) {
    const LEAST: f32 = 1e-6;
    let brightness = |c: Rgb| (0.299 * c.r * c.r + 0.587 * c.g * c.g + 0.114 * c.b * c.b).sqrt();
    let rest = 1.0 - specular.max_element().min(1.0);
    let (d, s) = (brightness(diffuse), brightness(specular));
    let metalness = if s < DIELECTRIC {
        0.0
    } else {
        let b = d * rest / (1.0 - DIELECTRIC) + s - 2.0 * DIELECTRIC;
        let root = (b * b - 4.0 * DIELECTRIC * (DIELECTRIC - s)).max(0.0).sqrt();
        ((root - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
    };
    let of_diffuse = diffuse * (rest / (1.0 - DIELECTRIC) / (1.0 - metalness).max(LEAST));
    let dielectric = DIELECTRIC * (1.0 - metalness);
    let of_specular = specular.map(|c| c - dielectric) * (1.0 / metalness.max(LEAST));
    let share = metalness * metalness;
    let base = of_diffuse * (1.0 - share) + of_specular * share;
    (base.map(|c| c.clamp(0.0, 1.0)), metalness)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dielectrics_keep_their_diffuse_color_and_metals_their_reflectance() {
        let (base, metalness) = metallic(Rgb::new(0.6, 0.3, 0.1), Rgb::new(0.04, 0.04, 0.04));
        assert!(metalness < 0.01 && (base.r - 0.6).abs() < 0.01, "{base:?} {metalness}");
        let (base, metalness) = metallic(Rgb::new(0.0, 0.0, 0.0), Rgb::new(1.0, 0.7, 0.3));
        assert!(metalness > 0.99 && (base.g - 0.7).abs() < 0.01, "{base:?} {metalness}");
    }
}
