//! The readers' messages for typical mistakes.

use super::*;
use insta::assert_snapshot;

fn error(name: &str, content: impl Into<Vec<u8>>) -> String {
    read(name, content).expect_err("the file is broken").to_string()
}

fn warnings(name: &str, content: &str) -> String {
    let scene = read(name, content).unwrap_or_else(|e| panic!("{e}"));
    scene.warnings.iter().map(|w| format!("{} ({}x)\n", w.message, w.count)).collect()
}

#[test]
fn obj_errors_name_line_and_column() {
    assert_snapshot!(error("a.obj", "v 0 0\n"), @"a.obj:1:6: the line ends where a coordinate of a \
        vertex is expected; complete the line, or export the file again");
    assert_snapshot!(error("a.obj", "v 0,5,1 0 0\n"), @r#"a.obj:1:3: found "0,5,1", expected a coordinate of a vertex; write a decimal point instead of a comma"#);
    assert_snapshot!(error("a.obj", "\x7fELF\x02\x01"), @"a.obj:1:1: found no statement of an OBJ \
        file, expected v, f or the like; this is not an OBJ file");
}

#[test]
fn obj_warnings_are_counted() {
    assert_snapshot!(warnings("a.obj", "v 0 0 0\nv nan 0 0\nv 1e39 inf 0\nl 1 2\nl 2 1\nf 1 \
        2\nfoo\nf 1 2 2\n"), @r#"
a.obj:2:1: a vertex is not finite; triangles that use such vertices are never hit: give it finite coordinates (2x)
a.obj:6:1: a face of 2 corners, expected 3 or more; such faces were skipped (1x)
a.obj:7:1: "foo": not a statement of OBJ files; lines like this were skipped (1x)
a.obj: 2 lines of vertices that are not finite are left out (1x)
"#);
    assert_snapshot!(warnings("a.obj", "mtllib a.mtl b.mtl\nusemtl x\n"), @r#"
a.obj: its material library "a.mtl b.mtl" does not exist; the default material was used (1x)
a.obj: there are no triangles to show; export it again with its faces (1x)
"#);
}

#[test]
fn faces_of_obj_that_name_missing_lines_are_skipped() {
    let text = format!(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1 2 3\n{}f 3 2 1\nf 1//2 2 3\n",
        ["1 2 4", "0 1 2", "1 2 -9", "1 2 1,5", "1//1 /1 3", "1 2 x"]
            .map(|f| format!("f {f}\n"))
            .concat()
    );
    let scene = read("a.obj", text.clone()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(triangles(&scene), 2);
    assert_snapshot!(warnings("a.obj", &text), @r#"
a.obj: faces refer to vt or vn lines, but the file has none; those indices were ignored (1x)
a.obj:6:7: "4" is not a corner of this file, which has 3 v, 0 vt and 1 vn lines; such faces were skipped (7x)
"#);
}

#[test]
fn decimal_commas_are_read_with_a_warning() {
    let obj = read("a.obj", "v 1,5 0 0\nv 2,5 0 0\nv 0 1,25 0\nf 1 2 3\n").expect("it is whole");
    assert_eq!(meshes(&obj)[0].positions[2], Vec3::new(0.0, 1.25, 0.0));
    assert!(obj.warnings[0].message.contains("a.obj:1:3"), "{:?}", obj.warnings);
    let off = read("a.off", "OFF\n3 1 0\n1,5 0 0\n2,5 0 0\n0 1,25 0\n3 0 1 2\n").expect("whole");
    assert_eq!(meshes(&off)[0].positions, meshes(&obj)[0].positions);
    assert!(off.warnings[0].message.contains("a.off:3:1"), "{:?}", off.warnings);
}

#[test]
fn decimal_commas_in_material_libraries_are_reported_too() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("a.mtl"), "newmtl a\nKd 0,5 0 0\n").expect("written");
    let obj = "mtllib a.mtl\nusemtl a\nv 1 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\n";
    let scene = read_scene_bytes("a.obj", obj.into(), folder.path(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    let said: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    assert!(said.len() == 1 && said[0].contains("a.mtl:2:4: a number has a comma"), "{said:?}");
}

#[test]
fn off_errors_name_what_was_expected() {
    assert_snapshot!(error("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), @"a.off:6:7: vertex 3 of a face, but there are 3 vertices; vertices count from 0; export the file again");
    assert_snapshot!(error("a.off", "OFF\n99999999999 1 0\n0 0 0\n"), @"a.off:4:1: the file ends \
        where a coordinate of vertex 1 of 99999999999 is expected; the file seems cut off; export \
        or copy it again");
    assert_snapshot!(error("a.off", "OFF BINARY\n\0\0"), @"a.off:1:5: this is the binary form of \
        OFF; export it as text, or as PLY");
    assert_snapshot!(error("a.off", "4OFF\n1 1 1"), @r#"a.off:1:1: "4OFF" is a mesh of more than three dimensions; project it to three dimensions first"#);
    assert_snapshot!(error("a.off", "hello"), @r#"a.off:1:1: found "hello", expected the number of vertices; write a whole number that is not negative"#);
}

#[test]
fn stl_errors_name_the_place() {
    let mut cut = vec![0; 84];
    cut[80] = 2;
    cut.extend([0; 60]);
    assert_snapshot!(error("a.stl", cut), @"a.stl: at byte 144: the file ends after 1 of 2 facets \
        of 50 bytes; the file seems cut off; export or copy it again");
    assert_snapshot!(error("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 \
        0\n"), @"a.stl:4:11: the line ends where a coordinate of a vertex is expected; complete \
            the line, or export the file again");
    assert_snapshot!(error("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertix 0 0 \
        0\n"), @r#"a.stl:4:1: found "vertix", expected facet, vertex, endloop or the like; this is not an STL file, or it is damaged"#);
    assert_snapshot!(error("a.stl", "short"), @r#"a.stl: at byte 5: found 5 bytes, expected "solid" or a header of 84 bytes; this is not an STL file, or it is cut off; export or copy it again"#);
}

#[test]
fn ply_errors_name_the_place() {
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float \
        y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n";
    assert_snapshot!(error("a.ply", format!("{header}0 0 0\n3 0 0 1\n")), @"a.ply:11:7: vertex number 1, but there are 1 vertices (counted from 0); the file is damaged; export it again");
    assert_snapshot!(error("a.ply", format!("{header}0 0 0\n3 0 x \
        0\n")), @r#"a.ply:11:5: found "x", expected a number; write a decimal number"#);
    assert_snapshot!(error("a.ply", format!("{header}0 0 0\n300 0\n")), @"a.ply:11:1: a list of \
        300 items, more than the rest of the file can hold; the file is damaged or cut off; export \
        it again");
    assert_snapshot!(error("a.ply", format!("{header}0 0")), @"a.ply:10:4: the file ends where \
        another value is expected; the file seems cut off; export or copy it again");
    assert_snapshot!(error("a.ply", header.replace("ascii", "binary_little_endian")), @"a.ply: at byte 169: the file ends before all values that its header declares; the file seems cut off; export or copy it again");
    assert_snapshot!(error("a.ply", "ply\nformat ascii 1.0\nelement vertex \
        many\n"), @r#"a.ply:3:16: found "many", expected the number of elements; write a whole number that is not negative"#);
}
