//! Notes how the extensions of a material are converted, for `snell info`.

use crate::ReadError;
use crate::scene::gltf::Reader;
use crate::scene::gltf::json::Json;

/// Material extensions, the OpenPBR parameters that they become, and what is lost.
const MAPPED: &[(&str, &str)] = &[
    (
        "KHR_materials_anisotropy",
        "specular_roughness_anisotropy, geometry_tangent (a texture scales the anisotropy of the \
            factor)",
    ),
    (
        "KHR_materials_clearcoat",
        "coat_weight, coat_roughness, geometry_coat_normal, with coat_ior 1.5 and coat_darkening 0",
    ),
    (
        "KHR_materials_diffuse_transmission",
        "subsurface_weight, subsurface_color, geometry_thin_walled",
    ),
    (
        "KHR_materials_dispersion",
        "transmission_dispersion_scale, with transmission_dispersion_abbe_number 20",
    ),
    ("KHR_materials_emissive_strength", "emission_luminance"),
    ("KHR_materials_ior", "specular_ior"),
    ("KHR_materials_iridescence", "thin_film_weight, thin_film_thickness, thin_film_ior"),
    (
        "KHR_materials_pbrSpecularGlossiness",
        "base_color, specular_color, specular_roughness (its map is not read)",
    ),
    ("KHR_materials_sheen", "fuzz_weight, fuzz_color, fuzz_roughness, with fuzz_model charlie"),
    (
        "KHR_materials_specular",
        "specular_weight, specular_color (at grazing angles too, unlike in glTF)",
    ),
    ("KHR_materials_transmission", "transmission_weight, transmission_tint"),
    ("KHR_materials_unlit", "emission of a black surface"),
    (
        "KHR_materials_volume",
        "transmission_color, transmission_depth (the thickness only separates walls from volumes)",
    ),
];

/// Adds a note for each extension of a material.
pub(super) fn add(reader: &mut Reader, json: &Json) -> Result<(), ReadError> {
    for name in json.extension_names()? {
        let note = match MAPPED.iter().find(|(mapped, _)| *mapped == name) {
            Some((_, parameters)) => format!("{name}: {parameters}"),
            None if name.contains("_materials_") => format!("{name}: not mapped"),
            None => continue,
        };
        reader.scene.note(note);
    }
    Ok(())
}
