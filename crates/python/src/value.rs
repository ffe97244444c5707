//! Values of declared parameters, of any type.
//!
//! A [`Value`] is the `serde` output for a part of the scene graph. Unlike JSON, it keeps which
//! numbers are ids of which table, and which are in single precision. So the parameters of every
//! material, light and camera can be shown and moved between tables without a list of them.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyTuple};
use serde::de::DeserializeOwned;
use serde::ser::{self, Serialize};
use serde_json::{Map, Value as Json};
use std::fmt::Display;

/// A value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// An absent option.
    Nothing,
    /// True or false.
    Bool(bool),
    /// A whole number.
    Whole(i64),
    /// A number in single precision.
    Single(f32),
    /// A number in double precision.
    Double(f64),
    /// A text or a name.
    Text(String),
    /// A position in a table, with the name of the id's type, such as `TextureId`.
    Id(&'static str, u32),
    /// Several values.
    List(Vec<Value>),
    /// Values by name.
    Fields(Vec<(String, Value)>),
}

/// The error for a value that cannot be converted.
#[derive(Debug)]
pub struct Unwritable(String);

impl Display for Unwritable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Unwritable {}

impl ser::Error for Unwritable {
    fn custom<T: Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

impl Value {
    /// The value of a part of the scene graph.
    pub fn of(value: &impl Serialize) -> Result<Self, String> {
        value.serialize(Writer).map_err(|e| e.to_string())
    }

    /// The value under a name.
    pub fn get(&self, name: &str) -> Option<&Self> {
        let Self::Fields(fields) = self else { return None };
        fields.iter().find(|(key, _)| key == name).map(|(_, value)| value)
    }

    /// Converts to Python's own values; ids become numbers.
    pub fn plain<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(match self {
            Self::Nothing => py.None().into_bound(py),
            Self::Bool(b) => PyBool::new(py, *b).to_owned().into_any(),
            Self::Whole(n) => n.into_pyobject(py)?.into_any(),
            Self::Single(x) => shortest(*x).into_pyobject(py)?.into_any(),
            Self::Double(x) => x.into_pyobject(py)?.into_any(),
            Self::Text(text) => text.into_pyobject(py)?.into_any(),
            Self::Id(_, number) => number.into_pyobject(py)?.into_any(),
            Self::List(items) => {
                let items: Vec<_> =
                    items.iter().map(|item| item.plain(py)).collect::<PyResult<_>>()?;
                PyTuple::new(py, items)?.into_any()
            }
            Self::Fields(fields) => {
                let all = PyDict::new(py);
                for (key, value) in fields {
                    all.set_item(key, value.plain(py)?)?;
                }
                all.into_any()
            }
        })
    }

