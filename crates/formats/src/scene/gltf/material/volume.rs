//! Extensions that transmit light: transmission, diffuse transmission, volumes, dispersion.

use super::layer::{color, scalar};
use super::{fraction, rgb};
use crate::ReadError;
use crate::scene::gltf::Reader;
use crate::scene::gltf::json::Json;
use snell_math::Rgb;
use snell_scene::material::OpenPbr;

pub(super) fn read(
    reader: &mut Reader,
    json: &Json,
    surface: &mut OpenPbr,
    is_boundary: &mut bool,
) -> Result<(), ReadError> {
    if let Some(transmission) = json.extension("KHR_materials_transmission")? {
        let factor = fraction(reader, &transmission, "transmissionFactor", 0.0)?;
        surface.transmission_weight =
            scalar(reader, &transmission, factor, "transmissionTexture", 0)?;
        // Transmitted light is tinted by the base colour, in addition to the volume's absorption.
        surface.transmission_tint = surface.base_color;
    }
    if let Some(diffuse) = json.extension("KHR_materials_diffuse_transmission")? {
        let factor = fraction(reader, &diffuse, "diffuseTransmissionFactor", 0.0)?;
        surface.subsurface_weight =
            scalar(reader, &diffuse, factor, "diffuseTransmissionTexture", 3)?;
        let factor = rgb(diffuse.numbers_or("diffuseTransmissionColorFactor", [1.0; 3])?);
        surface.subsurface_color =
            color(reader, &diffuse, factor, "diffuseTransmissionColorTexture")?;
        surface.subsurface_scatter_anisotropy = 1.0.into();
    }
    if let Some(dispersion) = json.extension("KHR_materials_dispersion")? {
        // The extension is 20 over the Abbe number.
        surface.transmission_dispersion_scale =
            (dispersion.number_or("dispersion", 0.0)?.max(0.0) as f32).into();
        surface.transmission_dispersion_abbe_number = 20.0.into();
    }
    let Some(volume) = json.extension("KHR_materials_volume")? else { return Ok(()) };
    *is_boundary = volume.number_or("thicknessFactor", 0.0)? > 0.0;
    // A leaf stays thin: diffuse transmission ignores the volume here.
    surface.geometry_thin_walled = !*is_boundary || surface.subsurface_weight.factor > 0.0;
    if surface.geometry_thin_walled {
        return Ok(());
    }
    let distance = volume.number_or("attenuationDistance", f64::INFINITY)?;
    if distance > 0.0 && distance < 1e30 {
        surface.transmission_color =
            rgb(volume.numbers_or("attenuationColor", [1.0; 3])?).map(|c| c.min(1.0)).into();
        surface.transmission_depth = (distance as f32).into();
    } else {
        surface.transmission_color = Rgb::WHITE.into();
    }
    Ok(())
}
