//! Checks that all references that may affect the picture point into their tables, so that no later
//! stage meets an invalid one (and a broken file is refused whichever scene is shown).

use super::json::Json;
use crate::ReadError;

/// Paths of references, and the table that they point into. `*` stands for every element or
/// property.
const REFERENCES: &[(&str, &str)] = &[
    ("scenes/*/nodes/*", "nodes"),
    ("nodes/*/children/*", "nodes"),
    ("nodes/*/mesh", "meshes"),
    ("nodes/*/skin", "skins"),
    ("nodes/*/camera", "cameras"),
    ("nodes/*/extensions/EXT_mesh_gpu_instancing/attributes/*", "accessors"),
    ("extensions/EXT_lights_ies/lights/*/bufferView", "bufferViews"),
    ("meshes/*/primitives/*/indices", "accessors"),
    ("meshes/*/primitives/*/attributes/*", "accessors"),
    ("meshes/*/primitives/*/targets/*/*", "accessors"),
    ("meshes/*/primitives/*/material", "materials"),
    ("meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/bufferView", "bufferViews"),
    ("skins/*/joints/*", "nodes"),
    ("skins/*/skeleton", "nodes"),
    ("skins/*/inverseBindMatrices", "accessors"),
    ("accessors/*/bufferView", "bufferViews"),
    ("accessors/*/sparse/indices/bufferView", "bufferViews"),
    ("accessors/*/sparse/values/bufferView", "bufferViews"),
    ("bufferViews/*/buffer", "buffers"),
    ("bufferViews/*/extensions/EXT_meshopt_compression/buffer", "buffers"),
    ("bufferViews/*/extensions/KHR_meshopt_compression/buffer", "buffers"),
    ("images/*/bufferView", "bufferViews"),
    ("textures/*/sampler", "samplers"),
    ("textures/*/source", "images"),
    ("textures/*/extensions/EXT_texture_avif/source", "images"),
    ("textures/*/extensions/EXT_texture_webp/source", "images"),
    ("textures/*/extensions/KHR_texture_basisu/source", "images"),
    ("textures/*/extensions/MSFT_texture_dds/source", "images"),
    ("materials/*/normalTexture/index", "textures"),
    ("materials/*/occlusionTexture/index", "textures"),
    ("materials/*/emissiveTexture/index", "textures"),
    ("materials/*/pbrMetallicRoughness/baseColorTexture/index", "textures"),
    ("materials/*/pbrMetallicRoughness/metallicRoughnessTexture/index", "textures"),
];

/// Checks all references of the document.
pub(super) fn check(root: &Json) -> Result<(), ReadError> {
    for (pattern, table) in REFERENCES {
        let count = root.get(table)?.map_or(Ok(0), |t| t.len())?;
        let steps: Vec<&str> = pattern.split('/').collect();
        check_at(root, &steps, table, count)?;
    }
    Ok(())
}

/// Checks the references that `steps` lead to from `at`: each must be less than `count`. `steps`
/// has only a few elements, so recursion is fine.
fn check_at(at: &Json, steps: &[&str], table: &str, count: usize) -> Result<(), ReadError> {
    match steps {
        [] => {
            let index = at.size()?;
            if index >= count {
                return Err(at.error(format!(
                    "it refers to number {index} of \"{table}\", but there are {count}"
                )));
            }
            Ok(())
        }
        ["*", rest @ ..] if at.is_object() => {
            at.properties()?.try_for_each(|(_, v)| check_at(&v, rest, table, count))
        }
        ["*", rest @ ..] => at.items()?.try_for_each(|v| check_at(&v, rest, table, count)),
        [key, rest @ ..] => match at.get(key)? {
            Some(value) => check_at(&value, rest, table, count),
            None => Ok(()),
        },
    }
}
