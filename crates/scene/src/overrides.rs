//! Changes to a scene by name: `-D key=value` on the command line, and edits in the viewer.
//!
//! A key is a path into the scene: `material.NAME.PARAMETER`, `camera.NAME.PARAMETER`,
//! `light.NUMBER.PARAMETER`, `medium.NUMBER.PARAMETER`, `node.NAME.visible`, `environment.rotation`
//! (degrees about the scene's up axis, counter-clockwise as seen from above), `environment.scale`,
//! `environment`, `background`, `background.color`, `ambient`. `material.NUMBER`, `light.NUMBER`,
//! `camera.NUMBER`, `texture.NUMBER` and `image.NUMBER` are whole entries of the scene's tables;
//! the number behind the last adds one, and `light.NUMBER=null` removes a light. The parameters are
//! those that the types in the scene declare. The value is JSON; anything that is not JSON is taken
//! as plain text.

mod node;
mod surroundings;
mod table;

pub use surroundings::rotation;

use crate::material::MaterialKind;
use crate::ranges::BRIGHTEST;
use crate::written::{misfit, unknown_names};
use crate::{Image, Material, Scene};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use snell_math::Rgb;
use snell_math::parameters::{Kind, Value as Parameters, problem_at};
use std::sync::Arc;

/// Opens the picture of a name; the error says why it cannot be.
pub type OpenPicture<'a> = &'a dyn Fn(&str) -> Result<Arc<Image>, String>;

/// The reason why a change is not possible, with the alternatives.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("-D {key}: {problem}")]
pub struct OverrideError {
    /// The key of the change, or the whole definition if it has no key.
    pub key: String,
    /// The reason why the change is not possible.
    pub problem: String,
}

fn error(key: &str, problem: impl Into<String>) -> OverrideError {
    OverrideError { key: key.to_string(), problem: problem.into() }
}

/// Applies one change `key=value`. If that fails, the scene is unchanged. No pictures are opened.
pub fn apply(scene: &mut Scene, definition: &str) -> Result<(), OverrideError> {
    apply_with(scene, definition, &|name| Err(format!("{name}: there is no such picture here")))
}

/// Applies one change `key=value`, which may name a picture. If that fails, the scene is unchanged.
pub fn apply_with(
    scene: &mut Scene,
    definition: &str,
    picture: OpenPicture<'_>,
) -> Result<(), OverrideError> {
    let Some((key, text)) = definition.split_once('=') else {
        let problem = "expected key=value, such as material.floor.reflectance.factor=[1,0,0]";
        return Err(error(definition, problem));
    };
    let value = value_of(text);
    if let Some(outcome) = table::edit(scene, key, &value, picture) {
        return outcome;
    }
    let (family, rest) = key.split_once('.').unwrap_or((key, ""));
    match family {
        "ambient" => {
            scene.ambient = light(key, value)?;
            Ok(())
        }
        "material" => {
            let names: Vec<String> = scene.materials.iter().map(|m| m.name.clone()).collect();
            let (index, path) = find(key, "material", &names, rest)?;
            let value = match value {
                Value::String(name) if path == "kind" => kind_named(key, &name)?,
                value => value,
            };
            let mut material = scene.materials[index].clone();
            edit_material(&mut material, key, path, value, edit_checked)?;
            if let Some(texture) = scene.missing_texture(&material) {
                let count = scene.textures.len();
                return Err(error(
                    key,
                    format!("there is no texture {}: the scene has {count}", texture.0),
                ));
            }
            scene.materials[index] = material;
            Ok(())
        }
        "camera" => {
            let names: Vec<String> = scene.cameras.iter().map(|c| c.name.clone()).collect();
            let (index, path) = find(key, "camera", &names, rest)?;
            edit_checked(&mut scene.cameras[index], key, path, value)?;
            scene.cameras[index].square_up();
            Ok(())
        }
        "light" => {
            let names = vec![String::new(); scene.lights.len()];
            let (index, path) = find(key, "light", &names, rest)?;
            edit_checked(&mut scene.lights[index], key, path, value)
        }
        "medium" => {
            let names = vec![String::new(); scene.media.len()];
            let (index, path) = find(key, "medium", &names, rest)?;
            let before = scene.media[index].clone();
            edit_checked(&mut scene.media[index], key, path, value)?;
            scene.media[index].keep_grids_of(&before);
            Ok(())
        }
        "node" => node::edit(scene, key, rest, value),
        "environment" => surroundings::edit_environment(scene, key, rest, value, picture),
        "background" => surroundings::edit_background(scene, key, rest, value),
        _ => {
            let known = "material.NAME, camera.NAME, light.NUMBER, medium.NUMBER, node.NAME, \
                texture.NUMBER, image.NUMBER, environment, background";
            let names: Vec<_> = scene.parameters.iter().map(|(name, _)| name.as_str()).collect();
            let own =
                if names.is_empty() { String::new() } else { format!(", or {}", names.join(", ")) };
            Err(error(key, format!("unknown key; keys begin with {known}, or are ambient{own}")))
        }
    }
}

