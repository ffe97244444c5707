//! The receipts of pictures: between the options of `snell render` and [`Receipt`].

use super::options::Options;
use crate::failure::Failure;
use clap::{ArgMatches, Command, FromArgMatches};
use snell_formats::Sources;
use snell_formats::error::one_line;
use snell_persist::{Receipt, sha256};
use std::path::Path;

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

/// The receipt of the picture that the options ask for, before its tiles are known. `matches` are
/// the options as they were given.
pub fn of_options(options: &Options, matches: &ArgMatches) -> Receipt {
    let mut arguments = arguments(matches, &NEUTRAL);
    arguments.retain(|argument| !argument.starts_with("--display=tev:"));
    let name = options.scene.file_name().unwrap_or(options.scene.as_os_str());
    let name = one_line(&name.to_string_lossy()).into_owned();
    Receipt::new(name, scene_sha256(options), arguments)
}

/// The hash of all files that were read, or of a built-in scene's name.
pub fn scene_sha256(options: &Options) -> String {
    let folder = options.scene.parent().unwrap_or(Path::new(""));
    let files = options.sources.as_ref().map(Sources::list).unwrap_or_default();
    if files.is_empty() {
        return sha256(options.scene.as_os_str().as_encoded_bytes());
    }
    // Names outside of the scene's folder differ between machines, but for the last part.
    let name = |path: &Path| {
        let inside = path.strip_prefix(folder).ok();
        inside.or(path.file_name().map(Path::new)).unwrap_or(path).display().to_string()
    };
    let named = files.iter().map(|(path, hash)| match *path == options.scene {
        true => (String::new(), hash),
        false => (name(path), hash),
    });
    Receipt::hash_of_files(named)
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
