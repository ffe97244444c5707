//! A worker of a render that processes share: it performs tasks.

use super::lock;
use crate::render::{Plan, REPORT, Task as Planned};
use crate::scene::Scene;
use crate::settings::Keywords;
use crate::work::{Cancel, begin_alone};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict};
use snell_render::{Fact, Job, Origin, Progress, TaskInput, Underway, with_patience};
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

    /// Trains the guiding field and returns it, for [`Self::learn`]; None if `is_wanted`, which is
    /// called every 100 ms, has returned False.
    #[pyo3(signature = (is_wanted=None))]
    fn train<'py>(
        &self,
        py: Python<'py>,
        is_wanted: Option<Py<PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let facts = self.facts();
        let saved = self.work(py, is_wanted, move |_, underway, _| {
            let mut bytes = Vec::new();
            underway.save_field(&facts, &mut bytes).map(|()| bytes)
        })?;
        let saved = saved.transpose().map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
        Ok(saved.map(|bytes| PyBytes::new(py, &bytes)))
    }

    /// Takes a guiding field that another worker has trained.
    fn learn(&self, py: Python<'_>, field: &[u8]) -> PyResult<()> {
        let Planned { prepared, camera, settings, .. } = &self.plan.task;
        let trained = py.detach(|| {
            let job = Job::new(&prepared.compiled, camera, settings);
            job.begin_trained(&mut &*field, &self.facts())
        });
        *lock(&self.underway) =
            Some(trained.map_err(|e| PyValueError::new_err(format!("guiding: {e}")))?);
        Ok(())
    }

    /// Performs a task and returns its result; None if `is_wanted`, which is called every 100 ms,
    /// has returned False. The first task trains the guiding field, if the render has one and the
    /// worker has not learnt it.
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
        let threads = self.plan.threads.count();
        let result = self.work(py, is_wanted, move |job, underway, cancel| {
            let keep_going = |_: &Progress| cancel.check().is_ok();
            let result = job.perform_input(underway, input, threads, &keep_going);
            result.ok_or_else(|| cancel.check().is_err())
        })?;
        let result = match result {
            None | Some(Err(true)) => return Ok(None),
            Some(Err(false)) => return Err(wrong(&"it is not of this render")),
            Some(Ok(result)) => result,
        };
        let origin = Origin { plan: self.name.clone(), frame: 0, worker };
        let mut bytes = Vec::new();
        py.detach(|| result.save(&origin, &mut bytes))
            .map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
        Ok(Some(PyBytes::new(py, &bytes)))
    }
}

impl _Worker {
    /// What a guiding field must be of.
    fn facts(&self) -> Vec<Fact> {
        vec![("the render".into(), self.name.clone())]
    }

    /// Works with the trained state, without the interpreter's lock and until `is_wanted` returns
    /// False; then it returns `None`, unless the work ends by itself. Only one thread may do this
    /// at a time.
    fn work<T: Send + 'static>(
        &self,
        py: Python<'_>,
        is_wanted: Option<Py<PyAny>>,
        work: impl FnOnce(&Job<'_>, &mut Underway, &Cancel) -> T + Send + 'static,
    ) -> PyResult<Option<T>> {
        let cancel = Arc::new(Cancel::default());
        let (plan, underway, stop) = (self.plan.clone(), self.underway.clone(), cancel.clone());
        let doing = begin_alone(py, self.plan.threads, move || {
            with_patience(
                || stop.check().is_err(),
                |flag| {
                    let Planned { prepared, camera, settings, .. } = &plan.task;
                    let job = Job::new(&prepared.compiled, camera, settings).with_cancel(flag);
                    let mut underway = lock(&underway);
                    if underway.is_none() {
                        let keep_going = |_: &Progress| stop.check().is_ok();
                        let trained = job.begin(plan.threads.count(), &keep_going);
                        // Training that was stopped gives another field.
                        *underway = stop.check().is_ok().then_some(trained);
                    }
                    underway.as_mut().map(|underway| work(&job, underway, &stop))
                },
            )
        })?;
        let mut asked = Instant::now();
        let waited = py.detach(|| {
            doing.wait_with(|py| {
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
        doing.take()
    }
}
