//! Arguments that become objects of a scene: vertices, faces, transforms, shapes.

use crate::arrays::{array, contiguous, is_double, numpy, shown, slice};
use crate::mesh::{Attributes, Mesh, Positions};
use numpy::{Element, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString};
use serde_json::{Map, Value};
use snell_intersect::{AnyShape, Shape, Spheres};
use snell_math::{DMat4, DVec3, Transform, Vec2, Vec3, Vec4};

/// The shape of an array `(n, width)`, or an error that says what was found.
fn rows(array: &Bound<'_, PyUntypedArray>, width: usize, name: &str) -> PyResult<usize> {
    match array.shape() {
        &[n, w] if w == width => Ok(n),
        // Nothing at all, as `[]` is.
        [0] => Ok(0),
        found => Err(PyValueError::new_err(format!("{name}: shape is {}, expected (n, {width})", shown(found)))),
    }
}

/// Refuses numbers that are not finite: names the first row that has one.
fn check_finite<T: Element + Copy + Into<f64> + Sync>(values: &[T], width: usize, name: &str) -> PyResult<()> {
    let bad = values.iter().position(|&x| !Into::<f64>::into(x).is_finite());
    bad.map_or(Ok(()), |at| {
        let (row, column, value) = (at / width, at % width, values[at].into());
        Err(PyValueError::new_err(format!("{name}[{row}, {column}] is {value}, expected a finite number")))
    })
}

/// Vertices: an array `(n, 3)` of finite numbers.
pub fn positions(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Positions> {
    let (array, py) = (array(value, name)?, value.py());
    rows(&array, 3, name)?;
    if is_double(&array, name)? {
        let values = contiguous::<f64>(&array)?;
        let values = slice(&values)?;
        check_finite(values, 3, name)?;
        Ok(Positions::Double(py.detach(|| values.chunks_exact(3).map(DVec3::from_slice).collect())))
    } else {
        let values = contiguous::<f32>(&array)?;
        let values = slice(&values)?;
        check_finite(values, 3, name)?;
        Ok(Positions::Single(py.detach(|| values.chunks_exact(3).map(Vec3::from_slice).collect())))
    }
}

/// Rows of numbers in single precision: finite, `(n, width)`, `n` as expected if something is.
fn attribute<const N: usize>(value: &Bound<'_, PyAny>, expected: Option<usize>, name: &str) -> PyResult<Vec<[f32; N]>> {
    let array = array(value, name)?;
    let found = rows(&array, N, name)?;
    if let Some(expected) = expected.filter(|&n| n != found) {
        return Err(PyValueError::new_err(format!("{name}: there are {found}, expected {expected}, one per vertex")));
    }
    is_double(&array, name)?;
    let values = contiguous::<f32>(&array)?;
    let values = slice(&values)?;
    check_finite(values, N, name)?;
    Ok(values.as_chunks::<N>().0.to_vec())
}

/// Normals of vertices.
pub fn normals(value: Option<&Bound<'_, PyAny>>, vertices: usize) -> PyResult<Option<Vec<Vec3>>> {
    let read =
        |value| Ok(attribute::<3>(value, Some(vertices), "normals")?.into_iter().map(Vec3::from_array).collect());
    value.map(read).transpose()
}

/// Texture coordinates of vertices.
pub fn uvs(value: Option<&Bound<'_, PyAny>>, vertices: usize) -> PyResult<Option<Vec<Vec2>>> {
    let read = |value| Ok(attribute::<2>(value, Some(vertices), "uvs")?.into_iter().map(Vec2::from_array).collect());
    value.map(read).transpose()
}

/// Faces: an array `(m, 3)` of whole numbers below `vertices`.
pub fn faces(value: &Bound<'_, PyAny>, vertices: usize) -> PyResult<Vec<[u32; 3]>> {
    let array = array(value, "faces")?;
    if rows(&array, 3, "faces")? == 0 {
        return Ok(Vec::new());
    }
    let kind: char = array.dtype().getattr("kind")?.extract()?;
    let size: usize = array.dtype().getattr("itemsize")?.extract()?;
    match (kind, size) {
        ('u', 4) => convert::<u32>(&array, vertices),
        ('i', 4) => convert::<i32>(&array, vertices),
        ('u', 8) => convert::<u64>(&array, vertices),
        ('i' | 'u', _) => convert::<i64>(&array, vertices),
        _ => Err(PyTypeError::new_err(format!("faces: dtype is {}, expected integers", array.dtype()))),
    }
}

fn convert<T: Element + Copy + TryInto<u32> + std::fmt::Display + Sync>(
    array: &Bound<'_, PyUntypedArray>,
    vertices: usize,
) -> PyResult<Vec<[u32; 3]>> {
    let values = contiguous::<T>(array)?;
    let values = slice(&values)?;
    let convert = |at: usize, x: T| x.try_into().ok().filter(|&i: &u32| (i as usize) < vertices).ok_or(at);
    let result: Result<Vec<[u32; 3]>, usize> = array.py().detach(|| {
        let row = |(i, row): (usize, &[T; 3])| {
            let [a, b, c] = *row;
            Ok([convert(3 * i, a)?, convert(3 * i + 1, b)?, convert(3 * i + 2, c)?])
        };
        values.as_chunks::<3>().0.iter().enumerate().map(row).collect()
    });
    result.map_err(|at| {
        let (row, column, value) = (at / 3, at % 3, values[at]);
        let expected = match vertices {
            0 => "but there are no vertices".to_string(),
            n => format!("expected 0 to {}", n - 1),
        };
        PyValueError::new_err(format!("faces[{row}, {column}] is {value}, {expected}"))
    })
}

/// A mesh from its arrays, or from a mesh of another library.
pub fn mesh<'py>(
    vertices: &Bound<'py, PyAny>,
    faces_given: Option<&Bound<'py, PyAny>>,
    normals_given: Option<&Bound<'py, PyAny>>,
    uvs_given: Option<&Bound<'py, PyAny>>,
) -> PyResult<Mesh> {
    let py = vertices.py();
    let (vertices, faces_given) = match faces_given {
        Some(faces) => (vertices.clone(), faces.clone()),
        None => py.import("snell._meshes")?.getattr("arrays_of")?.call1((vertices,))?.extract()?,
    };
    let positions = positions(&vertices, "vertices")?;
    let n = positions.len();
    if u32::try_from(n).is_err() {
        return Err(PyValueError::new_err(format!("vertices: there are {n}, expected at most {}", u32::MAX)));
    }
    let indices = faces(&faces_given, n)?;
    let normals = normals(normals_given, n)?.unwrap_or_default();
    let uvs = uvs(uvs_given, n)?.unwrap_or_default();
    let attributes = Attributes { normals, uvs, ..Attributes::default() };
    Ok(py.detach(|| Mesh::new(positions, indices, attributes)))
}

