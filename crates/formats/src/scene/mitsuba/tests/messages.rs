//! The reader's messages about broken files and about approximations.

use super::*;
use crate::{Limits, ReadOptions, read_scene};
use insta::assert_snapshot;
use snell_scene::Geometry;
use std::fmt::Write;
use std::path::Path;

/// Contents of the scene element of broken files. Each is written to `a.xml` in a folder with some
/// files.
const BROKEN: &[&str] = &[
    "<shape",
    "<shape type=\"sphere\">",
    "<shape type=\"sphere\"></bsdf>",
    "<shape/>",
    "<shape type=\"sphere\" type=\"disk\"/>",
    "<shape type=\"sphere\"><float name=\"radius\"/></shape>",
    "<shape type=\"sphere\"><float value=\"1\"/></shape>",
    "<shape type=\"sphere\"><float name=\"radius\" value=\"one\"/></shape>",
    "<shape type=\"sphere\"><float name=\"radius\" value=\"1e999\"/></shape>",
    "<shape type=\"sphere\"><float name=\"radius\" value=\"-1\"/></shape>",
    "<shape type=\"sphere\"><float name=\"radius\" value=\"nan\"/></shape>",
    "<shape type=\"sphere\"><string name=\"radius\" value=\"1\"/></shape>",
    "<shape type=\"sphere\"><float name=\"radius\" value=\"1\"/><float name=\"radius\" \
        value=\"2\"/></shape>",
    "<shape type=\"sphere\"><float name=\"center\" value=\"1\"/></shape>",
    "<shape type=\"sphere\"><point name=\"center\" value=\"1, 2\"/></shape>",
    "<shape type=\"sphere\"><point name=\"center\" x=\"a\"/></shape>",
    "<shape type=\"sphere\"><boolean name=\"flip_normals\" value=\"maybe\"/></shape>",
    "<shape type=\"sphere\"><transform name=\"to_world\"><shear x=\"1\"/></transform></shape>",
    "<shape type=\"sphere\"><transform name=\"to_world\"><rotate \
        angle=\"30\"/></transform></shape>",
    "<shape type=\"sphere\"><transform name=\"to_world\"><rotate x=\"1\"/></transform></shape>",
    "<shape type=\"sphere\"><transform name=\"to_world\"><matrix value=\"1 2 \
        3\"/></transform></shape>",
    "<shape type=\"sphere\"><transform name=\"to_world\"><matrix value=\"0 0 0 0 0 0 0 0 0 0 0 0 0 \
        0 0 0\"/></transform></shape>",
    "<shape type=\"sphere\"><transform name=\"to_world\"><lookat origin=\"0 0 0\" target=\"0 0 \
        0\"/></transform></shape>",
    "<shape type=\"sphere\"><transform name=\"to_world\"><lookat origin=\"0 0 \
        0\"/></transform></shape>",
    "<shape type=\"sphere\"><transform name=\"to_world\"><scale value=\"1e300\"/><scale \
        value=\"1e300\"/></transform></shape>",
    "<shape type=\"cylinder\"><point name=\"p1\" value=\"0 0 0\"/></shape>",
    "<shape type=\"obj\"/>",
    "<shape type=\"obj\"><string name=\"filename\" value=\"missing.obj\"/></shape>",
    "<shape type=\"ply\"><string name=\"filename\" value=\"cut.ply\"/></shape>",
    "<shape type=\"ply\"><string name=\"filename\" value=\"../outside.ply\"/></shape>",
    "<shape type=\"ply\"><integer name=\"filename\" value=\"3\"/></shape>",
    "<shape type=\"serialized\"><string name=\"filename\" value=\"cut.ply\"/></shape>",
    "<shape type=\"serialized\"><string name=\"filename\" value=\"huge.serialized\"/></shape>",
    "<shape type=\"serialized\"><string name=\"filename\" value=\"huge.serialized\"/><integer \
        name=\"shape_index\" value=\"9\"/></shape>",
    "<shape type=\"instance\"/>",
    "<shape type=\"instance\"><shape type=\"sphere\"/></shape>",
    "<shape type=\"shapegroup\" id=\"g\"><shape type=\"instance\"><ref id=\"g\"/></shape></shape>",
    "<shape type=\"sphere\"><ref id=\"none\"/></shape>",
    "<shape type=\"sphere\"><ref/></shape>",
    "<bsdf type=\"diffuse\" id=\"a\"/><bsdf type=\"diffuse\" id=\"a\"/>",
    "<shape type=\"sphere\"><bsdf type=\"twosided\" id=\"t\"><ref id=\"t\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"twosided\"/></shape>",
    "<shape type=\"sphere\"><bsdf type=\"blendbsdf\"><bsdf type=\"diffuse\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"dielectric\"><string name=\"int_ior\" \
        value=\"unobtainium\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"dielectric\"><float name=\"int_ior\" \
        value=\"0\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"roughconductor\"><string name=\"distribution\" \
        value=\"gauss\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"diffuse\"><string name=\"reflectance\" \
        value=\"red\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"1 \
        2\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"500:1, \
        400:1\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"1 2 3 \
        4\"/></bsdf></shape>",
    "<shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" \
        filename=\"missing.spd\"/></bsdf></shape>",
    "<shape type=\"sphere\"><emitter type=\"area\"><blackbody name=\"radiance\" \
        temperature=\"-5K\"/></emitter></shape>",
    "<shape type=\"sphere\"><bsdf type=\"diffuse\"><texture type=\"bitmap\" \
        name=\"reflectance\"/></bsdf></shape>",
    "<sensor type=\"perspective\"><float name=\"fov\" value=\"180\"/></sensor>",
    "<sensor type=\"perspective\"><string name=\"fov_axis\" value=\"z\"/></sensor>",
    "<sensor type=\"perspective\"><transform name=\"to_world\"><scale \
        value=\"0\"/></transform></sensor>",
    "<sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" \
        value=\"0\"/></film></sensor>",
    "<sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" \
        value=\"1.5\"/></film></sensor>",
    "<sensor type=\"perspective\"><sampler type=\"independent\"><integer name=\"sample_count\" \
        value=\"-1\"/></sampler></sensor>",
    "<integrator type=\"path\"><integer name=\"max_depth\" value=\"-2\"/></integrator>",
    "<integrator type=\"$nothing\"/>",
    "<default name=\"a\"/>",
    "<emitter type=\"envmap\"/>",
    "<shape type=\"cube\"><medium type=\"heterogeneous\" name=\"interior\"><volume \
        type=\"gridvolume\" name=\"sigma_t\"><string name=\"filename\" \
        value=\"cut.vol\"/></volume></medium></shape>",
    "<include filename=\"missing.xml\"/>",
    "<include filename=\"a.xml\"/>",
    "<include filename=\"b.xml\"/>",
    "<include filename=\"broken.xml\"/>",
    "<include/>",
    "&undefined;",
    "<shape type=\"sphere\"><float name=\"\u{1b}[31m\" value=\"x\"/></shape>",
];

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).expect("written")
    };
    write("b.xml", b"<scene version='3.0.0'>\n <include filename='a.xml'/></scene>");
    write("broken.xml", b"<scene version='3.0.0'>\n  <shape/>\n</scene>");
    write(
        "cut.ply",
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n1\n2\n",
    );
    write("cut.vol", b"VOL\x03\x01\0\0\0\xff\0\0\0");
    let mut huge = vec![0x1c, 0x04, 4, 0];
    let mut packer = flate2::write::ZlibEncoder::new(&mut huge, flate2::Compression::fast());
    let content =
        [&0x1000u32.to_le_bytes()[..], b"\0", &u64::MAX.to_le_bytes(), &u64::MAX.to_le_bytes()]
            .concat();
    std::io::Write::write_all(&mut packer, &content).expect("memory has room");
    packer.finish().expect("memory has room");
    huge.extend(0u64.to_le_bytes());
    huge.extend(1u32.to_le_bytes());
    write("huge.serialized", &huge);
    folder
}

