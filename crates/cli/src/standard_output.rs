//! Text on standard output. A reader that stops early (`snell info x | head -3`) is not an error.

use crate::failure::Failure;
use std::io::{ErrorKind, Write};

/// Writes bytes to standard output. A closed pipe counts as success.
pub fn write(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Failure::Other(format!(
            "standard output: cannot write: {e}; check where it is redirected to"
        ))),
        _ => Ok(()),
    }
}
