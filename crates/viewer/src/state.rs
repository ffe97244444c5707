//! The state of the view: everything that determines the picture.
//!
//! A message never changes a state: [`State::after`] returns the complete next state, or an error.

use crate::animation::Moment;
use crate::edits::node_that_is;
use crate::history::{History, Restored};
use crate::opening::Others;
use crate::pictures::Pictures;
use crate::protocol::ToServer;
use crate::size::fits;
use crate::subject::{Extents, extents};
use crate::viewpoint::{is_same_projection, keeping_frame};
use crate::{Opened, Which, by_name};
use serde_json::Value;
use snell_formats::image::{Display, Tonemap};
use snell_intersect::{AcceleratorKind, BuildOptions};
use snell_math::DVec3;
use snell_render::{Aov, IntegratorKind, Request, Settings, Wish};
use snell_scene::camera::{Intrinsics, Projection};
use snell_scene::{
    Camera, Environment, Geometry, Node, NodeId, Scene, Surface, overrides, problem_at,
};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

/// Maximum number of samples per pixel.
const MAX_SPP: u32 = 1 << 20;
/// Maximum distance of a camera from the origin, and of its focus: squares of larger numbers
/// overflow single precision.
const FARTHEST: f64 = 1e18;

/// Maximum time of an animation, in seconds.
const LATEST: f64 = 1e6;

/// Everything that determines the picture.
#[derive(Clone)]
pub struct State {
    pub(crate) opened: Arc<Opened>,
    /// What was opened, to be read again; the name of a dropped file, which cannot be.
    pub origin: Result<Which, String>,
    /// The scenes that were changed and then left for another one.
    pub(crate) others: Others,
    /// Changes of the scene and moves of the camera that can be undone.
    pub(crate) history: History,
    /// The moment of the scene's motion that is shown; none for the scene at rest.
    pub moment: Option<Moment>,
    /// The pictures that changes of the scene name.
    pub pictures: Arc<Pictures>,
    /// The scene with its edits.
    pub scene: Arc<Scene>,
    /// The boxes of the scene.
    pub extents: Arc<Extents>,
    /// Numbers of the hidden nodes.
    pub hidden: BTreeSet<u32>,
    /// Increases with each change of the scene.
    pub generation: u32,
    /// Increases when more than materials, lights, surroundings and places changes.
    pub geometry: u32,
    /// Increases when lights, surfaces that shine or surroundings change.
    pub light: u32,
    /// True if the last change was to another time of the same animation.
    pub is_playing: bool,
    /// Increases when nodes are placed or bent otherwise.
    pub placement: u32,
    /// The nodes that are placed or bent otherwise than they were read.
    pub moving: Arc<BTreeSet<NodeId>>,
    /// The camera.
    pub camera: Camera,
    /// The camera of the command without changes of the camera.
    pub(crate) usual: Camera,
    /// Number of the scene's camera from which the view began; it follows the shape of the picture
    /// as that camera does.
    pub(crate) standpoint: usize,
    /// Increases when the camera changes other than by a message with a camera: pages then take it.
    pub camera_changes: u32,
    /// Number of the last camera message.
    pub seq: u32,
    /// The render settings that the user asked for.
    pub(crate) request: Request,
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
    /// The camera was moved by a page.
    Camera,
    /// The camera was put somewhere else: the pages are to take it.
    Jump,
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
    pub(crate) fn with_size(opened: Opened, size: [u32; 2]) -> Result<Self, String> {
        let settings = Settings { size, progressive: true, crop: None, ..opened.settings.clone() };
        fits(&settings)?;
        let mut new = Self {
            scene: Arc::new(opened.scene.clone()),
            extents: Arc::new(extents_of(&opened.scene, &opened)),
            camera: opened.camera.clone(),
            usual: Self::usual_for(&opened, size),
            standpoint: opened.camera_number,
            camera_changes: 1,
            request: opened.request.clone(),
            settings,
            display: opened.display,
            opened: Arc::new(opened),
            origin: Ok(Which::Given),
            others: Others::default(),
            history: History::default(),
            moment: None,
            pictures: Arc::default(),
            moving: Arc::default(),
            placement: 1,
            is_playing: false,
            hidden: BTreeSet::new(),
            generation: 1,
            geometry: 1,
            light: 1,
            seq: 0,
            moved: Instant::now(),
        };
        new.camera = new.seen_from(new.standpoint, &new.usual, size);
        Ok(new)
    }

    /// The camera of the command without changes of the camera, for a picture of this size.
    fn usual_for(opened: &Opened, size: [u32; 2]) -> Camera {
        let made = opened.camera_for_size.as_ref().and_then(|f| f(size));
        made.unwrap_or_else(|| opened.camera.clone())
    }

