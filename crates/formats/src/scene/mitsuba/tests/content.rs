//! The conversion of objects.

use super::*;
use crate::{Limits, ReadOptions, read_scene};
use snell_math::{DVec3, Rgb};
use snell_scene::bsdf::MicrofacetShape;
use snell_scene::light::{Directional, Point, Profile};
use snell_scene::material::{
    AlphaMode, ConductorSpectrum, Diffuse, HeightUnit, MaterialKind, ScalarParam,
};
use snell_scene::{Environment, Geometry, Light, Material, Medium, Projection};
use std::io::Write;

/// The material of a sphere with this bsdf.
fn material(bsdf: &str) -> MaterialKind {
    let scene = clean(&format!("<shape type=\"sphere\">{bsdf}</shape>"));
    assert_eq!(scene.materials.len(), 1);
    scene.materials[0].kind.clone()
}

#[test]
fn public_scenes_load_with_all_they_hold() {
    let mut lines = Vec::new();
    for file in ["cornell-box/mitsuba/scene_v3.xml", "veach-mis/mitsuba/scene.xml"] {
        let Some(folder) = data("bitterli") else { return };
        let mut scene = read_scene(&folder.join(file), &ReadOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        let prefix = format!("{}/", folder.display());
        scene.warnings.iter_mut().for_each(|w| w.message = w.message.replace(&prefix, ""));
        lines.push(format!("{file}: {} {:?}", summary(&scene), scene.settings.size));
    }
    insta::assert_snapshot!(lines.join("\n"));
}

#[test]
fn content_tells_the_format() {
    for text in [
        "<scene version=\"3.0.0\">",
        "\u{feff}<?xml version='1.0'?>\n<!-- a -->\n <scene version='0.6.0' >",
    ] {
        assert!((READER.recognises)(text.as_bytes()), "{text}");
    }
    for text in ["", "<scene>", "<svg version='1'>", "<!-- ", "scene"] {
        assert!(!(READER.recognises)(text.as_bytes()), "{text}");
    }
}

#[test]
fn parameters_have_the_values_of_the_caller_or_their_defaults() {
    let text = "<scene version=\"3.0.0\"><default name=\"r\" value=\"2\"/><default name=\"rr\" \
        value=\"7\"/>\
        <shape type=\"sphere\"><float name=\"radius\" value=\"$r\"/></shape>\
        <shape type=\"sphere\"><float name=\"radius\" value=\"1$rr\"/></shape></scene>";
    let radii = |parameters: Vec<(String, String)>| {
        let options = ReadOptions { parameters, ..ReadOptions::default() };
        let scene =
            crate::read_scene_bytes("a.xml", text.into(), std::path::Path::new("."), &options)
                .expect("fine");
        assert!(scene.takes_parameter("r") && !scene.takes_parameter("other"));
        scene.bounds().expect("no cycles").max.x
    };
    assert_eq!(radii(Vec::new()), 17.0);
    assert_eq!(radii(vec![("r".into(), "30".into()), ("other".into(), "1".into())]), 30.0);
}

#[test]
fn a_parameter_without_a_value_leaves_the_default_and_a_warning() {
    let text = "<sensor type=\"perspective\"><sampler type=\"independent\"><integer \
        name=\"sample_count\" value=\"$spp\"/></sampler></sensor>";
    assert_eq!(scene_of(text).settings.spp, Some(4));
    assert!(warnings(text).contains("-D spp=VALUE"), "{}", warnings(text));
}

#[test]
fn search_folders_are_relative_to_the_file_that_names_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, text).expect("written");
    };
    let triangle = |size: u32| format!("v 0 0 0\nv {size} 0 0\nv 0 {size} 0\nf 1 2 3\n");
    write("meshes/a.obj", &triangle(1));
    write("parts/common/meshes/a.obj", &triangle(2));
    write("parts/common/more.xml", "<scene version='3.0.0'><shape type='sphere'/></scene>");
    write(
        "parts/part.xml",
        "<scene version='3.0.0'><path value='common'/><include filename='more.xml'/></scene>",
    );
    let shape = "<shape type='obj'><string name='filename' value='meshes/a.obj'/></shape>";
    let read = |first: &str| {
        write("a.xml", &format!("<scene version='3.0.0'>{first}{shape}</scene>"));
        read_scene(&folder.path().join("a.xml"), &ReadOptions::default()).expect("a scene")
    };
    let width = |scene: &Scene| scene.bounds().expect("no cycles").max.x;
    assert_eq!(width(&read("")), 1.0);
    let scene = read("<include filename='parts/part.xml'/>");
    assert_eq!((width(&scene), scene.nodes.len(), scene.warnings.len()), (2.0, 3, 0));
    // A name in an included file may be relative to it.
    write("other/b.obj", &triangle(3));
    write(
        "other/part.xml",
        "<scene version='3.0.0'><shape type='obj'><string name='filename' value='b.obj'/></shape>\
            </scene>",
    );
    assert_eq!(width(&read("<include filename='other/part.xml'/>")), 3.0);
    // Of a confined scene, no folder outside of its own is searched.
    write("parts/a.xml", "<scene version='3.0.0'><path value='..'/></scene>");
    let options = ReadOptions { confine: true, ..ReadOptions::default() };
    let outside = read_scene(&folder.path().join("parts/a.xml"), &options).expect("a scene");
    assert!(outside.warnings[0].message.contains("lies outside"), "{:?}", outside.warnings);
    write(
        "parts/a.xml",
        &format!("<scene version='3.0.0'><path value='../none'/>{}</scene>", shape),
    );
    let error = read_scene(&folder.path().join("parts/a.xml"), &options).expect_err("refused");
    assert!(error.to_string().contains("<path> \"../none\" was refused"), "{error}");
    assert!(read("<path value='none'/>").warnings[0].message.contains("no folder \"none\""));
}

