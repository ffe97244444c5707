//! The progress of long queries, shown as a bar or told to a function.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyBool;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Interval of reports.
const INTERVAL: Duration = Duration::from_millis(100);

/// Who is told how many rays of a query are answered.
#[derive(Debug)]
pub struct Report {
    told: Py<PyAny>,
    /// True for a bar, which is closed at the end.
    is_bar: bool,
    /// Number of rays that are answered.
    pub done: AtomicUsize,
    total: usize,
    last: Mutex<Instant>,
}

impl Report {
    /// Reads the argument `progress`: True for a bar, a callable, or nothing.
    pub fn new(progress: Option<&Bound<'_, PyAny>>, total: usize) -> PyResult<Option<Self>> {
        let Some(progress) = progress.filter(|progress| !progress.is_none()) else {
            return Ok(None);
        };
        let is_bar = progress.is_instance_of::<PyBool>();
        let told = match is_bar {
            true if !progress.is_truthy()? => return Ok(None),
            true => progress.py().import("snell._progress")?.getattr("query_bar")?.call0()?,
            false if progress.is_callable() => progress.clone(),
            false => {
                let found = crate::settings::shown(progress);
                return Err(PyTypeError::new_err(format!(
                    "progress is {found}, expected True, False or a function of (done, total)"
                )));
            }
        };
        Ok((!told.is_none()).then(|| Self {
            told: told.unbind(),
            is_bar,
            done: AtomicUsize::new(0),
            total,
            last: Mutex::new(Instant::now()),
        }))
    }

    /// Tells the state of the query, if it was not told lately.
    pub fn tell(&self, py: Python<'_>) -> PyResult<()> {
        if let Ok(mut last) = self.last.try_lock() {
            if last.elapsed() < INTERVAL {
                return Ok(());
            }
            *last = Instant::now();
        }
        self.told.call1(py, (self.done.load(Ordering::Relaxed), self.total)).map(drop)
    }

    /// Ends the reports of a query, which is complete unless it failed.
    pub fn end(&self, py: Python<'_>, is_complete: bool) -> PyResult<()> {
        if self.is_bar {
            return self.told.call_method0(py, "close").map(drop);
        }
        if is_complete { self.told.call1(py, (self.total, self.total)).map(drop) } else { Ok(()) }
    }
}
