//! The class `Medium`.

use crate::declare::Family;
use crate::said::{Declared, Said};
use crate::tree::Tree;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use snell_scene::medium::Medium as Value;

/// What light meets between surfaces: fog, smoke, milk. It fills the inside of a closed surface, as the `interior` of its material, or all of the
/// scene, as :attr:`Scene.medium`.
///
/// Parameters
/// ----------
/// kind : str
///     One of :data:`MEDIA`, such as `"homogeneous"`.
/// **parameters
///     Those of the kind. Coefficients are per unit of length of the scene.
///
/// Examples
/// --------
/// >>> import snell
/// >>> milk = snell.Medium("homogeneous", sigma_a=0.1, sigma_s=(5, 5, 4.8), emission=0, g=0)
/// >>> glass = snell.Material("dielectric", ior=1.5, roughness=0, tint=1, absorption=0, interior=milk)
#[pyclass(frozen, module = "snell")]
pub struct Medium(pub Said<Value>);

impl Declared for Value {
    fn family() -> Family {
        // Those that can be said wholly.
        let is_whole = |example: &Value| {
            let again = serde_json::to_string(example).and_then(|json| serde_json::from_str::<Value>(&json));
            again.is_ok_and(|again| again == *example)
        };
        let examples = Self::examples().into_iter().filter(is_whole);
        Family {
            name: "medium",
            tag: "medium",
            examples: examples.filter_map(|example| Tree::of(&example).ok()).collect(),
        }
    }

    fn common() -> PyResult<Vec<(String, Tree)>> {
        Ok(Vec::new())
    }

    fn assemble(kind: Vec<(String, Tree)>, _: Vec<(String, Tree)>) -> Vec<(String, Tree)> {
        kind
    }

    fn apart(tree: Tree) -> (Vec<(String, Tree)>, Vec<(String, Tree)>) {
        match tree {
            Tree::Fields(kind) => (kind, Vec::new()),
            _ => Default::default(),
        }
    }
}

#[pymethods]
impl Medium {
    #[new]
    #[pyo3(signature = (kind, /, **parameters))]
    fn new(kind: &str, parameters: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        Said::new(kind, parameters).map(Self)
    }

    /// Which kind, one of :data:`MEDIA`.
    #[getter]
    fn kind(&self) -> PyResult<String> {
        self.0.kind()
    }

    /// All parameters by name. Each is an attribute, too.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.0.parameters(py)
    }

    /// The same medium but for some parameters.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> fog = snell.Medium("homogeneous", sigma_a=0, sigma_s=0.1, emission=0, g=0)
    /// >>> fog.replace(g=0.5).g
    /// 0.5
    #[pyo3(signature = (**changes))]
    fn replace(&self, py: Python<'_>, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        self.0.replace(py, changes).map(Self)
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        self.0.attribute(py, "Medium", name)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.0.shown(py, "Medium")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let restore = py.import("snell._snell")?.getattr("_restore_medium")?;
        let json = serde_json::to_string(&self.0.value).map_err(|e| PyValueError::new_err(e.to_string()))?;
        Ok((restore, (json,).into_pyobject(py)?))
    }
}

/// Makes a medium from what was stored.
#[pyfunction]
pub fn _restore_medium(json: &str) -> PyResult<Medium> {
    Said::restored(json, Vec::new(), "[]").map(Medium)
}