/// A transform: a matrix `(4, 4)` whose last row is 0, 0, 0, 1, or its first three rows.
pub fn transform(value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Transform>> {
    let Some(value) = value else { return Ok(None) };
    let array = array(value, "transform")?;
    if !matches!(array.shape(), [3 | 4, 4]) {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!("transform: shape is {found}, expected (4, 4) or (3, 4)")));
    }
    is_double(&array, "transform")?;
    let values = contiguous::<f64>(&array)?;
    let values = slice(&values)?;
    check_finite(values, 4, "transform")?;
    let mut rows = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    rows[..values.len()].copy_from_slice(values);
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(PyValueError::new_err(format!("transform[3] is {:?}, expected [0, 0, 0, 1]", &rows[12..])));
    }
    let map = Transform::from_matrix(DMat4::from_cols_array(&rows).transpose());
    map.map(Some).ok_or_else(|| PyValueError::new_err("transform is singular, expected one with an inverse"))
}

/// A matrix `(4, 4)`.
pub fn matrix<'py>(py: Python<'py>, map: &Transform) -> PyResult<Bound<'py, PyAny>> {
    let rows = DMat4::from(*map.matrix()).transpose().to_cols_array();
    crate::arrays::from_vec(py, rows.to_vec(), &[4, 4])
}

/// A mask of 32 bits.
pub fn mask(value: Option<i64>) -> PyResult<u32> {
    let Some(value) = value else { return Ok(u32::MAX) };
    u32::try_from(value).map_err(|_| PyValueError::new_err(format!("mask is {value}, expected 0 to {}", u32::MAX)))
}

