//! What users of other programs reported about files of theirs, made again with small files.

use super::*;
use snell_math::spectrum::srgb_to_linear;
use snell_math::{DVec3, Vec3};

fn scene(name: &str, content: impl Into<Vec<u8>>) -> Scene {
    read(name, content).unwrap_or_else(|e| panic!("{e}"))
}

/// The colours of the corners of each triangle.
fn painted(scene: &Scene) -> Vec<[[f32; 4]; 3]> {
    let mesh = meshes(scene)[0];
    assert_eq!(mesh.validate(), Ok(()));
    assert!(!mesh.colors.is_empty(), "{:?}", scene.warnings);
    mesh.indices.iter().map(|t| t.map(|i| mesh.colors[i as usize])).collect()
}

const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
const BLUE: [f32; 4] = [0.0, 0.0, 1.0, 1.0];
const CORNERS: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

#[test]
fn off_files_have_colours_of_vertices_and_faces() {
    for file in [
        "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 255 0 0 255\n1 1 0 255 0 0 255\n3 0 1 2\n",
        "COFF 3 1 0\n0 0 0 1.0 0 0\n1 0 0 1.0 0 0 # red\n1 1 0 1 0 0 1\n3 0 1 2\n",
        "STCOFF 3 1 0\n0 0 0 255 0 0 .5 1\n1 0 0 255 0 0 0 0\n1 1 0 255 0 0 1 1\n3 0 1 2\n",
        "NCOFF 3 1 0\n0 0 0 0 0 1 255 0 0\n1 0 0 0 0 1 255 0 0\n1 1 0 0 0 1 255 0 0\n3 0 1 2\n",
    ] {
        assert_eq!(painted(&scene("a.off", file)), [[RED; 3]], "{file}");
    }
    // The coordinates that follow are no colours, whole or not.
    let grey = srgb_to_linear(128.0 / 255.0);
    let file = "STCOFF 3 1 0\n0 0 0 255 0 0 .5 1\n1 0 0 128 128 128 0 0\n1 1 0 0 0 255 1 .5\n\
        3 0 1 2\n";
    assert_eq!(painted(&scene("a.off", file)), [[RED, [grey, grey, grey, 1.0], BLUE]]);
    let faces = format!("OFF\n4 2 0\n{CORNERS}3 0 1 2 255 0 0\n3 0 2 3 0.0 0.0 1.0\n");
    assert_eq!(painted(&scene("a.off", faces)), [[RED; 3], [BLUE; 3]]);
    let quad = format!("OFF\n4 1 0\n{CORNERS}4 0 1 2 3  0 0 255\n");
    assert_eq!(painted(&scene("a.off", quad)), [[BLUE; 3]; 2]);
    let plain = scene("a.off", format!("OFF\n4 1 0\n{CORNERS}4 0 1 2 3\n"));
    assert!(meshes(&plain)[0].colors.is_empty());
}

#[test]
fn ply_files_have_colours_of_faces_where_vertices_have_none() {
    let file = |vertex: &str, corners: &str, value: &str, faces: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty \
             float z\n{vertex}element face 2\nproperty list uchar int vertex_indices\nproperty \
             {value} red\nproperty {value} green\nproperty {value} \
                 blue\nend_header\n{corners}{faces}"
        )
    };
    let faces = "3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n";
    assert_eq!(painted(&scene("a.ply", file("", CORNERS, "uchar", faces))), [[RED; 3], [BLUE; 3]]);
    assert_eq!(painted(&scene("a.ply", file("", CORNERS, "float", faces))), [[RED; 3], [BLUE; 3]]);
    let quads = "4 0 1 2 3 255 0 0\n3 0 2 3 0 0 255\n";
    let quads = scene("a.ply", file("", CORNERS, "uchar", quads));
    assert_eq!(painted(&quads), [[RED; 3], [RED; 3], [BLUE; 3]]);
    let vertex = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let corners = CORNERS.replace('\n', " 0 0 255\n");
    let both = scene("a.ply", file(vertex, &corners, "uchar", faces));
    assert_eq!(painted(&both), [[BLUE; 3]; 2]);
}

#[test]
fn colours_of_floating_point_types_may_be_bytes() {
    let grey = srgb_to_linear(128.0 / 255.0);
    let file = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nproperty float red\nproperty float green\nproperty float blue\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0 255 0 0\n1 0 0 128 128 128\n1 1 0 0 0 255\n3 0 1 2\n";
    let expected = [[RED, [grey, grey, grey, 1.0], BLUE]];
    assert_eq!(painted(&scene("a.ply", file)), expected);
    let file = "v 0 0 0 255 0 0\nv 1 0 0 128 128 128\nv 1 1 0 0 0 255\nf 1 2 3\n";
    assert_eq!(painted(&scene("a.obj", file)), expected);
}

/// A binary STL file of two facets with these attributes.
fn stl(header: &[u8], attributes: [u16; 2]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(2u32.to_le_bytes());
    let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    for (triangle, attribute) in [[0, 1, 2], [0, 2, 3]].into_iter().zip(attributes) {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|&i: &usize| corners[i]).flat_map(f32::to_le_bytes));
        bytes.extend(attribute.to_le_bytes());
    }
    bytes
}

