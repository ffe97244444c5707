//! Pickling of scenes.

use crate::arrays::from_vec;
use crate::contents::{Contents, Kind, Object, Slot};
use crate::objects;
use crate::place::{Place, matrices, matrix, place};
use crate::scene::Scene;
use crate::state::Shared;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyTuple};
use snell_formats::scene::snell::text;
use snell_formats::{Limits, ReadOptions, read_scene_bytes};
use snell_intersect::{Curves, Spheres};
use snell_math::{DVec4, Vec4};
use snell_scene::{MaterialId, Node, NodeId, Scene as Graph, Warning};
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

/// The function and arguments that restore the scene. Scenes that are instanced are in one list,
/// not within each other, because Python's pickles do not nest deep.
pub fn reduce<'py>(
    py: Python<'py>,
    contents: &Arc<Contents>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
    let (mut stages, mut numbers) = (Vec::new(), HashMap::new());
    let mut children = HashMap::new();
    let scenes = PyList::empty(py);
    for scene in below(contents) {
        let slots = PyList::empty(py);
        for slot in &scene.slots {
            match slot {
                Slot::Gone(_) => slots.append(py.None())?,
                Slot::Here(object) => slots.append(stored(py, object, &children)?)?,
            }
        }
        let stage = match numbers.get(&Arc::as_ptr(&scene.stage)) {
            Some(&known) => known,
            None => {
                stages.push(stored_stage(py, &scene.stage)?);
                numbers.insert(Arc::as_ptr(&scene.stage), stages.len() - 1);
                stages.len() - 1
            }
        };
        children.insert(Arc::as_ptr(scene), scenes.len());
        scenes.append((slots, stage, scene.compact))?;
    }
    let restore = py.import("snell._snell")?.getattr("_restore")?;
    Ok((restore, (scenes, stages).into_pyobject(py)?))
}

/// All scenes that a scene instances, each once and before those that instance it; it is the last.
fn below(contents: &Arc<Contents>) -> Vec<&Arc<Contents>> {
    fn add<'a>(
        contents: &'a Arc<Contents>,
        known: &mut HashSet<*const Contents>,
        all: &mut Vec<&'a Arc<Contents>>,
    ) {
        if !known.insert(Arc::as_ptr(contents)) {
            return;
        }
        for (_, object) in contents.objects() {
            if let Kind::Instance(child) = &object.kind {
                add(child, known, all);
            }
        }
        all.push(contents);
    }
    let mut all = Vec::new();
    add(contents, &mut HashSet::new(), &mut all);
    all
}

/// The bytes of a stage, and its warnings.
type StoredStage<'py> = (Bound<'py, PyBytes>, Vec<(String, u64)>);

/// A stage as a scene file without objects.
fn stored_stage<'py>(py: Python<'py>, stage: &Graph) -> PyResult<StoredStage<'py>> {
    let mut stage = Graph::clone(stage);
    (stage.nodes, stage.root) = (vec![Node::default()], NodeId(0));
    if stage.motion.take().is_some() {
        let message = "pickle: the animation of the file that objects do not have is left out; \
            keep the file, or use scene.at(time)";
        crate::encoding::warn(py, message.into())?;
    }
    let warnings: Vec<(String, u64)> =
        stage.warnings.iter().map(|w| (w.message.clone(), w.count)).collect();
    let text = text(&stage).map_err(PyValueError::new_err)?;
    Ok((PyBytes::new(py, text.as_bytes()), warnings))
}

/// An object as a dictionary; a scene that is instanced is its number.
fn stored<'py>(
    py: Python<'py>,
    object: &Object,
    children: &HashMap<*const Contents, usize>,
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
        Kind::Heightfield(field) => {
            all.set_item("heights", field.heights(py)?)?;
            all.set_item("grid", crate::place::matrix(py, &field.placed())?)?;
            all.set_item("smooth", field.is_smooth)?;
            all.set_item("closed", field.grid.has_closed_border())?;
        }
        Kind::Instance(child) => {
            all.set_item("scene", children.get(&Arc::as_ptr(child)))?;
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
pub fn _restore(
    scenes: Vec<(Bound<'_, PyList>, usize, bool)>,
    stages: Vec<StoredStage<'_>>,
) -> PyResult<Scene> {
    let stages = stages.iter().map(restored_stage).collect::<PyResult<Vec<_>>>()?;
    let mut made: Vec<Arc<Contents>> = Vec::with_capacity(scenes.len());
    for (slots, stage, compact) in scenes {
        let stage = stages.get(stage).cloned().ok_or_else(damaged)?;
        let mut contents = Contents::on(stage);
        contents.compact = compact;
        restore_slots(&slots, &mut contents, &made)?;
        made.push(Arc::new(contents));
    }
    made.pop().map(|contents| Scene(Shared::new(contents))).ok_or_else(damaged)
}

fn damaged() -> PyErr {
    PyValueError::new_err("the pickle of the scene is damaged")
}

fn restored_stage((stage, warnings): &StoredStage<'_>) -> PyResult<Arc<Graph>> {
    let options = ReadOptions {
        limits: Limits { file_bytes: u64::MAX, ..Limits::default() },
        ..ReadOptions::default()
    };
    let stage = read_scene_bytes("stage", stage.as_bytes().to_vec(), Path::new("."), &options);
    let mut stage = stage.map_err(|e| PyValueError::new_err(e.to_string()))?;
    stage.nodes.clear();
    let warning = |(message, count): &(String, u64)| Warning {
        message: message.clone(),
        count: *count,
        kind: Default::default(),
    };
    stage.warnings = warnings.iter().map(warning).collect();
    Ok(Arc::new(stage))
}

/// Adds stored objects to a scene; `made` are the scenes that instances refer to.
fn restore_slots(
    slots: &Bound<'_, PyList>,
    contents: &mut Contents,
    made: &[Arc<Contents>],
) -> PyResult<()> {
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
        } else if let Some(heights) = get("heights")? {
            let smooth: bool = need("smooth")?.extract()?;
            let closed: bool = need("closed")?.extract()?;
            let grid = need("grid")?;
            let field = crate::heightfield::field(&heights, Some(&grid), smooth, closed)?;
            Kind::Heightfield(Arc::new(field))
        } else if let Some(centers) = get("centers")? {
            Kind::Spheres(Arc::new(objects::spheres(&centers, &need("radii")?)?))
        } else {
            let number: usize = need("scene")?.extract()?;
            Kind::Instance(made.get(number).cloned().ok_or_else(damaged)?)
        };
        let Place { transform, motion } =
            place(get("transform")?.as_ref(), get("times")?.as_ref())?;
        let name = get("name")?.map(|name| name.extract()).transpose()?;
        let mask = objects::mask(get("mask")?.map(|mask| mask.extract::<u64>()).transpose()?)?;
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
    Ok(())
}
