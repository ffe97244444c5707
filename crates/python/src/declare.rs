//! Keyword arguments as declared parameters: materials, lights, projections.
//!
//! Nothing here knows a material or light by name. What the parameters of a kind are called, and
//! what they look like, is read from its examples ([`Tree`]); values are put into that form, and
//! the declaration itself says whether they fit. So a new kind, or parameter, is there in Python as
//! soon as it is declared.

use crate::arrays::numpy;
use crate::material::Material;
use crate::medium::Medium as PyMedium;
use crate::names::suggestion;
use crate::said::Said;
use crate::settings::shown;
use crate::texture::{AnyTexture, Channel};
use crate::tree::Tree;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyString, PyTuple};
use serde::de::DeserializeOwned;
use snell_math::Rgb;
use snell_scene::medium::Medium;

/// The kinds of one family, such as the materials.
#[derive(Debug)]
pub struct Family {
    /// What one of them is.
    pub name: &'static str,
    /// The field that says which kind.
    pub tag: &'static str,
    /// A few of each kind.
    pub examples: Vec<Tree>,
    /// The parameters of a kind that are arrays, or said by arrays, and so are not in the
    /// declaration.
    pub arrays: fn(&str) -> &'static [&'static str],
}

impl Family {
    /// A family without arrays, whose tag is its name.
    pub fn of<T: serde::Serialize>(name: &'static str, examples: &[T]) -> Self {
        let examples = examples.iter().filter_map(|example| Tree::of(example).ok()).collect();
        Self { name, tag: name, examples, arrays: |_| &[] }
    }

    fn kind<'a>(&self, example: &'a Tree) -> &'a str {
        match example.get(self.tag) {
            Some(Tree::Text(kind)) => kind,
            _ => "",
        }
    }

    /// The names of all kinds.
    pub fn kinds(&self) -> Vec<&str> {
        let mut all: Vec<&str> = Vec::new();
        for example in &self.examples {
            let kind = self.kind(example);
            if !all.contains(&kind) {
                all.push(kind);
            }
        }
        all
    }

    /// The parameters of a kind, each with an example.
    pub fn parameters(&self, kind: &str) -> PyResult<Vec<(String, Tree)>> {
        self.gather(kind, |_, _| {})
    }

    /// What the parameters of a kind may look like: of those that are one of several things, the
    /// fields of all.
    pub fn forms(&self, kind: &str) -> PyResult<Vec<(String, Tree)>> {
        self.gather(kind, merge)
    }

    fn gather(
        &self,
        kind: &str,
        merge: impl Fn(&mut Tree, &Tree),
    ) -> PyResult<Vec<(String, Tree)>> {
        let mut all: Vec<(String, Tree)> = Vec::new();
        let mut is_known = false;
        for example in self.examples.iter().filter(|example| self.kind(example) == kind) {
            is_known = true;
            let Tree::Fields(fields) = example else { continue };
            for (key, form) in fields.iter().filter(|(key, _)| key != self.tag) {
                match all.iter_mut().find(|(known, _)| known == key) {
                    None => all.push((key.clone(), form.clone())),
                    Some((_, known)) if *known == Tree::Nothing => *known = form.clone(),
                    Some((_, known)) => merge(known, form),
                }
            }
        }
        if is_known {
            return Ok(all);
        }
        Err(PyValueError::new_err(format!(
            "there is no {} {kind:?}{}",
            self.name,
            suggestion(kind, &self.kinds())
        )))
    }
}

/// Adds to what a parameter may look like what another example of it shows.
fn merge(known: &mut Tree, form: &Tree) {
    match (&mut *known, form) {
        (Tree::Fields(known), Tree::Fields(form)) => {
            for (key, value) in form {
                match known.iter_mut().find(|(name, _)| name == key) {
                    Some((_, known)) => merge(known, value),
                    None => known.push((key.clone(), value.clone())),
                }
            }
        }
        (Tree::Nothing, _) => *known = form.clone(),
        (Tree::Fields(_), _) | (_, Tree::Nothing) => {}
        (_, Tree::Fields(_)) => *known = form.clone(),
        // A number or a name: the declaration judges.
        (Tree::Single(_) | Tree::Double(_) | Tree::Whole(_), Tree::Text(_)) => {
            *known = form.clone()
        }
        _ => {}
    }
}

