//! What it takes to build for a target and to run what was built: a Rust that has the target's
//! standard library or can build it from source, a linker, and an emulator.

use std::path::{Path, PathBuf};
use std::process::Command;

/// How to build for one target, and how to run it on this machine.
pub struct Toolchain {
    /// The target, or `None` for this machine.
    target: Option<String>,
    /// The target folder. Each compiler and target has its own, so that none spoils another's.
    folder: PathBuf,
    cargo: PathBuf,
    environment: Vec<(String, String)>,
    flags: Vec<&'static str>,
    /// A program and its arguments, before which nothing built for the target runs here. Empty if
    /// this machine runs it as it is.
    runner: Vec<String>,
    /// Which Rust it is, as in `1.96.0`.
    version: String,
}

/// What a foreign target needs beside Rust.
struct Foreign {
    target: &'static str,
    /// The linker with its package, where Rust brings none of its own.
    linkers: &'static [&'static str],
    linker_package: &'static str,
    /// The emulator and its arguments, with its package.
    runner: &'static [&'static str],
    runner_package: &'static str,
    /// Crates of the standard library to be built where it is not installed.
    from_source: &'static str,
    /// Flags of the compiler.
    rustflags: &'static str,
}

/// WASI's C library, which Rust brings only with an installed standard library.
const WASI_LIBC: &str = "/usr/lib/wasm32-wasi";

