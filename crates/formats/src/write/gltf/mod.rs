//! Writes glTF 2.0: `.glb` in one file, `.gltf` with a buffer and pictures beside it.
//!
//! A shared node is written once per use, because glTF has trees; its meshes are shared.

mod buffer;
mod material;
mod stage;
mod texture;

use super::flat::{note_shape, tubes_of};
use super::{AROUND, Expansion, Output, SceneWriter};
use buffer::Buffer;
use serde_json::{Value, json};
use snell_intersect::{AnyShape, Curves, Shape, TriangleMesh};
use snell_math::DAffine3;
use snell_scene::placed::{MAX_PLACED, placement_count};
use snell_scene::{Geometry, MaterialId, Node, NodeId, Scene, Surface};
use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

/// The writer of glTF files.
pub const WRITER: SceneWriter =
    SceneWriter { name: "gltf", extensions: &["glb", "gltf"], knows: |_| false, write };

/// The growing parts of a document.
struct Document<'a, 'o> {
    scene: &'a Scene,
    output: &'o mut Output,
    buffer: Buffer,
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    extensions: BTreeSet<&'static str>,
    textures: texture::Textures,
    /// The written attributes of meshes, by address.
    attributes: HashMap<*const TriangleMesh, Value>,
    known_meshes: HashMap<Vec<SurfaceKey>, usize>,
    shapes: HashMap<*const AnyShape, Option<Arc<TriangleMesh>>>,
    tubes: HashMap<*const Curves, Option<Arc<TriangleMesh>>>,
    /// Number of the material for surfaces without one.
    default_material: Option<usize>,
}

/// A mesh, its materials by slot, and the inherited material.
type SurfaceKey = (*const TriangleMesh, Vec<Option<MaterialId>>, Option<MaterialId>);

fn write(scene: &Scene, output: &mut Output) -> Result<(), String> {
    // In glTF +y is up.
    let mut upright = scene.clone();
    snell_scene::framing::stand_up(&mut upright);
    let scene = &upright;
    check_expansion(scene, output)?;
    output.lose_settings(scene);
    let is_binary = output.extension == "glb";
    let mut document = Document {
        scene,
        output,
        buffer: Buffer::default(),
        nodes: Vec::new(),
        meshes: Vec::new(),
        materials: Vec::new(),
        extensions: BTreeSet::new(),
        textures: texture::Textures::default(),
        attributes: HashMap::new(),
        known_meshes: HashMap::new(),
        shapes: HashMap::new(),
        tubes: HashMap::new(),
        default_material: None,
    };
    for (i, material) in scene.materials.iter().enumerate() {
        let value = material::value(&mut document, i, material);
        document.materials.push(value);
    }
    let root = document.tree();
    let mut top = vec![root];
    let (cameras, lights) =
        (stage::cameras(&mut document, &mut top), stage::lights(&mut document, &mut top));
    let json = document.json(&top, cameras, lights, is_binary);
    let buffer = std::mem::take(&mut document.buffer.bytes);
    let text = serde_json::to_vec(&json).map_err(|error| error.to_string())?;
    if is_binary {
        output.main = container(text, buffer)?;
    } else {
        output.file(BUFFER_NAME, buffer);
        output.main = text;
    }
    Ok(())
}

/// Memory of a node while the document is written: its JSON, a copy and its text.
const BYTES_OF_NODE: u64 = 3000;

/// Refuses a scene that grows too large as a tree: glTF has trees, so a shared node is repeated for
/// each of its instances.
fn check_expansion(scene: &Scene, output: &Output) -> Result<(), String> {
    let expansion = Expansion {
        count: placement_count(scene)?,
        limit: MAX_PLACED,
        what: "nodes and surfaces",
        bytes_of_each: BYTES_OF_NODE,
        remedy: "write a format with instances of nodes: .snell or .pbrt",
    };
    expansion.check(output)
}

const BUFFER_NAME: &str = "buffer.bin";

