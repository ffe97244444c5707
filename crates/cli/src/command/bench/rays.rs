//! `snell bench rays`: rays per second by kind, compared with Embree.

use super::clock::{self, Clock};
use super::contest::{Call, Contest, Opponent, Outcome};
use super::kinds::{self, Kind};
use super::peer::{Peer, PeerPath, contenders, parse_peer};
use super::scenes::{self, Bench};
use super::{dump, variants};
use crate::exit::ExitCode;
use crate::failure::{Failure, choice};
use crate::{standard_output, threads};
use serde_json::{Value, json};
use snell_embree::{BuildQuality, PeerScene, SceneOptions};
use snell_formats::ReadOptions;
use snell_intersect::{BuildOptions, Hit, World};
use snell_math::Ray;
use std::path::PathBuf;

/// Options of `snell bench rays`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Scenes: files, built-in scenes, `terrain` (4 million triangles) or `room` (1.8 million).
    /// `:subdivide=N` cuts each triangle into four, N times; `:copies=N` makes N copies in one
    /// mesh, `:instances=N` the same as instances
    #[arg(value_name = "SCENE", required = true)]
    scenes: Vec<String>,
    /// Kinds of rays: primary, shadow, diffuse, shuffled
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "primary,shadow,diffuse,shuffled"
    )]
    rays: Vec<String>,
    /// Numbers of threads. Default: 1 and one per core
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = threads::number())]
    threads: Vec<u32>,
    /// Ways of calling Snell: batch, or one (one ray per call, against the peer's one ray per call)
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "batch")]
    calls: Vec<String>,
    #[command(flatten)]
    variants: variants::Options,
    /// Runs of each side; the median is reported
    #[arg(
        long,
        value_name = "N",
        default_value_t = 5,
        value_parser = clap::value_parser!(u32).range(1..=1000),
    )]
    repeat: u32,
    /// Width and height of the picture whose rays are traced; a power of two
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = kinds::parse_side)]
    side: u32,
    /// Clock: wall, or processor (for a machine with other load)
    #[arg(long, value_name = "NAME", default_value = "wall")]
    clock: Clock,
    /// Peer to compare with: embree=PATH, where PATH is its shared library or the wheel `embreex`
    /// from PyPI
    #[arg(long, value_name = "NAME=PATH", value_parser = parse_peer)]
    peer: Option<PeerPath>,
    /// Also write the triangles, the rays and their hits, as NumPy arrays in a folder per scene
    #[arg(long, value_name = "FOLDER")]
    dump_rays: Option<PathBuf>,
    /// Print JSON, a line for each measurement
    #[arg(long)]
    json: bool,
    /// Refuse to open files outside of the scenes' folders
    #[arg(long)]
    confine: bool,
}

/// The measurements to make on every scene.
struct Plan<'a> {
    options: &'a Options,
    kinds: Vec<Kind>,
    threads: Vec<usize>,
    calls: Vec<Call>,
    variants: Vec<BuildOptions>,
    peer: Option<Peer>,
}

/// Measures and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let named = |name: &String| choice("kind of ray", name, &Kind::ALL, Kind::name);
    let call = |name: &String| choice("way to call", name, &Call::ALL, Call::name);
    options.scenes.iter().try_for_each(|name| scenes::check(name))?;
    let plan = Plan {
        options,
        kinds: options.rays.iter().map(named).collect::<Result<_, _>>()?,
        threads: clock::thread_counts(&options.threads),
        calls: options.calls.iter().map(call).collect::<Result<_, _>>()?,
        variants: options.variants.variants()?,
        peer: options
            .peer
            .as_ref()
            .map(|path| Peer::new(&path.load()?, threads::cores()))
            .transpose()?,
    };
    let read = ReadOptions { confine: options.confine, ..ReadOptions::default() };
    for (i, name) in options.scenes.iter().enumerate() {
        let scene = scenes::load(name, &read)?;
        if i == 0 && !options.json {
            standard_output::write(heading(plan.peer.as_ref()).as_bytes())?;
        }
        plan.measure(&scene)?;
    }
    Ok(ExitCode::SUCCESS)
}