/// The names of all kinds, with those of their parameters.
pub fn catalogue<'py>(py: Python<'py>, family: &Family) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for kind in family.kinds() {
        let arrays = (family.arrays)(kind);
        let declared = family.parameters(kind)?.into_iter().map(|(name, _)| name);
        let declared = declared.filter(|name| !arrays.contains(&name.as_str()));
        let names: Vec<String> = declared.chain(arrays.iter().map(ToString::to_string)).collect();
        all.set_item(kind, PyTuple::new(py, names)?)?;
    }
    Ok(all)
}

/// What a declared value refers to, by the number that it has for each.
#[derive(Debug, Default)]
pub struct References {
    /// By number.
    pub textures: Vec<AnyTexture>,
    /// By number.
    pub media: Vec<Medium>,
}

impl References {
    /// The number of a medium.
    fn medium(&mut self, medium: &Medium) -> Tree {
        let known = self.media.iter().position(|known| known == medium);
        let number = known.unwrap_or_else(|| {
            self.media.push(medium.clone());
            self.media.len() - 1
        });
        Tree::Id("MediumId", number as u32)
    }

    /// The number of a texture.
    fn texture(&mut self, texture: AnyTexture) -> Tree {
        let known = self.textures.iter().position(|known| known.is(&texture));
        let number = known.unwrap_or_else(|| {
            self.textures.push(texture);
            self.textures.len() - 1
        });
        Tree::Id("TextureId", number as u32)
    }
}

/// The value of each parameter, in the form of its declaration.
pub fn read_all(
    what: &str,
    known: &[(String, Tree)],
    given: &Bound<'_, PyDict>,
    references: &mut References,
) -> PyResult<Vec<(String, Tree)>> {
    let mut all = Vec::new();
    for (key, value) in given {
        let key: String = key.extract()?;
        let Some((_, form)) = known.iter().find(|(known, _)| *known == key) else {
            let names: Vec<_> = known.iter().map(|(name, _)| name.as_str()).collect();
            let hint = suggestion(&key, &names);
            return Err(PyTypeError::new_err(format!("{what} has no parameter {key:?}{hint}")));
        };
        let value = read(&value, form, &key, references)?;
        all.push((key, value));
    }
    Ok(all)
}

/// Makes the declared value of the parameters that are given; `whole` puts them into place. An
/// error names the parameter.
pub fn make<T: DeserializeOwned>(
    what: &str,
    given: &[(String, Tree)],
    known: &[(String, Tree)],
    whole: impl Fn(Vec<(String, Tree)>) -> Tree,
) -> PyResult<T> {
    let with = |fields: &[(String, Tree)]| {
        serde_json::from_value::<T>(whole(fields.to_vec()).json(&mut |_, id| id))
    };
    let error = match with(given) {
        Ok(made) => return Ok(made),
        Err(error) => error.to_string(),
    };
    let is_missing = |name: &&String| error.contains(&format!("missing field `{name}`"));
    if let Some(name) = known.iter().map(|(name, _)| name).find(is_missing) {
        return Err(PyTypeError::new_err(format!("{what}: the parameter {name:?} is missing")));
    }
    // Which one: the first that does not go with the others as an example has them.
    for (key, value) in given.iter().filter(|_| with(known).is_ok()) {
        let mut fields = known.to_vec();
        if let Some((_, place)) = fields.iter_mut().find(|(known, _)| known == key) {
            place.clone_from(value);
        }
        if let Err(error) = with(&fields) {
            return Err(PyValueError::new_err(format!("{what}: {key}: {error}")));
        }
    }
    Err(PyValueError::new_err(format!("{what}: {error}")))
}

