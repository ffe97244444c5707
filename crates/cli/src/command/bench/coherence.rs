//! `snell bench coherence`: the rays of a picture traced one by one, in batches and packets, and as
//! beams, pencils and cones.

mod pictures;
mod ways;

use super::clock::{median, timed};
use super::kinds::{self, Kind, parse_side};
use super::make_folder;
use super::scenes::{self, Bench};
use super::variants;
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;
use serde_json::json;
use snell_formats::ReadOptions;
use snell_intersect::{BuildOptions, Hit, World};
use snell_lab::coherence::View;
use snell_math::{DVec2, Ray, Vec2};
use snell_scene::Camera;
use snell_scene::camera::CameraSample;
use std::path::PathBuf;
use ways::{Way, Work};

/// Options of `snell bench coherence`.
#[derive(Debug, clap::Args)]
#[group(id = "coherence")]
pub struct Options {
    /// The scene, as in `snell bench rays`; triangles only, seen by a pinhole camera
    #[arg(value_name = "SCENE")]
    scene: String,
    /// Width and height of the picture whose rays are traced; a power of two
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = parse_side)]
    side: u32,
    /// Runs of each method, except cones, which run once; the median is reported
    #[arg(
        long,
        value_name = "N",
        default_value_t = 3,
        value_parser = clap::value_parser!(u32).range(1..=1000),
    )]
    repeat: u32,
    /// Pencils may have this error, relative to the distance
    #[arg(long, value_name = "X", default_value_t = 1e-4, value_parser = parse_tolerance)]
    tolerance: f64,
    /// Also write the picture of each method, as PNG
    #[arg(long, value_name = "DIR")]
    image_folder: Option<PathBuf>,
    /// Print JSON, a line for each measurement
    #[arg(long)]
    json: bool,
    /// Refuse to open files outside of the scene's folder
    #[arg(long)]
    confine: bool,
}

fn parse_tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x < 0.1 => Ok(x),
        _ => Err(format!("\"{text}\" is not a tolerance; write a number above 0 and below 0.1")),
    }
}

/// A scene, its rays, and data that all methods use.
pub struct Case<'a> {
    pub bench: &'a Bench,
    pub world: &'a World,
    pub side: u32,
    /// The camera's projection; its places are in pixels.
    pub view: View,
    /// The diameter of the cone of each primary ray, per unit of distance.
    pub spreads: Vec<f32>,
    pub tolerance: f64,
    /// Radius of the ball that is the light for cones.
    pub light_radius: f64,
    /// Distances that differ by at most this count as equal.
    pub slack: f32,
}

