//! `-D key=value`: changes to the scene from the command line.
//!
//! A key is a path into the scene: `material.NAME.PARAMETER`, `camera.NAME.PARAMETER`, `light.NUMBER.PARAMETER`,
//! `medium.NUMBER.PARAMETER`, `ambient`. The parameters are those of the scene's own declarations; the value is JSON, or plain text
//! where JSON is not given. A `spectrum` may also be the name of a file with a wavelength and a value in each line.

use crate::failure::{Failure, nearest};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use snell_scene::Scene;
use std::path::Path;

/// Applies one `key=value`.
pub fn apply(scene: &mut Scene, definition: &str) -> Result<(), Failure> {
    let Some((key, text)) = definition.split_once('=') else {
        return Err(Failure::Usage(format!(
            "-D {definition}: expected key=value, such as material.floor.reflectance.factor=[1,0,0]"
        )));
    };
    let value: Value = serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_string()));
    let value = match &value {
        Value::String(name) if key.ends_with(".spectrum") && Path::new(name).is_file() => spectrum_file(name)?,
        _ => value,
    };
    let (family, rest) = key.split_once('.').unwrap_or((key, ""));
    match family {
        "ambient" => {
            scene.ambient = from_value(key, value)?;
            Ok(())
        }
        "material" => {
            let names: Vec<String> = scene.materials.iter().map(|m| m.name.clone()).collect();
            let (index, path) = find(key, "material", &names, rest)?;
            edit(&mut scene.materials[index], key, path, value)
        }
        "camera" => {
            let names: Vec<String> = scene.cameras.iter().map(|c| c.name.clone()).collect();
            let (index, path) = find(key, "camera", &names, rest)?;
            edit(&mut scene.cameras[index], key, path, value)
        }
        "light" => {
            let names = vec![String::new(); scene.lights.len()];
            let (index, path) = find(key, "light", &names, rest)?;
            edit(&mut scene.lights[index], key, path, value)
        }
        "medium" => {
            let names = vec![String::new(); scene.media.len()];
            let (index, path) = find(key, "medium", &names, rest)?;
            let before = scene.media[index].clone();
            edit(&mut scene.media[index], key, path, value)?;
            scene.media[index].keep_grids_of(&before);
            Ok(())
        }
        _ => Err(Failure::Usage(format!(
            "-D {key}: unknown key; keys begin with material.NAME, camera.NAME, light.NUMBER, medium.NUMBER, or are ambient"
        ))),
    }
}

/// The pairs of a file with a wavelength in nm and a value in each line, separated by blanks or a comma. What follows `#` is a comment.
fn spectrum_file(name: &str) -> Result<Value, Failure> {
    let text = std::fs::read_to_string(name).map_err(|e| Failure::Other(format!("{name}: {e}")))?;
    let mut pairs = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> = line.split([' ', '\t', ',', '\r']).filter(|w| !w.is_empty()).collect();
        if words.is_empty() {
            continue;
        }
        let numbers: Vec<f32> = words.iter().filter_map(|w| w.parse().ok()).collect();
        let [wavelength, value] = numbers[..] else {
            let message = "expected a wavelength in nm and a value, such as 550 0.8";
            return Err(Failure::Usage(format!("{name}:{number}: {message}, found \"{}\"", line.trim())));
        };
        pairs.push(serde_json::json!([wavelength, value]));
    }
    Ok(Value::Array(pairs))
}

/// The thing that a key names, by name or number, and the rest of the key. Names may contain dots.
fn find<'a>(key: &str, what: &str, names: &[String], rest: &'a str) -> Result<(usize, &'a str), Failure> {
    for (index, name) in names.iter().enumerate() {
        if let Some(path) = rest.strip_prefix(name.as_str()).and_then(|r| r.strip_prefix('.'))
            && !name.is_empty()
        {
            return Ok((index, path));
        }
    }
    let (first, path) = rest.split_once('.').unwrap_or((rest, ""));
    if let Ok(index) = first.parse::<usize>()
        && index < names.len()
    {
        return Ok((index, path));
    }
    let known: Vec<_> =
        names.iter().enumerate().map(|(i, n)| if n.is_empty() { i.to_string() } else { n.clone() }).collect();
    let list = if known.is_empty() { "the scene has none".to_string() } else { format!("known: {}", known.join(", ")) };
    Err(Failure::Usage(format!("-D {key}: there is no {what} \"{first}\" ({list})")))
}

fn edit<T: Serialize + DeserializeOwned>(target: &mut T, key: &str, path: &str, value: Value) -> Result<(), Failure> {
    let mut tree = serde_json::to_value(&*target).map_err(|e| Failure::Other(format!("-D {key}: {e}")))?;
    let mut place = &mut tree;
    for step in path.split('.') {
        place = descend(place, key, step)?;
    }
    let before = std::mem::replace(place, value);
    *target = serde_json::from_value(tree)
        .map_err(|e| Failure::Usage(format!("-D {key}: {e}; the value that it has now is {before}")))?;
    Ok(())
}

