//! Photons: from lamps through casters to the first surface of another kind. What they leave in
//! media on the way is in [`super::media`].
//!
//! Each photon is aimed at one target ([`crate::compile::casters`]) and counts only if the first
//! surface that it meets is one of that target, so that each light path is found in one way,
//! however targets overlap.
//!
//! Photons carry power, so what surfaces do to them is the adjoint of what they do to radiance:
//! refraction does not compress them, and shading normals take part as Veach gives it (Robust Monte
//! Carlo Methods for Light Transport Simulation, 1997, section 5.3).

use super::Caustics;
use super::lamps::Aim;
use super::map::Landed;
use super::media::Ends;
use crate::compile::CompiledLight;
use crate::compile::casters::Target;
use crate::integrator::carried::{Carried, Expected};
use crate::integrator::light_part::{LightSource, LobeShares};
use crate::integrator::{Context, PathState};
use crate::job::tracer::Tracer;
use crate::light_sampler::Receiver;
use crate::sampler::{Random, Sampler};
use crate::volume::{Insides, Numbers, OwnMedia, PathStep, Walker};
use snell_intersect::{Grouping, Hit, RayQuery, SurfaceInteraction};
use snell_math::{ColorMode, Frame, Ray, SampledSpectrum, Vec2, Vec3, real, sampling};
use snell_scene::material::{MaterialKind, Prepared, ShadingPoint};
use snell_scene::{Light, Material};
use std::f32::consts::PI;

/// The largest number of casters on the way of a photon. Light that is trapped in clear glass for
/// longer is lost.
const MOST_BOUNCES: u32 = 254;

/// The largest number of media on one way of a photon whose random numbers are all different.
const MOST_PASSED: u32 = 64;

/// The dimensions of the photons' random numbers, by use. From the last on, each medium on the way
/// has one.
mod dimension {
    pub const AIM: u32 = 0;
    pub const POSITION: u32 = 1;
    pub const DIRECTION: u32 = 2;
    pub const WAVELENGTH: u32 = 3;
    pub const TIME: u32 = 4;
    pub const LOBE: u32 = 5;
    pub const BSDF: u32 = 6;
    pub const ROULETTE: u32 = 7;
    pub const KEPT: u32 = 8;
    pub const PLACE: u32 = 9;
}

/// A photon in flight.
#[derive(Clone, Copy)]
pub(super) struct Photon {
    pub ray: Ray,
    pub state: PathState,
    /// The largest lane of its power at the start.
    first_flux: f32,
    pub hue: f32,
    pub bounces: u32,
    /// The target that its first surface must belong to.
    target: u32,
    pub source: LightSource,
    /// For a lamp without a surface: the number of the light, the random numbers that choose a
    /// point of it, and that point. The power follows from the irradiance where the photon meets
    /// the first surface.
    bare: Option<(usize, Vec2, Vec3)>,
    pub random: Random,
}

/// What some photons have left.
#[derive(Debug, Default)]
pub struct Shot {
    /// Where they ended on surfaces.
    pub landed: Vec<Landed>,
    /// Points of their ways through media that scatter light.
    pub in_media: Vec<Landed>,
    /// The number of photons that media have scattered after a caster, and their power in W.
    pub scattered: (u32, f64),
}

/// Shoots photons on one thread.
pub struct Shooter<'a> {
    pub(super) caustics: &'a Caustics<'a>,
    walker: Option<Walker<'a>>,
    pub(super) own: OwnMedia,
    /// The radius within which points in media are gathered.
    pub(super) reach: f32,
}

impl<'a> Shooter<'a> {
    /// `reach` is the radius within which points in media are gathered.
    pub fn new(caustics: &'a Caustics<'a>, reach: f32) -> Self {
        let Caustics { scene, settings, light_sampler, .. } = caustics;
        let context =
            Context { scene, settings, lights: light_sampler, field: None, wants_lobes: false };
        Self { caustics, walker: Walker::new(&context), own: OwnMedia::new(), reach }
    }

