//! Covers: many small boxes around the contents of an instance instead of one. After a rotation,
//! the union of the small boxes is much tighter than the box of the one rotated box (which is up to
//! `sqrt(3)` times as long on each axis), so fewer rays are transformed into the instance.

use crate::mesh::TriangleMesh;
use rayon::prelude::*;
use snell_math::{Bounds3, Bounds3d, Vec3};
use std::sync::Arc;

/// Boxes whose union holds everything that can be hit. Shared, because computing a cover takes
/// time.
pub(super) type Cover = Arc<[Bounds3d]>;

/// Cells on each axis of the grid into which triangles are sorted.
const CELLS: usize = 8;

/// Below this number of triangles, the cover of a mesh has one box per triangle.
const FEW: usize = 32;

/// The number of triangles that one task handles.
const CHUNK: usize = 1 << 14;

/// The largest number of boxes for the objects of a group; beyond it, boxes are merged.
const MAX_OBJECTS: usize = 512;

/// The cover of a mesh: for each cell of a grid, the box around the triangles whose centres are in
/// it.
pub(super) fn of_mesh(mesh: &TriangleMesh) -> Cover {
    let hittable = |i: &usize| !mesh.is_degenerate(*i);
    if mesh.indices.len() < FEW {
        return (0..mesh.indices.len())
            .filter(hittable)
            .map(|i| mesh.padded_bounds(i).into())
            .collect();
    }
    let all = mesh.bounds();
    let scale = Vec3::splat(CELLS as f32) / all.size();
    let cell = |b: &Bounds3| {
        let at = (b.min * 0.5 + b.max * 0.5 - all.min) * scale;
        // The conversion turns NaN into 0.
        let [x, y, z] = at.to_array().map(|x| (x as usize).min(CELLS - 1));
        x + CELLS * (y + CELLS * z)
    };
    let empty = || vec![Bounds3::EMPTY; CELLS * CELLS * CELLS];
    let of_chunk = |mut cells: Vec<Bounds3>, chunk: usize| {
        for i in (chunk * CHUNK..mesh.indices.len().min((chunk + 1) * CHUNK)).filter(hittable) {
            let b = mesh.padded_bounds(i);
            let cell = &mut cells[cell(&b)];
            *cell = cell.union(&b);
        }
        cells
    };
    let union =
        |a: Vec<Bounds3>, b: Vec<Bounds3>| a.iter().zip(&b).map(|(a, b)| a.union(b)).collect();
    let cells = (0..mesh.indices.len().div_ceil(CHUNK))
        .into_par_iter()
        .fold(empty, of_chunk)
        .reduce(empty, union);
    cells.into_iter().filter(|b| !b.is_empty()).map(Bounds3d::from).collect()
}

/// The cover of a group, made of the covers of its meshes and the boxes of its objects.
pub(super) fn of_group<'a>(meshes: impl Iterator<Item = &'a Cover>, objects: &[Bounds3d]) -> Cover {
    let size = objects.len().div_ceil(MAX_OBJECTS).max(1);
    let together =
        objects.chunks(size).map(|some| some.iter().fold(Bounds3d::EMPTY, |all, b| all.union(b)));
    meshes
        .flat_map(|cover| cover.iter().copied())
        .chain(together)
        .filter(|b| !b.is_empty())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cover_holds_every_triangle_and_is_no_larger_than_the_mesh() {
        let wave = |i: u32| (i as f32 * 0.37).sin() * 3.0;
        let mut mesh = TriangleMesh::default();
        for i in 0..3 * 1000 {
            mesh.positions.push(Vec3::new(wave(i), wave(i + 7) * 2.0, wave(i * 3)));
        }
        mesh.positions[30] = Vec3::NAN;
        mesh.indices = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        for mesh in [mesh.clone(), TriangleMesh { indices: mesh.indices[..20].to_vec(), ..mesh }] {
            let cover = of_mesh(&mesh);
            let mut all = Bounds3d::EMPTY;
            for i in (0..mesh.indices.len()).filter(|&i| !mesh.is_degenerate(i)) {
                let b = Bounds3d::from(mesh.padded_bounds(i));
                all = all.union(&b);
                assert!(cover.iter().any(|c| c.union(&b) == *c), "triangle {i} is in a box");
            }
            assert_eq!(cover.iter().fold(Bounds3d::EMPTY, |a, b| a.union(b)), all);
        }
    }
}
