//! `KHR_animation_pointer` and `KHR_node_visibility`.

use super::read_text;
use base64::Engine;
use serde_json::{Value, json};
use snell_math::Rgb;
use snell_scene::light::Point;
use snell_scene::material::MaterialKind;
use snell_scene::{Geometry, Light, NodeId, Player, Projection, Scene};

/// The numbers of the file: positions of a triangle, the times 0 and 2, and keys.
struct Numbers {
    bytes: Vec<u8>,
    accessors: Vec<Value>,
}

impl Numbers {
    fn add(&mut self, kind: &str, width: usize, numbers: &[f32]) -> usize {
        let (offset, count) = (self.bytes.len(), numbers.len() / width);
        numbers.iter().for_each(|x| self.bytes.extend(x.to_le_bytes()));
        self.accessors.push(json!({
            "bufferView": 0, "byteOffset": offset, "componentType": 5126, "count": count,
            "type": kind,
        }));
        self.accessors.len() - 1
    }
}

/// A file in which one property of each kind changes from 0 s to 2 s.
fn file() -> Value {
    let mut numbers = Numbers { bytes: Vec::new(), accessors: Vec::new() };
    let triangle = numbers.add("VEC3", 3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let times = numbers.add("SCALAR", 1, &[0.0, 2.0]);
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    let mut change = |pointer: &str, kind: &str, keys: &[f32], interpolation: &str| {
        let output = numbers.add(kind, keys.len() / 2, keys);
        let extensions = json!({"KHR_animation_pointer": {"pointer": pointer}});
        let target = json!({"path": "pointer", "extensions": extensions});
        channels.push(json!({"sampler": samplers.len(), "target": target}));
        samplers.push(json!({"input": times, "output": output, "interpolation": interpolation}));
    };
    let red_to_blue = [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.5];
    change("/materials/0/pbrMetallicRoughness/baseColorFactor", "VEC4", &red_to_blue, "LINEAR");
    change("/materials/0/pbrMetallicRoughness/roughnessFactor", "SCALAR", &[0.0, 1.0], "STEP");
    change("/materials/0/emissiveFactor", "VEC3", &[0.0, 0.0, 0.0, 1.0, 1.0, 1.0], "LINEAR");
    let strength = "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength";
    change(strength, "SCALAR", &[2.0, 4.0], "LINEAR");
    let offset = "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/\
        KHR_texture_transform/offset";
    change(offset, "VEC2", &[0.0, 0.0, 1.0, 0.5], "LINEAR");
    change("/cameras/0/perspective/yfov", "SCALAR", &[0.5, 1.5], "LINEAR");
    change("/extensions/KHR_lights_punctual/lights/0/intensity", "SCALAR", &[1.0, 3.0], "LINEAR");
    change("/nodes/0/translation", "VEC3", &[0.0, 0.0, 0.0, 0.0, 4.0, 0.0], "LINEAR");
    change("/nodes/0/extensions/KHR_node_visibility/visible", "SCALAR", &[1.0, 0.0], "STEP");
    change("/asset/version", "SCALAR", &[1.0, 0.0], "STEP");
    let image = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nG\
        P4z8DwHwAFAAH/iZk9HQAAAABJRU5ErkJggg==";
    let data = base64::engine::general_purpose::STANDARD.encode(&numbers.bytes);
    let length = numbers.bytes.len();
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_animation_pointer", "KHR_node_visibility", "KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}},
        "buffers": [{"byteLength": length, "uri": format!("data:;base64,{data}")}],
        "bufferViews": [{"buffer": 0, "byteLength": length}],
        "accessors": numbers.accessors,
        "images": [{"uri": image}],
        "textures": [{"source": 0}],
        "materials": [
            {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": triangle}, "material": 0}]}],
        "nodes": [
            {"name": "shown", "mesh": 0, "children": [1, 2]},
            {"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"name": "eye", "camera": 0},
            {"name": "never", "mesh": 0, "extensions": {"KHR_node_visibility": {"visible": false}}}
        ],
        "scenes": [{"nodes": [0, 3]}],
        "animations": [{"channels": channels, "samplers": samplers}]
    })
}

fn at(scene: &Scene, time: f64) -> Scene {
    let motion = scene.motion.clone().expect("the scene moves");
    let mut posed = scene.clone();
    posed.apply(&Player::new(motion.clone(), motion.usual_clips()).pose(time));
    posed
}

