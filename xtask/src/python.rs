//! The tests of the Python package, in their own virtual environment: `target/python/venv`.

use crate::{build_as_tested, run, run_quietly};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The requirements of the tests, one per line.
const REQUIREMENTS: &str = "python/requirements-test.txt";

/// Makes the environment import the package from `python/`.
const LINK: &str = "import pathlib, sysconfig
pathlib.Path(sysconfig.get_path('purelib'), \
'snell.pth').write_text(str(pathlib.Path('python').resolve()))";

/// The first Python that is new enough: from the variable `PYTHON`, or from the usual names.
fn interpreter() -> Option<String> {
    let check = "import sys, venv; sys.exit(sys.version_info < (3, 10))";
    let named = std::env::var("PYTHON").ok();
    let is_usable = |name: &String| {
        Command::new(name).args(["-c", check]).output().is_ok_and(|o| o.status.success())
    };
    named.into_iter().chain(["python3".into(), "python".into()]).find(is_usable)
}

/// The environment with everything that the tests need.
pub fn test_environment(root: &Path) -> Option<PathBuf> {
    environment(root, &root.join("target/python/venv"), REQUIREMENTS)
}

/// The programs of a virtual environment with the packages of a list; created if it is absent or
/// the list has changed.
pub fn environment(root: &Path, folder: &Path, requirements: &str) -> Option<PathBuf> {
    let programs = folder.join(if cfg!(windows) { "Scripts" } else { "bin" });
    let wanted = std::fs::read_to_string(root.join(requirements)).ok()?;
    let marker = folder.join("requirements.txt");
    if std::fs::read_to_string(&marker).is_ok_and(|installed| installed == wanted) {
        return Some(programs);
    }
    let Some(python) = interpreter() else {
        println!(
            "xtask: Python 3.10 or later with the module venv is not here (PYTHON names another \
                program)"
        );
        return None;
    };
    let mut make = Command::new(python);
    make.args(["-m", "venv"]).arg(folder);
    let mut install = Command::new(programs.join("python"));
    install
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"])
        .arg(root.join(requirements));
    let made = run("virtual environment", make) && run("installation of Python packages", install);
    made.then(|| std::fs::write(marker, wanted)).and_then(Result::ok).map(|()| programs)
}

/// Builds the Rust half and copies it to the folder from which the Python half imports it.
pub fn build(root: &Path, programs: &Path) -> bool {
    let mut build = build_as_tested(&["--lib"]);
    build.env("PYO3_PYTHON", programs.join("python"));
    let (built, module) = if cfg!(windows) {
        ("_snell.dll", "_snell.pyd")
    } else if cfg!(target_os = "macos") {
        ("lib_snell.dylib", "_snell.abi3.so")
    } else {
        ("lib_snell.so", "_snell.abi3.so")
    };
    let placed = || {
        let copied = std::fs::copy(
            root.join("target/debug").join(built),
            root.join("python/snell").join(module),
        );
        copied.inspect_err(|error| eprintln!("xtask: {built} could not be copied: {error}")).is_ok()
    };
    run("build of the Python package", build) && placed()
}

/// The root of the repository.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The Python of an environment, to be run at the root.
pub fn python(programs: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(programs.join("python"));
    command
        .args(arguments)
        .current_dir(root())
        .env("VIRTUAL_ENV", root().join("target/python/venv"));
    command
}

/// Checks format and lints of all Python code. `None` without Python.
pub fn lint() -> Option<bool> {
    let ruff = |what: &str, arguments: &[&str]| Some(run(what, ruff(arguments)?));
    let is_laid_out = ruff("format check of Python", &["format", "--check"])?;
    Some(ruff("ruff", &["check", "--quiet"])? && is_laid_out)
}

/// Formats all Python code. `None` without Python.
pub fn format() -> Option<bool> {
    Some(run("format of Python", ruff(&["format", "--quiet"])?))
}

fn ruff(arguments: &[&str]) -> Option<Command> {
    let programs = test_environment(&root())?;
    let mut command = python(&programs, &["-m", "ruff"]);
    command.args(arguments);
    Some(command)
}

/// Builds the package, runs its tests, and checks that the stubs agree with the module. `None`
/// without Python.
pub fn test() -> Option<bool> {
    let root = root();
    let programs = test_environment(&root)?;
    let command = |arguments: &[&str]| python(&programs, arguments);
    let package = ["-m", "maturin", "sdist", "--out", "target/python"];
    let steps: [(&str, &[&str]); 4] = [
        ("installation of the Python package", &["-c", LINK]),
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
    let is_built =
        build(&root, &programs) && run_quietly("package of the sources", command(&package));
    Some(is_built && steps.into_iter().all(|(what, arguments)| run(what, command(arguments))))
}
