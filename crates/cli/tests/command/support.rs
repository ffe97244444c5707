//! Runs the command and inspects its results.

use snell_formats::{Input, ReadOptions, image};
use snell_scene::{Image, LayeredImage};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// A small red ball, seen from the front, illuminated by its own sky.
pub const BALL: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float \
    y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 \
    2\n";

/// A fresh folder to run in.
pub struct Place {
    folder: TempDir,
}

/// How a command ended.
#[derive(Debug)]
pub struct Run {
    pub code: i32,
    pub out: Vec<u8>,
    pub err: String,
}

impl Run {
    /// Standard output as text.
    pub fn text(&self) -> &str {
        std::str::from_utf8(&self.out).expect("text is UTF-8")
    }

    /// Returns the run; panics unless the command succeeded.
    #[track_caller]
    pub fn done(self) -> Self {
        assert_eq!(self.code, 0, "{}", self.err);
        self
    }
}

impl Place {
    pub fn new() -> Self {
        Self { folder: TempDir::new().expect("temporary folders can be made") }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> &Self {
        std::fs::write(self.path(name), content).expect("the temporary folder is writable");
        self
    }

    pub fn command(&self, words: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_snell"));
        command
            .args(words.split_whitespace())
            .current_dir(self.folder.path())
            .env_remove("SNELL_SIMD");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Runs `snell` with these words, separated by blanks.
    pub fn run(&self, words: &str) -> Run {
        self.finish(&mut self.command(words), b"")
    }

    /// Runs `snell` with `input` on standard input.
    pub fn run_with_input(&self, words: &str, input: &[u8]) -> Run {
        self.finish(self.command(words).stdin(Stdio::piped()), input)
    }

    pub fn finish(&self, command: &mut Command, input: &[u8]) -> Run {
        let mut child = command.spawn().expect("the command exists");
        if let Some(mut stdin) = child.stdin.take() {
            // A command that fails early does not read.
            let _ = stdin.write_all(input);
        }
        let output = child.wait_with_output().expect("the command was started");
        let code = output.status.code().expect("the command ends by itself");
        Run { code, out: output.stdout, err: String::from_utf8_lossy(&output.stderr).into_owned() }
    }

    /// Names of the files in the folder.
    pub fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).expect("the folder is there");
        let mut names: Vec<_> =
            entries.flatten().map(|e| e.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    pub fn image(&self, name: &str) -> Image {
        read_image(&self.path(name))
    }

    pub fn layers(&self, name: &str) -> LayeredImage {
        let input = Input::open(&self.path(name), &ReadOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        image::read_layers(&input).unwrap_or_else(|e| panic!("{e}"))
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        let text = std::fs::read(self.path(name)).expect("the file was written");
        serde_json::from_slice(&text).expect("it is JSON")
    }
}

fn read_image(path: &Path) -> Image {
    let input = Input::open(path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    image::read_image(&input).unwrap_or_else(|e| panic!("{e}"))
}
