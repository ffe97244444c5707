//! The meaning of small files.

use super::*;
use snell_math::Vec2;

fn only_mesh(name: &str, content: &str) -> TriangleMesh {
    let scene = read(name, content).unwrap_or_else(|e| panic!("{e}"));
    let meshes = meshes(&scene);
    assert_eq!(meshes.len(), 1, "{:?}", scene.warnings);
    meshes[0].clone()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

/// A cube of the six faces given as OBJ statements.
fn cube(before_faces: &str) -> String {
    let mut text = String::new();
    for i in 0..8 {
        text += &format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2);
    }
    text + before_faces + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
}

#[test]
fn vertices_are_shared_among_equal_corners_only() {
    let mesh =
        only_mesh("a.obj", &format!("{SQUARE}vt 0 0\nvt 1 1\ns 1\nf 1/1 2/1 3/1\nf 1/1 3/2 4/1\n"));
    assert_eq!(mesh.positions.len(), 5);
    assert_eq!(mesh.uvs[0][mesh.indices[1][1] as usize], Vec2::ONE);
}

#[test]
fn every_form_of_index_means_the_same() {
    let lists = format!("{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n");
    let expected = only_mesh("a.obj", &format!("{lists}f 1/1/1 2/2/1 3/3/1\n"));
    assert_eq!(only_mesh("a.obj", &format!("{lists}f -4/-3/-1 -3/-2/-1 -2/-1/-1\n")), expected);
    assert_eq!(only_mesh("a.obj", &format!("{lists}f\t1/1/1   2/2/1 \\\n 3/3/1 # end")), expected);
    assert_eq!(
        only_mesh("a.obj", &format!("f 1/1/1 2/2/1 3/3/1\r\n{}", lists.replace('\n', "\r\n"))),
        expected
    );
}

#[test]
fn a_cube_without_normals_keeps_its_edges() {
    let mesh = only_mesh("a.obj", &cube(""));
    assert_eq!((mesh.indices.len(), mesh.positions.len()), (12, 24));
    for (t, triangle) in mesh.indices.iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let normal = (b - a).cross(c - a).normalize();
        assert!(triangle.iter().all(|&i| mesh.normals[i as usize].abs_diff_eq(normal, 1e-6)));
        assert!(normal.dot(a + b + c - Vec3::splat(1.5)) > 0.0, "the outside is outside");
    }
}

#[test]
fn smoothing_groups_decide_where_the_file_names_them() {
    assert_eq!(only_mesh("a.obj", &cube("s 1\n")).positions.len(), 8);
    assert_eq!(only_mesh("a.obj", &cube("s off\n")).positions.len(), 36);
    let flat_end = cube("").replace("f 2 4", "s 2\nf 2 4").replacen("f 1 3", "s 1\nf 1 3", 1);
    assert_eq!(only_mesh("a.obj", &flat_end).positions.len(), 12);
}

#[test]
fn a_ball_without_normals_is_smooth_across_a_seam_of_texture_coordinates() {
    let (rows, columns) = (12, 24);
    let mut mesh = TriangleMesh::default();
    for r in 0..=rows {
        for c in 0..=columns {
            // The last column repeats the first with other coordinates.
            let (polar, azimuth) = (r as f32 / rows as f32, (c % columns) as f32 / columns as f32);
            let (sp, cp) = (polar * std::f32::consts::PI).sin_cos();
            let (sa, ca) = (azimuth * std::f32::consts::TAU).sin_cos();
            mesh.positions.push(Vec3::new(sp * ca, sp * sa, cp));
            mesh.uvs[0].push(Vec2::new(c as f32, r as f32));
        }
    }
    for r in 0..rows {
        for c in 0..columns {
            let at = r * (columns + 1) + c;
            mesh.indices.push([at, at + columns + 1, at + columns + 2]);
            mesh.indices.push([at, at + columns + 2, at + 1]);
        }
    }
    let vertices = mesh.positions.len();
    smooth_normals(&mut mesh, 40.0);
    assert_eq!(mesh.positions.len(), vertices, "nothing is split");
    let used: Vec<usize> = mesh.indices.iter().flatten().map(|&i| i as usize).collect();
    // The seam lies at azimuth 0: its normals have no component around the axis.
    for &i in used.iter().filter(|&&i| mesh.positions[i].z.abs() < 0.9) {
        assert!(mesh.normals[i].dot(mesh.positions[i]) > 0.99, "{i}");
        let seam = mesh.uvs[0][i].x == 0.0;
        assert!(!seam || mesh.normals[i].y.abs() < 1e-3, "{i} {:?}", mesh.normals[i]);
    }
}

