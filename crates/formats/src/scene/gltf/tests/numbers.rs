//! Numbers in known files and small documents.

use super::{data, meshes, open, read_text};
use snell_intersect::TriangleMesh;
use snell_math::{Bounds3, ColorMode, DVec3, Rgb, Vec2, Vec3};
use snell_scene::light::{Directional, Point, Spot, SpotFalloff};
use snell_scene::material::{AlphaMode, FuzzModel, MaterialKind};
use snell_scene::texture::{Filtering, Wrap};
use snell_scene::{Background, Encoding, Geometry, Light, Projection, Scene};

/// A file of the collection.
fn scene(file: &str) -> Option<Scene> {
    let path = data("gltf")?.join(file);
    Some(open(&path).unwrap_or_else(|e| panic!("{e}")))
}

/// The corners of a mesh's triangles, each rotated so that its smallest corner comes first, sorted:
/// equal for equal surfaces.
fn triangles(mesh: &TriangleMesh) -> Vec<[[f32; 3]; 3]> {
    let corners = |i| mesh.corners(i).map(|p| p.to_array());
    let turned = |mut c: [[f32; 3]; 3]| {
        let least = (0..3)
            .min_by(|&a, &b| c[a].partial_cmp(&c[b]).expect("finite"))
            .expect("three corners");
        c.rotate_left(least);
        c
    };
    let mut all: Vec<_> = (0..mesh.indices.len()).map(|i| turned(corners(i))).collect();
    all.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
    all
}

#[test]
fn all_packagings_of_the_box_are_the_same_scene() {
    let names = ["Box_glTF/Box.gltf", "Box_glTF-Binary/Box.glb", "Box_glTF-Embedded/Box.gltf"];
    for name in names {
        let Some(scene) = scene(&format!("gltf-transform/{name}")) else { return };
        let [mesh] = meshes(&scene)[..] else { panic!("one mesh") };
        assert_eq!((mesh.positions.len(), mesh.indices.len(), mesh.normals.len()), (24, 12, 24));
        assert_eq!(mesh.bounds(), Bounds3 { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) });
        let bounds = scene.bounds().expect("the scene is sound");
        assert!(
            (bounds.min - DVec3::splat(-0.5)).length() < 1e-6
                && (bounds.max - DVec3::splat(0.5)).length() < 1e-6
        );
        assert_eq!(scene.warnings, []);
    }
}

#[test]
fn strips_and_fans_make_the_surface_of_triangles() {
    let square = |mode: u32, indices: &[u8]| {
        let scene = read_text(&square(mode, indices)).expect("the square is sound");
        triangles(meshes(&scene)[0])
    };
    let expected = square(4, &[0, 1, 2, 2, 1, 3]);
    assert_eq!(expected.len(), 2);
    assert_eq!(square(5, &[0, 1, 2, 3]), expected);
    assert_eq!(square(6, &[1, 3, 2, 0]).len(), 2);
    let up = |t: &[[f32; 3]; 3]| {
        let [a, b, c] = t.map(Vec3::from_array);
        (b - a).cross(c - a).z > 0.0
    };
    assert!(square(6, &[1, 3, 2, 0]).iter().all(up) && expected.iter().all(up));
}

/// A document with the corners (0,0,0) (1,0,0) (0,1,0) (1,1,0) as bytes, and these indices.
fn square(mode: u32, indices: &[u8]) -> String {
    use base64::Engine;
    let mut bytes = vec![0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0];
    bytes.extend(indices);
    let data = base64::engine::general_purpose::STANDARD.encode(&bytes);
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "mode": {mode}}}]}}],
        "accessors": [{{"componentType": 5121, "type": "VEC3", "count": 4, "bufferView": 0}},
            {{"componentType": 5121, "type": "SCALAR", "count": {count}, "bufferView": 1}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 16, "byteStride": 4}},
            {{"buffer": 0, "byteOffset": 16, "byteLength": {count}}}],
        "buffers": [{{"byteLength": {total}, "uri": "data:application/octet-stream;base64,{data}"}}]}}"#,
        count = indices.len(),
        total = bytes.len()
    )
}

