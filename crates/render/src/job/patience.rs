//! The time that a stopped render has to finish its current parts.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

/// The time for the current parts, of which most take milliseconds.
const PATIENCE: Duration = Duration::from_millis(500);

/// The interval at which `is_stopped` is asked.
const LOOK: Duration = Duration::from_millis(50);

/// A render whose time is over is stuck if no part was begun or done for this long, and for as long
/// as its whole time.
const LONG: Duration = Duration::from_secs(10);

/// The signs of life of a render. Its time limit lets the first pass end, however long that takes;
/// but where a single part takes longer than anything else, the pass would never end.
#[derive(Debug)]
pub struct Pulse {
    start: Instant,
    /// The milliseconds from the start to the last sign.
    last: AtomicU64,
    was_stuck: AtomicBool,
}

impl Default for Pulse {
    fn default() -> Self {
        Self { start: Instant::now(), last: AtomicU64::new(0), was_stuck: AtomicBool::new(false) }
    }
}

impl Pulse {
    /// Notes a sign of life; to be called whenever the render asks whether to go on.
    pub fn beat(&self) {
        let now = u64::try_from(self.start.elapsed().as_millis()).unwrap_or(u64::MAX);
        self.last.fetch_max(now, Ordering::Relaxed);
    }

    /// True if the time limit is over, and there was no sign of life for as long again, and for at
    /// least ten seconds. Without a limit, nothing is stuck.
    pub fn is_stuck(&self, limit: Option<Duration>) -> bool {
        let is_stuck = limit.is_some_and(|limit| self.is_late_and_silent(limit, limit.max(LONG)));
        self.was_stuck.fetch_or(is_stuck, Ordering::Relaxed);
        is_stuck
    }

    /// True if [`Self::is_stuck`] was ever true.
    pub fn was_stuck(&self) -> bool {
        self.was_stuck.load(Ordering::Relaxed)
    }

    fn is_late_and_silent(&self, limit: Duration, long: Duration) -> bool {
        let elapsed = self.start.elapsed();
        let last = Duration::from_millis(self.last.load(Ordering::Relaxed));
        elapsed > limit && elapsed.saturating_sub(last) > long
    }
}

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
    fn a_render_is_stuck_if_it_is_late_and_silent() {
        let (pulse, short) = (Pulse::default(), Duration::from_millis(20));
        let (day, step) = (Duration::from_secs(86400), short * 2);
        std::thread::sleep(step);
        assert!(pulse.is_late_and_silent(short, short) && !pulse.is_late_and_silent(day, short));
        assert!(!pulse.is_stuck(Some(short)) && !pulse.is_stuck(None));
        pulse.beat();
        assert!(!pulse.is_late_and_silent(short, day / 2));
        std::thread::sleep(step);
        assert!(pulse.is_late_and_silent(short, short));
    }

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
