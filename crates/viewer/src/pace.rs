//! Limits rendering to the speed at which pages show pictures: a picture that waits is outdated.

use crate::session::lock;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// The newest picture that the fastest page has shown.
#[derive(Debug, Default)]
pub struct Pace {
    shown: Mutex<u32>,
    changed: Condvar,
}

/// True if picture `a` precedes picture `b`. Their numbers wrap around.
pub fn is_before(a: u32, b: u32) -> bool {
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
    fn a_page_that_shows_nothing_stops_nobody() {
        let (pace, start) = (Pace::default(), Instant::now());
        pace.wait_for(1, Duration::from_millis(5));
        assert!(start.elapsed() >= Duration::from_millis(5));
    }
}