    /// The view of one of the scene's cameras in a picture of this size, for which `usual` is the
    /// camera of the command: all that the file shows is visible.
    fn seen_from(&self, number: usize, usual: &Camera, size: [u32; 2]) -> Camera {
        let Opened { scene, camera_number, camera_for_size, settings, .. } = &*self.opened;
        let is_first = number == *camera_number;
        if is_first && camera_for_size.is_some() {
            return usual.clone();
        }
        let own = scene.cameras.get(number).filter(|_| !is_first).unwrap_or(usual);
        let [width, height] = own.resolution.filter(|_| !is_first).unwrap_or(settings.size);
        keeping_frame(own, f64::from(width.max(1)) / f64::from(height.max(1)), size)
    }

    /// The picture has another size: a camera that is where it was in the scene, or has its angle
    /// of view, follows the shape of the picture.
    pub(crate) fn resize(&mut self, size: [u32; 2]) {
        let before = self.seen_from(self.standpoint, &self.usual, self.settings.size);
        self.usual = Self::usual_for(&self.opened, size);
        self.settings.size = size;
        if !is_same_projection(&self.camera.projection, &before.projection) {
            return;
        }
        let after = self.seen_from(self.standpoint, &self.usual, size);
        let projection = before.projection;
        let is_there = Camera { projection, ..self.camera.clone() } == before;
        let camera = match is_there {
            true => after,
            false => Camera { projection: after.projection, ..self.camera.clone() },
        };
        if camera != self.camera {
            self.jump(camera);
        }
    }

