//! Checks extensions: a required extension that is not supported is an error, an optional one
//! leaves a warning.

use super::json::Json;
use crate::ReadError;
use snell_scene::Scene;

/// Supported extensions.
const UNDERSTOOD: &[&str] = &[
    "EXT_lights_ies",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Extensions that do not affect a still picture.
const WITHOUT_EFFECT: &[&str] = &["FB_ngon_encoding", "KHR_xmp", "KHR_xmp_json_ld"];

/// Refuses required extensions that are not supported, and warns of optional ones.
pub(super) fn check(root: &Json, scene: &mut Scene) -> Result<(), ReadError> {
    let known = |name: &str| UNDERSTOOD.contains(&name) || WITHOUT_EFFECT.contains(&name);
    for required in root.items_of("extensionsRequired")? {
        let name = required.string()?;
        if !known(name) {
            return Err(required.error_with(
                format!("the file requires the extension {name}, which Snell does not support"),
                remedy(name),
            ));
        }
    }
    for used in root.items_of("extensionsUsed")? {
        let name = used.string()?;
        if !known(name) {
            scene.warn(format!(
                "the extension {name} is not supported; the scene is shown without it"
            ));
        }
    }
    Ok(())
}

fn remedy(name: &str) -> &'static str {
    match name {
        "KHR_draco_mesh_compression" => {
            "unpack it first with `gltf-transform copy in.glb out.glb` (npm install --global \
                @gltf-transform/cli), or export it without compression"
        }
        "KHR_texture_basisu" => {
            "unpack its KTX2 textures first with `gltf-transform ktxdecompress in.glb out.glb` \
                (npm install --global @gltf-transform/cli), or export it with PNG or JPEG textures"
        }
        "MSFT_texture_dds" | "EXT_texture_avif" => {
            "convert its textures to PNG or JPEG first, or export it with such textures"
        }
        "KHR_techniques_webgl" | "KHR_materials_common" => {
            "convert its materials to metallic-roughness, for example by loading it in Blender and \
                exporting it again"
        }
        _ => "export the file again without this extension, or as optional",
    }
}
