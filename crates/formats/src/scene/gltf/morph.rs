//! Morph targets and their weights.

use super::json::Json;
use super::{Reader, mesh};
use crate::ReadError;
use snell_intersect::TriangleMesh;
use snell_math::Vec3;
use snell_scene::motion::MorphTarget;

/// Weights of a mesh's morph targets at a node: the node's, or the mesh's, or none.
pub(super) fn weights(node: &Json, mesh: &Json) -> Result<Vec<f64>, ReadError> {
    match (node.get("weights")?, mesh.get("weights")?) {
        (Some(weights), _) | (None, Some(weights)) => weights.all_numbers(),
        (None, None) => Ok(Vec::new()),
    }
}

/// The maximum number of morph targets of a mesh's primitives.
pub(super) fn count(mesh: &Json) -> Result<usize, ReadError> {
    let mut most = 0;
    for primitive in mesh.items_of("primitives")? {
        most = most.max(primitive.items_of("targets")?.len());
    }
    Ok(most)
}

/// The targets of a primitive. Targets with weight 0 stay empty, unless weights change (`all`).
pub(super) fn targets(
    reader: &Reader,
    primitive: &Json,
    weights: &[f64],
    all: bool,
    mesh: &TriangleMesh,
) -> Result<Vec<MorphTarget>, ReadError> {
    let mut targets = Vec::new();
    for (i, target) in primitive.items_of("targets")?.iter().enumerate() {
        if !all && weights.get(i).is_none_or(|&weight| weight == 0.0) {
            targets.push(MorphTarget::default());
            continue;
        }
        targets.push(MorphTarget {
            positions: differences(reader, target, "POSITION", mesh.positions.len())?,
            normals: differences(reader, target, "NORMAL", mesh.normals.len())?,
            tangents: differences(reader, target, "TANGENT", mesh.tangents.len())?,
        });
    }
    Ok(targets)
}

/// Reads one attribute of a morph target. The result is empty if the primitive lacks the attribute
/// (`count` is 0).
fn differences(
    reader: &Reader,
    target: &Json,
    name: &str,
    count: usize,
) -> Result<Vec<Vec3>, ReadError> {
    if count == 0 {
        return Ok(Vec::new());
    }
    match mesh::attribute(reader, target, name, count)? {
        Some(accessor) => Ok(accessor.vectors()?.into_iter().map(Vec3::from_array).collect()),
        None => Ok(Vec::new()),
    }
}
