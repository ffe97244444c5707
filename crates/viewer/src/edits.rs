//! The changes of a scene that can be undone, each a step of one or more definitions in the form of
//! `-D`.

use std::time::{Duration, Instant};

/// Maximum number of steps that are kept.
const MAX_STEPS: usize = 1000;
/// Maximum total size in bytes of the steps that are kept.
const MAX_BYTES: usize = 4 << 20;
/// Changes of one thing within this time are one step, as of a slider that is dragged.
const TOGETHER: Duration = Duration::from_secs(1);

/// One step.
#[derive(Clone, Debug, PartialEq)]
struct Step {
    definitions: Vec<String>,
    /// The number of the gesture that made the step, if there is one.
    gesture: Option<u32>,
    made: Instant,
}

/// The history of changes.
#[derive(Clone, Debug, Default)]
pub struct Edits {
    steps: Vec<Step>,
    /// Number of steps that are applied; the rest can be redone.
    applied: usize,
}

impl Edits {
    /// Adds a step after those that are applied. Changes of the same keys in one gesture, or soon
    /// after each other, become one step.
    pub fn push(&mut self, definitions: Vec<String>, gesture: Option<u32>) -> Result<(), String> {
        self.steps.truncate(self.applied);
        let is_again = self.steps.last().is_some_and(|last| {
            let keys = |definitions: &[String]| {
                definitions.iter().map(|d| key(d).to_string()).collect::<Vec<_>>()
            };
            let is_soon = match gesture {
                Some(_) => last.gesture == gesture,
                None => last.made.elapsed() < TOGETHER,
            };
            is_soon && keys(&last.definitions) == keys(&definitions)
        });
        // Another entry of a table is a choice, and no slider.
        if is_again && !definitions.iter().any(|definition| is_entry(key(definition))) {
            self.steps.pop();
        }
        self.steps.push(Step { definitions, gesture, made: Instant::now() });
        self.applied = self.steps.len();
        let all = self.steps.iter().flat_map(|step| &step.definitions);
        let bytes: usize = all.map(String::len).sum();
        if self.steps.len() > MAX_STEPS || bytes > MAX_BYTES {
            return Err(format!(
                "more than {MAX_STEPS} changes of the scene, or {} MB of them; undo some, or copy \
                    the command and begin with it",
                MAX_BYTES >> 20
            ));
        }
        Ok(())
    }

    /// Takes the last step back; false if there is none.
    pub fn undo(&mut self) -> bool {
        self.applied.checked_sub(1).map(|applied| self.applied = applied).is_some()
    }

    /// Does the next step that was taken back again; false if there is none.
    pub fn redo(&mut self) -> bool {
        let has_more = self.applied < self.steps.len();
        self.applied += usize::from(has_more);
        has_more
    }

    /// Number of steps that are applied.
    pub fn count(&self) -> usize {
        self.applied
    }

    /// The definitions that make the scene what it is, in their order: those that are applied,
    /// without those that later ones replace.
    pub fn standing(&self) -> Vec<&str> {
        let applied = self.steps[..self.applied].iter();
        let all: Vec<&str> =
            applied.flat_map(|step| &step.definitions).map(String::as_str).collect();
        let mut stands = vec![true; all.len()];
        for i in (0..all.len()).rev() {
            stands[i] = !is_replaced(&all, &stands, i);
        }
        let kept = all.iter().zip(&stands).filter(|(_, stands)| **stands).map(|(edit, _)| *edit);
        // A node that was never hidden, or is shown again, needs no word.
        kept.filter(|edit| !is_plain(edit)).collect()
    }
}

/// True if the change number `i` has no effect, because a later one sets the same or what is around
/// it. `stands` says which of the later ones count.
fn is_replaced(all: &[&str], stands: &[bool], i: usize) -> bool {
    let own = key(all[i]);
    if is_removal(all[i]) {
        return false;
    }
    for j in (i + 1..all.len()).filter(|j| stands[*j]) {
        let other = key(all[j]);
        // After a removal, the numbers are those of other things.
        if is_removal(all[j]) && family(own) == family(other) {
            return false;
        }
        // Numbers of other things may rest on an entry that was added.
        if own == other || (is_within(own, other) && !is_entry(own)) {
            return !is_entry(own) || (i + 1..j).all(|k| !stands[k]);
        }
        if is_within(other, own) {
            return false;
        }
    }
    false
}

