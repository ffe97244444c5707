//! Work that several threads share.

/// Does work on this many threads, or on as many as the system lets start. Each takes from what
/// they share until nothing is left, so whoever is there does all of it.
pub fn on_threads(threads: usize, work: impl Fn() + Sync) {
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
