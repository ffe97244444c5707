//! `snell work`: renders tasks of a plan until none is left.

mod claims;

use super::FolderOption;
use super::folder::{Folder, Round};
use super::leases::{Leases, Other};
use super::results::{self, Gaps, Stored};
use crate::command::render::{self, frames::Frame, stage::Stage};
use crate::failure::Failure;
use crate::progress::duration;
use crate::{interrupt, threads};
use snell_formats::atomic;
use snell_formats::error::one_line;
use snell_math::simd::Level;
use snell_render::{Job, Progress, Settings, Task, TaskResult, Underway, with_patience};
use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::hash::{BuildHasher, RandomState};
use std::io::BufReader;
use std::ops::RangeInclusive;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Pauses between two looks at a folder in which nothing is free.
const PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(5)];

/// For so long a result that cannot be written is kept and tried again.
const STUBBORN: Duration = Duration::from_secs(600);

/// With more pictures than this, workers do not begin with the first.
const MANY_PICTURES: usize = 32;

/// Options of `snell work`.
#[derive(Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    folder: FolderOption,
    /// Render only these tasks, such as 7 or 10-19, for schedulers that number their tasks: from 0,
    /// picture by picture. Tasks that are done are not rendered again
    #[arg(long, value_name = "FIRST-LAST", value_parser = parse_tasks)]
    tasks: Option<RangeInclusive<u64>>,
    /// Name of this worker, for messages. Default: the machine's name and the process id
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// After this time without a sign of life of another worker its task is taken over
    #[arg(
        long,
        value_name = "TIME",
        value_parser = render::options::parse_duration,
        default_value = "60s",
    )]
    lease: Duration,
    /// Threads. Default: one per core
    #[arg(short, long, value_name = "N", value_parser = threads::number())]
    threads: Option<u32>,
    /// Print progress in the words of Open Job Description (openjd_progress: 42)
    #[arg(long)]
    openjd: bool,
    /// Print nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

impl Options {
    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.threads.map_or_else(threads::cores, |n| n as usize)
    }
}

fn parse_tasks(text: &str) -> Result<RangeInclusive<u64>, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    match (first.trim().parse(), last.trim().parse()) {
        (Ok(first), Ok(last)) if first <= last => Ok(first..=last),
        _ => Err("expected the number of a task, or a range such as 10-19".into()),
    }
}

/// Works on a plan.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let folder = Folder::open(&options.folder.folder)?;
    let plan = &folder.plan;
    if options.tasks.is_some() && plan.has_rounds {
        return Err(Failure::Usage(
            "--tasks: pixels of this plan stop by their error (--noise), so its tasks depend on \
             those before and have no fixed numbers; start as many workers without --tasks"
                .into(),
        ));
    }
    let all = u64::from(plan.tasks) * u64::from(plan.frames);
    if let Some(tasks) = &options.tasks
        && *tasks.end() >= all
    {
        return Err(Failure::Usage(format!(
            "--tasks {}-{}: the plan has the tasks 0 to {}",
            tasks.start(),
            tasks.end(),
            all.saturating_sub(1)
        )));
    }
    let simd = Level::from_env().map_err(Failure::Usage)?;
    let render_options = folder.render_options()?;
    let mut stage = Stage::new(folder.scene()?, &render_options)?;
    let frames = folder.frames(&render_options, &stage)?;
    interrupt::save_first();
    let name = worker_name(options.name.as_deref());
    let mut worker = Worker {
        options,
        folder: &folder,
        leases: Leases::new(&name, options.lease.max(Duration::from_millis(200))),
        name,
        render_options: &render_options,
        simd,
        done: 0,
        spent: Duration::ZERO,
        is_last: false,
        busy: HashMap::new(),
    };
    worker.work(&mut stage, &frames)
}

/// The name of a worker, which no other has even if it is given twice.
fn worker_name(given: Option<&str>) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let of_machine = || {
        #[cfg(unix)]
        let name = nix::unistd::gethostname().ok().and_then(|name| name.into_string().ok());
        #[cfg(not(unix))]
        let name = std::env::var("COMPUTERNAME").ok();
        format!("{}-{}", name.unwrap_or_else(|| "worker".into()), std::process::id())
    };
    let name = given.map_or_else(of_machine, String::from);
    let random = RandomState::new().hash_one(std::process::id()) as u32;
    format!("{}-{random:08x}", name.chars().map(plain).take(60).collect::<String>())
}

