//! What the classes of declared things have in common: a kind, its parameters, and the textures they refer to.

use crate::declare::{Family, References, make, read_all, show};
use crate::texture::AnyTexture;
use crate::tree::Tree;
use pyo3::exceptions::{PyAttributeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A declared value, as it was said in Python.
#[derive(Debug)]
pub struct Said<T> {
    /// The value; its textures are those of `references`.
    pub value: T,
    /// What it refers to.
    pub references: References,
}

/// A thing with a kind, whose parameters lie around.
pub trait Declared: Serialize + DeserializeOwned + Clone {
    /// Its family.
    fn family() -> Family;

    /// What it has whatever its kind; as an example.
    fn common() -> PyResult<Vec<(String, Tree)>> {
        Ok(Vec::new())
    }

    /// From the fields of the kind, the tag among them, and the common ones.
    fn assemble(kind: Vec<(String, Tree)>, _common: Vec<(String, Tree)>) -> Vec<(String, Tree)> {
        kind
    }

    /// The same, the other way: the fields of the kind and the common ones.
    fn apart(tree: Tree) -> (Vec<(String, Tree)>, Vec<(String, Tree)>) {
        match tree {
            Tree::Fields(kind) => (kind, Vec::new()),
            _ => Default::default(),
        }
    }

    /// Puts in order what may be said in several ways, such as the length of a direction.
    fn settle(self) -> PyResult<Self> {
        Ok(self)
    }
}

impl<T: Declared> Said<T> {
    /// A thing of this kind with these parameters.
    pub fn new(kind: &str, given: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let family = T::family();
        let (parameters, common) = (family.parameters(kind)?, T::common()?);
        let mut references = References::default();
        let known = Self::known(kind)?;
        let given = match given {
            Some(given) => read_all(kind, &known, given, &mut references)?,
            None => Vec::new(),
        };
        let mut all = common;
        let mut own = Vec::new();
        for (key, value) in given {
            let is_own = parameters.iter().any(|(known, _)| *known == key);
            match all.iter_mut().find(|(known, _)| *known == key) {
                Some((_, place)) if !is_own => *place = value,
                _ => own.push((key, value)),
            }
        }
        let tag = (family.tag.to_string(), Tree::Text(kind.to_string()));
        let whole =
            |own: Vec<_>| Tree::Fields(T::assemble(std::iter::once(tag.clone()).chain(own).collect(), all.clone()));
        let value: T = make(kind, &own, &parameters, whole)?;
        Ok(Self { value: value.settle()?, references })
    }

    fn fields(&self) -> PyResult<(Vec<(String, Tree)>, Vec<(String, Tree)>)> {
        Ok(T::apart(Tree::of(&self.value).map_err(PyTypeError::new_err)?))
    }

    /// The name of the kind.
    pub fn kind(&self) -> PyResult<String> {
        let tag = T::family().tag;
        let (kind, _) = self.fields()?;
        match kind.into_iter().find(|(key, _)| key == tag) {
            Some((_, Tree::Text(kind))) => Ok(kind),
            _ => Ok(String::new()),
        }
    }

    /// All parameters by name.
    pub fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let tag = T::family().tag;
        let (kind, common) = self.fields()?;
        let all = PyDict::new(py);
        for (key, value) in kind.iter().chain(&common).filter(|(key, _)| key != tag) {
            all.set_item(key, show(py, value, &self.references)?)?;
        }
        Ok(all)
    }

    /// One parameter.
    pub fn attribute<'py>(&self, py: Python<'py>, class: &str, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let found = self.parameters(py)?.get_item(name)?;
        found.ok_or_else(|| PyAttributeError::new_err(format!("a {class} of this kind has no {name:?}")))
    }

    /// The same but for some parameters.
    pub fn replace(&self, py: Python<'_>, changes: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let all = self.parameters(py)?;
        if let Some(changes) = changes {
            let known = Self::known(&self.kind()?)?;
            read_all(&self.kind()?, &known, changes, &mut References::default())?;
            all.update(changes.as_mapping())?;
        }
        Self::new(&self.kind()?, Some(&all))
    }

    /// What parameters may look like.
    fn known(kind: &str) -> PyResult<Vec<(String, Tree)>> {
        Ok(T::family().forms(kind)?.into_iter().chain(T::common()?).collect())
    }

    /// As one would write it.
    pub fn shown(&self, py: Python<'_>, class: &str) -> PyResult<String> {
        let mut text = format!("{class}({:?}", self.kind()?);
        let tag = T::family().tag;
        let (kind, common) = self.fields()?;
        let usual = T::common()?;
        let is_usual = |field: &&(String, Tree)| !usual.contains(field);
        for (key, value) in kind.iter().filter(|(key, _)| key != tag).chain(common.iter().filter(is_usual)) {
            text += &format!(", {key}={}", show(py, value, &self.references)?.repr()?);
        }
        Ok(text + ")")
    }

    /// What pickles: JSON, of media too, and textures.
    pub fn stored(&self, py: Python<'_>) -> PyResult<(String, Vec<AnyTexture>, String)> {
        let error = |e: serde_json::Error| PyValueError::new_err(e.to_string());
        let json = serde_json::to_string(&self.value).map_err(error)?;
        let media = serde_json::to_string(&self.references.media).map_err(error)?;
        Ok((json, self.references.textures.iter().map(|texture| texture.clone_ref(py)).collect(), media))
    }

    /// From what was stored.
    pub fn restored(json: &str, textures: Vec<AnyTexture>, media: &str) -> PyResult<Self> {
        let error = |e: serde_json::Error| PyValueError::new_err(e.to_string());
        let value = serde_json::from_str(json).map_err(error)?;
        let media = serde_json::from_str(media).map_err(error)?;
        Ok(Self { value, references: References { textures, media } })
    }
}

