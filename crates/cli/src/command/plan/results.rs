//! The results of tasks in the folder of a plan.

use super::folder::{Folder, Round};
use super::shown;
use crate::failure::Failure;
use snell_formats::atomic;
use snell_render::{Fact, Origin, SavedError, Settings, Task, TaskResult, Underway};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufReader, ErrorKind};
use std::path::{Path, PathBuf};

/// The number of useless files in one place that are kept.
const MOST_ASIDE: u32 = 100;

/// What was found in the place of a result.
pub enum Found {
    /// The result, and the worker that has made it.
    Result(String, TaskResult),
    /// Nothing.
    Missing,
    /// A file that is no result of the task, and why.
    Useless(String),
    /// A file that cannot be read, and why.
    Unreadable(std::io::Error),
}

/// Reads the result of a task from a file.
pub fn read(path: &Path, folder: &Folder, frame: u32, task: &Task) -> Found {
    let read = File::open(path)
        .map_err(SavedError::Io)
        .and_then(|file| TaskResult::load(&mut BufReader::new(file)));
    match read {
        Err(SavedError::Io(error)) if error.kind() == ErrorKind::NotFound => Found::Missing,
        Err(SavedError::Io(error)) => Found::Unreadable(error),
        Err(error) => Found::Useless(error.to_string()),
        Ok((Origin { plan, frame: of, worker }, result)) => {
            if plan != folder.plan.fingerprint {
                Found::Useless(format!("this is a result of another plan (worker {worker})"))
            } else if of != frame || result.task != *task {
                Found::Useless(format!("this is the result of another task (worker {worker})"))
            } else {
                Found::Result(worker, result)
            }
        }
    }
}

/// How a result was stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stored {
    /// It is the result of its task.
    First,
    /// Another worker was faster, and its result is the same.
    Same,
    /// The result of this other worker differs. Both are kept.
    Differs(String),
}

/// Stores a result. It never replaces another, unless that is useless.
pub fn store(
    round: &Round,
    folder: &Folder,
    frame: u32,
    worker: &str,
    result: &TaskResult,
) -> std::io::Result<Stored> {
    folder.make(&round.path)?;
    let path = round.result(&result.task);
    let plan = folder.plan.fingerprint.clone();
    let origin = Origin { plan, frame, worker: worker.into() };
    match atomic::write_new(&path, |out| result.save(&origin, out)) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
        written => return written.map(|()| Stored::First),
    }
    match read(&path, folder, frame, &result.task) {
        Found::Result(_, known) if known.is_same(result) => Ok(Stored::Same),
        Found::Result(other, _) => {
            let beside = round.other_result(&result.task, worker);
            atomic::write_with(&beside, |out| result.save(&origin, out))
                .map_err(std::io::Error::other)?;
            Ok(Stored::Differs(other))
        }
        Found::Unreadable(error) => Err(error),
        Found::Missing | Found::Useless(_) => {
            atomic::write_with(&path, |out| result.save(&origin, out))
                .map_err(std::io::Error::other)?;
            Ok(Stored::First)
        }
    }
}

/// What is missing or wrong in the results of a round.
#[derive(Clone, Debug, Default)]
pub struct Gaps {
    /// The number of tasks of the round.
    pub tasks: usize,
    /// The tasks without results, by their numbers in the round.
    pub missing: Vec<u32>,
    /// The files in the places of results that are none, and why.
    pub useless: Vec<(PathBuf, String)>,
    /// What else is in the way, a sentence each.
    pub problems: Vec<String>,
}

impl Gaps {
    /// True if nothing is missing or wrong.
    pub fn is_empty(&self) -> bool {
        self.missing.is_empty() && self.useless.is_empty() && self.problems.is_empty()
    }

    /// Sets useless files aside, so that their tasks are rendered again, and says what is in the
    /// way, a sentence each.
    pub fn set_aside(self) -> Vec<String> {
        let aside = self.useless.iter().map(|(path, problem)| match set_aside(path) {
            Ok(name) => format!(
                "{}: {problem}; it was renamed to {name}, and snell work renders the task again",
                shown(path)
            ),
            Err(error) => format!(
                "{}: {problem}; remove this file ({error}), and snell work renders the task again",
                shown(path)
            ),
        });
        aside.chain(self.problems).collect()
    }
}

