//! Writing files so that a failure leaves what was there before.

use crate::error::WriteError;
use std::io::Write;
use std::path::Path;

/// Writes `bytes` to a temporary file beside `path`, then renames it over `path`.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let error = |source: std::io::Error| WriteError::Io { path: path.into(), source };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".snell-").suffix(".tmp");
    let mut file = builder.tempfile_in(folder).map_err(error)?;
    file.write_all(bytes).map_err(error)?;
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
