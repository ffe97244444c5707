//! Warnings of scene readers about changes: each kind is reported once, at its first place.

use crate::scene::fault::Spot;
use snell_scene::{Scene, Warning, WarningKind};
use std::collections::HashMap;

/// Warnings, counted by kind.
#[derive(Debug, Default)]
pub struct Notes {
    positions: HashMap<String, usize>,
    notes: Vec<(Spot, Warning)>,
}

impl Notes {
    /// Adds a warning at a place: what was found, and what was done instead. Only the first warning
    /// of each kind is kept.
    pub fn add(
        &mut self,
        about: WarningKind,
        kind: String,
        at: Spot,
        message: impl FnOnce() -> String,
    ) {
        match self.positions.get(&kind) {
            Some(&position) => self.notes[position].1.count += 1,
            None => {
                self.positions.insert(kind, self.notes.len());
                self.notes.push((at, Warning { message: message(), count: 1, kind: about }));
            }
        }
    }

    /// Adds the warnings about a mesh that is named at a place.
    pub fn add_of_mesh(&mut self, at: Spot, warnings: Vec<(&'static str, Warning)>) {
        for (kind, Warning { message, count, kind: about }) in warnings {
            let kind = if kind.is_empty() { &message } else { kind };
            let key = format!("mesh: {kind}");
            self.add(about, key.clone(), at, || message);
            let position = self.positions[&key];
            self.notes[position].1.count += count.saturating_sub(1);
        }
    }

    /// Moves the warnings to the scene, in the order of the text. `files` are the file names by
    /// number.
    pub fn finish(&mut self, scene: &mut Scene, files: &[String]) {
        self.notes.sort_by_key(|(at, ..)| (at.file, at.line, at.column));
        for (at, Warning { message, count, kind }) in self.notes.drain(..) {
            let file = files.get(at.file as usize).map_or("", String::as_str);
            let message = format!("{file}:{}:{}: {message}", at.line, at.column);
            Warning::note_of(kind, &mut scene.warnings, message, count);
        }
    }
}
