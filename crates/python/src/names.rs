//! Names of things, names from a list, and errors for unknown names.

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;

/// The argument `name` if it is given: a text.
#[derive(Clone, Debug)]
pub struct Name(pub String);

impl<'a, 'py> FromPyObject<'a, 'py> for Name {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let Ok(text) = value.cast::<PyString>() else {
            let found = crate::settings::shown(&value);
            return Err(PyTypeError::new_err(format!(
                "name is {found}, expected a text, such as {:?}",
                "left wheel"
            )));
        };
        Ok(Self(text.to_str()?.to_string()))
    }
}

/// The element of `all` whose name is `wanted`. Otherwise an error suggests the nearest name.
pub fn choice<T: Copy>(
    argument: &str,
    wanted: &str,
    all: &[T],
    name_of: impl Fn(T) -> &'static str,
) -> PyResult<T> {
    if let Some(&found) = all.iter().find(|&&thing| name_of(thing) == wanted) {
        return Ok(found);
    }
    let names: Vec<_> = all.iter().map(|&thing| name_of(thing)).collect();
    Err(PyValueError::new_err(format!("{argument} is {wanted:?}{}", suggestion(wanted, &names))))
}

/// The end of a message about an unknown name: the closest of the known names, or all of them if
/// none is close.
pub fn suggestion(name: &str, known: &[&str]) -> String {
    let far = |known: &str| match name.is_empty()
        || !(known.starts_with(name) || name.starts_with(known))
    {
        true => distance(name, known),
        false => 1,
    };
    let nearest =
        known.iter().filter(|known| !known.is_empty()).map(|known| (far(known), *known)).min();
    match nearest {
        Some((far, nearest)) if far <= name.chars().count().div_ceil(3).max(1) => {
            format!("; did you mean {nearest:?}?")
        }
        Some(_) if known.len() == 1 => format!("; there is only {:?}", known[0]),
        Some(_) => format!("; there are {}", known.join(", ")),
        None => "; there is none".into(),
    }
}

/// Number of insertions, deletions and replacements between two words (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
