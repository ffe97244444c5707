//! `snell merge`: the picture of a plan, from the results of its workers.

use super::folder::Folder;
use super::results::{self, Gaps};
use super::{shown, word};
use crate::command::render::{self, Merged, again};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::threads;
use snell_persist::{Checkpoint, Found, Receipt};
use snell_render::{Difference, Film, Job, SavedError, Statistics, Underway};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

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
    let is_checkpoint = |path: &PathBuf| !path.is_dir() && Checkpoint::is_at(path);
    if options.folders.iter().all(is_checkpoint) {
        return merge_checkpoints(options);
    }
    if let Some(path) = options.folders.iter().find(|path| !path.exists() && !is_checkpoint(path)) {
        let problem = "there is no folder of a plan and no checkpoint of this name";
        return Err(Failure::Other(format!("{}: {problem}", shown(path))));
    }
    if let Some(path) = options.folders.iter().find(|path| is_checkpoint(path)) {
        let problem = "this is a file; merge either folders of a plan or checkpoints";
        return Err(Failure::Usage(format!("{}: {problem}", shown(path))));
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
    if options.resume && first.plan.first_number.is_none() {
        let problem = "--resume is for animations, and this plan has one picture";
        return Err(Failure::Usage(problem.into()));
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
    if options.resume {
        return Err(Failure::Usage("--resume is for the pictures of a plan".into()));
    }
    let problem = |path: &Path, error: SavedError| match error {
        SavedError::Io(_) => Failure::Other(format!("{}: {error}", shown(path))),
        // Trying again does not help.
        _ => Failure::Usage(format!("{}: {error}", shown(path))),
    };
    let find = |path: &PathBuf| Checkpoint::find(path).map_err(|error| problem(path, error));
    let found: Vec<Found> = options.folders.iter().map(find).collect::<Result<_, _>>()?;
    if !options.quiet {
        let warnings = found.iter().filter_map(|found| found.warning.as_ref());
        warnings.for_each(|warning| eprintln!("warning: {warning}"));
    }
    // The largest number of samples holds the samples of the others.
    let Some(first) = found.iter().rev().max_by_key(|found| found.header.spp) else {
        return Err(Failure::Usage("name a checkpoint".into()));
    };
    let other = |found: &Found| found.header.difference(&first.header.facts);
    if let Some((found, difference)) = found.iter().find_map(|f| other(f).map(|d| (f, d))) {
        return Err(unlike(first, found, &difference));
    }
    let facts = &first.header.facts;
    let receipt = Receipt::parse(&first.header.note)?;
    let scene = options.scene.clone().unwrap_or_else(|| again::named_scene(&receipt, &first.path));
    let (render_options, scene) = again::scene_of(&receipt, &scene)?;
    let default = PathBuf::from(&receipt.scene).with_extension("png");
    let default = PathBuf::from(default.file_name().unwrap_or_default());
    let render_options = with_output(options, render_options, default);
    let film = |job: &Job, _: u32| -> Result<(Film, Statistics), Failure> {
        let mut all: Option<Underway> = None;
        for Found { path, .. } in &found {
            let mut underway = Underway::empty(job.settings());
            let file = File::open(path).map(BufReader::new).map_err(SavedError::Io);
            file.and_then(|mut input| underway.replace_film(job.settings(), &mut input, facts))
                .map_err(|error| problem(path, error))?;
            match &mut all {
                Some(all) => all.merge(underway),
                None => all = Some(underway),
            }
        }
        let all = all.ok_or_else(|| Failure::Usage("name a checkpoint".into()))?;
        if !all.statistics.is_complete && !options.quiet {
            eprintln!(
                "warning: the picture has {} of {} samples; snell render with --checkpoint and \
                 --resume renders the rest",
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

/// The error of checkpoints of different pictures.
fn unlike(a: &Found, b: &Found, difference: &Difference) -> Failure {
    let value = |value: &Option<String>| value.clone().unwrap_or_else(|| "not given".into());
    let [a, b] = [a, b].map(|found| shown(&found.path));
    let Difference { name, then, now } = difference;
    let how = match difference.is_short() {
        true => format!("{name} is {} in the first and {} in the second", value(now), value(then)),
        false => format!("{name} differs"),
    };
    Failure::Usage(format!("{a} and {b} are of different pictures: {how}"))
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
            return Err(unfinished(gaps, round, frame, all[0]));
        }
        job.end_round(&mut underway);
        if !underway.tasks(settings, split).is_empty() {
            return Err(unfinished(gaps, round, frame, all[0]));
        }
    }
    Ok((underway.film, underway.statistics))
}

/// The error of a picture whose results are not all there. Useless files are set aside.
fn unfinished(gaps: Gaps, round: u32, frame: u32, folder: &Folder) -> Failure {
    let plan = &folder.plan;
    let picture = plan.name_of(frame).map_or(String::new(), |name| format!("{name}: "));
    let (tasks, missing) = (gaps.tasks, gaps.missing.clone());
    let problems = gaps.set_aside();
    if let Some(problem) = problems.first() {
        let more = match problems.len() - 1 {
            0 => String::new(),
            more => format!(" (and {more} more such problems)"),
        };
        return Failure::Other(format!("{picture}{problem}{more}"));
    }
    let number = |&task: &u32| plan.number_of(frame, task).to_string();
    let named: Vec<String> = missing.iter().take(NAMED).map(number).collect();
    let more = if missing.len() > NAMED { " and others" } else { "" };
    let of_round = match plan.has_rounds {
        true => format!(" of the round from sample {round}"),
        false => String::new(),
    };
    let (path, command) = (shown(&folder.path), word(&folder.path));
    Failure::Other(match missing.len() {
        0 => format!("{path}: {picture}the last round is not finished; run snell work {command}"),
        count => format!(
            "{path}: {picture}{count} of {tasks} tasks{of_round} have no result ({}{more}); run \
             snell work {command}",
            named.join(", ")
        ),
    })
}
