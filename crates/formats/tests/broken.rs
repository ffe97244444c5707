//! Broken files: for every reader more than fifty, each a small valid file with one fault. All end
//! in an error that names the file, the place, the problem and a remedy; the snapshots beside this
//! file record the text. (pbrt and Mitsuba have lists of their own, beside the readers.)

use flate2::{Compression, write::GzEncoder};
use serde_json::{Value, json};
use snell_formats::{Limits, Place, ReadOptions, read_scene_bytes};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float \
    y\nproperty float z\nelement face 1\n\
    property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
const OBJ: &str = "v 0 0 0\nv 1 0 0 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nvn 0 1 0\nvn \
    1 0 0\nf 1/1/1 2/2/2 3/3/3\nf -3//-3 -2//-2 -1//-1\n";
const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 \
    0\nendloop\nendfacet\n\
    facet normal 0 0 1\nouter loop\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 \
    0\nendloop\nendfacet\nendsolid a\n";
const OFF: &str = "OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0.2 0.1 0\n0 1 0\n3 0 1 2\n5 0 1 2 3 4\n";
const NFF: &str = "b 0.1 0.2 0.3\nv\nfrom 0 0 8\nat 0 0 0\nup 0 1 0\nangle 45\nhither \
    1\nresolution 64 32\nl 2 3 4\nf 1 0.2 0.2 1 0 10 0 1\n\
    s 0 0 0 1\nc\n0 0 0 1\n0 1 0 0.5\np 3\n0 0 0\n1 0 0\n0 1 0\npp 3\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 \
    1 0 0 0 1\n";
const SCN: &str = "camera 0 0 5  0 0 -1  0 1 0  0.3  0.1 100\nmaterial .1 .2 .3  1 0 0  .5 .5 .5  \
    0 0 0  0 0 0  20 1.5 0\n\
    begin 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\nsphere 0  0 0 0  1\nend\nbox 0  0 0 0  1 1 1\ntri \
    0  0 0 0  1 0 0  0 1 0\npoint_light 1 1 1  0 3 0  0 0 1\n";
const MINRAY: &str = r#"{"name": "a", "depth": 2, "size": 16, "aov_degrees": 30, "ambient": [0, 0.1, 0.2], "spheres": [
  {"x": 0, "y": 5, "z": 0, "r": 1, "g": 1, "b": 1, "rad": 1, "kd": 1, "ks": 0, "kt": 0, "kl": 0, "ir": 1.5},
  {"x": 0, "y": 6, "z": 1, "r": 1, "g": 0, "b": 1, "rad": 1, "kd": 1, "ks": 0, "kt": 0, "kl": 1, "ir": 1.5}]}"#;
const SNELL: &str = r#"{"format": "snell scene", "version": 1, "root": 0,
"cameras": [{"name": "a", "eye": [0, 1, 5], "towards": [0, 0, -1], "up": [0, 1, 0],
  "projection": {"projection": "perspective", "tan_half_fov": [null, 0.4]}, "aperture_radius": 0, "focus_distance": 5, "resolution": null}],
"lights": [{"light": "point", "position": [3, 4, 3], "intensity": [60, 60, 60]}],
"images": [{"width": 1, "height": 1, "channels": 1, "encoding": "srgb", "pixels": {"u8": [0]}}],
"nodes": [{"children": [1]}, {"name": "b", "transform": [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0]],
  "surfaces": [{"shape": {"shape": "sphere", "radius": 1}}, {"mesh": 0}]}],
"meshes": [{"positions": [0, 0, 0, 1, 0, 0, 0, 1, 0], "indices": [0, 1, 2]}],
"motion": {"joints": [{"node": 1, "rest": {"parts": {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}}}],
  "clips": [{"channels": [{"joint": 0, "track": {"translation": {"interpolation": "linear", "width": 3, "times": [0, 1], "values": [0, 0, 0, 1, 0, 0]}}}]}]}}"#;
const GLTF: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
"nodes": [{"mesh": 0, "translation": [0, 0, 1]}, {"camera": 0, "rotation": [0, 0, 0, 1]}],
"cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "metallicFactor": 0}}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "max": [1, 1, 0], "min": [0, 0, 0]},
  {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}],
"bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
"buffers": [{"byteLength": 42, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIA"}]}"#;

/// Minimum number of broken files of each format.
const LEAST: usize = 50;
/// Maximum number of broken files in a snapshot, taken evenly from all.
const SHOWN: usize = 80;

fn message(name: &str, bytes: Vec<u8>) -> Option<String> {
    let limits = Limits { elements: 10_000, ..Limits::default() };
    let options = ReadOptions { limits, ..ReadOptions::default() };
    let error = read_scene_bytes(name, bytes, Path::new("/nonexistent"), &options).err()?;
    assert!(!error.problem.is_empty() && !error.remedy.is_empty(), "{error}");
    // Only compression errors concern the whole file; all others have a line and a column, a byte
    // or a path into JSON.
    let is_whole = error.problem.contains("gzip");
    assert!(is_whole || error.place != Place::Whole, "{error}");
    // The names of our types mean nothing to a reader of the message.
    assert!(!error.problem.contains("untagged"), "{error}");
    Some(error.to_string())
}

/// Files in which one word of the text is changed, and files that end before it.
fn of_words(text: &str) -> Vec<(String, Vec<u8>)> {
    let follows_blank = |i: usize| text[..i].chars().next_back().is_none_or(char::is_whitespace);
    let starts = text.char_indices().filter(|&(i, c)| !c.is_whitespace() && follows_blank(i));
    let mut broken = Vec::new();
    for (start, _) in starts.skip(1) {
        let word = text[start..].split_whitespace().next().unwrap_or_default();
        let (before, after) = (&text.as_bytes()[..start], &text.as_bytes()[start + word.len()..]);
        broken.push((format!("cut before {word:?} at {start}"), before.to_vec()));
        for change in [&b"?"[..], b"-7", b"1,5", b"99999999999999999999", b"\xff\xfe\xfd"] {
            let shown = String::from_utf8_lossy(change);
            broken.push((
                format!("{word:?} at {start} is {shown:?}"),
                [before, change, after].concat(),
            ));
        }
    }
    broken
}

/// Collects the JSON pointers of a value and of everything in it.
fn pointers(value: &Value, at: String, all: &mut Vec<String>) {
    match value {
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(i, item)| pointers(item, format!("{at}/{i}"), all));
        }
        Value::Object(items) => {
            items.iter().for_each(|(key, item)| pointers(item, format!("{at}/{key}"), all))
        }
        _ => {}
    }
    all.push(at);
}

/// JSON with one value changed, or truncated.
fn of_json(text: &str) -> Vec<(String, Vec<u8>)> {
    let sound: Value = serde_json::from_str(text).expect("sound JSON");
    let mut all = Vec::new();
    pointers(&sound, String::new(), &mut all);
    let mut broken = Vec::new();
    for pointer in all.iter().filter(|p| !p.is_empty()) {
        for change in
            [json!(null), json!("x"), json!(-1), json!(99_999_999_999u64), json!([]), json!({})]
        {
            let mut value = sound.clone();
            if let Some(target) = value.pointer_mut(pointer) {
                *target = change.clone();
            }
            let text = serde_json::to_string_pretty(&value).expect("it was JSON");
            broken.push((format!("{pointer} is {change}"), text.into_bytes()));
        }
    }
    for cut in (20..text.len() - 1).step_by(text.len() / 8) {
        broken.push((format!("cut at {cut}"), text.as_bytes()[..cut].to_vec()));
    }
    let mut bytes = text.as_bytes().to_vec();
    bytes[30] = 0xff;
    broken.push(("a byte that is no UTF-8".into(), bytes));
    broken
}

fn check(name: &str, sound: &str, broken: Vec<(String, Vec<u8>)>) {
    assert_eq!(message(name, sound.as_bytes().to_vec()), None, "the file is sound");
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(sound.as_bytes()).expect("memory");
    let mut packed = packed.finish().expect("memory");
    packed.truncate(packed.len() / 2);
    let compressed = [("a compressed file cut off".to_string(), packed)];
    let refused = compressed
        .into_iter()
        .chain(broken)
        .filter_map(|(what, bytes)| Some((what, message(name, bytes)?)));
    // Of equal messages the first is kept.
    let mut known = BTreeSet::new();
    let refused: Vec<_> = refused.filter(|(_, message)| known.insert(message.clone())).collect();
    assert!(refused.len() >= LEAST, "{name}: only {} broken files", refused.len());
    let mut text = String::new();
    let shown = refused.len().min(SHOWN);
    for i in 0..shown {
        let (what, message) = &refused[i * refused.len() / shown];
        writeln!(text, "{what}\n    {message}").expect("memory");
    }
    let format = name.rsplit('.').next().unwrap_or(name);
    insta::with_settings!({ prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::assert_snapshot!(format!("broken_{format}"), text);
    });
}

#[test]
fn meshes() {
    check("a.ply", PLY, of_words(PLY));
    check("a.obj", OBJ, of_words(OBJ));
    check("a.stl", STL, of_words(STL));
    check("a.off", OFF, of_words(OFF));
}

#[test]
fn scenes_of_words() {
    check("a.nff", NFF, of_words(NFF));
    check("a.scn", SCN, of_words(SCN));
}

#[test]
fn scenes_of_json() {
    check("a.minray", MINRAY, of_json(MINRAY));
    check("a.snell", SNELL, of_json(SNELL));
    check("a.gltf", GLTF, of_json(GLTF));
}
