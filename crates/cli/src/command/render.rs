//! `snell render`: renders a scene file to a picture.

pub mod again;
pub mod checkpoint;
mod denoise;
mod exposure_hint;
pub mod frames;
mod layers;
mod memory;
pub mod options;
pub mod output;
mod preview;
pub mod receipt;
mod request;
mod rescue;
mod saving;
pub mod stage;
mod summary;
mod tev;

pub use options::Options;

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::messages::counted;
use crate::progress::Reporter;
use crate::{interrupt, scene_source};
use clap::ArgMatches;
use denoise::Denoised;
use exposure_hint::exposure_hint;
use output::Target;
use preview::Preview;
pub(super) use preview::display;
use saving::Saving;
use snell_formats::image::{Tonemap, encode_image_as};
use snell_math::simd::Level;
use snell_persist::Receipt;
use snell_render::{
    CausticsMode, CompiledScene, Film, FilmTile, IntegratorKind, Job, Progress, Pulse, Request,
    Settings, Statistics, with_patience,
};
use snell_scene::{Camera, Pose, Scene, Warning, WarningKind};
use snell_viewer::Finished;
use stage::{Shot, Stage};
use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use summary::{Facts, Summary};
use tev::Tev;

/// The message if a signal ends the command before anything can be saved.
const NOTHING_YET: &str = "interrupted before anything was rendered: no picture was written";

/// Films that were rendered elsewhere.
pub struct Merged<'a> {
    /// The film of the picture with this number, from 0, and its statistics.
    pub film: &'a dyn Fn(&Job, u32) -> Result<(Film, Statistics), Failure>,
    /// The receipt of the pictures, without tiles.
    pub receipt: Receipt,
}

/// Renders a scene and writes the picture, or the frames of an animation.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    interrupt::end_at_once(NOTHING_YET);
    let _lock = checkpoint::check(options)?;
    produce(&options.clone().recording_sources(), None, None)
}

/// Writes the picture, or the frames of an animation, of films that were rendered elsewhere.
pub fn finish(options: &Options, scene: Scene, merged: &Merged) -> Result<ExitCode, Failure> {
    interrupt::end_at_once(NOTHING_YET);
    produce(options, Some(scene), Some(merged))
}

/// Loads the scene, unless it is there, and makes its pictures.
fn produce(
    options: &Options,
    scene: Option<Scene>,
    merged: Option<&Merged>,
) -> Result<ExitCode, Failure> {
    let simd = Level::from_env().map_err(Failure::Usage)?;
    // Errors of the output are found before the work, not after it.
    let output = output::Output::plan(options)?;
    let denoiser = options.request.denoise.as_ref().map(denoise::load).transpose()?.map(Arc::new);
    let start = Instant::now();
    let scene = scene.map_or_else(|| load(options), Ok)?;
    let receipt = match merged {
        Some(merged) => merged.receipt.clone(),
        None => receipt::of_options(options, &crate::command::matches("render")?),
    };
    let mut stage = Stage::new(scene, options)?;
    let tonemap = options.tonemap(&stage.scene)?;
    let load_seconds = start.elapsed().as_secs_f64();
    let stem = scene_source::stem(&options.scene, &stage.scene);
    let path = output.path(&stem);
    output.check_apart(&path)?;
    let mut session = Session {
        options,
        simd,
        output,
        denoiser,
        tonemap,
        load_seconds,
        stem,
        estimated_memory_bytes: 0,
        has_begun: false,
        merged,
        receipt,
        number: 0,
    };
    if let Some(code) = frames::render(&mut session, &mut stage)? {
        return Ok(code);
    }
    let time = options.at.unwrap_or_else(|| stage.usual_time());
    let settings = options.settings(&stage.scene, &stage.camera(options)?, simd)?;
    session.estimated_memory_bytes = memory::check(options, &settings, &stage.scene)?;
    let shot = stage.shot(time, options, &settings.build)?;
    let target = match session.output.is_standard() {
        true => Target::Output { stand_in: &path },
        false => Target::File(&path),
    };
    let outcome = session.take(&stage.scene, shot, target)?;
    let mut is_in_place = !matches!(outcome.fate, Fate::Elsewhere);
    if let Some(path) = &options.stats {
        let text = serde_json::to_string_pretty(&outcome.statistics)
            .map_err(|e| Failure::Other(e.to_string()))?;
        is_in_place &= output::write_text(path, "the JSON", &(text + "\n"))?;
    }
    if interrupt::is_requested() {
        say_what_is_there(&outcome, &path, settings.spp);
        if let Some(farewell) = &outcome.farewell {
            eprintln!("{farewell}");
        }
    }
    Ok(match (is_in_place, interrupt::is_requested()) {
        (false, _) => ExitCode::from(1),
        (true, true) => ExitCode::from(interrupt::EXIT_CODE),
        (true, false) => ExitCode::SUCCESS,
    })
}

