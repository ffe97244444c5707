//! The program `snell`; [`snell_cli`] does the work.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(snell_cli::run(std::env::args_os()).number())
}
