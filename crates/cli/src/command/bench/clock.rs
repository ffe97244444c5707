//! Clocks, threads and medians.

use crate::threads::cores;
use rayon::ThreadPool;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Limits on the number of rays that a thread takes at a time. Within these limits, a thread takes
/// an eighth of its share, so that all threads end at about the same time.
pub const MIN_PIECE: usize = 4096;
const MAX_PIECE: usize = 65536;

/// The number of rays that each of `threads` threads takes at a time: a multiple of 64.
fn piece(count: usize, threads: usize) -> usize {
    if threads == 1 {
        MAX_PIECE
    } else {
        (count / (8 * threads)).next_multiple_of(64).clamp(MIN_PIECE, MAX_PIECE)
    }
}

/// The clock of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Clock {
    /// Wall-clock time.
    Wall,
    /// Processor time, averaged over all threads: other load on the machine counts less.
    Processor,
}

impl Clock {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Wall => "wall",
            Self::Processor => "processor",
        }
    }
}

/// The requested numbers of threads, by default 1 and one per core.
pub fn thread_counts(asked: &[u32]) -> Vec<usize> {
    let cores = cores();
    match asked {
        [] if cores > 1 => vec![1, cores],
        [] => vec![1],
        _ => asked.iter().map(|&n| n as usize).collect(),
    }
}

/// A pool of this many threads.
pub fn pool(threads: usize) -> Result<ThreadPool, String> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| format!("cannot start {threads} threads: {e}; ask for fewer"))
}

/// Calls `work`; returns its result and the processor time it took in seconds.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = thread_time();
    let result = work();
    (result, thread_time().saturating_sub(start).as_secs_f64().max(1e-9))
}

/// Calls `work` on pieces of two slices of equal length; each thread of the pool repeatedly takes
/// the next piece. Returns the seconds it took.
pub fn time_pieces<A: Sync, B: Send>(
    pool: &ThreadPool,
    clock: Clock,
    input: &[A],
    output: &mut [B],
    work: &(impl Fn(&[A], &mut [B]) + Sync),
) -> f64 {
    let piece = piece(input.len(), pool.current_num_threads());
    let pieces = Mutex::new(input.chunks(piece).zip(output.chunks_mut(piece)));
    let next = || pieces.lock().unwrap_or_else(|e| e.into_inner()).next();
    let start = Instant::now();
    let processor: Vec<Duration> = pool.broadcast(|_| {
        let start = thread_time();
        while let Some((input, output)) = next() {
            work(input, output);
        }
        thread_time().saturating_sub(start)
    });
    let seconds = match clock {
        Clock::Wall => start.elapsed().as_secs_f64(),
        Clock::Processor => {
            processor.iter().sum::<Duration>().as_secs_f64() / processor.len() as f64
        }
    };
    // A clock may be too coarse for a tiny batch.
    seconds.max(1e-9)
}

/// Processor time of this thread; wall-clock time where the system does not report it.
pub fn thread_time() -> Duration {
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    {
        use nix::time::{ClockId, clock_gettime};
        if let Ok(time) = clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID) {
            return Duration::from(time);
        }
    }
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}

/// The median; for an even number of values, the mean of the middle two. NaN if there are none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    match n {
        0 => f64::NAN,
        _ if n % 2 == 1 => sorted[n / 2],
        _ => (sorted[n / 2 - 1] + sorted[n / 2]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_piece_is_worked_on_once() {
        let input: Vec<u32> = (0..10_000).collect();
        let mut output = vec![0; input.len()];
        let pool = pool(3).expect("three threads");
        let seconds = time_pieces(
            &pool,
            Clock::Processor,
            &input,
            &mut output,
            &|a: &[u32], b: &mut [u32]| {
                for (a, b) in a.iter().zip(b) {
                    *b += a + 1;
                }
            },
        );
        assert!(seconds > 0.0);
        assert!(output.iter().zip(&input).all(|(b, a)| *b == a + 1));
    }

    #[test]
    fn threads_take_large_pieces_but_several_each() {
        assert_eq!(piece(1 << 20, 1), 65536);
        assert_eq!(piece(1 << 20, 4), 32768);
        assert_eq!(piece(320_000, 4), 10048);
        assert_eq!(piece(10, 64), 4096);
    }

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&[]).is_nan());
    }
}
