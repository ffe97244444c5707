//! The time that a stopped render has to finish its current parts.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
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
    /// How often [`Self::is_stuck`] was asked since the last sign. Looks are counted, not time, so
    /// that a process that was stopped, or had no processor, is not taken for stuck.
    looks: AtomicU32,
    was_stuck: AtomicBool,
}

impl Default for Pulse {
    fn default() -> Self {
        let (looks, was_stuck) = (AtomicU32::new(0), AtomicBool::new(false));
        Self { start: Instant::now(), looks, was_stuck }
    }
}

impl Pulse {
    /// Notes a sign of life; to be called whenever the render asks whether to go on.
    pub fn beat(&self) {
        self.looks.store(0, Ordering::Relaxed);
    }

    /// True if the time limit is over, and there was no sign of life for as long again, and for at
    /// least ten seconds. Without a limit, nothing is stuck. Only [`with_patience`] may ask, which
    /// does so at intervals.
    pub fn is_stuck(&self, limit: Option<Duration>) -> bool {
        let silence = LOOK * (self.looks.fetch_add(1, Ordering::Relaxed) + 1);
        let is_stuck =
            limit.is_some_and(|limit| self.start.elapsed() > limit && silence > limit.max(LONG));
        self.was_stuck.fetch_or(is_stuck, Ordering::Relaxed);
        is_stuck
    }

    /// True if [`Self::is_stuck`] was ever true.
    pub fn was_stuck(&self) -> bool {
        self.was_stuck.load(Ordering::Relaxed)
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
        let (pulse, moment) = (Pulse::default(), Some(Duration::from_nanos(1)));
        let looks = LONG.div_duration_f64(LOOK) as usize;
        for round in 0..2 {
            assert!((0..looks).all(|_| !pulse.is_stuck(moment)), "round {round}");
            pulse.beat();
        }
        let later = Some(Duration::from_secs(3600));
        assert!((0..=looks).all(|_| !pulse.is_stuck(None) && !pulse.is_stuck(later)));
        assert!(!pulse.was_stuck() && pulse.is_stuck(moment) && pulse.was_stuck());
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
