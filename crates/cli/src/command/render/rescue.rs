//! Saves results that took long to make: if a result cannot be written to its place, a fallback is
//! used.

use crate::failure::Failure;
use crate::interrupt;
use snell_formats::error::one_line;
use snell_formats::{WriteError, atomic};
use std::ffi::OsString;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Longest file name on most systems, in bytes.
const MAX_NAME_BYTES: usize = 255;
/// Number of names that are tried in a folder.
const MAX_NAMES: u32 = 1000;

/// Writes a file as [`atomic::write_with()`] does; `what` describes it in messages, such as "the
/// picture". Returns true if the file is at `path`. If that fails, the file is written to the
/// current folder, or else to the folder for temporary files, under a free name that the message
/// reports. If neither works and the terminal is interactive, the user is asked once to make room.
pub fn write(
    path: &Path,
    what: &str,
    fill: &dyn Fn(&mut dyn Write) -> std::io::Result<()>,
) -> Result<bool, Failure> {
    let written = match reader(path) {
        Ok(_reader) => atomic::write_with(path, fill),
        Err(source) => Err(WriteError::Io { path: path.into(), source }),
    };
    let Err(error) = written else { return Ok(true) };
    if elsewhere(path, what, &error.to_string(), fill) {
        return Ok(false);
    }
    if !asked_to_make_room(what, &error) {
        return Err(error.into());
    }
    match atomic::write_with(path, fill) {
        Ok(()) => Ok(true),
        Err(error) if elsewhere(path, what, &error.to_string(), fill) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// Writes a file under a free name in the current folder or in the folder for temporary files, and
/// reports the place and the original problem. Returns false if neither works.
pub fn elsewhere(
    path: &Path,
    what: &str,
    problem: &str,
    fill: &dyn Fn(&mut dyn Write) -> std::io::Result<()>,
) -> bool {
    let folders = [Some(PathBuf::from(".")), Some(std::env::temp_dir())];
    let Some(place) =
        folders.into_iter().flatten().find_map(|folder| write_in(&folder, path, fill))
    else {
        return false;
    };
    eprintln!(
        "error: {}; {what} is saved as {} instead",
        one_line(problem),
        one_line(&place.display().to_string())
    );
    true
}

/// Waits for a reader of the pipe at `path`, if there is one, and keeps it open. A signal during
/// the wait is an error.
#[cfg(unix)]
fn reader(path: &Path) -> std::io::Result<Option<std::fs::File>> {
    use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
    if !std::fs::metadata(path).is_ok_and(|known| known.file_type().is_fifo()) {
        return Ok(None);
    }
    let known = interrupt::requests();
    let at_once = nix::fcntl::OFlag::O_NONBLOCK.bits();
    loop {
        match std::fs::OpenOptions::new().write(true).custom_flags(at_once).open(path) {
            Err(error) if error.raw_os_error() == Some(nix::errno::Errno::ENXIO as i32) => {}
            opened => return opened.map(Some),
        }
        interrupt::wait(Duration::from_millis(20), known);
        if interrupt::requests() > known {
            return Err(std::io::Error::other("nothing reads this pipe"));
        }
    }
}

#[cfg(not(unix))]
fn reader(_: &Path) -> std::io::Result<Option<std::fs::File>> {
    Ok(None)
}

fn write_in(
    folder: &Path,
    path: &Path,
    fill: &dyn Fn(&mut dyn Write) -> std::io::Result<()>,
) -> Option<PathBuf> {
    for number in 0..MAX_NAMES {
        let name = if number == 0 {
            path.file_name()?.into()
        } else {
            extended(path, &format!("-{number}"))
        };
        let place = folder.join(name);
        match atomic::write_new(&place, fill) {
            Ok(()) => return Some(place),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(_) => return None,
        }
    }
    None
}

/// The name of an incomplete picture: `a.partial.png` for `a.png`.
pub fn partial(path: &Path) -> PathBuf {
    path.with_file_name(extended(path, ".partial"))
}

/// A file name with an addition before its extension. If that would be too long, another name is
/// made.
fn extended(path: &Path, addition: &str) -> OsString {
    let extension = path
        .extension()
        .map(|extension| [".".as_ref(), extension].into_iter().collect::<OsString>());
    let with = |stem: &std::ffi::OsStr| {
        [stem, addition.as_ref(), extension.as_deref().unwrap_or_default()]
            .into_iter()
            .collect::<OsString>()
    };
    let name = with(path.file_stem().unwrap_or_default());
    if name.len() <= MAX_NAME_BYTES { name } else { with("picture".as_ref()) }
}

/// Asks the user to make room. True if the user answered; false without an interactive terminal, or
/// if the user gives up.
fn asked_to_make_room(what: &str, error: &WriteError) -> bool {
    if !has_person() || interrupt::is_requested() {
        return false;
    }
    eprintln!("error: {}; no other folder takes {what} either", one_line(&error.to_string()));
    eprintln!("Make room and press Enter to try once more, or Ctrl-C to give up.");
    let (answered, answer) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let _ = answered
            .send(std::io::stdin().read_line(&mut String::new()).is_ok_and(|bytes| bytes > 0));
    });
    loop {
        match answer.recv_timeout(Duration::from_millis(100)) {
            Ok(has_answer) => return has_answer,
            Err(std::sync::mpsc::RecvTimeoutError::Timeout) if !interrupt::is_requested() => {}
            Err(_) => return false,
        }
    }
}

/// True if standard input and the messages are a terminal that this program may read.
fn has_person() -> bool {
    let stdin = std::io::stdin();
    if !stdin.is_terminal() || !std::io::stderr().is_terminal() {
        return false;
    }
    // Reading would stop a background process.
    #[cfg(unix)]
    return nix::unistd::tcgetpgrp(stdin).is_ok_and(|group| group == nix::unistd::getpgrp());
    #[cfg(not(unix))]
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_whole_has_a_name_of_its_own() {
        let name = |path: &str| partial(Path::new(path));
        assert_eq!(name("a/b.c.png"), Path::new("a/b.c.partial.png"));
        assert_eq!(name("a"), Path::new("a.partial"));
        let long = format!("x/{}.png", "n".repeat(251));
        assert_eq!(name(&long), Path::new("x/picture.partial.png"));
    }

    #[test]
    fn a_second_place_replaces_nothing() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = Path::new("gone/a.png");
        let mut places = Vec::new();
        for _ in 0..3 {
            places.extend(write_in(folder.path(), path, &|out| out.write_all(b"picture")));
        }
        assert_eq!(places, ["a.png", "a-1.png", "a-2.png"].map(|name| folder.path().join(name)));
    }
}
