//! Shapes.

use super::*;
use crate::scene::testing::geometries;
use snell_intersect::Curves;
use snell_math::{Vec2, Vec3};
use snell_scene::Geometry;
use std::sync::Arc;

#[test]
fn the_outer_side_of_triangles_is_that_of_their_normals() {
    let triangle = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]";
    let normal = |text: &str| {
        let scene = world(text);
        let mesh = meshes(&scene)[0].clone();
        let [a, b, c] = mesh.corners(0);
        (b - a).cross(c - a).normalize()
    };
    assert_eq!(normal(triangle), Vec3::Z);
    assert_eq!(normal(&format!("ReverseOrientation {triangle}")), Vec3::NEG_Z);
    assert_eq!(normal(&format!("{triangle} \"normal N\" [0 0 -1 0 0 -1 0 0 -1]")), Vec3::NEG_Z);
    assert_eq!(
        normal(&format!("ReverseOrientation {triangle} \"normal N\" [0 0 -1 0 0 -1 0 0 -1]")),
        Vec3::Z
    );
}

#[test]
fn texture_coordinates_grow_downwards_on_meshes_as_on_shapes() {
    let scene = world(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"point2 uv\" [0 0 1 0 0 1]",
    );
    assert_eq!(meshes(&scene)[0].uvs[0], [Vec2::Y, Vec2::ONE, Vec2::ZERO]);
}

#[test]
fn parts_of_quadrics_are_made_of_triangles() {
    let area = |text: &str| {
        let scene = world(text);
        let mesh = meshes(&scene)[0].clone();
        let area = |t| {
            let [a, b, c] = mesh.corners(t);
            0.5 * (b - a).cross(c - a).length()
        };
        assert!(mesh.indices.iter().enumerate().all(|(t, i)| {
            let [a, b, c] = mesh.corners(t);
            let normal = (b - a).cross(c - a);
            normal.length() < 1e-9
                || normal.dot(i.iter().map(|&i| mesh.normals[i as usize]).sum()) > 0.0
        }));
        (0..mesh.indices.len()).map(area).sum::<f32>()
    };
    use std::f32::consts::PI;
    for (text, expected) in [
        ("Shape \"sphere\" \"float phimax\" 180", 2.0 * PI),
        ("Shape \"sphere\" \"float zmin\" 0", 2.0 * PI),
        ("ReverseOrientation Shape \"sphere\"", 4.0 * PI),
        (
            "Shape \"cylinder\" \"float phimax\" 90 \"float zmin\" 0 \"float zmax\" 3",
            0.5 * PI * 3.0,
        ),
        (
            "Shape \"disk\" \"float phimax\" 90 \"float radius\" 2 \"float innerradius\" 1",
            0.25 * PI * 3.0,
        ),
    ] {
        let found = area(text);
        // The normals of a reversed sphere point inwards.
        assert!((found / expected - 1.0).abs() < 1e-3, "{text}: {found} instead of {expected}");
    }
}

#[test]
fn a_hyperboloid_is_what_a_segment_sweeps_around_the_z_axis() {
    let mesh = |text: &str| meshes(&world(&format!("Shape \"hyperboloid\" {text}")))[0].clone();
    let radius = |p: &Vec3| p.truncate().length();
    // A twisted segment, whose surface is narrow in the middle.
    let waist = mesh("\"point p1\" [0.6 0.6 0.6] \"point p2\" [0.6 -0.6 -0.6]");
    for (p, n) in waist.positions.iter().zip(&waist.normals) {
        // On x^2 + y^2 - z^2 = 0.36, the normal is along the gradient.
        assert!((radius(p).powi(2) - p.z * p.z - 0.36).abs() < 1e-5, "{p}");
        let gradient = Vec3::new(p.x, p.y, -p.z).normalize();
        assert!((n.dot(gradient).abs() - 1.0).abs() < 1e-5, "{p}: {n}, not {gradient}");
    }
    let reach = |mesh: &snell_intersect::TriangleMesh| {
        let radii: Vec<f32> = mesh.positions.iter().map(radius).collect();
        [radii.iter().copied().fold(f32::MAX, f32::min), radii.iter().copied().fold(0.0, f32::max)]
    };
    let [least, most] = reach(&waist);
    assert!((least - 0.6).abs() < 1e-4 && (most - 0.72f32.sqrt()).abs() < 1e-5, "{least} {most}");
    // Where the segment starts, u and v (upwards) are 0.
    let start = waist.uvs[0].iter().position(|uv| *uv == Vec2::Y).expect("the first corner");
    assert!((waist.positions[start] - Vec3::splat(0.6)).length() < 1e-6);
    // pbrt's surface has its waist at z = 0, wherever that of the segment is.
    let high = mesh("\"point p1\" [-3.2 0.8 0.4] \"point p2\" [-1 -0.5 -1.25]");
    for p in &high.positions {
        assert!((2.1399 * radius(p).powi(2) - 1.0719 * p.z * p.z - 1.0).abs() < 1e-3, "{p}");
    }
    // A quarter, and a cone whose normals point outwards at its tip too.
    let quarter = mesh("\"point p1\" [1 0 0] \"point p2\" [1 0 1] \"float phimax\" 90");
    assert!(quarter.positions.iter().all(|p| p.x > -1e-6 && p.y > -1e-6));
    assert!((0..quarter.indices.len()).all(|t| {
        let [a, b, c] = quarter.corners(t);
        (b - a).cross(c - a).dot((a + b + c) * Vec3::new(1.0, 1.0, 0.0)) > 0.0
    }));
    let cone = mesh("\"point p1\" [1 0 -1] \"point p2\" [0 0 1]");
    assert!(cone.normals.iter().all(|n| n.z > 0.1), "{:?}", cone.normals.last());
}

