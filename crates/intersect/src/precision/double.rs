//! Exact decisions in double precision, with trees in single precision.
//!
//! The tree of a group is built over a *shadow* of its meshes: triangles whose vertices are moved
//! near the origin, scaled to about 1 and rounded to `f32` ([`Frame`]). Boxes and the filter of
//! triangles use the shadow and allow for the rounding. The triangles that remain, one or two per
//! ray, are tested exactly on their `f64` vertices.

use super::frame::Frame;
use crate::mesh::DTriangleMesh;
use crate::prefetch::fetch;
use rayon::prelude::*;
use snell_math::DVec3;
use std::sync::Arc;

/// The data that searches in double precision need besides the trees.
#[derive(Debug, Default)]
pub(crate) struct DoubleData {
    /// For each group, the map from its coordinates to those of its tree.
    pub frames: Vec<Frame>,
    /// For each geometry the corners of its triangles, stored without indices, so that a ray waits
    /// for memory only once per triangle: most rays test one triangle of each leaf. Empty for a
    /// geometry that is not a mesh.
    corners: Vec<Arc<[[DVec3; 3]]>>,
}

impl DoubleData {
    /// Collects the corners of meshes. `known` returns earlier data, if any, that already holds the
    /// corners of the mesh with this number.
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

    /// The corners of all triangles of a mesh.
    #[cfg(test)]
    pub fn corners_of(&self, geometry: usize) -> Arc<[[DVec3; 3]]> {
        self.corners[geometry].clone()
    }

    /// Prefetches the corners of a triangle.
    #[inline(always)]
    pub fn fetch(&self, geometry: u32, triangle: u32) {
        fetch(self.corners(geometry, triangle));
    }

    /// Memory of the corners in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.corners.iter().map(|corners| size_of_val(&**corners)).sum()
    }
}