#[test]
fn broken_files_are_errors_with_file_line_and_column() {
    let folder = folder();
    let limits = Limits { elements: 1_000_000, ..Limits::default() };
    let options = ReadOptions { limits, confine: true, ..ReadOptions::default() };
    let path = folder.path().join("a.xml");
    let mut messages = String::new();
    for text in BROKEN {
        std::fs::write(&path, format!("<scene version=\"3.0.0\">\n{text}</scene>"))
            .expect("written");
        let message = match read_scene(&path, &options) {
            Ok(_) => "no error".to_string(),
            Err(error) => error.to_string(),
        };
        let message = message.replace(&format!("{}/", folder.path().display()), "");
        writeln!(messages, "{}\n    {message}", text.escape_debug()).expect("text");
    }
    assert!(!messages.contains("no error"), "{messages}");
    assert_snapshot!(messages.replace("No such file or directory (os error 2)", "(not found)"));
}

#[test]
fn files_that_are_no_scenes_are_errors() {
    let nested = format!("<scene version=\"3.0.0\">{}", "<bsdf type=\"twosided\">".repeat(100_000));
    let mut messages = String::new();
    for bytes in [
        &b""[..],
        b"<scene version=\"3.0.0\">\xff</scene>",
        b"\xff\xfe<\0s\0",
        b"<scene>\n</scene>",
        b"<robot version=\"1\"/>",
        nested.as_bytes(),
        format!("{nested}{}</scene>", "</bsdf>".repeat(100_000)).as_bytes(),
        b"<!DOCTYPE a [<!ENTITY b \"c\"> ]><scene version=\"3.0.0\">&b;</scene>",
    ] {
        let read = (READER.read)(&Input::from_bytes(
            "a.xml",
            bytes.to_vec(),
            Path::new("."),
            &ReadOptions::default(),
        ));
        writeln!(messages, "{}", read.expect_err("broken")).expect("text");
    }
    assert_snapshot!(messages);
}