/// The binary container: a header, JSON, and the buffer, each padded to four bytes.
fn container(mut json: Vec<u8>, mut buffer: Vec<u8>) -> Result<Vec<u8>, String> {
    json.resize(json.len().next_multiple_of(4), b' ');
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    let length = 12 + 8 + json.len() + if buffer.is_empty() { 0 } else { 8 + buffer.len() };
    let word = |n: usize| {
        u32::try_from(n)
            .map(u32::to_le_bytes)
            .map_err(|_| "more than 4 GiB, the limit of .glb files")
    };
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(word(length)?);
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", buffer)] {
        if !chunk.is_empty() {
            bytes.extend(word(chunk.len())?);
            bytes.extend(kind);
            bytes.extend(chunk);
        }
    }
    Ok(bytes)
}

impl Document<'_, '_> {
    fn json(
        &self,
        top: &[usize],
        cameras: Vec<Value>,
        lights: Vec<Value>,
        is_binary: bool,
    ) -> Value {
        let mut json = json!({
            "asset": {
                "version": "2.0", "generator": concat!("Snell ", env!("CARGO_PKG_VERSION")),
            },
            "scene": 0,
            "scenes": [{ "name": self.scene.name, "nodes": top }],
            "nodes": self.nodes,
        });
        let mut add = |key: &str, list: Vec<Value>| {
            if !list.is_empty() {
                json[key] = list.into();
            }
        };
        add("meshes", self.meshes.clone());
        add("materials", self.materials.clone());
        add("accessors", self.buffer.accessors.clone());
        add("bufferViews", self.buffer.views.clone());
        add("textures", self.textures.textures.clone());
        add("samplers", self.textures.samplers.clone());
        add("images", self.textures.images.clone());
        add("cameras", cameras);
        add("extensionsUsed", self.extensions.iter().map(|&e| e.into()).collect());
        if !self.buffer.bytes.is_empty() {
            let mut buffer = json!({ "byteLength": self.buffer.bytes.len() });
            if !is_binary {
                buffer["uri"] = format!("{}/{BUFFER_NAME}", self.output.folder()).into();
            }
            json["buffers"] = json!([buffer]);
        }
        if !lights.is_empty() {
            json["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
        }
        json
    }

    /// Writes the graph as a tree; returns the index of its root.
    fn tree(&mut self) -> usize {
        let scene = self.scene;
        let mut stack = vec![(scene.root, None, None)];
        let mut root = 0;
        while let Some((id, material, parent)) = stack.pop() {
            let node: &Node = &scene.nodes[NodeId::index(id)];
            let material: Option<MaterialId> = node.material.or(material);
            let number = self.nodes.len();
            let mut value = placed(&node.transform);
            if !node.name.is_empty() {
                value["name"] = node.name.clone().into();
            }
            if let Some(mesh) = self.mesh(&node.surfaces, material, &node.name) {
                value["mesh"] = mesh.into();
            }
            self.nodes.push(value);
            match parent {
                None => root = number,
                Some(parent) => {
                    let parent: &mut Value = &mut self.nodes[parent];
                    match parent.get_mut("children").and_then(Value::as_array_mut) {
                        Some(list) => list.push(number.into()),
                        None => parent["children"] = json!([number]),
                    }
                }
            }
            stack.extend(node.children.iter().rev().map(|&child| (child, material, Some(number))));
        }
        root
    }

    /// The index of the mesh for some surfaces, if anything is visible.
    fn mesh(
        &mut self,
        surfaces: &[Surface],
        inherited: Option<MaterialId>,
        name: &str,
    ) -> Option<usize> {
        let mut key = Vec::new();
        let mut shown = Vec::new();
        for surface in surfaces {
            let mesh = match &surface.geometry {
                Geometry::Mesh(mesh) => mesh.clone(),
                Geometry::Shape(shape) => match self.tessellated(shape) {
                    Some(mesh) => mesh,
                    None => continue,
                },
                Geometry::Curves(curves) => match self.tubes(curves) {
                    Some(mesh) => mesh,
                    None => continue,
                },
            };
            if !mesh.indices.is_empty() {
                key.push((Arc::as_ptr(&mesh), surface.materials.clone(), inherited));
                shown.push((mesh, &surface.materials));
            }
        }
        if key.is_empty() {
            return None;
        }
        if let Some(&known) = self.known_meshes.get(&key) {
            return Some(known);
        }
        let mut primitives = Vec::new();
        for (mesh, materials) in shown {
            let attributes = self.attributes(&mesh);
            for (slot, triangles) in by_slot(&mesh) {
                let material = materials.get(usize::from(slot)).copied().flatten().or(inherited);
                let indices = self.buffer.indices(&triangles);
                let material = self.material_number(material);
                primitives.push(
                    json!({ "attributes": attributes, "indices": indices, "material": material }),
                );
            }
        }
        let mut value = json!({ "primitives": primitives });
        if !name.is_empty() {
            value["name"] = name.into();
        }
        self.meshes.push(value);
        self.known_meshes.insert(key, self.meshes.len() - 1);
        Some(self.meshes.len() - 1)
    }

    fn tessellated(&mut self, shape: &Arc<AnyShape>) -> Option<Arc<TriangleMesh>> {
        note_shape(shape.name(), self.output);
        // The scene keeps the shapes, so addresses stay unique.
        self.shapes
            .entry(Arc::as_ptr(shape))
            .or_insert_with(|| shape.tessellate(AROUND).map(Arc::new))
            .clone()
    }

    /// The triangles of strands, tessellated once.
    fn tubes(&mut self, curves: &Arc<Curves>) -> Option<Arc<TriangleMesh>> {
        let output = &mut *self.output;
        self.tubes
            .entry(Arc::as_ptr(curves))
            .or_insert_with(|| tubes_of(curves, output).map(Arc::new))
            .clone()
    }

    /// The accessors of a mesh's attributes, written once.
    fn attributes(&mut self, mesh: &Arc<TriangleMesh>) -> Value {
        if let Some(known) = self.attributes.get(&Arc::as_ptr(mesh)) {
            return known.clone();
        }
        let mut value = json!({ "POSITION": self.buffer.positions(&mesh.positions) });
        let mut add = |name: &str, numbers: Vec<f32>, kind: &str, width: usize| {
            if !numbers.is_empty() {
                value[name] = self.buffer.vectors(&numbers, kind, width).into();
            }
        };
        // The format requires unit vectors.
        let unit =
            |n: &snell_math::Vec3| n.try_normalize().unwrap_or(snell_math::Vec3::Z).to_array();
        add("NORMAL", mesh.normals.iter().flat_map(unit).collect(), "VEC3", 3);
        add("TANGENT", mesh.tangents.iter().flat_map(|t| t.to_array()).collect(), "VEC4", 4);
        for (set, uvs) in mesh.uvs.iter().enumerate() {
            add(
                &format!("TEXCOORD_{set}"),
                uvs.iter().flat_map(|uv| uv.to_array()).collect(),
                "VEC2",
                2,
            );
        }
        add("COLOR_0", mesh.colors.as_flattened().to_vec(), "VEC4", 4);
        self.attributes.insert(Arc::as_ptr(mesh), value.clone());
        value
    }

    /// Surfaces without a material get the default one of the renderer, because glTF's default
    /// differs.
    fn material_number(&mut self, material: Option<MaterialId>) -> usize {
        if let Some(id) = material {
            return id.index();
        }
        if let Some(number) = self.default_material {
            return number;
        }
        let number = self.materials.len();
        let value = material::value(self, number, &snell_scene::framing::default_material());
        self.materials.push(value);
        self.default_material = Some(number);
        number
    }
}

/// The triangles of each slot, in ascending order of slots.
fn by_slot(mesh: &TriangleMesh) -> Vec<(u16, Vec<u32>)> {
    if mesh.material_slots.is_empty() {
        return vec![(0, mesh.indices.as_flattened().to_vec())];
    }
    let mut slots: std::collections::BTreeMap<u16, Vec<u32>> = Default::default();
    for (triangle, &slot) in mesh.indices.iter().zip(&mesh.material_slots) {
        slots.entry(slot).or_default().extend(triangle);
    }
    slots.into_iter().collect()
}

/// A node with a transform, without content.
fn placed(map: &DAffine3) -> Value {
    if *map == DAffine3::IDENTITY {
        return json!({});
    }
    let column = |v: snell_math::DVec3, w: f64| [v.x, v.y, v.z, w];
    let m = &map.matrix3;
    let columns = [
        column(m.x_axis, 0.0),
        column(m.y_axis, 0.0),
        column(m.z_axis, 0.0),
        column(map.translation, 1.0),
    ];
    json!({ "matrix": columns.as_flattened() })
}
