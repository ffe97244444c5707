//! The time that a stopped render has to finish its current parts.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// The time for the current parts, of which most take milliseconds.
const PATIENCE: Duration = Duration::from_millis(500);

/// The interval at which `is_stopped` is asked.
const LOOK: Duration = Duration::from_millis(50);

/// Runs `work` with a flag for [`super::Job::with_cancel`]. The flag is set half a second after
/// `is_stopped` first returns true.
pub fn with_patience<T>(
    is_stopped: impl Fn() -> bool + Sync,
    work: impl FnOnce(&AtomicBool) -> T,
) -> T {
    let cancel = AtomicBool::new(false);
    std::thread::scope(|scope| {
        // The sender is dropped when the work ends, even by a panic, which wakes the waiting
        // thread.
        let (_working, end) = mpsc::channel::<()>();
        let (is_stopped, cancel) = (&is_stopped, &cancel);
        scope.spawn(move || {
            let goes_on = |time| end.recv_timeout(time) == Err(RecvTimeoutError::Timeout);
            while goes_on(LOOK) {
                if is_stopped() {
                    goes_on(PATIENCE);
                    cancel.store(true, Ordering::Relaxed);
                    break;
                }
            }
        });
        work(cancel)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_does_not_end_is_cancelled() {
        let ended = with_patience(
            || true,
            |cancel| {
                let looks = (0..100).map(|_| std::thread::sleep(PATIENCE / 10));
                looks.into_iter().any(|()| cancel.load(Ordering::Relaxed))
            },
        );
        assert!(ended && with_patience(|| false, |cancel| !cancel.load(Ordering::Relaxed)));
    }
}
