//! glTF 1.0, converted to glTF 2.0 before it is read: objects refer to each other by number instead
//! of by name, and the values of techniques or of `KHR_materials_common` become the parameters of
//! `KHR_materials_pbrSpecularGlossiness`. Shaders are not run.
//!
//! A reference to what is not there stays the name that it was, and is reported by the reader.

mod material;

use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, PI};

type Object = Map<String, Value>;

/// Tables of a document; in glTF 1.0 they are objects. The first ones are referred to only by those
/// after them.
const TABLES: [&str; 13] = [
    "buffers",
    "bufferViews",
    "accessors",
    "images",
    "samplers",
    "textures",
    "materials",
    "meshes",
    "cameras",
    "skins",
    "nodes",
    "scenes",
    "animations",
];

/// The id of the buffer that is the body of a binary file (`KHR_binary_glTF`).
const BODY: &[&str] = &["binary_glTF", "KHR_binary_glTF"];

/// Extensions that are converted.
const CONVERTED: &[&str] = &["KHR_binary_glTF", "KHR_materials_common"];

/// The extension of a converted skin with the matrix that comes before its inverse bind matrices.
pub(super) const BIND_SHAPE: &str = "SNELL_bind_shape";

/// True if a document is of glTF 1.
pub(super) fn is(document: &Value) -> bool {
    match document.pointer("/asset/version") {
        Some(Value::String(version)) => version.split('.').next() == Some("1"),
        Some(version) => version.as_f64().is_some_and(|version| version.trunc() == 1.0),
        None => false,
    }
}

/// Converts a document of glTF 1 to glTF 2, and returns warnings about what was lost. `body` is the
/// length of a binary file's body.
pub(super) fn convert(document: &mut Value, body: usize) -> Vec<String> {
    let Some(old) = document.as_object().cloned() else { return Vec::new() };
    let mut converter = Converter::new(&old);
    let mut new = Object::new();
    for table in TABLES {
        let ids: Vec<String> = converter.ids(table);
        let mut objects = Vec::with_capacity(ids.len());
        for id in ids {
            let Some(value) = old.get(table).and_then(|table| table.get(&id)) else { continue };
            let Some(object) = value.as_object() else {
                objects.push(value.clone());
                continue;
            };
            let mut object = object.clone();
            object.entry("name").or_insert_with(|| id.as_str().into());
            converter.object(table, &id, &mut object, body);
            objects.push(object.into());
        }
        match table {
            "bufferViews" => {}
            "accessors" => {
                new.insert("bufferViews".into(), std::mem::take(&mut converter.views).into());
            }
            "nodes" => objects.append(&mut converter.more_nodes),
            _ => {}
        }
        if table != "bufferViews" && !objects.is_empty() {
            new.insert(table.into(), objects.into());
        }
    }
    if let Some(scene) = old.get("scene") {
        new.insert("scene".into(), converter.number("scenes", scene));
    }
    let mut asset = old.get("asset").cloned().unwrap_or_default();
    asset["version"] = "2.0".into();
    new.insert("asset".into(), asset);
    let mut extensions =
        old.get("extensions").and_then(Value::as_object).cloned().unwrap_or_default();
    extensions.remove(CONVERTED[1]);
    let lights = converter.lights();
    if !lights.is_empty() {
        extensions.insert("KHR_lights_punctual".into(), json!({ "lights": lights }));
    }
    new.insert("extensions".into(), extensions.into());
    // An extension that is used is necessary, in glTF 1.
    let used = old.get("extensionsUsed").and_then(Value::as_array).cloned().unwrap_or_default();
    let rest = used.into_iter().filter(|name| !CONVERTED.iter().any(|c| name == c));
    new.insert("extensionsRequired".into(), rest.collect());
    *document = new.into();
    converter.warnings
}

/// The ids of the lights of `KHR_materials_common`, in the order of their numbers.
fn common_lights(document: &Object) -> impl Iterator<Item = &String> {
    let extension = document.get("extensions").and_then(|e| e.get(CONVERTED[1]));
    let lights = extension.and_then(|e| e.get("lights")).and_then(Value::as_object);
    lights.into_iter().flat_map(Object::keys)
}

struct Converter<'a> {
    old: &'a Object,
    /// The number of each object, by table and id.
    numbers: BTreeMap<&'static str, BTreeMap<String, usize>>,
    /// The number of each light of `KHR_materials_common`, by id.
    lights: BTreeMap<&'a str, usize>,
    /// The number of the first node with each name of a joint.
    joints: BTreeMap<&'a str, usize>,
    /// The converted views, with one more for each accessor with a stride.
    views: Vec<Value>,
    /// Nodes for the further meshes of nodes with several.
    more_nodes: Vec<Value>,
    warnings: Vec<String>,
    /// The warnings once more.
    said: BTreeSet<String>,
}