/// Reports what an interrupted render has saved.
fn say_what_is_there(outcome: &Outcome, path: &Path, spp: u32) {
    let least = outcome.least_samples;
    match &outcome.fate {
        Fate::Nothing => eprintln!("{NOTHING_YET}"),
        Fate::Partial => {
            let partial = rescue::partial(path);
            let (partial, path) = (partial.display(), path.display());
            eprintln!(
                "interrupted in the first pass: {partial} holds what was rendered, with holes; \
                    {path} is as it was"
            );
        }
        Fate::Noisy => {
            eprintln!("interrupted while denoising: the picture is noisy ({least} samples)")
        }
        _ => {
            eprintln!("interrupted: the picture holds what was rendered ({least} of {spp} samples)")
        }
    }
}

/// Reads the scene, and selects the part of its file that the options name.
pub(super) fn load(options: &Options) -> Result<Scene, Failure> {
    let scene = scene_source::load(&options.scene, &options.read_options())?;
    let shown = options.scene.display();
    let lacks =
        |what: &str| Err(Failure::Usage(format!("{shown}: the file has no {what} to choose from")));
    if options.variant.is_some() && scene.variants.is_empty() {
        return lacks("variants");
    }
    if options.scene_of_file.is_some() && scene.scenes.is_empty() {
        return lacks("scenes");
    }
    Ok(scene)
}

/// Pictures with more pixels than this take so long to save that a message says so.
const QUICKLY_SAVED: u64 = 4_000_000;

/// State shared by all pictures of one command.
struct Session<'a> {
    options: &'a Options,
    simd: Level,
    output: output::Output<'a>,
    denoiser: Option<Arc<snell_oidn::Denoiser>>,
    tonemap: Tonemap,
    load_seconds: f64,
    stem: OsString,
    /// The memory estimate from before the picture was begun, in bytes.
    estimated_memory_bytes: u64,
    /// True once a picture was begun and warnings were printed.
    has_begun: bool,
    /// Films that are not rendered here.
    merged: Option<&'a Merged<'a>>,
    /// The receipt of the next picture, without tiles.
    receipt: Receipt,
    /// The number of the next picture, from 0.
    number: u32,
}

/// The result of a picture.
struct Outcome {
    compiled: CompiledScene,
    fate: Fate,
    least_samples: u32,
    render_seconds: f64,
    statistics: serde_json::Value,
    /// How to go on with the render, if it is kept on its way.
    farewell: Option<String>,
}

/// Whether and where a picture was written.
enum Fate {
    /// The picture is in its place; the text is the SHA-256 of its file.
    Written(String),
    /// The picture is in its place, but still noisy, because denoising was interrupted.
    Noisy,
    /// The picture is in a fallback place, which was reported.
    Elsewhere,
    /// An incomplete picture is beside its place, under another name.
    Partial,
    /// No picture was written: the render was interrupted before anything was rendered, or during
    /// one of many frames.
    Nothing,
}

