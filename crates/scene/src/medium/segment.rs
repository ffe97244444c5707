//! A segment of a ray through a medium, and the result of travelling along it.

use super::HenyeyGreenstein;
use snell_math::{SampledSpectrum, Vec3};

/// A segment of a ray through a medium.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    /// The start of the segment.
    pub origin: Vec3,
    /// Unit direction of the ray.
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
    /// Distance of the event from the origin of the segment, less than the segment's length.
    pub distance: f32,
    /// The phase function at the point of the event.
    pub phase: HenyeyGreenstein,
}

/// What happened to a path along a segment.
#[derive(Clone, Copy, Debug)]
pub struct Travel {
    /// The path's throughput at the end of the segment, or after it was scattered (including the
    /// albedo).
    pub throughput: SampledSpectrum,
    /// Radiance that the medium emitted towards the segment's start, multiplied by the throughput
    /// there.
    pub emitted: SampledSpectrum,
    /// The scattering event; `None` if the path reached the end.
    pub scattered: Option<Scattering>,
}

impl Travel {
    /// The result for a path through vacuum, whose throughput is unchanged.
    pub fn unchanged(throughput: SampledSpectrum) -> Self {
        Self { throughput, emitted: SampledSpectrum::ZERO, scattered: None }
    }
}