    /// The state after a message. Messages that concern pages, not the picture, change nothing. The
    /// error is a message for the user.
    pub fn after(&self, message: ToServer) -> Result<(Self, Change), String> {
        let mut next = self.clone();
        next.is_playing = false;
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
            ToServer::Camera { seq, camera, gesture } => {
                let camera = valid_camera(camera)?;
                self.history.moved(gesture, &self.camera, &camera);
                (self.camera, self.seq) = (camera, seq);
                return Ok(Change::Camera);
            }
            ToServer::Home { camera, gesture } => {
                let number = camera.map_or(self.opened.camera_number, |number| number as usize);
                if number >= self.opened.scene.cameras.len() {
                    return Err(format!("there is no camera {number}"));
                }
                let camera = self.seen_from(number, &self.usual, self.settings.size);
                self.history.moved(gesture, &self.camera, &camera);
                self.standpoint = number;
                return Ok(self.jump(camera));
            }
            ToServer::Size { size } if size == self.settings.size => return Ok(Change::Nothing),
            // A size that is refused must not reach a camera.
            ToServer::Size { size } => {
                fits(&Settings { size, ..self.settings.clone() })?;
                self.resize(size);
            }
            ToServer::Render { integrator, spp, max_depth, aov, accelerator } => {
                self.set_render(integrator, spp, max_depth, aov, accelerator)?;
            }
            ToServer::Set { name, value } => self.set(&name, &value)?,
            ToServer::Display { exposure, tonemap } => {
                if exposure.is_nan() || exposure.abs() > 100.0 {
                    return Err("an exposure is a number of stops from -100 to 100".into());
                }
                self.display.tonemap = by_name("tone map", &Tonemap::ALL, Tonemap::name, &tonemap)?;
                if exposure == self.display.exposure {
                    return Ok(Change::Display);
                }
                self.display.exposure = exposure;
                self.request.exposure = Some(exposure);
                // The wanted noise is that of the exposed picture.
                if self.settings.noise.is_none() {
                    return Ok(Change::Display);
                }
                let resolved = self.request.resolve(&self.scene, &self.camera);
                self.settings.noise_floor = resolved.map_err(|e| e.to_string())?.noise_floor;
            }
            ToServer::Edit { key, value } => self.edit(vec![definition(&key, value)], None)?,
            ToServer::Edits { edits, gesture } => {
                if edits.is_empty() {
                    return Ok(Change::Nothing);
                }
                let edits = edits.into_iter().map(|(key, value)| definition(&key, value));
                self.edit(edits.collect(), gesture)?;
            }
            ToServer::Time { clip, time } => self.show_time(clip, time)?,
            ToServer::Show { node, visible } => {
                if node as usize >= self.opened.scene.nodes.len() {
                    return Err(format!("there is no node {node}"));
                }
                self.edit(vec![format!("node.{node}.visible={visible}")], None)?;
            }
            ToServer::Undo => {
                return match self.history.undo() {
                    Some(restored) => self.restore(restored),
                    None => self.undo_opening(),
                };
            }
            ToServer::Redo => {
                return match self.history.redo() {
                    Some(restored) => self.restore(restored),
                    None => self.redo_opening(),
                };
            }
            ToServer::Reload
            | ToServer::Steer
            | ToServer::Ack { .. }
            | ToServer::Pick { .. }
            | ToServer::Select { .. }
            | ToServer::Explain { .. } => return Ok(Change::Nothing),
        }
        Ok(Change::Picture)
    }

    /// Puts the camera somewhere else.
    fn jump(&mut self, camera: Camera) -> Change {
        self.camera = camera;
        self.camera_changes += 1;
        Change::Jump
    }

    fn restore(&mut self, restored: Restored) -> Result<Change, String> {
        match restored {
            Restored::Camera(camera) => Ok(self.jump(*camera)),
            Restored::Scene => {
                self.make_scene()?;
                Ok(Change::Picture)
            }
        }
    }

    /// The scene without its edits.
    pub fn base(&self) -> &Scene {
        &self.opened.scene
    }

    /// Everything that messages can change, for comparison.
    #[cfg(test)]
    pub fn facts(&self) -> String {
        let Self {
            history,
            hidden,
            generation,
            geometry,
            camera,
            camera_changes,
            standpoint,
            seq,
            request,
            settings,
            display,
            moved,
            ..
        } = self;
        let scene = serde_json::to_string(&(&self.scene.materials, &self.scene.lights))
            .expect("plain data");
        let counters = (generation, geometry, camera_changes, seq);
        let view = (camera, standpoint, hidden, moved);
        format!("{history:?} {counters:?} {view:?} {request:?} {settings:?} {display:?} {scene}")
    }

    fn edit(&mut self, step: Vec<String>, gesture: Option<u32>) -> Result<(), String> {
        self.history.edit(step, gesture)?;
        self.others.forget_later();
        self.make_scene()
    }

    /// Shows a moment of the scene's motion.
    fn show_time(&mut self, clip: Option<String>, time: f64) -> Result<(), String> {
        let animate = self.opened.animate.as_ref().ok_or("nothing in this scene moves")?;
        if !(time.is_finite() && time.abs() <= LATEST) {
            return Err(format!("a time is a number of seconds, at most {LATEST}"));
        }
        let known = self.moment.as_ref().filter(|known| known.clip == clip);
        self.is_playing = known.is_some();
        let animated = match known {
            Some(known) => known.animated.clone(),
            None => Arc::new(animate(clip.as_deref())?),
        };
        self.moment = Some(Moment { clip, time, animated });
        self.make_scene()
    }

    /// Makes the scene from the opened one, the changes that stand, and the pose.
    fn make_scene(&mut self) -> Result<(), String> {
        let base = match &self.moment {
            Some(moment) => &moment.animated.scene,
            None => &self.opened.scene,
        };
        let mut scene = base.clone();
        let standing = self.history.standing();
        for edit in &standing {
            let picture = |name: &str| self.pictures.get(name);
            overrides::apply_with(&mut scene, edit, &picture).map_err(|e| in_words(e, edit))?;
        }
        let hidden = standing.iter().filter_map(|edit| node_that_is(edit, "visible=false"));
        let hidden: BTreeSet<u32> = hidden.collect();
        let placed = |(i, node): (usize, &Node)| {
            let before = base.nodes.get(i).is_some_and(|b| b.transform == node.transform);
            (!before).then_some(NodeId(i as u32))
        };
        let mut moving: BTreeSet<NodeId> =
            scene.nodes.iter().enumerate().filter_map(placed).collect();
        if let Some(Moment { animated, time, .. }) = &self.moment {
            scene.apply(&animated.pose(*time));
            moving.extend(animated.moving_nodes());
        }
        let is_same = moving == *self.moving && has_same_geometry(&self.scene, &scene);
        let stays = has_same_places(&self.scene, &scene);
        self.geometry += u32::from(!is_same);
        self.placement += u32::from(!stays);
        self.light += u32::from(!has_same_light(&self.scene, &scene));
        // The subject of an animation is that of its first picture.
        if !self.is_playing && (!is_same || !stays || hidden != self.hidden) {
            self.extents = Arc::new(extents_of(&scene, &self.opened));
        }
        self.hidden = hidden;
        self.moving = Arc::new(moving);
        self.scene = Arc::new(scene);
        self.generation += 1;
        Ok(())
    }

    /// True if texture coordinates of the scene's format grow downwards, as in glTF.
    pub fn is_v_down(&self) -> bool {
        let file = self.opened.command.get(2).map_or("", String::as_str).to_lowercase();
        [".gltf", ".glb", ".vrm"].iter().any(|extension| file.ends_with(extension))
    }

    /// The pictures that were dropped and that the command needs.
    pub fn needed_pictures(&self) -> Vec<String> {
        let named = |edit: &&str| {
            let (key, name) = edit.split_once('=')?;
            let is_place = key == "environment" || key.starts_with("image.");
            (is_place && self.pictures.get(name).is_ok()).then(|| name.to_string())
        };
        self.history.standing().iter().filter_map(named).collect()
    }

    /// True if the scene's motion can be shown.
    pub fn can_move(&self) -> bool {
        self.opened.animate.is_some()
    }

    /// The node that alone is shown, if there is one.
    pub fn isolated(&self) -> Option<u32> {
        self.history.standing().iter().rev().find_map(|edit| node_that_is(edit, "isolated=true"))
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

    /// The conversion of the picture to display values. Layers are shown without the curve of
    /// sRGB, as `snell render` writes them, unless the command asks for one or the other.
    pub fn shown_as(&self) -> Display {
        let is_layer = self.settings.integrator == IntegratorKind::Aov;
        let srgb = self.display.srgb && (!is_layer || self.opened.is_encoding_given);
        Display { srgb, ..self.display }
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
}

/// The integrator that shows light, and its number of bounces, for a scene that was opened with
/// these settings. The integrator `aov` shows no light; `path` stands in for it.
fn light_of(settings: &Settings) -> (IntegratorKind, u32) {
    match settings.integrator {
        IntegratorKind::Aov => (IntegratorKind::Path, IntegratorKind::Path.default_max_depth()),
        other => (other, settings.max_depth),
    }
}

/// The boxes of a scene, for its first view.
fn extents_of(scene: &Scene, opened: &Opened) -> Extents {
    let eye = opened.camera_for_size.is_none().then_some(opened.camera.eye);
    extents(scene, scene.settings.up.unwrap_or(DVec3::Y), eye)
}

/// A change in the form of `-D`.
fn definition(key: &str, value: Value) -> String {
    match value {
        Value::String(text) => format!("{key}={text}"),
        other => format!("{key}={other}"),
    }
}

/// A refused change in words for the page: what was changed, and what is wrong with it.
fn in_words(error: overrides::OverrideError, edit: &str) -> String {
    let name = crate::edits::key(edit).replace(['.', '_'], " ");
    format!("{name}: {}", error.problem)
}

/// True if two scenes have the same nodes with as many surfaces of the same materials, wherever
/// they are, and the same images, so that a compiled scene follows from one to the other.
fn has_same_geometry(a: &Scene, b: &Scene) -> bool {
    let is_alike = |(a, b): (&Node, &Node)| {
        let materials = a.surfaces.iter().map(|s| &s.materials);
        a.children == b.children
            && a.material == b.material
            && a.surfaces.len() == b.surfaces.len()
            && materials.eq(b.surfaces.iter().map(|s| &s.materials))
    };
    a.nodes.len() == b.nodes.len()
        && a.nodes.iter().zip(&b.nodes).all(is_alike)
        && a.textures == b.textures
        && a.images.len() == b.images.len()
        && a.images.iter().zip(&b.images).all(|(a, b)| Arc::ptr_eq(a, b))
}

/// True if the nodes of two scenes are in the same places, with the same meshes.
fn has_same_places(a: &Scene, b: &Scene) -> bool {
    let is_same = |(a, b): (&Surface, &Surface)| match (&a.geometry, &b.geometry) {
        (Geometry::Mesh(a), Geometry::Mesh(b)) => Arc::ptr_eq(a, b),
        (Geometry::Shape(a), Geometry::Shape(b)) => Arc::ptr_eq(a, b),
        (Geometry::Curves(a), Geometry::Curves(b)) => Arc::ptr_eq(a, b),
        _ => false,
    };
    a.nodes
        .iter()
        .zip(&b.nodes)
        .all(|(a, b)| a.transform == b.transform && a.surfaces.iter().zip(&b.surfaces).all(is_same))
}

/// True if two scenes with the same geometry have the same lights, surfaces that shine and
/// surroundings.
fn has_same_light(a: &Scene, b: &Scene) -> bool {
    let is_same_environment = match (&a.environment, &b.environment) {
        (None, None) => true,
        (Some(Environment::Constant(a)), Some(Environment::Constant(b))) => a == b,
        (
            Some(Environment::Image { image: a, scale, world_from_environment: turn }),
            Some(Environment::Image { image: b, scale: other, world_from_environment: turned }),
        ) => Arc::ptr_eq(a, b) && scale == other && turn == turned,
        _ => false,
    };
    let emissions = a.materials.iter().map(|material| &material.emission);
    is_same_environment
        && a.lights == b.lights
        && a.ambient == b.ambient
        && emissions.eq(b.materials.iter().map(|material| &material.emission))
}

/// Parses a camera, and checks that rays can be generated with it.
pub fn valid_camera(value: Value) -> Result<Camera, String> {
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