impl Session<'_> {
    /// Renders a picture and writes it to a file, or to standard output. A frame of several is not
    /// written if it is interrupted.
    fn take(&mut self, scene: &Scene, shot: Shot, target: Target) -> Result<Outcome, Failure> {
        let options = self.options;
        let Shot { camera, later_cameras, compiled, build_seconds, .. } = shot;
        let settings = Settings { later_cameras, ..options.settings(scene, &camera, self.simd)? };
        let is_first = !std::mem::replace(&mut self.has_begun, true);
        let mut warnings = warnings(options, scene, &compiled, &settings);
        if is_first && !options.quiet {
            for warning in &warnings {
                eprintln!("warning: {}", counted(warning));
            }
        }
        let threads = options.threads();
        let tev = options.tev().map(|url| Tev::open(url, &scene.name, &settings)).transpose()?;
        let start = Instant::now();
        let watcher = |tile: &FilmTile| tev.iter().for_each(|tev| tev.send(tile));
        interrupt::save_first();
        let mut saving = Saving {
            options,
            checkpoint: checkpoint::of_options(options, &settings, target.path(), &self.receipt)?,
            preview: Preview::new(options, scene, self.tonemap),
        };
        let (pulse, limit) = (Pulse::default(), options.request.time);
        let is_stopped = || interrupt::is_requested() || pulse.is_stuck(limit);
        let ((film, statistics), photons) = with_patience(is_stopped, |cancel| {
            let mut job = Job::new(&compiled, &camera, &settings).with_cancel(cancel);
            if let Some(merged) = self.merged {
                return (merged.film)(&job, self.number).map(|film| (film, None));
            }
            if tev.is_some() {
                job = job.watched(&watcher);
            }
            let film = render(&job, options, threads, &scene.name, &pulse, &mut saving)?;
            Ok((film, job.photons()))
        })?;
        if settings.caustics == CausticsMode::On && photons.is_none() && self.merged.is_none() {
            let problem = "--caustics on finds no lamp, or no glass, water or metal that is smooth \
                enough (roughness at most 0.3, alpha 0.09); the picture has no photons";
            let problem = format!("{}: {problem}", options.scene.display());
            if !options.quiet && is_first {
                eprintln!("warning: {problem}");
            }
            Warning::note_of(WarningKind::Choice, &mut warnings, problem, 1);
        }
        let render_seconds = start.elapsed().as_secs_f64();
        if let Some(tev) = tev {
            tev.finish(&film.tiles);
        }
        let is_stuck = pulse.was_stuck() && film.least_samples() == 0;
        let is_cut = (interrupt::is_requested() || is_stuck) && !statistics.is_complete;
        let has_holes = is_cut && film.least_samples() == 0;
        if is_cut
            && !is_stuck
            && film.crop.size().iter().map(|&side| u64::from(side)).product::<u64>() > QUICKLY_SAVED
        {
            eprintln!("interrupted: saving what was rendered; a second signal discards it");
        }

        let mut picture = snell_render::picture(&film, &settings, &compiled);
        if settings.integrator.is_path() && !is_cut && !options.has_frames() {
            let hint = exposure_hint(&picture.layers[0], options.exposure(scene));
            if let Some(hint) = hint.map(|hint| format!("{}: {hint}", options.scene.display())) {
                if !options.quiet {
                    eprintln!("warning: {hint}");
                }
                Warning::note_of(WarningKind::Choice, &mut warnings, hint, 1);
            }
        }
        let facts = Facts {
            scene,
            settings: &settings,
            statistics,
            photons,
            film: &film,
            image_sha256: snell_persist::image_sha256(&picture),
            receipt: self.receipt.of_film(&film),
        };
        let summary = Summary {
            facts,
            compiled: &compiled,
            warnings,
            load_seconds: self.load_seconds,
            build_seconds,
            render_seconds,
            threads,
            estimated_memory_bytes: self.estimated_memory_bytes,
        };
        snell_render::layers::name_groups(&mut picture, &film, &settings.light_groups);
        layers::add_cryptomatte(&mut picture, &film, scene, &compiled);
        let target_path = target.path().to_owned();
        let is_dropped = is_cut && (film.mean_samples() == 0.0 || options.has_frames());
        let mut fate = Fate::Nothing;
        if !is_dropped {
            let denoised = match &self.denoiser {
                Some(denoiser) if !has_holes => denoise::apply(denoiser, &mut picture, threads),
                _ => Ok(Denoised::Done),
            };
            let is_interrupted = matches!(denoised, Ok(Denoised::Interrupted));
            let beside = rescue::partial(target.path());
            let target =
                if has_holes || denoised.is_err() { Target::File(&beside) } else { target };
            if !(is_interrupted && options.has_frames()) {
                let written = self.output.write(target, picture, &summary.facts)?;
                if !options.quiet && !options.has_frames() && written.is_in_place {
                    summary.print(options, target);
                }
                fate = match written.is_in_place {
                    false => Fate::Elsewhere,
                    true if has_holes => Fate::Partial,
                    true if is_interrupted => Fate::Noisy,
                    true => Fate::Written(written.sha256),
                };
            }
            if let Err(failure) = denoised {
                let problem =
                    format!("{failure}; {} holds the noisy picture", target.path().display());
                return Err(Failure::Other(problem));
            }
        }
        if is_stuck && !interrupt::is_requested() {
            return Err(Failure::Scene(format!(
                "{}: the time is over, and some rays meet so many things that the first pass would \
                    not finish; {}",
                options.scene.display(),
                match fate {
                    Fate::Partial => format!(
                        "{} holds what was rendered, with holes",
                        rescue::partial(&target_path).display()
                    ),
                    _ => "no picture was written".into(),
                }
            )));
        }
        // The statistics come last, because the denoiser or the encoder may take the most memory.
        let (least_samples, statistics) = (film.least_samples(), summary.json());
        let farewell = saving.checkpoint.as_ref().map(checkpoint::farewell);
        Ok(Outcome { compiled, fate, least_samples, render_seconds, statistics, farewell })
    }
}

