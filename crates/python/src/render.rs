//! Rendering: without the interpreter's lock, on threads of its own, until it is done, out of time or stopped.

use crate::cameras;
use crate::image::{Image, Look};
use crate::prepare::{Prepared, Request as Preparation};
use crate::scene::Scene;
use crate::settings::{self, DEFAULT_SIZE, Keywords, Request};
use crate::work::{Cancel, Threads, begin_alone};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use snell_render::{Film, Job, Progress, Settings, Statistics};
use snell_scene::{Camera, LayeredImage};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often progress is told.
const REPORT: Duration = Duration::from_millis(100);

/// What the threads of a render and those who wait for it share.
#[derive(Debug, Default)]
struct Watch {
    cancel: Cancel,
    progress: Mutex<Progress>,
}

/// What a render gave.
struct Rendered {
    picture: LayeredImage,
    variance: LayeredImage,
    samples: u32,
    statistics: Statistics,
    seconds: f64,
}

/// What a render of these options reads of the scene: the samples per pixel.
#[pyfunction]
pub fn _samples<'py>(py: Python<'py>, scene: &Bound<'py, Scene>, options: &Bound<'py, PyDict>) -> PyResult<u32> {
    Ok(plan(py, scene, &Keywords(options))?.2.settings.spp)
}

/// Makes the scene ready and reads the options.
pub fn plan<'py>(
    py: Python<'py>,
    scene: &Bound<'py, Scene>,
    keywords: &Keywords<'_, 'py>,
) -> PyResult<(Arc<Prepared>, Camera, Request)> {
    let quality = settings::build(keywords)?.quality;
    let size = settings::size(keywords)?.unwrap_or(DEFAULT_SIZE);
    let prepared = scene.get().0.prepared(py, &Preparation { quality, size })?;
    let camera = cameras::choose(&prepared.cameras, keywords.any("camera")?.as_ref())?;
    let request = settings::read(keywords, &prepared.hints, &camera)?;
    Ok((prepared, camera, request))
}

/// Renders what a scene holds. `report` is called with the share that is done and the rays so far; it stops the render by answering False.
#[pyfunction]
#[pyo3(signature = (scene, options, report=None))]
pub fn _render<'py>(
    py: Python<'py>,
    scene: &Bound<'py, Scene>,
    options: &Bound<'py, PyDict>,
    report: Option<Py<PyAny>>,
) -> PyResult<Image> {
    let keywords = Keywords(options);
    let threads = Threads::new(keywords.get("threads", "a whole number")?)?;
    let (prepared, camera, Request { settings, time }) = plan(py, scene, &keywords)?;

    let watch = Arc::new(Watch::default());
    let doing = (prepared.clone(), camera, settings.clone(), watch.clone());
    let job = begin_alone(move || {
        let (prepared, camera, settings, watch) = doing;
        run(&prepared, &camera, &settings, threads, time, &watch)
    })?;
    let (start, mut told) = (Instant::now(), Instant::now());
    let waited = py.detach(|| {
        job.wait_with(|py| {
            let Some(report) = report.as_ref().filter(|_| told.elapsed() >= REPORT) else { return Ok(()) };
            told = Instant::now();
            let progress = *watch.progress.lock().unwrap_or_else(PoisonError::into_inner);
            let share = share(&progress, start.elapsed(), time);
            if report.call1(py, (share, progress.rays))?.is(PyBool::new(py, false)) {
                watch.cancel.stop();
            }
            Ok(())
        })
    });
    if waited.is_err() {
        watch.cancel.stop();
    }
    waited?;
    let Rendered { picture, variance, samples, statistics, seconds } = job.take()?;
    let look = Look::of(&prepared.hints, settings.integrator)?;
    let facts = facts(py, &prepared, &settings, samples, &statistics, seconds)?;
    Ok(Image::new(picture, Some(variance), look, facts))
}

fn run(
    prepared: &Prepared,
    camera: &Camera,
    settings: &Settings,
    threads: Threads,
    time: Option<Duration>,
    watch: &Watch,
) -> Rendered {
    let start = Instant::now();
    let job = Job::new(&prepared.compiled, camera, settings);
    let (film, statistics): (Film, Statistics) = job.run(threads.count(), &|progress| {
        if let Ok(mut last) = watch.progress.try_lock() {
            *last = *progress;
        }
        // A picture with holes is of no use: the time limit waits for the first pass.
        let is_late = progress.passes > 0 && time.is_some_and(|limit| start.elapsed() >= limit);
        !is_late && watch.cancel.check().is_ok()
    });
    let mut variance = film.variance();
    let picture = snell_render::picture(&film, settings, &prepared.compiled);
    variance.layers.truncate(1);
    if picture.layers[0].channels.len() == 3 {
        let main = &mut variance.layers[0];
        main.channels.truncate(3);
        main.values = main.values.chunks(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    }
    Rendered { picture, variance, samples: film.least_samples(), statistics, seconds: start.elapsed().as_secs_f64() }
}

/// How much is done, from 0 to 1.
fn share(progress: &Progress, elapsed: Duration, limit: Option<Duration>) -> f64 {
    let by_samples = progress.done as f64 / progress.total.max(1) as f64;
    let by_time = limit.map_or(0.0, |limit| elapsed.as_secs_f64() / limit.as_secs_f64());
    by_samples.max(by_time).min(1.0)
}

/// What a picture knows of how it was made.
fn facts(
    py: Python<'_>,
    prepared: &Prepared,
    settings: &Settings,
    samples: u32,
    statistics: &Statistics,
    seconds: f64,
) -> PyResult<Py<PyDict>> {
    let facts = PyDict::new(py);
    facts.set_item("scene", &prepared.name)?;
    facts.set_item("integrator", settings.integrator.name())?;
    facts.set_item("samples", samples)?;
    facts.set_item("max_depth", settings.max_depth)?;
    facts.set_item("seed", settings.seed)?;
    facts.set_item("sampler", settings.sampler.name())?;
    facts.set_item("filter", settings.filter.name())?;
    facts.set_item("seconds", seconds)?;
    facts.set_item("rays", statistics.rays.total())?;
    facts.set_item("invalid_samples", statistics.invalid_samples)?;
    facts.set_item("is_complete", statistics.is_complete)?;
    facts.set_item("warnings", &prepared.warnings)?;
    Ok(facts.unbind())
}