    /// Shoots photons `range` of a set of `count`, and adds what they leave to `shot`.
    pub fn shoot(
        &mut self,
        sampler: &Sampler,
        range: std::ops::Range<u32>,
        count: u32,
        tracer: &mut Tracer,
        shot: &mut Shot,
    ) {
        let photons = range.filter_map(|i| {
            let mut photon = self.emitted(sampler.random([0, 0], i))?;
            photon.state.throughput *= 1.0 / count as f32;
            photon.first_flux *= 1.0 / count as f32;
            Some(photon)
        });
        let mut photons: Vec<Photon> = photons.collect();
        if self.walker.is_some() {
            for photon in photons {
                if tracer.is_cancelled() {
                    return;
                }
                self.shoot_through_media(photon, shot);
            }
            return;
        }
        let (mut hits, mut rays, mut times) = (Vec::new(), Vec::new(), Vec::new());
        while !photons.is_empty() && !tracer.is_cancelled() {
            rays.clear();
            rays.extend(photons.iter().map(|photon| photon.ray));
            times.clear();
            times.extend(photons.iter().map(|photon| photon.state.time));
            tracer.closest(&rays, &times, Grouping::None, &mut hits);
            let of = |(photon, hit): (&Photon, &Hit)| {
                let (next, _) = self.arrived(photon, hit, 1.0, &mut shot.landed)?;
                Some(next)
            };
            photons = photons.iter().zip(&hits).filter_map(of).collect();
        }
    }

    /// Follows one photon to its end in a scene with media. It ends where a medium scatters it.
    fn shoot_through_media(&mut self, mut photon: Photon, shot: &mut Shot) {
        let Some(walker) = self.walker else { return };
        self.own.clear();
        let is_inside = photon.ray.origin.distance(self.caustics.scene.center)
            < 1.5 * self.caustics.scene.radius;
        let mut insides = match is_inside {
            true => {
                let around = walker.surfaces_around(photon.ray.origin);
                walker.insides_of(&mut self.own, &around, photon.state.mode)
            }
            false => Insides::default(),
        };
        let (first, mut begin) = (shot.in_media.len(), None);
        loop {
            let way = (&mut photon, &mut insides);
            let Some(hit) = self.travelled(&walker, way, begin, shot) else { break };
            let outside_ior = walker.outside_ior(&insides, &hit);
            let arriving = photon.ray.direction;
            let next = self.arrived(&photon, &hit, outside_ior, &mut shot.landed);
            let Some((next, surface)) = next else { break };
            let (normal, direction) = (surface.geometric_normal, next.ray.direction);
            if direction.dot(normal) * arriving.dot(normal) > 0.0 {
                insides = walker.beyond(
                    &mut self.own,
                    &insides,
                    &surface,
                    &hit,
                    direction,
                    photon.state.mode,
                );
            }
            begin = Some(direction.dot(normal).abs());
            photon = next;
        }
        let chosen = photon.random.at_vertex(1, 0).number(dimension::KEPT);
        super::media::choose(&mut shot.in_media, first, chosen);
    }

    /// Moves a photon through media and their boundaries to its next surface. `None` if it leaves
    /// the scene or a medium scatters or absorbs it. `begin` is the cosine of its direction with
    /// the surface that it comes from.
    fn travelled(
        &mut self,
        walker: &Walker,
        (photon, insides): (&mut Photon, &mut Insides),
        begin: Option<f32>,
        shot: &mut Shot,
    ) -> Option<Hit> {
        let (mut carried, rest) = Carried::of(&photon.state);
        let vertex = photon.random.at_vertex(1, photon.bounces);
        let mut numbers = Numbers::of_path(vertex, 0);
        let (mut begin, mut passed) = (begin, 0);
        loop {
            let query = RayQuery { time: rest.time, ..RayQuery::from(&photon.ray) };
            let scene = self.caustics.scene;
            let hit = scene.world.closest_one(query, walker.filter());
            if photon.bounces > 0
                && let Some(medium) =
                    walker.scattering_medium(&self.own, insides, photon.state.mode)
            {
                let end = hit.is_hit().then(|| {
                    let normal = scene.world.point(query, &hit).geometric_normal;
                    normal.dot(photon.ray.direction).abs()
                });
                let u = vertex.number(dimension::PLACE + passed);
                let mut numbers = Numbers::of_light_ray(vertex, passed);
                let ends = Ends { begin, end };
                let way = (&*photon, &*insides, &hit, ends);
                self.leave_points(walker, medium, way, u, &mut numbers, &mut shot.in_media);
                begin = end;
                passed = (passed + 1) % MOST_PASSED;
            }
            // What media emit is no light of the lamp.
            let mut glow = SampledSpectrum::ZERO;
            let step = walker.step(
                &mut self.own,
                &mut photon.ray,
                (&mut carried, &rest),
                insides,
                &hit,
                &mut numbers,
                &mut glow,
            );
            photon.state.throughput = carried.throughput;
            match step {
                PathStep::Arrived if hit.is_hit() && !carried.throughput.is_black() => {
                    return Some(hit);
                }
                PathStep::Passed if !carried.throughput.is_black() => {}
                PathStep::Scattered(_) if photon.bounces > 0 => {
                    shot.scattered.0 += 1;
                    shot.scattered.1 += f64::from(carried.throughput.average());
                    return None;
                }
                _ => return None,
            }
        }
    }

