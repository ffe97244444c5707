//! `snell bench accelerators`: all acceleration structures on one scene, and the growth of their
//! cost with the number of triangles.

mod growth;
mod measure;
mod plot;

use super::kinds::{Kind, parse_side};
use super::scenes::{self, Bench};
use super::variants;
use crate::exit::ExitCode;
use crate::failure::{Failure, choice};
use crate::{standard_output, threads};
use growth::Growth;
use measure::{Case, Measured, Measurer};
use serde_json::{Value, json};
use snell_formats::ReadOptions;
use snell_intersect::BuildOptions;
use snell_intersect::{AcceleratorKind, AcceleratorOptions};
use std::path::PathBuf;

/// Options of `snell bench accelerators`.
#[derive(Debug, clap::Args)]
#[group(id = "accelerators")]
pub struct Options {
    /// The scene, as in `snell bench rays`
    #[arg(value_name = "SCENE")]
    scene: String,
    /// Acceleration structures
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_values_t = AcceleratorKind::ALL.map(|k| k.name().to_string()),
    )]
    accelerator: Vec<String>,
    /// The largest number of triangles to which the scene is refined
    #[arg(long, value_name = "N", default_value_t = 1_200_000)]
    max_triangles: u64,
    /// Skip structures whose build would take longer than about this many seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0)]
    build_limit: f64,
    /// Seconds of tracing for each kind of ray
    #[arg(long, value_name = "SECONDS", default_value_t = 0.25)]
    seconds: f64,
    /// Width and height of the picture whose rays are traced; a power of two
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = parse_side)]
    side: u32,
    /// Write a plot for slides as SVG
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Print JSON, a line for each measurement
    #[arg(long)]
    json: bool,
    /// Refuse to open files outside of the scene's folder
    #[arg(long)]
    confine: bool,
}

/// Measures and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    scenes::check(&options.scene)?;
    if let Some(path) = &options.plot {
        snell_formats::atomic::check(path)?;
    }
    let named =
        |name: &String| choice("accelerator", name, &AcceleratorKind::ALL, AcceleratorKind::name);
    let kinds: Vec<AcceleratorKind> =
        options.accelerator.iter().map(named).collect::<Result<_, _>>()?;
    let read = ReadOptions { confine: options.confine, ..ReadOptions::default() };
    let bench = scenes::load(&options.scene, &read)?;
    let report = Report { options };
    let measurer =
        Measurer { side: options.side, seconds: options.seconds, build_limit: options.build_limit };
    report.structures(&bench, &kinds, &measurer)?;
    let sweep = report.resolutions(&bench, &measurer)?;
    report.switches(&bench, &kinds, &measurer)?;
    let growth = report.growth(&bench, &kinds, &measurer)?;
    if let Some(path) = &options.plot {
        let text = plot::svg(scenes::short_name(&options.scene), &growth, &sweep);
        snell_formats::atomic::write(path, text.as_bytes())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The output of the benchmark.
struct Report<'a> {
    options: &'a Options,
}

/// One point of the sweep over grid resolutions: the number of cells along the longest side, and
/// microseconds per diffuse ray.
type SweepPoint = (u32, f64);

