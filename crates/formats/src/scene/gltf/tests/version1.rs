//! Documents of glTF 1.0.

use super::{assert_sound, meshes, read_text};
use crate::{ReadOptions, read_scene_bytes};
use base64::Engine;
use snell_math::{DVec3, Vec3};
use snell_scene::Light;
use snell_scene::material::{AlphaMode, MaterialKind};
use std::path::Path;

/// The numbers of a buffer: three positions 16 bytes apart, one matrix, two times, and joints and
/// weights of the vertices.
fn numbers() -> Vec<u8> {
    let mut numbers: Vec<f32> =
        vec![0.0, 0.0, 0.0, 9.0, 1.0, 0.0, 0.0, 9.0, 0.0, 1.0, 0.0, 9.0, 0.0, 1.0];
    numbers
        .extend([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 5.0, 0.0, 0.0, 1.0]);
    numbers.extend([0.0; 12]);
    numbers.extend([1.0, 0.0, 0.0, 0.0].repeat(3));
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// A document with this text as its buffers.
fn document(buffers: &str, properties: &str) -> String {
    let accessor = |at: usize, stride: usize, count: usize, kind: &str| {
        format!(
            r#"{{"bufferView": "all", "byteOffset": {at}, "byteStride": {stride},
            "componentType": 5126, "count": {count}, "type": "{kind}"}}"#
        )
    };
    format!(
        r#"{{"asset": {{"version": "1.0"}}, "scene": "main", "scenes": {{"main": {{"nodes": ["top"]}}}},
        {properties}, "accessors": {{"places": {}, "bind": {}, "times": {}, "joints": {},
            "weights": {}}},
        "bufferViews": {{"all": {{"buffer": "binary_glTF", "byteLength": {}}}}},
        "buffers": {{"binary_glTF": {buffers}}}}}"#,
        accessor(0, 16, 3, "VEC3"),
        accessor(56, 0, 1, "MAT4"),
        accessor(48, 0, 2, "SCALAR"),
        accessor(120, 16, 3, "VEC4"),
        accessor(168, 0, 3, "VEC4"),
        numbers().len()
    )
}

fn embedded(properties: &str) -> String {
    let data = base64::engine::general_purpose::STANDARD.encode(numbers());
    let length = numbers().len();
    let buffer = format!(r#"{{"byteLength": {length}, "uri": "data:;base64,{data}"}}"#);
    document(&buffer, properties)
}

const MESHES: &str = r#""meshes": {"b": {"primitives": [{"attributes": {"POSITION": "places"},
    "material": "red"}]}, "a": {"primitives": [{"attributes": {"POSITION": "places"},
    "material": "pane"}]}},
    "techniques": {"shader": {"parameters": {"diffuse": {"type": 35666, "value": [0, 1, 0, 1]},
        "shininess": {"type": 5126}}, "states": {"enable": [2929]}}},
    "materials": {"red": {"technique": "shader", "values": {"diffuse": [1, 0, 0, 1],
        "shininess": 100, "specular": [0.5, 0.5, 0.5, 1]}},
        "pane": {"extensions": {"KHR_materials_common": {"technique": "LAMBERT",
            "transparent": true, "values": {"diffuse": [0.5, 0.5, 0.5, 1],
            "transparency": 0.25}}}}}"#;

