//! `snell render`: a scene file to a picture.

mod denoise;
mod frames;
mod layers;
mod options;
mod output;
mod stage;
mod summary;
mod tev;

pub use options::Options;

use crate::failure::Failure;
use crate::progress::Reporter;
use crate::{scene_source, spectrum_file};
use options::GuidingOption;
use snell_formats::error::one_line;
use snell_formats::image::Tonemap;
use snell_math::simd::Level;
use snell_render::{CompiledScene, FilmTile, Guiding, IntegratorKind, Job, Settings, Statistics, with_patience};
use snell_scene::{Camera, Pose, Scene};
use stage::{Shot, Stage};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use summary::Summary;
use tev::Tev;

/// Renders a scene and writes the picture, or the frames of an animation.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let simd = Level::from_env().map_err(Failure::Usage)?;
    // Fail before the work, not after it.
    let output = output::Output::plan(options)?;
    let denoiser = options.denoise.as_deref().map(denoise::load).transpose()?;
    let start = Instant::now();
    let scene = load(options)?;
    let mut stage = Stage::new(scene, options)?;
    let tonemap = options.tonemap(&stage.scene)?;
    let load_seconds = start.elapsed().as_secs_f64();
    let interrupted = Arc::new(AtomicBool::new(false));
    let stem = scene_source::stem(&options.scene, &stage.scene);
    output.check_apart(output.target(&stem).as_deref())?;
    let mut session =
        Session { options, simd, output, denoiser, tonemap, load_seconds, interrupted, stem, has_begun: false };
    if let Some(code) = frames::render(&mut session, &mut stage)? {
        return Ok(code);
    }
    let time = options.at.unwrap_or_else(|| stage.usual_time());
    let settings = options.settings(&stage.scene, &stage.camera(options)?, simd)?;
    let shot = stage.shot(time, options, &settings.build)?;
    let target = session.output.target(&session.stem);
    let outcome = session.take(&stage.scene, shot, target.as_deref())?;
    if let Some(path) = &options.stats {
        let text = serde_json::to_string_pretty(&outcome.statistics).map_err(|e| Failure::Other(e.to_string()))?;
        snell_formats::atomic::write(path, (text + "\n").as_bytes())?;
    }
    if session.interrupted.load(Ordering::Relaxed) {
        if outcome.is_empty {
            eprintln!("interrupted before anything was rendered: no picture was written");
        } else {
            eprintln!(
                "interrupted: the picture holds what was rendered ({} of {} samples)",
                outcome.least_samples, settings.spp
            );
        }
        return Ok(ExitCode::from(130));
    }
    Ok(ExitCode::SUCCESS)
}

/// Reads the scene, and the part of its file that the options choose.
fn load(options: &Options) -> Result<Scene, Failure> {
    let scene = scene_source::load(&options.scene, &options.read_options())?;
    let lacks = |what: &str| Err(Failure::Usage(format!("{}: the file has no {what} to choose from", options.scene)));
    if options.variant.is_some() && scene.variants.is_empty() {
        return lacks("variants");
    }
    if options.scene_of_file.is_some() && scene.scenes.is_empty() {
        return lacks("scenes");
    }
    Ok(scene)
}

/// What all pictures of one command have in common.
struct Session<'a> {
    options: &'a Options,
    simd: Level,
    output: output::Output<'a>,
    denoiser: Option<snell_oidn::Denoiser>,
    tonemap: Tonemap,
    load_seconds: f64,
    interrupted: Arc<AtomicBool>,
    stem: String,
    /// Some picture was begun: warnings are said, Ctrl-C is caught.
    has_begun: bool,
}

/// What became of a picture.
struct Outcome {
    compiled: CompiledScene,
    /// False if it was interrupted.
    is_complete: bool,
    /// It was interrupted before anything was rendered, and so not written.
    is_empty: bool,
    least_samples: u32,
    render_seconds: f64,
    statistics: serde_json::Value,
}

impl Session<'_> {
    /// Renders a picture and writes it to a file, or to standard output. A frame of many that is interrupted is not written.
    fn take(&mut self, scene: &Scene, shot: Shot, target: Option<&Path>) -> Result<Outcome, Failure> {
        let options = self.options;
        let Shot { camera, later_cameras, compiled, build_seconds, .. } = shot;
        let settings = Settings { later_cameras, ..options.settings(scene, &camera, self.simd)? };
        let is_first = !std::mem::replace(&mut self.has_begun, true);
        if is_first {
            if !options.quiet {
                warn(&options.scene, scene, &compiled);
                warn_of_lost_layers(options, &settings);
            }
            catch_interrupts(&self.interrupted)?;
        }
        let threads = options.threads();
        let tev = options.tev().map(|url| Tev::open(url, &scene.name, &settings)).transpose()?;
        let start = Instant::now();
        let watcher = |tile: &FilmTile| tev.iter().for_each(|tev| tev.send(tile));
        let interrupted = &self.interrupted;
        let (film, statistics) = with_patience(
            || interrupted.load(Ordering::Relaxed),
            |cancel| {
                let mut job = Job::new(&compiled, &camera, &settings).with_cancel(cancel);
                if tev.is_some() {
                    job = job.watched(&watcher);
                }
                render(&job, options, threads, interrupted, &scene.name)
            },
        );
        let render_seconds = start.elapsed().as_secs_f64();
        if let Some(tev) = tev {
            tev.finish(&film.tiles);
        }
        let is_complete = !self.interrupted.load(Ordering::Relaxed);

        let mut picture = snell_render::picture(&film, &settings, &compiled);
        let summary = Summary {
            scene,
            compiled: &compiled,
            settings: &settings,
            tonemap: self.tonemap,
            statistics,
            film: &film,
            load_seconds: self.load_seconds,
            build_seconds,
            render_seconds,
            threads,
            image_sha256: output::sha256(&picture),
        };
        snell_render::layers::name_groups(&mut picture, &film, &settings.light_groups);
        layers::add_cryptomatte(&mut picture, &film, scene, &compiled);
        if let Some(denoiser) = &self.denoiser {
            denoise::apply(denoiser, &mut picture, threads)?;
        }
        // (What stands there is better than nothing.)
        let is_empty = !is_complete && film.mean_samples() == 0.0;
        if !is_empty && (is_complete || !options.has_frames()) {
            self.output.write(target, picture, &film, &summary, scene)?;
            if !options.quiet && !options.has_frames() {
                summary.print(options, target);
            }
        }
        let (least_samples, statistics) = (film.least_samples(), summary.json());
        Ok(Outcome { compiled, is_complete, is_empty, least_samples, render_seconds, statistics })
    }
}

