//! `snell bench hidden-surfaces`: the classical visibility algorithms on one scene.

mod pictures;

use super::clock::{median, pool, timed};
use super::kinds::{self, parse_side};
use super::make_folder;
use super::scenes;
use super::variants;
use crate::exit::ExitCode;
use crate::failure::{Failure, choice};
use crate::standard_output;
use serde_json::{Map, Value, json};
use snell_formats::ReadOptions;
use snell_intersect::{BuildOptions, World};
use snell_lab::visible::{self, Characterization, HiddenLines, Method, Prepared, Screen, Seen};
use std::path::PathBuf;

/// A pixel centre this close to an edge, in pixels, may be on either side of it for a ray, whose
/// direction is rounded to `f32`.
const TOLERANCE: f64 = 1e-3;

/// Segments of lines shorter than this, in pixels, are not compared with rays.
const SHORT: f64 = 0.05;

/// A method is not run again after this many seconds.
const ENOUGH: f64 = 10.0;

/// Options of `snell bench hidden-surfaces`.
#[derive(Debug, clap::Args)]
#[group(id = "hidden_surfaces")]
pub struct Options {
    /// The scene, as in `snell bench rays`; triangles only, seen by a pinhole camera
    #[arg(value_name = "SCENE")]
    scene: String,
    /// Methods: ray-casting-all, ray-casting, z-buffer, scan-line-z, scan-line, depth-sort, bsp,
    /// bsp-front-to-back, warnock, weiler-atherton, quantitative-invisibility. Default: all
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    method: Vec<String>,
    /// Width and height of the picture in pixels; a power of two
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = parse_side)]
    side: u32,
    /// Runs of each method, but none after ten seconds; the median is reported
    #[arg(
        long,
        value_name = "N",
        default_value_t = 3,
        value_parser = clap::value_parser!(u32).range(1..=1000),
    )]
    repeat: u32,
    /// Also write what each method saw and where it worked, as PNG, and the visible lines, as SVG
    #[arg(long, value_name = "DIR")]
    image_folder: Option<PathBuf>,
    /// Print JSON, a line for each method
    #[arg(long)]
    json: bool,
    /// Refuse to open files outside of the scene's folder
    #[arg(long)]
    confine: bool,
}

/// An algorithm for surfaces, or for lines.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Surfaces(Method),
    Lines,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Surfaces(method) => method.name(),
            Self::Lines => HiddenLines::NAME,
        }
    }

    fn characterization(self) -> Characterization {
        match self {
            Self::Surfaces(method) => method.characterization(),
            Self::Lines => HiddenLines::CHARACTERIZATION,
        }
    }
}

/// The input of all methods.
struct Case<'a> {
    name: &'a str,
    world: &'a World,
    screen: &'a Screen,
    /// Seconds to build the acceleration structure.
    build: f64,
    /// Seconds to project all triangles.
    project: f64,
    /// What rays see in each pixel.
    rays: Seen,
    /// The content of the z-buffer.
    reference: Seen,
}

/// The measurements of a method.
struct Row {
    kind: Kind,
    outcome: Result<Measured, String>,
}

