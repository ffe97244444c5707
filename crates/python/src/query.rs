//! Queries over the rays of arrays: piece by piece, on all threads of a pool, until told to stop.

use crate::precision::Precision;
use crate::rays::RayView;
use crate::work::{Cancel, Stopped};
use rayon::prelude::*;
use snell_intersect::{AllHits, Grouping, Rays};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rays of a piece: less than a millisecond of work as a rule.
const PIECE: usize = 2048;

/// So few rays are asked by the calling thread.
pub const FEW: usize = 256;

/// A long list in pieces of [`PIECE`], the last may be shorter.
#[derive(Debug, Default)]
pub struct Pieces<T> {
    pieces: Vec<Vec<T>>,
    len: usize,
}

impl<T: Copy> Pieces<T> {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.len
    }

    /// One of them.
    #[inline(always)]
    pub fn get(&self, i: usize) -> &T {
        &self.pieces[i / PIECE][i % PIECE]
    }
}

impl<T: Clone> From<Vec<T>> for Pieces<T> {
    fn from(all: Vec<T>) -> Self {
        Self { len: all.len(), pieces: all.chunks(PIECE).map(<[T]>::to_vec).collect() }
    }
}

/// The rays of a query.
#[derive(Debug)]
pub struct Question<'a, P: Precision> {
    /// Which.
    pub rays: RayView<'a, P>,
    /// Whether neighbours are alike.
    pub grouping: Grouping,
    /// Rays that can hit nothing are counted here, if that was asked for.
    pub invalid: Option<&'a AtomicUsize>,
}

impl<P: Precision> Question<'_, P> {
    /// Answers every ray, in its place.
    pub fn answer<A: Send>(
        &self,
        cancel: &Cancel,
        answers: &mut [A],
        query: impl Fn(Rays<P::Tag>, &mut [A]) + Sync,
    ) -> Result<(), Stopped> {
        let piece = |(i, answers): (usize, &mut [A])| {
            cancel.check()?;
            let range = i * PIECE..i * PIECE + answers.len();
            self.with_piece(range, |rays| query(rays, answers));
            Ok(())
        };
        if answers.len() <= PIECE {
            return answers.chunks_mut(PIECE).enumerate().try_for_each(piece);
        }
        answers.par_chunks_mut(PIECE).enumerate().try_for_each(piece)
    }

    /// The answers of every ray, piece by piece as they came: nothing is moved together.
    pub fn pieces<A: Clone + Default + Send>(
        &self,
        cancel: &Cancel,
        query: impl Fn(Rays<P::Tag>, &mut [A]) + Sync,
    ) -> Result<Pieces<A>, Stopped> {
        let answer = |rays: Rays<P::Tag>| {
            let mut found = vec![A::default(); rays.len()];
            query(rays, &mut found);
            found
        };
        Ok(Pieces { len: self.rays.len(), pieces: self.by_piece(cancel, answer)? })
    }

    /// Every hit of every ray.
    pub fn all(
        &self,
        cancel: &Cancel,
        query: impl Fn(Rays<P::Tag>) -> AllHits<P::Tag> + Sync,
    ) -> Result<Vec<AllHits<P::Tag>>, Stopped> {
        self.by_piece(cancel, query)
    }

    fn by_piece<T: Send>(&self, cancel: &Cancel, query: impl Fn(Rays<P::Tag>) -> T + Sync) -> Result<Vec<T>, Stopped> {
        let piece = |i: usize| {
            cancel.check()?;
            Ok(self.with_piece(i * PIECE..self.rays.len().min((i + 1) * PIECE), &query))
        };
        // Few rays may be asked outside of a pool.
        match self.rays.len().div_ceil(PIECE) {
            0 => Ok(Vec::new()),
            1 => Ok(vec![piece(0)?]),
            n => (0..n).into_par_iter().map(piece).collect(),
        }
    }

    fn with_piece<T>(&self, range: Range<usize>, query: impl FnOnce(Rays<P::Tag>) -> T) -> T {
        let (mut rays, mut masks) = (Vec::with_capacity(range.len()), Vec::new());
        self.rays.read(range, &mut rays, &mut masks);
        if let Some(invalid) = self.invalid {
            invalid.fetch_add(rays.iter().filter(|ray| !P::is_valid(ray)).count(), Ordering::Relaxed);
        }
        let batch = Rays::new(&rays);
        query(if masks.is_empty() { batch } else { batch.with_masks(&masks) })
    }
}
