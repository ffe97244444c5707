//! Path tracing: light samples at every vertex and BSDF samples to continue, both weighted by the
//! power heuristic, with Russian roulette. `direct` is the same with one bounce.

use super::estimators::{Arrival, background, continued, environment_choice, light_pdf_of_hit};
use super::guided::GuidedBsdf;
use super::light_part::{LightSource, LobeShares};
use super::light_sample::weighted_light;
use super::scattering::scatter;
use super::{
    Context, Family, Integrator, Outputs, PathState, SurfaceVertex, Vertex, dimension, outgoing,
};
use crate::compile::floor::Received;
use crate::light_sampler::Receiver;
use crate::settings::{LightStrategy, Settings};
use snell_math::{ColorMode, Ray, SampledSpectrum, Vec2, Vec3, sampling};
use snell_scene::Background;
use snell_scene::light::environment::EnvironmentLight;
use snell_scene::material::{Prepared, ShadingBsdf, ShadingPoint};

/// The integrator `path`.
pub(crate) const PATH: Integrator = Integrator {
    name: "path",
    shade,
    family: Family::Path,
    max_depth: Settings::MAX_DEPTH,
    spp: 64,
};

/// The integrator `direct`.
pub(crate) const DIRECT: Integrator =
    Integrator { name: "direct", shade, family: Family::Path, max_depth: 1, spp: 64 };

/// Growth of the ray cone after a bounce that is not specular.
pub(crate) const SCATTERED_SPREAD: f32 = 0.2;

/// Vertex function of `path` and `direct`.
pub fn shade(context: &Context, vertex: &Vertex, out: &mut Outputs) {
    let max_depth = context.max_depth();
    if let Some(medium) = &vertex.medium {
        if vertex.depth < max_depth {
            scatter(context, vertex, medium, out);
        }
        return;
    }
    let Some(surface) = &vertex.surface else {
        if catch_shadow(context, vertex, out) {
            return;
        }
        (out.radiance, out.weights.found) = escaped(context, vertex);
        return;
    };
    let wo = outgoing(vertex.ray);
    let point = surface.point(context.scene);
    (out.radiance, out.weights.found) = shining(context, vertex, surface, &point);
    if vertex.depth >= max_depth {
        return;
    }
    let Scatterer { shading, at, receiver } =
        Scatterer::new(context, vertex, surface, surface.prepared, &point);
    let guided = GuidedBsdf::new(context.field, &shading, &receiver);
    if !shading.is_delta() {
        let bsdf = |wi| guided.eval_and_pdf(wo, wi);
        if let Some(wi) = light_sample(context, vertex, &at, &receiver, bsdf, out) {
            out.light_lobe =
                first_lobe(context, vertex, || LobeShares::of_surface(&shading, wo, wi, false));
        }
    }
    add_bounce(context, vertex, surface, &at, &receiver, &guided, out);
}

/// What the floor of the background receives where the camera ray meets it, if it meets one, and
/// the light of the background. Light rays together carry the background's radiance, because their
/// directions are sampled in proportion to the light that the floor receives: the fraction of the
/// rays that arrive is the brightness of the shadow.
#[inline]
pub(crate) fn caught_shadow(
    context: &Context,
    depth: u32,
    ray: &Ray,
    throughput: SampledSpectrum,
    mode: ColorMode,
    u: impl FnOnce() -> Vec2,
) -> Option<(Received, SampledSpectrum)> {
    let floor = context.scene.floor.as_ref().filter(|_| depth == 0)?;
    let received = floor.received(ray, u)?;
    Some((received, throughput * mode.illuminant(floor.color)))
}

/// Adds what the floor of the background receives, if the camera ray meets one.
fn catch_shadow(context: &Context, vertex: &Vertex, out: &mut Outputs) -> bool {
    let u = || vertex.random.pair(dimension::LIGHT);
    let PathState { throughput, mode, .. } = *vertex.state;
    let caught = caught_shadow(context, vertex.depth, vertex.ray, throughput, mode, u);
    let Some((received, light)) = caught else { return false };
    let [part, certain] = received.parts(light);
    out.radiance = certain;
    out.light_rays.extend(received.uncertain().iter().map(|&ray| (ray, part)));
    out.light_source = Some(LightSource::Environment);
    out.light_lobe = LobeShares::MATTE;
    true
}

