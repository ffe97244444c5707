//! Writes PLY: one binary mesh of the whole scene.

use super::flat::{Digits, world_meshes};
use super::{Output, SceneWriter};
use snell_intersect::TriangleMesh;
use snell_math::spectrum::linear_to_srgb;
use snell_scene::Scene;

/// The writer of PLY files.
pub const WRITER: SceneWriter =
    SceneWriter { name: "ply", extensions: &["ply"], knows: |_| true, write };

fn write(scene: &Scene, output: &mut Output) -> Result<(), String> {
    let mut meshes: Vec<TriangleMesh> =
        world_meshes(scene, output, Digits::Any)?.into_iter().map(|(_, mesh)| mesh).collect();
    output.lose_all_but_surfaces(scene);
    if meshes.len() > 1 {
        output.lose("all objects became one mesh");
    }
    let mesh = if meshes.len() == 1 { meshes.remove(0) } else { joined(&meshes, output)? };
    if mesh.normals.is_empty() && !mesh.indices.is_empty() {
        output.lose("flat shading cannot be expressed: programs that read the file may smooth it");
    }
    if mesh.uvs[1..].iter().any(|set| !set.is_empty()) || !mesh.tangents.is_empty() {
        output.lose("tangents and second texture coordinates are left out");
    }
    if mesh.colors.iter().flatten().any(|&x| x > 1.0) {
        output.lose("vertex colours above 1 become 1");
    }
    output.main = encoded(&mesh);
    Ok(())
}

/// Joins all meshes into one. An attribute that only some have gets default values in the others.
pub fn joined(meshes: &[TriangleMesh], output: &mut Output) -> Result<TriangleMesh, String> {
    let mut all = TriangleMesh::default();
    let vertices: usize = meshes.iter().map(|m| m.positions.len()).sum();
    if u32::try_from(vertices).is_err() {
        return Err("more vertices than 32-bit numbers can count, instances counted each".into());
    }
    let some = |has: fn(&TriangleMesh) -> bool| meshes.iter().any(has);
    let (normals, uvs, colors) = (
        some(|m| !m.normals.is_empty()),
        some(|m| !m.uvs[0].is_empty()),
        some(|m| !m.colors.is_empty()),
    );
    if some(|m| !m.exact.is_empty()) {
        all.exact = meshes.iter().flat_map(|m| m.exact_positions().into_owned()).collect();
    }
    for mesh in meshes {
        let (base, count) = (all.positions.len() as u32, mesh.positions.len());
        all.positions.extend(&mesh.positions);
        all.indices.extend(mesh.indices.iter().map(|t| t.map(|i| base + i)));
        if normals && mesh.normals.is_empty() {
            output.lose("an object without vertex normals is smooth: others have some");
            all.normals.extend(mesh.computed_normals());
        }
        all.normals.extend(&mesh.normals);
        all.uvs[0].extend(&mesh.uvs[0]);
        all.colors.extend(&mesh.colors);
        if uvs && mesh.uvs[0].is_empty() {
            all.uvs[0].resize(all.uvs[0].len() + count, Default::default());
        }
        if colors && mesh.colors.is_empty() {
            all.colors.resize(all.colors.len() + count, [1.0; 4]);
        }
    }
    Ok(all)
}

/// A binary file of a mesh with the attributes it has. Colours become 8-bit sRGB.
pub fn encoded(mesh: &TriangleMesh) -> Vec<u8> {
    let mut header =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.len());
    let mut properties = |kind: &str, names: &[&str]| {
        names.iter().for_each(|n| header += &format!("property {kind} {n}\n"));
    };
    let kind = if mesh.exact.is_empty() { "float" } else { "double" };
    properties(kind, &["x", "y", "z"]);
    if !mesh.normals.is_empty() {
        properties("float", &["nx", "ny", "nz"]);
    }
    if !mesh.uvs[0].is_empty() {
        properties("float", &["u", "v"]);
    }
    if !mesh.colors.is_empty() {
        // Most programs take colours for 0 to 255, whatever their type in the file.
        properties("uchar", &["red", "green", "blue", "alpha"]);
    }
    header += &format!(
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.indices.len()
    );
    let mut bytes = header.into_bytes();
    let put = |bytes: &mut Vec<u8>, numbers: &[f32]| {
        numbers.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    };
    for i in 0..mesh.positions.len() {
        match mesh.exact.get(i) {
            Some(exact) => exact.to_array().iter().for_each(|x| bytes.extend(x.to_le_bytes())),
            None => put(&mut bytes, &mesh.positions[i].to_array()),
        }
        if let Some(normal) = mesh.normals.get(i) {
            put(&mut bytes, &normal.to_array());
        }
        if let Some(uv) = mesh.uvs[0].get(i) {
            put(&mut bytes, &uv.to_array());
        }
        if let Some(&[r, g, b, a]) = mesh.colors.get(i) {
            let levels = [linear_to_srgb(r), linear_to_srgb(g), linear_to_srgb(b), a];
            bytes.extend(levels.map(|x| (x.clamp(0.0, 1.0) * 255.0 + 0.5) as u8));
        }
    }
    for triangle in &mesh.indices {
        bytes.push(3);
        triangle.iter().for_each(|i| bytes.extend(i.to_le_bytes()));
    }
    bytes
}
