//! `snell completions`.

use crate::failure::Failure;
use std::process::ExitCode;

/// Which shell.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The shell.
    shell: clap_complete::Shell,
}

/// Prints the script.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    clap_complete::generate(options.shell, &mut crate::interface(), "snell", &mut std::io::stdout());
    Ok(ExitCode::SUCCESS)
}
