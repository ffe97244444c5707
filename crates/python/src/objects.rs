//! Arguments that become objects of a scene: vertices, faces, shapes. Their places are in
//! [`crate::place`].

use crate::arrays::{array, check_unsigned, contiguous, is_double, numpy, shown, slice};
use crate::encoding::{AS_UINT8, warn_of_bytes};
use crate::mesh::{Attributes, Mesh, Positions};
use crate::schema::{References, family, kind_of, make, read_all};
use numpy::{Element, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value as Json};
use snell_intersect::{AnyShape, Curves, Shape, Spheres, StrandBasis};
use snell_math::{DVec3, DVec4, Vec2, Vec3, Vec4};

/// The shape of an array `(n, width)`, or an error that names the shape found.
fn rows(array: &Bound<'_, PyUntypedArray>, width: usize, name: &str) -> PyResult<usize> {
    match array.shape() {
        &[n, w] if w == width => Ok(n),
        // An empty array, as `[]` is.
        [0] => Ok(0),
        found => Err(PyValueError::new_err(format!(
            "{name}: shape is {}, expected (n, {width})",
            shown(found)
        ))),
    }
}

/// Refuses numbers that are not finite: names the first row that has one.
pub fn check_finite<T: Element + Copy + Into<f64> + Sync>(
    values: &[T],
    width: usize,
    name: &str,
) -> PyResult<()> {
    let bad = values.iter().position(|&x| !Into::<f64>::into(x).is_finite());
    bad.map_or(Ok(()), |at| {
        let (row, column, value) = (at / width, at % width, values[at].into());
        Err(PyValueError::new_err(format!(
            "{name}[{row}, {column}] is {value}, expected a finite number"
        )))
    })
}

/// Reads vertices: an array `(n, 3)` of finite numbers.
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

/// Reads an array of shape `(n, N)` as rows in single precision. Fails if a number is not finite,
/// or `n` is not as expected.
fn attribute<const N: usize>(
    value: &Bound<'_, PyAny>,
    expected: Option<usize>,
    name: &str,
) -> PyResult<Vec<[f32; N]>> {
    let array = array(value, name)?;
    let found = rows(&array, N, name)?;
    if let Some(expected) = expected.filter(|&n| n != found) {
        return Err(PyValueError::new_err(format!(
            "{name}: there are {found}, expected {expected}, one per vertex"
        )));
    }
    is_double(&array, name)?;
    let values = contiguous::<f32>(&array)?;
    let values = slice(&values)?;
    check_finite(values, N, name)?;
    Ok(values.as_chunks::<N>().0.to_vec())
}

/// Reads normals of vertices.
pub fn normals(value: Option<&Bound<'_, PyAny>>, vertices: usize) -> PyResult<Option<Vec<Vec3>>> {
    let read = |value| {
        Ok(attribute::<3>(value, Some(vertices), "normals")?
            .into_iter()
            .map(Vec3::from_array)
            .collect())
    };
    value.map(read).transpose()
}

/// Reads texture coordinates of vertices.
pub fn uvs(value: Option<&Bound<'_, PyAny>>, vertices: usize) -> PyResult<Option<Vec<Vec2>>> {
    let read = |value| {
        Ok(attribute::<2>(value, Some(vertices), "uvs")?
            .into_iter()
            .map(Vec2::from_array)
            .collect())
    };
    value.map(read).transpose()
}

/// Reads faces: an array `(m, 3)` of whole numbers below `vertices`.
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
        _ => Err(PyTypeError::new_err(format!(
            "faces: dtype is {}, expected integers",
            array.dtype()
        ))),
    }
}

