//! Whole entries of the scene's tables: `light.2={…}` replaces a light, or adds one if there are
//! two; likewise materials, cameras, textures and images. `light.2=null` removes a light.

use super::{OpenPicture, OverrideError, error, too_large};
use crate::material::Material;
use crate::motion::{Motion, Owner, Switched};
use crate::texture::{self, Texture};
use crate::written::unknown_names;
use crate::{Camera, Light, Scene};
use serde::de::DeserializeOwned;
use serde_json::Value;
use snell_math::parameters::{Value as Parameters, problem_at};

/// Applies a change of a whole entry; `None` if the key names none.
pub(super) fn edit(
    scene: &mut Scene,
    key: &str,
    value: &Value,
    picture: OpenPicture<'_>,
) -> Option<Result<(), OverrideError>> {
    let (family, number) = key.split_once('.')?;
    let number: usize = number.parse().ok()?;
    // Other values than an object or a name are changes of a parameter that was left out.
    let is_whole = value.is_object()
        || (family == "image" && value.is_string())
        || (family == "light" && value.is_null());
    if !is_whole {
        return None;
    }
    let value = value.clone();
    Some(match family {
        "material" => checked::<Material>(key, value).and_then(|material| {
            if let Some(missing) = scene.missing_texture(&material) {
                let (id, count) = (missing.0, scene.textures.len());
                let problem = format!("there is no texture {id}: the scene has {count}");
                return Err(error(key, problem));
            }
            put(&mut scene.materials, key, number, material)
        }),
        "light" if value.is_null() => remove_light(scene, key, number),
        "light" => checked::<Light>(key, value)
            .and_then(|light| put(&mut scene.lights, key, number, light)),
        "camera" => checked::<Camera>(key, value).and_then(|mut camera| {
            camera.square_up();
            put(&mut scene.cameras, key, number, camera)
        }),
        "texture" => set_texture(scene, key, number, value),
        "image" => {
            let name = value.as_str().unwrap_or_default();
            picture(name)
                .map_err(|problem| error(key, problem))
                .and_then(|image| put(&mut scene.images, key, number, image))
        }
        _ => return None,
    })
}

/// A thing of its written form, whose names are known and whose numbers are in their ranges.
fn checked<T: DeserializeOwned + Parameters>(key: &str, value: Value) -> Result<T, OverrideError> {
    if let Some(number) = too_large(&value) {
        let problem = format!("{number:e} is larger than any number that is computed with");
        return Err(error(key, problem));
    }
    if let Some(unknown) = unknown_names(T::KIND, &value).into_iter().next() {
        return Err(error(key, unknown));
    }
    let thing: T = serde_json::from_value(value).map_err(|e| error(key, e.to_string()))?;
    match problem_at(&thing, &[]) {
        Some(problem) => Err(error(key, problem)),
        None => Ok(thing),
    }
}

fn set_texture(
    scene: &mut Scene,
    key: &str,
    number: usize,
    value: Value,
) -> Result<(), OverrideError> {
    let mut textures = scene.textures.clone();
    let texture: Texture = serde_json::from_value(value).map_err(|e| error(key, e.to_string()))?;
    put(&mut textures, key, number, texture)?;
    let problems = texture::errors(&textures, scene.images.len());
    if let Some(problem) = &problems[number] {
        return Err(error(key, problem.to_string()));
    }
    scene.textures = textures;
    Ok(())
}

/// Removes a light; those behind it move up by one number.
fn remove_light(scene: &mut Scene, key: &str, number: usize) -> Result<(), OverrideError> {
    let count = scene.lights.len();
    if number >= count {
        return Err(error(key, format!("there is no light {number}: the scene has {count}")));
    }
    if scene.motion.as_ref().is_some_and(|motion| moves_lights_from(motion, number)) {
        let problem = "the animation moves this light or one behind it by its number; set its \
            intensity to 0 instead";
        return Err(error(key, problem));
    }
    scene.lights.remove(number);
    Ok(())
}

/// True if a motion has to do with a light of this number or a greater one.
fn moves_lights_from(motion: &Motion, number: usize) -> bool {
    let placed = motion.lights.iter().map(|(light, _)| *light);
    let switched = motion.switches.iter().filter_map(|switch| match switch.what {
        Switched::Light(light) => Some(light),
        Switched::Node(..) => None,
    });
    let tracks = motion.clips.iter().flat_map(|clip| &clip.parameters);
    let changed = tracks.filter_map(|track| match track.owner {
        Owner::Light(light) => Some(light),
        _ => None,
    });
    placed.chain(switched).chain(changed).any(|light| light >= number)
}

