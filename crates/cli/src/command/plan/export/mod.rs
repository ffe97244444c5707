//! `snell plan export`: a plan as a job of schedulers that exist.

mod kubernetes;
mod openjd;
mod slurm;

use super::folder::Folder;
use super::{FolderOption, shown};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;
use snell_formats::atomic;
use std::path::{Path, PathBuf};

/// Default number of workers of schedulers that do not number tasks.
const WORKERS: u32 = 8;

/// Options of `snell plan export`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// What runs the plan
    scheduler: Scheduler,
    #[command(flatten)]
    folder: FolderOption,
    /// File to write. Default: standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Picture that the job writes at the end. Default: beside the folder of the plan
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Number of workers, where tasks are not numbered
    #[arg(
        long,
        value_name = "N",
        default_value_t = WORKERS,
        value_parser = clap::value_parser!(u32).range(1..),
    )]
    workers: u32,
    /// Container image with `snell`, for Kubernetes
    #[arg(long, value_name = "NAME", default_value = "snell")]
    image: String,
    /// Persistent volume claim with the folder of the plan, for Kubernetes
    #[arg(long, value_name = "NAME", default_value = "renders")]
    claim: String,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Scheduler {
    /// A job template of Open Job Description, for AWS Deadline Cloud and others
    Openjd,
    /// A script for sbatch
    Slurm,
    /// An Indexed Job
    Kubernetes,
}

/// What a job is made of.
struct Job<'a> {
    folder: &'a Folder,
    /// The folder of the plan, from the root of the file system on.
    plan: String,
    /// The picture, from the root of the file system on.
    picture: String,
    /// The folder of the file that is written.
    base: PathBuf,
    /// A name of letters, digits and dashes.
    name: String,
    workers: u32,
    image: &'a str,
    claim: &'a str,
}

impl Job<'_> {
    /// The number of tasks, if they are fixed.
    fn tasks(&self) -> Option<u64> {
        let plan = &self.folder.plan;
        (!plan.has_rounds).then(|| u64::from(plan.tasks) * u64::from(plan.frames))
    }
}

/// Writes a job.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let folder = Folder::open(&options.folder.folder)?;
    let path = folder.path.canonicalize().unwrap_or_else(|_| folder.path.clone());
    let beside = path.parent().unwrap_or(Path::new("/")).join(&folder.plan.picture);
    let picture = options.picture.clone().unwrap_or(beside);
    let picture = std::path::absolute(&picture).unwrap_or(picture);
    let base = match options.output.as_deref().and_then(Path::parent) {
        Some(folder) if folder != Path::new("") => folder.canonicalize(),
        _ => std::env::current_dir(),
    };
    let job = Job {
        base: base.unwrap_or_default(),
        plan: text(&path)?,
        picture: text(&picture)?,
        name: name(&folder.plan.picture),
        workers: options.workers,
        image: &options.image,
        claim: &options.claim,
        folder: &folder,
    };
    let text = match options.scheduler {
        Scheduler::Openjd => openjd::template(&job),
        Scheduler::Slurm => slurm::script(&job),
        Scheduler::Kubernetes => kubernetes::manifest(&job),
    };
    match &options.output {
        Some(path) => atomic::write(path, text.as_bytes())?,
        None => standard_output::write(text.as_bytes())?,
    }
    Ok(ExitCode::SUCCESS)
}

/// A path as text that may be anywhere in a job, also in a line of comment.
fn text(path: &Path) -> Result<String, Failure> {
    let breaks = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
    let problem = match path.to_str() {
        Some(text) if !text.contains(breaks) => return Ok(text.into()),
        Some(_) => "this name has a line break or a control character, which a job cannot hold",
        None => "this name is not text, which a job needs",
    };
    Err(Failure::Usage(format!("{}: {problem}; rename it", shown(path))))
}

/// A name that every scheduler takes, from that of a file.
fn name(file: &str) -> String {
    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let name: String = stem.chars().map(plain).take(40).collect();
    let name = name.trim_matches('-');
    if name.is_empty() { "snell".into() } else { format!("snell-{name}") }
}

/// A text in quotes, as JSON and YAML have it.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}
