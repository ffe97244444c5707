//! Pickling of scenes.

use crate::arrays::from_vec;
use crate::contents::{Contents, Kind, Object, Slot};
use crate::objects;
use crate::place::{Place, matrices, matrix, place};
use crate::scene::Scene;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyTuple};
use snell_formats::scene::snell::text;
use snell_formats::{Limits, ReadOptions, read_scene_bytes};
use snell_intersect::{Curves, Spheres};
use snell_math::{DVec4, Vec4};
use snell_scene::{MaterialId, Node, NodeId, Scene as Graph, Warning};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// The function and arguments that restore the scene.
pub fn reduce<'py>(
    py: Python<'py>,
    contents: &Contents,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
    let mut children = HashMap::new();
    let slots = PyList::empty(py);
    for slot in &contents.slots {
        match slot {
            Slot::Gone(_) => slots.append(py.None())?,
            Slot::Here(object) => slots.append(stored(py, object, &mut children)?)?,
        }
    }
    // The stage is a scene file without objects.
    let mut stage = Graph::clone(&contents.stage);
    (stage.nodes, stage.root) = (vec![Node::default()], NodeId(0));
    let warnings: Vec<(String, u64)> =
        stage.warnings.iter().map(|w| (w.message.clone(), w.count)).collect();
    let stage = text(&stage).map_err(PyValueError::new_err)?;
    let restore = py.import("snell._snell")?.getattr("_restore")?;
    Ok((
        restore,
        (slots, PyBytes::new(py, stage.as_bytes()), warnings, contents.compact)
            .into_pyobject(py)?,
    ))
}

/// An object as a dictionary. A scene that is instanced several times is stored once.
fn stored<'py>(
    py: Python<'py>,
    object: &Object,
    children: &mut HashMap<*const Contents, Py<Scene>>,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    match &object.kind {
        Kind::Mesh(mesh) => {
            let shape = [mesh.vertex_count(), 3];
            let vertices = if mesh.is_double() {
                from_vec(
                    py,
                    mesh.double().positions.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>(),
                    &shape,
                )?
            } else {
                from_vec(
                    py,
                    mesh.single().positions.iter().flat_map(|p| p.to_array()).collect::<Vec<_>>(),
                    &shape,
                )?
            };
            all.set_item("vertices", vertices)?;
            let indices = mesh.indices();
            all.set_item(
                "faces",
                from_vec(py, indices.as_flattened().to_vec(), &[indices.len(), 3])?,
            )?;
            let attributes = mesh.attributes();
            let numbers: Vec<_> = attributes.normals.iter().flat_map(|n| n.to_array()).collect();
            all.set_item("normals", from_vec(py, numbers, &[attributes.normals.len(), 3])?)?;
            let numbers: Vec<_> = attributes.uvs.iter().flat_map(|n| n.to_array()).collect();
            all.set_item("uvs", from_vec(py, numbers, &[attributes.uvs.len(), 2])?)?;
            let numbers = attributes.colors.as_flattened().to_vec();
            all.set_item("colors", from_vec(py, numbers, &[attributes.colors.len(), 4])?)?;
            let slots = &attributes.material_slots;
            all.set_item("material_ids", from_vec(py, slots.clone(), &[slots.len()])?)?;
        }
        Kind::Shape(shape) => {
            let json = serde_json::to_string(&**shape)
                .map_err(|e| PyValueError::new_err(e.to_string()))?;
            all.set_item("shape", json)?;
        }
        Kind::Spheres(spheres) => {
            store_spheres(&all, spheres)?;
        }
        Kind::Curves(curves) => {
            store_curves(&all, curves)?;
        }
        Kind::Instance(child) => {
            let scene = match children.get(&Arc::as_ptr(child)) {
                Some(scene) => scene.clone_ref(py),
                None => {
                    let scene = Py::new(py, Scene::of(Contents::clone(child)))?;
                    children.insert(Arc::as_ptr(child), scene.clone_ref(py));
                    scene
                }
            };
            all.set_item("scene", scene)?;
        }
    }
    let place = match &object.motion {
        Some(motion) => Some(matrices(py, motion.maps())?),
        None => object.transform.map(|map| matrix(py, &map)).transpose()?,
    };
    all.set_item("transform", place)?;
    if let Some(motion) = &object.motion {
        all.set_item("times", motion.times().to_vec())?;
    }
    all.set_item("name", object.name.as_deref())?;
    all.set_item("mask", object.mask)?;
    let materials: Vec<Option<u32>> = object.materials.iter().map(|m| m.map(|m| m.0)).collect();
    all.set_item("materials", materials)?;
    Ok(all)
}

/// Stores spheres as the arguments of `Scene.add_spheres`.
pub fn store_spheres(all: &Bound<'_, PyDict>, spheres: &Spheres) -> PyResult<()> {
    balls(all, "centers", &spheres.spheres, &spheres.exact)
}

