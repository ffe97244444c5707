//! Keyword arguments as declared parameters: materials, lights, projections, shapes.
//!
//! Nothing here knows a material or light by name. The names and types of the parameters of a kind
//! are in its declaration ([`snell_scene::families`]); values are converted to that form, and
//! reading it validates them. So a new kind or parameter is available in Python once it is
//! declared.

use crate::arrays::numpy;
use crate::declared::Declared;
use crate::material::Material;
use crate::medium::Medium as PyMedium;
use crate::names::suggestion;
use crate::settings::shown;
use crate::texture::{AnyTexture, Channel};
use crate::value::Value;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString, PyTuple};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json};
use snell_math::Rgb;
use snell_math::parameters::{Declaration, Kind, Parameter, Range};
use snell_scene::families::Family;
use snell_scene::medium::Medium;
use snell_scene::written::unknown_names;

/// The family of this name.
pub fn family(name: &str) -> PyResult<&'static Family> {
    let names: Vec<_> = snell_scene::families::FAMILIES.iter().map(|f| f.name).collect();
    Family::named(name).ok_or_else(|| {
        PyValueError::new_err(format!("there is no family {name:?}{}", suggestion(name, &names)))
    })
}

/// The kind of this name of a family.
pub fn kind_of(family: &Family, name: &str) -> PyResult<&'static Declaration> {
    family.kind(name).ok_or_else(|| {
        let names: Vec<_> = family.kinds.iter().map(|kind| kind.name).collect();
        let hint = suggestion(name, &names);
        PyValueError::new_err(format!("there is no {} {name:?}{hint}", family.name))
    })
}

/// The names of all kinds of a family, each with the names of its parameters.
pub fn catalogue<'py>(py: Python<'py>, family: &str) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for kind in self::family(family)?.kinds {
        all.set_item(kind.name, PyTuple::new(py, names(kind))?)?;
    }
    Ok(all)
}

/// The names of the parameters of a kind; arrays come last.
fn names(kind: &Declaration) -> Vec<&'static str> {
    let arrays = arrays(kind);
    let declared = kind.fields().iter().map(|parameter| parameter.name);
    declared.filter(|name| !arrays.contains(name)).chain(arrays.iter().copied()).collect()
}

/// The parameters of a kind that are arrays: the cells of a grid, and the map that places the grid.
/// The place may also be given by corners (`bounds`).
pub fn arrays(kind: &Declaration) -> Vec<&'static str> {
    if !Medium::DECLARATIONS.contains(kind) {
        return Vec::new();
    }
    let is_place = |p: &&Parameter| p.kind == Kind::Matrix;
    let is_array = |p: &&Parameter| is_place(p) || p.kind.required() == Kind::Cells;
    let corners = kind.fields().iter().find(is_place).map(|_| "bounds");
    kind.fields().iter().filter(is_array).map(|p| p.name).chain(corners).collect()
}

/// The parameters of a kind of a family, as declared.
///
/// Parameters
/// ----------
/// family : str
///     `"material"`, `"pattern"`, `"medium"`, `"light"`, `"shape"` or `"projection"`.
/// kind : str
///     One of :data:`MATERIALS`, and so on.
///
/// Returns
/// -------
/// dict
///     By name: `"doc"`, `"kind"` (in words), `"range"` (in words), `"unit"` (both empty where
///     there is none), and, unless the parameter has to be given, `"default"`.
///
/// Examples
/// --------
/// >>> import snell
/// >>> ior = snell.describe("material", "dielectric")["ior"]
/// >>> ior["kind"], ior["range"], "default" in ior
/// ('number or glass', 'more than 0', False)
/// >>> snell.describe("material", "hair")["scale_tilt"]["default"]
/// 2.0
#[pyfunction]
pub fn describe<'py>(py: Python<'py>, family: &str, kind: &str) -> PyResult<Bound<'py, PyDict>> {
    let family = self::family(family)?;
    let kind = kind_of(family, kind)?;
    let all = PyDict::new(py);
    for parameter in kind.fields() {
        let about = PyDict::new(py);
        about.set_item("doc", parameter.text())?;
        about.set_item("kind", parameter.kind.to_string().replace('`', ""))?;
        let range = (parameter.range != Range::Any).then(|| parameter.range.to_string());
        about.set_item("range", range.unwrap_or_default())?;
        about.set_item("unit", parameter.unit)?;
        if let Some(default) = family.default_of(kind.name, parameter.name) {
            about.set_item("default", show(py, &Value::from(default), &References::default())?)?;
        }
        all.set_item(parameter.name, about)?;
    }
    Ok(all)
}

