//! What most integrators do at Lambertian surfaces without textures, at many vertices at once: the same as [`super::path`] and
//! [`super::classic`], bit for bit, in loops that become vector code. Such surfaces are most of many scenes, and cost little else.
//!
//! Which vertices come here depends on the scene and the settings alone, and no lane looks at another, so that a path does not depend
//! on what shares its batch.

use super::Context;
use super::estimators::{Arrival, Skin};
use super::light_part::LobeShares;
use super::path::{ROULETTE_DEPTH, SCATTERED_SPREAD, WeightedLight, survival_at, weighted_light};
use super::{IntegratorKind, Outputs, PathState, classic, dimension};
use crate::light_sampler::Receiver;
use crate::sampler::{ManyRandoms, Random, Sampler};
use snell_intersect::triangles::{HitLanes, HitVectors, TRIANGLE_HITS};
use snell_intersect::{Hit, TriangleHits, TrianglePoints};
use snell_math::simd::Wide;
use snell_math::{ColorMode, ColorModel, Frame, Ray, SampledSpectrum, Vec2, Vec3, at_level, robust, sampling};
use snell_scene::Material;
use snell_scene::material::visible_normal;
use std::f32::consts::{FRAC_1_PI, PI};

/// Most vertices at once.
pub const LANES: usize = TRIANGLE_HITS;

const ZERO: HitVectors = [[0.0; LANES]; 3];

/// Vertices being worked on. Arrays are by lane; those of lanes that are not in use hold anything.
#[derive(Debug)]
pub struct MatteVertices {
    hits: TriangleHits,
    points: TrianglePoints,
    /// Direction to where the path comes from.
    wo: HitVectors,
    randoms: ManyRandoms<LANES>,
    /// Shading normal.
    normal: HitVectors,
    bounces: Bounces,
    wide: Option<Wide>,
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

/// The numbers of all lanes.
#[derive(Debug)]
pub struct MatteNumbers {
    bsdf: [HitLanes; 2],
    light: [HitLanes; 2],
    light_choice: HitLanes,
    roulette: HitLanes,
}

fn is_for(integrator: IntegratorKind) -> bool {
    is_classic(integrator) || matches!(integrator, IntegratorKind::Path | IntegratorKind::Direct)
}

/// True for integrators of which vertices are shaded by [`MatteVertices::shade_classic`].
pub fn is_classic(integrator: IntegratorKind) -> bool {
    matches!(integrator, IntegratorKind::Raycast | IntegratorKind::Whitted)
}

/// The reflectance of a material whose vertices can be worked on here.
pub fn reflectance(context: &Context, material: &Material, color: ColorModel) -> Option<SampledSpectrum> {
    let is_for_all = is_for(context.settings.integrator) && context.field.is_none() && color == ColorModel::Rgb;
    is_for_all.then(|| material.lambertian()).flatten().map(|rgb| ColorMode::Rgb.reflectance(rgb))
}

fn at(v: &HitVectors, lane: usize) -> Vec3 {
    Vec3::new(v[0][lane], v[1][lane], v[2][lane])
}

fn put(v: &mut HitVectors, lane: usize, to: Vec3) {
    (v[0][lane], v[1][lane], v[2][lane]) = (to.x, to.y, to.z);
}

impl MatteVertices {
    /// For vertices of one depth.
    pub fn new(sampler: &Sampler, wide: Option<Wide>) -> Self {
        Self {
            hits: TriangleHits::default(),
            points: TrianglePoints::default(),
            wo: ZERO,
            randoms: ManyRandoms::new(sampler, 0),
            normal: ZERO,
            bounces: Bounces { wi: ZERO, origin: ZERO, pdf: [0.0; LANES], exists: [0; LANES] },
            wide,
        }
    }

    /// The following vertices are of this depth.
    pub fn start(&mut self, sampler: &Sampler, depth: u32) {
        self.randoms = ManyRandoms::new(sampler, depth);
    }

    /// Puts a vertex into a lane. False if it must be worked on alone.
    pub fn gather(&mut self, context: &Context, lane: usize, ray: &Ray, hit: &Hit, random: &Random) -> bool {
        if !context.scene.world.gather_triangle(hit, lane, &mut self.hits) {
            return false;
        }
        put(&mut self.wo, lane, -ray.direction);
        self.randoms.set(lane, random);
        true
    }

