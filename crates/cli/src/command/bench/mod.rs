//! `snell bench`: measurements that anybody can repeat.

mod clock;
mod contest;
mod kinds;
mod peer;
mod rays;
mod scenes;
mod variants;

use crate::failure::Failure;
use std::process::ExitCode;

/// What to measure.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Rays per second, by kind of ray, beside those of Embree.
    Rays(rays::Options),
}

/// Runs a benchmark.
pub fn run(command: &Command) -> Result<ExitCode, Failure> {
    match command {
        Command::Rays(options) => rays::run(options),
    }
}
