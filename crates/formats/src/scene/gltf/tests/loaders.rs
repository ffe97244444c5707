//! Files that the standard does not allow, but that loaders take; and what the standard allows and
//! few files use.

use super::{assert_sound, meshes, read_text};
use base64::Engine;
use snell_math::Rgb;
use snell_scene::{Scene, texture::missing_texture_image};
use std::path::Path;

fn base64(bytes: &[u8]) -> String {
    base64::engine::general_purpose::STANDARD.encode(bytes)
}

/// A triangle with three sets of texture coordinates (the number of the set is `u`) and these
/// properties; `mesh` is added to the primitive, `short` bytes are missing at the end of the
/// buffer.
fn triangle(mesh: &str, properties: &str, short: usize) -> String {
    let mut bytes: Vec<u8> = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    for set in 0..3u8 {
        bytes.extend([f32::from(set), 0.5].repeat(3).iter().flat_map(|x| x.to_le_bytes()));
    }
    let length = bytes.len();
    bytes.truncate(length - short);
    let views: Vec<String> = [(0, 36), (36, 24), (60, 24), (84, 24)]
        .map(|(at, n)| format!(r#"{{"buffer": 0, "byteOffset": {at}, "byteLength": {n}}}"#))
        .to_vec();
    let accessor = |view: usize, kind: &str| {
        format!(r#"{{"bufferView": {view}, "componentType": 5126, "count": 3, "type": "{kind}"}}"#)
    };
    let accessors =
        [accessor(0, "VEC3"), accessor(1, "VEC2"), accessor(2, "VEC2"), accessor(3, "VEC2")];
    format!(
        r#"{{"asset": {{"version": "2.0"}}, {properties}
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1,
            "TEXCOORD_1": 2, "TEXCOORD_2": 3}}{mesh}}}]}}],
        "accessors": [{}], "bufferViews": [{}],
        "buffers": [{{"byteLength": {length}, "uri": "data:;base64,{}"}}]}}"#,
        accessors.join(","),
        views.join(","),
        base64(&bytes)
    )
}

/// The scene, and its only warning.
fn with_warning(json: &str) -> (Scene, String) {
    let scene = read_text(json).unwrap_or_else(|e| panic!("{e}"));
    assert_sound(&scene, Path::new(json));
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    let said = scene.warnings[0].message.clone();
    (scene, said)
}

/// The places of the meshes in a scene of a few nodes.
fn places(scene: &Scene) -> Vec<f64> {
    let mut found = Vec::new();
    let mut waiting = vec![(scene.root, 0.0)];
    while let Some((id, x)) = waiting.pop() {
        let node = &scene.nodes[id.index()];
        let x = x + node.transform.translation.x;
        found.extend(node.surfaces.iter().map(|_| x));
        waiting.extend(node.children.iter().map(|&child| (child, x)));
    }
    found
}

