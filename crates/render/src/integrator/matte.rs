//! What most integrators do at Lambertian surfaces, at many vertices at once: the same as [`super::path`] and [`super::classic`], bit
//! for bit, in loops that become vector code. Such surfaces are most of many scenes, and cost little else.
//!
//! Which vertices come here depends on the scene and the settings alone, and no lane looks at another, so that a path does not depend
//! on what shares its batch.

use super::carried::Carried;
use super::estimators::{Arrival, Skin};
use super::light_part::{LightSource, LobeShares};
use super::lights::{ALONE, DARK, FlatArrivals, FlatLights, Surfaces};
use super::matte_surfaces::{MatteSurfaces, PlainSurface};
use super::path::{MAX_SURVIVAL, ROULETTE_DEPTH, SCATTERED_SPREAD, WeightedLight, weighted_sample};
use super::{Context, IntegratorKind, Outputs, PathState, classic, dimension};
use crate::light_sampler::Receivers;
use crate::sampler::{ManyRandoms, Random, Sampler};
use crate::settings::LightStrategy;
use snell_intersect::triangles::{HitLanes, HitVectors, TRIANGLE_HITS};
use snell_intersect::{Hit, TriangleHits, TrianglePoints};
use snell_math::simd::{Wide, least, most};
use snell_math::{ColorMode, Frame, Ray, SampledSpectrum, Vec2, Vec3, at_level, robust, sampling};
use snell_scene::MediumId;
use snell_scene::material::visible_normal;
use std::f32::consts::{FRAC_1_PI, PI};

/// Most vertices at once.
pub const LANES: usize = TRIANGLE_HITS;

const ZERO: HitVectors = [[0.0; LANES]; 3];

/// Paths that have come to surfaces.
#[derive(Clone, Copy, Debug)]
pub struct Arriving<'a> {
    /// Their last rays.
    pub rays: &'a [Ray],
    /// What these have hit.
    pub hits: &'a [Hit],
    /// The paths so far.
    pub carried: &'a [Carried],
    /// Which of the numbers are those of each.
    pub samples: &'a [u32],
    pub randoms: &'a [Random],
}

/// Vertices being worked on. Arrays are by lane; those of lanes that are not in use hold anything.
#[derive(Debug)]
pub struct MatteVertices {
    /// Numbers of the paths of the lanes, and how many lanes are in use.
    paths: [u32; LANES],
    count: usize,
    hits: TriangleHits,
    points: TrianglePoints,
    /// Lanes on plain triangles.
    plain: Vec<usize>,
    /// What is known already of the others.
    others: Vec<(usize, OtherPoint)>,
    /// Direction to where the path comes from.
    wo: HitVectors,
    /// By channel.
    reflectance: HitVectors,
    carried: CarriedLanes,
    randoms: ManyRandoms<LANES>,
    /// Shading normal, and the same on the side where the path comes from.
    normal: HitVectors,
    facing: HitVectors,
    bounces: Bounces,
    lights: FlatLights,
    arrivals: FlatArrivals,
    /// As [`super::Outputs::glowing`].
    glowing: [Option<MediumId>; LANES],
    outputs: MatteOutputs,
    wide: Option<Wide>,
}

/// Of [`Carried`], what is needed.
#[derive(Debug)]
struct CarriedLanes {
    /// By channel.
    throughput: HitVectors,
    eta_scale: HitLanes,
    /// At the vertex.
    cone_width: HitLanes,
    cone_spread: HitLanes,
}

/// What [`snell_intersect::SurfaceInteraction`] says of a point, as far as it matters here.
#[derive(Clone, Copy, Debug)]
struct OtherPoint {
    position: Vec3,
    position_error: Vec3,
    geometric_normal: Vec3,
    shading_normal: Vec3,
}

/// Where paths go on.
#[derive(Debug)]
struct Bounces {
    wi: HitVectors,
    origin: HitVectors,
    pdf: HitLanes,
    /// 0 where the path ends.
    exists: [u32; LANES],
}

