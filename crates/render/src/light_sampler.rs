//! Which light is sampled.

use snell_math::distribution::Distribution1D;

/// How a light is chosen among many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSamplerKind {
    /// Each with the same probability.
    Uniform,
    /// In proportion to emitted power.
    #[default]
    Power,
}

impl LightSamplerKind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Uniform, Self::Power];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Power => "power",
        }
    }
}

/// Chooses among the lights of a scene.
#[derive(Debug)]
pub struct LightSampler {
    distribution: Option<Distribution1D>,
}

impl LightSampler {
    /// A sampler over lights of these powers. A light of no power is never chosen by power, unless all have none. The light
    /// `left_out` is not chosen if there is another.
    pub fn new(kind: LightSamplerKind, powers: &[f64], left_out: Option<usize>) -> Self {
        let power = |i: usize| if left_out == Some(i) { 0.0 } else { powers[i] };
        // Relative to the strongest: the powers of huge and tiny scenes do not fit in single precision.
        let strongest = (0..powers.len()).map(power).fold(0.0, f64::max);
        let weight = |i: usize| match kind {
            LightSamplerKind::Uniform => f32::from(left_out != Some(i)),
            LightSamplerKind::Power => (power(i) / strongest) as f32,
        };
        let weights: Vec<f32> = (0..powers.len()).map(weight).collect();
        Self { distribution: (!powers.is_empty()).then(|| Distribution1D::new(&weights)) }
    }

    /// A light and the probability of choosing it; `None` without lights. `u` is asked for a uniform number if there is a choice.
    pub fn sample(&self, u: impl FnOnce() -> f32) -> Option<(usize, f32)> {
        let distribution = self.distribution.as_ref()?;
        if distribution.len() == 1 {
            return Some((0, 1.0));
        }
        let (light, _) = distribution.sample(u());
        Some((light, distribution.probability(light)))
    }

    /// The probability of choosing this light.
    pub fn probability(&self, light: usize) -> f32 {
        self.distribution.as_ref().map_or(0.0, |d| d.probability(light))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_of_power_does_not_matter() {
        for scale in [1e-60, 1.0, 1e60] {
            let sampler = LightSampler::new(LightSamplerKind::Power, &[scale, 3.0 * scale, 0.0], None);
            assert_eq!([0, 1, 2].map(|light| sampler.probability(light)), [0.25, 0.75, 0.0]);
        }
    }

    #[test]
    fn lights_without_power_are_chosen_among_themselves() {
        let sampler = LightSampler::new(LightSamplerKind::Power, &[0.0, 0.0], None);
        assert_eq!(sampler.probability(1), 0.5);
        assert!(LightSampler::new(LightSamplerKind::Power, &[], None).sample(|| 0.5).is_none());
    }

    #[test]
    fn a_light_that_is_left_out_takes_no_samples_from_the_others() {
        for kind in LightSamplerKind::ALL {
            let sampler = LightSampler::new(kind, &[2.0, 2.0, 1000.0], Some(2));
            assert_eq!([0, 1, 2].map(|light| sampler.probability(light)), [0.5, 0.5, 0.0], "{kind:?}");
        }
    }
}
