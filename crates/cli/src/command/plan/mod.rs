//! `snell plan`, `snell work` and `snell merge`: a render that many machines share through a
//! folder.

mod export;
pub mod folder;
mod leases;
pub mod merge;
mod results;
mod status;
pub mod work;

use crate::command::matches;
use crate::command::render::{self, receipt};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::scene_source;
use clap::parser::ValueSource;
use folder::{Folder, Plan};
use snell_formats::error::one_line;
use snell_math::simd::Level;
use snell_render::{Split, Underway};
use std::path::{Path, PathBuf};

/// The largest number of tasks of a picture, unless the options ask for more.
const MOST_TASKS: u32 = 256;

/// Options of `snell plan`.
#[derive(Debug, clap::Args)]
#[group(skip)]
#[command(
    args_conflicts_with_subcommands = true,
    override_usage = USAGE,
    after_help = EXAMPLES,
    mut_arg("output", |output| output.value_name("FOLDER").help(FOLDER).help_heading(PLAN)),
    mut_args(|arg| match REFUSED.contains(&arg.get_id().as_str()) {
        true => arg.hide(true),
        false => arg,
    }),
)]
pub struct Options {
    #[command(subcommand)]
    action: Option<Action>,
    /// What is rendered: the options of `snell render`, but `--output` is the folder of the plan
    #[command(flatten)]
    render: render::Options,
    /// Tiles of 16x16 pixels in a task. Default: so many that a picture has at most 256 tasks
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..),
        help_heading = PLAN,
    )]
    tiles_per_task: Option<u32>,
    /// Samples per pixel in a task, a multiple of 16, for few pixels with very many samples.
    /// Default: all
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..),
        help_heading = PLAN,
    )]
    samples_per_task: Option<u32>,
}

/// The heading of the options that only a plan has.
const PLAN: &str = "The plan";

/// What `--output` is.
const FOLDER: &str = "New folder for the plan, which all machines see. Required";

/// Options of `snell render` that make no sense for a plan.
const REFUSED: [&str; 6] =
    ["time", "checkpoint", "checkpoint_interval", "preview", "resume", "stats"];

/// The three ways to call the sub-command.
const USAGE: &str = "snell plan [OPTIONS] [SCENE] --output <FOLDER>
       snell plan status <FOLDER>
       snell plan export <SCHEDULER> <FOLDER>";

/// Examples below the help.
const EXAMPLES: &str = "Examples:
  snell plan room.gltf --spp 4096 -o plan    on one machine, in a folder that all machines see
  snell work plan                            on every machine, as often as you like
  snell plan status plan                     how far it has got
  snell merge plan -o room.exr               when all is done, on any machine";

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Show how much of a plan is done
    Status(status::Options),
    /// Write a plan as a job of a scheduler
    Export(export::Options),
}

/// Makes a plan, or tells of one.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    match &options.action {
        Some(Action::Status(options)) => status::run(options),
        Some(Action::Export(options)) => export::run(options),
        None => make(options),
    }
}

impl Options {
    /// Number of threads for reading the scene.
    pub fn threads(&self) -> usize {
        self.render.threads()
    }
}

fn usage(problem: &str) -> Failure {
    Failure::Usage(problem.into())
}

fn make(options: &Options) -> Result<ExitCode, Failure> {
    let render = &options.render.clone().recording_sources();
    let path = plan_folder(render)?;
    if let Some(samples) = options.samples_per_task
        && !samples.is_multiple_of(Split::SAMPLES)
    {
        return Err(Failure::Usage(format!(
            "--samples-per-task {samples}: give a multiple of {}, or whole tasks cannot be added \
             in any order",
            Split::SAMPLES
        )));
    }
    let simd = Level::from_env().map_err(Failure::Usage)?;
    let mut scene = render::load(render)?;
    let stem = scene_source::stem(&render.scene, &scene);
    let mut arguments = given_arguments()?;
    bake(render, &mut scene, &mut arguments)?;
    let bundle = scene.clone();
    let stage = render::stage::Stage::new(scene, &baked_options(render))?;
    let frames = render::frames::all(render, &stage)?;
    let settings = render.settings(&stage.scene, &stage.camera(render)?, simd)?;
    let film = Underway::empty(&settings);
    let tiles = film.film.tiles.len() as u32;
    let split = Split {
        tiles: options.tiles_per_task.unwrap_or(tiles.div_ceil(MOST_TASKS)).max(1),
        samples: options.samples_per_task,
    };
    let tasks = film.tasks(&settings, split).len() as u32;
    let warnings: Vec<String> = bundle.warnings.iter().map(crate::messages::counted).collect();
    if !render.quiet {
        warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let matches = matches("plan")?;
    let plan = Plan {
        scene: render.scene.display().to_string(),
        arguments,
        picture: stem.to_string_lossy().into_owned() + ".png",
        warnings,
        frames: frames.len() as u32,
        first_number: frames.first().map(|frame| frame.number).filter(|_| render.has_frames()),
        size: settings.size,
        tiles,
        spp: settings.spp,
        has_rounds: settings.noise.is_some(),
        split,
        tasks,
        receipt: receipt::of_options(render, &matches),
        scene_name: bundle.name.clone(),
        ..Plan::default()
    };
    let folder = Folder::create(path, &bundle, plan)?;
    if !render.quiet {
        say(&folder);
    }
    Ok(ExitCode::SUCCESS)
}

/// The folder of the new plan, if the options make sense for a plan.
fn plan_folder(render: &render::Options) -> Result<&Path, Failure> {
    let Some(path) = render.output.as_deref() else {
        return Err(usage("name the folder of the plan: snell plan SCENE --output FOLDER"));
    };
    if render.request.time.is_some() {
        return Err(usage(
            "--time: how much machines render in a given time cannot be reproduced; give --spp, or \
             --noise with an upper limit by --spp",
        ));
    }
    let given = matches("plan")?;
    let is_given = |id: &&str| given.value_source(id) == Some(ValueSource::CommandLine);
    let refused = REFUSED.into_iter().find(is_given).or(render.tev().map(|_| "display tev"));
    if let Some(option) = refused {
        return Err(Failure::Usage(format!(
            "--{} is not an option of a plan: what is done is in its folder, and snell merge \
             writes the picture",
            option.replace('_', "-")
        )));
    }
    if Folder::is_at(path) {
        let (shown, path) = (shown(path), word(path));
        return Err(Failure::Usage(format!(
            "{shown}: there is a plan in this folder; work on it with snell work {path}, or give \
             another folder"
        )));
    }
    if path.symlink_metadata().is_ok() && !is_empty_folder(path) {
        let path = path.display();
        return Err(Failure::Usage(format!(
            "{path}: this is not an empty folder; give a new one for the plan"
        )));
    }
    Ok(path)
}

fn is_empty_folder(path: &Path) -> bool {
    std::fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none())
}

