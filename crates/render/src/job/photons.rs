//! Photons train the guiding field before the first path. Paths rarely find a small lamp behind
//! glass or a door, whereas photons start there (Jensen, Importance driven path tracing using the
//! photon map, 1995; Vorba et al., On-line learning of parametric mixture models for light
//! transport simulation, 2014).
//!
//! Photons only guide paths, so their transport is simplified: media do not affect them, and
//! surfaces scatter them like paths from the camera.

use super::projection_maps::{Departure, ProjectionMaps};
use super::tracer::Tracer;
use super::{Job, into_inner, lock};
use crate::compile::{CompiledLight, CompiledScene};
use crate::guiding::directional::Moment;
use crate::guiding::{Field, Guiding, Record};
use crate::integrator::roulette;
use crate::light_sampler::{LightSampler, LightSamplerKind, Receiver};
use crate::sampler::{Random, Sampler, SamplerKind};
use crate::threads::on_threads;
use snell_intersect::{Grouping, Hit};
use snell_math::{ColorMode, Frame, Ray, SampledSpectrum, Vec2, Vec3, rng, sampling};
use snell_scene::light::environment::SkySample;
use std::f32::consts::PI;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How many times the field reads all photons.
const ROUNDS: u32 = 7;
/// The round before which the parallax of directions is determined. By then regions have about
/// their final size.
const PARALLAX_ROUND: u32 = 4;
/// The number of photons in a batch.
const BATCH: usize = 4096;
/// The largest number of bounces of a photon.
const MAX_DEPTH: u32 = 24;
/// One photon in this many is used to make the projection maps.
const SCOUTS: usize = 8;

/// The colour mode of photons. The directions of light hardly depend on the mode.
const COLOR: ColorMode = ColorMode::Rgb;

/// The dimensions of the photons' random numbers, by use.
mod dimension {
    pub const LIGHT: u32 = 0;
    pub const POSITION: u32 = 1;
    pub const DIRECTION: u32 = 2;
    pub const LOBE: u32 = 3;
    pub const BSDF: u32 = 4;
    pub const ROULETTE: u32 = 5;
    pub const AIM: u32 = 6;
}

/// A photon in flight.
#[derive(Clone, Copy)]
struct Photon {
    ray: Ray,
    flux: SampledSpectrum,
    /// The largest lane of the initial flux. Roulette compares the remaining flux with it.
    first_flux: f32,
    /// True if the last bounce was on smooth glass or a mirror.
    is_caustic: bool,
    departure: Departure,
    random: Random,
}

impl Job<'_> {
    /// Shoots photons from all lights, and trains the field with their hits.
    pub(super) fn learn_from_photons(
        &self,
        field: &mut Field,
        photons: u32,
        seed: u32,
        threads: usize,
    ) {
        let lights =
            self.scene.light_sampler(LightSamplerKind::Power, self.settings.light_strategy);
        let sampler = Sampler::new(SamplerKind::Independent, seed, 1);
        let roulette_depth = self.settings.roulette_depth.unwrap_or(0);
        let batches = photons as usize / BATCH;
        let shoot = |batches: Range<usize>, maps: &ProjectionMaps| {
            let shots: Vec<Mutex<Shots>> = batches.clone().map(|_| Mutex::default()).collect();
            let next = AtomicUsize::new(0);
            let work = || {
                let mut tracer = Tracer::new(self.scene, None, self.cancel);
                while !tracer.is_cancelled() {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(shots) = shots.get(index) else { break };
                    lock(shots).shoot(
                        (self.scene, &lights, maps),
                        (&sampler, roulette_depth),
                        batches.start + index,
                        &mut tracer,
                    );
                }
            };
            on_threads(threads, work);
            shots.into_iter().map(into_inner).collect::<Vec<Shots>>()
        };
        let scouts = batches / SCOUTS;
        let mut shots = shoot(0..scouts, &ProjectionMaps::default());
        let maps =
            ProjectionMaps::new(shots.iter().flat_map(|shots| shots.focused.iter().copied()));
        shots.extend(shoot(scouts..batches, &maps));
        let records: Vec<Record> = shots.into_iter().flat_map(|shots| shots.records).collect();
        // Regions and quads are divided according to their contents, and the new ones are filled by
        // reading all records again.
        let is_cancelled = || self.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed));
        for round in (0..ROUNDS).take_while(|_| !is_cancelled()) {
            if round == PARALLAX_ROUND {
                field.find_parallax(&records, rng::hash_combine(seed, ROUNDS), threads);
            }
            field.add(&records, rng::hash_combine(seed, round), threads);
            field.learn(Moment::First, Guiding::most_records(0), threads);
        }
    }
}

