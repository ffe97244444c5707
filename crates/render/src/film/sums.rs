//! Sums over the samples of the pixels of a tile, and what is computed from them.

use super::{BLOCK, FilmPart, FilmSample};
use crate::integrator::aov::NOTHING;
use serde::{Deserialize, Serialize};
use snell_math::Rgb;
use std::cmp::Ordering;

/// Which sums a tile has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// The number of pixels.
    pub pixels: usize,
    /// Channels of each pixel: red, green, blue and alpha, then those of the AOVs.
    pub channels: usize,
    /// The number of AOVs of kind [`AovKind::Coverage`](crate::integrator::aov::AovKind::Coverage).
    pub coverages: usize,
    /// True if samples may have weights other than 1.
    pub is_signed: bool,
}

/// Sums over some samples of the pixels of a tile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sums {
    #[serde(skip)]
    layout: Layout,
    /// The number of samples of each pixel.
    taken: Vec<u32>,
    /// Weighted sums: for each pixel colour, alpha, then the AOV channels.
    sum: Vec<f64>,
    /// Sums of the squares of the weighted values.
    square: Vec<f64>,
    /// Sum of the weights, per pixel; empty if all weights are 1.
    weight: Vec<f64>,
    /// Sums of the values without weights; empty if all weights are 1.
    plain: Vec<f64>,
    /// For each pixel, the sum of the intensities of its whole blocks, and the sum of their
    /// squares; empty before the first whole block.
    blocks: Vec<[f64; 2]>,
    /// For each pixel and each AOV of kind coverage, the keys that cover it, in ascending order,
    /// with the number of samples of each.
    coverage: Vec<Vec<(u64, u32)>>,
}

impl Sums {
    pub fn new(layout: Layout) -> Self {
        let Layout { pixels, channels, coverages, is_signed } = layout;
        let zeros = || vec![0.0; pixels * channels];
        let signed = |count: usize| vec![0.0; if is_signed { count } else { 0 }];
        Self {
            layout,
            taken: vec![0; pixels],
            sum: zeros(),
            square: zeros(),
            weight: signed(pixels),
            plain: signed(pixels * channels),
            blocks: Vec::new(),
            coverage: vec![Vec::new(); pixels * coverages],
        }
    }

    /// Takes sums that were read from a file for those of a tile with this layout, over so many
    /// samples at most. Returns `None` if they cannot be.
    pub fn of_layout(self, layout: Layout, most: u32) -> Option<Self> {
        let Layout { pixels, channels, coverages, is_signed } = layout;
        let signed = |count: usize| if is_signed { count } else { 0 };
        let has_sizes = self.taken.len() == pixels
            && self.sum.len() == pixels * channels
            && self.square.len() == self.sum.len()
            && self.weight.len() == signed(pixels)
            && self.plain.len() == signed(self.sum.len())
            && [0, pixels].contains(&self.blocks.len())
            && self.coverage.len() == pixels * coverages;
        let mut numbers = self.sum.iter().chain(&self.square).chain(&self.weight);
        let is_finite = numbers.all(|number| number.is_finite())
            && self.plain.iter().chain(self.blocks.as_flattened()).all(|n| n.is_finite());
        let is_ascending =
            self.coverage.iter().all(|list| list.windows(2).all(|pair| pair[0].0 < pair[1].0));
        let are_counts = self.taken.iter().all(|&count| count <= most)
            && self.coverage.iter().flatten().all(|&(_, count)| count <= most);
        (has_sizes && is_finite && is_ascending && are_counts).then_some(Self { layout, ..self })
    }

    /// Adds the samples `from..to` of a part, counted from its first, to the given pixels.
    pub fn add_samples(&mut self, part: &FilmPart, pixels: &[usize], from: usize, to: usize) {
        let count = (part.samples[1] - part.samples[0]) as usize;
        let aov_channels = self.layout.channels - 4;
        let mut values = vec![0.0; self.layout.channels];
        for (number, &pixel) in pixels.iter().enumerate() {
            let range = number * count + from..number * count + to;
            self.taken[pixel] += (to - from) as u32;
            if aov_channels == 0 && !self.layout.is_signed {
                self.add_plain(pixel, &part.values[range.clone()]);
            } else {
                for i in range.clone() {
                    let sample = &part.values[i];
                    values[..3].copy_from_slice(&sample.color.to_array());
                    values[3] = sample.alpha;
                    values[4..].copy_from_slice(&part.aovs[i * aov_channels..][..aov_channels]);
                    self.add(pixel, &values, sample.weight);
                }
            }
            let kinds = self.layout.coverages;
            for i in range.filter(|_| kinds > 0) {
                for (kind, &key) in part.keys[i * kinds..][..kinds].iter().enumerate() {
                    if key != NOTHING {
                        cover(&mut self.coverage[pixel * kinds + kind], key, 1);
                    }
                }
            }
        }
    }

    /// Adds samples of a pixel that have colour and alpha only, and weight 1.
    fn add_plain(&mut self, pixel: usize, samples: &[FilmSample]) {
        let range = 4 * pixel..4 * pixel + 4;
        let (Some(sum), Some(square)) =
            (self.sum[range.clone()].first_chunk_mut(), self.square[range].first_chunk_mut())
        else {
            return;
        };
        // The sums are kept in registers, and have the same order as those of `add`.
        let (mut sums, mut squares): ([f64; 4], [f64; 4]) = (*sum, *square);
        for sample in samples {
            let Rgb { r, g, b } = sample.color;
            let values = [r, g, b, sample.alpha];
            for channel in 0..4 {
                let value = f64::from(values[channel]);
                sums[channel] += value;
                squares[channel] += value * value;
            }
        }
        (*sum, *square) = (sums, squares);
    }

