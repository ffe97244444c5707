//! Invalid textures.

use super::material_name;
use crate::{Report, Severity, Subject};
use snell_intersect::UV_SETS;
use snell_scene::texture::TextureError;
use snell_scene::{Geometry, Material, TextureId};
use std::collections::BTreeSet;

/// Finds meshes without the coordinates that their textures need, and textures with missing images.
pub fn textures(subject: &Subject, report: &mut Report) {
    let scene = subject.scene;
    for (i, error) in
        snell_scene::texture::errors(&scene.textures, scene.images.len()).into_iter().enumerate()
    {
        let (message, remedy) = match error {
            None => continue,
            Some(TextureError::NoImage { .. }) => {
                ("its image is not there".to_string(), "name another image")
            }
            Some(error) => (error.to_string(), "let it refer only to textures that precede it"),
        };
        report.add(Severity::Error, format!("texture {i}"), message, remedy);
    }
    let used: Vec<BTreeSet<TextureId>> = scene.materials.iter().map(Material::textures).collect();
    for (i, material) in scene.materials.iter().enumerate() {
        if let Some(id) = used[i].iter().find(|id| id.index() >= scene.textures.len()) {
            let message = format!("its texture {} is not there", id.0);
            report.add(
                Severity::Error,
                material_name(i, material),
                message,
                "name another texture",
            );
        }
    }
    let mut reported = BTreeSet::new();
    for (place, placed) in subject.placed.iter().enumerate() {
        let Geometry::Mesh(mesh) = &placed.surface.geometry else { continue };
        for id in placed.slots().into_iter().filter_map(|(_, id)| id) {
            let Some(textures) = used.get(id.index()) else { continue };
            let lacking = textures
                .iter()
                .filter_map(|&t| scene.textures.get(t.index())?.as_image())
                .find(|texture| {
                    // An image of one pixel needs no coordinates.
                    let is_plain = scene
                        .images
                        .get(texture.image.index())
                        .is_none_or(|i| (i.width, i.height) == (1, 1));
                    !is_plain && mesh.uvs[(texture.uv_set as usize).min(UV_SETS - 1)].is_empty()
                });
            if lacking.is_some() && reported.insert((std::sync::Arc::as_ptr(mesh), id)) {
                let name = material_name(id.index(), &scene.materials[id.index()]);
                let message = format!(
                    "{name} has textures, but the mesh has no texture coordinates: one texel shows \
                        all over"
                );
                report.add(
                    Severity::Warning,
                    subject.name(place),
                    message,
                    "unwrap the mesh, or take the texture out",
                );
            }
        }
    }
}
