//! `snell bench`: measurements that anybody can repeat.

mod accelerators;
mod build;
mod clock;
mod coherence;
mod contest;
mod dump;
mod guiding;
mod hidden_surfaces;
mod kinds;
mod peer;
mod plot;
mod rays;
mod read;
mod render;
mod samplers;
mod scenes;
mod variants;

use crate::failure::Failure;
use std::path::Path;
use std::process::ExitCode;

/// What to measure.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Rays per second, by kind of ray, beside those of Embree.
    Rays(rays::Options),
    /// How long acceleration structures take to build, and their memory, beside Embree's.
    Build(build::Options),
    /// All acceleration structures beside each other: time, memory, work, and how they grow with
    /// the scene.
    Accelerators(accelerators::Options),
    /// Rays one by one, in batches and in bundles, beams, pencils and cones beside each other
    Coherence(coherence::Options),
    /// The classical ways to find what is visible, beside each other: z-buffer, scan lines,
    /// painters, area subdivision and others
    HiddenSurfaces(hidden_surfaces::Options),
    /// How fast files are read, and the memory that takes
    Read(read::Options),
    /// Rays per second inside of a render, beside those of the same rays alone.
    Render(render::Options),
    /// What path guiding gains at equal time: errors with and without it.
    Guiding(guiding::Options),
    /// Error against number of samples, for all samplers, on integrands of known value
    Samplers(samplers::Options),
}

/// Runs a benchmark.
pub fn run(command: &Command) -> Result<ExitCode, Failure> {
    match command {
        Command::Rays(options) => rays::run(options),
        Command::Build(options) => build::run(options),
        Command::Accelerators(options) => accelerators::run(options),
        Command::Coherence(options) => coherence::run(options),
        Command::HiddenSurfaces(options) => hidden_surfaces::run(options),
        Command::Read(options) => read::run(options),
        Command::Render(options) => render::run(options),
        Command::Guiding(options) => guiding::run(options),
        Command::Samplers(options) => samplers::run(options),
    }
}

/// Makes a folder for results, unless it is there: before anything is measured, so that no time is
/// lost if it cannot be made.
fn make_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| {
        let folder = folder.display();
        Failure::Other(format!(
            "{folder}: cannot make the folder: {e}; name one where you may write"
        ))
    })
}
