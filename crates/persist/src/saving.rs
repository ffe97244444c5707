//! Renders that are saved from time to time.

use snell_render::{Job, Progress, Underway};
use std::sync::atomic::{AtomicBool, Ordering};

/// Something that is saved of a render on its way.
pub trait Saved: Send + Sync {
    /// True if it is time to save.
    fn is_due(&self) -> bool;

    /// Saves. A failure must not end the render; the text is a warning.
    #[must_use]
    fn save(&mut self, underway: &Underway, job: &Job) -> Option<String>;
}

/// Continues a render as [`Job::go_on`] does, saves what is due on the way, and saves everything if
/// the render is finished or `keep_going` has stopped it. Returns true if it is not finished.
pub fn go_on(
    job: &Job,
    underway: &mut Underway,
    until: u32,
    threads: usize,
    keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    saved: &mut [&mut dyn Saved],
    warn: &mut dyn FnMut(String),
) -> bool {
    loop {
        let is_stopped = AtomicBool::new(false);
        let goes_on = |progress: &Progress| {
            let goes_on = keep_going(progress);
            is_stopped.fetch_or(!goes_on, Ordering::Relaxed);
            goes_on && !saved.iter().any(|saved| saved.is_due())
        };
        let is_left = job.go_on(underway, until, threads, &goes_on);
        let is_end = !is_left || is_stopped.load(Ordering::Relaxed);
        for saved in saved.iter_mut().filter(|saved| is_end || saved.is_due()) {
            saved.save(underway, job).into_iter().for_each(&mut *warn);
        }
        if is_end || underway.samples() >= until {
            return is_left;
        }
    }
}
