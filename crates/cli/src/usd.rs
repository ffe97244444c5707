//! USD stages, read by a Python with the package `usd-core`: the modules of `python/snell/usd`
//! convert them to Snell's own format.
//!
//! The modules are part of this program and are passed to Python on standard input, so that `snell`
//! works whether or not Snell's Python package is installed.

mod converter;
mod process;

use crate::failure::Failure;
pub use process::prefer_interpreter;
use process::{Answer, End};
use snell_formats::open::{self, NamedBy};
use snell_formats::{Place, ReadError, ReadOptions, read_stage};
use snell_scene::Scene;
use std::path::Path;

/// Exit code of the converter if `usd-core` or NumPy is missing.
const NO_PACKAGE: i32 = 3;
/// The remedy for a missing package.
const INSTALL: &str = "install what reads it with: pip install usd-core numpy (or pip install \
    'snell[usd]'), in a Python \
    that is found as python3 or python";
/// The remedy for a stage that exceeds a limit.
const BY_HAND: &str =
    "split the stage, or convert it without these limits: python3 -m snell.usd IN OUT.snell";

/// Extensions of USD files.
pub const EXTENSIONS: &[&str] = &["usd", "usda", "usdc", "usdz"];

/// True for the names of USD files.
pub fn is_usd(path: &Path) -> bool {
    let extension =
        path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    EXTENSIONS.contains(&extension.as_str())
}

/// Reads a stage.
pub fn load(path: &Path, options: &ReadOptions) -> Result<Scene, Failure> {
    let error = |problem: &str, remedy: &str| {
        let file = path.display().to_string();
        ReadError { file, place: Place::Whole, problem: problem.into(), remedy: remedy.into() }
    };
    open::open(path, NamedBy::User).map_err(|refused| error(&refused.problem, refused.remedy))?;
    let unreadable = |e: std::io::Error| {
        error(&format!("cannot be read as USD: {e}"), "check that Python works")
    };
    let mut problem = "reading USD needs Python";
    for python in process::interpreters(path) {
        let answer = process::run(&python, path, options).map_err(unreadable)?;
        match answer.end {
            End::Exit(0) => return scene(path, answer, options),
            End::Exit(NO_PACKAGE) => {
                problem = "reading USD needs the Python packages usd-core and numpy"
            }
            End::Exit(_) => {
                let shown = format!("{}: ", path.display());
                let last = answer
                    .said
                    .lines()
                    .rev()
                    .find(|l| !l.trim().is_empty())
                    .unwrap_or("Python printed nothing");
                let last = last.strip_prefix("error: ").unwrap_or(last);
                return Err(error(last.strip_prefix(&shown).unwrap_or(last).trim(), "").into());
            }
            End::Killed(status) => {
                let problem =
                    format!("its reader was killed ({status}), perhaps for lack of memory");
                return Err(error(&problem, BY_HAND).into());
            }
            End::TooLong => {
                let problem =
                    format!("reading it took more than {} minutes", process::TIME.as_secs() / 60);
                return Err(error(&problem, BY_HAND).into());
            }
            End::TooLarge => {
                let problem =
                    format!("becomes more than {} bytes, the limit", options.limits.file_bytes);
                return Err(error(&problem, "split the stage").into());
            }
        }
    }
    Err(error(problem, INSTALL).into())
}

/// Reads the scene that the converter wrote, and adds the converter's warnings.
fn scene(path: &Path, answer: Answer, options: &ReadOptions) -> Result<Scene, Failure> {
    let shown = path.display().to_string();
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut scene = read_stage(&shown, answer.scene, folder, options)?;
    for remark in answer.said.lines().filter_map(|line| line.strip_prefix("warning: ")) {
        scene.warn(format!("{shown}: {remark}"));
    }
    Ok(scene)
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
