//! Checks for available memory before large allocations: Python gets a `MemoryError` instead of a
//! killed process.

use crate::render::Task;
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use snell_formats::memory::Available;
use snell_render::Settings;
use snell_render::memory::{Estimate, Uses, of_picture, of_scene};

/// Smaller allocations are not checked: the check takes longer than the allocation.
const SMALL: u64 = 16 << 20;

/// Fails if there is no memory for `bytes` bytes, which are needed for `what`.
pub fn admit(what: &str, bytes: u64) -> PyResult<()> {
    if bytes < SMALL {
        return Ok(());
    }
    Available::now().admit(what, bytes).map_err(PyMemoryError::new_err)
}

/// Like [`admit`], for `count` values of `bytes_of_each` bytes.
pub fn admit_all(what: &str, count: usize, bytes_of_each: usize) -> PyResult<()> {
    admit(what, count as u64 * bytes_of_each as u64)
}

/// The memory that a render takes in addition to the Python scene: the compiled scene, the film and
/// the picture.
pub fn estimate(task: &Task, threads: usize) -> Estimate {
    picture(&task.settings, threads, task.denoiser.is_some()).with(of_scene(&task.prepared.scene))
}

/// The memory for the film, the picture, its variance, and a second copy of the picture as an array
/// or in an encoder.
fn picture(settings: &Settings, threads: usize, denoise: bool) -> Estimate {
    of_picture(settings, &Uses { threads, variance: true, denoise, beside: 16 })
}

/// Fails if there is no memory for a picture; the message gives the size that fits.
pub fn check_picture(settings: &Settings, threads: usize, denoise: bool) -> PyResult<()> {
    let estimate = picture(settings, threads, denoise);
    let available = Available::now().for_threads(threads);
    let [width, height] = estimate.size;
    let what = format!("size: a picture of {width} by {height} pixels");
    available.admit(&what, estimate.bytes()).map_err(|problem| {
        let fits = estimate.advice(available.bytes);
        PyMemoryError::new_err(format!(
            "{problem}; {fits}: make it smaller, or render parts of it with crop"
        ))
    })
}