/// True for the form of a colour: three numbers in single precision.
fn is_color(form: &Tree) -> bool {
    let Tree::List(items) = form else { return false };
    items.len() == 3 && items.iter().all(|item| matches!(item, Tree::Single(_)))
}

/// The form of a factor with a texture.
fn textured(form: &Tree) -> Option<&Tree> {
    form.get("texture").and(form.get("factor"))
}

/// The inside of a surface that is filled with a medium.
fn interior(medium: Tree) -> Tree {
    fields_of([("medium", medium), ("priority", Tree::Whole(0))])
}

/// True for a factor that changes nothing.
fn is_neutral(factor: &Tree) -> bool {
    match factor {
        Tree::List(items) => items.iter().all(is_neutral),
        factor => *factor == Tree::Single(1.0),
    }
}

/// Values by name.
fn fields_of<const N: usize>(fields: [(&str, Tree); N]) -> Tree {
    Tree::Fields(fields.map(|(key, value)| (key.to_string(), value)).to_vec())
}

/// A texture in the form of a parameter.
fn with_texture(form: &Tree, id: Tree, channel: Option<u8>, name: &str) -> PyResult<Tree> {
    let channel_of = |id| Tree::List(vec![id, Tree::Whole(channel.unwrap_or(0).into())]);
    if let Some(color) = form.get("color") {
        return Ok(fields_of([("color", with_texture(color, id, channel, name)?)]));
    }
    match (form, textured(form)) {
        (_, Some(factor)) if is_color(factor) => {
            if channel.is_some() {
                return Err(PyTypeError::new_err(format!(
                    "{name}: a colour takes a texture, not one of its channels"
                )));
            }
            Ok(fields_of([("factor", Tree::List(vec![Tree::Single(1.0); 3])), ("texture", id)]))
        }
        (_, Some(_)) => Ok(fields_of([("factor", Tree::Single(1.0)), ("texture", channel_of(id))])),
        (Tree::Id(..), _) => Ok(id),
        (Tree::List(items), _) if matches!(items[..], [Tree::Id(..), Tree::Whole(_)]) => {
            Ok(channel_of(id))
        }
        // Maps; most often there are none.
        _ if name.ends_with("bump_map") => Err(PyTypeError::new_err(format!(
            "{name}: how high? Give {{\"texture\": texture, \"height\": 0.01}}"
        ))),
        _ => Ok(fields_of([("texture", id), ("scale", Tree::Single(1.0))])),
    }
}

/// A colour as `#rrggbb`, in sRGB.
fn hex_color(text: &str) -> Option<Tree> {
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii())?;
    let part = |at: usize| {
        u8::from_str_radix(&digits[at..at + 2], 16).ok().map(|byte| f32::from(byte) / 255.0)
    };
    let color = Rgb::from_srgb(part(0)?, part(2)?, part(4)?);
    Some(Tree::List(color.to_array().map(Tree::Single).to_vec()))
}