/// The textures and media that a declared value refers to. Ids in the value are indices into these
/// lists.
#[derive(Debug, Default)]
pub struct References {
    /// Textures by id.
    pub textures: Vec<AnyTexture>,
    /// Media by id.
    pub media: Vec<Medium>,
}

impl References {
    /// The id of a medium, which is added if it is new.
    fn medium(&mut self, medium: &Medium) -> Value {
        let known = self.media.iter().position(|known| known == medium);
        let number = known.unwrap_or_else(|| {
            self.media.push(medium.clone());
            self.media.len() - 1
        });
        Value::Id("MediumId", number as u32)
    }

    /// The id of a texture, which is added if it is new.
    fn texture(&mut self, texture: AnyTexture) -> Value {
        let known = self.textures.iter().position(|known| known.is(&texture));
        let number = known.unwrap_or_else(|| {
            self.textures.push(texture);
            self.textures.len() - 1
        });
        Value::Id("TextureId", number as u32)
    }
}

/// Converts the given keyword arguments to values in the form of their parameters' declarations. An
/// unknown name or a value of another kind is an error.
pub fn read_all(
    what: &str,
    known: &[Parameter],
    given: &Bound<'_, PyDict>,
    references: &mut References,
) -> PyResult<Vec<(String, Value)>> {
    let mut all = Vec::new();
    for (key, value) in given {
        let key: String = key.extract()?;
        let Some(parameter) = known.iter().find(|known| known.name == key) else {
            let names: Vec<_> = known.iter().map(|known| known.name).collect();
            let hint = suggestion(&key, &names);
            return Err(PyTypeError::new_err(format!("{what} has no parameter {key:?}{hint}")));
        };
        let value = read(&value, parameter.kind, &key, references)?;
        let unknown = unknown_names(parameter.kind, &value.json(&mut |_, id| id));
        if let Some(problem) = unknown.first() {
            return Err(PyTypeError::new_err(format!("{what}: {key}: {problem}")));
        }
        all.push((key, value));
    }
    Ok(all)
}

/// Deserialises a `T` from parameters. `example` has all fields of the kind; `whole` assembles the
/// fields of a kind to the JSON of a `T`. An error names the parameter.
pub fn make<T: DeserializeOwned>(
    what: &str,
    known: &[Parameter],
    given: &[(String, Value)],
    example: &Map<String, Json>,
    whole: impl Fn(Map<String, Json>) -> Json,
) -> PyResult<T> {
    let json = |value: &Value| value.json(&mut |_, id| id);
    let with = |fields: Map<String, Json>| serde_json::from_value::<T>(whole(fields));
    let given: Map<String, Json> = given.iter().map(|(key, v)| (key.clone(), json(v))).collect();
    let error = match with(given.clone()) {
        Ok(made) => return Ok(made),
        Err(error) => error.to_string(),
    };
    let missing = error.strip_prefix("missing field `").and_then(|rest| rest.split_once('`'));
    if let Some((name, _)) = missing {
        if known.iter().any(|parameter| parameter.name == name) && !given.contains_key(name) {
            return Err(PyTypeError::new_err(format!("{what}: the parameter {name:?} is missing")));
        }
        if let Some(holder) = known.iter().find(|holder| holder.kind.inside(name).is_some()) {
            let message = format!("{what}: {}: {name:?} is missing", holder.name);
            return Err(PyTypeError::new_err(message));
        }
    }
    // The wrong parameter is the first that fails together with the other fields of an example.
    for (key, value) in given.iter().filter(|_| with(example.clone()).is_ok()) {
        let mut fields = example.clone();
        fields.insert(key.clone(), value.clone());
        if let Err(error) = with(fields) {
            return Err(PyValueError::new_err(format!("{what}: {key}: {error}")));
        }
    }
    Err(PyValueError::new_err(format!("{what}: {error}")))
}

/// The kind of values that are not checked here, but by deserialisation.
const ANYTHING: Kind = Kind::Table;

/// The variant that a bare texture or colour stands for.
fn textured_variant(kind: Kind) -> Option<(&'static str, Kind)> {
    let Kind::OneOf("", variants) = kind else { return None };
    variants.iter().find_map(|variant| match variant.parameters {
        [Parameter { name: "", kind: kind @ Kind::TexturedColor, .. }] => {
            Some((variant.name, *kind))
        }
        _ => None,
    })
}

