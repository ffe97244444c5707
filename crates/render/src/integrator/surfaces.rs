//! What `path` and `direct` do at surfaces of any kind, at many vertices at once: the same as [`super::path`], bit for bit. Lights, random numbers, roulette
//! and rays are worked on in loops that become vector code; how the surface scatters is asked one by one.
//!
//! As with [`super::matte`], which vertices come here depends on the scene and the settings alone, and no lane looks at another.

use super::carried::{Carried, Expected};
use super::guided::GuidedBsdf;
use super::lanes::{
    Arriving, CarriedLanes, Columns, LANES, LitColumns, OtherPoint, Roulette, VertexLanes, ZERO, at, color_at, put,
    put_color,
};
use super::lights::{DARK, FlatArrivals, Skins, ray_origin};
use super::lit::{LitLanes, LitOutputs};
use super::path::{SCATTERED_SPREAD, Scatterer, shining, weighted_sample};
use super::{Context, IntegratorKind, SurfaceVertex, Vertex, dimension};
use crate::light_sampler::Receivers;
use crate::sampler::Sampler;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::most;
use snell_math::{ColorModel, Ray, SampledSpectrum, Vec2, at_level};
use snell_scene::material::Prepared;

/// Vertices being worked on. Arrays are by lane; those of lanes that are not in use hold anything.
#[derive(Debug)]
pub struct SurfaceVertices<'a> {
    lanes: VertexLanes,
    scatterers: Vec<Scatterer<'a>>,
    /// The normal on the side where the path comes from.
    facing: HitVectors,
    /// Lanes of which the surface lets light through.
    transmitting: Vec<u32>,
    /// As [`Carried::is_specular`], so far.
    is_specular: [bool; LANES],
    /// How the surfaces scatter light from where it comes from.
    scattered: Scattered,
    bounces: Bounces,
    lit: LitLanes,
}

/// See [`GuidedBsdf::eval_and_pdf`].
#[derive(Debug)]
struct Scattered {
    /// By channel.
    value: HitVectors,
    pdf: HitLanes,
}

/// Where paths go on.
#[derive(Debug)]
struct Bounces {
    wi: HitVectors,
    origin: HitVectors,
    /// 0 for delta lobes.
    pdf: HitLanes,
    /// By channel, what the throughput is multiplied with.
    weight: HitVectors,
    eta_scale: HitLanes,
    /// As [`GuidedBsdf::survival`] gives it, where paths are guided.
    survival: HitLanes,
    expected: HitLanes,
    is_delta: [bool; LANES],
    /// 0 where the path ends.
    exists: [u32; LANES],
}

impl<'a> SurfaceVertices<'a> {
    /// `None` if vertices on surfaces are to be worked on one by one.
    pub fn new(context: &Context, sampler: &Sampler) -> Option<Self> {
        let (scene, settings) = (context.scene, context.settings);
        let is_for = matches!(settings.integrator, IntegratorKind::Path | IntegratorKind::Direct)
            && settings.color == ColorModel::Rgb
            && !context.wants_lobes
            && !scene.moves;
        let wide = scene.world.simd().wide().filter(|_| is_for)?;
        let number = [0.0; LANES];
        Some(Self {
            lanes: VertexLanes::new(sampler, Some(wide)),
            scatterers: Vec::with_capacity(LANES),
            facing: ZERO,
            transmitting: Vec::with_capacity(LANES),
            is_specular: [false; LANES],
            scattered: Scattered { value: ZERO, pdf: number },
            bounces: Bounces {
                wi: ZERO,
                origin: ZERO,
                pdf: number,
                weight: ZERO,
                eta_scale: number,
                survival: number,
                expected: number,
                is_delta: [false; LANES],
                exists: [0; LANES],
            },
            lit: LitLanes::default(),
        })
    }

    /// Takes the paths with these numbers ([`VertexLanes::start`]). What they have hit must follow for each lane.
    pub fn start(&mut self, sampler: &Sampler, from: &Arriving, paths: &[u32], depth: u32) {
        self.lanes.start(sampler, from, paths, depth);
        self.scatterers.clear();
        self.transmitting.clear();
    }

    /// Says what the path of the next lane has hit, and gives the light that it finds there. `prepared` is [`SurfaceVertex::prepared`].
    pub fn gather(
        &mut self,
        context: &Context,
        vertex: &Vertex,
        surface: &SurfaceVertex,
        prepared: &'a Prepared,
    ) -> SampledSpectrum {
        let point = surface.point(context.scene);
        let (found, _) = shining(context, vertex, surface, &point);
        if vertex.depth >= context.max_depth() {
            return found;
        }
        let lane = self.scatterers.len();
        let scatterer = Scatterer::new(context, vertex, surface, prepared, &point);
        let receiver = &scatterer.receiver;
        put(&mut self.facing, lane, receiver.normal);
        if receiver.transmits {
            self.transmitting.push(lane as u32);
        }
        let lift = scatterer.at.lift();
        self.lanes.put_point(lane, OtherPoint::of(surface.interaction, receiver.normal, lift));
        self.is_specular[lane] = vertex.state.is_specular;
        self.scatterers.push(scatterer);
        found
    }

