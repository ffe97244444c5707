//! Files that Python makes.

use crate::arrays::slice;
use numpy::PyReadonlyArray1;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use snell_formats::{WriteError, atomic};
use std::path::PathBuf;

/// The exception of a file that could not be written.
pub fn write_error(error: &WriteError) -> PyErr {
    match error {
        WriteError::Io { .. } => PyOSError::new_err(error.to_string()),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// Writes a file of a header and data, completely or not at all.
#[pyfunction]
pub fn _write_file(
    py: Python<'_>,
    path: PathBuf,
    header: &[u8],
    data: PyReadonlyArray1<'_, u8>,
) -> PyResult<()> {
    let data = slice(&data)?;
    py.detach(|| {
        atomic::write_with(&path, |out| {
            out.write_all(header)?;
            out.write_all(data)
        })
    })
    .map_err(|error| write_error(&error))
}
