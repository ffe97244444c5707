//! `--checkpoint`: the state of a render is saved from time to time, so that the same command goes
//! on with it after whatever has ended it.

use super::options::Options;
use super::receipt::Receipt;
use crate::failure::Failure;
use crate::spectrum_file;
use snell_formats::error::one_line;
use snell_formats::{Sources, atomic};
use snell_render::{
    Fact, Job, MARK_BYTES, Progress, SavedError, Settings, Underway, fact, facts, may_be_checkpoint,
};
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Default time between two savings.
const INTERVAL: Duration = Duration::from_secs(30);

/// The file that keeps a render on its way, and the one before it.
pub struct Checkpoint<'a> {
    path: &'a Path,
    options: &'a Options,
    facts: Vec<Fact>,
    /// The receipt of the picture, which tells what is rendered.
    receipt: String,
    has_failed: bool,
}

impl<'a> Checkpoint<'a> {
    /// The checkpoint that the options ask for, if they ask for one. `picture` is the file of the
    /// picture.
    pub fn new(
        options: &'a Options,
        settings: &Settings,
        picture: &Path,
        receipt: &Receipt,
    ) -> Result<Option<Self>, Failure> {
        let Some(path) = &options.checkpoint else { return Ok(None) };
        let facts = all_facts(options, settings, picture)?;
        Ok(Some(Self { path, options, facts, receipt: receipt.text(), has_failed: false }))
    }

    /// The time between two savings.
    pub fn interval(&self) -> Duration {
        self.options.checkpoint_interval.unwrap_or(INTERVAL)
    }

