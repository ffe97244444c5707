//! Objects of a scene: plugins with their properties and the objects inside of them, looked up by
//! name and checked by type.

use super::value::{Hue, Value};
use crate::scene::fault::{Fault, Spot};
use snell_math::{DAffine3, DVec3};
use std::cell::Cell;
use std::rc::Rc;

/// What stands between `<bsdf type="diffuse">` and `</bsdf>`.
#[derive(Debug, Default)]
pub struct Object {
    /// `bsdf`, `shape` and the like.
    pub class: String,
    /// The plugin.
    pub kind: String,
    /// What it is to the object around it; empty if it does not say.
    pub name: String,
    /// For references to it.
    pub id: Option<String>,
    /// Where it begins.
    pub at: Spot,
    /// Properties in the order of the file.
    pub properties: Vec<Property>,
    /// Objects inside.
    pub children: Vec<Child>,
}

/// A named value.
#[derive(Debug)]
pub struct Property {
    /// As versions 2 and 3 write it.
    pub name: String,
    /// Where it is.
    pub at: Spot,
    pub value: Value,
    pub used: Cell<bool>,
}

/// An object inside of another, or a reference to one.
#[derive(Debug)]
pub struct Child {
    pub name: String,
    pub at: Spot,
    pub content: Content,
    pub used: Cell<bool>,
}

/// See [`Child`].
#[derive(Clone, Debug)]
pub enum Content {
    Object(Rc<Object>),
    /// The id of an object that may stand anywhere.
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
    /// For messages: `bsdf "diffuse"`.
    pub fn owner(&self) -> String {
        format!("{} \"{}\"", self.class, self.kind)
    }

    /// An error about this object.
    pub fn fault(&self, problem: impl std::fmt::Display, remedy: impl Into<String>) -> Fault {
        Fault::new(self.at, format!("{}: {problem}", self.owner()), remedy)
    }

    /// The property of this name; it counts as used.
    pub fn get(&self, name: &str) -> Option<&Property> {
        let property = self.properties.iter().find(|p| p.name == name)?;
        property.used.set(true);
        Some(property)
    }

    /// True if there is a property or an object of this name; it does not count as used.
    pub fn has(&self, name: &str) -> bool {
        self.properties.iter().any(|p| p.name == name)
            || self.children.iter().any(|c| c.name == name)
    }

    /// A number.
    pub fn float(&self, name: &str) -> Result<Option<f64>, Fault> {
        let Some(property) = self.get(name) else { return Ok(None) };
        match property.value {
            Value::Float(x) | Value::Color(Hue::Uniform(x)) => Ok(Some(x)),
            Value::Integer(i) => Ok(Some(i as f64)),
            _ => Err(property.wrong_kind("float")),
        }
    }

    /// A number or its default.
    pub fn float_or(&self, name: &str, default: f64) -> Result<f64, Fault> {
        Ok(self.float(name)?.unwrap_or(default))
    }

    /// A number in a range (inclusive) or its default.
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

    /// A positive number or its default.
    pub fn positive(&self, name: &str, default: f64) -> Result<f64, Fault> {
        let number = self.float_or(name, default)?;
        if number > 0.0 && number < 1e30 {
            return Ok(number);
        }
        let at = self.get(name).map_or(self.at, |p| p.at);
        Err(Fault::new(at, format!("\"{name}\" is {number}"), "give a positive number"))
    }

    /// A whole number in a range (inclusive).
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

    /// Yes or no.
    pub fn bool_or(&self, name: &str, default: bool) -> Result<bool, Fault> {
        let Some(property) = self.get(name) else { return Ok(default) };
        match property.value {
            Value::Bool(b) => Ok(b),
            _ => Err(property.wrong_kind("boolean")),
        }
    }

    /// A text.
    pub fn string(&self, name: &str) -> Result<Option<(&str, Spot)>, Fault> {
        let Some(property) = self.get(name) else { return Ok(None) };
        match &property.value {
            Value::String(text) => Ok(Some((text, property.at))),
            _ => Err(property.wrong_kind("string")),
        }
    }

    /// A file name, which must be there.
    pub fn file_name(&self) -> Result<(&str, Spot), Fault> {
        let missing =
            || self.fault("there is no file name", "add <string name=\"filename\" value=\"…\"/>");
        self.string("filename")?.ok_or_else(missing)
    }

    /// A point or vector.
    pub fn vector(&self, name: &str) -> Result<Option<DVec3>, Fault> {
        let Some(property) = self.get(name) else { return Ok(None) };
        match property.value {
            Value::Vector(v) => Ok(Some(v)),
            _ => Err(property.wrong_kind("vector")),
        }
    }

    /// A transform; the identity if there is none.
    pub fn transform(&self, name: &str) -> Result<DAffine3, Fault> {
        let Some(property) = self.get(name) else { return Ok(DAffine3::IDENTITY) };
        match property.value {
            Value::Transform(map) => Ok(map),
            _ => Err(property.wrong_kind("transform")),
        }
    }

    /// The objects of a class (the objects referred to count when they are resolved), each counting
    /// as used.
    pub fn children_where<'a>(
        &'a self,
        is: impl Fn(&Child) -> bool + 'a,
    ) -> impl Iterator<Item = &'a Child> {
        self.children.iter().filter(move |c| is(c)).inspect(|c| c.used.set(true))
    }
}
