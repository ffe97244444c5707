//! Arguments that are the places of objects: transforms, and transforms at times.

use crate::arrays::{array, contiguous, index_in, is_double, shown, slice};
use crate::motion::Motion;
use crate::objects::check_finite;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;
use snell_math::{DMat4, Transform};
use std::sync::Arc;

/// Where an object is, and how it moves.
#[derive(Clone, Debug, Default)]
pub struct Place {
    /// The map from the object's coordinates to the scene's, at the first key if it moves.
    pub transform: Option<Transform>,
    /// The motion; `None` if the object rests.
    pub motion: Option<Arc<Motion>>,
}

/// A place: a transform, or transforms `(k, 4, 4)` at times `(k,)`.
pub fn place(
    transform: Option<&Bound<'_, PyAny>>,
    times: Option<&Bound<'_, PyAny>>,
) -> PyResult<Place> {
    let Some(value) = transform else {
        return match times {
            None => Ok(Place::default()),
            Some(_) => Err(PyTypeError::new_err("times are given, but no transform")),
        };
    };
    refuse_text(value, "transform")?;
    let matrices = array(value, "transform")?;
    if matrices.shape().len() != 3 {
        if times.is_some() {
            return Err(PyValueError::new_err(format!(
                "transform: shape is {}, expected (k, 4, 4), one for each of the times",
                shown(matrices.shape())
            )));
        }
        let transform = Some(named_transform(value, "transform")?);
        return Ok(Place { transform, motion: None });
    }
    let Some(times) = times else {
        return Err(PyValueError::new_err(format!(
            "transform: shape is {}, expected (4, 4); give times= for one object that moves, or \
                add_instances(scene, transforms) for many instances",
            shown(matrices.shape())
        )));
    };
    let maps = transforms(&matrices, "transform")?;
    let times = key_times(times, maps.len())?;
    moving(times, maps)
}

/// Fails for a text, which was meant as a name.
fn refuse_text(value: &Bound<'_, PyAny>, name: &str) -> PyResult<()> {
    if !value.is_instance_of::<PyString>() {
        return Ok(());
    }
    let found = crate::settings::shown(value);
    Err(PyTypeError::new_err(format!(
        "{name} is {found}, expected a matrix (4, 4); give a name as name={found}"
    )))
}

/// Places of many objects: transforms `(n, 4, 4)`, or `(n, k, 4, 4)` at times `(k,)`.
pub fn places(
    transforms_given: &Bound<'_, PyAny>,
    times: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Place>> {
    let matrices = array(transforms_given, "transforms")?;
    let shape = matrices.shape().to_vec();
    let maps = transforms(&matrices, "transforms")?;
    let (keys, times) = match (&shape[..], times) {
        ([_, k, _, _], Some(times)) => (*k, times),
        ([_, _, _, _], None) => {
            return Err(PyValueError::new_err(format!(
                "transforms: shape is {}, but there are no times; give times= for objects that \
                    move, or reshape(-1, 4, 4) for objects that rest",
                shown(&shape)
            )));
        }
        (_, None) => {
            let still = |map| Place { transform: Some(map), motion: None };
            return Ok(maps.into_iter().map(still).collect());
        }
        _ => {
            return Err(PyValueError::new_err(format!(
                "transforms: shape is {}, expected (n, k, 4, 4) with the times of k keys",
                shown(&shape)
            )));
        }
    };
    let times = key_times(times, keys)?;
    maps.chunks(keys).map(|maps| moving(times.clone(), maps.to_vec())).collect()
}

fn moving(times: Vec<f64>, maps: Vec<Transform>) -> PyResult<Place> {
    Motion::new(times, maps).map(Place::from)
}

impl From<Motion> for Place {
    fn from(motion: Motion) -> Self {
        Self { transform: motion.maps().first().copied(), motion: Some(Arc::new(motion)) }
    }
}

/// The times of `count` keys, ascending.
fn key_times(times: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<f64>> {
    if count == 0 {
        return Err(PyValueError::new_err("transform: there are no keys, expected one or more"));
    }
    let array = array(times, "times")?;
    if array.shape() != [count] {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!(
            "times: shape is {found}, expected ({count},), one for each key of the transform"
        )));
    }
    is_double(&array, "times")?;
    let values = contiguous::<f64>(&array)?;
    let values = slice(&values)?;
    if let Some(at) = values.iter().position(|time| !time.is_finite()) {
        let message = format!("times[{at}] is {}, expected a finite number", values[at]);
        return Err(PyValueError::new_err(message));
    }
    if let Some(at) = values.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(PyValueError::new_err(format!(
            "times[{}] is {}, expected more than times[{at}], {}",
            at + 1,
            values[at + 1],
            values[at]
        )));
    }
    Ok(values.to_vec())
}

