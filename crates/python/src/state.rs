//! The state of a scene between calls: its contents, and the worlds built from them so far.
//!
//! A world is built when a query first needs it, by one thread for all callers; a query keeps the
//! world that it started with. The lock of the state is taken only by threads that hold the
//! interpreter's lock, and never for long.

use crate::assemble::{Form, Snapshot, assemble};
use crate::contents::Contents;
use crate::nearest::PointPrecision;
use crate::pairs::Pairs;
use crate::prepare::{Prepared, Request};
use crate::work::{Job, Threads, begin, run_to_end, run_to_end_on};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use snell_intersect::{BuildOptions, WorldError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

type Built<F> = Result<Arc<Snapshot<F>>, WorldError>;

/// A world that is being built.
#[derive(Debug)]
struct Building<F: Form> {
    /// The process that builds the world. A forked child has not inherited the building thread.
    pid: u32,
    version: u64,
    job: Arc<Job<Built<F>>>,
}

/// The worlds of one kind.
#[derive(Debug)]
pub struct Worlds<F: Form> {
    made: Option<(u64, Arc<Snapshot<F>>)>,
    building: Option<Building<F>>,
    /// The world that was last prepared for [`snell_intersect::World::winding_number`], the process
    /// that did it, and the job.
    winding: Option<(Weak<F::World>, u32, Arc<Job<()>>)>,
}

impl<F: Form> Default for Worlds<F> {
    fn default() -> Self {
        Self { made: None, building: None, winding: None }
    }
}

/// The state of a scene.
#[derive(Debug, Default)]
pub struct State {
    contents: Arc<Contents>,
    /// Version, increased by every edit.
    version: u64,
    single: Worlds<f32>,
    double: Worlds<f64>,
    prepared: Option<(u64, Request, Arc<Prepared>)>,
    pairs: Option<(u64, Arc<Pairs>)>,
}

/// A kind of world, kept in a field of [`State`].
pub trait Kept: Form + Sized {
    /// The worlds of this kind.
    fn worlds(state: &mut State) -> &mut Worlds<Self>;
}

impl Kept for f32 {
    fn worlds(state: &mut State) -> &mut Worlds<Self> {
        &mut state.single
    }
}

impl Kept for f64 {
    fn worlds(state: &mut State) -> &mut Worlds<Self> {
        &mut state.double
    }
}

/// A [`State`] that threads share.
#[derive(Debug, Default)]
pub struct Shared(Mutex<State>);

impl Shared {
    /// A state with these contents.
    pub fn new(contents: Arc<Contents>) -> Self {
        Self(Mutex::new(State { contents, ..State::default() }))
    }

    fn lock(&self, _attached: Python<'_>) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The current contents.
    pub fn contents(&self, py: Python<'_>) -> Arc<Contents> {
        self.lock(py).contents.clone()
    }

    /// Changes the contents. If `edit` fails, the version stays, so `edit` must not leave a change.
    pub fn edit<T>(
        &self,
        py: Python<'_>,
        edit: impl FnOnce(&mut Contents) -> PyResult<T>,
    ) -> PyResult<T> {
        let mut state = self.lock(py);
        let result = edit(Arc::make_mut(&mut state.contents))?;
        state.version += 1;
        Ok(result)
    }

    /// The world of the current contents, built if needed.
    pub fn snapshot<F: Kept>(&self, py: Python<'_>) -> PyResult<Arc<Snapshot<F>>> {
        let wanted = self.lock(py).version;
        loop {
            let (version, job) = {
                let mut state = self.lock(py);
                let (version, contents) = (state.version, state.contents.clone());
                let worlds = F::worlds(&mut state);
                match &worlds.made {
                    Some((made, snapshot)) if *made >= wanted => return Ok(snapshot.clone()),
                    _ => {}
                }
                let pid = std::process::id();
                match &worlds.building {
                    Some(building) if building.pid == pid => {
                        (building.version, building.job.clone())
                    }
                    _ => {
                        let previous = worlds.made.as_ref().map(|(_, snapshot)| snapshot.clone());
                        let job = begin(py, move || {
                            let previous = previous.as_ref().map(|snapshot| &*snapshot.world);
                            let options = BuildOptions {
                                compact: contents.compact,
                                ..BuildOptions::default()
                            };
                            assemble(&contents, &options, previous).map(Arc::new)
                        })?;
                        worlds.building = Some(Building { pid, version, job: job.clone() });
                        (version, job)
                    }
                }
            };
            py.detach(|| job.wait_attentively())?;
            let mut state = self.lock(py);
            let worlds = F::worlds(&mut state);
            // The first thread that returns stores the world for all.
            if worlds.building.as_ref().is_some_and(|building| Arc::ptr_eq(&building.job, &job)) {
                worlds.building = None;
            }
            let built = job.result()?;
            match built {
                Ok(snapshot) if worlds.made.as_ref().is_none_or(|(made, _)| *made < version) => {
                    worlds.made = Some((version, snapshot));
                }
                Ok(_) => {}
                Err(error) if version >= wanted => {
                    return Err(PyValueError::new_err(error.to_string()));
                }
                Err(_) => {}
            }
        }
    }

    /// Prepares the world for winding numbers. (Queries must not do it themselves: threads of a
    /// pool that wait for each other's work might wait for themselves.)
    pub fn prepare_winding<F: Kept + PointPrecision>(
        &self,
        py: Python<'_>,
        snapshot: &Arc<Snapshot<F>>,
    ) -> PyResult<()> {
        let job = {
            let mut state = self.lock(py);
            let worlds = F::worlds(&mut state);
            let (world, pid) = (&snapshot.world, std::process::id());
            match &worlds.winding {
                Some((of, by, job)) if of.as_ptr() == Arc::as_ptr(world) && *by == pid => {
                    job.clone()
                }
                _ => {
                    let asked = world.clone();
                    let job = begin(py, move || F::prepare(&asked))?;
                    // The weak reference keeps the address from being used again.
                    worlds.winding = Some((Arc::downgrade(world), pid, job.clone()));
                    job
                }
            }
        };
        py.detach(|| job.wait_attentively())
    }

    /// The scene as it is rendered, built if needed.
    pub fn prepared(
        &self,
        py: Python<'_>,
        request: &Request,
        threads: Threads,
    ) -> PyResult<Arc<Prepared>> {
        let (version, contents) = {
            let state = self.lock(py);
            match &state.prepared {
                Some((version, made_for, prepared))
                    if *version == state.version && made_for == request =>
                {
                    return Ok(prepared.clone());
                }
                _ => (state.version, state.contents.clone()),
            }
        };
        let asked = request.clone();
        let made = run_to_end_on(py, threads, move || Prepared::new(&contents, &asked))?;
        let prepared = Arc::new(made?);
        self.lock(py).prepared = Some((version, request.clone(), prepared.clone()));
        Ok(prepared)
    }

    /// The triangles of the scene for questions about pairs, prepared if needed.
    pub fn pairs(&self, py: Python<'_>) -> PyResult<Arc<Pairs>> {
        let (version, contents) = {
            let state = self.lock(py);
            match &state.pairs {
                Some((version, pairs)) if *version == state.version => return Ok(pairs.clone()),
                _ => (state.version, state.contents.clone()),
            }
        };
        let made = run_to_end(py, move || Pairs::new(&contents))?;
        let pairs = Arc::new(made.map_err(PyValueError::new_err)?);
        self.lock(py).pairs = Some((version, pairs.clone()));
        Ok(pairs)
    }
}
