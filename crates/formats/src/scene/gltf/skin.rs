//! Skins: vertices moved by joints, at the pose that the nodes are in.

use super::Reader;
use super::json::Json;
use super::mesh::attribute;
use super::node::Hierarchy;
use crate::ReadError;
use snell_intersect::TriangleMesh;
use snell_math::{DAffine3, DMat3, DVec3};

/// Which joints move the vertices of a primitive, and how much.
pub(super) struct Influences {
    /// Four joints and weights per vertex in each set.
    sets: Vec<(Vec<[f32; 4]>, Vec<[f32; 4]>)>,
}

impl Influences {
    /// Reads `JOINTS_n` and `WEIGHTS_n`; `None` if there are none.
    pub fn read(reader: &Reader, attributes: &Json, vertices: usize) -> Result<Option<Self>, ReadError> {
        let mut sets = Vec::new();
        for set in 0.. {
            let joints = attribute(reader, attributes, &format!("JOINTS_{set}"), vertices)?;
            let weights = attribute(reader, attributes, &format!("WEIGHTS_{set}"), vertices)?;
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            sets.push((joints.vectors()?, weights.into_fractions().vectors()?));
        }
        Ok((!sets.is_empty()).then_some(Self { sets }))
    }

    /// Joint and positive weight pairs of a vertex.
    fn of(&self, vertex: usize) -> impl Iterator<Item = (usize, f64)> {
        let pairs = self.sets.iter().flat_map(move |(joints, weights)| joints[vertex].into_iter().zip(weights[vertex]));
        pairs.filter(|(_, weight)| *weight > 0.0).map(|(joint, weight)| (joint as usize, f64::from(weight)))
    }
}

/// The matrices `world_from_mesh` of a skin, one per joint.
pub(super) fn joint_matrices(reader: &Reader, skin: &Json, hierarchy: &Hierarchy) -> Result<Vec<DAffine3>, ReadError> {
    let joints = skin.require("joints")?;
    let mut matrices = Vec::new();
    for joint in joints.items()? {
        matrices.push(hierarchy.world(&joint)?);
    }
    let Some(index) = skin.get("inverseBindMatrices")? else { return Ok(matrices) };
    let inverse_bind = reader.accessors.get(&index)?.vectors::<16>()?;
    if inverse_bind.len() < matrices.len() {
        return Err(index.error(format!(
            "there are {} inverse bind matrices for {} joints; expected one per joint",
            inverse_bind.len(),
            matrices.len()
        )));
    }
    for (matrix, m) in matrices.iter_mut().zip(inverse_bind) {
        let column = |c: usize| DVec3::new(f64::from(m[c]), f64::from(m[c + 1]), f64::from(m[c + 2]));
        *matrix *= DAffine3 { matrix3: DMat3::from_cols(column(0), column(4), column(8)), translation: column(12) };
    }
    Ok(matrices)
}

/// Moves a mesh into the world. The error is the first joint that the skin does not have.
pub(super) fn apply(mesh: &mut TriangleMesh, influences: &Influences, matrices: &[DAffine3]) -> Result<(), usize> {
    let mut mirrored = 0usize;
    for vertex in 0..mesh.positions.len() {
        let matrix = blend(influences, vertex, matrices)?;
        let linear = matrix.matrix3;
        let turned_over = linear.determinant() < 0.0;
        mirrored += usize::from(turned_over);
        let position = &mut mesh.positions[vertex];
        *position = matrix.transform_point3(position.as_dvec3()).as_vec3();
        if let Some(normal) = mesh.normals.get_mut(vertex) {
            let n = cofactors(linear) * normal.as_dvec3() * if turned_over { -1.0 } else { 1.0 };
            *normal = n.try_normalize().map_or(*normal, |n| n.as_vec3());
        }
        if let Some(tangent) = mesh.tangents.get_mut(vertex) {
            let t = (linear * tangent.truncate().as_dvec3()).try_normalize();
            *tangent = t.map_or(*tangent, |t| t.as_vec3().extend(if turned_over { -tangent.w } else { tangent.w }));
        }
    }
    if mirrored * 2 > mesh.positions.len() {
        for [_, b, c] in &mut mesh.indices {
            std::mem::swap(b, c);
        }
    }
    Ok(())
}

/// Linear blend of a vertex's joints. Weights are scaled to a sum of 1; a vertex without any stays where it is.
fn blend(influences: &Influences, vertex: usize, matrices: &[DAffine3]) -> Result<DAffine3, usize> {
    let mut sum = DAffine3::ZERO;
    let mut total = 0.0;
    for (joint, weight) in influences.of(vertex) {
        let matrix = matrices.get(joint).ok_or(joint)?;
        sum.matrix3 += matrix.matrix3 * weight;
        sum.translation += matrix.translation * weight;
        total += weight;
    }
    if total == 0.0 || !total.is_finite() {
        return Ok(DAffine3::IDENTITY);
    }
    Ok(DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation / total })
}

/// The cofactor matrix: determinant times inverse transpose, which exists for singular matrices too.
fn cofactors(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}
