//! The command `snell`, which the package has too.

use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Runs the command with its arguments, of which the first is the name of the program, and returns
/// its exit code. A process can do this once. Signals are the command's from then on.
#[pyfunction]
pub fn _run_command(py: Python, arguments: Vec<OsString>, python: Option<PathBuf>) -> u8 {
    if let Some(python) = python {
        snell_cli::prefer_interpreter(python);
    }
    py.detach(|| snell_cli::run(arguments).number())
}
