//! Tessellates bilinear patches.

use super::super::Builder;
use super::super::params::Params;
use super::{Lamps, Made, check_length};
use crate::scene::fault::Fault;
use snell_intersect::TriangleMesh;
use snell_math::{Vec2, Vec3};

/// A patch is flat if its corners are this close to a plane, relative to its size.
const FLAT: f32 = 1e-4;
/// Pieces along the sides of a patch that is not flat.
const PIECES: u32 = 8;

impl Builder<'_> {
    pub(super) fn bilinear_mesh(&mut self, params: &Params) -> Result<Made, Fault> {
        let points = self.points(params)?;
        let count = points.len();
        let (mut indices, number) = params.indices::<4>("indices", count)?;
        if number == 0 {
            if count != 4 {
                return Err(params.fault(
                    "there are no indices",
                    "give four for each patch in \"integer indices\"",
                ));
            }
            indices = vec![[0, 1, 2, 3]];
        }
        if number % 4 != 0 {
            let problem = format!("{number} indices, which is not a multiple of four");
            return Err(params.fault(problem, "give four for each patch"));
        }
        let (normals, uvs) = (params.directions("N")?, self.uv_param(params)?);
        check_length(params, "N", normals.len(), count)?;
        check_length(params, "uv", uvs.len(), count)?;
        if let Some(param) = params.get("emissionfilename") {
            let at = param.at;
            self.note("emissionfilename", at, || {
                "\"emissionfilename\" was ignored: the patch emits evenly".into()
            });
        }
        self.note_common(params);
        let mut mesh = TriangleMesh::default();
        let mut counts = Vec::with_capacity(indices.len());
        for patch in &indices {
            let corners = patch.map(|i| i as usize);
            let p = corners.map(|i| points[i]);
            let n = (!normals.is_empty()).then(|| corners.map(|i| normals[i]));
            let uv = if uvs.is_empty() {
                [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE]
            } else {
                corners.map(|i| uvs[i])
            };
            let pieces = if is_flat(&p) { 1 } else { PIECES };
            add_patch(&mut mesh, p, n, uv, pieces);
            counts.push(2 * pieces * pieces);
        }
        if normals.is_empty() {
            // A mesh of flat patches needs no normals; if any patch is bent, smooth ones are
            // computed.
            let bent = mesh.indices.len() > indices.len() * 2;
            if bent {
                mesh.normals = mesh.computed_normals();
            }
        }
        Ok(self.finish_mesh(mesh, Lamps::Patches(counts.into())))
    }
}

fn is_flat([p00, p10, p01, p11]: &[Vec3; 4]) -> bool {
    let normal = (*p10 - *p00).cross(*p01 - *p00);
    let size = (*p11 - *p00).length().max((*p10 - *p01).length());
    normal.try_normalize().is_none_or(|n| (*p11 - *p00).dot(n).abs() <= FLAT * size)
}

/// Appends a patch with corners at (0, 0), (1, 0), (0, 1) and (1, 1) in its coordinates.
fn add_patch(
    mesh: &mut TriangleMesh,
    p: [Vec3; 4],
    n: Option<[Vec3; 4]>,
    uv: [Vec2; 4],
    pieces: u32,
) {
    let first = mesh.positions.len() as u32;
    for j in 0..=pieces {
        for i in 0..=pieces {
            let (s, t) = (i as f32 / pieces as f32, j as f32 / pieces as f32);
            let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
            mesh.positions.push((0..4).map(|k| p[k] * weights[k]).sum());
            mesh.uvs[0].push((0..4).map(|k| uv[k] * weights[k]).sum());
            if let Some(n) = n {
                mesh.normals.push((0..4).map(|k| n[k] * weights[k]).sum());
            }
        }
    }
    let at = |i: u32, j: u32| first + j * (pieces + 1) + i;
    for j in 0..pieces {
        for i in 0..pieces {
            mesh.indices.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.indices.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
}
