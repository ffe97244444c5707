//! Runs work without the interpreter's lock, on the requested number of threads, until Ctrl-C.
//!
//! A pool of threads is created when it is first needed and lives as long as the process. A forked
//! child creates its own pool, because it does not have the threads of its parent. All locks here
//! are taken only by threads that hold the interpreter's lock, so a fork never finds them locked.

use crate::arrays::{named, whole};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use snell_formats::memory::Available;
use snell_render::threads;
use std::any::Any;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, OnceLock, PoisonError};
use std::time::Duration;

/// Interval at which Python is asked whether Ctrl-C was pressed.
const LOOK_AT_SIGNALS: Duration = Duration::from_millis(30);

/// Sets the size of the global pool, which the threads of the viewer use. Only the first call of a
/// process has an effect.
pub fn bound_shared_pool(threads: Threads) {
    let name = |i| format!("snell-shared-{i}");
    // An error means that the pool exists already.
    let _ = ThreadPoolBuilder::new().num_threads(threads.0).thread_name(name).build_global();
}

/// The pools of the process `pid`, by their number of threads.
struct Pools {
    pid: u32,
    by_threads: BTreeMap<usize, Arc<ThreadPool>>,
}

static POOLS: Mutex<Pools> = Mutex::new(Pools { pid: 0, by_threads: BTreeMap::new() });

/// The number of cores, kept because asking the system takes longer than a short query.
static CORES: OnceLock<usize> = OnceLock::new();

/// The argument `threads` if it is given: a whole number.
#[derive(Clone, Copy, Debug)]
pub struct Count(i64);

impl<'a, 'py> FromPyObject<'a, 'py> for Count {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let wrong = || {
            let most = threads::MAX;
            named(&value, "threads", &format!("1 to {most}, or None for all cores"))
        };
        let number = whole(&value).ok_or_else(wrong)?;
        Ok(Self(number.clamp(i64::MIN.into(), i64::MAX.into()) as i64))
    }
}

/// Number of threads of a call: `None` means all cores.
#[derive(Clone, Copy, Debug)]
pub struct Threads(usize);

impl Threads {
    /// Checks the argument `threads`.
    pub fn new(threads: Option<i64>) -> PyResult<Self> {
        let Some(given) = threads else { return Ok(Self(*CORES.get_or_init(threads::cores))) };
        match usize::try_from(given) {
            Ok(n) if (1..=threads::MAX).contains(&n) => Ok(Self(n)),
            _ => Err(PyValueError::new_err(format!(
                "threads is {given}, expected 1 to {}, or None for all cores",
                threads::MAX
            ))),
        }
    }

    /// Checks the argument `threads`.
    pub fn given(threads: Option<Count>) -> PyResult<Self> {
        Self::new(threads.map(|Count(threads)| threads))
    }

    /// Number of threads.
    pub fn count(self) -> usize {
        self.0
    }

    /// The pool of this process with this number of threads.
    fn pool(self, _attached: Python<'_>) -> PyResult<Arc<ThreadPool>> {
        let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
        let pid = std::process::id();
        if pools.pid != pid {
            // After a fork, these threads are the parent's, and dropping the pools would wait for
            // them.
            std::mem::forget(std::mem::take(&mut pools.by_threads));
            pools.pid = pid;
        }
        if let Some(pool) = pools.by_threads.get(&self.0) {
            return Ok(pool.clone());
        }
        let refused = |why: &dyn Display| {
            PyRuntimeError::new_err(format!("cannot start {} threads: {why}", self.0))
        };
        Available::now().admit_stacks(self.0).map_err(|why| refused(&why))?;
        let name = |i| format!("snell-{i}");
        let pool = ThreadPoolBuilder::new().num_threads(self.0).thread_name(name).build();
        let pool = Arc::new(pool.map_err(|e| refused(&e))?);
        pools.by_threads.insert(self.0, pool.clone());
        Ok(pool)
    }
}

/// The error of work that was stopped by its flag.
#[derive(Debug)]
pub struct Stopped;

/// A flag that asks work to stop.
#[derive(Debug, Default)]
pub struct Cancel(AtomicBool);

impl Cancel {
    /// Fails if the work should stop. Work calls this every few milliseconds.
    pub fn check(&self) -> Result<(), Stopped> {
        if self.0.load(Ordering::Relaxed) { Err(Stopped) } else { Ok(()) }
    }

    /// The flag itself, which is true once work should stop.
    pub fn flag(&self) -> &AtomicBool {
        &self.0
    }

    /// Makes the work stop at its next check.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// The result of a task in a pool, for waiting threads.
#[derive(Debug)]
pub struct Job<T> {
    result: Mutex<Option<Result<T, String>>>,
    done: Condvar,
}

impl<T> Default for Job<T> {
    fn default() -> Self {
        Self { result: Mutex::new(None), done: Condvar::new() }
    }
}

/// The message of a panic.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied());
    format!("internal error: {}", text.unwrap_or("no message"))
}

