//! A task with the pixels that take its samples, as bytes: all that a worker needs of the round.

use super::chunk::{self, Mark, SavedError, damaged};
use crate::job::{Job, Progress, Task, TaskResult, Underway};
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// The mark of the input of a task.
const MARK: Mark = Mark { what: "task", bytes: *b"snellI01" };

/// What a task is computed from, besides the scene and the settings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TaskInput {
    /// The task.
    pub task: Task,
    /// The active pixels of each of its tiles; `None` if all are active.
    active: Vec<Option<Vec<u32>>>,
}

impl TaskInput {
    /// Writes the input: a mark and a [chunk].
    ///
    /// # Errors
    /// If `out` fails.
    pub fn save(&self, out: &mut dyn Write) -> std::io::Result<()> {
        out.write_all(&MARK.bytes)?;
        chunk::write(self, out)
    }

    /// Reads what [`Self::save`] has written.
    ///
    /// # Errors
    /// If the input is no task, or if it is damaged.
    pub fn load(input: &mut dyn Read) -> Result<Self, SavedError> {
        MARK.read(input)?;
        let read: Self = chunk::read(input)?;
        if input.read(&mut [0])? > 0 {
            return damaged("something follows its end");
        }
        Ok(read)
    }
}

impl Underway {
    /// The input of a task of the current round; `None` if the film has no such tiles.
    pub fn input(&self, task: Task) -> Option<TaskInput> {
        let [first, end] = task.tiles.map(|tile| tile as usize);
        let active = self.active.get(first..end)?.to_vec();
        Some(TaskInput { task, active })
    }
}

impl Job<'_> {
    /// Renders a task whose round is known only by its input: [`Self::perform`] for workers that do
    /// not have the film.
    ///
    /// Returns `None` if `keep_going` has ended it early, or if the input is not of this render.
    pub fn perform_input(
        &self,
        underway: &mut Underway,
        TaskInput { task, active }: TaskInput,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Option<TaskResult> {
        let [first, end] = task.tiles.map(|tile| tile as usize);
        let tiles = underway.film.tiles.get(first..end)?;
        let fits = |(tile, active): (&crate::film::FilmTile, &Option<Vec<u32>>)| {
            active.as_ref().is_none_or(|pixels| {
                let is_inside = |&pixel: &u32| (pixel as usize) < tile.pixels();
                pixels.is_sorted_by(|a, b| a < b) && pixels.last().is_none_or(is_inside)
            })
        };
        if tiles.len() != active.len() || !tiles.iter().zip(&active).all(fits) {
            return None;
        }
        underway.active[first..end].clone_from_slice(&active);
        self.perform(underway, task, threads, keep_going)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::CompiledScene;
    use crate::job::Split;
    use crate::settings::Settings;

    #[test]
    fn a_worker_without_the_film_gives_the_same_results_in_every_round() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        let plain = Settings { size: [40, 36], spp: 100, max_depth: 3, ..Settings::default() };
        let settings = Settings { noise: Some(0.15), ..plain };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let whole = job.run(2, &|_| true).0.image();
        let mut underway = job.begin(1, &|_| true);
        let mut worker = job.begin(1, &|_| true);
        loop {
            let tasks = underway.tasks(&settings, Split { tiles: 2, samples: None });
            if tasks.is_empty() {
                break;
            }
            for task in tasks {
                let mut bytes = Vec::new();
                let input = underway.input(task).expect("the film has the tiles");
                input.save(&mut bytes).expect("memory takes everything");
                let read = TaskInput::load(&mut bytes.as_slice()).expect("it is whole");
                assert_eq!(read, input);
                assert!(TaskInput::load(&mut &bytes[..bytes.len() - 1]).is_err());
                let result = job.perform_input(&mut worker, read, 1, &|_| true);
                assert!(underway.add(result.expect("nothing ends it")));
            }
            job.end_round(&mut underway);
        }
        assert_eq!(underway.film.image(), whole);
    }

    #[test]
    fn inputs_of_other_renders_are_refused() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        let settings = Settings { size: [20, 20], spp: 16, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let mut underway = job.begin(1, &|_| true);
        let task = |tiles| Task { tiles, samples: [0, 16] };
        assert!(underway.input(task([3, 5])).is_none() && underway.input(task([2, 1])).is_none());
        // The last tile has 4 by 4 pixels.
        for (tiles, active) in [
            ([3, 5], vec![None, None]),
            ([0, 2], vec![None]),
            ([3, 4], vec![Some(vec![16])]),
            ([3, 4], vec![Some(vec![2, 1])]),
        ] {
            let input = TaskInput { task: task(tiles), active };
            assert!(job.perform_input(&mut underway, input, 1, &|_| true).is_none());
        }
        let input = TaskInput { task: task([3, 4]), active: vec![Some(vec![15])] };
        assert!(job.perform_input(&mut underway, input, 1, &|_| true).is_some());
    }
}
