//! A render: parts, threads and progress.
//!
//! The unit of work is a *part*: one tile of 16 x 16 pixels and one range of sample numbers.
//! Threads take parts in a fixed order and fold them into the film tile by tile, in the order of
//! the samples. The picture does not depend on which thread rendered which part.

mod caustics;
mod glance;
mod journal;
mod light_parts;
mod part;
mod parts;
mod patience;
mod photons;
mod projection_maps;
mod saved;
mod task;
mod tracer;
mod training;
mod underway;
mod volumes;

pub(crate) use journal::{Event, Journal, Shaded};
pub use patience::{Pulse, with_patience};
pub use saved::{
    Difference, FRAME, Fact, Header, MARK_BYTES, Origin, SavedError, TaskInput, fact, facts,
    may_be_checkpoint,
};
pub use task::{Split, Task, TaskResult};
pub use tracer::{Recording, camera_filter, hit_filter};
pub use underway::Underway;

use crate::compile::CompiledScene;
use crate::film::filter::FilterSampler;
use crate::film::{Film, FilmPart, FilmTile};
use crate::guiding::{Field, Guiding};
use crate::integrator::Context;
use crate::light_sampler::LightSampler;
use crate::sampler::Sampler;
use crate::settings::{Crop, Settings, TileOrder};
use crate::threads::on_threads;
use caustics::Caustics;
pub use caustics::PhotonCounts;
use light_parts::LightParts;
use part::{Gathering, PartRenderer};
use parts::{Parts, Ranges};
use serde::{Deserialize, Serialize};
use snell_math::rng;
use snell_scene::Camera;
use std::collections::BTreeMap;
use std::ops::AddAssign;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};
use tracer::Tracer;

/// Numbers of rays traced, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RayCounts {
    /// Camera rays.
    pub camera: u64,
    /// Rays towards lights.
    pub shadow: u64,
    /// Rays after a bounce.
    pub indirect: u64,
}

impl RayCounts {
    /// The number of rays of all kinds.
    pub fn total(&self) -> u64 {
        self.camera.saturating_add(self.shadow).saturating_add(self.indirect)
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        // Numbers of a file may be any.
        self.camera = self.camera.saturating_add(other.camera);
        self.shadow = self.shadow.saturating_add(other.shadow);
        self.indirect = self.indirect.saturating_add(other.indirect);
    }
}

/// Statistics of a render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Statistics {
    /// Numbers of rays traced.
    pub rays: RayCounts,
    /// The number of samples taken, over all pixels.
    pub samples: u64,
    /// The number of samples that were not finite and counted as black. It is always 0 unless a
    /// material or light has an error.
    pub invalid_samples: u64,
    /// The number of paths of the integrator `path` that still met something after the largest
    /// number of bounces, so that light may be missing. It is 0 if no path is cut short.
    pub cut_paths: u64,
    /// Time that threads spent in ray queries, summed over all threads. Not reproducible.
    pub tracing: Duration,
    /// The number of complete training passes of path guiding.
    pub training_passes: u32,
    /// The time that training took.
    pub training: Duration,
    /// The rays that training has traced; they are among `rays`.
    pub training_rays: RayCounts,
    /// The number of trained regions of the guiding field.
    pub guiding_regions: u64,
    /// Memory use of the guiding field in bytes.
    pub guiding_bytes: u64,
    /// The number of pixels whose error is within the requested limit; 0 without a limit.
    pub converged_pixels: u64,
    /// False if the render was stopped before all samples were taken.
    pub is_complete: bool,
}

/// The progress of a render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// The number of samples taken, over all pixels.
    pub done: u64,
    /// The number of samples requested, over all pixels; an estimate if pixels stop by their error.
    pub total: u64,
    /// The number of rays traced so far.
    pub rays: u64,
    /// The number of passes over the whole picture that are complete, or will be if the render is
    /// stopped now, because threads finish their current parts.
    pub passes: usize,
    /// The progress of training for guiding; `None` when it does not run. While it runs, returning
    /// false ends training with the complete passes, and rendering starts.
    pub training: Option<Training>,
}