/// Spheres in bulk.
pub fn spheres(centers: &Bound<'_, PyAny>, radii: &Bound<'_, PyAny>) -> PyResult<Spheres> {
    let py = centers.py();
    let centers = attribute::<3>(centers, None, "centers")?;
    let radii_array = array(radii, "radii")?;
    is_double(&radii_array, "radii")?;
    if !matches!(radii_array.shape(), [] | [1]) && radii_array.shape() != [centers.len()] {
        let (found, n) = (shown(radii_array.shape()), centers.len());
        return Err(PyValueError::new_err(format!("radii: shape is {found}, expected ({n},) or one number")));
    }
    let values = contiguous::<f32>(&numpy(py, "atleast_1d")?.call1((radii_array,))?.cast_into::<PyUntypedArray>()?)?;
    let values = slice(&values)?;
    check_finite(values, 1, "radii")?;
    if let Some(at) = values.iter().position(|&r| r <= 0.0) {
        return Err(PyValueError::new_err(format!("radii[{at}] is {}, expected a positive number", values[at])));
    }
    let radius = |i: usize| if values.len() == 1 { values[0] } else { values[i] };
    let spheres = centers.iter().enumerate().map(|(i, &[x, y, z])| Vec4::new(x, y, z, radius(i))).collect();
    Ok(Spheres { spheres, colors: Vec::new() })
}

/// The names of the parameters of all shapes.
pub fn shape_parameters() -> Vec<(&'static str, Vec<String>)> {
    let mut all: Vec<(&'static str, Vec<String>)> = Vec::new();
    for shape in AnyShape::examples() {
        if all.iter().all(|(name, _)| *name != shape.name())
            && let Ok(Value::Object(fields)) = serde_json::to_value(&shape)
        {
            all.push((shape.name(), fields.keys().filter(|k| *k != "shape").cloned().collect()));
        }
    }
    all
}

/// What stands for a Python value in a declaration.
fn json(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Value> {
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Bool(value.extract()?));
    }
    if !value.is_instance_of::<PyUntypedArray>()
        && let Ok(number) = value.extract::<f64>()
    {
        let finite = serde_json::Number::from_f64(number);
        let error = || PyValueError::new_err(format!("{name} is {number}, expected a finite number"));
        return finite.map(Value::Number).ok_or_else(error);
    }
    if value.is_instance_of::<PyString>() {
        return Ok(Value::String(value.extract()?));
    }
    let items = if value.hasattr("tolist")? { value.call_method0("tolist")? } else { value.clone() };
    let items = items.try_iter().map_err(|_| PyTypeError::new_err(format!("{name}: expected numbers")))?;
    items.enumerate().map(|(i, item)| json(&item?, &format!("{name}[{i}]"))).collect()
}

/// The closest of some names to one that is not among them.
fn suggestion(py: Python<'_>, name: &str, known: &[&str]) -> PyResult<String> {
    let close: Vec<String> = py.import("difflib")?.call_method1("get_close_matches", (name, known, 1))?.extract()?;
    Ok(match close.first() {
        Some(close) => format!("; did you mean {close:?}?"),
        None => format!("; there are {}", known.join(", ")),
    })
}

/// An analytic shape from its name and parameters.
pub fn shape(py: Python<'_>, kind: &str, parameters: Option<&Bound<'_, PyDict>>) -> PyResult<AnyShape> {
    let shapes = shape_parameters();
    let Some((_, known)) = shapes.iter().find(|(name, _)| *name == kind) else {
        let names: Vec<_> = shapes.iter().map(|(name, _)| *name).collect();
        let hint = suggestion(py, kind, &names)?;
        return Err(PyValueError::new_err(format!("shape: there is no {kind:?}{hint}")));
    };
    let mut fields = Map::new();
    fields.insert("shape".into(), kind.into());
    for (key, value) in parameters.into_iter().flatten() {
        let key: String = key.extract()?;
        if !known.contains(&key) {
            let hint = suggestion(py, &key, &known.iter().map(String::as_str).collect::<Vec<_>>())?;
            return Err(PyTypeError::new_err(format!("{kind} has no parameter {key:?}{hint}")));
        }
        fields.insert(key.clone(), json(&value, &key)?);
    }
    let shape: AnyShape = serde_json::from_value(Value::Object(fields))
        .map_err(|e| PyValueError::new_err(format!("{kind}: {e}; its parameters are {}", known.join(", "))))?;
    shape.validate().map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(shape)
}
