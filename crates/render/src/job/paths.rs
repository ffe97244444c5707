//! The paths of a part, as a structure of arrays.

use crate::integrator::PathState;
use crate::integrator::light_part::LightTag;
use snell_intersect::Hit;
use snell_math::{Ray, SampledSpectrum};

/// Live paths: one entry per ray in flight.
#[derive(Debug, Default)]
pub struct Paths {
    /// The ray to trace next.
    pub rays: Vec<Ray>,
    /// When it is traced, from 0 to 1.
    pub times: Vec<f32>,
    /// What the path carries.
    pub states: Vec<PathState>,
    /// Which sample of the part the path belongs to.
    pub samples: Vec<u32>,
    /// What the rays hit.
    pub hits: Vec<Hit>,
}

impl Paths {
    pub fn clear(&mut self) {
        self.rays.clear();
        self.times.clear();
        self.states.clear();
        self.samples.clear();
    }

    pub fn push(&mut self, ray: Ray, state: PathState, sample: u32) {
        self.rays.push(ray);
        self.times.push(state.time);
        self.states.push(state);
        self.samples.push(sample);
    }

    pub fn len(&self) -> usize {
        self.rays.len()
    }
}

/// Rays towards lights, with what they bring if nothing is in the way.
#[derive(Debug, Default)]
pub struct LightRays {
    pub rays: Vec<Ray>,
    pub times: Vec<f32>,
    pub values: Vec<SampledSpectrum>,
    pub samples: Vec<u32>,
    /// What is known of the light, if anybody wants to know.
    pub tags: Vec<LightTag>,
    pub blocked: Vec<bool>,
}

impl LightRays {
    pub fn clear(&mut self) {
        self.rays.clear();
        self.times.clear();
        self.values.clear();
        self.samples.clear();
        self.tags.clear();
    }

    pub fn push(&mut self, ray: Ray, time: f32, value: SampledSpectrum, sample: u32) {
        self.rays.push(ray);
        self.times.push(time);
        self.values.push(value);
        self.samples.push(sample);
    }
}