/// Stores curves as the arguments of `Scene.add_curves`, and their colours, if there are any.
pub fn store_curves(all: &Bound<'_, PyDict>, curves: &Curves) -> PyResult<()> {
    let py = all.py();
    balls(all, "points", curves.points(), curves.exact_points())?;
    if !curves.colors().is_empty() {
        let colors = curves.colors().iter().flatten().copied().collect();
        all.set_item("colors", from_vec(py, colors, &[curves.points().len(), 4])?)?;
    }
    let strands = curves.strands();
    all.set_item("strands", from_vec(py, strands.to_vec(), &[strands.len()])?)?;
    let basis =
        serde_json::to_string(&curves.basis()).map_err(|e| PyValueError::new_err(e.to_string()))?;
    all.set_item("basis", basis.trim_matches('"'))
}

/// Stores balls as positions and radii, in double precision if they are known so.
fn balls(
    all: &Bound<'_, PyDict>,
    positions: &str,
    single: &[Vec4],
    exact: &[DVec4],
) -> PyResult<()> {
    let (py, count) = (all.py(), single.len());
    let (places, radii) = if exact.is_empty() {
        let places = single.iter().flat_map(|p| p.truncate().to_array()).collect();
        let radii = single.iter().map(|p| p.w).collect();
        (from_vec::<f32>(py, places, &[count, 3])?, from_vec::<f32>(py, radii, &[count])?)
    } else {
        let places = exact.iter().flat_map(|p| p.truncate().to_array()).collect();
        let radii = exact.iter().map(|p| p.w).collect();
        (from_vec::<f64>(py, places, &[count, 3])?, from_vec::<f64>(py, radii, &[count])?)
    };
    all.set_item(positions, places)?;
    all.set_item("radii", radii)
}

/// Restores a stored scene.
#[pyfunction]
#[pyo3(signature = (slots, stage, warnings, compact=false))]
pub fn _restore(
    slots: &Bound<'_, PyList>,
    stage: &[u8],
    warnings: Vec<(String, u64)>,
    compact: bool,
) -> PyResult<Scene> {
    let py = slots.py();
    let options = ReadOptions {
        limits: Limits { file_bytes: u64::MAX, ..Limits::default() },
        ..ReadOptions::default()
    };
    let stage = read_scene_bytes("stage", stage.to_vec(), Path::new("."), &options);
    let mut stage = stage.map_err(|e| PyValueError::new_err(e.to_string()))?;
    stage.nodes.clear();
    stage.warnings = warnings
        .into_iter()
        .map(|(message, count)| Warning { message, count, kind: Default::default() })
        .collect();
    let mut contents = Contents::on(Arc::new(stage));
    contents.compact = compact;
    for slot in slots {
        if slot.is_none() {
            contents.add_gap();
            continue;
        }
        let slot = slot.cast_into::<PyDict>()?;
        let get = |key: &str| slot.get_item(key).map(|value| value.filter(|v| !v.is_none()));
        let need = |key: &str| {
            get(key)?.ok_or_else(|| PyValueError::new_err(format!("there is no {key}")))
        };
        let kind = if let Some(vertices) = get("vertices")? {
            let some =
                |key: &str| Ok::<_, PyErr>(get(key)?.filter(|v| v.len().is_ok_and(|n| n > 0)));
            let keys = [some("normals")?, some("uvs")?, some("colors")?, some("material_ids")?];
            let [normals, uvs, colors, material_ids] = keys.each_ref().map(Option::as_ref);
            let given = objects::Given { normals, uvs, colors, material_ids };
            let mesh = objects::mesh(&vertices, Some(&need("faces")?), &given)?;
            Kind::Mesh(Arc::new(mesh))
        } else if let Some(shape) = get("shape")? {
            let shape = serde_json::from_str(&shape.extract::<String>()?);
            Kind::Shape(Arc::new(shape.map_err(|e| PyValueError::new_err(format!("shape: {e}")))?))
        } else if let Some(points) = get("points")? {
            let basis: String = need("basis")?.extract()?;
            let curves =
                objects::curves(&points, &need("radii")?, Some(&need("strands")?), &basis)?;
            let colors = get("colors")?.map(|colors| objects::point_colors(&colors)).transpose()?;
            let curves = curves.with_colors(colors.unwrap_or_default());
            Kind::Curves(Arc::new(curves.map_err(|e| PyValueError::new_err(e.to_string()))?))
        } else if let Some(centers) = get("centers")? {
            Kind::Spheres(Arc::new(objects::spheres(&centers, &need("radii")?)?))
        } else {
            Kind::Instance(need("scene")?.cast::<Scene>()?.get().0.contents(py))
        };
        let Place { transform, motion } =
            place(get("transform")?.as_ref(), get("times")?.as_ref())?;
        let name = get("name")?.map(|name| name.extract()).transpose()?;
        let mask = objects::mask(get("mask")?.map(|mask| mask.extract()).transpose()?)?;
        let materials: Vec<Option<u32>> = need("materials")?.extract()?;
        let count = contents.stage.materials.len();
        if materials.iter().flatten().any(|&m| m as usize >= count) {
            return Err(PyValueError::new_err(format!(
                "materials are {materials:?}, but there are {count}"
            )));
        }
        let materials = materials.into_iter().map(|m| m.map(MaterialId)).collect();
        contents.add(Object { motion, mask, materials, ..Object::new(kind, transform, name) })?;
    }
    Ok(Scene::of(contents))
}
