//! `KHR_lights_punctual` and `EXT_lights_ies`: directional, point and spot lights and measured
//! luminaires, placed by their nodes.

use super::Reader;
use super::container::fetch_uri;
use super::json::Json;
use crate::ReadError;
use crate::ies::read_ies as read_ies_file;
use snell_math::{DAffine3, DMat3, DVec3, Rgb};
use snell_scene::light::{Attenuation, Directional, Point, Profile, Spot, SpotFalloff};
use snell_scene::{Light, WarningKind};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// Lumens per watt by which Blender multiplies exported intensities (its standard lighting mode).
const BLENDER_LUMENS_PER_WATT: f64 = 683.0;

fn table<'a>(reader: &Reader<'a>) -> Result<Vec<Json<'a>>, ReadError> {
    match reader.root.extension("KHR_lights_punctual")? {
        Some(extension) => extension.items_of("lights"),
        None => Ok(Vec::new()),
    }
}

/// The factor on the file's intensities: 1, except for photometric values from Blender (see the
/// module `gltf`).
pub(super) fn scale(reader: &mut Reader) -> Result<f64, ReadError> {
    if !is_written_by(reader, "Blender")? {
        return Ok(1.0);
    }
    let mut is_photometric = false;
    for light in table(reader)? {
        let threshold = if light.get("type")?.is_some_and(|t| t.string() == Ok("directional")) {
            50.0
        } else {
            100.0
        };
        is_photometric |= light.number_or("intensity", 1.0)? >= threshold;
    }
    if is_photometric {
        reader.scene.warn_of(
            WarningKind::Choice,
            "the lights were written by Blender in photometric units; they are divided by 683 lm/W",
        );
    }
    Ok(if is_photometric { 1.0 / BLENDER_LUMENS_PER_WATT } else { 1.0 })
}

/// Says that lights of the file are all of its light, because viewers of glTF add light from all
/// around, which the format cannot hold. Scenes that Snell wrote are as they should be.
pub(super) fn tell_of_black_surroundings(reader: &mut Reader) -> Result<(), ReadError> {
    let scene = &reader.scene;
    let count = scene.lights.len();
    let emits = scene.materials.iter().any(snell_scene::Material::is_emissive);
    if count == 0 || emits || scene.environment.is_some() || is_written_by(reader, "Snell ")? {
        return Ok(());
    }
    let lights = if count == 1 { "light of the file is" } else { "lights of the file are" };
    reader.scene.warn_of(
        WarningKind::Choice,
        format!(
            "the {lights} all there is, and what they do not reach is black; viewers of glTF add \
             light from all around, and so does --environment sky, or a picture in place of sky"
        ),
    );
    Ok(())
}

/// True if the file names a generator with these words.
fn is_written_by(reader: &Reader, words: &str) -> Result<bool, ReadError> {
    let generator = reader.root.require("asset")?.get("generator")?;
    Ok(generator.is_some_and(|g| g.string().is_ok_and(|name| name.contains(words))))
}

/// Adds the light of a node, if it has one, and returns its index in the file. The light shines
/// along the node's `-z`.
pub(super) fn read(
    reader: &mut Reader,
    node: &Json,
    world_from_node: &DAffine3,
    scale: f64,
) -> Result<Option<usize>, ReadError> {
    let Some(extension) = node.extension("KHR_lights_punctual")? else { return Ok(None) };
    let index = extension.require("light")?;
    let Some(lights) = reader.root.extension("KHR_lights_punctual")? else {
        return Err(extension.error("the node has a light, but the file has no table of lights"));
    };
    let Some(light) = light(reader, &lights.entry("lights", &index)?, world_from_node, scale)?
    else {
        return Ok(None);
    };
    reader.scene.lights.push(light);
    index.size().map(Some)
}

