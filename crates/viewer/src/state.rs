//! The state of the view: everything that determines the picture.
//!
//! A message never changes a state: [`State::after`] returns the complete next state, or an error.

use crate::protocol::ToServer;
use crate::size::fits;
use crate::{Opened, by_name};
use serde_json::Value;
use snell_formats::image::{Display, Tonemap};
use snell_intersect::{AcceleratorKind, BuildOptions};
use snell_render::{Aov, IntegratorKind, Request, Settings, Wish};
use snell_scene::camera::{Intrinsics, Projection};
use snell_scene::{Camera, Scene, overrides, problem_at};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Maximum number of samples per pixel.
const MAX_SPP: u32 = 1 << 20;
/// Maximum number of edits that are kept.
const MAX_EDITS: usize = 1000;
/// Maximum total size in bytes of the edits that are kept.
const MAX_EDIT_BYTES: usize = 4 << 20;
/// Maximum distance of a camera from the origin, and of its focus: squares of larger numbers
/// overflow single precision.
const FARTHEST: f64 = 1e18;

/// Everything that determines the picture.
#[derive(Clone)]
pub struct State {
    opened: Arc<Opened>,
    /// Changes of the scene that can be undone, in the form of `-D`.
    edits: Vec<String>,
    /// Number of edits that are applied; the rest can be redone.
    applied: usize,
    /// The scene with its edits.
    pub scene: Arc<Scene>,
    /// Numbers of the hidden nodes.
    pub hidden: BTreeSet<u32>,
    /// Increases with each change of the scene.
    pub generation: u32,
    /// Increases when more than materials, lights and environment changes.
    pub geometry: u32,
    /// The camera.
    pub camera: Camera,
    /// Number of the last camera message.
    pub seq: u32,
    /// The render settings that the user asked for.
    request: Request,
    /// The render settings at rest.
    pub settings: Settings,
    /// The display settings.
    pub display: Display,
    /// Time of the last change that requires another picture.
    pub moved: Instant,
}

/// The effect of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// No visible change.
    Nothing,
    /// Only the conversion to display values changed.
    Display,
    /// The camera changed.
    Camera,
    /// The scene or its render settings changed.
    Picture,
}

impl State {
    /// The state of a newly opened scene. Fails if its picture is too large.
    pub fn new(opened: Opened) -> Result<Self, String> {
        let size = opened.settings.size;
        Self::with_size(opened, size)
    }

    /// The state of a newly opened scene, with another picture size.
    fn with_size(opened: Opened, size: [u32; 2]) -> Result<Self, String> {
        let settings = Settings { size, progressive: true, crop: None, ..opened.settings.clone() };
        fits(&settings)?;
        Ok(Self {
            scene: Arc::new(opened.scene.clone()),
            camera: opened.camera.clone(),
            request: opened.request.clone(),
            settings,
            display: opened.display,
            opened: Arc::new(opened),
            edits: Vec::new(),
            applied: 0,
            hidden: BTreeSet::new(),
            generation: 1,
            geometry: 1,
            seq: 0,
            moved: Instant::now(),
        })
    }

    /// The state for another scene on the same pages, or for the same scene read again (`is_same`);
    /// then camera and settings stay.
    pub fn reopened(&self, opened: Opened, is_same: bool) -> Result<Self, String> {
        let mut new = Self::with_size(opened, self.settings.size)?;
        (new.generation, new.geometry, new.seq) =
            (self.generation + 1, self.geometry + 1, self.seq);
        if is_same {
            (new.camera, new.display) = (self.camera.clone(), self.display);
            new.settings = Settings { build: new.settings.build.clone(), ..self.settings.clone() };
            new.request = self.request.clone();
        }
        Ok(new)
    }

    /// Returns the earlier state `before`, after this one could not be rendered. The counters of
    /// the result continue from this state's.
    pub fn taken_back_to(&self, before: &Self) -> Self {
        let (generation, geometry) = (self.generation + 1, self.geometry + 1);
        Self { generation, geometry, seq: self.seq, moved: Instant::now(), ..before.clone() }
    }

    /// The state after a message. Messages that concern pages, not the picture, change nothing. The
    /// error is a message for the user.
    pub fn after(&self, message: ToServer) -> Result<(Self, Change), String> {
        let mut next = self.clone();
        let change = next.apply(message)?;
        if change == Change::Picture {
            fits(&next.settings)?;
        }
        if !matches!(change, Change::Nothing | Change::Display) {
            next.moved = Instant::now();
        }
        Ok((next, change))
    }

