//! `snell man`.

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;

/// Prints the manual page (troff), including all sub-commands.
pub fn run() -> Result<ExitCode, Failure> {
    let failed = |e: std::io::Error| Failure::Other(format!("cannot make the manual page: {e}"));
    let mut out = Vec::new();
    append(&crate::interface(), "snell", &mut out).map_err(failed)?;
    standard_output::write(&out)?;
    Ok(ExitCode::SUCCESS)
}

/// Appends the pages of a command and its sub-commands.
fn append(command: &clap::Command, title: &str, out: &mut Vec<u8>) -> std::io::Result<()> {
    clap_mangen::Man::new(command.clone()).title(title).render(out)?;
    command
        .get_subcommands()
        .try_for_each(|sub| append(sub, &format!("{title}-{}", sub.get_name()), out))
}
