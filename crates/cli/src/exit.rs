//! The exit code of a command. That of the standard library is no number, and Python needs one.

/// Exit code of a command: 0 success, 1 failure, 2 wrong usage, 130 interrupted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExitCode(u8);

impl ExitCode {
    /// The command did what it was asked to do.
    pub const SUCCESS: Self = Self(0);

    /// The number that the process returns.
    pub fn number(self) -> u8 {
        self.0
    }
}

impl From<u8> for ExitCode {
    fn from(number: u8) -> Self {
        Self(number)
    }
}