impl<T> Job<T> {
    /// Runs `work` and stores its result; a panic becomes an error with its message.
    fn run(&self, work: impl FnOnce() -> T) {
        let result = catch_unwind(AssertUnwindSafe(work)).map_err(|panic| message(&*panic));
        *self.result.lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
        self.done.notify_all();
    }

    /// Waits for at most `time`; true if the work is done.
    fn wait(&self, time: Duration) -> bool {
        let result = self.result.lock().unwrap_or_else(PoisonError::into_inner);
        if result.is_some() {
            return true;
        }
        let (result, _) =
            self.done.wait_timeout(result, time).unwrap_or_else(PoisonError::into_inner);
        result.is_some()
    }

    /// Waits without the interpreter's lock, until the work is done or Ctrl-C is pressed.
    pub fn wait_attentively(&self) -> PyResult<()>
    where
        T: Send,
    {
        self.wait_with(|_| Ok(()))
    }

    /// Like [`Self::wait_attentively`], and calls `look` at the same interval.
    pub fn wait_with(&self, mut look: impl FnMut(Python<'_>) -> PyResult<()>) -> PyResult<()>
    where
        T: Send,
    {
        while !self.wait(LOOK_AT_SIGNALS) {
            Python::attach(|py| py.check_signals().and_then(|()| look(py)))?;
        }
        Ok(())
    }

    /// Waits until the work is done.
    pub fn wait_to_end(&self) {
        while !self.wait(LOOK_AT_SIGNALS) {}
    }

    /// Takes the result of the work, which must be done.
    pub fn take(&self) -> PyResult<T> {
        let result = self.result.lock().unwrap_or_else(PoisonError::into_inner).take();
        result.unwrap_or_else(|| Err("nothing was done".into())).map_err(PyRuntimeError::new_err)
    }
}

impl<T: Clone> Job<T> {
    /// The result of the work, which must be done.
    pub fn result(&self) -> PyResult<T> {
        let result = self.result.lock().unwrap_or_else(PoisonError::into_inner).clone();
        result.unwrap_or_else(|| Err("nothing was done".into())).map_err(PyRuntimeError::new_err)
    }
}

/// Runs work that checks the flag on a pool. If `is_small`, the calling thread does it at once.
pub fn run<T: Send>(
    py: Python<'_>,
    threads: Threads,
    is_small: bool,
    work: impl FnOnce(&Cancel) -> Result<T, Stopped> + Send,
) -> PyResult<T> {
    run_with(py, threads, is_small, |_| Ok(()), work)
}

/// Like [`run`], and calls `look` every few milliseconds while it waits. An error of it stops the
/// work.
pub fn run_with<T: Send>(
    py: Python<'_>,
    threads: Threads,
    is_small: bool,
    look: impl FnMut(Python<'_>) -> PyResult<()> + Send,
    work: impl FnOnce(&Cancel) -> Result<T, Stopped> + Send,
) -> PyResult<T> {
    let stopped = |_| PyRuntimeError::new_err("the query was stopped");
    let cancel = Cancel::default();
    if is_small {
        return py.detach(|| work(&cancel)).map_err(stopped);
    }
    let pool = threads.pool(py)?;
    let job = Job::default();
    let interrupted = py.detach(|| {
        pool.in_place_scope(|scope| {
            scope.spawn(|_| job.run(|| work(&cancel)));
            let waited = job.wait_with(look);
            cancel.0.store(waited.is_err(), Ordering::Relaxed);
            waited
        })
    });
    interrupted?;
    job.take()?.map_err(stopped)
}

/// Starts work on a thread of its own, whose parallel parts use the pool of this number of threads.
pub fn begin_alone<T: Send + 'static>(
    py: Python<'_>,
    threads: Threads,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<Arc<Job<T>>> {
    let pool = threads.pool(py)?;
    let job = Arc::new(Job::default());
    let doing = job.clone();
    let alone = move || pool.install(|| doing.run(work));
    let thread = std::thread::Builder::new().name("snell".into()).spawn(alone);
    thread.map_err(|e| PyRuntimeError::new_err(format!("cannot start a thread: {e}")))?;
    Ok(job)
}

/// Starts work that cannot be stopped, on the pool of all cores.
pub fn begin<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<Arc<Job<T>>> {
    begin_on(py, Threads::new(None)?, work)
}

/// Starts work that cannot be stopped, on a pool.
fn begin_on<T: Send + 'static>(
    py: Python<'_>,
    threads: Threads,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<Arc<Job<T>>> {
    let pool = threads.pool(py)?;
    let job = Arc::new(Job::default());
    let doing = job.clone();
    pool.spawn(move || doing.run(work));
    Ok(job)
}

/// Runs work that cannot be stopped, on all cores. After Ctrl-C the caller no longer waits for it.
pub fn run_to_end<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    run_to_end_on(py, Threads::new(None)?, work)
}

/// Like [`run_to_end`], on this number of threads.
pub fn run_to_end_on<T: Send + 'static>(
    py: Python<'_>,
    threads: Threads,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let job = begin_on(py, threads, work)?;
    py.detach(|| job.wait_attentively())?;
    job.take()
}
