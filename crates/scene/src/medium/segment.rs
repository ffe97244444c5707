//! A segment of a ray through a medium, and the result of travelling along it.

use super::HenyeyGreenstein;
use snell_math::{SampledSpectrum, Vec3};

/// A segment of a ray through a medium.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// Its start.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
    /// Length in scene units; may be infinite.
    pub length: f32,
}

impl Segment {
    /// The point at a distance from the origin.
    pub fn at(&self, distance: f32) -> Vec3 {
        self.origin + self.direction * distance
    }
}

/// A scattering event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattering {
    /// Distance from the origin of the segment, less than its length.
    pub distance: f32,
    /// The phase function there.
    pub phase: HenyeyGreenstein,
}

/// The result of a path that travels along a segment.
#[derive(Clone, Copy, Debug)]
pub struct Travel {
    /// Its throughput at the end, or where it was scattered (including the albedo).
    pub throughput: SampledSpectrum,
    /// Radiance that the medium emitted towards its start, times its throughput there.
    pub emitted: SampledSpectrum,
    /// The scattering event; `None` if the path reached the end.
    pub scattered: Option<Scattering>,
}

impl Travel {
    /// Travel through vacuum.
    pub fn unchanged(throughput: SampledSpectrum) -> Self {
        Self { throughput, emitted: SampledSpectrum::ZERO, scattered: None }
    }
}
