//! Tests of quads in worlds.

use super::{Random, agree, bits, worlds};
use crate::geometry::QuadMesh;
use crate::mesh::TriangleMesh;
use crate::search::AcceptAll;
use crate::world::{GeometryId, WorldBuilder};
use snell_math::{Ray, Vec2, Vec3};
use std::sync::Arc;

/// A cube around the origin, normals outward.
fn cube() -> Arc<QuadMesh> {
    let side = |bit: usize, i: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
    let positions = (0..8).map(|i| Vec3::new(side(0, i), side(1, i), side(2, i))).collect();
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Arc::new(
        QuadMesh::new(TriangleMesh { positions, ..TriangleMesh::default() }, &quads)
            .expect("valid"),
    )
}

fn on_quad(quads: &QuadMesh, quad: u32, uv: Vec2) -> Vec3 {
    let [a, b, c, d] = quads.quad(quad as usize).map(|v| quads.triangles().positions[v as usize]);
    a * ((1.0 - uv.x) * (1.0 - uv.y))
        + b * (uv.x * (1.0 - uv.y))
        + c * (uv.x * uv.y)
        + d * ((1.0 - uv.x) * uv.y)
}

#[test]
fn a_hit_names_its_quad_and_the_place_in_it() {
    let cube = cube();
    let worlds = worlds(|b| {
        b.add_quads(WorldBuilder::ROOT, cube.clone());
    });
    let mut random = Random(1);
    let mut rays: Vec<_> =
        (0..2000).map(|_| Ray::new(random.point(0.9), random.direction())).collect();
    // More rays run along the diagonals and edges.
    rays.extend(
        (0..50).map(|_| Ray::new(Vec3::ZERO, random.point(3.0).round())).filter(Ray::is_valid),
    );
    agree(&worlds, &rays, &vec![0.0; rays.len()]);
    for ray in &rays {
        let all = worlds[1].all_one(ray, &AcceptAll);
        assert_eq!(all.len(), 1, "the cube is closed: {ray:?}");
        let hit = all[0];
        let p = ray.at(hit.t);
        assert!(
            hit.primitive < 6 && (on_quad(&cube, hit.primitive, hit.uv) - p).length() < 1e-5,
            "{hit:?}"
        );
        let s = worlds[1].interaction(ray, &hit);
        assert!((s.position - p).length() < 1e-5);
        assert!((s.geometric_normal.dot(p) - 1.0).abs() < 1e-5, "outward: {s:?}");
    }
}

#[test]
fn a_quad_folded_onto_itself_has_one_answer() {
    // Both triangles cover the same place, but differ in uv.
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(0.1, 0.1, 0.0), Vec3::Y];
    let quads = Arc::new(
        QuadMesh::new(TriangleMesh { positions, ..TriangleMesh::default() }, &[[0, 1, 2, 3]; 4])
            .expect("valid"),
    );
    let fill = |order: [usize; 2]| {
        let quads = quads.clone();
        worlds(move |b| {
            for _ in order {
                b.add_quads(WorldBuilder::ROOT, quads.clone());
            }
        })
    };
    let worlds = fill([0, 1]);
    let mut random = Random(2);
    let rays: Vec<_> = (0..300)
        .map(|_| Ray::new(Vec3::new(random.unit(), random.unit(), 1.0), Vec3::new(0.0, 0.0, -1.0)))
        .collect();
    assert!(agree(&worlds, &rays, &vec![0.0; rays.len()]) > 100);
    let both = rays.iter().filter(|r| worlds[0].all_one(*r, &AcceptAll).len() == 16).count();
    assert!(both > 50, "{both}");
    for ray in &rays {
        let hit = worlds[0].closest_one(ray, &AcceptAll);
        if let Some(first) = worlds[0].all_one(ray, &AcceptAll).first() {
            assert_eq!(bits(&hit), bits(first));
            assert_eq!((hit.geometry, hit.primitive), (0, 0));
        }
    }
}

#[test]
fn a_quad_with_two_equal_corners_is_a_triangle() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let mesh = TriangleMesh { positions, ..TriangleMesh::default() };
    for quad in [[0, 1, 2, 2], [0, 0, 1, 2], [1, 2, 2, 0]] {
        let quads = Arc::new(QuadMesh::new(mesh.clone(), &[quad]).expect("valid"));
        let worlds = worlds(|b| {
            let id = b.add_quads(WorldBuilder::ROOT, quads.clone());
            assert_eq!(id, GeometryId(0));
        });
        let mut random = Random(3);
        for _ in 0..300 {
            let (x, y) = (random.unit(), random.unit());
            let ray = Ray::new(Vec3::new(x, y, 1.0), -Vec3::Z);
            let hit = worlds[1].closest_one(&ray, &AcceptAll);
            assert_eq!(hit.is_hit(), x + y < 1.0, "{quad:?} {x} {y}");
            if hit.is_hit() {
                let s = worlds[1].interaction(&ray, &hit);
                assert!(
                    (s.position - Vec3::new(x, y, 0.0)).length() < 1e-5,
                    "{quad:?} {hit:?} {s:?}"
                );
                assert_eq!(s.geometric_normal, Vec3::Z);
            }
        }
        assert_eq!(worlds[1].skipped_triangles(), 1);
    }
}

#[test]
fn the_nearest_point_of_a_quad_names_the_quad_and_the_place_in_it() {
    let cube = cube();
    let worlds = worlds(|b| {
        b.add_quads(WorldBuilder::ROOT, cube.clone());
    });
    let mut random = Random(4);
    for _ in 0..300 {
        let point = random.point(2.0);
        let found = worlds[0].nearest_point_one(point);
        assert!(
            found.primitive < 6
                && (on_quad(&cube, found.primitive, found.uv) - found.position).length() < 1e-5
        );
        for world in &worlds {
            assert_eq!(world.nearest_point_one(point), found);
        }
    }
}