#[test]
fn binary_stl_files_have_colours_of_facets() {
    let magics = stl(b"COLOR=\x00\x00\xff\xff of Magics", [31, 0x8000]);
    assert_eq!(painted(&scene("a.stl", magics)), [[RED; 3], [BLUE; 3]]);
    let viscam = stl(b"solid of VisCAM", [0x8000 | 31 << 10, 0x8000 | 31]);
    assert_eq!(painted(&scene("a.stl", viscam)), [[RED; 3], [BLUE; 3]]);
    for attributes in [[0, 0], [0x8000, 7], [1, 2]] {
        let plain = scene("a.stl", stl(b"other numbers", attributes));
        assert!(meshes(&plain)[0].colors.is_empty(), "{attributes:?}");
    }
}

#[test]
fn meshes_far_from_zero_keep_their_shape() {
    let at = DVec3::new(500_000.25, 4_649_776.5, 100.0);
    let corners: Vec<DVec3> = [[0.0, 0.0], [0.3, 0.0], [0.3, 0.3], [0.0, 0.3]]
        .map(|[x, y]| at + DVec3::new(x, y, 0.0))
        .to_vec();
    let lines = |before: &str| -> String {
        corners.iter().map(|p| format!("{before}{} {} {}\n", p.x, p.y, p.z)).collect()
    };
    let ply = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty double x\nproperty double y\n\
             property double z\nelement face 1\nproperty list uchar int vertex_indices\n\
             end_header\n"
        )
    };
    let mut binary = ply("binary_little_endian").into_bytes();
    binary.extend(corners.iter().flat_map(|p| p.to_array()).flat_map(f64::to_le_bytes));
    binary.extend([4]);
    binary.extend([0i32, 1, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let facet = |triangle: [usize; 3]| -> String {
        let vertices = triangle.map(|i| {
            let p = corners[i];
            format!("vertex {} {} {}\n", p.x, p.y, p.z)
        });
        format!("facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n", vertices.concat())
    };
    for (name, content) in [
        ("a.obj", format!("{}f 1 2 3 4\n", lines("v ")).into_bytes()),
        ("a.ply", format!("{}{}4 0 1 2 3\n", ply("ascii"), lines("")).into_bytes()),
        ("a.ply", binary),
        ("a.off", format!("OFF\n4 1 0\n{}4 0 1 2 3\n", lines("")).into_bytes()),
        (
            "a.stl",
            format!("solid a\n{}{}endsolid\n", facet([0, 1, 2]), facet([0, 2, 3])).into_bytes(),
        ),
    ] {
        let scene = scene(name, content);
        let world_from_mesh = scene.nodes[scene.root.index()].transform;
        let mesh = meshes(&scene)[0];
        assert_eq!(mesh.positions.len(), 4, "{name}");
        for (position, expected) in mesh.positions.iter().zip(&corners) {
            let found = world_from_mesh.transform_point3(position.as_dvec3());
            assert!(found.distance(*expected) < 1e-6, "{name}: {found} {expected}");
        }
    }
    let near = scene("a.obj", "v 5 0 0\nv 6 0 0\nv 6 1 0\nf 1 2 3\n");
    assert_eq!(meshes(&near)[0].positions[0], Vec3::new(5.0, 0.0, 0.0));
}

#[test]
fn materials_in_windows_1252_name_files_in_utf_8() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("gr\u{fc}n.mtl"), b"newmtl wei\xdf\nmap_Kd gr\xfcn.pbm\n")
        .expect("writable");
    std::fs::write(path("gr\u{fc}n.pbm"), "P1 1 1 0").expect("writable");
    let obj = b"mtllib gr\xfcn.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl wei\xdf\n\
        f 1/1 2/1 3/1\n";
    let scene = read_scene_bytes("a.obj", obj.to_vec(), folder.path(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!((scene.materials[0].name.as_str(), scene.images.len()), ("wei\u{df}", 1));
}

#[test]
fn the_library_of_a_renamed_mesh_is_found() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("b.mtl"), "newmtl red\nKd 1 0 0\n").expect("writable");
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl red\nf 1 2 3\n";
    let scene = read_scene_bytes("b.obj", obj.into(), folder.path(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.materials.len(), 1);
    assert!(scene.warnings[0].message.ends_with("does not exist; \"b.mtl\" was taken for it"));
}

#[test]
fn what_mtl_says_and_is_not_done_is_told() {
    let warnings = |mtl: &str| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("a.mtl"), mtl).expect("it is writable");
        let obj = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        std::fs::write(folder.path().join("a.obj"), obj).expect("it is writable");
        let path = folder.path().join("a.obj");
        let scene = crate::read_scene(&path, &crate::ReadOptions::default()).expect("sound");
        scene.warnings.iter().map(|w| w.message.clone()).collect::<Vec<_>>().join("\n")
    };
    assert_eq!(warnings("newmtl a\nPs 0\nPc 0.0\naniso 0\n"), "");
    assert!(warnings("newmtl a\nPc 1\n").contains("clear coat"));
    let ranged = |range: &str| warnings(&format!("newmtl a\nmap_Kd -mm {range} nope.png\n"));
    assert!(ranged("0.2 0.8").contains("the range of a map"));
    assert!(!ranged("0 1").contains("the range of a map"));
}

#[test]
fn packed_splats_are_named() {
    let file = "ply\nformat ascii 1.0\nelement vertex 1\nproperty uint packed_position\n\
        end_header\n7\n";
    let error = read("a.ply", file).expect_err("no positions");
    assert!(error.to_string().contains("Gaussian splats"), "{error}");
}