/// The hits of a batch of photons.
#[derive(Default)]
struct Shots {
    records: Vec<Record>,
    /// The cells of the projection maps from which focused photons were emitted.
    focused: Vec<Departure>,
}

impl Shots {
    /// Shoots one batch of photons.
    fn shoot(
        &mut self,
        (scene, lights, maps): (&CompiledScene, &LightSampler, &ProjectionMaps),
        (sampler, roulette_depth): (&Sampler, u32),
        batch: usize,
        tracer: &mut Tracer,
    ) {
        let random = |i: usize| sampler.random([batch as u32, i as u32], 0);
        let mut photons: Vec<Photon> =
            (0..BATCH).filter_map(|i| emitted(scene, lights, maps, random(i))).collect();
        let mut hits = Vec::new();
        for depth in 0..MAX_DEPTH {
            let rays: Vec<Ray> = photons.iter().map(|p| p.ray).collect();
            tracer.closest(&rays, &vec![0.0; rays.len()], Grouping::None, &mut hits);
            let most_survival = roulette::most_survival(roulette_depth, depth);
            let bounce = |(photon, hit)| bounced(scene, photon, hit, (depth, most_survival), self);
            photons = photons.iter().zip(&hits).filter_map(bounce).collect();
        }
    }
}

/// Emits a photon from a light.
fn emitted(
    scene: &CompiledScene,
    lights: &LightSampler,
    maps: &ProjectionMaps,
    random: Random,
) -> Option<Photon> {
    let vertex = random.at_vertex(0, 0);
    let chosen = lights.sample(&Receiver::default(), || vertex.number(dimension::LIGHT))?;
    let u = vertex.pair(dimension::POSITION);
    let (v, scale, departure) =
        maps.aim(chosen.light, vertex.number(dimension::AIM), vertex.pair(dimension::DIRECTION));
    let light = &scene.lights()[chosen.light];
    let (ray, flux) = match light {
        // Photons see the scene as it is when the shutter opens.
        CompiledLight::Area(_) | CompiledLight::Moving(_) => {
            let sample = match light {
                CompiledLight::Moving(moving) => moving.first.sample(u)?,
                CompiledLight::Area(area) => area.sample(u)?,
                _ => return None,
            };
            let point = scene.shading_point(&sample.surface, 0.0, COLOR);
            let material = scene.material(scene.material_id(&hit_of(&sample.surface)));
            let normal = sample.surface.geometric_normal;
            let (normal, sides, v) = match material.emits_on_both_sides {
                true if v.x < 0.5 => (-normal, 2.0, Vec2::new(v.x * 2.0, v.y)),
                true => (normal, 2.0, Vec2::new(v.x * 2.0 - 1.0, v.y)),
                false => (normal, 1.0, v),
            };
            let direction =
                Frame::from_z(normal).from_local(sampling::cosine_hemisphere(v)).try_normalize()?;
            let radiance = material.emitted(&point, direction);
            (
                Ray::new(sample.surface.ray_origin(direction), direction),
                radiance * (sides * PI / sample.pdf_area),
            )
        }
        CompiledLight::Light(light) => {
            let seen = light.sample(scene.center, u, COLOR)?;
            if seen.distance.is_finite() {
                let position = scene.center + seen.direction * seen.distance;
                let direction = sampling::uniform_sphere(v);
                // The intensity follows from the irradiance at a nearby point.
                let distance = scene.radius * 0.1;
                let near = light.sample(position + direction * distance, u, COLOR)?;
                let flux = near.radiance * (distance * distance * 4.0 * PI / near.pdf);
                (Ray::new(position, direction), flux)
            } else {
                let area = PI * scene.radius * scene.radius;
                (from_afar(scene, seen.direction, v), seen.radiance * (area / seen.pdf))
            }
        }
        CompiledLight::Medium(_, glow) => {
            let (position, pdf) = glow.sample(u);
            (
                Ray::new(position, sampling::uniform_sphere(v)),
                glow.emission(position, COLOR) * (4.0 * PI / pdf),
            )
        }
        CompiledLight::Environment => {
            let environment = scene.environment.as_ref()?;
            let SkySample { direction, pdf, place } = environment.sample(u);
            let (ray, area) = (from_afar(scene, direction, v), PI * scene.radius * scene.radius);
            // The portals are seen from the far end of the ray.
            let end = ray.at(4.0 * scene.radius);
            let radiance = environment.radiance_at(place, COLOR);
            let is_seen = environment.is_seen(end, direction);
            (ray, radiance * if is_seen { area / pdf } else { 0.0 })
        }
    };
    let flux = flux * (scale / chosen.probability);
    let first_flux = flux.max_element();
    let photon = Photon { ray, flux, first_flux, is_caustic: false, departure, random };
    (flux.is_finite() && first_flux > 0.0).then_some(photon)
}

