//! A render: parts, threads, progress.
//!
//! The unit of work is a *part*: one tile of 16 x 16 pixels and one range of sample numbers. Threads take parts in a fixed order and
//! fold them into the film tile by tile, in order of the samples; which thread did what never shows in the picture.

mod part;
mod paths;
mod tracer;
mod volumes;

pub use tracer::{Recording, hit_filter};

use crate::compile::CompiledScene;
use crate::film::filter::FilterSampler;
use crate::film::{BLOCK, Film, FilmPart, FilmTile};
use crate::integrator::Context;
use crate::light_sampler::LightSampler;
use crate::sampler::Sampler;
use crate::settings::{Crop, Settings, TileOrder};
use part::PartRenderer;
use snell_math::rng;
use snell_scene::Camera;
use std::collections::BTreeMap;
use std::ops::AddAssign;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;
use tracer::Tracer;

/// Rays traced, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// From the camera.
    pub camera: u64,
    /// Towards lights.
    pub shadow: u64,
    /// After a bounce.
    pub indirect: u64,
}

impl RayCounts {
    /// All kinds together.
    pub fn total(&self) -> u64 {
        self.camera + self.shadow + self.indirect
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.camera += other.camera;
        self.shadow += other.shadow;
        self.indirect += other.indirect;
    }
}

/// What a render did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Rays traced.
    pub rays: RayCounts,
    /// Samples that were not finite and counted as black. Always 0 unless there is a fault in a material or light.
    pub invalid_samples: u64,
    /// Time that threads spent in ray queries, all threads together. Not the same each time.
    pub tracing: Duration,
    /// False if the render was stopped before all samples were taken.
    pub is_complete: bool,
}

/// How far a render is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Pixel samples taken.
    pub done: u64,
    /// Pixel samples asked for.
    pub total: u64,
    /// Rays traced so far.
    pub rays: u64,
    /// Passes over the whole picture that are complete, or will be if the render is stopped now: threads end what they began.
    pub passes: usize,
}

/// One render, planned.
pub struct Job<'a> {
    scene: &'a CompiledScene,
    camera: &'a Camera,
    settings: &'a Settings,
    sampler: Sampler,
    filter: FilterSampler,
    lights: LightSampler,
    crop: Crop,
}

/// A tile being filled by several threads.
struct SharedTile {
    tile: FilmTile,
    /// Parts whose predecessors are still being rendered.
    waiting: BTreeMap<u32, FilmPart>,
}

impl<'a> Job<'a> {
    /// Plans a render.
    pub fn new(scene: &'a CompiledScene, camera: &'a Camera, settings: &'a Settings) -> Self {
        let full = Crop::full(settings.size);
        let crop = settings.crop.map_or(full, |c| Crop {
            min: [c.min[0].min(full.max[0]), c.min[1].min(full.max[1])],
            max: [c.max[0].min(full.max[0]), c.max[1].min(full.max[1])],
        });
        Self {
            scene,
            camera,
            settings,
            sampler: Sampler::new(settings.sampler, settings.seed, settings.spp),
            filter: FilterSampler::new(settings.filter),
            lights: scene.light_sampler(settings.light_sampler, settings.light_strategy),
            crop,
        }
    }

    /// Renders with `threads` threads (at least one) until all samples are taken or `keep_going` says no. `keep_going` is called
    /// often, from any thread, with the progress so far.
    pub fn run(&self, threads: usize, keep_going: &(dyn Fn(&Progress) -> bool + Sync)) -> (Film, Statistics) {
        self.extend(self.empty_film(), self.settings.spp, threads, keep_going)
    }

    /// A film of this render without samples.
    pub fn empty_film(&self) -> Film {
        Film::with_mean_weight(self.crop, &self.settings.aovs, self.filter.mean_weight())
    }

