//! `snell bench guiding`: the effect of path guiding at equal time.

use super::{make_folder, scenes};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::{standard_output, threads};
use serde_json::{Value, json};
use snell_formats::ReadOptions;
use snell_formats::image::{WriteOptions, write_image};
use snell_math::real;
use snell_render::{CompiledScene, Film, Guiding, IntegratorKind, Job, Settings, Statistics};
use snell_scene::{Camera, LayeredImage};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Options of `snell bench guiding`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Scenes: files or built-in ones
    #[arg(value_name = "SCENE", default_values = ["caustic", "door-ajar"])]
    scenes: Vec<String>,
    /// Processor time of each of four renders, summed over all threads
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = parse_seconds)]
    seconds: f64,
    /// Width of the pictures; the scene sets the height
    #[arg(
        long,
        value_name = "N",
        default_value_t = 320,
        value_parser = clap::value_parser!(u32).range(1..=16384),
    )]
    width: u32,
    /// Maximum number of bounces after the first hit
    #[arg(long, value_name = "N", default_value_t = Settings::MAX_DEPTH)]
    max_depth: u32,
    /// Learn from paths only
    #[arg(long)]
    no_photons: bool,
    /// Write the pictures to this folder
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,
    /// Threads. Default: one per core
    #[arg(short, long, value_name = "N", value_parser = threads::number())]
    threads: Option<u32>,
    /// Print JSON, a line for each scene
    #[arg(long)]
    json: bool,
    /// Refuse to open files outside of the scenes' folders
    #[arg(long)]
    confine: bool,
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0 && s.is_finite());
    seconds.ok_or_else(|| "expected a number of seconds above 0".to_string())
}

/// Measures and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let read = ReadOptions { confine: options.confine, ..ReadOptions::default() };
    if let Some(folder) = &options.keep {
        make_folder(folder)?;
    }
    if !options.json {
        let seconds = options.seconds;
        standard_output::write(
            format!("{seconds} s of processor time each.\n{}\n", heading()).as_bytes(),
        )?;
    }
    for name in &options.scenes {
        let value = measure(name, &read, options)?;
        let text = if options.json { format!("{value}\n") } else { row(&value) };
        standard_output::write(text.as_bytes())?;
    }
    Ok(ExitCode::SUCCESS)
}

fn measure(name: &str, read: &ReadOptions, options: &Options) -> Result<Value, Failure> {
    let (scene, _) = scenes::load_scene(name, read)?;
    let camera = scenes::camera(name, &scene)?;
    let [w, h] = scene.settings.size.or(camera.resolution).unwrap_or([4, 3]);
    let height =
        (u64::from(options.width) * u64::from(h) / u64::from(w.max(1))).clamp(1, 16384) as u32;
    let plain = Settings {
        size: [options.width, height],
        spp: 1 << 20,
        progressive: true,
        integrator: IntegratorKind::Path,
        max_depth: options.max_depth,
        ..Settings::default()
    };
    let guiding = Guiding::with_passes(Guiding::MAX_PASSES);
    let guiding = if options.no_photons { Guiding { photons: 0, ..guiding } } else { guiding };
    let guided = Settings { guiding: Some(guiding), ..plain.clone() };
    let compiled = CompiledScene::new(&scene, &plain.build)
        .map_err(|e| Failure::Scene(format!("{name}: {e}")))?;
    let render =
        |settings: &Settings, seconds: f64| render(&compiled, &camera, settings, seconds, options);
    let stem: String = scenes::short_name(name)
        .chars()
        .map(|c| if c.is_alphanumeric() { c } else { '-' })
        .collect();
    let file =
        |kind: &str| options.keep.as_ref().map(|folder| folder.join(format!("{stem}-{kind}.exr")));
    let mut found = Vec::new();
    for (kind, settings) in [("plain", &plain), ("guided", &guided)] {
        // Two renders with different random numbers allow an estimate of the error.
        let (first, statistics) = render(settings, options.seconds);
        let (second, _) =
            render(&Settings { seed: settings.seed + 1, ..settings.clone() }, options.seconds);
        let spp = first.least_samples().min(second.least_samples());
        let pair = [(first, ""), (second, "-again")]
            .map(|(film, suffix)| (film.image(), format!("{kind}{suffix}")));
        for (picture, kind) in &pair {
            keep(file(kind), picture)?;
        }
        found.push((pair.map(|(picture, _)| pixels(&picture)), spp, statistics));
    }
    let [(plain, plain_spp, _), (guided, guided_spp, statistics)] = &found[..] else {
        unreachable!("both ways were rendered")
    };
    let mean = mean(&[&plain[0], &plain[1], &guided[0], &guided[1]]);
    let [plain, guided] = [plain, guided].map(|pair| errors(pair, &mean));
    Ok(json!({
        "scene": name,
        "size": [options.width, height],
        "seconds": options.seconds,
        "plain": {
            "spp": plain_spp, "relative_mse": plain.mean, "without_outliers": plain.trimmed,
        },
        "guided": {
            "spp": guided_spp, "relative_mse": guided.mean, "without_outliers": guided.trimmed,
            "passes": statistics.training_passes,
            "regions": statistics.guiding_regions, "memory_bytes": statistics.guiding_bytes,
        },
        "gain": plain.mean / guided.mean,
        "gain_without_outliers": plain.trimmed / guided.trimmed,
    }))
}