#[test]
fn included_files_meshes_and_groups_are_parts_of_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).expect("written")
    };
    write("t.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0.25\nf 1/1 2/1 3/1\n");
    write("m.serialized", &serialized());
    write(
        "materials.xml",
        b"<scene version='3.0.0'><bsdf type='diffuse' id='red'><rgb name='reflectance' value='1 0 \
            0'/></bsdf></scene>",
    );
    write(
        "a.xml",
        br#"<scene version="3.0.0"><include filename="materials.xml"/><alias id="red" as="paint"/>
        <shape type="shapegroup" id="g"><shape type="obj"><string name="filename" value="t.obj"/><ref id="paint"/></shape></shape>
        <shape type="instance"><ref id="g"/><transform name="to_world"><translate x="1"/></transform></shape>
        <shape type="instance"><ref id="g"/><transform name="to_world"><translate x="5"/></transform></shape>
        <shape type="serialized"><string name="filename" value="m.serialized"/><integer name="shape_index" value="1"/></shape></scene>"#,
    );
    let scene = read_scene(&folder.path().join("a.xml"), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let meshes = meshes(&scene);
    // Two open meshes have black backs.
    assert_eq!(meshes.len(), 4);
    let obj = meshes.iter().find(|m| !m.uvs[0].is_empty()).expect("the one with coordinates");
    assert_eq!(obj.uvs[0][0].y, 0.75, "coordinates of OBJ files are turned");
    assert_eq!(
        (scene.bounds().expect("no cycles").max.x, scene.bounds().expect("no cycles").max.z),
        (6.0, 3.0)
    );
    assert_eq!(scene.materials[0].name, "red");
}

/// Two meshes of one triangle, the second at a height of 3.
fn serialized() -> Vec<u8> {
    let mut file = Vec::new();
    let mut offsets = Vec::new();
    for z in [1.0f32, 3.0] {
        offsets.push(file.len() as u64);
        file.extend([0x1c, 0x04, 4, 0]);
        let mut body = Vec::new();
        body.extend(0x1000u32.to_le_bytes());
        body.extend(b"name\0");
        body.extend([3u64, 1].map(u64::to_le_bytes).concat());
        body.extend([0.0, 0.0, z, 1.0, 0.0, z, 0.0, 1.0, z].map(f32::to_le_bytes).concat());
        body.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
        let mut packer = flate2::write::ZlibEncoder::new(&mut file, flate2::Compression::fast());
        packer.write_all(&body).expect("memory has room");
        packer.finish().expect("memory has room");
    }
    file.extend(offsets.into_iter().flat_map(u64::to_le_bytes));
    file.extend(2u32.to_le_bytes());
    file
}

#[test]
fn cameras_see_what_mitsubas_see() {
    let scene = clean(
        "<sensor type=\"thinlens\"><float name=\"fov\" value=\"90\"/><string name=\"fov_axis\" \
            value=\"y\"/>\
        <float name=\"aperture_radius\" value=\"0.1\"/><float name=\"focus_distance\" value=\"3\"/>\
        <transform name=\"to_world\"><lookat origin=\"0,0,5\" target=\"0,0,0\" \
        up=\"0,1,0\"/></transform>\
        <film type=\"hdrfilm\"><integer name=\"width\" value=\"200\"/><integer name=\"height\" \
        value=\"100\"/><rfilter type=\"tent\"/></film>\
        <sampler type=\"independent\"><integer name=\"sample_count\" \
        value=\"9\"/></sampler></sensor>\
        <integrator type=\"path\"><integer name=\"max_depth\" value=\"3\"/></integrator>",
    );
    let camera = &scene.cameras[0];
    assert_eq!(
        (camera.eye, camera.towards, camera.right()),
        (DVec3::Z * 5.0, DVec3::NEG_Z, DVec3::X)
    );
    assert_eq!((camera.aperture_radius, camera.focus_distance), (0.1, 3.0));
    let Projection::Perspective { tan_half_fov: [Some(x), None] } = camera.projection else {
        panic!("{camera:?}")
    };
    assert!((x - 2.0).abs() < 1e-12);
    let settings = &scene.settings;
    assert_eq!(
        (settings.size, settings.spp, settings.max_depth),
        (Some([200, 100]), Some(9), Some(2))
    );
    assert_eq!(settings.filter.as_deref(), Some("tent"));
    // A camera whose transform is a mirror mirrors the world.
    let scene = clean(
        "<sensor type=\"perspective\"><transform name=\"toWorld\"><scale \
            x=\"-1\"/></transform></sensor>\
        <shape type=\"sphere\"><point name=\"center\" x=\"4\" y=\"0\" z=\"0\"/></shape>",
    );
    assert_eq!(scene.bounds().expect("no cycles").max.x, -3.0);
}

#[test]
fn surfaces_are_what_they_say() {
    let MaterialKind::Dielectric(glass) = material(
        "<bsdf type=\"dielectric\"><string name=\"int_ior\" value=\"water\"/><float \
            name=\"ext_ior\" value=\"1\"/></bsdf>",
    ) else {
        panic!("glass")
    };
    assert!((glass.ior.at_line_d() - 1.333).abs() < 1e-6);
    let MaterialKind::Conductor(gold) = material(
        "<bsdf type=\"roughconductor\"><string name=\"material\" value=\"Au\"/><string \
            name=\"distribution\" value=\"ggx\"/><float name=\"alpha\" value=\"0.25\"/></bsdf>",
    ) else {
        panic!("gold")
    };
    assert_eq!(
        (gold.roughness, gold.microfacets),
        (ScalarParam::constant(0.5), MicrofacetShape::Ggx)
    );
    let MaterialKind::Conductor(beckmann) = material(
        "<bsdf type=\"roughconductor\"><float name=\"alpha\" value=\"0.25\"/><rgb \
            name=\"specular_reflectance\" value=\"0.5, 0.25, 0\"/></bsdf>",
    ) else {
        panic!("tinted")
    };
    assert_eq!(
        (beckmann.roughness, beckmann.microfacets),
        (ScalarParam::constant(0.5), MicrofacetShape::Beckmann)
    );
    // As in Mitsuba, light that bounces between facets is lost.
    let Rgb { r, g, b } = beckmann.tint.factor;
    assert!((0.45..0.5).contains(&r) && g == 0.5 * r && b == 0.0, "{:?}", beckmann.tint);
    let MaterialKind::Conductor(brushed) = material(
        "<bsdf type=\"roughconductor\"><float name=\"alpha_u\" value=\"0.1\"/><float \
            name=\"alpha_v\" value=\"0.4\"/></bsdf>",
    ) else {
        panic!("brushed")
    };
    let ratio = 1.0 + brushed.anisotropy.factor;
    let most = brushed.roughness.factor.powi(2) * (2.0 / (1.0 + ratio * ratio)).sqrt();
    assert!((ratio - 0.25).abs() < 1e-6 && (most - 0.4).abs() < 1e-6, "{brushed:?}");
    let MaterialKind::Conductor(tinted) = material(
        "<bsdf type=\"conductor\"><string name=\"material\" value=\"Au\"/><rgb \
            name=\"specular_reflectance\" value=\"0.5, 0.25, 0\"/></bsdf>",
    ) else {
        panic!("tinted gold")
    };
    assert!(
        matches!(tinted.spectrum, ConductorSpectrum::Metal(_))
            && tinted.tint.factor == Rgb::new(0.5, 0.25, 0.0)
    );
    assert!(matches!(
        material("<bsdf type=\"plastic\"><boolean name=\"nonlinear\" value=\"true\"/></bsdf>"),
        MaterialKind::CoatedDiffuse(_)
    ));
    assert!(matches!(material("<bsdf type=\"plastic\"/>"), MaterialKind::Plastic(_)));
    assert!(matches!(
        material(
            "<bsdf type=\"thindielectric\"><rgb name=\"specular_transmittance\" value=\"1 0 \
                0\"/></bsdf>"
        ),
        MaterialKind::MetallicRoughness(_)
    ));
    assert!(matches!(
        material("<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>"),
        MaterialKind::Mirror(_)
    ));
    let MaterialKind::OpenPbr(principled) = material(
        "<bsdf type=\"principled\"><rgb name=\"base_color\" value=\"1 0 0\"/><float \
            name=\"metallic\" value=\"0.5\"/><float name=\"specular\" value=\"0.5\"/></bsdf>",
    ) else {
        panic!("principled")
    };
    assert!(
        (principled.specular_ior.factor - 1.5).abs() < 1e-5
            && principled.base_metalness.factor == 0.5
    );
}

