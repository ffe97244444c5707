//! `snell man`.

use crate::failure::Failure;
use crate::standard_output;
use std::process::ExitCode;

/// Prints the manual page (troff), all sub-commands included.
pub fn run() -> Result<ExitCode, Failure> {
    let failed = |e: std::io::Error| Failure::Other(format!("cannot make the manual page: {e}"));
    let mut out = Vec::new();
    let interface = crate::interface();
    clap_mangen::Man::new(interface.clone()).render(&mut out).map_err(failed)?;
    for sub in interface.get_subcommands() {
        let title = format!("snell-{}", sub.get_name());
        clap_mangen::Man::new(sub.clone()).title(title).render(&mut out).map_err(failed)?;
    }
    standard_output::write(&out)?;
    Ok(ExitCode::SUCCESS)
}
