//! One scene being viewed: the state shared by all pages.
//!
//! Pages change the state; the worker (see [`crate::worker`]) notices the new version and renders.
//! Nothing here waits for a picture.

use crate::animation::motion_info;
use crate::describe::scene_info;
use crate::dropped::{MAX_BYTES, OTHERS, check_name};
use crate::explain::{self, Question, Report, Structure, Subject};
use crate::pace::Pace;
use crate::protocol::{
    Choices, Mask, Placement, SceneChoice, SceneInfo, ToPage, ToServer, ViewInfo,
};
use crate::state::{Change, State};
use crate::words::for_page;
use crate::{Finished, Source, Which, by_name, cost, selection, swatch};
use snell_formats::image::read_environment;
use snell_formats::image::{Display, Tonemap};
use snell_formats::{Input, ReadOptions, write_scene_as};
use snell_intersect::AcceleratorKind;
use snell_persist::{Checkpoint, image_sha256};
use snell_render::{Aov, CompiledScene, IntegratorKind, Settings};
use snell_scene::builtin::BUILTINS;
use snell_scene::{Camera, NodeId, Scene};
use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Semaphore, broadcast, watch};

/// Time without motion before the picture is refined.
pub const REST: Duration = Duration::from_millis(150);
/// The refusal of a page's request while another page has control.
const ANOTHER_STEERS: &str = "another page steers; take over first";
/// With at most this many triangles, all structures are built without being requested.
const FEW_TRIANGLES: u64 = 300_000;

/// An encoded picture.
#[derive(Debug)]
pub struct Frame {
    /// Number of the frame.
    pub number: u32,
    /// True if something moves: the next one will take its place.
    pub is_moving: bool,
    /// The header and the encoded picture.
    pub bytes: Vec<u8>,
}

/// The state of the view and the pages.
struct Viewing {
    state: State,
    /// The newest state with a picture, and its version.
    shown: Option<(u64, State)>,
    /// Number of connected pages.
    watching: u32,
    /// Number of the page that has control; 0 if none has.
    steering: u32,
    /// The sizes that pages have last asked for.
    sizes: BTreeMap<u32, [u32; 2]>,
    is_stopped: bool,
    /// True until a scene is chosen, if none was named.
    is_gallery: bool,
}

/// A copy of the state that a picture needs.
#[derive(Clone)]
pub struct Snapshot {
    /// Number of the change that made this state.
    pub version: u64,
    /// Generation of the scene.
    pub generation: u32,
    /// Generation of the scene's geometry.
    pub geometry: u32,
    /// Generation of the places of its parts.
    pub placement: u32,
    /// Generation of what shines.
    pub light: u32,
    /// The parts that move.
    pub moving: Arc<BTreeSet<NodeId>>,
    /// The scene.
    pub scene: Arc<Scene>,
    /// The camera.
    pub camera: Camera,
    /// Number of the camera message.
    pub seq: u32,
    /// The settings at rest.
    pub settings: Settings,
    /// The display settings.
    pub display: Display,
    /// Time of the last change.
    pub moved: Instant,
}

