//! Animations, variants and scenes of files.

use super::{data, open, read_text};
use crate::{ReadOptions, read_scene_bytes};
use base64::Engine;
use snell_math::{DVec3, Vec3};
use snell_scene::{Geometry, Node, Player, Scene};
use std::path::Path;

/// The scene at a time, with its default clips.
fn at(scene: &Scene, time: f64) -> Scene {
    let motion = scene.motion.clone().expect("the scene moves");
    let mut posed = scene.clone();
    posed.apply(&Player::new(motion.clone(), motion.usual_clips()).pose(time));
    posed
}

fn node<'s>(scene: &'s Scene, name: &str) -> &'s Node {
    scene.nodes.iter().find(|n| n.name == name).expect("the node is there")
}

/// All positions of the mesh of a node.
fn positions(node: &Node) -> &[Vec3] {
    let Geometry::Mesh(mesh) = &node.surfaces[0].geometry else { panic!("a mesh") };
    &mesh.positions
}

/// A file with one triangle, one morph target (0 0 1 for each vertex), and two animations: of the
/// weight and of the translation.
fn waving() -> String {
    let mut bytes = Vec::new();
    let floats: &[f32] = &[
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, // positions
        0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, // differences
        0.0, 2.0, // times
        0.0, 1.0, // weights
        0.0, 0.0, 0.0, 4.0, 0.0, 0.0, // places
    ];
    floats.iter().for_each(|f| bytes.extend(f.to_le_bytes()));
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    let accessor = |offset: usize, count: usize, kind: &str| {
        format!(
            r#"{{"bufferView": 0, "byteOffset": {offset}, "componentType": 5126, "count": {count}, "type": "{kind}"}}"#
        )
    };
    let accessors = [
        accessor(0, 3, "VEC3"),
        accessor(36, 3, "VEC3"),
        accessor(72, 2, "SCALAR"),
        accessor(80, 2, "SCALAR"),
        accessor(88, 2, "VEC3"),
    ];
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "buffers": [{{"byteLength": 112, "uri": "data:;base64,{data}"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 112}}], "accessors": [{}],
        "materials": [{{"name": "red"}}, {{"name": "blue"}}],
        "extensionsUsed": ["KHR_materials_variants"],
        "extensions": {{"KHR_materials_variants": {{"variants": [{{"name": "day"}}, {{"name": "night"}}]}}}},
        "meshes": [{{"name": "sail", "primitives": [{{"attributes": {{"POSITION": 0}}, "targets": [{{"POSITION": 1}}], "material": 0,
            "extensions": {{"KHR_materials_variants": {{"mappings": [{{"variants": [1], "material": 1}}]}}}}}}]}}],
        "nodes": [{{"name": "boat", "mesh": 0}}, {{"name": "other"}}],
        "scenes": [{{"name": "sea", "nodes": [0]}}, {{"name": "land", "nodes": [1]}}],
        "animations": [
            {{"name": "swell", "channels": [{{"sampler": 0, "target": {{"node": 0, "path": "weights"}}}}],
              "samplers": [{{"input": 2, "output": 3}}]}},
            {{"name": "sail away", "channels": [{{"sampler": 0, "target": {{"node": 0, "path": "translation"}}}}],
              "samplers": [{{"input": 2, "output": 4, "interpolation": "STEP"}}]}},
            {{"name": "sink", "channels": [{{"sampler": 0, "target": {{"node": 0, "path": "colour"}}}}],
              "samplers": [{{"input": 2, "output": 4}}]}}
        ]}}"#,
        accessors.join(",")
    )
}

fn read_with(options: ReadOptions) -> Result<Scene, crate::ReadError> {
    read_scene_bytes("test.gltf", waving().into_bytes(), Path::new("."), &options)
}

#[test]
fn weights_and_places_follow_their_keys() {
    let scene = read_text(&waving()).expect("the file is sound");
    let motion = scene.motion.clone().expect("it moves");
    assert_eq!(
        motion.clips.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(),
        ["swell", "sail away", "sink"]
    );
    assert!(
        scene.warnings.iter().any(|w| w.message.contains("\"colour\" is not a property")),
        "{:?}",
        scene.warnings
    );
    for (time, height, place) in
        [(0.0, 0.0, 0.0), (0.5, 0.25, 0.0), (1.5, 0.75, 0.0), (2.0, 1.0, 4.0), (7.0, 1.0, 4.0)]
    {
        let posed = at(&scene, time);
        assert!(positions(node(&posed, "sail")).iter().all(|p| p.z == height), "at {time}");
        assert_eq!(
            node(&posed, "boat").transform.translation,
            DVec3::new(place, 0.0, 0.0),
            "at {time}"
        );
    }
}

#[test]
fn variants_and_scenes_are_chosen_by_name_or_number() {
    let material = |variant: Option<&str>| {
        let scene =
            read_with(ReadOptions { variant: variant.map(String::from), ..ReadOptions::default() });
        scene.map(|scene| node(&scene, "sail").surfaces[0].materials[0].expect("it names one").0)
    };
    assert_eq!((material(None), material(Some("night"))), (Ok(0), Ok(1)));
    assert_eq!((material(Some("1")), material(Some("day"))), (Ok(1), Ok(0)));
    let error = material(Some("dusk")).expect_err("there is none");
    assert!(error.problem.contains("dusk") && error.remedy.contains("day, night"), "{error}");

    let land = read_with(ReadOptions { scene: Some("land".into()), ..ReadOptions::default() })
        .expect("it is there");
    assert!(
        land.nodes.iter().any(|n| n.name == "other") && land.nodes.iter().all(|n| n.name != "boat")
    );
    assert_eq!((land.scenes.len(), land.variants.len()), (2, 2));
    assert!(read_with(ReadOptions { scene: Some("2".into()), ..ReadOptions::default() }).is_err());
}

#[test]
fn a_skinned_file_bends_as_its_joint_turns() {
    let Some(folder) = data("gltf/assimp/simple_skin") else { return };
    let scene = open(&folder.join("simple_skin.gltf")).expect("the file is sound");
    let (rest, bent) = (at(&scene, 0.0), at(&scene, 1.5));
    let mesh = |scene: &Scene| {
        let deformed = &scene.motion.as_ref().expect("it moves").deformed[0];
        positions(&scene.nodes[deformed.node.index()]).to_vec()
    };
    let (rest, bent) = (mesh(&rest), mesh(&bent));
    // A strip of height 2 (10 vertices) whose upper half turns by 90 degrees about its middle.
    assert_eq!(rest.len(), 10);
    assert!((rest[0] - bent[0]).length() < 1e-5, "the foot stays");
    let (a, b) = (rest[8] - Vec3::Y, bent[8] - Vec3::Y);
    assert!((rest[8] - bent[8]).length() > 0.5, "{} {}", rest[8], bent[8]);
    assert!((a.length() - b.length()).abs() < 1e-4, "{a} {b}");
}