    /// Emits a photon.
    fn emitted(&self, random: Random) -> Option<Photon> {
        let Caustics { scene, settings, .. } = self.caustics;
        let lamps = self.caustics.lamps();
        let vertex = random.at_vertex(0, 0);
        let Aim { light, target: number, probability } =
            lamps.choose(vertex.number(dimension::AIM))?;
        let target = scene.casters().targets[number as usize];
        let hue = vertex.number(dimension::WAVELENGTH);
        let mode = settings.color.mode(|| hue);
        let time = if scene.moves { vertex.number(dimension::TIME) } else { 0.0 };
        let (u, v) = (vertex.pair(dimension::POSITION), vertex.pair(dimension::DIRECTION));
        let mut bare = None;
        let (ray, flux, source) = match &scene.lights()[light] {
            compiled @ (CompiledLight::Area(_) | CompiledLight::Moving(_)) => {
                let sample = match compiled {
                    CompiledLight::Area(area) => area.sample(u)?,
                    CompiledLight::Moving(moving) => moving.sample(time, u)?,
                    _ => return None,
                };
                let surface = &sample.surface;
                let id = scene.material_id(&hit_of(surface));
                let material = scene.material(id);
                if !lamps.has_material(id) {
                    return None;
                }
                let normal = surface.geometric_normal;
                let both = material.emits_on_both_sides;
                let (direction, pdf) =
                    target.direction_from(surface.position, (!both).then_some(normal), v);
                let cos = direction.dot(normal);
                let cos = if both { cos.abs() } else { cos };
                if cos <= 0.0 || pdf <= 0.0 {
                    return None;
                }
                let point = scene.shading_point(surface, 0.0, mode);
                let share = material.emitting_share(-direction, &point);
                let radiance = material.emitted(&point, direction) * share;
                let ray = Ray::new(surface.ray_origin(direction), direction);
                (ray, radiance * (cos / (sample.pdf_area * pdf)), LightSource::Material(id))
            }
            CompiledLight::Light(lamp) => {
                let source = LightSource::Light(light as u32);
                match lamp.light.position() {
                    Some(middle) => {
                        let origin = point_of_lamp(&lamp.light, middle.as_vec3(), scene.radius, u)?;
                        let (direction, pdf) = direction_from_lamp(&lamp.light, &target, origin, v);
                        bare = Some((light, u, origin));
                        // The body of a lamp does not stop its light.
                        let body = lamp.punctual.as_ref().map_or(0.0, |light| light.body_radius);
                        let begin = origin + direction * (body * 1.001) as f32;
                        (Ray::new(begin, direction), mode.unit() * (1.0 / pdf), source)
                    }
                    None => {
                        let seen = lamp.sample(target.center, u, mode)?;
                        let (ray, area) = self.ray_from_afar(&target, seen.direction, v);
                        (ray, seen.radiance * (area / seen.pdf), source)
                    }
                }
            }
            CompiledLight::Environment => {
                let sample = scene.environment.as_ref()?.sample_compensated(u)?;
                let radiance = scene.environment.as_ref()?.radiance_at(sample.place, mode);
                let share = 1.0 - lamps.left_of_sky(scene, sample.direction);
                let (ray, area) = self.ray_from_afar(&target, sample.direction, v);
                (ray, radiance * (share * area / sample.pdf), LightSource::Environment)
            }
            CompiledLight::Medium(..) => return None,
        };
        let flux = flux * (1.0 / probability);
        let first_flux = flux.max_element();
        let state = PathState {
            throughput: flux,
            mode,
            bsdf_pdf: 0.0,
            receiver: Receiver::default(),
            eta_scale: 1.0,
            is_specular: false,
            expected: Expected::default(),
            cone_width: 0.0,
            cone_spread: 0.0,
            stream: 0,
            lobe: LobeShares::UNKNOWN,
            time,
        };
        let photon = Photon {
            ray,
            state,
            first_flux,
            hue,
            bounces: 0,
            target: number,
            source,
            bare,
            random,
        };
        (flux.is_finite() && first_flux > 0.0).then_some(photon)
    }