/// The options of `snell render` that workers need: what is in the bundle already is left out.
fn given_arguments() -> Result<Vec<String>, Failure> {
    let matches = matches("plan")?;
    let in_bundle = ["variant", "scene_of_file", "confine", "define", "environment"];
    let neutral = receipt::NEUTRAL.iter().chain(&in_bundle).copied().collect::<Vec<_>>();
    Ok(receipt::arguments(&matches, &neutral))
}

/// Puts into the scene what its options read from files, so that workers need nothing else. What
/// remains to be done with the scene is added to the arguments.
fn bake(
    render: &render::Options,
    scene: &mut snell_scene::Scene,
    arguments: &mut Vec<String>,
) -> Result<(), Failure> {
    let is_kept =
        |definition: &&String| !scene_source::are_parameters(scene, &[definition.to_string()]);
    for definition in render.define.iter().filter(is_kept) {
        arguments.push(format!("--define={}", crate::spectrum_file::resolve(definition)?));
    }
    match render.environment.as_deref().and_then(std::ffi::OsStr::to_str) {
        // Its absence is no part of a scene: scenes without light get some.
        Some("none") => arguments.push("--environment=none".into()),
        _ => render.apply_environment(scene)?,
    }
    Ok(())
}

/// The options with which a baked scene is prepared.
fn baked_options(render: &render::Options) -> render::Options {
    let environment = render.environment.clone().filter(|name| name == "none");
    let define = render.define.clone();
    render::Options { environment, define, ..render.clone() }
}

fn say(folder: &Folder) {
    let (plan, path) = (&folder.plan, word(&folder.path));
    let [width, height] = plan.size;
    let pictures = match plan.frames {
        1 => "a picture".to_string(),
        count => format!("{count} pictures"),
    };
    let tasks = u64::from(plan.tasks) * u64::from(plan.frames);
    let tasks = if tasks == 1 { "1 task".into() } else { format!("{tasks} tasks") };
    let rounds = if plan.has_rounds { " in the first round" } else { "" };
    eprintln!("{path}: {pictures} of {width}x{height} pixels, {tasks}{rounds}");
    eprintln!(
        "Next: `snell work {path}` on every machine that sees the folder, then `snell merge {path}`"
    );
}

/// A path in a message.
fn shown(path: &Path) -> String {
    one_line(&path.display().to_string()).into_owned()
}

/// A path as one word of a command that is to be copied.
fn word(path: &Path) -> String {
    let text = shown(path);
    // It is no option.
    let text = if text.starts_with('-') { format!("./{text}") } else { text };
    let is_plain = |c: char| c.is_alphanumeric() || "/\\._-:+@%,=".contains(c);
    match (text.chars().all(is_plain) && !text.is_empty(), cfg!(windows)) {
        (true, _) => text,
        (false, true) => format!("\"{text}\""),
        (false, false) => shell(&text),
    }
}

/// A text as one word of a Unix shell.
fn shell(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// The path of a folder on the command line.
#[derive(Clone, Debug, clap::Args)]
pub struct FolderOption {
    /// Folder of a plan that `snell plan` has made
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_path_in_a_command_is_one_word_and_no_option() {
        let word = |path: &str| word(Path::new(path));
        assert_eq!(word("a/b-1.x"), "a/b-1.x");
        assert_eq!(word("-eq"), "./-eq");
        assert_eq!(word("my plan"), "'my plan'");
        assert_eq!(word("it's $HOME"), r"'it'\''s $HOME'");
    }
}
