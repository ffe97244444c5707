//! The reference page of all parameters: `docs/user/parameters.md`.

use super::{FAMILIES, Family};
use serde_json::Value;
use snell_math::parameters::{Declaration, Kind, Parameter, Range};

const START: &str = "# Parameters

What materials, patterns, media, lights, shapes and cameras are made of, as their declarations in
the source say; `cargo xtask parameters` writes this page. The names are those of
[`.snell` files](formats.md), of `-D` ([the command line](command-line.md)), of the forms of
[the viewer](viewer.md), and of the keyword arguments in [Python](python/rendering.md), where
`snell.describe(family, kind)` shows the same.

A number outside of its range is an error for `-D` and in Python, and a warning when a file is read.
A parameter without a default has to be given. Colours are linear RGB.
";

/// The reference page in Markdown.
pub fn reference() -> String {
    let families: Vec<String> = FAMILIES.iter().map(family_section).collect();
    format!("{START}\n{}", families.join("\n"))
}

fn family_section(family: &Family) -> String {
    let mut text = format!("## {}\n\n", family.title);
    if !family.common.is_empty() {
        text += "All of them have:\n\n";
        let common = family
            .common
            .iter()
            .filter(|p| !matches!(p.kind, Kind::OneOf(tag, _) if tag == family.tag));
        text += &table(common, &|parameter| family.common_default_of(parameter.name));
        text += "\n";
    }
    let kinds: Vec<String> = family.kinds.iter().map(|kind| kind_section(family, kind)).collect();
    text + &kinds.join("\n")
}

fn kind_section(family: &Family, kind: &Declaration) -> String {
    let mut text = format!("### `{}`\n\n{}\n", kind.name, kind.text());
    if !kind.fields().is_empty() {
        text += "\n";
        text += &table(kind.fields().iter(), &|p| family.default_of(kind.name, p.name));
    }
    text
}

fn table<'a>(
    parameters: impl Iterator<Item = &'a Parameter>,
    default: &dyn Fn(&Parameter) -> Option<Value>,
) -> String {
    let mut text =
        "| parameter | what it is | range | default | |\n|---|---|---|---|---|\n".to_string();
    for parameter in parameters {
        text += &row(parameter.name, parameter, default(parameter));
        inner_rows(parameter.name, parameter.kind, &mut text);
    }
    text
}

/// Adds the rows of the parameters inside a parameter.
fn inner_rows(place: &str, kind: Kind, text: &mut String) {
    let mut add = |place: &str, parameters: &[Parameter]| {
        for parameter in parameters.iter().filter(|p| !p.name.is_empty()) {
            let place = format!("{place}.{}", parameter.name);
            let row = row(&place, parameter, None);
            // A parameter that several variants share is listed once.
            if text.contains(&row) {
                continue;
            }
            *text += &row;
            inner_rows(&place, parameter.kind, text);
        }
    };
    match kind.required() {
        Kind::Group(parameters) => add(place, parameters),
        Kind::OneOf(tag, kinds) => {
            for kind in kinds {
                let inner =
                    if tag.is_empty() { format!("{place}.{}", kind.name) } else { place.into() };
                add(&inner, kind.fields());
            }
        }
        _ => {}
    }
}

fn row(name: &str, parameter: &Parameter, default: Option<Value>) -> String {
    let range = match parameter.range {
        Range::Any => String::new(),
        // The unit has a column of its own.
        range => range.to_string().replace(", in radians", ""),
    };
    let kind = match parameter.unit {
        "" => parameter.kind.to_string(),
        unit => format!("{}, {unit}", parameter.kind),
    };
    let default = default.map(|value| shown(&value)).unwrap_or_default();
    let cells = [format!("`{name}`"), kind, range, default, parameter.text()];
    format!("| {} |\n", cells.map(|cell| cell.replace('|', "\\|")).join(" | "))
}

/// A default in the form in which users write it.
fn shown(value: &Value) -> String {
    match value {
        Value::Null => "none".into(),
        Value::String(text) if text.is_empty() => String::new(),
        Value::Object(fields) => match (fields.get("factor"), fields.get("texture")) {
            (Some(factor), Some(Value::Null)) => shown(factor),
            _ => "see below".into(),
        },
        Value::Array(items) if items.iter().all(|item| item == &items[0]) && items.len() == 3 => {
            shown(&items[0])
        }
        Value::Array(items) if items.len() <= 3 && items.iter().all(Value::is_number) => {
            items.iter().map(shown).collect::<Vec<_>>().join(" ")
        }
        Value::Array(_) => "identity".into(),
        Value::Number(number) => {
            number.as_f64().map_or_else(String::new, |x| (x as f32).to_string())
        }
        Value::String(text) => format!("`{text}`"),
        Value::Bool(b) => b.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_reference_page_is_what_the_declarations_say() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/user/parameters.md");
        if std::env::var_os("SNELL_PARAMETERS").is_some_and(|wish| wish == "write") {
            std::fs::write(&path, reference()).expect("the page can be written");
        }
        let page = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            page == reference(),
            "docs/user/parameters.md is stale: run cargo xtask parameters"
        );
    }
}
