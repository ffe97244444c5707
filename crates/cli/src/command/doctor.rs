//! `snell doctor`: finds flaws of a scene.

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::resources::admit;
use crate::{scene_source, standard_output};
use serde_json::{Value, json};
use snell_doctor::{Finding, Severity, examine};
use snell_formats::ReadOptions;
use snell_formats::error::one_line;
use snell_render::memory::of_scene;
use snell_scene::Scene;
use snell_scene::placed::distinct_triangles;
use std::path::PathBuf;

/// Options of `snell doctor`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Scene or mesh file, `-` for standard input, or the name of a built-in scene
    scene: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Refuse to open files outside of the scene's folder
    #[arg(long)]
    confine: bool,
}

/// Prints the findings. The exit code is 1 if there are errors or warnings, or if the scene cannot
/// be read; notes are not counted.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let read = ReadOptions { confine: options.confine, ..ReadOptions::default() };
    let shown = options.scene.display().to_string();
    let findings = match scene_source::load(&options.scene, &read) {
        Ok(scene) => {
            let failed = |e: String| Failure::Scene(format!("{shown}: {e}"));
            check_memory(&scene).map_err(failed)?;
            examine(&scene).map_err(|e| failed(e.to_string()))?
        }
        Err(Failure::Read(error)) if options.json => vec![Finding {
            check: "reader",
            severity: Severity::Error,
            object: String::new(),
            face: None,
            position: None,
            count: 1,
            message: error.to_string(),
            remedy: "correct the file",
        }],
        Err(failure) => return Err(failure),
    };
    let of = |severity| findings.iter().filter(|f| f.severity == severity).count();
    let counts = [of(Severity::Error), of(Severity::Warning), of(Severity::Note)];
    let text = if options.json {
        format!("{:#}\n", as_json(&shown, &findings, counts))
    } else {
        as_text(&shown, &findings, counts)
    };
    standard_output::write(text.as_bytes())?;
    Ok(if counts[0] + counts[1] > 0 { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

/// Refuses a scene if there is too little memory to examine it.
fn check_memory(scene: &Scene) -> Result<(), String> {
    // Bytes per triangle, for its connectivity and a structure for rays. The number was measured.
    const BYTES: u64 = 260;
    let triangles = distinct_triangles(scene);
    admit(
        &format!("to examine the scene ({triangles} triangles)"),
        triangles * BYTES + of_scene(scene),
    )
}

fn as_json(scene: &str, findings: &[Finding], [errors, warnings, notes]: [usize; 3]) -> Value {
    let finding = |f: &Finding| {
        json!({
            "severity": f.severity.name(),
            "check": f.check,
            "object": f.object,
            "face": f.face,
            "position": f.position,
            "count": f.count,
            "message": f.message,
            "remedy": f.remedy,
        })
    };
    json!({
        "scene": scene,
        "clean": errors + warnings == 0,
        "errors": errors,
        "warnings": warnings,
        "notes": notes,
        "findings": findings.iter().map(finding).collect::<Vec<_>>(),
    })
}

fn as_text(scene: &str, findings: &[Finding], [errors, warnings, notes]: [usize; 3]) -> String {
    let mut text = String::new();
    for f in findings {
        let object = if f.object.is_empty() { String::new() } else { format!("{}: ", f.object) };
        text += &format!(
            "{} ({}): {}{}\n",
            f.severity.name(),
            f.check,
            one_line(&object),
            one_line(&f.message)
        );
        let mut place = Vec::new();
        if let Some(face) = f.face {
            place.push(format!("face {face}"));
        }
        if let Some([x, y, z]) = f.position {
            place.push(format!("near {x:.4} {y:.4} {z:.4}"));
        }
        if !place.is_empty() {
            text += &format!("    where: {}\n", place.join(", "));
        }
        text += &format!("    to do: {}\n", f.remedy);
    }
    let plural =
        |n: usize, what: &str| if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") };
    let verdict = match (errors, warnings) {
        (0, 0) => "nothing is wrong".to_string(),
        _ => format!("{}, {}", plural(errors, "error"), plural(warnings, "warning")),
    };
    let notes = if notes == 0 { String::new() } else { format!(", {}", plural(notes, "note")) };
    text + &format!("{}: {verdict}{notes}\n", one_line(scene))
}
