//! Samplers: pure functions from (seed, pixel, sample, dimension) to numbers in `[0, 1)`.
//!
//! A *dimension* is the use of a number (lens, light, BSDF at the third bounce …); [`Random`] holds
//! the other arguments. No number depends on the order of calls, so batching, threads and splitting
//! change nothing.

mod batch;
mod sobol;
mod stratified;
mod zsobol;

pub use batch::BatchRandoms;

use crate::film::BLOCK;
use crate::named::named;
use crate::settings::Settings;
use snell_math::{Vec2, rng};
use std::ops::Range;

named! {
    /// The kind of sampler.
    pub enum SamplerKind {
        /// Independent uniform numbers.
        Independent = "independent",
        /// Jittered strata, one sample in each (Cook, 1986), with strata permuted between
        /// dimensions.
        Stratified = "stratified",
        /// Owen-scrambled Sobol points, padded by two dimensions at a time (Burley, Practical
        /// hash-based Owen scrambling, JCGT 2020).
        Sobol = "sobol",
        /// Sobol points, distributed among neighbouring pixels so that the error of the picture is
        /// blue noise (Ahmed and Wonka, 2020).
        ZSobol = "zsobol" (default),
    }
}

/// A sampler for one render.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    kind: SamplerKind,
    seed: u32,
    spp: u32,
    /// True if every block of `spp` samples is a point set independent of other blocks.
    in_blocks: bool,
}

impl Sampler {
    /// The sampler of a render with `spp` samples per pixel.
    pub fn new(kind: SamplerKind, seed: u32, spp: u32) -> Self {
        Self { kind, seed, spp: spp.max(1), in_blocks: false }
    }

    /// A sampler for any number of samples. The samples of each block are well distributed, and
    /// different blocks are independent, so that the variance between blocks estimates the error of
    /// their mean.
    pub fn in_blocks(kind: SamplerKind, seed: u32, block: u32) -> Self {
        Self { in_blocks: true, ..Self::new(kind, seed, block) }
    }

    /// The sampler that the settings of a render request.
    pub fn of(settings: &Settings) -> Self {
        match settings.noise {
            None => Self::new(settings.sampler, settings.seed, settings.spp),
            Some(_) => Self::in_blocks(settings.sampler, settings.seed, BLOCK),
        }
    }

    /// The numbers of a sample of a pixel. Pixel coordinates are those of the whole picture.
    pub fn random(&self, pixel: [u32; 2], sample: u32) -> Random {
        let (block, sample) = self.block_of(sample);
        self.numbers_of(self.of_pixel(pixel, block).nth(sample))
    }

    /// The numbers of the sample with this key.
    pub fn numbers_of(&self, key: SampleKey) -> Random {
        Random { sampler: *self, key, base: 0 }
    }

    /// The keys of a range of samples of a pixel.
    pub fn keys(&self, pixel: [u32; 2], samples: Range<u32>) -> impl Iterator<Item = SampleKey> {
        let mut known: Option<(u32, SampleKey)> = None;
        samples.map(move |sample| {
            let (block, sample) = self.block_of(sample);
            match known {
                Some((of, first)) if of == block => first.nth(sample),
                _ => known.insert((block, self.of_pixel(pixel, block))).1.nth(sample),
            }
        })
    }

    /// The block that a sample belongs to, and the sample's index in the block.
    fn block_of(&self, sample: u32) -> (u32, u32) {
        if self.in_blocks { (sample / self.spp, sample % self.spp) } else { (0, sample) }
    }

    /// The key of the first sample of a pixel in a block.
    fn of_pixel(&self, pixel: [u32; 2], block: u32) -> SampleKey {
        let seed = if self.in_blocks { rng::hash_combine(self.seed, !block) } else { self.seed };
        let key = |[x, y]: [u32; 2]| rng::hash_combine(rng::hash_combine(seed, x), y);
        let (key, start) = match self.kind {
            SamplerKind::ZSobol => {
                let stretch = zsobol::stretch(pixel, self.spp);
                (key(stretch.square), stretch.start)
            }
            _ => (key(pixel), 0),
        };
        SampleKey { pixel: key, sample: start }
    }

    /// Binary logarithm of the number of samples of a pixel or block, rounded up.
    fn set_log2(&self) -> u32 {
        self.spp.next_power_of_two().trailing_zeros()
    }

