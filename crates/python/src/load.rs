//! Files as scenes: the surfaces of any file that Snell reads.
//!
//! A node with one parent is flattened into the scene: its surfaces become objects with the
//! transform of the node. A node or mesh that is used several times becomes a scene of its own,
//! which is instanced. So does a node that moves, unless it holds a single object.

use crate::animated::Animation;
use crate::contents::{Contents, Kind, Nodes, Object, Slot};
use crate::memory::admit_all;
use crate::mesh::Mesh;
use crate::motion::Motion;
use crate::origins::Origins;
use crate::scene::Scene;
use crate::work::{Threads, run_to_end_on};
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyValueError};
use pyo3::prelude::*;
use snell_formats::{ReadError, ReadOptions, read_scene, read_stage};
use snell_intersect::TriangleMesh;
use snell_math::Transform;
use snell_scene::builtin::builtin;
use snell_scene::{Geometry, MaterialId, NodeId, Scene as Graph, Surface};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Reads the scene of a file: everything that rays can hit, its materials, lights and cameras.
///
/// All formats that `snell formats` lists can be read: OBJ, PLY, STL, glTF and others. Objects are
/// named as in the file.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     A file or, if there is none of that name, a built-in scene: `"cornell-box"` and others
///     listed by `snell scenes`.
/// threads : int, optional
///     Number of threads for the reading. Default: one per core.
/// confine : bool, optional
///     Refuses to open files outside of the folder of `path`. Default: the scene may name files
///     anywhere.
///
/// Examples
/// --------
/// >>> import pathlib, tempfile, snell
/// >>> with tempfile.TemporaryDirectory() as folder:
/// ...     path = pathlib.Path(folder, "triangle.obj")
/// ...     _ = path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
/// ...     scene = snell.load(path)
/// >>> scene.bounds.tolist()
/// [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
#[pyfunction]
#[pyo3(signature = (path, *, threads=None, confine=false))]
pub fn load(py: Python<'_>, path: PathBuf, threads: Option<i64>, confine: bool) -> PyResult<Scene> {
    let built_in = if path.exists() { None } else { path.to_str().and_then(builtin) };
    if built_in.is_none() {
        check_there(&path)?;
    }
    let options = ReadOptions { confine, exact: true, ..ReadOptions::default() };
    folded(py, threads, move || match built_in {
        Some(scene) => Ok(scene),
        None => read_scene(&path, &options),
    })
}

/// Reads a USD stage from the text that `snell.usd.convert` made of it; `name` is the name of the
/// stage.
#[pyfunction]
#[pyo3(name = "_load_stage")]
pub fn load_stage(py: Python<'_>, name: String, text: String) -> PyResult<Scene> {
    let options = ReadOptions { exact: true, ..ReadOptions::default() };
    folded(py, None, move || read_stage(&name, text.into_bytes(), Path::new("."), &options))
}

/// A scene from what a reader reads.
fn folded(
    py: Python<'_>,
    threads: Option<i64>,
    read: impl FnOnce() -> Result<Graph, ReadError> + Send + 'static,
) -> PyResult<Scene> {
    let scene = run_to_end_on(py, Threads::new(threads)?, move || {
        let scene = read().map_err(|e| PyValueError::new_err(e.to_string()))?;
        check_memory(&scene)?;
        fold(scene).map_err(PyValueError::new_err)
    })?;
    scene.map(Scene::of)
}

/// Fails with the error that Python's `open` gives if a file cannot be read.
pub fn check_there(path: &Path) -> PyResult<()> {
    let Err(error) = std::fs::metadata(path) else { return Ok(()) };
    let (number, shown) = (error.raw_os_error(), path.display().to_string());
    if error.kind() == std::io::ErrorKind::NotFound {
        return Err(PyFileNotFoundError::new_err((number, "No such file or directory", shown)));
    }
    Err(PyOSError::new_err((number, error.to_string(), shown)))
}

/// Fails if there is too little memory for the objects of a scene graph: one object for each
/// surface, and at most one for each place of a node. Their list doubles when it grows.
fn check_memory(scene: &Graph) -> PyResult<()> {
    let objects: usize =
        scene.nodes.iter().map(|node| node.surfaces.len() + node.children.len()).sum();
    admit_all(
        "the list of the scene's objects",
        objects,
        3 * size_of::<Slot>() + size_of::<Option<MaterialId>>(),
    )
}

