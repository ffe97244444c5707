//! Arrays of Python as slices, and back. Errors name the argument.
//!
//! The dtype of a query's input decides the precision: `float16` and `float32` are processed in
//! single precision, `float64`, integers and plain Python numbers in double. A contiguous array of
//! the right dtype is read in place.

use crate::precision::Precision;
use numpy::ndarray::Dimension;
use numpy::{
    Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArray, PyReadonlyArrayDyn,
    PyReadwriteArray1, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyInt, PyTuple};

/// The function of NumPy with this name.
pub fn numpy<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    static NUMPY: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    let module = NUMPY.get_or_try_init(py, || py.import("numpy").map(Bound::unbind))?;
    module.bind(py).getattr(name)
}

/// Anything as an array: NumPy's own, tensors in main memory, `__array_interface__`, `__array__`,
/// DLPack, or nested sequences.
pub fn array<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = value.py();
    if value.get_type().is(py.get_type::<PyUntypedArray>()) {
        return Ok(value.cast::<PyUntypedArray>()?.clone());
    }
    let made = py.import("snell._arrays")?.getattr("array_of")?.call1((value, name))?;
    Ok(made.cast_into::<PyUntypedArray>()?)
}

/// The code of an array's numbers in NumPy: `f`, `i`, `u`, `b`, …
fn number_kind(array: &Bound<'_, PyUntypedArray>) -> PyResult<char> {
    array.dtype().getattr("kind")?.extract()
}

/// True if an array of real numbers is processed in double precision.
pub fn is_double(array: &Bound<'_, PyUntypedArray>, name: &str) -> PyResult<bool> {
    match number_kind(array)? {
        'f' => Ok(array.dtype().getattr("itemsize")?.extract::<usize>()? > 4),
        'i' | 'u' => Ok(true),
        _ => Err(PyTypeError::new_err(format!(
            "{name}: dtype is {}, expected real numbers",
            array.dtype()
        ))),
    }
}

/// True if one of several arguments is processed in double precision. Plain Python sequences do not
/// count beside arrays, as in NumPy.
pub fn are_double(
    arrays: &[(&Bound<'_, PyAny>, &Bound<'_, PyUntypedArray>, &str)],
) -> PyResult<bool> {
    let mut answer = None;
    for (given, array, name) in arrays {
        let double = is_double(array, name)?;
        if !given.is_instance_of::<pyo3::types::PyList>() && !given.is_instance_of::<PyTuple>() {
            answer = Some(answer.unwrap_or(false) || double);
        }
    }
    Ok(answer.unwrap_or(true))
}

/// An array of numbers as a contiguous one; the array itself if it is contiguous already.
pub fn contiguous<'py, T: Element>(
    array: &Bound<'py, PyUntypedArray>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let py = array.py();
    let wanted = match array.cast::<PyArrayDyn<T>>() {
        Ok(same) if same.is_c_contiguous() && is_aligned(same) => same.clone(),
        _ => {
            let options = PyDict::new(py);
            options.set_item("dtype", T::get_dtype(py))?;
            options.set_item("requirements", ["C", "A"])?;
            numpy(py, "require")?.call((array,), Some(&options))?.cast_into::<PyArrayDyn<T>>()?
        }
    };
    Ok(wanted.try_readonly()?)
}

/// True if the numbers lie at multiples of their size.
fn is_aligned<T: Element>(array: &Bound<'_, PyArrayDyn<T>>) -> bool {
    (array.data() as usize).is_multiple_of(align_of::<T>())
}

/// The numbers of a contiguous array.
pub fn slice<'a, T: Element, D: Dimension>(
    array: &'a PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    if array.len() == 0 {
        return Ok(&[]);
    }
    Ok(array.as_slice()?)
}

/// The numbers of a contiguous array, to be written.
pub fn slice_mut<'a, T: Element>(array: &'a mut PyReadwriteArray1<'_, T>) -> PyResult<&'a mut [T]> {
    if array.len() == 0 { Ok(&mut []) } else { Ok(array.as_slice_mut()?) }
}

/// A new uninitialised array, which the caller fills.
pub fn empty<'py, T: Element>(py: Python<'py>, len: usize) -> PyResult<Bound<'py, PyArray1<T>>> {
    Ok(numpy(py, "empty")?.call1((len, T::get_dtype(py)))?.cast_into::<PyArray1<T>>()?)
}

/// A new array that `fill` writes.
pub fn filled<'py, T: Element>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce(&mut [T]) -> PyResult<()>,
) -> PyResult<Bound<'py, PyAny>> {
    let array = empty::<T>(py, shape.iter().product())?;
    fill(slice_mut(&mut array.try_readwrite()?)?)?;
    Ok(array.reshape(shape)?.into_any())
}

/// An array repeated to a shape, made contiguous as by [`contiguous`].
pub fn broadcast<'py, T: Element>(
    array: &Bound<'py, PyUntypedArray>,
    shape: &[usize],
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    if array.shape() == shape {
        return contiguous(array);
    }
    let py = array.py();
    let wide = numpy(py, "broadcast_to")?.call1((array, PyTuple::new(py, shape)?))?;
    contiguous(wide.cast::<PyUntypedArray>()?)
}

/// The shape that arrays of these shapes broadcast to.
pub fn common_shape(a: &[usize], b: &[usize]) -> Option<Vec<usize>> {
    let n = a.len().max(b.len());
    let side = |shape: &[usize], i: usize| (i + shape.len()).checked_sub(n).map_or(1, |i| shape[i]);
    (0..n)
        .map(|i| match (side(a, i), side(b, i)) {
            (x, y) if x == y => Some(x),
            (1, y) => Some(y),
            (x, 1) => Some(x),
            _ => None,
        })
        .collect()
}

