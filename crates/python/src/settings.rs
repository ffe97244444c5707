//! The keyword arguments of a render as a request, from which the renderer derives its settings.

use crate::schema::is_flag;
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use snell_oidn::Denoiser;
use snell_render::{Denoise, Problem, Request, RequestError, Wish};

/// Keyword arguments by name.
#[derive(Debug)]
pub struct Keywords<'a, 'py>(pub &'a Bound<'py, PyDict>);

impl<'py> Keywords<'_, 'py> {
    /// The value of a name, if there is one.
    pub fn any(&self, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(self.0.get_item(name)?.filter(|value| !value.is_none()))
    }

    /// The value of a name; `what` describes the expected value in errors.
    pub fn get<T: for<'a> FromPyObject<'a, 'py>>(
        &self,
        name: &str,
        what: &str,
    ) -> PyResult<Option<T>> {
        let Some(value) = self.any(name)? else { return Ok(None) };
        let read = value.extract().map(Some);
        read.map_err(|_| {
            PyTypeError::new_err(format!("{name} is {}, expected {what}", shown(&value)))
        })
    }
}

/// A value in a message: not longer than a line.
pub fn shown(value: &Bound<'_, PyAny>) -> String {
    let text = value
        .repr()
        .map_or_else(|_| "something".into(), |text| text.to_string_lossy().into_owned());
    if text.chars().count() <= 60 {
        text
    } else {
        text.chars().take(57).chain("...".chars()).collect()
    }
}

/// Reads a request from the keyword arguments.
pub fn request(keywords: &Keywords<'_, '_>) -> PyResult<Request> {
    let mut request = Request::default();
    for setting in Request::SETTINGS {
        let Some(value) = keywords.any(setting.name)? else { continue };
        let refused = |text: &str| format!("{} is {}, {text}", setting.name, shown(&value));
        let problem = match wish(&value) {
            Some(wish) => setting.set(&mut request, &wish).err(),
            None => Some(Problem::Kind(format!("expected {}", setting.python))),
        };
        match problem {
            None => {}
            Some(Problem::Kind(text)) => return Err(PyTypeError::new_err(refused(&text))),
            Some(Problem::Value(text)) => return Err(PyValueError::new_err(refused(&text))),
        }
    }
    Ok(request)
}

/// Converts a Python value to the value of a setting; `None` if no setting has its type.
fn wish(value: &Bound<'_, PyAny>) -> Option<Wish> {
    if is_flag(value).unwrap_or(false) {
        return value.is_truthy().ok().map(Wish::Flag);
    }
    if let Ok(text) = value.extract() {
        return Some(Wish::Text(text));
    }
    if value.hasattr("__fspath__").unwrap_or(false) {
        return value.extract().ok().map(Wish::Path);
    }
    if let Ok(whole) = value.extract() {
        return Some(Wish::Whole(whole));
    }
    if let Ok(number) = value.extract() {
        return Some(Wish::Number(number));
    }
    if let Ok(named) = value.cast::<PyDict>() {
        let entry = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            Some((name.extract().ok()?, wish(&value).or_else(|| as_text(&value))?))
        };
        return named.iter().map(entry).collect::<Option<_>>().map(Wish::Named);
    }
    let items = value.try_iter().ok()?;
    let item = |item: PyResult<Bound<'_, PyAny>>| {
        let item = item.ok()?;
        wish(&item).or_else(|| as_text(&item))
    };
    items.map(item).collect::<Option<_>>().map(Wish::List)
}

/// Converts a value, such as a path, to text.
fn as_text(value: &Bound<'_, PyAny>) -> Option<Wish> {
    Some(Wish::Text(value.str().ok()?.to_string_lossy().into_owned()))
}

/// The settings of a render in the order of the reference page, with `doc`, `default`, `choices`,
/// `type` and `heading` of each. The Python function `render` takes its keywords and their
/// documentation from here.
#[pyfunction]
pub fn _render_settings(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let settings = PyDict::new(py);
    for setting in Request::SETTINGS {
        let about = PyDict::new(py);
        about.set_item("summary", setting.summary())?;
        about.set_item("details", setting.details())?;
        about.set_item("default", (setting.default)())?;
        about.set_item("choices", (setting.choices)())?;
        about.set_item("type", setting.python)?;
        settings.set_item(setting.name, about)?;
    }
    Ok(settings)
}

/// The error for a request that cannot be fulfilled, with the parameters as Python spells them.
pub fn request_error(error: RequestError) -> PyErr {
    PyValueError::new_err(match error {
        RequestError::TooManyPixels { .. } => {
            format!("size: {error}; render parts of it with crop")
        }
        _ => error.to_string(),
    })
}

/// Loads Open Image Denoise, if the request asks for denoising.
pub fn denoiser(request: &Request) -> PyResult<Option<Denoiser>> {
    let path = match &request.denoise {
        None => return Ok(None),
        Some(Denoise::Found) => None,
        Some(Denoise::At(path)) => Some(path.as_path()),
    };
    Denoiser::load(path).map(Some).map_err(denoise_error)
}

/// The error for a failed denoising. The library's message names the command's option, which is
/// replaced by the keyword.
pub fn denoise_error(error: snell_oidn::DenoiseError) -> PyErr {
    PyRuntimeError::new_err(error.to_string().replace("--denoise", "denoise"))
}