/// Places a light of the table. `None` if its type is unknown.
pub(super) fn light(
    reader: &mut Reader,
    light: &Json,
    world_from_node: &DAffine3,
    scale: f64,
) -> Result<Option<Light>, ReadError> {
    let kind = light.require("type")?;
    let position = world_from_node.translation;
    let direction = (-world_from_node.matrix3.z_axis).try_normalize().unwrap_or(DVec3::NEG_Z);
    let attenuation = Attenuation::INVERSE_SQUARE;
    let intensity = intensity(light, scale)?;
    Ok(Some(match kind.string()? {
        "directional" => Directional { direction, irradiance: intensity }.into(),
        "point" => Point { position, intensity, attenuation, body_radius: 0.0 }.into(),
        "spot" => {
            Spot { position, direction, intensity, attenuation, falloff: falloff(light)? }.into()
        }
        other => {
            reader.scene.warn(format!("\"{other}\" is not a type of light; it is left out"));
            return Ok(None);
        }
    }))
}

/// Adds the luminaire of a node, if it has one: its axis is the node's `-z`, its horizontal angles
/// go from `x` towards `y`. An unreadable profile leaves a warning.
pub(super) fn read_ies(
    reader: &mut Reader,
    node: &Json,
    world_from_node: &DAffine3,
    scale: f64,
) -> Result<(), ReadError> {
    let Some(extension) = node.extension("EXT_lights_ies")? else { return Ok(()) };
    let index = extension.require("light")?;
    let Some(lights) = reader.root.extension("EXT_lights_ies")? else {
        return Err(
            extension.error("the node has a light profile, but the file has no table of them")
        );
    };
    let profile = lights.entry("lights", &index)?;
    let bytes = match (profile.get("uri")?, profile.get("bufferView")?) {
        (Some(uri), _) => fetch_uri(reader.input, &uri)?,
        (None, Some(view)) => reader.accessors.buffers().view_bytes(&view)?.to_vec(),
        (None, None) => {
            return Err(profile.error("a light profile needs \"uri\" or \"bufferView\""));
        }
    };
    let name = format!("{} ({})", reader.input.name, profile.path());
    let input = reader.input.part(&name, bytes);
    let color = extension.numbers_or("color", [1.0; 3])?;
    let factor = extension.number_or("multiplier", 1.0)? * scale;
    let [r, g, b] = color.map(|c| (c.clamp(0.0, 1.0) * factor.max(0.0)) as f32);
    let axis = |v: DVec3, otherwise| v.try_normalize().unwrap_or(otherwise);
    let m = world_from_node.matrix3;
    let z = axis(-m.z_axis, DVec3::NEG_Z);
    let x = axis(m.x_axis - z * z.dot(m.x_axis), z.any_orthonormal_vector());
    let y = axis(m.y_axis - z * z.dot(m.y_axis) - x * x.dot(m.y_axis), z.cross(x));
    match read_ies_file(&input) {
        Ok(table) => reader.scene.add_light(Profile {
            position: world_from_node.translation,
            world_from_light: DMat3::from_cols(x, y, z),
            scale: Rgb::new(r, g, b),
            table,
        }),
        Err(error) => reader.scene.warn(format!("{error}; the light is left out")),
    }
    Ok(())
}

fn intensity(light: &Json, scale: f64) -> Result<Rgb, ReadError> {
    let color = light.numbers_or("color", [1.0; 3])?;
    let strength = light.number_or("intensity", 1.0)? * scale;
    let [r, g, b] = color.map(|c| (c.max(0.0) * strength) as f32);
    if !(strength >= 0.0 && Rgb::new(r, g, b).is_finite()) {
        return Err(light.error("the intensity of a light must be 0 or more"));
    }
    Ok(Rgb::new(r, g, b))
}

/// The cone of a spot light, with its angles put in order.
fn falloff(light: &Json) -> Result<SpotFalloff, ReadError> {
    let spot = light.require("spot")?;
    let outer = spot.number_or("outerConeAngle", FRAC_PI_4)?.clamp(0.0, FRAC_PI_2);
    let inner = spot.number_or("innerConeAngle", 0.0)?.clamp(0.0, outer);
    Ok(SpotFalloff::Smooth { inner, outer })
}
