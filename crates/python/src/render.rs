//! Renders without the interpreter's lock, on its own threads, until the picture is done, the time
//! is over or the render is stopped.

use crate::cameras;
use crate::contents::Contents;
use crate::encoding::warn;
use crate::image::{Image, Look};
use crate::keeping::{Keeping, RunError};
use crate::memory;
use crate::origins::{self, ID_AOVS};
use crate::prepare::{Prepared, Request as Preparation};
use crate::receipts;
use crate::scene::Scene;
use crate::settings::{self, Keywords, request_error};
use crate::work::{Cancel, Threads, begin_alone, run_to_end};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use snell_formats::image::cryptomatte;
use snell_math::DVec3;
use snell_oidn::{DenoiseError, Denoiser};
use snell_persist::{Checkpoint, Receipt, Saved, Wording};
use snell_render::layers::{Coverage, name_groups};
use snell_render::{Aov, Film, Job, Progress, Pulse, Request, Settings, Underway, with_patience};
use snell_scene::{Camera, LayeredImage};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Interval of progress reports.
pub const REPORT: Duration = Duration::from_millis(100);

/// A planned render.
pub struct Plan {
    /// The scene and settings.
    pub task: Task,
    /// The number of threads.
    pub threads: Threads,
    look: Look,
    /// Layers that only are needed for others, and are not returned.
    hidden: Vec<&'static str>,
    /// The file that keeps the render on its way.
    keeping: Option<Keeping>,
    /// The options of `snell render` that give the same picture, if there are such.
    arguments: Option<Vec<String>>,
}

/// The state of a render so far.
struct PartialRender {
    underway: Underway,
    checkpoint: Option<Checkpoint>,
    /// True if all pixels are finished.
    is_done: bool,
    seconds: f64,
}

impl PartialRender {
    fn new(underway: Underway, checkpoint: Option<Checkpoint>) -> Self {
        Self { underway, checkpoint, is_done: false, seconds: 0.0 }
    }

    /// Saves the render, if a file keeps it and does not have all of it; returns a warning.
    fn save(&mut self, settings: &Settings) -> Option<String> {
        self.checkpoint.as_mut()?.write(&self.underway, settings)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The goal of one run of a render.
#[derive(Clone, Copy)]
struct Goal {
    /// Samples per pixel; `None` for the requested number.
    samples: Option<u32>,
    /// Maximum time; `None` for no limit.
    time: Option<Duration>,
}

/// State shared by the threads of a render and the waiting thread.
#[derive(Debug, Default)]
struct Watch {
    cancel: Cancel,
    progress: Mutex<Progress>,
}

/// A picture of a film.
pub struct Finished {
    picture: LayeredImage,
    variance: LayeredImage,
    receipt: Option<Receipt>,
}

/// The result of a render.
struct Rendered {
    partial: PartialRender,
    finished: Finished,
    /// What went wrong with the checkpoint.
    warnings: Vec<String>,
}

/// A render that can be continued.
#[pyclass(frozen, module = "snell._snell")]
pub struct _Render {
    plan: Arc<Plan>,
    partial: Mutex<Option<PartialRender>>,
}

/// The scene and settings of a render.
pub struct Task {
    /// The scene, ready to be rendered.
    pub prepared: Arc<Prepared>,
    /// The camera.
    pub camera: Camera,
    /// The request of the user.
    pub request: Request,
    /// The settings derived from the request.
    pub settings: Settings,
    /// The denoiser.
    pub denoiser: Option<Denoiser>,
    /// The contents of the scene.
    pub contents: Arc<Contents>,
}

impl Task {
    /// Prepares the scene, reads the options and loads the denoiser.
    pub fn new<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        keywords: &Keywords<'_, 'py>,
    ) -> PyResult<Self> {
        let task = Self::without_denoiser(py, scene, keywords)?;
        Ok(Self { denoiser: settings::denoiser(&task.request)?, ..task })
    }

    /// Like [`Self::new`], for a render whose picture is denoised elsewhere, if at all.
    pub fn without_denoiser<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        keywords: &Keywords<'_, 'py>,
    ) -> PyResult<Self> {
        let request = settings::request(keywords)?;
        let threads = Threads::new(keywords.get("threads", "a whole number")?)?;
        if let Some(size) = request.size {
            // This is a lower bound; the rest is checked when all settings are known.
            let crop = request.crop_within(size).map_err(request_error)?;
            let least = Settings { size, crop, spp: 1, ..Settings::default() };
            memory::check_picture(&least, 1, false)?;
        }
        let mut build = request.build();
        let contents = scene.get().0.contents(py);
        build.compact |= contents.compact;
        let size = request.size.unwrap_or(Request::DEFAULT_SIZE);
        let shutter = shutter(keywords)?;
        let wanted = Preparation { build, size, shutter };
        let prepared = scene.get().0.prepared(py, &wanted, threads)?;
        let wanted = keywords.any("camera")?;
        let mut camera = cameras::choose(&prepared.scene.cameras, wanted.as_ref())?;
        if wanted.is_some_and(|wanted| wanted.is_instance_of::<crate::camera::Camera>()) {
            camera.eye += prepared.moved_by;
        }
        let settings = request.resolve(&prepared.scene, &camera).map_err(request_error)?;
        memory::check_picture(&settings, threads.count(), request.denoise.is_some())?;
        Ok(Self { prepared, camera, request, settings, denoiser: None, contents })
    }
}

