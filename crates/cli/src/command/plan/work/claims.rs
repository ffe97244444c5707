//! Which task a worker takes next.

use super::{Numbered, Worker};
use crate::command::plan::folder::Round;
use crate::command::plan::leases::{Lease, Other};
use crate::failure::Failure;
use snell_math::rng;
use snell_render::Task;
use std::collections::BTreeSet;
use std::hash::{BuildHasher, RandomState};
use std::time::Duration;

/// A task that takes another worker this many times as long as this one is done twice.
const STRAGGLER: u32 = 4;

/// The tasks of a round without results.
pub(super) struct OpenTasks {
    /// Those that nobody renders.
    pub free: Vec<Numbered>,
    /// Those that others render.
    pub leased: Vec<Numbered>,
}

impl Worker<'_> {
    /// True if the worker of some task of a round is dead or takes too long.
    pub(super) fn has_late(&mut self, round: &Round, names: &BTreeSet<String>) -> bool {
        let too_long = self.too_long();
        let leases = names.iter().filter(|name| name.ends_with(".lease"));
        let late = |other| !matches!(other, Other::Alive(time) if time < too_long);
        // Every lease is looked at, because the time of the first look counts.
        leases.fold(false, |any, name| late(self.leases.look(&round.path.join(name))) | any)
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
            return OpenTasks { free: left, leased: Vec::new() };
        }
        let key = rng::hash_combine(self.done, RandomState::new().hash_one(&self.name) as u32);
        left.sort_by_key(|(number, _)| rng::hash_combine(key, *number));
        let (leased, free) = left.into_iter().partition(|(_, task)| has(task, "lease"));
        OpenTasks { free, leased }
    }

    /// Takes a task that nobody renders. If there is none, takes one whose worker is dead or takes
    /// too long.
    pub(super) fn claim(
        &mut self,
        round: &Round,
        open: &mut OpenTasks,
    ) -> Result<Option<(u32, Task, Option<Lease>)>, Failure> {
        while let Some((number, task)) = open.free.pop() {
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