/// A transform: a matrix `(4, 4)` whose last row is 0, 0, 0, 1, or its first three rows.
pub fn transform(value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Transform>> {
    value.map(|value| named_transform(value, "transform")).transpose()
}

/// Like [`transform`], for a required argument of another name.
pub fn named_transform(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Transform> {
    let array = array(value, name)?;
    if !matches!(array.shape(), [3 | 4, 4]) {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!(
            "{name}: shape is {found}, expected (4, 4) or (3, 4)"
        )));
    }
    is_double(&array, name)?;
    let values = contiguous::<f64>(&array)?;
    let values = slice(&values)?;
    check_finite(values, 4, name)?;
    matrix_of(values, || name.to_string())
}

/// Transforms: an array `(…, 4, 4)` or `(…, 3, 4)` of at least three dimensions, as a list.
fn transforms(array: &Bound<'_, PyUntypedArray>, name: &str) -> PyResult<Vec<Transform>> {
    let &[ref many @ .., rows @ (3 | 4), 4] = array.shape() else {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!("{name}: shape is {found}, expected (n, 4, 4)")));
    };
    if !matches!(many.len(), 1 | 2) {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!("{name}: shape is {found}, expected (n, 4, 4)")));
    }
    let many = many.to_vec();
    is_double(array, name)?;
    let values = contiguous::<f64>(array)?;
    let values = slice(&values)?;
    let matrix = |(number, values): (usize, &[f64])| {
        let place = || format!("{name}[{}]", index_in(number, &many));
        if let Some(at) = values.iter().position(|x| !x.is_finite()) {
            return Err(PyValueError::new_err(format!(
                "{}[{}, {}] is {}, expected a finite number",
                place(),
                at / 4,
                at % 4,
                values[at]
            )));
        }
        matrix_of(values, place)
    };
    values.chunks_exact(4 * rows).enumerate().map(matrix).collect()
}

/// The transform of a matrix of three or four rows of finite numbers.
fn matrix_of(values: &[f64], name: impl Fn() -> String) -> PyResult<Transform> {
    let mut rows = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    rows[..values.len()].copy_from_slice(values);
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        let is_transposed = rows[3] == 0.0 && rows[7] == 0.0 && rows[11] == 0.0 && rows[15] == 1.0;
        let remedy = if is_transposed { "; it is made for row vectors: transpose it" } else { "" };
        return Err(PyValueError::new_err(format!(
            "{}[3] is {:?}, expected [0, 0, 0, 1]{remedy}",
            name(),
            &rows[12..]
        )));
    }
    let map = Transform::from_matrix(DMat4::from_cols_array(&rows).transpose());
    map.ok_or_else(|| {
        PyValueError::new_err(format!("{} is singular, expected one with an inverse", name()))
    })
}

/// A transform as a matrix `(4, 4)`.
pub fn matrix<'py>(py: Python<'py>, map: &Transform) -> PyResult<Bound<'py, PyAny>> {
    matrices(py, std::slice::from_ref(map))?.call_method1("reshape", (4, 4))
}

/// Transforms as an array `(n, 4, 4)`.
pub fn matrices<'py>(py: Python<'py>, maps: &[Transform]) -> PyResult<Bound<'py, PyAny>> {
    let rows = maps.iter().flat_map(|map| DMat4::from(*map.matrix()).transpose().to_cols_array());
    crate::arrays::from_vec(py, rows.collect(), &[maps.len(), 4, 4])
}