/// Measures and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    scenes::check(&options.scene)?;
    let read = ReadOptions { confine: options.confine, ..ReadOptions::default() };
    let bench = scenes::load(&options.scene, &read)?;
    let fail = |e: &dyn std::fmt::Display| Failure::Scene(format!("{}: {e}", bench.name));
    let world = variants::rebuilt(&bench.world, &BuildOptions::default()).map_err(|e| fail(&e))?;
    // Fails before anything is measured if this world is not supported.
    snell_lab::coherence::BeamTracer::new(&world).map_err(|e| fail(&e))?;
    let view = kinds::view(&bench.camera, options.side).ok_or_else(|| {
        fail(&"beams, pencils and cones need a pinhole camera with a flat picture")
    })?;
    if let Some(folder) = &options.image_folder {
        make_folder(folder)?;
    }
    let first = kinds::first_hits(&bench, &world, options.side);
    let radius = world.bounds().radius();
    let case = Case {
        bench: &bench,
        world: &world,
        side: options.side,
        view,
        spreads: spreads(&bench.camera, options.side),
        tolerance: options.tolerance,
        light_radius: radius * 0.005,
        slack: radius as f32 * 1e-6,
    };
    let primary = kinds::rays(Kind::Primary, &bench, &first);
    let shadow = kinds::rays(Kind::Shadow, &bench, &first);
    if !options.json {
        standard_output::write(heading(&case).as_bytes())?;
    }
    let mut closest = Vec::new();
    measure::<Hit>(options, &case, Kind::Primary, &primary, |way, hits| closest.push((way, hits)))?;
    let mut occluded = Vec::new();
    measure::<bool>(options, &case, Kind::Shadow, &shadow, |way, blocked| {
        occluded.push((way, blocked))
    })?;
    if let Some(folder) = &options.image_folder {
        pictures::write(folder, &case, &first, &closest, &occluded)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Traces rays by all methods, compares the results with the first method's, and prints.
fn measure<A: ways::Answers>(
    options: &Options,
    case: &Case,
    kind: Kind,
    rays: &[Ray],
    mut keep: impl FnMut(Way, Vec<A>),
) -> Result<(), Failure> {
    let mut exact: Vec<A> = Vec::new();
    for way in Way::ALL {
        let mut answers = vec![A::default(); rays.len()];
        let mut times = Vec::new();
        let mut extra = ways::Extra::default();
        // Cones are slow enough to be measured once.
        let repeat = if way == Way::Cones { 1 } else { options.repeat };
        for _ in 0..repeat {
            let (traced, seconds) = timed(|| A::trace(way, case, rays, &mut answers));
            extra = traced.map_err(|e| Failure::Scene(e.to_string()))?;
            times.push(seconds);
        }
        let work = extra.work.or_else(|| A::work(way, case, rays));
        if exact.is_empty() {
            exact.clone_from(&answers);
        }
        // A cone is wider than its ray: it hits if more than half of it is covered.
        let agrees = |(a, b): &(&A, &A)| match way {
            Way::Cones => a.is_hit() == b.is_hit(),
            _ => a.agrees(b, case.slack),
        };
        let both = || answers.iter().zip(&exact);
        let count = rays.len().max(1) as f64;
        let row = Row {
            kind,
            way,
            count: rays.len(),
            mrays: rays.len() as f64 / median(&times) * 1e-6,
            work,
            traced: extra.traced.map(|n| n as f64 / count),
            identical: both().filter(|(a, b)| a == b).count() as f64 / count,
            agree: both().filter(agrees).count() as f64 / count,
        };
        row.print(options, case)?;
        keep(way, answers);
    }
    Ok(())
}

/// The measurements of a method.
struct Row {
    kind: Kind,
    way: Way,
    count: usize,
    mrays: f64,
    work: Option<Work>,
    /// Share of the rays that fell back to tracing one by one.
    traced: Option<f64>,
    /// Share of the rays with the same result as one by one, bit for bit.
    identical: f64,
    /// Share of the rays whose result [agrees](super::contest::Answer::agrees) with that of tracing
    /// one by one.
    agree: f64,
}

impl Row {
    fn print(&self, options: &Options, case: &Case) -> Result<(), Failure> {
        let per_ray = |n: u64| n as f64 / self.count.max(1) as f64;
        let nodes = self.work.map(|w| per_ray(w.nodes));
        let tests = self.work.map(|w| per_ray(w.tests));
        let line = if options.json {
            json!({
                "scene": case.bench.name,
                "triangles": case.world.instanced_triangle_count(),
                "rays": self.kind.name(),
                "ray_count": self.count,
                "way": self.way.name(),
                "repeat": options.repeat,
                "mrays_per_second": self.mrays,
                "nodes": nodes,
                "tests": tests,
                "traced": self.traced,
                "identical": self.identical,
                "agree": self.agree,
            })
            .to_string()
        } else {
            let number =
                |x: Option<f64>, digits: usize| x.map_or("-".into(), |x| format!("{x:.digits$}"));
            format!(
                "{:8} {:8} {:10.3} {:>8} {:>8} {:>8} {:9.6} {:9.6}",
                self.kind.name(),
                self.way.name(),
                self.mrays,
                number(nodes, 2),
                number(tests, 2),
                number(self.traced, 4),
                self.identical,
                self.agree
            )
        };
        standard_output::write(format!("{line}\n").as_bytes())
    }
}

fn heading(case: &Case) -> String {
    format!(
        "{}, {} triangles, {side} x {side} pixels, one thread: millions of rays per second; nodes \
            and triangles per ray; share traced as single rays\n{:8} {:8} {:>10} {:>8} {:>8} {:>8} \
            {:>9} {:>9}\n",
        scenes::short_name(&case.bench.name),
        case.world.instanced_triangle_count(),
        "rays",
        "way",
        "Mrays/s",
        "nodes",
        "tests",
        "traced",
        "identical",
        "agree",
        side = case.side
    )
}

/// The spread of the pixels' cones, in the order of primary rays.
fn spreads(camera: &Camera, side: u32) -> Vec<f32> {
    let spread = |i: u32| {
        let (x, y) = (kinds::even_bits(i), kinds::even_bits(i >> 1));
        let film = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        camera.ray(&CameraSample { film, lens: Vec2::ZERO }, [side; 2]).spread
    };
    (0..side * side).map(spread).collect()
}
