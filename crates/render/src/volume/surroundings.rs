//! The media around paths at their vertices.

use super::{KnownInsides, Walker};
use crate::integrator::MediumVertex;
use snell_intersect::Hit;

/// The media around the paths of a batch.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// The walker, which holds the media of the scene.
    pub walker: &'a Walker<'a>,
    /// All sets of objects that the paths are inside.
    pub known: &'a KnownInsides,
    /// The number of each path's set.
    pub insides: &'a [u32],
    /// The points at which media scattered the paths.
    pub scattered: &'a [Option<MediumVertex>],
}

impl Surroundings<'_> {
    /// Index of refraction on the outer side of the surface that a path hit.
    pub fn outside_ior(&self, path: usize, hit: &Hit) -> f32 {
        self.walker.outside_ior(self.known.get(self.insides[path]), hit)
    }
}
