//! Declarations as trees: what a value of the scene graph looks like to those who do not know its
//! type.
//!
//! A tree is what `serde` says of a value, and keeps what JSON loses: which numbers are ids of
//! which table, and which are in single precision. So the parameters of every material, light and
//! camera can be read, shown and moved between tables without a list of them.

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyTuple};
use serde::de::DeserializeOwned;
use serde::ser::{self, Serialize};
use serde_json::{Map, Value};
use std::fmt::Display;

/// A value as its declaration says.
#[derive(Clone, Debug, PartialEq)]
pub enum Tree {
    /// An option that is not there.
    Nothing,
    /// True or false.
    Bool(bool),
    /// A whole number.
    Whole(i64),
    /// A number in single precision.
    Single(f32),
    /// A number in double precision.
    Double(f64),
    /// A name.
    Text(String),
    /// The position in a table: the name of its type, such as `TextureId`.
    Id(&'static str, u32),
    /// Several values.
    List(Vec<Tree>),
    /// Values by name.
    Fields(Vec<(String, Tree)>),
}

/// What cannot be said as a tree.
#[derive(Debug)]
pub struct Unsaid(String);

impl Display for Unsaid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Unsaid {}

impl ser::Error for Unsaid {
    fn custom<T: Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

impl Tree {
    /// The tree of a value.
    pub fn of(value: &impl Serialize) -> Result<Self, String> {
        value.serialize(Writer).map_err(|e| e.to_string())
    }

    /// The value of a name.
    pub fn get(&self, name: &str) -> Option<&Self> {
        let Self::Fields(fields) = self else { return None };
        fields.iter().find(|(key, _)| key == name).map(|(_, value)| value)
    }

    /// As Python's own values; ids are numbers.
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