#[test]
fn sparse_values_replace_those_of_the_buffer() {
    let Some(scene) = scene("khronos-samples-and-misc/SimpleSparseAccessor.gltf") else { return };
    let mesh = meshes(&scene)[0];
    // The model is a plane of 7 x 2 points, three of which are moved to (1, 2, 0), (3, 3, 0) and
    // (5, 4, 0).
    assert_eq!(mesh.positions.len(), 14);
    assert_eq!(
        [8, 10, 12].map(|i| mesh.positions[i]),
        [[1.0, 2.0, 0.0], [3.0, 3.0, 0.0], [5.0, 4.0, 0.0]].map(Vec3::from)
    );
    assert_eq!(mesh.positions[7], Vec3::new(0.0, 1.0, 0.0));
}

#[test]
fn a_mesh_used_twice_is_stored_once() {
    let Some(scene) = scene("blender-io/02_shared_mesh/02_shared_mesh.gltf") else { return };
    let users = scene.nodes.iter().flat_map(|n| &n.children);
    let with_surface = users.filter(|c| !scene.nodes[c.index()].surfaces.is_empty());
    assert!(with_surface.count() > meshes(&scene).len());
}

#[test]
fn cameras_stand_where_their_nodes_put_them() {
    let json = r#"{"asset": {"version": "2.0"}, "nodes": [
        {"translation": [1, 2, 3], "scale": [2, 2, 2], "rotation": [0, 0.7071067811865476, 0, 0.7071067811865476], "children": [1]},
        {"name": "eye", "translation": [0, 0, 1], "camera": 0}, {"camera": 1}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.5707963267948966, "znear": 0.1, "aspectRatio": 2}},
        {"name": "flat", "type": "orthographic", "orthographic": {"xmag": 4, "ymag": 3, "znear": 0, "zfar": 9}}]}"#;
    let scene = read_text(json).expect("the document is sound");
    let [flat, eye] = &scene.cameras[..] else { panic!("two cameras") };
    assert_eq!((eye.name.as_str(), flat.name.as_str()), ("eye", "flat"));
    assert!((eye.eye - DVec3::new(3.0, 2.0, 3.0)).length() < 1e-12, "{}", eye.eye);
    assert!((eye.towards - DVec3::NEG_X).length() < 1e-12 && (eye.up - DVec3::Y).length() < 1e-12);
    let Projection::Perspective { tan_half_fov: [None, Some(tan)] } = eye.projection else {
        panic!("{eye:?}")
    };
    assert!((tan - 1.0).abs() < 1e-12);
    assert_eq!(flat.projection, Projection::Orthographic { half_size: [None, Some(3.0)] });
}

