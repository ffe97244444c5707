//! Samplers: pure functions from (seed, pixel, sample, dimension) to numbers in `[0, 1)`.
//!
//! A *dimension* is what the number is for (lens, light, BSDF at the third bounce …); [`Random`] binds the rest. Nothing depends on
//! the order of calls, so batching, threads and splitting cannot change a number.

mod sobol;
mod stratified;

use snell_math::{Vec2, rng};

/// Which sampler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SamplerKind {
    /// Independent uniform numbers.
    Independent,
    /// Jittered strata, one sample in each (Cook, 1986), with strata permuted between dimensions.
    Stratified,
    /// Owen-scrambled Sobol points, padded by two dimensions at a time (Burley, Practical hash-based Owen scrambling, JCGT 2020).
    #[default]
    Sobol,
}

impl SamplerKind {
    /// All samplers.
    pub const ALL: [Self; 3] = [Self::Independent, Self::Stratified, Self::Sobol];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Independent => "independent",
            Self::Stratified => "stratified",
            Self::Sobol => "sobol",
        }
    }
}

/// A sampler for one render.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    kind: SamplerKind,
    seed: u32,
    spp: u32,
}

impl Sampler {
    /// The sampler of a render with `spp` samples per pixel.
    pub fn new(kind: SamplerKind, seed: u32, spp: u32) -> Self {
        Self { kind, seed, spp: spp.max(1) }
    }

    /// Numbers for a sample of a pixel (coordinates in the whole picture).
    pub fn random(&self, pixel: [u32; 2], sample: u32) -> Random {
        let key = rng::hash_combine(rng::hash_combine(self.seed, pixel[0]), pixel[1]);
        Random { sampler: *self, pixel: key, sample, base: 0 }
    }

    fn number(&self, pixel: u32, sample: u32, dimension: u32) -> f32 {
        let key = rng::hash_combine(pixel, dimension);
        match self.kind {
            SamplerKind::Sobol => sobol::number(key, sample),
            _ => self.point(pixel, sample, dimension).x,
        }
    }

    fn point(&self, pixel: u32, sample: u32, dimension: u32) -> Vec2 {
        let key = rng::hash_combine(pixel, dimension);
        match self.kind {
            SamplerKind::Independent => rng::uniform2([key, sample, pixel, dimension]),
            SamplerKind::Stratified => stratified::point(key, sample, self.spp),
            SamplerKind::Sobol => sobol::point(key, sample),
        }
    }
}

/// The numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Random {
    sampler: Sampler,
    pixel: u32,
    sample: u32,
    base: u32,
}

impl Random {
    /// The numbers of a vertex: each (`stream`, `depth`) has dimensions of its own.
    pub fn at_vertex(self, stream: u32, depth: u32) -> Self {
        let base = if stream == 0 { (depth + 1) << 8 } else { rng::hash_combine(stream, depth) << 8 };
        Self { base, ..self }
    }

    /// A well-distributed pair for a dimension below 256.
    pub fn pair(&self, dimension: u32) -> Vec2 {
        self.sampler.point(self.pixel, self.sample, self.base + dimension)
    }

    /// The pair of number `step` of a sequence of independent pairs: where nobody knows how many it takes.
    pub fn independent_pair(&self, step: u32) -> Vec2 {
        rng::uniform2([self.pixel, self.sample, rng::hash32(self.base), step])
    }

    /// A well-distributed number for a dimension below 256.
    pub fn number(&self, dimension: u32) -> f32 {
        self.sampler.number(self.pixel, self.sample, self.base + dimension)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrates over the unit square with `spp` samples in each of many pixels; returns mean and variance of the estimates.
    fn estimate(kind: SamplerKind, spp: u32, dimension: u32, f: impl Fn(Vec2) -> f32) -> (f64, f64) {
        let sampler = Sampler::new(kind, 1, spp);
        let pixels = 2000;
        let estimates: Vec<f64> = (0..pixels)
            .map(|x| {
                let sum: f64 =
                    (0..spp).map(|s| f64::from(f(sampler.random([x, 3], s).at_vertex(0, 2).pair(dimension)))).sum();
                sum / f64::from(spp)
            })
            .collect();
        let mean = estimates.iter().sum::<f64>() / f64::from(pixels);
        (mean, estimates.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / f64::from(pixels))
    }

    #[test]
    fn every_sampler_is_unbiased_and_the_good_ones_converge_faster() {
        // A quarter disk (area pi / 4) and a smooth product (mean 1 / 4).
        let disk = |u: Vec2| f32::from(u.length_squared() < 1.0);
        let smooth = |u: Vec2| u.x * u.y;
        let mut variances = Vec::new();
        for kind in SamplerKind::ALL {
            for dimension in [0, 1, 7] {
                let (mean, variance) = estimate(kind, 16, dimension, disk);
                let error = (variance / 2000.0).sqrt();
                assert!((mean - std::f64::consts::FRAC_PI_4).abs() < 4.0 * error, "{kind:?}: {mean} +- {error}");
            }
            let (mean, variance) = estimate(kind, 16, 3, smooth);
            assert!((mean - 0.25).abs() < 4.0 * (variance / 2000.0).sqrt(), "{kind:?}: {mean}");
            variances.push(variance);
        }
        let [independent, stratified, sobol] = variances[..] else { panic!("three samplers") };
        assert!(stratified < 0.25 * independent && sobol < 0.1 * independent, "{variances:?}");
    }

    #[test]
    fn dimensions_are_uncorrelated() {
        for kind in SamplerKind::ALL {
            let sampler = Sampler::new(kind, 9, 64);
            let mut covariance = 0.0f64;
            for x in 0..500 {
                for s in 0..64 {
                    let r = sampler.random([x, 8], s);
                    let (a, b) = (r.at_vertex(0, 0).number(1), r.at_vertex(0, 1).number(1));
                    covariance += f64::from((a - 0.5) * (b - 0.5));
                }
            }
            // Standard error is (1 / 12) / sqrt(32000) = 0.0005.
            assert!((covariance / 32000.0).abs() < 0.002, "{kind:?}: {covariance}");
        }
    }

    #[test]
    fn stratified_samples_fill_each_stratum_once() {
        let sampler = Sampler::new(SamplerKind::Stratified, 5, 16);
        let mut seen = [0; 16];
        for s in 0..16 {
            let u = sampler.random([4, 4], s).pair(2) * 4.0;
            seen[u.y as usize * 4 + u.x as usize] += 1;
        }
        assert_eq!(seen, [1; 16]);
    }

    #[test]
    fn sobol_prefixes_are_nets() {
        let sampler = Sampler::new(SamplerKind::Sobol, 5, 16);
        for (columns, rows) in [(16, 1), (8, 2), (4, 4), (2, 8), (1, 16)] {
            let mut seen = vec![0; 16];
            for s in 0..16 {
                let u = sampler.random([1, 2], s).pair(0) * Vec2::new(columns as f32, rows as f32);
                seen[u.y as usize * columns + u.x as usize] += 1;
            }
            assert_eq!(seen, [1; 16], "{columns} x {rows}");
        }
    }
}