#[test]
fn sensors_of_a_batch_are_cameras_and_a_meter_is_one_of_one_ray() {
    let sensor = |x: u32, name: &str| {
        format!(
            "<sensor type='perspective' {name}><float name='fov' value='90'/><transform \
                name='to_world'><lookat origin='{x},0,5' target='{x},0,0' up='0,1,0'/></transform>\
                <film type='hdrfilm'/></sensor>"
        )
    };
    let batch = |inner: &str| {
        format!(
            "<sensor type='batch'>{inner}<film type='hdrfilm'><integer name='width' value='192'/>\
                <integer name='height' value='72'/><rfilter type='box'/></film><sampler \
                type='independent'><integer name='sample_count' value='9'/></sampler></sensor>"
        )
    };
    let two = batch(&(sensor(1, "name='left'") + &sensor(2, "")));
    let scene = scene_of(&two);
    let cameras: Vec<_> =
        scene.cameras.iter().map(|c| (c.name.as_str(), c.eye.x, c.resolution)).collect();
    assert_eq!(cameras, [("left", 1.0, Some([96, 72])), ("batch-2", 2.0, Some([96, 72]))]);
    assert_eq!((scene.settings.size, scene.settings.spp), (Some([96, 72]), Some(9)));
    let [note] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(note.message.contains("--camera shows the others: \"batch-2\""), "{note}");
    assert!(
        testing::error_of(&READER, &format!("<scene version='3.0.0'>{}</scene>", batch("")))
            .contains("there is no sensor in it")
    );

    let meter = |place: &str| scene_of(&format!("<sensor type='radiancemeter'>{place}</sensor>"));
    let placed = "<point name='origin' value='0,0,4'/><vector name='direction' value='0,0,-2'/>";
    for place in [
        placed,
        "<transform name='to_world'><lookat origin='0,0,4' target='0,0,0' up='0,1,0'/></transform>",
    ] {
        let scene = meter(place);
        let camera = &scene.cameras[0];
        assert_eq!((camera.eye, camera.towards), (DVec3::Z * 4.0, DVec3::NEG_Z), "{place}");
        let Projection::Perspective { tan_half_fov: [Some(tan), _] } = camera.projection else {
            panic!("{camera:?}")
        };
        assert!(tan < 1e-3 && scene.warnings.len() == 1, "{:?}", scene.warnings);
    }
    // A sensor that is not known and has no place leaves the scene without a camera.
    let distant = "<sensor type='distant'><vector name='direction' value='0,0,-1'/></sensor>";
    assert!(scene_of(distant).cameras.is_empty());
    assert!(warnings(distant).contains("a camera that sees the whole scene was used"));
}

#[test]
fn what_differs_from_the_picture_of_mitsuba_is_told() {
    let sensor = |inside: &str| {
        format!(
            "<shape type='sphere'/><sensor type='perspective'>{inside}<transform \
                name='to_world'><lookat origin='0,0,5' target='0,0,0' up='0,1,0'/></transform>\
                </sensor>"
        )
    };
    let medium = "<shape type='sphere'><bsdf type='null'/><medium type='homogeneous' \
        name='interior'/></shape>";
    let integrator = |kind: &str, depth: i32| {
        format!(
            "<integrator type='{kind}'><integer name='max_depth' value='{depth}'/></integrator>"
        )
    };
    let stretched = |scale: &str| {
        format!(
            "<shape type='sphere'><transform name='to_world'><scale {scale}/></transform></shape>"
        )
    };
    for (text, told) in [
        (sensor("<float name='near_clip' value='4.5'/>"), "\"near_clip\""),
        (sensor("<float name='far_clip' value='5.5'/>"), "\"far_clip\""),
        (sensor("<float name='near_clip' value='3.9'/><float name='far_clip' value='6.1'/>"), ""),
        (
            sensor("<float name='fov' value='40'/><string name='focal_length' value='35mm'/>"),
            "the focal length was used",
        ),
        (integrator("path", 4) + medium, "ignores media"),
        (integrator("volpath", 4) + medium, ""),
        (integrator("path", 0), "nothing is seen in Mitsuba"),
        (stretched("x='2' y='1' z='1'"), "an ellipsoid"),
        (stretched("value='2'"), ""),
    ] {
        let said = warnings(&text);
        assert!(said.contains(told) && said.is_empty() == told.is_empty(), "{text}: {said}");
    }
}

