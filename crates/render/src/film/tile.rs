//! A tile of the film, and the tree in which its blocks of samples are added.
//!
//! Floating-point sums depend on their order, so the order is fixed by the numbers of the samples
//! alone. The samples of a block are added one after another. Blocks are the leaves of a tree in
//! which every node has [`FAN`] children, which are added one after another. A tile holds *runs*:
//! the sum of a whole node, or of the first few children of a node, or of the first few samples of
//! a block. Two runs are joined where the tree adds them next, and never otherwise. Any two runs
//! are therefore disjoint, or one contains the other, and however a tile's samples are split over
//! parts, runs and machines, and in whatever order they arrive, the same sums result. A tile whose
//! blocks arrive in order holds one run for each level of the tree.

use super::sums::{ChannelSums, Layout, Sums, cover};
use super::{BLOCK, FilmPart};
use crate::settings::Crop;
use serde::{Deserialize, Serialize};

/// The number of children of a node of the tree of sums.
const FAN: u32 = 8;

/// The sums over consecutive samples that the tree adds without others between.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Run {
    /// The first sample number, and one past the last.
    samples: [u32; 2],
    sums: Sums,
}

impl Run {
    fn contains(&self, other: &Self) -> bool {
        self.samples[0] <= other.samples[0] && other.samples[1] <= self.samples[1]
    }

    /// True if the tree has a sum over these samples.
    fn is_sum(&self) -> bool {
        let [start, end] = self.samples;
        let Some(size) = end.checked_sub(start).filter(|&size| size > 0) else { return false };
        if !start.is_multiple_of(BLOCK) {
            return false;
        }
        // The largest node that the sum does not exceed.
        let mut node = BLOCK;
        while node.checked_mul(FAN).is_some_and(|parent| parent <= size) {
            node *= FAN;
        }
        match size.cmp(&node) {
            std::cmp::Ordering::Less => true,
            std::cmp::Ordering::Equal => start.is_multiple_of(node),
            std::cmp::Ordering::Greater => {
                size.is_multiple_of(node)
                    && u64::from(start) % (u64::from(node) * u64::from(FAN)) == 0
            }
        }
    }

    /// True if the tree adds `next` to this run.
    fn precedes(&self, next: &Self) -> bool {
        let [start, end] = next.samples;
        let size = end - start;
        let is_node = size.is_multiple_of(BLOCK) && is_power_of_fan(size / BLOCK);
        let Some(parent) = size.checked_mul(FAN) else { return false };
        self.samples[1] == start
            && is_node
            && start.is_multiple_of(size)
            && self.samples[0] == start / parent * parent
    }
}

fn is_power_of_fan(mut count: u32) -> bool {
    while count > 1 && count.is_multiple_of(FAN) {
        count /= FAN;
    }
    count == 1
}

/// A limit of the number of runs of a tile between two of its parts, while it is filled in order.
pub fn most_runs(samples: u32) -> u32 {
    let blocks = samples / BLOCK;
    let levels = blocks.saturating_sub(1).checked_ilog(FAN).unwrap_or(0) + 1;
    let of_blocks = if blocks == 0 { 0 } else { levels };
    of_blocks + u32::from(!samples.is_multiple_of(BLOCK))
}

/// What a tile has gathered, as it is stored and sent.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TileState {
    runs: Vec<Run>,
    first: Vec<f32>,
    decided: Vec<Option<f64>>,
}

impl TileState {
    /// True if all samples are among these.
    pub fn is_within(&self, [start, end]: [u32; 2]) -> bool {
        self.runs.iter().all(|run| start <= run.samples[0] && run.samples[1] <= end)
    }
}

/// One tile of the film.
#[derive(Clone, Debug)]
pub struct FilmTile {
    /// The pixels of the tile, in coordinates of the whole picture.
    pub area: Crop,
    layout: Layout,
    /// Expected weight of a sample; see
    /// [`FilterSampler::mean_weight`](super::filter::FilterSampler::mean_weight).
    mean_weight: f64,
    /// The samples so far, in ascending order. Runs are disjoint.
    runs: Vec<Run>,
    /// Values of AOVs that cannot be averaged: those of the first sample.
    first: Vec<f32>,
    /// For each pixel that has stopped, the standard deviation of the intensities of blocks around
    /// it at that moment; empty if none has stopped.
    pub(super) decided: Vec<Option<f64>>,
}

impl FilmTile {
    /// A tile without samples.
    pub(super) fn new(area: Crop, aov_channels: usize, coverages: usize, mean_weight: f64) -> Self {
        let pixels = area.size().iter().product::<u32>() as usize;
        let is_signed = mean_weight < 1.0;
        let layout = Layout { pixels, channels: 4 + aov_channels, coverages, is_signed };
        let first = vec![0.0; pixels * aov_channels];
        Self { area, layout, mean_weight, runs: Vec::new(), first, decided: Vec::new() }
    }

