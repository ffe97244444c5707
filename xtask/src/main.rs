//! The commands for developers and CI, such as `cargo xtask test`. It has no dependencies, so that
//! it starts at once.

mod bits;
mod fuzz_smoke;
mod how_tested;
mod lint;
mod page;
mod python;
mod sanitize;
mod site;
mod toolchain;
mod web;
mod wheels;

use std::io::{BufRead, BufReader};
use std::process::{Command, ExitCode, Stdio};
use std::time::Instant;

const HELP: &str = "cargo xtask COMMAND

  test   install what the tests need and run them all; ends with a summary
  python only the tests of the Python package, in a virtual environment of their own
  web    only the tests of the viewer's page: types, units, and in a real browser
  web-build  build the viewer's page from web/ into crates/viewer/page
  page [--test]  build the page without a server, target/page, which any server of files can serve;
         --test runs its tests in a real browser
  lint [--quick]  layout and width of all code, clippy, ruff for Python, Biome for the page, the
         figures of docs/how-it-is-tested.md and, unless --quick, documentation; warnings are errors
  fmt    format everything: Rust, Python and the page
  docs [--draft]  build the documentation site, target/docs/site, with pictures that the commands
         of the pages render; --draft renders them with few samples. SNELL names the command that
         renders, in place of a fresh build
  wheels [TARGET...]  build wheels of the Python package in target/wheels, install those that can \
  run here where there is no Rust, and use them
  sanitize [address|miri]  tests of the code that is not safe Rust, under AddressSanitizer and \
  Miri; needs a nightly Rust
  fuzz-smoke  give damaged files to the program, for two minutes or --seconds N; --seed N, --only \
  render|commands, --release
  bits [--only COLUMN...]  compare the bits of pictures and hits between SIMD levels, compilers \
  and processors; writes docs/the-same-bits.md
  cross TARGET COMMAND  run a Cargo command, such as `build --package snell-math`, for another \
  target; says what to install if something is missing
  how-tested  write the figures of docs/how-it-is-tested.md; lint says when they are out of date
  parameters  write docs/user/settings.md, parameters.md and the pages of docs/user/parameters/, and
         python/snell/_settings.py; tests say when they are out of date
  gallery  make the pictures of the built-in scenes for the viewer's gallery
  golden make the pictures of golden scenes that changed the new references; look at them before \
  you commit
";

