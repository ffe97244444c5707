//! Computes, for the vertices of a batch on surfaces or in media, the direct light and the next
//! rays of their paths.

use super::lights::{ALONE, LightArrivals, LightSamples};
use super::vertices::{
    CarriedColumns, CarriedLanes, MarkLanes, RayColumns, Roulette, UNMARKED, VertexLanes,
};
use crate::integrator::carried::{Expected, Marks};
use crate::integrator::light_sample::WeightedLight;
use crate::integrator::path::SCATTERED_SPREAD;
use crate::integrator::roulette::unknown_survival;
use crate::lanes::{BLACK, HitColors, LANES, NOUGHTS, color_at, put_color};
use crate::light_sampler::ChosenLight;
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::max;
use snell_math::{SampledSpectrum, Vec2};
use snell_scene::MediumId;

/// The light samples of the vertices and their contributions. Arrays have an entry for each lane.
#[derive(Debug)]
pub struct DirectLight {
    pub lights: LightSamples,
    pub arrivals: LightArrivals,
    /// The glowing medium of each lane; see [`crate::integrator::Outputs::glowing`].
    pub glowing: [Option<MediumId>; LANES],
    pub outputs: VertexOutputs,
}

/// The outputs of vertices of the integrators `path` and `direct`, by lane.
#[derive(Debug)]
pub struct VertexOutputs {
    /// By channel, what the light contributes to the sample if the light ray is unoccluded.
    pub brought: HitColors,
    /// 0 in lanes without a light ray.
    pub has_light_ray: [u32; LANES],
    /// By channel, the path's throughput along the next ray.
    pub throughput: HitColors,
    /// See [`crate::integrator::carried::Carried`] for this field and the next.
    pub cone_spread: HitLanes,
    pub marks: MarkLanes,
    /// 1 where the path continues, 0 where it ends.
    pub goes_on: [u32; LANES],
}

impl Default for DirectLight {
    fn default() -> Self {
        Self {
            lights: LightSamples::default(),
            arrivals: LightArrivals::default(),
            glowing: [None; LANES],
            outputs: VertexOutputs {
                brought: BLACK,
                has_light_ray: [0; LANES],
                throughput: BLACK,
                cone_spread: NOUGHTS,
                marks: UNMARKED,
                goes_on: [0; LANES],
            },
        }
    }
}

impl VertexOutputs {
    /// Computes what the light of a lane contributes, given the BSDF times the cosine
    /// (`scattered`).
    #[inline(always)]
    pub fn bring<const CHANNELS: usize>(
        &mut self,
        lane: usize,
        carried: &CarriedLanes,
        scattered: [f32; CHANNELS],
        radiance: &HitColors,
        arrivals: &LightArrivals,
    ) {
        let scale = arrivals.scale[lane];
        let (mut is_bright, mut is_finite) = (false, true);
        for (channel, scattered) in scattered.into_iter().enumerate() {
            let value =
                carried.throughput[channel][lane] * scattered * radiance[channel][lane] * scale;
            self.brought[channel][lane] = value;
            is_bright |= value != 0.0;
            is_finite &= value.abs() < f32::INFINITY;
        }
        self.has_light_ray[lane] = u32::from((arrivals.exists[lane] != 0) & is_bright & is_finite);
    }

    /// Records the spread and marks of the path of a lane for its next ray. `is_delta` says that a
    /// delta lobe scattered it.
    #[inline(always)]
    pub fn mark(
        &mut self,
        lane: usize,
        carried: &CarriedLanes,
        expected: Expected,
        transmits: bool,
        is_delta: bool,
    ) {
        let before = carried.cone_spread[lane];
        self.cone_spread[lane] = if is_delta { before } else { max(before, SCATTERED_SPREAD) };
        let is_specular = is_delta & carried.marks[lane].is_specular();
        self.marks[lane] = Marks::new(expected, transmits, is_specular);
    }

    /// Decides whether the path of a lane continues in its sampled direction: if `exists` is true
    /// and the path survives Russian roulette. Roulette uses `survival`, or without it the
    /// throughput. `weight` is the factor on the throughput.
    #[inline(always)]
    pub fn go_on<const CHANNELS: usize>(
        &mut self,
        lane: usize,
        carried: &CarriedLanes,
        (weight, eta_scale): ([f32; CHANNELS], &HitLanes),
        survival: Option<&HitLanes>,
        roulette: &Roulette,
        exists: bool,
    ) {
        let (mut throughput, mut largest, mut is_finite) = ([0.0; CHANNELS], 0.0, true);
        for (channel, throughput) in throughput.iter_mut().enumerate() {
            *throughput = carried.throughput[channel][lane] * weight[channel];
            largest = max(largest, *throughput);
            is_finite &= throughput.abs() < f32::INFINITY;
        }
        let weight = match survival {
            Some(survival) => survival[lane],
            None => unknown_survival(largest * eta_scale[lane]),
        };
        let (scale, survives) = roulette.survival(lane, weight);
        for (channel, throughput) in throughput.into_iter().enumerate() {
            self.throughput[channel][lane] = throughput * scale;
        }
        self.goes_on[lane] = u32::from(exists & (largest > 0.0) & is_finite & survives);
    }
}

impl DirectLight {
    /// The rays from the vertices to the light samples.
    pub fn light_rays(&self) -> RayColumns<'_> {
        self.arrivals.shadow_rays()
    }

    /// What the light of a lane contributes if the light ray is unoccluded.
    #[inline(always)]
    pub fn brought(&self, lane: usize) -> SampledSpectrum {
        color_at(&self.outputs.brought, lane % LANES)
    }

    /// What the paths carry along their next rays. The arguments are the values that are not stored
    /// in `self`.
    pub fn carried<'a>(
        &'a self,
        lanes: &'a VertexLanes,
        eta_scale: &'a HitLanes,
        bsdf_pdf: &'a HitLanes,
        normal: &'a HitVectors,
    ) -> CarriedColumns<'a> {
        let VertexOutputs { throughput, cone_spread, marks, .. } = &self.outputs;
        let (cone_width, position) = (&lanes.carried.cone_width, &lanes.points.position);
        CarriedColumns {
            throughput,
            eta_scale,
            cone_width,
            cone_spread,
            marks,
            position,
            bsdf_pdf,
            normal,
        }
    }

    /// Samples lights for the first `count` lanes by calling `sample` with the random numbers `u`,
    /// where [`LightSamples`] does not handle the chosen light.
    pub fn sample_alone(
        &mut self,
        count: usize,
        u: &[HitLanes; 2],
        sample: impl Fn(usize, &ChosenLight, Vec2) -> Option<WeightedLight>,
    ) {
        for (lane, (&x, &y)) in u[0].iter().zip(&u[1]).enumerate().take(count) {
            if self.lights.how[lane] == ALONE
                && let Some(chosen) = self.lights.chosen.get(lane)
            {
                self.put_alone(lane, sample(lane, &chosen, Vec2::new(x, y)));
            }
        }
    }

    /// Stores the light sample of a lane that [`LightSamples`] does not handle.
    pub fn put_alone(&mut self, lane: usize, light: Option<WeightedLight>) {
        self.outputs.has_light_ray[lane] = u32::from(light.is_some());
        if let Some(WeightedLight { value, shadow_ray, source, weight, glowing, .. }) = light {
            self.glowing[lane] = glowing;
            put_color(&mut self.outputs.brought, lane, value);
            self.arrivals.put(lane, &shadow_ray, weight);
            self.lights.note_alone(lane, source);
        }
    }
}
