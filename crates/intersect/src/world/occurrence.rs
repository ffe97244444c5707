//! Occurrence numbers: converts between paths of instances and [`crate::Hit::instance`].

use super::{GroupContents, GroupId, World, WorldError};
use snell_math::Transform;

/// The largest nesting depth of instances.
pub(super) const MAX_NESTING: usize = 512;

/// The numbering of the occurrences of all groups.
#[derive(Debug)]
pub(super) struct Occurrences {
    /// Groups, children before parents.
    pub order: Vec<usize>,
    /// For each group, the number of occurrences that one instance of it adds: one for the group
    /// itself, and one for each occurrence below it.
    pub counts: Vec<u64>,
    /// For each instance of each group, the difference between the occurrence numbers of the child
    /// and of the group, in ascending order.
    pub offsets: Vec<Vec<u32>>,
}

impl Occurrences {
    /// Counts occurrences; returns an error for cycles, too many occurrences and too deep nesting.
    pub fn count(groups: &[GroupContents]) -> Result<Self, WorldError> {
        let order = children_first(groups)?;
        let mut counts = vec![1u64; groups.len()];
        let mut offsets = vec![Vec::new(); groups.len()];
        let mut nesting = vec![0; groups.len()];
        for &group in &order {
            for instance in &groups[group].instances {
                let child = instance.child.0 as usize;
                offsets[group].push(counts[group] as u32);
                counts[group] = counts[group].saturating_add(counts[child]);
                nesting[group] = nesting[group].max(nesting[child] + 1);
                if counts[group] > u64::from(u32::MAX) - 1 {
                    return Err(WorldError::TooManyInstances);
                }
            }
            if nesting[group] > MAX_NESTING {
                return Err(WorldError::Limit(format!(
                    "instances are nested more than {MAX_NESTING} deep; apply some of the \
                        transforms to the geometry instead"
                )));
            }
        }
        Ok(Self { order, counts, offsets })
    }
}

/// All groups, children before parents. Uses an explicit stack, because files may nest groups more
/// deeply than a thread's stack allows.
fn children_first(groups: &[GroupContents]) -> Result<Vec<usize>, WorldError> {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done,
    }
    let mut state = vec![State::New; groups.len()];
    let mut order = Vec::with_capacity(groups.len());
    for start in 0..groups.len() {
        if state[start] != State::New {
            continue;
        }
        state[start] = State::Open;
        let mut stack = vec![(start, 0)];
        while let Some((group, next)) = stack.pop() {
            let Some(instance) = groups[group].instances.get(next) else {
                state[group] = State::Done;
                order.push(group);
                continue;
            };
            stack.push((group, next + 1));
            let child = instance.child.0 as usize;
            match state[child] {
                State::Done => {}
                State::Open => return Err(WorldError::Cycle(child as u32)),
                State::New => {
                    state[child] = State::Open;
                    stack.push((child, 0));
                }
            }
        }
    }
    Ok(order)
}

impl World {
    /// The number of occurrences in the world: [`crate::Hit::instance`] is less than this.
    pub fn instance_count(&self) -> u32 {
        self.occurrences.counts[0] as u32
    }

    /// The index of the instance of `group` that leads to the occurrence numbered `rest` relative
    /// to the group (0 is the group itself), and the number of that occurrence relative to the
    /// child.
    pub(super) fn step(&self, group: GroupId, rest: u32) -> Option<(usize, u32)> {
        let offsets = &self.occurrences.offsets[group.0 as usize];
        let step = offsets.partition_point(|&o| o <= rest).checked_sub(1)?;
        Some((step, rest - offsets[step]))
    }

    /// The path from the root to an occurrence: for each step the group and the position of the
    /// instance in its list. Empty for the root.
    pub fn instance_path(&self, instance: u32) -> Vec<(GroupId, usize)> {
        let mut path = Vec::new();
        let (mut group, mut rest) = (GroupId(0), instance);
        while let Some((step, left)) = self.step(group, rest) {
            path.push((group, step));
            (group, rest) = (self.group(group).instances[step].child, left);
        }
        path
    }

    /// The map from the coordinates of an occurrence's group to the world, at time 0 if it moves.
    pub fn world_from_instance(&self, instance: u32) -> Transform {
        self.world_from_instance_at(instance, 0.0)
    }

    /// The map from the coordinates of an occurrence's group to the world at a time from 0 to 1. An
    /// instance whose map is singular at that time, so that it is not hit, contributes its map at
    /// time 0.
    pub fn world_from_instance_at(&self, instance: u32, time: f32) -> Transform {
        let mut world_from_group = Transform::IDENTITY;
        let (mut group, mut rest) = (GroupId(0), instance);
        while let Some((step, left)) = self.step(group, rest) {
            let instance = &self.group(group).instances[step];
            // The first step needs no product, and most paths have a single step.
            world_from_group = if group.0 == 0 {
                instance.at(time)
            } else {
                world_from_group.compose(&instance.at(time))
            };
            (group, rest) = (instance.child, left);
        }
        world_from_group
    }
}
