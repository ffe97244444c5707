//! `snell work`: renders tasks of a plan until none is left.

mod claims;
mod patience;
mod picture;

use super::FolderOption;
use super::folder::Folder;
use super::leases::Leases;
use crate::command::render::{self, frames::Frame, stage::Stage};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::{interrupt, threads};
use patience::PAUSES;
use snell_math::simd::Level;
use snell_render::Task;
use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasher, RandomState};
use std::ops::RangeInclusive;
use std::time::Duration;

/// With more pictures than this, workers do not begin with the first.
const MANY_PICTURES: usize = 32;

/// The times for which a worker may be silent: a beat takes some milliseconds, and nobody waits
/// longer than a day.
const LEASES: RangeInclusive<Duration> =
    Duration::from_millis(200)..=Duration::from_secs(24 * 60 * 60);

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
    /// When another worker has given no sign of life for this time, its task is taken over: 0.2 s
    /// to a day
    #[arg(long, value_name = "TIME", value_parser = parse_lease, default_value = "60s")]
    lease: Duration,
    /// Threads. Default: one per core
    #[arg(short, long, value_name = "N", value_parser = threads::number())]
    threads: Option<u32>,
    /// Print progress in the format of Open Job Description (openjd_progress: 42)
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

fn parse_lease(text: &str) -> Result<Duration, String> {
    let time = render::options::parse_duration(text)?;
    match LEASES.contains(&time) {
        true => Ok(time),
        false => Err("expected 0.2s to 24h".into()),
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
            "--tasks: pixels of this plan stop at an error (--noise), so its tasks depend on \
             earlier ones and have no fixed numbers; start as many workers without --tasks"
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
        leases: Leases::new(&name, options.lease),
        name,
        key: RandomState::new().hash_one(std::process::id()) as u32,
        render_options: &render_options,
        simd,
        done: 0,
        spent: Duration::ZERO,
        is_last: false,
        busy: HashMap::new(),
        finished: HashSet::new(),
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
    /// A random number, so that workers do different things.
    key: u32,
    render_options: &'a render::Options,
    simd: Level,
    /// The number of tasks that this worker has rendered.
    done: u32,
    /// The time that they took.
    spent: Duration,
    /// True if only one picture is left, so that this worker waits for the others there.
    is_last: bool,
    /// A hash of the names of the files of each picture in which nothing was free.
    busy: HashMap<u32, u64>,
    /// The pictures that this worker has found finished.
    finished: HashSet<u32>,
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
                let end = match self.glance(number)? {
                    Some(end) => end,
                    None => {
                        let end = self.work_on(stage, number, &frames[number as usize])?;
                        if end == End::Busy {
                            self.set_busy(number);
                        }
                        end
                    }
                };
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
    fn order(&mut self, frames: u32) -> Vec<u32> {
        let mut order: Vec<u32> = match self.numbers() {
            None => (0..frames).filter(|&frame| !self.is_finished(frame)).collect(),
            Some([first, last]) => {
                let tasks = u64::from(self.folder.plan.tasks.max(1));
                ((first / tasks) as u32..=(last / tasks) as u32).collect()
            }
        };
        let has_begun = |frame: &u32| self.folder.frame(*frame).is_dir();
        let (mut begun, mut fresh): (Vec<u32>, Vec<u32>) = order.drain(..).partition(has_begun);
        // Workers that start together begin at different pictures.
        for pictures in [&mut fresh, &mut begun] {
            if pictures.len() > MANY_PICTURES {
                let start = self.key as usize % pictures.len();
                pictures.rotate_left(start);
            }
        }
        fresh.extend(begun);
        fresh
    }

    /// True if a picture is finished. The folder is looked at until it is so.
    fn is_finished(&mut self, frame: u32) -> bool {
        let is_finished = self.finished.contains(&frame) || self.folder.is_finished(frame);
        if is_finished {
            self.finished.insert(frame);
        }
        is_finished
    }

    /// The numbers of the first and last task for this worker, if not all are.
    fn numbers(&self) -> Option<[u64; 2]> {
        self.options.tasks.as_ref().map(|tasks| [*tasks.start(), *tasks.end()])
    }

    fn is_ours(&self, frame: u32, number: u32) -> bool {
        let global = self.folder.plan.number_of(frame, number);
        self.numbers().is_none_or(|[first, last]| (first..=last).contains(&global))
    }
}
