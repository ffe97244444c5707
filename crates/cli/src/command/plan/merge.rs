//! `snell merge`: the picture of a plan, from the results of its workers.

use super::folder::Folder;
use super::results::{self, Gaps};
use crate::command::render::{self, Merged};
use crate::failure::Failure;
use crate::threads;
use snell_render::{Film, Job, Statistics, Underway};
use std::path::PathBuf;
use std::process::ExitCode;

/// The number of tasks that a message names.
const NAMED: usize = 8;

/// Options of `snell merge`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Folder of a plan that `snell plan` has made; several if they are copies of one whose results
    /// were collected apart
    #[arg(value_name = "FOLDER", required = true)]
    folders: Vec<PathBuf>,
    /// Picture to write; the extension decides the format, `-` is standard output (PNG). Default:
    /// the scene's name with .png
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write statistics as JSON
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Write the pictures of an animation that are missing, and keep the others
    #[arg(long)]
    resume: bool,
    /// Threads. Default: one per core
    #[arg(short, long, value_name = "N", value_parser = threads::number())]
    threads: Option<u32>,
    /// Print nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

impl Options {
    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.threads.map_or_else(threads::cores, |n| n as usize)
    }
}

/// Puts the picture together.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let folders: Vec<Folder> =
        options.folders.iter().map(|path| Folder::open(path)).collect::<Result<_, _>>()?;
    let Some(first) = folders.first() else {
        return Err(Failure::Usage("name the folder of a plan".into()));
    };
    if let Some(other) = folders.iter().find(|f| f.plan.fingerprint != first.plan.fingerprint) {
        return Err(Failure::Usage(format!(
            "{} and {} are not the same plan, so their results belong to different pictures",
            first.path.display(),
            other.path.display()
        )));
    }
    let output = options.output.clone().unwrap_or_else(|| PathBuf::from(&first.plan.picture));
    let render_options = render::Options {
        output: Some(output),
        stats: options.stats.clone(),
        resume: options.resume,
        threads: options.threads,
        quiet: options.quiet,
        ..first.render_options()?
    };
    let film = |job: &Job, frame: u32| film(job, frame, &folders);
    let receipt = first.plan.receipt.clone();
    render::finish(&render_options, first.scene()?, &Merged { film: &film, receipt })
}

/// The film of a picture, from the results in the folders.
fn film(job: &Job, frame: u32, folders: &[Folder]) -> Result<(Film, Statistics), Failure> {
    let settings = job.settings();
    let mut underway = Underway::empty(settings);
    for folder in folders.iter().filter(|folder| folder.plan.has_rounds) {
        results::catch_up(&mut underway, settings, folder, frame)?;
    }
    let all: Vec<&Folder> = folders.iter().collect();
    let split = all[0].plan.split;
    let round = underway.samples();
    if !underway.tasks(settings, split).is_empty() {
        let gaps = results::add_round(&mut underway, settings, &all, frame);
        if !gaps.is_empty() {
            return Err(unfinished(&gaps, round, frame, all[0]));
        }
        job.end_round(&mut underway);
        if !underway.tasks(settings, split).is_empty() {
            return Err(unfinished(&gaps, round, frame, all[0]));
        }
    }
    Ok((underway.film, underway.statistics))
}

/// The error of a picture whose results are not all there.
fn unfinished(gaps: &Gaps, round: u32, frame: u32, folder: &Folder) -> Failure {
    let picture = match folder.plan.frames {
        1 => String::new(),
        _ => format!("picture {}: ", frame + 1),
    };
    let path = folder.path.display();
    if let Some(problem) = gaps.problems.first() {
        let more = match gaps.problems.len() - 1 {
            0 => String::new(),
            more => format!(" (and {more} more of such problems)"),
        };
        return Failure::Other(format!("{picture}{problem}{more}"));
    }
    let named: Vec<String> = gaps.missing.iter().take(NAMED).map(u32::to_string).collect();
    let more = if gaps.missing.len() > NAMED { " and others" } else { "" };
    let of_round = match folder.plan.has_rounds {
        true => format!(" of the round from sample {round}"),
        false => String::new(),
    };
    Failure::Other(match gaps.missing.len() {
        0 => format!("{path}: {picture}the last round is not ended; run snell work {path}"),
        count => format!(
            "{path}: {picture}{count} of {} tasks{of_round} have no result ({}{more}); run snell work \
             {path}",
            gaps.tasks,
            named.join(", ")
        ),
    })
}
