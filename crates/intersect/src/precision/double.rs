//! Exact decisions in double precision, on trees in single precision.
//!
//! The tree of a group is built over a *shadow*: its triangles with vertices moved near the origin,
//! scaled to about 1 and rounded to `f32` ([`Frame`]). Boxes and the filter of triangles
//! work on the shadow and allow for the rounding; the triangles that remain, one or two a ray, are
//! decided on the `f64` vertices.

use super::frame::Frame;
use crate::mesh::DTriangleMesh;
use crate::prefetch::fetch;
use rayon::prelude::*;
use snell_math::DVec3;
use std::sync::Arc;

/// What searches in double precision need besides the trees.
#[derive(Debug, Default)]
pub(crate) struct DoubleData {
    /// Per group, how its tree's coordinates follow from its own.
    pub frames: Vec<Frame>,
    /// Per geometry the corners of its triangles, side by side: most rays want one triangle of each
    /// leaf they reach, and so wait for memory once. Empty for what is not a mesh.
    corners: Vec<Arc<[[DVec3; 3]]>>,
}

impl DoubleData {
    /// `known` finds groups that already hold the corners of a mesh.
    pub fn new<'a>(
        frames: Vec<Frame>,
        meshes: &[Arc<DTriangleMesh>],
        known: impl Fn(usize) -> Option<&'a Self>,
    ) -> Self {
        let corners = |(i, mesh): (usize, &Arc<DTriangleMesh>)| match known(i) {
            Some(data) => data.corners[i].clone(),
            None => (0..mesh.indices.len())
                .into_par_iter()
                .with_min_len(1 << 14)
                .map(|i| mesh.corners(i))
                .collect(),
        };
        Self { frames, corners: meshes.iter().enumerate().map(corners).collect() }
    }

    /// The corners of a triangle in the coordinates of its group.
    #[inline(always)]
    pub fn corners(&self, geometry: u32, triangle: u32) -> &[DVec3; 3] {
        &self.corners[geometry as usize][triangle as usize]
    }

    /// All corners of a mesh.
    #[cfg(test)]
    pub fn corners_of(&self, geometry: usize) -> Arc<[[DVec3; 3]]> {
        self.corners[geometry].clone()
    }

    /// Asks for the memory of a triangle.
    #[inline(always)]
    pub fn fetch(&self, geometry: u32, triangle: u32) {
        fetch(self.corners(geometry, triangle));
    }

    /// Memory of the corners.
    pub fn memory_bytes(&self) -> usize {
        self.corners.iter().map(|corners| size_of_val(&**corners)).sum()
    }
}
