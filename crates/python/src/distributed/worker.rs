//! A worker of a render that processes share: it performs tasks.

use super::lock;
use crate::render::{Plan, REPORT, Task as Planned};
use crate::scene::Scene;
use crate::settings::Keywords;
use crate::work::{Cancel, begin_alone};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict};
use snell_render::{Job, Origin, TaskInput, TaskResult, Underway, with_patience};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// A worker, which performs tasks of a render.
#[pyclass(frozen, module = "snell._snell")]
pub struct _Worker {
    plan: Arc<Plan>,
    name: String,
    /// The guiding field and a film that stays empty; `None` before the first task.
    underway: Arc<Mutex<Option<Underway>>>,
}

#[pymethods]
impl _Worker {
    /// Plans the same render as a [`_Film`](super::film::_Film) of the same name.
    #[new]
    fn new<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        options: &Bound<'py, PyDict>,
        name: String,
    ) -> PyResult<Self> {
        let keywords = Keywords(options);
        let plan = Plan::new(Planned::without_denoiser(py, scene, &keywords)?, &keywords)?;
        Ok(Self { plan: Arc::new(plan), name, underway: Arc::default() })
    }

    /// Performs a task and returns its result; None if `is_wanted`, which is called every 100 ms,
    /// has returned False. Only one thread may do this at a time.
    #[pyo3(signature = (task, worker, is_wanted=None))]
    fn perform<'py>(
        &self,
        py: Python<'py>,
        task: &[u8],
        worker: String,
        is_wanted: Option<Py<PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let wrong = |e: &dyn std::fmt::Display| PyValueError::new_err(format!("task: {e}"));
        let input = TaskInput::load(&mut &*task).map_err(|e| wrong(&e))?;
        let origin = Origin { plan: self.name.clone(), frame: 0, worker };
        let cancel = Arc::new(Cancel::default());
        let (plan, underway, stop) = (self.plan.clone(), self.underway.clone(), cancel.clone());
        let job = begin_alone(py, self.plan.threads, move || {
            perform(&plan, &mut lock(&underway), input, &stop)
        })?;
        let mut asked = Instant::now();
        let waited = py.detach(|| {
            job.wait_with(|py| {
                let Some(ask) = is_wanted.as_ref().filter(|_| asked.elapsed() >= REPORT) else {
                    return Ok(());
                };
                asked = Instant::now();
                if ask.call0(py)?.is(PyBool::new(py, false)) {
                    cancel.stop();
                }
                Ok(())
            })
        });
        if waited.is_err() {
            cancel.stop();
        }
        waited?;
        let Some(result) = job.take()? else {
            let message = "task: it is not of this render";
            return if cancel.check().is_err() { Ok(None) } else { Err(wrong(&message)) };
        };
        let mut bytes = Vec::new();
        py.detach(|| result.save(&origin, &mut bytes))
            .map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
        Ok(Some(PyBytes::new(py, &bytes)))
    }
}

/// Performs a task after the training, which the first task waits for.
fn perform(
    plan: &Plan,
    underway: &mut Option<Underway>,
    input: TaskInput,
    cancel: &Cancel,
) -> Option<TaskResult> {
    let Planned { prepared, camera, settings, .. } = &plan.task;
    let threads = plan.threads.count();
    let keep_going = |_: &snell_render::Progress| cancel.check().is_ok();
    with_patience(
        || cancel.check().is_err(),
        |flag| {
            let job = Job::new(&prepared.compiled, camera, settings).with_cancel(flag);
            let trained = match underway {
                Some(trained) => trained,
                None => {
                    let trained = job.begin(threads, &keep_going);
                    if cancel.check().is_err() {
                        return None;
                    }
                    underway.insert(trained)
                }
            };
            job.perform_input(trained, input, threads, &keep_going)
        },
    )
}
