//! `snell bench read`: speed and memory of reading files.

use super::clock::median;
use super::scenes::short_name;
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::resources::peak_memory_bytes;
use crate::standard_output;
use serde_json::{Value, json};
use snell_formats::mesh::read_mesh;
use snell_formats::{Input, ReadOptions, read_scene};
use snell_scene::{Geometry, Scene};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `snell bench read`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Scene or mesh files
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Read meshes exactly as in the file: make no shading normals for those without
    #[arg(long)]
    as_written: bool,
    /// Number of reads of each file; the median is reported
    #[arg(
        long,
        value_name = "N",
        default_value_t = 5,
        value_parser = clap::value_parser!(u32).range(1..=1000),
    )]
    repeat: u32,
    /// Print JSON, a line for each file
    #[arg(long)]
    json: bool,
    /// Refuse to open files outside of the scenes' folders
    #[arg(long)]
    confine: bool,
}

/// Measures and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let read = ReadOptions { confine: options.confine, ..ReadOptions::default() };
    for (number, path) in options.files.iter().enumerate() {
        let value = measure(path, &read, options)?;
        let heading = if number == 0 { heading() } else { String::new() };
        let text = if options.json { format!("{value}\n") } else { heading + &table_row(&value) };
        standard_output::write(text.as_bytes())?;
    }
    Ok(ExitCode::SUCCESS)
}

fn measure(path: &Path, read: &ReadOptions, options: &Options) -> Result<Value, Failure> {
    let name = path.display().to_string();
    let bytes = std::fs::metadata(path).map_or(0, |m| m.len());
    let before = peak_memory_bytes();
    let (mut seconds, mut triangles) = (Vec::new(), 0);
    for _ in 0..options.repeat {
        let start = Instant::now();
        // The time does not include freeing the scene.
        if options.as_written && is_mesh(path) {
            let mesh = read_mesh(&Input::open(path, read)?)?;
            seconds.push(start.elapsed().as_secs_f64());
            triangles = mesh.indices.len();
        } else {
            let scene = read_scene(path, read)?;
            seconds.push(start.elapsed().as_secs_f64());
            triangles = triangle_count(&scene);
        }
    }
    let memory = peak_memory_bytes().zip(before).map(|(after, before)| after - before);
    let seconds = median(&seconds);
    let rate = |amount: f64| amount / seconds.max(1e-9) * 1e-6;
    Ok(json!({
        "file": name,
        "bytes": bytes,
        "triangles": triangles,
        "as_written": options.as_written,
        "repeat": options.repeat,
        "seconds": seconds,
        "mb_per_second": rate(bytes as f64),
        "mtriangles_per_second": rate(triangles as f64),
        "memory_bytes": memory,
    }))
}

/// True for the names of files that hold a mesh and nothing else.
fn is_mesh(path: &Path) -> bool {
    let name = path.to_string_lossy().to_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    ["ply", "obj", "stl", "off", "ray"]
        .iter()
        .any(|extension| name.ends_with(&format!(".{extension}")))
}

/// Triangles of all meshes; a mesh counts once for each surface that uses it.
fn triangle_count(scene: &Scene) -> usize {
    let surfaces = scene.nodes.iter().flat_map(|node| &node.surfaces);
    surfaces
        .map(|s| if let Geometry::Mesh(mesh) = &s.geometry { mesh.indices.len() } else { 0 })
        .sum()
}

fn heading() -> String {
    format!(
        "{:32} {:>10} {:>11} {:>9} {:>9} {:>8} {:>10}\n",
        "file", "MB", "triangles", "seconds", "MB/s", "Mtri/s", "memory MB"
    )
}

fn table_row(value: &Value) -> String {
    let number = |key: &str| value[key].as_f64().unwrap_or(f64::NAN);
    format!(
        "{:32} {:10.2} {:11} {:9.4} {:9.1} {:8.2} {:10.1}\n",
        short_name(value["file"].as_str().unwrap_or_default()),
        number("bytes") * 1e-6,
        value["triangles"],
        number("seconds"),
        number("mb_per_second"),
        number("mtriangles_per_second"),
        number("memory_bytes") * 1e-6
    )
}
