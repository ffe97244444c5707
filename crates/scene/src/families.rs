//! The families of things with parameters, with everything that their declarations state. Tests,
//! the documentation, Python and the viewer iterate over the families, so a new kind or parameter
//! appears everywhere once it is declared.

mod pictures;
mod reference;

pub use reference::{describe, reference};

use crate::material::{Diffuse, Material, MaterialKind};
use crate::texture::Pattern;
use crate::{Camera, Light, Medium, Projection};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use snell_intersect::AnyShape;
use snell_math::parameters::{Declaration, Declared, Parameter};
use snell_math::{DVec3, Rgb};

/// All kinds of things of one sort, such as the materials.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// The name of one thing, in the singular.
    pub name: &'static str,
    /// The name of several things, in the plural.
    pub title: &'static str,
    /// The field that selects the kind of a thing.
    pub tag: &'static str,
    /// The declarations of the kinds.
    pub kinds: &'static [Declaration],
    /// The parameters common to all kinds.
    pub common: &'static [Parameter],
    /// A few examples of each kind, in the syntax of scenes.
    pub examples: fn() -> Vec<Value>,
    /// Reads a thing and writes it again; the error is the reason why it cannot be read.
    read: fn(Value) -> Result<Value, serde_json::Error>,
    /// Makes a thing of some kind, with the common parameters, in the syntax of scenes.
    plain: fn() -> Value,
    /// Does what [`Self::read`] does, for the value that [`Self::plain`] makes.
    read_plain: fn(Value) -> Result<Value, serde_json::Error>,
}

/// All families.
pub const FAMILIES: &[Family] = &[
    Family {
        name: "material",
        title: "Materials",
        tag: MaterialKind::TAG,
        kinds: MaterialKind::DECLARATIONS,
        common: Material::PARAMETERS,
        examples: || written(&MaterialKind::examples()),
        read: read::<MaterialKind>,
        plain: || one(&Material::new("", Diffuse::new(Rgb::WHITE))),
        read_plain: read::<Material>,
    },
    Family {
        name: "pattern",
        title: "Patterns",
        tag: Pattern::TAG,
        kinds: Pattern::DECLARATIONS,
        common: &[],
        examples: || written(&Pattern::examples()),
        read: read::<Pattern>,
        plain: || Value::Null,
        read_plain: Ok,
    },
    Family {
        name: "medium",
        title: "Media",
        tag: Medium::TAG,
        kinds: Medium::DECLARATIONS,
        common: &[],
        examples: || written(&Medium::examples()),
        read: read::<Medium>,
        plain: || Value::Null,
        read_plain: Ok,
    },
    Family {
        name: "light",
        title: "Lights",
        tag: Light::TAG,
        kinds: Light::DECLARATIONS,
        common: &[],
        examples: || written(&Light::examples()),
        read: read::<Light>,
        plain: || Value::Null,
        read_plain: Ok,
    },
    Family {
        name: "shape",
        title: "Shapes",
        tag: AnyShape::TAG,
        kinds: AnyShape::DECLARATIONS,
        common: &[],
        examples: || written(&AnyShape::examples()),
        read: read::<AnyShape>,
        plain: || Value::Null,
        read_plain: Ok,
    },
    Family {
        name: "projection",
        title: "Cameras",
        tag: "projection",
        kinds: Projection::DECLARATIONS,
        common: Camera::PARAMETERS,
        examples: || written(&Projection::examples()),
        read: read::<Projection>,
        plain: || {
            let projection = Projection::Panoramic;
            one(&Camera::from_direction(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, projection))
        },
        read_plain: read::<Camera>,
    },
];

fn one(thing: &impl Serialize) -> Value {
    serde_json::to_value(thing).unwrap_or_default()
}

fn written(things: &[impl Serialize]) -> Vec<Value> {
    things.iter().map(one).collect()
}

fn read<T: Serialize + DeserializeOwned>(written: Value) -> Result<Value, serde_json::Error> {
    serde_json::to_value(serde_json::from_value::<T>(written)?)
}

