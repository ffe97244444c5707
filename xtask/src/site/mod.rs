//! The documentation site: `cargo xtask docs` makes `target/docs/site` of the Markdown files in
//! `docs/`, of what the declarations in the source say, and of the interfaces of the Rust crates
//! and the Python package.
//!
//! The pages stay readable where they are. What only the site has is added to copies in
//! `target/docs/pages`: pictures, which the commands on the page render ([`pictures`]), and links
//! that fit the site ([`links`]). mkdocs makes HTML of the copies, and [`check`] follows all links.

mod check;
mod links;
mod nav;
mod pages;
mod pictures;

use crate::{cargo, python, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Packages of mkdocs, with their versions.
const REQUIREMENTS: &str = "xtask/site/requirements.txt";

/// Crates whose interface is for users.
const CRATES: [&str; 2] = ["snell-math", "snell-intersect"];

/// How a site is made.
struct Options {
    /// Renders pictures with few samples.
    is_draft: bool,
}

/// Makes the site, from the repository's root. Prints what fails; true if nothing does.
pub fn build(arguments: impl Iterator<Item = String>) -> bool {
    let mut options = Options { is_draft: false };
    for argument in arguments {
        match argument.as_str() {
            "--draft" => options.is_draft = true,
            _ => {
                eprintln!("xtask: docs does not know \"{argument}\" (known: --draft)");
                return false;
            }
        }
    }
    made(&options)
        .inspect_err(|error| {
            if !error.is_empty() {
                eprintln!("xtask: docs: {error}");
            }
        })
        .is_ok()
}

/// Makes the site; the error is empty if it was printed already.
fn made(options: &Options) -> Result<(), String> {
    let folder = PathBuf::from("target/docs");
    let printed = |succeeded: bool| if succeeded { Ok(()) } else { Err(String::new()) };
    let programs = python::environment(Path::new("."), &folder.join("venv"), REQUIREMENTS)
        .ok_or_else(|| "mkdocs needs a Python; see above".to_string())?;
    let snell = snell().ok_or_else(String::new)?;
    let pages = folder.join("pages");
    let mut pictures = pictures::Pictures::new(&folder, snell, options.is_draft)?;
    pages::write(&pages, &mut pictures)?;
    pictures.report();
    printed(python_reference(&programs, &pages) && rust_reference(&folder, &pages))?;
    nav::write_configuration(&folder)?;
    let mut mkdocs = Command::new(programs.join("python"));
    mkdocs.args(["-m", "mkdocs", "--quiet", "build", "--strict", "--clean", "--config-file"]);
    mkdocs.arg(folder.join("mkdocs.yml")).env("NO_MKDOCS_2_WARNING", "1");
    printed(run("mkdocs", mkdocs))?;
    let site = folder.join("site");
    check::links(&site)?;
    println!("{}", site.join("index.html").display());
    Ok(())
}

/// The command that renders the pictures: that of the variable `SNELL`, else one that is built.
fn snell() -> Option<PathBuf> {
    if let Some(path) = std::env::var_os("SNELL") {
        return Some(path.into());
    }
    let built = run("build of snell", cargo(&["build", "--release", "--quiet", "--bin", "snell"]));
    built
        .then(|| Path::new("target/release").join(format!("snell{}", std::env::consts::EXE_SUFFIX)))
}

/// Writes the pages of the Python package's interface.
fn python_reference(programs: &Path, pages: &Path) -> bool {
    let mut command = Command::new(programs.join("python"));
    command.env("PYTHONPATH", "python");
    command.arg("xtask/site/python_api.py").arg(pages.join("user/api/python"));
    python::build(Path::new("."), programs) && run("reference of Python", command)
}

/// Builds the pages of the Rust crates, and copies them to the others.
fn rust_reference(folder: &Path, pages: &Path) -> bool {
    let target = folder.join("cargo");
    let mut command = cargo(&["doc", "--quiet", "--no-deps", "--target-dir"]);
    command.arg(&target);
    for name in CRATES {
        command.args(["--package", name]);
    }
    let copied = || {
        pages::copy_folder(&target.join("doc"), &pages.join("rust"))
            .inspect_err(|error| eprintln!("xtask: documentation of Rust: {error}"))
            .is_ok()
    };
    run("documentation of Rust", command) && copied()
}
