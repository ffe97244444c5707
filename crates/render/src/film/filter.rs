//! Reconstruction filters, importance sampled: the offset of a sample from the pixel's centre is
//! distributed like the filter, so that the sample contributes to one pixel only (Ernst, Stamminger
//! and Greiner, Filter importance sampling, 2006).

use crate::named::named;
use snell_math::{DVec2, Vec2, real};
use std::f64::consts::PI;
use std::sync::OnceLock;

named! {
    /// A separable reconstruction filter.
    pub enum Filter {
        /// Constant over the pixel.
        Box = "box",
        /// Triangle of radius 1.
        Tent = "tent",
        /// Gaussian of standard deviation 0.5, cut at radius 1.5.
        Gaussian = "gaussian",
        /// Mitchell and Netravali's cubic (B = C = 1/3), radius 2. Has negative lobes.
        Mitchell = "mitchell",
        /// Blackman-Harris window of radius 1.65.
        BlackmanHarris = "blackman-harris" (default),
        /// Lanczos-windowed sinc of radius 3. Has negative lobes.
        Lanczos = "lanczos",
    }
}

impl Filter {
    /// True if the filter is negative somewhere.
    pub fn has_negative_lobes(self) -> bool {
        matches!(self, Self::Mitchell | Self::Lanczos)
    }

    /// Half of the filter's width in pixels.
    pub fn radius(self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Tent => 1.0,
            Self::Gaussian => 1.5,
            Self::Mitchell => 2.0,
            Self::BlackmanHarris => 1.65,
            Self::Lanczos => 3.0,
        }
    }

    /// The filter at distance `x` from its centre (not normalised).
    pub fn evaluate(self, x: f64) -> f64 {
        let r = self.radius();
        let d = x.abs();
        if d > r {
            return 0.0;
        }
        let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { real::sin(PI * x) / (PI * x) };
        match self {
            Self::Box => 1.0,
            Self::Tent => 1.0 - d,
            Self::Gaussian => {
                let g = |x: f64| real::exp(-x * x / (2.0 * 0.25));
                g(d) - g(r)
            }
            Self::Mitchell => {
                let (b, c) = (1.0 / 3.0, 1.0 / 3.0);
                if d < 1.0 {
                    ((12.0 - 9.0 * b - 6.0 * c) * d * d * d
                        + (-18.0 + 12.0 * b + 6.0 * c) * d * d
                        + (6.0 - 2.0 * b))
                        / 6.0
                } else {
                    ((-b - 6.0 * c) * d * d * d
                        + (6.0 * b + 30.0 * c) * d * d
                        + (-12.0 * b - 48.0 * c) * d
                        + (8.0 * b + 24.0 * c))
                        / 6.0
                }
            }
            Self::BlackmanHarris => {
                let t = PI * (x / r + 1.0);
                0.35875 - 0.48829 * real::cos(t) + 0.14128 * real::cos(2.0 * t)
                    - 0.01168 * real::cos(3.0 * t)
            }
            Self::Lanczos => sinc(x) * sinc(x / r),
        }
    }
}

/// A filter prepared for sampling.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    radius: f64,
    /// The inverse of the cumulative distribution of |f|, at equal steps of probability, multiplied
    /// by the sign of f at that point.
    offsets: Vec<f64>,
    filter: Filter,
    /// The integral of f divided by that of |f|.
    signed_share: f64,
}

impl FilterSampler {
    const STEPS: usize = 1024;
    const RESOLUTION: usize = 1 << 14;

    /// The filter prepared for sampling. It is tabulated once: a render in many short steps would
    /// spend much of their time on it.
    pub fn of(filter: Filter) -> &'static Self {
        static KNOWN: [OnceLock<FilterSampler>; Filter::ALL.len()] =
            [const { OnceLock::new() }; Filter::ALL.len()];
        KNOWN[filter as usize].get_or_init(|| Self::new(filter))
    }

    /// Tabulates a filter for sampling.
    fn new(filter: Filter) -> Self {
        let radius = filter.radius();
        let n = Self::RESOLUTION;
        let position = |i: f64| (i / n as f64 * 2.0 - 1.0) * radius;
        let mut cumulative = vec![0.0; n + 1];
        let mut signed = 0.0;
        for i in 0..n {
            let value = filter.evaluate(position(i as f64 + 0.5));
            cumulative[i + 1] = cumulative[i] + value.abs();
            signed += value;
        }
        let total = cumulative[n];
        let signed_share = if filter.has_negative_lobes() { signed / total } else { 1.0 };
        let offsets = (0..=Self::STEPS)
            .map(|k| {
                let target = total * k as f64 / Self::STEPS as f64;
                let i = cumulative.partition_point(|&c| c < target).clamp(1, n);
                let piece = cumulative[i] - cumulative[i - 1];
                let part = if piece > 0.0 { (target - cumulative[i - 1]) / piece } else { 0.0 };
                position(i as f64 - 1.0 + part)
            })
            .collect();
        Self { radius, offsets, filter, signed_share }
    }

    /// Samples the displacement from the pixel's centre, in pixels, and the sample's weight: 1, or
    /// -1 in a negative lobe.
    pub fn sample(&self, u: Vec2) -> (DVec2, f32) {
        let (x, wx) = self.sample_axis(u.x);
        let (y, wy) = self.sample_axis(u.y);
        (DVec2::new(x, y), wx * wy)
    }

    /// Expected weight of a sample: 1, or less if the filter has negative lobes.
    pub fn mean_weight(&self) -> f64 {
        self.signed_share * self.signed_share
    }

    fn sample_axis(&self, u: f32) -> (f64, f32) {
        if self.filter == Filter::Box {
            return (f64::from(u) - 0.5, 1.0);
        }
        let p = f64::from(u) * Self::STEPS as f64;
        let i = (p as usize).min(Self::STEPS - 1);
        let x = self.offsets[i] + (self.offsets[i + 1] - self.offsets[i]) * (p - i as f64);
        if !self.filter.has_negative_lobes() {
            return (x, 1.0);
        }
        let sign =
            if self.filter.evaluate(x.clamp(-self.radius, self.radius)) < 0.0 { -1.0 } else { 1.0 };
        (x, sign)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_reproduce_the_moments_of_each_filter() {
        for filter in Filter::ALL {
            let sampler = FilterSampler::new(filter);
            let n = 20_000;
            let (mut weight, mut second, mut first) = (0.0, 0.0, 0.0);
            for i in 0..n {
                let (x, w) = sampler.sample_axis((i as f32 + 0.5) / n as f32);
                weight += f64::from(w);
                first += f64::from(w) * x;
                second += f64::from(w) * x * x;
            }
            let r = filter.radius();
            let (mut area, mut moment) = (0.0, 0.0);
            for i in 0..n {
                let x = ((i as f64 + 0.5) / f64::from(n) * 2.0 - 1.0) * r;
                area += filter.evaluate(x);
                moment += filter.evaluate(x) * x * x;
            }
            assert!((first / weight).abs() < 1e-3, "{filter:?} is symmetric");
            assert!(
                (second / weight - moment / area).abs() < 0.01,
                "{filter:?}: {} {}",
                second / weight,
                moment / area
            );
        }
    }
}
