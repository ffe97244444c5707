//! Colours given as integers, as most programs have them: 8-bit or 16-bit sRGB.

use crate::arrays::numpy;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use snell_math::spectrum::srgb_to_linear;
use std::ffi::CString;

/// The level of full light of an array of sRGB integers (255 for `uint8`, 65535 for `uint16`);
/// `None` for linear numbers. Other integers than 0 and 1 are refused, because they may mean
/// either.
pub fn levels(array: &Bound<'_, PyUntypedArray>, name: &str) -> PyResult<Option<f32>> {
    let kind: char = array.dtype().getattr("kind")?.extract()?;
    let size: usize = array.dtype().getattr("itemsize")?.extract()?;
    match (kind, size) {
        ('u', 1) => Ok(Some(255.0)),
        ('u', 2) => Ok(Some(65535.0)),
        ('i' | 'u', _) if array.len() > 0 => {
            let extreme = |which| numpy(array.py(), which)?.call1((array,))?.extract::<i128>();
            let (low, high) = (extreme("min")?, extreme("max")?);
            if low >= 0 && high <= 1 {
                return Ok(None);
            }
            Err(PyValueError::new_err(format!(
                "{name}: dtype is {}, from {low} to {high}; expected uint8 (sRGB, 0 to 255), \
                    uint16 or floats (linear, 0 to 1)",
                array.dtype()
            )))
        }
        _ => Ok(None),
    }
}

/// A colour of sRGB integers, with alpha, as linear numbers from 0 to 1.
pub fn linear(color: [f32; 4], levels: f32) -> [f32; 4] {
    let [r, g, b, a] = color.map(|x| x / levels);
    [srgb_to_linear(r), srgb_to_linear(g), srgb_to_linear(b), a]
}

/// How 8-bit values are given in arrays.
pub const AS_UINT8: &str = "8-bit sRGB is given as uint8";

/// Warns of floats that are 8-bit values: whole numbers up to 255. `remedy` says how these are
/// given.
pub fn warn_of_bytes(py: Python<'_>, values: &[f32], name: &str, remedy: &str) -> PyResult<()> {
    let most = values.iter().copied().fold(0.0f32, f32::max);
    let is_like_bytes =
        (3.0..=255.0).contains(&most) && values.iter().all(|x| *x >= 0.0 && x.fract() == 0.0);
    if !is_like_bytes {
        return Ok(());
    }
    warn(
        py,
        format!("{name}: whole numbers up to {most}, which are linear light far above 1; {remedy}"),
    )
}

/// Gives a `UserWarning`.
pub fn warn(py: Python<'_>, message: String) -> PyResult<()> {
    let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &message, 1)
}
