//! The folder of a plan: what all workers share.
//!
//! ```text
//! plan.json                      what is rendered, and how it is split into tasks
//! scene-HASH.snell               the whole scene
//! frames/00000/                  the first picture
//!   finished                     there once all of its results were
//!   guiding.field                what path guiding has learnt, if it is asked for
//!   0000000/                     its round from sample 0 on
//!     00012-0000000.result       what the task from tile 12 and sample 0 on has given
//!     00012-0000000.lease        the worker that has taken this task
//!     00012-0000000.NAME.other   a second result, which differs from the first
//!     NAME.useless               a file that was set aside, because it is damaged or foreign
//!     end.state                  the film after the round, if pixels stop by their error
//! ```

use super::{shown, word};
use crate::command::render::output::{hex, sha256_of_file};
use crate::command::render::{
    self,
    frames::{Frame, digits},
    receipt,
    stage::Stage,
};
use crate::failure::Failure;
use serde::{Deserialize, Serialize};
use snell_formats::{ReadOptions, atomic};
use snell_persist::Receipt;
use snell_render::{Split, Task};
use snell_scene::{Scene, Warning, WarningKind};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The file that describes the plan.
const FILE: &str = "plan.json";

/// What the file calls itself.
const FORMAT: &str = "snell plan 1";

/// A plan: what is rendered, and how it is split into tasks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// [`FORMAT`].
    pub format: String,
    /// The version of Snell that made the plan. Only this version renders it, because others may
    /// give other bits.
    pub program: String,
    /// The name of the scene's file.
    pub scene: String,
    /// The file of the whole scene, in the folder of the plan.
    pub bundle: String,
    /// The SHA-256 of that file.
    pub bundle_sha256: String,
    /// Options of `snell render`.
    pub arguments: Vec<String>,
    /// The default name of the picture.
    pub picture: String,
    /// Warnings of the reader of the scene.
    pub warnings: Vec<String>,
    /// The number of pictures.
    pub frames: u32,
    /// The number of the first picture in the names of files; `None` if there is one, without a
    /// number.
    pub first_number: Option<i64>,
    /// Width and height of a picture in pixels.
    pub size: [u32; 2],
    /// Tiles of a picture.
    pub tiles: u32,
    /// Samples of a pixel; the upper limit if pixels stop by their error.
    pub spp: u32,
    /// True if pixels stop by their error, so that a picture takes several rounds.
    pub has_rounds: bool,
    /// How rounds are split into tasks.
    pub split: Split,
    /// The number of tasks of a picture; of its first round if it has several.
    pub tasks: u32,
    /// The name of the scene.
    pub scene_name: String,
    /// The receipt of the picture without its tiles.
    pub receipt: Receipt,
    /// The SHA-256 of all other fields.
    #[serde(default)]
    pub fingerprint: String,
}

/// A folder with a plan.
pub struct Folder {
    pub path: PathBuf,
    pub plan: Plan,
}

/// One round of one picture.
pub struct Round {
    pub path: PathBuf,
    /// Its first sample.
    pub start: u32,
}

fn failed(path: &Path, problem: impl std::fmt::Display) -> Failure {
    Failure::Other(format!("{}: {problem}", shown(path)))
}

/// An error that trying again does not mend.
fn hopeless(path: &Path, problem: impl std::fmt::Display) -> Failure {
    Failure::Usage(format!("{}: {problem}", shown(path)))
}

impl Folder {
    /// Makes a folder with a plan, whose format, program, bundle and fingerprint are filled in. The
    /// file that describes the plan comes last, so that workers that wait for it find all the rest.
    pub fn create(path: &Path, scene: &Scene, mut plan: Plan) -> Result<Self, Failure> {
        std::fs::create_dir_all(path).map_err(|error| failed(path, error))?;
        let first = path.join("scene-new.snell");
        snell_formats::write_scene(&first, scene)?;
        let bundle_sha256 = sha256_of_file(&first).map_err(|error| failed(&first, error))?;
        let bundle = format!("scene-{}.snell", &bundle_sha256[..16]);
        std::fs::rename(&first, path.join(&bundle)).map_err(|error| failed(&first, error))?;
        plan.format = FORMAT.into();
        plan.program = env!("CARGO_PKG_VERSION").into();
        (plan.bundle, plan.bundle_sha256) = (bundle, bundle_sha256);
        plan.fingerprint = plan.computed_fingerprint();
        let file = path.join(FILE);
        let text = serde_json::to_string_pretty(&plan).map_err(|error| failed(&file, error))?;
        atomic::write(&file, (text + "\n").as_bytes())?;
        Ok(Self { path: path.into(), plan })
    }