/// A value in the form of a parameter.
pub fn read(
    value: &Bound<'_, PyAny>,
    form: &Tree,
    name: &str,
    references: &mut References,
) -> PyResult<Tree> {
    let unexpected =
        || PyTypeError::new_err(format!("{name} is {}, expected {}", shown(value), expected(form)));
    if value.is_none() {
        return Ok(Tree::Nothing);
    }
    if let Ok(texture) = value.extract::<AnyTexture>() {
        // A pattern is as good a number as a colour: grey ones have one value.
        let is_number = textured(form).is_some_and(|factor| !is_color(factor));
        let channel = (is_number && matches!(texture, AnyTexture::Pattern(_))).then_some(0);
        return with_texture(form, references.texture(texture), channel, name);
    }
    if let Ok(channel) = value.cast::<Channel>() {
        let channel = channel.get();
        let texture = AnyTexture::Image(channel.texture.clone_ref(value.py()));
        return with_texture(form, references.texture(texture), Some(channel.number), name);
    }
    if let Ok(medium) = value.cast::<PyMedium>() {
        return Ok(interior(references.medium(&medium.get().0.value)));
    }
    if let Ok(material) = value.cast::<Material>() {
        let parameters = material.get().0.parameters(value.py())?;
        let own = PyDict::new(value.py());
        for (key, value) in parameters {
            if form.get(&key.extract::<String>()?).is_some() {
                own.set_item(key, value)?;
            }
        }
        return read(own.as_any(), form, name, references);
    }
    if let Ok(fields) = value.cast::<PyDict>() {
        let mut all = Vec::new();
        for (key, value) in fields {
            let key: String = key.extract()?;
            if let Ok(medium) = value.cast::<PyMedium>() {
                all.push((key, references.medium(&medium.get().0.value)));
                continue;
            }
            // The texture of a map, where there was no map before.
            if matches!(form, Tree::Nothing)
                && key == "texture"
                && let Ok(texture) = value.extract::<AnyTexture>()
            {
                all.push((key, references.texture(texture)));
                continue;
            }
            let form = form.get(&key).unwrap_or(&Tree::Nothing);
            all.push((key.clone(), read(&value, form, &format!("{name}[{key:?}]"), references)?));
        }
        if let (Some(factor), Some(Tree::Fields(_))) = (textured(form), Some(form)) {
            let neutral = if is_color(factor) {
                Tree::List(vec![Tree::Single(1.0); 3])
            } else {
                Tree::Single(1.0)
            };
            for (key, value) in [("factor", neutral), ("texture", Tree::Nothing)] {
                if all.iter().all(|(known, _)| known != key) {
                    all.push((key.to_string(), value));
                }
            }
        }
        return Ok(Tree::Fields(all));
    }
    if let Some(color) = form.get("color")
        && value.extract::<String>().map_or(true, |text| text.starts_with('#'))
    {
        return Ok(fields_of([("color", read(value, color, name, references)?)]));
    }
    if let Some(factor) = textured(form) {
        let factor = read(value, factor, name, references)?;
        return Ok(fields_of([("factor", factor), ("texture", Tree::Nothing)]));
    }
    if let Ok(text) = value.cast::<PyString>() {
        let text: String = text.extract()?;
        return match form {
            form if is_color(form) => hex_color(&text).ok_or_else(unexpected),
            Tree::Text(_) | Tree::Fields(_) | Tree::Nothing => Ok(Tree::Text(text)),
            _ => Err(unexpected()),
        };
    }
    let is_bool =
        value.is_instance_of::<PyBool>() || value.is_instance(&numpy(value.py(), "bool_")?)?;
    if is_bool {
        return match form {
            Tree::Bool(_) | Tree::Nothing => Ok(Tree::Bool(value.is_truthy()?)),
            _ => Err(unexpected()),
        };
    }
    if value.hasattr("__float__")?
        && value.len().is_err()
        && let Ok(number) = value.extract::<f64>()
    {
        return read_number(number, form, name, unexpected);
    }
    let items =
        if value.hasattr("tolist")? { value.call_method0("tolist")? } else { value.clone() };
    let items: Vec<_> = items.try_iter().map_err(|_| unexpected())?.collect::<PyResult<_>>()?;
    let forms: &[Tree] = match form {
        Tree::List(forms) => forms,
        Tree::Nothing => &[],
        _ => return Err(unexpected()),
    };
    let is_vector = forms.iter().all(|form| matches!(form, Tree::Single(_) | Tree::Double(_)))
        && forms.len() > 1;
    if is_vector && items.len() != forms.len() {
        return Err(unexpected());
    }
    let item = |(i, item): (usize, &Bound<'_, PyAny>)| {
        let form = forms.get(i).or(forms.last()).unwrap_or(&Tree::Nothing);
        read(item, form, &format!("{name}[{i}]"), references)
    };
    Ok(Tree::List(items.iter().enumerate().map(item).collect::<PyResult<_>>()?))
}

