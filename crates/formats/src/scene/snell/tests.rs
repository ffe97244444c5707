use super::*;
use crate::{ReadOptions, read_scene_bytes};
use snell_math::{DVec3, Rgb};
use snell_scene::builtin::BUILTINS;
use snell_scene::graph::MediumId;
use snell_scene::material::Interior;
use snell_scene::material::{Diffuse, MaterialKind};
use snell_scene::medium::Medium;
use snell_scene::{Encoding, TextureId, material::ColorParam};
use snell_scene::{Geometry, Image, ImageTexture, Light, Material, Node, Surface};
use std::path::Path;
use std::sync::Arc;

fn written(scene: &Scene) -> Result<Vec<u8>, String> {
    text(scene).map(String::into_bytes)
}

fn reread(bytes: Vec<u8>) -> Result<Scene, String> {
    read_scene_bytes("test.snell", bytes, Path::new("."), &ReadOptions::default())
        .map_err(|e| e.to_string())
}

/// Every value of a scene as text; sharing is compared through the file itself.
fn shown(scene: &Scene) -> String {
    format!("{:?}", Scene { warnings: Vec::new(), ..scene.clone() })
}

#[test]
fn a_name_that_nothing_declares_is_a_warning_with_its_place() {
    let file = written(&everything()).expect("it can be written");
    assert_eq!(reread(file.clone()).map(|scene| scene.warnings), Ok(Vec::new()));
    let document: serde_json::Value = serde_json::from_slice(&file).expect("JSON");
    for place in ["/lights/0", "/materials/0", "/materials/1/emission", "/textures/0", "/media/0"] {
        let mut document = document.clone();
        document.pointer_mut(place).expect("it is there")["nonsense"] = 1.into();
        let scene = reread(document.to_string().into_bytes()).expect("it can be read");
        let messages: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
        let [message] = messages[..] else { panic!("{place}: {messages:?}") };
        let table = place.split('/').take(3).collect::<Vec<_>>().join("/");
        let is_named = message.contains(&format!("{table}: there is no parameter \"nonsense\""));
        assert!(is_named && message.ends_with("it is ignored"), "{message}");
    }
}

/// One of every material and light, a texture, and a mesh that two nodes share.
fn everything() -> Scene {
    let mut scene = Scene::new("everything");
    let image = scene.add_image(Arc::new(Image::from_f32(
        9,
        3,
        3,
        (0..81).map(|i| i as f32 / 7.0).collect(),
    )));
    scene.add_texture(ImageTexture::new(image, Encoding::Linear));
    for (i, kind) in MaterialKind::examples().into_iter().enumerate() {
        let emission = ColorParam {
            texture: Some(TextureId(0)),
            ..ColorParam::constant(snell_math::Rgb::WHITE)
        };
        scene.add_material(Material { emission, ..Material::new(format!("number {i}"), kind) });
    }
    scene.lights = Light::examples();
    scene.media = Medium::examples();
    scene.materials[0].interior = Some(Interior { medium: Some(MediumId(0)), priority: 2 });
    scene.medium = Some(MediumId(0));
    let positions = (0..99)
        .map(|i| snell_math::Vec3::new(i as f32 / 3.0, 0.1 * i as f32, -1.0 / (i + 1) as f32))
        .collect();
    let indices = (0..33).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = Arc::new(snell_intersect::TriangleMesh { positions, indices, ..Default::default() });
    for i in 0..2 {
        let transform =
            snell_math::DAffine3::from_translation(snell_math::DVec3::splat(f64::from(i) / 3.0));
        let surface =
            Surface::with_material(Geometry::Mesh(mesh.clone()), snell_scene::MaterialId(i as u32));
        let root = scene.root;
        scene.add_child(
            root,
            Node { transform, surfaces: vec![surface], ..Node::named(format!("copy {i}")) },
        );
    }
    scene
}

#[test]
fn what_is_written_is_read_and_written_alike() {
    let scenes = BUILTINS.iter().map(|b| (b.make)()).chain([everything()]);
    for scene in scenes {
        let bytes = written(&scene).expect("every scene can be written");
        let again = reread(bytes.clone()).expect("what was written can be read");
        assert_eq!(shown(&again), shown(&scene), "{}", scene.name);
        assert!(written(&again).expect("it was written before") == bytes, "{}", scene.name);
    }
}

#[test]
fn a_shared_mesh_is_written_once() {
    let bytes = written(&everything()).expect("it can be written");
    let again = reread(bytes).expect("it can be read");
    let meshes: Vec<_> =
        again.nodes.iter().flat_map(|n| &n.surfaces).map(|s| &s.geometry).collect();
    let [Geometry::Mesh(a), Geometry::Mesh(b)] = meshes[..] else { panic!("two meshes") };
    assert!(Arc::ptr_eq(a, b));
}

#[test]
fn what_cannot_be_said_is_refused() {
    let mut scene = everything();
    scene.cameras.push(snell_scene::Camera::look_at(
        snell_math::Vec3::INFINITY,
        snell_math::Vec3::ZERO,
        snell_math::Vec3::Y,
        1.0,
    ));
    let error = written(&scene).expect_err("JSON has no word for infinity");
    assert!(error.contains("camera 0"), "{error}");
}

