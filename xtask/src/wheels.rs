//! The wheels of the Python package, which have the command too: `target/wheels`.

use crate::toolchain::Toolchain;
use crate::{python, run};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

const FOLDER: &str = "target/wheels";

/// The oldest Linux systems that wheels for Linux suit: those with glibc 2.17, of 2012.
const LINUX: &str = "manylinux2014";

/// The programs that make wheels, in an environment of their own.
const REQUIREMENTS: &str = "packaging/requirements.txt";

/// Builds a wheel for this machine, or for each target named, checks which systems it suits,
/// installs it where there is no Rust, and uses it. `None` without Python.
pub fn build(targets: impl Iterator<Item = String>) -> Option<bool> {
    let folder = python::root().join("target/packaging/venv");
    let programs = python::environment(&python::root(), &folder, REQUIREMENTS)?;
    let started = SystemTime::now();
    let mut targets: Vec<_> = targets.collect();
    if targets.is_empty() {
        targets.extend(Toolchain::host());
    }
    for target in &targets {
        let toolchain = match Toolchain::linked_by_zig(target) {
            Ok(toolchain) => toolchain,
            Err(error) => {
                eprintln!("xtask: {error}");
                return Some(false);
            }
        };
        let mut maturin = python::python(&programs, &["-m", "maturin", "build", "--release"]);
        maturin.env("CARGO_ZIGBUILD_PYTHON_PATH", programs.join("python"));
        maturin.args(["--zig", "--out", FOLDER, "--target", target]);
        if target.contains("linux") {
            maturin.args(["--compatibility", LINUX]);
        }
        toolchain.hand_to(&mut maturin);
        if !run("build of the wheel", maturin) {
            return Some(false);
        }
    }
    let wheels = made_since(&python::root().join(FOLDER), started);
    wheels.iter().for_each(|wheel| audit(&programs, wheel));
    let mut check = python::python(&programs, &["packaging/check_wheel.py"]);
    check.args(&wheels);
    Some(run("check of the wheels", check))
}

/// The wheels that were written after this time.
fn made_since(folder: &Path, time: SystemTime) -> Vec<PathBuf> {
    let is_new = |path: &PathBuf| {
        path.extension().is_some_and(|e| e == "whl")
            && path.metadata().and_then(|known| known.modified()).is_ok_and(|made| made >= time)
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut wheels: Vec<_> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_new).collect();
    wheels.sort();
    wheels
}

/// Prints which Linux systems a wheel suits.
fn audit(programs: &Path, wheel: &Path) {
    if !wheel.to_string_lossy().contains("linux") {
        return;
    }
    match Command::new(programs.join("auditwheel")).arg("show").arg(wheel).output() {
        Ok(output) => print!("{}", String::from_utf8_lossy(&output.stdout)),
        Err(error) => println!("xtask: not audited: auditwheel: {error}"),
    }
}