/// A value as people write it: JSON, in which numbers may begin with a point or a plus and end with
/// a point, or plain text.
fn value_of(text: &str) -> Value {
    serde_json::from_str(text)
        .or_else(|_| serde_json::from_str(&spelled_out(text)))
        .unwrap_or_else(|_| Value::String(text.to_string()))
}

/// A text with the numbers outside of quotes as JSON has them: `.5` becomes `0.5`.
fn spelled_out(text: &str) -> String {
    let letters: Vec<char> = text.chars().collect();
    let is_digit =
        |i: Option<usize>| i.and_then(|i| letters.get(i)).is_some_and(char::is_ascii_digit);
    let (mut out, mut is_quoted) = (String::new(), false);
    for (i, &letter) in letters.iter().enumerate() {
        is_quoted ^= letter == '"' && (i == 0 || letters[i - 1] != '\\');
        let after_digit = is_digit(i.checked_sub(1));
        match letter {
            '+' if !is_quoted && !after_digit && !out.ends_with(['e', 'E']) => {}
            '.' if !is_quoted => {
                out.push_str(if after_digit { "." } else { "0." });
                if !is_digit(Some(i + 1)) {
                    out.push('0');
                }
            }
            _ => out.push(letter),
        }
    }
    out
}

fn edit_material(
    material: &mut Material,
    key: &str,
    path: &str,
    value: Value,
    edit: fn(&mut Material, &str, &str, Value) -> Result<(), OverrideError>,
) -> Result<(), OverrideError> {
    let before = material.kind.clone();
    edit(material, key, path, value)?;
    material.follow_kind(&before);
    Ok(())
}

/// The entry of a table at a position; an error if there is none.
fn entry<'a, T>(table: &'a mut [T], number: usize, path: &str) -> Result<&'a mut T, OverrideError> {
    table.get_mut(number).ok_or_else(|| error(path, format!("there is no number {number}")))
}

/// Changes a parameter of a material, which is given by its position in the scene's table.
pub fn set_material(
    scene: &mut Scene,
    number: usize,
    path: &str,
    value: Value,
) -> Result<(), OverrideError> {
    edit_material(entry(&mut scene.materials, number, path)?, path, path, value, edit)
}

/// Changes a parameter of a light, which is given by its position in the scene's table.
pub fn set_light(
    scene: &mut Scene,
    number: usize,
    path: &str,
    value: Value,
) -> Result<(), OverrideError> {
    edit(entry(&mut scene.lights, number, path)?, path, path, value)
}

/// Changes a parameter of a camera, which is given by its position in the scene's table.
pub fn set_camera(
    scene: &mut Scene,
    number: usize,
    path: &str,
    value: Value,
) -> Result<(), OverrideError> {
    edit(entry(&mut scene.cameras, number, path)?, path, path, value)
}

