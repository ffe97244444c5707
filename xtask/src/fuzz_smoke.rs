//! Runs the mutation fuzzer of the command line, a test in `crates/cli/tests/hostile/`, for longer.

use super::{cargo, run};
use std::time::{SystemTime, UNIX_EPOCH};

const HELP: &str =
    "cargo xtask fuzz-smoke [--seconds N] [--seed N] [--only render|commands] [--release]

  --seconds  how long; 120 if not given
  --seed     of the random changes; if not given, every day another
  --only     renders, or every other command
  --release  the optimised program instead of the one that the tests have
";

/// Runs the fuzzer with these options; false if it found a failure or the options are invalid.
pub fn fuzz_smoke(mut options: impl Iterator<Item = String>) -> bool {
    let days = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |t| t.as_secs() / 86_400);
    let (mut seconds, mut seed, mut only) = ("120".to_string(), days.to_string(), String::new());
    let mut is_release = false;
    while let Some(option) = options.next() {
        let value = match option.as_str() {
            "--seconds" => &mut seconds,
            "--seed" => &mut seed,
            "--only" => &mut only,
            "--release" => {
                is_release = true;
                continue;
            }
            _ => {
                eprint!("{HELP}");
                return false;
            }
        };
        *value = options.next().unwrap_or_default();
    }
    if is_release
        && !run("the build", cargo(&["build", "--release", "--quiet", "--package", "snell"]))
    {
        return false;
    }
    // This compiles the libFuzzer targets, which are a workspace of their own that no other command
    // compiles.
    let targets = ["check", "--quiet", "--locked", "--manifest-path", "fuzz/Cargo.toml", "--bins"];
    let rest = ["--features", "render", "--target-dir", "target/fuzz"];
    if !run("the check of the fuzz targets", cargo(&[&targets[..], &rest].concat())) {
        return false;
    }
    // The test is built as by `xtask test`, so that nothing is built twice.
    let test = "smoke::whatever_the_files_are_the_program_keeps_its_promises";
    let mut command = cargo(&[
        "test",
        "--quiet",
        "--workspace",
        "--test",
        "hostile",
        "--",
        "--exact",
        test,
        "--nocapture",
    ]);
    let variables =
        [("SNELL_FUZZ_SECONDS", &seconds), ("SNELL_FUZZ_SEED", &seed), ("SNELL_FUZZ_ONLY", &only)];
    command.envs(variables);
    if is_release {
        let target = std::env::var_os("CARGO_TARGET_DIR").unwrap_or("target".into());
        let program = std::path::Path::new(&target).join("release/snell");
        command.env("SNELL_FUZZ_PROGRAM", std::path::absolute(program).unwrap_or_default());
    }
    run("fuzz-smoke", command)
}
