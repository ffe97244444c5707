//! USD stages, which a Python with the package `usd-core` reads: the modules of `python/snell/usd` turn them into Snell's own format.
//!
//! They are part of this program and are handed to Python as its input, so that `snell` works whether or not the Python package of Snell
//! is installed.

use crate::failure::Failure;
use snell_formats::{ReadOptions, read_scene_bytes};
use snell_scene::Scene;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// A module of the converter: its name, and its text.
macro_rules! modules {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!("../../../python/snell/usd/", $name, ".py")))),*]
    };
}
/// The modules of the converter; the first is the package itself.
const MODULES: [(&str, &str); 14] = modules![
    "__init__",
    "_motion",
    "_context",
    "_polygons",
    "_networks",
    "_materials",
    "_bindings",
    "_meshes",
    "_shapes",
    "_curves",
    "_cameras",
    "_lights",
    "_tree",
    "__main__",
];
/// What makes modules of their texts, and runs the last: a finder, so that a module is run when it is imported.
const START: &str = r#"
import importlib.abc, importlib.machinery, sys
class Carried(importlib.abc.MetaPathFinder, importlib.abc.InspectLoader):
    def find_spec(self, name, path=None, target=None):
        if name in TEXTS:
            return importlib.machinery.ModuleSpec(name, self, origin=name, is_package=self.is_package(name))
    def is_package(self, name):
        return name == "snell_usd"
    def get_source(self, name):
        return TEXTS[name]
sys.meta_path.insert(0, Carried())
from snell_usd.__main__ import main
sys.exit(main(sys.argv[1:]))
"#;
/// Exit code of the converter where `usd-core` or NumPy is missing.
const NO_PACKAGE: i32 = 3;
/// What to do about it.
const REMEDY: &str = "install what reads it with: pip install usd-core numpy (or pip install 'snell[usd]'), in a Python that is found as python3 or python";

/// Endings of the names of USD files.
pub const EXTENSIONS: &[&str] = &["usd", "usda", "usdc", "usdz"];

/// True for the names of USD files.
pub fn is_usd(path: &Path) -> bool {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    EXTENSIONS.contains(&extension.as_str())
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
    let problem =
        if lacking { "reading USD needs the Python packages usd-core and numpy" } else { "reading USD needs Python" };
    Err(Failure::Scene(format!("{shown}: {problem}; {REMEDY}")))
}

/// Runs the converter; `None` if there is no such Python.
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
        _ = input.write_all(program().as_bytes());
    }
    child.wait_with_output().map(Some)
}

/// The converter as one program, which Python can read from its input.
fn program() -> String {
    let mut text = String::from("TEXTS = {\n");
    for (name, source) in MODULES {
        let module = if name == "__init__" { "snell_usd".into() } else { format!("snell_usd.{name}") };
        // What JSON writes of a text is a literal of Python.
        text += &format!("{module:?}: {},\n", serde_json::Value::from(source));
    }
    text + "}\n" + START
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

    #[test]
    fn every_module_of_the_converter_is_carried() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../python/snell/usd"));
        let mut found: Vec<String> = std::fs::read_dir(folder)
            .expect("the folder is there")
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|e| e == "py"))
            .map(|path| path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default())
            .collect();
        found.sort();
        let mut carried: Vec<String> = MODULES.iter().map(|(name, _)| (*name).to_owned()).collect();
        carried.sort();
        assert_eq!(carried, found);
    }
}