/// Gives a useless file another name, which is returned.
fn set_aside(path: &Path) -> std::io::Result<String> {
    for number in 1..=MOST_ASIDE {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(if number == 1 { ".useless".into() } else { format!("-{number}.useless") });
        let aside = path.with_file_name(&name);
        if aside.symlink_metadata().is_err() {
            std::fs::rename(path, &aside)?;
            return Ok(name.display().to_string());
        }
    }
    Err(ErrorKind::AlreadyExists.into())
}

/// Adds all results of the current round of a picture to its film. The folders are copies of the
/// same plan.
pub fn add_round(
    underway: &mut Underway,
    settings: &Settings,
    folders: &[&Folder],
    frame: u32,
) -> Gaps {
    let start = underway.samples();
    let rounds: Vec<Round> = folders.iter().map(|folder| folder.round(frame, start)).collect();
    let names: Vec<BTreeSet<String>> = rounds.iter().map(Round::names).collect();
    let Some(first) = folders.first() else { return Gaps::default() };
    let tasks = underway.tasks(settings, first.plan.split);
    let mut gaps = Gaps { tasks: tasks.len(), ..Gaps::default() };
    for (number, task) in (0..).zip(&tasks) {
        let stem = Round::stem(task);
        let mut known: Option<(String, TaskResult)> = None;
        let mut useless = Vec::new();
        for (round, names) in rounds.iter().zip(&names) {
            let path = round.result(task);
            let name = shown(&path);
            let (worker, result) = match read(&path, first, frame, task) {
                Found::Missing => continue,
                Found::Useless(problem) => {
                    useless.push((path, problem));
                    continue;
                }
                Found::Unreadable(error) => {
                    gaps.problems.push(format!("{name}: {error}"));
                    continue;
                }
                Found::Result(worker, result) => (worker, result),
            };
            let differing = known.as_ref().filter(|known| !known.1.is_same(&result));
            let other = differing.map(|known| known.0.clone());
            for other in other.into_iter().chain(others(names, &stem).map(String::from)) {
                gaps.problems.push(format!(
                    "{name}: the results of the workers {worker} and {other} differ, so one of \
                     their machines is broken; remove the results of both ({stem}.*) and let \
                     another machine render the task"
                ));
            }
            known.get_or_insert((worker, result));
        }
        match known {
            // Another folder has what is useless here.
            Some((worker, result)) => {
                if !underway.add(result) {
                    gaps.problems.push(format!(
                        "{}: this result of worker {worker} does not fit its task; remove it",
                        rounds[0].result(task).display()
                    ));
                }
            }
            None if useless.is_empty() => gaps.missing.push(number),
            None => gaps.useless.extend(useless),
        }
    }
    gaps
}

/// The workers whose results of a task differ from its first.
fn others<'a>(names: &'a BTreeSet<String>, stem: &'a str) -> impl Iterator<Item = &'a str> {
    let start = format!("{stem}.");
    let of_task = names.range(start.clone()..).take_while(move |name| name.starts_with(&start));
    of_task.filter_map(move |name| name[stem.len() + 1..].strip_suffix(".other"))
}

/// Goes on with the film after the last round that was ended, if there is one.
pub fn catch_up(
    underway: &mut Underway,
    settings: &Settings,
    folder: &Folder,
    frame: u32,
) -> Result<(), Failure> {
    let facts: Vec<Fact> = folder.plan.facts(frame);
    while let Some(round) = folder.last_ended_round(frame) {
        if round.start < underway.samples() {
            break;
        }
        let path = round.end();
        let read = File::open(&path)
            .map_err(SavedError::Io)
            .and_then(|file| underway.replace_film(settings, &mut BufReader::new(file), &facts));
        let Err(error) = read else { break };
        let failed = |more: String| Failure::Other(format!("{}: {error}{more}", shown(&path)));
        if matches!(error, SavedError::Io(_)) {
            return Err(failed(String::new()));
        }
        // It is made again from the results of its round.
        let name = set_aside(&path).map_err(|aside| {
            failed(format!("; remove this file ({aside}), and snell work makes it again"))
        })?;
        eprintln!("warning: {}: {error}; it was renamed to {name}", shown(&path));
    }
    Ok(())
}
