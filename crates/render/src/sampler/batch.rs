//! Random numbers of many samples at once, with the same bits as [`Random`].

use super::{Random, SampleKey, Sampler, SamplerKind, sobol};
use snell_math::simd::Wide;
use snell_math::{at_level, rng};

/// The random numbers of `N` vertices at one depth of paths without branches.
#[derive(Clone, Debug)]
pub struct BatchRandoms<const N: usize> {
    sampler: Sampler,
    keys: [u32; N],
    samples: [u32; N],
    base: u32,
}

impl<const N: usize> BatchRandoms<N> {
    /// Random numbers for vertices at this depth.
    pub fn new(sampler: &Sampler, depth: u32) -> Self {
        let mut randoms = Self::of_camera(sampler);
        randoms.start(sampler, depth);
        randoms
    }

    /// Sets the depth of the vertices in the lanes.
    pub fn start(&mut self, sampler: &Sampler, depth: u32) {
        self.sampler = *sampler;
        self.base = Random::base_at(0, depth);
    }

    /// Random numbers for camera samples, which come before the first vertex.
    pub fn of_camera(sampler: &Sampler) -> Self {
        Self { sampler: *sampler, keys: [0; N], samples: [0; N], base: 0 }
    }

    /// Puts a sample into a lane. Only its pixel and sample number matter.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, key: SampleKey) {
        (self.keys[lane], self.samples[lane]) = (key.pixel, key.sample);
    }

    fn key(&self, lane: usize) -> SampleKey {
        SampleKey { pixel: self.keys[lane], sample: self.samples[lane] }
    }

    /// The result of [`Random::pair`] for each lane.
    pub fn pairs(&self, dimension: u32, wide: Option<Wide>) -> [[f32; N]; 2] {
        let dimension = self.base + dimension;
        let mut to = [[0.0; N]; 2];
        match self.sampler.kind {
            SamplerKind::Sobol | SamplerKind::ZSobol => {
                let [x, y] = &mut to;
                at_level!(
                    wide,
                    sobol_pairs,
                    (
                        keys: &[u32] = &self.keys,
                        samples: &[u32] = &self.samples,
                        dimension: u32 = dimension,
                        set_log2: u32 = self.sampler.set_log2(),
                        x: &mut [f32] = x,
                        y: &mut [f32] = y,
                    )
                )
            }
            SamplerKind::Independent => {
                let [x, y] = &mut to;
                at_level!(
                    wide,
                    independent_pairs,
                    (
                        keys: &[u32] = &self.keys,
                        samples: &[u32] = &self.samples,
                        dimension: u32 = dimension,
                        x: &mut [f32] = x,
                        y: &mut [f32] = y,
                    )
                )
            }
            SamplerKind::Stratified => {
                let point = |i| self.sampler.point(self.key(i), dimension);
                (0..N).for_each(|i| [to[0][i], to[1][i]] = point(i).to_array());
            }
        }
        to
    }

    /// The result of [`Random::number`] for each lane.
    pub fn numbers(&self, dimension: u32, wide: Option<Wide>) -> [f32; N] {
        let dimension = self.base + dimension;
        let mut to = [0.0; N];
        match self.sampler.kind {
            SamplerKind::Sobol | SamplerKind::ZSobol => {
                at_level!(
                    wide,
                    sobol_numbers,
                    (
                        keys: &[u32] = &self.keys,
                        samples: &[u32] = &self.samples,
                        dimension: u32 = dimension,
                        set_log2: u32 = self.sampler.set_log2(),
                        to: &mut [f32] = &mut to,
                    )
                )
            }
            SamplerKind::Independent => to = self.pairs(dimension - self.base, wide)[0],
            SamplerKind::Stratified => {
                (0..N).for_each(|i| to[i] = self.sampler.number(self.key(i), dimension))
            }
        }
        to
    }
}

#[inline(always)]
fn sobol_pairs(
    keys: &[u32],
    samples: &[u32],
    dimension: u32,
    set_log2: u32,
    x: &mut [f32],
    y: &mut [f32],
) {
    let count = keys.len();
    let (samples, x, y) = (&samples[..count], &mut x[..count], &mut y[..count]);
    for i in 0..count {
        let u = sobol::point(rng::hash_combine(keys[i], dimension), samples[i], set_log2);
        (x[i], y[i]) = (u.x, u.y);
    }
}

#[inline(always)]
fn independent_pairs(keys: &[u32], samples: &[u32], dimension: u32, x: &mut [f32], y: &mut [f32]) {
    let count = keys.len();
    let (samples, x, y) = (&samples[..count], &mut x[..count], &mut y[..count]);
    for i in 0..count {
        let u =
            rng::uniform2([rng::hash_combine(keys[i], dimension), samples[i], keys[i], dimension]);
        (x[i], y[i]) = (u.x, u.y);
    }
}

#[inline(always)]
fn sobol_numbers(keys: &[u32], samples: &[u32], dimension: u32, set_log2: u32, to: &mut [f32]) {
    let count = keys.len();
    let (samples, to) = (&samples[..count], &mut to[..count]);
    for i in 0..count {
        to[i] = sobol::number(rng::hash_combine(keys[i], dimension), samples[i], set_log2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::simd::Level;

    #[test]
    fn many_numbers_are_those_of_single_samples_at_every_level() {
        for kind in SamplerKind::ALL {
            let sampler = Sampler::new(kind, 7, 12);
            let mut many = BatchRandoms::<20>::new(&sampler, 3);
            let singles: Vec<Random> =
                (0..20).map(|i| sampler.random([i * 7, 40 - i], i % 12)).collect();
            singles.iter().enumerate().for_each(|(lane, random)| many.set(lane, random.key()));
            for level in Level::ALL {
                let (pairs, numbers) = (many.pairs(2, level.wide()), many.numbers(5, level.wide()));
                for (lane, random) in singles.iter().enumerate() {
                    let at_vertex = random.at_vertex(0, 3);
                    assert_eq!(
                        [pairs[0][lane], pairs[1][lane]],
                        at_vertex.pair(2).to_array(),
                        "{kind:?}"
                    );
                    assert_eq!(numbers[lane], at_vertex.number(5), "{kind:?}");
                }
            }
        }
    }
}
