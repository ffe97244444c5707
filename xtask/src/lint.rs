//! Checks of the code that need no run of it: layout, width, and lints of Rust, Python and the
//! page, with warnings as errors.

mod width;

use crate::{cargo, how_tested, python, run, web};

/// The workspaces of Rust code: the product, the fuzz targets, and the peers of the benchmarks.
const MANIFESTS: [&str; 3] = ["Cargo.toml", "fuzz/Cargo.toml", "bench/peers/Cargo.toml"];

/// Checks everything, the quick checks first. Every step runs, so that one call shows all faults.
/// Steps that need Python or Node.js are skipped where that is missing.
pub fn check(with_documentation: bool) -> bool {
    let mut results = vec![
        ("format of Rust", rustfmt(&["--check"])),
        ("width", width::check()),
        ("Python", python::lint() != Some(false)),
        ("the page", web::lint() != Some(false)),
        ("figures", has_current_figures()),
        ("clippy", clippy()),
    ];
    if with_documentation {
        results.push(("documentation", documentation()));
    }
    let failed: Vec<_> =
        results.into_iter().filter_map(|(step, passed)| (!passed).then_some(step)).collect();
    if !failed.is_empty() {
        eprintln!("xtask: there is something to mend: {}", failed.join(", "));
    }
    failed.is_empty()
}

/// Formats all code: Rust, Python, and the page.
pub fn format() -> bool {
    [rustfmt(&[]), python::format() != Some(false), web::format() != Some(false)] == [true; 3]
}

fn rustfmt(options: &[&str]) -> bool {
    MANIFESTS.map(|manifest| {
        let mut command = cargo(&["fmt", "--all", "--manifest-path", manifest]);
        command.args(options);
        run("rustfmt", command)
    }) == [true; MANIFESTS.len()]
}

fn clippy() -> bool {
    let arguments =
        ["--workspace", "--all-targets", "--keep-going", "--quiet", "--", "-D", "warnings"];
    let mut command = cargo(&["clippy"]);
    command.args(arguments);
    run("clippy", command)
}

fn documentation() -> bool {
    let mut command = cargo(&["doc", "--workspace", "--no-deps", "--quiet"]);
    command.env("RUSTDOCFLAGS", "-D warnings");
    run("documentation", command)
}

fn has_current_figures() -> bool {
    how_tested::check().inspect_err(|error| eprintln!("xtask: {error}")).unwrap_or(false)
}
