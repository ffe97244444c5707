//! `snell completions`.

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;

/// Options of `snell completions`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The shell.
    shell: clap_complete::Shell,
}

/// Prints the script.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut crate::interface(), "snell", &mut script);
    standard_output::write(&script)?;
    Ok(ExitCode::SUCCESS)
}
