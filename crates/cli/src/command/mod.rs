//! The sub-commands, one file each.

mod bench;
mod compare;
mod completions;
mod convert;
mod doctor;
mod explain;
mod formats;
mod info;
mod man;
mod plan;
mod render;
mod scenes;
mod verify;
mod view;

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::threads;

/// A sub-command.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Render a scene to a picture.
    Render(Box<render::Options>),
    /// Split a render into tasks for many machines
    Plan(Box<plan::Options>),
    /// Render tasks of a plan, on any machine that sees its folder
    Work(plan::work::Options),
    /// Write the picture of a plan whose tasks are done
    Merge(plan::merge::Options),
    /// Render parts of a picture again and compare bits
    Verify(verify::Options),
    /// Look at a scene in the browser.
    View(view::Options),
    /// Explain the colour of a pixel
    Explain(explain::Options),
    /// Show the contents of a scene file
    Info(info::Options),
    /// Compare two pictures.
    Compare(compare::Options),
    /// Write a scene in another format.
    Convert(convert::Options),
    /// Check a scene for problems
    Doctor(doctor::Options),
    /// Measure the speed of tracing rays and building structures, compared with others
    #[command(subcommand)]
    Bench(bench::Command),
    /// List the built-in scenes.
    Scenes,
    /// List the file formats.
    Formats,
    /// Print a completion script for a shell.
    Completions(completions::Options),
    /// Print the manual page.
    Man,
}

impl Command {
    /// The number of threads of the sub-command; `None` if it needs none.
    fn threads(&self) -> Option<usize> {
        match self {
            Self::Render(options) => Some(options.threads()),
            Self::Plan(options) => Some(options.threads()),
            Self::Work(options) => Some(options.threads()),
            Self::Merge(options) => Some(options.threads()),
            Self::Verify(options) => Some(options.threads()),
            Self::View(options) => Some(options.threads()),
            Self::Explain(options) => Some(options.threads()),
            Self::Scenes | Self::Formats | Self::Completions(_) | Self::Man => None,
            Self::Info(_)
            | Self::Compare(_)
            | Self::Convert(_)
            | Self::Doctor(_)
            | Self::Bench(_) => Some(threads::cores()),
        }
    }
}

/// Runs a sub-command.
pub fn run(command: Command) -> Result<ExitCode, Failure> {
    if let Some(threads) = command.threads() {
        threads::start(threads)?;
    }
    match command {
        Command::Render(options) => render::run(&options),
        Command::Plan(options) => plan::run(&options),
        Command::Work(options) => plan::work::run(&options),
        Command::Merge(options) => plan::merge::run(&options),
        Command::Verify(options) => verify::run(&options),
        Command::View(options) => view::run(&options),
        Command::Explain(options) => explain::run(&options),
        Command::Info(options) => info::run(&options),
        Command::Compare(options) => compare::run(&options),
        Command::Convert(options) => convert::run(&options),
        Command::Doctor(options) => doctor::run(&options),
        Command::Bench(command) => bench::run(&command),
        Command::Scenes => scenes::run(),
        Command::Formats => formats::run(),
        Command::Completions(options) => completions::run(&options),
        Command::Man => man::run(),
    }
}

/// The options of a sub-command as they were given.
fn matches(name: &str) -> Result<clap::ArgMatches, Failure> {
    crate::given()
        .and_then(|given| given.subcommand_matches(name))
        .cloned()
        .ok_or_else(|| Failure::Other(format!("the options of snell {name} cannot be read again")))
}