    fn number(&self, key: SampleKey, dimension: u32) -> f32 {
        match self.kind {
            SamplerKind::Sobol | SamplerKind::ZSobol => {
                sobol::number(rng::hash_combine(key.pixel, dimension), key.sample, self.set_log2())
            }
            _ => self.point(key, dimension).x,
        }
    }

    fn point(&self, SampleKey { pixel, sample }: SampleKey, dimension: u32) -> Vec2 {
        let of_dimension = rng::hash_combine(pixel, dimension);
        match self.kind {
            SamplerKind::Independent => rng::uniform2([of_dimension, sample, pixel, dimension]),
            SamplerKind::Stratified => stratified::point(of_dimension, sample, self.spp),
            SamplerKind::Sobol | SamplerKind::ZSobol => {
                sobol::point(of_dimension, sample, self.set_log2())
            }
        }
    }
}

/// The key from which a sampler computes the numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct SampleKey {
    /// The key of the sequences of numbers, which belong to one pixel or are shared by several.
    pixel: u32,
    /// The sample's index in these sequences.
    sample: u32,
}

impl SampleKey {
    /// The key of the sample that comes `sample` places later.
    fn nth(self, sample: u32) -> Self {
        Self { sample: self.sample + sample, ..self }
    }
}

/// The random numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Random {
    sampler: Sampler,
    key: SampleKey,
    base: u32,
}

impl Random {
    /// The numbers of a vertex. Each pair of `stream` and `depth` has dimensions of its own.
    pub fn at_vertex(self, stream: u32, depth: u32) -> Self {
        Self { base: Self::base_at(stream, depth), ..self }
    }

    /// The key of the sample.
    pub fn key(&self) -> SampleKey {
        self.key
    }

    /// The first dimension of the numbers of a vertex.
    fn base_at(stream: u32, depth: u32) -> u32 {
        if stream == 0 { (depth + 1) << 8 } else { rng::hash_combine(stream, depth) << 8 }
    }

    /// A well-distributed pair of numbers for a dimension below 256 of this vertex.
    pub fn pair(&self, dimension: u32) -> Vec2 {
        self.sampler.point(self.key, self.base + dimension)
    }

    /// Pair number `step` of a sequence of independent pairs, for uses that need an unknown number
    /// of pairs.
    pub fn independent_pair(&self, step: u32) -> Vec2 {
        rng::uniform2([self.key.pixel, self.key.sample, rng::hash32(self.base), step])
    }

    /// A well-distributed number for a dimension below 256 of this vertex.
    pub fn number(&self, dimension: u32) -> f32 {
        self.sampler.number(self.key, self.base + dimension)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrates a function over the unit square with `spp` samples in each of many pixels.
    /// Returns the mean and the variance of the estimates.
    fn estimate(
        kind: SamplerKind,
        spp: u32,
        dimension: u32,
        f: impl Fn(Vec2) -> f32,
    ) -> (f64, f64) {
        let sampler = Sampler::new(kind, 1, spp);
        let pixels = 2000;
        let estimates: Vec<f64> = (0..pixels)
            .map(|x| {
                let sum: f64 = (0..spp)
                    .map(|s| {
                        f64::from(f(sampler.random([x, 3], s).at_vertex(0, 2).pair(dimension)))
                    })
                    .sum();
                sum / f64::from(spp)
            })
            .collect();
        let mean = estimates.iter().sum::<f64>() / f64::from(pixels);
        (mean, estimates.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / f64::from(pixels))
    }

    #[test]
    fn every_sampler_is_unbiased_and_the_good_ones_converge_faster() {
        // The functions are a quarter disk (area pi / 4) and a smooth product (mean 1 / 4).
        let disk = |u: Vec2| f32::from(u.length_squared() < 1.0);
        let smooth = |u: Vec2| u.x * u.y;
        let mut variances = Vec::new();
        for kind in SamplerKind::ALL {
            for dimension in [0, 1, 7] {
                let (mean, variance) = estimate(kind, 16, dimension, disk);
                let error = (variance / 2000.0).sqrt();
                assert!(
                    (mean - std::f64::consts::FRAC_PI_4).abs() < 4.0 * error,
                    "{kind:?}: {mean} +- {error}"
                );
            }
            let (mean, variance) = estimate(kind, 16, 3, smooth);
            assert!((mean - 0.25).abs() < 4.0 * (variance / 2000.0).sqrt(), "{kind:?}: {mean}");
            variances.push(variance);
        }
        let [independent, stratified, sobol, zsobol] = variances[..] else {
            panic!("four samplers")
        };
        assert!(stratified < 0.25 * independent && sobol < 0.1 * independent, "{variances:?}");
        assert!(zsobol < 1.2 * sobol, "{variances:?}");
    }

    #[test]
    fn blocks_of_samples_are_independent() {
        for kind in SamplerKind::ALL {
            let sampler = Sampler::in_blocks(kind, 9, 16);
            let mean = |pixel: u32, block: u32| {
                let numbers = (0..16).map(|s| sampler.random([pixel, 2], block * 16 + s).pair(1));
                f64::from(numbers.map(|u| u.x * u.y).sum::<f32>()) / 16.0 - 0.25
            };
            let pixels = 0..2000;
            let variance = pixels.clone().map(|x| mean(x, 0).powi(2)).sum::<f64>();
            let covariance = pixels.map(|x| mean(x, 0) * mean(x, 1)).sum::<f64>();
            assert!(
                (covariance / variance).abs() < 4.0 / 2000f64.sqrt(),
                "{kind:?}: {}",
                covariance / variance
            );
        }
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
            // The standard error is (1 / 12) / sqrt(32000) = 0.0005.
            assert!((covariance / 32000.0).abs() < 0.002, "{kind:?}: {covariance}");
        }
    }

