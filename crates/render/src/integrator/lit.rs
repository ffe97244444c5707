//! What lights bring to vertices that are worked on together, and where their paths go on: the same for surfaces and points of media.

use super::lanes::{LANES, ZERO, put_color};
use super::lights::{FlatArrivals, FlatLights};
use super::path::WeightedLight;
use snell_intersect::triangles::HitVectors;
use snell_scene::MediumId;

/// The lights of vertices and what comes of them, by lane.
#[derive(Debug)]
pub struct LitLanes {
    pub lights: FlatLights,
    pub arrivals: FlatArrivals,
    /// As [`super::Outputs::glowing`].
    pub glowing: [Option<MediumId>; LANES],
    pub outputs: LitOutputs,
}

/// What the vertices of `path` or `direct` give.
#[derive(Debug)]
pub struct LitOutputs {
    /// By channel, what the light brings if its ray is free.
    pub brought: HitVectors,
    /// 0 where no light ray is sent.
    pub is_lit: [u32; LANES],
    /// By channel, the throughput of the next ray.
    pub throughput: HitVectors,
    /// 0 where the path ends.
    pub goes_on: [u32; LANES],
}

impl Default for LitLanes {
    fn default() -> Self {
        Self {
            lights: FlatLights::default(),
            arrivals: FlatArrivals::default(),
            glowing: [None; LANES],
            outputs: LitOutputs { brought: ZERO, is_lit: [0; LANES], throughput: ZERO, goes_on: [0; LANES] },
        }
    }
}

impl LitLanes {
    /// Takes a light sample of a lane that is not one of [`FlatLights`].
    pub fn put_alone(&mut self, lane: usize, light: Option<WeightedLight>) {
        self.outputs.is_lit[lane] = u32::from(light.is_some());
        if let Some(WeightedLight { value, shadow_ray, source, weight, glowing, .. }) = light {
            self.glowing[lane] = glowing;
            put_color(&mut self.outputs.brought, lane, value);
            self.arrivals.put(lane, &shadow_ray, weight);
            self.lights.note_alone(lane, source);
        }
    }
}