/// A scene being viewed.
pub struct Session {
    source: Box<dyn Source>,
    viewing: Mutex<Viewing>,
    /// Held while a scene is read: scenes are read one at a time.
    reading: Mutex<()>,
    /// Held while a pixel is explained or a structure is measured: these run one at a time, because
    /// of their memory.
    pub examining: Arc<Semaphore>,
    changed: Condvar,
    version: AtomicU64,
    clients: AtomicU32,
    /// The newest picture.
    pub frames: watch::Sender<Option<Arc<Frame>>>,
    /// The newest of the pictures that pages have shown.
    pub pace: Pace,
    /// All other messages for all pages.
    pub events: broadcast::Sender<ToPage>,
    /// The newest compiled scene.
    pub compiled: Mutex<Option<(u32, Arc<CompiledScene>)>>,
    /// The newest picture at rest, and the version that it shows.
    pub finished: Mutex<Option<(u64, Arc<Finished>)>>,
    /// The scene of one generation, compiled with other acceleration structures for explanations.
    structures: Mutex<(u32, Vec<Structure>)>,
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Session {
    /// Opens the first scene of `source`.
    pub fn new(source: Box<dyn Source>, is_gallery: bool) -> Result<Self, String> {
        let opened = source.open(Which::Given)?;
        let state = State::new(opened)?;
        let viewing = Viewing {
            state,
            shown: None,
            watching: 0,
            steering: 0,
            sizes: BTreeMap::new(),
            is_stopped: false,
            is_gallery,
        };
        Ok(Self {
            source,
            viewing: Mutex::new(viewing),
            reading: Mutex::new(()),
            examining: Arc::new(Semaphore::new(1)),
            changed: Condvar::new(),
            version: AtomicU64::new(1),
            clients: AtomicU32::new(0),
            frames: watch::Sender::new(None),
            pace: Pace::default(),
            events: broadcast::Sender::new(256),
            compiled: Mutex::new(None),
            finished: Mutex::new(None),
            structures: Mutex::new((0, Vec::new())),
        })
    }

    /// The version of the state: a picture of another version is outdated.
    pub fn version(&self) -> u64 {
        self.version.load(Ordering::Acquire)
    }

    /// Waits until a page watches, and the state is newer than `seen` or the time `until` is
    /// reached. `None` if the session ends.
    pub fn wait(&self, seen: u64, until: Option<Instant>) -> Option<Snapshot> {
        let mut viewing = lock(&self.viewing);
        loop {
            if viewing.is_stopped {
                return None;
            }
            let now = Instant::now();
            if self.is_due(&viewing, seen, until, now) {
                return Some(self.snapshot(&viewing.state));
            }
            viewing = match until.filter(|u| *u > now && viewing.watching > 0) {
                Some(until) => {
                    self.changed
                        .wait_timeout(viewing, until - now)
                        .unwrap_or_else(PoisonError::into_inner)
                        .0
                }
                None => self.changed.wait(viewing).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// As [`Self::wait`], but `None` if it would wait.
    pub fn due(&self, seen: u64, until: Option<Instant>) -> Option<Snapshot> {
        let viewing = lock(&self.viewing);
        let is_due = self.is_due(&viewing, seen, until, Instant::now());
        is_due.then(|| self.snapshot(&viewing.state))
    }

    fn is_due(&self, viewing: &Viewing, seen: u64, until: Option<Instant>, now: Instant) -> bool {
        let is_late = until.is_some_and(|until| until <= now);
        (self.version() != seen || is_late) && viewing.watching > 0
    }

    /// The file that keeps the picture at rest of a snapshot; `None` if none is kept, or if the
    /// state has changed since.
    pub fn checkpoint(&self, snapshot: &Snapshot) -> Option<Checkpoint> {
        let (writer, words) = {
            let state = &lock(&self.viewing).state;
            (self.version() == snapshot.version)
                .then(|| (state.opened.writer.clone(), state.command_words()))?
        };
        match writer.checkpoint(&words, &snapshot.settings)? {
            Ok(checkpoint) => Some(checkpoint),
            Err(message) => {
                self.tell(ToPage::Error { message });
                None
            }
        }
    }

    fn snapshot(&self, state: &State) -> Snapshot {
        Snapshot {
            version: self.version(),
            generation: state.generation,
            geometry: state.geometry,
            placement: state.placement,
            light: state.light,
            moving: state.moving.clone(),
            scene: state.scene.clone(),
            camera: state.camera.clone(),
            seq: state.seq,
            settings: state.settings.clone(),
            display: state.shown_as(),
            moved: state.moved,
        }
    }

    /// Ends the session and its worker.
    pub fn stop(&self) {
        lock(&self.viewing).is_stopped = true;
        self.version.fetch_add(1, Ordering::Release);
        self.changed.notify_all();
    }

    /// Sends a message to all pages.
    pub fn tell(&self, message: ToPage) {
        // An error only means that there are no pages.
        let _ = self.events.send(message);
    }

    /// Adds a page; returns its number and its first messages. The first page has control.
    pub fn join(&self) -> (u32, Vec<ToPage>) {
        let client = self.clients.fetch_add(1, Ordering::Relaxed) + 1;
        let mut viewing = lock(&self.viewing);
        viewing.watching += 1;
        if viewing.watching == 1 {
            viewing.steering = client;
        }
        // Wakes the worker, because the page needs a picture.
        self.changed.notify_all();
        let welcome = ToPage::Welcome {
            version: crate::protocol::VERSION,
            client,
            choices: choices(),
            is_gallery: viewing.is_gallery,
        };
        let messages = [vec![welcome], self.all_of(&viewing)].concat();
        drop(viewing);
        self.tell_steering();
        (client, messages)
    }

    /// All messages about the current state, for a page that has missed some messages.
    pub fn all(&self) -> Vec<ToPage> {
        self.all_of(&lock(&self.viewing))
    }

    fn all_of(&self, viewing: &Viewing) -> Vec<ToPage> {
        let Viewing { state, steering, watching, .. } = viewing;
        vec![
            ToPage::Scene { scene: Box::new(self.scene_info(state)) },
            ToPage::View { view: self.view_info(state) },
            ToPage::Steering { client: *steering, watching: *watching },
        ]
    }

    /// Removes a page; if it had control, the next page that acts gets it.
    pub fn leave(&self, client: u32) {
        let mut viewing = lock(&self.viewing);
        viewing.watching = viewing.watching.saturating_sub(1);
        viewing.sizes.remove(&client);
        if viewing.steering == client {
            viewing.steering = 0;
        }
        drop(viewing);
        self.tell_steering();
    }

    fn tell_steering(&self) {
        let Viewing { steering, watching, .. } = *lock(&self.viewing);
        self.tell(ToPage::Steering { client: steering, watching });
    }

    /// Executes a page's request completely, or leaves the state unchanged and returns an error for
    /// that page. Requests that concern only the page's own connection (acknowledgements, picks)
    /// are not handled here.
    pub fn handle(&self, client: u32, message: ToServer) -> Result<(), String> {
        if matches!(message, ToServer::Reload) {
            self.check_steers(client)?;
            let origin = lock(&self.viewing).state.origin.clone();
            return self.open(origin.map_err(|name| {
                format!("{name} was dropped on the page: to read it again, drop it again")
            })?);
        }
        let mut viewing = lock(&self.viewing);
        if let ToServer::Size { size } = message {
            viewing.sizes.insert(client, size);
        }
        let takes_over = viewing.steering != client
            && (viewing.steering == 0 || matches!(message, ToServer::Steer));
        if viewing.steering != client && !takes_over {
            // A page sends its size when it opens, with or without control.
            let is_size = matches!(message, ToServer::Size { .. });
            return if is_size { Ok(()) } else { Err(ANOTHER_STEERS.into()) };
        }
        let (mut state, mut change) = viewing.state.after(message)?;
        // The picture takes the size of the page that takes over. A size that does not fit now is
        // told when the page asks for it again.
        let size = viewing.sizes.get(&client).copied().filter(|_| takes_over);
        if let Some(Ok((sized, Change::Picture))) =
            size.map(|size| state.after(ToServer::Size { size }))
        {
            (state, change) = (sized, Change::Picture);
        }
        viewing.state = state;
        viewing.steering = client;
        let is_playing = viewing.state.is_playing;
        match change {
            Change::Nothing => drop(viewing),
            Change::Display => {
                drop(viewing);
                self.tell_view();
            }
            // The new camera is sent to the pages only when it rests.
            Change::Camera => self.after_change(viewing),
            Change::Picture | Change::Jump => {
                self.after_change(viewing);
                if !is_playing {
                    self.tell_view();
                }
            }
        }
        if takes_over {
            self.tell_steering();
        }
        Ok(())
    }

    /// Fails if another page than this one has control.
    pub fn check_steers(&self, client: u32) -> Result<(), String> {
        let steering = lock(&self.viewing).steering;
        if steering == 0 || steering == client { Ok(()) } else { Err(ANOTHER_STEERS.into()) }
    }

    /// Reads the scene again that was named when the viewer was started, if it is the one shown.
    pub fn reload(&self) -> Result<(), String> {
        let is_shown = matches!(lock(&self.viewing).state.origin, Ok(Which::Given));
        if is_shown { self.open(Which::Given) } else { Ok(()) }
    }

    /// Opens another scene, or reads the one shown again; then the camera stays. Scenes are read
    /// one at a time. Pages are told what else there was to open, and how to get back changes of
    /// the scene before.
    pub fn open(&self, which: Which) -> Result<(), String> {
        let origin = match &which {
            Which::Dropped(files) => {
                Err(files.first().map_or_else(String::new, |f| f.name.clone()))
            }
            other => Ok(other.clone()),
        };
        let _turn = lock(&self.reading);
        self.tell(ToPage::Busy { message: "reading the scene".into() });
        let opened = catch_unwind(AssertUnwindSafe(|| self.source.open(which)));
        self.tell(ToPage::Busy { message: String::new() });
        let opened = opened
            .unwrap_or_else(|_| Err("a fault in the reader; please report the file".into()))?;
        let mut viewing = lock(&self.viewing);
        let is_same = match (&viewing.state.origin, &origin) {
            (Ok(Which::Given), Ok(Which::Given)) => true,
            (Ok(Which::Builtin(a)), Ok(Which::Builtin(b))) => a == b && !viewing.is_gallery,
            _ => false,
        };
        let others =
            opened.scene.warnings.iter().map(|w| &w.message).filter(|m| m.contains(OTHERS));
        let mut notes: Vec<String> = others.cloned().collect();
        if viewing.state.is_changed() {
            let name = &viewing.state.scene.name;
            notes.push(format!("{name} had changes; undo brings them back"));
        }
        viewing.state = viewing.state.reopened(opened, origin, is_same)?;
        viewing.is_gallery = false;
        self.after_change(viewing);
        self.tell_view();
        if !notes.is_empty() {
            self.tell(ToPage::Notice { message: notes.join("; ") });
        }
        Ok(())
    }

    fn after_change(&self, viewing: MutexGuard<Viewing>) {
        self.version.fetch_add(1, Ordering::Release);
        drop(viewing);
        self.changed.notify_all();
    }

    /// Records that a picture of this version was shown.
    pub fn has_shown(&self, version: u64) {
        let mut viewing = lock(&self.viewing);
        if self.version() == version {
            viewing.shown = Some((version, viewing.state.clone()));
        }
    }

    /// Records that a version cannot be rendered: pages get the error, and the previously shown
    /// state is restored.
    pub fn has_failed(&self, version: u64, message: String) {
        self.tell(ToPage::Error { message });
        let mut viewing = lock(&self.viewing);
        if self.version() != version {
            return;
        }
        // A state that was shown and fails later is kept, because there is no better one.
        let Some((_, before)) = viewing.shown.take_if(|(shown, _)| *shown != version) else {
            return;
        };
        viewing.state = viewing.state.taken_back_to(&before);
        self.after_change(viewing);
        self.tell_view();
    }

    /// Sends the state of the view to the pages.
    pub fn tell_view(&self) {
        let view = self.view_info(&lock(&self.viewing).state);
        self.tell(ToPage::View { view });
    }

    /// Stores a newly compiled scene.
    pub fn set_compiled(&self, generation: u32, compiled: &Arc<CompiledScene>) {
        *lock(&self.compiled) = Some((generation, compiled.clone()));
        let viewing = lock(&self.viewing);
        // The page that plays knows what it asks for.
        let scene = (!viewing.state.is_playing).then(|| self.scene_info(&viewing.state));
        drop(viewing);
        if let Some(scene) = scene {
            self.tell(ToPage::Scene { scene: Box::new(scene) });
        }
    }

    /// A copy of the current state for a picture.
    pub fn now(&self) -> Snapshot {
        self.snapshot(&lock(&self.viewing).state)
    }

    /// Explains a pixel of the picture at rest.
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
        explain::report(
            Subject { scene, compiled: &compiled, camera, settings },
            question,
            &structures,
        )
    }

    /// The cost of each pixel in a structure, see [`cost::map`].
    pub fn cost(&self, kind: &str, width: u32) -> Result<Vec<u8>, String> {
        let kind = by_name("accelerator", &AcceleratorKind::ALL, AcceleratorKind::name, kind)?;
        let (snapshot, compiled) = self.prepared()?;
        let (_, compiled) = self.structure(&snapshot, &compiled, kind)?;
        let Snapshot { scene, camera, settings, .. } = &snapshot;
        Ok(cost::map(Subject { scene, compiled: &compiled, camera, settings }, width))
    }

    /// The picture at rest of the current state as a file, and the name of its scene; `None` while
    /// it is still being made. The error is a message for the user.
    pub fn save(&self, format: &str) -> Option<Result<(Vec<u8>, String), String>> {
        let (state, version) = {
            let viewing = lock(&self.viewing);
            (viewing.state.clone(), self.version())
        };
        let (of, finished) = lock(&self.finished).clone()?;
        if of != version {
            return None;
        }
        let (words, display) = (state.command_words(), state.shown_as());
        let bytes = state.opened.writer.write(&finished, &words, display, format);
        Some(bytes.map(|bytes| (bytes, finished.scene.name.clone())))
    }

    /// The SHA-256 of the picture at rest, as `snell render` gives it with `--stats`; `None` while
    /// it is still being made.
    pub fn sha256(&self) -> Result<Option<Vec<u8>>, String> {
        let finished = lock(&self.finished).clone().filter(|(of, _)| *of == self.version());
        let whole = finished.filter(|(_, finished)| finished.is_whole);
        Ok(whole.map(|(_, picture)| image_sha256(&picture.picture()).into_bytes()))
    }

    /// Keeps a picture that was dropped on the page, for edits that name it; returns its name.
    pub fn add_picture(&self, name: &str, bytes: Vec<u8>) -> Result<String, String> {
        check_name(name)?;
        let nowhere = Path::new("");
        let input = Input::from_bytes(name, bytes, nowhere, &ReadOptions::default());
        let image = read_environment(&input).map_err(|e| for_page(&e.to_string()))?;
        let pictures = lock(&self.viewing).state.pictures.clone();
        pictures.add(name, image)
    }

    /// The scene with all changes as a file of a format, and what the format leaves out. Its first
    /// camera is the present one.
    pub fn scene_file(&self, format: &str) -> Result<(Vec<u8>, Vec<String>), String> {
        if !["snell", "glb"].contains(&format) {
            return Err("a scene is saved as snell or glb".into());
        }
        let now = self.now();
        let mut scene = (*now.scene).clone();
        scene.cameras.insert(0, Camera { name: "view".into(), ..now.camera });
        // What moves is saved as it stands: the numbers of cameras have changed.
        scene.motion = None;
        let folder = tempfile::tempdir().map_err(|e| format!("no file can be made: {e}"))?;
        let path = folder.path().join(format!("scene.{format}"));
        let written = write_scene_as(&path, &scene, true).map_err(|e| e.to_string())?;
        let bytes = std::fs::read(&path).map_err(|e| format!("the file cannot be read: {e}"))?;
        Ok((bytes, written.losses.into_iter().map(|loss| loss.message).collect()))
    }

    /// A small picture of a texture, as PNG.
    pub fn swatch(&self, number: u32) -> Result<Vec<u8>, String> {
        let (snapshot, compiled) = self.prepared()?;
        swatch::png(&snapshot.scene, &compiled, number)
    }

    /// Where the thing at a path of nodes stands, which pixels show it, in a mask of this width,
    /// and the material of one of its surfaces.
    pub fn select(
        &self,
        path: &[u32],
        width: u32,
        surface: Option<[u32; 2]>,
    ) -> (Option<Placement>, Option<Mask>, Option<u32>) {
        let now = self.now();
        let place = selection::placement(&now.scene, path);
        let shown = place.as_ref().filter(|_| width > 0).and_then(|place| {
            let (snapshot, compiled) = self.prepared().ok()?;
            let path = path.get(..place.depth as usize)?;
            Some(selection::mask(&snapshot, &compiled, path, width))
        });
        let material = surface.and_then(|surface| selection::material(&now.scene, path, surface));
        (place, shown, material)
    }

    /// The current state and its compiled scene.
    fn prepared(&self) -> Result<(Snapshot, Arc<CompiledScene>), String> {
        let snapshot = self.now();
        let compiled = lock(&self.compiled)
            .clone()
            .filter(|(generation, _)| *generation == snapshot.generation);
        compiled
            .map(|(_, compiled)| (snapshot, compiled))
            .ok_or_else(|| "the scene is still being prepared".into())
    }

    /// The scene compiled with another structure on first request.
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
        let mut info = scene_info(
            state.base(),
            &state.scene,
            &state.extents,
            &state.hidden,
            state.generation,
            state.is_v_down(),
        );
        info.isolated = state.isolated();
        info.motion = motion_info(state.base().motion.as_deref(), state.moment.as_ref());
        info.motion = info.motion.filter(|_| state.can_move());
        info.warnings.extend(state.needed_pictures().into_iter().map(|name| {
            format!(
                "{name} was dropped here: run the command that is copied in a folder where it is, \
                    or save the scene"
            )
        }));
        if let Some((_, compiled)) = &*lock(&self.compiled) {
            info.triangles = compiled.world.instanced_triangle_count();
            info.shapes += compiled.world.stats().primitives;
        }
        info
    }

    fn view_info(&self, state: &State) -> ViewInfo {
        let (settings, display) = (&state.settings, state.shown_as());
        ViewInfo {
            camera: serde_json::to_value(&state.camera).unwrap_or_default(),
            camera_changes: state.camera_changes,
            history: state.can(),
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
            settings: state.set_settings(),
            exposure: display.exposure,
            tonemap: display.tonemap.name().into(),
            srgb: display.srgb,
            command: state.command(),
        }
    }
}

fn scene_choice(builtin: &snell_scene::builtin::Builtin) -> SceneChoice {
    SceneChoice { name: builtin.name.into(), description: builtin.description.into() }
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
        forms: crate::forms::forms(),
        examples: crate::forms::examples(),
        settings: crate::forms::settings(),
        max_upload: MAX_BYTES as u64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Opened;
    use crate::size::fits;
    use serde_json::{Value, json};
    use snell_math::DVec3;
    use snell_scene::camera::Projection;

    struct OneScene;

    impl Source for OneScene {
        fn open(&self, which: Which) -> Result<Opened, String> {
            assert!(
                !matches!(which, Which::Builtin(name) if name == "panic"),
                "a fault in a reader"
            );
            let scene = snell_scene::builtin::builtin("cornell-box").ok_or("it is built in")?;
            let settings = Settings { size: [8, 6], spp: 1, ..Settings::default() };
            Ok(Opened {
                camera: scene.cameras[0].clone(),
                scene,
                camera_number: 0,
                camera_for_size: None,
                is_encoding_given: false,
                writer: Arc::new(crate::PlainWriter),
                request: snell_render::Request::default(),
                settings,
                display: Display::default(),
                animate: None,
                command: Vec::new(),
            })
        }
    }

    fn session() -> (Session, u32) {
        let session = Session::new(Box::new(OneScene), false).expect("the scene is built in");
        let (client, _) = session.join();
        (session, client)
    }

    fn facts(session: &Session) -> String {
        let Viewing { state, steering, watching, .. } = &*lock(&session.viewing);
        format!("{} {steering} {watching} {}", state.facts(), session.version())
    }

    /// Valid messages with all of their fields.
    fn good(session: &Session) -> Vec<Value> {
        let camera = serde_json::to_value(session.now().camera).expect("plain data");
        vec![
            json!({"type": "camera", "seq": 1, "camera": camera, "gesture": 1}),
            json!({"type": "home", "camera": 0, "gesture": 2}),
            json!({"type": "size", "size": [9, 7]}),
            json!({
                "type": "render", "integrator": "whitted", "spp": 2, "max_depth": 3,
                "aov": "normal", "accelerator": "grid"
            }),
            json!({"type": "render", "integrator": "aov", "aov": ""}),
            json!({"type": "set", "name": "sampler", "value": "sobol"}),
            json!({"type": "set", "name": "clamp", "value": 8}),
            json!({"type": "set", "name": "clamp", "value": null}),
            json!({"type": "display", "exposure": 1, "tonemap": "aces"}),
            json!({"type": "edit", "key": "light.0.intensity", "value": [1, 1, 1]}),
            json!({"type": "edit", "key": "ambient", "value": [1, 1, 1]}),
            json!({
                "type": "edits", "gesture": 1,
                "edits": [["node.1.transform", [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0]]]]
            }),
            json!({"type": "edits", "edits": [["background", "studio"], ["environment", "sky"]]}),
            json!({"type": "time", "clip": null, "time": 0.5}),
            json!({"type": "select", "id": 1, "path": [0], "width": 8}),
            json!({"type": "show", "node": 1, "visible": false}),
            json!({"type": "undo"}),
            json!({"type": "redo"}),
            json!({"type": "reload"}),
            json!({"type": "pick", "id": 1, "pixel": [1, 1]}),
            json!({"type": "explain", "id": 1, "pixel": [1, 1], "sample": 0, "all": true}),
            json!({"type": "ack", "frame": 1}),
            json!({"type": "steer"}),
        ]
    }

    /// Copies of a message in which each value in turn is replaced by values that are mostly
    /// invalid.
    fn spoilt(message: &Value) -> Vec<Value> {
        let long = "x".repeat(2000);
        let bad = json!([
            null, -1, 0, 0.5, 1e300, -1e300, 1e-300, 1e19, 4294967295_u32, 4294967296_u64, 65535,
            "", "nope", "NaN", long, true, [], {}, [0, 0, 0], [null, null], [1e300, 1, 1],
            [16384, 16384], {"type": "x"}
        ]);
        let mut places = Vec::new();
        fn walk(value: &Value, place: String, places: &mut Vec<String>) {
            match value {
                Value::Object(fields) => {
                    fields.iter().for_each(|(k, v)| walk(v, format!("{place}/{k}"), places))
                }
                Value::Array(items) => items
                    .iter()
                    .enumerate()
                    .for_each(|(i, v)| walk(v, format!("{place}/{i}"), places)),
                _ => {}
            }
            places.push(place);
        }
        walk(message, String::new(), &mut places);
        let replaced = |place: &String, value: &Value| {
            let mut message = message.clone();
            *message.pointer_mut(place).expect("a place of the message") = value.clone();
            message
        };
        let values = bad.as_array().expect("a list");
        places
            .iter()
            .flat_map(|place| values.iter().map(move |value| replaced(place, value)))
            .collect()
    }

    #[test]
    fn a_message_that_is_refused_leaves_everything_as_it_was() {
        let (session, client) = session();
        let (mut refused, mut done) = (0, 0);
        for message in good(&session) {
            let sent: ToServer = serde_json::from_value(message.clone()).expect("a message");
            let outcome = session.handle(client, sent);
            // The available names may change, but most of these messages must be valid.
            done += u32::from(outcome.is_ok());
            for bad in spoilt(&message) {
                let Ok(sent) = serde_json::from_value::<ToServer>(bad.clone()) else { continue };
                let before = facts(&session);
                if session.handle(client, sent).is_err() {
                    refused += 1;
                    assert_eq!(facts(&session), before, "{bad}");
                }
                let now = session.now();
                assert!(
                    fits(&now.settings).is_ok() && now.camera.eye.as_vec3().is_finite(),
                    "{bad}"
                );
                assert_eq!(
                    now.settings.integrator == IntegratorKind::Aov,
                    !now.settings.aovs.is_empty(),
                    "{bad}"
                );
            }
        }
        assert!(done >= 13 && refused > 200, "{done} {refused}");
    }

    #[test]
    fn a_message_is_applied_whole_or_not_at_all() {
        let (session, client) = session();
        for (message, part) in [
            (json!({"type": "render", "integrator": "whitted", "aov": "nope"}), "aov"),
            (json!({"type": "render", "spp": 7, "accelerator": "nope"}), "accelerator"),
            (json!({"type": "render", "max_depth": 7, "spp": 0}), "spp"),
            (json!({"type": "display", "exposure": 3, "tonemap": "nope"}), "tonemap"),
            (json!({"type": "set", "name": "sampler", "value": "nope"}), "sampler"),
            (json!({"type": "set", "name": "denoise", "value": true}), "no setting of the page"),
            (json!({"type": "size", "size": [0, 100]}), "size"),
        ] {
            let before = facts(&session);
            let sent = serde_json::from_value(message).expect("a message");
            assert!(session.handle(client, sent).is_err() && facts(&session) == before, "{part}");
        }
        // A page requests control when no page has it, and asks for the impossible.
        session.leave(client);
        let before = facts(&session);
        assert!(session.handle(client + 1, ToServer::Size { size: [0, 0] }).is_err());
        assert_eq!(facts(&session), before);
    }

    #[test]
    fn what_cannot_be_rendered_is_taken_back() {
        let (session, client) = session();
        session.has_shown(session.version());
        let before = session.now();
        session.handle(client, ToServer::Size { size: [20, 10] }).expect("a size");
        let failed = session.version();
        session.has_failed(failed, "no memory".into());
        let now = session.now();
        assert!(
            now.settings.size == before.settings.size
                && now.version > failed
                && now.generation > before.generation
        );
        // A failure after the state was shown yields only a message.
        session.has_shown(now.version);
        session.has_failed(now.version, "again".into());
        assert_eq!(session.version(), now.version);
    }

    #[test]
    fn a_fault_in_a_reader_is_an_error() {
        let (session, _) = session();
        let before = facts(&session);
        assert!(session.open(Which::Builtin("panic".into())).is_err_and(|e| e.contains("report")));
        assert_eq!(facts(&session), before);
    }

    #[test]
    fn the_camera_follows_the_shape_of_the_page_and_comes_back() {
        let (session, client) = session();
        let tangents = |session: &Session| match session.now().camera.projection {
            Projection::Perspective { tan_half_fov } => tan_half_fov,
            other => panic!("{other:?}"),
        };
        let changes = |session: &Session| lock(&session.viewing).state.camera_changes;
        let before = changes(&session);
        session.handle(client, ToServer::Size { size: [39, 70] }).expect("a size");
        assert!(matches!(tangents(&session), [Some(_), None]), "{:?}", tangents(&session));
        assert!(changes(&session) > before, "pages are to take it");
        let first = session.now().camera;
        // A camera that was moved keeps its place, and its angle follows.
        let moved = Camera { eye: first.eye + DVec3::X, ..first.clone() };
        let send = |session: &Session, camera: &Camera, gesture| {
            let camera = serde_json::to_value(camera).expect("plain data");
            session.handle(client, ToServer::Camera { seq: 1, camera, gesture }).expect("valid");
        };
        send(&session, &moved, 1);
        session.handle(client, ToServer::Size { size: [90, 40] }).expect("a size");
        assert!(matches!(tangents(&session), [None, Some(_)]));
        assert_eq!(session.now().camera.eye, moved.eye);
        session.handle(client, ToServer::Home { camera: None, gesture: 2 }).expect("home");
        assert_eq!(session.now().camera.eye, first.eye);
        assert!(!session.view_info(&lock(&session.viewing).state).command.contains("camera.0.eye"));
        session.handle(client, ToServer::Undo).expect("a step");
        assert_eq!(session.now().camera.eye, moved.eye);
        assert!(session.handle(client, ToServer::Home { camera: Some(7), gesture: 3 }).is_err());
    }

    #[test]
    fn who_watches_changes_nothing_and_brings_the_size_along() {
        let (session, client) = session();
        let (other, _) = session.join();
        session.handle(other, ToServer::Size { size: [30, 50] }).expect("it is kept for later");
        assert_eq!(session.now().settings.size, [8, 6]);
        let before = facts(&session);
        for message in
            [ToServer::Undo, ToServer::Reload, ToServer::Home { camera: None, gesture: 1 }]
        {
            assert!(session.handle(other, message).is_err_and(|e| e.contains("take over")));
        }
        let shown = ToServer::Display { exposure: 1.0, tonemap: "aces".into() };
        assert!(session.handle(other, shown).is_err());
        assert!(session.check_steers(other).is_err() && session.check_steers(client).is_ok());
        assert_eq!(facts(&session), before);
        session.handle(other, ToServer::Steer).expect("it may take over");
        assert_eq!(session.now().settings.size, [30, 50]);
    }

    #[test]
    fn the_command_has_exposure_and_tone_map() {
        let (session, client) = session();
        let shown = ToServer::Display { exposure: -1.5, tonemap: "aces".into() };
        session.handle(client, shown).expect("valid");
        let words = lock(&session.viewing).state.command_words();
        assert!(words.contains(&"--exposure=-1.5".into()), "{words:?}");
        assert!(words.windows(2).any(|pair| pair == ["--tonemap", "aces"]), "{words:?}");
    }

    #[test]
    fn changes_are_kept_in_bounds() {
        let (session, client) = session();
        let ask = |n: u32| match n % 2 {
            0 => ToServer::Edit { key: "ambient".into(), value: json!([f64::from(n), 1, 1]) },
            _ => ToServer::Show { node: 1, visible: n % 4 == 1 },
        };
        let ends = (0..1200).find(|&n| session.handle(client, ask(n)).is_err());
        assert_eq!(ends, Some(1000));
        let huge =
            ToServer::Edit { key: "ambient".into(), value: Value::String("1".repeat(5 << 20)) };
        assert!(session.handle(client, huge).is_err());
    }
}
