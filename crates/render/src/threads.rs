//! How many threads there are, and work that they share.

use std::num::NonZeroUsize;

/// Most threads that may be asked for.
pub const MAX: usize = 4096;

/// Most threads where no number is asked for.
const MAX_UNASKED: usize = 1024;

/// The number of threads where none is asked for: one for each core that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get).min(MAX_UNASKED)
}

/// Does work on this many threads, or on as many as the system lets start. Each takes from what
/// they share until nothing is left, so whoever is there does all of it.
pub(crate) fn on_threads(threads: usize, work: impl Fn() + Sync) {
    if threads <= 1 {
        return work();
    }
    std::thread::scope(|scope| {
        let start = || std::thread::Builder::new().spawn_scoped(scope, &work).ok();
        let started: Vec<_> = (0..threads).map_while(|_| start()).collect();
        if started.is_empty() {
            work();
        }
    });
}