    /// A ray that arrives from `direction` through the disk into which a target projects, and the
    /// area of the disk.
    fn ray_from_afar(&self, target: &Target, direction: Vec3, u: Vec2) -> (Ray, f32) {
        let scene = self.caustics.scene;
        let disk = sampling::concentric_disk(u) * target.radius;
        let away = target.center.distance(scene.center) + target.radius + 2.0 * scene.radius;
        let origin = target.center + Frame::from_z(direction).from_local(disk.extend(away));
        (Ray::new(origin, -direction), PI * target.radius * target.radius)
    }

    /// Scatters a photon at a caster, or lets it land elsewhere. Returns the photon that goes on,
    /// and the surface.
    fn arrived(
        &self,
        photon: &Photon,
        hit: &Hit,
        outside_ior: f32,
        landed: &mut Vec<Landed>,
    ) -> Option<(Photon, SurfaceInteraction)> {
        let scene = self.caustics.scene;
        if !hit.is_hit() {
            return None;
        }
        let id = scene.material_id(hit);
        let is_caster = scene.casters().is_caster(id);
        let is_first = photon.bounces == 0;
        if is_first && (!is_caster || scene.casters().owner(hit) != Some(photon.target)) {
            return None;
        }
        let material = scene.material(id);
        let PathState { mode, time, throughput, .. } = photon.state;
        let surface = scene.interaction(&photon.ray, time, hit);
        let from = -photon.ray.direction;
        if !is_caster {
            if !matches!(material.kind, MaterialKind::Black(_)) {
                landed.push(Landed {
                    position: surface.position,
                    direction: from,
                    bounces: photon.bounces,
                    flux: throughput,
                    hue: photon.hue,
                    time,
                    source: photon.source,
                    medium: 0,
                });
            }
            return None;
        }
        let (mut flux, mut first_flux) = (throughput, photon.first_flux);
        if let Some((light, u, place)) = photon.bare {
            let CompiledLight::Light(lamp) = &scene.lights()[light] else { return None };
            let seen = lamp.sample(surface.position, u, mode)?;
            flux *= seen.radiance * (surface.position.distance_squared(place) / seen.pdf);
            first_flux = flux.max_element();
        }
        if photon.bounces >= MOST_BOUNCES.min(self.caustics.settings.max_depth) {
            return None;
        }
        let point = ShadingPoint { outside_ior, ..scene.shading_point(&surface, 0.0, mode) };
        let vertex = photon.random.at_vertex(0, photon.bounces + 1);
        let (u_lobe, u) = (vertex.number(dimension::LOBE), vertex.pair(dimension::BSDF));
        let (wi, factor) = scattered(material, scene.prepared(id), &point, from, u_lobe, u)?;
        flux *= factor;
        // Survivors have their initial power again, so that all photons weigh about the same.
        let survival = (flux.max_element() / first_flux).min(1.0);
        if !flux.is_finite() || vertex.number(dimension::ROULETTE) >= survival {
            return None;
        }
        let mode = if material.is_dispersive() { mode.hero_only() } else { mode };
        let state = PathState { throughput: flux * (1.0 / survival), mode, ..photon.state };
        let ray = Ray::new(surface.ray_origin(wi), wi);
        let bounces = photon.bounces + 1;
        Some((Photon { ray, state, first_flux, bounces, bare: None, ..*photon }, surface))
    }
}