impl Progress {
    /// True if a render that has taken this long must stop because of its time limit. Training
    /// whose number of passes is not fixed stops if the next pass, which takes as long as all
    /// passes before, would exceed the fraction [`Guiding::SHARE`] of the limit. Rendering
    /// continues until each pixel has a sample, since an incomplete picture is useless.
    pub fn is_late(
        &self,
        elapsed: Duration,
        limit: Option<Duration>,
        is_training_timed: bool,
    ) -> bool {
        let Some(limit) = limit else { return false };
        match self.training {
            Some(training) => {
                is_training_timed
                    && training.begun == 0
                    && elapsed * 2 > limit.mul_f64(Guiding::SHARE)
            }
            None => self.passes > 0 && elapsed >= limit,
        }
    }
}

/// The progress of training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Training {
    /// The number of the pass, from 0. Each pass takes about as long as all passes before.
    pub pass: u32,
    /// The number of parts of this pass that were started so far.
    pub begun: usize,
    /// The number of parts of this pass.
    pub parts: usize,
}

/// A render that is planned but not run yet.
pub struct Job<'a> {
    scene: &'a CompiledScene,
    camera: &'a Camera,
    settings: &'a Settings,
    sampler: Sampler,
    filter: &'static FilterSampler,
    lights: Arc<LightSampler>,
    light_parts: LightParts,
    watcher: Option<TileWatcher<'a>>,
    cancel: Option<&'a AtomicBool>,
    /// The photons, once they were needed; `None` inside if there are none.
    caustics: OnceLock<Option<Caustics<'a>>>,
}

/// A tile that several threads fill.
struct SharedTile {
    tile: FilmTile,
    /// The first sample of the part that is added next.
    next: u32,
    /// The pixels of the tile that take samples; `None` if all do.
    pixels: Option<Vec<u32>>,
    /// Parts that were rendered before an earlier part of the tile was complete, by first sample.
    waiting: BTreeMap<u32, FilmPart>,
}

/// The state shared by threads while they render a list of parts.
struct Shared<'b> {
    tiles: &'b [Mutex<SharedTile>],
    parts: &'b Parts,
    /// The number of the next part to take.
    next: AtomicUsize,
    /// The number of passes over the whole picture that were already complete.
    passes: usize,
    tally: &'b Tally,
    keep_going: &'b (dyn Fn(&Progress) -> bool + Sync),
}

/// A callback for every tile that has got more samples. It is called from any thread.
pub type TileWatcher<'a> = &'a (dyn Fn(&FilmTile) + Sync);

/// Statistics of a render so far.
#[derive(Default)]
struct Tally {
    /// The guiding field, if paths are guided.
    field: Option<Field>,
    done: AtomicU64,
    total: AtomicU64,
    rays: AtomicU64,
    stopped: AtomicBool,
    record: bool,
    statistics: Mutex<Statistics>,
    recording: Mutex<Recording>,
}

impl<'a> Job<'a> {
    /// Plans a render.
    pub fn new(scene: &'a CompiledScene, camera: &'a Camera, settings: &'a Settings) -> Self {
        Self {
            scene,
            camera,
            settings,
            sampler: Sampler::of(settings),
            filter: FilterSampler::of(settings.filter),
            lights: scene.light_sampler(settings.light_sampler, settings.light_strategy),
            light_parts: LightParts::new(scene, settings),
            watcher: None,
            cancel: None,
            caustics: OnceLock::new(),
        }
    }

    /// Sets a callback that is called for tiles when they get samples.
    pub fn watched(self, watcher: TileWatcher<'a>) -> Self {
        Self { watcher: Some(watcher), ..self }
    }

