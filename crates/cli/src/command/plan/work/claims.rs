//! Which task a worker takes next.

use super::{End, Numbered, Worker};
use crate::command::plan::folder::Round;
use crate::command::plan::leases::{Lease, Other};
use crate::failure::Failure;
use snell_math::rng;
use snell_render::Task;
use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::Duration;

/// A task that takes another worker this many times as long as this one is done twice.
const STRAGGLER: u32 = 4;

/// After this many attempts at tasks that others have taken meanwhile, the folder is looked at
/// again: thousands of workers change it quickly.
const MISSES: usize = 16;

/// A worker looks at no more leases of others at a time. Workers look at different ones, so that
/// thousands of them that wait for a few do not all read everything.
const LOOKS: usize = 64;

/// The tasks of a round without results.
pub(super) struct OpenTasks {
    /// Those that nobody renders.
    pub free: Vec<Numbered>,
    /// Some of those that others render.
    pub leased: Vec<Numbered>,
    /// True if others have taken so many tasks meanwhile that the folder must be looked at again.
    pub is_stale: bool,
}

/// What the names of the files of a round tell of its tasks.
struct Counts {
    /// The number of tasks with results.
    done: usize,
    /// The number of tasks with results or leases.
    taken: usize,
}

impl Counts {
    fn of(names: &BTreeSet<String>) -> Self {
        let task = |name: &str| name.split_once('.').map(|(stem, _)| stem.to_string());
        let is_taken = |name: &&String| name.ends_with(".result") || name.ends_with(".lease");
        let done = names.iter().filter(|name| name.ends_with(".result")).count();
        // The files of a task are next to each other.
        let mut taken: Vec<_> = names.iter().filter(is_taken).filter_map(|n| task(n)).collect();
        taken.dedup();
        Self { done, taken: taken.len() }
    }
}

fn hash(names: &BTreeSet<String>) -> u64 {
    let mut hasher = DefaultHasher::new();
    names.hash(&mut hasher);
    hasher.finish()
}

impl Worker<'_> {
    /// What the files of a picture tell before its scene is made ready, which takes long: that it
    /// is finished, or that others do what is left of it. `None` if there may be something to do.
    pub(super) fn glance(&mut self, frame: u32) -> Result<Option<End>, Failure> {
        if self.options.tasks.is_some() {
            return Ok(None);
        }
        let Some(round) = self.folder.newest_round(frame) else { return Ok(None) };
        let names = round.names();
        let (counts, tasks) = (Counts::of(&names), self.folder.plan.tasks as usize);
        let has_all = |count: usize| !self.folder.plan.has_rounds && count >= tasks;
        if has_all(counts.done) {
            return self.end(frame).map(Some);
        }
        let is_same = self.busy.get(&frame) == Some(&hash(&names));
        let is_busy = (is_same || has_all(counts.taken)) && !self.has_late(&round, &names);
        Ok(is_busy.then_some(End::Busy))
    }

    /// Notes that nothing is free in a picture, until its files change.
    pub(super) fn set_busy(&mut self, frame: u32) {
        if let Some(round) = self.folder.newest_round(frame) {
            self.busy.insert(frame, hash(&round.names()));
        }
    }

    /// True if the worker of some task of a round is dead or takes too long.
    fn has_late(&mut self, round: &Round, names: &BTreeSet<String>) -> bool {
        let too_long = self.too_long();
        let mut leases: Vec<_> = names.iter().filter(|name| name.ends_with(".lease")).collect();
        if !leases.is_empty() {
            let start = self.key as usize % leases.len();
            leases.rotate_left(start);
        }
        leases.truncate(LOOKS);
        let late = |other| !matches!(other, Other::Alive(time) if time < too_long);
        // Every lease is looked at, because the time of the first look counts.
        leases
            .into_iter()
            .fold(false, |any, name| late(self.leases.look(&round.path.join(name))) | any)
    }

    /// The time after which a task is done twice.
    fn too_long(&self) -> Duration {
        let usual = self.spent.checked_div(self.done).unwrap_or(self.options.lease);
        (usual * STRAGGLER).max(Duration::from_secs(2))
    }

    /// The tasks of a round without results, as the folder is now. They are in random order, so
    /// that workers rarely want the same; in the order of their numbers, if these are given.
    pub(super) fn open_tasks(&self, round: &Round, tasks: &[Numbered]) -> OpenTasks {
        let names = round.names();
        let has =
            |task: &Task, kind: &str| names.contains(&format!("{}.{kind}", Round::stem(task)));
        let mut left: Vec<Numbered> = tasks.to_vec();
        left.retain(|(_, task)| !has(task, "result"));
        if self.options.tasks.is_some() {
            left.reverse();
            return OpenTasks { free: left, leased: Vec::new(), is_stale: false };
        }
        let (mut leased, mut free): (Vec<Numbered>, Vec<Numbered>) =
            left.into_iter().partition(|(_, task)| has(task, "lease"));
        let key = rng::hash_combine(self.key, self.done);
        free.sort_by_key(|(number, _)| rng::hash_combine(key, *number));
        // Always the same leases are looked at, because it counts how long they do not change.
        leased.sort_by_key(|(number, _)| rng::hash_combine(self.key, *number));
        leased.truncate(LOOKS);
        OpenTasks { free, leased, is_stale: false }
    }

    /// Takes a task that nobody renders. If there is none, takes one whose worker is dead or takes
    /// too long.
    pub(super) fn claim(
        &mut self,
        round: &Round,
        open: &mut OpenTasks,
    ) -> Result<Option<(u32, Task, Option<Lease>)>, Failure> {
        let mut misses = 0;
        while let Some((number, task)) = open.free.pop() {
            if misses >= MISSES {
                open.is_stale = true;
                return Ok(None);
            }
            misses += 1;
            // Schedulers that number their tasks know that nobody else renders them.
            let lease = match self.options.tasks {
                Some(_) => None,
                None => {
                    let path = round.lease(&task);
                    match self.insist(&path, &mut || self.leases.take(&path))? {
                        None => continue,
                        lease => lease,
                    }
                }
            };
            if !round.result(&task).is_file() {
                return Ok(Some((number, task, lease)));
            }
        }
        let too_long = self.too_long();
        while let Some((number, task)) = open.leased.pop() {
            let path = round.lease(&task);
            let lease = match self.leases.look(&path) {
                Other::Alive(time) if time < too_long => continue,
                // It is done twice, and whoever comes first counts.
                Other::Alive(_) => None,
                Other::Dead => {
                    self.say(format!("the worker of {} gives no sign of life", path.display()));
                    Some(self.insist_mut(&path, &mut |leases| leases.take_over(&path))?)
                }
                Other::Gone => self.insist(&path, &mut || self.leases.take(&path))?,
            };
            if !round.result(&task).is_file() {
                return Ok(Some((number, task, lease)));
            }
        }
        Ok(None)
    }
}
