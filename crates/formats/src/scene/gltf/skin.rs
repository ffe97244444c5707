//! Skins: vertices moved by joints.

use super::Reader;
use super::json::Json;
use super::mesh::Attributes;
use super::node::Hierarchy;
use super::version1;
use crate::ReadError;
use snell_math::{DAffine3, DMat3, DVec3};
use snell_scene::motion::{InfluenceSet, Skin};

/// The joints and weights of a primitive's vertices: `JOINTS_n` and `WEIGHTS_n`. Empty if the
/// primitive cannot be skinned.
pub(super) fn influences(
    reader: &Reader,
    attributes: &Attributes,
    vertices: usize,
) -> Result<Vec<InfluenceSet>, ReadError> {
    let mut sets = Vec::new();
    for set in 0.. {
        let joints = attributes.get(reader, &format!("JOINTS_{set}"), vertices)?;
        let weights = attributes.get(reader, &format!("WEIGHTS_{set}"), vertices)?;
        let (Some(joints), Some(weights)) = (joints, weights) else { break };
        let joints: Vec<[f32; 4]> = joints.vectors()?;
        let joints =
            joints.into_iter().map(|of_vertex| of_vertex.map(|joint| joint as u16)).collect();
        sets.push(InfluenceSet { joints, weights: weights.into_fractions().vectors()? });
    }
    Ok(sets)
}

/// Reads a skin; its joints are node numbers.
pub(super) fn read(reader: &Reader, skin: &Json) -> Result<Skin, ReadError> {
    let mut joints = Vec::new();
    for joint in skin.require("joints")?.items()? {
        joints.push(joint.size()? as u32);
    }
    let matrix_of = |m: [f64; 16]| {
        let column = |c: usize| DVec3::new(m[c], m[c + 1], m[c + 2]);
        let linear = DMat3::from_cols(column(0), column(4), column(8));
        DAffine3 { matrix3: linear, translation: column(12) }
    };
    let bind_shape = match skin.extension(version1::BIND_SHAPE)? {
        Some(extension) => matrix_of(extension.require("matrix")?.numbers()?),
        None => DAffine3::IDENTITY,
    };
    let Some(index) = skin.get("inverseBindMatrices")? else {
        let inverse_bind = vec![bind_shape; joints.len()];
        return Ok(Skin { joints, inverse_bind });
    };
    let matrices = reader.accessors.get(&index)?.vectors::<16>()?;
    if matrices.len() < joints.len() {
        return Err(index.error(format!(
            "there are {} inverse bind matrices for {} joints; expected one per joint",
            matrices.len(),
            joints.len()
        )));
    }
    let matrix = |m: [f32; 16]| matrix_of(m.map(f64::from)) * bind_shape;
    let inverse_bind = matrices.into_iter().take(joints.len()).map(matrix).collect();
    Ok(Skin { joints, inverse_bind })
}

/// The matrices `world_from_mesh` of a skin, one per joint, at the current pose of the nodes.
pub(super) fn joint_matrices(skin: &Skin, hierarchy: &Hierarchy) -> Vec<DAffine3> {
    let joints = skin.joints.iter().map(|&joint| hierarchy.world(joint as usize));
    joints.zip(&skin.inverse_bind).map(|(joint, bind)| joint * *bind).collect()
}