#[test]
fn what_is_changed_is_told_once_of_each_kind() {
    let text = "<mode type=\"final\"/>\n<path value=\"a\"/>\n<integrator type=\"ptracer\"/>\n\
        <sensor type=\"fluencemeter\"><film type=\"hdrfilm\"><integer name=\"crop_width\" \
        value=\"3\"/><rfilter type=\"catmullrom\"/></film></sensor>\n\
        <shape type=\"heightfield\"/><shape type=\"heightfield\"/>\n\
        <shape type=\"sphere\"><float name=\"raduis\" value=\"3\"/><bsdf \
        type=\"measured\"/></shape>\n\
        <shape type=\"sphere\"><bsdf type=\"roughdielectric\"><float name=\"alpha_u\" \
        value=\"0.1\"/><float name=\"alpha_v\" value=\"0.3\"/><rgb name=\"specular_reflectance\" \
        value=\"1 0 0\"/></bsdf></shape>\n\
        <shape type=\"sphere\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/><bsdf \
        type=\"conductor\"/></bsdf></shape>\n\
        <shape type=\"sphere\"><bsdf type=\"roughconductor\"><float name=\"alpha_u\" \
        value=\"-3\"/><float name=\"alpha_v\" value=\"1e30\"/></bsdf></shape>\n\
        <shape type=\"sphere\"><bsdf type=\"conductor\"><string name=\"material\" \
        value=\"Unobtainium\"/></bsdf></shape>\n\
        <shape type=\"sphere\"><bsdf type=\"null\"/></shape>\n\
        <shape type=\"sphere\"><transform name=\"to_world\"><scale x=\"0\"/></transform></shape>\n\
        <shape type=\"sphere\"><bsdf type=\"diffuse\"><texture name=\"reflectance\" \
        type=\"noise\"/></bsdf><phase type=\"hg\"/></shape>\n\
        <shape type=\"sphere\"><emitter type=\"directionalarea\"/></shape>\n\
        <emitter type=\"laser\"/><emitter type=\"constant\"/><emitter type=\"envmap\"><string \
        name=\"filename\" value=\"missing.exr\"/></emitter>\n\
        <shape type=\"cube\"><medium type=\"homogeneous\" name=\"interior\"><phase \
        type=\"rayleigh\"/><string name=\"material\" value=\"coke\"/></medium></shape>";
    assert_snapshot!(warnings(text));
}

