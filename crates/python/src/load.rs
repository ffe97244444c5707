//! Files as scenes: the surfaces of any file that Snell reads.
//!
//! A node with one parent is folded into the scene, its surfaces with the map from their node; a node or mesh that is used several times
//! is a scene of its own, instanced.

use crate::contents::{Contents, Kind, Mesh, Object, Positions};
use crate::scene::Scene;
use crate::work::run_to_end;
use pyo3::exceptions::{PyFileNotFoundError, PyOSError, PyValueError};
use pyo3::prelude::*;
use snell_formats::{ReadOptions, read_scene};
use snell_intersect::TriangleMesh;
use snell_math::Transform;
use snell_scene::{Geometry, NodeId};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// The scene of a file: everything that rays can meet, and the cameras.
///
/// Reads what `snell formats` lists: OBJ, PLY, STL, glTF and others. Objects are named as in the file. Materials and lights are not kept.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
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
pub fn load(py: Python<'_>, path: PathBuf) -> PyResult<Scene> {
    // The same error as of `open`.
    match std::fs::metadata(&path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Err(PyFileNotFoundError::new_err((e.raw_os_error(), "No such file or directory", path)));
        }
        Err(e) => return Err(PyOSError::new_err((e.raw_os_error(), e.to_string(), path))),
        Ok(_) => {}
    }
    let scene = run_to_end(py, move || {
        let scene = read_scene(&path, &ReadOptions::default()).map_err(|e| e.to_string())?;
        Folder::fold(&scene)
    })?;
    scene.map(Scene::of).map_err(PyValueError::new_err)
}

/// Folds nodes into scenes.
struct Folder<'a> {
    scene: &'a snell_scene::Scene,
    parents: Vec<u32>,
    uses: HashMap<*const TriangleMesh, u32>,
    /// Nodes with several parents.
    nodes: HashMap<NodeId, Arc<Contents>>,
    /// Meshes with several uses.
    meshes: HashMap<*const TriangleMesh, Arc<Contents>>,
}

impl<'a> Folder<'a> {
    fn fold(scene: &'a snell_scene::Scene) -> Result<Contents, String> {
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
        let mut folder = Self { scene, parents, uses, nodes: HashMap::new(), meshes: HashMap::new() };
        // Children come before parents.
        for id in order.into_iter().filter(|&id| id != scene.root) {
            if folder.parents[id.index()] > 1 {
                let contents = folder.contents(id, Transform::IDENTITY)?;
                folder.nodes.insert(id, Arc::new(contents));
            }
        }
        let mut contents = match Transform::new(scene.nodes[scene.root.index()].transform) {
            Some(placed) => folder.contents(scene.root, placed)?,
            None => Contents::default(),
        };
        contents.cameras.clone_from(&scene.cameras);
        Ok(contents)
    }

    /// A node and all that only it holds.
    fn contents(&mut self, id: NodeId, placed: Transform) -> Result<Contents, String> {
        let mut contents = Contents::default();
        // An explicit stack, because files may nest deeper than the thread's stack.
        let mut stack = vec![(id, placed)];
        while let Some((id, placed)) = stack.pop() {
            let node = &self.scene.nodes[id.index()];
            let transform = (!placed.is_identity()).then_some(placed);
            let named = |kind, transform| {
                let name = (!node.name.is_empty()).then(|| node.name.clone());
                Object { kind, transform, name, mask: u32::MAX }
            };
            let mut add = |object| contents.add(object).map_err(|_| "the file is nested too deep".to_string());
            for surface in &node.surfaces {
                match &surface.geometry {
                    Geometry::Shape(shape) => add(named(Kind::Shape(shape.clone()), transform))?,
                    Geometry::Mesh(mesh) if self.uses[&Arc::as_ptr(mesh)] > 1 => {
                        let shared = self.meshes.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                            let mut alone = Contents::default();
                            let kind = Kind::Mesh(Arc::new(Mesh::read(TriangleMesh::clone(mesh))));
                            // One mesh is neither too many nor too deep.
                            let _ = alone.add(named(kind, None));
                            Arc::new(alone)
                        });
                        add(named(Kind::Instance(shared.clone()), transform))?
                    }
                    Geometry::Mesh(mesh) => add(named(Kind::Mesh(Arc::new(in_place(mesh, &placed))), None))?,
                };
            }
            // Reversed, so that the first child is folded first.
            for &child in node.children.iter().rev() {
                let Some(node_from_child) = Transform::new(self.scene.nodes[child.index()].transform) else { continue };
                let placed = placed.compose(&node_from_child);
                match self.nodes.get(&child) {
                    Some(shared) => {
                        add(named(Kind::Instance(shared.clone()), Some(placed)))?;
                    }
                    None => stack.push((child, placed)),
                }
            }
        }
        Ok(contents)
    }
}

/// A mesh with its transform applied: in double precision, so that nothing is lost.
fn in_place(mesh: &TriangleMesh, placed: &Transform) -> Mesh {
    if placed.is_identity() {
        return Mesh::read(mesh.clone());
    }
    let positions = mesh.positions.iter().map(|p| placed.point(p.as_dvec3())).collect();
    let mut moved = TriangleMesh { positions: Vec::new(), ..mesh.clone() };
    for n in &mut moved.normals {
        *n = placed.normal(n.as_dvec3()).normalize_or_zero().as_vec3();
    }
    if placed.is_mirrored() {
        moved.indices.iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
    }
    let [uvs, _] = moved.uvs;
    Mesh::new(Positions::Double(positions), moved.indices, moved.normals, uvs)
}
