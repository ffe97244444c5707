//! The reader's messages about broken files and about approximations.

use super::*;
use crate::{Limits, ReadOptions, read_scene};
use insta::assert_snapshot;
use std::fmt::Write;

/// Invalid scenes. Each is written to `a.pbrt` in a folder with some files.
const BROKEN: &[&str] = &[
    "Shape",
    "Shape sphere",
    "Shape \"sphere",
    "Shape \"sphere\" \"float radius\"",
    "Shape \"sphere\" \"float radius\" [ 1",
    "Shape \"sphere\" \"float radius\" [ 1 2 ]",
    "Shape \"sphere\" \"float radius\" [ one ]",
    "Shape \"sphere\" \"float radius\" [ 1,5 ]",
    "Shape \"sphere\" \"float radius\" [ 1e99 ]",
    "Shape \"sphere\" \"float radius\" [ nan ]",
    "Shape \"sphere\" \"float radius\" [ -1 ]",
    "Shape \"sphere\" \"float radius\" \"1\"",
    "Shape \"sphere\" \"integer radius\" [ 1 ]",
    "Shape \"sphere\" \"radius\" [ 1 ]",
    "Shape \"sphere\" \"double radius\" [ 1 ]",
    "Shape \"sphere\" \"float radius\" 1 \"float radius\" 2",
    "Shape \"disk\" \"float innerradius\" 2",
    "Shape \"cylinder\" \"float zmin\" 1 \"float zmax\" 0",
    "Shape \"trianglemesh\"",
    "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 ]",
    "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 3 ]",
    "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 -1 ]",
    "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 ]",
    "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 1.5 ]",
    "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"normal N\" [ 0 0 1 ]",
    "Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"point2 uv\" [ 0 0 1 1 ]",
    "Shape \"bilinearmesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ]",
    "Shape \"loopsubdiv\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 2 ] \
        \"integer levels\" 99",
    "Shape \"curve\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ]",
    "Shape \"curve\" \"string basis\" \"cubic\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 1 1 1 ]",
    "Shape \"plymesh\"",
    "Shape \"plymesh\" \"string filename\" \"missing.ply\"",
    "Shape \"plymesh\" \"string filename\" \"cut.ply\"",
    "Shape \"plymesh\" \"string filename\" \"cut.ply.gz\"",
    "Shape \"plymesh\" \"string filename\" \"../outside.ply\"",
    "Include \"missing.pbrt\"",
    "Include \"a.pbrt\"",
    "Include \"b.pbrt\"",
    "Include \"broken.pbrt\"",
    "Import \"open.pbrt\"",
    "Material \"conductor\" \"rgb reflectance\" [1 1 1] \"rgb conductor.eta\" [1 1 1] \"rgb eta\" \
        [1 1 1]",
    "Material \"dielectric\" \"spectrum eta\" \"glass-none\"",
    "Material \"diffuse\" \"spectrum reflectance\" [ 400 1 300 1 ]",
    "Material \"diffuse\" \"blackbody reflectance\" [ 0 ]",
    "MakeNamedMaterial \"a\" \"rgb reflectance\" [ 1 1 1 ]",
    "Material \"mix\" \"string materials\" [ \"a\" ]",
    "Texture \"a\" \"colour\" \"imagemap\"",
    "Texture \"a\" \"spectrum\" \"imagemap\"",
    "Texture \"a\" \"spectrum\" \"imagemap\" \"string filename\" \"a.png\" \"string wrap\" \
        \"mirror\"",
    "ObjectBegin \"a\" ObjectBegin \"b\"",
    "AttributeBegin Shape \"sphere\"",
    "AttributeEnd",
    "AttributeBegin TransformEnd",
    "WorldBegin WorldBegin",
    "WorldBegin Camera \"perspective\"",
    "Camera \"perspective\" \"float fov\" 180 WorldBegin",
    "Scale 0 1 1 Camera \"perspective\"",
    "LookAt 0 0 0 0 0 0 0 1 0",
    "LookAt 0 0 0 0 1 0 0 1 0",
    "Rotate 90 0 0 0",
    "Translate 1 2",
    "Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 ]",
    "Transform [ 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 ]",
    "ActiveTransform Never",
    "ColorSpace \"cmyk\"",
    "Film \"rgb\" \"integer xresolution\" 0 WorldBegin",
    "Sampler \"halton\" \"integer pixelsamples\" -1 WorldBegin",
    "Attribute \"camera\" \"float fov\" 3",
    "LightSource \"point\" \"rgb I\" [ 1 1 ]",
    "LightSource \"infinite\" \"rgb L\" [ 1 1 1 ] \"string filename\" \"a.exr\"",
    "AreaLightSource \"diffuse\" \"bool twosided\" [ maybe ]",
    "shape \"sphere\"",
    "Spere \"sphere\"",
    "[ 1 2 3 ]",
    "\"sphere\"",
    "Shape \"\u{1b}[31m\" \"float radius\" \"\u{7}\"",
];

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).expect("written")
    };
    write("b.pbrt", b"\n Include \"a.pbrt\"");
    write("broken.pbrt", b"AttributeBegin\nAttributeEnd\n  Shape \"sphere\" \"float radius\" x\n");
    write("open.pbrt", b"AttributeBegin");
    write(
        "cut.ply",
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n1\n2\n",
    );
    write("cut.ply.gz", &[0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3, 1, 2, 3]);
    folder
}