#[test]
fn objects_become_nodes_and_materials_become_slots() {
    let scene = read(
        "a.obj",
        format!("o one\n{SQUARE}usemtl x\nf 1 2 3\nusemtl y\nf 1 3 4\no two\nusemtl y\nf 1 2 4\n"),
    )
    .expect("a good file");
    let names: Vec<_> =
        scene.nodes.iter().filter(|n| !n.surfaces.is_empty()).map(|n| n.name.as_str()).collect();
    assert_eq!(names, ["one", "two"]);
    let meshes = meshes(&scene);
    assert_eq!((meshes[0].material_slots.as_slice(), meshes[0].positions.len()), (&[0, 1][..], 4));
    assert!(meshes[1].material_slots.is_empty());
}

#[test]
fn ply_colours_are_srgb_as_bytes_and_linear_as_floats() {
    let ply = |kind: &str, value: &str| {
        let color = ["red", "green", "blue"].map(|c| format!("property {kind} {c}\n")).concat();
        let vertex = format!("0 0 0 {value} {value} {value}\n");
        let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float \
            y\nproperty float z\n";
        let faces = "element face 1\nproperty list uchar int vertex_index\nend_header\n";
        only_mesh("a.ply", &format!("{header}{color}{faces}{}3 0 1 2\n", vertex.repeat(3))).colors
            [0]
    };
    assert!((ply("uchar", "188")[0] - 0.5029).abs() < 1e-3);
    assert_eq!(ply("float", "0.5"), [0.5, 0.5, 0.5, 1.0]);
}

#[test]
fn ply_reads_the_same_in_every_format() {
    let ascii = "ply\rformat ascii 1.0\relement face 1\rproperty list uchar int \
        vertex_indices\relement vertex 3\r\
        property float x\rproperty float y\rproperty float z\rend_header\r3 2 1 0\r10 0 0\r0 0 \
        0\r0 1 0\r";
    let binary = |order: &str, big: bool| {
        let header = ascii[..ascii.find("3 2").expect("the body")].replace("ascii", order);
        let mut bytes = header.into_bytes();
        bytes.push(3);
        [2i32, 1, 0]
            .iter()
            .for_each(|i| bytes.extend(if big { i.to_be_bytes() } else { i.to_le_bytes() }));
        for x in [10.0f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            bytes.extend(if big { x.to_be_bytes() } else { x.to_le_bytes() });
        }
        bytes
    };
    let expected = only_mesh("a.ply", ascii);
    for (order, big) in [("binary_little_endian", false), ("binary_big_endian", true)] {
        let scene = read("a.ply", binary(order, big)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(meshes(&scene), [&expected]);
    }
    assert_eq!(expected.positions[0], Vec3::new(10.0, 0.0, 0.0));
}

#[test]
fn stl_vertices_are_welded() {
    let facet = |a, b, c| {
        format!(
            "facet normal 0 0 0\nouter loop\nvertex {a}\nvertex {b}\nvertex \
                {c}\nendloop\nendfacet\n"
        )
    };
    let text = format!(
        "solid\n{}{}endsolid",
        facet("0 0 0", "1 0 0", "1 1 0"),
        facet("-0 0 0", "1 1 0", "0 1 0")
    );
    let mesh = only_mesh("a.stl", &text);
    assert_eq!((mesh.positions.len(), mesh.indices), (4, vec![[0, 1, 2], [0, 2, 3]]));
}

#[test]
fn faces_of_off_may_take_several_lines() {
    let mesh =
        only_mesh("a.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1\n0\n3 0 \n1 \n2\n\n3 0 2\n3\n");
    assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3]]);
    let cut = read("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0\n1\n");
    let error = cut.expect_err("a corner is missing").to_string();
    assert!(error.contains("the file ends where a corner of a face of 3"), "{error}");
}

#[test]
fn off_meshes_are_flat() {
    let mesh = only_mesh("a", "# first\nOFF3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n");
    assert!(mesh.normals.is_empty());
    assert_eq!(mesh.indices, [[0, 1, 2]]);
}