/// A material of the kind of this name with default parameters, or the kind's first example if some
/// parameters have no default.
fn kind_named(key: &str, name: &str) -> Result<Value, OverrideError> {
    let plain = json!({ "material": name });
    if serde_json::from_value::<MaterialKind>(plain.clone()).is_ok() {
        return Ok(plain);
    }
    let example = MaterialKind::examples().into_iter().find(|kind| kind.name() == name);
    match example {
        Some(example) => serde_json::to_value(example).map_err(|e| error(key, e.to_string())),
        None => {
            let hint = nearest(name, MaterialKind::NAMES)
                .map(|n| format!("; did you mean {n}?"))
                .unwrap_or_default();
            Err(error(
                key,
                format!(
                    "there is no kind \"{name}\"{hint} (known: {})",
                    MaterialKind::NAMES.join(", ")
                ),
            ))
        }
    }
}

/// The thing that a key names, by name or by number, and the rest of the key. Names may contain
/// dots.
fn find<'a>(
    key: &str,
    what: &str,
    names: &[String],
    rest: &'a str,
) -> Result<(usize, &'a str), OverrideError> {
    for (index, name) in names.iter().enumerate() {
        if let Some(path) = rest.strip_prefix(name.as_str()).and_then(|r| r.strip_prefix('.'))
            && !name.is_empty()
        {
            return Ok((index, path));
        }
    }
    let (first, path) = rest.split_once('.').unwrap_or((rest, ""));
    let numbered = first.parse::<usize>().ok().filter(|index| *index < names.len());
    let named = !rest.is_empty() && names.iter().any(|name| name == rest);
    if path.is_empty() && (numbered.is_some() || named) {
        return Err(error(
            key,
            format!("which parameter of {what} {rest}? Give {key}.PARAMETER=VALUE"),
        ));
    }
    if let Some(index) = numbered {
        return Ok((index, path));
    }
    let known: Vec<_> = names
        .iter()
        .enumerate()
        .map(|(i, n)| if n.is_empty() { i.to_string() } else { n.clone() })
        .collect();
    let list = if known.is_empty() {
        "the scene has none".to_string()
    } else {
        format!("known: {}", known.join(", "))
    };
    Err(error(key, format!("there is no {what} \"{first}\" ({list})")))
}

fn edit<T: Serialize + DeserializeOwned + Parameters>(
    target: &mut T,
    key: &str,
    path: &str,
    value: Value,
) -> Result<(), OverrideError> {
    *target = edited(target, key, path, value)?;
    Ok(())
}

/// Applies a user's edit, whose numbers must be within their ranges. (Those of animations may
/// overshoot.)
fn edit_checked<T: Serialize + DeserializeOwned + Parameters>(
    target: &mut T,
    key: &str,
    path: &str,
    value: Value,
) -> Result<(), OverrideError> {
    if let Some(number) = too_large(&value) {
        return Err(error(
            key,
            format!("{number:e} is larger than any number that is computed with"),
        ));
    }
    let after = edited(target, key, path, value)?;
    let steps: Vec<&str> = path.split('.').collect();
    if let Some(problem) = problem_at(&after, &steps) {
        return Err(error(key, problem));
    }
    *target = after;
    Ok(())
}

/// The first number that does not fit in single precision, if there is one.
fn too_large(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64().filter(|x| !(*x as f32).is_finite()),
        Value::Array(items) => items.iter().find_map(too_large),
        Value::Object(fields) => fields.values().find_map(too_large),
        _ => None,
    }
}

fn edited<T: Serialize + DeserializeOwned + Parameters>(
    target: &T,
    key: &str,
    path: &str,
    value: Value,
) -> Result<T, OverrideError> {
    let mut tree = serde_json::to_value(target).map_err(|e| error(key, e.to_string()))?;
    let mut place = &mut tree;
    for step in path.split('.') {
        place = descend(place, key, step)?;
    }
    let kind = path.split('.').try_fold(T::KIND, |kind, step| kind.inside(step));
    if let Some(unknown) = kind.and_then(|kind| unknown_names(kind, &value).into_iter().next()) {
        return Err(error(key, unknown));
    }
    let misfit = kind.and_then(|kind| misfit(kind, &value));
    let before = std::mem::replace(place, value);
    serde_json::from_value(tree).map_err(|e| {
        if let Some((place, kind, found)) = misfit {
            let expected = expected(kind).unwrap_or_else(|| kind.to_string());
            return error(key, format!("{place} is {found}, expected {expected}"));
        }
        let now = if before.is_null() { "nothing".into() } else { before.to_string() };
        error(key, format!("{}; now it is {now}", in_words(&e.to_string(), kind)))
    })
}

