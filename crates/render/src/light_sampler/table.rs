//! A choice among lights that does not depend on the receiver.

use super::ChosenLight;
use snell_math::distribution::Distribution1D;

/// A table of the probabilities of lights.
#[derive(Debug)]
pub struct LightTable {
    distribution: Option<Distribution1D>,
}

impl LightTable {
    /// A table with these weights (finite, not negative); it chooses no light if all weights are 0.
    pub fn new(weights: &[f64]) -> Self {
        // Weights are taken relative to the strongest, because the powers of huge and tiny scenes
        // do not fit in single precision.
        let strongest = weights.iter().copied().fold(0.0, f64::max);
        let relative: Vec<f32> = weights.iter().map(|w| (w / strongest) as f32).collect();
        Self { distribution: (strongest > 0.0).then(|| Distribution1D::new(&relative)) }
    }

    /// Samples a light. `u` returns a uniform number and is called only if there is more than one
    /// light.
    pub fn sample(&self, u: impl FnOnce() -> f32) -> Option<ChosenLight> {
        let distribution = self.distribution.as_ref()?;
        let light = if distribution.len() == 1 { 0 } else { distribution.sample(u()).0 };
        Some(ChosenLight { light, part: None, probability: distribution.probability(light) })
    }

    /// The probability of choosing a light.
    pub fn probability(&self, light: usize) -> f32 {
        self.distribution.as_ref().map_or(0.0, |d| d.probability(light))
    }
}
