//! The integrator of ambient occlusion.

use super::{Context, Family, Integrator, Outputs, Vertex, dimension};
use snell_math::{Frame, Ray, SampledSpectrum, sampling};

/// The integrator `ao`.
pub(crate) const AO: Integrator =
    Integrator { name: "ao", shade, family: Family::Other, max_depth: 1, spp: 32 };

/// Vertex function of `ao`: the fraction of the cosine-weighted hemisphere that is free within the
/// occlusion distance, as a grey.
pub fn shade(context: &Context, vertex: &Vertex, out: &mut Outputs) {
    let mode = vertex.state.mode;
    let white: SampledSpectrum = mode.in_white_light(mode.unit());
    let Some(surface) = &vertex.surface else {
        out.radiance =
            super::estimators::background(context, vertex.depth, vertex.state).unwrap_or(white);
        return;
    };
    let interaction = surface.interaction;
    let facing = interaction.is_front_facing(vertex.ray.direction);
    let side = if facing { 1.0 } else { -1.0 };
    let local = sampling::cosine_hemisphere(vertex.random.pair(dimension::BSDF));
    let direction = Frame::from_z(interaction.shading_normal * side).from_local(local);
    if direction.dot(interaction.geometric_normal) * side <= 0.0 {
        return;
    }
    let reach = context.settings.ao_distance.unwrap_or(0.5 * context.scene.radius);
    let ray = Ray::new(interaction.ray_origin(direction), direction).with_t_max(reach);
    out.light_rays.push((ray, white));
}
