//! The reference pages of all parameters: `docs/user/parameters.md`, and one for each family in
//! `docs/user/parameters/`.

use super::pictures::arguments;
use super::{FAMILIES, Family};
use serde_json::Value;
use snell_math::parameters::{Declaration, Kind, Parameter, Range};

const START: &str = "# Parameters

This page and its parts list the parameters of materials, patterns, media, lights, shapes and
cameras. `cargo xtask parameters` writes them from the declarations in the source. The names are
those of [`.snell` files](formats.md), of `-D` ([the command line](command-line.md)), of the forms
of [the viewer](viewer.md), and of the keyword arguments in [Python](python/rendering.md), where
`snell.describe(family, kind)` shows the same.

A number outside of its range is an error for `-D` and in Python, and a warning when a file is read.
A parameter without a default must be given. A `.snell` file may leave it out: the value in
parentheses is then used. Colours are linear RGB.
";

/// What the page of a family says first, below its title.
const PART: &str = "[How to read these tables](../parameters.md): ranges, defaults, and where the \
names are used.";

/// The reference pages in Markdown, by their places below `docs/user/`.
pub fn reference() -> Vec<(String, String)> {
    let index: Vec<String> = FAMILIES.iter().map(index_section).collect();
    let mut pages = vec![("parameters.md".into(), format!("{START}\n{}", index.join("\n")))];
    for family in FAMILIES {
        let text = format!("# {}\n\n{PART}\n\n{}", family.title, family_section(family));
        pages.push((format!("parameters/{}", page_of(family)), text));
    }
    pages
}

/// The file name of a family's page.
fn page_of(family: &Family) -> String {
    format!("{}.md", family.title.to_lowercase())
}

/// The kinds of a family with links to their sections.
fn index_section(family: &Family) -> String {
    let page = page_of(family);
    let link = |kind: &Declaration| {
        let first = kind.text();
        let first = first.split_once(". ").map_or(first.as_str(), |(first, _)| first);
        let first = first.trim_end_matches('.');
        format!("| [`{0}`](parameters/{page}#{0}) | {first}. |\n", kind.name)
    };
    let rows: String = family.kinds.iter().map(link).collect();
    format!("## {0}\n\n| [{0}](parameters/{page}) | |\n|---|---|\n{rows}", family.title)
}

/// The kinds of this name with their parameters, units, ranges and defaults, or the kinds of the
/// family of this name, as text; `None` if there is neither.
pub fn describe(name: &str) -> Option<String> {
    let one = |family: &Family, kind: &Declaration| {
        let mut text = format!("{} \"{}\": {}\n", family.name, kind.name, kind.text());
        let lines = |text: &mut String, parameters: &[Parameter], default: &Default| {
            for parameter in parameters.iter().filter(|p| p.name != family.tag) {
                let [_, kind, range, default, about] =
                    cells(parameter.name, parameter, default(parameter));
                let is_required = default.is_empty() || default.starts_with('(');
                let default = match default.as_str() {
                    _ if is_required => "has to be given".into(),
                    default => format!("default {default}"),
                };
                let facts: Vec<_> =
                    [kind, range, default].into_iter().filter(|f| !f.is_empty()).collect();
                *text += &format!("  {}: {}\n      {about}\n", parameter.name, facts.join(", "));
            }
        };
        lines(&mut text, kind.fields(), &default_of_kind(family, kind));
        if !family.common.is_empty() {
            text += &format!("parameters of every {}:\n", family.name);
            lines(&mut text, family.common, &common_default(family));
        }
        text
    };
    let kinds = |family: &Family| {
        let names: Vec<_> = family.kinds.iter().map(|kind| kind.name).collect();
        format!("kinds of {}: {}\n", family.name, names.join(", "))
    };
    let of_family = Family::named(name).map(kinds);
    let of_kind = FAMILIES.iter().filter_map(|f| f.kind(name).map(|kind| one(f, kind)));
    let found: Vec<String> = of_family.into_iter().chain(of_kind).collect();
    (!found.is_empty()).then(|| found.join("\n"))
}