    /// As JSON, with other ids.
    pub fn json(&self, id: &mut impl FnMut(&'static str, u32) -> u32) -> Value {
        match self {
            Self::Nothing => Value::Null,
            Self::Bool(b) => Value::Bool(*b),
            Self::Whole(n) => (*n).into(),
            Self::Single(x) => f64::from(*x).into(),
            Self::Double(x) => (*x).into(),
            Self::Text(text) => Value::String(text.clone()),
            Self::Id(kind, number) => id(kind, *number).into(),
            Self::List(items) => items.iter().map(|item| item.json(id)).collect(),
            Self::Fields(fields) => Value::Object(
                fields
                    .iter()
                    .map(|(key, value)| (key.clone(), value.json(id)))
                    .collect::<Map<_, _>>(),
            ),
        }
    }
}

/// A number in single precision as people write it: 0.1, not 0.10000000149.
fn shortest(x: f32) -> f64 {
    x.to_string().parse().unwrap_or_else(|_| f64::from(x))
}

/// The same value with other ids: what `id` makes of the name of an id's type and the id.
pub fn with_ids<T: Serialize + DeserializeOwned>(
    value: &T,
    mut id: impl FnMut(&'static str, u32) -> u32,
) -> Result<T, String> {
    serde_json::from_value(Tree::of(value)?.json(&mut id)).map_err(|e| e.to_string())
}

/// Writes trees.
struct Writer;

/// Writes lists.
struct ListWriter {
    items: Vec<Tree>,
    variant: Option<&'static str>,
}

/// Writes fields.
struct FieldWriter {
    fields: Vec<(String, Tree)>,
    variant: Option<&'static str>,
}

/// A value under the name of its variant, as JSON has it.
fn in_variant(variant: Option<&'static str>, tree: Tree) -> Tree {
    match variant {
        Some(name) => Tree::Fields(vec![(name.to_string(), tree)]),
        None => tree,
    }
}

macro_rules! simple {
    ($($method:ident($type:ty) => $tree:expr;)*) => {
        $(fn $method(self, value: $type) -> Result<Tree, Unsaid> {
            let make: fn($type) -> Tree = $tree;
            Ok(make(value))
        })*
    };
}

impl ser::Serializer for Writer {
    type Ok = Tree;
    type Error = Unsaid;
    type SerializeSeq = ListWriter;
    type SerializeTuple = ListWriter;
    type SerializeTupleStruct = ListWriter;
    type SerializeTupleVariant = ListWriter;
    type SerializeMap = FieldWriter;
    type SerializeStruct = FieldWriter;
    type SerializeStructVariant = FieldWriter;

    simple! {
        serialize_bool(bool) => Tree::Bool;
        serialize_i8(i8) => |n| Tree::Whole(n.into());
        serialize_i16(i16) => |n| Tree::Whole(n.into());
        serialize_i32(i32) => |n| Tree::Whole(n.into());
        serialize_i64(i64) => Tree::Whole;
        serialize_u8(u8) => |n| Tree::Whole(n.into());
        serialize_u16(u16) => |n| Tree::Whole(n.into());
        serialize_u32(u32) => |n| Tree::Whole(n.into());
        serialize_u64(u64) => |n| Tree::Whole(i64::try_from(n).unwrap_or(i64::MAX));
        serialize_f32(f32) => Tree::Single;
        serialize_f64(f64) => Tree::Double;
        serialize_char(char) => |c| Tree::Text(c.to_string());
        serialize_str(&str) => |text| Tree::Text(text.to_string());
        serialize_bytes(&[u8]) => |bytes| {
            Tree::List(bytes.iter().map(|&b| Tree::Whole(b.into())).collect())
        };
    }

    fn serialize_none(self) -> Result<Tree, Unsaid> {
        Ok(Tree::Nothing)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<Tree, Unsaid> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<Tree, Unsaid> {
        Ok(Tree::Nothing)
    }

    fn serialize_unit_struct(self, _: &'static str) -> Result<Tree, Unsaid> {
        Ok(Tree::Nothing)
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
    ) -> Result<Tree, Unsaid> {
        Ok(Tree::Text(variant.to_string()))
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        name: &'static str,
        value: &T,
    ) -> Result<Tree, Unsaid> {
        match value.serialize(self)? {
            Tree::Whole(number) if name.ends_with("Id") => {
                Ok(Tree::Id(name, u32::try_from(number).unwrap_or(u32::MAX)))
            }
            tree => Ok(tree),
        }
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<Tree, Unsaid> {
        Ok(in_variant(Some(variant), value.serialize(self)?))
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<ListWriter, Unsaid> {
        Ok(ListWriter { items: Vec::new(), variant: None })
    }

    fn serialize_tuple(self, _: usize) -> Result<ListWriter, Unsaid> {
        self.serialize_seq(None)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<ListWriter, Unsaid> {
        self.serialize_seq(None)
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<ListWriter, Unsaid> {
        Ok(ListWriter { items: Vec::new(), variant: Some(variant) })
    }

    fn serialize_map(self, _: Option<usize>) -> Result<FieldWriter, Unsaid> {
        Ok(FieldWriter { fields: Vec::new(), variant: None })
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<FieldWriter, Unsaid> {
        self.serialize_map(None)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<FieldWriter, Unsaid> {
        Ok(FieldWriter { fields: Vec::new(), variant: Some(variant) })
    }
}

macro_rules! list_writer {
    ($($trait:ident::$method:ident,)*) => {
        $(impl ser::$trait for ListWriter {
            type Ok = Tree;
            type Error = Unsaid;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unsaid> {
                self.items.push(value.serialize(Writer)?);
                Ok(())
            }

            fn end(self) -> Result<Tree, Unsaid> {
                Ok(in_variant(self.variant, Tree::List(self.items)))
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
            type Ok = Tree;
            type Error = Unsaid;

            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                key: &'static str,
                value: &T,
            ) -> Result<(), Unsaid> {
                self.fields.push((key.to_string(), value.serialize(Writer)?));
                Ok(())
            }

            fn end(self) -> Result<Tree, Unsaid> {
                Ok(in_variant(self.variant, Tree::Fields(self.fields)))
            }
        })*
    };
}

field_writer! {
    SerializeStruct,
    SerializeStructVariant,
}

impl ser::SerializeMap for FieldWriter {
    type Ok = Tree;
    type Error = Unsaid;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), Unsaid> {
        let Tree::Text(key) = key.serialize(Writer)? else {
            return Err(ser::Error::custom("a key that is no text"));
        };
        self.fields.push((key, Tree::Nothing));
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Unsaid> {
        let value = value.serialize(Writer)?;
        if let Some(last) = self.fields.last_mut() {
            last.1 = value;
        }
        Ok(())
    }

    fn end(self) -> Result<Tree, Unsaid> {
        Ok(Tree::Fields(self.fields))
    }
}
