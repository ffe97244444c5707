//! The promises of the program for any files and options: it ends quickly by itself, in bounded
//! memory, with exit code 0, 1 or 2; a failure is one clean line and leaves the folder unchanged;
//! pixels are finite.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Address space of the program, in KiB: an allocation beyond it ends the program by a signal.
const MEMORY_KIB: u64 = 2_000_000;
/// Limit of processor time, in seconds: no file of a few kilobytes may take longer. Processor time
/// does not depend on other load on the machine.
const PROCESSOR_SECONDS: u32 = 20;
/// Limit of time, in seconds, for anything that waits forever.
const SECONDS: u64 = 120;
/// Maximum number of bytes of messages.
const FLOOD: usize = 1 << 20;
/// The content of the output before the program runs.
const BEFORE: &[u8] = b"what was here before";

/// How a run of the program ended.
pub struct Ended {
    /// Exit code; `None` if a signal or the limits ended it.
    pub code: Option<i32>,
    pub output: Vec<u8>,
    pub messages: String,
    pub time: Duration,
    status: String,
}

/// Runs the program in a folder. Its output goes to files in `scratch`, outside of that folder.
pub fn run(program: &Path, words: &[String], folder: &Path, scratch: &Path) -> Ended {
    let [output, messages] = ["output", "messages"].map(|name| scratch.join(name));
    let file = |path: &Path| File::create(path).expect("the temporary folder is writable");
    let mut command = if cfg!(target_os = "linux") {
        let mut shell = Command::new("sh");
        let limits = format!("ulimit -v {MEMORY_KIB}; ulimit -t {PROCESSOR_SECONDS}; ulimit -c 0");
        shell.arg("-c").arg(format!("{limits}; exec \"$0\" \"$@\"")).arg(program);
        shell
    } else {
        Command::new(program)
    };
    command.args(words).current_dir(folder).env_remove("SNELL_SIMD").env("RUST_BACKTRACE", "0");
    command.stdin(Stdio::null()).stdout(file(&output)).stderr(file(&messages));
    let start = Instant::now();
    let mut child = command.spawn().expect("the program exists");
    let status = loop {
        if let Some(status) = child.try_wait().expect("a child can be waited for") {
            break Some(status);
        }
        if start.elapsed() > Duration::from_secs(SECONDS) {
            _ = child.kill();
            _ = child.wait();
            break None;
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    let bytes = |path: &Path| fs::read(path).expect("the file was made above");
    Ended {
        code: status.and_then(|s| s.code()),
        status: status.map_or(format!("nothing after {SECONDS} s"), |s| s.to_string()),
        time: start.elapsed(),
        output: bytes(&output),
        messages: String::from_utf8_lossy(&bytes(&messages)).into_owned(),
    }
}

impl Ended {
    /// The promise that the program broke, if any. For `doctor` and `compare`, exit code 1 is also
    /// a regular result, not a failure.
    pub fn fault(&self, words: &[String]) -> Option<String> {
        let answers = matches!(words[0].as_str(), "doctor" | "compare");
        let panic = self.messages.lines().find(|line| line.contains("panicked at"));
        let said = || panic.or(self.messages.lines().last()).unwrap_or_default();
        let errors = self.messages.lines().filter(|line| line.starts_with("error: ")).count();
        if self.messages.contains("panicked") || self.messages.contains("internal fault") {
            return Some(format!("panics: {}", said()));
        }
        match self.code {
            None => return Some(format!("ended by {}: {}", self.status, said())),
            Some(0) if errors > 0 => return Some(format!("done, with an error: {}", said())),
            Some(1) if errors == 0 && answers => {}
            Some(1 | 2) if errors != 1 => {
                return Some(format!("{errors} errors, expected one: {}", said()));
            }
            Some(0..=2) => {}
            Some(code) => return Some(format!("exit code {code}: {}", said())),
        }
        if self.messages.len() > FLOOD {
            return Some(format!(
                "a flood of {} bytes of messages: {}",
                self.messages.len(),
                said()
            ));
        }
        let is_unclean = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
        let unclean = self.messages.lines().find(|line| line.contains(is_unclean));
        unclean.map(|line| format!("control characters in a message: {line:?}"))
    }
}

/// A folder of files, and a command to run there.
#[derive(Clone)]
pub struct Case {
    pub files: BTreeMap<String, Vec<u8>>,
    pub words: Vec<String>,
    /// The file that is written, if any; files beside it begin with its stem.
    pub writes: Option<String>,
}

impl Case {
    /// The case of one file and a command line in which `FILE` stands for its name.
    pub fn new(files: BTreeMap<String, Vec<u8>>, name: &str, line: &str) -> Self {
        let words: Vec<_> = line.split_whitespace().map(|w| w.replace("FILE", name)).collect();
        let writes = words.iter().find(|w| w.starts_with("out.")).cloned();
        Self { files, words, writes }
    }

    /// Runs the case in a fresh folder below `scratch`: true if the program succeeded, false if it
    /// refused; otherwise the fault.
    pub fn try_in(&self, program: &Path, scratch: &Path) -> Result<bool, String> {
        let folder = scratch.join("case");
        _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).expect("the temporary folder is writable");
        let mut before = self.files.clone();
        // By default `convert` replaces no file; that is tested elsewhere.
        let is_replaced = self.words[0] != "convert" || self.words.iter().any(|w| w == "--force");
        before.extend(
            self.writes.iter().filter(|_| is_replaced).map(|name| (name.clone(), BEFORE.to_vec())),
        );
        write_files(&folder, &before);
        let ended = run(program, &self.words, &folder, scratch);
        match ended
            .fault(&self.words)
            .or_else(|| self.fault_of_files(&before, &folder, ended.code == Some(0)))
        {
            Some(fault) => Err(fault),
            None if self.words.iter().any(|w| w == "--json") && ended.code == Some(0) => {
                let json = serde_json::from_slice::<serde_json::Value>(&ended.output);
                json.map(|_| true).map_err(|error| format!("its JSON is none: {error}"))
            }
            None => Ok(ended.code == Some(0)),
        }
    }

    fn fault_of_files(
        &self,
        before: &BTreeMap<String, Vec<u8>>,
        folder: &Path,
        is_done: bool,
    ) -> Option<String> {
        let stem = self.writes.as_deref().map(|name| name.split('.').next().unwrap_or(name));
        let may_write = |name: &str| is_done && stem.is_some_and(|stem| name.starts_with(stem));
        let after = files_in(folder);
        let changed =
            after.iter().find(|(name, bytes)| before.get(*name) != Some(bytes) && !may_write(name));
        if let Some((name, _)) = changed {
            return Some(format!("writes {name}, done: {is_done}"));
        }
        if let Some(name) = before.keys().find(|name| !after.contains_key(*name)) {
            return Some(format!("removes {name}"));
        }
        let name = self.writes.as_ref().filter(|_| is_done)?;
        match after.get(name) {
            None => Some(format!("done without {name}")),
            Some(bytes) if bytes == BEFORE => Some(format!("done, and {name} is as before")),
            Some(bytes) => fault_of_picture(name, bytes),
        }
    }

    /// The command line that reproduces the case in a folder of its files.
    pub fn command_line(&self, program: &Path) -> String {
        let quoted: Vec<_> =
            self.words.iter().map(|w| format!("'{}'", w.replace('\'', r"'\''"))).collect();
        format!(
            "(ulimit -v {MEMORY_KIB} -t {PROCESSOR_SECONDS}; {} {})",
            program.display(),
            quoted.join(" ")
        )
    }
}

/// The files below a folder, by their relative path; a folder has no entry of its own unless it is
/// empty.
pub fn files_in(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("the folder is readable").flatten() {
        let (name, path) = (entry.file_name().to_string_lossy().into_owned(), entry.path());
        let inside = if path.is_dir() { files_in(&path) } else { BTreeMap::new() };
        if inside.is_empty() {
            found.insert(name, fs::read(&path).unwrap_or_default());
        } else {
            found.extend(
                inside.into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)),
            );
        }
    }
    found
}

