//! Warnings of the mesh readers, counted by kind.
//!
//! A file may repeat one oddity millions of times: the message is composed for the first one only.

use snell_scene::{Scene, Warning, WarningKind};

/// Names in quotes for a message: the first ones, and how many there are besides.
pub fn listed(names: &[&str]) -> String {
    const SHOWN: usize = 4;
    let shown = names.iter().take(SHOWN).map(|name| format!("\"{name}\""));
    let shown = shown.collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// The warnings of one file.
#[derive(Clone, Debug, Default)]
pub struct Notes {
    kinds: Vec<(&'static str, Warning)>,
}

impl Notes {
    /// Counts one warning of a kind; `message` describes the first one, its place, and what was
    /// done instead.
    pub fn add(&mut self, kind: &'static str, message: impl FnOnce() -> String) {
        self.add_of(WarningKind::Changed, kind, message);
    }

    /// Counts one warning of a kind whose [`WarningKind`] is not a change.
    pub fn add_of(
        &mut self,
        about: WarningKind,
        kind: &'static str,
        message: impl FnOnce() -> String,
    ) {
        match self.kinds.iter_mut().find(|(k, _)| *k == kind) {
            Some((_, warning)) => warning.count += 1,
            None => self.kinds.push((kind, Warning { message: message(), count: 1, kind: about })),
        }
    }

    /// Counts several warnings of a kind at once; see [`Self::add`].
    pub fn add_times(&mut self, count: u64, kind: &'static str, message: impl FnOnce() -> String) {
        match self.kinds.iter_mut().find(|(k, _)| *k == kind) {
            Some((_, warning)) => warning.count += count,
            None => {
                let (message, about) = (message(), WarningKind::Changed);
                self.kinds.push((kind, Warning { message, count, kind: about }));
            }
        }
    }

    /// Adds a warning of a rare kind; equal messages are counted.
    pub fn say(&mut self, about: WarningKind, message: String) {
        match self.kinds.iter_mut().find(|(_, w)| w.message == message) {
            Some((_, warning)) => warning.count += 1,
            None => self.kinds.push(("", Warning { message, count: 1, kind: about })),
        }
    }

    /// Adds the warnings of a later part of the file.
    pub fn append(&mut self, later: Self) {
        for (kind, warning) in later.kinds {
            match self
                .kinds
                .iter_mut()
                .find(|(k, w)| (*k == kind && !k.is_empty()) || w.message == warning.message)
            {
                Some((_, known)) => known.count += warning.count,
                None => self.kinds.push((kind, warning)),
            }
        }
    }

    /// The warnings with the names of their kinds; a name may be empty.
    pub fn into_kinds(self) -> Vec<(&'static str, Warning)> {
        self.kinds
    }

    /// Moves the warnings to a scene.
    pub fn finish(self, scene: &mut Scene) {
        scene.warnings.extend(self.kinds.into_iter().map(|(_, warning)| warning));
    }
}
