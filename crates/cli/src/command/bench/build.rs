//! `snell bench build`: build time and memory of acceleration structures, compared with Embree's.

use super::clock::{self, median};
use super::peer::{Peer, PeerPath, parse_peer};
use super::scenes::{self, Bench};
use super::variants;
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::{standard_output, threads};
use rayon::ThreadPool;
use serde_json::{Value, json};
use snell_embree::{BuildQuality, SceneOptions};
use snell_formats::ReadOptions;
use snell_intersect::BuildOptions;
use std::time::{Duration, Instant};

/// Options of `snell bench build`.
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
    /// Builds of each kind; the median is reported
    #[arg(
        long,
        value_name = "N",
        default_value_t = 5,
        value_parser = clap::value_parser!(u32).range(1..=1000),
    )]
    repeat: u32,
    /// Peer to compare with: embree=PATH, where PATH is its shared library or the wheel `embreex`
    /// from PyPI
    #[arg(long, value_name = "NAME=PATH", value_parser = parse_peer)]
    peer: Option<PeerPath>,
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
    let embree = options.peer.as_ref().map(PeerPath::load).transpose()?;
    for (i, name) in options.scenes.iter().enumerate() {
        let bench = scenes::load(name, &read)?;
        if i == 0 && !options.json {
            standard_output::write(heading().as_bytes())?;
        }
        for threads in clock::thread_counts(&options.threads) {
            let peer = embree.as_ref().map(|embree| Peer::new(embree, threads)).transpose()?;
            let pool = clock::pool(threads).map_err(Failure::Other)?;
            let own = variants.iter().map(|variant| Row::new(Way::Own(variant, &pool)));
            let layouts = if options.variants.compact { &[false, true][..] } else { &[false] };
            let of_peer = |peer| {
                BuildQuality::ALL.into_iter().flat_map(move |quality| {
                    layouts.iter().map(move |&compact| Row::new(Way::Peer(peer, quality, compact)))
                })
            };
            let mut rows: Vec<Row> = own.chain(peer.iter().flat_map(of_peer)).collect();
            // The builders take turns, so that other load on the machine affects all of them
            // equally.
            for _ in 0..options.repeat {
                for row in &mut rows {
                    // Threads of the previous build may still be looking for work, which would take
                    // time from this build.
                    std::thread::sleep(PAUSE);
                    row.build(&bench)?;
                }
            }
            for row in rows {
                let value = row.json(&bench, threads);
                let text = if options.json { format!("{value}\n") } else { table_row(&value) };
                standard_output::write(text.as_bytes())?;
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Pause before each build. It is short because, after a pause of 20 ms, a virtual machine with two
/// cores runs both threads of a build on one core for some milliseconds.
const PAUSE: Duration = Duration::from_millis(5);

/// A builder to measure.
enum Way<'a> {
    Own(&'a BuildOptions, &'a ThreadPool),
    /// The peer's builder, and whether the structure is to be compact.
    Peer(&'a Peer, BuildQuality, bool),
}

/// A builder and its measurements.
struct Row<'a> {
    way: Way<'a>,
    /// Seconds of each build.
    seconds: Vec<f64>,
    memory_bytes: u64,
}

impl<'a> Row<'a> {
    fn new(way: Way<'a>) -> Self {
        Self { way, seconds: Vec::new(), memory_bytes: 0 }
    }

    /// Builds once and records time and memory.
    fn build(&mut self, bench: &Bench) -> Result<(), Failure> {
        let (seconds, memory_bytes) = match &self.way {
            Way::Own(variant, pool) => {
                let builder = variants::builder_of(&bench.world);
                let start = Instant::now();
                let world = pool.install(|| builder.build(variant));
                let seconds = start.elapsed().as_secs_f64();
                (
                    seconds,
                    world
                        .map_err(|e| Failure::Scene(format!("{}: {e}", bench.name)))?
                        .memory_bytes(),
                )
            }
            Way::Peer(peer, quality, compact) => {
                let options = SceneOptions { quality: *quality, robust: false, compact: *compact };
                let scene = peer.build(&bench.world, options)?;
                (scene.build_seconds(), scene.memory_bytes().max(0) as u64)
            }
        };
        self.seconds.push(seconds);
        self.memory_bytes = memory_bytes;
        Ok(())
    }

    fn json(&self, bench: &Bench, threads: usize) -> Value {
        let triangles = bench.world.triangle_count();
        let seconds = median(&self.seconds);
        let (builder, accelerator, quality, compact) = match &self.way {
            Way::Own(variant, _) => (
                "Snell".into(),
                variant.accelerator.name(),
                variant.quality.name(),
                variant.compact,
            ),
            Way::Peer(peer, quality, compact) => {
                (format!("Embree {}", peer.version()), "bvh", quality.name(), *compact)
            }
        };
        json!({
            "scene": bench.name,
            "triangles": bench.world.instanced_triangle_count(),
            "unique_triangles": triangles,
            "builder": builder,
            "accelerator": accelerator,
            "quality": quality,
            "compact": compact,
            "threads": threads,
            "repeat": self.seconds.len(),
            "seconds": seconds,
            "mtriangles_per_second": triangles as f64 / seconds.max(1e-9) * 1e-6,
            "memory_bytes": self.memory_bytes,
            "bytes_per_triangle": self.memory_bytes as f64 / triangles.max(1) as f64,
        })
    }
}

fn heading() -> String {
    format!(
        "{:32} {:>11} {:13} {:21} {:7} {:7} {:>7} {:>10} {:>8} {:>11}\n",
        "scene",
        "triangles",
        "builder",
        "accelerator",
        "quality",
        "layout",
        "threads",
        "seconds",
        "Mtri/s",
        "bytes/tri"
    )
}

fn table_row(value: &Value) -> String {
    let text = |key: &str| value[key].as_str().unwrap_or_default();
    let number = |key: &str| value[key].as_f64().unwrap_or(f64::NAN);
    format!(
        "{:32} {:11} {:13} {:21} {:7} {:7} {:7} {:10.4} {:8.2} {:11.1}\n",
        scenes::short_name(text("scene")),
        value["unique_triangles"],
        text("builder"),
        text("accelerator"),
        text("quality"),
        variants::layout(value["compact"] == true),
        value["threads"],
        number("seconds"),
        number("mtriangles_per_second"),
        number("bytes_per_triangle")
    )
}