    /// Goes on with a film of this render until every pixel has `until` samples (or all that are asked for), or `keep_going` says
    /// no. In how many steps a film is made never shows in it.
    pub fn extend(
        &self,
        film: Film,
        until: u32,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> (Film, Statistics) {
        let (film, statistics, _) = self.extend_and_record(film, until, threads, keep_going, false);
        (film, statistics)
    }

    /// The rays that [`Self::run`] traces, batch by batch: 32 bytes a ray. Which batch comes first is not the same each time.
    pub fn record(&self, threads: usize) -> Recording {
        self.extend_and_record(self.empty_film(), self.settings.spp, threads, &|_| true, true).2
    }

    fn extend_and_record(
        &self,
        mut film: Film,
        until: u32,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
        record: bool,
    ) -> (Film, Statistics, Recording) {
        let order = tile_order(film.tiles.len(), self.settings.tile_order);
        let until = until.min(self.settings.spp);
        let mut ranges = sample_ranges(self.settings.spp, self.settings.progressive);
        let start = film.least_samples();
        ranges.retain(|range| range[1] > start && range[0] < until);
        let missing = |tile: &FilmTile| pixels(&tile.area) * u64::from(until.saturating_sub(tile.samples));
        let total: u64 = film.tiles.iter().map(missing).sum();
        let tiles: Vec<Mutex<SharedTile>> = std::mem::take(&mut film.tiles)
            .into_iter()
            .map(|tile| Mutex::new(SharedTile { tile, waiting: BTreeMap::new() }))
            .collect();
        let (next, done, rays, stopped) =
            (AtomicUsize::new(0), AtomicU64::new(0), AtomicU64::new(0), AtomicBool::new(false));
        let statistics = Mutex::new(Statistics::default());
        let recording = Mutex::new(Recording::default());
        let work = || {
            let context = Context { scene: self.scene, settings: self.settings, lights: &self.lights };
            let tracer = Tracer::new(self.scene, record.then(Recording::default));
            let mut renderer = PartRenderer::new(context, self.camera, &self.sampler, &self.filter, tracer);
            let mut mine = Statistics::default();
            loop {
                // Asked before a part is taken: every part that is taken is rendered, and so the passes counted here are whole,
                // however late some thread is.
                let taken = next.load(Ordering::Relaxed);
                let progress = Progress {
                    done: done.load(Ordering::Relaxed),
                    total,
                    rays: rays.load(Ordering::Relaxed),
                    passes: taken / tiles.len().max(1),
                };
                if stopped.load(Ordering::Relaxed) || !keep_going(&progress) {
                    stopped.store(true, Ordering::Relaxed);
                    break;
                }
                let index = next.fetch_add(1, Ordering::Relaxed);
                if index >= tiles.len() * ranges.len() {
                    break;
                }
                let range = ranges[index / tiles.len()];
                let shared = &tiles[order[index % tiles.len()]];
                let (area, range) = {
                    let tile = &lock(shared).tile;
                    // What the film brings along is not rendered again. (Samples that other threads are adding now belong to
                    // earlier ranges.)
                    (tile.area, [range[0].max(tile.samples.min(range[1])), range[1].min(until)])
                };
                if range[0] >= range[1] {
                    continue;
                }
                let before = mine.rays.total();
                let part = renderer.render(area, range, &mut mine);
                done.fetch_add(pixels(&area) * u64::from(range[1] - range[0]), Ordering::Relaxed);
                rays.fetch_add(mine.rays.total() - before, Ordering::Relaxed);
                lock(shared).accept(part);
            }
            let mut all = lock(&statistics);
            all.rays += mine.rays;
            all.invalid_samples += mine.invalid_samples;
            all.tracing += renderer.tracer.spent;
            lock(&recording).append(renderer.tracer.recording.unwrap_or_default());
        };
        if threads <= 1 {
            work();
        } else {
            std::thread::scope(|scope| {
                for _ in 0..threads {
                    scope.spawn(work);
                }
            });
        }
        film.tiles = tiles.into_iter().map(|t| into_inner(t).tile).collect();
        let mut statistics = into_inner(statistics);
        statistics.is_complete = film.tiles.iter().all(|t| t.samples >= until);
        (film, statistics, into_inner(recording))
    }
}

impl SharedTile {
    fn accept(&mut self, part: FilmPart) {
        self.waiting.insert(part.samples[0], part);
        while let Some(part) = self.waiting.remove(&self.tile.samples) {
            self.tile.fold(&part);
        }
    }
}

fn pixels(area: &Crop) -> u64 {
    area.size().iter().map(|&x| u64::from(x)).product()
}

/// A panic of another thread does not make the film unusable: parts are folded whole.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn into_inner<T>(mutex: Mutex<T>) -> T {
    mutex.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Ranges of sample numbers, in order. Progressive ones begin with small ranges, so that a first picture is there soon.
fn sample_ranges(spp: u32, progressive: bool) -> Vec<[u32; 2]> {
    let mut ends: Vec<u32> = if progressive { vec![1, 4] } else { Vec::new() };
    ends.extend((1..=spp / BLOCK).map(|b| b * BLOCK));
    ends.push(spp);
    ends.retain(|&e| e <= spp);
    let mut start = 0;
    let mut ranges = Vec::new();
    for end in ends {
        if end > start {
            ranges.push([start, end]);
            start = end;
        }
    }
    ranges
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
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default()).expect("a valid scene");
        let settings = Settings { size: [20, 20], spp: 16, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let (_, statistics) = job.run(2, &|_| true);
        let recording = job.record(2);
        let count = |wanted: Grouping| {
            let batches = recording.closest.iter().filter(|(grouping, _)| *grouping == wanted);
            batches.map(|(_, rays)| rays.len() as u64).sum::<u64>()
        };
        let shadow = recording.occluded.iter().map(|rays| rays.len() as u64).sum();
        let recorded = RayCounts { camera: count(Grouping::Coherent), shadow, indirect: count(Grouping::None) };
        assert_eq!(recorded, statistics.rays);
        assert!(statistics.tracing > Duration::ZERO);
    }

    #[test]
    fn a_film_that_is_extended_step_by_step_is_the_film_of_one_run() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default()).expect("a valid scene");
        let settings = Settings { size: [20, 20], spp: 20, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let whole = job.run(2, &|_| true).0.image();
        for steps in [&[1, 4, 16, 20][..], &[7, 7, 30], &[19, 20]] {
            let mut film = job.empty_film();
            for &until in steps {
                // Stopped in the middle, too: tiles then differ in their samples.
                let limit = AtomicUsize::new(0);
                film = job.extend(film, until, 2, &|_| limit.fetch_add(1, Ordering::Relaxed) < 3).0;
                let statistics;
                (film, statistics) = job.extend(film, until, 2, &|_| true);
                assert!(statistics.is_complete && film.least_samples() == until.min(20), "{steps:?}");
            }
            assert_eq!(film.image(), whole, "{steps:?}");
        }
    }

    #[test]
    fn ranges_cover_all_samples_once() {
        for spp in [1, 3, 4, 15, 16, 17, 40, 64] {
            for progressive in [false, true] {
                let ranges = sample_ranges(spp, progressive);
                assert_eq!((ranges[0][0], ranges[ranges.len() - 1][1]), (0, spp));
                assert!(ranges.windows(2).all(|r| r[0][1] == r[1][0]), "{ranges:?}");
                assert!(ranges.iter().all(|r| r[0] / BLOCK == (r[1] - 1) / BLOCK), "{ranges:?}");
            }
        }
    }
}
