//! The blocks of a tree's triangles, in the plain form that kernels use or in the
//! [compact](crate::tree::compact) form.

use super::compact::{BlocksAt, Line, SPARE_LINES, ids_from, lines_from, pack};
use super::storage::{Plain, Storage};
use crate::tree::block::TriangleBlock;
use rayon::prelude::*;
use snell_math::Bounds3;
use snell_math::simd::{Lanes8, Portable, Portable8};
use std::mem::MaybeUninit;

// SAFETY: numbers of 32 bits without padding: 16 in 64 bytes.
unsafe impl Plain for Line {}

/// The blocks of a tree.
#[derive(Clone, Debug)]
pub(crate) enum Blocks {
    /// Blocks in the form that kernels use. Block numbers are indices of blocks.
    Plain(Storage<TriangleBlock>),
    /// Compact records, and how many there are. Block numbers are indices of lines; [`SPARE_LINES`]
    /// follow the last record.
    Compact(Storage<Line>, usize),
}

impl Blocks {
    /// No blocks.
    pub fn none() -> Self {
        Self::Plain(Storage::unset(0))
    }

    /// Blocks in the plain form.
    #[cfg(test)]
    pub fn of(blocks: &[TriangleBlock]) -> Self {
        let mut all = Storage::unset(blocks.len());
        all.copy_from_slice(blocks);
        Self::Plain(all)
    }

    #[inline(always)]
    pub fn at(&self) -> BlocksAt {
        match self {
            Self::Plain(blocks) => BlocksAt::blocks(blocks),
            Self::Compact(lines, _) => BlocksAt::lines(lines),
        }
    }

    /// An upper bound, exclusive, on block numbers.
    #[inline(always)]
    pub fn end(&self) -> usize {
        match self {
            Self::Plain(blocks) => blocks.len(),
            Self::Compact(lines, _) => lines.len().saturating_sub(SPARE_LINES),
        }
    }

    #[inline(always)]
    fn check(&self, number: usize) {
        assert!(number < self.end(), "there is no block {number}");
    }

    /// The block with this number, unpacked into `room` if it is compact.
    #[inline(always)]
    pub fn get<'a>(
        &'a self,
        number: usize,
        room: &'a mut MaybeUninit<TriangleBlock>,
    ) -> &'a TriangleBlock {
        self.unpacked::<Portable8>(Portable, number, room)
    }

    /// Performs [`Self::get`] with the SIMD instructions of `L`.
    #[inline(always)]
    pub fn unpacked<'a, L: Lanes8>(
        &'a self,
        token: L::Token,
        number: usize,
        room: &'a mut MaybeUninit<TriangleBlock>,
    ) -> &'a TriangleBlock {
        self.check(number);
        // SAFETY: `check` has found `number` below `end`: it counts a plain block, or a line with
        // `SPARE_LINES` more behind it, and no more is read whatever these contain.
        unsafe { self.at().block::<L>(token, number, room) }
    }

    /// The corners of the triangle in a lane of a block.
    #[inline(always)]
    pub fn corners(&self, number: usize, lane: usize) -> [[f32; 3]; 3] {
        self.check(number);
        // SAFETY: `check` has found `number` below `end`: it counts a plain block, or a line with
        // `SPARE_LINES` more behind it.
        unsafe { self.at().corners(number, lane) }
    }

    /// The number within the group of the triangle in a lane of a block.
    #[inline(always)]
    pub fn id(&self, number: usize, lane: usize) -> u32 {
        self.check(number);
        // SAFETY: `check` has found `number` below `end`: it counts a plain block, or a line with
        // `SPARE_LINES` more behind it.
        unsafe { self.at().id(number, lane) }
    }

    /// The numbers of all blocks.
    pub fn numbers(&self) -> impl Iterator<Item = usize> {
        let mut next = 0;
        std::iter::from_fn(move || {
            let number = next;
            (number < self.end()).then(|| {
                next = self.after(number);
                number
            })
        })
    }

    /// The number of the block after this one.
    fn after(&self, number: usize) -> usize {
        match self {
            Self::Plain(_) => number + 1,
            Self::Compact(lines, _) => number + lines_from(&lines[number]),
        }
    }

    /// The numbers of a block's triangles; `u32::MAX` in lanes that are not used.
    pub fn ids(&self, number: usize) -> [u32; 8] {
        match self {
            Self::Plain(blocks) => blocks[number].ids,
            Self::Compact(lines, _) => ids_from(&lines[number]),
        }
    }

    pub fn is_compact(&self) -> bool {
        matches!(self, Self::Compact(..))
    }

    /// The number of blocks.
    pub fn count(&self) -> usize {
        match self {
            Self::Plain(blocks) => blocks.len(),
            Self::Compact(_, count) => *count,
        }
    }

    /// Compact blocks from an untrusted source. `None` unless records follow each other to the end
    /// and no triangle number reaches the given count.
    pub fn checked(lines: Storage<Line>, triangles: usize) -> Option<Self> {
        let blocks = Self::Compact(lines, 0);
        let (mut count, mut end) = (0, 0);
        for number in blocks.numbers() {
            (count, end) = (count + 1, blocks.after(number));
            if !ids_exist(&blocks.ids(number), triangles) {
                return None;
            }
        }
        match blocks {
            Self::Compact(lines, _) if lines.is_empty() || end + SPARE_LINES == lines.len() => {
                Some(Self::Compact(lines, count))
            }
            _ => None,
        }
    }

    pub fn memory_bytes(&self) -> usize {
        self.bytes().len()
    }

    /// The blocks as bytes in memory.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Plain(blocks) => blocks.bytes(),
            Self::Compact(lines, _) => lines.bytes(),
        }
    }

    /// A copy in which each block was modified by `change`, which returns the box of the block; and
    /// these boxes, indexed by block number. `None` if a modified block no longer fits its compact
    /// record.
    pub fn changed(
        &self,
        change: impl Fn(&mut TriangleBlock) -> Bounds3 + Send + Sync,
    ) -> Option<(Self, Vec<Bounds3>)> {
        let mut lines = match self {
            Self::Plain(blocks) => {
                let mut blocks = blocks.clone();
                let bounds = blocks.par_iter_mut().map(change).collect();
                return Some((Self::Plain(blocks), bounds));
            }
            Self::Compact(lines, _) => lines.clone(),
        };
        let mut bounds = vec![Bounds3::EMPTY; self.end()];
        let numbers: Vec<usize> = self.numbers().collect();
        let mut records = Vec::with_capacity(numbers.len());
        let (mut lines_left, mut bounds_left) = (&mut lines[..], &mut bounds[..]);
        for &number in &numbers {
            let count = lines_from(&lines_left[0]);
            let (own, rest) = lines_left.split_at_mut(count);
            let (bound, rest_bounds) = bounds_left.split_at_mut(count);
            records.push((number, own, &mut bound[0]));
            (lines_left, bounds_left) = (rest, rest_bounds);
        }
        let change = |(number, own, bounds): (usize, &mut [Line], &mut Bounds3)| {
            let mut block = *self.get(number, &mut MaybeUninit::uninit());
            *bounds = change(&mut block);
            pack(&block, own)
        };
        let fits = records.into_par_iter().all(change);
        fits.then_some((Self::Compact(lines, numbers.len()), bounds))
    }
}

/// True if all triangle numbers of a block are valid in a group of this many triangles.
pub(crate) fn ids_exist(ids: &[u32; 8], triangles: usize) -> bool {
    ids.iter().all(|&id| id == u32::MAX || (id as usize) < triangles)
}
