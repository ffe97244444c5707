//! The film of a render that processes share: it hands out tasks and merges their results.

use super::lock;
use crate::image::Image;
use crate::render::{Plan, Task as Planned};
use crate::scene::Scene;
use crate::settings::{Keywords, denoise_error};
use crate::work::{run_to_end, run_to_end_on};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use snell_render::{Job, Split, Task, TaskInput, TaskResult, Underway};
use std::collections::HashSet;
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// The film of a render whose tasks others perform.
#[pyclass(frozen, module = "snell._snell")]
pub struct _Film {
    plan: Arc<Plan>,
    name: String,
    state: Arc<Mutex<State>>,
    start: Instant,
}

struct State {
    underway: Underway,
    /// The tasks whose results are in the film.
    done: HashSet<[u32; 4]>,
}

fn key(task: &Task) -> [u32; 4] {
    let ([first, end], [start, until]) = (task.tiles, task.samples);
    [first, end, start, until]
}

#[pymethods]
impl _Film {
    /// Plans a render. `name` is that of the render, which its workers must give too.
    #[new]
    fn new<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        options: &Bound<'py, PyDict>,
        name: String,
    ) -> PyResult<Self> {
        let keywords = Keywords(options);
        let plan = Arc::new(Plan::new(Planned::new(py, scene, &keywords)?, &keywords)?);
        let underway = Underway::empty(&plan.task.settings);
        let state = Arc::new(Mutex::new(State { underway, done: HashSet::new() }));
        Ok(Self { plan, name, state, start: Instant::now() })
    }

    /// True if pixels stop by their error, so that there are several rounds.
    #[getter]
    fn has_rounds(&self) -> bool {
        self.plan.task.settings.noise.is_some()
    }

    /// True if paths are guided, so that workers need a field.
    #[getter]
    fn is_guided(&self) -> bool {
        self.plan.task.settings.guiding.is_some()
    }

    /// The share of the pixels that have stopped by their error, and the number of rays so far.
    #[getter]
    fn progress(&self) -> (f64, u64) {
        let state = lock(&self.state);
        let statistics = &state.underway.statistics;
        let [width, height] = state.underway.film.crop.size().map(f64::from);
        (statistics.converged_pixels as f64 / (width * height), statistics.rays.total())
    }

    /// The tasks of the current round, in at least `count` parts if there are as many tiles, and of
    /// at most `samples` samples of all their pixels together if a tile has no more; none if the
    /// render is finished.
    fn tasks<'py>(
        &self,
        py: Python<'py>,
        count: u32,
        samples: u64,
    ) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let settings = &self.plan.task.settings;
        let inputs = py.detach(|| {
            let underway = &lock(&self.state).underway;
            let all = underway.tasks(settings, Split { tiles: 1, samples: None });
            let Some(task) = all.first() else { return Ok(Vec::new()) };
            let of_tile = u64::from(task.samples[1] - task.samples[0]) * 256;
            let most = (underway.film.tiles.len() as u64 / u64::from(count.max(1))).max(1);
            let tiles = (samples / of_tile.max(1)).clamp(1, most) as u32;
            let step = (samples / 256).clamp(u64::from(Split::SAMPLES), u64::from(u32::MAX / 2));
            let split = Split { tiles, samples: (of_tile > samples).then_some(step as u32) };
            let tasks = underway.tasks(settings, split);
            let inputs = tasks.into_iter().filter_map(|task| underway.input(task));
            let pack = |input: TaskInput| {
                let mut bytes = Vec::new();
                input.save(&mut bytes).map(|()| bytes)
            };
            inputs.map(pack).collect()
        });
        let inputs: Vec<Vec<u8>> =
            inputs.map_err(|e: std::io::Error| PyRuntimeError::new_err(e.to_string()))?;
        Ok(inputs.iter().map(|bytes| PyBytes::new(py, bytes)).collect())
    }

    /// Adds the result of a task; one that is added again changes nothing.
    fn add(&self, py: Python<'_>, result: &[u8]) -> PyResult<()> {
        let foreign = |what: &str| {
            PyRuntimeError::new_err(format!(
                "a worker has returned something that is not a result of this render: {what}"
            ))
        };
        let (origin, result) =
            py.detach(|| TaskResult::load(&mut &*result)).map_err(|e| foreign(&e.to_string()))?;
        if origin.plan != self.name {
            return Err(foreign(&format!("that of {} comes from {}", origin.plan, origin.worker)));
        }
        py.detach(|| {
            let State { underway, done } = &mut *lock(&self.state);
            let is_new = done.insert(key(&result.task));
            let statistics = underway.statistics;
            let is_added = underway.add(result);
            if !is_new {
                underway.statistics = statistics;
            }
            is_added
        })
        .then_some(())
        .ok_or_else(|| foreign(&format!("its tiles do not fit; it comes from {}", origin.worker)))
    }

    /// Ends a round whose results are all added.
    fn end_round(&self, py: Python<'_>) -> PyResult<()> {
        let (plan, state) = (self.plan.clone(), self.state.clone());
        run_to_end(py, move || {
            let Planned { prepared, camera, settings, .. } = &plan.task;
            let job = Job::new(&prepared.compiled, camera, settings);
            job.end_round(&mut lock(&state).underway);
        })
    }

    /// The picture so far.
    fn picture(&self, py: Python<'_>) -> PyResult<Image> {
        let (plan, state) = (self.plan.clone(), self.state.clone());
        let seconds = self.start.elapsed().as_secs_f64();
        let made = run_to_end_on(py, self.plan.threads, move || {
            plan.finish(&lock(&state).underway.film, seconds)
        })?;
        let made = made.map_err(denoise_error)?;
        self.plan.image(py, made, &lock(&self.state).underway, seconds)
    }
}
