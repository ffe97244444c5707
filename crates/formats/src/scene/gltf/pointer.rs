//! `KHR_animation_pointer`: animates any property that a JSON pointer names.
//!
//! A number of the file may become anything in the scene: an angle of view becomes a tangent, a
//! strength becomes a factor of a colour. So the object that has it (a material, a light, a camera,
//! the placement of a texture) is read again with the numbers of each key, and each result that
//! changes between keys becomes a track of the scene's motion. Between keys without step
//! interpolation some more times are sampled.

use super::animation::{Placed, curve};
use super::json::Json;
use super::{Reader, camera, light, material, texture};
use crate::ReadError;
use serde_json::Value;
use snell_scene::motion::{Curve, Interpolation, Owner, ParameterTrack};
use std::collections::BTreeMap;

/// A property over time.
#[derive(Clone)]
pub(super) struct Pointer {
    /// Number of the animation.
    pub clip: usize,
    /// JSON pointer of the property.
    pub path: String,
    /// JSON pointer of the channel, for messages.
    channel: String,
    /// The values of the property over time.
    pub curve: Curve,
}

impl Pointer {
    /// The part of the path below `object`; `None` if the property does not belong to that object.
    pub fn below(&self, object: &str) -> Option<&str> {
        self.path.strip_prefix(object)?.strip_prefix('/')
    }
}

/// Maximum length of a pointer: missing objects on its path are created, nested.
const MOST_STEPS: usize = 32;

/// Reads all properties that animations name by pointer. Unreadable ones leave a warning.
pub(super) fn read_all(reader: &mut Reader) -> Result<Vec<Pointer>, ReadError> {
    let mut pointers = Vec::new();
    for (clip, animation) in reader.root.items_of("animations")?.iter().enumerate() {
        for channel in animation.items_of("channels").unwrap_or_default() {
            match read(reader, clip, animation, &channel) {
                Ok(pointer) => pointers.extend(pointer),
                Err(error) => warn(reader, channel.path(), &error.problem),
            }
        }
    }
    Ok(pointers)
}

fn warn(reader: &mut Reader, channel: &str, problem: &str) {
    reader.scene.warn(format!("{channel}: {problem}; this is not animated"));
}

/// The property of a channel; `None` if the channel is of another kind.
fn read(
    reader: &Reader,
    clip: usize,
    animation: &Json,
    channel: &Json,
) -> Result<Option<Pointer>, ReadError> {
    let target = channel.require("target")?;
    if target.get("path")?.is_none_or(|path| path.string() != Ok("pointer")) {
        return Ok(None);
    }
    let Some(extension) = target.extension("KHR_animation_pointer")? else {
        return Err(target
            .error("the path is \"pointer\", but there is no extension KHR_animation_pointer"));
    };
    let path = extension.require("pointer")?.string()?.to_owned();
    if path.split('/').count() > MOST_STEPS {
        return Err(extension.error("the pointer has too many steps"));
    }
    let curve = curve(reader, &animation.entry("samplers", &channel.require("sampler")?)?, None)?;
    Ok(Some(Pointer { clip, path, channel: channel.path().to_owned(), curve }))
}

/// Tracks for pointers to anything but nodes, each with its animation's number.
pub(super) fn tracks(
    reader: &mut Reader,
    placed: &Placed,
) -> Result<Vec<(usize, ParameterTrack)>, ReadError> {
    // Properties of one object in one animation are read together.
    let mut groups: BTreeMap<(usize, String), Vec<Pointer>> = BTreeMap::new();
    for pointer in reader.pointers.clone() {
        match object(&pointer.path) {
            Some(object) => groups.entry((pointer.clip, object)).or_default().push(pointer),
            None => {
                warn(reader, &pointer.channel, &format!("\"{}\" cannot be animated", pointer.path))
            }
        }
    }
    // The objects are read again, which repeats warnings, so the warnings are restored afterwards.
    let (warnings, notes) = (reader.scene.warnings.clone(), reader.scene.notes.clone());
    let (mut tracks, mut failed) = (Vec::new(), Vec::new());
    for ((clip, object), pointers) in groups {
        match tracks_of(reader, placed, &object, &pointers) {
            Ok(found) => tracks.extend(found.into_iter().map(|track| (clip, track))),
            Err(error) => failed.push((pointers[0].channel.clone(), error.problem)),
        }
    }
    (reader.scene.warnings, reader.scene.notes) = (warnings, notes);
    failed.into_iter().for_each(|(channel, problem)| warn(reader, &channel, &problem));
    Ok(tracks)
}