fn read_number(
    number: f64,
    form: &Tree,
    name: &str,
    unexpected: impl Fn() -> PyErr,
) -> PyResult<Tree> {
    if !number.is_finite() {
        return Err(PyValueError::new_err(format!("{name} is {number}, expected a finite number")));
    }
    let is_whole = number.fract() == 0.0 && number.abs() < 9e15;
    match form {
        Tree::Single(_) if number.abs() <= f64::from(f32::MAX) => Ok(Tree::Single(number as f32)),
        Tree::Double(_) => Ok(Tree::Double(number)),
        Tree::Whole(_) if is_whole => Ok(Tree::Whole(number as i64)),
        form if is_color(form) && number.abs() <= f64::from(f32::MAX) => {
            Ok(Tree::List(vec![Tree::Single(number as f32); 3]))
        }
        Tree::Nothing | Tree::Text(_) if is_whole => Ok(Tree::Whole(number as i64)),
        Tree::Nothing | Tree::Text(_) => Ok(Tree::Double(number)),
        _ => Err(unexpected()),
    }
}

/// What a parameter may be, in words.
fn expected(form: &Tree) -> String {
    match form {
        Tree::Nothing => "another kind of value".into(),
        Tree::Bool(_) => "True or False".into(),
        Tree::Whole(_) => "a whole number".into(),
        Tree::Single(_) | Tree::Double(_) => "a number".into(),
        Tree::Text(text) => format!("a name such as {text:?}"),
        Tree::Id(..) => "a Texture or a Pattern".into(),
        form if is_color(form) => {
            "a colour: a number, three numbers (linear), or \"#rrggbb\"".into()
        }
        Tree::List(items) => match items.first() {
            Some(Tree::Single(_) | Tree::Double(_) | Tree::Whole(_)) => {
                format!("{} numbers", items.len())
            }
            _ => "a list".into(),
        },
        Tree::Fields(_) => match textured(form) {
            Some(factor) if is_color(factor) => {
                format!("{}, or a Texture or Pattern", expected(factor))
            }
            Some(_) => "a number, a channel of a Texture, or a Pattern".into(),
            None => match form {
                Tree::Fields(fields) => {
                    let names: Vec<_> =
                        fields.iter().map(|(name, _)| format!("{name:?}")).collect();
                    format!("a dictionary with {}", names.join(", "))
                }
                _ => String::new(),
            },
        },
    }
}

/// A declared value as Python shows it: constants as numbers, textures as such.
pub fn show<'py>(
    py: Python<'py>,
    tree: &Tree,
    references: &References,
) -> PyResult<Bound<'py, PyAny>> {
    match tree {
        Tree::Id("TextureId", number) => match references.textures.get(*number as usize) {
            Some(texture) => Ok(texture.clone_ref(py).into_pyobject(py)?.into_any()),
            None => tree.plain(py),
        },
        Tree::Id("MediumId", number) => match references.media.get(*number as usize) {
            Some(medium) => {
                let said = Said { value: medium.clone(), references: References::default() };
                Ok(Bound::new(py, PyMedium(said))?.into_any())
            }
            None => tree.plain(py),
        },
        Tree::List(items) => {
            let items: Vec<_> =
                items.iter().map(|item| show(py, item, references)).collect::<PyResult<_>>()?;
            Ok(PyTuple::new(py, items)?.into_any())
        }
        Tree::Fields(fields) => {
            // What is as one says it is shown so: a constant, a texture, one of its channels.
            let is_bare = |(key, value): &(String, Tree)| {
                matches!(&**key, "factor" | "texture") || *value == Tree::Nothing
            };
            match (textured(tree).filter(|_| fields.iter().all(is_bare)), tree.get("texture")) {
                (Some(factor), Some(Tree::Nothing)) => return show(py, factor, references),
                (Some(factor), Some(texture)) if is_neutral(factor) => match texture {
                    Tree::List(items) if let [id, Tree::Whole(number)] = &items[..] => {
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
        _ => tree.plain(py),
    }
}
