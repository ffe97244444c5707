//! The blocks of a tree's triangles: as kernels take them, or [compact](crate::tree::compact).

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
    /// As kernels take them. Their numbers count them.
    Plain(Storage<TriangleBlock>),
    /// In less memory: this many. Their numbers count lines; [`SPARE_LINES`] follow the last.
    Compact(Storage<Line>, usize),
}

impl Blocks {
    /// None.
    pub fn none() -> Self {
        Self::Plain(Storage::unset(0))
    }

    /// Plain ones.
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

    /// Numbers are below this.
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

    /// A block, unpacked into `room` if it has to be.
    #[inline(always)]
    pub fn get<'a>(
        &'a self,
        number: usize,
        room: &'a mut MaybeUninit<TriangleBlock>,
    ) -> &'a TriangleBlock {
        self.unpacked::<Portable8>(Portable, number, room)
    }

    /// The same, with the instructions of `L`.
    #[inline(always)]
    pub fn unpacked<'a, L: Lanes8>(
        &'a self,
        token: L::Token,
        number: usize,
        room: &'a mut MaybeUninit<TriangleBlock>,
    ) -> &'a TriangleBlock {
        self.check(number);
        // SAFETY: it is there: whatever lines these are, those that are read with them are, too.
        unsafe { self.at().block::<L>(token, number, room) }
    }

    /// The corners of one triangle.
    #[inline(always)]
    pub fn corners(&self, number: usize, lane: usize) -> [[f32; 3]; 3] {
        self.check(number);
        // SAFETY: as in `unpacked`.
        unsafe { self.at().corners(number, lane) }
    }

    /// The number of one triangle within the group.
    #[inline(always)]
    pub fn id(&self, number: usize, lane: usize) -> u32 {
        self.check(number);
        // SAFETY: as in `unpacked`.
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

    /// The number after that of a block.
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

    /// Lines from an untrusted source, if records follow each other to the end and have no triangle
    /// numbers beyond the given count.
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

    /// The memory as it is.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Plain(blocks) => blocks.bytes(),
            Self::Compact(lines, _) => lines.bytes(),
        }
    }

    /// The same with each block changed by `change`, which returns its box; and these boxes, by the
    /// numbers of the blocks. `None` if one does not fit in its place.
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
