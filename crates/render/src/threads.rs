//! The number of threads, and loops that several threads share.

use std::num::NonZeroUsize;

/// The largest number of threads that may be requested.
pub const MAX: usize = 4096;

/// The largest number of threads that is chosen by default.
const MAX_UNASKED: usize = 1024;

/// The default number of threads: one for each core that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZeroUsize::get).min(MAX_UNASKED)
}

/// Runs `work` on this many threads, or on as many as the system can start. `work` must take items
/// from a shared supply until none is left, so that fewer threads still do everything.
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
