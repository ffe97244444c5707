//! The integrator without illumination: every surface shows its colour.

use super::estimators::{background, environment};
use super::{Context, Family, Integrator, Outputs, Vertex, outgoing};
use snell_math::ColorMode;
use snell_scene::bsdf::Lobes;
use snell_scene::material::ShadingPoint;

/// The integrator `flat`.
pub(crate) const FLAT: Integrator =
    Integrator { name: "flat", shade, family: Family::Other, max_depth: 1, spp: 16 };

/// Vertex function of `flat`.
pub fn shade(context: &Context, vertex: &Vertex, out: &mut Outputs) {
    let Some(surface) = &vertex.surface else {
        out.radiance = background(context, vertex.depth, vertex.state)
            .unwrap_or_else(|| environment(context, vertex));
        return;
    };
    let point = surface.point(context.scene);
    let wo = outgoing(vertex.ray);
    let shading = surface.material.bsdf(&point);
    let color = vertex.state.mode.in_white_light(shading.bsdf.albedo(shading.frame.to_local(wo)));
    let emitted = surface.material.emitted(&point, wo);
    // The brightest channel of a lamp is shown like that of white paper.
    let brightest =
        surface.material.emitted(&ShadingPoint { mode: ColorMode::Rgb, ..point }, wo).max_element();
    out.radiance = color + if brightest > 1.0 { emitted / brightest } else { emitted };
}