/// Writes files below a folder.
pub fn write_files(folder: &Path, files: &BTreeMap<String, Vec<u8>>) {
    for (name, bytes) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().expect("a file is in a folder"))
            .expect("the folder is writable");
        fs::write(path, bytes).expect("the folder is writable");
    }
}

/// The fault of a floating-point picture, if any.
fn fault_of_picture(name: &str, bytes: &[u8]) -> Option<String> {
    use snell_formats::{Input, ReadOptions, image};
    if !name.ends_with(".pfm") && !name.ends_with(".exr") {
        return None;
    }
    if name.ends_with(".pfm") {
        // The file is decoded here, because Snell's reader makes values finite.
        let header = bytes.iter().enumerate().filter(|(_, b)| **b == b'\n').nth(2)?.0 + 1;
        let mut values =
            bytes[header..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        return values.any(|v| !v.is_finite()).then(|| "a pixel that is not finite".into());
    }
    match image::read_layers(&Input::from_bytes(
        name,
        bytes.to_vec(),
        Path::new("."),
        &ReadOptions::default(),
    )) {
        Err(error) => Some(format!("its picture cannot be read: {error}")),
        Ok(picture) => {
            let layer =
                picture.layers.iter().find(|layer| layer.values.iter().any(|v| !v.is_finite()))?;
            Some(format!("a pixel of layer {:?} that is not finite", layer.name))
        }
    }
}
