//! Writing files so that a failure leaves what was there before.

use crate::error::WriteError;
use std::io::Write;
use std::path::Path;

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
    tempfile::Builder::new().prefix(".snell-").suffix(".tmp").tempfile_in(folder)
}

/// Writes `bytes` to a temporary file beside `path`, then renames it over `path`. What is no file, such as a pipe or a device, is
/// written to and not replaced.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    write_with(path, |out| out.write_all(bytes))
}

/// Like [`write()`], for what need not be in memory as a whole: `fill` writes it.
pub fn write_with(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<(), WriteError> {
    let error = |source: std::io::Error| WriteError::Io { path: path.into(), source };
    if is_special(path) {
        let mut out = std::fs::OpenOptions::new().write(true).open(path).map_err(error)?;
        return fill(&mut out).map_err(error);
    }
    let mut file = temporary_beside(path).map_err(error)?;
    let mut out = std::io::BufWriter::new(file.as_file_mut());
    fill(&mut out).and_then(|()| out.flush()).map_err(error)?;
    drop(out);
    file.as_file().sync_all().map_err(error)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private; the picture gets the mode of the file it replaces, or the usual one.
        let mode = std::fs::metadata(path).map_or(0o644, |m| m.permissions().mode());
        let _ = file.as_file().set_permissions(std::fs::Permissions::from_mode(mode));
    }
    file.persist(path).map_err(|e| error(e.error))?;
    Ok(())
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
