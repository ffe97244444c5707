//! Answers queries over arrays of rays, piece by piece, on all threads of a pool, until all are
//! answered or the query is cancelled.

use crate::columns::Places;
use crate::precision::Precision;
use crate::rays::RayView;
use crate::work::{Cancel, Stopped};
use rayon::prelude::*;
use snell_intersect::{AllHits, Grouping, Rays, world::BuildStats};
use snell_math::{DRay, DVec3};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Minimum number of rays of a piece: fewer are not worth handing to another thread.
const MIN_PIECE: usize = 512;

/// Maximum number of rays of a piece: these rays and their hits stay in the caches of a core.
const MAX_PIECE: usize = 2048;

/// Maximum number of rays of a piece in large worlds. There the world sorts the rays of a piece,
/// which is worthwhile for long pieces; a piece takes about 50 milliseconds in the largest worlds.
const MAX_PIECE_OF_LARGE_WORLD: usize = 32768;

/// Number of pieces per thread for a long list. There are several, so that all threads end at about
/// the same time.
const PIECES_PER_THREAD: usize = 8;

/// Worlds whose structures take at least this many bytes are large: they get larger pieces.
const LARGE_WORLD: u64 = 1 << 21;

/// Up to this number of rays, the calling thread answers the query.
pub const FEW: usize = 256;

/// Number of pairs of neighbouring rays that are tested for coherence.
const SAMPLES: usize = 32;

/// The rays of a query.
#[derive(Debug)]
pub struct Question<'a, P: Precision> {
    /// The rays.
    pub rays: RayView<'a, P>,
    /// Number of rays of a piece.
    pub piece: usize,
    /// Square of the angle in radians up to which neighbouring rays are traced together.
    pub coherent_angle: f64,
    /// The counter for rays that can hit nothing, if these are to be counted.
    pub invalid: Option<&'a AtomicUsize>,
    /// The counter for rays that are answered, if these are to be counted.
    pub done: Option<&'a AtomicUsize>,
}

/// Scratch space of a thread.
struct Scratch<P: Precision> {
    rays: Vec<P::Ray>,
    masks: Vec<u32>,
    times: Vec<f32>,
    hits: Vec<P::Hit>,
}

impl<P: Precision> Scratch<P> {
    fn new() -> Self {
        Self { rays: Vec::new(), masks: Vec::new(), times: Vec::new(), hits: Vec::new() }
    }
}

/// Number of rays of a piece, if `threads` threads share `rays` rays.
pub fn piece_size(rays: usize, threads: usize, world: &BuildStats) -> usize {
    let most = if world.memory_bytes >= LARGE_WORLD { MAX_PIECE_OF_LARGE_WORLD } else { MAX_PIECE };
    (rays / (threads * PIECES_PER_THREAD)).clamp(MIN_PIECE, most).next_multiple_of(64)
}

/// The square of the angle in radians up to which neighbouring rays are worth tracing together:
/// where a picture has about one pixel per triangle or more. (By measurement, both ways are equally
/// fast at 0.15 degrees for 70 thousand triangles, and at 0.04 degrees for a million.)
pub fn coherent_angle(world: &BuildStats) -> f64 {
    (0.475 / world.instanced_triangles.max(1) as f64).min(0.0027)
}