/// What the vertices of `path` or `direct` give.
#[derive(Debug)]
struct MatteOutputs {
    /// By channel, what the light brings if its ray is free.
    brought: HitVectors,
    /// 0 where no light ray is sent.
    is_lit: [u32; LANES],
    /// By channel, the throughput of the next ray.
    throughput: HitVectors,
    /// 0 where the path ends.
    goes_on: [u32; LANES],
}

/// A surface as the light sees it.
struct Seen {
    arrival: Arrival,
    normal: Vec3,
    geometric_normal: Vec3,
    /// Cosines of where the path comes from with the normals.
    cos_o: f32,
    side: f32,
    reflectance: SampledSpectrum,
}

impl Seen {
    /// The BSDF times the cosine, and the density of sampling, of a direction.
    fn reflected(&self, wi: Vec3) -> (SampledSpectrum, f32) {
        let cos_i = self.normal.dot(wi);
        let is_seen = self.cos_o * cos_i > 0.0 && self.side * self.geometric_normal.dot(wi) > 0.0;
        let pdf = if is_seen { cos_i.abs() * FRAC_1_PI } else { 0.0 };
        (self.reflectance * pdf, pdf)
    }
}

/// True for integrators of which vertices are shaded by [`MatteVertices::shade_classic`].
pub fn is_classic(integrator: IntegratorKind) -> bool {
    matches!(integrator, IntegratorKind::Raycast | IntegratorKind::Whitted)
}

fn at(v: &HitVectors, lane: usize) -> Vec3 {
    Vec3::new(v[0][lane], v[1][lane], v[2][lane])
}

fn put(v: &mut HitVectors, lane: usize, to: Vec3) {
    (v[0][lane], v[1][lane], v[2][lane]) = (to.x, to.y, to.z);
}

/// A spectrum of [`ColorMode::Rgb`].
fn color_at(v: &HitVectors, lane: usize) -> SampledSpectrum {
    SampledSpectrum([v[0][lane], v[1][lane], v[2][lane], 0.0])
}

fn put_color(v: &mut HitVectors, lane: usize, to: SampledSpectrum) {
    (v[0][lane], v[1][lane], v[2][lane]) = (to.0[0], to.0[1], to.0[2]);
}

impl MatteVertices {
    /// For vertices of one depth.
    pub fn new(sampler: &Sampler, wide: Option<Wide>) -> Self {
        Self {
            paths: [0; LANES],
            count: 0,
            hits: TriangleHits::default(),
            points: TrianglePoints::default(),
            plain: Vec::new(),
            others: Vec::new(),
            wo: ZERO,
            reflectance: ZERO,
            carried: CarriedLanes {
                throughput: ZERO,
                eta_scale: [0.0; LANES],
                cone_width: [0.0; LANES],
                cone_spread: [0.0; LANES],
            },
            randoms: ManyRandoms::new(sampler, 0),
            normal: ZERO,
            facing: ZERO,
            bounces: Bounces { wi: ZERO, origin: ZERO, pdf: [0.0; LANES], exists: [0; LANES] },
            lights: FlatLights::default(),
            arrivals: FlatArrivals::default(),
            glowing: [None; LANES],
            outputs: MatteOutputs { brought: ZERO, is_lit: [0; LANES], throughput: ZERO, goes_on: [0; LANES] },
            wide,
        }
    }

    /// Puts vertices of this depth on [`MatteSurfaces`] into the lanes: those of the paths with these numbers, at most [`LANES`], of
    /// which the dead are left out.
    pub fn gather(
        &mut self,
        context: &Context,
        sampler: &Sampler,
        surfaces: &MatteSurfaces,
        from: &Arriving,
        paths: &[u32],
        depth: u32,
    ) {
        self.randoms.start(sampler, depth);
        self.count = 0;
        for &path in &paths[..paths.len().min(LANES)] {
            self.paths[self.count % LANES] = path;
            self.count += usize::from(!from.carried[path as usize].throughput.is_black());
        }
        self.plain.clear();
        self.others.clear();
        for lane in 0..self.count.min(LANES) {
            let path = self.paths[lane] as usize;
            let (ray, hit, carried) = (&from.rays[path], &from.hits[path], &from.carried[path]);
            put(&mut self.wo, lane, -ray.direction);
            self.randoms.set(lane, &from.randoms[from.samples[path] as usize]);
            put_color(&mut self.carried.throughput, lane, carried.throughput);
            self.carried.eta_scale[lane] = carried.eta_scale;
            self.carried.cone_width[lane] = carried.cone_width + carried.cone_spread * hit.t;
            self.carried.cone_spread[lane] = carried.cone_spread;
            match surfaces.plain(hit) {
                Some(PlainSurface { reflectance, .. }) => {
                    put(&mut self.reflectance, lane, Vec3::from(reflectance.to_array()));
                    self.plain.push(lane);
                }
                None => self.gather_other(context, lane, ray, hit),
            }
        }
        let paths = &self.paths;
        let plain = self.plain.iter().filter_map(|&lane| {
            let hit = &from.hits[paths[lane] as usize];
            surfaces.plain(hit).map(|surface| (lane, &surface.mesh, hit))
        });
        self.hits.gather(plain);
    }

