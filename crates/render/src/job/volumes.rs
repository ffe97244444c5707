//! Batches of paths and light rays through media: all are traced, those that pass a surface are traced again, until all have
//! arrived.

use super::paths::{LightRays, Paths};
use super::tracer::Tracer;
use crate::integrator::{Context, MediumVertex, SurfaceVertex};
use crate::sampler::Random;
use crate::volume::{Insides, LightStep, Numbers, OwnMedia, PathStep, Walker};
use snell_intersect::{Grouping, Hit, SurfaceInteraction};
use snell_math::{ColorMode, Ray, SampledSpectrum, Vec3};
use snell_scene::{MaterialId, MediumId};

/// Most surfaces that a ray passes between two vertices. No scene that makes sense has as many.
const MOST_PASSED: usize = 1 << 14;

/// What media need beside [`Paths`] and [`LightRays`]: entries for the same paths and rays.
pub struct VolumeBatch<'a> {
    walker: Walker<'a>,
    own: OwnMedia,
    /// Surfaces whose insides the camera is in.
    around_camera: Vec<(MaterialId, SurfaceInteraction)>,
    /// The insides that each path is in.
    insides: Vec<Insides>,
    next: Vec<Insides>,
    /// Where media scattered paths.
    pub scattered: Vec<Option<MediumVertex>>,
    light_insides: Vec<Insides>,
    light_numbers: Vec<Numbers>,
    /// Media that light rays must end in.
    glowing: Vec<Option<MediumId>>,
    numbers: Vec<Numbers>,
    pending: Vec<u32>,
    rays: Vec<Ray>,
    times: Vec<f32>,
    hits: Vec<Hit>,
}

impl<'a> VolumeBatch<'a> {
    /// `None` if the scene has no media.
    pub fn new(context: &Context<'a>, eye: Vec3) -> Option<Self> {
        let walker = Walker::new(context)?;
        Some(Self {
            walker,
            own: OwnMedia::new(),
            around_camera: walker.surfaces_around(eye),
            insides: Vec::new(),
            next: Vec::new(),
            scattered: Vec::new(),
            light_insides: Vec::new(),
            light_numbers: Vec::new(),
            glowing: Vec::new(),
            numbers: Vec::new(),
            pending: Vec::new(),
            rays: Vec::new(),
            times: Vec::new(),
            hits: Vec::new(),
        })
    }

    /// Begins a part with these camera paths.
    pub fn start(&mut self, paths: &Paths) {
        self.own.clear();
        self.insides.clear();
        let (walker, own, around) = (self.walker, &mut self.own, &self.around_camera);
        self.insides.extend((0..paths.len()).map(|i| walker.insides_of(own, around, paths.rest(i).mode)));
        self.next.clear();
    }

    /// The paths that were collected become those that are traced.
    pub fn swap(&mut self) {
        std::mem::swap(&mut self.insides, &mut self.next);
        self.next.clear();
    }

    /// True if rays must be traced by [`Self::advance`], which sees interfaces.
    pub fn sees_more(&self) -> bool {
        self.walker.has_passable()
    }

    /// Brings every path to its next vertex. The hits are those of the rays as the renderer sees them, and are found again if
    /// [`Self::sees_more`]. `random` gives the numbers of a path's next vertex, `radiance` where the emission on its way goes.
    pub fn advance(
        &mut self,
        tracer: &mut Tracer,
        paths: &mut Paths,
        grouping: Grouping,
        random: impl Fn(&Paths, usize) -> Random,
        mut emitted: impl FnMut(&Paths, usize, SampledSpectrum),
    ) {
        let count = paths.len();
        if self.sees_more() {
            tracer.closest_by(&self.walker, &paths.rays, &paths.times, grouping, &mut paths.hits);
        }
        self.scattered.clear();
        self.scattered.resize(count, None);
        self.numbers.clear();
        self.numbers.extend((0..count).map(|i| Numbers::of_path(random(paths, i))));
        self.pending.clear();
        self.pending.extend(0..count as u32);
        for _ in 0..MOST_PASSED {
            let mut kept = 0;
            for at in 0..self.pending.len() {
                let i = self.pending[at] as usize;
                if paths.is_dead(i) {
                    continue;
                }
                let (mut radiance, mut state) = (SampledSpectrum::ZERO, paths.state(i));
                let step = self.walker.step(
                    &mut self.own,
                    &mut paths.rays[i],
                    &mut state,
                    &mut self.insides[i],
                    &paths.hits[i],
                    &mut self.numbers[i],
                    &mut radiance,
                );
                paths.set_state(i, &state);
                if !radiance.is_black() {
                    emitted(paths, i, radiance);
                }
                match step {
                    PathStep::Arrived => {}
                    PathStep::Scattered(vertex) => {
                        self.scattered[i] = Some(vertex);
                        paths.hits[i] = Hit::MISS;
                    }
                    PathStep::Passed => {
                        self.pending[kept] = i as u32;
                        kept += 1;
                    }
                }
            }
            self.pending.truncate(kept);
            if self.pending.is_empty() {
                return;
            }
            self.rays.clear();
            self.rays.extend(self.pending.iter().map(|&i| paths.rays[i as usize]));
            self.times.clear();
            self.times.extend(self.pending.iter().map(|&i| paths.rest(i as usize).time));
            tracer.closest_by(&self.walker, &self.rays, &self.times, Grouping::None, &mut self.hits);
            for (&i, hit) in self.pending.iter().zip(&self.hits) {
                paths.hits[i as usize] = *hit;
            }
        }
        for &i in &self.pending {
            paths.carried[i as usize].throughput = SampledSpectrum::ZERO;
        }
    }

