//! How a worker renders tasks of a picture.

use super::patience::PAUSES;
use super::{End, Numbered, Worker};
use crate::command::plan::folder::Round;
use crate::command::plan::leases::Other;
use crate::command::plan::results::{self, Gaps, Stored};
use crate::command::render::{self, frames::Frame, stage::Stage};
use crate::failure::Failure;
use crate::interrupt;
use crate::progress::duration;
use snell_formats::atomic;
use snell_render::{Job, Progress, Settings, Task, TaskResult, Underway, with_patience};
use std::fs::File;
use std::io::BufReader;
use std::time::Instant;

/// A picture that a worker works on.
struct Picture<'a> {
    frame: u32,
    job: &'a Job<'a>,
    settings: &'a Settings,
    underway: Underway,
}

impl Worker<'_> {
    pub(super) fn work_on(
        &mut self,
        stage: &mut Stage,
        number: u32,
        frame: &Frame,
    ) -> Result<End, Failure> {
        if interrupt::is_requested() {
            return Ok(End::Interrupted);
        }
        if self.folder.is_finished(number) {
            return Ok(End::Finished);
        }
        let options = self.render_options;
        let camera = stage.camera(options)?;
        let settings = options.settings(&stage.scene, &camera, self.simd)?;
        let shot = render::frames::shot(stage, frame, options, &settings.build)?;
        let settings = Settings {
            later_cameras: shot.later_cameras,
            ..options.settings(&stage.scene, &shot.camera, self.simd)?
        };
        let end = with_patience(interrupt::is_requested, |cancel| {
            let job = Job::new(&shot.compiled, &shot.camera, &settings).with_cancel(cancel);
            let Some(underway) = self.begin(&job, number)? else { return Ok(End::Interrupted) };
            let picture = Picture { frame: number, job: &job, settings: &settings, underway };
            self.finish(picture)
        });
        stage.keep(shot.compiled);
        end
    }

    /// Begins a picture. One worker trains its guiding field, and the others wait for it. Returns
    /// `None` if it was interrupted.
    fn begin(&mut self, job: &Job, frame: u32) -> Result<Option<Underway>, Failure> {
        let threads = self.options.threads();
        let goes_on = |_: &Progress| !interrupt::is_requested();
        if job.settings().guiding.is_none() {
            return Ok(Some(job.begin(threads, &goes_on)));
        }
        let folder = self.folder;
        let (path, place) = (folder.field(frame), folder.field_lease(frame));
        let facts = folder.plan.facts(frame);
        let parent = folder.frame(frame);
        self.insist(&parent, &mut || folder.make(&parent))?;
        let mut pause = PAUSES[0];
        loop {
            if interrupt::is_requested() {
                return Ok(None);
            }
            if let Ok(file) = File::open(&path) {
                match job.begin_trained(&mut BufReader::new(file), &facts) {
                    Ok(underway) => return Ok(Some(underway)),
                    Err(error) => {
                        let shown = path.display();
                        eprintln!("warning: {shown}: {error}; the field is trained again");
                        let _ = std::fs::remove_file(&path);
                    }
                }
            }
            let lease = match self.insist(&place, &mut || self.leases.take(&place))? {
                Some(lease) => Some(lease),
                None if self.leases.look(&place) == Other::Dead => {
                    Some(self.insist_mut(&place, &mut |leases| leases.take_over(&place))?)
                }
                None => None,
            };
            if lease.is_some() && !path.is_file() {
                let underway = job.begin(threads, &goes_on);
                if interrupt::is_requested() {
                    return Ok(None);
                }
                self.insist(&path, &mut || {
                    atomic::write_with(&path, |out| underway.save_field(&facts, out))
                        .map_err(std::io::Error::other)
                })?;
                return Ok(Some(underway));
            }
            self.pause(&mut pause);
        }
    }

    /// Renders tasks of a picture until none is free.
    fn finish(&mut self, mut picture: Picture) -> Result<End, Failure> {
        let mut pause = PAUSES[0];
        loop {
            if picture.settings.noise.is_some() {
                let (underway, settings) = (&mut picture.underway, picture.settings);
                results::catch_up(underway, settings, self.folder, picture.frame)?;
            }
            let all = picture.underway.tasks(picture.settings, self.folder.plan.split);
            let round = self.folder.round(picture.frame, picture.underway.samples());
            let tasks: Vec<Numbered> =
                (0..).zip(all).filter(|(number, _)| self.is_ours(picture.frame, *number)).collect();
            if tasks.is_empty() {
                return self.end(picture.frame);
            }
            self.insist(&round.path, &mut || self.folder.make(&round.path))?;
            match self.work_on_round(&mut picture, &round, &tasks)? {
                End::Finished => {}
                end => return Ok(end),
            }
            if picture.settings.noise.is_none() {
                return self.end(picture.frame);
            }
            if self.end_round(&mut picture, &round)? {
                pause = PAUSES[0];
            } else if self.is_last {
                self.pause(&mut pause);
            } else {
                return Ok(End::Busy);
            }
        }
    }

    /// Renders tasks of a round until all have results, or until none is free.
    fn work_on_round(
        &mut self,
        picture: &mut Picture,
        round: &Round,
        tasks: &[Numbered],
    ) -> Result<End, Failure> {
        let mut pause = PAUSES[0];
        loop {
            let mut open = self.open_tasks(round, tasks);
            if open.free.is_empty() && open.leased.is_empty() {
                return Ok(End::Finished);
            }
            let mut has_worked = false;
            while let Some((number, task, lease)) = self.claim(round, &mut open)? {
                if interrupt::is_requested() || !self.render(picture, round, number, task)? {
                    return Ok(End::Interrupted);
                }
                drop(lease);
                has_worked = true;
            }
            if interrupt::is_requested() {
                return Ok(End::Interrupted);
            }
            if open.is_stale {
                continue;
            }
            match (has_worked, self.is_last) {
                (true, _) => pause = PAUSES[0],
                (false, true) => self.pause(&mut pause),
                (false, false) => return Ok(End::Busy),
            }
            // Another worker may have ended the round.
            if round.end().is_file() {
                return Ok(End::Finished);
            }
        }
    }

    /// Renders a task and stores its result. Returns false if it was interrupted.
    fn render(
        &mut self,
        picture: &mut Picture,
        round: &Round,
        number: u32,
        task: Task,
    ) -> Result<bool, Failure> {
        let start = Instant::now();
        let goes_on = |_: &Progress| !interrupt::is_requested();
        let threads = self.options.threads();
        let result = picture.job.perform(&mut picture.underway, task, threads, &goes_on);
        let Some(result) = result else { return Ok(false) };
        let taken = start.elapsed();
        self.store(picture.frame, round, &result)?;
        (self.done, self.spent) = (self.done + 1, self.spent + taken);
        let plan = &self.folder.plan;
        let of_picture = plan.name_of(picture.frame).map_or(String::new(), |n| format!(" ({n})"));
        let all = u64::from(plan.tasks) * u64::from(plan.frames);
        let among = match plan.has_rounds {
            true => format!("of the round from sample {}", task.samples[0]),
            false => format!("of 0 to {}", all.saturating_sub(1)),
        };
        self.say(format!(
            "task {} {among}{of_picture}: {}",
            plan.number_of(picture.frame, number),
            duration(taken.as_secs_f64())
        ));
        if self.options.openjd {
            let all = self.numbers().map_or(all, |[first, last]| last - first + 1);
            let share = 100.0 * f64::from(self.done) / all.max(1) as f64;
            println!("openjd_progress: {:.1}", share.min(100.0));
        }
        Ok(true)
    }

    fn store(&mut self, frame: u32, round: &Round, result: &TaskResult) -> Result<(), Failure> {
        let path = round.result(&result.task);
        let stored = self
            .insist(&path, &mut || results::store(round, self.folder, frame, &self.name, result))?;
        if let Stored::Differs(other) = stored {
            eprintln!(
                "warning: {}: the results of worker {other} and of this one ({}) differ, so one of \
                 the machines is broken; snell merge says more",
                path.display(),
                self.name
            );
        }
        Ok(())
    }

    /// Puts the results of a round together, which decides what pixels need more samples. Returns
    /// false if another worker does that.
    fn end_round(&mut self, picture: &mut Picture, round: &Round) -> Result<bool, Failure> {
        let path = round.end_lease();
        let lease = match self.insist(&path, &mut || self.leases.take(&path))? {
            Some(lease) => lease,
            None if self.leases.look(&path) == Other::Dead => {
                self.insist_mut(&path, &mut |leases| leases.take_over(&path))?
            }
            None => return Ok(false),
        };
        if round.end().is_file() {
            return Ok(true);
        }
        let (settings, frame) = (picture.settings, picture.frame);
        let gaps = results::add_round(&mut picture.underway, settings, &[self.folder], frame);
        if !gaps.is_empty() {
            return Err(vanished(round, gaps));
        }
        picture.job.end_round(&mut picture.underway);
        let facts = self.folder.plan.facts(frame);
        self.insist(&round.end(), &mut || {
            atomic::write_with(&round.end(), |out| picture.underway.save(settings, &facts, "", out))
                .map_err(std::io::Error::other)
        })?;
        drop(lease);
        Ok(true)
    }

    /// Notes that a picture is finished, if it is so for all workers.
    pub(super) fn end(&self, frame: u32) -> Result<End, Failure> {
        if self.options.tasks.is_none() {
            let path = self.folder.frame(frame);
            self.insist(&path, &mut || {
                self.folder.make(&path)?;
                self.folder.set_finished(frame)
            })?;
        }
        Ok(End::Finished)
    }
}

/// The error of a round of which not all results can be used after all.
fn vanished(round: &Round, gaps: Gaps) -> Failure {
    let problem = gaps.set_aside().into_iter().next();
    Failure::Other(
        problem.unwrap_or_else(|| {
            format!("{}: results have vanished; start again", round.path.display())
        }),
    )
}
