//! Checks extensions: whatever is not supported leaves a warning, and is an error only if the file
//! requires it to store its geometry.

use super::json::Json;
use crate::ReadError;
use snell_scene::Scene;

/// Supported extensions.
const UNDERSTOOD: &[&str] = &[
    "EXT_lights_ies",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
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
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "MSFT_texture_dds",
];

/// Extensions that do not affect a still picture: what things are, how they behave, and other
/// levels of detail.
const WITHOUT_EFFECT: &[&str] = &[
    "AGI_articulations",
    "AGI_stk_metadata",
    "CESIUM_primitive_outline",
    "EXT_feature_metadata",
    "EXT_instance_features",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "FB_ngon_encoding",
    "GODOT_single_root",
    "KHR_audio",
    "KHR_audio_emitter",
    "KHR_implicit_shapes",
    "KHR_interactivity",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_physics_rigid_bodies",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_lod",
    "OMI_collider",
    "OMI_link",
    "OMI_physics_body",
    "OMI_physics_shape",
    "OMI_seat",
    "OMI_spawn_point",
    "VRM",
    "VRMC_node_constraint",
    "VRMC_springBone",
    "VRMC_vrm",
];

/// Moves the whole file to a place on the globe.
const RELATIVE_TO_CENTER: &str = "CESIUM_RTC";

/// Objects that store geometry, as paths; `*` stands for every element.
const GEOMETRY: &[&[&str]] = &[
    &["buffers", "*"],
    &["bufferViews", "*"],
    &["accessors", "*"],
    &["meshes", "*"],
    &["meshes", "*", "primitives", "*"],
];

/// Objects with images, as a path like those of [`GEOMETRY`].
const TEXTURES: &[&str] = &["textures", "*"];

/// End of the warning about an unknown extension of textures.
const OTHER_IMAGES: &str =
    "its images are shown only where a texture has no other, and if their format is known";

/// Refuses a file that stores geometry with a required extension that is not supported, and warns
/// of every other unsupported extension.
pub(super) fn check(root: &Json, scene: &mut Scene) -> Result<(), ReadError> {
    let mut required_names = Vec::new();
    for required in root.items_of("extensionsRequired")? {
        let name = required.string()?;
        required_names.push(name);
        if UNDERSTOOD.contains(&name) || name == RELATIVE_TO_CENTER {
            continue;
        }
        if WITHOUT_EFFECT.contains(&name) {
            scene.warn(format!(
                "the file requires the extension {name}, which is not read; it does not change \
                    the picture"
            ));
            continue;
        }
        for path in GEOMETRY {
            if has_extension(root, path, name)? {
                return Err(required.error_with(
                    format!(
                        "the file requires the extension {name} for its geometry, and Snell does \
                            not support it"
                    ),
                    "export the file again without this extension, or as optional",
                ));
            }
        }
        let rest = match has_extension(root, TEXTURES, name)? {
            true => OTHER_IMAGES,
            false => "the scene is shown without it, and may look different",
        };
        scene.warn(format!(
            "the file requires the extension {name}, which is not supported; {rest}"
        ));
    }
    for used in root.items_of("extensionsUsed")? {
        let name = used.string()?;
        if WITHOUT_EFFECT.contains(&name) {
            scene.note(format!("{name}: not read, because it does not change the picture"));
            continue;
        }
        let is_known = UNDERSTOOD.contains(&name) || name == RELATIVE_TO_CENTER;
        if !is_known && !required_names.contains(&name) {
            let rest = match has_extension(root, TEXTURES, name)? {
                true => OTHER_IMAGES,
                false => "the scene is shown without it",
            };
            scene.warn(format!("the extension {name} is not supported; {rest}"));
        }
    }
    if let Some(extension) = root.extension(RELATIVE_TO_CENTER)? {
        let [x, y, z] = extension.require("center")?.numbers::<3>()?;
        scene.warn(format!(
            "{RELATIVE_TO_CENTER} would move the whole scene by ({x} {y} {z}) m; the picture is \
                the same, so it stays where it is"
        ));
    }
    Ok(())
}

/// True if an object that `path` leads to from `at` has the extension `name`.
fn has_extension(at: &Json, path: &[&str], name: &str) -> Result<bool, ReadError> {
    let [key, rest @ ..] = path else { return Ok(at.extension(name)?.is_some()) };
    let next = if *key == "*" { at.items()?.collect() } else { at.get(key)?.into_iter().collect() };
    let next: Vec<Json> = next;
    for value in next {
        if has_extension(&value, rest, name)? {
            return Ok(true);
        }
    }
    Ok(false)
}