/// The kind of the value under a name inside of a parameter.
fn inside(kind: Kind, key: &str) -> Kind {
    kind.inside(key).unwrap_or(ANYTHING).required()
}

/// True for a factor of 1.
fn is_neutral(factor: &Value) -> bool {
    match factor {
        Value::List(items) => items.iter().all(is_neutral),
        factor => *factor == Value::Single(1.0),
    }
}

/// A factor of 1 in the form of a parameter.
fn neutral(kind: Kind) -> Value {
    match kind {
        Kind::TexturedColor => Value::List(vec![Value::Single(1.0); 3]),
        _ => Value::Single(1.0),
    }
}

/// Values by name.
fn fields_of<const N: usize>(fields: [(&str, Value); N]) -> Value {
    Value::Fields(fields.map(|(key, value)| (key.to_string(), value)).to_vec())
}

/// The value of a parameter that is given by a texture, or by a channel of one.
fn with_texture(kind: Kind, id: Value, channel: Option<u8>, name: &str) -> PyResult<Value> {
    if let Some((variant, color)) = textured_variant(kind) {
        return Ok(fields_of([(variant, with_texture(color, id, channel, name)?)]));
    }
    match kind {
        Kind::TexturedColor if channel.is_some() => Err(PyTypeError::new_err(format!(
            "{name}: a colour takes a texture, not one of its channels"
        ))),
        Kind::TexturedColor => Ok(fields_of([("factor", neutral(kind)), ("texture", id)])),
        Kind::TexturedNumber => {
            let channel = Value::Whole(channel.unwrap_or(0).into());
            let texture = Value::List(vec![id, channel]);
            Ok(fields_of([("factor", neutral(kind)), ("texture", texture)]))
        }
        Kind::Reference(_) => Ok(id),
        // The factor is given separately, so the value is the texture alone.
        Kind::Table => Ok(match channel {
            Some(channel) => Value::List(vec![id, Value::Whole(channel.into())]),
            None => id,
        }),
        // Maps have further parameters; if one is missing, that is reported when the map is
        // created.
        _ => Ok(fields_of([("texture", id)])),
    }
}

/// A colour as `#rrggbb`, in sRGB.
fn hex_color(text: &str) -> Option<Value> {
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii())?;
    let part = |at: usize| {
        u8::from_str_radix(&digits[at..at + 2], 16).ok().map(|byte| f32::from(byte) / 255.0)
    };
    let color = Rgb::from_srgb(part(0)?, part(2)?, part(4)?);
    Some(Value::List(color.to_array().map(Value::Single).to_vec()))
}

/// A value in the form of a parameter.
pub fn read(
    value: &Bound<'_, PyAny>,
    kind: Kind,
    name: &str,
    references: &mut References,
) -> PyResult<Value> {
    let kind = kind.required();
    let unexpected =
        || PyTypeError::new_err(format!("{name} is {}, expected {}", shown(value), expected(kind)));
    if value.is_none() {
        return Ok(Value::Nothing);
    }
    if let Ok(texture) = value.extract::<AnyTexture>() {
        return with_texture(kind, references.texture(texture), None, name);
    }
    if let Ok(channel) = value.cast::<Channel>() {
        let channel = channel.get();
        let texture = AnyTexture::Image(channel.texture.clone_ref(value.py()));
        return with_texture(kind, references.texture(texture), Some(channel.number), name);
    }
    if let Ok(medium) = value.cast::<PyMedium>() {
        let medium = references.medium(&medium.get().0.value);
        // A medium may stand for the group that describes an interior, or be a member of that
        // group.
        let is_whole = matches!(kind, Kind::Group(_));
        return Ok(if is_whole { fields_of([("medium", medium)]) } else { medium });
    }
    if let Ok(material) = value.cast::<Material>() {
        let parameters = material.get().0.parameters(value.py())?;
        let own = PyDict::new(value.py());
        let Kind::Group(known) = kind else { return Err(unexpected()) };
        for (key, value) in parameters {
            let text: String = key.extract()?;
            if known.iter().any(|parameter| parameter.name == text) {
                own.set_item(key, value)?;
            }
        }
        return read(own.as_any(), kind, name, references);
    }
    if let Ok(fields) = value.cast::<PyDict>() {
        return read_fields(fields, kind, name, references);
    }
    if let Some((variant, color)) = textured_variant(kind)
        && value.extract::<String>().map_or(true, |text| text.starts_with('#'))
    {
        return Ok(fields_of([(variant, read(value, color, name, references)?)]));
    }
    if matches!(kind, Kind::TexturedNumber | Kind::TexturedColor) {
        let factor = inside(kind, "factor");
        let known = || {
            PyTypeError::new_err(format!("{name} is {}, expected {}", shown(value), expected(kind)))
        };
        let factor = read(value, factor, name, references).map_err(|error| {
            if error.is_instance_of::<PyTypeError>(value.py()) { known() } else { error }
        })?;
        return Ok(fields_of([("factor", factor), ("texture", Value::Nothing)]));
    }
    if let Ok(text) = value.cast::<PyString>() {
        let text: String = text.extract()?;
        return match kind {
            Kind::Color => hex_color(&text).ok_or_else(unexpected),
            Kind::Text(_) | Kind::OneOf(..) | Kind::RefractiveIndex | Kind::Table => {
                Ok(Value::Text(text))
            }
            _ => Err(unexpected()),
        };
    }
    if is_flag(value)? {
        return match kind {
            Kind::Flag | Kind::Table => Ok(Value::Bool(value.is_truthy()?)),
            _ => Err(unexpected()),
        };
    }
    if value.hasattr("__float__")?
        && value.len().is_err()
        && let Ok(number) = value.extract::<f64>()
    {
        return read_number(number, kind, name, unexpected);
    }
    read_list(value, kind, name, references, &unexpected)
}

