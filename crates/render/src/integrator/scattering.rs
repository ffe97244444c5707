//! The vertex function of `path` and `direct` where a medium scatters: a light sample, and a new
//! direction from the phase function. Both are weighted by the power heuristic on their densities
//! of direction. Media and interfaces on the way affect both equally.

use super::estimators::Arrival;
use super::light_part::LobeShares;
use super::path::{SCATTERED_SPREAD, first_lobe, light_sample, survival};
use super::roulette::unknown_survival;
use super::{Context, MediumVertex, Outputs, PathState, Vertex, dimension};
use crate::light_sampler::Receiver;
use snell_math::{Ray, SampledSpectrum, Vec3};

/// Light samples and the next ray of a path that was scattered in a medium.
pub fn scatter(context: &Context, vertex: &Vertex, medium: &MediumVertex, out: &mut Outputs) {
    let forward = vertex.ray.direction;
    let receiver = Receiver { position: medium.position, normal: Vec3::ZERO, transmits: true };
    let phase = |wi: Vec3| {
        let pdf = medium.phase.pdf(forward, wi);
        (SampledSpectrum::splat(pdf), pdf)
    };
    let at = Arrival {
        position: medium.position,
        surface: None,
        mode: vertex.state.mode,
        time: vertex.state.time,
    };
    light_sample(context, vertex, &at, &receiver, phase, out);
    let lobe = first_lobe(context, vertex, || LobeShares::VOLUME);
    out.light_lobe = lobe;
    let (wi, pdf) = medium.phase.sample(forward, vertex.random.pair(dimension::BSDF));
    let mut throughput = vertex.state.throughput;
    let weight = unknown_survival(throughput.max_element() * vertex.state.eta_scale);
    let Some(survival) = survival(context, vertex, weight) else { return };
    throughput *= 1.0 / survival;
    let state = PathState {
        throughput,
        bsdf_pdf: pdf,
        receiver,
        is_specular: false,
        lobe,
        cone_width: medium.footprint,
        cone_spread: vertex.state.cone_spread.max(SCATTERED_SPREAD),
        ..*vertex.state
    };
    out.next.push((Ray::new(medium.position, wi), state));
}