/// The times at which the shutter opens and closes.
fn shutter(keywords: &Keywords<'_, '_>) -> PyResult<Option<[f64; 2]>> {
    let shutter: Option<[f64; 2]> = keywords.get("shutter", "two times, (open, close)")?;
    match shutter {
        Some([open, close]) if !(open.is_finite() && close.is_finite() && open <= close) => {
            Err(PyValueError::new_err(format!(
                "shutter is ({open}, {close}), expected when it opens and when it closes, in order"
            )))
        }
        shutter => Ok(shutter),
    }
}

#[pymethods]
impl _Render {
    /// Prepares the scene and reads the options. `checkpoint` is the file that keeps the render on
    /// its way, the seconds between two savings, and whether the render goes on with what is there.
    #[new]
    #[pyo3(signature = (scene, options, checkpoint=None))]
    fn new<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        options: &Bound<'py, PyDict>,
        checkpoint: Option<(PathBuf, f64, bool)>,
    ) -> PyResult<Self> {
        let keywords = Keywords(options);
        let mut plan = Plan::new(Task::new(py, scene, &keywords)?, &keywords)?;
        if let Some(wanted) = checkpoint {
            plan.keeping = Some(Keeping::new(py, scene, &plan.task, &keywords, wanted)?);
        }
        Ok(Self { plan: Arc::new(plan), partial: Mutex::new(None) })
    }

    /// Saves the render, if a file keeps it.
    fn save(&self, py: Python<'_>) -> PyResult<()> {
        let Some(mut partial) = lock(&self.partial).take() else { return Ok(()) };
        let plan = self.plan.clone();
        let (partial, warning) = run_to_end(py, move || {
            let warning = partial.save(&plan.task.settings);
            (partial, warning)
        })?;
        *lock(&self.partial) = Some(partial);
        warning.map_or(Ok(()), |warning| warn(py, warning))
    }

    /// Requested samples per pixel.
    #[getter]
    fn samples(&self) -> u32 {
        self.plan.task.settings.spp
    }

    /// The number of samples that pixels which take more samples have.
    #[getter]
    fn taken(&self) -> u32 {
        lock(&self.partial).as_ref().map_or(0, |partial| partial.underway.samples())
    }

    /// True if the render is complete.
    #[getter]
    fn is_done(&self) -> bool {
        let partial = lock(&self.partial);
        partial.as_ref().is_some_and(|partial| partial.is_done)
    }

    /// Continues until every pixel has this number of samples (all if left out), or for this number
    /// of seconds. `report` is called with the share done and the number of rays so far, ten times
    /// a second and at the end; it stops the render by returning False.
    #[pyo3(signature = (samples=None, time=None, report=None))]
    fn render(
        &self,
        py: Python<'_>,
        samples: Option<u32>,
        time: Option<f64>,
        report: Option<Py<PyAny>>,
    ) -> PyResult<Image> {
        let time = time.map(|s| Duration::try_from_secs_f64(s).unwrap_or_default()).or(self
            .plan
            .task
            .request
            .time);
        let goal = Goal { samples, time };
        let watch = Arc::new(Watch::default());
        let partial = lock(&self.partial).take();
        let doing = (self.plan.clone(), watch.clone());
        let job = begin_alone(py, self.plan.threads, move || doing.0.run(partial, goal, &doing.1))?;
        let (start, mut reported) = (Instant::now(), Instant::now());
        let waited = py.detach(|| {
            job.wait_with(|py| {
                let Some(report) = report.as_ref().filter(|_| reported.elapsed() >= REPORT) else {
                    return Ok(());
                };
                reported = Instant::now();
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
            if self.plan.keeping.is_some() {
                // What was rendered is saved before the program goes on, or ends.
                py.detach(|| job.wait_to_end());
                let rendered = job.take()?;
                *lock(&self.partial) = rendered.ok().map(|rendered| rendered.partial);
            }
        }
        waited?;
        let Rendered { partial, finished, warnings } = job.take()?.map_err(|e| e.raised())?;
        warnings.into_iter().try_for_each(|warning| warn(py, warning))?;
        if let Some(report) = report.filter(|_| watch.cancel.check().is_ok()) {
            // Short renders would not report anything otherwise.
            let progress = *watch.progress.lock().unwrap_or_else(PoisonError::into_inner);
            let share = if partial.is_done { 1.0 } else { share(&progress, start.elapsed(), time) };
            let rays = partial.underway.statistics.rays.total().max(progress.rays);
            report.call1(py, (share, rays))?;
        }
        let PartialRender { underway, seconds, .. } = &partial;
        let image = self.plan.image(py, finished, underway, *seconds);
        *lock(&self.partial) = Some(partial);
        image
    }
}

impl Plan {
    /// Plans a render of a task.
    pub fn new(mut task: Task, keywords: &Keywords<'_, '_>) -> PyResult<Self> {
        let mut hidden = Vec::new();
        let aovs = &mut task.settings.aovs;
        if ID_AOVS.iter().any(|aov| aovs.contains(aov)) {
            hidden.extend(ID_AOVS.into_iter().filter(|aov| !aovs.contains(aov)).map(Aov::name));
            let missing: Vec<_> =
                ID_AOVS.into_iter().filter(|aov| hidden.contains(&aov.name())).collect();
            aovs.extend(missing);
        }
        let exposure = task.request.exposure;
        let tonemap: Option<String> = keywords.get("tonemap", "a name")?;
        let look = Look::of(&task.prepared.scene.settings, task.settings.integrator)?;
        let look = look.with(exposure, tonemap.as_deref())?;
        let threads = Threads::new(keywords.get("threads", "a whole number")?)?;
        let arguments = receipts::arguments(&task, keywords)?;
        Ok(Self { task, threads, look, hidden, keeping: None, arguments })
    }

    fn run(
        &self,
        partial: Option<PartialRender>,
        goal: Goal,
        watch: &Watch,
    ) -> Result<Rendered, RunError> {
        let (pulse, time) = (Pulse::default(), goal.time);
        let is_stopped = || watch.cancel.check().is_err() || pulse.is_stuck(time);
        with_patience(is_stopped, |cancel| self.run_with(partial, goal, watch, &pulse, cancel))
    }

    fn run_with(
        &self,
        partial: Option<PartialRender>,
        goal: Goal,
        watch: &Watch,
        pulse: &Pulse,
        cancel: &AtomicBool,
    ) -> Result<Rendered, RunError> {
        let Task { prepared, camera, request, settings, .. } = &self.task;
        let (start, compiled) = (Instant::now(), &prepared.compiled);
        let job = Job::new(compiled, camera, settings).with_cancel(cancel);
        let keep_going = |progress: &Progress| {
            pulse.beat();
            if progress.training.is_none()
                && let Ok(mut last) = watch.progress.try_lock()
            {
                *last = *progress;
            }
            let is_timed = request.is_training_timed();
            !progress.is_late(start.elapsed(), goal.time, is_timed) && watch.cancel.check().is_ok()
        };
        let threads = self.threads.count();
        let mut warnings = Vec::new();
        let mut partial = match (partial, &self.keeping) {
            (Some(partial), _) => partial,
            (None, None) => PartialRender::new(job.begin(threads, &keep_going), None),
            (None, Some(keeping)) => {
                let checkpoint = keeping.checkpoint();
                let (underway, warning) = checkpoint.begin(
                    &job,
                    keeping.resume,
                    Wording::PYTHON,
                    threads,
                    &keep_going,
                )?;
                warnings.extend(warning);
                PartialRender::new(underway, Some(checkpoint))
            }
        };
        let PartialRender { underway, checkpoint, is_done, seconds } = &mut partial;
        let until = goal.samples.unwrap_or(settings.spp);
        let checkpoint = checkpoint.iter_mut().map(|checkpoint| checkpoint as &mut dyn Saved);
        let mut saved: Vec<_> = checkpoint.collect();
        let warn = &mut |warning| warnings.push(warning);
        let go_on = snell_persist::go_on;
        *is_done = !go_on(&job, underway, until, threads, &keep_going, &mut saved, warn);
        *seconds += start.elapsed().as_secs_f64();
        let finished = self.finish(&underway.film, *seconds)?;
        Ok(Rendered { partial, finished, warnings })
    }

    /// The picture of a film with all its layers, denoised if that was requested, its variance, and
    /// its receipt. `seconds` is the time that the film took.
    pub fn finish(&self, film: &Film, seconds: f64) -> Result<Finished, DenoiseError> {
        let Task { prepared, settings, denoiser, .. } = &self.task;
        let mut picture = snell_render::picture(film, settings, &prepared.compiled);
        origins::rename(&mut picture, prepared);
        picture.layers.retain(|layer| !self.hidden.contains(&layer.name.as_str()));
        place_back(&mut picture, prepared.moved_by);
        name_groups(&mut picture, film, &settings.light_groups);
        self.add_cryptomatte(&mut picture, film);
        if let Some(denoiser) = denoiser {
            denoiser.denoise_picture(&mut picture, self.threads.count())?;
        }
        let variance = variance(film, picture.layers[0].channels.len());
        let arguments = self.arguments.as_ref();
        let receipt = arguments.and_then(|a| receipts::of_film(&self.task, a, film, seconds));
        Ok(Finished { picture, variance, receipt })
    }

    /// A picture with the metadata of a render.
    pub fn image(
        &self,
        py: Python<'_>,
        Finished { picture, variance, receipt }: Finished,
        underway: &Underway,
        seconds: f64,
    ) -> PyResult<Image> {
        let facts = facts(py, self, underway, seconds)?;
        for (key, value) in &picture.metadata {
            facts.bind(py).set_item(key, value)?;
        }
        Ok(Image::new(picture, Some(variance), self.look, facts).with_receipt(receipt))
    }

    /// Adds the layers and the metadata of Cryptomatte.
    fn add_cryptomatte(&self, picture: &mut LayeredImage, film: &Film) {
        let Prepared { scene, compiled, .. } = &*self.task.prepared;
        for (aov, kind) in
            [(Aov::CryptoObject, "CryptoObject"), (Aov::CryptoMaterial, "CryptoMaterial")]
        {
            if let Some(coverage) = Coverage::of(film, aov, scene, compiled) {
                let matte = cryptomatte::encode(
                    kind,
                    &coverage.names,
                    coverage.shares.iter().map(Vec::as_slice),
                );
                picture.layers.extend(matte.layers);
                picture.metadata.extend(matte.metadata);
            }
        }
    }
}

/// Moves positions in a picture of a scene that was moved by `by` back to their places. Pixels that
/// show nothing have the position 0 and keep it.
fn place_back(picture: &mut LayeredImage, by: DVec3) {
    let layer = picture.layers.iter_mut().find(|layer| layer.name == Aov::Position.name());
    let Some(layer) = layer.filter(|_| by != DVec3::ZERO) else { return };
    for position in layer.values.as_chunks_mut::<3>().0.iter_mut().filter(|p| **p != [0.0; 3]) {
        *position = (DVec3::from(position.map(f64::from)) - by).as_vec3().to_array();
    }
}

/// The variance of the first `channels` of a picture.
fn variance(film: &Film, channels: usize) -> LayeredImage {
    let mut variance = film.variance();
    variance.layers.truncate(1);
    let main = &mut variance.layers[0];
    let all = main.channels.len();
    if channels < all {
        main.channels.truncate(channels);
        main.values = main.values.chunks(all).flat_map(|p| &p[..channels]).copied().collect();
    }
    variance
}

/// The finished share of the render, from 0 to 1.
fn share(progress: &Progress, elapsed: Duration, limit: Option<Duration>) -> f64 {
    let by_samples = progress.done as f64 / progress.total.max(1) as f64;
    let by_time = limit.map_or(0.0, |limit| elapsed.as_secs_f64() / limit.as_secs_f64().max(1e-9));
    by_samples.max(by_time).min(1.0)
}

/// The metadata that a render gives its picture.
fn facts(
    py: Python<'_>,
    plan: &Plan,
    Underway { film, statistics, .. }: &Underway,
    seconds: f64,
) -> PyResult<Py<PyDict>> {
    let settings: &Settings = &plan.task.settings;
    let facts = PyDict::new(py);
    facts.set_item("scene", &plan.task.prepared.scene.name)?;
    facts.set_item("integrator", settings.integrator.name())?;
    facts.set_item("samples", film.least_samples())?;
    if settings.noise.is_some() {
        let [width, height] = film.crop.size().map(f64::from);
        facts.set_item("mean_samples", film.mean_samples())?;
        facts.set_item("converged", statistics.converged_pixels as f64 / (width * height))?;
    }
    if settings.guiding.is_some() {
        facts.set_item("training_passes", statistics.training_passes)?;
    }
    facts.set_item("max_depth", settings.max_depth)?;
    facts.set_item("seed", settings.seed)?;
    facts.set_item("sampler", settings.sampler.name())?;
    facts.set_item("filter", settings.filter.name())?;
    facts.set_item("seconds", seconds)?;
    facts.set_item("rays", statistics.rays.total())?;
    facts.set_item("invalid_samples", statistics.invalid_samples)?;
    facts.set_item("cut_paths", statistics.cut_paths)?;
    let estimate = memory::estimate(&plan.task, plan.threads.count());
    facts.set_item("estimated_memory_bytes", estimate.bytes())?;
    facts.set_item("is_complete", statistics.is_complete)?;
    facts.set_item("warnings", &plan.task.prepared.warnings)?;
    Ok(facts.unbind())
}