#[test]
fn what_is_partly_clear_lets_the_same_part_out() {
    let kinds = |clear: &str| {
        let scene = clean(&format!(
            "<shape type='sphere'><bsdf type='principled'><rgb name='base_color' \
                value='.81 .25 .25'/>{clear}</bsdf></shape>"
        ));
        let of = |m: &Material| {
            let MaterialKind::OpenPbr(kind) = &m.kind else { panic!("OpenPBR") };
            let clear = (kind.transmission_weight.factor, kind.transmission_color.factor.r);
            (m.alpha.factor, clear, kind.base_metalness.factor)
        };
        scene.materials.iter().map(of).collect::<Vec<_>>()
    };
    let clear = |share: f32| format!("<float name='spec_trans' value='{share}'/>");
    assert_eq!(kinds(&clear(1.0)), [(1.0, (1.0, 0.9), 0.0)]);
    assert_eq!(kinds(&clear(0.0)).len(), 1);
    // The rest is clear to so small a part that only its inside counts, which is black.
    assert_eq!(kinds(&clear(0.75)), [(0.75, (1.0, 0.9), 0.0), (1.0, (1e-6, 0.0), 0.0)]);
    let metal = "<float name='metallic' value='0.5'/>";
    assert_eq!(
        kinds(&(clear(0.5) + metal)),
        [(0.25, (1.0, 0.9), 0.0), (1.0, (1e-6, 0.0), 0.5 / 0.75)]
    );
}

#[test]
fn panes_are_mirrors_that_are_there_as_often_as_they_reflect() {
    let pane = "<bsdf type='thindielectric'><float name='int_ior' value='1.5'/><float \
        name='ext_ior' value='1'/></bsdf>";
    let kinds = |text: &str| {
        let of = |m: &Material| (m.kind.name(), m.alpha_mode, m.interior.is_some());
        clean(text).materials.iter().map(of).collect::<Vec<_>>()
    };
    let glass = ("mirror", AlphaMode::Sheet(1.5), false);
    assert_eq!(kinds(&format!("<shape type='sphere'>{pane}</shape>")), [glass]);
    // What goes through a pane enters the medium behind it.
    assert_eq!(
        kinds(&format!(
            "<shape type='sphere'>{pane}<medium type='homogeneous' name='interior'/></shape>"
        )),
        [glass, ("interface", AlphaMode::Opaque, true)]
    );
    let solid = ("metallic-roughness", AlphaMode::Blend, false);
    assert_eq!(
        kinds(&format!("<shape type='sphere'><bsdf type='mask'>{pane}</bsdf></shape>")),
        [solid]
    );
}

#[test]
fn the_backs_of_one_sided_bsdfs_are_black_where_they_are_seen() {
    let kinds = |shape: &str, bsdf: &str| {
        let scene = clean(&format!("<shape type='{shape}'>{bsdf}</shape>"));
        let of = |m: &Material| (m.kind.name(), m.double_sided, m.alpha_mode);
        scene.materials.iter().map(of).collect::<Vec<_>>()
    };
    let (metal, opaque) = ("<bsdf type='conductor'/>", AlphaMode::Opaque);
    let both = [("mirror", false, opaque), ("diffuse", false, opaque)];
    assert_eq!(kinds("rectangle", metal), both);
    // The inside of a closed body is not seen.
    assert_eq!(kinds("cube", metal), [("mirror", true, opaque)]);
    assert_eq!(kinds("sphere", metal), [("mirror", true, opaque)]);
    for two_sided in [
        "<bsdf type='twosided'><bsdf type='conductor'/></bsdf>",
        "<bsdf type='dielectric'/>",
        "<bsdf type='blendbsdf'><bsdf type='dielectric'/><bsdf type='diffuse'/></bsdf>",
    ] {
        assert!(kinds("rectangle", two_sided).iter().all(|(_, both, _)| *both), "{two_sided}");
    }
    // Where a mask is empty there is no back either.
    let leaf = kinds("disk", &format!("<bsdf type='mask'>{metal}</bsdf>"));
    assert_eq!(leaf[1], ("diffuse", false, AlphaMode::Blend));
    // Lamps without a bsdf are black anyway.
    assert_eq!(kinds("rectangle", "<emitter type='area'/>"), [("diffuse", true, opaque)]);
}

#[test]
fn a_heterogeneous_medium_of_constant_extinction_fills_the_box_of_its_volume() {
    let scene = clean(
        "<shape type='cube'><medium type='heterogeneous' name='interior'><volume \
            type='constvolume' name='sigma_t'><rgb name='value' value='0.5 1 2'/><transform \
            name='to_world'><scale value='2'/><translate x='-1'/></transform></volume><rgb \
            name='albedo' value='0'/></medium></shape>",
    );
    let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
    let corner = |p: DVec3| grid.world_from_grid.transform_point3(p);
    assert_eq!(corner(DVec3::ZERO), DVec3::new(-1.0, 0.0, 0.0));
    assert_eq!(corner(DVec3::ONE), DVec3::new(1.0, 2.0, 2.0));
    assert_eq!(grid.sigma_a, Rgb::new(0.5, 1.0, 2.0));
}

#[test]
fn numbers_of_two_textures_are_combined_texel_by_texel() {
    let checker = |name: &str, a: f32, b: f32| {
        format!(
            "<texture name='{name}' type='checkerboard'><float name='color0' value='{a}'/><float \
                name='color1' value='{b}'/></texture>"
        )
    };
    let scene = clean(&format!(
        "<shape type='sphere'><bsdf type='roughconductor'>{}{}</bsdf></shape>",
        checker("alpha_u", 0.1, 0.4),
        checker("alpha_v", 0.4, 0.1)
    ));
    let MaterialKind::Conductor(metal) = &scene.materials[0].kind else { panic!("a metal") };
    let texels = |parameter: ScalarParam| {
        let texture = &scene.textures[parameter.texture.expect("a texture").0.index()];
        let texture = texture.as_image().expect("a picture");
        let image = &scene.images[texture.image.index()];
        ([0, 1].map(|x| image.value(x, 0, 0)), texture.uv_transform[0][2])
    };
    // The squares of a checkerboard that is a number are swapped, by half of a period.
    let (anisotropy, offset) = texels(metal.anisotropy);
    assert!((anisotropy[0] + 0.75).abs() < 1e-6 && (anisotropy[1] - 0.75).abs() < 1e-6);
    assert_eq!(offset, 0.5);
    let (roughness, _) = texels(metal.roughness);
    assert_eq!(roughness[0], roughness[1]);
}

