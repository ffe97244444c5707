//! Morph targets, applied once with the weights that the file starts with.

use super::json::Json;
use super::{Reader, mesh};
use crate::ReadError;
use snell_intersect::TriangleMesh;
use snell_math::Vec3;

/// Weights of a mesh's morph targets where a node shows it: the node's, or the mesh's, or none.
pub(super) fn weights(node: &Json, mesh: &Json) -> Result<Vec<f64>, ReadError> {
    match (node.get("weights")?, mesh.get("weights")?) {
        (Some(weights), _) | (None, Some(weights)) => weights.all_numbers(),
        (None, None) => Ok(Vec::new()),
    }
}

/// Adds the targets of a primitive, each times its weight, to its attributes.
pub(super) fn apply(
    reader: &Reader,
    primitive: &Json,
    weights: &[f64],
    mesh: &mut TriangleMesh,
) -> Result<(), ReadError> {
    for (target, &weight) in primitive.items_of("targets")?.iter().zip(weights) {
        if weight == 0.0 {
            continue;
        }
        let weight = weight as f32;
        add(reader, target, "POSITION", weight, mesh.positions.iter_mut())?;
        add(reader, target, "NORMAL", weight, mesh.normals.iter_mut())?;
        let mut directions: Vec<Vec3> = mesh.tangents.iter().map(|t| t.truncate()).collect();
        add(reader, target, "TANGENT", weight, directions.iter_mut())?;
        for (tangent, direction) in mesh.tangents.iter_mut().zip(directions) {
            *tangent = direction.extend(tangent.w);
        }
    }
    Ok(())
}

/// Adds one attribute of a target. An attribute that the primitive does not have (no `values`) is left out.
fn add<'v>(
    reader: &Reader,
    target: &Json,
    name: &str,
    weight: f32,
    values: impl ExactSizeIterator<Item = &'v mut Vec3>,
) -> Result<(), ReadError> {
    if values.len() == 0 {
        return Ok(());
    }
    if let Some(accessor) = mesh::attribute(reader, target, name, values.len())? {
        for (value, delta) in values.zip(accessor.vectors()?) {
            *value += weight * Vec3::from_array(delta);
        }
    }
    Ok(())
}