/// The default of a parameter as people write it, in parentheses if only files may leave it out.
type Default<'a> = dyn Fn(&Parameter) -> String + 'a;

fn default_of_kind<'a>(
    family: &'a Family,
    kind: &'a Declaration,
) -> impl Fn(&Parameter) -> String + 'a {
    let usual = family.usual(kind.name);
    move |parameter| either(family.default_of(kind.name, parameter.name), usual.get(parameter.name))
}

fn common_default(family: &Family) -> impl Fn(&Parameter) -> String + '_ {
    let usual = family.usual_common();
    move |parameter| either(family.common_default_of(parameter.name), usual.get(parameter.name))
}

fn either(default: Option<Value>, usual: Option<&Value>) -> String {
    let in_parentheses = |value: &Value| match shown(value) {
        text if text.is_empty() => text,
        text => format!("({text})"),
    };
    default.map_or_else(|| usual.map(in_parentheses).unwrap_or_default(), |value| shown(&value))
}

fn family_section(family: &Family) -> String {
    let kinds: Vec<String> = family.kinds.iter().map(|kind| kind_section(family, kind)).collect();
    let mut text = kinds.join("\n");
    if !family.common.is_empty() {
        text += &format!("\n## Parameters of all {}\n\n", family.title.to_lowercase());
        let common = family
            .common
            .iter()
            .filter(|p| !matches!(p.kind, Kind::OneOf(tag, _) if tag == family.tag));
        text += &table(common, &common_default(family));
    }
    text
}

fn kind_section(family: &Family, kind: &Declaration) -> String {
    let (name, of) = (kind.name, family.name);
    let command = format!("snell render {} --spp 256 -o {of}-{name}.jpg", arguments(family, name));
    let mut text = format!(
        "## `{name}`\n\n{}\n\n<!-- picture: the {of} {name} -->\n```sh\n{command}\n```\n",
        kind.text()
    );
    if !kind.fields().is_empty() {
        text += "\n";
        text += &table(kind.fields().iter(), &default_of_kind(family, kind));
    }
    text
}

fn table<'a>(parameters: impl Iterator<Item = &'a Parameter>, default: &Default) -> String {
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
            let row = row(&place, parameter, String::new());
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

fn row(name: &str, parameter: &Parameter, default: String) -> String {
    let cells = cells(&format!("`{name}`"), parameter, default);
    format!("| {} |\n", cells.map(|cell| cell.replace('|', "\\|")).join(" | "))
}

/// A parameter's name, what it is, its range, its default and its documentation.
fn cells(name: &str, parameter: &Parameter, default: String) -> [String; 5] {
    let range = match parameter.range {
        Range::Any => String::new(),
        // The unit has a column of its own.
        range => range.to_string().replace(", in radians", ""),
    };
    let kind = match parameter.unit {
        "" => parameter.kind.to_string(),
        unit => format!("{}, {unit}", parameter.kind),
    };
    [name.into(), kind, range, default, parameter.text()]
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
        Value::Array(items)
            if items.iter().all(|item| item.as_array().is_some_and(|i| i.len() == 3)) =>
        {
            let rows: Vec<_> = items.iter().map(shown).collect();
            if rows == ["1 0 0", "0 1 0", "0 0 1"] { "identity".into() } else { rows.join("; ") }
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

    #[test]
    fn a_kind_is_described_with_units_ranges_and_defaults() {
        let text = describe("open-pbr").expect("a kind");
        assert!(text.starts_with("material \"open-pbr\": "), "{text}");
        assert!(text.contains("  base_weight: number or texture, 0 to 1, default 1\n"), "{text}");
        assert!(text.contains("W / (m^2 sr)"), "{text}");
        assert!(describe("diffuse").expect("a kind").contains("has to be given"));
        assert!(describe("material").expect("a family").contains("open-pbr, "));
        let both = describe("disk").expect("a light and a shape");
        assert!(both.contains("light \"disk\"") && both.contains("shape \"disk\""), "{both}");
        assert_eq!(describe("no such thing"), None);
    }
}
