//! Atomic file writes: a failed write leaves the previous file untouched.
//!
//! A file is written under a temporary name in the same folder and then renamed. New files get the
//! mode that the user's umask allows; replaced files keep theirs. A symbolic link stays a link: the
//! file that it points to is replaced.

use crate::error::WriteError;
use std::collections::BTreeSet;
use std::io::{Error, ErrorKind, Result, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::NamedTempFile;

/// The longest chain of symbolic links that is followed, as on Linux.
const MAX_LINKS: usize = 40;

/// Checks, before any work is done, whether [`write()`] could put a file at `path`.
pub fn check(path: &Path) -> std::result::Result<(), WriteError> {
    let possible = || match destination(path)? {
        Destination::Special => Ok(()),
        Destination::File(place) => Temporary::beside(&place).map(drop),
    };
    possible().map_err(io_error(path))
}

/// Writes `bytes` to a temporary file beside `path`, then renames it over `path`. Pipes and devices
/// are written to directly and not replaced.
pub fn write(path: &Path, bytes: &[u8]) -> std::result::Result<(), WriteError> {
    write_with(path, |out| out.write_all(bytes))
}

/// Like [`write()`], for content that need not be in memory as a whole: `fill` writes it.
pub fn write_with(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> Result<()>,
) -> std::result::Result<(), WriteError> {
    stage(path, fill).and_then(Staged::place).map_err(io_error(path))
}

/// Like [`write_with()`], but never replaces a file: if something exists at `path`, the error is of
/// the kind [`ErrorKind::AlreadyExists`].
pub fn write_new(path: &Path, fill: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
    if path.symlink_metadata().is_ok() {
        return Err(ErrorKind::AlreadyExists.into());
    }
    let mut file = Temporary::beside(path)?;
    file.fill(fill)?;
    file.rename(|file| file.persist_noclobber(path).map(drop).map_err(|e| e.error))
}

/// Like [`write_with()`], but what was at `path` is then at `before`. The file has its content on
/// disk before it gets its name, and at every moment one of the two names leads to a whole file,
/// whatever ends the program or the system. The temporary file has a fixed name, so that programs
/// that are killed leave no more than one.
pub fn write_keeping(
    path: &Path,
    before: &Path,
    fill: impl FnOnce(&mut dyn Write) -> Result<()>,
) -> std::result::Result<(), WriteError> {
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    let new = PathBuf::from(name);
    let write = || {
        let mut out = std::io::BufWriter::new(std::fs::File::create(&new)?);
        fill(&mut out)?;
        let file = out.into_inner().map_err(std::io::IntoInnerError::into_error)?;
        #[cfg(unix)]
        if let Ok(known) = std::fs::metadata(path) {
            let _ = file.set_permissions(known.permissions());
        }
        file.sync_all()?;
        match std::fs::rename(path, before) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        std::fs::rename(&new, path)?;
        sync_folder(folder_of(path))
    };
    write().map_err(io_error(path)).inspect_err(|_| drop(std::fs::remove_file(&new)))
}

/// Makes the names in a folder lasting.
fn sync_folder(folder: &Path) -> Result<()> {
    // Other systems than Unix cannot open a folder, and do this by themselves.
    #[cfg(unix)]
    std::fs::File::open(folder)?.sync_all()?;
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}

/// Writes several files as [`write()`] does. All of them are written under temporary names before
/// the first is renamed; the renames follow the order of `files`.
pub fn write_all(files: &[(PathBuf, Vec<u8>)]) -> std::result::Result<(), WriteError> {
    let staged: Vec<_> = files
        .iter()
        .map(|(path, bytes)| match destination(path).map_err(io_error(path))? {
            // A special file has no temporary name: it is written in the second step.
            Destination::Special => Ok(None),
            Destination::File(_) => {
                stage(path, |out| out.write_all(bytes)).map(Some).map_err(io_error(path))
            }
        })
        .collect::<std::result::Result<_, WriteError>>()?;
    for ((path, bytes), staged) in files.iter().zip(staged) {
        staged
            .map_or_else(|| write(path, bytes), |staged| staged.place().map_err(io_error(path)))?;
    }
    Ok(())
}

/// Removes all temporary files, for a program that is about to exit. After this call, a thread that
/// would create a temporary file or rename one into place blocks until the process exits.
pub fn abandon() {
    let known = temporaries();
    for path in known.iter() {
        let _ = std::fs::remove_file(path);
    }
    std::mem::forget(known);
}

fn io_error(path: &Path) -> impl Fn(Error) -> WriteError {
    move |source| WriteError::Io { path: path.into(), source }
}

/// The destination of a file.
enum Destination {
    /// An ordinary file (which may not exist yet), after all links are followed.
    File(PathBuf),
    /// Something other than a file, such as a device or a pipe, which cannot be renamed over.
    Special,
}

/// Follows symbolic links, including those that point to nothing yet.
fn destination(path: &Path) -> Result<Destination> {
    if names_a_folder(path) || path.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if std::fs::metadata(path).is_ok_and(|known| !known.is_file()) {
        return Ok(Destination::Special);
    }
    let mut place = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        match std::fs::symlink_metadata(&place) {
            Ok(known) if known.is_symlink() => {
                place = folder_of(&place).join(std::fs::read_link(&place)?)
            }
            Ok(_) => {
                // Renaming does not check write permission, so a read-only file is refused here.
                std::fs::OpenOptions::new().write(true).open(&place)?;
                return Ok(Destination::File(place));
            }
            // A link may also name a folder.
            Err(e) if e.kind() == ErrorKind::NotFound && !names_a_folder(&place) => {
                return Ok(Destination::File(place));
            }
            Err(e) => return Err(e),
        }
    }
    Err(Error::other("the symbolic links form a loop or are too many"))
}