/// One step into a tree. Materials hold their parameters one level down (`kind`), which keys may leave out.
fn descend<'a>(tree: &'a mut Value, key: &str, step: &str) -> Result<&'a mut Value, Failure> {
    let shown = tree.clone();
    if let Value::Array(items) = tree {
        let length = items.len();
        return step.parse::<usize>().ok().and_then(|i| items.get_mut(i)).ok_or_else(|| {
            Failure::Usage(format!("-D {key}: \"{step}\" is not a position from 0 to {}", length.saturating_sub(1)))
        });
    }
    let inner = tree.get("kind").is_some_and(|k| k.get(step).is_some()) && tree.get(step).is_none();
    let tree = if inner { &mut tree["kind"] } else { tree };
    if tree.get(step).is_some() {
        return Ok(&mut tree[step]);
    }
    let mut names: Vec<&str> = shown.as_object().map(|o| o.keys().map(String::as_str).collect()).unwrap_or_default();
    if let Some(kind) = shown.get("kind").and_then(Value::as_object) {
        names.extend(kind.keys().map(String::as_str));
    }
    let hint = nearest(step, &names).map(|n| format!("; did you mean {n}?")).unwrap_or_default();
    Err(Failure::Usage(format!("-D {key}: there is no parameter \"{step}\"{hint} (known: {})", names.join(", "))))
}

fn from_value<T: DeserializeOwned>(key: &str, value: Value) -> Result<T, Failure> {
    serde_json::from_value(value).map_err(|e| Failure::Usage(format!("-D {key}: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Rgb;
    use snell_scene::material::{Diffuse, MaterialKind};
    use snell_scene::{Material, Medium};

    fn scene() -> Scene {
        let mut scene = Scene::new("test");
        scene.add_material(Material::new("the.floor", Diffuse::new(Rgb::WHITE)));
        scene
    }

    #[test]
    fn a_parameter_is_changed_by_its_path() {
        let mut scene = scene();
        apply(&mut scene, "material.the.floor.reflectance.factor=[0.5,0,0]").expect("the path exists");
        apply(&mut scene, "material.0.double_sided=false").expect("the path exists");
        let MaterialKind::Diffuse(diffuse) = &scene.materials[0].kind else { panic!("still diffuse") };
        assert_eq!(diffuse.reflectance.factor, Rgb::new(0.5, 0.0, 0.0));
        assert!(!scene.materials[0].double_sided);
    }

    #[test]
    fn spectra_come_from_text_and_files() {
        let mut scene = scene();
        apply(&mut scene, "material.0.emission.spectrum=blackbody:3000").expect("a spectrum");
        let red = scene.materials[0].emission.spectrum.expect("it was set").light_rgb();
        assert!(red.r > red.g && red.g > red.b);
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("paint.spd");
        std::fs::write(&file, "# nm, share\n400 0.1\n700, 0.9 # red\n\n").expect("is written");
        apply(&mut scene, &format!("material.0.reflectance.spectrum={}", file.display())).expect("a table");
        let MaterialKind::Diffuse(diffuse) = &scene.materials[0].kind else { panic!("still diffuse") };
        assert!((diffuse.reflectance.spectrum.expect("it was set").at(550.0) - 0.5).abs() < 1e-6);
        std::fs::write(&file, "400 0.1\n500\n").expect("is written");
        let error = apply(&mut scene, &format!("material.0.reflectance.spectrum={}", file.display()));
        let error = error.expect_err("a line is short").to_string();
        assert!(error.contains("paint.spd:2: expected a wavelength"), "{error}");
        let error = apply(&mut scene, "material.0.reflectance.spectrum=nonsense").expect_err("no spectrum").to_string();
        assert!(error.contains("blackbody:KELVIN"), "{error}");
    }

    #[test]
    fn media_are_changed_by_number_and_keep_their_grids() {
        let mut scene = snell_scene::builtin::builtin("smoke").expect("the scene is built in");
        let before = scene.media[0].clone();
        apply(&mut scene, "medium.0.g=0.5").expect("the path exists");
        let (Medium::Grid(before), Medium::Grid(after)) = (&before, &scene.media[0]) else { panic!("a grid") };
        assert_eq!(after.g, 0.5);
        assert_eq!(*after, snell_scene::medium::Grid { g: 0.5, ..before.clone() });
    }

    #[test]
    fn a_wrong_path_names_what_there_is() {
        let error = apply(&mut scene(), "material.0.reflectence=1").expect_err("misspelt").to_string();
        assert!(error.contains("did you mean reflectance?"), "{error}");
        let error = apply(&mut scene(), "material.0.reflectance.factor=red").expect_err("no colour").to_string();
        assert!(error.contains("the value that it has now is [1.0,1.0,1.0]"), "{error}");
        let error = apply(&mut scene(), "material.wall.x=1").expect_err("no such material").to_string();
        assert!(error.contains("known: the.floor"), "{error}");
    }
}
