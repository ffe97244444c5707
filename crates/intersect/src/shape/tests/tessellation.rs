//! Tests of the triangles of every example: closed, on the surface, facing outwards, and converging
//! to it.

use crate::mesh::TriangleMesh;
use crate::shape::{AnyShape, Metric, Shape};
use snell_math::{DVec3, Vec3};
use std::collections::HashMap;

const AROUND: u32 = 48;

/// Bounded examples and their triangles.
fn tessellated() -> impl Iterator<Item = (AnyShape, TriangleMesh)> {
    let bounded = AnyShape::examples().into_iter().filter(|shape| shape.area().is_finite());
    bounded.map(|shape| {
        let mesh = shape.tessellate(AROUND).expect("a bounded shape has triangles");
        (shape, mesh)
    })
}

/// How far corners in single precision may lie off the surface.
fn blur(shape: &AnyShape) -> f64 {
    let bounds = shape.bounds();
    f64::from(f32::EPSILON) * (bounds.radius() + bounds.center().length())
}

fn area_of(mesh: &TriangleMesh) -> f64 {
    let cross = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
    let corners = (0..mesh.indices.len()).map(|i| mesh.corners(i).map(|p| p.as_dvec3()));
    corners.map(|corners| 0.5 * cross(corners).length()).sum()
}

#[test]
fn bounded_shapes_have_triangles_and_unbounded_ones_have_none() {
    for shape in AnyShape::examples() {
        let mesh = shape.tessellate(AROUND);
        assert_eq!(mesh.is_some(), shape.area().is_finite(), "{shape:?}");
        let Some(mesh) = mesh else { continue };
        mesh.validate().expect("numbers of vertices that are there");
        let most: u64 = shape.patches().iter().map(|patch| patch.most_triangles(AROUND)).sum();
        assert!((1..=most).contains(&(mesh.indices.len() as u64)), "{shape:?}");
    }
}

#[test]
fn triangles_of_closed_shapes_are_closed() {
    // Adding 0 turns -0 into +0.
    let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    for (shape, mesh) in tessellated() {
        let mut edges: HashMap<_, i32> = HashMap::new();
        for i in 0..mesh.indices.len() {
            let [a, b, c] = mesh.corners(i).map(key);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let (edge, way) = if from < to { ((from, to), 1) } else { ((to, from), -1) };
                *edges.entry(edge).or_default() += way;
            }
        }
        let is_closed = edges.values().all(|&ways| ways == 0);
        assert_eq!(is_closed, shape.is_closed(), "{shape:?}");
    }
}

#[test]
fn vertices_lie_on_the_surface_and_triangles_face_outwards() {
    for (shape, mesh) in tessellated() {
        let (center, blur) = (shape.bounds().center(), blur(&shape));
        for position in mesh.positions.iter().map(|p| p.as_dvec3()) {
            let metric = Metric::EUCLIDEAN;
            let nearest = shape.nearest_point(position, &metric).expect("a point near it");
            assert!(nearest.position.distance(position) <= 2.0 * blur, "{shape:?} {position}");
        }
        let mut volume = 0.0;
        for (i, triangle) in mesh.indices.iter().enumerate() {
            let [a, b, c] = mesh.corners(i).map(|p| p.as_dvec3());
            let normal: DVec3 = triangle.iter().map(|&i| mesh.normals[i as usize].as_dvec3()).sum();
            let cross = (b - a).cross(c - a);
            // Three corners of a polygon may lie on a line.
            let may_be_flat = matches!(shape, AnyShape::Polygon(_));
            assert!(may_be_flat || cross.length() > 0.0, "{shape:?}: triangle {i} has no area");
            assert!(cross.dot(normal) >= 0.0, "{shape:?}: triangle {i} looks inwards");
            volume += cross.dot(a - center);
        }
        assert!(volume > 0.0 || !shape.is_closed(), "{shape:?} is inside out");
    }
}

#[test]
fn the_area_of_the_triangles_converges_with_the_square_of_their_number() {
    for (shape, mesh) in tessellated() {
        let error = |mesh: &TriangleMesh| (area_of(mesh) / shape.area() - 1.0).abs();
        let finer = shape.tessellate(2 * AROUND).expect("as before");
        assert!(error(&mesh) < 0.01, "{shape:?}: {}", error(&mesh));
        let rounding = blur(&shape) * shape.bounds().radius() / shape.area() + 1e-6;
        assert!(error(&finer) < error(&mesh) / 3.5 + rounding, "{shape:?}: {}", error(&finer));
    }
}