#[test]
fn objects_with_names_are_found_and_techniques_become_materials() {
    let properties = format!(
        r#""nodes": {{"top": {{"meshes": ["b", "a"], "translation": [3, 0, 0]}}}}, {MESHES}"#
    );
    let scene = read_text(&embedded(&properties)).unwrap_or_else(|e| panic!("{e}"));
    assert_sound(&scene, Path::new("1.gltf"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let found = meshes(&scene);
    assert_eq!(found.len(), 2);
    assert!(found.iter().all(|mesh| mesh.positions == [Vec3::ZERO, Vec3::X, Vec3::Y]));
    let top = &scene.nodes[scene.nodes[scene.root.index()].children[0].index()];
    assert_eq!((top.transform.translation, top.children.len()), (DVec3::X * 3.0, 2));
    let material = |name: &str| scene.materials.iter().find(|m| m.name == name).expect(name);
    let MaterialKind::OpenPbr(red) = &material("red").kind else { panic!("no OpenPBR surface") };
    let color = red.base_color.factor;
    assert!(color.g == 0.0 && color.r > 0.1 && material("red").double_sided);
    let roughness = red.specular_roughness.factor;
    assert!((roughness - (2.0f32 / 102.0).powf(0.25)).abs() < 1e-5, "{roughness}");
    let pane = material("pane");
    assert_eq!((pane.alpha_mode, pane.alpha.factor), (AlphaMode::Blend, 0.25));
    let MaterialKind::OpenPbr(surface) = &pane.kind else { panic!("no OpenPBR surface") };
    // Colours are given as they are displayed.
    assert!((surface.base_color.factor.r - 0.214).abs() < 1e-3, "{:?}", surface.base_color);
}

#[test]
fn skins_animations_and_lights_are_converted() {
    let properties = r#""nodes": {"top": {"children": ["body", "bone", "lamp"]},
            "body": {"meshes": ["m"], "skin": "skin", "skeletons": ["bone"]},
            "bone": {"jointName": "Bone"}, "lamp": {"translation": [0, 0, 4],
                "extensions": {"KHR_materials_common": {"light": "sun"}}}},
        "meshes": {"m": {"primitives": [{"attributes": {"POSITION": "places", "JOINT": "joints",
            "WEIGHT": "weights"}}]}},
        "skins": {"skin": {"jointNames": ["Bone"], "inverseBindMatrices": "bind",
            "bindShapeMatrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]}},
        "animations": {"a": {"parameters": {"TIME": "times", "x": "places"},
            "samplers": {"s": {"input": "TIME", "output": "x"}},
            "channels": [{"sampler": "s", "target": {"id": "bone", "path": "translation"}}]}},
        "extensions": {"KHR_materials_common": {"lights": {"sun": {"type": "directional",
            "directional": {"color": [1, 0.5, 0]}}}}},
        "extensionsUsed": ["KHR_materials_common"]"#;
    // Two keys need two places.
    let text = embedded(properties).replace(r#""x": "places""#, r#""x": "two""#).replace(
        r#""times":"#,
        r#""two": {"bufferView": "all", "byteOffset": 0, "byteStride": 16, "componentType": 5126,
            "count": 2, "type": "VEC3"}, "times":"#,
    );
    let scene = read_text(&text).unwrap_or_else(|e| panic!("{e}"));
    let is_about_lights = |w: &snell_scene::Warning| w.message.contains("all there is");
    assert!(scene.warnings.iter().all(is_about_lights), "{:?}", scene.warnings);
    // Twice as large by the bind shape, then moved by 5 by the bind matrix.
    let expected = [Vec3::X * 5.0, Vec3::X * 7.0, Vec3::new(5.0, 2.0, 0.0)];
    assert_eq!(meshes(&scene)[0].positions, expected);
    let clips = &scene.motion.as_ref().expect("it moves").clips;
    assert_eq!(clips[0].channels.len(), 1);
    let Light::Directional(sun) = &scene.lights[0] else { panic!("no sun") };
    assert!((sun.irradiance.g / sun.irradiance.r - 0.5).abs() < 1e-6);
}

#[test]
fn binary_files_have_their_buffer_and_images_in_their_body() {
    let mut targa = vec![0u8; 18];
    (targa[2], targa[12], targa[14], targa[16], targa[17]) = (2, 1, 1, 32, 8);
    targa.extend([0, 0, 255, 128]);
    targa.extend(b"\0\0\0\0\0\0\0\0TRUEVISION-XFILE.\0");
    let properties = format!(
        r#""nodes": {{"top": {{"meshes": ["b"]}}}}, {},
        "images": {{"i": {{"uri": "data:,", "extensions": {{"KHR_binary_glTF":
            {{"bufferView": "picture", "mimeType": "image/x-tga"}}}}}}}},
        "textures": {{"t": {{"source": "i", "sampler": "s"}}}}, "samplers": {{"s": {{}}}},
        "extensionsUsed": ["KHR_binary_glTF"]"#,
        MESHES.replace("\"diffuse\": [1, 0, 0, 1]", "\"diffuse\": \"t\"")
    );
    let picture = format!(
        r#""bufferViews": {{"picture": {{"buffer": "binary_glTF", "byteOffset": {},
            "byteLength": {}}},"#,
        numbers().len(),
        targa.len()
    );
    let text = document(r#"{"byteLength": 0, "uri": "data:,"}"#, &properties)
        .replace("\"bufferViews\": {", &picture);
    let body = [numbers(), targa].concat();
    let file = |length: usize, format: u32| {
        let mut bytes = b"glTF\x01\0\0\0".to_vec();
        for word in [20 + text.len() + body.len(), length] {
            bytes.extend((word as u32).to_le_bytes());
        }
        bytes.extend(format.to_le_bytes());
        [&bytes, text.as_bytes(), &body].concat()
    };
    let read =
        |bytes: Vec<u8>| read_scene_bytes("1.glb", bytes, Path::new("."), &ReadOptions::default());
    let scene = read(file(text.len(), 0)).unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!((scene.images.len(), scene.images[0].width), (1, 1));
    assert_eq!(meshes(&scene)[0].positions[1], Vec3::X);
    assert!(read(file(1 << 30, 0)).expect_err("too long").problem.contains("should have"));
    assert!(read(file(text.len(), 7)).expect_err("no JSON").problem.contains("format 7"));
    let whole = file(text.len(), 0);
    for length in (0..whole.len()).step_by(7) {
        if let Ok(scene) = read(whole[..length].to_vec()) {
            assert_sound(&scene, Path::new("cut.glb"));
        }
    }
}

#[test]
fn names_without_an_object_and_unknown_extensions_are_reported() {
    let error =
        read_text(&embedded(r#""nodes": {"top": {"meshes": ["m"]}}"#)).expect_err("no mesh");
    assert!(error.problem.contains("found \"m\""), "{error}");
    let quantized = embedded(&format!(
        r#""extensionsUsed": ["WEB3D_quantized_attributes"], "nodes": {{"top": {{"meshes": ["b"]}}}},
        {MESHES}"#
    ))
    .replace(
        r#""accessors": {"#,
        r#""accessors": {"q": {"extensions": {"WEB3D_quantized_attributes": {}},
            "componentType": 5126, "count": 1, "type": "SCALAR"}, "#,
    );
    let error = read_text(&quantized).expect_err("geometry would be missing");
    assert!(error.problem.contains("WEB3D_quantized_attributes for its geometry"), "{error}");
    let custom = MESHES.replace("\"shininess\": 100", "\"u_glow\": 3");
    let scene =
        read_text(&embedded(&format!(r#""nodes": {{"top": {{"meshes": ["b"]}}}}, {custom}"#)))
            .unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.warnings[0].message.contains("not used: u_glow"), "{:?}", scene.warnings);
}