/// Replaces an entry, or adds it behind the last one.
fn put<T>(table: &mut Vec<T>, key: &str, number: usize, thing: T) -> Result<(), OverrideError> {
    let next = table.len();
    match table.get_mut(number) {
        Some(place) => *place = thing,
        None if number == next => table.push(thing),
        None => {
            return Err(error(key, format!("there are {next}; the next one has number {next}")));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{apply, apply_with};
    use crate::Image;
    use crate::builtin::builtin;
    use crate::motion::Motion;
    use std::sync::Arc;

    #[test]
    fn a_whole_light_is_replaced_or_added() {
        let mut scene = builtin("spheres").expect("the scene is built in");
        let count = scene.lights.len();
        let spot = r#"{"light":"point","position":[0,5,0],"intensity":[9,9,9]}"#;
        apply(&mut scene, &format!("light.{count}={spot}")).expect("the next number");
        apply(&mut scene, &format!("light.{count}.intensity=[1,2,3]")).expect("it is there");
        assert_eq!(scene.lights.len(), count + 1);
        for (wrong, part) in [
            (format!("light.{}={spot}", count + 5), "the next one has number"),
            (format!("light.{count}={}", spot.replace("9,9,9", "-1,0,0")), "-1"),
            (format!("light.{count}={}", spot.replace("position", "place")), "place"),
        ] {
            let problem = apply(&mut scene, &wrong).expect_err(&wrong).to_string();
            assert!(problem.contains(part), "{problem}");
        }
    }

    #[test]
    fn a_light_is_removed_and_those_behind_it_move_up() {
        let mut scene = builtin("cornell-box").expect("the scene is built in");
        let point = |x: u32| {
            let light =
                format!("{{\"light\":\"point\",\"position\":[{x},0,0],\"intensity\":[9,9,9]}}");
            format!("light.{x}={light}")
        };
        for x in 0..3 {
            apply(&mut scene, &point(x)).expect("the next number");
        }
        let last = scene.lights[2].clone();
        apply(&mut scene, "light.1=null").expect("it is there");
        assert_eq!((scene.lights.len(), &scene.lights[1]), (2, &last));
        let none = apply(&mut scene, "light.2=null").expect_err("there are two").to_string();
        assert!(none.contains("there is no light 2: the scene has 2"), "{none}");
        assert!(apply(&mut scene, "material.0=null").is_err(), "only lights are removed");
        // What an animation moves by its number keeps it.
        let motion = Motion { lights: vec![(0, 0)], ..Motion::default() };
        scene.motion = Some(Arc::new(motion));
        apply(&mut scene, "light.1=null").expect("it lies behind");
        let moved = apply(&mut scene, "light.0=null").expect_err("it moves").to_string();
        assert!(moved.contains("set its intensity to 0"), "{moved}");
    }

    #[test]
    fn a_picture_becomes_the_texture_of_a_parameter() {
        let mut scene = builtin("cornell-box").expect("the scene is built in");
        let red = |_: &str| Ok(Arc::new(Image::from_f32(1, 1, 3, vec![1.0, 0.0, 0.0])));
        let texture = r#"{"image":0,"encoding":"srgb","wrap":["repeat","repeat"],
            "filtering":"trilinear","uv_set":0,"uv_transform":[[1,0,0],[0,1,0]]}"#;
        let early = apply(&mut scene, &format!("texture.0={texture}"));
        assert!(early.is_err_and(|e| e.to_string().contains("image is 0")));
        for definition in [
            "image.0=brick.png",
            &format!("texture.0={texture}"),
            "material.0.reflectance.texture=0",
        ] {
            apply_with(&mut scene, definition, &red).expect(definition);
        }
        assert_eq!(scene.materials[0].textures().len(), 1);
        assert!(apply(&mut scene, "image.1=brick.png").is_err(), "no pictures are at hand");
    }

    #[test]
    fn a_new_material_is_the_next_one() {
        let mut scene = builtin("cornell-box").expect("the scene is built in");
        let count = scene.materials.len();
        let clay = r#"{"name":"clay","kind":{"material":"diffuse","reflectance":
            {"factor":[0.5,0.3,0.2],"texture":null}}}"#;
        apply(&mut scene, &format!("material.{count}={clay}")).expect("the next number");
        assert_eq!(scene.materials[count].name, "clay");
    }
}