/// True if a value is one of the booleans of Python or NumPy.
pub fn is_flag(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(value.is_instance_of::<PyBool>() || value.is_instance(&numpy(value.py(), "bool_")?)?)
}

/// Reads a dictionary: the parameters of a group, a variant, or a factor with its texture.
fn read_fields(
    fields: &Bound<'_, PyDict>,
    kind: Kind,
    name: &str,
    references: &mut References,
) -> PyResult<Value> {
    let mut all = Vec::new();
    for (key, value) in fields {
        let key: String = key.extract()?;
        let place = format!("{name}[{key:?}]");
        let mut value = read(&value, inside(kind, &key), &place, references)?;
        // The texture of a number needs a channel: 0 if the value names none, such as a pattern.
        if kind == Kind::TexturedNumber && matches!(value, Value::Id("TextureId", _)) {
            value = Value::List(vec![value, Value::Whole(0)]);
        }
        all.push((key, value));
    }
    if matches!(kind, Kind::TexturedNumber | Kind::TexturedColor) {
        for (key, value) in [("factor", neutral(kind)), ("texture", Value::Nothing)] {
            if all.iter().all(|(known, _)| known != key) {
                all.push((key.to_string(), value));
            }
        }
    }
    Ok(Value::Fields(all))
}

/// Reads a sequence: a vector, a colour, or a list.
fn read_list(
    value: &Bound<'_, PyAny>,
    kind: Kind,
    name: &str,
    references: &mut References,
    unexpected: &dyn Fn() -> PyErr,
) -> PyResult<Value> {
    let items =
        if value.hasattr("tolist")? { value.call_method0("tolist")? } else { value.clone() };
    let items: Vec<_> = items.try_iter().map_err(|_| unexpected())?.collect::<PyResult<_>>()?;
    let (of, length) = match kind {
        Kind::Color => (Kind::Number, Some(3)),
        Kind::Vector(n) | Kind::Numbers(n) => (Kind::Number, Some(n)),
        Kind::List(of) => (*of, None),
        Kind::Matrix | Kind::Table => (ANYTHING, None),
        _ => return Err(unexpected()),
    };
    if length.is_some_and(|length| length != items.len()) {
        return Err(unexpected());
    }
    let items = items
        .iter()
        .enumerate()
        .map(|(i, item)| {
            let item = read(item, of, &format!("{name}[{i}]"), references)?;
            Ok(match (kind, item) {
                (Kind::Color, Value::Double(x)) => Value::Single(x as f32),
                // Some of these numbers are declared as whole; the others can be read from whole
                // numbers too.
                (Kind::Numbers(_), Value::Double(x)) if x.fract() == 0.0 && x.abs() < 9e15 => {
                    Value::Whole(x as i64)
                }
                (_, item) => item,
            })
        })
        .collect::<PyResult<_>>()?;
    Ok(Value::List(items))
}

