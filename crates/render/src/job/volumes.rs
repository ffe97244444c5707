//! Moves batches of paths and light rays through media. All rays are traced, and those that pass an
//! interface are traced again, until all have arrived.

use super::tracer::Tracer;
use crate::batch::paths::{LightRays, Paths};
use crate::integrator::{Context, MediumVertex};
use crate::sampler::{Random, Sampler};
use crate::volume::{
    Filling, HomogeneousBatch, InterfaceCrossings, KnownInsides, Numbers, Surroundings, Walker,
    end_of, length_to,
};
use snell_intersect::{Grouping, Hit, SurfaceInteraction, SurfacePoint};
use snell_math::{ColorMode, ColorModel, Ray, SampledSpectrum, Vec3};
use snell_scene::{MaterialId, MediumId};

/// The largest number of interfaces that a ray may pass between two vertices, far more than real
/// scenes have.
const MOST_PASSED: usize = 1 << 14;

/// Stands for no material.
const NONE: MaterialId = MaterialId(u32::MAX);

/// The data that media need besides [`Paths`] and [`LightRays`]. The lists have entries for the
/// same paths and rays.
pub struct VolumeBatch<'a> {
    walker: Walker<'a>,
    known: KnownInsides,
    /// The materials of the objects that the camera is inside, each with a point of its surface.
    around_camera: Vec<(MaterialId, SurfaceInteraction)>,
    /// The objects that each path is inside, by number in `known`.
    insides: Vec<u32>,
    /// The objects that each next ray starts inside, by number in `known`.
    next: Vec<u32>,
    /// The points at which media scattered paths.
    pub scattered: Vec<Option<MediumVertex>>,
    light_insides: Vec<u32>,
    /// Random numbers of light rays; empty unless some medium needs them.
    light_numbers: Vec<Numbers>,
    /// The emissive medium in which each light ray must end, if there is one.
    glowing: Vec<Option<MediumId>>,
    /// The number of steps that each path has taken in its [`Numbers`].
    steps: Vec<u32>,
    on_the_way: OnTheWay<'a>,
    sampler: Sampler,
    /// Batch versions of the steps through homogeneous media; `None` with portable code, or in
    /// spectral mode.
    homogeneous: Option<Box<HomogeneousBatch>>,
}

/// Moves the origin of a path's ray, and the hit with it, so that the interval of the ray begins at
/// 0. Returns the origin.
fn begun_at_interval(paths: &mut Paths, path: usize) -> Vec3 {
    let (ray, carried) = (&mut paths.rays[path], &mut paths.carried[path]);
    let begin = ray.t_min;
    carried.cone_width += carried.cone_spread * begin;
    (ray.origin, ray.t_min, ray.t_max) = (ray.at(begin), 0.0, ray.t_max - begin);
    if let Some(hit) = paths.hits.get_mut(path) {
        hit.t -= begin;
    }
    ray.origin
}

/// Rays that have not arrived yet.
struct OnTheWay<'a> {
    /// The indices of the paths or light rays that the rays belong to.
    pending: Vec<u32>,
    rays: Vec<Ray>,
    times: Vec<f32>,
    hits: Vec<Hit>,
    /// The materials of the surfaces that the rays pass.
    materials: Vec<MaterialId>,
    crossings: InterfaceCrossings<'a>,
}