impl<P: Precision> Question<'_, P> {
    /// Writes the answer of every ray to the element of `answers` with the ray's index.
    pub fn answer<A: Send>(
        &self,
        cancel: &Cancel,
        answers: &mut [A],
        query: impl Fn(Rays<P::Tag>, Grouping, &mut [A]) + Sync,
    ) -> Result<(), Stopped> {
        let piece = |scratch: &mut Scratch<P>, (i, answers): (usize, &mut [A])| {
            cancel.check()?;
            let first = i * self.piece;
            self.with_piece(first..first + answers.len(), scratch, |rays, grouping, _| {
                query(rays, grouping, answers)
            });
            Ok(())
        };
        // A few rays may be processed outside a pool.
        if answers.len() <= self.piece {
            return answers
                .chunks_mut(self.piece)
                .enumerate()
                .try_for_each(|it| piece(&mut Scratch::new(), it));
        }
        answers.par_chunks_mut(self.piece).enumerate().try_for_each_init(Scratch::new, piece)
    }

    /// Writes the hit of every ray to the element with the ray's index.
    pub fn hits(
        &self,
        cancel: &Cancel,
        places: Places<'_, P>,
        query: impl Fn(Rays<P::Tag>, Grouping, &mut [P::Hit]) + Sync,
    ) -> Result<(), Stopped> {
        places.fill(self.piece, Scratch::new, |scratch, first, mut places| {
            cancel.check()?;
            self.with_piece(first..first + places.len(), scratch, |rays, grouping, hits| {
                if hits.len() < rays.len() {
                    hits.resize(rays.len(), P::Hit::default());
                }
                let hits = &mut hits[..rays.len()];
                query(rays, grouping, hits);
                places.write(hits);
            });
            Ok(())
        })
    }

    /// Every hit of every ray.
    pub fn all(
        &self,
        cancel: &Cancel,
        query: impl Fn(Rays<P::Tag>) -> AllHits<P::Tag> + Sync,
    ) -> Result<Vec<AllHits<P::Tag>>, Stopped> {
        let piece = |scratch: &mut Scratch<P>, i: usize| {
            cancel.check()?;
            let range = i * self.piece..self.rays.len().min((i + 1) * self.piece);
            Ok(self.with_piece(range, scratch, |rays, _, _| query(rays)))
        };
        match self.rays.len().div_ceil(self.piece) {
            0 => Ok(Vec::new()),
            1 => Ok(vec![piece(&mut Scratch::new(), 0)?]),
            n => (0..n).into_par_iter().map_init(Scratch::new, piece).collect(),
        }
    }

    fn with_piece<T>(
        &self,
        range: Range<usize>,
        scratch: &mut Scratch<P>,
        query: impl FnOnce(Rays<P::Tag>, Grouping, &mut Vec<P::Hit>) -> T,
    ) -> T {
        let Scratch { rays, masks, times, hits } = scratch;
        self.rays.read(range.clone(), rays, masks);
        self.rays.read_times(range, times);
        if let Some(invalid) = self.invalid {
            invalid
                .fetch_add(rays.iter().filter(|ray| !P::is_valid(ray)).count(), Ordering::Relaxed);
        }
        let grouping = if are_coherent::<P>(rays, self.coherent_angle) {
            Grouping::Coherent
        } else {
            Grouping::None
        };
        let batch = Rays::new(rays);
        let batch = if masks.is_empty() { batch } else { batch.with_masks(masks) };
        let batch = if times.is_empty() { batch } else { batch.with_times(times) };
        let answer = query(batch, grouping, hits);
        if let Some(done) = self.done {
            done.fetch_add(rays.len(), Ordering::Relaxed);
        }
        answer
    }
}

/// True if neighbouring rays have similar origins and directions, like the rays of pictures. The
/// result decides how rays are traced, but does not affect the hits.
fn are_coherent<P: Precision>(rays: &[P::Ray], angle_squared: f64) -> bool {
    let step = (rays.len() / SAMPLES).max(1);
    let pairs =
        || rays.windows(2).step_by(step).map(|pair| [P::exact(&pair[0]), P::exact(&pair[1])]);
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    pairs().for_each(|[ray, _]| (low, high) = (low.min(ray.origin), high.max(ray.origin)));
    let extent = (high - low).length_squared();
    let is_coherent = |[a, b]: [DRay; 2]| {
        let (dot, lengths) = (
            a.direction.dot(b.direction),
            a.direction.length_squared() * b.direction.length_squared(),
        );
        let sine = a.direction.cross(b.direction).length_squared();
        // The directions are within the angle, and the origins within a tenth of the extent.
        dot > 0.0
            && sine <= angle_squared * lengths
            && (a.origin - b.origin).length_squared() <= 0.01 * extent
    };
    let count = pairs().count();
    count >= 8 && 4 * pairs().filter(|pair| is_coherent(*pair)).count() >= 3 * count
}
