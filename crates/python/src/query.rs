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
    /// Answers every ray: `query` answers a piece, `store` puts an answer in its place.
    pub fn answer<A: Clone + Default, W: Send>(
        &self,
        cancel: &Cancel,
        width: usize,
        answers: &mut [W],
        query: impl Fn(Rays<P::Tag>, &mut [A]) + Sync,
        store: impl Fn(&A, &mut [W]) + Sync,
    ) -> Result<(), Stopped> {
        let piece = |(i, answers): (usize, &mut [W])| {
            cancel.check()?;
            let first = i * PIECE;
            let found = self.with_piece(first..first + answers.len() / width, |rays| {
                let mut found = vec![A::default(); rays.len()];
                query(rays, &mut found);
                found
            });
            found.iter().zip(answers.chunks_exact_mut(width)).for_each(|(answer, place)| store(answer, place));
            Ok(())
        };
        if self.rays.len() <= PIECE {
            return answers.chunks_mut(PIECE * width).enumerate().try_for_each(piece);
        }
        answers.par_chunks_mut(PIECE * width).enumerate().try_for_each(piece)
    }

    /// Every hit of every ray.
    pub fn all(
        &self,
        cancel: &Cancel,
        query: impl Fn(Rays<P::Tag>) -> AllHits<P::Tag> + Sync,
    ) -> Result<Vec<AllHits<P::Tag>>, Stopped> {
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

    fn with_piece<T>(&self, range: Range<usize>, query: impl Fn(Rays<P::Tag>) -> T) -> T {
        let (mut rays, mut masks) = (Vec::with_capacity(range.len()), Vec::new());
        self.rays.read(range, &mut rays, &mut masks);
        if let Some(invalid) = self.invalid {
            invalid.fetch_add(rays.iter().filter(|ray| !P::is_valid(ray)).count(), Ordering::Relaxed);
        }
        let batch = Rays::new(&rays);
        query(if masks.is_empty() { batch } else { batch.with_masks(&masks) })
    }
}