/// What the readers warn of names the place in a file. What is found later is about the whole of `name`.
fn warn(name: &str, scene: &Scene, compiled: &CompiledScene) {
    let found_later = compiled.warnings.iter().map(|warning| (format!("{name}: "), warning));
    for (place, warning) in scene.warnings.iter().map(|warning| (String::new(), warning)).chain(found_later) {
        let times = if warning.count > 1 { format!(" ({} times)", warning.count) } else { String::new() };
        eprintln!("warning: {place}{}{times}", one_line(&warning.message));
    }
}

/// Only OpenEXR holds layers. The integrator `aov` shows its first one in any format.
fn warn_of_lost_layers(options: &Options, settings: &Settings) {
    let extension = options.output.as_ref().and_then(|path| path.extension());
    let shown = usize::from(settings.integrator == IntegratorKind::Aov);
    let asked = options.aov.len().max(shown) > shown || !options.light_group.is_empty() || options.variance;
    if asked && !extension.is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
        eprintln!("warning: only OpenEXR holds layers and variance; write the picture to a file.exr to have them");
    }
}

/// Makes a scene ready to be looked at, as the options say.
pub(super) fn prepare_scene(scene: Scene, options: &Options) -> Result<Scene, Failure> {
    Ok(Stage::new(scene, options)?.into_scene(options.at))
}

/// Adds what the scene lacks and changes what the options say. A camera that is made shows all of the poses.
fn prepare_for(scene: &mut Scene, poses: &[Pose], options: &Options) -> Result<(), Failure> {
    options.apply_environment(scene)?;
    let size = options.size.unwrap_or(options::DEFAULT_SIZE);
    let framing = snell_scene::framing::FramingOptions { size, ..Default::default() };
    let prepared = snell_scene::framing::prepare_for(scene, poses, &framing);
    prepared.map_err(|e| Failure::Scene(format!("{}: {e}", options.scene)))?;
    options.apply_background(scene)?;
    if let Some(density) = options.fog {
        let filled = snell_scene::framing::fill_with_fog(scene, density);
        filled.map_err(|e| Failure::Scene(format!("{}: {e}", options.scene)))?;
    }
    for definition in &options.define {
        if scene.takes_parameter(definition.split('=').next().unwrap_or_default()) {
            continue;
        }
        snell_scene::overrides::apply(scene, &spectrum_file::resolve(definition)?)?;
    }
    Ok(())
}

pub(super) fn choose_camera(scene: &Scene, options: &Options) -> Result<Camera, Failure> {
    let Some(wanted) = &options.camera else {
        return scene.cameras.first().cloned().ok_or_else(|| Failure::Scene("the scene has no camera".into()));
    };
    let by_name = scene.cameras.iter().find(|c| c.name == *wanted);
    let by_number = || wanted.parse::<usize>().ok().and_then(|i| scene.cameras.get(i));
    by_name.or_else(by_number).cloned().ok_or_else(|| {
        let names: Vec<_> = scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} \"{}\"", c.name)).collect();
        Failure::Usage(format!("there is no camera \"{wanted}\"; the scene has: {}", names.join(", ")))
    })
}

/// The first Ctrl-C ends the render with the picture saved, the second ends the program.
fn catch_interrupts(interrupted: &Arc<AtomicBool>) -> Result<(), Failure> {
    let flag = interrupted.clone();
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|e| Failure::Other(format!("cannot watch for Ctrl-C: {e}")))
}

fn render(
    job: &Job,
    options: &Options,
    threads: usize,
    interrupted: &AtomicBool,
    name: &str,
) -> (snell_render::Film, Statistics) {
    let reporter = Reporter::new(options.progress, options.quiet, name);
    let limit: Option<Duration> = options.time;
    let start = Instant::now();
    let result = job.run(threads, &|progress| {
        if let Some(training) = progress.training {
            reporter.update_training(&training);
            // A pass takes as long as all before it. Where passes are counted, the clock has no say: bits must repeat.
            let share =
                limit.filter(|_| options.guiding == Some(GuidingOption::Auto)).map(|l| l.mul_f64(Guiding::SHARE));
            let late = training.begun == 0 && share.is_some_and(|share| start.elapsed() * 2 > share);
            return !late && !interrupted.load(Ordering::Relaxed);
        }
        reporter.update(progress, limit);
        // A picture with holes is of no use: the time limit waits for the first pass.
        let late = progress.passes > 0 && limit.is_some_and(|l| start.elapsed() >= l);
        !late && !interrupted.load(Ordering::Relaxed)
    });
    reporter.finish();
    result
}