    /// Numbers of the paths of the lanes in use.
    pub fn paths(&self) -> &[u32] {
        &self.paths[..self.count]
    }

    /// What is on no plain triangle.
    #[inline(never)]
    fn gather_other(&mut self, context: &Context, lane: usize, ray: &Ray, hit: &Hit) {
        let scene = context.scene;
        // (Where anything moves, nothing comes here.)
        let surface = scene.interaction(ray, 0.0, hit);
        let point = scene.shading_point(&surface, self.carried.cone_width[lane], ColorMode::Rgb);
        let Some((reflectance, shading_normal)) = scene.material(scene.material_id(hit)).matte_at(&point) else {
            return;
        };
        put_color(&mut self.reflectance, lane, reflectance);
        let (position, position_error) = (surface.position, surface.position_error);
        let geometric_normal = surface.geometric_normal;
        self.others.push((lane, OtherPoint { position, position_error, geometric_normal, shading_normal }));
    }

    /// The points of all lanes.
    fn place(&mut self) {
        self.hits.points(&mut self.points, self.wide);
        for &(lane, ref other) in &self.others {
            put(&mut self.points.position, lane, other.position);
            put(&mut self.points.position_error, lane, other.position_error);
            put(&mut self.points.geometric_normal, lane, other.geometric_normal);
            put(&mut self.points.shading_normal, lane, other.shading_normal);
            self.points.is_sound[lane] = 1;
        }
    }

    /// Works out what the lanes give.
    pub fn shade(&mut self, context: &Context, depth: u32) {
        let count = self.count;
        self.place();
        let bsdf = self.randoms.pairs(dimension::BSDF, self.wide);
        let light = self.randoms.pairs(dimension::LIGHT, self.wide);
        let plays = depth >= ROULETTE_DEPTH;
        let roulette = match plays {
            true => self.randoms.numbers(dimension::ROULETTE, self.wide),
            false => [0.0; LANES],
        };
        at_level!(
            self.wide,
            bounce,
            (
                points: &TrianglePoints = &self.points,
                wo: &HitVectors = &self.wo,
                u: &[HitLanes; 2] = &bsdf,
                normals: [&mut HitVectors; 2] = [&mut self.normal, &mut self.facing],
                to: &mut Bounces = &mut self.bounces,
            )
        );
        self.choose_lights(context);
        let surfaces = Surfaces { points: &self.points, normal: &self.normal, wo: &self.wo };
        self.lights.arrivals(context.scene, &surfaces, &light, count, self.wide, &mut self.arrivals);
        at_level!(
            self.wide,
            outputs,
            (
                carried: &CarriedLanes = &self.carried,
                reflectance: &HitVectors = &self.reflectance,
                radiance: &HitVectors = &self.lights.radiance,
                arrivals: &FlatArrivals = &self.arrivals,
                bounces: &Bounces = &self.bounces,
                roulette: (bool, &HitLanes) = (plays, &roulette),
                to: &mut MatteOutputs = &mut self.outputs,
            )
        );
        for (lane, (&x, &y)) in light[0].iter().zip(&light[1]).enumerate().take(count) {
            if self.lights.how[lane] == ALONE {
                self.light_alone(context, lane, Vec2::new(x, y));
            }
        }
    }

