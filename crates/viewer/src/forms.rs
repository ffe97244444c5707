//! Forms of the page: what the page needs to edit parameters, taken from their declarations.

use serde::Serialize;
use snell_math::parameters::{Declaration, Kind, Parameter};
use snell_render::{Request, Setting};
use snell_scene::families::Family;
use std::collections::BTreeMap;

/// How the page shows one parameter.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Form {
    /// The name of the parameter.
    pub name: String,
    /// The control for the parameter: `flag`, `number`, `color`, `vector`, `choice`, or `other`.
    pub kind: String,
    /// The plausible range of a number, if it is bounded on both sides.
    pub range: Option<[f64; 2]>,
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

/// The forms of all materials and lights, each as if it were one parameter.
pub fn forms() -> BTreeMap<String, Form> {
    let families = ["material", "light"].into_iter().filter_map(Family::named);
    families.map(|family| (family.name.to_string(), of_family(family))).collect()
}

fn of_family(family: &Family) -> Form {
    let kinds = of_kind(Kind::OneOf(family.tag, family.kinds));
    let fields = family.common.iter().map(of_parameter).collect();
    Form { name: family.name.into(), fields, ..kinds }
}

fn of_parameter(parameter: &Parameter) -> Form {
    Form {
        name: parameter.name.into(),
        range: parameter.usual.ends(),
        unit: parameter.unit.into(),
        doc: parameter.text(),
        ..of_kind(parameter.kind)
    }
}

fn of_kind(kind: Kind) -> Form {
    let kind = kind.required();
    let name = match kind {
        Kind::Flag => "flag",
        Kind::Number | Kind::Whole | Kind::TexturedNumber | Kind::RefractiveIndex => "number",
        Kind::Color | Kind::TexturedColor => "color",
        Kind::Vector(_) | Kind::Numbers(_) => "vector",
        Kind::OneOf("", kinds) if kinds.iter().all(|kind| kind.parameters.is_empty()) => "choice",
        _ => "other",
    };
    let mut form = Form {
        name: String::new(),
        kind: name.into(),
        range: None,
        unit: String::new(),
        doc: String::new(),
        options: Vec::new(),
        fields: Vec::new(),
        tag: String::new(),
        kinds: BTreeMap::new(),
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
        let axes = &forms["light"].kinds["rectangle"];
        assert!(axes.iter().any(|form| form.name == "axes" && form.kind == "vector"));
        let spot = forms["light"].kinds["spot"].iter().find(|form| form.name == "falloff");
        assert_eq!(spot.expect("spots fall off").kinds["power"][0].unit, "radians");
    }
}
