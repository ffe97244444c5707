//! Finds memory errors that tests do not notice: runs tests of unsafe code under AddressSanitizer
//! and Miri.

use crate::{Counts, counted};
use std::process::{Command, Stdio};

/// A package, and substrings that select its tests.
type Tests = (&'static str, &'static [&'static str]);

/// The tests for AddressSanitizer, which checks every access, including those of vector
/// instructions and of C++.
const ADDRESS: [Tests; 3] = [
    ("snell-math", &["simd::"]),
    ("snell-intersect", &["kernel::", "exact::", "tree::", "build::"]),
    ("snell-formats", &["meshopt", "compression"]),
];

/// The tests for Miri, which also checks the aliasing rules of Rust. Miri is a thousand times
/// slower, has only the baseline instructions, and supports neither C++ nor large worlds.
const MIRI: [Tests; 2] = [
    ("snell-math", &["simd::"]),
    ("snell-intersect", &["tree::compact", "tree::storage", "a_tree_stays_as_it_was_read"]),
];

/// Runs tests and counts them; `None` if the tools for it are missing.
type Run = fn(&mut Counts) -> Option<bool>;

/// Runs both sanitizers, or the one named; true if they passed.
pub fn run(which: Option<&str>) -> bool {
    let runs: [(&str, Run); 2] = [("address", address), ("miri", miri)];
    if let Some(name) = which.filter(|name| runs.iter().all(|run| run.0 != *name)) {
        eprintln!("xtask: there is no sanitizer {name}: name `address`, `miri`, or none for both");
        return false;
    }
    if !starts(&["--version"]) {
        eprintln!("xtask: sanitizers need a nightly Rust: `rustup toolchain install nightly`");
        return false;
    }
    let mut results = Vec::new();
    for (name, run) in runs.into_iter().filter(|run| which.is_none_or(|name| name == run.0)) {
        let mut counts = Counts::default();
        let result = match run(&mut counts) {
            Some(succeeded) if succeeded && counts.passed > 0 => "passed",
            Some(_) => "FAILED",
            None => "skipped",
        };
        results.push(result);
        println!(
            "{name}: {} passed, {} failed, {} left out: {result}",
            counts.passed, counts.failed, counts.ignored
        );
    }
    // A skipped run proves nothing: one that was requested by name must run.
    let forbidden: &[&str] = if which.is_some() { &["FAILED", "skipped"] } else { &["FAILED"] };
    !results.iter().any(|result| forbidden.contains(result))
}

/// Cargo of the nightly toolchain, which builds into a folder of its own.
fn nightly(arguments: &[&str], folder: &str) -> Command {
    // The Cargo in the environment would belong to the toolchain that built this program.
    let mut command = Command::new("cargo");
    command.arg("+nightly").args(arguments).env("CARGO_TARGET_DIR", format!("target/{folder}"));
    command
}

fn starts(arguments: &[&str]) -> bool {
    let mut command = nightly(arguments, "sanitize");
    command
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Runs tests under AddressSanitizer; `None` on systems other than Linux on x86-64.
fn address(counts: &mut Counts) -> Option<bool> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        println!("address: it is set up for Linux on x86-64 only");
        return None;
    }
    const TARGET: &str = "x86_64-unknown-linux-gnu";
    let run = |(package, names): Tests| {
        // With an explicit target, build scripts and macros are built without the sanitizer.
        let mut command =
            nightly(&["test", "--target", TARGET, "--package", package, "--lib", "--"], "sanitize");
        // Stack frames are larger under the sanitizer, so test threads need larger stacks.
        command
            .args(names)
            .env("RUSTFLAGS", "-Zsanitizer=address")
            .env("RUST_MIN_STACK", (64 << 20).to_string());
        // The archive of a C++ library is linked twice, for the crate and for its tests.
        command.env("ASAN_OPTIONS", "detect_odr_violation=0");
        command.env(format!("CXXFLAGS_{TARGET}"), "-fsanitize=address -fno-omit-frame-pointer");
        counted(command, counts)
    };
    Some(all(ADDRESS.map(run)))
}

/// Runs tests under Miri; `None` if Miri is not installed.
fn miri(counts: &mut Counts) -> Option<bool> {
    if !starts(&["miri", "--version"]) {
        println!(
            "miri: it is not installed: `rustup component add --toolchain nightly miri rust-src`"
        );
        return None;
    }
    let run = |(package, names): Tests| {
        let mut command = nightly(&["miri", "test", "--package", package, "--lib", "--"], "miri");
        // Miri must allow tests to write files, and threads of the pool never to end. The pool's
        // queues violate the rules of stacked borrows, so tree borrows are checked.
        command
            .args(names)
            .env("MIRIFLAGS", "-Zmiri-disable-isolation -Zmiri-ignore-leaks -Zmiri-tree-borrows");
        counted(command, counts)
    };
    Some(all(MIRI.map(run)))
}

fn all<const N: usize>(results: [bool; N]) -> bool {
    results.iter().all(|&succeeded| succeeded)
}

#[cfg(test)]
mod tests {
    /// This test is built with the profile of all tests.
    #[test]
    #[should_panic(expected = "overflow")]
    fn tests_check_arithmetic_for_overflow() {
        let largest = std::hint::black_box(u8::MAX);
        std::hint::black_box(largest + 1);
    }
}
