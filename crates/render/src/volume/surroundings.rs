//! What media say of paths that have come to vertices.

use super::{KnownInsides, Walker};
use crate::integrator::MediumVertex;
use snell_intersect::Hit;

/// The media around the paths of a batch.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// Knows the media of the scene.
    pub walker: &'a Walker<'a>,
    /// All insides that paths are in.
    pub known: &'a KnownInsides,
    /// The number of the insides of each path.
    pub insides: &'a [u32],
    /// Where media have scattered paths.
    pub scattered: &'a [Option<MediumVertex>],
}

impl Surroundings<'_> {
    /// Index of refraction on the outer side of the surface that a path has hit.
    pub fn outside_ior(&self, path: usize, hit: &Hit) -> f32 {
        self.walker.outside_ior(self.known.get(self.insides[path]), hit)
    }
}