fn convert<T: Element + Copy + TryInto<u32> + std::fmt::Display + Sync>(
    array: &Bound<'_, PyUntypedArray>,
    vertices: usize,
) -> PyResult<Vec<[u32; 3]>> {
    let values = contiguous::<T>(array)?;
    let values = slice(&values)?;
    let convert =
        |at: usize, x: T| x.try_into().ok().filter(|&i: &u32| (i as usize) < vertices).ok_or(at);
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

/// The optional arguments of a mesh beside vertices and faces.
#[derive(Debug, Default)]
pub struct Given<'a, 'py> {
    /// Normals of vertices: an array `(n, 3)`.
    pub normals: Option<&'a Bound<'py, PyAny>>,
    /// Texture coordinates of vertices: an array `(n, 2)`.
    pub uvs: Option<&'a Bound<'py, PyAny>>,
    /// Colours of vertices: an array `(n, 3)` or `(n, 4)`.
    pub colors: Option<&'a Bound<'py, PyAny>>,
    /// Material slots of faces: an array `(m,)`.
    pub material_ids: Option<&'a Bound<'py, PyAny>>,
}

impl Given<'_, '_> {
    fn attributes(&self, vertices: usize, faces: usize) -> PyResult<Attributes> {
        Ok(Attributes {
            normals: normals(self.normals, vertices)?.unwrap_or_default(),
            uvs: uvs(self.uvs, vertices)?.unwrap_or_default(),
            colors: self.colors.map_or(Ok(Vec::new()), |value| colors(value, vertices))?,
            material_slots: self
                .material_ids
                .map_or(Ok(Vec::new()), |value| slots(value, faces))?,
            ..Attributes::default()
        })
    }
}

/// Colours of vertices, with alpha or without: linear floats, or 8-bit or 16-bit sRGB.
fn colors(value: &Bound<'_, PyAny>, vertices: usize) -> PyResult<Vec<[f32; 4]>> {
    let array = array(value, "colors")?;
    let levels = crate::encoding::levels(&array, "colors")?;
    let read: Vec<[f32; 4]> = if array.shape().last() == Some(&4) {
        attribute::<4>(array.as_any(), Some(vertices), "colors")?
    } else {
        let opaque = attribute::<3>(array.as_any(), Some(vertices), "colors")?;
        let alpha = levels.unwrap_or(1.0);
        opaque.into_iter().map(|[r, g, b]| [r, g, b, alpha]).collect()
    };
    let Some(levels) = levels else {
        warn_of_bytes(value.py(), read.as_flattened(), "colors", AS_UINT8)?;
        return Ok(read);
    };
    Ok(read.into_iter().map(|color| crate::encoding::linear(color, levels)).collect())
}

/// Reads material slots of faces.
fn slots(value: &Bound<'_, PyAny>, faces: usize) -> PyResult<Vec<u16>> {
    let array = array(value, "material_ids")?;
    if array.shape() != [faces] {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!(
            "material_ids: shape is {found}, expected ({faces},), one per face"
        )));
    }
    check_unsigned(&array, u16::MAX.into(), "material_ids")?;
    Ok(slice(&contiguous::<u16>(&array)?)?.to_vec())
}

/// The arguments of `Scene.add_mesh` for a mesh of another library, or a list of such meshes.
pub fn parts<'py>(mesh: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    let module = mesh.py().import("snell._meshes")?;
    Ok(module.getattr("parts_of")?.call1((mesh,))?.cast_into::<PyDict>()?)
}

/// A mesh from its arrays, or from a mesh of another library.
pub fn mesh<'py>(
    vertices: &Bound<'py, PyAny>,
    faces_given: Option<&Bound<'py, PyAny>>,
    given: &Given<'_, 'py>,
) -> PyResult<Mesh> {
    let py = vertices.py();
    let (vertices, faces_given) = match faces_given {
        Some(faces) => (vertices.clone(), faces.clone()),
        None => py.import("snell._meshes")?.getattr("arrays_of")?.call1((vertices,))?.extract()?,
    };
    let positions = positions(&vertices, "vertices")?;
    let n = positions.len();
    if u32::try_from(n).is_err() {
        return Err(PyValueError::new_err(format!(
            "vertices: there are {n}, expected at most {}",
            u32::MAX
        )));
    }
    let indices = faces(&faces_given, n)?;
    let attributes = given.attributes(n, indices.len())?;
    Ok(py.detach(|| Mesh::new(positions, indices, attributes)))
}

/// Reads a mask of 32 bits.
pub fn mask(value: Option<i64>) -> PyResult<u32> {
    let Some(value) = value else { return Ok(u32::MAX) };
    u32::try_from(value).map_err(|_| {
        PyValueError::new_err(format!("mask is {value}, expected 32 bits: 0 to {}", u32::MAX))
    })
}

/// Positions with one number more for each: `radii`, of which a single one stands for all.
enum Balls {
    /// In single precision: as it was given.
    Single(Vec<Vec4>),
    /// In double precision.
    Double(Vec<DVec4>),
}

/// Reads positions and the radii of balls there. They are kept in double precision unless the
/// positions are `float32`.
fn balls(
    points: &Bound<'_, PyAny>,
    name: &str,
    radii: &Bound<'_, PyAny>,
    least: impl Fn(usize, f64) -> PyResult<()>,
) -> PyResult<Balls> {
    let positions = positions(points, name)?;
    let radii = of_each(radii, "radii", positions.len())?;
    radii.iter().enumerate().try_for_each(|(at, &radius)| least(at, radius))?;
    Ok(match positions {
        Positions::Single(all) => {
            Balls::Single(all.iter().zip(radii).map(|(p, r)| p.extend(r as f32)).collect())
        }
        Positions::Double(all) => {
            Balls::Double(all.iter().zip(radii).map(|(p, r)| p.extend(r)).collect())
        }
    })
}

