//! What a render saves on its way: its state, and a preview of the picture.

use super::checkpoint::Checkpoint;
use super::preview::Preview;
use crate::failure::Failure;
use snell_render::{Film, Job, Progress, Statistics};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Rendering takes at least this many times the time of saving.
const SHARE: u32 = 100;

/// What is saved on the way.
pub struct Saving<'a> {
    pub checkpoint: Option<Checkpoint<'a>>,
    pub preview: Option<Preview<'a>>,
}

/// When something is saved next.
struct Pace {
    interval: Duration,
    next: Option<Instant>,
}

impl Pace {
    fn new(interval: Option<Duration>) -> Self {
        let next = interval.map(|interval| Instant::now() + interval);
        Self { interval: interval.unwrap_or_default(), next }
    }

    fn is_due(&self) -> bool {
        self.next.is_some_and(|next| Instant::now() >= next)
    }

    /// Saves, and waits the longer the more time that takes.
    fn save(&mut self, save: impl FnOnce()) {
        let start = Instant::now();
        save();
        self.next = Some(Instant::now() + self.interval.max(start.elapsed() * SHARE));
    }
}

impl Saving<'_> {
    /// Renders until all samples are taken or `keep_going` returns false, and saves from time to
    /// time and at the end.
    pub fn run(
        &mut self,
        job: &Job,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Result<(Film, Statistics), Failure> {
        let settings = job.settings();
        let mut underway = match &self.checkpoint {
            Some(checkpoint) => checkpoint.begin(job, threads, keep_going)?,
            None => job.begin(threads, keep_going),
        };
        let mut states = Pace::new(self.checkpoint.as_ref().map(Checkpoint::interval));
        let mut previews = Pace::new(self.preview.as_ref().map(|_| Preview::INTERVAL));
        loop {
            let is_stopped = AtomicBool::new(false);
            let goes_on = |progress: &Progress| {
                let goes_on = keep_going(progress);
                is_stopped.fetch_or(!goes_on, Ordering::Relaxed);
                goes_on && !states.is_due() && !previews.is_due()
            };
            let is_left = job.go_on(&mut underway, settings.spp, threads, &goes_on);
            let is_end = !is_left || is_stopped.load(Ordering::Relaxed);
            if let Some(checkpoint) = self.checkpoint.as_mut().filter(|_| is_end || states.is_due())
            {
                states.save(|| checkpoint.save(&underway, settings));
            }
            if let Some(preview) = self.preview.as_mut().filter(|_| is_end || previews.is_due()) {
                previews.save(|| preview.write(&underway.film, job));
            }
            if is_end {
                return Ok((underway.film, underway.statistics));
            }
        }
    }
}
