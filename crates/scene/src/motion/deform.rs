//! Deformation of meshes by morph targets, then by skins (glTF 2.0, sections 3.7.2.2 and 3.7.3).

pub use super::mesh::make_usable;

use crate::graph::NodeId;
use snell_intersect::TriangleMesh;
use snell_math::{DAffine3, DMat3, Vec3};
use std::sync::Arc;

/// A surface whose mesh is deformed.
#[derive(Clone, Debug)]
pub struct Deformed {
    /// The node that holds the surface.
    pub node: NodeId,
    /// Index of the surface among those of the node.
    pub surface: usize,
    /// The undeformed mesh.
    pub rest: Arc<TriangleMesh>,
    /// Morph targets that are added to the mesh.
    pub morph: Option<Morph>,
    /// The skin, and the influences of its joints on the vertices.
    pub skin: Option<(Arc<Skin>, Vec<InfluenceSet>)>,
}

/// Morph targets of a mesh.
#[derive(Clone, Debug)]
pub struct Morph {
    /// The morph targets.
    pub targets: Vec<MorphTarget>,
    /// Default weights of the targets; missing ones are 0.
    pub weights: Vec<f64>,
    /// Number of the joint whose weight tracks set the weights.
    pub joint: u32,
}

/// Differences from the mesh, one per vertex; empty lists for unchanged attributes.
#[derive(Clone, Debug, Default)]
pub struct MorphTarget {
    /// Differences of positions.
    pub positions: Vec<Vec3>,
    /// Differences of normals.
    pub normals: Vec<Vec3>,
    /// Differences of tangent directions.
    pub tangents: Vec<Vec3>,
}

/// The joints of a skin.
#[derive(Clone, Debug, Default)]
pub struct Skin {
    /// Numbers of the joints.
    pub joints: Vec<u32>,
    /// The map from the mesh to each joint in the bind pose, one for each joint.
    pub inverse_bind: Vec<DAffine3>,
}

/// Up to four joints that influence each vertex. Several sets hold more than four.
#[derive(Clone, Debug, Default)]
pub struct InfluenceSet {
    /// For each vertex, indices into [`Skin::joints`].
    pub joints: Vec<[u16; 4]>,
    /// For each vertex, the weights of these joints; weights that are not positive are ignored.
    pub weights: Vec<[f32; 4]>,
}

impl Deformed {
    /// The mesh deformed with these weights and, if there is a skin, with `matrices`, which hold
    /// `world_from_mesh` for each of the skin's joints. The error is the index of the first joint
    /// that influences a vertex but is missing in the skin.
    pub fn mesh(&self, weights: &[f64], matrices: &[DAffine3]) -> Result<TriangleMesh, usize> {
        let mut mesh = TriangleMesh::clone(&self.rest);
        if let Some(morph) = &self.morph {
            morph_mesh(&mut mesh, &morph.targets, weights);
        }
        if let Some((_, influences)) = &self.skin {
            skin_mesh(&mut mesh, influences, matrices)?;
        }
        Ok(mesh)
    }
}

/// Adds the weighted targets to a mesh, and repairs its attributes.
pub fn morph_mesh(mesh: &mut TriangleMesh, targets: &[MorphTarget], weights: &[f64]) {
    for (target, &weight) in targets.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
        let weight = weight as f32;
        mesh.positions.iter_mut().zip(&target.positions).for_each(|(p, d)| *p += weight * *d);
        mesh.normals.iter_mut().zip(&target.normals).for_each(|(n, d)| *n += weight * *d);
        for (tangent, difference) in mesh.tangents.iter_mut().zip(&target.tangents) {
            *tangent = (tangent.truncate() + weight * *difference).extend(tangent.w);
        }
    }
    make_usable(mesh);
}

/// Deforms a mesh by a skin, into world coordinates. The error is the index of the first joint that
/// is missing in the skin.
pub fn skin_mesh(
    mesh: &mut TriangleMesh,
    influences: &[InfluenceSet],
    matrices: &[DAffine3],
) -> Result<(), usize> {
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
            *tangent = t.map_or(*tangent, |t| {
                t.as_vec3().extend(if turned_over { -tangent.w } else { tangent.w })
            });
        }
    }
    if mirrored * 2 > mesh.positions.len() {
        for [_, b, c] in &mut mesh.indices {
            std::mem::swap(b, c);
        }
    }
    Ok(())
}

/// The linear blend of the maps of a vertex's joints. Weights are normalised; a vertex without
/// influences stays in place.
fn blend(
    influences: &[InfluenceSet],
    vertex: usize,
    matrices: &[DAffine3],
) -> Result<DAffine3, usize> {
    let mut sum = DAffine3::ZERO;
    let mut total = 0.0;
    for set in influences {
        let pairs = set.joints[vertex].iter().zip(&set.weights[vertex]);
        for (&joint, &weight) in pairs.filter(|(_, weight)| **weight > 0.0) {
            let matrix = matrices.get(usize::from(joint)).ok_or(usize::from(joint))?;
            let weight = f64::from(weight);
            sum.matrix3 += matrix.matrix3 * weight;
            sum.translation += matrix.translation * weight;
            total += weight;
        }
    }
    if total == 0.0 || !total.is_finite() {
        return Ok(DAffine3::IDENTITY);
    }
    Ok(DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation / total })
}

/// The cofactor matrix: the determinant times the inverse transpose. It exists for singular
/// matrices too.
fn cofactors(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}