/// The file of a picture that the viewer has made, as these options write it; `matches` are the
/// options as they were given.
pub(super) fn encode(
    options: &Options,
    matches: &ArgMatches,
    made: &Finished,
    format: &str,
) -> Result<Vec<u8>, Failure> {
    let Finished { scene, compiled, settings, film, statistics, is_whole: _ } = made;
    let mut picture = snell_render::picture(film, settings, compiled);
    let facts = Facts {
        photons: None,
        scene,
        settings,
        statistics: *statistics,
        film,
        image_sha256: snell_persist::image_sha256(&picture),
        receipt: receipt::of_options(options, matches).of_film(film),
    };
    snell_render::layers::name_groups(&mut picture, film, &settings.light_groups);
    layers::add_cryptomatte(&mut picture, film, scene, compiled);
    let denoiser = options.request.denoise.as_ref().map(denoise::load).transpose()?;
    if let Some(denoiser) = denoiser.map(Arc::new) {
        denoise::apply(&denoiser, &mut picture, options.threads())?;
    }
    let (picture, writing) = output::prepared(options, picture, &facts)?;
    Ok(encode_image_as(format, &picture, &writing)?)
}

/// Warnings before a picture is rendered. Warnings of the readers name a place in a file; warnings
/// of the compiler concern the whole scene.
fn warnings(
    options: &Options,
    scene: &Scene,
    compiled: &CompiledScene,
    settings: &Settings,
) -> Vec<Warning> {
    let mut warnings = scene.warnings.clone();
    let name = options.scene.display();
    let found_later = compiled.warnings.iter();
    warnings.extend(
        found_later.map(|w| Warning { message: format!("{name}: {}", w.message), ..w.clone() }),
    );
    if loses_layers(options, settings) {
        let message =
            "only OpenEXR holds layers and variance; write the picture to a file.exr to have them";
        Warning::note(&mut warnings, message.into(), 1);
    }
    warnings
}

