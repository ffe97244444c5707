//! What a worker waits for, and what it tries again.

use super::Worker;
use crate::command::plan::leases::Leases;
use crate::command::plan::shown;
use crate::failure::Failure;
use crate::interrupt;
use std::time::{Duration, Instant};

/// Pauses between two looks at a folder in which nothing is free.
pub(super) const PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];

/// For so long a result that cannot be written is kept and tried again.
const STUBBORN: Duration = Duration::from_secs(600);

impl Worker<'_> {
    /// Waits, the longer the more often.
    pub(super) fn pause(&self, pause: &mut Duration) {
        interrupt::wait((*pause).min(self.options.lease), 0);
        *pause = (*pause * 2).min(PAUSES[1]);
    }

    /// Does something with the folder, and tries again for some minutes if that fails: a disk may
    /// be full, or a share away for a moment.
    pub(super) fn insist<T>(
        &self,
        path: &std::path::Path,
        action: &mut dyn FnMut() -> std::io::Result<T>,
    ) -> Result<T, Failure> {
        let start = Instant::now();
        let mut pause = PAUSES[0];
        loop {
            let error = match action() {
                Ok(done) => return Ok(done),
                Err(error) => error,
            };
            let (problem, remedy) = match self.folder.is_there() {
                true => (format!("{}: {error}", shown(path)), "make room or repair the folder"),
                false => (
                    format!("{}: the plan is gone from its folder", shown(&self.folder.path)),
                    "bring it back, or start snell work with its new name",
                ),
            };
            if pause == PAUSES[0] {
                let minutes = STUBBORN.as_secs() / 60;
                eprintln!("warning: {problem}; trying again for {minutes} minutes: {remedy}");
            }
            if start.elapsed() > STUBBORN || interrupt::is_requested() {
                return Err(Failure::Other(format!("{problem}; {remedy}")));
            }
            pause = (pause * 2).min(PAUSES[1]);
            interrupt::wait(pause, 0);
        }
    }

    /// As [`Self::insist`], with the leases.
    pub(super) fn insist_mut<T>(
        &mut self,
        path: &std::path::Path,
        action: &mut dyn FnMut(&mut Leases) -> std::io::Result<T>,
    ) -> Result<T, Failure> {
        let nobody = Leases::new(&self.name, self.options.lease);
        let mut leases = std::mem::replace(&mut self.leases, nobody);
        let done = self.insist(path, &mut || action(&mut leases));
        self.leases = leases;
        done
    }

    pub(super) fn say(&self, line: String) {
        if !self.options.quiet {
            eprintln!("{}: {line}", self.name);
        }
    }
}