/// Declares the class of a family of declared things, and the function that makes one from what was stored.
macro_rules! declared_class {
    ($(#[doc = $doc:expr])* $class:ident of $value:ty, restored by $restore:ident; $(#[doc = $about:expr])* replace) => {
        $(#[doc = $doc])*
        #[pyclass(frozen, module = "snell")]
        pub struct $class(pub $crate::said::Said<$value>);

        #[pymethods]
        impl $class {
            #[new]
            #[pyo3(signature = (kind, /, **parameters))]
            fn new(kind: &str, parameters: Option<&Bound<'_, pyo3::types::PyDict>>) -> PyResult<Self> {
                $crate::said::Said::new(kind, parameters).map(Self)
            }

            /// Which kind of its family it is, by name.
            #[getter]
            fn kind(&self) -> PyResult<String> {
                self.0.kind()
            }

            /// All parameters by name. Each is an attribute, too.
            #[getter]
            fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyDict>> {
                self.0.parameters(py)
            }

            $(#[doc = $about])*
            #[pyo3(signature = (**changes))]
            fn replace(&self, py: Python<'_>, changes: Option<&Bound<'_, pyo3::types::PyDict>>) -> PyResult<Self> {
                self.0.replace(py, changes).map(Self)
            }

            fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
                self.0.attribute(py, stringify!($class), name)
            }

            fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
                self.0.shown(py, stringify!($class))
            }

            fn __reduce__<'py>(
                &self,
                py: Python<'py>,
            ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, pyo3::types::PyTuple>)> {
                let restore = py.import("snell._snell")?.getattr(stringify!($restore))?;
                Ok((restore, self.0.stored(py)?.into_pyobject(py)?))
            }
        }

        /// Makes one from what was stored.
        #[pyfunction]
        pub fn $restore(json: &str, textures: Vec<$crate::texture::AnyTexture>, media: &str) -> PyResult<$class> {
            $crate::said::Said::restored(json, textures, media).map($class)
        }
    };
}

pub(crate) use declared_class;
