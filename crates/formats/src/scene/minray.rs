//! Scenes of Heckbert's minimal ray tracer as JSON (P. Heckbert, A Minimal Ray Tracer, Graphics
//! Gems IV, 1994): spheres, some of which are lights, and a camera at the origin that looks along
//! `+y`. [`MinrayDescription`] documents the numbers.

use crate::{Input, Place, ReadError, SceneReader};
use snell_scene::Scene;
use snell_scene::builtin::{MinrayDescription, MinrayError, minray_scene};

/// The reader of minray scenes.
pub const READER: SceneReader = SceneReader {
    name: "minray",
    description: "spheres of Heckbert's minimal ray tracer, as JSON",
    extensions: &["minray"],
    recognises,
    read,
};

const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";

/// True for a JSON object that has an angle of view near its start or end, and spheres near either.
fn recognises(bytes: &[u8]) -> bool {
    const WINDOW: usize = 4096;
    let text = bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes);
    let ends = [&text[..text.len().min(WINDOW)], &text[text.len().saturating_sub(WINDOW)..]];
    let names = |key: &[u8]| ends.iter().any(|end| end.windows(key.len()).any(|part| part == key));
    text.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{')
        && names(b"\"spheres\"")
        && names(b"\"aov_degrees\"")
}

fn read(input: &Input) -> Result<Scene, ReadError> {
    let text = input.bytes.strip_prefix(UTF8_MARK).unwrap_or(&input.bytes);
    let description: MinrayDescription = serde_json::from_slice(text).map_err(|error| {
        let message = error.to_string();
        let problem = message.split(" at line ").next().unwrap_or(&message).to_string();
        let remedy = "write an object with name, depth, size, aov_degrees, ambient and spheres, \
                      each sphere with x y z r g b rad kd ks kt kl ir";
        input.error(Place::Column(error.line(), error.column().max(1)), problem, remedy)
    })?;
    let limit = input.options.limits.elements;
    if description.spheres.len() > limit {
        let problem =
            format!("{} spheres, more than the limit of {limit}", description.spheres.len());
        return Err(input.error(Place::Json("/spheres".into()), problem, "split the scene"));
    }
    minray_scene(&description).map_err(|error| {
        let (path, found, expected) = match error {
            MinrayError::OutOfRange { name, found, expected } => {
                (format!("/{name}"), found, expected)
            }
            MinrayError::Sphere { number, name, found, expected } => {
                (format!("/spheres/{}/{name}", number.saturating_sub(1)), found, expected)
            }
        };
        input.error(
            Place::Json(path),
            format!("found {found}, expected {expected}"),
            "change the number",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::testing::{self, data, error_of, read_text, summary};
    use std::path::Path;

    const SMALL: &str = r#"{"name": "small", "depth": 2, "size": 16, "aov_degrees": 30, "ambient": [0, 0.1, 0.2],
 "spheres": [{"x": 0, "y": 5, "z": 0, "r": 1, "g": 1, "b": 1, "rad": 1, "kd": 1, "ks": 0, "kt": 0, "kl": 0, "ir": 1.5},
  {"x": 0, "y": 5, "z": 9, "r": 1, "g": 1, "b": 1, "rad": 1, "kd": 0, "ks": 0, "kt": 0, "kl": 1, "ir": 1}]}"#;

    #[test]
    fn the_scene_of_the_contest_is_the_built_in_one() {
        let Some(folder) = data("minray") else { return };
        let read = crate::read_scene(&folder.join("test1.json"), &Default::default())
            .expect("the public scene loads");
        let builtin = snell_scene::builtin::builtin("minray").expect("there is such a scene");
        assert_eq!(read.name, "test1");
        assert_eq!(summary(&read), summary(&builtin));
        assert_eq!(read.nodes.len(), builtin.nodes.len());
        assert!(read.nodes.iter().zip(&builtin.nodes).all(|(a, b)| a.transform == b.transform));
        assert_eq!((read.materials, read.lights), (builtin.materials, builtin.lights));
        assert_eq!((read.cameras, read.settings), (builtin.cameras, builtin.settings));
        assert_eq!((read.ambient, read.background), (builtin.ambient, builtin.background));
    }

    #[test]
    fn it_is_recognised_by_content_alone() {
        assert!(recognises(SMALL.as_bytes()));
        assert!(recognises(format!("\u{feff} {SMALL}").as_bytes()));
        let scene = crate::read_scene_bytes("-", SMALL.into(), Path::new("."), &Default::default());
        assert_eq!(scene.expect("well-formed").settings.size, Some([16, 16]));
        for other in
            ["", "{}", "[1]", r#"{"asset": {"version": "2.0"}}"#, "\"spheres\" \"aov_degrees\""]
        {
            assert!(!recognises(other.as_bytes()), "{other}");
        }
    }

    #[test]
    fn errors_name_the_place_and_the_way_out() {
        let errors = [
            "",
            "{\n  \"name\": }",
            "{\"name\": \"x\", \"size\": 5}",
            &SMALL.replace("\"depth\": 2", "\"depth\": \"deep\""),
            &SMALL.replace("\"depth\": 2", "\"dept\": 2"),
            &SMALL.replace("\"kl\": 0,", "\"kl\": 0, \"kq\": 1,"),
            &SMALL.replace("\"size\": 16", "\"size\": -16"),
            &SMALL.replace("\"size\": 16", "\"size\": 1000000"),
            &SMALL.replace("\"depth\": 2", "\"depth\": 0"),
            &SMALL.replace("30", "180"),
            &SMALL.replace("\"rad\": 1", "\"rad\": 0"),
            &SMALL.replace("\"rad\": 1", "\"rad\": 1e999"),
            &SMALL[..200],
        ];
        let messages: Vec<_> = errors.iter().map(|text| error_of(&READER, text)).collect();
        insta::assert_snapshot!(messages.join("\n"), @r##"
    test:1:1: EOF while parsing a value; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    test:2:11: expected value; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    test:1:24: missing field `depth`; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    test:1:33: invalid type: string "deep", expected u32; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    test:1:24: unknown field `dept`, expected one of `name`, `depth`, `size`, `aov_degrees`, `ambient`, `spheres`; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    test:2:112: unknown field `kq`, expected one of `x`, `y`, `z`, `r`, `g`, `b`, `rad`, `kd`, `ks`, `kt`, `kl`, `ir`; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    test:1:41: invalid value: integer `-16`, expected u32; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    test: at /size: found 1000000, expected 1 to 65536 pixels; change the number
    test: at /depth: found 0, expected at least 1 (0 would be a black picture); change the number
    test: at /aov_degrees: found 180, expected an angle of view between 0 and 180 degrees; change the number
    test: at /spheres/0/rad: found 0, expected a radius above 0; change the number
    test:2:74: number out of range; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    test:2:113: EOF while parsing a value; write an object with name, depth, size, aov_degrees, ambient and spheres, each sphere with x y z r g b rad kd ks kt kl ir
    "##);
    }

    #[test]
    fn the_picture_is_the_one_the_file_asks_for() {
        let scene = read_text(&READER, SMALL).expect("well-formed");
        insta::assert_snapshot!(summary(&scene), @r##"2 sphere, 2 material, lights [point], 1 camera, background 0 0.1 0.2"##);
        assert_eq!(scene.settings.integrator.as_deref(), Some("whitted"));
        assert_eq!(scene.settings.max_depth, Some(1));
    }

    #[test]
    fn broken_files_end_in_errors() {
        testing::read_broken_versions(&READER, SMALL.as_bytes(), Path::new("."));
    }
}
