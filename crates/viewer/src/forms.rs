//! Forms of the page: what the page needs to edit parameters, taken from their declarations.

use serde::Serialize;
use serde_json::{Map, Value};
use snell_math::parameters::{Declaration, Kind, Parameter, Range};
use snell_render::{Request, Setting};
use snell_scene::families::Family;
use std::collections::BTreeMap;

/// How the page shows one parameter.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Form {
    /// The name of the parameter.
    pub name: String,
    /// The control for the parameter: `flag`, `number`, `color`, `vector`, `choice`, `texture`, or
    /// `other`.
    pub kind: String,
    /// The plausible range of a number, if it is bounded on both sides.
    pub range: Option<[f64; 2]>,
    /// The least and the largest number that is possible; none where there is no such bound.
    pub limits: [Option<f64>; 2],
    /// The value that an emptied field stands for: the default, or for a parameter that has to be
    /// given that of an example; null if neither is known.
    #[cfg_attr(test, ts(type = "unknown"))]
    pub default: Value,
    /// True if a texture may multiply the value.
    pub is_textured: bool,
    /// The unit of the parameter; empty for plain numbers.
    pub unit: String,
    /// The documentation of the parameter.
    pub doc: String,
    /// The names of a choice.
    pub options: Vec<String>,
    /// The parameters of a group.
    pub fields: Vec<Form>,
    /// The field that names the variant, one of `kinds`; empty if the variant's name is the key
    /// around its parameters.
    pub tag: String,
    /// The parameters of each variant, by its name.
    pub kinds: BTreeMap<String, Vec<Form>>,
    /// What each variant is, by its name, where that is known.
    pub docs: BTreeMap<String, String>,
}

/// A setting of the render.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SettingForm {
    /// The name of the setting.
    pub name: String,
    /// The documentation of the setting.
    pub doc: String,
    /// The value that holds while the setting is not set, in words.
    pub default: String,
    /// The names of a choice; empty for a number.
    pub options: Vec<String>,
}

/// The settings of the render that may change while a picture is looked at.
pub fn settings() -> Vec<SettingForm> {
    let form = |setting: &Setting| SettingForm {
        name: setting.name.into(),
        doc: setting.summary(),
        default: (setting.default)().into(),
        options: (setting.choices)().into_iter().map(String::from).collect(),
    };
    Request::SETTINGS.iter().filter(|setting| setting.is_live).map(form).collect()
}

/// The families whose things the page edits.
const EDITED: [&str; 3] = ["material", "light", "pattern"];

/// The forms of all materials, lights and patterns, each as if it were one parameter.
pub fn forms() -> BTreeMap<String, Form> {
    let families = EDITED.into_iter().filter_map(Family::named);
    families.map(|family| (family.name.to_string(), of_family(family))).collect()
}

/// A thing of each kind of a family, as it is written in scenes: what a page begins with that
/// chooses another kind.
pub fn examples() -> BTreeMap<String, BTreeMap<String, Value>> {
    let of_family = |family: &Family| {
        let kinds = family.kinds.iter();
        kinds.map(|kind| (kind.name.to_string(), plain(family, kind.name).into())).collect()
    };
    let families = EDITED.into_iter().filter_map(Family::named);
    families.map(|family| (family.name.to_string(), of_family(family))).collect()
}

/// A thing of a kind with the defaults of all parameters that have some.
fn plain(family: &Family, kind: &str) -> Map<String, Value> {
    let mut fields = family.example(kind);
    for (name, value) in &mut fields {
        if let Some(default) = family.default_of(kind, name) {
            *value = default;
        }
    }
    fields
}

fn of_family(family: &Family) -> Form {
    let mut form = of_kind(Kind::OneOf(family.tag, family.kinds));
    let kinds: BTreeMap<_, _> = family.kinds.iter().map(|kind| (kind.name, kind)).collect();
    for (name, fields) in &mut form.kinds {
        let defaults = plain(family, name);
        fill(fields, &defaults);
        if let Some(kind) = kinds.get(name.as_str()) {
            form.docs.insert(name.clone(), kind.text());
        }
    }
    form.fields = family.common.iter().map(of_parameter).collect();
    // The parameters of one kind stand in the common parameter `kind`, and have their form here.
    for field in &mut form.fields {
        field.default = family.common_default_of(&field.name).unwrap_or_default();
    }
    Form { name: family.name.into(), ..form }
}

/// Sets the defaults of parameters from those of the whole that they belong to.
fn fill(fields: &mut [Form], defaults: &Map<String, Value>) {
    for field in fields {
        field.default = defaults.get(&field.name).cloned().unwrap_or_default();
        if let Value::Object(inner) = &field.default {
            fill(&mut field.fields, &inner.clone());
        }
    }
}

