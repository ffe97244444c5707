//! `snell bench`: reproducible measurements.

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

use crate::exit::ExitCode;
use crate::failure::Failure;
use std::path::Path;

/// A benchmark.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Rays per second, by kind of ray, compared with Embree
    Rays(rays::Options),
    /// Build time and memory of acceleration structures, compared with Embree
    Build(build::Options),
    /// All acceleration structures compared: time, memory, work, and their growth with the scene
    Accelerators(accelerators::Options),
    /// Rays one by one, in batches and in packets, beams, pencils and cones compared
    Coherence(coherence::Options),
    /// The classical visibility algorithms compared: z-buffer, scan lines, painters, area
    /// subdivision and others
    HiddenSurfaces(hidden_surfaces::Options),
    /// Speed and memory of reading files
    Read(read::Options),
    /// Rays per second inside of a render, compared with the same rays alone
    Render(render::Options),
    /// The effect of path guiding at equal time: errors with and without it
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

/// Creates a folder for results, unless it exists. Benchmarks do this before they measure, so that
/// no time is lost if it fails.
fn make_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|e| {
        let folder = folder.display();
        Failure::Other(format!(
            "{folder}: cannot create the folder: {e}; name one where you may write"
        ))
    })
}
