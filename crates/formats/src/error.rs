//! Errors of reading and writing files. Each has a place, a problem and a remedy.

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    Whole,
    /// A line, from 1.
    Line(usize),
    /// A line and a column, both from 1.
    Column(usize, usize),
    /// A byte offset, from 0.
    Byte(u64),
    /// A JSON pointer, such as `/meshes/0/primitives/1`.
    Json(String),
    /// A JSON pointer, with line and column, both from 1.
    JsonAt(String, usize, usize),
}

/// A file could not be read. Displays as one message: `file:place: problem; remedy`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadError {
    /// The file, as the user named it.
    pub file: String,
    /// The place in the file.
    pub place: Place,
    /// What was found and what was expected.
    pub problem: String,
    /// A way to mend the file or to avoid the problem.
    pub remedy: String,
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&one_line(&self.file))?;
        match &self.place {
            Place::Whole => {}
            Place::Line(line) => write!(f, ":{line}")?,
            Place::Column(line, column) => write!(f, ":{line}:{column}")?,
            Place::Byte(offset) => write!(f, ": at byte {offset}")?,
            Place::Json(path) => write!(f, ": at {path}")?,
            Place::JsonAt(path, line, column) => write!(f, ":{line}:{column}: at {path}")?,
        }
        write!(f, ": {}", one_line(&self.problem))?;
        if !self.remedy.is_empty() {
            write!(f, "; {}", one_line(&self.remedy))?;
        }
        Ok(())
    }
}

impl std::error::Error for ReadError {}

/// A message as one line without control characters: text from a file must not control the
/// terminal.
pub fn one_line(text: &str) -> Cow<'_, str> {
    if !text.contains(char::is_control) {
        return Cow::Borrowed(text);
    }
    let lines: Vec<_> = text.split(['\n', '\r']).map(str::trim).filter(|l| !l.is_empty()).collect();
    let mut shown = String::new();
    for c in lines.join(" ").chars() {
        match c {
            '\t' => shown.push(' '),
            c if c.is_control() => shown.extend(c.escape_unicode()),
            c => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

/// The error of a file that could not be written. A file that existed at its path is unchanged.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The system refused.
    #[error("{}: cannot write: {source}; check that the folder exists, is writable and has \
        room", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The picture does not fit the format.
    #[error("{}: {problem}; {remedy}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The property of the picture that the format cannot hold.
        problem: String,
        /// A way to avoid the problem.
        remedy: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_one_line_without_control_characters() {
        assert_eq!(one_line("a plain message"), "a plain message");
        assert_eq!(one_line("two\r\n lines\n"), "two lines");
        assert_eq!(one_line("red \x1b[31m\ttext"), "red \\u{1b}[31m text");
    }
}
