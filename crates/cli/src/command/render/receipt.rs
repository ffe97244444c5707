//! The receipt of a picture: all that is needed to render parts of it again and to compare bits.
//!
//! A picture carries its receipt in its metadata. It does not depend on the machines, threads and
//! runs that made the picture.

use super::options::Options;
use super::output::hex;
use crate::failure::Failure;
use base64::Engine;
use base64::prelude::BASE64_STANDARD_NO_PAD as BASE64;
use clap::{ArgMatches, Command, FromArgMatches};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use snell_formats::Sources;
use snell_formats::error::one_line;
use snell_render::{Film, FilmTile};
use std::path::Path;

/// The name of the receipt in the metadata of a picture.
pub const KEY: &str = "Receipt";

/// Bytes of a tile's hash.
const HASH_BYTES: usize = 8;

/// Options that do not change the picture.
pub const NEUTRAL: [&str; 12] = [
    "scene",
    "output",
    "threads",
    "stats",
    "quiet",
    "verbose",
    "progress",
    "checkpoint",
    "checkpoint_interval",
    "resume",
    "preview",
    "simd",
];

/// The option of the time of a picture.
const AT: &str = "--at";

/// The option of the frames of an animation.
const FRAMES: &str = "--frames";

/// The receipt of a picture.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Receipt {
    /// The version of Snell.
    pub version: String,
    /// The name of the scene's file without its folder, or of the built-in scene.
    pub scene: String,
    /// The SHA-256 of the names and contents of all files of the scene.
    pub scene_sha256: String,
    /// The options of `snell render` that change the picture, in alphabetical order.
    pub arguments: Vec<String>,
    /// The number of the picture among those of a turntable, from 0.
    pub picture: u32,
    /// The least and the largest number of samples of a pixel.
    pub samples: [u32; 2],
    /// A hash of each tile, from the top left, row by row: eight bytes in base64.
    pub tiles: String,
}

impl Receipt {
    /// The receipt of the picture that the options ask for, before its tiles are known. `matches`
    /// are the options as they were given.
    pub fn new(options: &Options, matches: &ArgMatches) -> Self {
        let is_kept = |argument: &str| !argument.starts_with("--display=tev:");
        let mut arguments = arguments(matches, &NEUTRAL);
        arguments.retain(|argument| is_kept(argument));
        arguments.sort_by(|a, b| name_of(a).cmp(name_of(b)));
        let name = options.scene.file_name().unwrap_or(options.scene.as_os_str());
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: one_line(&name.to_string_lossy()).into_owned(),
            scene_sha256: scene_sha256(options),
            arguments,
            picture: 0,
            samples: [0; 2],
            tiles: String::new(),
        }
    }

    /// The receipt of one frame of an animation: that of the picture at its time.
    pub fn of_frame(&self, time: f64) -> Self {
        let mut arguments = self.arguments.clone();
        arguments.retain(|argument| name_of(argument) != FRAMES);
        arguments.push(format!("{AT}={time}"));
        arguments.sort_by(|a, b| name_of(a).cmp(name_of(b)));
        Self { arguments, ..self.clone() }
    }

    /// The time that the picture shows, if it is given.
    pub fn time(&self) -> Option<f64> {
        let given = self.arguments.iter().find(|argument| name_of(argument) == AT);
        given?.split_once('=')?.1.parse().ok()
    }

    /// This receipt with the hashes of a film's tiles.
    pub fn of_film(&self, film: &Film) -> Self {
        let hashes: Vec<u8> = film.tiles.iter().flat_map(tile_hash).collect();
        let samples = [film.least_samples(), film.most_samples()];
        Self { samples, tiles: BASE64.encode(hashes), ..self.clone() }
    }

    /// The receipt as the text in a picture's metadata.
    pub fn text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Reads the text of a receipt.
    pub fn parse(text: &str) -> Result<Self, Failure> {
        serde_json::from_str(text)
            .map_err(|error| Failure::Other(format!("the receipt cannot be read: {error}")))
    }

    /// The hashes of the tiles.
    pub fn hashes(&self) -> Option<Vec<[u8; HASH_BYTES]>> {
        let bytes = BASE64.decode(&self.tiles).ok()?;
        let (hashes, []) = bytes.as_chunks::<HASH_BYTES>() else { return None };
        Some(hashes.to_vec())
    }
}

