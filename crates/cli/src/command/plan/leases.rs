//! Leases: which worker renders which task.
//!
//! A lease is a file that only one worker can create. Its owner changes it every few seconds. A
//! lease that has not changed for a while, by the clock of the one who looks, is that of a dead
//! worker. No times are compared between machines, so clocks may be wrong. If two workers render a
//! task nevertheless, the picture is the same.

use snell_formats::atomic;
use std::collections::HashMap;
use std::fs::OpenOptions;
use std::io::{ErrorKind, Result, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// An owner changes its lease this often while it may be silent.
const BEATS: u32 = 4;

/// What a worker knows of the leases of others.
pub struct Leases {
    worker: String,
    /// The longest time without change of the lease of a living worker.
    patience: Duration,
    seen: HashMap<PathBuf, Seen>,
}

struct Seen {
    content: Vec<u8>,
    /// When this content was first seen.
    since: Instant,
    /// When the lease was first seen.
    first: Instant,
}

/// The lease of a task that this worker renders. It is kept alive until it is dropped.
pub struct Lease {
    path: PathBuf,
    worker: String,
    stop: Option<Sender<()>>,
    beat: Option<std::thread::JoinHandle<()>>,
}

/// What a lease of another worker looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Other {
    /// Its owner is alive, and has had it for this long at least.
    Alive(Duration),
    /// Its owner is dead.
    Dead,
    /// There is none any more.
    Gone,
}

impl Leases {
    /// The leases as `worker` sees them.
    pub fn new(worker: &str, patience: Duration) -> Self {
        Self { worker: worker.into(), patience, seen: HashMap::new() }
    }

    /// Takes a lease that nobody has; `None` if somebody has it.
    pub fn take(&self, path: &Path) -> Result<Option<Lease>> {
        match OpenOptions::new().write(true).create_new(true).open(path) {
            Ok(mut file) => {
                file.write_all(content(&self.worker, 0).as_bytes())?;
                Ok(Some(self.keep(path)))
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Takes the lease of a dead worker, or of one that takes too long.
    pub fn take_over(&mut self, path: &Path) -> Result<Lease> {
        self.seen.remove(path);
        let text = content(&self.worker, 0);
        atomic::write_with(path, |out| out.write_all(text.as_bytes()))
            .map_err(std::io::Error::other)?;
        Ok(self.keep(path))
    }

    /// Looks at the lease of another worker.
    pub fn look(&mut self, path: &Path) -> Other {
        let Ok(content) = std::fs::read(path) else {
            self.seen.remove(path);
            return Other::Gone;
        };
        let now = Instant::now();
        let new = || Seen { content: content.clone(), since: now, first: now };
        let seen = self.seen.entry(path.into()).or_insert_with(new);
        if seen.content != content {
            (seen.content, seen.since) = (content, now);
        }
        match now - seen.since > self.patience {
            true => Other::Dead,
            false => Other::Alive(now - seen.first),
        }
    }

    fn keep(&self, path: &Path) -> Lease {
        let (stop, stopped) = channel();
        let (worker, path) = (self.worker.clone(), path.to_path_buf());
        let (pause, place) = (self.patience / BEATS, path.clone());
        let name = worker.clone();
        let beat = move || {
            for number in 1u64.. {
                match stopped.recv_timeout(pause) {
                    Err(RecvTimeoutError::Timeout) => {}
                    _ => break,
                }
                // If the folder is away for a moment, the next beat may come through. A lease that
                // somebody else has taken is left alone.
                if is_of(&place, &name) {
                    let file = OpenOptions::new().write(true).open(&place);
                    let _ = file.and_then(|mut f| f.write_all(content(&name, number).as_bytes()));
                }
            }
        };
        let beat = std::thread::Builder::new().name("lease".into()).spawn(beat).ok();
        Lease { path, worker, stop: Some(stop), beat }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(beat) = self.beat.take() {
            let _ = beat.join();
        }
        if is_of(&self.path, &self.worker) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// The content of a lease: JSON whose length never changes, so that it can be changed in place.
fn content(worker: &str, beat: u64) -> String {
    format!("{{\"worker\": {worker:?}, \"beat\": \"{beat:020}\"}}\n")
}

/// The worker that has a lease, if it can be read.
pub fn worker_of(path: &Path) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let value: serde_json::Value = serde_json::from_str(&text).ok()?;
    value["worker"].as_str().map(String::from)
}

/// True if a lease is that of this worker.
fn is_of(path: &Path, worker: &str) -> bool {
    let start = format!("{{\"worker\": {worker:?},");
    std::fs::read_to_string(path).is_ok_and(|text| text.starts_with(&start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lease_has_one_owner_and_outlives_only_the_living() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.lease");
        let patience = Duration::from_millis(400);
        let (a, mut b) = (Leases::new("a", patience), Leases::new("b", patience));
        let lease = a.take(&path).expect("it is writable").expect("nobody has it");
        assert_eq!(worker_of(&path).as_deref(), Some("a"));
        assert!(b.take(&path).expect("it is readable").is_none());
        let start = Instant::now();
        while start.elapsed() < 2 * patience {
            assert!(matches!(b.look(&path), Other::Alive(_)));
            std::thread::sleep(patience / 8);
        }
        drop(lease);
        assert_eq!(b.look(&path), Other::Gone);
        // A worker that was killed leaves its lease as it was.
        std::fs::write(&path, content("dead", 7)).expect("it is writable");
        assert!(matches!(b.look(&path), Other::Alive(_)));
        std::thread::sleep(patience + patience / 4);
        assert_eq!(b.look(&path), Other::Dead);
        let lease = b.take_over(&path).expect("it is writable");
        assert!(is_of(&path, "b"));
        // Somebody else takes it: it is not removed by its former owner.
        std::fs::write(&path, content("c", 0)).expect("it is writable");
        drop(lease);
        assert!(is_of(&path, "c"));
    }
}