    /// Sets a flag that cancels the current parts. When `keep_going` returns false, threads finish
    /// their current parts, which may take minutes where a ray has millions of hits. When the flag
    /// is set they soon abandon these parts, and the film keeps only complete ones. A cancelled
    /// render makes no further progress.
    pub fn with_cancel(self, cancel: &'a AtomicBool) -> Self {
        Self { cancel: Some(cancel), ..self }
    }

    /// Renders with `threads` threads (at least one) until all samples are taken or `keep_going`
    /// returns false. `keep_going` is called often, from any thread, with the progress so far.
    pub fn run(
        &self,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> (Film, Statistics) {
        let mut underway = self.begin(threads, keep_going);
        self.go_on(&mut underway, self.settings.spp, threads, keep_going);
        (underway.film, underway.statistics)
    }

    /// The scene of the render.
    pub fn scene(&self) -> &'a CompiledScene {
        self.scene
    }

    /// The settings of the render.
    pub fn settings(&self) -> &'a Settings {
        self.settings
    }

    /// A film of this render without samples.
    pub fn empty_film(&self) -> Film {
        empty_film(self.settings)
    }

    /// Continues a film of this render until every pixel has `until` samples (at most the requested
    /// number), or until `keep_going` returns false. The film does not depend on the number of
    /// calls. No pixel stops by its error.
    pub fn extend(
        &self,
        film: Film,
        until: u32,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> (Film, Statistics) {
        let mut underway = self.begin_from(film, threads, keep_going);
        self.fill(&mut underway, until, threads, keep_going, false);
        (underway.film, underway.statistics)
    }

    /// Records the rays that [`Self::extend`] traces, batch by batch, with 32 bytes for each ray.
    /// The order of batches is not reproducible.
    pub fn record(&self, threads: usize) -> Recording {
        self.fill(&mut self.begin(threads, &|_| true), self.settings.spp, threads, &|_| true, true)
    }

    /// Renders all samples of one pixel of the whole picture, and passes them block by block with
    /// their journal to a callback. The samples have the same bits as those of [`Self::run`] if no
    /// pixel stops by its error.
    pub(crate) fn observe(
        &self,
        pixel: [u32; 2],
        threads: usize,
        see: &mut dyn FnMut(&FilmPart, &Journal),
    ) {
        let (trained, _) = self.trained(None, threads, &|_| true);
        let (wants_lobes, field) = (self.light_parts.want_lobes(), trained.as_ref());
        let context = Context {
            scene: self.scene,
            settings: self.settings,
            lights: &self.lights,
            field,
            wants_lobes,
        };
        let tracer = Tracer::new(self.scene, None, self.cancel);
        let mut renderer = PartRenderer::new(
            context,
            self.camera,
            &self.sampler,
            self.filter,
            &self.light_parts,
            tracer,
        )
        .with_caustics(self.caustics().map(Gathering::new));
        for range in
            (Ranges::Blocks { start: 0, end: self.settings.spp, is_progressive: false }).all()
        {
            renderer.journal = Some(Journal::default());
            let part = renderer.render(area_of(pixel), None, range, &mut Statistics::default());
            see(&part, &renderer.journal.take().unwrap_or_default());
        }
    }

    /// The photons of the render; `None` if it has none.
    fn caustics(&self) -> Option<&Caustics<'a>> {
        let make = || Caustics::new(self.scene, self.camera, self.settings, &self.lights);
        self.caustics.get_or_init(make).as_ref()
    }

    /// Figures of the photons that this job has shot so far; `None` if caustics are not found by
    /// photons.
    pub fn photons(&self) -> Option<PhotonCounts> {
        self.caustics().map(Caustics::counts)
    }

    /// An empty film of this render for one pixel of the whole picture.
    pub(crate) fn film_of_pixel(&self, pixel: [u32; 2]) -> Film {
        Film::with_mean_weight(area_of(pixel), &self.settings.aovs, self.filter.mean_weight())
    }

    /// Trains the guiding field, if the settings request guiding, in at most this many passes.
    fn trained(
        &self,
        passes: Option<u32>,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> (Option<Field>, Statistics) {
        let mut statistics = Statistics::default();
        let begin = Instant::now();
        let field = self.train(passes, threads, keep_going, &mut statistics);
        statistics.training = if field.is_some() { begin.elapsed() } else { Duration::ZERO };
        statistics.training_rays = statistics.rays;
        (field, statistics)
    }

    /// The missing parts of a film, given the missing ranges of samples of each tile.
    fn parts(&self, film: &Film, ranges: impl Fn(usize) -> Ranges) -> Parts {
        Parts::new(tile_order(film.tiles.len(), self.settings.tile_order), ranges)
    }

    fn render_parts(
        &self,
        film: &mut Film,
        active: &[Option<Vec<u32>>],
        parts: &Parts,
        passes: usize,
        threads: usize,
        tally: &Tally,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) {
        let tiles = std::mem::take(&mut film.tiles).into_iter().zip(active);
        let tiles: Vec<_> = tiles
            .enumerate()
            .map(|(number, (tile, pixels))| {
                let next = parts.first(number).unwrap_or(0);
                let (pixels, waiting) = (pixels.clone(), BTreeMap::new());
                Mutex::new(SharedTile { tile, next, pixels, waiting })
            })
            .collect();
        let shared =
            Shared { tiles: &tiles, parts, next: AtomicUsize::new(0), passes, tally, keep_going };
        on_threads(threads, || self.work(&shared));
        film.tiles = tiles.into_iter().map(|t| into_inner(t).tile).collect();
    }

    /// The loop of a thread: takes the next part, renders it, and adds it to its tile, until none
    /// is left.
    fn work(&self, shared: &Shared) {
        let Shared { tiles, parts, next, passes, tally, keep_going } = shared;
        let wants_lobes = self.light_parts.want_lobes();
        let field = tally.field.as_ref();
        let context = Context {
            scene: self.scene,
            settings: self.settings,
            lights: &self.lights,
            field,
            wants_lobes,
        };
        let tracer = Tracer::new(self.scene, tally.record.then(Recording::default), self.cancel);
        let mut renderer = PartRenderer::new(
            context,
            self.camera,
            &self.sampler,
            self.filter,
            &self.light_parts,
            tracer,
        )
        .with_caustics(self.caustics().map(Gathering::new));
        let mut mine = Statistics::default();
        loop {
            // `keep_going` is asked before a part is taken. Every part that is taken is rendered,
            // so the passes counted here will be complete, however slow some thread is.
            let progress = Progress {
                done: tally.done.load(Ordering::Relaxed),
                total: tally.total.load(Ordering::Relaxed),
                rays: tally.rays.load(Ordering::Relaxed),
                passes: passes + next.load(Ordering::Relaxed) / tiles.len().max(1),
                training: None,
            };
            if next.load(Ordering::Relaxed) >= parts.end() {
                break;
            }
            if tally.stopped.load(Ordering::Relaxed) || !keep_going(&progress) {
                tally.stopped.store(true, Ordering::Relaxed);
                break;
            }
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= parts.end() {
                break;
            }
            let Some((tile, range)) = parts.get(number) else { continue };
            let tile = &tiles[tile];
            let (area, pixels) = {
                let tile = lock(tile);
                (tile.tile.area, tile.pixels.clone())
            };
            let before = mine.rays.total();
            let part = renderer.render(area, pixels.as_deref(), range, &mut mine);
            if renderer.tracer.is_cancelled() {
                tally.stopped.store(true, Ordering::Relaxed);
                break;
            }
            let samples = part.values.len() as u64;
            mine.samples += samples;
            tally.done.fetch_add(samples, Ordering::Relaxed);
            tally.rays.fetch_add(mine.rays.total() - before, Ordering::Relaxed);
            let mut tile = lock(tile);
            tile.accept(part);
            if let Some(watcher) = self.watcher {
                watcher(&tile.tile);
            }
        }
        let mut all = lock(&tally.statistics);
        all.rays += mine.rays;
        all.samples += mine.samples;
        all.invalid_samples += mine.invalid_samples;
        all.cut_paths += mine.cut_paths;
        all.tracing += renderer.tracer.spent;
        lock(&tally.recording).append(renderer.tracer.recording.unwrap_or_default());
    }
}

