//! Exact decisions in double precision, on trees in single precision.
//!
//! The tree of a group is built over a *shadow*: its triangles with vertices moved near the origin, scaled to about 1 and rounded
//! to `f32` ([`frame::Frame`]). Boxes and the filter of triangles work on the shadow and allow for the rounding; the triangles
//! that remain, one or two a ray, are decided on the `f64` vertices.

pub(crate) mod frame;
pub(crate) mod plane;
pub(crate) mod triangle;

#[cfg(test)]
mod tests;

use crate::mesh::DTriangleMesh;
use frame::Frame;
use snell_math::DVec3;
use std::sync::Arc;

/// What searches in double precision need besides the trees.
#[derive(Debug, Default)]
pub(crate) struct DoubleData {
    /// Per group, how its tree's coordinates follow from its own.
    pub frames: Vec<Frame>,
    /// Per geometry; empty for what is not a mesh.
    pub meshes: Vec<Arc<DTriangleMesh>>,
}

impl DoubleData {
    /// The corners of a triangle in the coordinates of its group.
    #[inline(always)]
    pub fn corners(&self, geometry: u32, triangle: u32) -> [DVec3; 3] {
        self.meshes[geometry as usize].corners(triangle as usize)
    }
}