    /// This tile without samples.
    pub fn emptied(&self) -> Self {
        let (runs, decided) = (Vec::new(), Vec::new());
        Self { runs, first: vec![0.0; self.first.len()], decided, ..*self }
    }

    /// What the tile has gathered.
    pub fn state(&self) -> TileState {
        let Self { runs, first, decided, .. } = self.clone();
        TileState { runs, first, decided }
    }

    /// This tile with what a tile of the same place has gathered; `None` if the state cannot be of
    /// such a tile.
    pub fn with_state(&self, state: TileState) -> Option<Self> {
        let TileState { runs, first, decided } = state;
        let is_ascending = runs.windows(2).all(|pair| pair[0].samples[1] <= pair[1].samples[0]);
        let has_sizes = first.len() == self.first.len()
            && [0, self.pixels()].contains(&decided.len())
            && first.iter().all(|value| !value.is_nan());
        if !(is_ascending && has_sizes && runs.iter().all(Run::is_sum)) {
            return None;
        }
        let of_layout = |Run { samples, sums }: Run| {
            let sums = sums.of_layout(self.layout, samples[1] - samples[0])?;
            Some(Run { samples, sums })
        };
        let runs = runs.into_iter().map(of_layout).collect::<Option<_>>()?;
        Some(Self {
            area: self.area,
            layout: self.layout,
            mean_weight: self.mean_weight,
            runs,
            first,
            decided,
        })
    }

    /// The number of samples before the first that is missing. Pixels that have stopped by their
    /// error have fewer.
    pub fn samples(&self) -> u32 {
        self.runs
            .iter()
            .fold(0, |end, run| if run.samples[0] == end { run.samples[1] } else { end })
    }

    /// Adds a part of this tile. It may begin at any block, or continue a block that has some
    /// samples.
    ///
    /// # Panics
    /// If the part begins within a block that does not have the samples before it, or if the tile
    /// has some of its samples.
    pub fn fold(&mut self, part: &FilmPart) {
        let pixels: Vec<usize> = match &part.pixels {
            Some(pixels) => pixels.iter().map(|&p| p as usize).collect(),
            None => (0..self.layout.pixels).collect(),
        };
        let [first, end] = part.samples;
        if first == 0 && end > 0 {
            self.keep_first(part, &pixels);
        }
        let mut at = first;
        while at < end {
            let until = (at / BLOCK * BLOCK).saturating_add(BLOCK).min(end);
            let number = self.run_at(at);
            let run = &mut self.runs[number];
            run.sums.add_samples(part, &pixels, (at - first) as usize, (until - first) as usize);
            run.samples[1] = until;
            if until.is_multiple_of(BLOCK) {
                run.sums.end_block(&pixels, self.mean_weight);
                self.join();
            }
            at = until;
        }
    }

    /// The index of the run to which a sample is added: a new one at the start of a block.
    fn run_at(&mut self, sample: u32) -> usize {
        let after = self.runs.partition_point(|run| run.samples[0] < sample);
        let is_free = self.runs.get(after).is_none_or(|run| run.samples[0] > sample);
        let end = after.checked_sub(1).map_or(0, |before| self.runs[before].samples[1]);
        assert!(is_free && end <= sample, "the tile has sample {sample}");
        if sample.is_multiple_of(BLOCK) {
            let samples = [sample, sample];
            self.runs.insert(after, Run { samples, sums: Sums::new(self.layout) });
            return after;
        }
        assert!(end == sample, "the tile lacks the samples of a block before sample {sample}");
        after - 1
    }

    fn keep_first(&mut self, part: &FilmPart, pixels: &[usize]) {
        let channels = self.layout.channels - 4;
        let samples = (part.samples[1] - part.samples[0]) as usize;
        for (number, &pixel) in pixels.iter().enumerate() {
            let values = &part.aovs[number * samples * channels..][..channels];
            self.first[pixel * channels..][..channels].copy_from_slice(values);
        }
    }

    /// Joins runs as far as the tree allows.
    fn join(&mut self) {
        let mut number = 1;
        while number < self.runs.len() {
            if self.runs[number - 1].precedes(&self.runs[number]) {
                let next = self.runs.remove(number);
                let run = &mut self.runs[number - 1];
                run.sums.add_all(&next.sums);
                run.samples[1] = next.samples[1];
                number = (number - 1).max(1);
            } else {
                number += 1;
            }
        }
    }