    /// Works out what the lanes give.
    pub fn shade(&mut self, context: &Context, depth: u32) {
        self.lanes.place();
        self.lanes.place_lifts(context);
        let (wide, count) = (self.lanes.wide, self.scatterers.len());
        let numbers = |dimension| self.lanes.randoms.numbers(dimension, wide);
        let (choice, light) = (numbers(dimension::LOBE), self.lanes.randoms.pairs(dimension::LIGHT, wide));
        let bounce = self.lanes.randoms.pairs(dimension::BSDF, wide);
        let quad = context.field.map_or([0.0; LANES], |_| numbers(dimension::GUIDE));
        let roulette = self.lanes.roulette(context, depth);
        let receivers =
            Receivers { position: &self.lanes.points.position, normal: &self.facing, transmitting: &self.transmitting };
        self.lit.lights.choose(context, &receivers, &self.lanes.randoms, count, wide);
        self.lit.glowing = [None; LANES];
        for (how, scatterer) in self.lit.lights.how.iter_mut().zip(&self.scatterers) {
            *how = if scatterer.shading.is_delta() { DARK } else { *how };
        }
        let skins = Skins { points: &self.lanes.points, lift: &self.lanes.lift };
        self.lit.lights.arrivals(context.scene, &skins, &light, count, wide, &mut self.lit.arrivals);
        for lane in 0..count {
            self.scatter(context, lane, choice[lane], Vec2::new(bounce[0][lane], bounce[1][lane]), quad[lane]);
        }
        at_level!(
            wide,
            outputs,
            (
                carried: &CarriedLanes = &self.lanes.carried,
                skins: &Skins<'_> = &Skins { points: &self.lanes.points, lift: &self.lanes.lift },
                scattered: &Scattered = &self.scattered,
                radiance: &HitVectors = &self.lit.lights.radiance,
                arrivals: &mut FlatArrivals = &mut self.lit.arrivals,
                bounces: &mut Bounces = &mut self.bounces,
                is_guided: bool = context.field.is_some(),
                roulette: &Roulette = &roulette,
                to: &mut LitOutputs = &mut self.lit.outputs,
            )
        );
        let Self { lanes, scatterers, lit, .. } = self;
        lit.sample_alone(count, &light, |lane, chosen, u| {
            let Scatterer { shading, at: arrival, receiver } = &scatterers[lane];
            let (guided, wo) = (GuidedBsdf::new(context.field, shading, receiver), at(&lanes.wo, lane));
            let throughput = color_at(&lanes.carried.throughput, lane);
            weighted_sample(context, throughput, arrival, chosen, u, |wi| guided.eval_and_pdf(wo, wi))
        });
    }

    /// Asks the surface of a lane how it scatters the light that arrives, and where the path goes on.
    fn scatter(&mut self, context: &Context, lane: usize, u_lobe: f32, u: Vec2, u_quad: f32) {
        let Self { lanes, scatterers, scattered, bounces, lit, .. } = self;
        let Scatterer { shading, receiver, .. } = &scatterers[lane];
        let (guided, wo) = (GuidedBsdf::new(context.field, shading, receiver), at(&lanes.wo, lane));
        if lit.arrivals.exists[lane] != 0 {
            let (value, pdf) = guided.eval_and_pdf(wo, at(lit.arrivals.directions(), lane));
            put_color(&mut scattered.value, lane, value);
            scattered.pdf[lane] = pdf;
        }
        let sample = guided.sample(wo, u_lobe, u, || u_quad);
        bounces.exists[lane] = u32::from(sample.is_some());
        let Some(sample) = sample else { return };
        let carried = &lanes.carried;
        let crossing = if sample.is_transmission { shading.crossing_scale(wo) } else { 1.0 };
        let before = (color_at(&carried.throughput, lane), Expected::of(carried.expected[lane]));
        let (survival, expected) = guided.survival(wo, &sample, crossing, before, 0.0);
        put(&mut bounces.wi, lane, sample.wi);
        put_color(&mut bounces.weight, lane, sample.weight);
        bounces.pdf[lane] = if sample.is_delta { 0.0 } else { sample.pdf };
        bounces.eta_scale[lane] = carried.eta_scale[lane] * crossing;
        (bounces.survival[lane], bounces.expected[lane]) = (survival, expected.get());
        bounces.is_delta[lane] = sample.is_delta;
    }
}

impl Columns for SurfaceVertices<'_> {
    fn vertices(&self) -> &VertexLanes {
        &self.lanes
    }

    fn goes_on(&self) -> &[u32; LANES] {
        &self.lit.outputs.goes_on
    }

    #[inline(always)]
    fn next_ray(&self, lane: usize) -> Ray {
        let lane = lane % LANES;
        Ray::new(at(&self.bounces.origin, lane), at(&self.bounces.wi, lane))
    }

    #[inline(always)]
    fn carried(&self, lane: usize) -> Carried {
        let lane = lane % LANES;
        let (before, bounces) = (&self.lanes.carried, &self.bounces);
        let is_delta = bounces.is_delta[lane];
        let spread = before.cone_spread[lane];
        Carried {
            throughput: color_at(&self.lit.outputs.throughput, lane),
            position: at(&self.lanes.points.position, lane),
            normal: at(&self.facing, lane),
            bsdf_pdf: bounces.pdf[lane],
            eta_scale: bounces.eta_scale[lane],
            cone_width: before.cone_width[lane],
            cone_spread: if is_delta { spread } else { most(spread, SCATTERED_SPREAD) },
            stream: 0,
            expected: Expected::of(bounces.expected[lane]),
            transmits: self.scatterers[lane].receiver.transmits,
            is_specular: is_delta && self.is_specular[lane],
        }
    }
}