fn of_parameter(parameter: &Parameter) -> Form {
    Form {
        name: parameter.name.into(),
        range: parameter.usual.ends(),
        limits: limits(parameter),
        unit: parameter.unit.into(),
        doc: parameter.text(),
        ..of_kind(parameter.kind)
    }
}

/// The bounds of a parameter's numbers. A factor of a texture may exceed the upper one.
fn limits(parameter: &Parameter) -> [Option<f64>; 2] {
    let finite = |x: f64| Some(x).filter(|x| x.abs() < 1e20);
    match parameter.range {
        Range::Within(least, most) | Range::Between(least, most) => [finite(least), finite(most)],
        Range::Positive => [Some(0.0), None],
        Range::Any | Range::Direction => [None, None],
    }
}

fn of_kind(kind: Kind) -> Form {
    let kind = kind.required();
    let name = match kind {
        Kind::Flag => "flag",
        Kind::Number | Kind::Whole | Kind::TexturedNumber | Kind::RefractiveIndex => "number",
        Kind::Color | Kind::TexturedColor => "color",
        Kind::Vector(_) | Kind::Numbers(_) => "vector",
        Kind::Reference("texture") => "texture",
        Kind::OneOf("", kinds) if kinds.iter().all(|kind| kind.parameters.is_empty()) => "choice",
        _ => "other",
    };
    let mut form = Form {
        name: String::new(),
        kind: name.into(),
        range: None,
        limits: [None, None],
        default: Value::Null,
        is_textured: matches!(kind, Kind::TexturedNumber | Kind::TexturedColor),
        unit: String::new(),
        doc: String::new(),
        options: Vec::new(),
        fields: Vec::new(),
        tag: String::new(),
        kinds: BTreeMap::new(),
        docs: BTreeMap::new(),
    };
    let inner = |kind: &Declaration| kind.fields().iter().map(of_parameter).collect();
    match kind {
        Kind::Group(parameters) => form.fields = parameters.iter().map(of_parameter).collect(),
        Kind::List(of) => form = Form { kind: of_kind(*of).kind, ..form },
        Kind::OneOf(tag, kinds) => {
            form.tag = tag.into();
            form.options = kinds.iter().map(|kind| kind.name.to_string()).collect();
            form.kinds = kinds.iter().map(|kind| (kind.name.to_string(), inner(kind))).collect();
        }
        _ => {}
    }
    form
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_have_every_material_and_light_with_ranges_choices_and_words() {
        let forms = forms();
        for name in snell_scene::material::MaterialKind::NAMES {
            assert!(forms["material"].kinds.contains_key(*name), "{name}");
        }
        for name in snell_scene::Light::NAMES {
            assert!(forms["light"].kinds.contains_key(*name), "{name}");
        }
        let glass = &forms["material"].kinds["dielectric"];
        let field = |name: &str| glass.iter().find(|form| form.name == name).expect(name);
        assert_eq!((&*field("ior").kind, field("ior").range), ("number", Some([0.2, 6.0])));
        assert_eq!(field("microfacets").options, ["ggx", "beckmann"]);
        assert!(field("roughness").doc.starts_with("Roughness"));
        assert_eq!(field("roughness").limits, [Some(0.0), Some(1.0)]);
        assert!(field("tint").is_textured && !field("absorption").is_textured);
        assert!(forms["material"].docs["dielectric"].starts_with("The interface"));
        let axes = &forms["light"].kinds["rectangle"];
        assert!(axes.iter().any(|form| form.name == "axes" && form.kind == "vector"));
        let spot = forms["light"].kinds["spot"].iter().find(|form| form.name == "falloff");
        assert_eq!(spot.expect("spots fall off").kinds["power"][0].unit, "radians");
    }

    #[test]
    fn an_emptied_field_has_a_default_to_go_back_to() {
        let forms = forms();
        let default = |family: &str, kind: &str, name: &str| {
            let fields = &forms[family].kinds[kind];
            fields.iter().find(|field| field.name == name).expect(name).default.clone()
        };
        assert_eq!(default("material", "dielectric", "ior"), 1.5);
        assert_eq!(default("material", "dielectric", "roughness")["factor"], 0.0);
        assert_eq!(default("material", "open-pbr", "specular_ior")["factor"], 1.5);
        assert_eq!(default("light", "point", "attenuation"), serde_json::json!([0.0, 0.0, 1.0]));
        let common = |name: &str| forms["material"].fields.iter().find(|f| f.name == name);
        assert_eq!(common("alpha").expect("it is common").default["factor"], 1.0);
    }

    #[test]
    fn every_kind_has_an_example_to_begin_with() {
        let (forms, examples) = (forms(), examples());
        for (family, form) in forms {
            for kind in form.kinds.keys() {
                let example = &examples[&family][kind];
                assert_eq!(example[&form.tag], **kind, "{family} {kind}");
            }
        }
    }
}