    fn choose_lights(&mut self, context: &Context) {
        let choices = match context.lights.has_choice() {
            true => self.randoms.numbers(dimension::LIGHT_CHOICE, self.wide),
            false => [0.0; LANES],
        };
        let receivers = Receivers { position: &self.points.position, normal: &self.facing };
        context.lights.sample_many(&receivers, &choices, self.count, &mut self.lights.chosen);
        self.lights.look_up(context.scene, receivers.position, self.count, self.wide);
        if context.settings.light_strategy != LightStrategy::Mis {
            self.lights.how.iter_mut().filter(|how| **how != DARK).for_each(|how| *how = ALONE);
        }
        self.glowing = [None; LANES];
    }

    /// Works out what [`Self::shade_classic`] needs.
    pub fn prepare_classic(&mut self) {
        self.place();
        at_level!(
            self.wide,
            normals,
            (
                points: &TrianglePoints = &self.points,
                wo: &HitVectors = &self.wo,
                normal: &mut HitVectors = &mut self.normal,
            )
        );
    }

    /// What a vertex of `raycast` or `whitted` gives: ambient light, and a light ray for each light.
    pub fn shade_classic(&self, context: &Context, lane: usize, state: &PathState, random: &Random, out: &mut Outputs) {
        let seen = self.seen(lane, state.mode, state.time);
        let ambient = seen.reflectance * state.mode.illuminant(context.scene.ambient + context.settings.fill);
        out.radiance = state.throughput * ambient;
        let local = |wi| seen.reflected(wi).0 * PI;
        classic::add_lights(context, state.throughput, random, &seen.arrival, local, out);
    }

    /// What a lane knows of its surface.
    fn seen(&self, lane: usize, mode: ColorMode, time: f32) -> Seen {
        let (wo, normal, reflectance) = (at(&self.wo, lane), at(&self.normal, lane), color_at(&self.reflectance, lane));
        let geometric_normal = at(&self.points.geometric_normal, lane);
        let position = at(&self.points.position, lane);
        let skin = Skin { position_error: at(&self.points.position_error, lane), geometric_normal };
        let arrival = Arrival { position, surface: Some(skin), mode, time };
        Seen { arrival, normal, geometric_normal, cos_o: normal.dot(wo), side: geometric_normal.dot(wo), reflectance }
    }

    /// False for a vertex that must be worked on alone after all.
    pub fn is_sound(&self, lane: usize) -> bool {
        self.points.is_sound[lane] != 0
    }

    /// The lanes of those given that send a light ray.
    pub fn lit(&self, lanes: &[u32], to: &mut Vec<u32>) {
        keep(lanes, &self.outputs.is_lit, to);
    }

    /// The lanes of those given whose paths go on.
    pub fn going_on(&self, lanes: &[u32], to: &mut Vec<u32>) {
        keep(lanes, &self.outputs.goes_on, to);
    }

    /// True if the path of a lane goes on.
    pub fn goes_on(&self, lane: usize) -> bool {
        self.outputs.goes_on[lane] != 0
    }

    /// The light ray of a lane.
    #[inline(always)]
    pub fn light_ray(&self, lane: usize) -> Ray {
        self.arrivals.shadow_ray(lane % LANES)
    }

    /// What that brings if it is free.
    #[inline(always)]
    pub fn brought(&self, lane: usize) -> SampledSpectrum {
        color_at(&self.outputs.brought, lane % LANES)
    }

    /// The medium that must glow at its end for it to count; `None` for all other light.
    pub fn glowing(&self, lane: usize) -> Option<MediumId> {
        self.glowing[lane % LANES]
    }

    /// True if the light ray of a lane starts through the surface, by rounding.
    pub fn passes(&self, lane: usize) -> bool {
        let normal = at(&self.points.geometric_normal, lane);
        self.arrivals.shadow_ray(lane).direction.dot(normal) * -at(&self.wo, lane).dot(normal) > 0.0
    }

    /// The source of the light ray of a lane, if it sends one, and its weight by multiple importance sampling.
    pub fn light_source(&self, lane: usize) -> Option<(LightSource, f32)> {
        (self.outputs.is_lit[lane] != 0).then(|| (self.lights.source[lane], self.arrivals.weight(lane)))
    }