/// One number for each of `count` points; a single number stands for all.
fn of_each(values: &Bound<'_, PyAny>, what: &str, count: usize) -> PyResult<Vec<f64>> {
    let py = values.py();
    let values = array(values, what)?;
    is_double(&values, what)?;
    if !matches!(values.shape(), [] | [1]) && values.shape() != [count] {
        let found = shown(values.shape());
        return Err(PyValueError::new_err(format!(
            "{what}: shape is {found}, expected ({count},) or one number"
        )));
    }
    let values = contiguous::<f64>(
        &numpy(py, "atleast_1d")?.call1((values,))?.cast_into::<PyUntypedArray>()?,
    )?;
    let values = slice(&values)?;
    check_finite(values, 1, what)?;
    Ok(if values.len() == 1 { vec![values[0]; count] } else { values.to_vec() })
}

/// Spheres in bulk.
pub fn spheres(centers: &Bound<'_, PyAny>, radii: &Bound<'_, PyAny>) -> PyResult<Spheres> {
    let balls = balls(centers, "centers", radii, |at, radius| {
        if radius > 0.0 {
            return Ok(());
        }
        let message = format!("radii[{at}] is {radius}, expected a positive number");
        Err(PyValueError::new_err(message))
    })?;
    Ok(match balls {
        Balls::Single(spheres) => Spheres { spheres, ..Spheres::default() },
        Balls::Double(exact) => Spheres {
            spheres: exact.iter().map(|ball| ball.as_vec4()).collect(),
            exact,
            ..Spheres::default()
        },
    })
}

/// Strands of round curves. `strands` has the number of points of each; without it, all points are
/// one strand.
pub fn curves(
    points: &Bound<'_, PyAny>,
    radii: &Bound<'_, PyAny>,
    strands: Option<&Bound<'_, PyAny>>,
    basis: &str,
) -> PyResult<Curves> {
    let balls = balls(points, "points", radii, |at, radius| {
        if radius >= 0.0 {
            return Ok(());
        }
        Err(PyValueError::new_err(format!("radii[{at}] is {radius}, expected 0 or more")))
    })?;
    let count = match &balls {
        Balls::Single(all) => all.len(),
        Balls::Double(all) => all.len(),
    };
    let strands: Vec<u32> = match strands {
        Some(counts) => counts.extract().map_err(|_| {
            PyValueError::new_err(
                "strands: expected a sequence of whole numbers, of points of each strand",
            )
        })?,
        None => vec![count as u32],
    };
    let named = serde_json::from_value::<StrandBasis>(basis.into());
    let basis = named.map_err(|_| {
        PyValueError::new_err(format!(
            "basis is {basis:?}, expected \"bezier\", \"b-spline\", \"catmull-rom\" or \"linear\""
        ))
    })?;
    let curves = match balls {
        Balls::Single(points) => Curves::new(basis, points, strands),
        Balls::Double(points) => Curves::exact(basis, points, strands),
    };
    curves.map_err(|error| PyValueError::new_err(error.to_string()))
}

/// What other programs call shapes, and their names here.
const SHAPES_ELSEWHERE: &[(&str, &str)] = &[
    ("cube", "box"),
    ("cuboid", "box"),
    ("ball", "sphere"),
    ("quad", "rectangle"),
    ("square", "rectangle"),
    ("ground", "plane"),
    ("floor", "plane"),
    ("circle", "disk"),
    ("tube", "cylinder"),
];

/// Colours of the points of curves, linear RGB and alpha.
pub fn point_colors(colors: &Bound<'_, PyAny>) -> PyResult<Vec<[f32; 4]>> {
    attribute::<4>(colors, None, "colors")
}

/// An analytic shape from its name and parameters.
pub fn shape(kind: &str, parameters: Option<&Bound<'_, PyDict>>) -> PyResult<AnyShape> {
    let family = family("shape")?;
    if let Some((_, ours)) = SHAPES_ELSEWHERE.iter().find(|(name, _)| *name == kind) {
        return Err(PyValueError::new_err(format!(
            "there is no shape {kind:?}; it is called {ours:?}"
        )));
    }
    let known = kind_of(family, kind)?.fields();
    let given = match parameters {
        Some(given) => read_all(kind, known, given, &mut References::default())?,
        None => Vec::new(),
    };
    let whole = |mut fields: Map<String, Json>| {
        fields.insert(family.tag.to_string(), kind.into());
        Json::Object(fields)
    };
    let shape: AnyShape = make(kind, known, &given, &family.example(kind), whole)?;
    shape.validate().map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(shape)
}