    /// True if there is a plan in a folder.
    pub fn is_at(path: &Path) -> bool {
        path.join(FILE).symlink_metadata().is_ok()
    }

    /// Opens the folder of a plan of this version of Snell.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        let file = path.join(FILE);
        if path.is_file() {
            return Err(hopeless(path, "this is a file; give the folder of a plan"));
        }
        let text = match std::fs::read_to_string(&file) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && path.is_dir() => {
                let problem = "there is no plan in this folder; make one with snell plan SCENE -o";
                return Err(hopeless(path, format!("{problem} {}", word(path))));
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(failed(path, "there is no such folder"));
            }
            read => read.map_err(|error| failed(&file, error))?,
        };
        let plan: Plan = serde_json::from_str(&text)
            .map_err(|error| hopeless(&file, format!("this is not a plan of Snell: {error}")))?;
        if plan.format != FORMAT || plan.program != env!("CARGO_PKG_VERSION") {
            return Err(hopeless(
                &file,
                format!(
                    "this plan was made by Snell {}, and this is {}, whose pictures may have other \
                     bits; use the same version on all machines",
                    plan.program,
                    env!("CARGO_PKG_VERSION")
                ),
            ));
        }
        let is_name = |name: &str| Path::new(name).file_name() == Some(std::ffi::OsStr::new(name));
        if !is_name(&plan.bundle) || !is_name(&plan.picture) {
            return Err(hopeless(&file, "this plan names files outside of its folder"));
        }
        if plan.fingerprint != plan.computed_fingerprint() {
            return Err(hopeless(&file, "this plan was changed after it was made; make a new one"));
        }
        Ok(Self { path: path.into(), plan })
    }

    /// The options of `snell render` with which the plan is rendered.
    pub fn render_options(&self) -> Result<render::Options, Failure> {
        receipt::options_of(&self.path.join(&self.plan.bundle), &self.plan.arguments)
    }

    /// Reads the scene.
    pub fn scene(&self) -> Result<Scene, Failure> {
        let path = self.path.join(&self.plan.bundle);
        let found = sha256_of_file(&path).map_err(|error| failed(&path, error))?;
        if found != self.plan.bundle_sha256 {
            let problem =
                "this is not the scene of the plan (its SHA-256 differs); copy the folder";
            return Err(hopeless(&path, format!("{problem} again, or make a new plan")));
        }
        let mut scene = snell_formats::read_scene(&path, &ReadOptions::default())?;
        scene.name.clone_from(&self.plan.scene_name);
        let warnings = self.plan.warnings.iter().cloned();
        scene.warnings = warnings
            .map(|message| Warning { message, count: 1, kind: WarningKind::Choice })
            .collect();
        Ok(scene)
    }

    /// The pictures of the plan, in order.
    pub fn frames(&self, options: &render::Options, stage: &Stage) -> Result<Vec<Frame>, Failure> {
        let frames = render::frames::all(options, stage)?;
        if frames.len() != self.plan.frames as usize {
            let problem = "scene and plan have different numbers of pictures; make a new plan";
            return Err(hopeless(&self.path, problem));
        }
        Ok(frames)
    }

    /// False if the plan is gone: its folder was moved or removed, or its share is away.
    pub fn is_there(&self) -> bool {
        self.path.join(FILE).is_file()
    }

    /// Makes a folder in that of the plan, if it is not there yet.
    ///
    /// # Errors
    /// If the plan itself is gone: a folder that was removed must not come back half.
    pub fn make(&self, path: &Path) -> std::io::Result<()> {
        match self.is_there() {
            true => std::fs::create_dir_all(path),
            false => Err(std::io::ErrorKind::NotFound.into()),
        }
    }

    /// The folder of a picture.
    pub fn frame(&self, frame: u32) -> PathBuf {
        self.path.join("frames").join(format!("{frame:05}"))
    }

    /// The guiding field of a picture.
    pub fn field(&self, frame: u32) -> PathBuf {
        self.frame(frame).join("guiding.field")
    }

    /// The file that says who trains the guiding field of a picture.
    pub fn field_lease(&self, frame: u32) -> PathBuf {
        self.frame(frame).join("guiding.lease")
    }

    /// The file that says that all results of a picture were there once.
    fn finished(&self, frame: u32) -> PathBuf {
        self.frame(frame).join("finished")
    }

    /// True if all results of a picture were there once, and still are, by their names.
    pub fn is_finished(&self, frame: u32) -> bool {
        self.finished(frame).is_file()
            && match self.plan.has_rounds {
                // The film after the last round has all of its results.
                true => self.newest_round(frame).is_some_and(|round| round.end().is_file()),
                false => self.round(frame, 0).results() >= self.plan.tasks as usize,
            }
    }

    /// Notes that all results of a picture are there.
    pub fn set_finished(&self, frame: u32) -> std::io::Result<()> {
        std::fs::write(self.finished(frame), "")
    }

    /// The round of a picture that begins with this sample.
    pub fn round(&self, frame: u32, sample: u32) -> Round {
        Round { path: self.frame(frame).join(format!("{sample:07}")), start: sample }
    }

    /// The rounds of a picture that have begun.
    fn rounds(&self, frame: u32) -> impl Iterator<Item = Round> {
        let entries = std::fs::read_dir(self.frame(frame)).into_iter().flatten().flatten();
        entries.filter_map(|entry| {
            let start = entry.file_name().to_str()?.parse().ok()?;
            Some(Round { path: entry.path(), start })
        })
    }

    /// The last round of a picture that has begun.
    pub fn newest_round(&self, frame: u32) -> Option<Round> {
        self.rounds(frame).max_by_key(|round| round.start)
    }

    /// The last round of a picture whose film is there.
    pub fn last_ended_round(&self, frame: u32) -> Option<Round> {
        self.rounds(frame).filter(|round| round.end().is_file()).max_by_key(|round| round.start)
    }
}