    /// Index of refraction on the outer side of the surface that a path is at.
    pub fn outside_ior(&self, path: usize, hit: &Hit) -> f32 {
        self.walker.outside_ior(&self.insides[path], hit)
    }

    /// Notes the insides of the rays that a vertex sends out.
    pub fn note_outputs(
        &mut self,
        path: usize,
        arriving: Vec3,
        surface: Option<&SurfaceVertex>,
        random: Random,
        light_rays: &[(Ray, SampledSpectrum)],
        glowing: Option<MediumId>,
        next: impl Iterator<Item = Vec3>,
    ) {
        let here = self.insides[path];
        let mut beyond = None;
        let mut of = |own: &mut OwnMedia, direction: Vec3| match surface {
            Some(s)
                if direction.dot(s.interaction.geometric_normal) * arriving.dot(s.interaction.geometric_normal)
                    > 0.0 =>
            {
                *beyond.get_or_insert_with(|| self.walker.beyond(own, &here, s.interaction, s.hit, direction, s.mode))
            }
            _ => here,
        };
        for (number, (ray, _)) in light_rays.iter().enumerate() {
            self.light_insides.push(of(&mut self.own, ray.direction));
            self.light_numbers.push(Numbers::of_light_ray(random, number as u32));
            self.glowing.push(glowing);
        }
        for direction in next {
            self.next.push(of(&mut self.own, direction));
        }
    }

    /// Notes that a path goes on on the side that it has come from.
    pub fn note_next(&mut self, path: usize) {
        self.next.push(self.insides[path]);
    }

    /// Sends light rays to their lights: values lose what media take, and what arrives is not `blocked`. `mode` is that of a sample.
    pub fn trace_light_rays(&mut self, tracer: &mut Tracer, light: &mut LightRays, mode: impl Fn(u32) -> ColorMode) {
        let may_see_past = self.walker.has_priorities() || self.walker.follows_light_rays();
        if may_see_past {
            light.blocked.clear();
            light.blocked.resize(light.rays.len(), false);
        } else {
            tracer.occluded(&light.rays, &light.times, &mut light.blocked);
        }
        self.pending.clear();
        self.pending.extend((0..light.rays.len() as u32).filter(|&i| !light.blocked[i as usize]));
        for _ in 0..MOST_PASSED {
            self.rays.clear();
            self.rays.extend(self.pending.iter().map(|&i| light.rays[i as usize]));
            self.times.clear();
            self.times.extend(self.pending.iter().map(|&i| light.times[i as usize]));
            if self.walker.has_passable() {
                tracer.closest_by(&self.walker, &self.rays, &self.times, Grouping::None, &mut self.hits);
            } else {
                // Nothing is in the way, as is known already.
                self.hits.clear();
                self.hits.resize(self.rays.len(), Hit::MISS);
            }
            let mut kept = 0;
            for at in 0..self.pending.len() {
                let i = self.pending[at] as usize;
                let step = self.walker.light_step(
                    &mut self.own,
                    &mut light.rays[i],
                    light.times[i],
                    &mut light.values[i],
                    mode(light.samples[i]),
                    &mut self.light_insides[i],
                    &self.hits[at],
                    &mut self.light_numbers[i],
                );
                match step {
                    LightStep::Arrived => {
                        light.blocked[i] = !self.walker.is_in(&self.light_insides[i], self.glowing[i])
                    }
                    LightStep::Blocked => light.blocked[i] = true,
                    LightStep::Passed => {
                        self.pending[kept] = i as u32;
                        kept += 1;
                    }
                }
            }
            self.pending.truncate(kept);
            if self.pending.is_empty() {
                break;
            }
        }
        for &i in &self.pending {
            light.blocked[i as usize] = true;
        }
        self.light_insides.clear();
        self.light_numbers.clear();
        self.glowing.clear();
    }
}
