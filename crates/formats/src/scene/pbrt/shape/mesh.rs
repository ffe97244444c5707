//! Triangle meshes, in the scene and in files.

use super::super::params::Params;
use super::super::{Builder, identity};
use super::{Lamps, Made, check_length, flip_v, orient};
use crate::mesh::{MeshRead, read_named_mesh, vertices_at};
use crate::scene::fault::Fault;
use snell_intersect::{TriangleMesh, first_uv_set};
use snell_math::{DVec3, Vec2, Vec3};
use std::sync::Arc;

impl Builder<'_> {
    pub(super) fn triangle_mesh(&mut self, params: &Params) -> Result<Made, Fault> {
        let positions = self.points(params)?;
        let count = positions.len();
        let (mut indices, number) = params.indices::<3>("indices", count)?;
        if number == 0 {
            if count != 3 {
                return Err(params.fault(
                    "there are no indices",
                    "give three for each triangle in \"integer indices\"",
                ));
            }
            indices = vec![[0, 1, 2]];
        }
        if number % 3 != 0 {
            let problem = format!("{number} indices, which is not a multiple of three");
            return Err(params.fault(problem, "give three for each triangle"));
        }
        let normals = params.directions("N")?;
        let uvs = self.uv_param(params)?;
        // Tangents only orient anisotropic surfaces.
        params.get("S");
        check_length(params, "N", normals.len(), count)?;
        check_length(params, "uv", uvs.len(), count)?;
        self.note_common(params);
        let mesh = TriangleMesh {
            positions,
            indices,
            normals,
            uvs: first_uv_set(uvs),
            ..TriangleMesh::default()
        };
        Ok(self.finish_mesh(mesh, Lamps::Triangles))
    }

    /// Texture coordinates, by the names of pbrt-v4 and pbrt-v3.
    pub(super) fn uv_param(&self, params: &Params) -> Result<Vec<Vec2>, Fault> {
        let uvs = params.pairs("uv")?;
        if uvs.is_empty() { params.pairs("st") } else { Ok(uvs) }
    }

    /// Converts a mesh to the scene's conventions.
    pub(super) fn finish_mesh(&mut self, mut mesh: TriangleMesh, lamps: Lamps) -> Made {
        repair(&mut mesh);
        orient(&mut mesh, self.is_reversed());
        if mesh.uvs[0].is_empty() && self.is_textured() {
            separate_with_uvs(&mut mesh);
        }
        flip_v(&mut mesh);
        match mesh.indices.is_empty() {
            true => Made::Nothing,
            false => Made::Mesh(Arc::new(mesh), DVec3::ZERO, lamps),
        }
    }

    pub(super) fn ply_mesh(&mut self, params: &Params) -> Result<Made, Fault> {
        let Some((name, at)) = self.file_name(params, "filename")? else {
            return Err(params.fault("there is no file name", "add \"string filename\""));
        };
        self.note_common(params);
        let path = self
            .home(name)
            .resolve(name)
            .map_err(|error| Fault::new(at, error.problem, error.remedy))?;
        let key = (identity(&path), self.is_reversed());
        if let Some((mesh, origin, lamps)) = self.shapes.files.get(&key) {
            return Ok(Made::Mesh(mesh.clone(), *origin, lamps.clone()));
        }
        let mut input = self.open(name, at)?;
        let MeshRead { mut mesh, origin, faces, warnings, .. } = read_named_mesh(&mut input)?;
        self.notes.add_of_mesh(at, warnings);
        mesh.colors.clear();
        mesh.material_slots.clear();
        // pbrt makes a bilinear patch of a quadrilateral.
        let lamps = match faces {
            Some(triangles) => Lamps::Patches(triangles.into()),
            None => Lamps::Triangles,
        };
        let mut made = self.finish_mesh(mesh, lamps);
        if let Made::Mesh(mesh, at, lamps) = &mut made {
            *at = origin;
            self.shapes.files.insert(key, (mesh.clone(), origin, lamps.clone()));
        }
        Ok(made)
    }
}

/// Replaces normals of zero length by those of the adjacent faces.
fn repair(mesh: &mut TriangleMesh) {
    let is_bad = |n: &Vec3| n.try_normalize().is_none();
    if mesh.normals.iter().any(is_bad) {
        let computed = mesh.computed_normals();
        for (normal, computed) in mesh.normals.iter_mut().zip(computed) {
            if is_bad(normal) {
                *normal = computed;
            }
        }
    }
    for uv in &mut mesh.uvs[0] {
        if !uv.is_finite() {
            *uv = Vec2::ZERO;
        }
    }
}

/// Gives each triangle its own vertices, with pbrt's default texture coordinates.
fn separate_with_uvs(mesh: &mut TriangleMesh) {
    let indices = (0..mesh.indices.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    *mesh = TriangleMesh { indices, ..vertices_at(mesh, mesh.indices.as_flattened()) };
    let triangle = [Vec2::ZERO, Vec2::X, Vec2::ONE];
    mesh.uvs[0] = (0..mesh.positions.len()).map(|i| triangle[i % 3]).collect();
}