#[test]
fn thin_principled_surfaces_have_gloss_where_they_are_clear() {
    let scene = clean(
        "<shape type='rectangle'><bsdf type='principledthin'><float name='spec_trans' \
            value='0.25'/><float name='diff_trans' value='0.5'/></bsdf></shape>",
    );
    let [clear, matte] = &scene.materials[..] else { panic!("two layers") };
    assert_eq!((clear.alpha.factor, matte.alpha_mode), (0.25, AlphaMode::Opaque));
    let MaterialKind::OpenPbr(matte) = &matte.kind else { panic!("OpenPBR") };
    assert_eq!((matte.specular_weight.factor, matte.subsurface_weight.factor), (0.0, 0.25));
}

#[test]
fn attributes_of_faces_are_on_all_their_corners() {
    let folder = tempfile::tempdir().expect("a folder");
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nproperty float heat_0\nelement face 1\n\
        property list uchar int vertex_indices\nproperty float tint_r\nproperty float tint_g\n\
        property float tint_b\nend_header\n\
        0 0 0 0\n1 0 0 0.25\n1 1 0 1\n0 1 0 0.5\n4 0 1 2 3 0.2 0.5 1\n";
    std::fs::write(folder.path().join("a.ply"), ply).expect("written");
    let read = |bsdf: &str| {
        let text = format!(
            "<scene version='3.0.0'><shape type='ply'><string name='filename' value='a.ply'/>\
                {bsdf}</shape></scene>"
        );
        testing::read_in(&READER, folder.path(), &text).unwrap_or_else(|e| panic!("{e}"))
    };
    let attribute = |parameter: &str, name: &str| {
        format!(
            "<texture name='{parameter}' type='mesh_attribute'><string name='name' \
                value='{name}'/></texture>"
        )
    };
    let scene =
        read(&format!("<bsdf type='diffuse'>{}</bsdf>", attribute("reflectance", "face_tint")));
    let mesh = &meshes(&scene)[0];
    assert_eq!((mesh.indices.len(), mesh.positions.len(), scene.warnings.len()), (2, 6, 0));
    assert!(mesh.colors.iter().all(|color| *color == [0.2, 0.5, 1.0, 1.0]));
    let scene = read(&format!(
        "<bsdf type='blendbsdf'>{}<bsdf type='diffuse'/><bsdf type='conductor'/></bsdf>",
        attribute("weight", "vertex_heat")
    ));
    let mesh = &meshes(&scene)[0];
    let heat: Vec<f32> = mesh.uvs[1].iter().map(|uv| uv.x).collect();
    assert_eq!((heat, mesh.colors.len()), (vec![0.0, 0.25, 1.0, 0.5], 0));
    let weight = scene.materials[0].alpha.texture.expect("a texture").0;
    let texture = scene.textures[weight.index()].as_image().expect("a picture");
    // The ends of the range are the middles of the two texels.
    assert_eq!((texture.uv_set, texture.uv_transform[0]), (1, [0.5, 0.0, 0.25]));
    let missing =
        read(&format!("<bsdf type='diffuse'>{}</bsdf>", attribute("reflectance", "face_x")));
    assert!(missing.warnings[0].message.contains("no attribute \"face_x\""));
    // Triangles that strips add have no attribute of faces.
    let strips = ply.replace(
        "end_header",
        "element tristrips 1\nproperty list uchar int \
        vertex_indices\nproperty list uchar float texcoord\nend_header",
    );
    std::fs::write(folder.path().join("a.ply"), format!("{strips}3 0 1 2 0\n")).expect("written");
    let misfit =
        read(&format!("<bsdf type='diffuse'>{}</bsdf>", attribute("reflectance", "face_tint")));
    assert!(meshes(&misfit)[0].colors.is_empty());
    let said: Vec<_> = misfit.warnings.iter().map(|w| w.message.as_str()).collect();
    assert!(said[0].contains("not the number of its triangles; 1 was used"), "{said:?}");
}

#[test]
fn warnings_about_the_files_of_meshes_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 2\nproperty list uchar int vertex_indices\n\
        property list uchar float texcoord\nend_header\n0 0 0\n1 0 0\n1 1 0\n\
        3 0 1 2 0\n2 0 1 0\n";
    std::fs::write(folder.path().join("a.ply"), ply).expect("written");
    let text = "<scene version='3.0.0'><shape type='ply'><string name='filename' value='a.ply'/>\
        </shape></scene>";
    let scene = testing::read_in(&READER, folder.path(), text).unwrap_or_else(|e| panic!("{e}"));
    let said: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    assert!(said.len() == 2 && said[0].contains("a.ply: texture coordinates at the"), "{said:?}");
    assert!(said[0].starts_with("test:1:") && said[1].contains("fewer than 3 corners"), "{said:?}");
}

#[test]
fn pictures_without_memory_are_warnings() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(
        folder.path().join("p.pgm"),
        "P2\n64 64\n255\n".to_string() + &"9 ".repeat(4096),
    )
    .expect("written");
    let picture = "<string name='filename' value='p.pgm'/></texture>";
    let text = format!(
        "<scene version='3.0.0'><emitter type='spot'><texture name='texture' type='bitmap'>\
            {picture}</emitter><shape type='sphere'><bsdf type='principled'><texture \
            name='roughness' type='bitmap'>{picture}<float name='anisotropic' value='0.5'/></bsdf>\
            </shape></scene>"
    );
    let read = |memory_bytes: u64| {
        let limits = Limits { memory_bytes, expansion: 0, ..Limits::default() };
        let options = ReadOptions { limits, ..ReadOptions::default() };
        let path = folder.path().join("a.xml");
        std::fs::write(&path, &text).expect("written");
        let scene = read_scene(&path, &options).unwrap_or_else(|e| panic!("{e}"));
        let said = scene.warnings.iter().map(|w| w.message.clone()).collect::<Vec<_>>().join("\n");
        (scene.lights.len(), said)
    };
    let (lights, said) = read(1 << 30);
    assert!(lights == 1 && said.is_empty(), "{said}");
    let (lights, said) = read(1 << 16);
    assert!(lights == 0 && said.contains("a spot light with a picture was left out"), "{said}");
    assert!(said.contains("its textures are not shown: two numbers of a picture would"), "{said}");
}