/// The name of the option of an argument.
fn name_of(argument: &str) -> &str {
    argument.split('=').next().unwrap_or_default()
}

/// The hash of a tile: the first bytes of the SHA-256 of its values, in 32-bit floats.
pub fn tile_hash(tile: &FilmTile) -> [u8; HASH_BYTES] {
    let mut hasher = Sha256::new();
    for value in tile.values() {
        hasher.update(value.to_le_bytes());
    }
    let mut first = [0; HASH_BYTES];
    first.copy_from_slice(&hasher.finalize()[..HASH_BYTES]);
    first
}

/// The SHA-256 of the names and contents of all files that were read, or of a built-in scene's
/// name.
pub fn scene_sha256(options: &Options) -> String {
    let folder = options.scene.parent().unwrap_or(Path::new(""));
    let files = options.sources.as_ref().map(Sources::list).unwrap_or_default();
    if files.is_empty() {
        return hex(options.scene.as_os_str().as_encoded_bytes());
    }
    // Names outside of the scene's folder differ between machines, but for the last part.
    let line = |(path, hash): (&std::path::PathBuf, &[u8; 32])| {
        let inside = path.strip_prefix(folder).ok();
        let name = inside.or(path.file_name().map(Path::new)).unwrap_or(path);
        let hash: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("{hash} {}\n", name.display())
    };
    let mut lines: Vec<String> = files.iter().map(line).collect();
    lines.sort();
    hex(lines.concat().as_bytes())
}

/// The options of `snell render` that a file holds as arguments, for a scene at `path`.
///
/// A file may be a stranger's: it may ask for nothing but a picture, so options that name files to
/// write or hosts to talk to are refused, and a denoiser is the one that is installed, never a
/// library that the file names.
pub fn options_of(path: &Path, arguments: &[String]) -> Result<Options, Failure> {
    let command = <Options as clap::Args>::augment_args(Command::new("render"));
    let given = ["render".into(), path.as_os_str().to_owned()];
    let all = given.into_iter().chain(arguments.iter().map(Into::into));
    let usage = |error: clap::Error| Failure::Usage(error.render().to_string());
    let matches = command.try_get_matches_from(all).map_err(usage)?;
    let mut options = Options::from_arg_matches(&matches).map_err(usage)?;
    let is_given = |id: &&str| {
        matches.try_contains_id(id).is_ok()
            && matches.value_source(id) == Some(clap::parser::ValueSource::CommandLine)
    };
    // The scene is given here.
    let refused = NEUTRAL.into_iter().filter(|&id| id != "scene").find(is_given);
    if let Some(option) = refused.or(options.tev().map(|_| "display tev")) {
        return Err(Failure::Usage(format!(
            "{}: the options that belong to it ask for --{}, which no file may; do not trust it",
            one_line(&path.display().to_string()),
            option.replace('_', "-")
        )));
    }
    options.request.use_own_denoiser();
    Ok(options)
}

/// The options of `snell render` that were given, except those with these ids, in the order in
/// which they are declared: as arguments that give the same options again.
pub fn arguments(matches: &ArgMatches, except: &[&str]) -> Vec<String> {
    let command = <Options as clap::Args>::augment_args(Command::new("render"));
    let mut arguments = Vec::new();
    for argument in command.get_arguments() {
        let id = argument.get_id().as_str();
        let is_given = matches.try_contains_id(id).unwrap_or(false)
            && matches.value_source(id) == Some(clap::parser::ValueSource::CommandLine);
        let (true, false, Some(long)) = (is_given, except.contains(&id), argument.get_long())
        else {
            continue;
        };
        if !argument.get_action().takes_values() {
            arguments.push(format!("--{long}"));
            continue;
        }
        for value in matches.get_raw(id).into_iter().flatten() {
            arguments.push(format!("--{long}={}", value.to_string_lossy()));
        }
    }
    arguments
}
