//! `snell convert`: converts a scene to another format.

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::messages::{self, counted};
use crate::{scene_source, standard_output};
use serde_json::json;
use snell_formats::{ReadOptions, Written, check_scene_path, write_scene_as};
use snell_scene::Warning;
use std::path::{Path, PathBuf};

/// Options of `snell convert`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Scene or mesh file, `-` for standard input, or the name of a built-in scene
    input: PathBuf,
    /// File to write; its extension selects the format (`snell formats` lists the writable ones)
    output: PathBuf,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
    /// Print what was written, and what the format could not hold, as JSON
    #[arg(long)]
    json: bool,
    /// Change the scene: material.NAME.PARAMETER=VALUE, camera.…, light.NUMBER.…, medium.NUMBER.…,
    /// `ambient=[r,g,b]`; or NAME=VALUE, a parameter of a Mitsuba scene
    #[arg(short = 'D', long = "define", value_name = "key=value")]
    define: Vec<String>,
    /// Refuse to open files outside of the scene's folder
    #[arg(long)]
    confine: bool,
}

/// Reads a scene, writes it, and reports what was lost.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    check_scene_path(&options.output, options.force)?;
    let read = ReadOptions {
        confine: options.confine,
        exact: true,
        parameters: scene_source::parameters(&options.define),
        ..ReadOptions::default()
    };
    let mut scene = scene_source::load(&options.input, &read)?;
    scene_source::apply(&mut scene, &options.define)?;
    let written = write_scene_as(&options.output, &scene, options.force)?;
    if options.json {
        let text = format!("{:#}\n", as_json(&scene.warnings, &written));
        standard_output::write(text.as_bytes())?;
    } else {
        for warning in &scene.warnings {
            eprintln!("warning: {}", counted(warning));
        }
        for loss in &written.losses {
            eprintln!("lost: {}", counted(loss));
        }
        eprintln!("{}", summary(&options.output, &written));
    }
    Ok(ExitCode::SUCCESS)
}

fn summary(path: &Path, written: &Written) -> String {
    let beside = match written.files.len() - 1 {
        0 => String::new(),
        1 => " and 1 file beside it".into(),
        count => format!(" and {count} files beside it"),
    };
    let losses = match written.losses.len() {
        0 => "nothing was lost".into(),
        1 => "1 loss, see above".into(),
        count => format!("{count} losses, see above"),
    };
    format!("wrote {}{beside}; {losses}", path.display())
}

fn as_json(warnings: &[Warning], written: &Written) -> serde_json::Value {
    json!({
        "format": written.format,
        "files": written.files.iter().map(|p| p.display().to_string()).collect::<Vec<_>>(),
        "warnings": messages::as_json(warnings),
        "losses": messages::as_json(&written.losses),
    })
}
