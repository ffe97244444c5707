//! `snell plan status`: how much of a plan is done.

use super::FolderOption;
use super::folder::Folder;
use super::leases::worker_of;
use super::results;
use crate::command::render::stage::Stage;
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;
use serde_json::json;
use snell_formats::error::one_line;
use snell_formats::image::{self, WriteOptions};
use snell_math::simd::Level;
use snell_render::Underway;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// The number of pictures that are listed one by one.
const LISTED: usize = 20;

/// Options of `snell plan status`.
#[derive(Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    folder: FolderOption,
    /// Write a picture of what is done; the rest is black
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// The picture of an animation to write, by the number in the name of its file. Default: the
    /// first
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    frame: Option<i64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// What is done of one picture.
struct Done {
    frame: u32,
    is_finished: bool,
    /// The first sample of the current round.
    round: u32,
    results: usize,
    /// The names of results that have no content.
    empty: Vec<String>,
    /// The tasks that are being rendered, with their workers.
    leases: BTreeMap<String, String>,
    /// The results that differ from the first of their task.
    differing: Vec<String>,
}

/// Shows the state of a plan.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let folder = Folder::open(&options.folder.folder)?;
    let all: Vec<Done> = (0..folder.plan.frames).map(|frame| done(&folder, frame)).collect();
    let text = match options.json {
        true => format!("{:#}\n", as_value(&folder, &all)),
        false => text(&folder, &all),
    };
    standard_output::write(text.as_bytes())?;
    if let Some(path) = &options.picture {
        write_picture(path, &folder, frame_of(options.frame, &folder)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn done(folder: &Folder, frame: u32) -> Done {
    let Some(round) = folder.newest_round(frame) else {
        return Done {
            frame,
            is_finished: false,
            round: 0,
            results: 0,
            empty: Vec::new(),
            leases: BTreeMap::new(),
            differing: Vec::new(),
        };
    };
    let names = round.names();
    let is_empty = |name: &str| {
        round.path.join(name).metadata().is_ok_and(|known| known.is_file() && known.len() == 0)
    };
    let is_result = |name: &&String| name.ends_with(".result");
    let (empty, whole): (Vec<&String>, Vec<&String>) =
        names.iter().filter(is_result).partition(|name| is_empty(name));
    let results: BTreeSet<&str> =
        whole.iter().filter_map(|name| name.strip_suffix(".result")).collect();
    let leased = names.iter().filter_map(|name| name.strip_suffix(".lease"));
    let leases = leased.filter(|task| !results.contains(task)).map(|task| {
        let worker = worker_of(&round.path.join(format!("{task}.lease")));
        let worker = worker.unwrap_or_else(|| "unknown".into());
        (task.to_string(), one_line(&worker).into_owned())
    });
    Done {
        frame,
        is_finished: match folder.plan.has_rounds {
            true => folder.is_finished(frame),
            false => results.len() >= folder.plan.tasks as usize,
        },
        round: round.start,
        results: results.len(),
        empty: empty.into_iter().cloned().collect(),
        leases: leases.collect(),
        differing: names.iter().filter(|name| name.ends_with(".other")).cloned().collect(),
    }
}

fn as_value(folder: &Folder, all: &[Done]) -> serde_json::Value {
    let plan = &folder.plan;
    let picture = |done: &Done| {
        json!({
            "picture": plan.first_number.map(|first| first + i64::from(done.frame)),
            "finished": done.is_finished,
            "from_sample": done.round,
            "results": done.results,
            "empty": done.empty,
            "being_rendered": done.leases,
            "differing": done.differing,
        })
    };
    json!({
        "scene": plan.scene,
        "version": plan.program,
        "width": plan.size[0],
        "height": plan.size[1],
        "spp": plan.spp,
        "pictures": all.iter().map(picture).collect::<Vec<_>>(),
        "tasks_of_a_picture": plan.tasks,
        "finished": all.iter().filter(|done| done.is_finished).count(),
    })
}

fn text(folder: &Folder, all: &[Done]) -> String {
    let plan = &folder.plan;
    let [width, height] = plan.size;
    let finished = all.iter().filter(|done| done.is_finished).count();
    let mut text = format!(
        "{}: {width}x{height} pixels, {} samples in each, {finished} of {} pictures finished\n",
        one_line(&plan.scene),
        plan.spp,
        all.len()
    );
    // Those on their way come first, because they are what is looked for.
    let mut shown: Vec<&Done> = all.iter().collect();
    shown.sort_by_key(|done| (done.is_finished, done.results == 0, done.frame));
    for done in shown.iter().take(LISTED) {
        let tasks = plan.tasks as usize;
        let state = match (done.is_finished, plan.has_rounds) {
            (true, _) => "finished".to_string(),
            (false, true) => {
                format!("round from sample {}: {} results", done.round, done.results)
            }
            (false, false) => format!(
                "{} of {tasks} tasks, {} %",
                done.results,
                100 * done.results / tasks.max(1)
            ),
        };
        let count = done.leases.len();
        let leased = if count > 0 { format!(", {count} being rendered") } else { String::new() };
        let name = plan.name_of(done.frame).unwrap_or_else(|| "the picture".into());
        text += &format!("  {name}: {state}{leased}\n");
        for name in &done.differing {
            text += &format!("    two results differ: {name}\n");
        }
        for name in &done.empty {
            text += &format!("    empty, so remove it and run snell work again: {name}\n");
        }
    }
    if all.len() > LISTED {
        text += &format!("  and {} more pictures\n", all.len() - LISTED);
    }
    let mut workers: BTreeMap<&str, usize> = BTreeMap::new();
    for worker in all.iter().flat_map(|done| done.leases.values()) {
        *workers.entry(worker).or_default() += 1;
    }
    for (worker, tasks) in workers {
        text += &format!("  worker {worker}: {tasks} task{}\n", if tasks == 1 { "" } else { "s" });
    }
    text
}

/// The picture whose file has this number.
fn frame_of(number: Option<i64>, folder: &Folder) -> Result<u32, Failure> {
    let Some(number) = number else { return Ok(0) };
    let plan = &folder.plan;
    let first = plan.first_number.unwrap_or_default();
    let frame = number.checked_sub(first).and_then(|frame| u32::try_from(frame).ok());
    frame.filter(|&frame| frame < plan.frames).ok_or_else(|| {
        let last = first + i64::from(plan.frames) - 1;
        Failure::Usage(format!("--frame {number}: the plan has the pictures {first} to {last}"))
    })
}

/// Writes a picture of what is done of a picture.
fn write_picture(path: &std::path::Path, folder: &Folder, frame: u32) -> Result<(), Failure> {
    let options = folder.render_options()?;
    let stage = Stage::new(folder.scene()?, &options)?;
    let simd = Level::from_env().map_err(Failure::Usage)?;
    let settings = options.settings(&stage.scene, &stage.camera(&options)?, simd)?;
    let mut underway = Underway::empty(&settings);
    results::catch_up(&mut underway, &settings, folder, frame)?;
    let _ = results::add_round(&mut underway, &settings, &[folder], frame);
    let picture = underway.film.image();
    let display = image::Display {
        exposure: options.exposure(&stage.scene),
        tonemap: options.tonemap(&stage.scene)?,
        ..image::Display::default()
    };
    let writing = WriteOptions { display, ..WriteOptions::default() };
    let bytes = image::encode_image(path, &picture, &writing)?;
    Ok(snell_formats::atomic::write(path, &bytes)?)
}
