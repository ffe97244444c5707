//! One message for each kind of error.

use super::read_text;
use insta::assert_snapshot;

/// The message about a document with these properties next to `asset`.
fn message(properties: &str) -> String {
    let json = format!("{{\"asset\": {{\"version\": \"2.0\"}}, {properties}}}");
    read_text(&json).expect_err("the file is broken").to_string()
}

/// The message about one primitive over two accessors: 0 has three positions, 1 three indices.
fn primitive_message(primitive: &str, accessors: &str) -> String {
    message(&format!(
        r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{{primitive}}}]}}], "accessors": [{accessors}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}, {{"buffer": 0, "byteOffset": 36, "byteLength": 3}}],
        "buffers": [{{"byteLength": 39, "uri": "data:;base64,{}AAEJ"}}]"#,
        "A".repeat(48)
    ))
}

const POSITIONS: &str = r#"{"componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0}"#;

#[test]
fn text_that_is_not_json() {
    let error = read_text("{\"asset\": {\"version\": \"2.0\"},\n  nodes: []}")
        .expect_err("keys need quotes");
    assert_snapshot!(error, @"test.gltf:2:3: not valid JSON: key must be a string; export the file \
        again, or check it with the glTF validator");
}

#[test]
fn bytes_that_are_no_binary_gltf() {
    for bytes in [&b"\x07\xc8random"[..], b"", b"solid"] {
        let folder = std::path::Path::new(".");
        let read = crate::read_scene_bytes("odd.glb", bytes.to_vec(), folder, &Default::default());
        let said = read.expect_err("it is none").to_string();
        assert!(said.contains("this is not a binary glTF (.glb) file"), "{said}");
    }
}

