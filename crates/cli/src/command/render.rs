//! `snell render`: a scene file to a picture.

mod denoise;
mod layers;
mod options;
mod output;
mod summary;

pub use options::Options;

use crate::failure::Failure;
use crate::progress::Reporter;
use crate::{scene_source, spectrum_file};
use options::GuidingOption;
use snell_formats::error::one_line;
use snell_math::simd::Level;
use snell_render::{CompiledScene, Guiding, IntegratorKind, Job, Settings, Statistics};
use snell_scene::{Camera, Scene};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use summary::Summary;

/// Renders a scene and writes the picture.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let simd = Level::from_env().map_err(Failure::Usage)?;
    // Fail before the work, not after it.
    let output = output::Output::plan(options)?;
    let denoiser = options.denoise.as_deref().map(denoise::load).transpose()?;
    let start = Instant::now();
    let mut scene = scene_source::load(&options.scene, &options.read_options())?;
    prepare_scene(&mut scene, options)?;
    let camera = choose_camera(&scene, options)?;
    let settings = options.settings(&scene, &camera, simd)?;
    let tonemap = options.tonemap(&scene)?;
    let load_seconds = start.elapsed().as_secs_f64();

    let start = Instant::now();
    let compiled =
        CompiledScene::new(&scene, &settings.build).map_err(|e| Failure::Scene(format!("{}: {e}", options.scene)))?;
    let build_seconds = start.elapsed().as_secs_f64();
    if !options.quiet {
        for warning in scene.warnings.iter().chain(&compiled.warnings) {
            let times = if warning.count > 1 { format!(" ({} times)", warning.count) } else { String::new() };
            eprintln!("warning: {}{times}", one_line(&warning.message));
        }
        warn_of_lost_layers(options, &settings);
    }

    let interrupted = Arc::new(AtomicBool::new(false));
    catch_interrupts(&interrupted)?;
    let threads = options.threads();
    let start = Instant::now();
    let (film, statistics) = render(&compiled, &camera, &settings, options, threads, &interrupted, &scene.name);
    let render_seconds = start.elapsed().as_secs_f64();

    let stem = scene_source::stem(&options.scene, &scene);
    let mut picture = snell_render::picture(&film, &settings, &compiled);
    let summary = Summary {
        scene: &scene,
        compiled: &compiled,
        settings: &settings,
        tonemap,
        statistics,
        film: &film,
        load_seconds,
        build_seconds,
        render_seconds,
        threads,
        image_sha256: output::sha256(&picture),
    };
    snell_render::layers::name_groups(&mut picture, &film, &settings.light_groups);
    layers::add_cryptomatte(&mut picture, &film, &scene, &compiled);
    if let Some(denoiser) = &denoiser {
        denoise::apply(denoiser, &mut picture, threads)?;
    }
    let written = output.write(&stem, picture, &film, &summary, &scene)?;
    if let Some(path) = &options.stats {
        let text = serde_json::to_string_pretty(&summary.json()).map_err(|e| Failure::Other(e.to_string()))?;
        snell_formats::atomic::write(path, (text + "\n").as_bytes())?;
    }
    if !options.quiet {
        summary.print(options, &written);
    }
    if interrupted.load(Ordering::Relaxed) {
        eprintln!(
            "interrupted: the picture holds what was rendered ({} of {} samples)",
            film.least_samples(),
            settings.spp
        );
        return Ok(ExitCode::from(130));
    }
    Ok(ExitCode::SUCCESS)
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

pub(super) fn prepare_scene(scene: &mut Scene, options: &Options) -> Result<(), Failure> {
    options.apply_environment(scene)?;
    let size = options.size.unwrap_or(options::DEFAULT_SIZE);
    let framing = snell_scene::framing::FramingOptions { size, ..Default::default() };
    snell_scene::framing::prepare(scene, &framing).map_err(|e| Failure::Scene(format!("{}: {e}", options.scene)))?;
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
    compiled: &CompiledScene,
    camera: &Camera,
    settings: &Settings,
    options: &Options,
    threads: usize,
    interrupted: &AtomicBool,
    name: &str,
) -> (snell_render::Film, Statistics) {
    let reporter = Reporter::new(options.progress, options.quiet, name);
    let limit: Option<Duration> = options.time;
    let start = Instant::now();
    let result = Job::new(compiled, camera, settings).run(threads, &|progress| {
        if let Some((_, begun)) = progress.training {
            // A pass takes as long as all before it. Where passes are counted, the clock has no say: bits must repeat.
            let share =
                limit.filter(|_| options.guiding == Some(GuidingOption::Auto)).map(|l| l.mul_f64(Guiding::SHARE));
            let late = begun == 0 && share.is_some_and(|share| start.elapsed() * 2 > share);
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