/// A document with one light at (0, 0, 5).
fn light(generator: &str, light: &str) -> Light {
    let json = format!(
        r#"{{"asset": {{"version": "2.0", "generator": "{generator}"}},
        "extensions": {{"KHR_lights_punctual": {{"lights": [{light}]}}}},
        "nodes": [{{"translation": [0, 0, 5], "extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}}]}}"#
    );
    let mut scene = read_text(&json).expect("the document is sound");
    scene.lights.remove(0)
}

#[test]
fn lights_keep_their_numbers_and_shine_along_minus_z() {
    let sun = light("x", r#"{"type": "directional", "intensity": 2, "color": [1, 0.5, 0]}"#);
    assert_eq!(
        sun,
        Light::Directional(Directional {
            direction: DVec3::NEG_Z,
            irradiance: Rgb::new(2.0, 1.0, 0.0)
        })
    );
    let Light::Spot(Spot { position, intensity, falloff, .. }) = light(
        "x",
        r#"{"type": "spot", "intensity": 5, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}}"#,
    ) else {
        panic!("a spot light")
    };
    assert_eq!((position, intensity), (DVec3::new(0.0, 0.0, 5.0), Rgb::splat(5.0)));
    assert_eq!(falloff, SpotFalloff::Smooth { inner: 0.2, outer: 0.4 });
}

#[test]
fn light_profiles_shine_along_minus_z_of_their_nodes() {
    let document = |uri: &str| {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "extensions": {{"EXT_lights_ies": {{"lights": [{{"uri": "{uri}"}}]}}}},
            "nodes": [{{"translation": [0, 0, 5], "extensions": {{"EXT_lights_ies": {{"light": 0, "multiplier": 3}}}}}}]}}"#
        )
    };
    // The profile has 100 cd along the axis, 50 cd to the side, and nothing behind.
    let ies =
        "data:application/x-ies-lm-63,TILT=NONE%0A1 1 1 2 1 1 2 0 0 0%0A1 1 0%0A0 90%0A0%0A100 50";
    let scene = read_text(&document(ies)).expect("the document is sound");
    let at = |p: Vec3| scene.lights[0].sample(p, Vec2::ZERO, ColorMode::Rgb).map(|s| s.radiance[1]);
    assert_eq!(at(Vec3::new(0.0, 0.0, 3.0)), Some(75.0));
    assert_eq!(at(Vec3::new(0.0, 0.0, 6.0)), None);
    assert!(at(Vec3::new(1.0, 0.0, 5.0)).is_some_and(|side| (side - 150.0).abs() < 1e-2));
    let broken = read_text(&document("data:,nothing")).expect("the rest is shown");
    assert!(
        broken.lights.is_empty()
            && broken.warnings.iter().any(|w| w.message.contains("no line TILT="))
    );
}

#[test]
fn photometric_lights_of_blender_become_watts_again() {
    let intensity = |generator, cd: f64| match light(
        generator,
        &format!(r#"{{"type": "point", "intensity": {cd}}}"#),
    ) {
        Light::Point(Point { intensity, .. }) => f64::from(intensity.r),
        other => panic!("{other:?}"),
    };
    // A lamp of 1000 W: 1000 W * 683 lm/W / 4 pi sr.
    let written = 1000.0 * 683.0 / (4.0 * std::f64::consts::PI);
    assert!(
        (intensity("Khronos glTF Blender I/O v4.2", written) * 4.0 * std::f64::consts::PI - 1000.0)
            .abs()
            < 1e-3
    );
    assert!((intensity("something else", written) - written).abs() < 1e-2);
    assert_eq!(intensity("Khronos glTF Blender I/O v4.2", 3.0), 3.0);
}

#[test]
fn texture_coordinates_are_turned_as_the_test_model_of_the_extension_wants() {
    let Some(scene) = scene("assimp/textureTransform/TextureTransformTest.gltf") else { return };
    let map = |name: &str, uv: [f32; 2]| {
        let material =
            scene.materials.iter().find(|m| m.name == name).expect("the material is there");
        let (texture, _) = material.alpha.texture.expect("it has a texture");
        let texture = scene.textures[texture.index()].as_image().expect("an image");
        assert_eq!(texture.wrap, [Wrap::Clamp; 2]);
        texture.uv_transform.map(|row| row[0] * uv[0] + row[1] * uv[1] + row[2])
    };
    assert_eq!(map("Offset UV", [0.25, 0.0]), [0.75, 0.5]);
    // The arrow points along the diagonal of its image; the marker "correct" shows where the arrow
    // must end.
    let [u, v] = map("Rotation", [0.5 - 0.079_048_224, 0.5 + 0.516_267_5]);
    assert!((u - v).abs() < 1e-4, "{u} {v}");
    let [u, v] = map("Scale", [0.518_544_97, 0.518_544_97]);
    assert!((u - 0.777_817_46).abs() < 1e-4 && (u - v).abs() < 1e-6, "{u} {v}");
}

#[test]
fn materials_carry_their_textures_and_modes() {
    let json = r#"{"asset": {"version": "2.0"}, "materials": [
        {"name": "m", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0, 0.25], "baseColorTexture": {"index": 0}},
         "alphaMode": "MASK", "alphaCutoff": 0.75, "emissiveFactor": [1, 0.5, 0],
         "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}},
        {"name": "u", "extensions": {"KHR_materials_unlit": {}}, "doubleSided": true,
         "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 0, 1]}}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33648, "magFilter": 9728}], "images": [{"uri": "data:image/png;base64,AAAA"}]}"#;
    let scene = read_text(json).expect("the document is sound");
    let [textured, unlit] = &scene.materials[..] else { panic!("two materials") };
    assert_eq!((textured.alpha_mode, textured.alpha.factor), (AlphaMode::Mask(0.75), 0.25));
    assert_eq!(textured.emission.factor, Rgb::new(4.0, 2.0, 0.0));
    assert!(!textured.double_sided && !textured.emits_on_both_sides);
    assert_eq!(unlit.emission.factor, Rgb::new(0.5, 1.0, 0.0));
    assert!(unlit.double_sided && unlit.emits_on_both_sides);
    let [texture] = &scene.textures[..] else { panic!("one texture") };
    let texture = texture.as_image().expect("an image");
    assert_eq!(texture.wrap, [Wrap::Mirror, Wrap::Repeat]);
    assert_eq!((texture.filtering, texture.encoding), (Filtering::Nearest, Encoding::Srgb));
    // The image is broken: a checkerboard and a warning replace it.
    assert_eq!(scene.images[0].rgba(0, 0)[..3], [1.0, 0.0, 1.0]);
    assert!(scene.warnings[0].message.contains("checker"), "{:?}", scene.warnings);
}

#[test]
fn morph_targets_are_applied_with_the_weights_of_the_file() {
    let Some(folder) = data("gltf/cesium/box-morph") else { return };
    let text = std::fs::read_to_string(folder.join("box-morph.gltf"))
        .expect("the file is in the collection");
    let mut json: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
    let mut height = |weights: serde_json::Value| {
        for mesh in json["meshes"].as_array_mut().expect("it has meshes") {
            mesh["weights"] = weights.clone();
        }
        let options = crate::ReadOptions::default();
        let scene =
            crate::read_scene_bytes("box.gltf", json.to_string().into_bytes(), &folder, &options);
        meshes(&scene.expect("the document is sound"))[0].bounds()
    };
    let (none, full, half) = (
        height(serde_json::json!([0.0, 0.0])),
        height(serde_json::json!([1.0, 0.0])),
        height(serde_json::json!([0.5, 0.0])),
    );
    assert_ne!(none, full);
    let mean = (none.max + full.max) * 0.5;
    assert!((half.max - mean).length() < 1e-5, "{half:?}");
}

#[test]
fn skinned_meshes_follow_their_joints_and_not_their_node() {
    let Some(scene) = scene("assimp/simple_skin/simple_skin.gltf") else { return };
    let mesh = meshes(&scene)[0];
    assert_eq!(mesh.indices.len(), 8);
    // At the pose of the file the joints are at their bind pose, so nothing moves: the strip is 2
    // high.
    let bounds = scene.bounds().expect("the scene is sound");
    assert!((bounds.max.y - 2.0).abs() < 1e-6, "{bounds:?}");
}

#[test]
fn instances_share_one_mesh() {
    let Some(scene) = scene("blender-io/24_gpu_instancing/24_gpu_instancing.gltf") else { return };
    let mut uses = vec![0; scene.nodes.len()];
    for child in scene.nodes.iter().flat_map(|n| &n.children) {
        uses[child.index()] += 1;
    }
    assert!(uses.iter().max() > Some(&1), "{uses:?}");
}

#[test]
fn quantised_positions_and_fractions_are_scaled_by_their_type() {
    let scene = read_text(&square(4, &[0, 1, 2])).expect("the square is sound");
    assert_eq!(meshes(&scene)[0].positions[3], Vec3::new(1.0, 1.0, 0.0));
    let normalized = square(4, &[0, 1, 2]).replace(r#""VEC3","#, r#""VEC3", "normalized": true,"#);
    let scene = read_text(&normalized).expect("the square is sound");
    assert_eq!(meshes(&scene)[0].positions[3], Vec3::new(1.0 / 255.0, 1.0 / 255.0, 0.0));
}

#[test]
fn vertices_that_no_triangle_uses_are_left_out_and_nothing_moves() {
    let corner = |i: u16| Vec3::new(f32::from(i), f32::from(i * i), 0.0);
    let mesh = TriangleMesh {
        positions: (0..20).map(corner).collect(),
        colors: (0u8..20).map(|i| [f32::from(i); 4]).collect(),
        indices: vec![[19, 3, 7], [3, 7, 11]],
        ..TriangleMesh::default()
    };
    let before = triangles(&mesh);
    let mut primitive = super::super::mesh::Primitive {
        mesh,
        targets: Vec::new(),
        influences: Vec::new(),
        strokes: None,
        material: None,
    };
    super::super::mesh::drop_unused(&mut primitive);
    let mesh = primitive.mesh;
    assert_eq!((mesh.positions.len(), mesh.colors.len(), mesh.validate()), (4, 4, Ok(())));
    assert_eq!(triangles(&mesh), before);
    assert!(mesh.positions.iter().zip(&mesh.colors).all(|(p, c)| p.x == c[0]));
}

#[test]
fn clear_volumes_refract_and_thin_sheets_do_not() {
    let material = |thickness: f64| {
        let json = format!(
            r#"{{"asset": {{"version": "2.0"}}, "materials": [{{"pbrMetallicRoughness": {{"metallicFactor": 0}}, "extensions": {{
            "KHR_materials_ior": {{"ior": 1.33}}, "KHR_materials_transmission": {{"transmissionFactor": 1}},
            "KHR_materials_volume": {{"thicknessFactor": {thickness}, "attenuationDistance": 1, "attenuationColor": [0.25, 1, 1]}}}}}}]}}"#
        );
        read_text(&json).expect("the document is sound").materials.remove(0)
    };
    let glass = material(1.0);
    let MaterialKind::OpenPbr(solid) = &glass.kind else { panic!("{glass:?}") };
    assert_eq!(
        (solid.specular_ior.factor, solid.transmission_weight.factor, glass.double_sided),
        (1.33, 1.0, true)
    );
    assert_eq!(
        (solid.transmission_color.factor, solid.transmission_depth.factor),
        (Rgb::new(0.25, 1.0, 1.0), 1.0)
    );
    assert!(!solid.geometry_thin_walled);
    let sheet = material(0.0);
    assert!(matches!(&sheet.kind, MaterialKind::OpenPbr(m) if m.geometry_thin_walled), "{sheet:?}");
}

