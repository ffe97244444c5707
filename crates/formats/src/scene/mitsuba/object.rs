//! Objects of a scene: plugins with their properties and nested objects, which are looked up by
//! name and checked by type.

use super::value::{Hue, Value};
use crate::scene::fault::{Fault, Spot};
use snell_math::{DAffine3, DVec3};
use std::cell::Cell;
use std::rc::Rc;

/// An element such as `<bsdf type="diffuse">` with its content.
#[derive(Debug, Default)]
pub struct Object {
    /// Name of the element: `bsdf`, `shape` and the like.
    pub class: String,
    /// Name of the plugin.
    pub kind: String,
    /// The name of the object within its parent; empty if absent.
    pub name: String,
    /// The id by which other objects refer to this one.
    pub id: Option<String>,
    /// The place where the object begins.
    pub at: Spot,
    /// Properties in the order of the file.
    pub properties: Vec<Property>,
    /// The nested objects.
    pub children: Vec<Child>,
}

/// A named value of an object.
#[derive(Debug)]
pub struct Property {
    /// The name in the spelling of versions 2 and 3.
    pub name: String,
    /// The place of the property.
    pub at: Spot,
    pub value: Value,
    pub used: Cell<bool>,
}

/// A nested object, or a reference to one.
#[derive(Debug)]
pub struct Child {
    pub name: String,
    pub at: Spot,
    pub content: Content,
    pub used: Cell<bool>,
}

/// An object, or a reference to one; see [`Child`].
#[derive(Clone, Debug)]
pub enum Content {
    Object(Rc<Object>),
    /// The id of an object anywhere in the scene.
    Reference(String),
}

impl Property {
    /// An error about this property.
    pub fn fault(&self, problem: impl std::fmt::Display, remedy: impl Into<String>) -> Fault {
        Fault::new(self.at, format!("\"{}\": {problem}", self.name), remedy)
    }

    fn wrong_kind(&self, expected: &str) -> Fault {
        let found = self.value.kind();
        self.fault(
            format!("{found} found, {expected} expected"),
            format!("write <{expected} name=\"{}\" …/>", self.name),
        )
    }
}

impl Object {
    /// The name for messages: `bsdf "diffuse"`.
    pub fn owner(&self) -> String {
        format!("{} \"{}\"", self.class, self.kind)
    }

    /// An error about this object.
    pub fn fault(&self, problem: impl std::fmt::Display, remedy: impl Into<String>) -> Fault {
        Fault::new(self.at, format!("{}: {problem}", self.owner()), remedy)
    }

    /// The property of this name, which is marked as used.
    pub fn get(&self, name: &str) -> Option<&Property> {
        let property = self.properties.iter().find(|p| p.name == name)?;
        property.used.set(true);
        Some(property)
    }

    /// True if there is a property or an object of this name. This does not mark it as used.
    pub fn has(&self, name: &str) -> bool {
        self.properties.iter().any(|p| p.name == name)
            || self.children.iter().any(|c| c.name == name)
    }

    /// The property `name` as a number; `None` if absent.
    pub fn float(&self, name: &str) -> Result<Option<f64>, Fault> {
        let Some(property) = self.get(name) else { return Ok(None) };
        match property.value {
            Value::Float(x) | Value::Color(Hue::Uniform(x)) => Ok(Some(x)),
            Value::Integer(i) => Ok(Some(i as f64)),
            _ => Err(property.wrong_kind("float")),
        }
    }

    /// The property `name` as a number, or its default.
    pub fn float_or(&self, name: &str, default: f64) -> Result<f64, Fault> {
        Ok(self.float(name)?.unwrap_or(default))
    }

    /// The property `name` as a number in a range (inclusive), or its default.
    pub fn float_within(&self, name: &str, default: f64, range: [f64; 2]) -> Result<f64, Fault> {
        let number = self.float_or(name, default)?;
        if (range[0]..=range[1]).contains(&number) {
            return Ok(number);
        }
        let at = self.get(name).map_or(self.at, |p| p.at);
        Err(Fault::new(
            at,
            format!("\"{name}\" is {number}"),
            format!("give a number from {} to {}", range[0], range[1]),
        ))
    }

    /// The property `name` as a positive number, or its default.
    pub fn positive(&self, name: &str, default: f64) -> Result<f64, Fault> {
        let number = self.float_or(name, default)?;
        if number > 0.0 && number < 1e30 {
            return Ok(number);
        }
        let at = self.get(name).map_or(self.at, |p| p.at);
        Err(Fault::new(at, format!("\"{name}\" is {number}"), "give a positive number"))
    }

    /// The property `name` as a whole number in a range (inclusive); `None` if absent.
    pub fn integer_within(&self, name: &str, range: [i64; 2]) -> Result<Option<i64>, Fault> {
        let Some(property) = self.get(name) else { return Ok(None) };
        let number = match property.value {
            Value::Integer(i) => i,
            Value::Float(x) if x.fract() == 0.0 && x.abs() < 1e15 => x as i64,
            _ => return Err(property.wrong_kind("integer")),
        };
        if (range[0]..=range[1]).contains(&number) {
            return Ok(Some(number));
        }
        Err(property.fault(
            format!("it is {number}"),
            format!("give a number from {} to {}", range[0], range[1]),
        ))
    }

    /// The property `name` as a boolean, or its default.
    pub fn bool_or(&self, name: &str, default: bool) -> Result<bool, Fault> {
        let Some(property) = self.get(name) else { return Ok(default) };
        match property.value {
            Value::Bool(b) => Ok(b),
            _ => Err(property.wrong_kind("boolean")),
        }
    }

    /// The property `name` as a string, with its place; `None` if absent.
    pub fn string(&self, name: &str) -> Result<Option<(&str, Spot)>, Fault> {
        let Some(property) = self.get(name) else { return Ok(None) };
        match &property.value {
            Value::String(text) => Ok(Some((text, property.at))),
            _ => Err(property.wrong_kind("string")),
        }
    }

    /// The required file name of the object, with its place.
    pub fn file_name(&self) -> Result<(&str, Spot), Fault> {
        let missing =
            || self.fault("there is no file name", "add <string name=\"filename\" value=\"…\"/>");
        self.string("filename")?.ok_or_else(missing)
    }

    /// The property `name` as a point or vector; `None` if absent.
    pub fn vector(&self, name: &str) -> Result<Option<DVec3>, Fault> {
        let Some(property) = self.get(name) else { return Ok(None) };
        match property.value {
            Value::Vector(v) => Ok(Some(v)),
            _ => Err(property.wrong_kind("vector")),
        }
    }

    /// The property `name` as a transform; the identity if absent.
    pub fn transform(&self, name: &str) -> Result<DAffine3, Fault> {
        let Some(property) = self.get(name) else { return Ok(DAffine3::IDENTITY) };
        match property.value {
            Value::Transform(map) => Ok(map),
            _ => Err(property.wrong_kind("transform")),
        }
    }

    /// The children that satisfy a condition, each marked as used.
    pub fn children_where<'a>(
        &'a self,
        is: impl Fn(&Child) -> bool + 'a,
    ) -> impl Iterator<Item = &'a Child> {
        self.children.iter().filter(move |c| is(c)).inspect(|c| c.used.set(true))
    }
}