/// The error message of `serde` for a value that does not fit. It keeps the value that was found,
/// and says what the declaration expects, without the names of Rust types.
fn in_words(message: &str, kind: Option<Kind>) -> String {
    let Some((found, own)) = message.split_once(", expected ") else { return message.to_string() };
    let expected = kind.and_then(expected).unwrap_or_else(|| own.to_string());
    format!("{}, expected {expected}", found.strip_prefix("invalid type: ").unwrap_or(found))
}

/// The syntax of a value in words; `None` if the message of the reader is more precise.
fn expected(kind: Kind) -> Option<String> {
    let names = |names: &mut dyn Iterator<Item = &str>| names.collect::<Vec<_>>().join(", ");
    Some(match kind {
        Kind::Flag => "true or false".into(),
        Kind::Number => "a number".into(),
        Kind::Whole => "a whole number".into(),
        Kind::TexturedNumber => "a number, or {\"factor\": number, \"texture\": …}".into(),
        Kind::Color => of_numbers(3),
        Kind::Vector(n) | Kind::Numbers(n) => of_numbers(n),
        Kind::TexturedColor => "{\"factor\":[1,1,1],\"texture\":null}".into(),
        Kind::Reference(table) => format!("the number of a {table}"),
        Kind::OneOf("", kinds) if kinds.iter().all(|kind| kind.parameters.is_empty()) => {
            format!("one of {}", names(&mut kinds.iter().map(|kind| kind.name)))
        }
        Kind::OneOf("", _) => return None,
        Kind::OneOf(tag, kinds) => {
            let names = names(&mut kinds.iter().map(|kind| kind.name));
            format!("an object with its parameters, whose \"{tag}\" is one of {names}")
        }
        Kind::Group(parameters) => {
            format!("an object with {}", names(&mut parameters.iter().map(|p| p.name)))
        }
        Kind::Optional(kind) => format!("null, or {}", expected(*kind)?),
        _ => return None,
    })
}

fn of_numbers(n: usize) -> String {
    format!("a list of {n} numbers, such as [{}]", vec!["1"; n].join(","))
}

/// The value one step further down in a tree. Materials hold their parameters one level down
/// (`kind`), which keys may leave out.
fn descend<'a>(tree: &'a mut Value, key: &str, step: &str) -> Result<&'a mut Value, OverrideError> {
    let shown = tree.clone();
    if let Value::Array(items) = tree {
        let length = items.len();
        return step.parse::<usize>().ok().and_then(|i| items.get_mut(i)).ok_or_else(|| {
            error(
                key,
                format!("\"{step}\" is not a position from 0 to {}", length.saturating_sub(1)),
            )
        });
    }
    let inner = tree.get("kind").is_some_and(|k| k.get(step).is_some()) && tree.get(step).is_none();
    let tree = if inner { &mut tree["kind"] } else { tree };
    if tree.get(step).is_some() {
        return Ok(&mut tree[step]);
    }
    if !shown.is_object() {
        let problem =
            format!("there is no \"{step}\" in it: now it is {shown}; give all of it at once");
        return Err(error(key, problem));
    }
    let mut names: Vec<&str> =
        shown.as_object().map(|o| o.keys().map(String::as_str).collect()).unwrap_or_default();
    if let Some(kind) = shown.get("kind").and_then(Value::as_object) {
        names.extend(kind.keys().map(String::as_str));
    }
    let hint = nearest(step, &names).map(|n| format!("; did you mean {n}?")).unwrap_or_default();
    Err(error(key, format!("there is no parameter \"{step}\"{hint} (known: {})", names.join(", "))))
}

fn from_value<T: DeserializeOwned + Parameters>(
    key: &str,
    value: Value,
) -> Result<T, OverrideError> {
    serde_json::from_value(value).map_err(|e| error(key, in_words(&e.to_string(), Some(T::KIND))))
}

