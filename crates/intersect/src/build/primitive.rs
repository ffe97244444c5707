//! The input of the builders: boxes with the numbers of their triangles or objects.

use super::binning::{Box8, Primitive};
use crate::group::GroupList;
use crate::mesh::{TriangleMesh, are_degenerate, padded_bounds};
use crate::prefetch::fetch;
use crate::tree::storage::{Plain, Storage};
use rayon::prelude::*;
use snell_math::{Vec3, Vec4};
use std::ops::Range;

/// A value that carries the number of a triangle within its group, or the number of an object
/// together with the bit [`OBJECT`].
pub(super) trait Numbered: Copy + Send + Sync {
    fn id(&self) -> u32;
}

/// The bit that is set in numbers of objects (shapes and instances).
pub(super) const OBJECT: u32 = 1 << 31;

/// The largest number of triangles in a group.
pub(super) const MAX_TRIANGLES: usize = 1 << 30;

// SAFETY: a `Primitive` is eight numbers without padding, and accepts any bits.
unsafe impl Plain for Primitive {}

impl Numbered for Primitive {
    #[inline(always)]
    fn id(&self) -> u32 {
        self.number()
    }
}

/// The triangles of a group, numbered mesh after mesh.
#[derive(Clone, Copy)]
pub(super) struct Triangles<'a> {
    list: &'a GroupList,
    /// For each mesh the number of its first triangle, and its geometry; see
    /// [`crate::tree::GroupTree::meshes`].
    meshes: &'a [(u32, u32)],
}

impl<'a> Triangles<'a> {
    pub fn new(list: &'a GroupList, meshes: &'a [(u32, u32)]) -> Self {
        Self { list, meshes }
    }

    /// The number of triangles, including degenerate ones.
    pub fn count(&self) -> usize {
        self.list.meshes.iter().map(|(_, mesh)| mesh.indices.len()).sum()
    }

    /// The mesh of a triangle, and the number of the triangle in the mesh.
    #[inline(always)]
    fn find(&self, id: u32) -> (&'a TriangleMesh, usize) {
        let mesh = match self.meshes {
            [_] => 0,
            all => all.partition_point(|m| m.0 <= id).saturating_sub(1),
        };
        (&self.list.meshes[mesh].1, (id - self.meshes[mesh].0) as usize)
    }

    /// The corners of a triangle.
    #[inline(always)]
    pub fn corners(&self, id: u32) -> [Vec3; 3] {
        let (mesh, triangle) = self.find(id);
        mesh.corners(triangle)
    }

    /// Prefetches the indices of a triangle.
    #[inline(always)]
    pub fn fetch_indices(&self, id: u32) {
        let (mesh, triangle) = self.find(id);
        fetch(&mesh.indices[triangle]);
    }

    /// Prefetches the corners of a triangle.
    #[inline(always)]
    pub fn fetch_corners(&self, id: u32) {
        let (mesh, triangle) = self.find(id);
        for v in mesh.indices[triangle] {
            fetch(&mesh.positions[v as usize]);
        }
    }

    /// True if the triangle can never be hit.
    pub fn is_degenerate(&self, id: u32) -> bool {
        let (mesh, triangle) = self.find(id);
        mesh.is_degenerate(triangle)
    }

    /// A box around the doubled centres (by `center2`) of all triangles. It is approximate if there
    /// are so many triangles that they are sampled.
    pub fn centers(&self, center2: impl Fn([Vec3; 3]) -> Vec4 + Sync) -> Box8 {
        let stride = self.count() / SAMPLES + 1;
        let of_piece = |(mesh, range): (&TriangleMesh, Range<usize>)| {
            let all = range.step_by(stride).map(|triangle| mesh.corners(triangle));
            all.filter(|corners| !are_degenerate(corners))
                .fold(Box8::EMPTY, |b, corners| b.with_point(center2(corners)))
        };
        let mut pieces = Vec::new();
        for (_, mesh) in &self.list.meshes {
            // Each piece starts where the samples of the previous piece would continue.
            pieces.extend(
                ranges(mesh.indices.len(), stride * SAMPLES_AT_ONCE).map(|range| (&**mesh, range)),
            );
        }
        pieces.into_par_iter().map(of_piece).reduce(|| Box8::EMPTY, |a, b| a.union(&b))
    }

