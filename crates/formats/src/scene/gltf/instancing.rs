//! `EXT_mesh_gpu_instancing`: many instances of a mesh below its node.

use super::json::Json;
use super::{Reader, mesh, node};
use crate::ReadError;
use snell_math::DAffine3;

/// The transforms `node_from_instance` of a node's mesh; `None` if the node does not use the
/// extension.
pub(super) fn transforms(reader: &Reader, node: &Json) -> Result<Option<Vec<DAffine3>>, ReadError> {
    let Some(extension) = node.extension("EXT_mesh_gpu_instancing")? else { return Ok(None) };
    let attributes = extension.require("attributes")?;
    let Some((_, first)) = attributes.properties()?.next() else { return Ok(None) };
    let count = reader.accessors.get(&first)?.count;
    let translations = vectors::<3>(reader, &attributes, "TRANSLATION", count, false)?;
    let rotations = vectors::<4>(reader, &attributes, "ROTATION", count, true)?;
    let scales = vectors::<3>(reader, &attributes, "SCALE", count, false)?;
    let part = |i: usize| {
        node::from_parts(
            translations.as_ref().map_or([0.0; 3], |t| t[i]),
            rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |r| r[i]),
            scales.as_ref().map_or([1.0; 3], |s| s[i]),
        )
        .matrix()
    };
    Ok(Some((0..count).map(part).collect()))
}

fn vectors<const N: usize>(
    reader: &Reader,
    attributes: &Json,
    name: &str,
    count: usize,
    fractions: bool,
) -> Result<Option<Vec<[f64; N]>>, ReadError> {
    let Some(accessor) = mesh::attribute(reader, attributes, name, count)? else { return Ok(None) };
    let accessor = if fractions { accessor.into_fractions() } else { accessor };
    Ok(Some(accessor.vectors()?.into_iter().map(|v: [f32; N]| v.map(f64::from)).collect()))
}
