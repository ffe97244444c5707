//! The order in which samples are taken. A part is a tile and a range of the tile's samples.

use crate::film::{BLOCK, TILE};

/// Ranges of sample numbers of one tile, in order. They are computed when needed, since a tile may
/// have a million of them.
#[derive(Clone, Copy, Debug)]
pub(super) enum Ranges {
    /// Ranges of whole blocks. Progressive renders start with smaller ranges, to show a first
    /// picture soon.
    Blocks { start: u32, end: u32, is_progressive: bool },
    /// Ranges of `step` samples, for one round of pixels that stop by their error.
    Round { start: u32, end: u32, step: u32 },
}

impl Ranges {
    /// The ranges of one round for a tile with this number of active pixels. With fewer pixels the
    /// ranges are longer.
    ///
    /// With `one_by_one`, no range has samples of two blocks.
    pub fn of_round([start, end]: [u32; 2], pixels: u64, one_by_one: bool) -> Self {
        let blocks = u64::from(TILE * TILE)
            .checked_div(pixels)
            .filter(|_| !one_by_one)
            .map_or(1, |blocks| blocks.clamp(1, 16) as u32);
        Self::Round { start, end: if pixels == 0 { start } else { end }, step: blocks * BLOCK }
    }

    /// The range with this number; `None` beyond the last.
    pub fn get(self, number: usize) -> Option<[u32; 2]> {
        let (start, end, ends) = match self {
            Self::Blocks { start, end, is_progressive } => {
                let first = ends_before(start, is_progressive);
                let end_of = |i: usize| end_of_block(i, is_progressive);
                let number = first.checked_add(number)?;
                (start, end, [number.checked_sub(1).map_or(Some(0), end_of)?, end_of(number)?])
            }
            Self::Round { start, end, step } => {
                let from = u32::try_from(number).ok()?.checked_mul(step)?.checked_add(start)?;
                (start, end, [from, from.saturating_add(step)])
            }
        };
        let range = [ends[0].max(start), ends[1].min(end)];
        (range[0] < range[1]).then_some(range)
    }

    /// All ranges, in order.
    pub fn all(self) -> impl Iterator<Item = [u32; 2]> {
        (0..).map_while(move |number| self.get(number))
    }

    /// The number of ranges.
    fn count(self) -> usize {
        match self {
            Self::Blocks { start, end, .. } | Self::Round { start, end, .. } if end <= start => 0,
            Self::Blocks { start, end, is_progressive } => {
                ends_before(end - 1, is_progressive) + 1 - ends_before(start, is_progressive)
            }
            Self::Round { start, end, step } => (end - start).div_ceil(step) as usize,
        }
    }
}

/// The end of the range with this number. Progressive ranges end at samples 1 and 4, then at whole
/// blocks; others end at whole blocks only.
fn end_of_block(number: usize, is_progressive: bool) -> Option<u32> {
    match (is_progressive, number) {
        (true, 0) => Some(1),
        (true, 1) => Some(4),
        (true, _) => end_of_block(number - 2, false),
        (false, _) => u32::try_from(number).ok()?.checked_add(1).map(|n| n.saturating_mul(BLOCK)),
    }
}

/// The number of ranges that end at or before a sample.
fn ends_before(sample: u32, is_progressive: bool) -> usize {
    match (is_progressive, sample) {
        (true, 0) => 0,
        (true, 1..4) => 1,
        _ => (sample / BLOCK) as usize + if is_progressive { 2 } else { 0 },
    }
}

/// The missing parts of a film: the first range of every tile, then the second range of every tile,
/// and so on.
#[derive(Debug)]
pub(super) struct Parts {
    order: Vec<usize>,
    ranges: Vec<Ranges>,
    passes: usize,
}

impl Parts {
    /// The parts of the tiles in this order, given the ranges of each tile.
    pub fn new(order: Vec<usize>, ranges: impl Fn(usize) -> Ranges) -> Self {
        let ranges: Vec<_> = (0..order.len()).map(ranges).collect();
        let passes = ranges.iter().map(|ranges| ranges.count()).max().unwrap_or(0);
        Self { order, ranges, passes }
    }

    /// A number above those of all parts.
    pub fn end(&self) -> usize {
        self.order.len().saturating_mul(self.passes)
    }

    /// The first sample of the first part of a tile; `None` if the tile has no parts.
    pub fn first(&self, tile: usize) -> Option<u32> {
        self.ranges[tile].get(0).map(|[start, _]| start)
    }

    /// Tile and range of samples of the part with this number. `None` if the tile has fewer ranges
    /// than other tiles.
    pub fn get(&self, number: usize) -> Option<(usize, [u32; 2])> {
        let tile = self.order[number % self.order.len()];
        self.ranges[tile].get(number / self.order.len()).map(|range| (tile, range))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_cover_all_samples_once() {
        for (start, end) in [
            (0, 1),
            (0, 3),
            (0, 4),
            (0, 16),
            (0, 17),
            (0, 64),
            (1, 40),
            (2, 40),
            (4, 5),
            (15, 64),
            (16, 33),
            (7, 7),
        ] {
            for is_progressive in [false, true] {
                let ranges: Vec<_> = Ranges::Blocks { start, end, is_progressive }.all().collect();
                check(&ranges, start, end);
                assert!(ranges.iter().all(|r| r[0] / BLOCK == (r[1] - 1) / BLOCK), "{ranges:?}");
                assert_eq!(ranges.len(), Ranges::Blocks { start, end, is_progressive }.count());
                assert!(
                    !is_progressive || start > 0 || end < 4 || ranges[..2] == [[0, 1], [1, 4]],
                    "{ranges:?}"
                );
            }
            for pixels in [0, 1, 20, 256] {
                let round = Ranges::of_round([start, end], pixels, false);
                let ranges: Vec<_> = round.all().collect();
                check(&ranges, start, if pixels == 0 { start } else { end });
                assert!(
                    Ranges::of_round([0, end], pixels, true).all().all(|r| r[1] - r[0] <= BLOCK)
                );
                assert_eq!(ranges.len(), round.count());
            }
        }
    }

    fn check(ranges: &[[u32; 2]], start: u32, end: u32) {
        let mut at = start;
        for range in ranges {
            assert!(range[0] == at && range[1] > at, "{ranges:?}");
            at = range[1];
        }
        assert_eq!(at, end, "{ranges:?}");
    }

    #[test]
    fn parts_come_pass_by_pass_and_are_not_listed() {
        let parts = Parts::new(vec![1, 0], |tile| Ranges::Blocks {
            start: 16 * tile as u32,
            end: 40,
            is_progressive: false,
        });
        let found: Vec<_> = (0..parts.end()).filter_map(|number| parts.get(number)).collect();
        assert_eq!(
            found,
            [(1, [16, 32]), (0, [0, 16]), (1, [32, 40]), (0, [16, 32]), (0, [32, 40])]
        );
        // The parts of an 8K picture with the largest number of samples.
        let parts = Parts::new((0..129_600).collect(), |_| Ranges::Blocks {
            start: 0,
            end: 1 << 24,
            is_progressive: false,
        });
        assert_eq!(parts.get(parts.end() - 1), Some((129_599, [(1 << 24) - BLOCK, 1 << 24])));
    }
}
