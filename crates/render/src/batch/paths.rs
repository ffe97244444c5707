//! The paths of a part, as a structure of arrays.

use crate::compile::CompiledScene;
use crate::integrator::carried::{Carried, Rest};
use crate::integrator::light_part::LightTag;
use crate::integrator::{PathState, SurfaceVertex};
use snell_intersect::{Hit, SurfaceInteraction};
use snell_math::{Ray, SampledSpectrum};

/// Live paths: one entry per ray in flight.
#[derive(Debug)]
pub struct Paths {
    /// The ray to trace next.
    pub rays: Vec<Ray>,
    /// The state of the path.
    pub carried: Vec<Carried>,
    /// The rest of the state; empty if it is [`Rest::PLAIN`] for all.
    rest: Vec<Rest>,
    /// The times of the rays, from 0 to 1; empty like `rest`.
    pub times: Vec<f32>,
    is_plain: bool,
    /// The sample of the part to which the path belongs.
    pub samples: Vec<u32>,
    /// The hits of the rays.
    pub hits: Vec<Hit>,
}

impl Paths {
    /// No paths. `is_plain` if the states of all future paths are [`Rest::PLAIN`].
    pub fn new(is_plain: bool) -> Self {
        let (rays, carried, rest, times) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Self { rays, carried, rest, times, is_plain, samples: Vec::new(), hits: Vec::new() }
    }

    pub fn clear(&mut self) {
        self.rays.clear();
        self.carried.clear();
        self.rest.clear();
        self.times.clear();
        self.samples.clear();
    }

    pub fn push(&mut self, ray: Ray, state: &PathState, sample: u32) {
        let (carried, rest) = Carried::of(state);
        self.rays.push(ray);
        self.carried.push(carried);
        self.samples.push(sample);
        self.extend_rest(std::iter::once(rest));
    }

    /// Adds the rest of states after all else was added.
    pub fn extend_rest(&mut self, rest: impl Iterator<Item = Rest> + Clone) {
        if !self.is_plain {
            self.rest.extend(rest.clone());
            self.times.extend(rest.map(|rest| rest.time));
        }
    }

    /// The state of a path.
    pub fn state(&self, path: usize) -> PathState {
        self.carried[path].with(self.rest(path))
    }

    pub fn rest(&self, path: usize) -> &Rest {
        if self.is_plain { &Rest::PLAIN } else { &self.rest[path] }
    }

    /// The rest of all states, if it is not [`Rest::PLAIN`] for all.
    pub fn rests(&self) -> Option<&[Rest]> {
        (!self.is_plain).then_some(&self.rest)
    }

    /// True for a path that has ended.
    pub fn is_dead(&self, path: usize) -> bool {
        self.carried[path].throughput.is_black()
    }

    /// The surface that a path has hit.
    pub fn interaction(&self, scene: &CompiledScene, path: usize) -> SurfaceInteraction {
        scene.interaction(&self.rays[path], self.rest(path).time, &self.hits[path])
    }

    /// The same as input of vertex functions.
    pub fn surface<'s>(
        &'s self,
        scene: &'s CompiledScene,
        path: usize,
        interaction: &'s SurfaceInteraction,
        outside_ior: f32,
    ) -> SurfaceVertex<'s> {
        let material = scene.material_id(&self.hits[path]);
        let (hit, Carried { cone_width, cone_spread, .. }) =
            (&self.hits[path], &self.carried[path]);
        SurfaceVertex {
            hit,
            interaction,
            material: scene.material(material),
            prepared: scene.prepared(material),
            footprint: cone_width + cone_spread * hit.t,
            mode: self.rest(path).mode,
            outside_ior,
        }
    }

    /// True if the rest of all states is [`Rest::PLAIN`].
    pub fn is_plain(&self) -> bool {
        self.is_plain
    }

    pub fn len(&self) -> usize {
        self.rays.len()
    }
}

/// Rays towards lights, with their contributions if unoccluded.
#[derive(Debug, Default)]
pub struct LightRays {
    pub rays: Vec<Ray>,
    pub times: Vec<f32>,
    pub values: Vec<SampledSpectrum>,
    pub samples: Vec<u32>,
    /// The classification of the light, if layers need it.
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
