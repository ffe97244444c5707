//! The `snell` command: renders, inspects and compares from the shell. The libraries do the work;
//! this crate has options, messages, files and exit codes.
//!
//! It is a library, because two programs run it: `main.rs`, and the Python package, which has the
//! command `snell` too.
//!
//! Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted (with the rendered part saved).

#![forbid(unsafe_code)]

#[macro_use]
mod messages;

mod command;
mod exit;
mod failure;
mod interrupt;
mod progress;
mod resources;
mod scene_source;
mod spectrum_file;
mod standard_output;
mod threads;
mod usd;

use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser};
pub use exit::ExitCode;
use failure::Failure;
use std::ffi::OsString;
use std::io::Write;
use std::sync::OnceLock;
pub use usd::prefer_interpreter;

/// A ray caster and physically based renderer.
///
/// Without a scene, `snell render` draws the built-in Cornell box.
#[derive(Debug, Parser)]
#[command(name = "snell", version, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: command::Command,
}

/// The command line of this process.
static GIVEN: OnceLock<ArgMatches> = OnceLock::new();

/// Runs the command with its arguments, of which the first is the name of the program. Threads,
/// signals and standard streams are the process's, so a process can do this once.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    // The last line of defence: a fault in the program ends with an error message.
    let arguments = arguments.into_iter().collect::<Vec<_>>();
    let outcome = std::panic::catch_unwind(|| match parse(arguments) {
        Ok(command) => interrupt::watch().and_then(|()| command::run(command)),
        Err(code) => Ok(code),
    });
    let code = match outcome {
        Ok(Ok(code)) => code,
        Ok(Err(failure)) => failure.report(),
        Err(_) => {
            eprintln!(
                "error: internal fault (see above); please report it with the scene and the \
                    command line"
            );
            ExitCode::from(1)
        }
    };
    // Only a program written in Rust does this by itself when it ends.
    let _ = std::io::stdout().flush();
    code
}

/// The sub-command and its options. If there is nothing to run, what the user must know is printed,
/// and the error is the exit code.
fn parse(arguments: Vec<OsString>) -> Result<command::Command, ExitCode> {
    let parsed = Cli::command().try_get_matches_from(arguments).and_then(|given| {
        let cli = Cli::from_arg_matches(&given).map_err(|e| e.format(&mut Cli::command()))?;
        Ok((cli, given))
    });
    let (cli, given) = parsed.map_err(|error| {
        // A closed pipe is no reason for another message.
        let _ = error.print();
        ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2))
    })?;
    GIVEN.set(given).map_err(|_| {
        let remedy = "start another for the next one";
        Failure::Other(format!("this process has run a command already; {remedy}")).report()
    })?;
    Ok(cli.command)
}

/// The command line of this process; `None` before it is parsed.
fn given() -> Option<&'static ArgMatches> {
    GIVEN.get()
}

/// The whole command-line interface, for completions and the manual page.
fn interface() -> clap::Command {
    Cli::command()
}
