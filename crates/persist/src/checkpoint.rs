//! The file that keeps a render on its way, and the one before it.

use crate::lock::{Lock, Unlocked};
use crate::{Pace, Saved};
use snell_formats::error::one_line;
use snell_formats::{WriteError, atomic};
use snell_render::{
    Fact, Header, Job, MARK_BYTES, Progress, SavedError, Settings, Underway, may_be_checkpoint,
};
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A file that keeps a render on its way.
///
/// The file is replaced as a whole, and the one before it stays beside it under the name
/// `FILE.before`, so that at every moment one of both is whole, whatever ends the program or the
/// system.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    facts: Vec<Fact>,
    note: String,
    pace: Pace,
    has_failed: bool,
}

/// Whether a render goes on with the file that is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resume {
    /// It begins anew.
    Never,
    /// It goes on, or fails if the file is of another picture.
    Always,
    /// It goes on if the file is of the same picture, and begins anew otherwise. One program
    /// renders several pictures with one file.
    IfSame,
}

/// How a program calls what messages name.
#[derive(Clone, Copy, Debug)]
pub struct Wording {
    /// What to do to go on with a file.
    pub resume: &'static str,
    /// The option that names the file.
    pub checkpoint: &'static str,
}

/// Why a render cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The file must not be used.
    #[error("{0}")]
    Usage(String),
    /// The file cannot be gone on with.
    #[error("{0}")]
    Other(String),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl Wording {
    /// The words of the command.
    pub const COMMAND: Self = Self { resume: "add --resume", checkpoint: "--checkpoint" };
    /// The words of the Python package.
    pub const PYTHON: Self = Self { resume: "give resume=True", checkpoint: "checkpoint" };
}

impl Checkpoint {
    /// The default time between two savings.
    pub const INTERVAL: Duration = Duration::from_secs(30);

    /// The file at `path`. `facts` are all on which the picture depends; `note` is kept in the file
    /// for those who read it.
    pub fn new(path: PathBuf, facts: Vec<Fact>, note: String, interval: Duration) -> Self {
        Self { path, facts, note, pace: Pace::new(interval), has_failed: false }
    }

    /// Checks before any work is done whether a file can be at `path`, and refuses to replace one
    /// that is not gone on with, or to which another render saves. While the lock exists, no other
    /// render saves to the file; it is `None` where the system has no locks.
    ///
    /// # Errors
    /// The message says what to do.
    pub fn check(path: &Path, resume: Resume, words: Wording) -> Result<Option<Lock>, Problem> {
        let Wording { resume: remedy, checkpoint } = words;
        check_kind(path)?;
        let place = extended(path, ".lock");
        let lock = match Lock::take(&place) {
            Ok(lock) => Some(lock),
            Err(Unlocked::Impossible) => None,
            Err(Unlocked::Taken) => {
                return Err(Problem::Usage(format!(
                    "{}: another render saves to this file; wait until it ends, or give another \
                     {checkpoint}",
                    shown(path)
                )));
            }
            Err(Unlocked::Foreign) => {
                return Err(Problem::Usage(format!(
                    "{} is not a lock of Snell, but it has the name of the checkpoint's lock; \
                     remove it, or give another {checkpoint}",
                    shown(&place)
                )));
            }
        };
        let new = extended(path, ".new");
        let mut start = Vec::new();
        let found =
            File::open(&new).and_then(|file| file.take(MARK_BYTES as u64).read_to_end(&mut start));
        if found.is_ok() && !may_be_checkpoint(&start) {
            return Err(Problem::Usage(format!(
                "{} would be overwritten while the checkpoint is saved; give another {checkpoint}",
                shown(&new)
            )));
        }
        let known = places(path).into_iter().find(|path| path.symlink_metadata().is_ok());
        if let (Some(known), Resume::Never) = (known, resume) {
            return Err(Problem::Usage(format!(
                "{} exists; {remedy} to continue it, or remove it to start again",
                shown(&known)
            )));
        }
        atomic::check(path)?;
        Ok(lock)
    }

