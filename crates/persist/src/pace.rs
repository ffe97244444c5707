//! When something is saved next.

use std::time::{Duration, Instant};

/// Rendering takes at least this many times the time of saving.
const SHARE: u32 = 100;

/// Says when something is saved next: after an interval, and so rarely that rendering takes at
/// least a hundred times as long as saving.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    interval: Duration,
    next: Instant,
}

impl Pace {
    /// The pace of something that is saved for the first time after `interval`.
    pub fn new(interval: Duration) -> Self {
        Self { interval, next: Instant::now() + interval }
    }

    /// True if it is time to save.
    pub fn is_due(&self) -> bool {
        Instant::now() >= self.next
    }

    /// Saves, and waits the longer the more time that takes.
    pub fn save<T>(&mut self, save: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let saved = save();
        self.next = Instant::now() + self.interval.max(start.elapsed() * SHARE);
        saved
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_long_is_saved_rarely() {
        let interval = Duration::from_millis(1);
        let mut pace = Pace::new(interval);
        std::thread::sleep(2 * interval);
        assert!(pace.is_due());
        pace.save(|| std::thread::sleep(Duration::from_millis(20)));
        std::thread::sleep(100 * interval);
        assert!(!pace.is_due());
    }
}
