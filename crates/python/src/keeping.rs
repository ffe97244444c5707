//! Files that keep renders on their way.

use crate::distributed::packed;
use crate::file::write_error;
use crate::render::Task;
use crate::scene::Scene;
use crate::settings::{Keywords, denoise_error};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use snell_oidn::DenoiseError;
use snell_persist::{Checkpoint, Lock, Problem, Receipt, Resume, Wording, sha256};
use snell_render::{Fact, Request, fact, facts};
use std::path::PathBuf;
use std::time::Duration;

/// A file that keeps a render on its way.
pub struct Keeping {
    /// Whether the render goes on with what is there.
    pub resume: Resume,
    path: PathBuf,
    interval: Duration,
    facts: Vec<Fact>,
    note: String,
    /// Keeps other renders from saving to the file.
    _lock: Option<Lock>,
}

/// Why a render has failed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Noise could not be removed.
    #[error(transparent)]
    Denoise(#[from] DenoiseError),
    /// What was saved cannot be gone on with.
    #[error(transparent)]
    Checkpoint(#[from] Problem),
}

impl RunError {
    /// The error for Python.
    pub fn raised(self) -> PyErr {
        match self {
            Self::Denoise(error) => denoise_error(error),
            Self::Checkpoint(problem) => raised(&problem),
        }
    }
}

impl Keeping {
    /// The file of these keywords: its path, the seconds between two savings, and whether the
    /// render goes on with what is there. The picture depends on the scene and on all settings.
    pub fn new<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        task: &Task,
        keywords: &Keywords<'_, 'py>,
        (path, seconds, is_resumed): (PathBuf, f64, bool),
    ) -> PyResult<Self> {
        let interval = Duration::try_from_secs_f64(seconds).ok().filter(|i| !i.is_zero());
        let Some(interval) = interval else {
            return Err(PyValueError::new_err(format!(
                "checkpoint_interval is {seconds}, expected seconds above 0"
            )));
        };
        let resume = if is_resumed { Resume::Always } else { Resume::Never };
        let lock = Checkpoint::check(&path, resume, Wording::PYTHON)
            .map_err(|problem| raised(&problem))?;
        let version = env!("CARGO_PKG_VERSION").to_string();
        let hash = sha256(packed(py, scene)?.as_bytes());
        let camera = serde_json::to_string(&task.camera);
        let camera = camera.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let shutter: Option<[f64; 2]> = keywords.get("shutter", "two times, (open, close)")?;
        let mut all = vec![
            ("the version of Snell".to_string(), version),
            ("the scene".into(), hash.clone()),
            ("the camera".into(), camera),
        ];
        all.extend(fact("--shutter", shutter.map(|[open, close]| format!("({open}, {close})"))));
        all.extend(facts(&task.settings));
        let name = task.prepared.scene.name.clone();
        let note = Receipt::new(name, hash, Vec::new()).text();
        Ok(Self { resume, path, interval, facts: all, note, _lock: lock })
    }

    /// The checkpoint.
    pub fn checkpoint(&self) -> Checkpoint {
        let Self { path, interval, facts, note, .. } = self;
        Checkpoint::new(path.clone(), facts.clone(), note.clone(), *interval)
    }
}

/// The error for Python of a problem with a checkpoint.
fn raised(problem: &Problem) -> PyErr {
    match problem {
        Problem::Write(error) => write_error(error),
        Problem::Usage(message) | Problem::Other(message) => {
            PyValueError::new_err(with_keywords(message))
        }
    }
}

/// A message in which the command's options have the names of the keywords.
fn with_keywords(message: &str) -> String {
    let word = |word: &str| match word.strip_prefix("--") {
        Some(option) => {
            let setting = Request::SETTINGS.iter().find(|setting| setting.option() == option);
            setting.map_or_else(|| option.replace('-', "_"), |setting| setting.name.into())
        }
        None => word.to_string(),
    };
    message.split(' ').map(word).collect::<Vec<_>>().join(" ")
}
