//! Programs in C, compiled against the header, linked with the library, and run.

#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The folder of the library: the tests are built beside it.
fn libraries() -> PathBuf {
    let test = std::env::current_exe().expect("the path of the test");
    test.parent().expect("a folder").to_path_buf()
}

/// Compiles and runs a program; `None` if there is no C compiler.
fn run(program: &str) -> Option<Output> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scratch = tempfile::tempdir().expect("a folder");
    let binary = scratch.path().join("program");
    let mut compile = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()));
    compile
        .args(["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&binary)
        .arg("-I")
        .arg(folder.join("include"))
        .arg(folder.join(program))
        .arg("-L")
        .arg(libraries())
        .args(["-lsnell", "-lm"])
        .arg(format!("-Wl,-rpath,{}", libraries().display()));
    let compiled = match compile.output() {
        Ok(output) => output,
        Err(error) => {
            println!("not tested: there is no C compiler here ({error})");
            return None;
        }
    };
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    Some(Command::new(&binary).output().expect("the program starts"))
}

#[test]
fn the_example_finds_its_hits() {
    let Some(output) = run("examples/first_hit.c") else { return };
    assert!(output.status.success(), "{output:?}");
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        "ray 0 hits triangle 0 at t = 2, u = 0.25, v = 0.5; occluded 1\nray 1 misses; occluded 0\n"
    );
}

#[test]
fn wrong_calls_are_errors_that_name_what_is_wrong() {
    let Some(output) = run("tests/errors.c") else { return };
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn large_batches_have_the_answers_of_single_rays() {
    let Some(output) = run("tests/batches.c") else { return };
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
}