impl OnTheWay<'_> {
    fn clear(&mut self) {
        self.pending.clear();
        self.rays.clear();
        self.times.clear();
        self.hits.clear();
        self.materials.clear();
    }

    /// Adds a ray that passes a surface of this material. `whose` is the index of its path or light
    /// ray.
    fn push(&mut self, whose: u32, ray: Ray, time: f32, hit: Hit, material: MaterialId) {
        self.pending.push(whose);
        self.rays.push(ray);
        self.times.push(time);
        self.hits.push(hit);
        self.materials.push(material);
    }

    /// Keeps only the first `count` rays.
    fn truncate(&mut self, count: usize) {
        self.pending.truncate(count);
        self.rays.truncate(count);
        self.times.truncate(count);
        self.hits.truncate(count);
        self.materials.truncate(count);
    }

    /// Moves a ray to an earlier index, with the material of the surface that it passes.
    fn keep(&mut self, from: usize, to: usize, material: MaterialId) {
        (self.pending[to], self.rays[to], self.times[to]) =
            (self.pending[from], self.rays[from], self.times[from]);
        (self.hits[to], self.materials[to]) = (self.hits[from], material);
    }

    /// Moves every ray through the surface that it passes, and updates the objects that its path is
    /// inside. `mode` returns the colour mode of a path.
    fn cross(
        &mut self,
        walker: &Walker,
        known: &mut KnownInsides,
        insides: &mut [u32],
        mode: impl Fn(usize) -> ColorMode,
    ) {
        self.crossings.find(&self.rays, &self.times, &self.hits);
        for (at, crossing) in self.crossings.found().iter().enumerate() {
            let (ray, hit, whose) = (&mut self.rays[at], &self.hits[at], self.pending[at] as usize);
            let mode = mode(whose);
            let surface = || walker.interaction(ray, self.times[at], hit);
            let to =
                walker.crossed(known, insides[whose], crossing, self.materials[at], mode, surface);
            insides[whose] = to;
            *ray = Ray::new(crossing.origin, ray.direction).with_t_max(ray.t_max - hit.t);
        }
    }
}

impl<'a> VolumeBatch<'a> {
    /// Makes the data; `None` if the scene has no media.
    pub fn new(context: &Context<'a>, sampler: &Sampler, eye: Vec3) -> Option<Self> {
        let walker = Walker::new(context)?;
        let wide =
            context.scene.world.simd().wide().filter(|_| context.settings.color == ColorModel::Rgb);
        Some(Self {
            walker,
            known: KnownInsides::new(walker.everywhere()),
            around_camera: walker.surfaces_around(eye),
            insides: Vec::new(),
            next: Vec::new(),
            scattered: Vec::new(),
            light_insides: Vec::new(),
            light_numbers: Vec::new(),
            glowing: Vec::new(),
            steps: Vec::new(),
            on_the_way: OnTheWay {
                pending: Vec::new(),
                rays: Vec::new(),
                times: Vec::new(),
                hits: Vec::new(),
                materials: Vec::new(),
                crossings: InterfaceCrossings::new(context.scene),
            },
            sampler: *sampler,
            homogeneous: wide.map(|wide| Box::new(HomogeneousBatch::new(sampler, wide))),
        })
    }

    /// Starts a part with these camera paths. Those that a plane clips are moved to the plane, and
    /// may begin inside of objects there.
    pub fn start(&mut self, paths: &mut Paths) {
        self.known.clear();
        self.insides.clear();
        self.next.clear();
        if paths.rays.iter().any(|ray| ray.t_min > 0.0) {
            for path in 0..paths.len() {
                let around = if paths.rays[path].t_min > 0.0 {
                    self.walker.surfaces_around(begun_at_interval(paths, path))
                } else {
                    self.around_camera.clone()
                };
                let own = &mut self.known.own;
                let insides = self.walker.insides_of(own, &around, paths.rest(path).mode);
                self.insides.push(self.known.number(insides));
            }
            return;
        }
        if self.around_camera.is_empty() {
            self.insides.resize(paths.len(), 0);
            return;
        }
        for path in 0..paths.len() {
            let own = &mut self.known.own;
            let insides = self.walker.insides_of(own, &self.around_camera, paths.rest(path).mode);
            self.insides.push(self.known.number(insides));
        }
    }

    /// Makes the collected next paths the current ones.
    pub fn swap(&mut self) {
        std::mem::swap(&mut self.insides, &mut self.next);
        self.next.clear();
    }

    /// True if paths must be traced by [`Self::advance`], which detects interfaces.
    pub fn sees_more(&self) -> bool {
        self.walker.has_passable()
    }