#[test]
fn flags_of_bent_normals_are_reported_if_they_are_set() {
    for kind in ["bumpmap", "normalmap"] {
        let said = |value: bool| {
            warnings(&format!(
                "<shape type='rectangle'><bsdf type='{kind}'><boolean name='flip_invalid_normals' \
                    value='{value}'/><boolean name='use_shadowing_function' value='{value}'/>\
                    <texture type='checkerboard'/><bsdf type='diffuse'/></bsdf></shape>"
            ))
        };
        assert_eq!(said(false), "");
        assert_eq!(said(true).matches("is not done").count(), 2, "{}", said(true));
    }
}

#[test]
fn a_picture_on_a_spot_light_fills_the_square_around_its_cone() {
    let scene = clean(
        "<emitter type='spot'><rgb name='intensity' value='3'/><float name='cutoff_angle' \
            value='45'/><float name='beam_width' value='40'/><texture name='texture' \
            type='checkerboard'><float name='color0' value='1'/><float name='color1' \
            value='0'/></texture><transform name='to_world'><lookat origin='0 0 0' \
            target='0 0 1' up='0 1 0'/></transform></emitter>",
    );
    let [Light::Projector(light)] = &scene.lights[..] else { panic!("one projector") };
    assert!(!light.even && light.scale == Rgb::splat(3.0));
    // The light looks along +z with +x to the left; u and v grow with x and y.
    let at =
        |x: f64, y: f64| light.slide.at(light.world_from_light.transpose() * DVec3::new(x, y, 1.0));
    assert_eq!([at(0.3, 0.3), at(-0.3, 0.3)], [Rgb::WHITE, Rgb::BLACK]);
    let edge = at(0.5, 0.5);
    assert!((edge.r - 1.0).abs() < 1e-3, "{edge:?}");
    let fading = at(0.65, 0.65).r;
    let angle = (0.65 * 2f64.sqrt()).atan().to_degrees();
    assert!((f64::from(fading) - (45.0 - angle) / 5.0).abs() < 0.02, "{fading}");
}

#[test]
fn blends_and_masks_are_layers_with_their_shares() {
    let scene = clean(
        "<shape type=\"sphere\"><bsdf type=\"mask\"><float name=\"opacity\" value=\"0.5\"/><bsdf \
            type=\"blendbsdf\">\
        <float name=\"weight\" value=\"0.25\"/><bsdf type=\"diffuse\"/><bsdf \
        type=\"conductor\"/></bsdf></bsdf></shape>",
    );
    let layers: Vec<_> = scene.materials.iter().map(|m| (m.kind.name(), m.alpha.factor)).collect();
    // A mirror covers an eighth of the surface. Three eighths are diffuse, of the seven eighths
    // that pass the mirror.
    assert_eq!(layers, [("mirror", 0.125), ("diffuse", 0.375 / 0.875)]);
    assert_eq!(scene.nodes.iter().map(|n| n.surfaces.len()).sum::<usize>(), 2);
}

#[test]
fn emitters_have_their_radiometry() {
    let scene = clean(
        "<emitter type=\"point\"><rgb name=\"intensity\" value=\"1 2 3\"/><point name=\"position\" \
            value=\"1 2 3\"/></emitter>\
        <emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"40\"/><float \
        name=\"beam_width\" value=\"20\"/></emitter>\
        <emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"-2\" z=\"0\"/><float \
        name=\"irradiance\" value=\"5\"/></emitter>\
        <emitter type=\"constant\"><float name=\"radiance\" value=\"0.5\"/></emitter>\
        <shape type=\"rectangle\"><emitter type=\"area\"><rgb name=\"radiance\" value=\"17 12 \
        4\"/></emitter></shape>",
    );
    let [
        Light::Point(Point { position, intensity, .. }),
        Light::Profile(Profile { table, .. }),
        Light::Directional(Directional { direction, irradiance }),
    ] = &scene.lights[..]
    else {
        panic!("{:?}", scene.lights)
    };
    assert_eq!((*position, *intensity), (DVec3::new(1.0, 2.0, 3.0), Rgb::new(1.0, 2.0, 3.0)));
    let at = |degrees: f64| {
        table.at(DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos())).r
    };
    assert!(
        at(19.0) == 1.0 && (at(30.0) - 0.5).abs() < 1e-5 && at(41.0) == 0.0,
        "{} {}",
        at(19.0),
        at(30.0)
    );
    assert_eq!((*direction, *irradiance), (DVec3::NEG_Y, Rgb::splat(5.0)));
    assert!(matches!(scene.environment, Some(Environment::Constant(c)) if c == Rgb::splat(0.5)));
    assert_eq!(scene.materials[0].emission.factor, Rgb::new(17.0, 12.0, 4.0));
    assert_eq!(scene.materials[0].kind, Diffuse::new(Rgb::BLACK).into(), "it reflects nothing");
    assert_eq!(material(""), Diffuse::new(Rgb::splat(0.5)).into());
    assert!(!scene.materials[0].emits_on_both_sides);
}

#[test]
fn media_are_inside_of_their_shapes() {
    let scene = clean(
        "<medium type=\"homogeneous\" id=\"fog\"><float name=\"sigma_t\" value=\"2\"/><rgb \
            name=\"albedo\" value=\"0.5 0.25 1\"/>\
        <phase type=\"hg\"><float name=\"g\" value=\"0.7\"/></phase></medium>\
        <shape type=\"cube\"><bsdf type=\"null\"/><ref name=\"interior\" id=\"fog\"/></shape>\
        <medium type=\"homogeneous\" name=\"preset\"><string name=\"material\" \
        value=\"skin1\"/></medium>",
    );
    let Medium::Homogeneous(fog) = &scene.media[0] else { panic!("{:?}", scene.media) };
    assert_eq!(
        (fog.sigma_s, fog.sigma_a, fog.g),
        (Rgb::new(1.0, 0.5, 2.0), Rgb::new(1.0, 1.5, 0.0), 0.7)
    );
    assert!(
        scene.materials[0].is_interface()
            && scene.materials[0].interior.is_some_and(|i| i.medium.is_some())
    );
}