    /// Applies a message to this state, perhaps partially if it fails: see [`Self::after`].
    fn apply(&mut self, message: ToServer) -> Result<Change, String> {
        match message {
            ToServer::Camera { seq, camera } => {
                self.camera = valid_camera(camera)?;
                self.seq = seq;
                return Ok(Change::Camera);
            }
            ToServer::Size { size } if size == self.settings.size => return Ok(Change::Nothing),
            ToServer::Size { size } => self.settings.size = size,
            ToServer::Render { integrator, spp, max_depth, aov, accelerator } => {
                self.set_render(integrator, spp, max_depth, aov, accelerator)?;
            }
            ToServer::Set { name, value } => self.set(&name, &value)?,
            ToServer::Display { exposure, tonemap } => {
                if exposure.is_nan() || exposure.abs() > 100.0 {
                    return Err("an exposure is a number of stops from -100 to 100".into());
                }
                self.display.exposure = exposure;
                self.display.tonemap = by_name("tone map", &Tonemap::ALL, Tonemap::name, &tonemap)?;
                return Ok(Change::Display);
            }
            ToServer::Edit { key, value } => {
                let text = match value {
                    Value::String(text) => text,
                    other => other.to_string(),
                };
                self.edit(format!("{key}={text}"))?;
            }
            ToServer::Show { node, visible } => {
                if node as usize >= self.opened.scene.nodes.len() {
                    return Err(format!("there is no node {node}"));
                }
                self.edit(format!("node.{node}.visible={visible}"))?;
            }
            ToServer::Undo if self.applied == 0 => return Ok(Change::Nothing),
            ToServer::Undo => self.go_to(self.applied - 1)?,
            ToServer::Redo if self.applied == self.edits.len() => return Ok(Change::Nothing),
            ToServer::Redo => self.go_to(self.applied + 1)?,
            ToServer::Reload
            | ToServer::Steer
            | ToServer::Ack { .. }
            | ToServer::Pick { .. }
            | ToServer::Explain { .. } => return Ok(Change::Nothing),
        }
        Ok(Change::Picture)
    }

    /// Whether there is a change to undo, and one to redo.
    pub fn history(&self) -> [bool; 2] {
        [self.applied > 0, self.applied < self.edits.len()]
    }

    /// The scene without its edits.
    pub fn base(&self) -> &Scene {
        &self.opened.scene
    }

    /// Everything that messages can change, for comparison.
    #[cfg(test)]
    pub fn facts(&self) -> String {
        let Self {
            edits,
            applied,
            hidden,
            generation,
            geometry,
            camera,
            seq,
            request,
            settings,
            display,
            moved,
            ..
        } = self;
        let scene = serde_json::to_string(&(&self.scene.materials, &self.scene.lights))
            .expect("plain data");
        let numbers = (applied, hidden, generation, geometry, seq, moved);
        format!("{edits:?} {numbers:?} {camera:?} {request:?} {settings:?} {display:?} {scene}")
    }

    fn edit(&mut self, edit: String) -> Result<(), String> {
        self.edits.truncate(self.applied);
        // Dragging a slider counts as one change.
        let is_again = self.edits.last().is_some_and(|old| key(old) == key(&edit));
        if is_again && self.moved.elapsed() < Duration::from_secs(1) {
            self.edits.pop();
        }
        self.edits.push(edit);
        let bytes: usize = self.edits.iter().map(String::len).sum();
        if self.edits.len() > MAX_EDITS || bytes > MAX_EDIT_BYTES {
            return Err(format!(
                "more than {MAX_EDITS} changes of the scene, or {} MB of them; undo some, or copy \
                    the \
                 command and begin with it",
                MAX_EDIT_BYTES >> 20
            ));
        }
        self.go_to(self.edits.len())
    }

    /// Changes the scene to the one after this many edits.
    fn go_to(&mut self, applied: usize) -> Result<(), String> {
        let mut scene = self.opened.scene.clone();
        for edit in standing(&self.edits[..applied]) {
            overrides::apply(&mut scene, edit).map_err(|e| e.to_string())?;
        }
        let hidden =
            standing(&self.edits[..applied]).filter_map(|edit| hidden_node(edit)).collect();
        self.geometry += u32::from(hidden != self.hidden);
        self.scene = Arc::new(scene);
        (self.hidden, self.applied) = (hidden, applied);
        self.generation += 1;
        Ok(())
    }

