//! Limits rendering to the speed at which pages show pictures: a picture that waits is outdated.

use crate::session::lock;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// The newest picture that the fastest page has shown, and the speed of its line.
#[derive(Debug)]
pub struct Pace {
    shown: Mutex<u32>,
    changed: Condvar,
    /// Bytes per second.
    line: Mutex<f64>,
}

impl Default for Pace {
    fn default() -> Self {
        // Lines are fast until one is not.
        Self { shown: Mutex::default(), changed: Condvar::default(), line: Mutex::new(1e9) }
    }
}

/// The share of a new measurement in the speed of a line that seems to become slower.
const SLOWING: f64 = 0.3;

/// True if picture `a` precedes picture `b`. Their numbers wrap around.
fn is_before(a: u32, b: u32) -> bool {
    a.wrapping_sub(b).cast_signed() < 0
}

impl Pace {
    /// Records that a page shows this picture.
    pub fn show(&self, number: u32) {
        let mut shown = lock(&self.shown);
        if is_before(*shown, number) {
            *shown = number;
            self.changed.notify_all();
        }
    }

    /// Records that a page got so many bytes in this time.
    pub fn measure(&self, bytes: usize, time: Duration) {
        let now = bytes as f64 / time.as_secs_f64().max(1e-6);
        let mut line = lock(&self.line);
        let share = if now < *line { SLOWING } else { 1.0 };
        *line += (now - *line) * share;
    }

    /// The number of bytes that the fastest page gets in so many seconds.
    pub fn bytes_within(&self, seconds: f64) -> usize {
        (*lock(&self.line) * seconds) as usize
    }

    /// True if a page has shown this picture or a later one.
    pub fn has_shown(&self, number: u32) -> bool {
        !is_before(*lock(&self.shown), number)
    }

    /// Waits until a page shows this picture or a later one, for at most `most`.
    pub fn wait_for(&self, number: u32, most: Duration) {
        let shown = lock(&self.shown);
        let is_late = |shown: &mut u32| is_before(*shown, number);
        drop(
            self.changed
                .wait_timeout_while(shown, most, is_late)
                .unwrap_or_else(PoisonError::into_inner),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    const LONG: Duration = Duration::from_secs(60);

    #[test]
    fn a_picture_that_is_shown_is_not_waited_for() {
        let pace = Pace::default();
        pace.show(7);
        // A page that lags behind the others shows an older picture.
        pace.show(3);
        pace.wait_for(7, LONG);
        pace.wait_for(u32::MAX, LONG);
        std::thread::scope(|scope| {
            scope.spawn(|| pace.wait_for(8, LONG));
            pace.show(8);
        });
    }

    #[test]
    fn a_line_is_as_fast_as_its_fastest_page() {
        let pace = Pace::default();
        for _ in 0..100 {
            pace.measure(10_000, Duration::from_millis(100));
        }
        assert!((9_900..11_000).contains(&pace.bytes_within(0.1)));
        pace.measure(10_000, Duration::from_millis(10));
        assert!((99_000..101_000).contains(&pace.bytes_within(0.1)));
    }

    #[test]
    fn a_page_that_shows_nothing_stops_nobody() {
        let (pace, start) = (Pace::default(), Instant::now());
        pace.wait_for(1, Duration::from_millis(5));
        assert!(start.elapsed() >= Duration::from_millis(5));
    }
}
