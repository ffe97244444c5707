//! Renders that processes share. One process has a [`film::_Film`]: it hands out tasks and merges
//! their results. Any number of others have a [`worker::_Worker`] of the same scene and settings,
//! which performs tasks. Tasks and results are bytes; the Python half sends them.

pub mod film;
pub mod worker;

use crate::graph::{Purpose, graph};
use crate::load::fold;
use crate::scene::Scene;
use crate::work::{Threads, run_to_end, run_to_end_on};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use snell_formats::scene::snell::text;
use snell_formats::{Limits, ReadOptions, read_scene_bytes};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A scene as bytes, for pictures: what [`_unpack_scene`] reads gives the same ones. They are
/// larger than what pickling gives, and keep the objects as they were read from a file.
#[pyfunction]
pub fn _pack_scene<'py>(
    py: Python<'py>,
    scene: &Bound<'py, Scene>,
) -> PyResult<Bound<'py, PyBytes>> {
    Ok(PyBytes::new(py, packed(py, scene)?.as_bytes()))
}

/// All of a scene on which pictures depend, as text.
pub fn packed<'py>(py: Python<'py>, scene: &Bound<'py, Scene>) -> PyResult<String> {
    let contents = scene.get().0.contents(py);
    let packed = run_to_end(py, move || text(&graph(&contents, Purpose::Picture)?))?;
    packed.map_err(|e| PyValueError::new_err(format!("scene: {e}")))
}

/// The scene of the bytes that [`_pack_scene`] has given.
#[pyfunction]
pub fn _unpack_scene(py: Python<'_>, packed: Vec<u8>, threads: Option<i64>) -> PyResult<Scene> {
    let limits = Limits { file_bytes: u64::MAX, ..Limits::default() };
    let options = ReadOptions { limits, exact: true, ..ReadOptions::default() };
    let scene = run_to_end_on(py, Threads::new(threads)?, move || {
        let scene = read_scene_bytes("scene", packed, Path::new("."), &options);
        fold(scene.map_err(|e| e.to_string())?)
    })?;
    scene.map(Scene::of).map_err(PyValueError::new_err)
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