    /// Moves every path to its next vertex, at this depth. The paths' hits must be those of their
    /// rays, unless [`Self::sees_more`] is true; then they are traced here. `random` returns the
    /// random numbers of the next vertex of a path; `emitted` receives the emission that a path
    /// finds on the way.
    pub fn advance(
        &mut self,
        tracer: &mut Tracer,
        paths: &mut Paths,
        grouping: Grouping,
        depth: u32,
        random: impl Fn(&Paths, usize) -> Random,
        mut emitted: impl FnMut(&Paths, usize, SampledSpectrum),
    ) {
        let (walker, count) = (self.walker, paths.len());
        let filter = walker.camera_filter();
        if walker.has_passable() {
            tracer.closest_by(
                filter.at(depth),
                &paths.rays,
                &paths.times,
                grouping,
                &mut paths.hits,
            );
        }
        self.scattered.clear();
        self.scattered.resize(count, None);
        self.steps.clear();
        self.steps.resize(count, 0);
        if let Some(homogeneous) = &mut self.homogeneous {
            homogeneous.start(&self.sampler, depth);
        }
        self.on_the_way.pending.clear();
        self.on_the_way
            .pending
            .extend((0..count as u32).filter(|&path| !paths.is_dead(path as usize)));
        for _ in 0..MOST_PASSED {
            self.travel(paths, &random, &mut emitted);
            let Self { known, insides, scattered, on_the_way: way, .. } = self;
            let mut pending = std::mem::take(&mut way.pending);
            way.clear();
            for &whose in &pending {
                let path = whose as usize;
                let hit = paths.hits[path];
                if scattered[path].is_none()
                    && let Some(material) =
                        walker.path_passes(known.get(insides[path]), &mut paths.carried[path], &hit)
                {
                    way.push(whose, paths.rays[path], paths.rest(path).time, hit, material);
                }
            }
            pending.clear();
            if way.pending.is_empty() {
                return;
            }
            way.cross(&walker, known, insides, |path| paths.rest(path).mode);
            tracer.closest_by(
                filter.at(depth),
                &way.rays,
                &way.times,
                Grouping::None,
                &mut way.hits,
            );
            for ((&path, ray), hit) in way.pending.iter().zip(&way.rays).zip(&way.hits) {
                (paths.rays[path as usize], paths.hits[path as usize]) = (*ray, *hit);
            }
        }
        for &path in &self.on_the_way.pending {
            paths.carried[path as usize].throughput = SampledSpectrum::ZERO;
        }
    }

    /// Moves the paths that have not arrived through the media in which they are.
    fn travel(
        &mut self,
        paths: &mut Paths,
        random: &impl Fn(&Paths, usize) -> Random,
        emitted: &mut impl FnMut(&Paths, usize, SampledSpectrum),
    ) {
        let Self { walker, known, insides, scattered, steps, on_the_way: way, homogeneous, .. } =
            self;
        for &whose in &way.pending {
            let path = whose as usize;
            let filling = known.filling(insides[path]);
            if filling == Filling::Empty {
                continue;
            }
            let random = random(paths, path);
            let (ray, hit, carried) = (&paths.rays[path], &paths.hits[path], &paths.carried[path]);
            if let Some(homogeneous) = homogeneous
                && let Some(medium) = walker.homogeneous_in_rgb(&known.own, filling)
                && !walker.seeks_equiangular_lights(carried)
            {
                homogeneous.push_path(
                    whose,
                    medium,
                    end_of(ray, hit),
                    carried.throughput,
                    &random,
                    steps[path],
                );
                steps[path] += 1;
                if homogeneous.is_full() {
                    arrive(homogeneous, paths, scattered);
                }
                continue;
            }
            let mut numbers = Numbers::of_path(random, steps[path]);
            let (mut carried, rest, mut radiance) =
                (*carried, *paths.rest(path), SampledSpectrum::ZERO);
            let state = (&mut carried, &rest);
            let here = known.get(insides[path]);
            let vertex =
                walker.travel(&known.own, here, ray, hit, state, &mut numbers, &mut radiance);
            steps[path] = numbers.step();
            paths.carried[path].throughput = carried.throughput;
            if !radiance.is_black() {
                emitted(paths, path, radiance);
            }
            if vertex.is_some() {
                scattered[path] = vertex;
                paths.hits[path] = Hit::MISS;
            }
        }
        if let Some(homogeneous) = homogeneous {
            arrive(homogeneous, paths, scattered);
        }
    }