/// True for `a/` and `a/.`, which the system treats as folders although the last component of these
/// paths is `a`.
fn names_a_folder(path: &Path) -> bool {
    let name = path.as_os_str().as_encoded_bytes();
    let is_separator = |b: Option<&u8>| b.is_some_and(|&b| std::path::is_separator(b.into()));
    is_separator(name.last())
        || name.strip_suffix(b".").is_some_and(|rest| is_separator(rest.last()))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A file that is removed when this is dropped, and by [`abandon`].
#[derive(Debug)]
pub struct Passing(PathBuf);

impl Passing {
    /// The file at `path`, which need not be there.
    pub fn new(path: PathBuf) -> Self {
        temporaries().insert(path.clone());
        Self(path)
    }
}

impl Drop for Passing {
    fn drop(&mut self) {
        if temporaries().remove(&self.0) {
            let _ = std::fs::remove_file(&self.0);
        }
    }
}

/// Content that is written but not yet renamed into place.
enum Staged {
    /// A file under a temporary name.
    File { temporary: Temporary, place: PathBuf },
    /// Content that was written to a special file, which needs no renaming.
    Done,
}

fn stage(path: &Path, fill: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<Staged> {
    let place = match destination(path)? {
        Destination::Special => {
            fill(&mut std::fs::OpenOptions::new().write(true).open(path)?)?;
            return Ok(Staged::Done);
        }
        Destination::File(place) => place,
    };
    let mut temporary = Temporary::beside(&place)?;
    temporary.fill(fill)?;
    #[cfg(unix)]
    if let (Ok(known), Some(file)) = (std::fs::metadata(&place), &temporary.0) {
        let _ = file.as_file().set_permissions(known.permissions());
    }
    Ok(Staged::File { temporary, place })
}

impl Staged {
    fn place(self) -> Result<()> {
        match self {
            Self::File { temporary, place } => {
                temporary.rename(|file| file.persist(&place).map(drop).map_err(|e| e.error))?;
                // A folder that cannot be opened has the file nevertheless.
                let _ = sync_folder(folder_of(&place));
                Ok(())
            }
            Self::Done => Ok(()),
        }
    }
}

/// The existing temporary files. They are created, renamed and removed only while this set is
/// locked, so that [`abandon`] misses none.
static TEMPORARIES: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn temporaries() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    TEMPORARIES.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file with a temporary name, removed when it is dropped.
struct Temporary(Option<NamedTempFile>);

impl Temporary {
    fn beside(path: &Path) -> Result<Self> {
        let folder = folder_of(path);
        // The error names the user's path, not the temporary one, which means nothing to a user.
        let plain = |e: Error| {
            std::fs::metadata(folder).err().unwrap_or_else(|| {
                e.raw_os_error().map_or(e.kind().into(), Error::from_raw_os_error)
            })
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".snell-").suffix(".tmp");
        #[cfg(unix)]
        // From this mode, the system removes the bits that the umask forbids.
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut known = temporaries();
        let file = builder.tempfile_in(folder).map_err(plain)?;
        known.insert(file.path().into());
        Ok(Self(Some(file)))
    }

    fn fill(&mut self, fill: impl FnOnce(&mut dyn Write) -> Result<()>) -> Result<()> {
        let Some(file) = &mut self.0 else { return Ok(()) };
        let mut out = std::io::BufWriter::new(file.as_file_mut());
        fill(&mut out).and_then(|()| out.flush())?;
        drop(out);
        file.as_file().sync_all()
    }

    fn rename(mut self, to: impl FnOnce(NamedTempFile) -> Result<()>) -> Result<()> {
        let mut known = temporaries();
        let Some(file) = self.0.take() else { return Ok(()) };
        known.remove(file.path());
        to(file)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(file) = self.0.take() {
            temporaries().remove(file.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_takes_no_files_is_found_out_before_the_work() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.png");
        check(&path).expect("the folder is writable");
        assert_eq!(
            std::fs::read_dir(folder.path()).expect("the folder is there").count(),
            0,
            "nothing is left behind"
        );
        write(&path, b"abc").expect("the folder is writable");
        assert_eq!(std::fs::read(&path).expect("the file is there"), b"abc");
        assert!(check(&folder.path().join("missing/a.png")).is_err());
    }

    #[test]
    fn what_could_not_be_renamed_in_the_end_is_found_out_before_the_work() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let long = |bytes: usize| folder.path().join("x".repeat(bytes));
        write(&long(255), b"abc").expect("this is the longest name");
        assert!(check(&long(256)).is_err());
        for name in ["a.png/", "a.png/.", ""] {
            let path = folder.path().join(name);
            assert!(check(&path).is_err(), "{name}");
            assert!(write(&path, b"abc").is_err(), "{name}");
        }
        assert_eq!(
            std::fs::read_dir(folder.path()).expect("it is there").count(),
            1,
            "nothing is left behind"
        );
    }

    #[test]
    fn a_new_file_replaces_nothing() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.png");
        write_new(&path, |out| out.write_all(b"first")).expect("nothing is there");
        let error =
            write_new(&path, |out| out.write_all(b"second")).expect_err("the first is there");
        assert_eq!(error.kind(), ErrorKind::AlreadyExists);
        assert_eq!(std::fs::read(&path).expect("it is there"), b"first");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_what_it_leads_to_is_replaced() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        std::fs::create_dir(path("store")).expect("the folder is writable");
        std::fs::write(path("store/a"), "old").expect("the folder is writable");
        std::fs::set_permissions(path("store/a"), PermissionsExt::from_mode(0o640))
            .expect("it is ours");
        for (to, link) in [
            ("store/a", "full"),
            ("full", "twice"),
            ("store/new", "dangling"),
            ("/dev/null", "nowhere"),
        ] {
            symlink(to, path(link)).expect("the folder is writable");
        }
        for link in ["full", "twice", "dangling", "nowhere"] {
            check(&path(link)).unwrap_or_else(|e| panic!("{link}: {e}"));
            write(&path(link), link.as_bytes()).unwrap_or_else(|e| panic!("{link}: {e}"));
            assert!(
                path(link).symlink_metadata().is_ok_and(|m| m.is_symlink()),
                "{link} is still a link"
            );
        }
        let content = |name: &str| std::fs::read_to_string(path(name)).expect("it is there");
        assert_eq!((content("store/a"), content("store/new")), ("twice".into(), "dangling".into()));
        let mode = std::fs::metadata(path("store/a")).expect("it is there").permissions().mode();
        assert_eq!(mode & 0o777, 0o640, "a replaced file keeps its mode");
        symlink("round", path("round")).expect("the folder is writable");
        assert!(check(&path("round")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_socket_is_not_replaced_by_a_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("socket");
        let _socket =
            std::os::unix::net::UnixListener::bind(&path).expect("the folder is writable");
        assert!(write(&path, b"abc").is_err(), "nothing can be written to a socket");
        assert!(!std::fs::metadata(&path).expect("it is still there").is_file());
    }
}
