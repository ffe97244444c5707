//! What the classes of declared things have in common: a kind, its parameters, and the textures
//! they refer to.

use crate::declare::{Family, References, make, read_all, show};
use crate::medium::Medium;
use crate::texture::AnyTexture;
use crate::tree::Tree;
use pyo3::exceptions::{PyAttributeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;
use snell_scene::medium::Medium as Value;

/// A declared value, as it was said in Python.
#[derive(Debug)]
pub struct Said<T> {
    /// The value; its textures are those of `references`.
    pub value: T,
    /// What it refers to.
    pub references: References,
}

/// A thing with a kind, whose parameters lie around.
pub trait Declared: Serialize + DeserializeOwned + Clone + snell_math::parameters::Value {
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

    /// Parameters of a kind that are arrays, or said by arrays, and so are not in the declaration.
    fn arrays(_kind: &str) -> &'static [&'static str] {
        &[]
    }

    /// Takes one of [`Self::arrays`], which is not None.
    fn set_array(&mut self, name: &str, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        Err(PyTypeError::new_err(format!("there is no array {name:?}")))
    }

    /// True for an array that is not kept as such.
    fn is_only_said(_name: &str) -> bool {
        false
    }

    /// One of [`Self::arrays`], if it is there.
    fn array<'py>(&self, _py: Python<'py>, _name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(None)
    }

    /// Refuses what lacks something.
    fn complete(self) -> PyResult<Self> {
        Ok(self)
    }

    /// Puts in order what may be said in several ways, such as the length of a direction.
    fn settle(self) -> PyResult<Self> {
        Ok(self)
    }
}

impl<T: Declared> Said<T> {
    /// A thing of this kind with these parameters.
    fn new<'py>(py: Python<'py>, kind: &str, given: Option<&Bound<'py, PyDict>>) -> PyResult<Self> {
        let family = T::family();
        let (parameters, common) = (family.parameters(kind)?, T::common()?);
        let mut references = References::default();
        let known = Self::known(kind)?;
        let (declared, arrays) = Self::sorted(py, kind, given)?;
        let given = read_all(kind, &known, &declared, &mut references)?;
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
        let whole = |own: Vec<_>| {
            Tree::Fields(T::assemble(
                std::iter::once(tag.clone()).chain(own).collect(),
                all.clone(),
            ))
        };
        let value: T = make(kind, &own, &parameters, whole)?;
        let mut value = value.settle()?;
        for (name, array) in arrays.into_iter().filter(|(_, array)| !array.is_none()) {
            value.set_array(name, &array)?;
        }
        Ok(Self { value: value.complete()?, references })
    }

    /// Parameters that are declared, and those that are arrays.
    fn sorted<'py>(
        py: Python<'py>,
        kind: &str,
        given: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Sorted<'py>> {
        let (declared, mut arrays) = (PyDict::new(py), Vec::new());
        for (key, value) in given.into_iter().flatten() {
            match T::arrays(kind).iter().find(|name| key.eq(**name).unwrap_or(false)) {
                Some(name) => arrays.push((*name, value)),
                None => declared.set_item(key, value)?,
            }
        }
        Ok((declared, arrays))
    }

    /// Refuses numbers of these parameters that mean nothing. (Those of files are told and kept.)
    fn check(self, kind: &str, given: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        for key in given.into_iter().flatten().map(|(key, _)| key) {
            let key: String = key.extract()?;
            if let Some(problem) = snell_scene::problem_at(&self.value, &[&key]) {
                return Err(PyValueError::new_err(format!("{kind}: {problem}")));
            }
        }
        Ok(self)
    }

    /// A thing of this kind with these parameters, whose numbers have to mean something.
    pub fn checked<'py>(
        py: Python<'py>,
        kind: &str,
        given: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Self> {
        Self::new(py, kind, given)?.check(kind, given)
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
        for name in T::arrays(&self.kind()?) {
            match self.value.array(py, name)? {
                Some(array) => all.set_item(name, array)?,
                // What another one says.
                None if T::is_only_said(name) => {}
                None => all.set_item(name, py.None())?,
            }
        }
        Ok(all)
    }

    /// One parameter.
    pub fn attribute<'py>(
        &self,
        py: Python<'py>,
        class: &str,
        name: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        let found = self.parameters(py)?.get_item(name)?;
        found.ok_or_else(|| {
            PyAttributeError::new_err(format!("a {class} of this kind has no {name:?}"))
        })
    }

    /// The same but for some parameters.
    pub fn replace<'py>(
        &self,
        py: Python<'py>,
        changes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Self> {
        let all = self.parameters(py)?;
        if let Some(changes) = changes {
            let kind = self.kind()?;
            let known = Self::known(&kind)?;
            let (declared, _) = Self::sorted(py, &kind, Some(changes))?;
            read_all(&kind, &known, &declared, &mut References::default())?;
            all.update(changes.as_mapping())?;
        }
        Self::new(py, &self.kind()?, Some(&all))?.check(&self.kind()?, changes)
    }

    /// What parameters may look like; arrays look like nothing.
    fn known(kind: &str) -> PyResult<Vec<(String, Tree)>> {
        let arrays = T::arrays(kind).iter().map(|name| (name.to_string(), Tree::Nothing));
        let declared = T::family()
            .forms(kind)?
            .into_iter()
            .filter(|(name, _)| !T::arrays(kind).contains(&name.as_str()));
        Ok(declared.chain(T::common()?).chain(arrays).collect())
    }

    /// As one would write it.
    pub fn shown(&self, py: Python<'_>, class: &str) -> PyResult<String> {
        let mut text = format!("{class}({:?}", self.kind()?);
        let tag = T::family().tag;
        let (kind, common) = self.fields()?;
        let usual = T::common()?;
        let is_usual = |field: &&(String, Tree)| !usual.contains(field);
        let arrays = T::arrays(&self.kind()?);
        let is_array = |field: &&(String, Tree)| arrays.contains(&field.0.as_str());
        let kind = kind.iter().filter(|field| field.0 != tag && !is_array(field));
        for (key, value) in kind.chain(common.iter().filter(is_usual)) {
            text += &format!(", {key}={}", show(py, value, &self.references)?.repr()?);
        }
        for name in arrays {
            if let Some(array) = self.value.array(py, name)? {
                let shape: Vec<usize> = array.getattr("shape")?.extract()?;
                text += &match shape[..] {
                    [4, 4] => format!(", {name}={}", array.call_method0("tolist")?.repr()?),
                    _ => format!(", {name}=<array {}>", crate::arrays::shown(&shape)),
                };
            }
        }
        Ok(text + ")")
    }

    /// What pickles: JSON, textures, media, and arrays by name.
    pub fn stored<'py>(&self, py: Python<'py>) -> PyResult<Stored<'py>> {
        let error = |e: serde_json::Error| PyValueError::new_err(e.to_string());
        let json = serde_json::to_string(&self.value).map_err(error)?;
        let textures =
            self.references.textures.iter().map(|texture| texture.clone_ref(py)).collect();
        let of = |medium: &Value| {
            Py::new(py, Medium(Said { value: medium.clone(), references: References::default() }))
        };
        let media = self.references.media.iter().map(of).collect::<PyResult<_>>()?;
        let arrays = PyDict::new(py);
        for name in T::arrays(&self.kind()?) {
            if let Some(array) = self.value.array(py, name)? {
                arrays.set_item(name, array)?;
            }
        }
        Ok((json, textures, media, arrays))
    }

    /// From what was stored.
    pub fn restored(stored: Stored<'_>) -> PyResult<Self> {
        let (json, textures, media, arrays) = stored;
        let mut value: T =
            serde_json::from_str(&json).map_err(|e| PyValueError::new_err(e.to_string()))?;
        for (name, array) in arrays {
            value.set_array(&name.extract::<String>()?, &array)?;
        }
        let media = media.iter().map(|medium| medium.get().0.value.clone()).collect();
        Ok(Self { value, references: References { textures, media } })
    }
}