/// A direction in which a surface scatters a photon that came from `from`, and the factor on its
/// power.
fn scattered(
    material: &Material,
    prepared: &Prepared,
    point: &ShadingPoint,
    from: Vec3,
    u_lobe: f32,
    u: Vec2,
) -> Option<(Vec3, SampledSpectrum)> {
    let shading = material.prepared_towards(prepared, point, from);
    let sample = shading.sample(from, u_lobe, u)?;
    let crossing = if sample.is_transmission { shading.crossing_scale(from) } else { 1.0 };
    let (smooth, flat) = (shading.frame.z, shading.geometric_normal);
    let adjoint = (from.dot(smooth) * sample.wi.dot(flat)).abs()
        / (from.dot(flat) * sample.wi.dot(smooth)).abs();
    // (Where a normal is at a right angle to a direction, nothing arrives.)
    let adjoint = if smooth == flat { 1.0 } else { adjoint };
    (adjoint.is_finite() && adjoint > 0.0)
        .then(|| (sample.wi, sample.weight * (crossing * adjoint)))
}

impl Target {
    /// A direction from a point towards the sphere, and its density per steradian: uniform in the
    /// cone that the sphere fills. From inside, all directions are possible; with a normal, those
    /// on its side, by their cosine.
    fn direction_from(&self, point: Vec3, normal: Option<Vec3>, u: Vec2) -> (Vec3, f32) {
        match (self.cap_seen_from(point), normal) {
            (Some(cap), _) => (in_cap(self.center - point, cap, u), 1.0 / (2.0 * PI * cap)),
            (None, Some(normal)) => {
                let local = sampling::cosine_hemisphere(u);
                (Frame::from_z(normal).from_local(local).normalize_or(normal), local.z / PI)
            }
            (None, None) => (sampling::uniform_sphere(u), sampling::UNIFORM_SPHERE_PDF),
        }
    }
}

/// A direction within a cone around an axis. `cap` is 1 less the cosine of its half-angle.
fn in_cap(axis: Vec3, cap: f32, u: Vec2) -> Vec3 {
    let axis = axis.normalize_or(Vec3::Z);
    let below = u.x * cap;
    let sin = (below * (2.0 - below)).max(0.0).sqrt();
    let (sin_around, cos_around) = real::sin_cos(2.0 * PI * u.y);
    let local = Vec3::new(sin * cos_around, sin * sin_around, 1.0 - below);
    Frame::from_z(axis).from_local(local).normalize_or(axis)
}

/// A direction in which a lamp without a surface sends a photon to a target, and its density per
/// steradian. A narrow beam is followed where it is narrower than the target.
fn direction_from_lamp(light: &Light, target: &Target, origin: Vec3, u: Vec2) -> (Vec3, f32) {
    if let Some((axis, angle)) = light.cone() {
        // A little wider, against rounding.
        let cap = (1.0 - real::cos(angle * 1.001 + 1e-6)) as f32;
        if target.cap_seen_from(origin).is_none_or(|of_target| cap < of_target) && cap < 2.0 {
            return (in_cap(axis.as_vec3(), cap, u), 1.0 / (2.0 * PI * cap));
        }
    }
    target.direction_from(origin, None, u)
}

/// The point of a lamp without a surface that the random numbers choose.
fn point_of_lamp(light: &Light, middle: Vec3, radius: f32, u: Vec2) -> Option<Vec3> {
    if !matches!(light, Light::Disk(_) | Light::Rectangle(_)) {
        return Some(middle);
    }
    let (axis, _) = light.cone()?;
    let from = middle + axis.as_vec3() * radius;
    let seen = light.sample(from, u, ColorMode::Rgb)?;
    Some(from + seen.direction * seen.distance)
}

/// The hit from which the interaction was made.
fn hit_of(surface: &SurfaceInteraction) -> Hit {
    Hit {
        t: surface.t,
        uv: surface.primitive_uv,
        instance: surface.instance,
        geometry: surface.geometry,
        primitive: surface.primitive,
    }
}