#[test]
fn a_file_may_be_written_by_hand() {
    let text = r#"{
        "format": "snell scene", "version": 1, "root": 0,
        "materials": [{
            "name": "red", "kind": {"material": "diffuse", "reflectance": {"factor": [0.8, 0.1, 0.1], "texture": null}},
            "emission": {"factor": [0, 0, 0], "texture": null}, "emits_on_both_sides": false, "illuminates": true,
            "alpha_mode": "opaque", "alpha": {"factor": 1, "texture": null}, "double_sided": true, "normal_map": null
        }],
        "nodes": [{"children": [1]}, {
            "transform": [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0]],
            "surfaces": [{"shape": {"shape": "sphere", "radius": 1}, "materials": [0]}]
        }]
    }"#;
    let scene = reread(text.as_bytes().to_vec()).expect("it is complete");
    assert_eq!(scene.bounds().expect("no cycle").center().x, 2.0);
}

#[test]
fn numbers_that_mean_nothing_are_told_and_light_is_brought_to_what_can_be() {
    let file = |material: &str| {
        format!(
            r#"{{"format": "snell scene", "version": 1, "root": 0, "nodes": [{{}}], "materials": [{material}],
            "cameras": [{{"name": "c", "eye": [0, 0, 0], "towards": [0, 0, 2], "up": [0, 3, 1], "aperture_radius": 0,
            "projection": {{"projection": "panoramic"}}, "focus_distance": -1, "resolution": null}}]}}"#
        )
    };
    let plain = Material::new("lamp", Diffuse::new(Rgb::WHITE));
    let with = |change: &dyn Fn(&mut Material)| {
        let mut material = plain.clone();
        change(&mut material);
        reread(file(&serde_json::to_string(&material).expect("it is JSON")).into_bytes())
    };
    let scene = with(&|m| (m.emission.factor, m.alpha.factor) = (Rgb::new(3e38, -1.0, 5.0), 7.0))
        .expect("it is whole");
    assert_eq!(scene.materials[0].emission.factor, Rgb::new(snell_scene::BRIGHTEST, 0.0, 5.0));
    assert_eq!((scene.cameras[0].towards, scene.cameras[0].up), (DVec3::Z, DVec3::Y));
    let warnings: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    for part in [
        "\"lamp\") is 3e38",
        "below zero: -1",
        "alpha.factor: 7 is not",
        "camera 0 (\"c\"): focus_distance: -1",
    ] {
        assert!(warnings.iter().any(|t| t.contains(part)), "{part}: {warnings:?}");
    }
    let map = snell_scene::material::NormalMap::new(snell_scene::TextureId(9), 1.0);
    let error = with(&|m| m.normal_map = Some(map)).expect_err("there are no textures");
    assert!(error.contains("material 0 (\"lamp\") refers to texture 9"), "{error}");
}

