//! Common code of the classes whose parameters are declared (materials, lights, media, patterns): a
//! kind, its parameters, and the textures and media that they refer to.

use crate::medium::Medium;
use crate::schema::{References, arrays, family, kind_of, make, read_all, show};
use crate::texture::AnyTexture;
use crate::value::Value;
use pyo3::exceptions::{PyAttributeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json};
use snell_math::parameters::{self, Declaration, Kind, Parameter};

/// A value with declared parameters, and the objects that it refers to.
#[derive(Debug)]
pub struct Declared<T> {
    /// The value. Ids of textures and media in it are indices into `references`.
    pub value: T,
    /// The textures and media that the value refers to.
    pub references: References,
}

/// Values by name.
type Fields = Vec<(String, Value)>;

/// How a family, such as materials, lays out its parameters.
pub trait Schema: Serialize + DeserializeOwned + Clone + parameters::Value {
    /// The name of the family.
    const FAMILY: &'static str;

    /// The defaults of the parameters common to all kinds.
    fn common() -> PyResult<Fields> {
        Ok(Vec::new())
    }

    /// Joins the fields of the kind, including its tag, and the common fields.
    fn assemble(kind: Map<String, Json>, _common: Map<String, Json>) -> Json {
        Json::Object(kind)
    }

    /// Splits a value into the fields of its kind and the common fields.
    fn apart(value: Value) -> (Fields, Fields) {
        match value {
            Value::Fields(kind) => (kind, Vec::new()),
            _ => Default::default(),
        }
    }

    /// Sets the array parameter `name` to a value that is not None.
    fn set_array(&mut self, name: &str, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        Err(PyTypeError::new_err(format!("there is no array {name:?}")))
    }

    /// True for the name of an array that sets another parameter and is not kept itself.
    fn is_shorthand(_name: &str) -> bool {
        false
    }

    /// The array parameter `name`, if present.
    fn array<'py>(&self, _py: Python<'py>, _name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(None)
    }

    /// Fails if a required parameter is missing.
    fn complete(self) -> PyResult<Self> {
        Ok(self)
    }

    /// Normalises parameters that may be given in several ways, such as the length of a direction.
    fn settle(self) -> PyResult<Self> {
        Ok(self)
    }
}

impl<T: Schema> Declared<T> {
    /// The declaration of a kind.
    fn declaration(kind: &str) -> PyResult<&'static Declaration> {
        kind_of(family(T::FAMILY)?, kind)
    }

    /// The parameters that a kind takes.
    fn known(kind: &Declaration) -> PyResult<Vec<Parameter>> {
        let common = family(T::FAMILY)?
            .common
            .iter()
            .filter(|p| !matches!(p.kind, Kind::OneOf(tag, _) if tag == T::FAMILY));
        Ok(kind.fields().iter().chain(common).copied().collect())
    }

    /// A value of this kind with the parameters `given`.
    fn new<'py>(py: Python<'py>, kind: &str, given: Option<&Bound<'py, PyDict>>) -> PyResult<Self> {
        let (family, declaration) = (family(T::FAMILY)?, Self::declaration(kind)?);
        let mut references = References::default();
        let known = Self::known(declaration)?;
        let (declared, arrays) = Self::sorted(py, declaration, given)?;
        let given = read_all(kind, &known, &declared, &mut references)?;
        let (mut common, mut own) = (T::common()?, Vec::new());
        for (key, value) in given {
            let is_own = declaration.get(&key).is_some();
            match common.iter_mut().find(|(known, _)| *known == key) {
                Some((_, place)) if !is_own => *place = value,
                _ => own.push((key, value)),
            }
        }
        let common: Map<String, Json> =
            common.iter().map(|(key, value)| (key.clone(), value.json(&mut |_, id| id))).collect();
        let whole = |mut own: Map<String, Json>| {
            own.insert(family.tag.to_string(), kind.into());
            T::assemble(own, common.clone())
        };
        let value: T = make(kind, &known, &own, &family.example(kind), whole)?;
        let mut value = value.settle()?;
        for (name, array) in arrays.into_iter().filter(|(_, array)| !array.is_none()) {
            value.set_array(name, &array)?;
        }
        Ok(Self { value: value.complete()?, references })
    }

    /// Separates the declared parameters from those that are arrays.
    fn sorted<'py>(
        py: Python<'py>,
        kind: &Declaration,
        given: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Sorted<'py>> {
        let (declared, mut given_arrays) = (PyDict::new(py), Vec::new());
        for (key, value) in given.into_iter().flatten() {
            match arrays(kind).into_iter().find(|name| key.eq(*name).unwrap_or(false)) {
                Some(name) => given_arrays.push((name, value)),
                None => declared.set_item(key, value)?,
            }
        }
        Ok((declared, given_arrays))
    }

    /// Fails if a number of the parameters `given` is out of range. (Readers of files only warn of
    /// such numbers.)
    fn check(self, kind: &str, given: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        for key in given.into_iter().flatten().map(|(key, _)| key) {
            let key: String = key.extract()?;
            if let Some(problem) = snell_scene::problem_at(&self.value, &[&key]) {
                return Err(PyValueError::new_err(format!("{kind}: {problem}")));
            }
        }
        let mut too_large = None;
        parameters::find(&self.value, &mut |found| {
            if found.numbers().iter().any(|x| !x.is_finite()) {
                too_large.get_or_insert(found.name());
            }
        });
        if let Some(name) = too_large {
            let message = format!("{kind}: {name} is larger than any number that is computed with");
            return Err(PyValueError::new_err(message));
        }
        Ok(self)
    }

    /// Like [`Self::new`], and fails if a number is out of range.
    pub fn checked<'py>(
        py: Python<'py>,
        kind: &str,
        given: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Self> {
        Self::new(py, kind, given)?.check(kind, given)
    }

    fn fields(&self) -> PyResult<(Vec<(String, Value)>, Vec<(String, Value)>)> {
        Ok(T::apart(Value::of(&self.value).map_err(PyTypeError::new_err)?))
    }

    /// The name of the kind.
    pub fn kind(&self) -> PyResult<String> {
        let tag = family(T::FAMILY)?.tag;
        let (kind, _) = self.fields()?;
        match kind.into_iter().find(|(key, _)| key == tag) {
            Some((_, Value::Text(kind))) => Ok(kind),
            _ => Ok(String::new()),
        }
    }

    /// All parameters by name.
    pub fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let tag = family(T::FAMILY)?.tag;
        let (kind, common) = self.fields()?;
        let all = PyDict::new(py);
        for (key, value) in kind.iter().chain(&common).filter(|(key, _)| key != tag) {
            all.set_item(key, show(py, value, &self.references)?)?;
        }
        for name in arrays(Self::declaration(&self.kind()?)?) {
            match self.value.array(py, name)? {
                Some(array) => all.set_item(name, array)?,
                None if T::is_shorthand(name) => {}
                None => all.set_item(name, py.None())?,
            }
        }
        Ok(all)
    }

    /// Value of one parameter, for attribute access in Python.
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

    /// A copy with the parameters in `changes` replaced.
    pub fn replace<'py>(
        &self,
        py: Python<'py>,
        changes: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Self> {
        let all = self.parameters(py)?;
        if let Some(changes) = changes {
            let kind = Self::declaration(&self.kind()?)?;
            let known = Self::known(kind)?;
            let (declared, _) = Self::sorted(py, kind, Some(changes))?;
            read_all(kind.name, &known, &declared, &mut References::default())?;
            all.update(changes.as_mapping())?;
        }
        Self::new(py, &self.kind()?, Some(&all))?.check(&self.kind()?, changes)
    }

    /// The Python expression that creates the value.
    pub fn shown(&self, py: Python<'_>, class: &str) -> PyResult<String> {
        let mut text = format!("{class}({:?}", self.kind()?);
        let tag = family(T::FAMILY)?.tag;
        let (kind, common) = self.fields()?;
        let usual = T::common()?;
        let is_usual = |field: &&(String, Value)| !usual.contains(field);
        let arrays = arrays(Self::declaration(&self.kind()?)?);
        let is_array = |field: &&(String, Value)| arrays.contains(&field.0.as_str());
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

    /// The state for pickling: JSON, textures, media, and arrays by name.
    pub fn stored<'py>(&self, py: Python<'py>) -> PyResult<Stored<'py>> {
        let error = |e: serde_json::Error| PyValueError::new_err(e.to_string());
        let json = serde_json::to_string(&self.value).map_err(error)?;
        let textures =
            self.references.textures.iter().map(|texture| texture.clone_ref(py)).collect();
        let of = |medium: &snell_scene::Medium| {
            let (value, references) = (medium.clone(), References::default());
            Py::new(py, Medium(Declared { value, references }))
        };
        let media = self.references.media.iter().map(of).collect::<PyResult<_>>()?;
        let kept = PyDict::new(py);
        for name in arrays(Self::declaration(&self.kind()?)?) {
            if let Some(array) = self.value.array(py, name)? {
                kept.set_item(name, array)?;
            }
        }
        Ok((json, textures, media, kept))
    }

    /// Restores a value from its state.
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

