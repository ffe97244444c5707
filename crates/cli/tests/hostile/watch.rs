//! Runs cases one by one and records how they end: panics, time, memory.

use super::render::End;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Time limit for a file. On an idle machine no file takes a quarter of it; a hang takes forever.
const LIMIT: Duration = Duration::from_secs(60);

/// The results so far.
#[derive(Default)]
pub struct Report {
    pub files: usize,
    pub pictures: usize,
    pub refused: usize,
    pub invalid_samples: u64,
    pub worst: (Duration, String),
    pub failures: Vec<String>,
}

impl Report {
    /// Runs one case. A case that hangs ends the whole test with its name.
    pub fn case(&mut self, name: &str, run: impl FnOnce() -> End) {
        let start = Instant::now();
        let (done, watch) = mpsc::channel::<()>();
        let watched = name.to_string();
        let watchdog = std::thread::spawn(move || {
            if watch.recv_timeout(LIMIT * 2) == Err(RecvTimeoutError::Timeout) {
                eprintln!("{watched}: hangs");
                std::process::exit(99);
            }
        });
        match catch_unwind(AssertUnwindSafe(run)) {
            Ok(End::Picture { invalid_samples }) => {
                self.pictures += 1;
                self.invalid_samples += invalid_samples;
            }
            Ok(End::Refused(message)) => {
                self.refused += 1;
                if ["decoder failed", "parser failed"].iter().any(|text| message.contains(text)) {
                    eprintln!("note: {message}");
                }
            }
            Err(panic) => {
                let text = panic.downcast_ref::<String>().cloned();
                let text = text.or_else(|| panic.downcast_ref::<&str>().map(|s| s.to_string()));
                self.failures.push(format!("{name}: {}", text.unwrap_or_default()));
            }
        }
        drop(done);
        watchdog.join().expect("the watchdog does not fail");
        self.files += 1;
        let time = start.elapsed();
        if time > self.worst.0 {
            self.worst = (time, name.to_string());
        }
        if time > LIMIT {
            self.failures.push(format!("{name}: took {time:?}"));
        }
    }

    pub fn add(&mut self, other: Self) {
        self.files += other.files;
        self.pictures += other.pictures;
        self.refused += other.refused;
        self.invalid_samples += other.invalid_samples;
        self.worst = std::mem::take(&mut self.worst).max(other.worst);
        self.failures.extend(other.failures);
    }

    /// Prints the numbers; returns the failures.
    pub fn conclude(self, what: &str) -> Vec<String> {
        eprintln!(
            "{what}: {} files: {} pictures ({} samples not finite), {} refused; longest {:?} ({}); \
                peak memory {} MB",
            self.files,
            self.pictures,
            self.invalid_samples,
            self.refused,
            self.worst.0,
            self.worst.1,
            peak_memory_bytes() >> 20
        );
        self.failures
    }
}

/// Peak resident memory of this process; 0 where the system does not report it.
fn peak_memory_bytes() -> u64 {
    #[cfg(unix)]
    {
        use nix::sys::resource::{UsageWho, getrusage};
        getrusage(UsageWho::RUSAGE_SELF).map_or(0, |u| u.max_rss() as u64 * 1024)
    }
    #[cfg(not(unix))]
    0
}
