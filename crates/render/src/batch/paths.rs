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
    /// The ray of each path to trace next.
    pub rays: Vec<Ray>,
    /// The most used part of each path's state.
    pub carried: Vec<Carried>,
    /// The other part of each path's state; empty if it is [`Rest::PLAIN`] for all paths.
    rest: Vec<Rest>,
    /// The times of the rays, from 0 to 1; empty where `rest` is.
    pub times: Vec<f32>,
    is_plain: bool,
    /// The sample that each path belongs to, by its number in the part.
    pub samples: Vec<u32>,
    /// The hit of each ray.
    pub hits: Vec<Hit>,
}

impl Paths {
    /// Makes an empty list. `is_plain` says that the rest of the state of all future paths is
    /// [`Rest::PLAIN`].
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

    /// Adds the rest of the state of paths for which everything else was added before.
    pub fn extend_rest(&mut self, rest: impl Iterator<Item = Rest> + Clone) {
        if !self.is_plain {
            self.rest.extend(rest.clone());
            self.times.extend(rest.map(|rest| rest.time));
        }
    }

    /// The whole state of a path.
    pub fn state(&self, path: usize) -> PathState {
        self.carried[path].with(self.rest(path))
    }

    pub fn rest(&self, path: usize) -> &Rest {
        if self.is_plain { &Rest::PLAIN } else { &self.rest[path] }
    }

    /// The rest of the states of all paths; `None` if it is [`Rest::PLAIN`] for all.
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

    /// The surface that a path has hit, as the input of vertex functions.
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

    /// True if the rest of the state is [`Rest::PLAIN`] for all paths.
    pub fn is_plain(&self) -> bool {
        self.is_plain
    }

    pub fn len(&self) -> usize {
        self.rays.len()
    }
}

/// Rays towards lights, with what each contributes if it is unoccluded.
#[derive(Debug, Default)]
pub struct LightRays {
    pub rays: Vec<Ray>,
    pub times: Vec<f32>,
    pub values: Vec<SampledSpectrum>,
    pub samples: Vec<u32>,
    /// The layers that each contribution belongs to, if layers need it.
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
