//! A lock that keeps two renders from saving to one file.

use snell_formats::atomic::Passing;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::Path;

/// The content of the file that is locked, by which it is known for one of Snell.
const CONTENT: &str = "A render of snell saves to the file beside this one.\n";

/// A file that is locked while this exists, and removed with it. The system unlocks it whatever
/// ends the program.
#[derive(Debug)]
pub struct Lock {
    // Removed before it is unlocked, so that nobody locks a file that is about to be removed.
    _passing: Passing,
    _file: File,
}

/// Why there is no lock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unlocked {
    /// Somebody else has it.
    Taken,
    /// Another file is in its place.
    Foreign,
    /// The folder or its system has no locks.
    Impossible,
}

impl Lock {
    /// Locks the file at `path`, which is made.
    pub(crate) fn take(path: &Path) -> Result<Self, Unlocked> {
        // Its last owner may remove it between these steps.
        for _ in 0..8 {
            if path.symlink_metadata().is_ok_and(|known| !known.is_file()) {
                return Err(Unlocked::Foreign);
            }
            let opened =
                OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
            let mut file = opened.map_err(|_| Unlocked::Impossible)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => return Err(Unlocked::Taken),
                // Where nothing is locked, nothing is left behind either.
                Err(TryLockError::Error(_)) => return Err(abandoned(&mut file, path)),
                Ok(()) => {}
            }
            if !is_at(&file, path) {
                continue;
            }
            return match is_ours(&mut file) {
                false => Err(Unlocked::Foreign),
                true => Ok(Self { _passing: Passing::new(path.into()), _file: file }),
            };
        }
        Err(Unlocked::Taken)
    }
}

/// Removes a file that could not be locked, if it is ours.
fn abandoned(file: &mut File, path: &Path) -> Unlocked {
    match is_ours(file) {
        true => {
            drop(Passing::new(path.into()));
            Unlocked::Impossible
        }
        false => Unlocked::Foreign,
    }
}

/// True if the file has our content, or the start of it, to which the rest is then added.
fn is_ours(file: &mut File) -> bool {
    let mut content = Vec::new();
    let read = (&*file).take(CONTENT.len() as u64 + 1).read_to_end(&mut content);
    if read.is_err() || !CONTENT.as_bytes().starts_with(&content) {
        return false;
    }
    if content.len() < CONTENT.len() {
        // A full disk is no reason not to render.
        let _ = file.rewind().and_then(|()| file.write_all(CONTENT.as_bytes()));
    }
    true
}

/// True if the name leads to this file still.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |known: std::fs::Metadata| (known.dev(), known.ino());
    let [open, named] = [file.metadata(), path.metadata()].map(|known| known.map(place).ok());
    open.is_some() && open == named
}

/// True if the name leads to this file still. An open file is not removed on other systems.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_has_the_lock_and_nothing_is_left_behind() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.lock");
        let lock = Lock::take(&path).expect("nobody has it");
        assert_eq!(Lock::take(&path).err(), Some(Unlocked::Taken));
        drop(lock);
        assert!(!path.exists());
        // One that was killed leaves its file, without a lock.
        std::fs::write(&path, CONTENT).expect("the folder is writable");
        drop(Lock::take(&path).expect("nobody has it"));
        assert!(!path.exists());
    }

    #[test]
    fn a_file_of_somebody_else_stays() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("Cargo.lock");
        std::fs::write(&path, "mine").expect("the folder is writable");
        assert_eq!(Lock::take(&path).err(), Some(Unlocked::Foreign));
        assert_eq!(std::fs::read(&path).expect("it is there"), b"mine");
        let nowhere = folder.path().join("no/a.lock");
        assert_eq!(Lock::take(&nowhere).err(), Some(Unlocked::Impossible));
    }
}