#[test]
fn coats_have_their_own_roughness_and_normals() {
    let json = r#"{"asset": {"version": "2.0"}, "textures": [{"source": 0}],
        "images": [{"uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="}],
        "materials": [{"normalTexture": {"index": 0}, "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.5,
            "clearcoatRoughnessFactor": 0.25, "clearcoatNormalTexture": {"index": 0, "scale": 2}}}}]}"#;
    let scene = read_text(json).expect("the document is sound");
    assert!(scene.warnings.len() == 1 && scene.warnings[0].message.contains("no meshes"));
    let MaterialKind::OpenPbr(coated) = &scene.materials[0].kind else { panic!("{scene:?}") };
    assert_eq!((coated.coat_weight.factor, coated.coat_roughness.factor), (0.5, 0.25));
    assert_eq!(coated.geometry_coat_normal.map(|m| m.scale), Some(2.0));
}

#[test]
fn extensions_of_materials_become_parameters_of_open_pbr_and_are_noted() {
    let json = r#"{"asset": {"version": "2.0"}, "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.5},
        "extensions": {
            "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 0], "sheenRoughnessFactor": 0.3},
            "KHR_materials_iridescence": {"iridescenceFactor": 0.75, "iridescenceIor": 1.8, "iridescenceThicknessMaximum": 500},
            "KHR_materials_anisotropy": {"anisotropyStrength": 1, "anisotropyRotation": 0.5},
            "KHR_materials_dispersion": {"dispersion": 0.5},
            "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.25, "diffuseTransmissionColorFactor": [1, 0, 0]},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [2, 1, 1]},
            "ACME_materials_magic": {}}}]}"#;
    let scene = read_text(json).expect("the document is sound");
    let MaterialKind::OpenPbr(m) = &scene.materials[0].kind else { panic!("{scene:?}") };
    assert_eq!(
        (m.fuzz_weight.factor, m.fuzz_color.factor, m.fuzz_roughness.factor),
        (0.5, Rgb::new(1.0, 0.5, 0.0), 0.3)
    );
    assert_eq!(m.fuzz_model, FuzzModel::Charlie);
    assert_eq!(
        (m.thin_film_weight.factor, m.thin_film_ior.factor, m.thin_film_thickness.factor),
        (0.75, 1.8, 0.5)
    );
    // alpha is 1 along the tangent and stays 0.25 across.
    assert!((m.specular_roughness_anisotropy.factor - 0.75).abs() < 1e-6);
    assert!((m.specular_roughness.factor.powi(4) - 0.5 * (1.0 + 0.0625)).abs() < 1e-6);
    assert_eq!(m.geometry_tangent.map(|t| t.rotation), Some(0.5));
    assert_eq!(m.transmission_dispersion_scale.factor, 0.5);
    assert_eq!(
        (m.subsurface_weight.factor, m.subsurface_color.factor),
        (0.25, Rgb::new(1.0, 0.0, 0.0))
    );
    // Twice 4 % is the reflectance of an index of 1.789.
    assert!((m.specular_ior.factor - 1.7888).abs() < 1e-3, "{}", m.specular_ior.factor);
    assert_eq!(m.specular_color.factor, Rgb::new(1.0, 0.5, 0.5));
    assert!(
        scene.notes.iter().any(|n| n.message.starts_with("KHR_materials_sheen: fuzz_weight")),
        "{:?}",
        scene.notes
    );
    assert!(
        scene.notes.iter().any(|n| n.message == "ACME_materials_magic: not mapped"),
        "{:?}",
        scene.notes
    );
}