    /// Converts to JSON. `id` maps the type and number of an id to its new number.
    pub fn json(&self, id: &mut impl FnMut(&'static str, u32) -> u32) -> Json {
        match self {
            Self::Nothing => Json::Null,
            Self::Bool(b) => Json::Bool(*b),
            Self::Whole(n) => (*n).into(),
            Self::Single(x) => f64::from(*x).into(),
            Self::Double(x) => (*x).into(),
            Self::Text(text) => Json::String(text.clone()),
            Self::Id(kind, number) => id(kind, *number).into(),
            Self::List(items) => items.iter().map(|item| item.json(id)).collect(),
            Self::Fields(fields) => Json::Object(
                fields
                    .iter()
                    .map(|(key, value)| (key.clone(), value.json(id)))
                    .collect::<Map<_, _>>(),
            ),
        }
    }
}

impl From<Json> for Value {
    fn from(json: Json) -> Self {
        match json {
            Json::Null => Self::Nothing,
            Json::Bool(b) => Self::Bool(b),
            Json::Number(number) => match (number.as_i64(), number.as_f64()) {
                (Some(whole), _) => Self::Whole(whole),
                // A number that single precision holds exactly was given in single precision.
                (_, Some(x)) if f64::from(x as f32) == x => Self::Single(x as f32),
                (_, x) => Self::Double(x.unwrap_or(f64::NAN)),
            },
            Json::String(text) => Self::Text(text),
            Json::Array(items) => Self::List(items.into_iter().map(Self::from).collect()),
            Json::Object(fields) => {
                Self::Fields(fields.into_iter().map(|(key, v)| (key, Self::from(v))).collect())
            }
        }
    }
}

/// A number in single precision with its shortest decimal form: 0.1, not 0.10000000149.
fn shortest(x: f32) -> f64 {
    x.to_string().parse().unwrap_or_else(|_| f64::from(x))
}

/// The value with other ids: `id` maps the type and number of an id to its new number.
pub fn with_ids<T: Serialize + DeserializeOwned>(
    value: &T,
    mut id: impl FnMut(&'static str, u32) -> u32,
) -> Result<T, String> {
    serde_json::from_value(Value::of(value)?.json(&mut id)).map_err(|e| e.to_string())
}

/// Serialises to a [`Value`].
struct Writer;

/// Collects the elements of a list, a tuple or a variant with several values.
struct ListWriter {
    items: Vec<Value>,
    variant: Option<&'static str>,
}

/// Serialises the fields of a struct.
struct FieldWriter {
    fields: Vec<(String, Value)>,
    variant: Option<&'static str>,
}

/// A value under the name of its variant, as in JSON.
fn in_variant(variant: Option<&'static str>, value: Value) -> Value {
    match variant {
        Some(name) => Value::Fields(vec![(name.to_string(), value)]),
        None => value,
    }
}

macro_rules! simple {
    ($($method:ident($type:ty) => $made:expr;)*) => {
        $(fn $method(self, value: $type) -> Result<Value, Unwritable> {
            let make: fn($type) -> Value = $made;
            Ok(make(value))
        })*
    };
}

impl ser::Serializer for Writer {
    type Ok = Value;
    type Error = Unwritable;
    type SerializeSeq = ListWriter;
    type SerializeTuple = ListWriter;
    type SerializeTupleStruct = ListWriter;
    type SerializeTupleVariant = ListWriter;
    type SerializeMap = FieldWriter;
    type SerializeStruct = FieldWriter;
    type SerializeStructVariant = FieldWriter;

    simple! {
        serialize_bool(bool) => Value::Bool;
        serialize_i8(i8) => |n| Value::Whole(n.into());
        serialize_i16(i16) => |n| Value::Whole(n.into());
        serialize_i32(i32) => |n| Value::Whole(n.into());
        serialize_i64(i64) => Value::Whole;
        serialize_u8(u8) => |n| Value::Whole(n.into());
        serialize_u16(u16) => |n| Value::Whole(n.into());
        serialize_u32(u32) => |n| Value::Whole(n.into());
        serialize_u64(u64) => |n| Value::Whole(i64::try_from(n).unwrap_or(i64::MAX));
        serialize_f32(f32) => Value::Single;
        serialize_f64(f64) => Value::Double;
        serialize_char(char) => |c| Value::Text(c.to_string());
        serialize_str(&str) => |text| Value::Text(text.to_string());
        serialize_bytes(&[u8]) => |bytes| {
            Value::List(bytes.iter().map(|&b| Value::Whole(b.into())).collect())
        };
    }

    fn serialize_none(self) -> Result<Value, Unwritable> {
        Ok(Value::Nothing)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<Value, Unwritable> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<Value, Unwritable> {
        Ok(Value::Nothing)
    }

    fn serialize_unit_struct(self, _: &'static str) -> Result<Value, Unwritable> {
        Ok(Value::Nothing)
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
    ) -> Result<Value, Unwritable> {
        Ok(Value::Text(variant.to_string()))
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        name: &'static str,
        value: &T,
    ) -> Result<Value, Unwritable> {
        match value.serialize(self)? {
            Value::Whole(number) if name.ends_with("Id") => {
                Ok(Value::Id(name, u32::try_from(number).unwrap_or(u32::MAX)))
            }
            value => Ok(value),
        }
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<Value, Unwritable> {
        Ok(in_variant(Some(variant), value.serialize(self)?))
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<ListWriter, Unwritable> {
        Ok(ListWriter { items: Vec::new(), variant: None })
    }

    fn serialize_tuple(self, _: usize) -> Result<ListWriter, Unwritable> {
        self.serialize_seq(None)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<ListWriter, Unwritable> {
        self.serialize_seq(None)
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<ListWriter, Unwritable> {
        Ok(ListWriter { items: Vec::new(), variant: Some(variant) })
    }

    fn serialize_map(self, _: Option<usize>) -> Result<FieldWriter, Unwritable> {
        Ok(FieldWriter { fields: Vec::new(), variant: None })
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<FieldWriter, Unwritable> {
        self.serialize_map(None)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<FieldWriter, Unwritable> {
        Ok(FieldWriter { fields: Vec::new(), variant: Some(variant) })
    }
}

macro_rules! list_writer {
    ($($trait:ident::$method:ident,)*) => {
        $(impl ser::$trait for ListWriter {
            type Ok = Value;
            type Error = Unwritable;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
                self.items.push(value.serialize(Writer)?);
                Ok(())
            }

            fn end(self) -> Result<Value, Unwritable> {
                Ok(in_variant(self.variant, Value::List(self.items)))
            }
        })*
    };
}

list_writer! {
    SerializeSeq::serialize_element,
    SerializeTuple::serialize_element,
    SerializeTupleStruct::serialize_field,
    SerializeTupleVariant::serialize_field,
}

macro_rules! field_writer {
    ($($trait:ident,)*) => {
        $(impl ser::$trait for FieldWriter {
            type Ok = Value;
            type Error = Unwritable;

            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                key: &'static str,
                value: &T,
            ) -> Result<(), Unwritable> {
                self.fields.push((key.to_string(), value.serialize(Writer)?));
                Ok(())
            }

            fn end(self) -> Result<Value, Unwritable> {
                Ok(in_variant(self.variant, Value::Fields(self.fields)))
            }
        })*
    };
}

field_writer! {
    SerializeStruct,
    SerializeStructVariant,
}

impl ser::SerializeMap for FieldWriter {
    type Ok = Value;
    type Error = Unwritable;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), Unwritable> {
        let Value::Text(key) = key.serialize(Writer)? else {
            return Err(ser::Error::custom("a key that is no text"));
        };
        self.fields.push((key, Value::Nothing));
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unwritable> {
        let value = value.serialize(Writer)?;
        if let Some(last) = self.fields.last_mut() {
            last.1 = value;
        }
        Ok(())
    }

    fn end(self) -> Result<Value, Unwritable> {
        Ok(Value::Fields(self.fields))
    }
}
