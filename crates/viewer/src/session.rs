//! One scene being looked at: what everybody who watches shares.
//!
//! Pages change the state; the worker (see [`crate::worker`]) sees that its version has changed and renders. Nothing here waits for
//! a picture.

use crate::describe::scene_info;
use crate::explain::{self, Question, Report, Structure, Subject};
use crate::pace::Pace;
use crate::protocol::{Choices, SceneChoice, SceneInfo, ToPage, ToServer, ViewInfo};
use crate::{Opened, Source, Which};
use crate::{cost, thumbnail};
use serde_json::Value;
use snell_formats::image::{Display, Tonemap};
use snell_intersect::accel::AcceleratorKind;
use snell_render::{Aov, CompiledScene, IntegratorKind, Settings};
use snell_scene::builtin::BUILTINS;
use snell_scene::{Camera, LayeredImage, Scene, overrides};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{broadcast, watch};

/// How long nothing must move before the picture is refined.
pub const REST: Duration = Duration::from_millis(150);
/// Largest side of a picture that a page may ask for.
const MAX_SIDE: u32 = 8192;
/// Most samples per pixel.
const MAX_SPP: u32 = 1 << 20;

/// With at most so many triangles, all structures are built without being asked for.
const FEW_TRIANGLES: u64 = 300_000;

/// An encoded picture.
#[derive(Debug)]
pub struct Frame {
    /// Its number.
    pub number: u32,
    /// Header and bytes.
    pub bytes: Vec<u8>,
}

/// Everything that decides what the picture is.
pub struct State {
    opened: Opened,
    /// Changes of the scene that can be taken back, as `-D` takes them.
    edits: Vec<String>,
    /// How many of them count; the rest can be made again.
    applied: usize,
    /// The scene with its edits.
    pub scene: Arc<Scene>,
    hidden: BTreeSet<u32>,
    /// Counts up with the scene.
    pub generation: u32,
    /// Counts up when more has changed than materials, lights and surroundings.
    pub geometry: u32,
    /// Where it is seen from.
    pub camera: Camera,
    /// Number of the last camera message.
    pub seq: u32,
    /// How it is rendered at rest.
    pub settings: Settings,
    /// How values are shown.
    pub display: Display,
    /// Last change that makes another picture.
    pub moved: Instant,
    watching: u32,
    steering: u32,
    is_stopped: bool,
    /// True until a scene is chosen, if none was named.
    is_gallery: bool,
}

/// A copy of what a picture needs.
#[derive(Clone)]
pub struct Snapshot {
    /// Counts up with every change.
    pub version: u64,
    /// Of the scene.
    pub generation: u32,
    /// Of what its surfaces are.
    pub geometry: u32,
    /// The scene.
    pub scene: Arc<Scene>,
    /// The camera.
    pub camera: Camera,
    /// Its number.
    pub seq: u32,
    /// The settings at rest.
    pub settings: Settings,
    /// How values are shown.
    pub display: Display,
    /// When the last change was.
    pub moved: Instant,
}

/// The picture at rest so far, to be saved.
#[derive(Clone)]
pub struct Finished {
    /// The scene.
    pub name: String,
    /// Its layers.
    pub picture: Arc<LayeredImage>,
}