    /// True if there is a checkpoint of this name, or the one before it.
    pub fn is_at(path: &Path) -> bool {
        places(path).iter().any(|path| path.is_file())
    }

    /// The whole checkpoint of this name: the file at `path`, or the one before it if that is
    /// damaged or gone.
    ///
    /// # Errors
    /// What is wrong with the file at `path`, if neither is whole.
    pub fn find(path: &Path) -> Result<Found, SavedError> {
        let read = |path: &Path| -> Result<Header, SavedError> {
            let mut input = BufReader::new(File::open(path)?);
            let header = Header::read(&mut input)?;
            header.check_rest(&mut input)?;
            Ok(header)
        };
        let error = match read(path) {
            Ok(header) => return Ok(Found { header, path: path.into(), warning: None }),
            Err(error) => error,
        };
        let before = before(path);
        let Ok(header) = read(&before) else { return Err(error) };
        let warning = Some(one_before(&format!("{}: {error}", shown(path)), &before));
        Ok(Found { header, path: before, warning })
    }

    /// What the file at `path`, or else the one before it, tells of its render; `None` if there is
    /// none.
    ///
    /// # Errors
    /// If neither of both is a whole checkpoint.
    pub fn header(path: &Path, words: Wording) -> Result<Option<Header>, Problem> {
        let read = |input: &mut BufReader<File>| Header::read(input).map(Some);
        Ok(first_whole(path, words, &read)?.map(|found| found.content))
    }

    /// Checks that the file, if it is there, is of a picture of the same animation as this one:
    /// that only what belongs to the single picture differs.
    ///
    /// # Errors
    /// As those of [`Self::restore`].
    pub fn check_animation(&self, spp: u32, words: Wording) -> Result<(), Problem> {
        let Some(header) = Self::header(&self.path, words)? else { return Ok(()) };
        let difference = header.difference_from_animation(&self.facts).map(|d| d.to_string());
        let excess = (header.samples > spp)
            .then(|| format!("it has {} samples already, and --spp is {spp} now", header.samples));
        match difference.or(excess) {
            Some(problem) => Err(other(&shown(&self.path), &SavedError::Other(problem), words)),
            None => Ok(()),
        }
    }

