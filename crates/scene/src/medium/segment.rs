//! A straight way through a medium, and what becomes of light on it.

use super::HenyeyGreenstein;
use snell_math::{SampledSpectrum, Vec3};

/// A straight way through a medium.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Where it begins.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
    /// In scene units; may be infinite.
    pub length: f32,
}

impl Segment {
    /// The point at a distance from the origin.
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// Where a path was scattered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattering {
    /// Distance from the origin of the segment, less than its length.
    pub distance: f32,
    /// How it goes on.
    pub phase: HenyeyGreenstein,
}

/// What became of a path that set out along a segment.
#[derive(Clone, Copy, Debug)]
pub struct Travel {
    /// Its throughput at the end of the way, or where it was scattered (albedo included).
    pub throughput: SampledSpectrum,
    /// Radiance that the medium emitted towards its start, times its throughput there.
    pub emitted: SampledSpectrum,
    /// Where it was scattered; `None` if it came to the end.
    pub scattered: Option<Scattering>,
}

impl Travel {
    /// A way through nothing.
    pub fn unchanged(throughput: SampledSpectrum) -> Self {
        Self { throughput, emitted: SampledSpectrum::ZERO, scattered: None }
    }
}