    /// Sets a setting that has no message of its own; null restores the value when the scene was
    /// opened.
    fn set(&mut self, name: &str, value: &Value) -> Result<(), String> {
        let setting = Request::setting(name).filter(|setting| setting.is_live);
        let setting = setting.ok_or_else(|| format!("there is no setting \"{name}\" here"))?;
        let wish = match value {
            Value::Null => setting.get(&self.opened.request).map(Wish::Text),
            Value::Bool(flag) => Some(Wish::Flag(*flag)),
            Value::Number(number) => number
                .as_i64()
                .map_or_else(|| number.as_f64().map(Wish::Number), |n| Some(Wish::Whole(n))),
            Value::String(text) => Some(Wish::Text(text.clone())),
            _ => return Err(format!("{name}: a name or a number is expected")),
        };
        match wish {
            Some(wish) => setting
                .set(&mut self.request, &wish)
                .map_err(|problem| format!("{name}: {}", problem.text()))?,
            None => setting.clear(&mut self.request),
        }
        let resolved = self.request.resolve(&self.scene, &self.camera);
        let resolved = resolved.map_err(|error| error.to_string())?;
        let now = &self.settings;
        let build = BuildOptions { accelerator: now.build.accelerator, ..resolved.build.clone() };
        if build.quality != now.build.quality {
            self.generation += 1;
            self.geometry += 1;
        }
        // The other settings have messages of their own.
        self.settings = Settings {
            size: now.size,
            crop: None,
            spp: now.spp,
            progressive: true,
            integrator: now.integrator,
            max_depth: now.max_depth,
            aovs: now.aovs.clone(),
            build,
            ..resolved
        };
        Ok(())
    }

    /// The settings without messages of their own that are set, in the form of command-line values.
    pub fn set_settings(&self) -> BTreeMap<String, String> {
        let live = Request::SETTINGS.iter().filter(|setting| setting.is_live);
        live.filter_map(|s| Some((s.name.to_string(), s.get(&self.request)?))).collect()
    }

    fn set_render(
        &mut self,
        integrator: Option<String>,
        spp: Option<u32>,
        max_depth: Option<u32>,
        aov: Option<String>,
        accelerator: Option<String>,
    ) -> Result<(), String> {
        let settings = &mut self.settings;
        if let Some(name) = integrator {
            settings.integrator =
                by_name("integrator", &IntegratorKind::ALL, IntegratorKind::name, &name)?;
            settings.aovs.clear();
            settings.max_depth = settings.integrator.default_max_depth();
            if settings.integrator == IntegratorKind::Aov {
                settings.aovs.push(Aov::Normal);
            }
        }
        match aov.as_deref() {
            None => {}
            Some("") => {
                settings.aovs.clear();
                if settings.integrator == IntegratorKind::Aov {
                    (settings.integrator, settings.max_depth) = light_of(&self.opened.settings);
                }
            }
            Some(name) => {
                settings.aovs = vec![by_name("layer", &Aov::ALL, Aov::name, name)?];
                settings.integrator = IntegratorKind::Aov;
            }
        }
        if let Some(spp) = spp {
            if !(1..=MAX_SPP).contains(&spp) {
                return Err(format!("{spp} samples per pixel; choose 1 to {MAX_SPP}"));
            }
            settings.spp = spp;
        }
        if let Some(depth) = max_depth {
            if depth > Settings::DEEPEST {
                return Err(format!("{depth} bounces; choose 0 to {}", Settings::DEEPEST));
            }
            settings.max_depth = depth;
        }
        if let Some(name) = accelerator {
            let kind = by_name("accelerator", &AcceleratorKind::ALL, AcceleratorKind::name, &name)?;
            if kind != settings.build.accelerator {
                settings.build.accelerator = kind;
                self.generation += 1;
                self.geometry += 1;
            }
        }
        Ok(())
    }