struct Worker<'a> {
    options: &'a Options,
    folder: &'a Folder,
    leases: Leases,
    name: String,
    render_options: &'a render::Options,
    simd: Level,
    /// The number of tasks that this worker has rendered.
    done: u32,
    /// The time that they took.
    spent: Duration,
    /// True if only one picture is left, so that this worker waits for the others there.
    is_last: bool,
    /// The files of pictures in which nothing was free.
    busy: HashMap<u32, BTreeSet<String>>,
}

/// Why work on a picture has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// All that is to be done is done.
    Finished,
    /// Others do the rest.
    Busy,
    Interrupted,
}

/// A task with its number in its round.
type Numbered = (u32, Task);

/// A picture that this worker works on.
struct Picture<'a> {
    frame: u32,
    job: &'a Job<'a>,
    settings: &'a Settings,
    underway: Underway,
}

impl Worker<'_> {
    fn work(&mut self, stage: &mut Stage, frames: &[Frame]) -> Result<ExitCode, Failure> {
        let mut pause = PAUSES[0];
        loop {
            let mut is_all = true;
            let mut has_worked = false;
            let order = self.order(frames.len() as u32);
            self.is_last = order.len() == 1;
            for number in order {
                let before = self.done;
                let end = match self.is_still_busy(number) {
                    true => End::Busy,
                    false => self.work_on(stage, number, &frames[number as usize])?,
                };
                if end == End::Busy {
                    self.busy.insert(number, self.names(number));
                }
                has_worked |= self.done > before;
                match end {
                    End::Finished => {}
                    End::Busy => is_all = false,
                    End::Interrupted => {
                        self.say(format!(
                            "interrupted: {} tasks are done; their results are in {}",
                            self.done,
                            self.folder.path.display()
                        ));
                        return Ok(ExitCode::from(interrupt::EXIT_CODE));
                    }
                }
            }
            if is_all {
                self.say(format!("no task is left; {} were done here", self.done));
                return Ok(ExitCode::SUCCESS);
            }
            pause = if has_worked { PAUSES[0] } else { (pause * 2).min(PAUSES[1]) };
            interrupt::wait(pause.min(self.options.lease), 0);
        }
    }

    /// The pictures that have tasks for this worker, first those that nobody has begun.
    fn order(&self, frames: u32) -> Vec<u32> {
        let mut order: Vec<u32> = match self.numbers() {
            None => (0..frames).filter(|&frame| !self.folder.is_finished(frame)).collect(),
            Some([first, last]) => {
                let tasks = u64::from(self.folder.plan.tasks.max(1));
                ((first / tasks) as u32..=(last / tasks) as u32).collect()
            }
        };
        let has_begun = |frame: &u32| self.folder.frame(*frame).is_dir();
        let (begun, mut fresh): (Vec<u32>, Vec<u32>) = order.drain(..).partition(has_begun);
        // Workers that start together begin at different pictures.
        if fresh.len() > MANY_PICTURES {
            let start = RandomState::new().hash_one(&self.name) as usize % fresh.len();
            fresh.rotate_left(start);
        }
        fresh.extend(begun);
        fresh
    }

    /// The files of the newest round of a picture.
    fn names(&self, frame: u32) -> BTreeSet<String> {
        self.folder.newest_round(frame).map(|round| round.names()).unwrap_or_default()
    }

    /// True if nothing was free in a picture, and nothing has changed since.
    fn is_still_busy(&mut self, frame: u32) -> bool {
        let Some(round) = self.folder.newest_round(frame) else { return false };
        let names = round.names();
        self.busy.get(&frame) == Some(&names) && !self.has_late(&round, &names)
    }

    /// The numbers of the first and last task for this worker, if not all are.
    fn numbers(&self) -> Option<[u64; 2]> {
        self.options.tasks.as_ref().map(|tasks| [*tasks.start(), *tasks.end()])
    }

    fn work_on(&mut self, stage: &mut Stage, number: u32, frame: &Frame) -> Result<End, Failure> {
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
                return self.end(&picture);
            }
            self.insist(&round.path, &mut || self.folder.make(&round.path))?;
            match self.work_on_round(&mut picture, &round, &tasks)? {
                End::Finished => {}
                end => return Ok(end),
            }
            if picture.settings.noise.is_none() {
                return self.end(&picture);
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

    /// Waits, the longer the more often.
    fn pause(&self, pause: &mut Duration) {
        interrupt::wait((*pause).min(self.options.lease), 0);
        *pause = (*pause * 2).min(PAUSES[1]);
    }

    fn is_ours(&self, frame: u32, number: u32) -> bool {
        let global = u64::from(frame) * u64::from(self.folder.plan.tasks) + u64::from(number);
        self.numbers().is_none_or(|[first, last]| (first..=last).contains(&global))
    }

    /// Notes that a picture is finished, if it is so for all workers.
    fn end(&self, picture: &Picture) -> Result<End, Failure> {
        if self.options.tasks.is_none() {
            let path = self.folder.frame(picture.frame);
            self.insist(&path, &mut || {
                self.folder.make(&path)?;
                self.folder.set_finished(picture.frame)
            })?;
        }
        Ok(End::Finished)
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
        let count = self.folder.plan.tasks;
        let picture_of = match self.folder.plan.frames {
            1 => String::new(),
            frames => format!(" of picture {} of {frames}", picture.frame + 1),
        };
        let from = match self.folder.plan.has_rounds {
            true => format!(", from sample {} on", task.samples[0]),
            false => String::new(),
        };
        self.say(format!(
            "task {} of {count}{picture_of}{from}: {}",
            number + 1,
            duration(taken.as_secs_f64())
        ));
        if self.options.openjd {
            let all = match self.numbers() {
                Some([first, last]) => last - first + 1,
                None => u64::from(count) * u64::from(self.folder.plan.frames),
            };
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
                "warning: {}: worker {other} has another result than this one ({}), so one of the \
                 machines is broken; snell merge tells more",
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
            return Err(self.gaps(round, &gaps));
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

    fn gaps(&self, round: &Round, gaps: &Gaps) -> Failure {
        let problem = gaps.problems.first().cloned();
        Failure::Other(problem.unwrap_or_else(|| {
            format!("{}: results have vanished; start again", round.path.display())
        }))
    }

    /// Does something with the folder, and tries again for some minutes if that fails: a disk may
    /// be full, or a share away for a moment.
    fn insist<T>(
        &self,
        path: &std::path::Path,
        action: &mut dyn FnMut() -> std::io::Result<T>,
    ) -> Result<T, Failure> {
        let start = Instant::now();
        let mut pause = PAUSES[0];
        loop {
            let error = match action() {
                Ok(done) => return Ok(done),
                Err(error) => error,
            };
            let shown = one_line(&path.display().to_string()).into_owned();
            if pause == PAUSES[0] {
                eprintln!(
                    "warning: {shown}: {error}; trying again for {} minutes: make room or mend \
                     the folder",
                    STUBBORN.as_secs() / 60
                );
            }
            if start.elapsed() > STUBBORN || interrupt::is_requested() {
                return Err(Failure::Other(format!("{shown}: {error}")));
            }
            pause = (pause * 2).min(PAUSES[1]);
            interrupt::wait(pause, 0);
        }
    }

    /// As [`Self::insist`], with the leases.
    fn insist_mut<T>(
        &mut self,
        path: &std::path::Path,
        action: &mut dyn FnMut(&mut Leases) -> std::io::Result<T>,
    ) -> Result<T, Failure> {
        let patience = self.options.lease.max(Duration::from_millis(200));
        let mut leases = std::mem::replace(&mut self.leases, Leases::new(&self.name, patience));
        let done = self.insist(path, &mut || action(&mut leases));
        self.leases = leases;
        done
    }

    fn say(&self, line: String) {
        if !self.options.quiet {
            eprintln!("{}: {line}", self.name);
        }
    }
}