/// Converts a scene graph to the contents of a scene.
pub fn fold(mut scene: Graph) -> Result<Contents, String> {
    let nodes = std::mem::take(&mut scene.nodes);
    let stage = scene.clone();
    scene.nodes = nodes;
    let animation = Animation::of(&scene).filter(|animation| !animation.nodes.is_empty());
    let moving = animation.and_then(|Animation { nodes, rest }| {
        let stage = Arc::new(Graph { motion: rest, ..stage.clone() });
        // Nodes that move may be nested deeper than scenes.
        Folder::fold(&scene, stage, &nodes).ok()
    });
    let (mut contents, origins) = match moving {
        Some(folded) => folded,
        None => Folder::fold(&scene, Arc::new(stage), &HashMap::new())?,
    };
    let Graph { nodes, root, motion, .. } = scene;
    contents.set_nodes(Nodes { nodes, root, motion, origins });
    Ok(contents)
}

/// Flattens nodes into scenes.
struct Folder<'a> {
    scene: &'a Graph,
    parents: Vec<u32>,
    uses: HashMap<*const TriangleMesh, u32>,
    /// The nodes that move.
    moving: &'a HashMap<NodeId, Motion>,
    /// Scenes for nodes with several parents, and for nodes that move.
    nodes: HashMap<NodeId, Arc<Contents>>,
    /// The objects of nodes that move and have one parent, until their place is known.
    apart: HashMap<NodeId, Origins>,
    /// Scenes for meshes with several uses.
    meshes: HashMap<MeshUse, Arc<Contents>>,
    /// The materials, lights and cameras that all scenes share.
    stage: Arc<Graph>,
    origins: Origins,
}

/// A mesh, and the materials of one of its uses.
type MeshUse = (*const TriangleMesh, Vec<Option<MaterialId>>);

/// The material of each slot of a surface.
fn slots(surface: &Surface, inherited: Option<MaterialId>) -> Vec<Option<MaterialId>> {
    let count = match &surface.geometry {
        Geometry::Mesh(mesh) => {
            mesh.material_slots.iter().max().map_or(1, |&slot| usize::from(slot) + 1)
        }
        Geometry::Shape(_) | Geometry::Curves(_) => 1,
    };
    let own = |slot: usize| surface.materials.get(slot).copied().flatten();
    (0..count.max(surface.materials.len())).map(|slot| own(slot).or(inherited)).collect()
}

impl<'a> Folder<'a> {
    fn fold(
        scene: &'a Graph,
        stage: Arc<Graph>,
        moving: &'a HashMap<NodeId, Motion>,
    ) -> Result<(Contents, Origins), String> {
        let order = scene.topological_order().map_err(|e| e.to_string())?;
        let (mut parents, mut uses) = (vec![0; scene.nodes.len()], HashMap::new());
        for id in &order {
            let node = &scene.nodes[id.index()];
            node.children.iter().for_each(|child| parents[child.index()] += 1);
            for surface in &node.surfaces {
                if let Geometry::Mesh(mesh) = &surface.geometry {
                    mesh.validate().map_err(|e| format!("mesh in node {:?}: {e}", node.name))?;
                    *uses.entry(Arc::as_ptr(mesh)).or_insert(0) += 1;
                }
            }
        }
        let mut folder = Self {
            scene,
            parents,
            uses,
            moving,
            nodes: HashMap::new(),
            apart: HashMap::new(),
            meshes: HashMap::new(),
            stage,
            origins: Origins::default(),
        };
        // Children are converted before their parents.
        for id in order.into_iter().filter(|&id| id != scene.root) {
            let (is_shared, moves) = (folder.parents[id.index()] > 1, moving.contains_key(&id));
            if !is_shared && !moves {
                continue;
            }
            let known = std::mem::take(&mut folder.origins);
            let contents = folder.contents(id, Transform::IDENTITY)?;
            folder.nodes.insert(id, Arc::new(contents));
            let own = std::mem::replace(&mut folder.origins, known);
            match is_shared {
                true => folder.origins.extend(own),
                false => drop(folder.apart.insert(id, own)),
            }
        }
        let contents = match Transform::new(scene.nodes[scene.root.index()].transform) {
            Some(placed) => folder.contents(scene.root, placed)?,
            None => folder.empty(),
        };
        Ok((contents, folder.origins))
    }

    fn empty(&self) -> Contents {
        Contents::on(self.stage.clone())
    }