fn main() -> ExitCode {
    let command = std::env::args().nth(1).unwrap_or_default();
    let succeeded = match command.as_str() {
        "test" => test(),
        "python" => python::test().unwrap_or(false),
        "web" => web::test().unwrap_or(false),
        "web-build" => web::build(),
        "page" => page::run(std::env::args().skip(2)),
        "lint" => lint::check(std::env::args().nth(2).as_deref() != Some("--quick")),
        "fmt" => lint::format(),
        "docs" => site::build(std::env::args().skip(2)),
        "wheels" => wheels::build(std::env::args().skip(2)).unwrap_or(false),
        "gallery" => gallery(),
        "golden" => golden(),
        "parameters" => parameters(),
        "sanitize" => sanitize::run(std::env::args().nth(2).as_deref()),
        "fuzz-smoke" => fuzz_smoke::fuzz_smoke(std::env::args().skip(2)),
        "bits" => bits::run_columns(std::env::args().skip(2)),
        "cross" => cross(std::env::args().skip(2)),
        "how-tested" => {
            how_tested::write().inspect_err(|error| eprintln!("xtask: {error}")).is_ok()
        }
        _ => {
            eprint!("{HELP}");
            return ExitCode::from(2);
        }
    };
    if succeeded { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Returns a command for Cargo, without incremental compilation unless `CARGO_INCREMENTAL` is set.
/// A full build is faster without it, and so is the built program.
fn cargo(arguments: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command
        .args(arguments)
        .env("CARGO_INCREMENTAL", std::env::var_os("CARGO_INCREMENTAL").unwrap_or("0".into()));
    command
}

/// Builds targets of the workspace with the dependencies that its tests are built with. A small
/// test is included, because only then dependencies get the features that tests need.
fn build_as_tested(targets: &[&str]) -> Command {
    let mut command = cargo(&["build", "--quiet", "--workspace", "--test", "planted"]);
    command.args(targets);
    command
}

/// Runs a command and shows its output; true if it succeeded.
fn run(what: &str, mut command: Command) -> bool {
    match command.status() {
        Ok(status) if status.success() => true,
        Ok(status) => {
            eprintln!("xtask: {what} failed ({status})");
            false
        }
        Err(error) => {
            eprintln!("xtask: {what} could not be started: {error}");
            false
        }
    }
}

/// Runs a command, and shows its output only if it fails; true if it succeeded.
fn run_quietly(what: &str, mut command: Command) -> bool {
    match command.output() {
        Ok(output) if output.status.success() => true,
        Ok(output) => {
            eprintln!(
                "{}{}",
                String::from_utf8_lossy(&output.stdout),
                String::from_utf8_lossy(&output.stderr)
            );
            eprintln!("xtask: {what} failed ({})", output.status);
            false
        }
        Err(error) => {
            eprintln!("xtask: {what} could not be started: {error}");
            false
        }
    }
}

/// Runs a Cargo command for another target.
fn cross(mut arguments: impl Iterator<Item = String>) -> bool {
    let (Some(target), Some(command)) = (arguments.next(), arguments.next()) else {
        eprintln!("xtask: cross needs a target and a command of Cargo: `cross TARGET build`");
        return false;
    };
    match toolchain::Toolchain::of(&target) {
        Ok(toolchain) => {
            let mut cargo = toolchain.cargo(&command);
            cargo.args(arguments);
            run(&format!("cargo {command} for {target}"), cargo)
        }
        Err(error) => {
            eprintln!("xtask: {error}");
            false
        }
    }
}

/// Makes the pictures of `tests/golden/` that have changed the new references.
fn golden() -> bool {
    let arguments =
        ["test", "--package", "snell-tests", "golden::every_golden", "--", "--nocapture"];
    let mut command = cargo(&arguments);
    command.env("SNELL_GOLDEN", "accept");
    let succeeded = run("golden", command);
    if succeeded {
        println!(
            "Each picture written is named above, and in `git status`. None was written if all are \
                as they were."
        );
    }
    succeeded
}

/// Makes the pictures of the built-in scenes in `crates/viewer/gallery/`.
fn gallery() -> bool {
    let mut command = cargo(&["test", "--package", "snell-viewer", "--lib", "gallery::"]);
    command.env("SNELL_GALLERY", "write");
    run("gallery", command)
}

/// Writes the pages of parameters and settings, and the types of settings in Python, from their
/// declarations.
fn parameters() -> bool {
    let mut command = cargo(&["test", "--package", "snell", "--test", "pages"]);
    command.env("SNELL_PARAMETERS", "write");
    run("parameters", command)
}

/// The numbers in the output of a test run.
#[derive(Default)]
struct Counts {
    passed: u64,
    failed: u64,
    ignored: u64,
    suites: u64,
}

impl Counts {
    /// Adds a line such as `test result: ok. 3 passed; 0 failed; 1 ignored; …`.
    fn add_line(&mut self, line: &str) {
        let Some(rest) = line.trim().strip_prefix("test result: ") else { return };
        self.suites += 1;
        let numbers = rest.split(['.', ';']).filter_map(|part| {
            let mut words = part.split_whitespace();
            Some((words.next()?.parse::<u64>().ok()?, words.next()?.to_string()))
        });
        for (number, what) in numbers {
            match what.as_str() {
                "passed" => self.passed += number,
                "failed" => self.failed += number,
                "ignored" => self.ignored += number,
                _ => {}
            }
        }
    }
}

/// Runs the selected tests of the workspace, and counts them.
fn cargo_test(which: &str, counts: &mut Counts) -> bool {
    counted(cargo(&["test", "--workspace", "--no-fail-fast", which]), counts)
}

/// Runs a command that runs tests, with its output shown, and counts them.
fn counted(mut command: Command, counts: &mut Counts) -> bool {
    command.stdout(Stdio::piped());
    let finished = command.spawn().and_then(|mut child| {
        let output = child.stdout.take().map(BufReader::new);
        for line in output.into_iter().flat_map(|o| o.lines().map_while(Result::ok)) {
            println!("{line}");
            counts.add_line(&line);
        }
        child.wait()
    });
    match finished {
        Ok(status) => status.success(),
        Err(error) => {
            eprintln!("xtask: cargo test could not be started: {error}");
            false
        }
    }
}

/// Runs all tests: unit tests, properties, documentation examples, the command line, the Python
/// package, and the viewer's page in a browser.
fn test() -> bool {
    let start = Instant::now();
    let mut counts = Counts::default();
    // Without a selection, the benchmarks would be built as well; `lint` compiles them.
    let succeeded = ["--tests", "--doc"].map(|which| cargo_test(which, &mut counts)) == [true; 2];
    let python = python::test();
    let web = web::test();
    let succeeded = succeeded && python != Some(false) && web != Some(false);
    let seconds = start.elapsed().as_secs();
    println!("\n{} suites in {}m{:02}s", counts.suites, seconds / 60, seconds % 60);
    println!("{} passed, {} failed, {} skipped", counts.passed, counts.failed, counts.ignored);
    match python {
        Some(true) => println!("the tests of the Python package passed"),
        Some(false) => println!("the tests of the Python package failed"),
        None => {
            println!("the tests of the Python package were skipped: there is no Python for them")
        }
    }
    match web {
        Some(true) => println!("the tests of the viewer's page passed"),
        Some(false) => println!("the tests of the viewer's page failed"),
        None => {
            println!("the tests of the viewer's page were skipped: there is no Node.js for them")
        }
    }
    if !succeeded {
        println!("FAILED");
    }
    succeeded && counts.passed > 0
}