#[test]
fn errors_say_where_and_what() {
    let file = |rest: &str| {
        format!("{{\"format\": \"snell scene\", \"version\": 1, \"root\": 0, {rest}}}")
    };
    let cases = [
        (file("\"nodes\": [{\"child\": []}]"), "unknown field `child`"),
        (file("\"nodes\": [{\"children\": [7]}]"), "/nodes: node 0 (\"\") refers to child node 7"),
        (
            file("\"nodes\": [{\"surfaces\": [{\"mesh\": 1}]}]"),
            "/nodes/0/surfaces/0: mesh is 1, but there are 0",
        ),
        (file("\"nodes\": [{\"surfaces\": [{}]}]"), "a surface is a mesh, a shape or curves"),
        (
            file(
                "\"nodes\": [{}], \"lights\": [{\"light\": \"directional\", \
                 \"direction\": [0, 0, 0], \"irradiance\": [1, 1, 1]}]",
            ),
            "/lights/0: direction: expected a direction, not all zeros",
        ),
        (
            file("\"nodes\": [{\"surfaces\": [{\"curves\": 2}]}]"),
            "/nodes/0/surfaces/0: curves is 2, but there are 0",
        ),
        (
            file("\"nodes\": [{}], \"curves\": [{\"points\": [0, 0, 0, 1], \"strands\": [1]}]"),
            "/curves/0/strands: strand 0 has 1 points, expected 4, 7, 10",
        ),
        (
            file("\"nodes\": [{}], \"meshes\": [{\"positions\": [1, 2], \"indices\": []}]"),
            "/meshes/0/positions: there are 2 numbers, expected a multiple of 3",
        ),
        (
            file("\"nodes\": [{}], \"meshes\": [{\"positions\": \"!\", \"indices\": []}]"),
            "broken base64",
        ),
        (
            file(
                "\"nodes\": [{}], \"images\": [{\"width\": 2, \"height\": 1, \"channels\": 1, \
                    \"encoding\": \"srgb\", \"pixels\": {\"u8\": [0]}}]",
            ),
            "/images/0: there are 1 values, expected 2",
        ),
        (file("\"nodes\": [{}]").replace("\"version\": 1", "\"version\": 9"), "version is 9"),
    ];
    for (text, expected) in cases {
        let error = reread(text.into_bytes()).expect_err(expected);
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn damaged_files_never_panic() {
    let bytes = written(&everything()).expect("it can be written");
    for seed in 0..300u32 {
        let mut damaged = bytes.clone();
        for k in 0..3 {
            let at = snell_math::rng::hash_combine(seed, k) as usize % damaged.len();
            damaged[at] = snell_math::rng::hash_combine(seed, k + 10) as u8;
        }
        damaged.truncate(damaged.len() - seed as usize * 7 % damaged.len());
        let _ = reread(damaged);
    }
}

#[test]
fn scenes_of_other_formats_are_kept_whole() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let files = [
        "nff/tetra.nff",
        "minray/test1.json",
        "scn/scenes/distributed.scn",
        "bitterli/cornell-box/pbrt/scene-v4.pbrt",
        "meshes/assimp-obj/spider.obj",
        "gltf/assimp/AnimatedMorphCube/glTF/AnimatedMorphCube.gltf",
        "gltf/cesium/box-morph/box-morph.gltf",
        "gltf/assimp/simple_skin/simple_skin.gltf",
    ];
    for file in files {
        let path = data.join(file);
        if !path.exists() {
            eprintln!("skipped: {file} is not there");
            continue;
        }
        let scene =
            crate::read_scene(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let text = written(&scene).unwrap_or_else(|e| panic!("{file}: {e}"));
        let again = reread(text.clone()).unwrap_or_else(|e| panic!("{file}: {e}"));
        // Notes describe the conversion of another file and its other contents.
        let without_notes =
            Scene { notes: Vec::new(), scenes: Vec::new(), variants: Vec::new(), ..scene };
        assert_eq!(shown(&again), shown(&without_notes), "{file}");
        assert!(written(&again).expect("it was written before") == text, "{file}");
    }
}

#[test]
fn pictures_may_stand_there_as_files_have_them() {
    let image = Image {
        width: 2,
        height: 1,
        channels: 3,
        pixels: snell_scene::Pixels::U8(vec![1, 2, 3, 4, 5, 6]),
        encoding: Encoding::Srgb,
    };
    let (png, _) = crate::write::encoded_picture(&image);
    let numbers: Vec<_> = png.iter().map(u8::to_string).collect();
    let document = |encoded: &str| {
        format!(
            "{{\"format\": \"snell scene\", \"version\": 1, \"root\": 0, \"nodes\": [{{}}], \
                \"images\": [{{\"encoded\": {encoded}}}]}}"
        )
    };
    let scene =
        reread(document(&format!("[{}]", numbers.join(","))).into_bytes()).expect("a picture");
    assert_eq!(*scene.images[0], image);
    let error = reread(document("[1, 2, 3]").into_bytes()).expect_err("no picture");
    assert!(error.contains("/images/0"), "{error}");
}

#[test]
fn a_file_may_leave_out_what_the_reference_page_has_a_value_for() {
    use snell_scene::families::FAMILIES;
    let read = |text: String| {
        let input =
            Input::from_bytes("a.snell", text.into(), Path::new("."), &ReadOptions::default());
        (READER.read)(&input).unwrap_or_else(|e| panic!("{e}"))
    };
    let file = |things: &str| {
        format!(
            "{{\"format\": \"snell scene\", \"version\": 1, {things} \"root\": 0, \
            \"nodes\": [{{\"surfaces\": []}}]}}"
        )
    };
    let mut count = 0;
    for family in FAMILIES.iter().filter(|family| family.name != "pattern") {
        for kind in family.kinds {
            let thing = format!("{{\"{}\": \"{}\"}}", family.tag, kind.name);
            let things = match family.name {
                "material" => format!("\"materials\": [{{\"kind\": {thing}}}],"),
                "projection" => format!("\"cameras\": [{{\"projection\": {thing}}}],"),
                "light" => format!("\"lights\": [{thing}],"),
                // The cells of a grid are elsewhere.
                "medium" if kind.name == "grid" => continue,
                "medium" => format!("\"media\": [{thing}],"),
                _ => {
                    let text = file("").replace("[]", &format!("[{{\"shape\": {thing}}}]"));
                    assert!(!read(text).bounds().expect("no cycles").is_empty(), "{}", kind.name);
                    continue;
                }
            };
            let scene = read(file(&things));
            let things =
                [scene.materials.len(), scene.cameras.len(), scene.lights.len(), scene.media.len()];
            assert_eq!(things.iter().sum::<usize>(), 1, "{}", kind.name);
            count += 1;
        }
    }
    assert!(count > 20, "{count}");
    let plain = read(file("\"materials\": [{}], \"cameras\": [{}],"));
    assert_eq!((plain.materials[0].kind.name(), plain.cameras.len()), ("diffuse", 1));
}
