//! `--checkpoint`: the state of a render is saved from time to time, so that the same command goes
//! on with it after whatever has ended it.

use super::options::Options;
use crate::failure::Failure;
use crate::spectrum_file;
use snell_formats::Sources;
use snell_formats::error::one_line;
use snell_persist::{Checkpoint, Lock, Receipt, Resume, Wording};
use snell_render::{FRAME, Fact, Settings, fact, facts};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// The checkpoint that the options ask for, if they ask for one. `picture` is the file of the
/// picture, and the receipt tells what is rendered.
pub fn of_options(
    options: &Options,
    settings: &Settings,
    picture: &Path,
    receipt: &Receipt,
) -> Result<Option<Checkpoint>, Failure> {
    let Some(path) = options.checkpoint.clone() else { return Ok(None) };
    let interval = options.checkpoint_interval.unwrap_or(Checkpoint::INTERVAL);
    let facts = all_facts(options, settings, picture)?;
    Ok(Some(Checkpoint::new(path, facts, receipt.text(), interval)))
}

/// Whether the options go on with what is there. The checkpoint of one frame is followed by that of
/// the next.
pub fn resume(options: &Options) -> Resume {
    match (options.resume, options.has_frames()) {
        (false, _) => Resume::Never,
        (true, false) => Resume::Always,
        (true, true) => Resume::IfSame,
    }
}

/// What to do to go on with an interrupted render.
pub fn farewell(checkpoint: &Checkpoint) -> String {
    let shown = one_line(&checkpoint.path().display().to_string()).into_owned();
    match checkpoint.has_failed() {
        true => format!("the render could not be saved in {shown}"),
        false => format!("the same command with --resume continues from {shown}"),
    }
}

/// Refuses the checkpoint of another animation, or of a single picture.
pub fn check_animation(
    options: &Options,
    settings: &Settings,
    first: &Path,
    receipt: &Receipt,
) -> Result<(), Failure> {
    match of_options(options, settings, first, receipt)? {
        Some(checkpoint) if options.resume => {
            Ok(checkpoint.check_animation(settings.spp, Wording::COMMAND)?)
        }
        _ => Ok(()),
    }
}

/// Refuses a checkpoint that would replace one that is not gone on with. While the lock exists, no
/// other render saves to it.
pub fn check(options: &Options) -> Result<Option<Lock>, Failure> {
    let Some(path) = &options.checkpoint else {
        let is_alone = options.resume && !options.has_frames();
        return match (is_alone, options.checkpoint_interval) {
            (true, _) => Err(Failure::Usage(
                "--resume continues frames, or the render that --checkpoint FILE has saved".into(),
            )),
            (_, Some(_)) => {
                Err(Failure::Usage("--checkpoint-interval needs --checkpoint FILE".into()))
            }
            _ => Ok(None),
        };
    };
    if path == Path::new("-") {
        let problem = "--checkpoint -: a checkpoint is written again and again; name a file";
        return Err(Failure::Usage(problem.into()));
    }
    let place = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(folder.join(path.file_name()?))
    };
    let others = [
        ("--output", &options.output),
        ("--stats", &options.stats),
        ("--preview", &options.preview),
    ];
    let is_same = |other: &&(&str, &Option<PathBuf>)| {
        other.1.as_ref().is_some_and(|other| other == path || place(other) == place(path))
    };
    if let Some((name, _)) = others.iter().find(is_same) {
        return Err(Failure::Usage(format!("--checkpoint and {name} name the same file")));
    }
    Ok(Checkpoint::check(path, resume(options), Wording::COMMAND)?)
}

/// All on which a picture depends: the files, the options that change the scene, and the settings.
pub fn all_facts(
    options: &Options,
    settings: &Settings,
    picture: &Path,
) -> Result<Vec<Fact>, Failure> {
    let mut all = vec![("the version of Snell".into(), env!("CARGO_PKG_VERSION").to_string())];
    let folder = options.scene.parent().unwrap_or(Path::new(""));
    let files = options.sources.as_ref().map(Sources::list).unwrap_or_default();
    if files.is_empty() {
        all.push(("the scene".into(), one_line(&options.scene.display().to_string()).into()));
    }
    for (path, hash) in files {
        let name = path.strip_prefix(folder).unwrap_or(&path);
        let hash: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        all.push((format!("the file {}", one_line(&name.display().to_string())), hash));
    }
    let define: Vec<String> = options
        .define
        .iter()
        .map(|definition| spectrum_file::resolve(definition))
        .collect::<Result<_, _>>()?;
    let frame = picture.file_name().filter(|_| options.has_frames());
    let shutter = options.shutter.map(|[open, close]| format!("{open}..{close}"));
    let define = Some(define.join(" --define ")).filter(|_| !define.is_empty());
    all.extend(fact(FRAME, frame.map(OsStr::display)));
    all.extend(fact("--at", options.at));
    for (name, value) in [
        ("--camera", &options.camera),
        ("--animation", &options.animation),
        ("--turntable", &options.turntable.map(|turn| turn.to_string())),
        ("--shutter", &shutter),
        ("--variant", &options.variant),
        ("--scene", &options.scene_of_file),
        ("--background", &options.background),
        ("--fog", &options.fog.map(|density| density.to_string())),
        ("--define", &define),
    ] {
        all.extend(fact(name, value.as_ref()));
    }
    all.extend(fact("--environment", options.environment.as_deref().map(OsStr::display)));
    all.extend(facts(settings));
    Ok(all)
}