/// Formats a shape as Python does.
pub fn shown(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// The index of an element by its number in an array of this shape, as Python writes it.
pub fn index_in(mut number: usize, shape: &[usize]) -> String {
    let mut index: Vec<String> = Vec::with_capacity(shape.len());
    for &side in shape.iter().rev() {
        index.push((number % side.max(1)).to_string());
        number /= side.max(1);
    }
    index.reverse();
    index.join(", ")
}

/// An array of a shape that holds these numbers.
pub fn from_vec<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyArray1::from_vec(py, values).reshape(shape)?.into_any())
}

/// Points: an array of shape `(..., 3)`.
#[derive(Debug)]
pub struct PointArray<'py, P: Precision> {
    /// Three numbers per point.
    pub values: PyReadonlyArrayDyn<'py, P>,
    /// The leading shape.
    pub shape: Vec<usize>,
}

impl<'py, P: Precision> PointArray<'py, P> {
    /// Reads an argument.
    pub fn new(array: &Bound<'py, PyUntypedArray>, name: &str) -> PyResult<Self> {
        let shape = leading(array, 3, name)?;
        Ok(Self { values: contiguous(array)?, shape })
    }
}

/// The leading shape of an array of shape `(..., last)`.
pub fn leading(array: &Bound<'_, PyUntypedArray>, last: usize, name: &str) -> PyResult<Vec<usize>> {
    match array.shape().split_last() {
        Some((&n, rest)) if n == last => Ok(rest.to_vec()),
        // An empty array, as `[]` is.
        Some((0, [])) => Ok(vec![0]),
        _ => Err(PyValueError::new_err(format!(
            "{name}: shape is {}, expected (..., {last})",
            shown(array.shape())
        ))),
    }
}

/// One number for each ray or point, or one for all.
#[derive(Debug)]
pub enum Column<'py, T: Element + Copy> {
    /// One value for all.
    All(T),
    /// One value for each.
    Each(PyReadonlyArrayDyn<'py, T>),
}

impl<'py, T: Element + Copy> Column<'py, T> {
    /// Reads an argument: a number, or an array that broadcasts to `shape`.
    pub fn new(value: &Bound<'py, PyAny>, shape: &[usize], name: &str) -> PyResult<Self>
    where
        T: Precision,
    {
        if !value.is_instance_of::<PyUntypedArray>()
            && let Ok(number) = value.extract::<f64>()
        {
            return Ok(Self::All(T::round(number)));
        }
        let array = array(value, name)?;
        is_double(&array, name)?;
        Self::each(&array, shape, name)
    }

    fn each(array: &Bound<'py, PyUntypedArray>, shape: &[usize], name: &str) -> PyResult<Self> {
        if common_shape(array.shape(), shape).as_deref() != Some(shape) {
            let (found, shape) = (shown(array.shape()), shown(shape));
            return Err(PyValueError::new_err(format!(
                "{name}: shape {found} does not broadcast to {shape}"
            )));
        }
        Ok(Self::Each(broadcast(array, shape)?))
    }

    /// The numbers, to be read by other threads.
    pub fn values(&self) -> PyResult<Values<'_, T>> {
        Ok(match self {
            Self::All(value) => Values::All(*value),
            Self::Each(array) => Values::Each(slice(array)?),
        })
    }
}

/// The numbers of a [`Column`], for other threads.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a, T> {
    /// One value for all.
    All(T),
    /// One value for each.
    Each(&'a [T]),
}

impl<T: Copy> Values<'_, T> {
    /// The number of ray `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> T {
        match self {
            Self::All(value) => *value,
            Self::Each(values) => values[i],
        }
    }
}

/// A mask of 32 bits, one for all or one per ray.
pub fn mask_column<'py>(
    value: Option<&Bound<'py, PyAny>>,
    shape: &[usize],
) -> PyResult<Column<'py, u32>> {
    let Some(value) = value else { return Ok(Column::All(u32::MAX)) };
    if value.is_instance_of::<PyInt>() {
        let mask = value.extract::<u32>().map_err(|_| {
            PyValueError::new_err(format!("mask is {value}, expected 32 bits: 0 to {}", u32::MAX))
        })?;
        return Ok(Column::All(mask));
    }
    let array = array(value, "mask")?;
    check_unsigned(&array, u32::MAX.into(), "mask")?;
    Column::each(&array, shape, "mask")
}

/// Fails unless all elements are whole numbers from 0 to `largest`.
pub fn check_unsigned(array: &Bound<'_, PyUntypedArray>, largest: u64, name: &str) -> PyResult<()> {
    let py = array.py();
    let kind = number_kind(array)?;
    if !matches!(kind, 'i' | 'u') {
        return Err(PyTypeError::new_err(format!(
            "{name}: dtype is {}, expected integers",
            array.dtype()
        )));
    }
    if array.len() == 0 {
        return Ok(());
    }
    let extreme = |which| numpy(py, which)?.call1((array,))?.extract::<i128>();
    if extreme("min")? >= 0 && extreme("max")? <= i128::from(largest) {
        return Ok(());
    }
    let flat = array.call_method0("ravel")?;
    let bad = flat
        .call_method1("__lt__", (0,))?
        .call_method1("__or__", (flat.call_method1("__gt__", (largest,))?,))?;
    let first: usize = bad.call_method0("argmax")?.extract()?;
    let value = flat.get_item(first)?;
    let place = numpy(py, "unravel_index")?.call1((first, array.getattr("shape")?))?;
    let place: Vec<usize> = place.extract()?;
    let place = place.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    Err(PyValueError::new_err(format!(
        "{name}[{place}] is {}, expected 0 to {largest}",
        value.str()?
    )))
}