    /// As [`super::Outputs::light_lobe`].
    pub fn lobe(&self, lane: usize) -> LobeShares {
        LobeShares::of_matte(color_at(&self.reflectance, lane))
    }

    /// The next ray of a lane.
    #[inline(always)]
    pub fn next_ray(&self, lane: usize) -> Ray {
        let lane = lane % LANES;
        Ray::new(at(&self.bounces.origin, lane), at(&self.bounces.wi, lane))
    }

    /// What the path of the next ray carries.
    #[inline(always)]
    pub fn carried(&self, lane: usize) -> Carried {
        let lane = lane % LANES;
        Carried {
            throughput: color_at(&self.outputs.throughput, lane),
            position: at(&self.points.position, lane),
            normal: at(&self.facing, lane),
            bsdf_pdf: self.bounces.pdf[lane],
            eta_scale: self.carried.eta_scale[lane],
            cone_width: self.carried.cone_width[lane],
            cone_spread: most(self.carried.cone_spread[lane], SCATTERED_SPREAD),
            stream: 0,
            transmits: false,
            is_specular: false,
        }
    }

    /// A light sample that is not one of [`FlatLights`].
    #[inline(never)]
    fn light_alone(&mut self, context: &Context, lane: usize, u: Vec2) {
        let Some(chosen) = &self.lights.chosen.get(lane) else { return };
        let seen = self.seen(lane, ColorMode::Rgb, 0.0);
        let throughput = color_at(&self.carried.throughput, lane);
        let light = weighted_sample(context, throughput, &seen.arrival, chosen, u, |wi| seen.reflected(wi));
        self.outputs.is_lit[lane] = u32::from(light.is_some());
        if let Some(WeightedLight { value, shadow_ray, source, weight, glowing, .. }) = light {
            self.glowing[lane] = glowing;
            put_color(&mut self.outputs.brought, lane, value);
            self.arrivals.put(lane, &shadow_ray, weight);
            self.lights.note_alone(lane, source);
        }
    }
}

/// The lanes that are marked, of those given.
fn keep(lanes: &[u32], marks: &[u32; LANES], to: &mut Vec<u32>) {
    to.clear();
    to.resize(lanes.len(), 0);
    let mut count = 0;
    for &lane in lanes {
        to[count] = lane;
        count += usize::from(marks[lane as usize % LANES] != 0);
    }
    to.truncate(count);
}

/// What vertices give, where their lights are flat.
#[inline(always)]
fn outputs(
    carried: &CarriedLanes,
    reflectance: &HitVectors,
    radiance: &HitVectors,
    arrivals: &FlatArrivals,
    bounces: &Bounces,
    (plays, roulette): (bool, &HitLanes),
    to: &mut MatteOutputs,
) {
    for i in 0..LANES {
        let (cosine, scale) = (arrivals.cosine[i], arrivals.scale[i]);
        let (mut is_lit, mut is_bright, mut is_finite) = (arrivals.exists[i] != 0, false, true);
        for channel in 0..3 {
            let reflected = carried.throughput[channel][i] * (reflectance[channel][i] * cosine);
            let value = reflected * radiance[channel][i] * scale;
            to.brought[channel][i] = value;
            is_bright |= value != 0.0;
            is_finite &= value.abs() < f32::INFINITY;
        }
        is_lit &= is_bright & is_finite;
        to.is_lit[i] = u32::from(is_lit);
        let (mut throughput, mut largest) = ([0.0; 3], 0.0);
        let mut is_finite = true;
        for (channel, throughput) in throughput.iter_mut().enumerate() {
            *throughput = carried.throughput[channel][i] * reflectance[channel][i];
            largest = most(largest, *throughput);
            is_finite &= throughput.abs() < f32::INFINITY;
        }
        // As `survival_at`.
        let survival = if plays { least(largest * carried.eta_scale[i], MAX_SURVIVAL) } else { 1.0 };
        let goes_on = (bounces.exists[i] != 0) & (largest > 0.0) & is_finite & (roulette[i] < survival);
        for (channel, throughput) in throughput.into_iter().enumerate() {
            to.throughput[channel][i] = throughput * (1.0 / survival);
        }
        to.goes_on[i] = u32::from(goes_on);
    }
}

