//! The classic integrators: local illumination (`raycast`) and the recursive ray tree (`whitted`).
//!
//! The radiance is emission + ambient reflectance x ambient light + the sum over lights of their
//! local illumination. `whitted` adds the weighted radiance along the perfectly reflected and
//! refracted directions.

use super::estimators::{Arrival, background, continued, environment, sample_whole_light};
use super::{
    Context, Family, Integrator, IntegratorKind, Outputs, PathState, SurfaceVertex, Vertex,
    dimension, outgoing,
};
use crate::sampler::Random;
use crate::settings::Shadows;
use snell_math::{Ray, SampledSpectrum, Vec2, Vec3, rng};
use snell_scene::material::ShadingBsdf;
use std::f32::consts::FRAC_1_PI;

/// The integrator `raycast`.
pub(crate) const RAYCAST: Integrator =
    Integrator { name: "raycast", shade, family: Family::Classic, max_depth: 1, spp: 16 };

/// The integrator `whitted`.
pub(crate) const WHITTED: Integrator =
    Integrator { name: "whitted", shade, family: Family::Classic, max_depth: 8, spp: 16 };

/// Branches whose throughput is below this are not followed.
const LEAST_THROUGHPUT: f32 = 1e-4;

/// Vertex function of `raycast` and `whitted`.
pub fn shade(context: &Context, vertex: &Vertex, out: &mut Outputs) {
    let throughput = vertex.state.throughput;
    let Some(surface) = &vertex.surface else {
        let seen = background(context, vertex.depth, vertex.state)
            .unwrap_or_else(|| environment(context, vertex));
        out.radiance = throughput * seen;
        return;
    };
    let wo = outgoing(vertex.ray);
    let point = surface.point(context.scene);
    let mut shading = surface.material.bsdf_towards(&point, wo);
    let at = Arrival::at_surface(context, vertex, surface, &mut shading);
    let ambient = shading.ambient(wo)
        * vertex.state.mode.illuminant(context.scene.ambient + context.settings.fill);
    out.radiance = throughput * (surface.material.emitted(&point, wo) + ambient);
    let local = |wi| shading.eval_classic(wo, wi);
    add_lights(context, throughput, &vertex.random, &at, local, out);
    let follows = context.settings.integrator == IntegratorKind::Whitted
        && vertex.depth < context.settings.max_depth;
    if follows {
        add_branches(vertex, surface, &shading, wo, out);
    }
}

/// Adds the contribution of every light. `local` returns `pi f |cos|` for a direction, or the value
/// of the classic formula in its place.
pub(crate) fn add_lights(
    context: &Context,
    throughput: SampledSpectrum,
    random: &Random,
    at: &Arrival,
    local: impl Fn(Vec3) -> SampledSpectrum,
    out: &mut Outputs,
) {
    for light in 0..context.scene.lights().len() {
        let u = match context.settings.shadows {
            // The middle of the environment is not representative, so a direction is always
            // sampled.
            _ if context.scene.environment_light() == Some(light) => random.pair(dimension::LIGHT),
            Shadows::Soft => random.pair(dimension::LIGHTS + light as u32 % 200),
            // These numbers select the middle of the light.
            Shadows::None | Shadows::Hard => Vec2::splat(0.5),
        };
        let Some(sample) = sample_whole_light(context, at, light, u) else { continue };
        let local = local(sample.direction) * FRAC_1_PI;
        let value = throughput * local * sample.radiance / sample.pdf;
        if value.is_black() || !value.is_finite() {
            continue;
        }
        if context.settings.shadows == Shadows::None {
            out.radiance += value;
        } else {
            out.light_rays.push((sample.shadow_ray, value));
        }
    }
}

fn add_branches(
    vertex: &Vertex,
    surface: &SurfaceVertex,
    shading: &ShadingBsdf,
    wo: Vec3,
    out: &mut Outputs,
) {
    let branches = shading.specular_branches(wo);
    for (number, branch) in branches.into_iter().enumerate() {
        let Some(branch) = branch else { continue };
        let throughput: SampledSpectrum = vertex.state.throughput * branch.weight;
        if !throughput.is_finite() || throughput.max_element() < LEAST_THROUGHPUT {
            continue;
        }
        let stream = rng::hash_combine(vertex.state.stream, 1 + number as u32);
        let state = PathState { stream, ..continued(vertex, surface, throughput) };
        out.next.push((Ray::new(surface.interaction.ray_origin(branch.wi), branch.wi), state));
    }
}
