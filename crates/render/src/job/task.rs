//! Renders that many machines share: tasks, and what each of them gives.
//!
//! A render is a list of *rounds*: one if all pixels get the same number of samples, otherwise one
//! for each check of the pixels' errors. The tasks of a round are independent of each other. When
//! the results of all of them are in the film, the round is ended, and the next one can begin. The
//! results of a round may come in any order and more than once; the film has the same bits as that
//! of one process.

use super::parts::{Parts, Ranges};
use super::{
    Job, Progress, RayCounts, Statistics, Tally, Underway, empty_film, into_inner, pixels,
    tile_order,
};
use crate::film::tile::TileState;
use crate::film::{BLOCK, noise};
use crate::settings::Settings;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, Ordering};

/// A part of a render that is computed at a time: some samples of some tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Task {
    /// The first tile, and one past the last. Tiles of 16 x 16 pixels are counted row by row.
    pub tiles: [u32; 2],
    /// The first sample number, and one past the last.
    pub samples: [u32; 2],
}

/// How the rounds of a render are split into tasks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Split {
    /// Tiles of a task, at least 1.
    pub tiles: u32,
    /// Samples of a task: a multiple of 16, or `None` for all samples of the round. Pixels that
    /// stop by their error always get all samples of a round in one task.
    pub samples: Option<u32>,
}

/// What a task has given.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TaskResult {
    /// The task.
    pub task: Task,
    /// Statistics of its samples.
    pub statistics: Statistics,
    pub(super) tiles: Vec<TileState>,
}

impl Split {
    /// The least number of samples of a task, and the number of which it is a multiple.
    pub const SAMPLES: u32 = BLOCK;

    /// The tasks of a round with these samples, over a film with this number of tiles.
    pub fn tasks(self, tiles: u32, samples: [u32; 2]) -> impl Iterator<Item = Task> {
        let [start, end] = samples;
        let all = end.saturating_sub(start);
        let step = self.samples.unwrap_or(all).max(1).next_multiple_of(BLOCK);
        let width = self.tiles.max(1);
        let strips = (0..tiles).step_by(width as usize);
        strips.flat_map(move |first| {
            (start..end).step_by(step as usize).map(move |from| Task {
                tiles: [first, first.saturating_add(width).min(tiles)],
                samples: [from, from.saturating_add(step).min(end)],
            })
        })
    }
}

impl TaskResult {
    /// True if both results have the same bits, whatever time they took.
    pub fn is_same(&self, other: &Self) -> bool {
        let bytes = |result: &Self| postcard::to_stdvec(&(result.task, &result.tiles)).ok();
        bytes(self) == bytes(other)
    }
}

impl Underway {
    /// A render with these settings that has no samples, and no guiding field: results can be added
    /// to it, but tasks cannot be rendered with it.
    pub fn empty(settings: &Settings) -> Self {
        Self::new(empty_film(settings), None, Statistics::default())
    }

    /// The tasks of the current round; none if the render is finished. Tasks whose pixels have all
    /// stopped are left out.
    pub fn tasks(&self, settings: &Settings, split: Split) -> Vec<Task> {
        let Some(samples) = self.round(settings) else { return Vec::new() };
        let step = split.samples.filter(|_| settings.noise.is_none());
        let split = Split { samples: step, ..split };
        let mut tasks: Vec<Task> = split.tasks(self.film.tiles.len() as u32, samples).collect();
        tasks.retain(|task| {
            let [first, end] = task.tiles.map(|tile| tile as usize);
            (first..end).any(|tile| self.count(tile) > 0)
        });
        tasks
    }

    /// The samples of the current round; `None` if the render is finished.
    fn round(&self, settings: &Settings) -> Option<[u32; 2]> {
        let end = match settings.noise {
            Some(_) => self.look.min(settings.spp),
            None => settings.spp,
        };
        (self.samples < end && self.is_active()).then_some([self.samples, end])
    }

    /// Adds all samples of another state of the same render.
    pub fn merge(&mut self, other: Self) {
        if other.samples > self.samples {
            (self.active, self.look) = (other.active, other.look);
        }
        for (tile, other) in self.film.tiles.iter_mut().zip(other.film.tiles) {
            tile.merge(other);
        }
        self.samples = self.samples.max(other.samples);
        // What both have is counted once, and what only one has is not known; the larger is told.
        if other.statistics.samples > self.statistics.samples {
            self.statistics = other.statistics;
        }
    }