/// The texture transform within a path.
const TEXTURE_TRANSFORM: &str = "/extensions/KHR_texture_transform/";

/// The path of the object that is read again when a property changes; `None` if there is none.
fn object(path: &str) -> Option<String> {
    if let Some((info, _)) =
        path.split_once(TEXTURE_TRANSFORM).filter(|_| path.starts_with("/materials/"))
    {
        return Some(info.to_owned());
    }
    let steps = match path.split('/').nth(1)? {
        "materials" | "cameras" => 3,
        "extensions" if path.starts_with("/extensions/KHR_lights_punctual/lights/") => 5,
        _ => return None,
    };
    let object: Vec<&str> = path.split('/').take(steps).collect();
    (path.split('/').count() > steps).then(|| object.join("/"))
}

fn tracks_of(
    reader: &mut Reader,
    placed: &Placed,
    object: &str,
    pointers: &[Pointer],
) -> Result<Vec<ParameterTrack>, ReadError> {
    let root = reader.root.clone();
    let json = root.at(object)?;
    let number = object.rsplit('/').next().and_then(|n| n.parse().ok());
    if pointers[0].path.contains(TEXTURE_TRANSFORM) {
        let Some(&id) = reader.moving_textures.get(object) else { return Ok(Vec::new()) };
        let baked = Baked::new(object, &json, pointers, |json| {
            let (_, map) = texture::placement(json)?;
            Ok(Value::from(map.as_flattened()))
        })?;
        return Ok(baked.tracks(Owner::Texture(id.index()), |_| "uv_transform".into()));
    }
    let Some(number): Option<usize> = number else {
        return Err(json.error("this cannot be animated"));
    };
    let mut tracks = Vec::new();
    if object.starts_with("/materials/") {
        let baked =
            Baked::new(object, &json, pointers, |json| Ok(value(&material::read(reader, json)?)))?;
        return Ok(baked.tracks(Owner::Material(number), str::to_owned));
    }
    if object.starts_with("/cameras/") {
        for (shown, _) in placed.cameras.iter().filter(|(_, camera)| *camera == number) {
            let baked =
                Baked::new(object, &json, pointers, |json| Ok(value(&camera::projection(json)?)))?;
            tracks.extend(baked.tracks(Owner::Camera(*shown), |path| format!("projection.{path}")));
        }
        return Ok(tracks);
    }
    for &(shown, _, world) in placed.lights.iter().filter(|(_, light, _)| *light == number) {
        let baked = Baked::new(object, &json, pointers, |json| {
            Ok(light::light(reader, json, &world, placed.light_scale)?
                .map_or(Value::Null, |light| value(&light)))
        })?;
        tracks.extend(baked.tracks(Owner::Light(shown), str::to_owned));
    }
    Ok(tracks)
}

fn value(read: &impl serde::Serialize) -> Value {
    serde_json::to_value(read).unwrap_or(Value::Null)
}

/// An object sampled at many times.
struct Baked {
    times: Vec<f64>,
    interpolation: Interpolation,
    read: Vec<Value>,
}

impl Baked {
    fn new(
        object: &str,
        json: &Json,
        pointers: &[Pointer],
        mut read: impl FnMut(&Json) -> Result<Value, ReadError>,
    ) -> Result<Self, ReadError> {
        let is_stepped = |p: &Pointer| p.curve.interpolation() == Interpolation::Step;
        let interpolation = if pointers.iter().all(is_stepped) {
            Interpolation::Step
        } else {
            Interpolation::Linear
        };
        let times = times(pointers, interpolation);
        let at = |time: f64| {
            let mut patched = json.value().clone();
            for pointer in pointers {
                put(
                    &mut patched,
                    pointer.below(object).unwrap_or_default(),
                    &pointer.curve.at(time),
                );
            }
            read(&json.with_value(&patched))
        };
        let read = times.iter().copied().map(at).collect::<Result<_, _>>()?;
        Ok(Self { times, interpolation, read })
    }