#[test]
fn a_vertex_with_a_hundred_thousand_attributes_is_quick() {
    let mut text = String::from("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n");
    (0..100_000).for_each(|i| text += &format!("vt {i} 0\n"));
    (1..100_000).for_each(|i| text += &format!("f 1/{i}/1 2/{i}/1 3/{i}/1\n"));
    assert_eq!(only_mesh("a.obj", &text).positions.len(), 299_997);
}

#[test]
fn the_size_of_a_binary_stl_file_decides_how_many_facets_it_has() {
    for (declared, expected) in [(0, 2), (1, 2), (2, 2), (3, 2), (u32::MAX, 2)] {
        let mut bytes = vec![0; 80];
        bytes.extend(u32::to_le_bytes(declared));
        for facet in [[0.0f32, 1.0, 2.0], [5.0, 6.0, 7.0]] {
            let corners = facet.map(|x| [x, x * x, 0.0]);
            let floats = [[0.0; 3], corners[0], corners[1], corners[2]].concat();
            bytes.extend(floats.iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        let scene = read("a.stl", bytes).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(triangles(&scene), expected, "{declared}");
        assert_eq!(scene.warnings.len(), usize::from(declared != 2), "{:?}", scene.warnings);
    }
}

#[test]
fn the_words_of_a_ply_header_may_be_in_any_case_and_unknown_lines_are_skipped() {
    let plain = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float \
        y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let expected = only_mesh("a.ply", &format!("{plain}{body}"));
    assert_eq!(only_mesh("a.ply", &format!("{}{body}", plain.to_uppercase())), expected);
    let odd = plain.replacen("element", "Created by hand\nelement", 1);
    let scene = read("a.ply", format!("{odd}{body}")).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(meshes(&scene), [&expected]);
    assert!(scene.warnings[0].message.contains("a.ply:3:1"), "{:?}", scene.warnings);
}

#[test]
fn ply_faces_may_have_texture_coordinates_and_pictures() {
    let folder = tempfile::tempdir().expect("a folder for the test");
    for (name, grey) in [("a.pgm", 0), ("b.pgm", 255)] {
        std::fs::write(folder.path().join(name), format!("P2 1 1 255 {grey}")).expect("writable");
    }
    let text = "ply\nformat ascii 1.0\ncomment TextureFile a.pgm\ncomment TextureFile b.pgm\n\
        element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 3\n\
        property list uchar int vertex_indices\nproperty list uchar float texcoord\n\
        property int texnumber\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n\
        4 0 1 2 3 8 0 0 1 0 1 1 0 1 0\n3 0 1 2 6 0 0 1 0 0.5 0.5 1\n3 2 1 0 0 1\n";
    let scene = read_scene_bytes("a.ply", text.into(), folder.path(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.warnings, []);
    assert_eq!((scene.materials.len(), scene.images.len()), (2, 2));
    let mesh = meshes(&scene)[0];
    assert_eq!(mesh.material_slots, [0, 0, 1, 1]);
    let uv = |t: usize, k: usize| mesh.uvs[0][mesh.indices[t][k] as usize];
    assert_eq!([uv(2, 0), uv(2, 1), uv(2, 2)], [Vec2::ZERO, Vec2::X, Vec2::splat(0.5)]);
    assert_eq!(mesh.corners(2)[2], Vec3::new(1.0, 1.0, 0.0));
    let corners: Vec<Vec2> = mesh.indices[..2]
        .iter()
        .flatten()
        .map(|&i| mesh.positions[i as usize].truncate() - mesh.uvs[0][i as usize])
        .collect();
    assert_eq!(corners, [Vec2::ZERO; 6]);
    let beyond = text.replace("3 2 1 0 0 1\n", "3 2 1 0 0 7\n");
    let scene = read_scene_bytes("a.ply", beyond.into(), folder.path(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(meshes(&scene)[0].material_slots, [0, 0, 1, 1]);
    assert!(scene.warnings[0].message.contains("texnumber 7"), "{:?}", scene.warnings);
    // Without "texnumber" the first picture is shown.
    let text = text.replace("property int texnumber\n", "").replace("3 2 1 0 0 1\n", "3 2 1 0 0\n");
    let scene = read_scene_bytes("a.ply", text.into(), folder.path(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(meshes(&scene)[0].material_slots.is_empty());
    let said: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    let is_said = |w: &&str| w.contains("names 2 pictures") && w.contains("\"a.pgm\" is shown");
    assert!(said.iter().any(is_said), "{said:?}");
}