    /// Adds a result of the current round. Results may be added in any order; one that was added
    /// before changes nothing but the statistics.
    ///
    /// Returns false, and adds nothing, if the result cannot be one of this render.
    #[must_use]
    pub fn add(&mut self, result: TaskResult) -> bool {
        let [first, end] = result.task.tiles.map(|tile| tile as usize);
        let Some(tiles) = self.film.tiles.get(first..end) else { return false };
        let samples = result.task.samples;
        let fits = result.tiles.len() == tiles.len()
            && result.tiles.iter().all(|tile| tile.is_within(samples));
        let pairs = tiles.iter().zip(result.tiles);
        let new: Option<Vec<_>> = pairs.map(|(tile, state)| tile.with_state(state)).collect();
        let (true, Some(new)) = (fits, new) else { return false };
        for (tile, new) in self.film.tiles[first..end].iter_mut().zip(new) {
            tile.merge(new);
        }
        self.statistics.add(&result.statistics);
        true
    }
}

impl Statistics {
    /// Adds what other samples have taken. All have the same training, whose rays count once.
    fn add(&mut self, other: &Self) {
        if self.training_rays == RayCounts::default() {
            self.rays += other.training_rays;
            self.training_rays = other.training_rays;
        }
        (self.training, self.training_passes) = (other.training, other.training_passes);
        (self.guiding_regions, self.guiding_bytes) = (other.guiding_regions, other.guiding_bytes);
        self.rays += other.rays;
        self.samples = self.samples.saturating_add(other.samples);
        self.invalid_samples = self.invalid_samples.saturating_add(other.invalid_samples);
        self.cut_paths = self.cut_paths.saturating_add(other.cut_paths);
        self.tracing = self.tracing.saturating_add(other.tracing);
    }
}

impl Job<'_> {
    /// Renders a task of the current round. The state is not changed, so that tasks can be rendered
    /// in any order.
    ///
    /// Returns `None` if `keep_going` has ended it early, if the film has no such tiles, or if the
    /// samples do not begin with a block of 16.
    pub fn perform(
        &self,
        underway: &mut Underway,
        task: Task,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Option<TaskResult> {
        let [first, end] = task.tiles.map(|tile| tile as usize);
        // A task costs only its own tiles, however large the picture is.
        let mut film = underway.film.part(first..end)?;
        let counts: Vec<u64> = (first..end).map(|tile| underway.count(tile)).collect();
        let active = &underway.active[first..end];
        let [start, until] = task.samples;
        if !start.is_multiple_of(BLOCK) || start >= until {
            return None;
        }
        let order = tile_order(film.tiles.len(), self.settings.tile_order);
        let parts = Parts::new(order, |tile| match self.settings.noise {
            Some(_) => Ranges::of_round(task.samples, counts[tile], self.caustics().is_some()),
            None => Ranges::Blocks { start, end: until, is_progressive: false },
        });
        let total = counts.iter().sum::<u64>() * u64::from(until.saturating_sub(start));
        let tally = Tally {
            field: underway.field.take(),
            total: AtomicU64::new(total),
            ..Tally::default()
        };
        self.render_parts(&mut film, active, &parts, 0, threads, &tally, keep_going);
        underway.field = tally.field;
        if tally.stopped.load(Ordering::Relaxed) {
            return None;
        }
        let tiles = film.tiles.iter().map(|tile| tile.state()).collect();
        let trained = underway.statistics;
        let statistics = Statistics {
            training: trained.training,
            training_passes: trained.training_passes,
            training_rays: trained.training_rays,
            guiding_regions: trained.guiding_regions,
            guiding_bytes: trained.guiding_bytes,
            ..into_inner(tally.statistics)
        };
        Some(TaskResult { task, statistics, tiles })
    }

    /// Ends a round whose results are all added: decides which pixels take more samples.
    pub fn end_round(&self, underway: &mut Underway) {
        let Some([_, end]) = underway.round(self.settings) else { return };
        self.judge(underway, end);
        let is_left = underway.round(self.settings).is_some();
        underway.statistics.is_complete = !is_left;
    }

    /// Takes the samples up to `end` for complete, and finds the pixels that need more.
    pub(super) fn judge(&self, underway: &mut Underway, end: u32) {
        underway.samples = end;
        let Some(noise) = self.settings.noise else { return };
        if end == underway.look.min(self.settings.spp) {
            let floor = self.settings.noise_floor;
            underway.active =
                noise::unconverged(&mut underway.film, &underway.active, noise, floor);
        }
        if end == underway.look {
            underway.look = noise::next_look(end);
        }
        underway.count_converged();
    }
}