    /// A track for each number, or list of numbers, that changes.
    fn tracks(&self, owner: Owner, path: impl Fn(&str) -> String) -> Vec<ParameterTrack> {
        let mut leaves = Vec::new();
        collect_leaves(&self.read[0], String::new(), &mut leaves);
        let track = |leaf: String| {
            let mut values = Vec::new();
            for read in &self.read {
                values.push(numbers(
                    leaf.split('.').filter(|s| !s.is_empty()).try_fold(read, descend)?,
                )?);
            }
            let width = values[0].len();
            if values.iter().all(|v| *v == values[0]) || values.iter().any(|v| v.len() != width) {
                return None;
            }
            let curve =
                Curve::new(self.times.clone(), values.concat(), width, self.interpolation).ok()?;
            Some(ParameterTrack { owner, path: path(&leaf), curve })
        };
        leaves.into_iter().filter_map(track).collect()
    }
}

/// Maximum number of times at which an object is read.
const MOST_TIMES: usize = 20_000;

/// Times to read at: each key, and some times between keys without step interpolation.
fn times(pointers: &[Pointer], interpolation: Interpolation) -> Vec<f64> {
    /// Number of parts between two keys.
    const PARTS: u32 = 8;
    /// Duration in seconds that stands for a step, if other properties are not stepped.
    const STEP: f64 = 1e-5;
    let keys: usize = pointers.iter().map(|p| p.curve.times().len()).sum();
    let parts = if keys * PARTS as usize > MOST_TIMES { 1 } else { PARTS };
    let mut times = Vec::new();
    for curve in pointers.iter().map(|p| &p.curve) {
        times.extend(curve.times());
        match (curve.interpolation(), interpolation) {
            (Interpolation::Step, Interpolation::Step) => {}
            (Interpolation::Step, _) => {
                times.extend(curve.times().iter().skip(1).map(|time| time - STEP))
            }
            _ => times.extend(curve.times().windows(2).flat_map(|pair| {
                (1..parts).map(|i| pair[0] + (pair[1] - pair[0]) * f64::from(i) / f64::from(parts))
            })),
        }
    }
    times.sort_unstable_by(f64::total_cmp);
    times.dedup_by(|a, b| a <= b);
    let stride = times.len().div_ceil(MOST_TIMES).max(1);
    times.into_iter().step_by(stride).collect()
}

/// Sets numbers at a path, creating missing objects.
fn put(value: &mut Value, path: &str, numbers: &[f64]) {
    let mut place = value;
    for step in path.split('/') {
        let step = step.replace("~1", "/").replace("~0", "~");
        let item = step
            .parse::<usize>()
            .ok()
            .filter(|i| place.as_array().is_some_and(|items| *i < items.len()));
        if let Some(item) = item {
            place = &mut place[item];
            continue;
        }
        if !place.is_object() {
            *place = Value::Object(serde_json::Map::new());
        }
        place = &mut place[step];
    }
    *place = match (&*place, numbers) {
        (Value::Bool(_), [flag, ..]) => Value::Bool(*flag >= 0.5),
        (_, [one]) => Value::from(*one),
        _ => Value::from(numbers),
    };
}

/// The value one step down a path.
fn descend<'a>(value: &'a Value, step: &str) -> Option<&'a Value> {
    if value.is_array() { value.get(step.parse::<usize>().ok()?) } else { value.get(step) }
}

/// The numbers of a leaf value.
fn numbers(value: &Value) -> Option<Vec<f32>> {
    match value {
        Value::Number(number) => Some(vec![number.as_f64()? as f32]),
        Value::Array(items) => items.iter().map(|item| item.as_f64().map(|x| x as f32)).collect(),
        _ => None,
    }
}

/// Collects paths of numbers and of lists of numbers. A parameter's texture index is not included.
fn collect_leaves(value: &Value, path: String, leaves: &mut Vec<String>) {
    if numbers(value).is_some_and(|numbers| !numbers.is_empty()) {
        leaves.push(path);
        return;
    }
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Object(map) => map
            .iter()
            .filter(|(key, _)| *key != "texture")
            .for_each(|(key, value)| collect_leaves(value, below(key), leaves)),
        Value::Array(items) => {
            items
                .iter()
                .enumerate()
                .for_each(|(i, item)| collect_leaves(item, below(&i.to_string()), leaves));
        }
        _ => {}
    }
}