    /// The contents of a node and of everything that only this node refers to.
    fn contents(&mut self, id: NodeId, placed: Transform) -> Result<Contents, String> {
        let mut contents = self.empty();
        // An explicit stack, because files may nest deeper than the thread's stack.
        let mut stack = vec![(id, placed, None)];
        while let Some((id, placed, inherited)) = stack.pop() {
            let node = &self.scene.nodes[id.index()];
            let material = node.material.or(inherited);
            let transform = (!placed.is_identity()).then_some(placed);
            let named = |kind, transform, materials| {
                let name = (!node.name.is_empty()).then(|| node.name.clone());
                Object { materials, ..Object::new(kind, transform, name) }
            };
            let mut add = |object| {
                contents.add(object).map_err(|_| "the file is nested too deep".to_string())
            };
            for (number, surface) in node.surfaces.iter().enumerate() {
                let materials = slots(surface, material);
                let object = match &surface.geometry {
                    Geometry::Shape(shape) => {
                        add(named(Kind::Shape(shape.clone()), transform, materials))?
                    }
                    Geometry::Curves(curves) => {
                        add(named(Kind::Curves(curves.clone()), transform, materials))?
                    }
                    Geometry::Mesh(mesh) if self.uses[&Arc::as_ptr(mesh)] > 1 => {
                        let key = (Arc::as_ptr(mesh), materials.clone());
                        let shared = self.meshes.entry(key).or_insert_with(|| {
                            let mut alone = Contents::on(self.stage.clone());
                            let kind = Kind::Mesh(Arc::new(Mesh::read(mesh, &Transform::IDENTITY)));
                            // Adding a single mesh exceeds no limit.
                            let _ = alone.add(named(kind, None, materials));
                            Arc::new(alone)
                        });
                        self.origins.inner.insert((id, number as u32), 0);
                        add(named(Kind::Instance(shared.clone()), transform, vec![material]))?
                    }
                    Geometry::Mesh(mesh) => add(named(
                        Kind::Mesh(Arc::new(Mesh::read(mesh, &placed))),
                        None,
                        materials,
                    ))?,
                };
                self.origins.first.entry(id).or_insert(object);
            }
            // The children are pushed in reverse, so that the first child is folded first.
            for &child in node.children.iter().rev() {
                if let Some(motion) = self.moving.get(&child) {
                    let (object, is_alone) = self.moving_object(child, motion, &placed, material);
                    let object = add(object)?;
                    let own = self.apart.remove(&child).unwrap_or_default();
                    self.origins.extend(if is_alone { own.renumbered(object) } else { own });
                    if !is_alone {
                        self.origins.steps.insert((id, child), object);
                    }
                    continue;
                }
                let Some(node_from_child) =
                    Transform::new(self.scene.nodes[child.index()].transform)
                else {
                    continue;
                };
                let placed = placed.compose(&node_from_child);
                match self.nodes.get(&child) {
                    Some(shared) => {
                        let object = add(named(
                            Kind::Instance(shared.clone()),
                            Some(placed),
                            vec![material],
                        ))?;
                        self.origins.steps.insert((id, child), object);
                    }
                    None => stack.push((child, placed, material)),
                }
            }
        }
        Ok(contents)
    }

    /// The object for a node that moves below a node that is `placed`, and true if it is the only
    /// object of the node instead of an instance.
    fn moving_object(
        &self,
        id: NodeId,
        motion: &Motion,
        placed: &Transform,
        material: Option<MaterialId>,
    ) -> (Object, bool) {
        let Some(inner) = self.nodes.get(&id) else { unreachable!("children come first") };
        let mut all = inner.objects();
        let alone = match (all.next(), all.next()) {
            (Some((_, object)), None) => Some(object),
            _ => None,
        };
        let rests = |object: &Object| {
            object.motion.is_none() && object.transform.is_none_or(|map| map.is_identity())
        };
        let name = &self.scene.nodes[id.index()].name;
        // Two names need two objects.
        let is_one = |own: &Option<Arc<str>>| own.as_deref().is_none_or(|own| own == name.as_str());
        let alone = alone.filter(|object| rests(object));
        let alone = alone.filter(|object| name.is_empty() || is_one(&object.name));
        // Between keys, only maps that keep angles may be composed with keys.
        let composed = motion.below(placed);
        if let (Some(object), Some(moved), true) = (alone, &composed, self.apart.contains_key(&id))
        {
            let mut object = object.clone();
            if !name.is_empty() {
                object.name = Some(name.as_str().into());
            }
            for slot in &mut object.materials {
                *slot = slot.or(material);
            }
            object.put(moved.clone().into());
            return (object, true);
        }
        let named = |kind, transform| Object {
            materials: vec![material],
            ..Object::new(kind, transform, (!name.is_empty()).then(|| name.clone()))
        };
        let mut object = named(Kind::Instance(inner.clone()), None);
        match composed {
            Some(moved) => object.put(moved.into()),
            None => {
                object.put(motion.clone().into());
                let mut outer = self.empty();
                // Its nesting was checked when the node was folded, but for one more step.
                let _ = outer.add(object);
                object = named(Kind::Instance(Arc::new(outer)), Some(*placed));
            }
        }
        (object, false)
    }
}