/// The emission of the surface that the path hit, multiplied by throughput and weight, and the MIS
/// weight.
pub(crate) fn shining(
    context: &Context,
    vertex: &Vertex,
    surface: &SurfaceVertex,
    point: &ShadingPoint,
) -> (SampledSpectrum, f32) {
    let (material, is_seen) = (surface.material, vertex.state.is_specular);
    if material.is_emissive() && (material.illuminates || is_seen) {
        // What a bounce meets is what light samples take; only what is seen is a picture.
        let footprint = if is_seen { point.footprint } else { 0.0 };
        let emitted = material.emitted(&ShadingPoint { footprint, ..*point }, outgoing(vertex.ray));
        if !emitted.is_black() {
            let weight = weight_of_bsdf_sample(context, vertex, || {
                light_pdf_of_hit(context, vertex, surface)
            });
            return (vertex.state.throughput * emitted * weight, weight);
        }
    }
    (SampledSpectrum::ZERO, 1.0)
}

/// The environment's radiance for a path that leaves the scene, multiplied by throughput and
/// weight, and the MIS weight.
pub(crate) fn escaped(context: &Context, vertex: &Vertex) -> (SampledSpectrum, f32) {
    let place = |sky: &EnvironmentLight| sky.place(vertex.ray.direction);
    escaped_to(context, vertex.depth, vertex.ray, vertex.state, place)
}

/// Adds a light ray towards a light sample, and returns the direction of the sample. `scattering`
/// returns two values for a direction: the BSDF times the cosine, and the density with which the
/// path itself samples the direction.
pub(crate) fn light_sample(
    context: &Context,
    vertex: &Vertex,
    at: &Arrival,
    receiver: &Receiver,
    scattering: impl Fn(Vec3) -> (SampledSpectrum, f32),
    out: &mut Outputs,
) -> Option<Vec3> {
    let u_choice = || vertex.random.number(dimension::LIGHT_CHOICE);
    let u = || vertex.random.pair(dimension::LIGHT);
    let found =
        weighted_light(context, vertex.state.throughput, at, receiver, u_choice, u, scattering)?;
    out.light_source = Some(found.source);
    out.weights.light = found.weight;
    out.glowing = found.glowing;
    out.light_rays.push((found.shadow_ray, found.value));
    Some(found.direction)
}

fn add_bounce(
    context: &Context,
    vertex: &Vertex,
    surface: &SurfaceVertex,
    at: &Arrival,
    receiver: &Receiver,
    guided: &GuidedBsdf,
    out: &mut Outputs,
) {
    let wo = outgoing(vertex.ray);
    let (u_lobe, u) = (vertex.random.number(dimension::LOBE), vertex.random.pair(dimension::BSDF));
    let u_quad = || vertex.random.number(dimension::GUIDE);
    let Some(sample) = guided.sample(wo, u_lobe, u, u_quad) else { return };
    let mut throughput = vertex.state.throughput * sample.weight;
    if throughput.is_black() || !throughput.is_finite() {
        return;
    }
    let crossing = if sample.is_transmission { guided.shading.crossing_scale(wo) } else { 1.0 };
    let eta_scale = vertex.state.eta_scale * crossing;
    let next = throughput.max_element() * eta_scale;
    let before = (vertex.state.throughput, vertex.state.expected);
    let (weight, expected) = guided.survival(wo, &sample, crossing, before, next);
    let Some(survival) = survival(context, vertex, weight) else { return };
    throughput *= 1.0 / survival;
    let state = PathState {
        eta_scale,
        bsdf_pdf: if sample.is_delta { 0.0 } else { sample.pdf },
        receiver: *receiver,
        is_specular: vertex.state.is_specular && sample.is_delta,
        expected,
        lobe: first_lobe(context, vertex, || {
            LobeShares::of_surface(guided.shading, wo, sample.wi, sample.is_delta)
        }),
        cone_spread: if sample.is_delta {
            vertex.state.cone_spread
        } else {
            vertex.state.cone_spread.max(SCATTERED_SPREAD)
        },
        ..continued(vertex, surface, throughput)
    };
    out.choice = guided.choice(receiver, wo, &sample, survival);
    out.next.push((Ray::new(at.ray_origin(sample.wi), sample.wi), state));
}

/// Russian roulette: the survival probability of a path, given the weight that it would have;
/// `None` if it ends.
pub(crate) fn survival(context: &Context, vertex: &Vertex, weight: f32) -> Option<f32> {
    let Some(most) = context.roulette(vertex.depth) else { return Some(1.0) };
    let survival = weight.min(most);
    (vertex.random.number(dimension::ROULETTE) < survival).then_some(survival)
}

/// The path's first scattering: `this` at the first vertex if lobes are recorded, otherwise the one
/// in the path's state.
pub(crate) fn first_lobe(
    context: &Context,
    vertex: &Vertex,
    this: impl FnOnce() -> LobeShares,
) -> LobeShares {
    if context.wants_lobes && vertex.depth == 0 { this() } else { vertex.state.lobe }
}