/// The number of meshes that are shown.
fn meshes(scene: &Scene) -> usize {
    let count = |id: &NodeId| {
        let surfaces = scene.nodes[id.index()].surfaces.iter();
        surfaces.filter(|s| matches!(s.geometry, Geometry::Mesh(_))).count()
    };
    scene.topological_order().expect("no cycles").iter().map(count).sum()
}

#[test]
fn whatever_a_pointer_names_follows_its_keys() {
    let scene = read_text(&file().to_string()).expect("the file is sound");
    let warnings: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    let [pointer, lights] = warnings[..] else { panic!("{warnings:?}") };
    assert!(pointer.contains("/asset/version") && lights.contains("all there is"), "{warnings:?}");
    assert_eq!(
        (meshes(&scene), scene.textures.len()),
        (1, 2),
        "the moving texture is one of its own"
    );
    for time in [0.0, 0.5, 1.0, 2.0] {
        let (posed, share) = (at(&scene, time), (time / 2.0) as f32);
        let is_there = time < 2.0;
        let material = &posed.materials[0];
        let MaterialKind::OpenPbr(surface) = &material.kind else { panic!("an OpenPBR surface") };
        let Rgb { r, g, b } = surface.base_color.factor;
        assert!((r - (1.0 - share)).abs() < 1e-6 && g == 0.0 && (b - share).abs() < 1e-6);
        assert!((material.alpha.factor - (1.0 - 0.5 * share)).abs() < 1e-6);
        assert_eq!(surface.specular_roughness.factor, if is_there { 0.0 } else { 1.0 });
        assert!((material.emission.factor.r - share * (2.0 + 2.0 * share)).abs() < 0.01, "{time}");
        let [row, other] = posed.textures[0].as_image().expect("an image").uv_transform;
        assert!((row[2] - share).abs() < 1e-6 && (other[2] - 0.5 * share).abs() < 1e-6);
        assert_eq!(posed.textures[1], scene.textures[1], "the other material's texture stays");
        let Projection::Perspective { tan_half_fov: [None, Some(tangent)] } =
            posed.cameras[0].projection
        else {
            panic!("a perspective camera")
        };
        assert!((tangent - ((0.5 + time / 2.0) / 2.0).tan()).abs() < 1e-3, "{time}");
        assert_eq!(posed.cameras[0].eye.y, 2.0 * time);
        if let Light::Point(Point { position, intensity, .. }) = &posed.lights[0] {
            assert!(is_there && (intensity.r - (1.0 + 2.0 * share)).abs() < 1e-6);
            assert_eq!(position.y, 2.0 * time);
        } else {
            assert!(!is_there, "lamps of hidden nodes are off");
        }
        assert_eq!(meshes(&posed), usize::from(is_there), "{time}");
    }
}

#[test]
fn the_text_format_keeps_what_pointers_change() {
    let scene = read_text(&file().to_string()).expect("the file is sound");
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.snell");
    crate::write::write_scene(&path, &scene).expect("it can be written");
    let again = crate::read_scene(&path, &crate::ReadOptions::default()).expect("it can be read");
    let (a, b) = (scene.motion.expect("it moves"), again.motion.expect("it moves"));
    assert_eq!(
        (a.clips[0].parameters.len(), &a.clips[0].parameters),
        (b.clips[0].parameters.len(), &b.clips[0].parameters)
    );
    assert!(a.clips[0].parameters.len() >= 6 && a.switches == b.switches && !a.switches.is_empty());
}

#[test]
fn pointers_into_nothing_are_warnings() {
    for pointer in [
        "",
        "/",
        "/materials/7/emissiveFactor",
        "/materials/0",
        "/nodes/0/scale",
        "/cameras/x/y",
        "/materials/-/a~1b",
    ] {
        let mut file = file();
        let target = &mut file["animations"][0]["channels"][0]["target"];
        target["extensions"]["KHR_animation_pointer"]["pointer"] = pointer.into();
        let scene = read_text(&file.to_string()).expect("the file can be shown");
        assert!(scene.warnings.len() >= 2, "{pointer}: {:?}", scene.warnings);
        at(&scene, 1.0);
    }
}

#[test]
fn a_pointer_of_any_length_is_refused_with_a_warning() {
    let mut file = file();
    let pointer = format!("/materials/0{}", "/a".repeat(200_000));
    file["animations"][0]["channels"][0]["target"] =
        json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
    let scene = read_text(&file.to_string()).expect("the file is sound");
    assert!(
        scene.warnings.iter().any(|w| w.message.contains("too many steps")),
        "{:?}",
        scene.warnings
    );
}
