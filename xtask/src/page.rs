//! The page without a server: a folder that any server of files can serve, with the renderer in
//! WebAssembly.

use crate::toolchain::Toolchain;
use crate::{run as succeeds, run_quietly, web};
use std::path::{Path, PathBuf};

const TARGET: &str = "wasm32-wasip1";

/// The folder that is made.
pub const FOLDER: &str = "target/page";

/// The most that all files may have together, compressed as the renderer is.
const MOST_BYTES: u64 = 6 << 20;

/// Builds the page, and tests it with `--test`. True if nothing fails.
pub fn run(mut arguments: impl Iterator<Item = String>) -> bool {
    let is_test = match (arguments.next().as_deref(), arguments.next()) {
        (None, _) => false,
        (Some("--test"), None) => true,
        (Some(other), _) => {
            eprintln!("xtask: page does not know \"{other}\" (known: --test)");
            return false;
        }
    };
    let built = made().inspect_err(|error| {
        if !error.is_empty() {
            eprintln!("xtask: page: {error}");
        }
    });
    built.is_ok() && (!is_test || web::test_in_browser("browser-alone"))
}

/// Builds the page; the error is empty if it was printed already.
fn made() -> Result<(), String> {
    let printed = |succeeded: bool| if succeeded { Ok(()) } else { Err(String::new()) };
    let program = program()?;
    printed(web::packages() == Some(true))?;
    let mut build = web::npm(&["run", "--silent", "build-alone", "--", "--logLevel", "warn"]);
    build.env("SNELL_WASM", &program);
    printed(succeeds("build of the page without a server", build))?;
    let bytes = size_of(Path::new(FOLDER)).map_err(|error| format!("{FOLDER}: {error}"))?;
    let megabytes = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!("{FOLDER}: {:.2} MB, to be served by any server of files", megabytes(bytes));
    if bytes > MOST_BYTES {
        let most = megabytes(MOST_BYTES);
        return Err(format!("{FOLDER} may have at most {most} MB: look at what has grown"));
    }
    Ok(())
}

/// Builds the renderer.
fn program() -> Result<PathBuf, String> {
    let toolchain = Toolchain::of(TARGET)?;
    let mut build = toolchain.cargo("rustc");
    build.args(["--package", "snell-wasm", "--lib", "--crate-type", "cdylib"]);
    build.args(["--profile", "page"]).current_dir(web::root());
    println!("building the renderer, which takes some minutes from nothing");
    // Much of what other processors have is unused there, and the compiler warns of it at length.
    if !run_quietly("build of the renderer for the page", build) {
        return Err(String::new());
    }
    let built = web::root().join(toolchain.artifacts("page")).join("snell_wasm.wasm");
    std::path::absolute(&built).map_err(|error| format!("{}: {error}", built.display()))
}

/// The size of all files in a folder.
fn size_of(folder: &Path) -> std::io::Result<u64> {
    std::fs::read_dir(folder)?.try_fold(0, |sum, entry| {
        let entry = entry?;
        let about = entry.metadata()?;
        Ok(sum + if about.is_dir() { size_of(&entry.path())? } else { about.len() })
    })
}
