//! The class `Material`.

use crate::declare::Family;
use crate::said::{Declared, Said};
use crate::texture::Texture;
use crate::tree::Tree;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use snell_scene::Material as Value;
use snell_scene::material::MaterialKind;

/// What light does at a surface.
///
/// A colour is a number (grey), three numbers (linear Rec. 709), `"#rrggbb"` (sRGB) or a :class:`Texture`; a number may be a channel of a texture. A
/// dictionary says both: `{"factor": 0.5, "texture": texture}`. :data:`MATERIALS` lists the kinds and their parameters.
///
/// Parameters
/// ----------
/// kind : str
///     Such as `"diffuse"` or `"metallic-roughness"`.
/// **parameters
///     Those of the kind, and of all kinds: `name`, `emission` (radiance, W / (m^2 sr)), `alpha`, `alpha_mode` (`"opaque"`, `"blend"` or
///     `{"mask": cutoff}`), `double_sided`, `normal_map` (a texture) and others.
///
/// Examples
/// --------
/// >>> import snell
/// >>> red = snell.Material("diffuse", reflectance=(0.8, 0.1, 0.1))
/// >>> red
/// Material("diffuse", reflectance=(0.8, 0.1, 0.1))
/// >>> red.replace(emission=2).emission
/// (2.0, 2.0, 2.0)
/// >>> snell.Material("difuse")
/// Traceback (most recent call last):
/// ValueError: there is no material "difuse"; did you mean "diffuse"?
#[pyclass(frozen, module = "snell")]
pub struct Material(pub Said<Value>);

impl Declared for Value {
    fn family() -> Family {
        let examples = MaterialKind::examples();
        let examples = examples.iter().filter_map(|example| Tree::of(example).ok()).collect();
        Family { name: "material", tag: "material", examples }
    }

    fn common() -> PyResult<Vec<(String, Tree)>> {
        let bare = Self::new("", snell_scene::material::Diffuse::new(snell_math::Rgb::WHITE));
        let (_, common) = Self::apart(Tree::of(&bare).map_err(PyTypeError::new_err)?);
        Ok(common)
    }

    fn assemble(kind: Vec<(String, Tree)>, mut common: Vec<(String, Tree)>) -> Vec<(String, Tree)> {
        common.push(("kind".into(), Tree::Fields(kind)));
        common
    }

    fn apart(tree: Tree) -> (Vec<(String, Tree)>, Vec<(String, Tree)>) {
        let Tree::Fields(mut common) = tree else { return Default::default() };
        let place = common.iter().position(|(key, _)| key == "kind");
        match place.map(|at| common.remove(at)) {
            Some((_, Tree::Fields(kind))) => (kind, common),
            _ => (Vec::new(), common),
        }
    }
}

#[pymethods]
impl Material {
    #[new]
    #[pyo3(signature = (kind, /, **parameters))]
    fn new(kind: &str, parameters: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        Said::new(kind, parameters).map(Self)
    }

    /// Which kind, one of :data:`MATERIALS`.
    #[getter]
    fn kind(&self) -> PyResult<String> {
        self.0.kind()
    }

    /// All parameters by name. Each is an attribute, too.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.0.parameters(py)
    }

    /// The same material but for some parameters.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> gold = snell.Material("metallic-roughness", base_color=(1, 0.77, 0.34), metallic=1)
    /// >>> gold.replace(roughness=0.5).roughness
    /// 0.5
    #[pyo3(signature = (**changes))]
    fn replace(&self, py: Python<'_>, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        self.0.replace(py, changes).map(Self)
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        self.0.attribute(py, "Material", name)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.0.shown(py, "Material")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let restore = py.import("snell._snell")?.getattr("_restore_material")?;
        Ok((restore, self.0.stored(py)?.into_pyobject(py)?))
    }
}

/// Makes a material from what was stored.
#[pyfunction]
pub fn _restore_material(json: &str, textures: Vec<Py<Texture>>, media: &str) -> PyResult<Material> {
    Said::restored(json, textures, media).map(Material)
}
