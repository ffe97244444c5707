//! Renders the same scenes and traces the same rays in several ways (SIMD levels, compilers,
//! processors), and writes `docs/the-same-bits.md`, which says where the bits differ.

mod page;

use crate::toolchain::Toolchain;
use crate::{build_as_tested, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A way to compute.
struct Column {
    name: &'static str,
    /// What the page says of it.
    about: &'static str,
    target: &'static str,
    /// Whether it is built by the second Rust of this machine, not by the first.
    by_other_rust: bool,
    profile: &'static str,
    /// The SIMD level that is asked for; the best one if empty.
    simd: &'static str,
    /// The number of entries of [`WORLDS`] that are traced. Slow ways do not trace all.
    rays: usize,
}

const NATIVE: &str = "";

const COLUMNS: [Column; 7] = [
    Column::native("scalar", "x86-64, portable code", "scalar"),
    Column::native("avx2", "x86-64, AVX2", "avx2"),
    Column::native("avx512", "x86-64, AVX-512", "avx512"),
    Column {
        profile: "release",
        ..Column::native("release", "x86-64, the best level, built with `--release`", "")
    },
    Column {
        by_other_rust: true,
        ..Column::native("other-rust", "x86-64, the best level, by another compiler", "")
    },
    Column {
        target: "aarch64-unknown-linux-gnu",
        rays: 2,
        ..Column::native("aarch64", "64-bit ARM in an emulator, NEON", "")
    },
    Column {
        target: "wasm32-unknown-unknown",
        rays: 2,
        ..Column::native("wasm", "WebAssembly (32 bits) in Node.js, SIMD128; rays only", "")
    },
];

impl Column {
    /// A way on this machine, built as tests are: optimised, with all checks.
    const fn native(name: &'static str, about: &'static str, simd: &'static str) -> Self {
        let (target, by_other_rust, profile) = (NATIVE, false, "debug");
        Self { name, about, target, by_other_rust, profile, simd, rays: WORLDS.len() }
    }
}

/// Numbers of random worlds whose rays are traced; each has 4096 rays.
const WORLDS: [u32; 3] = [25, 250, 2500];

/// The scenes with the options they are rendered with: every integrator, media, learnt light,
/// wavelengths, strands, motion and layers.
const SCENES: [(&str, &[&str]); 14] = [
    ("cornell-box", &[]),
    ("minray", &["-i", "raycast"]),
    ("spheres", &["-i", "whitted", "--shadows", "soft"]),
    ("night-town", &["-i", "direct"]),
    ("teapot", &["-i", "ao"]),
    ("scenes/patterns.pbrt", &["-i", "flat"]),
    ("drink", &["-i", "aov", "--aov", "all"]),
    ("teapot", &["--environment", "sky:elevation=35,azimuth=135"]),
    ("fog", &[]),
    ("smoke", &[]),
    ("door-ajar", &["--guiding=2", "--spp", "16"]),
    ("prism", &["--color", "spectral"]),
    ("hair", &["--aov", "normal,albedo"]),
    ("scenes/pendulum.gltf", &["--at", "0.3", "--shutter", "0..0.2"]),
];

/// Options of all scenes.
const OPTIONS: [&str; 7] = ["-s", "48x36", "--spp", "4", "--threads", "2", "--quiet"];

/// What a way gave: by the name of what was computed, its hash; or why it did not run.
type Results = Result<Vec<(String, String)>, String>;

/// Computes the named columns, or all of them, and writes the page of all that ever ran. True if
/// all that ran agree and none failed.
pub fn run_columns(arguments: impl Iterator<Item = String>) -> bool {
    let names: Vec<String> = arguments.filter(|argument| argument != "--only").collect();
    if let Some(name) = names.iter().find(|name| COLUMNS.iter().all(|c| c.name != **name)) {
        let known = COLUMNS.map(|c| c.name).join(", ");
        eprintln!("xtask: bits has no column `{name}`; it has {known}");
        return false;
    }
    let is_wanted = |column: &&Column| names.is_empty() || names.iter().any(|n| n == column.name);
    for column in COLUMNS.iter().filter(is_wanted) {
        println!("{}: {}", column.name, column.about);
        let results = column.compute();
        if let Err(reason) = &results {
            println!("  not computed: {reason}");
        }
        if let Err(error) = page::save(column, &results) {
            eprintln!("xtask: the results of {} could not be saved: {error}", column.name);
            return false;
        }
    }
    page::write(&COLUMNS).unwrap_or_else(|error| {
        eprintln!("xtask: {}: {error}", page::PAGE);
        false
    })
}

impl Column {
    fn toolchain(&self) -> Result<Toolchain, String> {
        if self.by_other_rust {
            Toolchain::other()
        } else if self.target == NATIVE {
            Toolchain::native()
        } else {
            Toolchain::of(self.target)
        }
    }

    fn compute(&self) -> Results {
        let toolchain = self.toolchain()?;
        let is_wasm = self.target.starts_with("wasm32");
        let mut build = toolchain.cargo("build");
        build.args(["--package", "snell-lab", "--example"]);
        build.arg(if is_wasm { "random_rays_wasm" } else { "random_rays" });
        if !is_wasm {
            build.args(["--package", "snell", "--bin", "snell"]);
        }
        if self.profile == "release" {
            build.arg("--release");
        } else if self.target == NATIVE && !self.by_other_rust {
            // What tests use is built already.
            build = build_as_tested(&["--bins", "--example", "random_rays"]);
        }
        if !run(&format!("the build for {}", self.name), build) {
            return Err("it could not be built".into());
        }
        let programs = toolchain.artifacts(self.profile);
        let mut results = vec![("Rust".to_string(), toolchain.version().to_string())];
        if !is_wasm {
            let snell = programs.join("snell");
            for (scene, options) in SCENES {
                let mut command = toolchain.run(&snell)?;
                command.args(["render", scene]).args(OPTIONS).args(options);
                results.push((name_of(scene, options), self.render(command)?));
            }
        }
        for worlds in &WORLDS[..self.rays] {
            let mut command = match is_wasm {
                true => in_node(&toolchain, &programs.join("examples/random_rays_wasm.wasm"))?,
                false => toolchain.run(&programs.join("examples/random_rays"))?,
            };
            let text = self.output(command.arg(worlds.to_string()))?;
            let [rays, hits, digest] = text.split(' ').collect::<Vec<_>>()[..] else {
                return Err(format!("random_rays printed `{text}`"));
            };
            results.push((format!("{rays} random rays"), format!("{hits} hits, {digest}")));
        }
        Ok(results)
    }

    /// Renders a picture, and returns the SHA-256 of its values.
    fn render(&self, mut command: Command) -> Result<String, String> {
        let folder = PathBuf::from("target/bits");
        let stats = folder.join(format!("{}.json", self.name));
        std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        command.arg("--stats").arg(&stats).arg("-o").arg(folder.join("picture.exr"));
        self.output(&mut command)?;
        let text = std::fs::read_to_string(&stats).map_err(|e| format!("{stats:?}: {e}"))?;
        let hash = text.split_once("\"image_sha256\"").and_then(|(_, rest)| rest.split('"').nth(1));
        hash.map(Into::into).ok_or_else(|| format!("{stats:?} has no image_sha256"))
    }

    /// What a command prints, at the SIMD level of this column.
    fn output(&self, command: &mut Command) -> Result<String, String> {
        let output = command.env("SNELL_SIMD", self.simd).output();
        let output = output.map_err(|error| format!("{command:?}: {error}"))?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).trim().to_string());
        }
        let message = String::from_utf8_lossy(&output.stderr);
        let last = message.lines().last().unwrap_or("it failed without a message");
        Err(match last.contains("instructions that this machine lacks") {
            true => "not on this machine".into(),
            false => last.to_string(),
        })
    }
}

/// How the page calls a picture.
fn name_of(scene: &str, options: &[&str]) -> String {
    let name = Path::new(scene).file_stem().unwrap_or_default().to_string_lossy();
    [&[&*name], options].concat().join(" ")
}

/// A command that traces the rays of a WebAssembly module; its argument is the number of worlds.
fn in_node(toolchain: &Toolchain, module: &Path) -> Result<Command, String> {
    const SCRIPT: &str = "xtask/src/bits/rays.mjs";
    let mut command = toolchain.run(Path::new(SCRIPT))?;
    command.arg(module);
    Ok(command)
}
