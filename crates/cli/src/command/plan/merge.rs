//! `snell merge`: the picture of a plan, from the results of its workers.

use super::folder::Folder;
use super::results::{self, Gaps};
use crate::command::render::receipt::Receipt;
use crate::command::render::{self, Merged, again};
use crate::failure::Failure;
use crate::threads;
use snell_formats::error::one_line;
use snell_render::{Film, Header, Job, SavedError, Statistics, Underway};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The number of tasks that a message names.
const NAMED: usize = 8;

/// Options of `snell merge`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Folder of a plan that `snell plan` has made; several if they are copies of one whose results
    /// were collected apart. Or checkpoints of one render: the picture has all samples of all
    #[arg(value_name = "FOLDER|CHECKPOINT", required = true)]
    folders: Vec<PathBuf>,
    /// Picture to write; the extension decides the format, `-` is standard output (PNG). Default:
    /// the scene's name with .png
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Scene of the checkpoints. Default: the file that they name, in their folder or the current
    /// one
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
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
    if options.folders.iter().all(|path| path.is_file()) {
        return merge_checkpoints(options);
    }
    if options.scene.is_some() {
        let problem = "--scene is for checkpoints; a plan has its scene in its folder";
        return Err(Failure::Usage(problem.into()));
    }
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
    let default = PathBuf::from(&first.plan.picture);
    let render_options = with_output(options, first.render_options()?, default);
    let film = |job: &Job, frame: u32| film(job, frame, &folders);
    let receipt = first.plan.receipt.clone();
    render::finish(&render_options, first.scene()?, &Merged { film: &film, receipt })
}

/// The options of the render with those of the merge.
fn with_output(
    options: &Options,
    render_options: render::Options,
    default: PathBuf,
) -> render::Options {
    render::Options {
        output: Some(options.output.clone().unwrap_or(default)),
        stats: options.stats.clone(),
        resume: options.resume,
        threads: options.threads,
        quiet: options.quiet,
        ..render_options
    }
}

/// Writes the picture of the samples of all checkpoints, which are of one render.
fn merge_checkpoints(options: &Options) -> Result<ExitCode, Failure> {
    let shown = |path: &Path| one_line(&path.display().to_string()).into_owned();
    let problem = |path: &Path, error: SavedError| match error {
        SavedError::Io(_) | SavedError::Damaged(_) => {
            Failure::Other(format!("{}: {error}", shown(path)))
        }
        _ => Failure::Usage(format!("{}: {error}", shown(path))),
    };
    let open = |path: &PathBuf| File::open(path).map(BufReader::new).map_err(SavedError::Io);
    let headers: Vec<Header> = options
        .folders
        .iter()
        .map(|path| {
            let header = open(path).and_then(|mut input| Header::read(&mut input));
            header.map_err(|error| problem(path, error))
        })
        .collect::<Result<_, _>>()?;
    // The largest number of samples holds the samples of the others.
    let samples = |&i: &usize| (headers[i].spp, std::cmp::Reverse(i));
    let most = (0..headers.len()).max_by_key(samples).unwrap_or_default();
    let (first, facts) = (&options.folders[most], &headers[most].facts);
    let receipt = Receipt::parse(&headers[most].note)?;
    let scene = options.scene.clone().unwrap_or_else(|| again::named_scene(&receipt, first));
    let (render_options, scene) = again::scene_of(&receipt, &scene)?;
    let default = PathBuf::from(&receipt.scene).with_extension("png");
    let default = PathBuf::from(default.file_name().unwrap_or_default());
    let render_options = with_output(options, render_options, default);
    let film = |job: &Job, _: u32| -> Result<(Film, Statistics), Failure> {
        let mut all: Option<Underway> = None;
        for path in &options.folders {
            let mut underway = Underway::empty(job.settings());
            open(path)
                .and_then(|mut input| underway.replace_film(job.settings(), &mut input, facts))
                .map_err(|error| problem(path, error))?;
            match &mut all {
                Some(all) => all.merge(underway),
                None => all = Some(underway),
            }
        }
        let all = all.ok_or_else(|| Failure::Usage("name a checkpoint".into()))?;
        if !all.statistics.is_complete && !options.quiet {
            eprintln!(
                "warning: the picture has {} of {} samples; --resume goes on with it",
                all.film.least_samples(),
                job.settings().spp
            );
        }
        Ok((all.film, all.statistics))
    };
    let merged = Merged { film: &film, receipt };
    match render_options.has_frames() {
        // A checkpoint is that of one of the frames.
        true => again::one(&render_options, scene, &merged).map(|()| ExitCode::SUCCESS),
        false => render::finish(&render_options, scene, &merged),
    }
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
            "{path}: {picture}{count} of {} tasks{of_round} have no result ({}{more}); run snell \
             work {path}",
            gaps.tasks,
            named.join(", ")
        ),
    })
}