#[test]
fn a_root_that_is_a_child_is_shown_once() {
    let nodes = r#""nodes": [{"children": [1], "translation": [10, 0, 0]},
        {"mesh": 0, "translation": [1, 0, 0]}],"#;
    let (scene, said) =
        with_warning(&triangle("", &format!(r#"{nodes} "scenes": [{{"nodes": [1]}}],"#), 0));
    assert_eq!(places(&scene), [1.0]);
    assert!(said.contains("which is not shown"), "{said}");
    for roots in ["[0, 1]", "[1, 0]"] {
        let scenes = format!(r#"{nodes} "scenes": [{{"nodes": {roots}}}],"#);
        let (scene, said) = with_warning(&triangle("", &scenes, 0));
        assert_eq!(places(&scene), [11.0]);
        assert!(said.contains("as that child"), "{said}");
    }
}

#[test]
fn a_node_below_two_parents_is_shown_below_each() {
    let nodes = r#""nodes": [{"children": [1, 2], "translation": [10, 0, 0]},
        {"children": [3], "translation": [1, 0, 0]}, {"children": [3, 3], "translation": [2, 0, 0]},
        {"children": [4]}, {"mesh": 0, "translation": [0.5, 0, 0]}],"#;
    let scene = read_text(&triangle("", nodes, 0)).unwrap_or_else(|e| panic!("{e}"));
    let mut found = places(&scene);
    found.sort_by(f64::total_cmp);
    assert_eq!(found, [11.5, 12.5]);
    let said: Vec<&str> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    assert!(said.len() == 2 && said[0].contains("/nodes/3 is named more than once"), "{said:?}");
    assert!(said[1].contains("/nodes/3 has more than one parent"), "{said:?}");
}

#[test]
fn copies_of_a_moving_node_move() {
    let animation = r#""nodes": [{"children": [2]}, {"children": [2], "translation": [5, 0, 0]},
        {"mesh": 0}], "animations": [{"samplers": [{"input": 4, "output": 5}],
        "channels": [{"sampler": 0, "target": {"node": 2, "path": "translation"}}]}],"#;
    // The numbers of the positions are times and places, too.
    let accessor = |at: usize, kind: &str| {
        format!(
            r#", {{"bufferView": 0, "byteOffset": {at}, "componentType": 5126, "count": 2,
            "type": "{kind}"}}"#
        )
    };
    let text = triangle("", animation, 0);
    let end = text.find(r#"], "bufferViews""#).expect("the end of the accessors");
    let more = [accessor(8, "SCALAR"), accessor(0, "VEC3")].concat();
    let text = format!("{}{more}{}", &text[..end], &text[end..]);
    let (scene, said) = with_warning(&text);
    assert!(said.contains("/nodes/2 has more than one parent"), "{said}");
    let clip = &scene.motion.as_ref().expect("it moves").clips[0];
    let joints: Vec<u32> = clip.channels.iter().map(|channel| channel.joint).collect();
    assert!(joints.len() == 2 && joints[0] != joints[1], "{joints:?}");
}

