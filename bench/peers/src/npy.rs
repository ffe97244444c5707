//! Reading NumPy's files, as far as Snell writes them: little-endian numbers of four bytes, rows of
//! `N`.

use crate::Error;
use std::path::Path;

/// Rows of floats.
pub fn floats<const N: usize>(path: &Path) -> Result<Vec<[f32; N]>, Error> {
    rows(path, "<f4", f32::from_le_bytes)
}

/// Rows of integers.
pub fn integers<const N: usize>(path: &Path) -> Result<Vec<[u32; N]>, Error> {
    rows(path, "<u4", u32::from_le_bytes)
}

fn rows<T: Copy + Default, const N: usize>(
    path: &Path,
    kind: &str,
    read: fn([u8; 4]) -> T,
) -> Result<Vec<[T; N]>, Error> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let wrong = || {
        format!(
            "{}: not an array as `snell bench rays --dump-rays` writes \
        it",
            path.display()
        )
    };
    let length = bytes.get(8..10).ok_or_else(wrong)?;
    let begin = 10 + usize::from(u16::from_le_bytes([length[0], length[1]]));
    let (header, body) = bytes.split_at_checked(begin).ok_or_else(wrong)?;
    if !header.starts_with(b"\x93NUMPY\x01") || !String::from_utf8_lossy(header).contains(kind) {
        return Err(wrong().into());
    }
    let row = |row: &[u8]| {
        let mut numbers = [T::default(); N];
        for (number, b) in numbers.iter_mut().zip(row.chunks_exact(4)) {
            *number = read([b[0], b[1], b[2], b[3]]);
        }
        numbers
    };
    Ok(body.chunks_exact(4 * N).map(row).collect())
}
