//! `snell explain`: explains the colour of a pixel.

use super::view::{self, Files};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;
use snell_intersect::AcceleratorKind;
use snell_render::CompiledScene;
use snell_viewer::explain::{self, Question, Subject};
use snell_viewer::{Source, Which};
use std::ffi::OsString;
use std::path::PathBuf;

/// In scenes with more triangles than this, the ray is followed only through the structure in use,
/// unless the user asks for others: some structures take long to build.
const MANY_TRIANGLES: u64 = 300_000;

/// Options of `snell explain`.
#[derive(Debug, clap::Args)]
#[command(args_override_self = true)]
pub struct Options {
    /// Scene or mesh file, or the name of a built-in scene
    scene: PathBuf,
    /// The pixel: column and row from the upper left corner, from 0
    #[arg(long, value_name = "X,Y", value_parser = parse_pixel, allow_hyphen_values = true)]
    pixel: [u32; 2],
    /// The sample whose path is shown, from 0. Default: the one whose colour is closest to that of
    /// the pixel
    #[arg(long, value_name = "N")]
    sample: Option<u32>,
    /// Structures through which the camera ray is followed: names, `all` or `none`. Default: all;
    /// in scenes of more than 300000 triangles only the one in use
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    structures: Option<Vec<String>>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write a drawing to this file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Options of `snell render`, after `--`: those of the picture to which the pixel belongs, such
    /// as `-- --size 800x600 --spp 256`
    #[arg(last = true, value_name = "RENDER OPTIONS")]
    render: Vec<OsString>,
}

impl Options {
    /// The number of threads in the render's options.
    pub fn threads(&self) -> usize {
        view::threads_of(&self.render)
    }
}

fn parse_pixel(text: &str) -> Result<[u32; 2], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    numbers
        .and_then(|n| n.try_into().ok())
        .ok_or_else(|| "a pixel is a column and a row, such as 320,240".into())
}

/// Renders the pixel and explains it.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let files = Files::new(&options.scene, &options.render)?;
    let opened = files.open(Which::Given).map_err(Failure::Scene)?;
    let (scene, settings) = (&opened.scene, &opened.settings);
    let failed = |e: String| Failure::Scene(format!("{}: {e}", options.scene.display()));
    let compiled = CompiledScene::new(scene, &settings.build).map_err(|e| failed(e.to_string()))?;
    let kinds = kinds(options, compiled.world.stats().triangles, settings.build.accelerator)?;
    let structures = explain::structures(scene, settings, &kinds).map_err(failed)?;
    let subject = Subject { scene, compiled: &compiled, camera: &opened.camera, settings };
    let question = Question { pixel: options.pixel, sample: options.sample };
    let report = explain::report(subject, &question, &structures).map_err(Failure::Usage)?;
    if let Some(path) = &options.svg {
        snell_formats::atomic::write(path, explain::svg::svg(&report).as_bytes())?;
    }
    let text = if options.json {
        serde_json::to_string_pretty(&report).map_err(|e| Failure::Other(e.to_string()))? + "\n"
    } else if options.svg.is_some() {
        String::new()
    } else {
        explain::text::text(&report)
    };
    standard_output::write(text.as_bytes())?;
    Ok(ExitCode::SUCCESS)
}

/// The structures to follow the ray through.
fn kinds(
    options: &Options,
    triangles: u64,
    used: AcceleratorKind,
) -> Result<Vec<AcceleratorKind>, Failure> {
    let words: Vec<&str> = match &options.structures {
        Some(words) => words.iter().map(String::as_str).collect(),
        None if triangles > MANY_TRIANGLES => return Ok(vec![used]),
        None => vec!["all"],
    };
    match words[..] {
        ["all"] => return Ok(AcceleratorKind::ALL.to_vec()),
        ["none"] if options.structures.as_ref().is_some_and(|w| w.len() == 1) => {
            return Ok(Vec::new());
        }
        _ => {}
    }
    let kind = |name: &&str| {
        AcceleratorKind::from_name(name).ok_or_else(|| {
            let names: Vec<_> = AcceleratorKind::ALL.iter().map(|k| k.name()).collect();
            Failure::Usage(format!(
                "--structures {name}: there are {}, and `all`",
                names.join(", ")
            ))
        })
    };
    words.iter().map(kind).collect()
}