impl Report<'_> {
    /// Prints one line: `text`, or `value` with `--json`.
    fn line(&self, value: &Value, text: String) -> Result<(), Failure> {
        let line = if self.options.json { format!("{value}\n") } else { text + "\n" };
        standard_output::write(line.as_bytes())
    }

    /// Prints a line that is not part of the JSON output.
    fn heading(&self, text: &str) -> Result<(), Failure> {
        if self.options.json {
            Ok(())
        } else {
            standard_output::write(format!("{text}\n").as_bytes())
        }
    }

    /// Measures all structures on the scene itself.
    fn structures(
        &self,
        bench: &Bench,
        kinds: &[AcceleratorKind],
        measurer: &Measurer,
    ) -> Result<(), Failure> {
        let triangles = bench.world.instanced_triangle_count();
        self.heading(&format!(
            "{}, {triangles} triangles: thousands of rays per second, one thread; and of a diffuse \
                ray the nodes, cells and primitives",
            scenes::short_name(&bench.name)
        ))?;
        self.heading(&format!(
            "{:20} {:>8} {:>8} {:>9} {:>9} {:>9} {:>9} {:>8} {:>8} {:>8}",
            "",
            "build s",
            "MB",
            "primary",
            "shadow",
            "diffuse",
            "shuffled",
            "nodes",
            "cells",
            "tests"
        ))?;
        let case = Case::new(bench, measurer)?;
        for &kind in kinds {
            let options = BuildOptions { accelerator: kind, ..BuildOptions::default() };
            let measured = measurer.measure(&case, &options, &Kind::ALL)?;
            let rate = |i: usize| measured.kinds[i].rays_per_second * 1e-3;
            let diffuse = &measured.kinds[2];
            let text = format!(
                "{:20} {:8.3} {:8.1} {:9.1} {:9.1} {:9.1} {:9.1} {:8.1} {:8.1} {:8.1}",
                kind.name(),
                measured.build_seconds,
                measured.memory_bytes as f64 * 1e-6,
                rate(0),
                rate(1),
                rate(2),
                rate(3),
                diffuse.nodes,
                diffuse.cells,
                diffuse.primitives
            );
            self.line(&self.json("structure", &options, triangles, &measured), text)?;
        }
        Ok(())
    }

    /// Measures the uniform grid at several resolutions without nested grids, and at its default
    /// resolution without and with nested grids.
    fn resolutions(&self, bench: &Bench, measurer: &Measurer) -> Result<Vec<SweepPoint>, Failure> {
        let triangles = bench.world.instanced_triangle_count();
        self.heading(
            "\nUniform grid by resolution (cells along the longest side): microseconds \
            for a diffuse ray",
        )?;
        let case = Case::new(bench, measurer)?;
        let fixed = (0..8).map(|i| (Some(2u32 << i), false));
        let mut sweep = Vec::new();
        for (grid_resolution, nested_grids) in fixed.chain([(None, false), (None, true)]) {
            let accelerator_options = AcceleratorOptions {
                grid_resolution,
                nested_grids,
                ..AcceleratorOptions::default()
            };
            let options = BuildOptions {
                accelerator: AcceleratorKind::Grid,
                accelerator_options,
                ..BuildOptions::default()
            };
            let measured = measurer.measure(&case, &options, &[Kind::Diffuse])?;
            let micros = 1e6 / measured.kinds[0].rays_per_second;
            let name = match grid_resolution {
                Some(n) => n.to_string(),
                None if nested_grids => "automatic, nested".into(),
                None => "automatic".into(),
            };
            sweep.extend(grid_resolution.map(|n| (n, micros)));
            let text = format!(
                "{name:20} {:8.3} s {:8.1} MB {micros:9.3} us {:8.1} cells {:8.1} tests",
                measured.build_seconds,
                measured.memory_bytes as f64 * 1e-6,
                measured.kinds[0].cells,
                measured.kinds[0].primitives
            );
            self.line(&self.json("resolution", &options, triangles, &measured), text)?;
        }
        Ok(sweep)
    }

    /// Measures the effect of front-to-back order and of testing the last hit first.
    fn switches(
        &self,
        bench: &Bench,
        kinds: &[AcceleratorKind],
        measurer: &Measurer,
    ) -> Result<(), Failure> {
        let triangles = bench.world.instanced_triangle_count();
        self.heading(
            "\nSwitches: thousands of rays per second, and tests per ray; primary, then diffuse",
        )?;
        let case = Case::new(bench, measurer)?;
        let switchable =
            |k: &&AcceleratorKind| !matches!(k, AcceleratorKind::None | AcceleratorKind::Bvh);
        for &accelerator in kinds.iter().filter(switchable) {
            for (name, front_to_back, last_hit_cache) in [
                ("as it is", true, false),
                ("unsorted", false, false),
                ("last hit first", true, true),
            ] {
                let has_order =
                    !matches!(accelerator, AcceleratorKind::Grid | AcceleratorKind::Octree);
                if !front_to_back && !has_order {
                    continue;
                }
                let accelerator_options = AcceleratorOptions {
                    front_to_back,
                    last_hit_cache,
                    ..AcceleratorOptions::default()
                };
                let options =
                    BuildOptions { accelerator, accelerator_options, ..BuildOptions::default() };
                let measured =
                    measurer.measure(&case, &options, &[Kind::Primary, Kind::Diffuse])?;
                let [a, b] = [&measured.kinds[0], &measured.kinds[1]];
                let text = format!(
                    "{:20} {name:15} {:9.1} {:9.1} {:9.1} {:9.1}",
                    accelerator.name(),
                    a.rays_per_second * 1e-3,
                    a.primitives,
                    b.rays_per_second * 1e-3,
                    b.primitives
                );
                self.line(&self.json("switch", &options, triangles, &measured), text)?;
            }
        }
        Ok(())
    }

    /// Measures the scene with fewer and with more triangles.
    fn growth(
        &self,
        bench: &Bench,
        kinds: &[AcceleratorKind],
        measurer: &Measurer,
    ) -> Result<Vec<Growth>, Failure> {
        self.heading("\nGrowth: microseconds for a diffuse ray by number of triangles")?;
        let mut growths: Vec<Growth> = kinds.iter().map(|&kind| Growth::new(kind)).collect();
        for (triangles, sized) in growth::sizes(bench, self.options.max_triangles)? {
            let case = Case::new(&sized, measurer)?;
            for growth in &mut growths {
                if growth.would_take(triangles) > measurer.build_limit {
                    continue;
                }
                let options = BuildOptions { accelerator: growth.kind, ..BuildOptions::default() };
                let measured =
                    measurer.measure(&case, &options, &[Kind::Primary, Kind::Diffuse])?;
                growth.add(triangles, &measured);
                let text = format!(
                    "{:20} {triangles:10} {:9.3} us {:9.1} nodes {:9.1} cells {:9.1} tests {:9.3} \
                        s to build",
                    growth.kind.name(),
                    1e6 / measured.kinds[1].rays_per_second,
                    measured.kinds[1].nodes,
                    measured.kinds[1].cells,
                    measured.kinds[1].primitives,
                    measured.build_seconds
                );
                self.line(&self.json("growth", &options, triangles, &measured), text)?;
            }
        }
        self.heading(
            "\nExponents: the cost of a ray grows as the number of triangles to this \
            power (time; nodes, cells and tests; time to build)",
        )?;
        for growth in &growths {
            let (time, work, build) = growth.exponents();
            let value = json!({
                "measurement": "exponent",
                "scene": self.options.scene,
                "accelerator": growth.kind.name(),
                "time_exponent": time,
                "work_exponent": work,
                "build_exponent": build,
            });
            self.line(
                &value,
                format!("{:20} {time:7.3} {work:7.3} {build:7.3}", growth.kind.name()),
            )?;
        }
        Ok(growths)
    }

    fn json(
        &self,
        measurement: &str,
        options: &BuildOptions,
        triangles: u64,
        measured: &Measured,
    ) -> Value {
        let switches = &options.accelerator_options;
        let rays: serde_json::Map<String, Value> = measured
            .kinds
            .iter()
            .map(|k| {
                let value = json!({
                    "mrays_per_second": k.rays_per_second * 1e-6,
                    "nodes": k.nodes,
                    "cells": k.cells,
                    "primitives": k.primitives,
                });
                (k.kind.name().to_string(), value)
            })
            .collect();
        json!({
            "measurement": measurement,
            "scene": self.options.scene,
            "triangles": triangles,
            "accelerator": options.accelerator.name(),
            "front_to_back": switches.front_to_back,
            "last_hit_cache": switches.last_hit_cache,
            "grid_resolution": switches.grid_resolution,
            "nested_grids": switches.nested_grids,
            "build_seconds": measured.build_seconds,
            "build_threads": threads::cores(),
            "memory_bytes": measured.memory_bytes,
            "references": measured.references,
            "rays": rays,
        })
    }
}

/// Rebuilds a world with other options.
fn rebuilt(bench: &Bench, options: &BuildOptions) -> Result<snell_intersect::World, Failure> {
    variants::rebuilt(&bench.world, options)
        .map_err(|e| Failure::Scene(format!("{}: {e}", bench.name)))
}