fn read_number(
    number: f64,
    kind: Kind,
    name: &str,
    unexpected: impl Fn() -> PyErr,
) -> PyResult<Value> {
    if !number.is_finite() {
        return Err(PyValueError::new_err(format!("{name} is {number}, expected a finite number")));
    }
    let is_whole = number.fract() == 0.0 && number.abs() < 9e15;
    match kind {
        Kind::Number | Kind::RefractiveIndex => Ok(Value::Double(number)),
        Kind::Color if number.abs() <= f64::from(f32::MAX) => {
            Ok(Value::List(vec![Value::Single(number as f32); 3]))
        }
        Kind::Whole | Kind::Table if is_whole => Ok(Value::Whole(number as i64)),
        Kind::Table => Ok(Value::Double(number)),
        _ => Err(unexpected()),
    }
}

/// The values that a parameter accepts, in words.
fn expected(kind: Kind) -> String {
    match kind {
        Kind::Flag => "True or False".into(),
        Kind::Whole => "a whole number".into(),
        Kind::Number => "a number".into(),
        Kind::RefractiveIndex => "a number, or the name of a glass such as \"BK7\"".into(),
        Kind::Text(what) => format!("a {what}"),
        Kind::Reference(_) => "a Texture or a Pattern".into(),
        Kind::Color => "a colour: a number, three numbers (linear), or \"#rrggbb\"".into(),
        Kind::TexturedColor => format!("{}, or a Texture or Pattern", expected(Kind::Color)),
        Kind::TexturedNumber => "a number, a channel of a Texture, or a Pattern".into(),
        Kind::Vector(n) | Kind::Numbers(n) => format!("{n} numbers"),
        Kind::List(_) | Kind::Matrix => "a list".into(),
        Kind::Table | Kind::Cells => "another kind of value".into(),
        Kind::Optional(kind) => expected(*kind),
        Kind::Group(parameters) => {
            let names: Vec<_> = parameters.iter().map(|p| format!("{:?}", p.name)).collect();
            format!("a dictionary with {}", names.join(", "))
        }
        Kind::OneOf(_, variants) => {
            let names: Vec<_> = variants.iter().map(|v| format!("{:?}", v.name)).collect();
            format!("one of {}", names.join(", "))
        }
    }
}

/// A declared value as a Python object: constants become numbers, textures their objects.
pub fn show<'py>(
    py: Python<'py>,
    value: &Value,
    references: &References,
) -> PyResult<Bound<'py, PyAny>> {
    match value {
        Value::Id("TextureId", number) => match references.textures.get(*number as usize) {
            Some(texture) => Ok(texture.clone_ref(py).into_pyobject(py)?.into_any()),
            None => value.plain(py),
        },
        Value::Id("MediumId", number) => match references.media.get(*number as usize) {
            Some(medium) => {
                let value = medium.clone();
                let declared = Declared { value, references: References::default() };
                Ok(Bound::new(py, PyMedium(declared))?.into_any())
            }
            None => value.plain(py),
        },
        Value::List(items) => {
            let items: Vec<_> =
                items.iter().map(|item| show(py, item, references)).collect::<PyResult<_>>()?;
            Ok(PyTuple::new(py, items)?.into_any())
        }
        Value::Fields(fields) => {
            // Factors of 1 are left out, so that a constant, a texture or a channel stands alone.
            let is_bare = |(key, value): &(String, Value)| {
                matches!(&**key, "factor" | "texture") || *value == Value::Nothing
            };
            let factor = value.get("texture").and(value.get("factor"));
            match (factor.filter(|_| fields.iter().all(is_bare)), value.get("texture")) {
                (Some(factor), Some(Value::Nothing)) => return show(py, factor, references),
                (Some(factor), Some(texture)) if is_neutral(factor) => match texture {
                    Value::List(items) if let [id, Value::Whole(number)] = &items[..] => {
                        match show(py, id, references)?.extract::<AnyTexture>() {
                            Ok(AnyTexture::Image(texture)) => {
                                let channel = Channel { texture, number: *number as u8 };
                                return Ok(Bound::new(py, channel)?.into_any());
                            }
                            Ok(AnyTexture::Pattern(pattern)) if *number == 0 => {
                                return Ok(pattern.into_bound(py).into_any());
                            }
                            _ => {}
                        }
                    }
                    _ => return show(py, texture, references),
                },
                _ => {}
            }
            let all = PyDict::new(py);
            for (key, value) in fields {
                all.set_item(key, show(py, value, references)?)?;
            }
            Ok(all.into_any())
        }
        _ => value.plain(py),
    }
}
