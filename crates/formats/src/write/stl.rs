//! Writes STL: the binary form.

use super::flat::{Digits, world_meshes};
use super::{Output, SceneWriter};
use snell_scene::Scene;

/// The writer of STL files.
pub const WRITER: SceneWriter =
    SceneWriter { name: "stl", extensions: &["stl"], knows: |_| true, write };

fn write(scene: &Scene, output: &mut Output) -> Result<(), String> {
    let meshes = world_meshes(scene, output, Digits::Single)?;
    output.lose_all_but_surfaces(scene);
    if meshes.len() > 1 {
        output.lose("all objects became one mesh");
    }
    if meshes
        .iter()
        .any(|(_, m)| !m.normals.is_empty() || !m.uvs[0].is_empty() || !m.colors.is_empty())
    {
        output.lose("vertex normals, texture coordinates and colours are left out");
    }
    // A file that begins with "solid" would be read as text.
    let mut bytes = vec![b' '; 80];
    let title = b"binary STL";
    bytes[..title.len()].copy_from_slice(title);
    let count: usize = meshes.iter().map(|(_, m)| m.indices.len()).sum();
    bytes.extend((count as u32).to_le_bytes());
    for (_, mesh) in &meshes {
        for i in 0..mesh.indices.len() {
            let corners = mesh.corners(i);
            let [a, b, c] = corners.map(|p| p.as_dvec3());
            let normal = (b - a).cross(c - a).try_normalize().unwrap_or_default().as_vec3();
            for v in [normal].into_iter().chain(corners) {
                v.to_array().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            }
            bytes.extend([0; 2]);
        }
    }
    output.main = bytes;
    Ok(())
}
