//! Renders in several steps, in which pixels may stop by their error.

use super::parts::Ranges;
use super::{Job, Progress, Recording, Statistics, Tally, into_inner, pixels};
use crate::film::{Film, FilmTile, noise};
use crate::guiding::Field;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// A render between two steps: its film and its guiding field.
pub struct Underway {
    /// The film with all samples so far.
    pub film: Film,
    /// Statistics of these samples, complete if the last step was not interrupted.
    pub statistics: Statistics,
    /// The guiding field, if paths are guided.
    pub(super) field: Option<Field>,
    /// The active pixels of each tile, which take more samples; `None` if all are active.
    pub(super) active: Vec<Option<Vec<u32>>>,
    /// The number of samples that the active pixels have.
    pub(super) samples: u32,
    /// The number of samples at which the active pixels are checked next.
    pub(super) look: u32,
}

impl Underway {
    pub(super) fn new(film: Film, field: Option<Field>, statistics: Statistics) -> Self {
        let (active, samples) = (vec![None; film.tiles.len()], film.least_samples());
        Self { film, statistics, field, active, samples, look: noise::next_look(0) }
    }

    /// The number of samples that the active pixels have.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// True if some pixels are active.
    pub(super) fn is_active(&self) -> bool {
        self.active.iter().any(|pixels| pixels.as_ref().is_none_or(|p| !p.is_empty()))
    }

    /// The number of active pixels of a tile.
    pub(super) fn count(&self, tile: usize) -> u64 {
        self.active[tile]
            .as_ref()
            .map_or_else(|| pixels(&self.film.tiles[tile].area), |p| p.len() as u64)
    }

    /// Lends the state to the threads of a step.
    fn tally(&mut self, record: bool) -> Tally {
        let done = AtomicU64::new(self.statistics.samples);
        let rays = AtomicU64::new(self.statistics.rays.total());
        let statistics = Mutex::new(self.statistics);
        Tally { field: self.field.take(), done, rays, statistics, record, ..Tally::default() }
    }

    fn take_back(&mut self, tally: Tally) -> Recording {
        (self.field, self.statistics) = (tally.field, into_inner(tally.statistics));
        into_inner(tally.recording)
    }
}

impl Job<'_> {
    /// Starts a render in steps. Trains the guiding field first if the settings request guiding.
    pub fn begin(
        &self,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Underway {
        self.begin_from(self.empty_film(), threads, keep_going)
    }

    pub(super) fn begin_from(
        &self,
        film: Film,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Underway {
        let (field, statistics) = self.trained(None, threads, keep_going);
        Underway::new(film, field, statistics)
    }

    /// Continues a render until every pixel has `until` samples or has stopped by its error, or
    /// until `keep_going` returns false. Returns true if the render is not finished. The picture
    /// does not depend on the number of steps.
    pub fn go_on(
        &self,
        underway: &mut Underway,
        until: u32,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> bool {
        match self.settings.noise {
            Some(_) => self.go_on_by_error(underway, until, threads, keep_going),
            None => _ = self.fill(underway, until, threads, keep_going, false),
        }
        underway.samples < self.settings.spp && underway.is_active()
    }

    /// Gives every pixel `until` samples, whatever its error.
    pub(super) fn fill(
        &self,
        underway: &mut Underway,
        until: u32,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
        record: bool,
    ) -> Recording {
        let until = until.min(self.settings.spp);
        let is_progressive = self.settings.progressive;
        let tally = underway.tally(record);
        let film = &mut underway.film;
        let missing =
            |tile: &FilmTile| pixels(&tile.area) * u64::from(until.saturating_sub(tile.samples()));
        let total = underway.statistics.samples + film.tiles.iter().map(missing).sum::<u64>();
        tally.total.store(total, Ordering::Relaxed);
        // Only samples that the film does not have yet are rendered.
        let parts = self.parts(film, |tile| Ranges::Blocks {
            start: film.tiles[tile].samples(),
            end: until,
            is_progressive,
        });
        let passes = usize::from(underway.samples > 0);
        self.render_parts(film, &underway.active, &parts, passes, threads, &tally, keep_going);
        let recording = underway.take_back(tally);
        underway.samples = underway.film.least_samples();
        underway.statistics.is_complete = underway.samples >= until;
        recording
    }

    /// Renders rounds of samples for the pixels whose error is still too large; see
    /// [`crate::film::noise`].
    fn go_on_by_error(
        &self,
        underway: &mut Underway,
        until: u32,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) {
        let until = until.min(self.settings.spp);
        let tally = underway.tally(false);
        while underway.samples < until && underway.is_active() {
            let [start, end] = [underway.samples, underway.look.min(until)];
            let still: u64 = (0..underway.film.tiles.len()).map(|tile| underway.count(tile)).sum();
            let done = tally.done.load(Ordering::Relaxed);
            tally.total.store(done + still * u64::from(end - start), Ordering::Relaxed);
            let parts = self.parts(&underway.film, |tile| {
                // After an interrupted round, some tiles have more samples than others.
                Ranges::of_round(
                    [underway.film.tiles[tile].samples().max(start), end],
                    underway.count(tile),
                    self.caustics().is_some(),
                )
            });
            let (film, active) = (&mut underway.film, &underway.active);
            self.render_parts(
                film,
                active,
                &parts,
                usize::from(start > 0),
                threads,
                &tally,
                keep_going,
            );
            let is_stopped = tally.stopped.load(Ordering::Relaxed);
            // Pixels are not judged by what an interrupted round has given some of them.
            if is_stopped {
                break;
            }
            self.judge(underway, end);
        }
        let is_complete = !tally.stopped.load(Ordering::Relaxed);
        underway.take_back(tally);
        underway.count_converged();
        underway.statistics.is_complete = is_complete;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::CompiledScene;
    use crate::guiding::Guiding;
    use crate::settings::Settings;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn steps_and_interruptions_do_not_show_in_a_picture_whose_pixels_stop_or_learn() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        let guiding = Some(Guiding::with_passes(2));
        let plain = Settings { size: [20, 20], spp: 300, max_depth: 3, ..Settings::default() };
        let by_error = Settings { noise: Some(0.1), ..plain.clone() };
        let guided = Settings { spp: 40, guiding, ..plain };
        for settings in [&by_error, &guided, &Settings { guiding, ..by_error.clone() }] {
            let job = Job::new(&compiled, &scene.cameras[0], settings);
            let (whole, statistics) = job.run(2, &|_| true);
            let mut underway = job.begin(2, &|_| true);
            let steps =
                (0..).take_while(|step| job.go_on(&mut underway, 1 << step, 2, &|_| true)).count();
            assert!(steps > 3 && underway.statistics.is_complete);
            assert_eq!(underway.film.image(), whole.image());
            assert_eq!(underway.statistics.samples, statistics.samples);
            assert_eq!(underway.statistics.converged_pixels, statistics.converged_pixels);
        }
        let job = Job::new(&compiled, &scene.cameras[0], &by_error);
        let mut underway = job.begin(2, &|_| true);
        let asked = AtomicUsize::new(0);
        assert!(job.go_on(&mut underway, 64, 2, &|_| asked.fetch_add(1, Ordering::Relaxed) < 3));
        assert!(!underway.statistics.is_complete);
        job.go_on(&mut underway, 300, 2, &|_| true);
        assert_eq!(underway.film.image(), job.run(2, &|_| true).0.image());
    }
}