fn render(
    compiled: &CompiledScene,
    camera: &Camera,
    settings: &Settings,
    seconds: f64,
    options: &Options,
) -> (Film, Statistics) {
    let threads = options.threads.map_or_else(threads::cores, |n| n as usize);
    let start = process_time();
    Job::new(compiled, camera, settings).run(threads, &|progress| {
        let spent = (process_time().saturating_sub(start)).as_secs_f64();
        match progress.training {
            Some(training) => training.begun > 0 || spent * 2.0 < seconds * Guiding::SHARE,
            None => progress.passes == 0 || spent < seconds,
        }
    })
}

/// Processor time of all threads; wall-clock time where the system does not report it.
fn process_time() -> Duration {
    #[cfg(unix)]
    {
        use nix::time::{ClockId, clock_gettime};
        if let Ok(time) = clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID) {
            return Duration::from(time);
        }
    }
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}

/// Relative squared errors.
struct Errors {
    mean: f64,
    /// The error without the worst thousandth of the pixels.
    trimmed: f64,
}

/// The relative squared errors of a picture, estimated from two pictures that differ only in noise
/// as half of the squared difference. No converged reference is needed, so the noise of a reference
/// cannot be taken for error. Errors are relative to `mean`, as in `snell compare`.
fn errors([a, b]: &[Pixels; 2], mean: &Pixels) -> Errors {
    let pixel = |((a, b), mean): ((&[f64; 3], &[f64; 3]), &[f64; 3])| {
        let channel = |c: usize| {
            real::powi(a[c] - b[c], 2)
                / 2.0
                / (mean[c] * mean[c] + snell_formats::image::compare::RELATIVE_EPSILON)
        };
        (channel(0) + channel(1) + channel(2)) / 3.0
    };
    let mut all: Vec<f64> = a.iter().zip(b).zip(mean).map(pixel).collect();
    all.sort_by(f64::total_cmp);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    Errors { mean: mean(&all), trimmed: mean(&all[..all.len() - all.len() / 1000]) }
}

type Pixels = Vec<[f64; 3]>;

fn mean(pictures: &[&Pixels]) -> Pixels {
    let channel =
        |i: usize, c: usize| pictures.iter().map(|p| p[i][c]).sum::<f64>() / pictures.len() as f64;
    (0..pictures[0].len()).map(|i| [0, 1, 2].map(|c| channel(i, c))).collect()
}

fn pixels(picture: &LayeredImage) -> Pixels {
    let layer = &picture.layers[0];
    layer.values.chunks(layer.channels.len()).map(|p| [p[0], p[1], p[2]].map(f64::from)).collect()
}

fn keep(path: Option<PathBuf>, picture: &LayeredImage) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    write_image(&path, picture, &WriteOptions::default())?;
    Ok(write_image(&path.with_extension("png"), picture, &WriteOptions::default())?)
}

fn heading() -> String {
    format!(
        "{:24} {:>9} {:>9} {:>11} {:>11} {:>7} {:>9}  passes  regions",
        "scene", "spp", "guided", "rel. MSE", "guided", "gain", "trimmed"
    )
}

fn row(value: &Value) -> String {
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let whole = |value: &Value| value.as_u64().unwrap_or(0);
    let (plain, guided) = (&value["plain"], &value["guided"]);
    format!(
        "{:24} {:9} {:9} {:11.5} {:11.5} {:7.2} {:9.2}  {:6}  {:7}\n",
        scenes::short_name(value["scene"].as_str().unwrap_or_default()),
        whole(&plain["spp"]),
        whole(&guided["spp"]),
        number(&plain["relative_mse"]),
        number(&guided["relative_mse"]),
        number(&value["gain"]),
        number(&value["gain_without_outliers"]),
        whole(&guided["passes"]),
        whole(&guided["regions"]),
    )
}
