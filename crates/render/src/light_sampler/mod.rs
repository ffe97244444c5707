//! Which light is sampled: from a table, the same everywhere ([`table`]), or from a tree that knows
//! where the receiving point is ([`bvh`]).

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

use snell_math::Vec3;
use snell_math::simd::Wide;
use snell_scene::light::LightBounds;

/// How a light is chosen among many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSamplerKind {
    /// Each with the same probability.
    Uniform,
    /// In proportion to emitted power.
    Power,
    /// By what it may bring to the point that receives light: power, distance and angles, by a tree
    /// over all lights and all triangles of emissive surfaces.
    #[default]
    Bvh,
}

impl LightSamplerKind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Uniform, Self::Power, Self::Bvh];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Power => "power",
            Self::Bvh => "bvh",
        }
    }
}

/// The point that receives light: what the choice of a light may depend on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Receiver {
    /// Where.
    pub position: Vec3,
    /// Unit shading normal on the side of the viewer; zero inside a medium, which receives light
    /// from everywhere.
    pub normal: Vec3,
    /// True if light from behind the normal counts too.
    pub transmits: bool,
}

/// A chosen light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChosenLight {
    /// Position among the lights of the scene.
    pub light: usize,
    /// The part of an emissive surface, if that was chosen too.
    pub part: Option<u32>,
    /// Probability of the choice.
    pub probability: f32,
}

/// One light as the samplers see it.
#[derive(Clone, Debug, PartialEq)]
pub struct LightSummary {
    /// Approximate power, W. Finite, not negative.
    pub power: f64,
    /// Bounds of its parts, in order; empty if it has no place or does not fade with the square of
    /// the distance.
    pub parts: Vec<LightBounds>,
    /// False for lights that are left to BSDF samples.
    pub is_sampled: bool,
}

/// Chooses among the lights of a scene. Immutable; a pure function of its arguments.
#[derive(Debug)]
pub enum LightSampler {
    /// The same choice everywhere.
    Table(LightTable),
    /// By what lights may bring to the receiver.
    Bvh(LightBvh),
}

impl LightSampler {
    /// A sampler over these lights. `wide` allows wide registers.
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

    /// False if no number is needed for choosing.
    pub fn has_choice(&self) -> bool {
        match self {
            Self::Table(_) => true,
            Self::Bvh(bvh) => bvh.has_choice(),
        }
    }

    /// Samples a light; `None` if none can light the receiver. `u` is called for a uniform number
    /// if there is a choice.
    pub fn sample(&self, receiver: &Receiver, u: impl FnOnce() -> f32) -> Option<ChosenLight> {
        match self {
            Self::Table(table) => table.sample(u),
            Self::Bvh(bvh) => bvh.sample(receiver, u),
        }
    }

    /// [`Self::sample`] for the given number of first receivers; further entries are arbitrary.
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

    /// The probability of choosing this part of a light, where `part` is its number and its
    /// probability if only the light is chosen.
    pub fn probability(&self, receiver: &Receiver, light: usize, part: (u32, f32)) -> f32 {
        match self {
            Self::Table(table) => table.probability(light) * part.1,
            Self::Bvh(bvh) => bvh.probability(receiver, light, part.0),
        }
    }
}
