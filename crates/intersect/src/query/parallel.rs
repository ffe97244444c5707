//! Queries over batches on all threads of the current rayon pool.
//!
//! A batch is divided into pieces, whose size is a multiple of the run length of [`Grouping`], and
//! each piece is an ordinary query, so results are the same for any number of threads and any size
//! of pieces. (Callers that run many batches in separate tasks use the [`World`] directly.)

#[cfg(test)]
mod tests;

use super::all::AllHits;
use super::queries::Queries;
use crate::precision::Precision;
use crate::search::points::Points;
use crate::search::rays::Rays;
use crate::search::{Grouping, HitFilter};
use crate::world::World;
use crate::world::double::DWorld;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// A multiple of the run length of coherent rays.
const RUN: usize = 64;

/// The least number of rays in a piece. A piece is an eighth of a thread's share, so that all
/// threads finish at about the same time.
const MIN_PIECE: usize = 4096;
/// The largest number of rays in a piece: large enough that incoherent rays can be sorted.
const MAX_PIECE: usize = 65536;

/// The largest number of rays in a piece if the query can be cancelled: about 20 milliseconds of
/// work in large worlds.
const MAX_PIECE_TO_CANCEL: usize = 16384;

/// The error of a query that was cancelled by its flag. Its results are only partly written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the query was cancelled")]
pub struct Cancelled;

/// The queries of a world on many threads. See [`World::parallel`].
#[derive(Clone, Copy, Debug)]
pub struct Parallel<'a, W = World> {
    world: &'a W,
    piece: Option<usize>,
    cancel: Option<&'a AtomicBool>,
}

impl World {
    /// The queries of this world on all threads of the current rayon pool. Results are the same,
    /// bit for bit.
    pub fn parallel(&self) -> Parallel<'_> {
        Parallel { world: self, piece: None, cancel: None }
    }
}

impl DWorld {
    /// The queries of this world on all threads of the current rayon pool; see [`World::parallel`].
    pub fn parallel(&self) -> Parallel<'_, Self> {
        Parallel { world: self, piece: None, cancel: None }
    }
}

/// The precision of a world; the types of its rays and results follow.
type Of<W> = <W as Queries>::Precision;
type HitOf<W> = <Of<W> as Precision>::Hit;
type DistanceOf<W> = <Of<W> as Precision>::Distance;
type NearestOf<W> = <Of<W> as Precision>::Nearest;

impl<'a, W: Queries> Parallel<'a, W> {
    /// Makes queries return [`Cancelled`] soon after the flag is set. It is checked before each
    /// piece of at most 16,384 rays, or 64 points, and during traversal.
    pub fn with_cancel(self, cancel: &'a AtomicBool) -> Self {
        Self { cancel: Some(cancel), ..self }
    }

    /// Sets the number of rays in a piece, rounded up to a multiple of 64. By default it follows
    /// from the size of the batch.
    pub fn with_piece(self, rays: usize) -> Self {
        Self { piece: rays.max(1).checked_next_multiple_of(RUN), ..self }
    }