/// True if layers would be lost: only OpenEXR holds them. The integrator `aov` shows the first of
/// its layers as the picture, in any format.
fn loses_layers(options: &Options, settings: &Settings) -> bool {
    let extension = options.output.as_ref().and_then(|path| path.extension());
    fn count<T>(items: &Option<Vec<T>>) -> usize {
        items.as_ref().map_or(0, Vec::len)
    }
    let shown = usize::from(settings.integrator == IntegratorKind::Aov);
    let asked = count(&options.request.aovs) > shown
        || count(&options.request.light_groups) > 0
        || options.variance;
    asked && !extension.is_some_and(|e| e.eq_ignore_ascii_case("exr"))
}

/// Prepares a scene for viewing, according to the options.
pub(super) fn prepare_scene(scene: Scene, options: &Options) -> Result<Scene, Failure> {
    Ok(Stage::new(scene, options)?.into_scene(options.at))
}

/// Adds missing parts of the scene and applies the options. A default camera frames all of the
/// poses.
fn prepare_for(scene: &mut Scene, poses: &[Pose], options: &Options) -> Result<(), Failure> {
    options.apply_environment(scene)?;
    let size = options.request.size.unwrap_or(Request::DEFAULT_SIZE);
    // Definitions of `-D` may name positions in the world of the file.
    let may_move = scene_source::are_parameters(scene, &options.define);
    let framing = snell_scene::framing::FramingOptions { size, may_move, ..Default::default() };
    let prepared = snell_scene::framing::prepare_for(scene, poses, &framing);
    let failed =
        |e: &dyn std::fmt::Display| Failure::Scene(format!("{}: {e}", options.scene.display()));
    prepared.map_err(|e| failed(&e))?;
    options.apply_background(scene)?;
    if let Some(density) = options.fog {
        let filled = snell_scene::framing::fill_with_fog(scene, density);
        filled.map_err(|e| failed(&e))?;
    }
    scene_source::apply(scene, &options.define)
}

pub(super) fn choose_camera(scene: &Scene, options: &Options) -> Result<Camera, Failure> {
    let Some(wanted) = &options.camera else {
        return scene
            .cameras
            .first()
            .cloned()
            .ok_or_else(|| Failure::Scene("the scene has no camera".into()));
    };
    let by_name = scene.cameras.iter().find(|c| c.name == *wanted);
    let by_number = || wanted.parse::<usize>().ok().and_then(|i| scene.cameras.get(i));
    by_name.or_else(by_number).cloned().ok_or_else(|| {
        let names: Vec<_> =
            scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} \"{}\"", c.name)).collect();
        Failure::Usage(format!(
            "there is no camera \"{wanted}\"; the scene has: {}",
            names.join(", ")
        ))
    })
}

fn render(
    job: &Job,
    options: &Options,
    threads: usize,
    name: &str,
    pulse: &Pulse,
    saving: &mut Saving,
) -> Result<(Film, Statistics), Failure> {
    let reporter = Reporter::new(options.progress, options.quiet, name);
    let limit: Option<Duration> = options.request.time;
    let start = Instant::now();
    let keep_going = |progress: &Progress| {
        pulse.beat();
        match &progress.training {
            Some(training) => reporter.update_training(training),
            None => reporter.update(progress, limit),
        }
        // If training passes are counted, training does not depend on the time, so that bits
        // repeat.
        let is_training_timed = options.request.is_training_timed();
        !progress.is_late(start.elapsed(), limit, is_training_timed) && !interrupt::is_requested()
    };
    let result = saving.run(job, threads, &keep_going);
    reporter.finish();
    result
}