    /// Adds all samples of another film's tile that this one lacks. The tiles must be of the same
    /// place of the same render; samples that both have are the same.
    ///
    /// # Panics
    /// If the tiles differ in their area or channels.
    pub fn merge(&mut self, other: Self) {
        assert!(
            self.area == other.area && self.layout == other.layout,
            "the tiles are of different pictures"
        );
        let lacks_first = self.runs.first().is_none_or(|run| run.samples[0] > 0);
        if lacks_first && other.runs.first().is_some_and(|run| run.samples[0] == 0) {
            self.first = other.first;
        }
        for run in other.runs {
            if self.runs.iter().any(|mine| mine.contains(&run)) {
                continue;
            }
            self.runs.retain(|mine| !run.contains(mine));
            let at = self.runs.partition_point(|mine| mine.samples[0] < run.samples[0]);
            self.runs.insert(at, run);
            self.join();
        }
    }

    /// The picture of this tile so far, row by row: red, green, blue (linear Rec. 709) and alpha
    /// (premultiplied) of each pixel.
    pub fn colors(&self) -> Vec<f32> {
        let value = |i: usize| self.mean(i / 4, i % 4) as f32;
        (0..self.layout.pixels * 4).map(value).collect()
    }

    /// All values of this tile so far: for each pixel, the means of colour, alpha and the AOV
    /// channels.
    pub fn values(&self) -> impl Iterator<Item = f32> {
        let channels = self.layout.channels;
        (0..self.layout.pixels * channels)
            .map(move |i| self.mean(i / channels, i % channels) as f32)
    }

    /// The number of pixels.
    pub fn pixels(&self) -> usize {
        self.layout.pixels
    }

    /// The number of samples of a pixel.
    pub(super) fn taken(&self, pixel: usize) -> u32 {
        self.runs.iter().map(|run| run.sums.taken(pixel)).sum()
    }

    /// The numbers of samples of all pixels, row by row.
    pub(super) fn all_taken(&self) -> impl Iterator<Item = u32> {
        (0..self.layout.pixels).map(|pixel| self.taken(pixel))
    }

    fn sums(&self, pixel: usize, channel: usize) -> ChannelSums {
        let nothing = ChannelSums::nothing(self.layout.is_signed);
        self.runs.iter().fold(nothing, |sums, run| sums.plus(run.sums.channel(pixel, channel)))
    }

    /// The sum of the intensities of a pixel's whole blocks, and the sum of their squares.
    pub(super) fn blocks_of(&self, pixel: usize) -> [f64; 2] {
        self.runs.iter().fold([0.0; 2], |sums, run| {
            let more = run.sums.blocks(pixel);
            [sums[0] + more[0], sums[1] + more[1]]
        })
    }

    /// The keys that cover a pixel in one AOV of kind coverage, in ascending order, with the number
    /// of samples of each.
    pub(super) fn coverage(&self, pixel: usize, kind: usize) -> Vec<(u64, u32)> {
        let mut list = Vec::new();
        for run in &self.runs {
            let keys = run.sums.coverage(pixel, kind);
            keys.iter().for_each(|&(key, count)| cover(&mut list, key, count));
        }
        list
    }

    /// The value of an AOV's channel at the first sample of a pixel. Channels are counted after
    /// alpha.
    pub(super) fn first(&self, pixel: usize, channel: usize) -> f32 {
        self.first[pixel * (self.layout.channels - 4) + channel]
    }

    /// The mean of one channel of a pixel.
    pub(super) fn mean(&self, pixel: usize, channel: usize) -> f64 {
        let count = f64::from(self.taken(pixel).max(1));
        self.sums(pixel, channel).mean(count, self.mean_weight)
    }

    /// The variance of the mean of one channel of a pixel.
    pub(super) fn variance(&self, pixel: usize, channel: usize) -> f64 {
        let count = f64::from(self.taken(pixel).max(1));
        self.sums(pixel, channel).variance(count, self.mean_weight)
    }
}

#[cfg(test)]
mod tests {
    use super::super::FilmSample;
    use super::*;
    use proptest::prelude::*;
    use snell_math::{Rgb, rng};

    const PIXELS: u32 = 3;
    const AREA: Crop = Crop { min: [0, 0], max: [PIXELS, 1] };

    /// An empty tile with one AOV channel and one coverage, for a filter with negative weights.
    fn empty() -> FilmTile {
        FilmTile::new(AREA, 1, 1, 0.5)
    }

    fn part(samples: [u32; 2]) -> FilmPart {
        let numbers = || (0..PIXELS).flat_map(|p| (samples[0]..samples[1]).map(move |s| [p, s]));
        let unit = |[p, s]: [u32; 2], k| rng::to_unit(rng::hash_combine(p * 100_000 + s, k));
        let value = |at: [u32; 2]| FilmSample {
            color: Rgb::splat(unit(at, 1) * 1000.0),
            alpha: unit(at, 2),
            weight: if unit(at, 3) < 0.25 { -1.0 } else { 1.0 },
        };
        FilmPart {
            area: AREA,
            samples,
            pixels: None,
            values: numbers().map(value).collect(),
            aovs: numbers().map(|at| unit(at, 4)).collect(),
            keys: numbers().map(|at| (unit(at, 5) * 5.0) as u64).collect(),
        }
    }