impl Plan<'_> {
    fn measure(&self, bench: &Bench) -> Result<(), Failure> {
        let fail = |e: snell_intersect::WorldError| Failure::Scene(format!("{}: {e}", bench.name));
        let sight = variants::rebuilt(&bench.world, &BuildOptions::default()).map_err(fail)?;
        let first = kinds::first_hits(bench, &sight, self.options.side);
        let batches: Vec<(Kind, Vec<Ray>)> =
            self.kinds.iter().map(|&kind| (kind, kinds::rays(kind, bench, &first))).collect();
        drop(first);
        if let Some(folder) = &self.options.dump_rays {
            dump::write(folder, bench, &sight, &batches)?;
        }
        drop(sight);
        let peer_scenes = self.peer_scenes(&bench.world)?;
        for variant in &self.variants {
            let world = variants::rebuilt(&bench.world, variant).map_err(fail)?;
            for &threads in &self.threads {
                let pool = clock::pool(threads).map_err(Failure::Other)?;
                for (&call, (kind, rays)) in
                    self.calls.iter().flat_map(|c| batches.iter().map(move |b| (c, b)))
                {
                    let contenders = contenders(&peer_scenes, call == Call::One);
                    let contest = Contest {
                        pool: &pool,
                        clock: self.options.clock,
                        repeat: self.options.repeat as usize,
                        world: &world,
                        call,
                        grouping: kind.grouping(),
                        rays,
                        contenders: &contenders,
                    };
                    let outcome = match kind {
                        Kind::Shadow => contest.run::<bool>(),
                        _ => contest.run::<Hit>(),
                    };
                    let row = Row {
                        bench,
                        world: &world,
                        kind: *kind,
                        call,
                        count: rays.len(),
                        threads,
                        variant,
                    };
                    self.print(&row, &outcome)?;
                }
            }
        }
        Ok(())
    }

    /// Embree's scenes: of medium and of high quality, each in a fast and a robust form.
    fn peer_scenes(&self, world: &World) -> Result<Vec<PeerScene>, Failure> {
        let Some(peer) = &self.peer else { return Ok(Vec::new()) };
        let ways = [false, true]
            .map(|robust| [BuildQuality::Medium, BuildQuality::High].map(|q| (q, robust)));
        let options = |&(quality, robust): &_| SceneOptions { quality, robust, compact: false };
        ways.as_flattened().iter().map(|way| peer.build(world, options(way))).collect()
    }

    fn print(&self, row: &Row, outcome: &Outcome) -> Result<(), Failure> {
        let text = if self.options.json {
            format!("{}\n", self.json(row, outcome))
        } else {
            table_row(row, outcome)
        };
        standard_output::write(text.as_bytes())
    }

    fn json(&self, row: &Row, outcome: &Outcome) -> Value {
        let mut value = json!({
            "scene": row.bench.name,
            "triangles": row.world.instanced_triangle_count(),
            "unique_triangles": row.world.triangle_count(),
            "rays": row.kind.name(),
            "ray_count": row.count,
            "hits": outcome.hits,
            "threads": row.threads,
            "accelerator": row.variant.accelerator.name(),
            "quality": row.variant.quality.name(),
            "compact": row.variant.compact,
            "simd": row.world.simd().name(),
            "call": row.call.name(),
            "clock": self.options.clock.name(),
            "repeat": self.options.repeat,
            "mrays_per_second": row.rate(outcome.seconds),
        });
        let version = self.peer.as_ref().map(Peer::version);
        for (prefix, opponent) in [("peer", &outcome.opponent), ("robust_peer", &outcome.robust)] {
            let Some(opponent) = opponent else { continue };
            let of_peer = |name: &str| {
                if prefix == "peer" { name.to_string() } else { format!("robust_{name}") }
            };
            value[prefix] = json!({ "name": "Embree", "version": version, "mode": opponent.mode });
            value[format!("{prefix}_mrays_per_second")] = json!(row.rate(opponent.seconds));
            value[of_peer("ratio")] = json!(opponent.ratio);
            value[of_peer("agree")] = json!(opponent.agree);
        }
        value
    }
}

/// The measurements of one row.
struct Row<'a> {
    bench: &'a Bench,
    world: &'a World,
    kind: Kind,
    call: Call,
    count: usize,
    threads: usize,
    variant: &'a BuildOptions,
}

impl Row<'_> {
    fn rate(&self, seconds: f64) -> f64 {
        self.count as f64 / seconds * 1e-6
    }
}

fn heading(peer: Option<&Peer>) -> String {
    let mut text = String::from("Mrays/s, medians. ");
    match peer {
        Some(peer) => {
            text += &format!(
                "Peer: Embree {}, the fastest way that is not robust; then the fastest robust \
                    one.\n",
                peer.version()
            )
        }
        None => text += "No peer.\n",
    }
    text + &format!(
        "{:32} {:>11} {:9} {:5} {:>7} {:6} {:7} {:7} {:6} {:>8} {:>8} {:>6} {:>9} {:24} {:>8} \
            {:>6} {:>9}  {}\n",
        "scene",
        "triangles",
        "rays",
        "call",
        "threads",
        "accel",
        "quality",
        "layout",
        "simd",
        "snell",
        "peer",
        "ratio",
        "agree",
        "way",
        "robust",
        "ratio",
        "agree",
        "way"
    )
}

fn table_row(row: &Row, outcome: &Outcome) -> String {
    let name = scenes::short_name(&row.bench.name);
    let opponent = |o: &Option<Opponent>| match o {
        Some(o) => {
            format!(" {:8.2} {:6.2} {:9.6} {:24}", row.rate(o.seconds), o.ratio, o.agree, o.mode)
        }
        None => String::new(),
    };
    let text = format!(
        "{name:32} {:11} {:9} {:5} {:7} {:6} {:7} {:7} {:6} {:8.2}{}{}",
        row.world.instanced_triangle_count(),
        row.kind.name(),
        row.call.name(),
        row.threads,
        row.variant.accelerator.name(),
        row.variant.quality.name(),
        variants::layout(row.variant.compact),
        row.world.simd().name(),
        row.rate(outcome.seconds),
        opponent(&outcome.opponent),
        opponent(&outcome.robust)
    );
    text.trim_end().to_string() + "\n"
}