/// Normals as they are seen.
#[inline(always)]
fn normals(points: &TrianglePoints, wo: &HitVectors, normal: &mut HitVectors) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let n = visible_normal(vector(&points.shading_normal), vector(&points.geometric_normal), vector(wo));
        (0..3).for_each(|axis| normal[axis][i] = n[axis]);
    }
}

/// Normals as they are seen, and cosine-distributed directions.
#[inline(always)]
fn bounce(
    points: &TrianglePoints,
    wo: &HitVectors,
    u: &[HitLanes; 2],
    normals: [&mut HitVectors; 2],
    to: &mut Bounces,
) {
    let [normal, facing] = normals;
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let (wo, flat) = (vector(wo), vector(&points.geometric_normal));
        let n = visible_normal(vector(&points.shading_normal), flat, wo);
        let frame = Frame::from_z(n);
        let up = sampling::cosine_hemisphere(Vec2::new(u[0][i], u[1][i]));
        let pdf = up.z * FRAC_1_PI;
        let cos_o = n.dot(wo);
        let local = Vec3::new(up.x, up.y, if cos_o < 0.0 { -up.z } else { up.z });
        let direction = frame.from_local(local);
        let scale = 1.0 / direction.length();
        let wi = direction * scale;
        let is_seen = flat.dot(wo) * flat.dot(wi) > 0.0;
        let exists = is_seen & (pdf > 0.0) & (cos_o != 0.0) & (scale > 0.0) & (scale < f32::INFINITY);
        let origin = robust::offset_ray_origin(vector(&points.position), vector(&points.position_error), flat, wi);
        for axis in 0..3 {
            normal[axis][i] = n[axis];
            facing[axis][i] = if cos_o < 0.0 { -n[axis] } else { n[axis] };
            to.wi[axis][i] = wi[axis];
            to.origin[axis][i] = origin[axis];
        }
        to.pdf[i] = pdf;
        to.exists[i] = u32::from(exists);
    }
}

#[cfg(test)]
mod tests {
    use crate::sampler::SamplerKind;
    use crate::settings::Shadows;
    use crate::{CompiledScene, IntegratorKind, Job, Settings};
    use snell_intersect::BuildOptions;
    use snell_math::Rgb;
    use snell_math::simd::Level;
    use snell_scene::builtin::builtin;
    use snell_scene::material::Diffuse;

    #[test]
    fn many_vertices_at_once_give_the_bits_of_one_at_a_time() {
        for name in ["cornell-box", "teapot", "spheres", "night-town", "fog", "smoke"] {
            let mut scene = builtin(name).expect("the scene is built in");
            for (i, material) in scene.materials.iter_mut().enumerate().filter(|(_, m)| !m.is_emissive()) {
                material.kind = Diffuse::new(Rgb::new(0.9, 0.6, 0.1 * (i % 8) as f32)).into();
            }
            let kinds = [
                (IntegratorKind::Path, SamplerKind::ZSobol, Shadows::Hard),
                (IntegratorKind::Path, SamplerKind::Independent, Shadows::Hard),
                (IntegratorKind::Raycast, SamplerKind::ZSobol, Shadows::Hard),
                (IntegratorKind::Whitted, SamplerKind::ZSobol, Shadows::Soft),
            ];
            for (integrator, sampler, shadows) in kinds {
                let picture = |simd: Level| {
                    let options = BuildOptions { simd, ..BuildOptions::default() };
                    let compiled = CompiledScene::new(&scene, &options).expect("a valid scene");
                    let (max_depth, fill) = (9, Rgb::new(0.1, 0.2, 0.3));
                    let how = Settings { max_depth, sampler, integrator, shadows, fill, ..Settings::default() };
                    let settings = Settings { size: [36, 24], spp: 4, ..how };
                    let image = Job::new(&compiled, &scene.cameras[0], &settings).run(1, &|_| true).0.image();
                    image.layers[0].values.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
                };
                let one_by_one = picture(Level::Scalar);
                for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                    assert_eq!(picture(level), one_by_one, "{name} {integrator:?} {sampler:?} {level}");
                }
            }
        }
    }
}