/// A value as the RGB of light; an error if it is not one.
fn light(key: &str, value: Value) -> Result<Rgb, OverrideError> {
    let light: Rgb = from_value(key, value)?;
    let possible = |x: f32| (0.0..=BRIGHTEST).contains(&x);
    if possible(light.r) && possible(light.g) && possible(light.b) {
        return Ok(light);
    }
    Err(error(key, format!("expected three numbers from 0 to {BRIGHTEST:e}")))
}

/// The name that is nearest to `name`, if one is near.
pub fn nearest<'a>(name: &str, names: &[&'a str]) -> Option<&'a str> {
    let best = names.iter().map(|n| (edit_distance(name, n), *n)).min()?;
    (best.0 <= name.chars().count().div_ceil(3).max(1)).then_some(best.1)
}

/// The number of insertions, deletions and replacements that turn one word into another
/// (Levenshtein).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Diffuse, MaterialKind};
    use crate::{Environment, Medium};
    use snell_math::{DAffine3, DVec3};

    fn scene() -> Scene {
        let mut scene = Scene::new("test");
        scene.add_material(Material::new("the.floor", Diffuse::new(Rgb::WHITE)));
        scene
    }

    #[test]
    fn a_kind_may_be_its_name_and_parameters_may_be_plain_values() {
        let mut scene = scene();
        for name in MaterialKind::NAMES {
            apply(&mut scene, &format!("material.the.floor.kind={name}")).expect("a kind by name");
            assert_eq!(scene.materials[0].kind.name(), *name);
        }
        apply(&mut scene, "material.the.floor.kind=open-pbr").expect("a kind by name");
        apply(&mut scene, "material.the.floor.base_color.factor=[0.5,0.25,0]").expect("a colour");
        apply(&mut scene, "material.the.floor.coat_weight=0.75").expect("a plain number");
        let MaterialKind::OpenPbr(p) = &scene.materials[0].kind else { panic!("not open-pbr") };
        assert_eq!((p.base_color.factor, p.coat_weight.factor), (Rgb::new(0.5, 0.25, 0.0), 0.75));
        for (text, color) in [(".5", 0.5), ("+.25", 0.25), ("1.", 1.0), ("5.e-1", 0.5)] {
            let definition = format!("material.the.floor.base_color.factor=[{text}, .75,0]");
            apply(&mut scene, &definition).expect("a colour");
            apply(&mut scene, &format!("material.the.floor.coat_weight={text}")).expect("a number");
            let MaterialKind::OpenPbr(p) = &scene.materials[0].kind else { panic!("not open-pbr") };
            let found = (p.base_color.factor, p.coat_weight.factor);
            assert_eq!(found, (Rgb::new(color, 0.75, 0.0), color), "{text}");
        }
        apply(&mut scene, "material.the.floor.name=a.b +c").expect("a name");
        assert_eq!(scene.materials[0].name, "a.b +c");
        scene.materials[0].name = "the.floor".into();
        let wrong =
            apply(&mut scene, "material.the.floor.coat_weight=much").expect_err("no number");
        assert!(wrong.to_string().contains("expected a number"), "{wrong}");
        let wrong = apply(&mut scene, "material.the.floor.kind=dielectrik").expect_err("no kind");
        assert!(wrong.to_string().contains("did you mean dielectric?"), "{wrong}");
    }

    #[test]
    fn names_that_nothing_declares_and_values_of_another_sort_are_errors_with_their_place() {
        let plastic = |more: &str| {
            let value = format!("{{\"material\":\"plastic\",{more}}}");
            apply(&mut scene(), &format!("material.0.kind={value}")).expect_err("no such kind")
        };
        let diffuse = "\"diffuse\":{\"factor\":[1,1,1],\"texture\":null}";
        let unknown = plastic(&format!("{diffuse},\"roughness\":{{\"factor\":0.2,\"x\":1}}"));
        let expected = "there is no parameter \"x\" of roughness (known: factor, texture)";
        assert!(unknown.to_string().ends_with(expected), "{unknown}");
        let number = plastic("\"diffuse\":0.5");
        assert!(number.to_string().contains("diffuse is 0.5, expected {\"factor\""), "{number}");
        let misspelt = plastic(&format!("{diffuse},\"rougness\":0.5"));
        assert!(misspelt.to_string().contains("did you mean roughness?"), "{misspelt}");
    }

    #[test]
    fn a_parameter_is_changed_by_its_path() {
        let mut scene = scene();
        apply(&mut scene, "material.the.floor.reflectance.factor=[0.5,0,0]")
            .expect("the path exists");
        apply(&mut scene, "material.0.double_sided=false").expect("the path exists");
        let MaterialKind::Diffuse(diffuse) = &scene.materials[0].kind else {
            panic!("still diffuse")
        };
        assert_eq!(diffuse.reflectance.factor, Rgb::new(0.5, 0.0, 0.0));
        assert!(!scene.materials[0].double_sided);
    }

    #[test]
    fn what_an_open_pbr_says_of_emission_and_opacity_counts_and_what_is_unknown_is_an_error() {
        let mut scene = scene();
        apply(&mut scene, "material.0.alpha=0.5").expect("the path exists");
        apply(&mut scene, r#"material.0.kind={"material":"open-pbr","emission_luminance":2}"#)
            .expect("a kind");
        assert_eq!(scene.materials[0].emission.factor, Rgb::splat(2.0));
        assert_eq!(scene.materials[0].alpha.factor, 0.5, "of opacity nothing was said");
        apply(&mut scene, "material.0.emission_color.factor=[0.5,1,0]").expect("the path exists");
        assert_eq!(scene.materials[0].emission.factor, Rgb::new(1.0, 2.0, 0.0));
        apply(&mut scene, "material.0.geometry_opacity=0.25").expect("the path exists");
        assert_eq!(
            (scene.materials[0].alpha.factor, scene.materials[0].alpha_mode),
            (0.25, crate::material::AlphaMode::Blend)
        );
        let wrong = apply(&mut scene, r#"material.0.kind={"material":"open-pbr","emision":2}"#)
            .expect_err("misspelt");
        assert!(wrong.to_string().contains("emision"), "{wrong}");
    }

    #[test]
    fn spectra_come_from_text() {
        let mut scene = scene();
        apply(&mut scene, "material.0.emission.spectrum=blackbody:3000").expect("a spectrum");
        let red = scene.materials[0].emission.spectrum.expect("it was set").light_rgb();
        assert!(red.r > red.g && red.g > red.b);
        let error = apply(&mut scene, "material.0.reflectance.spectrum=nonsense")
            .expect_err("no spectrum")
            .to_string();
        assert!(error.contains("blackbody:KELVIN"), "{error}");
    }

    #[test]
    fn media_are_changed_by_number_and_keep_their_grids() {
        let mut scene = crate::builtin::builtin("smoke").expect("the scene is built in");
        let before = scene.media[0].clone();
        apply(&mut scene, "medium.0.g=0.5").expect("the path exists");
        let (Medium::Grid(before), Medium::Grid(after)) = (&before, &scene.media[0]) else {
            panic!("a grid")
        };
        assert_eq!(after.g, 0.5);
        assert_eq!(*after, crate::medium::Grid { g: 0.5, ..before.clone() });
    }

    #[test]
    fn a_wrong_path_names_what_there_is() {
        let error =
            apply(&mut scene(), "material.0.reflectence=1").expect_err("misspelt").to_string();
        assert!(error.contains("did you mean reflectance?"), "{error}");
        let error = apply(&mut scene(), "material.0.reflectance.factor=red")
            .expect_err("no colour")
            .to_string();
        assert!(
            error.contains("a list of 3 numbers, such as [1,1,1]; now it is [1.0,1.0,1.0]"),
            "{error}"
        );
        let error =
            apply(&mut scene(), "material.wall.x=1").expect_err("no such material").to_string();
        assert!(error.contains("known: the.floor"), "{error}");
    }

    #[test]
    fn numbers_that_mean_nothing_and_textures_that_are_not_there_are_refused_and_change_nothing() {
        let mut scene = crate::builtin::builtin("cornell-box").expect("the scene is built in");
        let before = (scene.materials.clone(), scene.cameras.clone(), scene.ambient);
        for (definition, part) in [
            (
                "material.red.reflectance.factor=[0.5,-1,0]",
                "reflectance.factor.1: -1 is not possible, expected 0 to 1",
            ),
            (
                "material.lamp.emission.factor=[3e38,0,0]",
                "3e38 is not possible, expected 0 to 1e24",
            ),
            ("material.lamp.emission.factor=[1e39,0,0]", "1e39 is larger than any number"),
            ("material.red.reflectance.texture=7", "there is no texture 7: the scene has 0"),
            ("material.red=1", "Give material.red.PARAMETER=VALUE"),
            ("material.red.interior.medium=0", "now it is null; give all of it at once"),
            (
                "material.red.kind=5",
                "expected an object with its parameters, whose \"material\" is one of",
            ),
            ("material.red.double_sided=1", "integer `1`, expected true or false; now it is true"),
            ("ambient=[0,-1,0]", "expected three numbers from 0 to 1e24"),
            ("camera.0.towards=[0,0,0]", "expected a direction, not all zeros"),
            ("camera.0.focus_distance=-5", "-5 is not possible, expected more than 0"),
            ("camera.0.eye.0=1e30", "1e30 is not possible, expected -1e18 to 1e18"),
            (
                "camera.0.projection.tan_half_fov=[0,null]",
                "0 is not possible, expected more than 0",
            ),
            ("camera.0.projection.tan_half_fov=[null,null]", "expected at least one number"),
        ] {
            let error = apply(&mut scene, definition).expect_err(definition).to_string();
            assert!(error.contains(part), "{definition}: {error}");
        }
        assert_eq!((scene.materials.clone(), scene.cameras.clone(), scene.ambient), before);
        apply(&mut scene, "camera.0.towards=[0,0.2,2]").expect("a direction of another length");
        let camera = &scene.cameras[0];
        assert!(
            (camera.towards.length() - 1.0).abs() < 1e-12
                && camera.up.dot(camera.towards).abs() < 1e-12
        );
    }

    #[test]
    fn the_nearest_name_is_suggested_only_if_it_is_near() {
        assert_eq!(nearest("pth", &["path", "whitted"]), Some("path"));
        assert_eq!(nearest("zzz", &["path", "whitted"]), None);
    }

    #[test]
    fn an_environment_is_turned_to_an_angle_whatever_it_was_before() {
        let mut scene = crate::Scene::new("sky");
        assert!(apply(&mut scene, "environment.rotation=10").is_err());
        let image = std::sync::Arc::new(crate::Image::from_f32(1, 1, 3, vec![1.0; 3]));
        scene.environment = Some(Environment::Image {
            image,
            scale: snell_math::Rgb::WHITE,
            world_from_environment: DAffine3::from_rotation_x(0.1),
        });
        for angle in [30.0, -170.0, 0.0] {
            apply(&mut scene, &format!("environment.rotation={angle}")).expect("it can be turned");
            let Some(Environment::Image { world_from_environment, .. }) = &scene.environment else {
                panic!("still there")
            };
            assert!((rotation(world_from_environment, DVec3::Y) - angle).abs() < 1e-9);
        }
        assert!(
            apply(&mut scene, "environment.rotation=true").is_err()
                && apply(&mut scene, "environment.tilt=1").is_err()
        );
    }

    #[test]
    fn a_hidden_node_holds_nothing() {
        let mut scene = crate::builtin::builtin("spheres").expect("the scene is built in");
        let node = scene
            .nodes
            .iter()
            .position(|n| !n.surfaces.is_empty())
            .expect("some node has surfaces");
        apply(&mut scene, &format!("node.{node}.visible=true")).expect("there is such a node");
        assert!(!scene.nodes[node].surfaces.is_empty());
        apply(&mut scene, &format!("node.{node}.visible=false")).expect("there is such a node");
        assert!(scene.nodes[node].surfaces.is_empty());
        assert!(
            apply(&mut scene, "node.0.name=x").is_err()
                && apply(&mut scene, "node.99999.visible=false").is_err()
        );
    }
}
