//! The tests of the Python package, in a virtual environment of their own: `target/python/venv`.

use crate::run;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What the tests need, one requirement a line.
const REQUIREMENTS: &str = "python/requirements-test.txt";

/// The first Python that is new enough: of the variable `PYTHON`, or what the usual names give.
fn interpreter() -> Option<String> {
    let check = "import sys, venv; sys.exit(sys.version_info < (3, 10))";
    let named = std::env::var("PYTHON").ok();
    let is_usable = |name: &String| Command::new(name).args(["-c", check]).output().is_ok_and(|o| o.status.success());
    named.into_iter().chain(["python3".into(), "python".into()]).find(is_usable)
}

/// The environment with all that the tests need; made if it is not there or needs something else now.
fn environment(root: &Path) -> Option<PathBuf> {
    let folder = root.join("target/python/venv");
    let programs = folder.join(if cfg!(windows) { "Scripts" } else { "bin" });
    let wanted = std::fs::read_to_string(root.join(REQUIREMENTS)).ok()?;
    let marker = folder.join("requirements.txt");
    if std::fs::read_to_string(&marker).is_ok_and(|installed| installed == wanted) {
        return Some(programs);
    }
    let Some(python) = interpreter() else {
        println!("xtask: Python 3.10 or later with the module venv is not here (PYTHON names another program)");
        return None;
    };
    let mut make = Command::new(python);
    make.args(["-m", "venv"]).arg(&folder);
    let mut install = Command::new(programs.join("python"));
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"]).arg(root.join(REQUIREMENTS));
    let made = run("virtual environment", make) && run("installation of what the Python tests need", install);
    made.then(|| std::fs::write(marker, wanted)).and_then(Result::ok).map(|()| programs)
}

/// Builds the package and runs its tests; checks that the stubs say what the module has. `None` without Python.
pub fn test() -> Option<bool> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let programs = environment(&root)?;
    let command = |arguments: &[&str]| {
        let mut command = Command::new(programs.join("python"));
        command.args(arguments).current_dir(&root).env("VIRTUAL_ENV", root.join("target/python/venv"));
        command
    };
    let steps: [(&str, &[&str]); 4] = [
        ("build of the Python package", &["-m", "maturin", "develop", "--profile", "dev", "--quiet"]),
        ("Python tests", &["-m", "pytest", "--quiet"]),
        (
            "Python stubs",
            &[
                "-m",
                "mypy.stubtest",
                "snell",
                "--allowlist",
                "python/stubtest-allowlist.txt",
                "--ignore-unused-allowlist",
                "--mypy-config-file",
                "pyproject.toml",
            ],
        ),
        ("Python types", &["-m", "mypy", "--strict", "python/snell"]),
    ];
    Some(steps.into_iter().all(|(what, arguments)| run(what, command(arguments))))
}
