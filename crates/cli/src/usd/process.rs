//! The Python process that reads a stage. It imports nothing from the current folder or the scene's
//! folder, has limits on time, memory and output, and ends when this program does.

use super::converter;
use snell_formats::ReadOptions;
use std::ffi::OsStr;
use std::io::{Read, Result, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Maximum time for reading a stage.
pub const TIME: Duration = Duration::from_secs(600);
/// Maximum number of bytes of messages that are kept.
const MOST_SAID: u64 = 16 << 20;
/// Interval between checks on the process.
const INTERVAL: Duration = Duration::from_millis(5);
/// Prefixes of environment variables that change what Python and USD load; such a variable may name
/// the current folder.
const FOREIGN: [&str; 7] = ["PYTHON", "PXR_", "USD", "TF_", "AR_", "SDF_", "PCP_"];

/// How the process ended.
pub enum End {
    /// The process exited with this code.
    Exit(i32),
    /// A signal killed the process, or the system reported something else.
    Killed(ExitStatus),
    /// The process took longer than [`TIME`].
    TooLong,
    /// The process wrote more than a file may hold.
    TooLarge,
}

/// The output of the process.
pub struct Answer {
    pub end: End,
    /// The standard output of the process.
    pub scene: Vec<u8>,
    /// The standard error of the process.
    pub said: String,
}

/// The Python that runs this program, if one does.
static OWN: OnceLock<PathBuf> = OnceLock::new();

/// Makes this Python the first that reads USD stages: the one that a Python package runs in has
/// `usd-core`, if it was installed with the package.
pub fn prefer_interpreter(python: PathBuf) {
    // It is called once, before the command starts.
    let _ = OWN.set(python);
}

/// The Python that this program runs in, and the programs `python3` and `python` on the search
/// path. Entries that depend on the working directory are skipped: relative ones, the current
/// folder and the scene's folder.
pub fn interpreters(scene: &Path) -> Vec<PathBuf> {
    let here = [std::env::current_dir().ok(), absolute(scene).parent().map(Path::to_path_buf)];
    let here: Vec<_> =
        here.into_iter().flatten().filter_map(|folder| folder.canonicalize().ok()).collect();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<_> = std::env::split_paths(&path)
        .filter(|folder| {
            folder.is_absolute()
                && folder.canonicalize().is_ok_and(|folder| !here.contains(&folder))
        })
        .collect();
    let find = |name: &str| {
        let name = format!("{name}{}", std::env::consts::EXE_SUFFIX);
        folders.iter().map(|folder| folder.join(&name)).find(|program| is_program(program))
    };
    OWN.get()
        .cloned()
        .into_iter()
        .chain(["python3", "python"].into_iter().filter_map(find))
        .collect()
}

fn is_program(path: &Path) -> bool {
    let Ok(known) = path.metadata() else { return false };
    #[cfg(unix)]
    if std::os::unix::fs::PermissionsExt::mode(&known.permissions()) & 0o111 == 0 {
        return false;
    }
    known.is_file()
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf())
}

/// Runs the converter.
pub fn run(python: &Path, scene: &Path, options: &ReadOptions) -> Result<Answer> {
    let program = converter::program();
    let mut process = Process(command(python, scene, options, program.len()).spawn()?);
    let (stdin, stdout, stderr) =
        (process.0.stdin.take(), process.0.stdout.take(), process.0.stderr.take());
    let limit = options.limits.file_bytes;
    std::thread::scope(|threads| {
        // Each pipe has a thread, so that neither side waits for the other forever. The pipe to the
        // process stays open: the process ends when it closes. If the process ends early, its own
        // message gives the reason.
        let input = threads
            .spawn(move || stdin.map(|mut pipe| pipe.write_all(program.as_bytes()).map(|()| pipe)));
        let output = threads.spawn(move || read(stdout, limit));
        let said = threads.spawn(move || read(stderr, MOST_SAID));
        let status = process.wait(Instant::now() + TIME);
        drop(process);
        drop(input.join());
        let [scene, said] = [output, said].map(|reader| reader.join().unwrap_or_default());
        let end = match status? {
            _ if scene.len() as u64 > limit => End::TooLarge,
            None => End::TooLong,
            Some(status) => status.code().map_or(End::Killed(status), End::Exit),
        };
        Ok(Answer { end, scene, said: String::from_utf8_lossy(&said).into_owned() })
    })
}

fn command(python: &Path, scene: &Path, options: &ReadOptions, length: usize) -> Command {
    let path = absolute(scene);
    let mut command = Command::new(python);
    command
        .args(["-I", "-B", "-X", "utf8", "-c", converter::BOOT])
        .arg(length.to_string())
        .arg(scene);
    if options.confine {
        command.arg("--confine");
    }
    command.arg(&path).arg("-").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // Nothing is loaded from the current folder, libraries included.
    command.current_dir(path.ancestors().last().unwrap_or(&path));
    let is_foreign =
        |name: &OsStr| FOREIGN.iter().any(|start| name.to_string_lossy().starts_with(start));
    for (name, _) in std::env::vars_os().filter(|(name, _)| is_foreign(name)) {
        command.env_remove(name);
    }
    command
}

/// Reads a pipe up to the limit, and one byte more if there is one. The pipe is then closed, so the
/// other side cannot go on writing.
fn read(pipe: Option<impl Read>, limit: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    // After an error, the bytes read so far are kept; the exit status tells the reason.
    let _ = pipe.map(|pipe| pipe.take(limit.saturating_add(1)).read_to_end(&mut bytes));
    bytes
}

/// A child process that is killed when this value is dropped.
struct Process(Child);

impl Process {
    /// Waits until the process ends; `None` if it has not ended at `until`.
    fn wait(&mut self, until: Instant) -> Result<Option<ExitStatus>> {
        while Instant::now() < until {
            if let Some(status) = self.0.try_wait()? {
                return Ok(Some(status));
            }
            std::thread::sleep(INTERVAL);
        }
        Ok(None)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Killing fails if the process has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    /// A script that stands in for the Python interpreter.
    fn script(folder: &tempfile::TempDir, text: &str) -> PathBuf {
        let path = folder.path().join("python3");
        std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).expect("written");
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("ours");
        path
    }

    #[test]
    fn output_without_end_is_cut_off() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut options = ReadOptions::default();
        options.limits.file_bytes = 10_000;
        let endless = script(&folder, "exec yes scene");
        let answer = run(&endless, Path::new("a.usda"), &options).expect("it starts");
        assert!(matches!(answer.end, End::TooLarge));
        assert_eq!(answer.scene.len(), 10_001);
        let brief = script(&folder, "echo scene; echo 'warning: odd' >&2");
        let answer = run(&brief, Path::new("a.usda"), &options).expect("it starts");
        assert!(matches!(answer.end, End::Exit(0)));
        assert_eq!(
            (answer.scene.as_slice(), answer.said.as_str()),
            (&b"scene\n"[..], "warning: odd\n")
        );
    }

    #[test]
    fn what_takes_too_long_is_ended() {
        let child = Command::new("sleep").arg("600").spawn().expect("it starts");
        let (id, mut process) = (child.id(), Process(child));
        assert!(
            process
                .wait(Instant::now() + Duration::from_millis(20))
                .expect("it can be asked")
                .is_none()
        );
        drop(process);
        assert!(!Path::new(&format!("/proc/{id}")).exists());
    }
}