#[test]
fn spectra_are_what_they_say() {
    let light = |radiance: &str| {
        let scene = clean(&format!(
            "<shape type=\"sphere\"><emitter type=\"area\">{radiance}</emitter></shape>"
        ));
        let emission = scene.materials[0].emission;
        emission.spectrum.map_or(emission.factor, |s| emission.factor * s.light_rgb())
    };
    let constant = light("<spectrum name=\"radiance\" value=\"400:2, 500:2, 700:2\"/>");
    assert!((constant.luminance() - 2.0).abs() < 0.02, "{constant:?}");
    let ember = light(
        "<spectrum name=\"radiance\" type=\"blackbody\"><float name=\"temperature\" \
            value=\"2000\"/></spectrum>",
    );
    assert!(ember.r > 2.0 * ember.g && ember.g > ember.b, "{ember:?}");
    assert_eq!(light("<rgb name=\"radiance\" value=\"#ff0000\"/>"), Rgb::new(1.0, 0.0, 0.0));
}

#[test]
fn bumps_keep_their_heights_in_units_of_the_scene() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("h.pgm"), b"P2\n4 1\n255\n0 85 170 255\n").expect("written");
    let text = |scale: f32| {
        format!(
            "<scene version=\"3.0.0\"><shape type=\"rectangle\">\
            <bsdf type=\"bumpmap\"><float name=\"scale\" value=\"{scale}\"/><texture \
            type=\"bitmap\"><string name=\"filename\" value=\"h.pgm\"/><boolean name=\"raw\" \
            value=\"true\"/></texture>\
            <bsdf type=\"diffuse\"/></bsdf></shape></scene>"
        )
    };
    let map = |scale: f32| {
        let scene = testing::read_in(&READER, folder.path(), &text(scale))
            .unwrap_or_else(|e| panic!("{e}"));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        scene.materials[0].bump_map.expect("a map")
    };
    assert_eq!((map(1.0).height, map(-2.5).height), (1.0, -2.5));
    assert_eq!((map(1.0).channel, map(1.0).unit), (None, HeightUnit::Scene));
}

#[test]
fn hair_has_its_pigments_or_its_absorption() {
    let MaterialKind::Hair(brown) = material("<bsdf type=\"hair\"/>") else { panic!("hair") };
    assert_eq!((brown.eumelanin, brown.pheomelanin), (1.3.into(), 0.2.into()));
    assert!((brown.ior - 1.55 / 1.000_277).abs() < 1e-6);
    let text = "<bsdf type=\"hair\"><rgb name=\"sigma_a\" value=\"0.2, 0.25, 0.7\"/><float \
        name=\"scale\" value=\"2\"/>\
        <float name=\"longitudinal_roughness\" value=\"0.5\"/><float name=\"scale_tilt\" \
        value=\"3\"/></bsdf>";
    let MaterialKind::Hair(hair) = material(text) else { panic!("hair") };
    assert_eq!(hair.eumelanin, 0.0.into());
    assert!((hair.sigma_a.factor.b - 1.4).abs() < 1e-5, "{hair:?}");
    assert_eq!((hair.longitudinal_roughness, hair.scale_tilt), (0.5.into(), 3.0));
}

#[test]
fn curves_are_strands_of_the_radii_in_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let read = |kind: &str, text: &str| {
        std::fs::write(folder.path().join("c.txt"), text).expect("written");
        let scene = format!(
            "<scene version=\"3.0.0\"><shape type=\"{kind}\"><string name=\"filename\" \
                value=\"c.txt\"/>\
             <transform name=\"to_world\"><scale value=\"2\"/></transform></shape></scene>"
        );
        std::fs::write(folder.path().join("a.xml"), scene).expect("written");
        read_scene(&folder.path().join("a.xml"), &ReadOptions::default()).map_err(|e| e.to_string())
    };
    let scene = read("linearcurve", "0 0 0 0.1\n1 0 0 0.2\n\n \n0 1 0 0.1\r\n0 2 0 0.1\n0 3 0 0.1")
        .expect("two strands");
    let curves = |s: &snell_scene::Surface| {
        if let snell_scene::Geometry::Curves(curves) = &s.geometry {
            Some(curves.clone())
        } else {
            None
        }
    };
    let found: Vec<_> = scene.nodes.iter().flat_map(|n| &n.surfaces).filter_map(curves).collect();
    assert_eq!(found[0].strands(), [2, 3]);
    assert_eq!(found[0].points()[1].to_array(), [2.0, 0.0, 0.0, 0.2]);
    for (text, expected) in [
        ("0 0 0 1\n1 0 0 1\n2 0 0 1\n\n", "c.txt:4"),
        ("0 0 0 1\n1 0 x 1\n", "c.txt:2"),
        ("0 0 0\n", "the radius of a point of a curve"),
    ] {
        let error = read("bsplinecurve", text).expect_err(expected);
        assert!(error.contains(expected), "{error}");
    }
    assert!(read("bsplinecurve", "").expect("nothing").warnings[0].message.contains("no curves"));
}

#[test]
fn the_outside_of_a_mesh_is_that_of_its_normals() {
    let folder = tempfile::tempdir().expect("a folder");
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 -1\nf 1//1 2//1 3//1\n";
    std::fs::write(folder.path().join("a.obj"), obj).expect("written");
    let read = |more: &str| {
        let text = format!(
            "<scene version=\"3.0.0\"><shape type=\"obj\"><string name=\"filename\" \
                value=\"a.obj\"/>{more}</shape></scene>"
        );
        testing::read_in(&READER, folder.path(), &text).unwrap_or_else(|e| panic!("{e}"))
    };
    let outside = |more: &str| {
        let mesh = meshes(&read(more)).remove(0);
        let [a, b, c] = mesh.corners(0);
        (b - a).cross(c - a).z
    };
    let flag = |name: &str| format!("<boolean name=\"{name}\" value=\"true\"/>");
    assert_eq!(outside(""), -1.0);
    assert_eq!(outside(&flag("flip_normals")), 1.0);
    assert_eq!(outside(&flag("face_normals")), 1.0);
    let medium = "<bsdf type=\"dielectric\"/><medium type=\"homogeneous\" name=\"interior\"/>";
    let said = &read(medium).warnings;
    assert!(said.iter().any(|w| w.message.contains("oppose its winding")), "{said:?}");
    assert_eq!(read("<bsdf type=\"dielectric\"/>").warnings, []);
}