    fn add(&mut self, pixel: usize, values: &[f32], weight: f32) {
        let range = pixel * values.len()..(pixel + 1) * values.len();
        if self.layout.is_signed {
            for (plain, &value) in self.plain[range.clone()].iter_mut().zip(values) {
                *plain += f64::from(value);
            }
            self.weight[pixel] += f64::from(weight);
        }
        for ((sum, square), &value) in
            self.sum[range.clone()].iter_mut().zip(&mut self.square[range]).zip(values)
        {
            let value = f64::from(value * weight);
            *sum += value;
            *square += value * value;
        }
    }

    /// Records the intensities of the given pixels, if these sums are those of one whole block.
    pub fn end_block(&mut self, pixels: &[usize], mean_weight: f64) {
        let mut blocks = vec![[0.0; 2]; self.layout.pixels];
        for &pixel in pixels {
            let mean = |channel| self.channel(pixel, channel).mean(f64::from(BLOCK), mean_weight);
            let intensity = (mean(0) + mean(1) + mean(2)) / 3.0;
            blocks[pixel] = [intensity, intensity * intensity];
        }
        self.blocks = blocks;
    }

    /// Adds the sums of later samples.
    pub fn add_all(&mut self, later: &Self) {
        let mine = self
            .sum
            .iter_mut()
            .chain(&mut self.square)
            .chain(&mut self.weight)
            .chain(&mut self.plain)
            .chain(self.blocks.as_flattened_mut());
        let theirs = later
            .sum
            .iter()
            .chain(&later.square)
            .chain(&later.weight)
            .chain(&later.plain)
            .chain(later.blocks.as_flattened());
        mine.zip(theirs).for_each(|(mine, theirs)| *mine += theirs);
        self.taken.iter_mut().zip(&later.taken).for_each(|(mine, theirs)| *mine += theirs);
        for (mine, theirs) in self.coverage.iter_mut().zip(&later.coverage) {
            theirs.iter().for_each(|&(key, count)| cover(mine, key, count));
        }
    }

    /// The number of samples of a pixel.
    pub fn taken(&self, pixel: usize) -> u32 {
        self.taken[pixel]
    }

    /// The sum of the intensities of a pixel's whole blocks, and the sum of their squares.
    pub fn blocks(&self, pixel: usize) -> [f64; 2] {
        self.blocks.get(pixel).copied().unwrap_or_default()
    }

    /// The keys that cover a pixel in one AOV of kind coverage, in ascending order, with the number
    /// of samples of each.
    pub fn coverage(&self, pixel: usize, kind: usize) -> &[(u64, u32)] {
        &self.coverage[pixel * self.layout.coverages + kind]
    }

    /// The sums of one channel of one pixel.
    pub fn channel(&self, pixel: usize, channel: usize) -> ChannelSums {
        let i = pixel * self.layout.channels + channel;
        let weight = self.weight.get(pixel).copied().unwrap_or(f64::from(self.taken[pixel]));
        let [sum, square] = [self.sum[i], self.square[i]];
        ChannelSums { sum, square, weight, plain: self.plain.get(i).copied() }
    }
}

/// Adds samples that a key covers to an ascending list of keys.
pub fn cover(list: &mut Vec<(u64, u32)>, key: u64, count: u32) {
    let compare = |entry: &(u64, u32)| -> Ordering { entry.0.cmp(&key) };
    match list.binary_search_by(compare) {
        Ok(at) => list[at].1 += count,
        Err(at) => list.insert(at, (key, count)),
    }
}

/// The sums of one channel of one pixel.
#[derive(Clone, Copy)]
pub struct ChannelSums {
    sum: f64,
    square: f64,
    weight: f64,
    plain: Option<f64>,
}

impl ChannelSums {
    /// Empty sums; `is_signed` says that samples may have weights other than 1.
    pub fn nothing(is_signed: bool) -> Self {
        Self { sum: 0.0, square: 0.0, weight: 0.0, plain: is_signed.then_some(0.0) }
    }

    pub fn plus(self, other: Self) -> Self {
        Self {
            sum: self.sum + other.sum,
            square: self.square + other.square,
            weight: self.weight + other.weight,
            plain: self.plain.zip(other.plain).map(|(a, b)| a + b),
        }
    }

    /// The unweighted mean over `n` samples, and the sum of the weighted differences from it.
    ///
    /// The sum of the weights of few samples may be 0 or have the wrong sign where the filter is
    /// partly negative, so it is no divisor. Only the differences from the unweighted mean are
    /// weighted, and they are divided by the expected weight.
    fn plain_mean(&self, n: f64) -> (f64, f64) {
        match self.plain {
            None => (self.sum / n, 0.0),
            Some(plain) => (plain / n, self.sum - plain / n * self.weight),
        }
    }

    /// The mean over `n` samples, an estimate of the pixel's value.
    pub fn mean(&self, n: f64, mean_weight: f64) -> f64 {
        let (mean, difference) = self.plain_mean(n);
        if difference == 0.0 { mean } else { mean + difference / (n * mean_weight) }
    }

    /// The variance of [`Self::mean`] over `n` samples.
    pub fn variance(&self, n: f64, mean_weight: f64) -> f64 {
        let (mean, difference) = self.plain_mean(n);
        // The variance of the weighted differences from the unweighted mean. All weights are 1 or
        // -1.
        let spread = (self.square - mean * mean * n - difference * difference / n).max(0.0);
        let divisor = n * mean_weight;
        if n > 1.0 { spread / (divisor * divisor) * (n / (n - 1.0)) } else { 0.0 }
    }
}