/// Parameters as they were given: the declared ones, and arrays by name.
type Sorted<'py> = (Bound<'py, PyDict>, Vec<(&'static str, Bound<'py, PyAny>)>);

/// The stored form of a declared value.
pub type Stored<'py> = (String, Vec<AnyTexture>, Vec<Py<Medium>>, Bound<'py, PyDict>);

/// Declares the Python class of a family, and the function that restores a pickled value.
macro_rules! declared_class {
    ($(#[doc = $doc:expr])* $class:ident of $value:ty, restored by $restore:ident;
        $(#[doc = $about:expr])* replace) => {
        $(#[doc = $doc])*
        #[pyclass(frozen, module = "snell")]
        pub struct $class(pub $crate::declared::Declared<$value>);

        #[pymethods]
        impl $class {
            #[new]
            #[pyo3(signature = (kind, /, **parameters))]
            fn new<'py>(
                py: Python<'py>,
                kind: &str,
                parameters: Option<&Bound<'py, pyo3::types::PyDict>>,
            ) -> PyResult<Self> {
                $crate::declared::Declared::checked(py, kind, parameters).map(Self)
            }

            /// The name of the kind.
            #[getter]
            fn kind(&self) -> PyResult<String> {
                self.0.kind()
            }

            /// All parameters by name. Each is an attribute, too.
            #[getter]
            fn parameters<'py>(
                &self,
                py: Python<'py>,
            ) -> PyResult<Bound<'py, pyo3::types::PyDict>> {
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

            fn __setattr__(&self, name: &str, _value: &Bound<'_, PyAny>) -> PyResult<()> {
                Err(pyo3::exceptions::PyAttributeError::new_err(format!(
                    "{name}: a {} never changes; replace({name}=…) makes another one",
                    stringify!($class)
                )))
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

        /// Restores a pickled value.
        #[pyfunction]
        pub fn $restore(
            json: String,
            textures: Vec<$crate::texture::AnyTexture>,
            media: Vec<Py<$crate::medium::Medium>>,
            arrays: Bound<'_, pyo3::types::PyDict>,
        ) -> PyResult<$class> {
            $crate::declared::Declared::restored((json, textures, media, arrays)).map($class)
        }
    };
}

pub(crate) use declared_class;