/// The targets other than this machine that are known to work.
const FOREIGN: [Foreign; 4] = [
    Foreign {
        target: "aarch64-unknown-linux-gnu",
        linkers: &["aarch64-linux-gnu-gcc"],
        linker_package: "gcc-aarch64-linux-gnu and g++-aarch64-linux-gnu",
        runner: &["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
        runner_package: "qemu-user",
        from_source: "-Zbuild-std=std,panic_unwind",
        rustflags: "",
    },
    Foreign {
        target: "wasm32-unknown-unknown",
        linkers: &["rust-lld", "wasm-ld-22", "wasm-ld"],
        linker_package: "lld-22",
        runner: &["node"],
        runner_package: "nodejs",
        from_source: "-Zbuild-std=std,panic_abort",
        rustflags: "-Ctarget-feature=+simd128",
    },
    Foreign {
        target: "wasm32-wasip1",
        linkers: &["rust-lld", "wasm-ld-22", "wasm-ld"],
        linker_package: "lld-22",
        runner: &["node"],
        runner_package: "nodejs",
        from_source: "-Zbuild-std=std,panic_abort",
        // The usual stack of one megabyte is less than that of a thread elsewhere.
        rustflags: "-Ctarget-feature=+simd128 -Clink-arg=-zstack-size=16777216",
    },
    Foreign {
        target: "x86_64-pc-windows-gnu",
        linkers: &["x86_64-w64-mingw32-gcc"],
        linker_package: "gcc-mingw-w64-x86-64 and g++-mingw-w64-x86-64",
        runner: &["wine"],
        runner_package: "wine64",
        from_source: "-Zbuild-std=std,panic_unwind",
        rustflags: "",
    },
];

const NO_RUST: &str = "there is no `rustc`: install Rust from https://rustup.rs";

/// A Rust compiler with its Cargo.
struct Rust {
    cargo: PathBuf,
    rustc: PathBuf,
    version: String,
    host: String,
    sysroot: PathBuf,
}

impl Rust {
    /// The Rust in `PATH` (or chosen by the environment), and that of the system, if they are
    /// there. The first is that of rustup on most machines; Debian's, which cannot add targets, can
    /// build every standard library with its package of sources.
    fn all() -> Vec<Self> {
        let chosen = |name: &str, variable| {
            std::env::var_os(variable).map_or_else(|| PathBuf::from(name), PathBuf::from)
        };
        let pairs = [
            (chosen("cargo", "CARGO"), chosen("rustc", "RUSTC")),
            ("/usr/bin/cargo".into(), "/usr/bin/rustc".into()),
        ];
        pairs.into_iter().filter_map(|(cargo, rustc)| Self::new(cargo, rustc)).collect()
    }

    fn new(cargo: PathBuf, rustc: PathBuf) -> Option<Self> {
        let about = output(Command::new(&rustc).arg("-vV"))?;
        let field = |name| Some(about.lines().find_map(|l| l.strip_prefix(name))?.to_string());
        let sysroot = output(Command::new(&rustc).args(["--print", "sysroot"]))?.into();
        Some(Self { cargo, version: field("release: ")?, host: field("host: ")?, sysroot, rustc })
    }

    /// Whether the standard library of the target is installed.
    fn has(&self, target: &str) -> bool {
        let mut ask = Command::new(&self.rustc);
        ask.args(["--print", "target-libdir", "--target", target]);
        let files = output(&mut ask).and_then(|folder| std::fs::read_dir(folder).ok());
        files
            .into_iter()
            .flatten()
            .flatten()
            .any(|file| file.file_name().to_str().is_some_and(|n| n.starts_with("libstd-")))
    }

    /// Whether the sources of the standard library are installed.
    fn has_sources(&self) -> bool {
        self.sysroot.join("lib/rustlib/src/rust/library/std/Cargo.toml").exists()
    }

    /// Whether the compiler brings a linker of its own.
    fn has_linker(&self, name: &str) -> bool {
        self.sysroot.join("lib/rustlib").join(&self.host).join("bin").join(name).exists()
    }
}

impl Toolchain {
    /// How to build for a target. An error says what has to be installed.
    pub fn of(target: &str) -> Result<Self, String> {
        let all = Rust::all();
        let Some(first) = all.first() else {
            return Err(NO_RUST.into());
        };
        if first.host == target {
            return Self::native();
        }
        let foreign = FOREIGN.iter().find(|f| f.target == target).ok_or_else(|| {
            let known = FOREIGN.map(|f| f.target).join(", ");
            format!("`{target}` is not a target that is known here: {known}")
        })?;
        let (rust, mut toolchain) = compiler(&all, target, foreign.from_source)?;
        let mut rustflags = foreign.rustflags.to_string();
        if !rust.has(target) && target.contains("wasi") {
            rustflags += &with_wasi_libc()?;
        }
        let found = |name: &&&str| rust.has_linker(name) || is_in_path(name);
        let linker = foreign.linkers.iter().find(found).ok_or_else(|| {
            let (name, package) = (foreign.linkers[0], foreign.linker_package);
            format!("the linker `{name}` for {target} is not installed: `apt install {package}`")
        })?;
        let variable = target.to_uppercase().replace('-', "_");
        toolchain.set(&format!("CARGO_TARGET_{variable}_LINKER"), linker);
        if !rustflags.is_empty() {
            toolchain.set(&format!("CARGO_TARGET_{variable}_RUSTFLAGS"), &rustflags);
        }
        if !target.starts_with(std::env::consts::ARCH) || !target.contains(std::env::consts::OS) {
            toolchain.runner = foreign.runner.iter().map(|&word| word.into()).collect();
            let runner = foreign.runner.join(" ");
            toolchain.set(&format!("CARGO_TARGET_{variable}_RUNNER"), &runner);
        }
        Ok(toolchain)
    }

    /// How to build for a target, for a program that brings a linker of its own. An error says what
    /// has to be installed.
    pub fn linked_by_zig(target: &str) -> Result<Self, String> {
        let toolchain = compiler(&Rust::all(), target, "-Zbuild-std=std,panic_unwind")?.1;
        let folder = Path::new("target/for").join(format!("{target}-{}-zig", toolchain.version));
        Ok(Self { folder, ..toolchain })
    }

    /// The target that is this machine.
    pub fn host() -> Option<String> {
        Rust::all().into_iter().next().map(|rust| rust.host)
    }

    /// How to build for this machine: as `cargo` does, into the folder `target`.
    pub fn native() -> Result<Self, String> {
        let all = Rust::all();
        let toolchain = all.first().ok_or(NO_RUST)?.toolchain(None);
        Ok(Self { folder: "target".into(), ..toolchain })
    }

    /// How to build for this machine by another version of Rust than usual.
    pub fn other() -> Result<Self, String> {
        let all = Rust::all();
        let first = all.first().ok_or(NO_RUST)?;
        let other = all.iter().find(|rust| rust.version != first.version);
        Ok(other.ok_or("there is no second Rust in /usr/bin")?.toolchain(None))
    }

    /// The version of the compiler, as in `1.96.0`.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// A Cargo command for the target, such as `build`. What it builds is in the folder
    /// [`artifacts`](Self::artifacts).
    pub fn cargo(&self, command: &str) -> Command {
        let mut cargo = Command::new(&self.cargo);
        cargo.arg(command).args(&self.flags).arg("--target-dir").arg(&self.folder);
        if let Some(target) = &self.target {
            cargo.args(["--target", target]);
        }
        cargo.envs(self.environment.iter().map(|(name, value)| (name, value)));
        cargo
    }

    /// Makes a program that calls Cargo and passes Cargo's options on, such as `maturin`, build for
    /// the target.
    pub fn hand_to(&self, program: &mut Command) {
        program.env("CARGO", &self.cargo);
        program.envs(self.environment.iter().map(|(name, value)| (name, value)));
        program.args(&self.flags).arg("--target-dir").arg(&self.folder);
    }

    /// The folder of what was built with a profile, such as `release`.
    pub fn artifacts(&self, profile: &str) -> PathBuf {
        match &self.target {
            Some(target) => self.folder.join(target).join(profile),
            None => self.folder.join(profile),
        }
    }

    /// A command that runs a program that was built for the target (for `wasm32`, a script for
    /// Node.js). An error says what has to be installed.
    pub fn run(&self, program: &Path) -> Result<Command, String> {
        let Some((name, arguments)) = self.runner.split_first() else {
            return Ok(Command::new(program));
        };
        if !is_in_path(name) {
            let foreign = FOREIGN.iter().find(|f| f.runner[0] == name);
            let package = foreign.map_or("", |f| f.runner_package);
            return Err(format!("`{name}` is not installed: `apt install {package}`"));
        }
        let mut command = Command::new(name);
        command.args(arguments).arg(program);
        Ok(command)
    }

    fn set(&mut self, name: &str, value: &str) {
        self.environment.push((name.into(), value.into()));
    }
}

impl Rust {
    fn toolchain(&self, target: Option<&str>) -> Toolchain {
        let rustc = self.rustc.to_string_lossy().into_owned();
        let folder = format!("{}-{}", target.unwrap_or("here"), self.version);
        Toolchain {
            target: target.map(Into::into),
            folder: Path::new("target/for").join(folder),
            cargo: self.cargo.clone(),
            environment: vec![("RUSTC".into(), rustc)],
            flags: Vec::new(),
            runner: Vec::new(),
            version: self.version.clone(),
        }
    }
}

/// The compiler for a target, with the flags of Cargo that make up for a standard library that is
/// not installed.
fn compiler<'a>(
    all: &'a [Rust],
    target: &str,
    from_source: &'static str,
) -> Result<(&'a Rust, Toolchain), String> {
    if all.is_empty() {
        return Err(NO_RUST.into());
    }
    let built = all.iter().find(|rust| rust.has(target));
    let rust = built.or(all.iter().find(|rust| rust.has_sources())).ok_or_else(|| {
        format!(
            "the standard library for {target} is not installed: `rustup target add {target}`, \
             or on Debian `apt install cargo-web rustc-web rust-web-src rust-web-llvm`"
        )
    })?;
    let mut toolchain = rust.toolchain(Some(target));
    if built.is_none() {
        toolchain.flags.push(from_source);
        toolchain.set("RUSTC_BOOTSTRAP", "1");
    }
    Ok((rust, toolchain))
}

/// Flags that link Debian's C library for WASI.
fn with_wasi_libc() -> Result<String, String> {
    let start = Path::new(WASI_LIBC).join("crt1-reactor.o");
    if !start.exists() {
        return Err("the C library for WASI is not installed: `apt install wasi-libc`".into());
    }
    let start = start.display();
    Ok(format!(" -Clink-self-contained=no -Lnative={WASI_LIBC} -Clink-arg={start}"))
}

/// The first line that a command prints, or all of them; `None` if it fails.
fn output(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_string())
}

fn is_in_path(name: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| {
        folder.join(name).is_file() || folder.join(name).with_extension("exe").is_file()
    })
}