#[test]
fn a_node_below_itself_is_cut_and_doubling_is_bounded() {
    let cycle = r#""nodes": [{"children": [1]}, {"children": [2], "translation": [1, 0, 0]},
        {"mesh": 0, "children": [1]}],"#;
    let (scene, said) = with_warning(&triangle("", cycle, 0));
    assert_eq!(places(&scene), [1.0]);
    assert!(said.contains("/nodes/1 is below itself"), "{said}");
    // Each of 60 levels shows the next one twice.
    let mut nodes = Vec::new();
    for level in 0..60 {
        let next = 3 * level + 3;
        nodes.push(format!(r#"{{"children": [{}, {}]}}"#, next - 2, next - 1));
        nodes.extend([(); 2].map(|()| format!(r#"{{"children": [{next}]}}"#)));
    }
    let text = format!(r#""nodes": [{}, {{"mesh": 0}}],"#, nodes.join(","));
    let error = read_text(&triangle("", &text, 0)).expect_err("too many copies");
    assert!(error.problem.contains("a node with more than one parent would take"), "{error}");
}

#[test]
fn a_default_scene_that_is_not_there_is_reported_with_the_file() {
    let (_, said) = with_warning(&triangle("", r#""scene": 0, "nodes": [{"mesh": 0}],"#, 0));
    assert!(said.starts_with("test.gltf: \"scene\" asks for scene number 0, but there"), "{said}");
}

#[test]
fn null_and_minus_one_are_none() {
    let nodes = r#""nodes": [{"mesh": 0, "camera": null, "skin": -1}, {"mesh": -1}],"#;
    let (scene, said) = with_warning(&triangle(r#", "material": -1"#, nodes, 0));
    assert_eq!(places(&scene).len(), 1);
    assert!(said.contains("and 3 more"), "{said}");
    let material = r#""nodes": [{"mesh": 0}], "materials": [{"extras": {"a": null, "mesh": -1},
        "pbrMetallicRoughness": {"baseColorTexture": {"index": -1}}}],"#;
    let (scene, said) = with_warning(&triangle(r#", "material": 0"#, material, 0));
    assert!(scene.images.is_empty());
    let place = "/materials/0/pbrMetallicRoughness/baseColorTexture; it is taken";
    assert!(said.contains(place), "{said}");
}

#[test]
fn a_version_may_be_a_number() {
    let json = r#"{"asset": {"version": 2.0, "minVersion": 2}}"#;
    assert!(read_text(json).expect("glTF 2.0").warnings[0].message.contains("the number 2"));
    let error = read_text(r#"{"asset": {"version": 0.8}}"#).expect_err("glTF 0.8");
    assert!(error.problem.contains("this is glTF \"0.8\""), "{error}");
}

#[test]
fn a_buffer_may_lack_a_few_bytes() {
    let nodes = r#""nodes": [{"mesh": 0}],"#;
    let (scene, said) = with_warning(&triangle("", nodes, 3));
    // The last set of coordinates is not read, because nothing uses it.
    assert_eq!((places(&scene).len(), meshes(&scene)[0].indices.len()), (1, 1));
    assert!(said.contains("should have 108 bytes, but has 105"), "{said}");
    assert!(read_text(&triangle("", nodes, 16)).is_err());
}

#[test]
fn required_extensions_are_a_warning_unless_geometry_would_be_missing() {
    for (name, expected) in [
        ("EXT_mesh_features", "does not change the picture"),
        ("MSFT_lod", "does not change the picture"),
        ("ACME_wonder", "may look different"),
    ] {
        let properties = format!(
            r#""extensionsRequired": ["{name}"], "extensionsUsed": ["{name}"], "nodes": [{{"mesh": 0}}],"#
        );
        let (scene, said) = with_warning(&triangle("", &properties, 0));
        assert!(
            places(&scene).len() == 1 && said.contains(name) && said.contains(expected),
            "{said}"
        );
    }
    let center = r#""extensionsRequired": ["CESIUM_RTC"], "nodes": [{"mesh": 0}],
        "extensions": {"CESIUM_RTC": {"center": [1e6, 2, 3]}},"#;
    let (scene, said) = with_warning(&triangle("", center, 0));
    assert!(places(&scene) == [0.0] && said.contains("(1000000 2 3) m"), "{said}");
}

/// Materials of a file, with textures of one image of one pixel: red, half transparent.
fn textured(material: &str) -> Scene {
    let mut targa = vec![0u8; 18];
    (targa[2], targa[12], targa[14], targa[16], targa[17]) = (2, 1, 1, 32, 8);
    targa.extend([0, 0, 255, 128]);
    targa.extend(b"\0\0\0\0\0\0\0\0TRUEVISION-XFILE.\0");
    let properties = format!(
        r#""nodes": [{{"mesh": 0}}], "materials": [{material}], "textures": [{{"source": 0}}],
        "images": [{{"uri": "data:;base64,{}"}}],"#,
        base64(&targa)
    );
    let scene = read_text(&triangle(r#", "material": 0"#, &properties, 0))
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.images.iter().all(|image| **image != missing_texture_image()));
    scene
}

#[test]
fn a_material_may_use_any_four_sets_of_texture_coordinates() {
    let texture = |set: usize| format!(r#"{{"index": 0, "texCoord": {set}}}"#);
    let of = |sets: [usize; 3]| {
        let [first, second, third] = sets.map(texture);
        textured(&format!(
            r#"{{"pbrMetallicRoughness": {{"baseColorTexture": {first}}},
            "emissiveTexture": {second}, "normalTexture": {third}}}"#
        ))
    };
    for sets in [[2, 2, 2], [0, 2, 1], [2, 1, 0]] {
        let scene = of(sets);
        let mesh = meshes(&scene)[0];
        let used = scene.textures.iter().map(|t| t.as_image().expect("an image").uv_set as usize);
        let used: Vec<f32> = used.map(|set| mesh.uvs[set][0].x).collect();
        assert!(sets.iter().all(|&set| used.contains(&(set as f32))), "{used:?}");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
    // Sets with high numbers are stored first, if they are used.
    let scene = of([7, 0, 2]);
    let mesh = meshes(&scene)[0];
    let used: Vec<_> =
        scene.textures.iter().map(|t| t.as_image().expect("an image").uv_set as usize).collect();
    assert_eq!(used.iter().filter(|&&set| mesh.uvs[set].is_empty()).count(), 1);
    let many = textured(&format!(
        r#"{{"pbrMetallicRoughness": {{"baseColorTexture": {}, "metallicRoughnessTexture": {}}},
        "emissiveTexture": {}, "normalTexture": {}, "extensions":
        {{"KHR_materials_clearcoat": {{"clearcoatFactor": 1, "clearcoatTexture": {}}}}}}}"#,
        texture(0),
        texture(1),
        texture(2),
        texture(3),
        texture(4)
    ));
    assert!(many.warnings[0].message.contains("more than 4 sets"), "{:?}", many.warnings);
}

#[test]
fn a_texture_shows_the_first_of_its_images_that_can_be_read() {
    let mut targa = vec![0u8; 18];
    (targa[2], targa[12], targa[14], targa[16], targa[17]) = (2, 1, 1, 32, 8);
    targa.extend([0, 0, 255, 128]);
    targa.extend(b"\0\0\0\0\0\0\0\0TRUEVISION-XFILE.\0");
    let read = |texture: &str| {
        let properties = format!(
            r#""nodes": [{{"mesh": 0}}], "extensionsUsed": ["ACME_texture_good"], "materials":
            [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
            "textures": [{texture}], "images": [{{"uri": "data:;base64,{}"}},
            {{"uri": "data:;base64,AAAA"}}],"#,
            base64(&targa)
        );
        read_text(&triangle(r#", "material": 0"#, &properties, 0)).unwrap_or_else(|e| panic!("{e}"))
    };
    for (texture, is_shown, said) in [
        (r#"{"source": 1, "extensions": {"EXT_texture_webp": {"source": 0}}}"#, true, None),
        (
            r#"{"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}"#,
            true,
            Some("another image of the texture at /textures/0 is shown instead"),
        ),
        (r#"{"source": 0, "extensions": {"ACME_texture_good": {"source": 1}}}"#, true, None),
        (r#"{"extensions": {"ACME_texture_good": {"source": 0}}}"#, true, None),
        (r#"{"extensions": {"ACME_texture_good": {"source": 9}}}"#, false, Some("names no image")),
        (r#"{"extensions": {"ACME_texture_good": 7}}"#, false, Some("names no image")),
    ] {
        let scene = read(texture);
        assert_eq!(*scene.images[0] != missing_texture_image(), is_shown, "{texture}");
        let warnings: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
        let has_images = warnings[0].contains("only where a texture has no other");
        assert_eq!(has_images, texture.contains("ACME"), "{texture}: {warnings:?}");
        assert!(said.is_none_or(|said| warnings.last().is_some_and(|w| w.contains(said))));
        assert_eq!(warnings.len(), 1 + usize::from(said.is_some()), "{texture}: {warnings:?}");
    }
}

#[test]
fn maps_of_specular_glossiness_become_metal_where_they_reflect_as_metal() {
    let scene = textured(
        r#"{"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 0, 0, 1],
        "specularGlossinessTexture": {"index": 0}, "glossinessFactor": 0.5}}}"#,
    );
    assert_eq!(scene.images.len(), 3);
    let pixel = |i: usize| scene.images[i].rgba_as(0, 0, scene.images[i].encoding);
    let [r, g, b, _] = pixel(1);
    assert!(Rgb::new(r, g, b).max_element() > 0.99 && g < 0.01, "{r} {g} {b}");
    let [_, roughness, metalness, _] = pixel(2);
    assert!((roughness - 0.75).abs() < 0.01 && metalness > 0.9, "{roughness} {metalness}");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

/// A pyramid of four triangles, as Draco's encoder wrote it: by edgebreaker at its best level, and
/// one triangle after the other.
const PYRAMIDS: [&str; 2] = [
    "RFJBQ08CAgEBAAAABQQABAAAAm8B/wERAf8AAQEACQMAAAIBAQEADwfNDCs1MwPy34L///8fAPz//r8AgPj/AIAAAA\
    D4/wIA\
     AAAAAP8/AAAAAAAAAAAAAAAAAAAAAIA/Dg==",
    "RFJBQ08CAgEAAAAEBQEAAQQBAgQCAwQDAAQBAQAJAwAAAgABAQAPA2kmzQwrzQwDBfWdiIT/v/8PAAAAAAAA/z8AAA\
    AAAAAA\
     AAAAAAAAAAAAgD8O",
];

/// A file of one Draco stream.
fn draco(stream: &[u8]) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "extensionsUsed": ["KHR_draco_mesh_compression"],
        "extensionsRequired": ["KHR_draco_mesh_compression"], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1,
            "extensions": {{"KHR_draco_mesh_compression":
                {{"bufferView": 0, "attributes": {{"POSITION": 0}}}}}}}}]}}],
        "accessors": [{{"componentType": 5126, "count": 5, "type": "VEC3"}},
            {{"componentType": 5123, "count": 12, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": {0}}}],
        "buffers": [{{"byteLength": {0}, "uri": "data:;base64,{1}"}}]}}"#,
        stream.len(),
        base64(stream)
    )
}

#[test]
fn draco_meshes_are_decoded() {
    for text in PYRAMIDS {
        let stream = base64::engine::general_purpose::STANDARD.decode(text).expect("valid base64");
        let scene = read_text(&draco(&stream)).unwrap_or_else(|e| panic!("{e}"));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let mesh = meshes(&scene)[0];
        assert_eq!((mesh.positions.len(), mesh.indices.len()), (5, 4));
        // Every triangle has the apex (0.5, 0.5, 1), and two neighbours of the base.
        for triangle in &mesh.indices {
            let corners = triangle.map(|i| mesh.positions[i as usize]);
            let sum = corners[0] + corners[1] + corners[2];
            assert!((sum.z - 1.0).abs() < 1e-3, "{corners:?}");
            let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length() / 2.0;
            assert!((area - 1.25f32.sqrt() / 2.0).abs() < 1e-3, "{area}");
        }
    }
}

#[test]
fn damaged_draco_data_is_an_error_or_a_mesh() {
    for text in PYRAMIDS {
        let stream = base64::engine::general_purpose::STANDARD.decode(text).expect("valid base64");
        for length in 0..stream.len() {
            if let Ok(scene) = read_text(&draco(&stream[..length])) {
                assert_sound(&scene, Path::new("cut.gltf"));
            }
        }
        for at in 0..stream.len() {
            for value in [0, 1, 0x7f, 0xff] {
                let mut damaged = stream.clone();
                damaged[at] = value;
                if let Ok(scene) = read_text(&draco(&damaged)) {
                    assert_sound(&scene, Path::new("damaged.gltf"));
                }
            }
        }
    }
    let many = draco(&[0; 8]).replace("\"count\": 5", "\"count\": 400000000");
    let error = read_text(&many).expect_err("4.8 GB from 8 bytes");
    assert!(error.problem.contains("a Draco mesh would take"), "{error}");
}

#[test]
fn a_stride_of_zero_is_none_and_zeros_may_pad_the_json() {
    let json = triangle("", r#""nodes": [{"mesh": 0}],"#, 0);
    let stride = json.replacen(r#""byteLength": 36"#, r#""byteLength": 36, "byteStride": 0"#, 1);
    assert_ne!(stride, json);
    let scene = read_text(&stride).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(meshes(&scene).len(), 1);
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    let mut chunk = json.into_bytes();
    chunk.resize(chunk.len().next_multiple_of(4) + 4, 0);
    glb.extend((20 + chunk.len() as u32).to_le_bytes());
    glb.extend((chunk.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(chunk);
    let read = crate::read_scene_bytes("a.glb", glb, Path::new("."), &Default::default());
    assert_eq!(meshes(&read.unwrap_or_else(|e| panic!("{e}"))).len(), 1);
}

#[test]
fn documents_may_be_utf_16_and_values_written_in_other_ways() {
    let material = r#""materials": [{"doubleSided": 1, "alphaMode": "blend"}],
        "nodes": [{"mesh": 0}, {"mesh": 0, "matrix": [0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]}],"#;
    let json = triangle("", material, 0);
    let units = json.encode_utf16().flat_map(u16::to_le_bytes);
    let utf16: Vec<u8> = [0xff, 0xfe].into_iter().chain(units).collect();
    let padded = [json.as_bytes(), &[0; 3]].concat();
    for bytes in [json.into_bytes(), utf16, padded] {
        let read = crate::read_scene_bytes("a.gltf", bytes, Path::new("."), &Default::default());
        let scene = read.unwrap_or_else(|e| panic!("{e}"));
        assert!(scene.materials[0].double_sided);
        let said: Vec<_> = scene.warnings.iter().map(|w| &*w.message).collect();
        assert!(said.iter().any(|w| w.contains("alphaMode is \"blend\"")), "{said:?}");
        assert!(said.iter().any(|w| w.contains("doubleSided is 1")), "{said:?}");
    }
}

#[test]
fn an_angle_of_view_may_be_in_degrees() {
    let camera = |angle: &str| {
        let perspective = format!(r#"{{"yfov": {angle}, "znear": 0.1}}"#);
        let camera = format!(r#"{{"type": "perspective", "perspective": {perspective}}}"#);
        triangle(
            "",
            &format!(r#""nodes": [{{"camera": 0, "mesh": 0}}], "cameras": [{camera}],"#),
            0,
        )
    };
    let (scene, said) = with_warning(&camera("45"));
    assert!(said.contains("45 radians") && said.contains("degrees"), "{said}");
    let right = read_text(&camera("0.7853981633974483")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.cameras[0].projection, right.cameras[0].projection);
}

#[test]
fn tangents_without_a_direction_are_those_of_the_texture_coordinates() {
    let floats = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    for (u, expected) in [([0.0f32, 1.0, 1.0], 1.0f32), ([1.0, 0.0, 0.0], -1.0)] {
        let mut bytes = floats(&[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0]);
        bytes.extend(floats(&[0.0, 0.0, 1.0].repeat(3)));
        bytes.extend(floats(&[u[0], 1.0, u[1], 1.0, u[2], 0.0]));
        bytes.extend(floats(&[0.0, 0.0, 0.0, 1.0, 0.6, 0.8, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]));
        let parts = [(0, 36, "VEC3"), (36, 36, "VEC3"), (72, 24, "VEC2"), (96, 48, "VEC4")];
        let views = parts
            .map(|(at, n, _)| format!(r#"{{"buffer": 0, "byteOffset": {at}, "byteLength": {n}}}"#));
        let accessors = [0, 1, 2, 3].map(|i| {
            let kind = parts[i].2;
            format!(r#"{{"bufferView": {i}, "componentType": 5126, "count": 3, "type": "{kind}"}}"#)
        });
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}], "meshes": [{{"primitives":
            [{{"attributes": {{"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "TANGENT": 3}}}}]}}],
            "accessors": [{}], "bufferViews": [{}],
            "buffers": [{{"byteLength": {}, "uri": "data:;base64,{}"}}]}}"#,
            accessors.join(","),
            views.join(","),
            bytes.len(),
            base64(&bytes)
        );
        let scene = read_text(&json).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((scene.warnings.len(), scene.warnings[0].count), (1, 2), "{:?}", scene.warnings);
        let tangents = &meshes(&scene)[0].tangents;
        assert_eq!(tangents[1].to_array(), [0.6, 0.8, 0.0, 1.0]);
        for tangent in [tangents[0], tangents[2]] {
            assert_eq!(tangent.to_array(), [expected, 0.0, 0.0, expected]);
        }
    }
}