#[test]
fn mirrored_spheres_are_turned_over() {
    let outwards = |more: &str| {
        let scene = clean(&format!("<shape type=\"sphere\">{more}</shape>"));
        let [mesh, ..] = &meshes(&scene)[..] else { return true };
        let [a, b, c] = mesh.corners(7000);
        (b - a).cross(c - a).dot(a) > 0.0
    };
    let mirror = "<transform name=\"to_world\"><scale x=\"-1\" y=\"1\" z=\"1\"/></transform>";
    let flip = "<boolean name=\"flip_normals\" value=\"true\"/>";
    assert!(outwards(""));
    assert!(!outwards(mirror));
    assert!(!outwards(flip));
    assert!(outwards(&format!("{flip}{mirror}")));
}

#[test]
fn masks_do_not_dim_emitters() {
    let lamp = |bsdf: &str| {
        let scene = clean(&format!(
            "<shape type=\"sphere\">{bsdf}<emitter type=\"area\"><rgb name=\"radiance\" \
                value=\"1 2 3\"/></emitter></shape>"
        ));
        scene.materials[0].clone()
    };
    let mask = |opacity: f32| {
        format!(
            "<bsdf type=\"mask\"><float name=\"opacity\" value=\"{opacity}\"/><bsdf \
                type=\"diffuse\"/></bsdf>"
        )
    };
    let masked = lamp(&mask(0.25));
    assert_eq!((masked.alpha.factor, masked.emission.factor), (0.25, Rgb::new(4.0, 8.0, 12.0)));
    // What is behind a lamp of nothing is seen through it.
    for bsdf in [mask(0.0), "<bsdf type=\"null\"/>".into()] {
        let clear = lamp(&bsdf);
        let MaterialKind::MetallicRoughness(kind) = &clear.kind else { panic!("{clear:?}") };
        assert_eq!((kind.ior, kind.transmission), (1.0, 1.0.into()));
        assert_eq!(clear.emission.factor, Rgb::new(1.0, 2.0, 3.0));
        assert_eq!(clear.alpha_mode, snell_scene::material::AlphaMode::Opaque);
    }
}

#[test]
fn colours_of_vertices_are_scaled_and_emitted() {
    let folder = tempfile::tempdir().expect("a folder");
    let vertex = "0.2 0.5 1\n";
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nproperty float r\nproperty float g\nproperty float b\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 {vertex}1 0 0 {vertex}0 1 0 {vertex}3 0 1 2\n"
    );
    std::fs::write(folder.path().join("a.ply"), ply).expect("written");
    let read = |parts: &str| {
        let text = format!(
            "<scene version=\"3.0.0\"><shape type=\"ply\"><string name=\"filename\" \
                value=\"a.ply\"/>{parts}</shape></scene>"
        );
        let scene =
            testing::read_in(&READER, folder.path(), &text).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(scene.warnings, [], "{parts}");
        assert_eq!(meshes(&scene)[0].colors.len(), 3, "{parts}");
        scene.materials[0].clone()
    };
    let attribute = |name: &str, scale: f32| {
        format!(
            "<texture name=\"{name}\" type=\"mesh_attribute\"><string name=\"name\" \
                value=\"vertex_color\"/><float name=\"scale\" value=\"{scale}\"/></texture>"
        )
    };
    let lamp = read(&format!("<emitter type=\"area\">{}</emitter>", attribute("radiance", 3.0)));
    assert!(lamp.emission_takes_vertex_color);
    assert_eq!(lamp.emission.factor, Rgb::splat(3.0));
    let nested = "<texture type=\"scale\" name=\"reflectance\"><float name=\"scale\" \
        value=\"0.5\"/><texture type=\"vertexcolors\"/></texture>";
    for reflectance in [&attribute("reflectance", 0.5), nested] {
        let matte = read(&format!("<bsdf type=\"diffuse\">{reflectance}</bsdf>"));
        assert_eq!(matte.kind, Diffuse::new(Rgb::splat(0.5)).into());
    }
}

#[test]
fn an_area_emitter_outside_of_a_shape_is_told_so() {
    for kind in ["area", "directionalarea"] {
        let said = warnings(&format!("<emitter type=\"{kind}\"/><shape type=\"sphere\"/>"));
        assert!(said.contains(" belongs to no shape; put it inside"), "{said}");
    }
    let said = warnings("<shape type=\"sphere\"><emitter type=\"point\"/></shape>");
    assert!(said.contains("a shape cannot emit this (only area)"), "{said}");
}

#[test]
fn an_obj_file_of_many_materials_is_read_once_and_shared_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let count = 200;
    let faces: String = (0..count)
        .map(|i| format!("v {i} 0 0\nv {i} 1 0\nv {i} 0 1\nusemtl m{i}\nf -3 -2 -1\n"))
        .collect();
    std::fs::write(folder.path().join("a.obj"), faces + "usemtl x\nf 1 2 4\n").expect("written");
    let bsdfs: String = (0..count)
        .map(|i| {
            format!(
                "<bsdf type='diffuse' name='m{i}'><rgb name='reflectance' value='{} 0 0'/></bsdf>",
                f64::from(i) / f64::from(count)
            )
        })
        .collect();
    let text = format!(
        "<scene version='0.6.0'><shape type='obj'><string name='filename' value='a.obj'/>{bsdfs}\
        </shape></scene>"
    );
    let scene = testing::read_in(&READER, folder.path(), &text).unwrap_or_else(|e| panic!("{e}"));
    let shown: Vec<_> = scene.nodes.iter().filter(|node| !node.surfaces.is_empty()).collect();
    assert_eq!(shown.len(), count as usize + 1);
    for (i, node) in shown.iter().take(count as usize).enumerate() {
        let surface = &node.surfaces[0];
        let Geometry::Mesh(mesh) = &surface.geometry else { panic!("a mesh") };
        assert_eq!((mesh.positions.len(), mesh.indices.len()), (3, 1));
        assert_eq!(mesh.positions[0].x, i as f32);
        let material = surface.materials[0].expect("its material");
        let MaterialKind::Diffuse(diffuse) = &scene.materials[material.index()].kind else {
            panic!("diffuse")
        };
        assert!(
            (f64::from(diffuse.reflectance.factor.r) - i as f64 / f64::from(count)).abs() < 1e-6
        );
    }
}