impl<'a> Converter<'a> {
    fn new(old: &'a Object) -> Self {
        let mut this = Self {
            old,
            numbers: BTreeMap::new(),
            lights: common_lights(old).map(String::as_str).zip(0..).collect(),
            joints: BTreeMap::new(),
            views: Vec::new(),
            more_nodes: Vec::new(),
            warnings: Vec::new(),
            said: BTreeSet::new(),
        };
        for table in TABLES {
            let objects = old.get(table).and_then(Value::as_object);
            let mut ids: Vec<_> = objects.into_iter().flat_map(Object::keys).cloned().collect();
            // The body of a binary file is buffer 0 in glTF 2.
            ids.sort_by_key(|id| !(table == "buffers" && BODY.contains(&id.as_str())));
            this.numbers.insert(table, ids.into_iter().zip(0..).collect());
        }
        for (id, node) in old.get("nodes").and_then(Value::as_object).into_iter().flatten() {
            if let Some(joint) = node.get("jointName").and_then(Value::as_str) {
                this.joints.entry(joint).or_insert(this.numbers["nodes"][id]);
            }
        }
        this
    }

    /// The ids of a table, in the order of their numbers.
    fn ids(&self, table: &str) -> Vec<String> {
        let mut ids: Vec<_> = self.numbers[table].iter().collect();
        ids.sort_by_key(|(_, number)| **number);
        ids.into_iter().map(|(id, _)| id.clone()).collect()
    }

    /// The number of the object with an id; the id itself if there is none.
    fn number(&self, table: &str, id: &Value) -> Value {
        let number = id.as_str().and_then(|id| self.numbers[table].get(id));
        number.map_or_else(|| id.clone(), |&number| number.into())
    }

    fn warn(&mut self, warning: impl Into<String>) {
        let warning = warning.into();
        if self.said.insert(warning.clone()) {
            self.warnings.push(warning);
        }
    }

    /// Replaces the id in a property by the number of the object in `table`.
    fn refer(&self, object: &mut Object, key: &str, table: &str) {
        if let Some(id) = object.get_mut(key) {
            *id = self.number(table, id);
        }
    }

    /// Replaces the ids in a list.
    fn refer_all(&self, object: &mut Object, key: &str, table: &str) {
        let ids = object.get_mut(key).and_then(Value::as_array_mut);
        ids.into_iter().flatten().for_each(|id| *id = self.number(table, id));
    }

    /// Converts an object of a table.
    fn object(&mut self, table: &str, id: &str, object: &mut Object, body: usize) {
        match table {
            "buffers" if BODY.contains(&id) && body > 0 => {
                object.remove("uri");
                object.insert("byteLength".into(), body.into());
            }
            "bufferViews" => {
                self.refer(object, "buffer", "buffers");
                self.views.push(object.clone().into());
            }
            "accessors" => self.accessor(object),
            "images" => {
                let binary = object.get("extensions").and_then(|e| e.get(CONVERTED[0]));
                if let Some(view) = binary.and_then(|binary| binary.get("bufferView")).cloned() {
                    object.remove("uri");
                    object.insert("bufferView".into(), self.number("bufferViews", &view));
                }
            }
            "textures" => {
                self.refer(object, "sampler", "samplers");
                self.refer(object, "source", "images");
            }
            "materials" => *object = self.material(object),
            "meshes" => self.mesh(object),
            "skins" => self.skin(object),
            "nodes" => self.node(object),
            "scenes" => self.refer_all(object, "nodes", "nodes"),
            "animations" => self.animation(object),
            _ => {}
        }
    }

    /// The stride of an accessor belongs to its view.
    fn accessor(&mut self, accessor: &mut Object) {
        self.refer(accessor, "bufferView", "bufferViews");
        let size = |object: &Object, key: &str| object.get(key).and_then(Value::as_u64);
        let stride = accessor.remove("byteStride").as_ref().and_then(Value::as_u64).unwrap_or(0);
        let view = size(accessor, "bufferView").and_then(|i| self.views.get(i as usize));
        let Some(Value::Object(view)) = view.filter(|_| stride > 0) else { return };
        let (start, offset) = (size(accessor, "byteOffset"), size(view, "byteOffset"));
        let (start, offset) = (start.unwrap_or(0), offset.unwrap_or(0));
        let Some(length) = size(view, "byteLength").and_then(|l| l.checked_sub(start)) else {
            return;
        };
        let buffer = view.get("buffer").filter(|buffer| buffer.is_u64()).cloned();
        let mut view: Object = buffer.map(|buffer| ("buffer".into(), buffer)).into_iter().collect();
        view.insert("byteOffset".into(), offset.saturating_add(start).into());
        view.insert("byteLength".into(), length.into());
        view.insert("byteStride".into(), stride.into());
        accessor.insert("bufferView".into(), self.views.len().into());
        accessor.insert("byteOffset".into(), 0.into());
        self.views.push(view.into());
    }

