//! What can go wrong for a user, and the exit code it ends with.

use snell_formats::error::one_line;
use snell_formats::{ReadError, WriteError};
use std::process::ExitCode;

/// An error that ends the command.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The options do not make sense.
    #[error("{0}")]
    Usage(String),
    /// A file could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The scene cannot be rendered.
    #[error("{0}")]
    Scene(String),
    /// Anything else.
    #[error("{0}")]
    Other(String),
}

impl Failure {
    /// Prints the message and gives the exit code.
    pub fn report(&self) -> ExitCode {
        eprintln!("error: {}", one_line(&self.to_string()));
        match self {
            Self::Usage(_) => ExitCode::from(2),
            _ => ExitCode::from(1),
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
    Err(Failure::Usage(format!("there is no {what} \"{name}\"{hint} (known: {})", names.join(", "))))
}

/// The nearest of some names, if one is near.
pub fn nearest<'a>(name: &str, names: &[&'a str]) -> Option<&'a str> {
    let best = names.iter().map(|n| (edit_distance(name, n), *n)).min()?;
    (best.0 <= name.chars().count().div_ceil(3).max(1)).then_some(best.1)
}

/// Number of insertions, deletions and replacements between two words (Levenshtein).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_suggested_only_if_it_is_near() {
        assert_eq!(nearest("pth", &["path", "whitted"]), Some("path"));
        assert_eq!(nearest("zzz", &["path", "whitted"]), None);
    }
}