    /// Begins the render, or goes on with the saved one. The text is a warning.
    ///
    /// # Errors
    /// As those of [`Self::restore`].
    pub fn begin(
        &self,
        job: &Job,
        resume: Resume,
        words: Wording,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Result<(Underway, Option<String>), Problem> {
        if let Some(restored) = self.restore(job, resume, words, threads, keep_going)? {
            return Ok(restored);
        }
        let warning = (resume == Resume::Always).then(|| {
            let path = shown(&self.path);
            format!("{path}: there is no checkpoint yet; the render starts from the beginning")
        });
        Ok((job.begin(threads, keep_going), warning))
    }

    /// The saved render, to be gone on with, and a warning; `None` if there is none.
    ///
    /// # Errors
    /// If what is saved cannot be gone on with; the message says why, and what to do.
    pub fn restore(
        &self,
        job: &Job,
        resume: Resume,
        words: Wording,
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Result<Option<(Underway, Option<String>)>, Problem> {
        if resume == Resume::Never {
            return Ok(None);
        }
        let restore = |input: &mut BufReader<File>| match job.restore(
            input,
            &self.facts,
            threads,
            keep_going,
        ) {
            Err(SavedError::Other(_)) if resume == Resume::IfSame => Ok(None),
            restored => restored.map(Some),
        };
        let Some(Whole { content, path, warning }) = first_whole(&self.path, words, &restore)?
        else {
            return Ok(None);
        };
        if path != self.path {
            // The next saving may not put a damaged file in the place of this one.
            std::fs::rename(&path, &self.path)
                .map_err(|error| Problem::Other(format!("{}: {error}", shown(&path))))?;
        }
        Ok(Some((content, warning)))
    }

    /// Writes the state. If that fails, the last good file stays; a first failure gives a warning.
    #[must_use]
    pub fn write(&mut self, underway: &Underway, settings: &Settings) -> Option<String> {
        let Self { path, facts, note, pace, has_failed } = self;
        let written = pace.save(|| {
            atomic::write_keeping(path, &before(path), |out| {
                underway.save(settings, facts, note, out)
            })
        });
        let had_failed = std::mem::replace(has_failed, written.is_err());
        let error = written.err().filter(|_| !had_failed)?;
        Some(format!(
            "{}; rendering continues, and saving is tried again: make room or repair the folder",
            one_line(&error.to_string())
        ))
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// True if the last saving has failed.
    pub fn has_failed(&self) -> bool {
        self.has_failed
    }
}

impl Saved for Checkpoint {
    fn is_due(&self) -> bool {
        self.pace.is_due()
    }

    fn save(&mut self, underway: &Underway, job: &Job) -> Option<String> {
        self.write(underway, job.settings())
    }
}

/// A whole checkpoint.
#[derive(Debug)]
pub struct Found {
    /// What it tells of its render.
    pub header: Header,
    /// The file that has it.
    pub path: PathBuf,
    /// What is wrong with the newer one, if that is not whole.
    pub warning: Option<String>,
}

/// Refuses what cannot be replaced by a file.
fn check_kind(path: &Path) -> Result<(), Problem> {
    let shown = shown(path);
    let Ok(known) = path.symlink_metadata() else { return Ok(()) };
    if known.is_symlink() {
        let target = std::fs::read_link(path).unwrap_or_default();
        let target = path.parent().unwrap_or(Path::new("")).join(target);
        return Err(Problem::Usage(format!(
            "{shown} is a symbolic link, and saving would replace it; name {} itself",
            one_line(&target.display().to_string())
        )));
    }
    match known.is_file() {
        true => Ok(()),
        false => Err(Problem::Usage(format!("{shown} is not a file; give the name of a file"))),
    }
}

/// The warning that the one before a checkpoint is used.
fn one_before(problem: &str, path: &Path) -> String {
    format!("{problem}; continuing with {}, the one before it", shown(path))
}

/// The error of a checkpoint of another picture.
fn other(name: &str, error: &SavedError, words: Wording) -> Problem {
    Problem::Other(format!(
        "{name}: {error}; give the same options and files as before, or another {}",
        words.checkpoint
    ))
}

/// A checkpoint that could be read.
struct Whole<T> {
    content: T,
    /// The file that has it.
    path: PathBuf,
    /// What is wrong with the newer one.
    warning: Option<String>,
}

/// Reads the checkpoint at `path`, or the one before it if that is damaged or gone. `None` if there
/// is none, or if `read` wants none.
fn first_whole<T>(
    path: &Path,
    words: Wording,
    read: &dyn Fn(&mut BufReader<File>) -> Result<Option<T>, SavedError>,
) -> Result<Option<Whole<T>>, Problem> {
    let mut first_problem = None;
    for path in places(path) {
        let file = File::open(&path).map_err(SavedError::Io);
        let name = shown(&path);
        let problem = match file.and_then(|file| read(&mut BufReader::new(file))) {
            Ok(Some(content)) => {
                let warning = first_problem.map(|problem: String| one_before(&problem, &path));
                return Ok(Some(Whole { content, path, warning }));
            }
            Ok(None) => continue,
            Err(SavedError::Io(error)) if error.kind() == ErrorKind::NotFound => continue,
            Err(error @ SavedError::Other(_)) => return Err(other(&name, &error, words)),
            Err(error @ SavedError::Foreign(_)) => {
                return Err(Problem::Other(format!("{name}: {error}; name another file")));
            }
            Err(error) => format!("{name}: {error}"),
        };
        first_problem.get_or_insert(problem);
    }
    match first_problem {
        Some(problem) => Err(Problem::Other(format!("{problem}; remove it to start again"))),
        None => Ok(None),
    }
}

/// The file, and the one before it.
fn places(path: &Path) -> [PathBuf; 2] {
    [path.to_path_buf(), before(path)]
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

fn shown(path: &Path) -> String {
    one_line(&path.display().to_string()).into_owned()
}
