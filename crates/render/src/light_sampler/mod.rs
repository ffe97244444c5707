//! The choice of the light to sample: from a table that is the same everywhere ([`table`]), or from
//! a tree that takes the receiving point into account ([`bvh`]).

mod batch;
mod build;
mod bvh;
mod cone;
mod table;
#[cfg(test)]
mod tests;

pub use batch::{BATCH, ChosenLights, Receivers};
pub use bvh::{LightBvh, NONE};
pub use table::LightTable;

use crate::named::named;
use snell_math::Vec3;
use snell_math::simd::Wide;
use snell_scene::light::LightBounds;

named! {
    /// How a light is chosen among many.
    pub enum LightSamplerKind {
        /// Each light has the same probability.
        Uniform = "uniform",
        /// Each light has a probability in proportion to its emitted power.
        Power = "power",
        /// Each light has a probability in proportion to its estimated contribution to the point
        /// that receives light: from power, distance and angles, with a tree over all lights and
        /// all triangles of emissive surfaces.
        Bvh = "bvh" (default),
    }
}

/// A point that receives light, with the data that the choice of a light may depend on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Receiver {
    /// The point in the world.
    pub position: Vec3,
    /// Unit shading normal on the side of the viewer. Zero inside a medium, where light is received
    /// from everywhere.
    pub normal: Vec3,
    /// True if light from behind the normal counts too.
    pub transmits: bool,
}

/// A light that was chosen, with its probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChosenLight {
    /// Position among the lights of the scene.
    pub light: usize,
    /// The part of an emissive surface, if the sampler has chosen one too.
    pub part: Option<u32>,
    /// Probability of choosing the light, and the part if there is one.
    pub probability: f32,
}

/// One light as the samplers see it.
#[derive(Clone, Debug, PartialEq)]
pub struct LightSummary {
    /// Approximate power in W, finite and not negative.
    pub power: f64,
    /// Bounds of the light's parts, in order. Empty if the light has no place, or does not fade
    /// with the square of the distance.
    pub parts: Vec<LightBounds>,
    /// False for lights that are left to BSDF samples.
    pub is_sampled: bool,
}

/// Chooses among the lights of a scene. It is immutable, and its methods are pure functions of
/// their arguments.
#[derive(Debug)]
pub enum LightSampler {
    /// Chooses with the same probabilities everywhere.
    Table(LightTable),
    /// Chooses by the estimated contribution to the receiver.
    Bvh(LightBvh),
}

impl LightSampler {
    /// A sampler of these lights. `wide` are the instructions that it may use.
    pub fn new(kind: LightSamplerKind, lights: &[LightSummary], wide: Option<Wide>) -> Self {
        let powers = |light: &LightSummary| if light.is_sampled { light.power } else { 0.0 };
        match kind {
            LightSamplerKind::Uniform => {
                let weights: Vec<f64> =
                    lights.iter().map(|l| f64::from(u8::from(l.is_sampled))).collect();
                Self::Table(LightTable::new(&weights))
            }
            LightSamplerKind::Power => {
                let mut weights: Vec<f64> = lights.iter().map(powers).collect();
                if weights.iter().all(|&w| w == 0.0) {
                    weights = lights.iter().map(|l| f64::from(u8::from(l.is_sampled))).collect();
                }
                Self::Table(LightTable::new(&weights))
            }
            LightSamplerKind::Bvh => Self::Bvh(LightBvh::new(lights, wide)),
        }
    }

    /// True if [`Self::sample`] may need a random number. A tree over at most one light needs none.
    pub fn has_choice(&self) -> bool {
        match self {
            Self::Table(_) => true,
            Self::Bvh(bvh) => bvh.has_choice(),
        }
    }

    /// Samples a light; `None` if none can light the receiver. `u` returns a uniform number and is
    /// called only if there is a choice.
    pub fn sample(&self, receiver: &Receiver, u: impl FnOnce() -> f32) -> Option<ChosenLight> {
        match self {
            Self::Table(table) => table.sample(u),
            Self::Bvh(bvh) => bvh.sample(receiver, u),
        }
    }

    /// [`Self::sample`] for the first `count` receivers; further entries are arbitrary.
    pub fn sample_batch(
        &self,
        receivers: &Receivers,
        u: &[f32; BATCH],
        count: usize,
        chosen: &mut ChosenLights,
    ) {
        match self {
            Self::Table(table) => (0..count).for_each(|i| chosen.put(i, table.sample(|| u[i]))),
            Self::Bvh(bvh) => bvh.sample_batch(receivers, u, count, chosen),
        }
    }

    /// The probability of choosing this part of a light. `part` is the number of the part, and the
    /// probability with which it is chosen afterwards if the sampler chooses only the light.
    pub fn probability(&self, receiver: &Receiver, light: usize, part: (u32, f32)) -> f32 {
        match self {
            Self::Table(table) => table.probability(light) * part.1,
            Self::Bvh(bvh) => bvh.probability(receiver, light, part.0),
        }
    }
}