/// A scene being looked at.
pub struct Session {
    source: Box<dyn Source>,
    state: Mutex<State>,
    changed: Condvar,
    version: AtomicU64,
    clients: AtomicU32,
    /// The newest picture.
    pub frames: watch::Sender<Option<Arc<Frame>>>,
    /// Which of them pages have shown.
    pub pace: Pace,
    /// Everything else that all pages are told.
    pub events: broadcast::Sender<ToPage>,
    /// The newest compiled scene.
    pub compiled: Mutex<Option<(u32, Arc<CompiledScene>)>>,
    /// The newest picture at rest.
    pub finished: Mutex<Option<Finished>>,
    /// The scene of a generation in other structures, for explanations.
    structures: Mutex<(u32, Vec<Structure>)>,
    /// Pictures of built-in scenes that were asked for.
    thumbnails: Mutex<BTreeMap<String, Arc<Vec<u8>>>>,
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Session {
    /// Looks at what the source opens first.
    pub fn new(source: Box<dyn Source>, is_gallery: bool) -> Result<Self, String> {
        let opened = source.open(Which::Given)?;
        crate::memory::check(&opened.settings)?;
        let state = State { is_gallery, ..State::new(opened) };
        Ok(Self {
            source,
            state: Mutex::new(state),
            changed: Condvar::new(),
            version: AtomicU64::new(1),
            clients: AtomicU32::new(0),
            frames: watch::Sender::new(None),
            pace: Pace::default(),
            events: broadcast::Sender::new(256),
            compiled: Mutex::new(None),
            finished: Mutex::new(None),
            structures: Mutex::new((0, Vec::new())),
            thumbnails: Mutex::new(BTreeMap::new()),
        })
    }

    /// The version of the state: a picture of another one is out of date.
    pub fn version(&self) -> u64 {
        self.version.load(Ordering::Acquire)
    }

    /// Waits until the state is newer than `seen`, or until `until` if that comes first. `None` if the session ends.
    pub fn wait(&self, seen: u64, until: Option<Instant>) -> Option<Snapshot> {
        let mut state = lock(&self.state);
        loop {
            if state.is_stopped {
                return None;
            }
            let now = Instant::now();
            let is_due = self.version() != seen || until.is_some_and(|u| u <= now);
            if is_due && state.watching > 0 {
                return Some(self.snapshot(&state));
            }
            state = match until.filter(|u| *u > now && state.watching > 0) {
                Some(until) => self.changed.wait_timeout(state, until - now).unwrap_or_else(PoisonError::into_inner).0,
                None => self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    fn snapshot(&self, state: &State) -> Snapshot {
        Snapshot {
            version: self.version(),
            generation: state.generation,
            geometry: state.geometry,
            scene: state.scene.clone(),
            camera: state.camera.clone(),
            seq: state.seq,
            settings: state.settings.clone(),
            display: state.display,
            moved: state.moved,
        }
    }

    /// Ends the worker.
    pub fn stop(&self) {
        lock(&self.state).is_stopped = true;
        self.version.fetch_add(1, Ordering::Release);
        self.changed.notify_all();
    }

    /// Tells all pages.
    pub fn tell(&self, message: ToPage) {
        // Without pages nobody listens, and that is fine.
        let _ = self.events.send(message);
    }

    /// A page has come; gives its number. The first one steers.
    pub fn join(&self) -> (u32, Vec<ToPage>) {
        let client = self.clients.fetch_add(1, Ordering::Relaxed) + 1;
        let mut state = lock(&self.state);
        state.watching += 1;
        if state.watching == 1 {
            state.steering = client;
        }
        // A picture for whom came.
        self.changed.notify_all();
        let messages = vec![
            ToPage::Welcome {
                version: crate::protocol::VERSION,
                client,
                choices: choices(),
                is_gallery: state.is_gallery,
            },
            ToPage::Scene { scene: self.scene_info(&state) },
            ToPage::View { view: self.view_info(&state) },
        ];
        let steering = ToPage::Steering { client: state.steering, watching: state.watching };
        drop(state);
        self.tell(steering.clone());
        (client, [messages, vec![steering]].concat())
    }

    /// A page has gone; if it steered, whoever acts next will.
    pub fn leave(&self, client: u32) {
        let mut state = lock(&self.state);
        state.watching = state.watching.saturating_sub(1);
        if state.steering == client {
            state.steering = 0;
        }
        let message = ToPage::Steering { client: state.steering, watching: state.watching };
        drop(state);
        self.tell(message);
    }

    /// Does what a page asks. What is asked only of one page's own connection (acknowledgements, picks) does not come here. An error
    /// is for that page.
    pub fn handle(&self, client: u32, message: ToServer) -> Result<(), String> {
        let mut state = lock(&self.state);
        if matches!(message, ToServer::Steer) || state.steering == 0 {
            state.steering = client;
            self.tell(ToPage::Steering { client, watching: state.watching });
        }
        if state.steering != client {
            // A page says its size when it opens, whether it steers or not.
            if matches!(message, ToServer::Size { .. } | ToServer::Display { .. }) {
                return Ok(());
            }
            return Err("another page steers; take over first".into());
        }
        let is_camera = matches!(message, ToServer::Camera { .. });
        match message {
            ToServer::Camera { seq, camera } => {
                state.camera = valid_camera(camera)?;
                state.seq = seq;
            }
            ToServer::Size { size } => {
                if size.iter().any(|s| !(1..=MAX_SIDE).contains(s)) {
                    return Err(format!(
                        "a picture of {}x{} pixels; each side is from 1 to {MAX_SIDE}",
                        size[0], size[1]
                    ));
                }
                if state.settings.size == size {
                    return Ok(());
                }
                crate::memory::check(&Settings { size, ..state.settings.clone() })?;
                state.settings.size = size;
            }
            ToServer::Render { integrator, spp, max_depth, aov, accelerator } => {
                state.set_render(integrator, spp, max_depth, aov, accelerator)?;
            }
            ToServer::Display { exposure, tonemap } => {
                if exposure.is_nan() || exposure.abs() > 100.0 {
                    return Err("an exposure is a number of stops from -100 to 100".into());
                }
                state.display.exposure = exposure;
                state.display.tonemap = by_name("tone map", &Tonemap::ALL, Tonemap::name, &tonemap)?;
                // The page shows what it has; nothing is rendered again.
                return Ok(());
            }
            ToServer::Edit { key, value } => {
                let text = match value {
                    Value::String(text) => text,
                    other => other.to_string(),
                };
                state.edit(format!("{key}={text}"))?;
            }
            ToServer::Show { node, visible } => state.edit(format!("node.{node}.visible={visible}"))?,
            ToServer::Undo => {
                let applied = state.applied.saturating_sub(1);
                state.go_to(applied)?;
            }
            ToServer::Redo => {
                let applied = (state.applied + 1).min(state.edits.len());
                state.go_to(applied)?;
            }
            ToServer::Reload => {
                drop(state);
                return self.open(Which::Given);
            }
            ToServer::Steer | ToServer::Ack { .. } | ToServer::Pick { .. } | ToServer::Explain { .. } => return Ok(()),
        }
        self.after_change(state);
        // Where the camera is is told when it rests.
        if !is_camera {
            self.tell_view();
        }
        Ok(())
    }

    /// Opens another scene, or the same again. The camera stays if it is the same.
    pub fn open(&self, which: Which) -> Result<(), String> {
        let keeps_camera = matches!(which, Which::Given);
        self.tell(ToPage::Busy { message: "reading the scene".into() });
        let opened = self.source.open(which);
        self.tell(ToPage::Busy { message: String::new() });
        let opened = opened?;
        let mut state = lock(&self.state);
        let mut new = State::new(opened);
        (new.generation, new.geometry) = (state.generation + 1, state.geometry + 1);
        (new.watching, new.steering, new.seq) = (state.watching, state.steering, state.seq);
        new.settings.size = state.settings.size;
        new.is_stopped = state.is_stopped;
        if keeps_camera {
            new.camera = state.camera.clone();
            new.display = state.display;
            new.settings = Settings { build: new.settings.build.clone(), ..state.settings.clone() };
        }
        *state = new;
        self.after_change(state);
        self.tell_view();
        Ok(())
    }

    fn after_change(&self, mut state: MutexGuard<State>) {
        state.moved = Instant::now();
        self.version.fetch_add(1, Ordering::Release);
        drop(state);
        self.changed.notify_all();
    }

    /// Tells the pages how the scene is rendered.
    pub fn tell_view(&self) {
        let view = self.view_info(&lock(&self.state));
        self.tell(ToPage::View { view });
    }

    /// A scene has been compiled.
    pub fn set_compiled(&self, generation: u32, compiled: &Arc<CompiledScene>) {
        *lock(&self.compiled) = Some((generation, compiled.clone()));
        let scene = self.scene_info(&lock(&self.state));
        self.tell(ToPage::Scene { scene });
    }

    /// A copy of what a picture needs now.
    pub fn now(&self) -> Snapshot {
        self.snapshot(&lock(&self.state))
    }

    /// Why a pixel of the picture at rest looks as it does.
    pub fn explain(&self, question: &Question, all: bool) -> Result<Report, String> {
        let (snapshot, compiled) = self.prepared()?;
        let Snapshot { scene, camera, settings, .. } = &snapshot;
        let structures = if all || compiled.world.stats().triangles <= FEW_TRIANGLES {
            AcceleratorKind::ALL
                .into_iter()
                .map(|k| self.structure(&snapshot, &compiled, k))
                .collect::<Result<_, _>>()?
        } else {
            vec![(settings.build.accelerator, compiled.clone())]
        };
        explain::report(Subject { scene, compiled: &compiled, camera, settings }, question, &structures)
    }

    /// What each pixel costs in a structure, see [`cost::map`].
    pub fn cost(&self, kind: &str, width: u32) -> Result<Vec<u8>, String> {
        let kind = by_name("accelerator", &AcceleratorKind::ALL, AcceleratorKind::name, kind)?;
        let (snapshot, compiled) = self.prepared()?;
        let (_, compiled) = self.structure(&snapshot, &compiled, kind)?;
        let Snapshot { scene, camera, settings, .. } = &snapshot;
        Ok(cost::map(Subject { scene, compiled: &compiled, camera, settings }, width))
    }

    /// A small picture of a built-in scene, as PNG.
    pub fn thumbnail(&self, name: &str) -> Result<Arc<Vec<u8>>, String> {
        // One at a time: they are in nobody's way.
        let mut known = lock(&self.thumbnails);
        if let Some(bytes) = known.get(name) {
            return Ok(bytes.clone());
        }
        let opened = self.source.open(Which::Builtin(name.into()))?;
        let bytes = Arc::new(thumbnail::png(&opened)?);
        known.insert(name.into(), bytes.clone());
        Ok(bytes)
    }

    /// What is looked at now, and compiled.
    fn prepared(&self) -> Result<(Snapshot, Arc<CompiledScene>), String> {
        let snapshot = self.now();
        let compiled = lock(&self.compiled).clone().filter(|(generation, _)| *generation == snapshot.generation);
        compiled.map(|(_, compiled)| (snapshot, compiled)).ok_or_else(|| "the scene is still being prepared".into())
    }

    /// The scene in another structure, built when it is first asked for.
    fn structure(
        &self,
        snapshot: &Snapshot,
        compiled: &Arc<CompiledScene>,
        kind: AcceleratorKind,
    ) -> Result<Structure, String> {
        if kind == snapshot.settings.build.accelerator {
            return Ok((kind, compiled.clone()));
        }
        let mut kept = lock(&self.structures);
        if kept.0 != snapshot.generation {
            *kept = (snapshot.generation, Vec::new());
        }
        if let Some(known) = kept.1.iter().find(|(k, _)| *k == kind) {
            return Ok(known.clone());
        }
        kept.1.extend(explain::structures(&snapshot.scene, &snapshot.settings, &[kind])?);
        kept.1.last().cloned().ok_or_else(|| "there is no such structure".into())
    }

    fn scene_info(&self, state: &State) -> SceneInfo {
        let mut info = scene_info(&state.opened.scene, &state.scene, &state.hidden, state.generation);
        info.history = [state.applied > 0, state.applied < state.edits.len()];
        if let Some((_, compiled)) = &*lock(&self.compiled) {
            info.triangles = compiled.world.instanced_triangle_count();
        }
        info
    }

    fn view_info(&self, state: &State) -> ViewInfo {
        let settings = &state.settings;
        ViewInfo {
            camera: serde_json::to_value(&state.camera).unwrap_or_default(),
            size: settings.size,
            integrator: settings.integrator.name().into(),
            aov: if settings.integrator == IntegratorKind::Aov {
                settings.aovs.first().map_or("", |a| a.name()).into()
            } else {
                String::new()
            },
            spp: settings.spp,
            max_depth: settings.max_depth,
            accelerator: settings.build.accelerator.name().into(),
            exposure: state.display.exposure,
            tonemap: state.display.tonemap.name().into(),
            srgb: state.display.srgb,
            command: state.command(),
        }
    }
}

impl State {
    fn new(opened: Opened) -> Self {
        Self {
            scene: Arc::new(opened.scene.clone()),
            camera: opened.camera.clone(),
            settings: Settings { progressive: true, ..opened.settings.clone() },
            display: opened.display,
            opened,
            edits: Vec::new(),
            applied: 0,
            hidden: BTreeSet::new(),
            generation: 1,
            geometry: 1,
            seq: 0,
            moved: Instant::now(),
            watching: 0,
            steering: 0,
            is_stopped: false,
            is_gallery: false,
        }
    }

    fn edit(&mut self, edit: String) -> Result<(), String> {
        let before = (self.edits.clone(), self.applied);
        self.edits.truncate(self.applied);
        // A slider that is dragged is one change.
        let is_again = self.edits.last().is_some_and(|old| key(old) == key(&edit));
        if is_again && self.moved.elapsed() < Duration::from_secs(1) {
            self.edits.pop();
        }
        self.edits.push(edit);
        let applied = self.edits.len();
        let outcome = self.go_to(applied);
        if outcome.is_err() {
            (self.edits, self.applied) = before;
        }
        outcome
    }

    /// The scene after this many edits.
    fn go_to(&mut self, applied: usize) -> Result<(), String> {
        let mut scene = self.opened.scene.clone();
        for edit in standing(&self.edits[..applied]) {
            overrides::apply(&mut scene, edit).map_err(|e| e.to_string())?;
        }
        let hidden = standing(&self.edits[..applied]).filter_map(|edit| hidden_node(edit)).collect();
        self.geometry += u32::from(hidden != self.hidden);
        self.scene = Arc::new(scene);
        (self.hidden, self.applied) = (hidden, applied);
        self.generation += 1;
        Ok(())
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
            settings.integrator = by_name("integrator", &IntegratorKind::ALL, IntegratorKind::name, &name)?;
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
                    settings.integrator = self.opened.settings.integrator;
                    settings.max_depth = self.opened.settings.max_depth;
                }
            }
            Some(name) => {
                settings.aovs = vec![by_name("layer", &Aov::ALL, Aov::name, name)?];
                settings.integrator = IntegratorKind::Aov;
            }
        }
        if let Some(spp) = spp {
            settings.spp = spp.clamp(1, MAX_SPP);
        }
        if let Some(depth) = max_depth {
            settings.max_depth = depth.min(Settings::MAX_DEPTH);
        }
        if let Some(name) = accelerator {
            settings.build.accelerator = by_name("accelerator", &AcceleratorKind::ALL, AcceleratorKind::name, &name)?;
            self.generation += 1;
            self.geometry += 1;
        }
        Ok(())
    }

    /// What makes the picture at rest from a shell.
    fn command(&self) -> String {
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

/// What an edit changes.
fn key(edit: &str) -> &str {
    edit.split_once('=').map_or(edit, |(key, _)| key)
}

/// The edits that count: of those of one key the last, and nothing is said of nodes that are shown.
fn standing(edits: &[String]) -> impl Iterator<Item = &String> {
    let is_last = move |(i, edit): &(usize, &String)| !edits[i + 1..].iter().any(|later| key(later) == key(edit));
    let says = |edit: &&String| !(edit.starts_with("node.") && edit.ends_with(".visible=true"));
    edits.iter().enumerate().filter(is_last).map(|(_, edit)| edit).filter(says)
}

/// The node that an edit hides.
fn hidden_node(edit: &str) -> Option<u32> {
    edit.strip_prefix("node.")?.strip_suffix(".visible=false")?.parse().ok()
}

/// A word as a shell wants it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_string();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// A camera with which rays can be made, whatever a page sends.
fn valid_camera(value: Value) -> Result<Camera, String> {
    let camera: Camera = serde_json::from_value(value).map_err(|e| format!("camera: {e}"))?;
    let is_finite = camera.eye.is_finite() && camera.towards.is_finite() && camera.up.is_finite();
    let lens_is_finite = camera.aperture_radius.is_finite() && camera.focus_distance.is_finite();
    if !is_finite || !lens_is_finite || camera.focus_distance <= 0.0 || camera.aperture_radius < 0.0 {
        return Err("camera: numbers must be finite, the focus positive and the aperture not negative".into());
    }
    let upright = Camera::from_direction(camera.eye, camera.towards, camera.up, camera.projection);
    // Camera vectors that are as they should be stay as they are, to the bit.
    let is_close = (upright.towards - camera.towards).length() < 1e-9 && (upright.up - camera.up).length() < 1e-9;
    Ok(if is_close { camera } else { Camera { towards: upright.towards, up: upright.up, ..camera } })
}

fn scene_choice(builtin: &snell_scene::builtin::Builtin) -> SceneChoice {
    SceneChoice { name: builtin.name.into(), description: builtin.description.into() }
}

fn by_name<T: Copy>(what: &str, all: &[T], name_of: impl Fn(T) -> &'static str, name: &str) -> Result<T, String> {
    all.iter().copied().find(|&x| name_of(x) == name).ok_or_else(|| format!("there is no {what} \"{name}\""))
}

fn choices() -> Choices {
    fn names<T: Copy>(all: &[T], name_of: impl Fn(T) -> &'static str) -> Vec<String> {
        all.iter().map(|&x| name_of(x).to_string()).collect()
    }
    Choices {
        integrators: names(&IntegratorKind::ALL, IntegratorKind::name),
        aovs: names(&Aov::ALL, Aov::name),
        tonemaps: names(&Tonemap::ALL, Tonemap::name),
        accelerators: names(&AcceleratorKind::ALL, AcceleratorKind::name),
        scenes: BUILTINS.iter().map(scene_choice).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_several_changes_of_one_thing_the_last_counts() {
        let edits = ["a=1", "node.3.visible=false", "b=2", "a=3", "node.3.visible=true", "node.4.visible=false"];
        let edits: Vec<String> = edits.map(String::from).to_vec();
        assert_eq!(standing(&edits).collect::<Vec<_>>(), ["b=2", "a=3", "node.4.visible=false"]);
        assert_eq!(standing(&edits[..3]).filter_map(|edit| hidden_node(edit)).collect::<Vec<_>>(), [3]);
    }
}
