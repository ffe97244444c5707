//! `snell bench render`: the share of the ray core's speed that a render reaches.

use super::clock::{self, Clock, median, time_pieces};
use super::{kinds, scenes, variants};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::{standard_output, threads};
use serde_json::{Value, json};
use snell_formats::ReadOptions;
use snell_intersect::{BuildOptions, Grouping, Hit};
use snell_math::Ray;
use snell_render::job::hit_filter;
use snell_render::{CompiledScene, IntegratorKind, Job, Recording, Settings};
use std::time::Instant;

/// Options of `snell bench render`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Scenes, as in `snell bench rays`
    #[arg(value_name = "SCENE", required = true)]
    scenes: Vec<String>,
    /// Numbers of threads. Default: 1 and one per core
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = threads::number())]
    threads: Vec<u32>,
    #[command(flatten)]
    variants: variants::Options,
    /// Width and height of the picture; a power of two
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = kinds::parse_side)]
    side: u32,
    /// Samples per pixel
    #[arg(
        long,
        value_name = "N",
        default_value_t = 16,
        value_parser = clap::value_parser!(u32).range(1..=65536),
    )]
    spp: u32,
    /// Runs of each; the median is reported
    #[arg(
        long,
        value_name = "N",
        default_value_t = 5,
        value_parser = clap::value_parser!(u32).range(1..=1000),
    )]
    repeat: u32,
    /// Print JSON, a line for each measurement
    #[arg(long)]
    json: bool,
    /// Refuse to open files outside of the scenes' folders
    #[arg(long)]
    confine: bool,
}

/// Measures and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    options.scenes.iter().try_for_each(|name| scenes::check(name))?;
    let variants = options.variants.variants()?;
    let read = ReadOptions { confine: options.confine, ..ReadOptions::default() };
    for (i, name) in options.scenes.iter().enumerate() {
        let (scene, _) = scenes::load_scene(name, &read)?;
        if i == 0 && !options.json {
            standard_output::write(heading().as_bytes())?;
        }
        let camera = scenes::camera(name, &scene)?;
        for variant in &variants {
            let compiled = CompiledScene::new(&scene, variant)
                .map_err(|e| Failure::Scene(format!("{name}: {e}")))?;
            let settings = Settings {
                size: [options.side; 2],
                spp: options.spp,
                integrator: IntegratorKind::Path,
                build: variant.clone(),
                ..Settings::default()
            };
            let job = Job::new(&compiled, &camera, &settings);
            let rays = RecordedRays::new(job.record(threads::cores()));
            for threads in clock::thread_counts(&options.threads) {
                let value = measure(name, &compiled, &job, &rays, threads, variant, options)?;
                let text = if options.json { format!("{value}\n") } else { table_row(&value) };
                standard_output::write(text.as_bytes())?;
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The rays of a render, as three long batches.
struct RecordedRays {
    /// Rays of closest-hit queries that are grouped as coherent.
    coherent: Vec<Ray>,
    /// All other rays of closest-hit queries.
    unrelated: Vec<Ray>,
    /// Rays of occlusion queries.
    occluded: Vec<Ray>,
    /// The number of queries.
    queries: usize,
}

impl RecordedRays {
    fn new(recording: Recording) -> Self {
        let queries = recording.closest.len() + recording.occluded.len();
        let (mut coherent, mut unrelated) = (Vec::new(), Vec::new());
        for (grouping, rays) in recording.closest {
            if grouping == Grouping::None { unrelated.extend(rays) } else { coherent.extend(rays) }
        }
        Self { coherent, unrelated, occluded: recording.occluded.concat(), queries }
    }

    fn len(&self) -> usize {
        self.coherent.len() + self.unrelated.len() + self.occluded.len()
    }
}

fn measure(
    name: &str,
    compiled: &CompiledScene,
    job: &Job,
    rays: &RecordedRays,
    threads: usize,
    variant: &BuildOptions,
    options: &Options,
) -> Result<Value, Failure> {
    let pool = clock::pool(threads).map_err(Failure::Other)?;
    let (world, filter) = (&compiled.world, hit_filter(compiled));
    let mut hits = vec![Hit::MISS; rays.coherent.len().max(rays.unrelated.len())];
    let mut blocked = vec![false; rays.occluded.len()];
    let (mut render, mut tracing, mut raw) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..options.repeat {
        let start = Instant::now();
        let (_, statistics) = job.run(threads, &|_| true);
        render.push(start.elapsed().as_secs_f64());
        tracing.push(statistics.tracing.as_secs_f64() / threads as f64);
        let mut seconds = 0.0;
        for (grouping, rays) in
            [(Grouping::Coherent, &rays.coherent), (Grouping::None, &rays.unrelated)]
        {
            seconds += time_pieces(
                &pool,
                Clock::Wall,
                rays,
                &mut hits[..rays.len()],
                &|rays: &[Ray], hits: &mut [Hit]| {
                    world.closest(rays, grouping, filter, hits);
                },
            );
        }
        seconds += time_pieces(
            &pool,
            Clock::Wall,
            &rays.occluded,
            &mut blocked,
            &|rays: &[Ray], blocked: &mut [bool]| {
                world.occluded(rays, Grouping::None, filter, blocked);
            },
        );
        raw.push(seconds);
    }
    let rate = |seconds: &[f64]| rays.len() as f64 / median(seconds) * 1e-6;
    let shares: Vec<f64> =
        tracing.iter().zip(&render).map(|(tracing, render)| tracing / render).collect();
    Ok(json!({
        "scene": name,
        "triangles": world.instanced_triangle_count(),
        "threads": threads,
        "accelerator": variant.accelerator.name(),
        "quality": variant.quality.name(),
        "compact": variant.compact,
        "simd": world.simd().name(),
        "side": options.side,
        "spp": options.spp,
        "repeat": options.repeat,
        "ray_count": rays.len(),
        "mean_batch": rays.len() as f64 / rays.queries.max(1) as f64,
        "mrays_per_second": rate(&render),
        "tracing_share": median(&shares),
        "tracing_mrays_per_second": rate(&tracing),
        "raw_mrays_per_second": rate(&raw),
    }))
}

fn heading() -> String {
    format!(
        "Mrays/s, medians: of the whole render, while in ray queries, and of the same rays alone.\n\
         {:32} {:>11} {:>7} {:>10} {:>10} {:>8} {:>8} {:>8} {:>8}\n",
        "scene", "triangles", "threads", "rays", "mean batch", "render", "share", "tracing", "raw"
    )
}

fn table_row(value: &Value) -> String {
    let number = |key: &str| value[key].as_f64().unwrap_or(f64::NAN);
    format!(
        "{:32} {:11} {:7} {:10} {:10.1} {:8.2} {:8.2} {:8.2} {:8.2}\n",
        scenes::short_name(value["scene"].as_str().unwrap_or_default()),
        value["triangles"],
        value["threads"],
        value["ray_count"],
        number("mean_batch"),
        number("mrays_per_second"),
        number("tracing_share"),
        number("tracing_mrays_per_second"),
        number("raw_mrays_per_second")
    )
}
