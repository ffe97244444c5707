//! The `snell` command: renders, inspects and compares from the shell. The libraries do the work;
//! this crate has options, messages, files and exit codes.
//!
//! Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted (with the rendered part saved).

#![forbid(unsafe_code)]

#[macro_use]
mod messages;

mod command;
mod failure;
mod interrupt;
mod progress;
mod resources;
mod scene_source;
mod spectrum_file;
mod standard_output;
mod threads;
mod usd;

use clap::{CommandFactory, Parser};
use std::process::ExitCode;

/// A ray caster and physically based renderer.
///
/// Without a scene, `snell render` draws the built-in Cornell box.
#[derive(Debug, Parser)]
#[command(name = "snell", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: command::Command,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    // The last line of defence: a fault in the program ends with an error message.
    let outcome =
        std::panic::catch_unwind(|| interrupt::watch().and_then(|()| command::run(cli.command)));
    match outcome {
        Ok(Ok(code)) => code,
        Ok(Err(failure)) => failure.report(),
        Err(_) => {
            eprintln!(
                "error: internal fault (see above); please report it with the scene and the \
                    command line"
            );
            ExitCode::from(1)
        }
    }
}

/// The whole command-line interface, for completions and the manual page.
fn interface() -> clap::Command {
    Cli::command()
}
