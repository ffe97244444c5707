//! The class `Light`.

use crate::declared::{Schema, declared_class};
use crate::value::Value;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

declared_class! {
    /// A light that is not a surface. (A surface emits if its material has an `emission`.)
    ///
    /// Parameters
    /// ----------
    /// kind : str
    ///     One of :data:`LIGHTS`, such as `"point"` or `"directional"`.
    /// **parameters
    ///     The parameters of the kind, in coordinates of the scene. Directions have any length.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> lamp = snell.Light("point", position=(0, 3, 0), intensity=40)
    /// >>> lamp.intensity
    /// (40.0, 40.0, 40.0)
    /// >>> snell.Light("point", positoin=(0, 3, 0))
    /// Traceback (most recent call last):
    /// TypeError: point has no parameter "positoin"; did you mean "position"?
    Light of snell_scene::Light, restored by _restore_light;

    /// A copy of the light with some parameters changed.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> sun = snell.Light("directional", direction=(0, -2, 0), irradiance=3)
    /// >>> sun.replace(irradiance="#ffffff").direction
    /// (0.0, -1.0, 0.0)
    replace
}

impl Schema for snell_scene::Light {
    const FAMILY: &'static str = "light";

    fn settle(self) -> PyResult<Self> {
        let Value::Fields(mut fields) = Value::of(&self).map_err(PyTypeError::new_err)? else {
            return Ok(self);
        };
        for name in self.directions() {
            for (key, value) in fields.iter_mut().filter(|(key, _)| key == name) {
                *value = unit(value, key)?;
            }
        }
        serde_json::from_value(Value::Fields(fields).json(&mut |_, id| id))
            .map_err(|e| PyValueError::new_err(e.to_string()))
    }
}

/// Scales a direction, or each of several, to unit length.
fn unit(value: &Value, name: &str) -> PyResult<Value> {
    let Value::List(items) = value else { return Ok(value.clone()) };
    let numbers: Option<Vec<f64>> = items
        .iter()
        .map(|item| if let Value::Double(x) = item { Some(*x) } else { None })
        .collect();
    let Some(numbers) = numbers else {
        return Ok(Value::List(
            items.iter().map(|item| unit(item, name)).collect::<PyResult<_>>()?,
        ));
    };
    let length = numbers.iter().map(|x| x * x).sum::<f64>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return Err(PyValueError::new_err(format!(
            "{name} is {numbers:?}, expected a direction that is not 0"
        )));
    }
    // Unit vectors are not changed.
    let scale = if (length - 1.0).abs() < 1e-12 { 1.0 } else { 1.0 / length };
    Ok(Value::List(numbers.into_iter().map(|x| Value::Double(x * scale)).collect()))
}
