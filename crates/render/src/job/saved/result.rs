//! The result of a task, as a file.

use super::chunk::{self, Mark, SavedError, damaged};
use crate::film::tile::TileState;
use crate::job::{Statistics, Task, TaskResult};
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// The mark of the result of a task.
const MARK: Mark = Mark { what: "result of a task", bytes: *b"snellT02" };

/// Where a result comes from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Origin {
    /// The fingerprint of the plan to which the task belongs.
    pub plan: String,
    /// The number of the picture among those of the plan, from 0.
    pub frame: u32,
    /// The name of the worker that has rendered the task.
    pub worker: String,
}

#[derive(Serialize, Deserialize)]
struct Head {
    origin: Origin,
    task: Task,
    statistics: Statistics,
}

impl TaskResult {
    /// Writes the result: a mark, a [chunk] with its origin, and a chunk with its tiles.
    ///
    /// # Errors
    /// If `out` fails, or if the tiles take more than a gigabyte.
    pub fn save(&self, origin: &Origin, out: &mut dyn Write) -> std::io::Result<()> {
        let Self { task, statistics, tiles } = self;
        out.write_all(&MARK.bytes)?;
        let head = Head { origin: origin.clone(), task: *task, statistics: *statistics };
        chunk::write(&head, out)?;
        chunk::write(tiles, out)
    }

    /// Reads what [`Self::save`] has written. Whether it fits a render shows when it is
    /// [added](crate::Underway::add).
    ///
    /// # Errors
    /// If the input is no result of a task, or if it is damaged.
    pub fn load(input: &mut dyn Read) -> Result<(Origin, Self), SavedError> {
        MARK.read(input)?;
        let Head { origin, task, statistics } = chunk::read(input)?;
        let tiles: Vec<TileState> = chunk::read(input)?;
        if input.read(&mut [0])? > 0 {
            return damaged("something follows its end");
        }
        Ok((origin, Self { task, statistics, tiles }))
    }
}
