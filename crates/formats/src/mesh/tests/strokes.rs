//! Points and lines of mesh files.

use super::*;

#[test]
fn a_ply_without_faces_is_balls_of_its_colours() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
        end_header\n0 0 0 255 0 0\n8 0 0 0 255 0\n0 6 0 0 0 255\n";
    let scene = read("cloud.ply", ply).expect("a cloud");
    check(&scene, "cloud");
    let [cloud] = strokes(&scene)[..] else { panic!("one cloud") };
    assert_eq!((cloud.strands().len(), cloud.ball_count()), (3, 3));
    let color = |i| cloud.color_of_strand(i, 0.0);
    assert_eq!([color(0), color(2)], [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]);
    assert_eq!(
        scene.warnings[0].message,
        "cloud.ply: there are no faces; 3 points are drawn as balls of radius 0.125"
    );
    let plain = ply.replace("element vertex 3", "element vertex 0");
    let nothing = read("cloud.ply", plain.split("0 0 0 255").next().unwrap_or_default());
    assert!(nothing.expect("nothing").warnings[0].message.contains("no triangles to show"));
}

#[test]
fn clouds_of_sensors_are_drawn_without_their_gaps() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n\
        property float z\nproperty float intensity\nelement face 0\nend_header\n0 0 0 0\n\
        0 0 0 0\n8 0 0 1\n0 0 0 0\nnan nan nan 0\n0 6 0 9\n";
    let scene = read("scan.ply", ply).expect("a cloud");
    check(&scene, "scan");
    assert_eq!(strokes(&scene)[0].ball_count(), 3);
    let said: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    let [properties, points] = said[..] else { panic!("{said:?}") };
    assert!(properties.ends_with("properties of the points are not shown: intensity"));
    assert!(points.contains("3 points are drawn") && points.contains("; 3 points at the places"));
}

#[test]
fn points_and_lines_of_obj_are_drawn_beside_faces_with_their_materials() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nusemtl a\nl 1 2/1 -1\nusemtl b\np 1 2\n\
        l 1 9\n";
    let scene = read("a.obj", obj).expect("whole");
    check(&scene, "strokes");
    assert_eq!(triangles(&scene), 1);
    let found: Vec<_> =
        strokes(&scene).iter().map(|s| (s.strands().to_vec(), s.ball_count())).collect();
    assert_eq!(found, [(vec![3], 0), (vec![2, 2], 2)], "one surface for each material");
    let said: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    assert!(said.iter().any(|w| w.contains("a.obj:10:1") && w.contains("skipped")), "{said:?}");
    assert!(said.iter().any(|w| w.contains("2 points are drawn as balls")), "{said:?}");
    let input = Input::from_bytes(
        "a.obj",
        obj.as_bytes().to_vec(),
        Path::new("."),
        &ReadOptions::default(),
    );
    assert_eq!(read_mesh(&input).expect("a mesh").indices.len(), 1);
}