impl Plan {
    fn computed_fingerprint(&self) -> String {
        let bare = Self { fingerprint: String::new(), ..self.clone() };
        hex(serde_json::to_string(&bare).unwrap_or_default().as_bytes())
    }

    /// The name of a picture in messages: the number in the name of its file; `None` if there is
    /// one picture, without a number.
    pub fn name_of(&self, frame: u32) -> Option<String> {
        let number = self.first_number? + i64::from(frame);
        Some(format!("picture {}", digits(number, 4)))
    }

    /// The number of a task among all of the plan, by its number in its round. The tasks of plans
    /// with several rounds have no others.
    pub fn number_of(&self, frame: u32, task: u32) -> u64 {
        match self.has_rounds {
            true => task.into(),
            false => u64::from(frame) * u64::from(self.tasks) + u64::from(task),
        }
    }

    /// The facts on which the film of a picture depends, for its state between two rounds.
    pub fn facts(&self, frame: u32) -> Vec<snell_render::Fact> {
        vec![
            ("the plan".into(), self.fingerprint.clone()),
            ("the picture".into(), frame.to_string()),
        ]
    }
}

impl Round {
    /// The part of a task's file names that tells it from others of the round.
    pub fn stem(task: &Task) -> String {
        format!("{:05}-{:07}", task.tiles[0], task.samples[0])
    }

    /// The file of a task's result.
    pub fn result(&self, task: &Task) -> PathBuf {
        self.path.join(format!("{}.result", Self::stem(task)))
    }

    /// The file of a result that differs from the first of its task.
    pub fn other_result(&self, task: &Task, worker: &str) -> PathBuf {
        self.path.join(format!("{}.{worker}.other", Self::stem(task)))
    }

    /// The file that says who renders a task.
    pub fn lease(&self, task: &Task) -> PathBuf {
        self.path.join(format!("{}.lease", Self::stem(task)))
    }

    /// The file that says who puts the results of the round together.
    pub fn end_lease(&self) -> PathBuf {
        self.path.join("end.lease")
    }

    /// The film after the round.
    pub fn end(&self) -> PathBuf {
        self.path.join("end.state")
    }

    /// The names of all files of the round; none if it has not begun.
    pub fn names(&self) -> BTreeSet<String> {
        self.all_names().collect()
    }

    /// The number of results.
    fn results(&self) -> usize {
        self.all_names().filter(|name| name.ends_with(".result")).count()
    }

    fn all_names(&self) -> impl Iterator<Item = String> {
        let entries = std::fs::read_dir(&self.path).into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.file_name().into_string().ok())
    }
}