    #[test]
    fn what_depends_on_several_dimensions_is_as_good_as_chance_allows() {
        // The integrand is the product of 8 numbers plus 1/2. The terms of a single pair integrate
        // without error, and those of several pairs are random.
        let pair = (13.0f64 / 12.0).powi(2) - 1.0;
        let rest = (1.0 + pair).powi(4) - 1.0 - 4.0 * pair;
        for kind in [SamplerKind::Stratified, SamplerKind::Sobol, SamplerKind::ZSobol] {
            let mut variance = 0.0;
            for x in 0..4000 {
                let sampler = Sampler::new(kind, x, 64);
                let value = |s| {
                    (0..4)
                        .map(|d| sampler.random([x, 7], s).pair(d) + 0.5)
                        .fold(1.0, |f, u| f * u.x * u.y)
                };
                let mean = f64::from((0..64).map(value).sum::<f32>()) / 64.0;
                variance += (mean - 1.0).powi(2) / 4000.0;
            }
            assert!(
                (0.9..1.15).contains(&(variance * 64.0 / rest)),
                "{kind:?}: {}",
                variance * 64.0 / rest
            );
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

    /// The number of points in each of `columns * rows` boxes.
    fn counts(points: &[Vec2], columns: usize, rows: usize) -> Vec<u32> {
        let mut seen = vec![0; columns * rows];
        for u in points {
            let cell = *u * Vec2::new(columns as f32, rows as f32);
            seen[cell.y as usize * columns + cell.x as usize] += 1;
        }
        seen
    }

    #[test]
    fn sobol_prefixes_are_nets() {
        for kind in [SamplerKind::Sobol, SamplerKind::ZSobol] {
            let sampler = Sampler::new(kind, 5, 100);
            let points: Vec<Vec2> = (0..16).map(|s| sampler.random([1, 2], s).pair(0)).collect();
            for (columns, rows) in [(16, 1), (8, 2), (4, 4), (2, 8), (1, 16)] {
                assert_eq!(counts(&points, columns, rows), [1; 16], "{kind:?} {columns} x {rows}");
            }
        }
    }

    #[test]
    fn the_samples_of_aligned_squares_of_pixels_are_nets_together() {
        let sampler = Sampler::new(SamplerKind::ZSobol, 5, 4);
        for corner in [[0, 0], [2, 6], [130, 258]] {
            let pixels = (0..4).map(|p| [corner[0] + p % 2, corner[1] + p / 2]);
            let points: Vec<Vec2> = pixels
                .flat_map(|p| (0..4).map(move |s| sampler.random(p, s).at_vertex(0, 1).pair(3)))
                .collect();
            for (columns, rows) in [(16, 1), (8, 2), (4, 4), (2, 8), (1, 16)] {
                assert_eq!(
                    counts(&points, columns, rows),
                    [1; 16],
                    "{corner:?} {columns} x {rows}"
                );
            }
        }
    }
}
