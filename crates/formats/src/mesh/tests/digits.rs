//! Coordinates whose digits single precision does not hold.

use super::*;
use crate::read_scene;
use std::io::Write;

/// The corners of a small triangle in UTM coordinates.
const FAR: [[f64; 3]; 3] = [
    [691234.125, 5334567.015625, 520.5],
    [691234.375, 5334567.015625, 520.5],
    [691234.125, 5334567.265625, 520.5],
];

/// The corners as text, with words before each and after it.
fn text(before: &str, after: &str) -> String {
    FAR.map(|[x, y, z]| format!("{before}{x} {y} {z}{after}")).concat()
}

fn stl() -> String {
    let facet = text("vertex ", "\n");
    format!("solid a\nfacet normal 0 0 1\nouter loop\n{facet}endloop\nendfacet\nendsolid a\n")
}

fn ray() -> String {
    text("#vertex ", " 0 0 1 0 0\n") + "#shape_triangle 0 0 1 2\n"
}

fn ply() -> String {
    let numbers = ["x", "y", "z"].map(|axis| format!("property double {axis}\n")).concat();
    format!(
        "ply\nformat ascii 1.0\nelement vertex 3\n{numbers}element face 1\n\
        property list uchar int vertex_indices\nend_header\n{}3 0 1 2\n",
        text("", "\n")
    )
}

/// A file of Mitsuba with one mesh in double precision.
fn serialized() -> Vec<u8> {
    let mut body = 0x2000u32.to_le_bytes().to_vec();
    body.extend(b"name\0");
    body.extend([3u64, 1].map(u64::to_le_bytes).concat());
    body.extend(FAR.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    body.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
    let mut file = vec![0x1c, 0x04, 4, 0];
    let mut packer = flate2::write::ZlibEncoder::new(&mut file, flate2::Compression::fast());
    packer.write_all(&body).expect("memory has room");
    packer.finish().expect("memory has room");
    file.extend(0u64.to_le_bytes());
    file.extend(1u32.to_le_bytes());
    file
}

#[test]
fn text_of_stl_and_ray_keeps_all_digits() {
    let exact = ReadOptions { exact: true, ..ReadOptions::default() };
    for (name, text) in [("a.stl", stl()), ("a.ray", ray()), ("a.ply", ply())] {
        let input = Input::from_bytes(name, text.into(), Path::new("."), &exact);
        let mesh = read_mesh(&input).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(mesh.exact, FAR.map(DVec3::from), "{name}");
        assert_eq!(mesh.indices, [[0, 1, 2]], "{name}");
    }
}

#[test]
fn far_meshes_keep_their_shape_in_the_scenes_that_name_them() {
    let folder = tempfile::tempdir().expect("a folder for the test");
    let write = |name: &str, content: &[u8]| {
        std::fs::write(folder.path().join(name), content).expect("it is writable")
    };
    write("a.stl", stl().as_bytes());
    write("a.ray", ray().as_bytes());
    write("a.ply", ply().as_bytes());
    write("a.obj", (text("v ", "\n") + "f 1 2 3\n").as_bytes());
    write("a.serialized", &serialized());
    let mitsuba = |kind: &str| {
        format!(
            "<scene version='3.0.0'><shape type='{kind}'><string name='filename' value='a.{kind}'/>\
            </shape></scene>"
        )
    };
    for (name, text) in [
        ("a.pbrt", "WorldBegin\nShape \"plymesh\" \"string filename\" \"a.ply\"\n".into()),
        ("obj.xml", mitsuba("obj")),
        ("ply.xml", mitsuba("ply")),
        ("serialized.xml", mitsuba("serialized")),
        ("obj.scn", "mesh -1 a.obj\nmesh -1 a.obj\n".into()),
        ("ray.scn", "mesh -1 a.ray\n".into()),
        ("stl.scn", "mesh -1 a.stl\n".into()),
    ] {
        write(name, text.as_bytes());
        let path = folder.path().join(name);
        let scene = read_scene(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        assert!(
            !scene.warnings.iter().any(|w| w.message.contains(" far from zero")),
            "{:?}",
            scene.warnings
        );
        let shown: Vec<_> = scene.nodes.iter().filter(|node| !node.surfaces.is_empty()).collect();
        assert_eq!(shown.len(), if name == "obj.scn" { 2 } else { 1 }, "{name}");
        for node in shown {
            let Geometry::Mesh(mesh) = &node.surfaces[0].geometry else { panic!("{name}") };
            let root = scene.nodes[scene.root.index()].transform;
            let mirror = if name == "a.pbrt" { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::ONE };
            for (at, expected) in mesh.positions.iter().zip(FAR) {
                let placed = (root * node.transform).transform_point3(at.as_dvec3()) * mirror;
                let apart = placed.distance(DVec3::from(expected));
                assert!(apart < 1e-6, "{name}: {placed} is {apart} from {expected:?}");
            }
        }
    }
}
