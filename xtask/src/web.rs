//! The viewer's page: its build into `crates/viewer/page/`, its unit tests, and its tests in a real
//! browser.

use crate::{build_as_tested, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Files of the built page.
const PAGE: [&str; 3] = ["index.html", "app.js", "app.css"];

pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

pub fn npm(arguments: &[&str]) -> Command {
    let mut command = Command::new(if cfg!(windows) { "npm.cmd" } else { "npm" });
    command.args(arguments).current_dir(root().join("web"));
    command
}

fn runs(program: &str, arguments: &[&str]) -> bool {
    Command::new(program).args(arguments).output().is_ok_and(|o| o.status.success())
}

/// Installs the build tools of the page, if they have changed. `None` without Node.js.
pub fn packages() -> Option<bool> {
    let is_new_enough = "process.exit(Number(process.versions.node.split('.')[0]) < 20 ? 1 : 0)";
    if !runs("node", &["-e", is_new_enough]) || npm(&["--version"]).output().is_err() {
        println!("xtask: Node.js 20 or later with npm is not here");
        return None;
    }
    let (lock, marker) =
        (root().join("web/package-lock.json"), root().join("web/node_modules/installed.json"));
    let wanted = std::fs::read(lock).ok()?;
    if std::fs::read(&marker).is_ok_and(|installed| installed == wanted) {
        return Some(true);
    }
    let installed = run(
        "installation of what the page is built with",
        npm(&["install", "--no-save", "--no-audit", "--no-fund", "--silent"]),
    );
    Some(installed && std::fs::write(marker, wanted).is_ok())
}

/// Builds the page into the folder from which the server includes it.
pub fn build() -> bool {
    packages() == Some(true) && run("build of the page", npm(&["run", "--silent", "build"]))
}

/// Checks format and lints of the page and of the scripts that drive it. `None` without Node.js.
pub fn lint() -> Option<bool> {
    Some(packages()? && run("Biome", npm(&["run", "--silent", "lint"])))
}

/// Formats the page and the scripts that drive it. `None` without Node.js.
pub fn format() -> Option<bool> {
    Some(packages()? && run("format of the page", npm(&["run", "--silent", "format"])))
}

/// Checks types, runs unit tests, checks that the built page is up to date with the sources, and
/// tests the page in a browser. `None` without Node.js.
pub fn test() -> Option<bool> {
    if !packages()? {
        return Some(false);
    }
    let fresh = root().join("target/web");
    let out = fresh.display().to_string();
    let build = npm(&["run", "--silent", "build", "--", "--outDir", &out, "--logLevel", "warn"]);
    let passed = run("build of the page", build)
        && is_fresh(&fresh)
        && run("tests of the page", npm(&["test", "--silent"]));
    Some(passed && in_browser())
}

/// True if the included page matches the one built from the sources.
fn is_fresh(built: &Path) -> bool {
    let there = root().join("crates/viewer/page");
    let stale: Vec<_> = PAGE
        .into_iter()
        .filter(|name| std::fs::read(built.join(name)).ok() != std::fs::read(there.join(name)).ok())
        .collect();
    if !stale.is_empty() {
        eprintln!(
            "xtask: crates/viewer/page is not what web/ gives ({}); run `cargo xtask web-build`",
            stale.join(", ")
        );
    }
    stale.is_empty()
}

fn in_browser() -> bool {
    test_in_browser("browser")
}

/// Runs a script of `web/package.json` that tests in a browser, with the `snell` of the tests.
pub fn test_in_browser(script: &str) -> bool {
    let Some(browser) = browser() else {
        eprintln!("xtask: no Chromium or Chrome, and none could be installed; CHROME names one");
        return false;
    };
    if !run("build of snell", build_as_tested(&["--bin", "snell"])) {
        return false;
    }
    let snell = root().join("target/debug").join(if cfg!(windows) { "snell.exe" } else { "snell" });
    let mut command = npm(&["run", "--silent", script]);
    command.env("CHROME", browser).env("SNELL", snell);
    run("tests of the page in a browser", command)
}

/// Path of a Chromium or Chrome: from the variable `CHROME`, an installed one, or one that this
/// function installs.
fn browser() -> Option<String> {
    let usual = [
        "chromium",
        "chromium-browser",
        "google-chrome",
        "google-chrome-stable",
        "microsoft-edge",
        "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
        r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    ];
    let named = std::env::var("CHROME").ok();
    let find = || usual.into_iter().find(|name| runs(name, &["--version"])).and_then(full_path);
    named.or_else(find).or_else(|| install_package().then(find).flatten()).or_else(install_from_npm)
}

/// The full path of a program, because the browser library accepts no bare name.
fn full_path(name: &str) -> Option<String> {
    if Path::new(name).is_absolute() {
        return Some(name.to_string());
    }
    let folders = std::env::var_os("PATH")?;
    let found =
        std::env::split_paths(&folders).map(|folder| folder.join(name)).find(|path| path.exists());
    found.map(|path| path.display().to_string())
}

/// Installs Debian's package chromium; false without root rights, or if that fails.
fn install_package() -> bool {
    if !runs("id", &["-u"])
        || !Command::new("id").arg("-u").output().is_ok_and(|o| o.stdout.starts_with(b"0\n"))
    {
        return false;
    }
    println!("xtask: installing Debian's package chromium");
    let apt = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive");
        command
    };
    run("list of packages", apt(&["update", "-qq"]))
        && run(
            "installation of chromium",
            apt(&["install", "-qq", "-y", "--no-install-recommends", "chromium"]),
        )
}

/// Installs a browser from an npm package, which needs no privileges.
fn install_from_npm() -> Option<String> {
    println!("xtask: installing a Chromium from npm");
    let folder = root().join("target/chromium");
    std::fs::create_dir_all(&folder).ok()?;
    let mut install = npm(&["install", "--no-audit", "--no-fund", "--silent", "--prefix"]);
    install.arg(&folder).arg("@sparticuz/chromium");
    if !run("installation of @sparticuz/chromium", install) {
        return None;
    }
    let unpack = "import('@sparticuz/chromium').then(async (m) => console.log(await \
        m.default.executablePath()))";
    let output = Command::new("node").args(["-e", unpack]).current_dir(&folder).output().ok()?;
    let path = String::from_utf8(output.stdout).ok()?.trim().to_string();
    runs(&path, &["--version"]).then_some(path)
}