#[test]
fn a_bilinear_patch_is_two_triangles_if_flat_and_more_if_not() {
    let patch =
        |z: f32| world(&format!("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 {z}]"));
    assert_eq!(meshes(&patch(0.0))[0].indices.len(), 2);
    let bent = patch(1.0);
    let mesh = &meshes(&bent)[0];
    assert_eq!((mesh.indices.len(), mesh.normals.len()), (128, 81));
    assert_eq!(mesh.positions[40], Vec3::new(0.5, 0.5, 0.25));
}

/// The curves of a scene.
fn curves(scene: &Scene) -> Vec<Arc<Curves>> {
    let curves = |g| if let Geometry::Curves(curves) = g { Some(curves) } else { None };
    geometries(scene).into_iter().filter_map(curves).collect()
}

#[test]
fn curves_go_through_their_ends() {
    for (text, ends) in [
        ("\"point3 P\" [0 0 0 1 0 0 1 1 0 2 2 2]", [Vec3::ZERO, Vec3::splat(2.0)]),
        (
            "\"integer degree\" 2 \"point3 P\" [0 0 0 1 0 0 1 1 0]",
            [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)],
        ),
        (
            "\"string basis\" \"bspline\" \"point3 P\" [0 0 0 3 0 0 6 0 0 9 0 0]",
            [Vec3::new(3.0, 0.0, 0.0), Vec3::new(6.0, 0.0, 0.0)],
        ),
        (
            "\"string basis\" \"bspline\" \"integer degree\" 2 \"point3 P\" [0 0 0 2 0 0 2 4 0 0 4 \
                0]",
            [Vec3::new(1.0, 0.0, 0.0), Vec3::new(1.0, 4.0, 0.0)],
        ),
    ] {
        for kind in ["flat", "cylinder"] {
            let kind =
                format!("\"string type\" \"{kind}\" \"float width0\" 0.2 \"float width1\" 0.1");
            let scene = scene(&format!("WorldBegin Shape \"curve\" {kind} {text}"));
            let points = curves(&scene)[0].points().to_vec();
            let [first, last] = [points[0], points[points.len() - 1]];
            assert_eq!([first, last].map(|p| p.truncate()), ends, "{text}");
            assert_eq!([first.w, last.w], [0.1, 0.05]);
        }
    }
}

#[test]
fn cubic_b_splines_become_the_bezier_curves_they_are() {
    let scene = scene(
        "WorldBegin Shape \"curve\" \"string basis\" \"bspline\" \"point3 P\" [0 0 0 6 0 0 6 6 0 0 \
            6 6 0 0 6]",
    );
    let curves = &curves(&scene)[0];
    // The ends have the weights 1, 4, 1 over 6; the inner points divide the inner sides in thirds.
    let expected: [[f32; 3]; 7] = [
        [5.0, 1.0, 0.0],
        [6.0, 2.0, 0.0],
        [6.0, 4.0, 0.0],
        [5.0, 5.0, 1.0],
        [4.0, 6.0, 2.0],
        [2.0, 6.0, 4.0],
        [1.0, 5.0, 5.0],
    ];
    for (point, expected) in curves.points().iter().zip(expected) {
        assert!(
            (point.truncate() - Vec3::from(expected)).length() < 1e-5,
            "{point}, not {expected:?}"
        );
    }
    assert_eq!((curves.strands(), curves.points().len()), (&[7][..], 7));
}

#[test]
fn curves_of_one_place_and_material_are_one_object_and_ribbons_are_triangles() {
    let curve = "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 1 1 0 2 2 2]";
    let ribbon = format!("{curve} \"string type\" \"ribbon\" \"normal N\" [0 0 1 0 0 1]");
    let scene = scene(&format!(
        "WorldBegin Material \"diffuse\" {curve} {curve} {ribbon} {curve} Material \"dielectric\" \
            {curve} Translate 1 0 0 {curve}"
    ));
    let strands: Vec<_> = curves(&scene).iter().map(|c| c.strands().len()).collect();
    assert_eq!(strands, [3, 1, 1]);
    assert_eq!(meshes(&scene).len(), 1);
    let moved = scene
        .nodes
        .iter()
        .filter(|n| n.surfaces.iter().any(|s| matches!(s.geometry, Geometry::Curves(_))));
    assert_eq!(moved.map(|n| n.transform.translation.x).collect::<Vec<_>>(), [0.0, 1.0]);
}
