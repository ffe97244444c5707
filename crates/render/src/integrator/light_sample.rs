//! Light samples with their MIS weights.

use super::Context;
use super::estimators::{
    Arrival, IncidentLight, environment_direction, from_environment, sample_light,
};
use super::light_part::LightSource;
use crate::compile::CompiledLight;
use crate::light_sampler::{ChosenLight, Receiver};
use crate::settings::LightStrategy;
use snell_math::{Ray, SampledSpectrum, Vec2, Vec3, sampling};
use snell_scene::MediumId;
use snell_scene::light::environment::SkySample;

/// A light sample with its MIS weight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedLight {
    /// What the sample contributes to the path if the shadow ray is unoccluded.
    pub value: SampledSpectrum,
    /// The shadow ray; see [`Outputs::light_rays`].
    pub shadow_ray: Ray,
    /// The unit direction to the light.
    pub direction: Vec3,
    /// The source of the light.
    pub source: LightSource,
    /// The MIS weight, which `value` includes.
    pub weight: f32,
    /// The emissive medium that the light comes from; see [`Outputs::glowing`].
    pub glowing: Option<MediumId>,
}

/// Samples a light for a path of this throughput. [`super::path::light_sample`] describes
/// `scattering`.
#[inline]
pub(crate) fn weighted_light(
    context: &Context,
    throughput: SampledSpectrum,
    at: &Arrival,
    receiver: &Receiver,
    u_choice: impl FnOnce() -> f32,
    u: impl FnOnce() -> Vec2,
    scattering: impl Fn(Vec3) -> (SampledSpectrum, f32),
) -> Option<WeightedLight> {
    let chosen = context.lights.sample(receiver, u_choice)?;
    weighted_sample(context, throughput, at, &chosen, u(), scattering)
}

/// Samples a light that was chosen before, like [`weighted_light`].
#[inline]
pub(crate) fn weighted_sample(
    context: &Context,
    throughput: SampledSpectrum,
    at: &Arrival,
    chosen: &ChosenLight,
    u: Vec2,
    scattering: impl Fn(Vec3) -> (SampledSpectrum, f32),
) -> Option<WeightedLight> {
    let drawn = DrawnLight::of(context, at, chosen, u)?;
    let scattered = scattering(drawn.direction());
    drawn.weighted(context, throughput, at, chosen.probability, scattered)
}

/// A light sample whose BSDF value is not known yet.
#[derive(Clone, Copy, Debug)]
pub(crate) enum DrawnLight {
    /// A direction to the environment, without its radiance. Half of the directions lie behind the
    /// surface, and looking up radiance is expensive.
    Environment(SkySample),
    Other(IncidentLight),
}

impl DrawnLight {
    /// Samples a light that was chosen before.
    #[inline]
    pub fn of(context: &Context, at: &Arrival, chosen: &ChosenLight, u: Vec2) -> Option<Self> {
        match &context.scene.lights()[chosen.light] {
            CompiledLight::Environment => {
                environment_direction(context, at.position, u).map(Self::Environment)
            }
            _ => sample_light(context, at, chosen, u).map(Self::Other),
        }
    }

    /// The unit direction to the light.
    pub fn direction(&self) -> Vec3 {
        match self {
            Self::Environment(sample) => sample.direction,
            Self::Other(sample) => sample.direction,
        }
    }

    /// The sample with its contribution to a path of this throughput, given the probability of
    /// choosing the light, and the BSDF value and density for its direction (see
    /// [`super::path::light_sample`]).
    #[inline]
    pub fn weighted(
        self,
        context: &Context,
        throughput: SampledSpectrum,
        at: &Arrival,
        probability: f32,
        (value, pdf): (SampledSpectrum, f32),
    ) -> Option<WeightedLight> {
        if value.is_black() {
            return None;
        }
        let sample = match self {
            Self::Environment(sample) => from_environment(context, at, &sample)?,
            Self::Other(sample) => sample,
        };
        if context.settings.light_strategy == LightStrategy::Bsdf && !sample.is_delta {
            return None;
        }
        let weight = if sample.is_delta || context.settings.light_strategy == LightStrategy::Light {
            1.0
        } else {
            sampling::power_heuristic(sample.pdf * probability, pdf)
        };
        let value = throughput * value * sample.radiance * (weight / (sample.pdf * probability));
        if value.is_black() || !value.is_finite() {
            return None;
        }
        let IncidentLight { shadow_ray, direction, source, glowing, .. } = sample;
        Some(WeightedLight { value, shadow_ray, direction, source, weight, glowing })
    }
}
