//! One message of each kind of error.

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
    let error = read_text("{\"asset\": {\"version\": \"2.0\"},\n  nodes: []}").expect_err("keys need quotes");
    assert_snapshot!(error, @"");
}

#[test]
fn versions() {
    let error = read_text(r#"{"asset": {"version": "1.0"}}"#).expect_err("an old version");
    assert_snapshot!(error, @"");
}

#[test]
fn required_extensions() {
    assert_snapshot!(message(r#""extensionsRequired": ["EXT_meshopt_compression"]"#), @"");
    assert_snapshot!(message(r#""extensionsRequired": ["ACME_wonder"]"#), @"");
}

#[test]
fn wrong_types() {
    assert_snapshot!(message(r#""nodes": [{"mesh": "Box"}]"#), @"");
    assert_snapshot!(message(r#""nodes": [{"translation": [1, 2]}]"#), @"");
}

#[test]
fn dangling_references() {
    assert_snapshot!(message(r#""nodes": [{"mesh": 3}], "meshes": []"#), @"");
}

#[test]
fn hierarchies_that_are_no_trees() {
    assert_snapshot!(message(r#""nodes": [{"children": [1]}, {"children": [0]}]"#), @"");
    assert_snapshot!(message(r#""nodes": [{"children": [2]}, {"children": [2]}, {}]"#), @"");
    assert_snapshot!(message(r#""nodes": [{"children": [1]}, {}], "scenes": [{"nodes": [0, 1]}]"#), @"");
}

#[test]
fn buffers() {
    let with = |buffer: &str| {
        primitive_message("", POSITIONS).len();
        message(&format!(
            r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}],
            "accessors": [{POSITIONS}], "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{buffer}]"#
        ))
    };
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "data:;base64,AAAA"}"#), @"");
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "data:;base64,?"}"#), @"");
    assert_snapshot!(with(r#"{"byteLength": 36}"#), @"");
    assert_snapshot!(with(r#"{"byteLength": 35}"#), @"");
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "no%20such.bin"}"#), @"");
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "../../../../etc/passwd"}"#), @"");
    assert_snapshot!(with(r#"{"byteLength": 36, "uri": "https://example.org/a.bin"}"#), @"");
}

#[test]
fn accessors() {
    let positions = r#""attributes": {"POSITION": 0}"#;
    let of = |accessor: &str| primitive_message(positions, accessor);
    assert_snapshot!(of(r#"{"componentType": 5126, "type": "VEC3", "count": 4, "bufferView": 0}"#), @"");
    assert_snapshot!(of(r#"{"componentType": 5126, "type": "VEC2", "count": 3, "bufferView": 0}"#), @"");
    assert_snapshot!(of(r#"{"componentType": 5124, "type": "VEC3", "count": 3, "bufferView": 0}"#), @"");
    assert_snapshot!(of(r#"{"componentType": 5126, "type": "VEC3", "count": 4000000000}"#), @"");
}

#[test]
fn indices() {
    let indexed = |accessor: &str| {
        primitive_message(r#""attributes": {"POSITION": 0}, "indices": 1"#, &format!("{POSITIONS}, {accessor}"))
    };
    assert_snapshot!(indexed(r#"{"componentType": 5121, "type": "SCALAR", "count": 3, "bufferView": 1}"#), @"");
    assert_snapshot!(indexed(r#"{"componentType": 5120, "type": "SCALAR", "count": 3, "bufferView": 1}"#), @"");
}

#[test]
fn attributes() {
    let primitive = r#""attributes": {"POSITION": 0, "NORMAL": 1}"#;
    let normals = r#"{"componentType": 5126, "type": "VEC3", "count": 2, "bufferView": 0}"#;
    assert_snapshot!(primitive_message(primitive, &format!("{POSITIONS}, {normals}")), @"");
    assert_snapshot!(primitive_message(r#""attributes": {"POSITION": 0}, "mode": 9"#, POSITIONS), @"");
}

#[test]
fn cameras_and_lights() {
    let camera = r#"{"type": "perspective", "perspective": {"yfov": 4}}"#;
    assert_snapshot!(message(&format!(r#""nodes": [{{"camera": 0}}], "cameras": [{camera}]"#)), @"");
    let node = r#"{"extensions": {"KHR_lights_punctual": {"light": 0}}}"#;
    let lights = r#"{"KHR_lights_punctual": {"lights": [{"type": "spot"}]}}"#;
    assert_snapshot!(message(&format!(r#""nodes": [{node}], "extensions": {lights}"#)), @"");
}