    /// Works out all that does not need the lights.
    pub fn prepare(&mut self, depth: u32) -> MatteNumbers {
        self.hits.points(&mut self.points, self.wide);
        let pairs = |dimension| self.randoms.pairs(dimension, self.wide);
        let numbers = MatteNumbers {
            bsdf: pairs(dimension::BSDF),
            light: pairs(dimension::LIGHT),
            light_choice: self.randoms.numbers(dimension::LIGHT_CHOICE, self.wide),
            roulette: match depth < ROULETTE_DEPTH {
                true => [0.0; LANES],
                false => self.randoms.numbers(dimension::ROULETTE, self.wide),
            },
        };
        at_level!(
            self.wide,
            bounce,
            (
                points: &TrianglePoints = &self.points,
                wo: &HitVectors = &self.wo,
                u: &[HitLanes; 2] = &numbers.bsdf,
                normal: &mut HitVectors = &mut self.normal,
                to: &mut Bounces = &mut self.bounces,
            )
        );
        numbers
    }

    /// Works out what [`Self::shade_classic`] needs.
    pub fn prepare_classic(&mut self) {
        self.hits.points(&mut self.points, self.wide);
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
    pub fn shade_classic(
        &self,
        context: &Context,
        lane: usize,
        state: &PathState,
        random: &Random,
        reflectance: SampledSpectrum,
        out: &mut Outputs,
    ) {
        let seen = self.seen(lane, state, reflectance);
        let ambient = reflectance * state.mode.illuminant(context.scene.ambient + context.settings.fill);
        out.radiance = state.throughput * ambient;
        let local = |wi| seen.reflected(wi).0 * PI;
        classic::add_lights(context, state.throughput, random, &seen.arrival, local, out);
    }

    /// What a lane knows of its surface.
    fn seen(&self, lane: usize, state: &PathState, reflectance: SampledSpectrum) -> Seen {
        let (wo, normal) = (at(&self.wo, lane), at(&self.normal, lane));
        let geometric_normal = at(&self.points.geometric_normal, lane);
        let position = at(&self.points.position, lane);
        let skin = Skin { position_error: at(&self.points.position_error, lane), geometric_normal };
        let arrival = Arrival { position, surface: Some(skin), mode: state.mode, time: state.time };
        Seen { arrival, normal, geometric_normal, cos_o: normal.dot(wo), side: geometric_normal.dot(wo), reflectance }
    }

    /// False for a vertex that must be worked on alone after all.
    pub fn is_sound(&self, lane: usize) -> bool {
        self.points.is_sound[lane] != 0
    }

    /// What the vertex gives: a light ray, and the next ray.
    pub fn shade(
        &self,
        context: &Context,
        lane: usize,
        numbers: &MatteNumbers,
        depth: u32,
        (hit, state): (&Hit, &PathState),
        reflectance: SampledSpectrum,
        out: &mut Outputs,
    ) {
        let seen = self.seen(lane, state, reflectance);
        let (position, normal) = (seen.arrival.position, seen.normal);
        let normal = if seen.cos_o < 0.0 { -normal } else { normal };
        let receiver = Receiver { position, normal, transmits: false };
        let reflected = |wi| seen.reflected(wi);
        let u = || Vec2::new(numbers.light[0][lane], numbers.light[1][lane]);
        let choice = || numbers.light_choice[lane];
        let lobe = if context.wants_lobes && depth == 0 { LobeShares::of_matte(reflectance) } else { state.lobe };
        let light = weighted_light(context, state.throughput, &seen.arrival, &receiver, choice, u, reflected);
        if let Some(WeightedLight { value, shadow_ray, source, weight, .. }) = light {
            out.weights.light = weight;
            (out.light_source, out.light_lobe) = (Some(source), lobe);
            out.light_rays.push((shadow_ray, value));
        }
        let mut throughput = state.throughput * reflectance;
        if self.bounces.exists[lane] == 0 || throughput.is_black() || !throughput.is_finite() {
            return;
        }
        let weight = throughput.max_element() * state.eta_scale;
        let Some(survival) = survival_at(depth, weight, || numbers.roulette[lane]) else { return };
        throughput *= 1.0 / survival;
        let next = PathState {
            throughput,
            bsdf_pdf: self.bounces.pdf[lane],
            receiver,
            is_specular: false,
            lobe,
            cone_width: state.cone_width + state.cone_spread * hit.t,
            cone_spread: state.cone_spread.max(SCATTERED_SPREAD),
            ..*state
        };
        out.next.push((Ray::new(at(&self.bounces.origin, lane), at(&self.bounces.wi, lane)), next));
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
fn bounce(points: &TrianglePoints, wo: &HitVectors, u: &[HitLanes; 2], normal: &mut HitVectors, to: &mut Bounces) {
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
        for name in ["cornell-box", "teapot", "spheres", "night-town"] {
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