    /// Finds the nearest hit of each ray; see [`World::closest`].
    ///
    /// # Errors
    /// If the flag was set.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn closest<'r>(
        &self,
        rays: impl Into<Rays<'r, Of<W>>>,
        grouping: Grouping,
        filter: &dyn HitFilter<Of<W>>,
        hits: &mut [HitOf<W>],
    ) -> Result<(), Cancelled> {
        let rays = self.cancellable(rays.into());
        self.write(rays.len(), self.piece(rays.len()), hits, |range, hits| {
            self.world.closest(rays.slice(range), grouping, filter, hits);
        })
    }

    /// For each ray, whether anything lies in its interval; see [`World::occluded`].
    ///
    /// # Errors
    /// If the flag was set.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded<'r>(
        &self,
        rays: impl Into<Rays<'r, Of<W>>>,
        grouping: Grouping,
        filter: &dyn HitFilter<Of<W>>,
        blocked: &mut [bool],
    ) -> Result<(), Cancelled> {
        let rays = self.cancellable(rays.into());
        self.write(rays.len(), self.piece(rays.len()), blocked, |range, blocked| {
            self.world.occluded(rays.slice(range), grouping, filter, blocked);
        })
    }

    /// The number of hits of each ray; see [`World::count`].
    ///
    /// # Errors
    /// If the flag was set.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn count<'r>(
        &self,
        rays: impl Into<Rays<'r, Of<W>>>,
        filter: &dyn HitFilter<Of<W>>,
        counts: &mut [u32],
    ) -> Result<(), Cancelled> {
        let rays = self.cancellable(rays.into());
        self.write(rays.len(), self.piece(rays.len()), counts, |range, counts| {
            self.world.count(rays.slice(range), filter, counts)
        })
    }

    /// Every hit of each ray; see [`World::all`].
    ///
    /// # Errors
    /// If the flag was set.
    pub fn all<'r>(
        &self,
        rays: impl Into<Rays<'r, Of<W>>>,
        filter: &dyn HitFilter<Of<W>>,
    ) -> Result<AllHits<Of<W>>, Cancelled> {
        let rays = self.cancellable(rays.into());
        let piece = self.piece(rays.len());
        let pieces = (0..rays.len().div_ceil(piece)).into_par_iter().map(|i| {
            self.check()?;
            let start = i * piece;
            Ok(self.world.all(rays.slice(start..rays.len().min(start + piece)), filter))
        });
        Ok(AllHits::concatenated(pieces.collect::<Result<_, _>>()?))
    }

    /// The nearest surface point to each point; see [`World::nearest_point`].
    ///
    /// # Errors
    /// If the flag was set.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn nearest_point<'p>(
        &self,
        points: impl Into<Points<'p, Of<W>>>,
        nearest: &mut [NearestOf<W>],
    ) -> Result<(), Cancelled> {
        let points = points.into();
        self.write(points.len(), RUN, nearest, |range, nearest| {
            self.world.nearest_point(points.slice(range), nearest)
        })
    }

    /// The distance of each point to the nearest surface, negative inside; see
    /// [`World::signed_distance`].
    ///
    /// # Errors
    /// If the flag was set.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn signed_distance<'p>(
        &self,
        points: impl Into<Points<'p, Of<W>>>,
        distances: &mut [DistanceOf<W>],
    ) -> Result<(), Cancelled> {
        let points = points.into();
        self.write(points.len(), RUN, distances, |range, distances| {
            self.world.signed_distance(points.slice(range), distances);
        })
    }

    /// The winding number around each point; see [`World::winding_number`].
    ///
    /// # Errors
    /// If the flag was set.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn winding_number<'p>(
        &self,
        points: impl Into<Points<'p, Of<W>>>,
        numbers: &mut [f64],
    ) -> Result<(), Cancelled> {
        let points = points.into();
        self.write(points.len(), RUN, numbers, |range, numbers| {
            self.world.winding_number(points.slice(range), numbers)
        })
    }

    /// For each point, whether it is inside; see [`World::occupancy`].
    ///
    /// # Errors
    /// If the flag was set.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occupancy<'p>(
        &self,
        points: impl Into<Points<'p, Of<W>>>,
        inside: &mut [bool],
    ) -> Result<(), Cancelled> {
        let points = points.into();
        self.write(points.len(), RUN, inside, |range, inside| {
            self.world.occupancy(points.slice(range), inside)
        })
    }

    /// The rays, with this query's flag set.
    fn cancellable<'r>(&'r self, rays: Rays<'r, Of<W>>) -> Rays<'r, Of<W>> {
        self.cancel.map_or(rays, |flag| rays.with_cancel(flag))
    }

    /// The number of rays in a piece of a batch of `rays`.
    fn piece(&self, rays: usize) -> usize {
        let most = if self.cancel.is_some() { MAX_PIECE_TO_CANCEL } else { MAX_PIECE };
        let share = rays / (8 * rayon::current_num_threads());
        self.piece.unwrap_or_else(|| share.next_multiple_of(RUN).clamp(MIN_PIECE, most))
    }

    /// Calls `query` for each piece of the results, with the range of the piece.
    fn write<T: Send>(
        &self,
        count: usize,
        piece: usize,
        answers: &mut [T],
        query: impl Fn(Range<usize>, &mut [T]) + Sync,
    ) -> Result<(), Cancelled> {
        assert_eq!(count, answers.len(), "one answer per ray or point");
        answers.par_chunks_mut(piece).enumerate().try_for_each(|(i, answers)| {
            self.check()?;
            query(i * piece..i * piece + answers.len(), answers);
            Ok(())
        })?;
        // The flag may have been set during the last pieces.
        self.check()
    }

    fn check(&self) -> Result<(), Cancelled> {
        match self.cancel {
            Some(flag) if flag.load(Ordering::Relaxed) => Err(Cancelled),
            _ => Ok(()),
        }
    }
}