    fn mesh(&mut self, mesh: &mut Object) {
        let primitives = mesh.get_mut("primitives").and_then(Value::as_array_mut);
        for primitive in primitives.into_iter().flatten().filter_map(Value::as_object_mut) {
            self.refer(primitive, "indices", "accessors");
            self.refer(primitive, "material", "materials");
            let Some(Value::Object(old)) = primitive.get("attributes") else { continue };
            let attribute = |(name, id): (&String, &Value)| {
                let name = match name.as_str() {
                    "TEXCOORD" | "COLOR" => format!("{name}_0"),
                    "JOINT" | "JOINTS" => "JOINTS_0".into(),
                    "WEIGHT" | "WEIGHTS" => "WEIGHTS_0".into(),
                    _ => name.clone(),
                };
                (name, self.number("accessors", id))
            };
            let new: Object = old.iter().map(attribute).collect();
            primitive.insert("attributes".into(), new.into());
        }
    }

    fn skin(&mut self, skin: &mut Object) {
        self.refer(skin, "inverseBindMatrices", "accessors");
        let names = skin.remove("jointNames").unwrap_or_default();
        let joint = |name: &Value| {
            let number = name.as_str().and_then(|name| self.joints.get(name));
            number.map_or_else(|| self.number("nodes", name), |&number| number.into())
        };
        let joints: Vec<Value> = names.as_array().into_iter().flatten().map(joint).collect();
        skin.insert("joints".into(), joints.into());
        if let Some(matrix) = skin.remove("bindShapeMatrix") {
            skin.insert("extensions".into(), json!({ BIND_SHAPE: { "matrix": matrix } }));
        }
    }

    fn node(&mut self, node: &mut Object) {
        self.refer_all(node, "children", "nodes");
        self.refer(node, "camera", "cameras");
        self.refer(node, "skin", "skins");
        let light = node.get("extensions").and_then(|e| e.get(CONVERTED[1]));
        if let Some(light) = light.and_then(|common| common.get("light")).and_then(Value::as_str)
            && let Some(&number) = self.lights.get(light)
        {
            node["extensions"]["KHR_lights_punctual"] = json!({ "light": number });
        }
        let meshes = node.remove("meshes").unwrap_or_default();
        for (i, mesh) in meshes.as_array().into_iter().flatten().enumerate() {
            let mesh = self.number("meshes", mesh);
            if i == 0 {
                node.insert("mesh".into(), mesh);
                continue;
            }
            let mut child = json!({ "mesh": mesh });
            if let Some(skin) = node.get("skin") {
                child["skin"] = skin.clone();
            }
            let number = self.numbers["nodes"].len() + self.more_nodes.len();
            self.more_nodes.push(child);
            let children = node.entry("children").or_insert_with(|| json!([]));
            children.as_array_mut().into_iter().for_each(|list| list.push(number.into()));
        }
    }

    fn animation(&mut self, animation: &mut Object) {
        let parameters = animation.remove("parameters").unwrap_or_default();
        let samplers = animation.remove("samplers").unwrap_or_default();
        let samplers = samplers.as_object().cloned().unwrap_or_default();
        let places: BTreeMap<&str, usize> = samplers.keys().map(String::as_str).zip(0..).collect();
        let place = |id: &Value| id.as_str().and_then(|id| places.get(id)).copied();
        for channel in
            animation.get_mut("channels").and_then(Value::as_array_mut).into_iter().flatten()
        {
            if let Some(number) = channel.get("sampler").and_then(place) {
                channel["sampler"] = number.into();
            }
            if let Some(target) = channel.get_mut("target").and_then(Value::as_object_mut)
                && let Some(id) = target.remove("id")
            {
                target.insert("node".into(), self.number("nodes", &id));
            }
        }
        let converted = samplers.values().cloned().map(|mut sampler| {
            for key in ["input", "output"] {
                if let Some(value) = sampler.get_mut(key) {
                    let parameter = value.as_str().and_then(|name| parameters.get(name));
                    *value = self.number("accessors", parameter.unwrap_or(value));
                }
            }
            sampler
        });
        animation.insert("samplers".into(), converted.collect());
    }

    /// The lights of `KHR_materials_common`. A white surface under a directional one shows its
    /// colour.
    fn lights(&mut self) -> Vec<Value> {
        let mut lights = Vec::new();
        for id in common_lights(self.old) {
            let light = &self.old["extensions"][CONVERTED[1]]["lights"][id];
            let kind = light.get("type").and_then(Value::as_str).unwrap_or("point");
            let values = light.get(kind).cloned().unwrap_or_default();
            let color = values.get("color").cloned().unwrap_or(json!([1, 1, 1]));
            let color: Value = color.as_array().into_iter().flatten().take(3).cloned().collect();
            let mut new = json!({ "name": id, "type": kind, "color": color, "intensity": PI });
            match kind {
                "ambient" | "directional" => {}
                _ => self.warn(format!(
                    "the light \"{id}\" of glTF 1.0 falls off with the square of the distance, \
                        whatever its attenuation is"
                )),
            }
            if kind == "spot" {
                let angle = values.get("falloffAngle").and_then(Value::as_f64).unwrap_or(PI);
                new["spot"] = json!({ "outerConeAngle": (angle / 2.0).clamp(0.0, FRAC_PI_2) });
            }
            lights.push(new);
        }
        lights
    }
}