struct Measured {
    /// Seconds of view-independent preparation.
    prepare: Option<f64>,
    /// Seconds per picture.
    seconds: f64,
    runs: usize,
    memory: Option<usize>,
    work: Vec<(&'static str, u64)>,
    /// Share of pixels (for lines: of segments) that agree with rays.
    agree: f64,
    /// Number of the others for which rounding may decide.
    borderline: u64,
    /// Number of the rest.
    unexplained: u64,
    /// Share of pixels with the same triangle as the z-buffer.
    identical: Option<f64>,
    /// Mean and maximum work per pixel.
    cost: Option<(f64, u32)>,
}

/// Measures and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let kinds = methods(&options.method)?;
    scenes::check(&options.scene)?;
    let read = ReadOptions { confine: options.confine, ..ReadOptions::default() };
    let bench = scenes::load(&options.scene, &read)?;
    let fail = |e: &dyn std::fmt::Display| Failure::Scene(format!("{}: {e}", bench.name));
    let view = kinds::view(&bench.camera, options.side)
        .ok_or_else(|| fail(&visible::VisibleError::NotPinhole))?;
    let (screen, project) = timed(|| Screen::new(&bench.world, &view, [options.side; 2]));
    let screen = screen.map_err(|e| fail(&e))?;
    // The structure is built on one thread, because all methods are measured on one thread.
    let pool = pool(1).map_err(Failure::Other)?;
    let (world, build) =
        pool.install(|| timed(|| variants::rebuilt(&bench.world, &BuildOptions::default())));
    let world = world.map_err(|e| fail(&e))?;
    if let Some(folder) = &options.image_folder {
        make_folder(folder)?;
    }
    let once = |method| Prepared::new(method, &screen, &world)?.run(&screen, false);
    let rays = once(Method::RayCasting).map_err(|e| fail(&e))?;
    let reference = once(Method::ZBuffer).map_err(|e| fail(&e))?;
    let case =
        Case { name: &bench.name, world: &world, screen: &screen, build, project, rays, reference };
    if !options.json {
        standard_output::write(heading(&case).as_bytes())?;
    }
    let mut rows = Vec::new();
    for kind in kinds {
        let row = match kind {
            Kind::Surfaces(method) => surfaces(options, &case, method)?,
            Kind::Lines => lines(options, &case)?,
        };
        let line = if options.json { row.json(&case) } else { row.line() };
        standard_output::write(format!("{line}\n").as_bytes())?;
        rows.push(row);
    }
    if !options.json {
        standard_output::write(legend(&rows).as_bytes())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The methods with these names, or all.
fn methods(names: &[String]) -> Result<Vec<Kind>, Failure> {
    let all: Vec<Kind> = Method::ALL.map(Kind::Surfaces).into_iter().chain([Kind::Lines]).collect();
    match names {
        [] => Ok(all),
        _ => names.iter().map(|name| choice("method", name, &all, Kind::name)).collect(),
    }
}

/// Runs `work` as often as requested, but not again after [`ENOUGH`] seconds. Returns the last
/// result and the seconds of each run.
fn repeated<T, E>(repeat: u32, mut work: impl FnMut() -> Result<T, E>) -> Result<(T, Vec<f64>), E> {
    let (first, seconds) = timed(&mut work);
    let (mut last, mut times) = (first?, vec![seconds]);
    while times.len() < repeat as usize && times.iter().sum::<f64>() < ENOUGH {
        let (next, seconds) = timed(&mut work);
        last = next?;
        times.push(seconds);
    }
    Ok((last, times))
}

/// Measures a method that finds surfaces.
fn surfaces(options: &Options, case: &Case, method: Method) -> Result<Row, Failure> {
    let screen = case.screen;
    let (prepared, prepare) = timed(|| Prepared::new(method, screen, case.world));
    let run = prepared.and_then(|prepared| {
        let (seen, times) = repeated(options.repeat, || prepared.run(screen, false))?;
        let cost = if method.characterization().cost.is_some() {
            prepared.run(screen, true)?.cost
        } else {
            None
        };
        Ok((seen, times, cost))
    });
    let kind = Kind::Surfaces(method);
    let (mut seen, times, cost) = match run {
        Ok(run) => run,
        Err(e) => return Ok(Row { kind, outcome: Err(e.to_string()) }),
    };
    if method == Method::RayCasting {
        let [nodes, triangles] = visible::ray_work(screen, case.world);
        seen.work.extend([("nodes", nodes), ("tests", triangles)]);
    }
    if let Some(folder) = &options.image_folder {
        pictures::surfaces(folder, method, screen, &seen.items, cost.as_deref())?;
    }
    let (agree, borderline, unexplained) = compare(case, &seen.items);
    let pixels = seen.items.len() as f64;
    let same = seen.items.iter().zip(&case.reference.items).filter(|(a, b)| a == b).count();
    let prepare = match method {
        Method::Bsp | Method::BspFrontToBack => Some(prepare),
        Method::RayCasting | Method::WeilerAtherton => Some(case.build),
        _ => None,
    };
    let measured = Measured {
        prepare,
        seconds: median(&times),
        runs: times.len(),
        memory: seen.memory,
        work: seen.work,
        agree,
        borderline,
        unexplained,
        identical: Some(same as f64 / pixels),
        cost: cost.map(|c| {
            (
                c.iter().map(|&n| f64::from(n)).sum::<f64>() / pixels,
                c.iter().copied().max().unwrap_or(0),
            )
        }),
    };
    Ok(Row { kind, outcome: Ok(measured) })
}

/// Compares pixels with rays: the share that agrees, the number of other pixels that are so close
/// to an edge or another triangle that rounding may decide, and the number of the rest.
fn compare(case: &Case, items: &[u32]) -> (f64, u64, u64) {
    let width = case.screen.size()[0];
    let (mut same, mut borderline, mut unexplained) = (0u64, 0, 0);
    for (i, (&item, &ray)) in items.iter().zip(&case.rays.items).enumerate() {
        let (x, y) = (i as u32 % width, i as u32 / width);
        if item == ray {
            same += 1;
        } else if ray == visible::EDGE_ON || case.screen.is_borderline(x, y, item, ray, TOLERANCE) {
            borderline += 1;
        } else {
            unexplained += 1;
        }
    }
    (same as f64 / items.len().max(1) as f64, borderline, unexplained)
}

/// Measures hidden-line removal, and checks the middles of the segments by rays.
fn lines(options: &Options, case: &Case) -> Result<Row, Failure> {
    let run = repeated(options.repeat, || HiddenLines::new(case.screen));
    let (found, times) = match run {
        Ok(run) => run,
        Err(e) => return Ok(Row { kind: Kind::Lines, outcome: Err(e.to_string()) }),
    };
    if let Some(folder) = &options.image_folder {
        pictures::lines(folder, case.screen, &found)?;
    }
    let compared: Vec<_> = found.stretches.iter().filter(|s| s.length() > SHORT).collect();
    let (mut same, mut borderline, mut unexplained) = (0u64, 0, 0);
    for stretch in &compared {
        let is_hidden = stretch.invisibility > 0;
        if stretch.is_occluded(case.screen, case.world) == is_hidden {
            same += 1;
        } else if stretch.is_surely_hidden(case.screen, TOLERANCE) == is_hidden || is_hidden {
            borderline += 1;
        } else {
            unexplained += 1;
        }
    }
    let w = &found.work;
    let visible = found.stretches.iter().filter(|s| s.invisibility == 0).count() as u64;
    let measured = Measured {
        prepare: None,
        seconds: median(&times),
        runs: times.len(),
        memory: None,
        work: vec![
            ("edges", w.edges),
            ("contours", w.contours),
            ("comparisons", w.comparisons),
            ("crossings", w.crossings),
            ("piercings", w.piercings),
            ("faces", w.faces),
            ("counts", w.counts),
            ("stretches", found.stretches.len() as u64),
            ("visible", visible),
        ],
        agree: same as f64 / compared.len().max(1) as f64,
        borderline,
        unexplained,
        identical: None,
        cost: None,
    };
    Ok(Row { kind: Kind::Lines, outcome: Ok(measured) })
}

impl Row {
    fn line(&self) -> String {
        let name = self.kind.name();
        let m = match &self.outcome {
            Ok(measured) => measured,
            Err(why) => return format!("{name:25} left out: {why}"),
        };
        let number =
            |x: Option<f64>, digits: usize| x.map_or("-".into(), |x| format!("{x:.digits$}"));
        let work: Vec<String> =
            m.work.iter().map(|(what, count)| format!("{what} {count}")).collect();
        format!(
            "{name:25} {:>9} {:>9} {:>8} {:9.6} {:>10} {:>11} {:>9}  {}",
            number(m.prepare.map(|s| s * 1e3), 2),
            number(Some(m.seconds * 1e3), 2),
            number(m.memory.map(|n| n as f64 * 1e-6), 2),
            m.agree,
            m.borderline,
            m.unexplained,
            number(m.identical, 6),
            work.join(", ")
        )
    }

    fn json(&self, case: &Case) -> String {
        let kind = self.kind.characterization();
        let mut object = json!({
            "scene": case.name,
            "triangles": case.screen.triangle_count(),
            "facets": case.screen.facet_count(),
            "facets_at_centres": case.screen.sampled_count(),
            "edge_on": case.screen.edge_on_count(),
            "side": case.screen.size()[0],
            "project_seconds": case.project,
            "method": self.kind.name(),
            "space": kind.space.name(),
            "sorts": kind.sorts,
            "coherence": kind.coherence,
            "source": kind.source,
        });
        let fields = match &self.outcome {
            Err(why) => json!({ "left_out": why }),
            Ok(m) => json!({
                "left_out": null,
                "prepare_seconds": m.prepare,
                "seconds": m.seconds,
                "runs": m.runs,
                "memory_bytes": m.memory,
                "work": m.work.iter()
                    .map(|(what, count)| (what.replace(' ', "_"), json!(count)))
                    .collect::<Map<_, _>>(),
                "agree": m.agree,
                "borderline": m.borderline,
                "unexplained": m.unexplained,
                "identical": m.identical,
                "cost": kind.cost,
                "cost_mean": m.cost.map(|c| c.0),
                "cost_most": m.cost.map(|c| c.1),
            }),
        };
        if let (Value::Object(all), Value::Object(fields)) = (&mut object, fields) {
            all.extend(fields);
        }
        object.to_string()
    }
}

fn heading(case: &Case) -> String {
    let s = case.screen;
    format!(
        "{}, {} triangles, {side} x {side} pixels, one thread. Projected in {:.2} ms: {} in the \
            picture, {} at the centre of a pixel, {} seen edge-on\n\
         {:25} {:>9} {:>9} {:>8} {:>9} {:>10} {:>11} {:>9}  work\n",
        scenes::short_name(case.name),
        s.triangle_count(),
        case.project * 1e3,
        s.facet_count(),
        s.sampled_count(),
        s.edge_on_count(),
        "method",
        "before ms",
        "ms",
        "MB",
        "agree",
        "borderline",
        "unexplained",
        "identical",
        side = s.size()[0],
    )
}

/// The methods, in the terms of the 1974 paper.
fn legend(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let kind = row.kind.characterization();
        text += &format!("\n{} ({})\n", row.kind.name(), kind.source);
        text += &format!(
            "  decides in: {}; sorts {}\n  coherence: {}\n",
            kind.space.name(),
            kind.sorts,
            kind.coherence
        );
        if let (Some(what), Ok(Measured { cost: Some((mean, most)), .. })) =
            (kind.cost, &row.outcome)
        {
            text += &format!("  {what}: {mean:.2} on average, {most} at most\n");
        }
    }
    text
}