    /// Begins the render, or goes on with the saved one.
    pub fn begin(
        &self,
        job: &Job,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Result<Underway, Failure> {
        if !self.options.resume {
            return Ok(job.begin(threads, keep_going));
        }
        let mut first_problem = None;
        for path in [self.path.to_path_buf(), before(self.path)] {
            let restored = File::open(&path).map_err(SavedError::Io).and_then(|file| {
                job.restore(&mut BufReader::new(file), &self.facts, threads, keep_going)
            });
            let shown = one_line(&path.display().to_string()).into_owned();
            let problem = match restored {
                Ok(underway) => {
                    if let Some(problem) = first_problem {
                        self.warn(format!("{problem}; going on with {shown}, the one before it"));
                    }
                    if path != self.path {
                        // The next saving may not put a damaged file in the place of this one.
                        std::fs::rename(&path, self.path)
                            .map_err(|error| Failure::Other(format!("{shown}: {error}")))?;
                    }
                    return Ok(underway);
                }
                Err(SavedError::Io(error)) if error.kind() == ErrorKind::NotFound => continue,
                // The checkpoint of one frame is followed by that of the next.
                Err(SavedError::Other(_)) if self.options.has_frames() => continue,
                Err(error @ SavedError::Other(_)) => {
                    return Err(Failure::Other(format!(
                        "{shown}: {error}; give the options and files of before, or another \
                            --checkpoint"
                    )));
                }
                Err(error @ SavedError::Foreign(_)) => {
                    return Err(Failure::Other(format!("{shown}: {error}; name another file")));
                }
                Err(error) => format!("{shown}: {error}"),
            };
            first_problem.get_or_insert(problem);
        }
        match first_problem {
            Some(problem) => {
                let remedy = "remove it to begin anew";
                Err(Failure::Other(format!("{problem}; {remedy}")))
            }
            None => {
                if !self.options.has_frames() {
                    let shown = one_line(&self.path.display().to_string()).into_owned();
                    self.warn(format!(
                        "{shown}: there is no checkpoint yet; the render begins anew"
                    ));
                }
                Ok(job.begin(threads, keep_going))
            }
        }
    }

    /// Saves the state. A failure is told once; the last good file stays, and rendering goes on.
    pub fn save(&mut self, underway: &Underway, settings: &Settings) {
        let written = atomic::write_keeping(self.path, &before(self.path), |out| {
            underway.save(settings, &self.facts, &self.receipt, out)
        });
        match written {
            Ok(()) => self.has_failed = false,
            Err(error) if !std::mem::replace(&mut self.has_failed, true) => self.warn(format!(
                "{}; rendering goes on, and saving is tried again: make room or mend the folder",
                one_line(&error.to_string())
            )),
            Err(_) => {}
        }
    }

    /// What to do to go on with an interrupted render.
    pub fn farewell(&self) -> String {
        let shown = one_line(&self.path.display().to_string()).into_owned();
        match self.has_failed {
            true => format!("the render could not be saved in {shown}"),
            false => format!("the same command with --resume goes on from {shown}"),
        }
    }

    fn warn(&self, problem: String) {
        if !self.options.quiet {
            eprintln!("warning: {problem}");
        }
    }
}

/// Refuses a checkpoint that would replace one that is not gone on with.
pub fn check(options: &Options) -> Result<(), Failure> {
    let Some(path) = &options.checkpoint else {
        let is_alone = options.resume && !options.has_frames();
        return match (is_alone, options.checkpoint_interval) {
            (true, _) => Err(Failure::Usage(
                "--resume goes on with frames, or with the render that --checkpoint FILE has saved"
                    .into(),
            )),
            (_, Some(_)) => {
                Err(Failure::Usage("--checkpoint-interval needs --checkpoint FILE".into()))
            }
            _ => Ok(()),
        };
    };
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
    let shown = |path: &Path| one_line(&path.display().to_string()).into_owned();
    if path.symlink_metadata().is_ok_and(|known| !known.is_file()) {
        let path = shown(path);
        return Err(Failure::Usage(format!(
            "{path} is a link or no file; name a file that is in the folder itself"
        )));
    }
    let new = extended(path, ".new");
    let mut start = Vec::new();
    let found =
        File::open(&new).and_then(|file| file.take(MARK_BYTES as u64).read_to_end(&mut start));
    if found.is_ok() && !may_be_checkpoint(&start) {
        let new = shown(&new);
        return Err(Failure::Usage(format!(
            "{new} would be overwritten while the checkpoint is saved; give another --checkpoint"
        )));
    }
    let known = [path.clone(), before(path)];
    let known = known.iter().find(|path| path.symlink_metadata().is_ok());
    if let (Some(known), false) = (known, options.resume) {
        let known = shown(known);
        return Err(Failure::Usage(format!(
            "{known} is there; add --resume to go on with it, or remove it to begin anew"
        )));
    }
    Ok(atomic::check(path)?)
}

/// The name of the checkpoint before the last one.
fn before(path: &Path) -> PathBuf {
    extended(path, ".before")
}

fn extended(path: &Path, more: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(more);
    name.into()
}

/// All on which a picture depends: the files, the options that change the scene, and the settings.
fn all_facts(options: &Options, settings: &Settings, picture: &Path) -> Result<Vec<Fact>, Failure> {
    let mut all = vec![("the version of Snell".into(), env!("CARGO_PKG_VERSION").to_string())];
    let folder = options.scene.parent().unwrap_or(Path::new(""));
    let files = options.sources.as_ref().map(Sources::list).unwrap_or_default();
    if files.is_empty() {
        all.push(("the scene".into(), format!("{:?}", options.scene)));
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
    let mut add = |name: &str, value: &dyn std::fmt::Debug| all.extend(fact(name, value));
    add("the frame", &picture.file_name().filter(|_| options.has_frames()));
    add("--at", &options.at);
    add("--camera", &options.camera);
    add("--animation", &options.animation);
    add("--turntable", &options.turntable);
    add("--shutter", &options.shutter);
    add("--variant", &options.variant);
    add("--scene", &options.scene_of_file);
    add("--background", &options.background);
    add("--environment", &options.environment);
    add("--fog", &options.fog);
    add("--define", &define);
    all.extend(facts(settings));
    Ok(all)
}
