//! USD stages, which a Python with the package `usd-core` reads: `python/snell/usd.py` turns them into Snell's own format.
//!
//! The module is part of this program and is handed to Python as its input, so that `snell` works whether or not the Python package of Snell
//! is installed.

use crate::failure::Failure;
use snell_formats::{ReadOptions, read_scene_bytes};
use snell_scene::Scene;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// The converter.
const MODULE: &str = include_str!("../../../python/snell/usd.py");
/// Exit code of the module where `usd-core` is missing.
const NO_PACKAGE: i32 = 3;
/// What to do about it.
const REMEDY: &str = "install it with: pip install usd-core (or pip install 'snell[usd]'), in a Python that is found as python3 or python";

/// True for the names of USD files.
pub fn is_usd(path: &Path) -> bool {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    matches!(extension.as_str(), "usd" | "usda" | "usdc" | "usdz")
}

/// Reads a stage.
pub fn load(path: &Path, options: &ReadOptions) -> Result<Scene, Failure> {
    let shown = path.display();
    let mut lacking = false;
    for python in ["python3", "python"] {
        let Some(output) = run(python, path).map_err(|e| Failure::Scene(format!("{shown}: {python}: {e}")))? else {
            continue;
        };
        if output.status.code() == Some(NO_PACKAGE) {
            lacking = true;
            continue;
        }
        let said = String::from_utf8_lossy(&output.stderr);
        if !output.status.success() {
            let last = said.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or("it said nothing");
            let problem = last.trim().trim_start_matches("error: ");
            return Err(Failure::Scene(format!("{shown}: cannot be read as USD: {problem}")));
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut scene = read_scene_bytes(&shown.to_string(), output.stdout, folder, options)?;
        for remark in said.lines().filter_map(|line| line.strip_prefix("warning: ")) {
            scene.warn(format!("{shown}: {remark}"));
        }
        return Ok(scene);
    }
    let problem = if lacking { "reading USD needs the Python package usd-core" } else { "reading USD needs Python" };
    Err(Failure::Scene(format!("{shown}: {problem}; {REMEDY}")))
}

/// Runs the module; `None` if there is no such Python.
fn run(python: &str, path: &Path) -> std::io::Result<Option<std::process::Output>> {
    let mut command = Command::new(python);
    command.arg("-").arg(path).arg("-").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    if let Some(mut input) = child.stdin.take() {
        // A Python that ends early says why by itself.
        _ = input.write_all(MODULE.as_bytes());
    }
    child.wait_with_output().map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usd_files_are_known_by_their_names() {
        for name in ["a.usd", "b.USDA", "c/d.usdc", "e.usdz"] {
            assert!(is_usd(Path::new(name)), "{name}");
        }
        assert!(!is_usd(Path::new("a.usd.gz")) && !is_usd(Path::new("usdz")));
    }
}
