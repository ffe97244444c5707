//! The wavelengths that a path carries.

use super::LANES;
use super::cie::{LAMBDA_COUNT, LAMBDA_MAX, LAMBDA_MIN};
use crate::exponentials::{exp, ln};
use crate::simd::{max, min};

/// The wavelengths of a path's lanes: a *hero* wavelength and three that follow at equal distances
/// in the distribution, so that together they cover the visible range (Wilkie et al., Hero
/// Wavelength Spectral Sampling, EGSR 2014).
///
/// They are sampled roughly in proportion to the sensitivity of the eye, from the density of
/// Radziszewski et al. (An improved technique for full spectral rendering, 2009) with the
/// parameters of pbrt-v4: `sech^2(0.0072 (lambda - 538 nm))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledWavelengths {
    /// Wavelengths in vacuum, in nm. The first is the hero's.
    lambda: [f32; LANES],
    /// True if the wavelengths were separated, so that only the hero's lane carries light.
    hero_only: bool,
}

/// Steepness of the density in 1/nm.
const STEEPNESS: f32 = 0.0072;
/// The wavelength at which the density has its maximum, in nm.
const PEAK: f32 = 538.0;
/// `tanh(STEEPNESS (PEAK - LAMBDA_MIN))`.
const TANH_MIN: f32 = 0.856_910_6;
/// The sum of [`TANH_MIN`] and `tanh(STEEPNESS (LAMBDA_MAX - PEAK))`.
const TANH_RANGE: f32 = 1.827_495;

/// `e^x` and `e^-x` at each whole nm, where `x` is twice the argument of the density.
static EXPONENTIALS: [[f64; 2]; LAMBDA_COUNT] = {
    let mut all = [[0.0; 2]; LAMBDA_COUNT];
    let mut i = 0;
    while i < LAMBDA_COUNT {
        let x = 2.0 * STEEPNESS as f64 * (LAMBDA_MIN as f64 + i as f64 - PEAK as f64);
        all[i] = [series(x), series(-x)];
        i += 1;
    }
    all
};

/// `e^x` for small `x`, at compile time: the 16th power of the Taylor series of `e^(x/16)`.
const fn series(x: f64) -> f64 {
    let (x, mut sum, mut term, mut n) = (x / 16.0, 1.0, 1.0, 1);
    while n < 20 {
        term *= x / n as f64;
        sum += term;
        n += 1;
    }
    let mut squared = 0;
    while squared < 4 {
        sum *= sum;
        squared += 1;
    }
    sum
}

impl SampledWavelengths {
    /// The wavelengths for a uniform number `u` in `[0, 1)`.
    #[inline(always)]
    pub fn sample(u: f32) -> Self {
        let mut lambda = [0.0; LANES];
        for (lane, lambda) in lambda.iter_mut().enumerate() {
            let u = u + lane as f32 / LANES as f32;
            *lambda = wavelength(if u < 1.0 { u } else { u - 1.0 });
        }
        Self { lambda, hero_only: false }
    }

    /// The wavelengths of the lanes in nm; the first is the hero's.
    #[inline]
    pub fn lambda(&self) -> [f32; LANES] {
        self.lambda
    }

    /// Density per nm with which [`Self::sample`] chooses a wavelength.
    #[inline(always)]
    pub fn pdf(lambda: f32) -> f32 {
        // `e + 2 + 1 / e` is the square of twice the hyperbolic cosine.
        let e = exp(2.0 * f64::from(STEEPNESS * (lambda - PEAK)));
        (4.0 * f64::from(STEEPNESS) / (f64::from(TANH_RANGE) * (e + 2.0 + 1.0 / e))) as f32
    }

    /// The reciprocal of [`Self::pdf`] at the wavelength `whole + rest` nm above [`LAMBDA_MIN`],
    /// computed without an exponential.
    #[inline(always)]
    pub(super) fn inverse_pdf(whole: usize, rest: f32) -> f32 {
        const FACTOR: f64 = TANH_RANGE as f64 / (4.0 * STEEPNESS as f64);
        let x = 2.0 * f64::from(STEEPNESS) * f64::from(rest);
        // Taylor series, with an argument below 0.0145 and a remainder below 1e-14.
        let (even, odd) = (
            1.0 + x * x * (0.5 + x * x * (1.0 / 24.0)),
            x * (1.0 + x * x * (1.0 / 6.0 + x * x * (1.0 / 120.0))),
        );
        let [growth, decay] = EXPONENTIALS[whole.min(LAMBDA_COUNT - 1)];
        (FACTOR * (growth * (even + odd) + 2.0 + decay * (even - odd))) as f32
    }

    /// True if only the hero's lane carries light.
    #[inline]
    pub fn is_hero_only(&self) -> bool {
        self.hero_only
    }

    /// The same wavelengths after an event that separates them, so that only the hero's remains.
    #[inline]
    pub fn hero_only(self) -> Self {
        Self { hero_only: true, ..self }
    }
}

/// The wavelength at which the distribution function has the value `u`.
#[inline(always)]
fn wavelength(u: f32) -> f32 {
    let tanh = f64::from(TANH_MIN) - f64::from(TANH_RANGE) * f64::from(u);
    // The logarithm is the inverse hyperbolic tangent, times 2.
    let lambda = f64::from(PEAK) - ln((1.0 + tanh) / (1.0 - tanh)) * (0.5 / f64::from(STEEPNESS));
    min(max(lambda as f32, LAMBDA_MIN), LAMBDA_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_of_the_density_is_that() {
        for i in 0..10_000 {
            let lambda = LAMBDA_MIN + (LAMBDA_MAX - LAMBDA_MIN) * (i as f32 / 1e4);
            let whole = lambda - LAMBDA_MIN;
            let found =
                SampledWavelengths::inverse_pdf(whole as usize, whole - (whole as usize) as f32);
            let product = f64::from(found) * f64::from(SampledWavelengths::pdf(lambda));
            assert!((product - 1.0).abs() < 1e-6, "{lambda} {product}");
        }
    }

    #[test]
    fn wavelengths_follow_their_density_and_cover_the_visible_range() {
        // The density integrated up to a wavelength must be the distribution function there.
        let n = 4000;
        let step = (LAMBDA_MAX - LAMBDA_MIN) / n as f32;
        let (mut sum, mut at) = (0.0, Vec::new());
        for i in 0..n {
            at.push((LAMBDA_MIN + step * i as f32, sum));
            sum += SampledWavelengths::pdf(LAMBDA_MIN + step * (i as f32 + 0.5)) * step;
        }
        assert!((sum - 1.0).abs() < 1e-4, "{sum}");
        for &(lambda, u) in at.iter().skip(1).step_by(97) {
            let hero = SampledWavelengths::sample(u).lambda()[0];
            assert!((hero - lambda).abs() < 0.2, "{hero} {lambda}");
        }
    }

    #[test]
    fn lanes_are_a_quarter_of_the_distribution_apart() {
        let a = SampledWavelengths::sample(0.1).lambda();
        let b = SampledWavelengths::sample(0.35).lambda();
        assert!((0..3).all(|i| (a[i + 1] - b[i]).abs() < 0.01) && (b[3] - a[0]).abs() < 0.01);
        let ends = [SampledWavelengths::sample(0.0), SampledWavelengths::sample(0.999_999_94)];
        assert!(
            ends.iter().all(|w| w.lambda().iter().all(|l| (LAMBDA_MIN..=LAMBDA_MAX).contains(l)))
        );
    }
}