/// A surface that scatters light, with the outgoing direction of a path.
#[derive(Clone, Debug)]
pub(crate) struct Scatterer<'a> {
    pub shading: ShadingBsdf<'a>,
    pub at: Arrival,
    pub receiver: Receiver,
}

impl<'a> Scatterer<'a> {
    /// The surface at a vertex. `prepared` is [`SurfaceVertex::prepared`], from which the result
    /// borrows.
    pub fn new(
        context: &Context,
        vertex: &Vertex,
        surface: &SurfaceVertex,
        prepared: &'a Prepared,
        point: &ShadingPoint,
    ) -> Self {
        let wo = outgoing(vertex.ray);
        let mut shading = surface.material.prepared_towards(prepared, point, wo);
        let at = Arrival::at_surface(context, vertex, surface, &mut shading);
        let normal = shading.frame.z;
        let receiver = Receiver {
            position: surface.interaction.position,
            normal: if normal.dot(wo) < 0.0 { -normal } else { normal },
            transmits: !shading.is_opaque(),
        };
        Self { shading, at, receiver }
    }
}

/// The environment, if paths that leave the scene at this depth find its radiance with an MIS
/// weight of 1, so that [`escaped`] need not be called.
pub(crate) fn plain_sky<'a>(context: &Context<'a>, depth: u32) -> Option<&'a EnvironmentLight> {
    let (scene, strategy) = (context.scene, context.settings.light_strategy);
    let shows_background = depth == 0 && !matches!(scene.background, Background::Environment);
    let is_sampled = strategy == LightStrategy::Light || scene.samples_environment(strategy);
    let is_plain = |sky: &&EnvironmentLight| !shows_background && !is_sampled && !sky.has_portals();
    scene.environment.as_deref().filter(is_plain)
}

/// What [`escaped`] returns for a path in this state that leaves the scene at this depth along a
/// ray; `place` computes the [place](EnvironmentLight::place) of its direction in the environment.
#[inline]
pub(crate) fn escaped_to(
    context: &Context,
    depth: u32,
    ray: &Ray,
    state: &PathState,
    place: impl FnOnce(&EnvironmentLight) -> Vec2,
) -> (SampledSpectrum, f32) {
    if let Some(background) = background(context, depth, state) {
        return (state.throughput * background, 1.0);
    }
    let Some(sky) = &context.scene.environment else { return (SampledSpectrum::ZERO, 1.0) };
    let (direction, strategy) = (ray.direction, context.settings.light_strategy);
    if !sky.is_seen(ray.origin, direction) {
        return (SampledSpectrum::ZERO, 1.0);
    }
    let is_sampled = strategy == LightStrategy::Mis && context.scene.samples_environment(strategy);
    let place = place(sky);
    let radiance = sky.radiance_at(place, state.mode);
    if radiance.is_black() {
        return (SampledSpectrum::ZERO, 1.0);
    }
    let weight = match strategy {
        LightStrategy::Mis | LightStrategy::Light if sky.has_portals() => {
            weight_of_found_light(strategy, state.bsdf_pdf, || {
                let pdf = sky.pdf_from(state.receiver.position, direction);
                environment_choice(context, &state.receiver, pdf)
            })
        }
        LightStrategy::Mis if !is_sampled => 1.0,
        LightStrategy::Mis => weight_of_found_light(strategy, state.bsdf_pdf, || {
            environment_choice(context, &state.receiver, sky.pdf_compensated_at(place))
        }),
        LightStrategy::Bsdf => 1.0,
        LightStrategy::Light => weight_of_found_light(strategy, state.bsdf_pdf, || {
            environment_choice(context, &state.receiver, sky.pdf(direction))
        }),
    };
    (state.throughput * radiance * weight, weight)
}

fn weight_of_bsdf_sample(context: &Context, vertex: &Vertex, light_pdf: impl Fn() -> f32) -> f32 {
    weight_of_found_light(context.settings.light_strategy, vertex.state.bsdf_pdf, light_pdf)
}

/// The MIS weight of light that a BSDF sample found in a direction with this density of light
/// samples (0 if no light sample can find it).
#[inline]
pub(crate) fn weight_of_found_light(
    strategy: LightStrategy,
    bsdf_pdf: f32,
    light_pdf: impl Fn() -> f32,
) -> f32 {
    if bsdf_pdf == 0.0 {
        return 1.0;
    }
    match strategy {
        LightStrategy::Mis => sampling::power_heuristic(bsdf_pdf, light_pdf()),
        LightStrategy::Light => f32::from(light_pdf() == 0.0),
        LightStrategy::Bsdf => 1.0,
    }
}