impl SharedTile {
    fn accept(&mut self, part: FilmPart) {
        self.waiting.insert(part.samples[0], part);
        while let Some(part) = self.waiting.remove(&self.next) {
            self.tile.fold(&part);
            self.next = part.samples[1];
        }
    }
}

/// The film of a render with these settings, without samples.
fn empty_film(settings: &Settings) -> Film {
    let full = Crop::full(settings.size);
    let crop = settings.crop.map_or(full, |c| Crop {
        min: [c.min[0].min(full.max[0]), c.min[1].min(full.max[1])],
        max: [c.max[0].min(full.max[0]), c.max[1].min(full.max[1])],
    });
    let mean_weight = FilterSampler::of(settings.filter).mean_weight();
    let mut film = Film::with_mean_weight(crop, &settings.aovs, mean_weight);
    film.noise_floor = settings.noise_floor;
    film
}

fn area_of(pixel: [u32; 2]) -> Crop {
    Crop { min: pixel, max: pixel.map(|p| p + 1) }
}

fn pixels(area: &Crop) -> u64 {
    area.size().iter().map(|&x| u64::from(x)).product()
}

/// Locks a mutex even if another thread has panicked. The film stays valid, because only complete
/// parts are added.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn into_inner<T>(mutex: Mutex<T>) -> T {
    mutex.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn tile_order(count: usize, order: TileOrder) -> Vec<usize> {
    let mut tiles: Vec<usize> = (0..count).collect();
    match order {
        TileOrder::Rows => {}
        TileOrder::Reversed => tiles.reverse(),
        TileOrder::Shuffled(key) => tiles.sort_by_key(|&t| rng::hash_combine(key, t as u32)),
    }
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::Grouping;

    #[test]
    fn the_rays_that_are_recorded_are_those_that_are_counted() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        let settings = Settings { size: [20, 20], spp: 16, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let (_, statistics) = job.run(2, &|_| true);
        let recording = job.record(2);
        let count = |wanted: Grouping| {
            let batches = recording.closest.iter().filter(|(grouping, _)| *grouping == wanted);
            batches.map(|(_, rays)| rays.len() as u64).sum::<u64>()
        };
        let shadow = recording.occluded.iter().map(|rays| rays.len() as u64).sum();
        let recorded = RayCounts {
            camera: count(Grouping::Coherent),
            shadow,
            indirect: count(Grouping::None),
        };
        assert_eq!(recorded, statistics.rays);
        assert!(statistics.tracing > Duration::ZERO);
    }

    #[test]
    fn a_film_that_is_extended_step_by_step_is_the_film_of_one_run() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        let settings = Settings { size: [20, 20], spp: 20, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let whole = job.run(2, &|_| true).0.image();
        for steps in [&[1, 4, 16, 20][..], &[7, 7, 30], &[19, 20]] {
            let mut film = job.empty_film();
            for &until in steps {
                // The render is also stopped in the middle of a step, when tiles differ in their
                // number of samples.
                let asked = AtomicUsize::new(0);
                film = job.extend(film, until, 2, &|_| asked.fetch_add(1, Ordering::Relaxed) < 3).0;
                let statistics;
                (film, statistics) = job.extend(film, until, 2, &|_| true);
                assert!(
                    statistics.is_complete && film.least_samples() == until.min(20),
                    "{steps:?}"
                );
            }
            assert_eq!(film.image(), whole, "{steps:?}");
        }
    }
}