/// Parameters as they were given: those that are declared, and arrays by name.
type Sorted<'py> = (Bound<'py, PyDict>, Vec<(&'static str, Bound<'py, PyAny>)>);

/// What is stored of a declared value.
pub type Stored<'py> = (String, Vec<AnyTexture>, Vec<Py<Medium>>, Bound<'py, PyDict>);

/// Declares the class of a family of declared things, and the function that makes one from what was
/// stored.
macro_rules! declared_class {
    ($(#[doc = $doc:expr])* $class:ident of $value:ty, restored by $restore:ident; $(#[doc = $about:expr])* replace) => {
        $(#[doc = $doc])*
        #[pyclass(frozen, module = "snell")]
        pub struct $class(pub $crate::said::Said<$value>);

        #[pymethods]
        impl $class {
            #[new]
            #[pyo3(signature = (kind, /, **parameters))]
            fn new<'py>(
                py: Python<'py>,
                kind: &str,
                parameters: Option<&Bound<'py, pyo3::types::PyDict>>,
            ) -> PyResult<Self> {
                $crate::said::Said::checked(py, kind, parameters).map(Self)
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
            fn replace<'py>(
                &self,
                py: Python<'py>,
                changes: Option<&Bound<'py, pyo3::types::PyDict>>,
            ) -> PyResult<Self> {
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
        pub fn $restore(
            json: String,
            textures: Vec<$crate::texture::AnyTexture>,
            media: Vec<Py<$crate::medium::Medium>>,
            arrays: Bound<'_, pyo3::types::PyDict>,
        ) -> PyResult<$class> {
            $crate::said::Said::restored((json, textures, media, arrays)).map($class)
        }
    };
}

pub(crate) use declared_class;