#[test]
fn several_bsdfs_of_one_shape_are_told() {
    let two = warnings(
        "<shape type=\"sphere\"><bsdf type=\"diffuse\" name=\"wood\"/><bsdf type=\"diffuse\" \
        name=\"metal\"/></shape>",
    );
    assert!(two.contains("several bsdfs: the last is that of all"), "{two}");
}

#[test]
fn bsdfs_of_an_obj_mesh_are_those_of_the_faces_of_their_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
    let faces = "usemtl wood\nf 1 2 3\nusemtl metal\nf 1 3 4\nf 1 2 4\nusemtl glass\nf 2 3 4\n";
    std::fs::write(folder.path().join("a.obj"), corners.to_owned() + faces).expect("written");
    let text = "<scene version=\"0.6.0\"><bsdf type=\"diffuse\" id=\"x\"/><shape \
        type=\"obj\"><string name=\"filename\" value=\"a.obj\"/>\
        <bsdf type=\"twosided\" name=\"wood\"><bsdf \
        type=\"plastic\"/></bsdf><ref name=\"metal\" id=\"x\"/></shape></scene>";
    let scene = crate::read_scene_bytes(
        "a.xml",
        text.into(),
        folder.path(),
        &crate::ReadOptions::default(),
    )
    .unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let mut counts: Vec<(String, usize)> = Vec::new();
    for node in &scene.nodes {
        if let Some(surface) = node.surfaces.first()
            && let Geometry::Mesh(mesh) = &surface.geometry
        {
            let material = &scene.materials[surface.materials[0].expect("it has one").index()];
            counts.push((material.kind.name().into(), mesh.indices.len()));
        }
    }
    let counts: Vec<_> = counts.iter().map(|(kind, count)| (kind.as_str(), *count)).collect();
    assert_eq!(counts, [("plastic", 1), ("diffuse", 2), ("diffuse", 1)]);
}

#[test]
fn broken_versions_of_a_scene_never_panic() {
    const SEED: &str = "<scene version=\"3.0.0\"><default name=\"spp\" value=\"4\"/><integrator \
        type=\"path\"><integer name=\"max_depth\" value=\"8\"/></integrator>\
        <sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/><transform \
        name=\"to_world\"><lookat origin=\"0,-6,2\" target=\"0,0,0\" up=\"0,0,1\"/></transform>\
        <sampler type=\"independent\"><integer name=\"sample_count\" \
        value=\"$spp\"/></sampler><film type=\"hdrfilm\"><integer name=\"width\" \
        value=\"36\"/></film></sensor>\
        <bsdf type=\"blendbsdf\" id=\"b\"><float name=\"weight\" value=\"0.25\"/><bsdf \
        type=\"diffuse\"><rgb name=\"reflectance\" value=\"1,0,0\"/></bsdf><bsdf \
        type=\"roughconductor\"><string name=\"material\" value=\"Au\"/></bsdf></bsdf>\
        <shape type=\"shapegroup\" id=\"g\"><shape type=\"cube\"><ref \
        id=\"b\"/></shape></shape><shape type=\"instance\"><ref id=\"g\"/></shape>\
        <shape type=\"sphere\"><point name=\"center\" x=\"1\" y=\"2\" z=\"3\"/><bsdf \
        type=\"mask\"><texture name=\"opacity\" type=\"checkerboard\"/><bsdf \
        type=\"principled\"/></bsdf>\
        <medium type=\"homogeneous\" name=\"interior\"><rgb name=\"albedo\" value=\"1 0 \
        0\"/></medium><emitter type=\"area\"><spectrum name=\"radiance\" \
        value=\"400:1,700:2\"/></emitter></shape>\
        <emitter type=\"spot\"><float name=\"cutoff_angle\" value=\"30\"/></emitter></scene>";
    testing::read_broken_versions(&READER, SEED.as_bytes(), Path::new("/nonexistent"));
}