impl Family {
    /// The family of this name; `None` if there is none.
    pub fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.iter().find(|family| family.name == name)
    }

    /// The kind of this name; `None` if there is none.
    pub fn kind(&self, name: &str) -> Option<&'static Declaration> {
        self.kinds.iter().find(|kind| kind.name == name)
    }

    /// The first example of a kind, in the syntax of scenes.
    pub fn example(&self, kind: &str) -> Map<String, Value> {
        let examples = (self.examples)().into_iter();
        let of_kind = |example: &Value| example.get(self.tag).and_then(Value::as_str) == Some(kind);
        match examples.into_iter().find(of_kind) {
            Some(Value::Object(fields)) => fields,
            _ => Map::new(),
        }
    }

    /// The default of a parameter of a kind, in the syntax of scenes; `None` if the parameter is
    /// required.
    pub fn default_of(&self, kind: &str, parameter: &str) -> Option<Value> {
        let mut fields = self.example(kind);
        fields.remove(parameter);
        let read = (self.read)(Value::Object(fields)).ok()?;
        read.get(parameter).cloned()
    }

    /// The parameters of a kind that have no default, with the values of its first example: what a
    /// `.snell` file means that leaves them out.
    pub fn usual(&self, kind: &str) -> Map<String, Value> {
        let required = |name: &String| name != self.tag && self.default_of(kind, name).is_none();
        self.example(kind).into_iter().filter(|(name, _)| required(name)).collect()
    }

    /// The parameters of all kinds that have no default, with the values that a `.snell` file means
    /// that leaves them out.
    pub fn usual_common(&self) -> Map<String, Value> {
        let Value::Object(fields) = (self.plain)() else { return Map::new() };
        let is_required = |name: &String| self.common_default_of(name).is_none();
        fields.into_iter().filter(|(name, _)| is_required(name)).collect()
    }

    /// The default of a parameter that all kinds have, in the syntax of scenes; `None` if the
    /// parameter is required.
    pub fn common_default_of(&self, parameter: &str) -> Option<Value> {
        let mut thing = (self.plain)();
        thing.as_object_mut()?.remove(parameter);
        (self.read_plain)(thing).ok()?.get(parameter).cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use snell_intersect::Shape;
    use snell_math::parameters::{Kind, Leaf, Range, Step, find, place_of};

    /// Asserts that written values have the declared names and form.
    fn agree(kind: Kind, written: &Value, place: &str) {
        match (kind, written) {
            (Kind::Optional(_), Value::Null) => {}
            (Kind::Optional(kind), _) => agree(*kind, written, place),
            (Kind::Group(parameters), Value::Object(fields)) => {
                agree_all(parameters, fields, "", place);
            }
            (Kind::OneOf("", kinds), Value::String(name)) => {
                assert!(kinds.iter().any(|kind| kind.name == name), "{place}: {name}");
            }
            (Kind::OneOf("", kinds), Value::Object(fields)) => {
                assert_eq!(fields.len(), 1, "{place}: {written}");
                for (name, inner) in fields {
                    let kind = kinds.iter().find(|kind| kind.name == name).expect(place);
                    match kind.parameters {
                        [Parameter { name: "", kind, .. }] => agree(*kind, inner, place),
                        parameters => agree(Kind::Group(parameters), inner, place),
                    }
                }
            }
            (Kind::OneOf(tag, kinds), Value::Object(fields)) => {
                let name = fields[tag].as_str().expect("the tag is a name");
                let kind = kinds.iter().find(|kind| kind.name == name).expect(place);
                agree_all(kind.fields(), fields, tag, place);
            }
            (Kind::TexturedNumber | Kind::TexturedColor, Value::Object(fields)) => {
                assert!(fields.contains_key("factor") && fields.contains_key("texture"), "{place}");
            }
            (Kind::Flag, Value::Bool(_)) | (Kind::Text(_), Value::String(_)) => {}
            (Kind::Whole | Kind::Reference(_), Value::Number(n)) => assert!(n.is_u64(), "{place}"),
            (Kind::Number | Kind::RefractiveIndex, Value::Number(_)) => {}
            (Kind::RefractiveIndex, Value::String(_)) | (Kind::Table, _) => {}
            (Kind::Color, Value::Array(items)) => assert_eq!(items.len(), 3, "{place}"),
            (Kind::Vector(n) | Kind::Numbers(n), Value::Array(items)) => {
                assert_eq!(items.len(), n, "{place}");
            }
            (Kind::List(kind), Value::Array(items)) => {
                items.iter().for_each(|item| agree(*kind, item, place));
            }
            (Kind::Matrix, Value::Array(_)) => {}
            (kind, written) => panic!("{place}: declared {kind:?}, written {written}"),
        }
    }

    fn agree_all(parameters: &[Parameter], fields: &Map<String, Value>, tag: &str, place: &str) {
        let mut declared: Vec<&str> =
            parameters.iter().filter(|p| !is_cells(p.kind)).map(|p| p.name).collect();
        let mut names: Vec<&str> =
            fields.keys().map(String::as_str).filter(|name| *name != tag).collect();
        declared.sort_unstable();
        names.sort_unstable();
        assert_eq!(declared, names, "{place}: what is declared, and what is written");
        for parameter in parameters.iter().filter(|p| !is_cells(p.kind)) {
            let place = format!("{place}.{}", parameter.name);
            agree(parameter.kind, &fields[parameter.name], &place);
        }
    }

    /// True for the cells of grids, which are not part of the written value.
    fn is_cells(kind: Kind) -> bool {
        kind.required() == Kind::Cells
    }

    #[test]
    fn every_kind_declares_the_names_and_forms_that_serialization_writes() {
        for family in FAMILIES {
            let names: Vec<&str> = family.kinds.iter().map(|kind| kind.name).collect();
            for example in (family.examples)() {
                let name = example[family.tag].as_str().expect("the tag is a name");
                assert!(names.contains(&name), "{} {name} is not declared", family.name);
                agree(Kind::OneOf(family.tag, family.kinds), &example, name);
            }
            for name in names {
                assert!(!family.example(name).is_empty(), "{name} has no example");
            }
            if !family.common.is_empty() {
                agree(Kind::Group(family.common), &(family.plain)(), family.name);
            }
        }
    }

    /// A number just outside a range; `None` if the range allows all numbers.
    fn outside(range: Range) -> Option<f64> {
        match range {
            Range::Any | Range::Direction => None,
            Range::Within(_, most) if most < 1e20 => Some(most + most.abs().max(1.0)),
            Range::Within(least, _) => Some(least - 1.0),
            Range::Between(_, most) => Some(most),
            Range::Positive => Some(0.0),
        }
    }

    /// Copies of the thing, each with one number outside of its range. Returns the key of the
    /// number's place, the number, and the copy.
    fn spoilt<T>(thing: &T) -> Vec<(String, f64, T)>
    where
        T: snell_math::parameters::Value + Serialize + DeserializeOwned,
    {
        let mut places = Vec::new();
        find(thing, &mut |found| {
            let index = match found.leaf {
                Leaf::Numbers(all) => all.iter().position(Option::is_some).map(Step::Index),
                Leaf::Number(_) => None,
                Leaf::Reference(..) => return,
            };
            let steps: Vec<Step> = found.place.iter().copied().chain(index).collect();
            places.extend(outside(found.range).map(|x| (steps, x)));
        });
        let spoil = |(steps, x): (Vec<Step>, f64)| {
            let mut written = one(thing);
            let pointer: String = steps.iter().map(|step| format!("/{step}")).collect();
            let is_whole = written.pointer(&pointer).expect(&pointer).is_u64();
            *written.pointer_mut(&pointer).expect(&pointer) =
                if is_whole { Value::from(x as u64) } else { Value::from(x) };
            let spoilt = serde_json::from_value(written).expect("numbers of any size are read");
            (place_of(&steps), x, spoilt)
        };
        places.into_iter().map(spoil).collect()
    }

    /// Asserts that each number outside of its range is an error when `-D` sets it, and a warning
    /// when a scene that has it is read.
    fn ranges_hold<T>(thing: &T, key: &str, add: fn(&mut Scene, T))
    where
        T: snell_math::parameters::Value + Serialize + DeserializeOwned + Clone,
    {
        for (place, x, spoilt) in spoilt(thing) {
            let mut scene = Scene::new("");
            add(&mut scene, thing.clone());
            let definition = format!("{key}.0.{place}={x}");
            let error = crate::overrides::apply(&mut scene, &definition).expect_err(&definition);
            assert!(error.to_string().contains("is not possible"), "{error}");
            let mut scene = Scene::new("");
            add(&mut scene, spoilt);
            scene.check_ranges();
            let warned = scene.warnings.iter().any(|w| w.message.contains("is not possible"));
            assert!(warned, "{definition}: no warning");
        }
    }

    #[test]
    fn every_range_is_enforced_by_readers_and_by_changes_on_the_command_line() {
        for kind in MaterialKind::examples() {
            let add = |scene: &mut Scene, material| scene.materials.push(material);
            ranges_hold(&Material::new("", kind), "material", add);
        }
        for light in Light::examples() {
            ranges_hold(&light, "light", |scene, light| scene.add_light(light));
        }
        for medium in Medium::examples() {
            ranges_hold(&medium, "medium", |scene, medium| scene.media.push(medium));
        }
        for projection in Projection::examples() {
            let camera = Camera::from_direction(DVec3::ONE, DVec3::X, DVec3::Y, projection);
            ranges_hold(&camera, "camera", |scene, camera| scene.cameras.push(camera));
        }
        for pattern in Pattern::examples() {
            for (place, x, spoilt) in spoilt(&pattern) {
                let mut scene = Scene::new("");
                scene.add_texture(spoilt);
                scene.check_ranges();
                assert_eq!(scene.warnings.len(), 1, "{place} is {x}");
            }
        }
        for shape in AnyShape::examples() {
            for (place, x, spoilt) in spoilt(&shape) {
                assert!(spoilt.validate().is_err(), "{place} is {x}");
            }
        }
    }

    #[test]
    fn every_declaration_is_documented() {
        fn look(parameters: &[Parameter], place: &str) {
            for parameter in parameters {
                let place = format!("{place}.{}", parameter.name);
                let is_sentence = parameter.text().ends_with(['.', ')']);
                assert!(parameter.name.is_empty() || is_sentence, "{place}");
                match parameter.kind.required() {
                    Kind::Group(inner) => look(inner, &place),
                    Kind::OneOf(_, kinds) => kinds.iter().for_each(|kind| {
                        assert!(kind.text().ends_with(['.', ')']), "{place}.{}", kind.name);
                        look(kind.parameters, &place);
                    }),
                    _ => {}
                }
            }
        }
        for family in FAMILIES {
            look(family.common, family.name);
            for kind in family.kinds {
                assert!(kind.text().ends_with(['.', ')']), "{}", kind.name);
                look(kind.parameters, kind.name);
            }
        }
    }

    #[test]
    fn defaults_are_what_an_empty_description_gives() {
        for family in FAMILIES {
            for kind in family.kinds {
                let mut least = Map::from_iter([(family.tag.to_string(), kind.name.into())]);
                let mut expected = Map::new();
                for parameter in kind.fields().iter().filter(|p| !is_cells(p.kind)) {
                    let default = family.default_of(kind.name, parameter.name);
                    if default.is_none() {
                        let given = family.example(kind.name)[parameter.name].clone();
                        least.insert(parameter.name.to_string(), given);
                    }
                    expected.extend(default.map(|value| (parameter.name.to_string(), value)));
                }
                let read = (family.read)(Value::Object(least)).expect(kind.name);
                for (name, default) in expected {
                    assert_eq!(read[&name], default, "{} {name}", kind.name);
                }
            }
        }
        let material = Family::named("material").expect("there are materials");
        let kind = one(&MaterialKind::from(Diffuse::new(Rgb::WHITE)));
        let empty = serde_json::json!({ "kind": kind });
        assert_eq!(read::<Material>(empty).expect("it has a kind"), (material.plain)());
        assert_eq!(material.default_of("diffuse", "reflectance"), None);
        assert_eq!(
            material.default_of("open-pbr", "specular_ior").expect("it has one")["factor"],
            1.5
        );
    }
}
