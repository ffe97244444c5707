//! Errors for the user, and their exit codes.

use crate::exit::ExitCode;
use snell_formats::error::one_line;
use snell_formats::{ReadError, WriteError};
use snell_persist::Problem;
use snell_scene::overrides::{OverrideError, nearest};

/// An error that ends the command.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The options are invalid.
    #[error("{0}")]
    Usage(String),
    /// `-D` names something that does not exist.
    #[error(transparent)]
    Override(#[from] OverrideError),
    /// A file could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The scene cannot be rendered.
    #[error("{0}")]
    Scene(String),
    /// Any other failure.
    #[error("{0}")]
    Other(String),
}

impl Failure {
    /// Prints the message and returns the exit code.
    pub fn report(&self) -> ExitCode {
        eprintln!("error: {}", one_line(&self.to_string()));
        match self {
            Self::Usage(_) | Self::Override(_) => ExitCode::from(2),
            _ => ExitCode::from(1),
        }
    }
}

impl From<Problem> for Failure {
    fn from(problem: Problem) -> Self {
        match problem {
            Problem::Usage(message) => Self::Usage(message),
            Problem::Other(message) => Self::Other(message),
            Problem::Write(error) => Self::Write(error),
        }
    }
}

/// The choice of this name, or an error that lists the names and suggests the nearest.
pub fn choice<T: Copy>(
    what: &str,
    name: &str,
    choices: &[T],
    name_of: impl Fn(T) -> &'static str,
) -> Result<T, Failure> {
    if let Some(&found) = choices.iter().find(|&&c| name_of(c) == name) {
        return Ok(found);
    }
    let names: Vec<_> = choices.iter().map(|&c| name_of(c)).collect();
    let hint = nearest(name, &names).map(|n| format!("; did you mean {n}?")).unwrap_or_default();
    Err(Failure::Usage(format!(
        "there is no {what} \"{name}\"{hint} (known: {})",
        names.join(", ")
    )))
}