    /// The shell command that renders the picture at rest.
    pub fn command(&self) -> String {
        let (settings, camera) = (&self.settings, &self.camera);
        let mut words: Vec<String> = self.opened.command.clone();
        let mut option = |name: &str, value: String| words.extend([name.to_string(), value]);
        option("--size", format!("{}x{}", settings.size[0], settings.size[1]));
        option("--spp", settings.spp.to_string());
        option("-i", settings.integrator.name().into());
        if settings.integrator == IntegratorKind::Aov {
            option("--aov", settings.aovs.first().map_or("normal", |a| a.name()).into());
        } else {
            option("--max-depth", settings.max_depth.to_string());
        }
        if settings.build.accelerator != AcceleratorKind::default() {
            option("--accelerator", settings.build.accelerator.name().into());
        }
        let live = Request::SETTINGS.iter().filter(|setting| setting.is_live);
        for setting in live {
            let before = setting.get(&self.opened.request);
            if let Some(now) = setting.get(&self.request).filter(|now| before.as_ref() != Some(now))
            {
                option(&format!("--{}", setting.option()), now);
            }
        }
        for edit in standing(&self.edits[..self.applied]) {
            option("-D", edit.clone());
        }
        let is_other = self.opened.is_camera_made && settings.size != self.opened.settings.size;
        if is_other || *camera != self.opened.camera {
            let number = self.opened.camera_number;
            let before = serde_json::to_value(&self.opened.camera).unwrap_or_default();
            let now = serde_json::to_value(camera).unwrap_or_default();
            for (key, value) in now.as_object().into_iter().flatten() {
                let is_said = before.get(key) != Some(value) || (is_other && !value.is_null());
                if is_said && key != "name" {
                    option("-D", format!("camera.{number}.{key}={value}"));
                }
            }
        }
        words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" ")
    }
}

/// The integrator that shows light, and its number of bounces, for a scene that was opened with
/// these settings. The integrator `aov` shows no light; `path` stands in for it.
fn light_of(settings: &Settings) -> (IntegratorKind, u32) {
    match settings.integrator {
        IntegratorKind::Aov => (IntegratorKind::Path, IntegratorKind::Path.default_max_depth()),
        other => (other, settings.max_depth),
    }
}

/// The key of an edit, which has the form `key=value`.
fn key(edit: &str) -> &str {
    edit.split_once('=').map_or(edit, |(key, _)| key)
}

/// The effective edits: the last one per key, without those that show nodes.
fn standing(edits: &[String]) -> impl Iterator<Item = &String> {
    let is_last = move |(i, edit): &(usize, &String)| {
        !edits[i + 1..].iter().any(|later| key(later) == key(edit))
    };
    let says = |edit: &&String| !(edit.starts_with("node.") && edit.ends_with(".visible=true"));
    edits.iter().enumerate().filter(is_last).map(|(_, edit)| edit).filter(says)
}

/// The node that an edit hides.
fn hidden_node(edit: &str) -> Option<u32> {
    edit.strip_prefix("node.")?.strip_suffix(".visible=false")?.parse().ok()
}

/// A word quoted for a shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_string();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// Parses a camera, and checks that rays can be generated with it.
fn valid_camera(value: Value) -> Result<Camera, String> {
    let mut camera: Camera = serde_json::from_value(value).map_err(|e| format!("camera: {e}"))?;
    let all = serde_json::to_value(&camera).map_err(|e| format!("camera: {e}"))?;
    if let Some(number) = too_large(&all) {
        return Err(format!("camera: {number:e} is larger than any number that is computed with"));
    }
    if let Some(problem) = problem_at(&camera, &[]) {
        return Err(format!("camera: {problem}"));
    }
    if let Projection::Intrinsics(Intrinsics { focal_length, .. }) = camera.projection
        && focal_length.contains(&0.0)
    {
        return Err("camera: a focal length of 0 shows nothing".into());
    }
    camera.square_up();
    Ok(camera)
}

/// Finds a number whose square overflows single precision.
fn too_large(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64().filter(|x| x.abs() > FARTHEST),
        Value::Array(items) => items.iter().find_map(too_large),
        Value::Object(fields) => fields.values().find_map(too_large),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_several_changes_of_one_thing_the_last_counts() {
        let edits = [
            "a=1",
            "node.3.visible=false",
            "b=2",
            "a=3",
            "node.3.visible=true",
            "node.4.visible=false",
        ];
        let edits: Vec<String> = edits.map(String::from).to_vec();
        assert_eq!(standing(&edits).collect::<Vec<_>>(), ["b=2", "a=3", "node.4.visible=false"]);
        assert_eq!(
            standing(&edits[..3]).filter_map(|edit| hidden_node(edit)).collect::<Vec<_>>(),
            [3]
        );
    }
}
