//! Opens regular files only: a pipe or a device may block a reader forever, or supply bytes without
//! end.

use crate::error::one_line;
use std::fmt;
use std::fs::{File, Metadata};
use std::io::Read;
use std::path::Path;

/// The origin of a file's name, which decides whether the file may be a pipe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NamedBy {
    /// The user named the file. It may be a pipe if it is one that the shell passes: `/dev/stdin`,
    /// or `/dev/fd/63` for `<(command)`.
    User,
    /// Another file, or a folder that is searched.
    File,
}

/// The reason why a file cannot be read. Displays as `problem; remedy`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// What was found.
    pub problem: String,
    /// A way to avoid the problem.
    pub remedy: &'static str,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", one_line(&self.problem), self.remedy)
    }
}

impl std::error::Error for Refusal {}

impl Refusal {
    fn new(problem: impl Into<String>, remedy: &'static str) -> Self {
        Self { problem: problem.into(), remedy }
    }
}

/// A file may grow by this many bytes while it is read. A file that yields more than its size, as
/// some in `/proc` do, is taken to be endless.
const GROWTH_BYTES: u64 = 64 << 20;

/// Opens a file without blocking.
pub fn open(path: &Path, named_by: NamedBy) -> Result<File, Refusal> {
    let is_handed_over = named_by == NamedBy::User && is_own_descriptor(path);
    let mut options = std::fs::OpenOptions::new();
    options.read(true);
    if let Ok(known) = std::fs::metadata(path) {
        // Opening some devices has side effects, and sockets cannot be opened.
        check(&known, is_handed_over)?;
    }
    #[cfg(unix)]
    if !is_handed_over {
        std::os::unix::fs::OpenOptionsExt::custom_flags(
            &mut options,
            libc::O_NONBLOCK | libc::O_NOCTTY,
        );
    }
    let failed =
        |e| Refusal::new(format!("cannot open: {e}"), "check the name and that you may read it");
    let file = options.open(path).map_err(failed)?;
    // The file may have been replaced since the check.
    check(&file.metadata().map_err(failed)?, is_handed_over)?;
    Ok(file)
}

/// Reads a file of at most `limit` bytes.
pub fn read(path: &Path, named_by: NamedBy, limit: u64) -> Result<Vec<u8>, Refusal> {
    let failed =
        |e| Refusal::new(format!("cannot read: {e}"), "check the disk and your permissions");
    let larger =
        || Refusal::new(format!("larger than the limit of {limit} bytes"), "split the scene");
    let file = open(path, named_by)?;
    let known = file.metadata().map_err(failed)?;
    let most =
        if known.is_file() { limit.min(known.len().saturating_add(GROWTH_BYTES)) } else { limit };
    if known.len() > limit {
        return Err(larger());
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(known.len() as usize + 1).map_err(|_| {
        Refusal::new(
            format!("no memory for its {} bytes", known.len()),
            "free some, or split the scene",
        )
    })?;
    file.take(most + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 <= most {
        return Ok(bytes);
    }
    if most == limit {
        return Err(larger());
    }
    let problem = format!("yields far more than its {} bytes and may be endless", known.len());
    Err(Refusal::new(problem, "name an ordinary file"))
}

/// True for the names of this process's own file descriptors.
pub(crate) fn is_own_descriptor(path: &Path) -> bool {
    let folder = path.parent();
    let is_in = |name: &str| folder == Some(Path::new(name));
    cfg!(unix) && (path == Path::new("/dev/stdin") || is_in("/dev/fd") || is_in("/proc/self/fd"))
}

/// Refuses anything but regular files (and pipes, if allowed).
fn check(known: &Metadata, may_be_pipe: bool) -> Result<(), Refusal> {
    if known.is_file() {
        return Ok(());
    }
    if known.is_dir() {
        return Err(Refusal::new("this is a folder, not a file", "name the scene file inside it"));
    }
    match kind(known) {
        "pipe" if may_be_pipe => Ok(()),
        "pipe" => Err(Refusal::new(
            "this is a pipe, not a file",
            "write a file, or give a scene as standard input: -",
        )),
        kind => Err(Refusal::new(format!("this is a {kind}, not a file"), "name an ordinary file")),
    }
}

/// Names the kind of something that is neither a file nor a folder.
fn kind(known: &Metadata) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = known.file_type();
        if kind.is_fifo() {
            return "pipe";
        }
        if kind.is_socket() {
            return "socket";
        }
    }
    let _ = known;
    "device"
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;
    use std::process::Command;
    use std::time::{Duration, Instant};

    #[test]
    fn pipes_devices_and_sockets_are_refused_at_once() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        let made = Command::new("mkfifo")
            .arg(path("pipe"))
            .status()
            .expect("mkfifo is part of every Unix");
        assert!(made.success());
        let _socket = UnixListener::bind(path("socket")).expect("the folder is writable");
        std::os::unix::fs::symlink("/dev/zero", path("link")).expect("the folder is writable");
        let start = Instant::now();
        for (name, what) in [("pipe", "pipe"), ("socket", "socket"), ("link", "device")] {
            for named_by in [NamedBy::User, NamedBy::File] {
                let refused = read(&path(name), named_by, 1 << 30).expect_err(name).to_string();
                assert!(
                    refused.starts_with(&format!("this is a {what}, not a file; ")),
                    "{refused}"
                );
            }
        }
        assert!(start.elapsed() < Duration::from_secs(5));
    }

    #[test]
    fn a_pipe_of_the_shell_is_read_if_the_user_names_it_and_not_if_a_file_does() {
        use std::io::Write;
        use std::os::fd::AsRawFd;
        let (pipe, mut end) = std::io::pipe().expect("a pipe");
        let name = format!("/dev/fd/{}", pipe.as_raw_fd());
        let refused = read(Path::new(&name), NamedBy::File, 100).expect_err("named by a file");
        assert_eq!(refused.problem, "this is a pipe, not a file");
        end.write_all(b"scene").expect("a pipe holds that much");
        drop(end);
        assert_eq!(
            read(Path::new(&name), NamedBy::User, 100).expect("named by the user"),
            b"scene"
        );
    }

    #[test]
    fn a_file_that_gives_more_than_its_size_says_ends_in_an_error() {
        // The memory map of this process: hundreds of gigabytes in a file of size 0.
        let endless = Path::new("/proc/self/pagemap");
        if endless.exists() {
            read(endless, NamedBy::User, u64::MAX - 1).expect_err("endless");
        }
        let refused = read(Path::new("/proc/kcore"), NamedBy::User, 1 << 30);
        assert!(refused.is_err(), "it is as large as all addresses");
    }
}