    /// The triangles that can never be hit.
    pub fn degenerate(&self) -> Vec<u32> {
        (0..self.count() as u32)
            .into_par_iter()
            .with_min_len(CHUNK)
            .filter(|&id| self.is_degenerate(id))
            .collect()
    }

    /// Fills the front of `to`, in parallel and in order, with the results of `make` for the
    /// triangles that can be hit (called with the number and corners of each). Returns the number
    /// of these triangles.
    pub fn collect<T: Copy + Send>(
        &self,
        to: &mut [T],
        make: impl Fn(u32, [Vec3; 3]) -> T + Sync,
    ) -> usize {
        let chunk = chunk_of(self.count());
        let mut rest = &mut *to;
        let mut jobs = Vec::new();
        for ((_, mesh), &(first, _)) in self.list.meshes.iter().zip(self.meshes) {
            for range in ranges(mesh.indices.len(), chunk) {
                let (piece, others) = rest.split_at_mut(range.len());
                rest = others;
                jobs.push((mesh, first, range, piece));
            }
        }
        let counts: Vec<(usize, usize)> = jobs
            .into_par_iter()
            .map(|(mesh, first, range, piece)| {
                let (size, mut count) = (range.len(), 0);
                for i in range {
                    let corners = mesh.corners(i);
                    if !are_degenerate(&corners) {
                        piece[count] = make(first + i as u32, corners);
                        count += 1;
                    }
                }
                (size, count)
            })
            .collect();
        close_gaps(to, &counts)
    }
}

/// The number of triangles sampled to estimate the extent of all.
const SAMPLES: usize = 1 << 14;

/// The number of samples that one task handles.
const SAMPLES_AT_ONCE: usize = 1 << 11;

/// The largest number of triangles that one task handles.
pub(super) const CHUNK: usize = 1 << 14;
/// The least number of triangles that one task handles.
const LEAST_CHUNK: usize = 1 << 11;

/// The number of triangles per task, of `count` in total: small enough to balance the threads.
fn chunk_of(count: usize) -> usize {
    (count / (8 * rayon::current_num_threads())).clamp(LEAST_CHUNK, CHUNK)
}

/// Ranges of `size` elements that together cover `count`; the last may be shorter.
fn ranges(count: usize, size: usize) -> impl Iterator<Item = Range<usize>> {
    (0..count).step_by(size).map(move |start| start..(start + size).min(count))
}

/// Moves the used elements of all pieces together, to the front. `pieces` has for each piece its
/// size and the number of its used elements, which are at its front. Returns the number of all used
/// elements.
fn close_gaps<T: Copy>(items: &mut [T], pieces: &[(usize, usize)]) -> usize {
    let (mut from, mut to) = (0, 0);
    for &(size, used) in pieces {
        if from != to {
            items.copy_within(from..from + used, to);
        }
        from += size;
        to += used;
    }
    to
}

/// The boxes of all triangles that can be hit, and the number of these triangles, with room for
/// `extra` more boxes.
pub(super) fn triangle_primitives(
    triangles: &Triangles,
    extra: usize,
) -> (Storage<Primitive>, usize) {
    let mut primitives = Storage::unset(triangles.count() + extra);
    let count = triangles.collect(&mut primitives[..triangles.count()], |id, corners| {
        let bounds = padded_bounds(&corners);
        Primitive::new(bounds.min, bounds.max, id)
    });
    (primitives, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_close_in_order() {
        let mut items = [1, 2, 0, 3, 0, 0, 4, 5, 6];
        assert_eq!(close_gaps(&mut items, &[(3, 2), (3, 1), (3, 3)]), 6);
        assert_eq!(items[..6], [1, 2, 3, 4, 5, 6]);
    }

    #[test]
    fn numbers_survive_beside_boxes() {
        for id in [0, 1, 7 | OBJECT, u32::MAX, 0x7fc0_0001] {
            let p = Primitive::new(Vec3::ZERO, Vec3::ONE, id);
            assert_eq!((p.id(), p.bounds().half_area()), (id, 3.0));
        }
    }
}