/// True for a key inside of what another key sets.
fn is_within(inner: &str, outer: &str) -> bool {
    inner.strip_prefix(outer).is_some_and(|rest| rest.starts_with('.'))
}

/// True for the key of a whole entry of a table of the scene, such as `light.2`.
fn is_entry(key: &str) -> bool {
    key.split_once('.').is_some_and(|(_, number)| number.parse::<usize>().is_ok())
}

/// True if a change removes an entry of a table, so that the ones behind it move up.
fn is_removal(edit: &str) -> bool {
    edit.strip_suffix("=null").is_some_and(is_entry)
}

/// The table that a key leads into.
fn family(key: &str) -> &str {
    key.split_once('.').map_or(key, |(family, _)| family)
}

/// True for changes that leave a scene as it is.
fn is_plain(edit: &str) -> bool {
    edit.starts_with("node.")
        && (edit.ends_with(".visible=true") || edit.ends_with(".isolated=false"))
}

/// The key of a definition `key=value`.
pub fn key(edit: &str) -> &str {
    edit.split_once('=').map_or(edit, |(key, _)| key)
}

/// The number of the node for which a definition says this, such as `visible=false`.
pub fn node_that_is(edit: &str, what: &str) -> Option<u32> {
    edit.strip_prefix("node.")?.strip_suffix(what)?.strip_suffix('.')?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(definitions: &[&str]) -> Edits {
        let mut edits = Edits::default();
        for (i, definition) in definitions.iter().enumerate() {
            edits.push(vec![definition.to_string()], Some(i as u32)).expect("there is room");
        }
        edits
    }

    #[test]
    fn of_several_changes_of_one_thing_the_last_counts() {
        let mut edits = of(&[
            "a=1",
            "node.3.visible=false",
            "b=2",
            "a=3",
            "node.3.visible=true",
            "node.4.visible=false",
        ]);
        assert_eq!(edits.standing(), ["b=2", "a=3", "node.4.visible=false"]);
        let hidden = |edit: &str| node_that_is(edit, "visible=false");
        assert_eq!(edits.standing().into_iter().filter_map(hidden).collect::<Vec<_>>(), [4]);
        assert!(edits.undo() && edits.undo() && edits.undo());
        assert_eq!(edits.standing(), ["a=1", "node.3.visible=false", "b=2"]);
        assert_eq!(edits.count(), 3);
    }

    #[test]
    fn what_a_change_rests_on_stays_before_it() {
        let edits = of(&["m.kind=x", "m.kind.a=1", "m.kind=y", "m.kind.b=2"]);
        assert_eq!(edits.standing(), ["m.kind=y", "m.kind.b=2"]);
        let edits = of(&["m.kind=x", "m.kind.a=1", "c=1", "m.kind.a=2"]);
        assert_eq!(edits.standing(), ["m.kind=x", "c=1", "m.kind.a=2"]);
        let added = ["light.1={}", "light.2={}", "light.1.x=1", "light.1={\"y\":1}"];
        assert_eq!(of(&added).standing(), ["light.1={}", "light.2={}", "light.1={\"y\":1}"]);
    }

    #[test]
    fn changes_before_and_after_a_removal_are_those_of_different_things() {
        let all =
            ["light.1.x=1", "material.0.y=1", "light.0=null", "material.0.y=2", "light.1.x=3"];
        let stand = ["light.1.x=1", "light.0=null", "material.0.y=2", "light.1.x=3"];
        assert_eq!(of(&all).standing(), stand);
        let again = ["light.0=null", "light.0=null", "light.0={}", "light.0=null"];
        assert_eq!(of(&again).standing(), again);
        assert_eq!(
            of(&["material.0.normal_map=null", "material.0.normal_map={}"]).standing().len(),
            1
        );
    }

    #[test]
    fn a_gesture_is_one_step_however_long_it_takes() {
        let mut edits = Edits::default();
        for (value, gesture) in [(1, 1), (2, 1), (3, 2)] {
            edits.push(vec![format!("node.1.transform={value}")], Some(gesture)).expect("room");
        }
        assert!(edits.undo());
        assert_eq!(edits.standing(), ["node.1.transform=2"]);
        assert!(edits.undo() && !edits.undo() && edits.redo());
    }
}