#[test]
fn broken_files_are_errors_with_file_line_and_column() {
    let folder = folder();
    let limits = Limits { elements: 1_000_000, ..Limits::default() };
    let options = ReadOptions { limits, confine: true, ..ReadOptions::default() };
    let path = folder.path().join("a.pbrt");
    let mut messages = String::new();
    for text in BROKEN {
        std::fs::write(&path, text).expect("written");
        let message = match read_scene(&path, &options) {
            Ok(_) => "no error".to_string(),
            Err(error) => error.to_string(),
        };
        let message = message.replace(&format!("{}/", folder.path().display()), "");
        writeln!(messages, "{}\n    {message}", text.escape_debug()).expect("text");
    }
    // The system's own text is not part of the snapshot.
    assert!(!messages.contains("no error"), "{messages}");
    assert_snapshot!(messages.replace("No such file or directory (os error 2)", "(not found)"));
}

#[test]
fn a_file_without_a_world_is_told() {
    for (text, told) in [
        ("# pbrt", "there is nothing to show"),
        ("Shape \"sphere\"", "there is no WorldBegin"),
        ("Camera \"perspective\"", "there is no WorldBegin"),
        ("WorldBegin Shape \"sphere\"", ""),
    ] {
        let said = warnings(text);
        assert!(said.contains(told) && said.is_empty() == told.is_empty(), "{text}: {said}");
    }
}

#[test]
fn bytes_that_are_not_text_are_errors() {
    for (bytes, expected) in [
        (
            &b"Shape \"sph\xffere\""[..],
            "a.pbrt:1:7: the string \"sph\u{fffd}ere\" is not valid UTF-8; save the file as UTF-8",
        ),
        (
            &b"\n\xff\xfe"[..],
            "a.pbrt:2:1: \"\u{fffd}\u{fffd}\" is not a directive of pbrt; correct it; perhaps a \
                value lacks brackets, or this is not a pbrt file",
        ),
    ] {
        let error = crate::read_scene_bytes(
            "a.pbrt",
            bytes.to_vec(),
            Path::new("."),
            &ReadOptions::default(),
        );
        assert_eq!(error.expect_err("broken").to_string(), expected);
    }
}

#[test]
fn limits_are_errors() {
    let read = |limits: Limits, text: &str| {
        let options = ReadOptions { limits, ..ReadOptions::default() };
        let error = crate::read_scene_bytes("a.pbrt", text.into(), Path::new("."), &options);
        error.expect_err("over the limit").to_string()
    };
    let few = Limits { elements: 5, depth: 3, ..Limits::default() };
    assert_snapshot!(read(few.clone(), &"Identity ".repeat(6)), @"a.pbrt:1:46: the scene has more \
        than 5 directives, the limit; split the scene");
    assert_snapshot!(read(few.clone(), &"AttributeBegin ".repeat(4)), @"a.pbrt:1:46: blocks are \
        nested deeper than 3, the limit; flatten the scene");
    assert_snapshot!(read(few, "Shape \"sphere\" \"float radius\" [ 1 2 3 4 5 6 \
        ]"), @"a.pbrt:1:44: \"radius\" has more than 5 numbers, the limit; split it");
}

#[test]
fn what_is_changed_is_told_once_of_each_kind() {
    assert_snapshot!(warnings("Integrator \"mlt\" \"integer maxdepth\" 3\nCamera \"realistic\" \
        \"string lensfile\" \"a\"\nFilm \"rgb\" \"float cropwindow\" [0 1 0 1]\nPixelFilter \
        \"gaussian\" \"float xradius\" 3\nSampler \"halton\" \"integer speed\" 3\nWorldBegin\n\
        CoordSysTransform \"nowhere\"\nMaterial \"measured\" \"string filename\" \
        \"a.bsdf\"\nMaterial \"diffuse\" \"float rougness\" 3\nMaterial \"diffuse\" \"float \
        rougness\" 3\n\
        Shape \"nurbs\"\nShape \"nurbs\"\nTexture \"f\" \"float\" \"fbm\"\nLightSource \
        \"laser\"\nOption \"bool disablepixeljitter\" true\n\
        ActiveTransform EndTime Translate 1 0 0 ActiveTransform All Shape \"sphere\"\nMaterial \
        \"interface\" Shape \"disk\"\n"), @r#"
    test:1:1: Integrator "mlt": the integrator path was used instead (1x)
    test:2:1: Camera "realistic": its lenses cannot be read; a perspective camera was used instead (1x)
    test:4:1: PixelFilter "gaussian" of radius 3: radius 1.5 was used, the only one of this filter (1x)
    test:5:18: "integer speed" of Sampler "halton" is not known; it was ignored (1x)
    test:7:19: there is no coordinate system "nowhere"; the transform was left as it is (1x)
    test:8:1: Material "measured" is not supported; a grey diffuse surface was used instead (1x)
    test:9:20: "float rougness" of Material "diffuse" is not known; it was ignored (2x)
    test:11:1: Shape "nurbs" is not a known shape; it was left out (2x)
    test:14:1: LightSource "laser" is not known; it was left out (1x)
    test:15:8: "bool disablepixeljitter" of Option was ignored: it is an aid for debugging pbrt (1x)
    test:17:22: surfaces without a material that bound no medium are not seen, and were left out (1x)
    "#);
}