    fn folded(samples: &[[u32; 2]]) -> FilmTile {
        let mut tile = empty();
        samples.iter().for_each(|&samples| tile.fold(&part(samples)));
        tile
    }

    fn same(a: &FilmTile, b: &FilmTile) -> bool {
        a.runs == b.runs && a.first == b.first
    }

    #[test]
    fn the_runs_of_a_tile_are_the_digits_of_its_number_of_blocks() {
        let tile = folded(&[[0, 16 * (64 + 8 * 3 + 5) + 7]]);
        let ends: Vec<u32> = tile.runs.iter().map(|run| run.samples[1]).collect();
        assert_eq!(ends, [16 * 64, 16 * 88, 16 * 93, 16 * 93 + 7]);
        assert_eq!(tile.samples(), 16 * 93 + 7);
        assert_eq!(folded(&[[0, 16 * 512]]).runs.len(), 1);
    }

    #[test]
    fn the_same_order_of_sums_is_written_out_for_ten_blocks() {
        let block = |number: u32| folded(&[[16 * number, 16 * number + 16]]).runs.remove(0).sums;
        let mut eight = block(0);
        (1..8).for_each(|number| eight.add_all(&block(number)));
        let mut two = block(8);
        two.add_all(&block(9));
        let runs = folded(&[[0, 160]]).runs;
        assert_eq!(runs.into_iter().map(|run| run.sums).collect::<Vec<_>>(), [eight, two]);
    }

    #[test]
    fn the_number_of_runs_is_bounded() {
        for samples in [0, 5, 16, 128, 129, 160, 1024, 1040, 1100] {
            let mut tile = empty();
            let mut most = 0;
            for start in (0..samples).step_by(BLOCK as usize) {
                tile.fold(&part([start, (start + BLOCK).min(samples)]));
                most = most.max(tile.runs.len() as u32);
            }
            let limit = most_runs(samples);
            assert!(most <= limit && limit <= most + 1, "{samples} samples: {most} {limit}");
        }
    }

    proptest! {
        /// Samples are split into tiles in any way that respects blocks, some are taken twice, and
        /// the tiles are merged in any order.
        #[test]
        fn any_split_merged_in_any_order_with_duplicates_gives_the_same_bits(
            samples in 1u32..1500,
            cuts in prop::collection::vec(0u32..94, 0..12),
            again in prop::collection::vec((0u32..94, 1u32..40), 0..4),
            key in any::<u32>(),
        ) {
            let whole = folded(&[[0, samples]]);
            let mut ends: Vec<u32> = cuts.iter().map(|c| (c * BLOCK).min(samples)).collect();
            ends.extend([0, samples]);
            ends.sort_unstable();
            let mut ranges: Vec<[u32; 2]> = ends.windows(2).map(|w| [w[0], w[1]]).collect();
            ranges.extend(again.iter().map(|&(start, blocks)| {
                [start * BLOCK, (start + blocks) * BLOCK].map(|s| s.min(samples))
            }));
            ranges.retain(|range| range[0] < range[1]);
            ranges.sort_by_key(|range| rng::hash_combine(range[0] * 2000 + range[1], key));
            let mut merged = empty();
            ranges.iter().for_each(|&range| merged.merge(folded(&[range])));
            prop_assert!(same(&merged, &whole));
            prop_assert_eq!(merged.samples(), samples);
        }

        /// Parts end anywhere, also within blocks.
        #[test]
        fn any_splitting_of_the_samples_in_order_gives_the_same_bits(
            samples in 1u32..600,
            cuts in prop::collection::vec(0u32..600, 0..12),
        ) {
            let mut ends: Vec<u32> = cuts.into_iter().filter(|&cut| cut < samples).collect();
            ends.extend([0, samples]);
            ends.sort_unstable();
            let ranges: Vec<[u32; 2]> = ends.windows(2).map(|w| [w[0], w[1]]).collect();
            prop_assert!(same(&folded(&ranges), &folded(&[[0, samples]])));
        }
    }

    #[test]
    fn a_later_state_of_a_block_replaces_an_earlier_one() {
        let whole = folded(&[[0, 48]]);
        let mut tile = folded(&[[0, 20]]);
        tile.merge(folded(&[[16, 48]]));
        assert!(same(&tile, &whole));
        tile.merge(folded(&[[0, 23]]));
        assert!(same(&tile, &whole));
    }
}