impl LitColumns for SurfaceVertices<'_> {
    fn light(&self) -> &LitLanes {
        &self.lit
    }
}

/// What vertices give, where their lights are flat.
#[inline(always)]
fn outputs(
    carried: &CarriedLanes,
    skins: &Skins,
    scattered: &Scattered,
    radiance: &HitVectors,
    arrivals: &mut FlatArrivals,
    bounces: &mut Bounces,
    is_guided: bool,
    roulette: &Roulette,
    to: &mut LitOutputs,
) {
    let survival = is_guided.then_some(&bounces.survival);
    for i in 0..LANES {
        arrivals.weigh(i, scattered.pdf[i]);
        let value = [scattered.value[0][i], scattered.value[1][i], scattered.value[2][i]];
        to.bring(i, carried, value, radiance, arrivals);
        let next = (&bounces.weight, &bounces.eta_scale);
        to.go_on(i, carried, next, survival, roulette, bounces.exists[i] != 0);
        let origin = ray_origin(skins.points, skins.lift, i, at(&bounces.wi, i));
        for axis in 0..3 {
            bounces.origin[axis][i] = origin[axis];
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::sampler::SamplerKind;
    use crate::{CompiledScene, Guiding, IntegratorKind, Job, LightStrategy, Settings};
    use snell_intersect::BuildOptions;
    use snell_math::simd::Level;
    use snell_scene::Texture;
    use snell_scene::builtin::builtin;
    use snell_scene::material::{AlphaMode, MaterialKind, NormalMap};
    use snell_scene::texture::Pattern;

    #[test]
    fn many_vertices_at_once_give_the_bits_of_one_at_a_time() {
        let guiding = Some(Guiding { passes: 2, photons: 1 << 13 });
        let kinds = MaterialKind::examples();
        let mut first = 0;
        for name in ["cornell-box", "teapot", "spheres", "night-town", "fog", "drink", "hair", "smoke"] {
            let mut scene = builtin(name).expect("the scene is built in");
            let bumps = Pattern::examples().into_iter().find(|p| p.textures().is_empty()).expect("there is one");
            let texture = scene.add_texture(Texture::Pattern(bumps));
            // A lamp that is not black, among others.
            if let Some(lamp) = scene.materials.iter_mut().find(|m| m.is_emissive()) {
                lamp.kind = kinds[first % kinds.len()].clone();
            }
            let ways = [
                (IntegratorKind::Path, SamplerKind::ZSobol, LightStrategy::Mis, None),
                (IntegratorKind::Path, SamplerKind::Independent, LightStrategy::Mis, None),
                (IntegratorKind::Path, SamplerKind::Independent, LightStrategy::Mis, guiding),
                (IntegratorKind::Path, SamplerKind::ZSobol, LightStrategy::Light, None),
                (IntegratorKind::Direct, SamplerKind::Stratified, LightStrategy::Bsdf, None),
            ];
            for (way, (integrator, sampler, light_strategy, guiding)) in ways.into_iter().enumerate() {
                let materials = scene.materials.iter_mut().filter(|m| !m.is_emissive() && m.interior.is_none());
                for (i, material) in materials.enumerate().take(if name == "night-town" { 12 } else { 4 }) {
                    let number = first + i;
                    material.kind = kinds[number % kinds.len()].clone();
                    let is_bent = number % 3 == 0;
                    material.normal_map = is_bent.then_some(NormalMap { texture, scale: 0.3 });
                    material.alpha_mode = if number % 5 == 0 { AlphaMode::Blend } else { AlphaMode::Opaque };
                    material.alpha = 0.7.into();
                }
                first += 4;
                let picture = |simd: Level| {
                    let options = BuildOptions { simd, ..BuildOptions::default() };
                    let compiled = CompiledScene::new(&scene, &options).expect("a valid scene");
                    let how = Settings { max_depth: 7, sampler, integrator, light_strategy, ..Settings::default() };
                    let settings = Settings { size: [32, 24], spp: 4, guiding, ..how };
                    let image = Job::new(&compiled, &scene.cameras[0], &settings).run(1, &|_| true).0.image();
                    image.layers[0].values.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
                };
                let one_by_one = picture(Level::Scalar);
                assert!(one_by_one.iter().any(|&x| f32::from_bits(x) != 0.0) || way > 2, "{name}");
                for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
                    let is_alike = picture(level) == one_by_one;
                    assert!(is_alike, "{name} {integrator:?} {sampler:?} {light_strategy:?} {guiding:?} {level}");
                }
            }
        }
    }
}
