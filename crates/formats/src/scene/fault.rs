//! Errors in scene files. Places refer to files by number, which become names when a user sees
//! them.

use crate::{Place, ReadError};

/// A place in one of the files of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spot {
    /// The number of the file, in the order of opening.
    pub file: u32,
    /// Number of the line, from 1.
    pub line: u32,
    /// Number of the character in the line, from 1.
    pub column: u32,
}

/// A reason to stop reading.
#[derive(Clone, Debug)]
pub enum Fault {
    /// Something in a file of the scene.
    Here {
        /// The place in the file.
        at: Spot,
        /// What was found and what was expected.
        problem: String,
        /// A way to mend the file.
        remedy: String,
    },
    /// An error about another file, which has its own place.
    Read(ReadError),
}

impl Fault {
    /// An error at a place.
    pub fn new(at: Spot, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Here { at, problem: problem.into(), remedy: remedy.into() }
    }

    /// The error for the user. `files` are the names of the files by number.
    pub fn into_error(self, files: &[String]) -> ReadError {
        match self {
            Self::Read(error) => error,
            Self::Here { at, problem, remedy } => ReadError {
                file: files.get(at.file as usize).cloned().unwrap_or_default(),
                place: Place::Column(at.line as usize, at.column as usize),
                problem,
                remedy,
            },
        }
    }
}

impl From<ReadError> for Fault {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}