impl Underway {
    /// Counts the pixels that have stopped by their error.
    pub(super) fn count_converged(&mut self) {
        let all: u64 = self.film.tiles.iter().map(|t| pixels(&t.area)).sum();
        let left: usize = self.active.iter().flatten().map(Vec::len).sum();
        let is_known = self.active.iter().all(Option::is_some);
        self.statistics.converged_pixels = if is_known { all - left as u64 } else { 0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::CompiledScene;
    use crate::film::filter::Filter;
    use crate::guiding::Guiding;
    use crate::integrator::aov::Aov;
    use crate::{Origin, SavedError};
    use snell_math::rng;

    fn through_a_file(result: &TaskResult) -> TaskResult {
        let origin = Origin { plan: "a".into(), frame: 3, worker: "b".into() };
        let mut bytes = Vec::new();
        result.save(&origin, &mut bytes).expect("memory takes everything");
        let (read, loaded) = TaskResult::load(&mut bytes.as_slice()).expect("it is whole");
        assert!(read == origin && loaded.is_same(result));
        let other = TaskResult { tiles: Vec::new(), ..loaded.clone() };
        assert!(!other.is_same(result));
        let cut = TaskResult::load(&mut &bytes[..bytes.len() - 1]);
        assert!(matches!(cut, Err(SavedError::Damaged(_))));
        loaded
    }

    #[test]
    fn tasks_in_any_order_and_twice_give_the_picture_of_one_process() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        let plain = Settings { size: [40, 36], spp: 70, max_depth: 3, ..Settings::default() };
        let aovs = vec![Aov::Depth, Aov::CryptoObject, Aov::Samples];
        let guiding = Some(Guiding::with_passes(2));
        for (settings, tiles, samples) in [
            (plain.clone(), 1, None),
            (plain.clone(), 2, Some(16)),
            (Settings { aovs, filter: Filter::Mitchell, ..plain.clone() }, 5, Some(48)),
            (Settings { noise: Some(0.1), spp: 300, ..plain.clone() }, 2, Some(16)),
            (Settings { guiding, noise: Some(0.2), spp: 200, ..plain }, 4, None),
        ] {
            let job = Job::new(&compiled, &scene.cameras[0], &settings);
            let (whole, statistics) = job.run(2, &|_| true);
            let split = Split { tiles, samples };
            let mut underway = job.begin(1, &|_| true);
            let mut rounds = 0;
            loop {
                let mut tasks = underway.tasks(&settings, split);
                if tasks.is_empty() {
                    break;
                }
                rounds += 1;
                tasks.sort_by_key(|t| rng::hash_combine(t.tiles[0], t.samples[0]));
                for (number, &task) in tasks.iter().enumerate() {
                    let result = job.perform(&mut underway, task, 1, &|_| true);
                    let result = through_a_file(&result.expect("nothing ends it"));
                    if number % 7 == 0 {
                        let kept = underway.statistics;
                        assert!(underway.add(result.clone()));
                        underway.statistics = kept;
                    }
                    assert!(underway.add(result));
                }
                job.end_round(&mut underway);
            }
            assert_eq!(rounds > 1, settings.noise.is_some());
            assert!(underway.statistics.is_complete);
            assert_eq!(underway.film.image(), whole.image(), "{settings:?}");
            assert_eq!(underway.film.variance(), whole.variance(), "{settings:?}");
            let taken = underway.statistics;
            assert_eq!(taken.samples, statistics.samples);
            assert_eq!(taken.rays, statistics.rays);
            assert_eq!(taken.converged_pixels, statistics.converged_pixels);
        }
    }

    #[test]
    fn the_rays_of_training_count_once() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        let guiding = Some(Guiding::with_passes(1));
        let settings =
            Settings { size: [40, 36], spp: 16, max_depth: 2, guiding, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let mut worker = job.begin(1, &|_| true);
        // It merges what others have rendered, and has trained nothing.
        let mut merged = Underway::empty(&settings);
        for task in merged.tasks(&settings, Split { tiles: 3, samples: None }) {
            let result = job.perform(&mut worker, task, 1, &|_| true).expect("nothing ends it");
            assert!(merged.add(through_a_file(&result)));
        }
        let whole = job.run(1, &|_| true).1;
        assert!(whole.training_rays.total() > 0);
        assert_eq!(merged.statistics.rays, whole.rays);
    }

    #[test]
    fn a_task_that_is_ended_early_gives_nothing_and_foreign_results_are_refused() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        let settings = Settings { size: [40, 36], spp: 16, max_depth: 2, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let mut underway = job.begin(1, &|_| true);
        let task = underway.tasks(&settings, Split { tiles: 3, samples: None })[0];
        assert!(job.perform(&mut underway, task, 1, &|_| false).is_none());
        let beyond = Task { tiles: [0, 1000], ..task };
        assert!(job.perform(&mut underway, beyond, 1, &|_| true).is_none());
        let result = job.perform(&mut underway, task, 1, &|_| true).expect("nothing ends it");
        let elsewhere = Task { tiles: [1, 4], ..task };
        assert!(!underway.add(TaskResult { task: beyond, ..result.clone() }));
        assert!(!underway.add(TaskResult { task: elsewhere, ..result.clone() }));
        let later = Task { samples: [16, 32], ..task };
        assert!(!underway.add(TaskResult { task: later, ..result.clone() }));
        assert_eq!(underway.film.most_samples(), 0);
        assert!(underway.add(result));
    }
}
