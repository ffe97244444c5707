//! Writes OFF: text.

use super::flat::{Digits, world_meshes};
use super::{Output, SceneWriter, ply};
use snell_intersect::TriangleMesh;
use snell_scene::Scene;
use std::fmt::Write;

/// The writer of OFF files.
pub const WRITER: SceneWriter =
    SceneWriter { name: "off", extensions: &["off"], knows: |_| true, write };

fn write(scene: &Scene, output: &mut Output) -> Result<(), String> {
    let meshes: Vec<TriangleMesh> =
        world_meshes(scene, output, Digits::Any)?.into_iter().map(|(_, mesh)| mesh).collect();
    output.lose_all_but_surfaces(scene);
    if meshes.len() > 1 {
        output.lose("all objects became one mesh");
    }
    let mesh = ply::joined(&meshes, output)?;
    if !mesh.uvs[0].is_empty() || !mesh.colors.is_empty() {
        output.lose("texture coordinates and colours are left out");
    }
    let mut text = format!(
        "{}OFF\n{} {} 0\n",
        if mesh.normals.is_empty() { "" } else { "N" },
        mesh.positions.len(),
        mesh.indices.len()
    );
    for (i, p) in mesh.positions.iter().enumerate() {
        _ = match mesh.exact.get(i) {
            Some(p) => write!(text, "{} {} {}", p.x, p.y, p.z),
            None => write!(text, "{} {} {}", p.x, p.y, p.z),
        };
        if let Some(n) = mesh.normals.get(i) {
            _ = write!(text, " {} {} {}", n.x, n.y, n.z);
        }
        text.push('\n');
    }
    for [a, b, c] in &mesh.indices {
        _ = writeln!(text, "3 {a} {b} {c}");
    }
    output.main = text.into_bytes();
    Ok(())
}
