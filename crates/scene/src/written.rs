//! Compares values as scene files and users write them with the declarations of parameters, before
//! `serde` reads them. It finds names that nothing declares, and values of the wrong type. And the
//! written form of affine maps.

use serde_json::Value;
use snell_math::parameters::{Kind, Parameter};
use snell_math::{DAffine3, DMat3, DVec3};

/// An affine map as it is written in scenes: three rows of four numbers.
pub type Rows = [[f64; 4]; 3];

/// An affine map in rows.
pub fn rows(map: &DAffine3) -> Rows {
    let (m, t) = (map.matrix3, map.translation);
    std::array::from_fn(|i| [m.x_axis[i], m.y_axis[i], m.z_axis[i], t[i]])
}

/// The affine map of rows.
pub fn affine(rows: &Rows) -> DAffine3 {
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

/// The names that an object may have; `None` if it has no declared names.
fn names(kind: Kind, value: &Value) -> Option<Vec<&'static str>> {
    let named = |parameters: &[Parameter]| parameters.iter().map(|p| p.name).collect();
    match kind.required() {
        Kind::Group(parameters) => Some(named(parameters)),
        Kind::OneOf("", variants) => Some(variants.iter().map(|v| v.name).collect()),
        Kind::OneOf(tag, variants) => {
            let variant = variants.iter().find(|v| value[tag] == v.name)?;
            Some([vec![tag], named(variant.fields())].concat())
        }
        Kind::TexturedNumber => Some(vec!["factor", "texture"]),
        Kind::TexturedColor => Some(vec!["factor", "texture", "spectrum"]),
        _ => None,
    }
}

/// The kind of the value under a name of an object; `None` if it is not declared.
fn kind_of(kind: Kind, value: &Value, name: &str) -> Option<Kind> {
    match kind.required() {
        Kind::OneOf(tag, variants) if !tag.is_empty() => {
            let variant = variants.iter().find(|v| value[tag] == v.name)?;
            variant.get(name).map(|parameter| parameter.kind)
        }
        kind => kind.inside(name),
    }
}

/// Calls `look` with every value whose kind is declared, and with the value's place in the whole.
fn walk(kind: Kind, value: &Value, place: &str, look: &mut dyn FnMut(&str, Kind, &Value)) {
    look(place, kind, value);
    let inside = |step: &str| match place {
        "" => step.to_string(),
        _ => format!("{place}.{step}"),
    };
    match (kind.required(), value) {
        (Kind::List(of), Value::Array(items)) => {
            for (i, item) in items.iter().enumerate() {
                walk(*of, item, &inside(&i.to_string()), look);
            }
        }
        (kind, Value::Object(fields)) => {
            for (name, field) in fields {
                if let Some(kind) = kind_of(kind, value, name) {
                    walk(kind, field, &inside(name), look);
                }
            }
        }
        _ => {}
    }
}

/// The names in a value that no declaration has, which would be ignored. Each is given with its
/// place and the names that are valid there.
pub fn unknown_names(kind: Kind, value: &Value) -> Vec<String> {
    let mut unknown = Vec::new();
    walk(kind, value, "", &mut |place, kind, value| {
        let (Some(known), Value::Object(fields)) = (names(kind, value), value) else { return };
        for name in fields.keys().filter(|name| !known.contains(&name.as_str())) {
            let of = if place.is_empty() { String::new() } else { format!(" of {place}") };
            let hint = crate::overrides::nearest(name, &known);
            let hint = hint.map(|name| format!("; did you mean {name}?")).unwrap_or_default();
            let known = known.join(", ");
            unknown.push(format!("there is no parameter \"{name}\"{of}{hint} (known: {known})"));
        }
    });
    unknown
}

/// The first value whose type differs from its declaration, such as text for a number: its place,
/// its declared kind, and the value. `None` if there is none.
pub fn misfit(kind: Kind, value: &Value) -> Option<(String, Kind, Value)> {
    let mut found = None;
    walk(kind, value, "", &mut |place, kind, value| {
        let fits = match kind {
            Kind::Optional(_) if value.is_null() => true,
            _ => match kind.required() {
                Kind::Flag => value.is_boolean(),
                Kind::Number | Kind::Whole => value.is_number(),
                Kind::TexturedNumber => value.is_number() || value.is_object(),
                Kind::TexturedColor | Kind::Group(_) => value.is_object(),
                Kind::Color | Kind::Vector(_) | Kind::Numbers(_) | Kind::List(_) => {
                    value.is_array()
                }
                _ => true,
            },
        };
        if !fits && found.is_none() && !place.is_empty() {
            found = Some((place.to_string(), kind, value.clone()));
        }
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::FAMILIES;
    use crate::material::MaterialKind;
    use serde_json::json;
    use snell_math::parameters::Value as Parameters;

    #[test]
    fn what_is_written_has_no_unknown_names_and_a_name_more_is_found_everywhere() {
        for family in FAMILIES {
            let kind = Kind::OneOf(family.tag, family.kinds);
            for example in (family.examples)() {
                assert_eq!(unknown_names(kind, &example), [""; 0], "{example}");
                assert!(misfit(kind, &example).is_none(), "{example}");
                let mut more = example.clone();
                more["nonsense"] = json!(1);
                assert_eq!(unknown_names(kind, &more).len(), 1, "{more}");
            }
        }
    }

    #[test]
    fn places_are_named() {
        let plastic = json!({"material": "plastic", "diffuse": 0.5, "roughness": {"facto": 1}});
        let kind = <MaterialKind as Parameters>::KIND;
        let unknown = unknown_names(kind, &plastic);
        let expected = "there is no parameter \"facto\" of roughness; did you mean factor? \
            (known: factor, texture)";
        assert_eq!(unknown, [expected]);
        let (place, kind, _) = misfit(kind, &plastic).expect("a colour is no number");
        assert_eq!((place.as_str(), kind), ("diffuse", Kind::TexturedColor));
    }
}
