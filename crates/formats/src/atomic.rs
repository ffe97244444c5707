//! Writing files so that a failure leaves what was there before.

use crate::error::WriteError;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Finds out, before any work, whether [`write()`] could put a file at `path`.
pub fn check(path: &Path) -> Result<(), WriteError> {
    if is_special(path) {
        return Ok(());
    }
    temporary_beside(path).map(drop).map_err(|source| WriteError::Io { path: path.into(), source })
}

fn is_special(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|m| !m.is_file())
}

fn temporary_beside(path: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // The temporary name says nothing to a user, so it does not belong into the error.
    let plain = |e: std::io::Error| std::fs::metadata(folder).err().unwrap_or_else(|| e.kind().into());
    tempfile::Builder::new().prefix(".snell-").suffix(".tmp").tempfile_in(folder).map_err(plain)
}

/// Writes `bytes` to a temporary file beside `path`, then renames it over `path`. What is no file, such as a pipe or a device, is
/// written to and not replaced.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    place(path, stage(path, bytes)?, bytes)
}

/// Like [`write()`], for what need not be in memory as a whole: `fill` writes it.
pub fn write_with(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<(), WriteError> {
    if is_special(path) {
        let mut out = std::fs::OpenOptions::new().write(true).open(path).map_err(io_error(path))?;
        return fill(&mut out).map_err(io_error(path));
    }
    persist(path, filled(path, fill)?)
}

/// Writes several files as [`write()`] does: all of them under temporary names before the first is renamed. The last is renamed last.
pub fn write_all(files: &[(PathBuf, Vec<u8>)]) -> Result<(), WriteError> {
    let staged: Vec<_> = files.iter().map(|(path, bytes)| stage(path, bytes)).collect::<Result<_, _>>()?;
    for ((path, bytes), staged) in files.iter().zip(staged) {
        place(path, staged, bytes)?;
    }
    Ok(())
}

fn io_error(path: &Path) -> impl Fn(std::io::Error) -> WriteError {
    move |source| WriteError::Io { path: path.into(), source }
}

/// The content under a temporary name; `None` for what is no file and cannot be renamed.
fn stage(path: &Path, bytes: &[u8]) -> Result<Option<tempfile::NamedTempFile>, WriteError> {
    if is_special(path) {
        return Ok(None);
    }
    filled(path, |out| out.write_all(bytes)).map(Some)
}

/// A temporary file with what `fill` writes.
fn filled(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<tempfile::NamedTempFile, WriteError> {
    let mut file = temporary_beside(path).map_err(io_error(path))?;
    let mut out = std::io::BufWriter::new(file.as_file_mut());
    fill(&mut out).and_then(|()| out.flush()).map_err(io_error(path))?;
    drop(out);
    file.as_file().sync_all().map_err(io_error(path))?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private; the picture gets the mode of the file it replaces, or the usual one.
        let mode = std::fs::metadata(path).map_or(0o644, |m| m.permissions().mode());
        let _ = file.as_file().set_permissions(std::fs::Permissions::from_mode(mode));
    }
    Ok(file)
}

fn persist(path: &Path, file: tempfile::NamedTempFile) -> Result<(), WriteError> {
    file.persist(path).map(drop).map_err(|e| io_error(path)(e.error))
}

fn place(path: &Path, staged: Option<tempfile::NamedTempFile>, bytes: &[u8]) -> Result<(), WriteError> {
    match staged {
        Some(file) => persist(path, file),
        None => std::fs::write(path, bytes).map_err(io_error(path)),
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
        assert_eq!(std::fs::read_dir(folder.path()).expect("the folder is there").count(), 0, "nothing is left behind");
        write(&path, b"abc").expect("the folder is writable");
        assert_eq!(std::fs::read(&path).expect("the file is there"), b"abc");
        assert!(check(&folder.path().join("missing/a.png")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_socket_is_not_replaced_by_a_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("socket");
        let _socket = std::os::unix::net::UnixListener::bind(&path).expect("the folder is writable");
        assert!(write(&path, b"abc").is_err(), "nothing can be written to a socket");
        assert!(!std::fs::metadata(&path).expect("it is still there").is_file());
    }
}
