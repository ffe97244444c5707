//! Ways of writing values that the standard does not have, but that exporters use and loaders take:
//! `null` for any property and -1 for the number of an object, which stand for "none"; 0 and 1, or
//! text, for false and true; alpha modes in small letters.

use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Properties whose value is the number of an object.
const NUMBERS: &[&str] = &[
    "buffer",
    "bufferView",
    "camera",
    "indices",
    "inverseBindMatrices",
    "light",
    "material",
    "mesh",
    "node",
    "sampler",
    "scene",
    "skeleton",
    "skin",
    "source",
];

/// Removes the properties of a document that say "none" and returns a warning that names the first
/// of them, or `None` if there are none. `extras` stay as they are, and so do elements of arrays,
/// whose order is their meaning.
pub(super) fn remove(document: &mut Value) -> Option<String> {
    let (mut first, mut count) = (None, 0);
    remove_below(document, "", &mut first, &mut count);
    let others = match count {
        0 | 1 => String::new(),
        2 => " and 1 more".into(),
        _ => format!(" and {} more", count - 1),
    };
    first.map(|first| {
        format!("null or -1 stands for \"none\" at {first}{others}; it is taken as absent")
    })
}

/// Removes what says "none" below `value`, at `path`. The parser limits the depth of a document, so
/// recursion is fine.
fn remove_below(value: &mut Value, path: &str, first: &mut Option<String>, count: &mut usize) {
    match value {
        Value::Array(items) => {
            for (i, item) in items.iter_mut().enumerate() {
                if item.is_object() || item.is_array() {
                    remove_below(item, &format!("{path}/{i}"), first, count);
                }
            }
        }
        Value::Object(map) => {
            let is_attributes = path.ends_with("/attributes");
            map.retain(|key, value| {
                let is_none = says_none(key, value, is_attributes);
                if is_none {
                    first.get_or_insert_with(|| format!("{path}/{key}"));
                    *count += 1;
                }
                !is_none
            });
            for (key, below) in map.iter_mut().filter(|(key, _)| *key != "extras") {
                if below.is_object() || below.is_array() {
                    remove_below(below, &format!("{path}/{key}"), first, count);
                }
            }
        }
        _ => {}
    }
}

/// True if a property says that there is no such thing. A texture of number -1 is none.
fn says_none(key: &str, value: &Value, is_attribute: bool) -> bool {
    let is_minus_one = |value: &Value| value.as_f64() == Some(-1.0);
    let is_no_texture = |info: &Map<String, Value>| {
        info.get("index").is_some_and(|i| i.is_null() || is_minus_one(i))
    };
    match value {
        Value::Null => key != "extras",
        Value::Number(_) => (is_attribute || NUMBERS.contains(&key)) && is_minus_one(value),
        Value::Object(info) => key.ends_with("Texture") && is_no_texture(info),
        _ => false,
    }
}

/// Properties whose value is true or false.
const BOOLEANS: &[&str] = &["doubleSided", "normalized", "visible"];

/// Writes truth values and alpha modes of a document in the standard's way, and returns warnings.
pub(super) fn spell(document: &mut Value) -> Vec<String> {
    let mut found = BTreeMap::new();
    spell_below(document, "", &mut found);
    let told = |(key, (path, before)): (String, (String, String))| {
        format!("{key} is {before} at {path}, which is not how the standard writes it")
    };
    found.into_iter().map(told).collect()
}

/// Mends the spelling below `value`, at `path`, and notes the first place of each property.
fn spell_below(value: &mut Value, path: &str, found: &mut BTreeMap<String, (String, String)>) {
    match value {
        Value::Array(items) => {
            for (i, item) in items.iter_mut().enumerate() {
                if item.is_object() || item.is_array() {
                    spell_below(item, &format!("{path}/{i}"), found);
                }
            }
        }
        Value::Object(map) => {
            for (key, below) in map.iter_mut().filter(|(key, _)| *key != "extras") {
                if below.is_object() || below.is_array() {
                    spell_below(below, &format!("{path}/{key}"), found);
                } else if let Some(usual) = usual(key, below) {
                    let before = std::mem::replace(below, usual).to_string();
                    found.entry(key.clone()).or_insert_with(|| (format!("{path}/{key}"), before));
                }
            }
        }
        _ => {}
    }
}

/// The standard's way to write a value, if it is written in another one.
fn usual(key: &str, value: &Value) -> Option<Value> {
    if BOOLEANS.contains(&key) {
        let is_true = match value {
            Value::Number(number) => [(0.0, false), (1.0, true)]
                .into_iter()
                .find_map(|(known, is_true)| (number.as_f64() == Some(known)).then_some(is_true)),
            Value::String(text) => text.to_ascii_lowercase().parse().ok(),
            _ => None,
        };
        return is_true.map(Value::Bool);
    }
    let mode = value.as_str().filter(|_| key == "alphaMode")?;
    let upper = mode.to_ascii_uppercase();
    (upper != mode && ["OPAQUE", "MASK", "BLEND"].contains(&&*upper)).then(|| upper.into())
}