    /// The media around the paths, as the input of batch shaders.
    pub fn surroundings(&self) -> Surroundings<'_> {
        let Self { walker, known, insides, scattered, .. } = self;
        Surroundings { walker, known, insides, scattered }
    }

    /// Records the objects that the light rays and next rays of a vertex start inside. `surface` is
    /// called only where a medium depends on it.
    pub fn note_outputs(
        &mut self,
        path: usize,
        arriving: Vec3,
        surface: Option<(&SurfacePoint, impl Fn() -> SurfaceInteraction)>,
        (hit, mode): (&Hit, ColorMode),
        random: Random,
        light_rays: &[(Ray, SampledSpectrum)],
        glowing: Option<MediumId>,
        next: impl Iterator<Item = Vec3>,
    ) {
        let here = self.insides[path];
        let mut beyond = None;
        let (walker, known) = (self.walker, &mut self.known);
        let mut of = |direction: Vec3| match &surface {
            Some((point, whole))
                if direction.dot(point.geometric_normal) * arriving.dot(point.geometric_normal)
                    > 0.0 =>
            {
                *beyond.get_or_insert_with(|| {
                    let insides = *known.get(here);
                    let beyond = walker.through(
                        &mut known.own,
                        &insides,
                        point,
                        hit,
                        direction,
                        mode,
                        whole,
                    );
                    known.number(beyond)
                })
            }
            _ => here,
        };
        let needs_numbers = !walker.is_in_closed_form();
        for (number, (ray, _)) in light_rays.iter().enumerate() {
            self.light_insides.push(of(ray.direction));
            if needs_numbers {
                self.light_numbers.push(Numbers::of_light_ray(random, number as u32));
            }
            self.glowing.push(glowing);
        }
        self.next.extend(next.map(of));
    }

    /// Records that the only light ray of a vertex starts on the side from which the path arrived.
    pub fn note_light_ray(
        &mut self,
        path: usize,
        random: impl FnOnce() -> Random,
        glowing: Option<MediumId>,
    ) {
        self.light_insides.push(self.insides[path]);
        if !self.walker.is_in_closed_form() {
            self.light_numbers.push(Numbers::of_light_ray(random(), 0));
        }
        self.glowing.push(glowing);
    }

    /// Records that a path continues on the side from which it arrived.
    pub fn note_next(&mut self, path: usize) {
        self.next.push(self.insides[path]);
    }

    /// Traces light rays to their lights. Their values are multiplied by the transmittance, and
    /// rays that do not arrive are marked as blocked. `mode` returns the colour mode of a sample.
    pub fn trace_light_rays(
        &mut self,
        tracer: &mut Tracer,
        light: &mut LightRays,
        mode: impl Fn(u32) -> ColorMode,
    ) {
        let Self {
            walker,
            known,
            light_insides: insides,
            light_numbers,
            glowing,
            on_the_way: way,
            homogeneous,
            ..
        } = self;
        let may_see_past = walker.has_priorities() || walker.follows_light_rays();
        if may_see_past {
            light.blocked.clear();
            light.blocked.resize(light.rays.len(), false);
        } else {
            tracer.occluded(&light.rays, &light.times, &mut light.blocked);
        }
        let is_in =
            |known: &KnownInsides, insides: u32, glowing| walker.is_in(known.get(insides), glowing);
        way.clear();
        for i in (0..light.rays.len()).filter(|&i| !light.blocked[i]) {
            way.pending.push(i as u32);
            way.rays.push(light.rays[i]);
            way.times.push(light.times[i]);
            way.materials.push(NONE);
        }
        for _ in 0..MOST_PASSED {
            if way.pending.is_empty() {
                break;
            }
            if walker.has_passable() {
                tracer.closest_by(
                    walker.filter(),
                    &way.rays,
                    &way.times,
                    Grouping::None,
                    &mut way.hits,
                );
            } else {
                // The ray is already known to be unoccluded.
                way.hits.clear();
                way.hits.resize(way.rays.len(), Hit::MISS);
            }
            for at in 0..way.pending.len() {
                let (i, ray, hit) = (way.pending[at] as usize, &way.rays[at], &way.hits[at]);
                let (here, filling) = (known.get(insides[i]), known.filling(insides[i]));
                let passed = walker.light_passes(here, hit);
                way.materials[at] = passed.flatten().unwrap_or(NONE);
                if passed.is_none() {
                    light.blocked[i] = true;
                } else if filling == Filling::Empty {
                    // Vacuum absorbs nothing.
                } else if let Some(homogeneous) = homogeneous
                    && let Some(medium) = walker.homogeneous_in_rgb(&known.own, filling)
                {
                    homogeneous.push(i as u32, medium, length_to(ray, hit), light.values[i]);
                    if homogeneous.is_full() {
                        lose(homogeneous, light);
                    }
                } else {
                    let (value, mode) = (light.values[i], mode(light.samples[i]));
                    let numbers = || light_numbers[i].next();
                    light.values[i] =
                        walker.attenuate(&known.own, here, ray, hit, value, mode, numbers);
                }
            }
            if let Some(homogeneous) = homogeneous {
                lose(homogeneous, light);
            }
            let mut kept = 0;
            for at in 0..way.pending.len() {
                let (i, material) = (way.pending[at] as usize, way.materials[at]);
                if light.blocked[i] | light.values[i].is_black() {
                    light.blocked[i] = true;
                } else if material != NONE {
                    way.keep(at, kept, material);
                    kept += 1;
                } else {
                    light.blocked[i] = !is_in(known, insides[i], glowing[i]);
                }
            }
            way.truncate(kept);
            way.cross(walker, known, insides, |i| mode(light.samples[i]));
            // Some light rays end at the surface that they pass.
            let mut kept = 0;
            for at in 0..way.pending.len() {
                let i = way.pending[at] as usize;
                if way.rays[at].t_max > 0.0 {
                    way.keep(at, kept, way.materials[at]);
                    kept += 1;
                } else {
                    light.blocked[i] = !is_in(known, insides[i], glowing[i]);
                }
            }
            way.truncate(kept);
        }
        for &i in &way.pending {
            light.blocked[i as usize] = true;
        }
        self.light_insides.clear();
        self.light_numbers.clear();
        self.glowing.clear();
    }
}

/// Stores the results of all path lanes, and empties the lanes.
fn arrive(
    homogeneous: &mut HomogeneousBatch,
    paths: &mut Paths,
    scattered: &mut [Option<MediumVertex>],
) {
    if homogeneous.whose().is_empty() {
        return;
    }
    homogeneous.travel();
    for (lane, &path) in homogeneous.whose().iter().enumerate() {
        let path = path as usize;
        let carried = &mut paths.carried[path];
        carried.throughput = homogeneous.color(lane);
        if let Some(scattering) = homogeneous.scattered(lane) {
            scattered[path] = Some(Walker::vertex(&paths.rays[path], carried, &scattering));
            paths.hits[path] = Hit::MISS;
        }
    }
    homogeneous.clear();
}

/// Multiplies the light rays in all lanes by their transmittance, and empties the lanes.
fn lose(homogeneous: &mut HomogeneousBatch, light: &mut LightRays) {
    if homogeneous.whose().is_empty() {
        return;
    }
    homogeneous.attenuate();
    for (lane, &ray) in homogeneous.whose().iter().enumerate() {
        light.values[ray as usize] = homogeneous.color(lane);
    }
    homogeneous.clear();
}
