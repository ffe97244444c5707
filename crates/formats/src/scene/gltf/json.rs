//! A value in the JSON of a glTF file, with its path. Every query returns an error that names the
//! path, so that the rest of the reader states only what it expects.

use crate::{Input, Place, ReadError};
use serde_json::Value;

/// Remedy for files that violate the glTF specification.
pub(super) const REPAIR: &str = "export the file again, or check it with the glTF validator";

/// A value in the document, and its path.
#[derive(Clone)]
pub(super) struct Json<'a> {
    input: &'a Input,
    value: &'a Value,
    path: String,
}

impl<'a> Json<'a> {
    /// The whole document.
    pub fn root(input: &'a Input, value: &'a Value) -> Self {
        Self { input, value, path: String::new() }
    }

    /// The value itself.
    pub fn value(&self) -> &'a Value {
        self.value
    }

    /// Returns another value with the path of this one.
    pub fn with_value<'b>(&self, value: &'b Value) -> Json<'b>
    where
        'a: 'b,
    {
        Json { input: self.input, value, path: self.path.clone() }
    }

    /// The value that a JSON pointer names, relative to this one.
    pub fn at(&self, pointer: &str) -> Result<Self, ReadError> {
        let found = self.value.pointer(pointer);
        let value =
            found.ok_or_else(|| self.error(format!("there is nothing at \"{pointer}\"")))?;
        Ok(Self { input: self.input, value, path: format!("{}{pointer}", self.path) })
    }

    /// JSON pointer of this value, such as `/meshes/0`.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The file and the path of this value, with its name if it has one, for a warning.
    pub fn place(&self) -> String {
        let name = self.name();
        let name = if name.is_empty() { name } else { format!(" \"{name}\"") };
        format!("{}: at {}{name}", self.input.name, self.path)
    }

    /// An error at this place.
    pub fn error(&self, problem: impl Into<String>) -> ReadError {
        self.error_with(problem, REPAIR)
    }

    /// An error at this place with a remedy of its own.
    pub fn error_with(&self, problem: impl Into<String>, remedy: impl Into<String>) -> ReadError {
        let place =
            if self.path.is_empty() { Place::Whole } else { Place::Json(self.path.clone()) };
        self.input.error(place, problem, remedy)
    }

    fn wrong_type(&self, expected: &str) -> ReadError {
        let found = match self.value {
            Value::Null => "null".into(),
            Value::Bool(b) => b.to_string(),
            Value::Number(n) => n.to_string(),
            Value::String(s) if s.chars().count() <= 40 => format!("\"{s}\""),
            Value::String(_) => "a string".into(),
            Value::Array(_) => "an array".into(),
            Value::Object(_) => "an object".into(),
        };
        self.error(format!("expected {expected}, found {found}"))
    }

    /// A property, or `None` if it is absent.
    pub fn get(&self, key: &str) -> Result<Option<Self>, ReadError> {
        let Value::Object(map) = self.value else { return Err(self.wrong_type("an object")) };
        Ok(map.get(key).map(|value| self.step(value, key)))
    }

    /// The property `key`, which is required.
    pub fn require(&self, key: &str) -> Result<Self, ReadError> {
        let missing = || {
            let error = self.error(format!("the property \"{key}\" is missing"));
            // The top has no place of its own.
            let is_top = error.place == Place::Whole;
            let place = if is_top { Place::Json(format!("/{key}")) } else { error.place.clone() };
            ReadError { place, ..error }
        };
        self.get(key)?.ok_or_else(missing)
    }

    /// An extension object, or `None` if it is absent.
    pub fn extension(&self, name: &str) -> Result<Option<Self>, ReadError> {
        match self.get("extensions")? {
            Some(extensions) => extensions.get(name),
            None => Ok(None),
        }
    }

    /// The names of all extension objects here.
    pub fn extension_names(&self) -> Result<Vec<String>, ReadError> {
        let extensions = self.get("extensions")?;
        let object = extensions.as_ref().and_then(|e| e.value.as_object());
        Ok(object.map_or(Vec::new(), |o| o.keys().cloned().collect()))
    }

    fn step(&self, value: &'a Value, key: &str) -> Self {
        // RFC 6901: "~" and "/" in keys are escaped.
        let escaped = key.replace('~', "~0").replace('/', "~1");
        Self { input: self.input, value, path: format!("{}/{escaped}", self.path) }
    }

    fn item(&self, i: usize, value: &'a Value) -> Self {
        Self { input: self.input, value, path: format!("{}/{i}", self.path) }
    }

    /// The element of the array `table` (a property of this object) that `index` refers to.
    pub fn entry(&self, table: &str, index: &Json) -> Result<Self, ReadError> {
        let i = index.size()?;
        let items = match self.get(table)? {
            Some(array) => array.as_array()?,
            None => &[],
        };
        let value = items.get(i).ok_or_else(|| {
            index.error(format!(
                "it refers to number {i} of \"{table}\", but there are {}",
                items.len()
            ))
        })?;
        Ok(Self { input: self.input, value, path: format!("{}/{table}/{i}", self.path) })
    }

    fn as_array(&self) -> Result<&'a [Value], ReadError> {
        match self.value {
            Value::Array(items) => Ok(items),
            _ => Err(self.wrong_type("an array")),
        }
    }

    /// Names and values of an object's properties, sorted by name.
    pub fn properties(&self) -> Result<impl Iterator<Item = (&'a str, Self)>, ReadError> {
        let Value::Object(map) = self.value else { return Err(self.wrong_type("an object")) };
        Ok(map.iter().map(|(key, value)| (key.as_str(), self.step(value, key))))
    }

    /// The elements of an array.
    pub fn items(&self) -> Result<impl ExactSizeIterator<Item = Self> + use<'a>, ReadError> {
        let items = self.as_array()?;
        let this = self.clone();
        Ok(items.iter().enumerate().map(move |(i, value)| this.item(i, value)))
    }

    /// The elements of an array property; none if it is absent.
    pub fn items_of(&self, key: &str) -> Result<Vec<Self>, ReadError> {
        Ok(match self.get(key)? {
            Some(array) => array.items()?.collect(),
            None => Vec::new(),
        })
    }

    /// Number of elements of an array.
    pub fn len(&self) -> Result<usize, ReadError> {
        Ok(self.as_array()?.len())
    }

    /// The value as a number.
    pub fn number(&self) -> Result<f64, ReadError> {
        self.value.as_f64().ok_or_else(|| self.wrong_type("a number"))
    }

    /// A whole number from 0; `2.0` counts too.
    pub fn size(&self) -> Result<usize, ReadError> {
        let whole = |x: f64| (x.fract() == 0.0 && (0.0..9e15).contains(&x)).then_some(x as u64);
        self.value
            .as_u64()
            .or_else(|| self.value.as_f64().and_then(whole))
            .and_then(|x| usize::try_from(x).ok())
            .ok_or_else(|| self.wrong_type("a whole number from 0"))
    }

    /// The value as a boolean.
    pub fn boolean(&self) -> Result<bool, ReadError> {
        self.value.as_bool().ok_or_else(|| self.wrong_type("true or false"))
    }

    /// The value as a string.
    pub fn string(&self) -> Result<&'a str, ReadError> {
        self.value.as_str().ok_or_else(|| self.wrong_type("a string"))
    }

    /// An array of exactly `N` numbers.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], ReadError> {
        let all = self.all_numbers()?;
        all.try_into().map_err(|found: Vec<f64>| {
            self.error(format!("expected {N} numbers, found {}", found.len()))
        })
    }

    /// An array of any number of numbers.
    pub fn all_numbers(&self) -> Result<Vec<f64>, ReadError> {
        let Value::Array(items) = self.value else {
            return Err(self.wrong_type("an array of numbers"));
        };
        let number = |(i, value): (usize, &'a Value)| {
            value.as_f64().map_or_else(|| self.item(i, value).number(), Ok)
        };
        items.iter().enumerate().map(number).collect()
    }

    /// A number property or its default.
    pub fn number_or(&self, key: &str, default: f64) -> Result<f64, ReadError> {
        self.get(key)?.map_or(Ok(default), |value| value.number())
    }

    /// A whole-number property or its default.
    pub fn size_or(&self, key: &str, default: usize) -> Result<usize, ReadError> {
        self.get(key)?.map_or(Ok(default), |value| value.size())
    }

    /// A property of `N` numbers or its default.
    pub fn numbers_or<const N: usize>(
        &self,
        key: &str,
        default: [f64; N],
    ) -> Result<[f64; N], ReadError> {
        self.get(key)?.map_or(Ok(default), |value| value.numbers())
    }

    /// A boolean property or its default.
    pub fn boolean_or(&self, key: &str, default: bool) -> Result<bool, ReadError> {
        self.get(key)?.map_or(Ok(default), |value| value.boolean())
    }

    /// The property `name`, for display; empty if absent or not a string.
    pub fn name(&self) -> String {
        self.value.get("name").and_then(Value::as_str).unwrap_or_default().to_owned()
    }

    /// True for an object (broken files have other values as extensions).
    pub fn is_object(&self) -> bool {
        self.value.is_object()
    }
}