#[test]
fn what_only_glows_is_lit_by_the_sky_and_lamps_are_not() {
    let scene = |material: &str| {
        let with = |key: &str, value: &str| format!("{value}, {key}");
        let text = square(4, &[0, 1, 2])
            .replace(r#""nodes""#, &with(r#""nodes""#, &format!(r#""materials": [{material}]"#)))
            .replace(r#""attributes""#, &with(r#""attributes""#, r#""material": 0"#));
        read_text(&text).expect("sound")
    };
    let unlit = scene(r#"{"extensions": {"KHR_materials_unlit": {}}}"#);
    let display = scene(r#"{"emissiveFactor": [1, 1, 1]}"#);
    for lit in [&unlit, &display] {
        assert!(
            lit.environment.is_some() && matches!(lit.background, Background::ShadowCatcher(_))
        );
    }
    assert!(!unlit.materials[0].illuminates && unlit.materials[0].emission_takes_vertex_color);
    assert!(display.materials[0].illuminates && !display.materials[0].emission_takes_vertex_color);
    let strength = r#""extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 5}}"#;
    let lamp = scene(&format!(r#"{{"emissiveFactor": [1, 1, 1], {strength}}}"#));
    assert!(lamp.environment.is_none() && scene("{}").environment.is_none());
}

#[test]
fn meshes_without_nodes_are_shown_and_have_two_sides() {
    let scene = read_text(&square(4, &[0, 1, 2]).replace("\"nodes\"", "\"extras\""))
        .expect("the square is sound");
    let bounds = scene.bounds().expect("the scene is sound");
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(bounds.is_finite() && scene.materials.iter().all(|m| m.double_sided));
}

#[test]
fn points_and_lines_are_balls_and_tubes_and_the_message_names_their_place() {
    let scene = read_text(&square(0, &[0, 1, 2])).expect("points");
    let strokes = |scene: &Scene| -> Vec<Vec<u32>> {
        let surfaces = scene.nodes.iter().flat_map(|n| &n.surfaces);
        surfaces
            .filter_map(|s| match &s.geometry {
                Geometry::Curves(curves) => Some(curves.strands().to_vec()),
                _ => None,
            })
            .collect()
    };
    assert_eq!(strokes(&scene), [[2, 2, 2]]);
    let said = &scene.warnings[0].message;
    assert!(said.starts_with("test.gltf: at /meshes/0: 3 points are drawn as balls"), "{said}");
    let closed = read_text(&square(2, &[0, 1, 2])).expect("a loop");
    assert_eq!(strokes(&closed), [[4]]);
}