/// A ray that arrives from `direction`, through the disk into which the scene's bounding sphere
/// projects.
fn from_afar(scene: &CompiledScene, direction: Vec3, u: Vec2) -> Ray {
    let disk = sampling::concentric_disk(u) * scene.radius;
    let frame = Frame::from_z(direction);
    let origin = scene.center + frame.from_local(disk.extend(2.0 * scene.radius));
    Ray::new(origin, -direction)
}

/// The hit from which the interaction was made.
fn hit_of(surface: &snell_intersect::SurfaceInteraction) -> Hit {
    Hit {
        t: surface.t,
        uv: surface.primitive_uv,
        instance: surface.instance,
        geometry: surface.geometry,
        primitive: surface.primitive,
    }
}

/// Records the hit of a photon, and scatters the photon. `None` if the photon ends.
fn bounced(
    scene: &CompiledScene,
    photon: &Photon,
    hit: &Hit,
    (depth, most_survival): (u32, Option<f32>),
    shots: &mut Shots,
) -> Option<Photon> {
    if !hit.is_hit() {
        return None;
    }
    let surface = scene.world.interaction(&photon.ray, hit);
    let point = scene.shading_point(&surface, 0.0, COLOR);
    let from = -photon.ray.direction;
    let shading = scene.material(scene.material_id(hit)).bsdf_towards(&point, from);
    // Direct light is left to light samples, so it is not recorded.
    if depth > 0 && !shading.is_delta() {
        let normal = shading.frame.z;
        let normal = if normal.dot(from) < 0.0 { -normal } else { normal };
        let (position, light) = (surface.position, photon.flux.average());
        shots.records.push(Record {
            position,
            normal,
            direction: from,
            light,
            found: 0.0,
            bsdf_share: 0.0,
        });
        if photon.is_caustic {
            shots.focused.push(photon.departure);
        }
    }
    let vertex = photon.random.at_vertex(0, depth + 1);
    let sample =
        shading.sample(from, vertex.number(dimension::LOBE), vertex.pair(dimension::BSDF))?;
    let flux = photon.flux * sample.weight;
    // Those that survive have their initial flux again, so that all hits have the same weight.
    let remaining = flux.max_element() / photon.first_flux;
    let survival = most_survival.map_or(1.0, |most| remaining.min(most));
    if !flux.is_finite() || vertex.number(dimension::ROULETTE) >= survival {
        return None;
    }
    let ray = Ray::new(surface.ray_origin(sample.wi), sample.wi);
    Some(Photon { ray, flux: flux * (1.0 / survival), is_caustic: sample.is_delta, ..*photon })
}
