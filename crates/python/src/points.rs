//! Reads clouds of points as arrays.

use crate::arrays::from_vec;
use crate::load::check_there;
use crate::work::run_to_end;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use snell_formats::points::Values;
use snell_formats::{ReadOptions, read_points};
use std::path::PathBuf;

/// The columns of a PLY or PCD file by name, and the numbers of rows and of points in a row.
#[pyfunction]
pub fn _load_points<'py>(
    py: Python<'py>,
    path: PathBuf,
) -> PyResult<(Vec<(String, Bound<'py, PyAny>)>, [usize; 2])> {
    check_there(&path)?;
    let table = run_to_end(py, move || read_points(&path, &ReadOptions::default()))?;
    let table = table.map_err(|error| PyValueError::new_err(error.to_string()))?;
    let count = table.width * table.height;
    let column = |column: snell_formats::points::Column| {
        let shape: &[usize] =
            if column.channels == 1 { &[count] } else { &[count, column.channels] };
        let array = match column.values {
            Values::I8(all) => from_vec(py, all, shape),
            Values::U8(all) => from_vec(py, all, shape),
            Values::I16(all) => from_vec(py, all, shape),
            Values::U16(all) => from_vec(py, all, shape),
            Values::I32(all) => from_vec(py, all, shape),
            Values::U32(all) => from_vec(py, all, shape),
            Values::I64(all) => from_vec(py, all, shape),
            Values::U64(all) => from_vec(py, all, shape),
            Values::F32(all) => from_vec(py, all, shape),
            Values::F64(all) => from_vec(py, all, shape),
        };
        Ok((column.name, array?))
    };
    let columns = table.columns.into_iter().map(column).collect::<PyResult<_>>()?;
    Ok((columns, [table.height, table.width]))
}