#[test]
fn versions() {
    let error = read_text(r#"{"asset": {"version": "0.8"}}"#).expect_err("an old version");
    assert_snapshot!(error, @r#"test.gltf:1:23: at /asset/version: this is glTF "0.8", expected 2.0; convert it to glTF 2.0, for example with gltf-pipeline or Blender"#);
}

#[test]
fn required_extensions() {
    assert_snapshot!(message(r#""extensionsRequired": ["ACME_wonder"], "meshes": [{"primitives": [{"extensions": {"ACME_wonder": {}}}]}]"#), @"test.gltf:1:54: at /extensionsRequired/0: the file requires the extension ACME_wonder for its geometry, and Snell does not support it; export the file again without this extension, or as optional");
}

#[test]
fn wrong_types() {
    assert_snapshot!(message(r#""nodes": [{"mesh": "Box"}]"#), @r#"test.gltf:1:50: at /nodes/0/mesh: expected a whole number from 0, found "Box"; export the file again, or check it with the glTF validator"#);
    assert_snapshot!(message(r#""nodes": [{"translation": [1, 2]}]"#), @"test.gltf:1:57: at /nodes/0/translation: expected 3 numbers, found 2; export the file again, or check it with the glTF validator");
}

#[test]
fn dangling_references() {
    assert_snapshot!(message(r#""nodes": [{"mesh": 3}], "meshes": []"#), @r#"test.gltf:1:50: at /nodes/0/mesh: it refers to number 3 of "meshes", but there are 0; export the file again, or check it with the glTF validator"#);
}

#[test]
fn hierarchies_that_are_no_trees() {
    assert_snapshot!(message(r#""nodes": [{"children": [1]}, {"children": [0]}]"#), @"test.gltf:1:41: at /nodes/0: the node is its own descendant; nodes must form trees; export the file again, or check it with the glTF validator");
}

#[test]
fn buffers() {
    let with = |buffer: &str| {
        message(&format!(
            r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "accessors": [{POSITIONS}], "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{buffer}]"#
        ))
    };
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "data:;base64,AAAA"}"#), @"test.gltf:2:160: at /buffers/0: the buffer should have 36 bytes, but has only 3; the file with the buffer is cut off or not the right one: copy or export it again");
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "data:;base64,?"}"#), @"test.gltf:2:186: at \
        /buffers/0/uri: the data URI is not valid base64: Invalid symbol 63, offset 0.; export the \
        file again, or check it with the glTF validator");
    assert_snapshot!(with(r#"{"byteLength": 36}"#), @r#"test.gltf:2:160: at /buffers/0: the buffer has no "uri", and there is no binary chunk for it; export the file again with its buffers"#);
    assert_snapshot!(with(r#"{"byteLength": 35}"#), @"test.gltf:2:114: at /bufferViews/0: the \
        buffer view takes 36 bytes from byte 0, but its buffer has 35 bytes; export the file \
        again, or check it with the glTF validator");
    let missing = with(r#"{"byteLength": 36, "uri": "no%20such.bin"}"#);
    // The rest of the message is the system's.
    let expected = "test.gltf:2:186: at /buffers/0/uri: the file \"no such.bin\" cannot be used: \
        cannot open: ";
    assert!(missing.starts_with(expected), "{missing}");
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "../../../../etc/passwd"}"#), @r#"test.gltf:2:186: at /buffers/0/uri: the file "../../../../etc/passwd" cannot be used: it names the file "../../../../etc/passwd", which lies outside of the scene's folder; move the file into the folder, or leave out --confine (confine=True)"#);
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "https://example.org/a.bin"}"#), @r#"test.gltf:2:186: at /buffers/0/uri: "https://example.org/a.bin" is not a file next to the scene; download it, and put it beside the scene"#);
}

#[test]
fn accessors() {
    let positions = r#""attributes": {"POSITION": 0}"#;
    let of = |accessor: &str| primitive_message(positions, accessor);
    assert_snapshot!(
        of(r#"{"componentType": 5126, "type": "VEC3", "count": 4, "bufferView": 0}"#),
        @"test.gltf:1:132: at /accessors/0: 4 elements of 12 bytes, 12 bytes apart, from byte 0 do not fit into the 36 bytes of the buffer view; export the file again, or check it with the glTF validator"
    );
    assert_snapshot!(
        of(r#"{"componentType": 5126, "type": "VEC2", "count": 3, "bufferView": 0}"#),
        @"test.gltf:1:132: at /accessors/0: its elements have 2 components, expected 3; export the file again, or check it with the glTF validator"
    );
    assert_snapshot!(
        of(r#"{"componentType": 5124, "type": "VEC3", "count": 3, "bufferView": 0}"#),
        @"test.gltf:1:150: at /accessors/0/componentType: 5124 is not a component type; expected one of 5120, 5121, 5122, 5123, 5125, 5126; export the file again, or check it with the glTF validator"
    );
    assert_snapshot!(of(r#"{"componentType": 5126, "type": "VEC3", "count": 4000000000}"#), @"test.gltf:1:132: at /accessors/0: the accessor declares 4000000000 elements without any data; at most 4194304 are possible so; export the file again, or check it with the glTF validator");
}

#[test]
fn indices() {
    let indexed = |accessor: &str| {
        primitive_message(
            r#""attributes": {"POSITION": 0}, "indices": 1"#,
            &format!("{POSITIONS}, {accessor}"),
        )
    };
    assert_snapshot!(indexed(r#"{"componentType": 5121, "type": "SCALAR", "count": 3, "bufferView": 1}"#), @"test.gltf:1:125: at /meshes/0/primitives/0/indices: index 2 is 9, but there are only 3 vertices (strips cannot be restarted in glTF); export the file again, or check it with the glTF validator");
    assert_snapshot!(indexed(r#"{"componentType": 5120, "type": "SCALAR", "count": 3, "bufferView": 1}"#), @"test.gltf:1:216: at /accessors/1: indices must be unsigned whole numbers (SCALAR of type 5121, 5123 or 5125); export the file again, or check it with the glTF validator");
}

#[test]
fn attributes() {
    let primitive = r#""attributes": {"POSITION": 0, "NORMAL": 1}"#;
    let normals = r#"{"componentType": 5126, "type": "VEC3", "count": 2, "bufferView": 0}"#;
    assert_snapshot!(primitive_message(primitive, &format!("{POSITIONS}, {normals}")), @"test.gltf:1:123: at /meshes/0/primitives/0/attributes/NORMAL: its accessor has 2 elements, but there are 3 positions; every attribute needs one per vertex; export the file again, or check it with the glTF validator");
    assert_snapshot!(primitive_message(r#""attributes": {"POSITION": 0}, "mode": 9"#, POSITIONS), @"test.gltf:1:122: at /meshes/0/primitives/0/mode: 9 is not a primitive mode; expected 0 to 6; export the file again, or check it with the glTF validator");
}

#[test]
fn cameras_and_lights() {
    let camera = r#"{"type": "perspective", "perspective": {"yfov": 4}}"#;
    assert_snapshot!(message(&format!(r#""nodes": [{{"camera": 0}}], "cameras": [{camera}]"#)), @"test.gltf:1:117: at /cameras/0/perspective/yfov: the angle of view is 4 radians, expected more than 0 and less than pi; export the file again, or check it with the glTF validator");
    let node = r#"{"extensions": {"KHR_lights_punctual": {"light": 0}}}"#;
    let lights = r#"{"KHR_lights_punctual": {"lights": [{"type": "spot"}]}}"#;
    assert_snapshot!(message(&format!(r#""nodes": [{node}], "extensions": {lights}"#)), @r#"test.gltf:1:147: at /extensions/KHR_lights_punctual/lights/0: the property "spot" is missing; export the file again, or check it with the glTF validator"#);
}

/// The warnings about a document with these properties, whose generator has this name.
fn warnings(generator: &str, properties: &str) -> Vec<String> {
    let json = format!(
        "{{\"asset\": {{\"version\": \"2.0\", \"generator\": \"{generator}\"}}, {properties}}}"
    );
    let scene = read_text(&json).expect("the document is sound");
    scene.warnings.into_iter().map(|w| w.message).collect()
}

#[test]
fn lights_that_are_all_there_is_are_told() {
    let lit = |emission: &str| {
        format!(
            r#""extensions": {{"KHR_lights_punctual": {{"lights": [{{"type": "point"}}]}}}},
            "materials": [{{"emissiveFactor": {emission}}}], "meshes": [{{"primitives": []}}],
            "nodes": [{{"mesh": 0, "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}}]"#
        )
    };
    let said = warnings("x", &lit("[0, 0, 0]"));
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("light of the file is all there is") && said[0].contains("sky"));
    // Snell's own files hold all that there was, and a lamp is light beside the lights.
    assert_eq!(warnings("Snell 0.1.0", &lit("[0, 0, 0]")), [""; 0]);
    assert_eq!(warnings("x", &lit("[1, 1, 1]")), [""; 0]);
}

#[test]
fn a_file_without_meshes_is_told() {
    let said = warnings("x", r#""nodes": [{"name": "empty"}]"#);
    assert_eq!(said, ["test.gltf: the file has no meshes, so that nothing is visible"]);
}
