//! Tests of moving geometry in worlds.

use super::{Random, agree, bits, sets, worlds};
use crate::geometry::motion::transform_at;
use crate::geometry::{MeshKey, MovingMesh};
use crate::hit::Hit;
use crate::mesh::TriangleMesh;
use crate::search::AcceptAll;
use crate::search::rays::RayQuery;
use crate::world::tests::sphere_mesh;
use crate::world::{BuildOptions, Instance, World, WorldBuilder};
use snell_math::{Bounds3d, DAffine3, DMat3, DVec3, Ray, Transform, Vec3};
use std::sync::Arc;

fn at(ray: &Ray, time: f32) -> RayQuery<'_> {
    RayQuery { time, ..RayQuery::from(ray) }
}

fn world(fill: impl FnOnce(&mut WorldBuilder)) -> World {
    let mut builder = WorldBuilder::default();
    fill(&mut builder);
    builder.build(&BuildOptions::default()).expect("a world")
}

/// A closed mesh around the origin, dented differently at each of three keys; a ray from the centre
/// crosses it once at any time.
fn breathing(random: &mut Random) -> MovingMesh {
    let mut first = sphere_mesh(Vec3::ZERO, 1.0, 16, 32);
    let rest = first.positions.clone();
    let mut dented = || rest.iter().map(|p| *p * random.range(0.7, 1.3)).collect::<Vec<_>>();
    first.positions = dented();
    first.normals = rest.clone();
    let later = [dented(), dented()].map(|positions| MeshKey { positions, normals: rest.clone() });
    MovingMesh::new(first, later.to_vec()).expect("valid")
}

#[test]
fn a_moving_mesh_is_hit_as_the_mesh_at_that_time_bit_for_bit_and_never_leaks() {
    let mut random = Random(7);
    let mesh = Arc::new(breathing(&mut random));
    let moving = worlds(|b| {
        b.add_moving_mesh(WorldBuilder::ROOT, mesh.clone());
    });
    for i in 0..24 {
        let time = if i < 5 { i as f32 * 0.25 } else { random.unit() };
        let still = mesh.at(time);
        let mut targets = still.positions.clone();
        targets.extend((0..still.indices.len()).flat_map(|t| {
            let [a, b, c] = still.corners(t);
            [(a + b) * 0.5, (b + c) * 0.5]
        }));
        targets.extend((0..200).map(|_| random.direction()));
        let still = world(|b| {
            b.add_mesh(WorldBuilder::ROOT, Arc::new(still));
        });
        for target in targets {
            let ray = Ray::new(Vec3::ZERO, target);
            let all = moving[1].all_one(at(&ray, time), &AcceptAll);
            assert_eq!(all.len(), 1, "time {time}, {target}: {all:?}");
            assert_eq!(all, still.all_one(&ray, &AcceptAll));
            let s = moving[1].interaction(at(&ray, time), &all[0]);
            assert_eq!(s, still.interaction(&ray, &all[0]));
        }
    }
    let rays: Vec<_> = (0..300).map(|_| Ray::new(random.point(0.8), random.direction())).collect();
    let times: Vec<_> = rays.iter().map(|_| random.range(-0.2, 1.2)).collect();
    assert!(agree(&moving, &rays, &times) > 150);
}

#[test]
fn corners_that_are_not_finite_or_together_take_their_triangles_out() {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE, Vec3::ZERO];
    let indices = vec![[0, 1, 2], [1, 2, 3], [0, 1, 4], [2, 4, 0]];
    let first = TriangleMesh { positions: positions.clone(), indices, ..TriangleMesh::default() };
    let mut later = positions;
    later[3].x = f32::NAN;
    later[4].y = -1.0;
    let mesh = MovingMesh::new(first, vec![MeshKey { positions: later, normals: Vec::new() }])
        .expect("valid");
    let mesh = Arc::new(mesh);
    let all = worlds(|b| {
        b.add_moving_mesh(WorldBuilder::ROOT, mesh.clone());
    });
    // At time 0 two corners of the third triangle coincide; later it is not degenerate.
    assert_eq!((all[1].stats().triangles, all[1].skipped_triangles()), (4, 1));
    let below = Ray::new(Vec3::new(0.2, -0.1, 1.0), -Vec3::Z);
    let hit = |time| all[1].closest_one(at(&below, time), &AcceptAll);
    assert_eq!((hit(0.0), hit(1.0).primitive), (Hit::MISS, 2));
    let mut random = Random(3);
    let rays: Vec<_> = (0..400)
        .map(|_| Ray::new(Vec3::new(random.unit(), random.range(-1.0, 1.0), 1.0), -Vec3::Z))
        .collect();
    let times: Vec<_> = (0..400).map(|i| [0.0, 0.3, 1.0, f32::NAN][i % 4]).collect();
    assert!(agree(&all, &rays, &times) > 100);
    let still = mesh.at(0.5);
    assert!(!still.positions[3].is_finite() && still.positions[4] == Vec3::new(0.0, -0.5, 0.0));
}

fn turned(angle: f64, offset: DVec3) -> Transform {
    let matrix3 = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle)
        * DMat3::from_diagonal(DVec3::new(1.0, -0.5, 1.5));
    Transform::new(DAffine3 { matrix3, translation: offset }).expect("invertible")
}

fn keys() -> Vec<Transform> {
    vec![
        turned(0.0, DVec3::ZERO),
        turned(0.7, DVec3::X * 2.0),
        turned(1.5, DVec3::new(1.0, 2.0, -0.5)),
    ]
}

/// The map of an instance with [`keys`] at these times.
fn map_at(times: &[f32], time: f32) -> Transform {
    transform_at(&keys()[0], &keys()[1..], times, time).expect("not flat")
}

#[test]
fn a_moving_instance_is_hit_where_it_is_at_that_time() {
    for times in [&[][..], &[0.2, 0.3, 0.9]] {
        check_moving_instance(times);
    }
}

fn check_moving_instance(times: &[f32]) {
    let mesh = Arc::new(sphere_mesh(Vec3::ZERO, 1.0, 12, 24));
    let place = |keys: &[Transform], b: &mut WorldBuilder| {
        let child = b.add_group();
        b.add_mesh(child, mesh.clone());
        let times = if keys.len() > 1 { times.to_vec() } else { Vec::new() };
        b.add(
            WorldBuilder::ROOT,
            Instance { later: keys[1..].to_vec(), times, ..Instance::new(child, keys[0]) },
        );
    };
    let moving = world(|b| place(&keys(), b));
    let mut random = Random(5);
    let mut hits = 0;
    for _ in 0..60 {
        let time = random.unit();
        let now = map_at(times, time);
        let still = world(|b| place(&[now], b));
        let moved = world(|b| {
            b.add_mesh(WorldBuilder::ROOT, Arc::new(mesh.transformed(&now)));
        });
        for _ in 0..40 {
            let (from, to) =
                (random.point(5.0), now.point(random.direction().as_dvec3() * 0.8).as_vec3());
            let ray = Ray::new(from, to - from);
            let hit = moving.closest_one(at(&ray, time), &AcceptAll);
            assert_eq!(bits(&hit), bits(&still.closest_one(&ray, &AcceptAll)));
            let other = moved.closest_one(&ray, &AcceptAll);
            assert!(hit.is_hit() && (hit.t - other.t).abs() < 1e-4, "{hit:?} {other:?}");
            let (s, expected) =
                (moving.interaction(at(&ray, time), &hit), still.interaction(&ray, &hit));
            assert_eq!(s, expected);
            assert!((s.position - ray.at(hit.t)).length() < 1e-5);
            let d = random.direction();
            let next = Ray::new(s.ray_origin(d), d);
            let again = moving.all_one(at(&next, time), &AcceptAll);
            assert!(again.iter().all(|h| h.primitive != hit.primitive), "{hit:?} {again:?}");
            hits += 1;
        }
    }
    assert_eq!(hits, 2400);
    assert_eq!(moving.world_from_instance_at(1, times.get(1).copied().unwrap_or(0.5)), keys()[1]);
    assert_eq!(moving.world_from_instance(1), keys()[0]);
}

#[test]
fn bounds_hold_everything_at_all_times() {
    let mut random = Random(2);
    let mesh = Arc::new(breathing(&mut random));
    let world = world(|b| {
        let child = b.add_group();
        b.add_moving_mesh(child, mesh.clone());
        b.add(
            WorldBuilder::ROOT,
            Instance { later: keys()[1..].to_vec(), ..Instance::new(child, keys()[0]) },
        );
    });
    let bounds = world.bounds();
    let outer = Bounds3d { min: bounds.min - 1e-9, max: bounds.max + 1e-9 };
    for _ in 0..30 {
        let time = random.unit();
        let now = map_at(&[], time);
        assert!(mesh.at(time).positions.iter().all(|p| outer.contains(now.point(p.as_dvec3()))));
    }
}

#[test]
fn every_structure_level_and_batch_agrees_about_what_moves() {
    let mut random = Random(9);
    let mesh = Arc::new(breathing(&mut random));
    let half_turn = turned(std::f64::consts::PI, DVec3::ZERO);
    let all = worlds(|b| {
        let (outer, inner) = (b.add_group(), b.add_group());
        b.add_moving_mesh(inner, mesh.clone());
        b.add_mesh(inner, Arc::new(mesh.at(0.3)));
        sets::everything(b);
        b.add(outer, Instance { later: keys(), ..Instance::new(inner, turned(0.2, DVec3::Y)) });
        b.add(
            outer,
            Instance { later: vec![half_turn], ..Instance::new(inner, turned(0.0, DVec3::ZERO)) },
        );
        b.add(
            WorldBuilder::ROOT,
            Instance { later: keys(), ..Instance::new(outer, turned(0.3, DVec3::Z)) },
        );
    });
    let rays: Vec<_> = (0..500)
        .map(|i| {
            let (from, to) = (random.point(5.0), random.point(2.0));
            let direction =
                if i % 7 == 0 { [Vec3::X, -Vec3::Y, Vec3::Z][i % 3] } else { to - from };
            Ray::new(from, direction)
        })
        .collect();
    let times: Vec<_> =
        (0..500).map(|i| if i % 5 == 0 { 0.5 } else { random.range(-0.1, 1.1) }).collect();
    assert!(agree(&all, &rays, &times) > 250);
}

#[test]
fn the_nearest_point_of_what_moves_is_that_at_time_0() {
    let mut random = Random(4);
    let mesh = Arc::new(breathing(&mut random));
    let moving = worlds(|b| {
        let child = b.add_group();
        b.add_moving_mesh(child, mesh.clone());
        b.add(
            WorldBuilder::ROOT,
            Instance { later: keys()[1..].to_vec(), ..Instance::new(child, keys()[0]) },
        );
    });
    let still = world(|b| {
        let child = b.add_group();
        b.add_mesh(child, mesh.first().clone());
        b.add_instance(WorldBuilder::ROOT, child, keys()[0]);
    });
    for _ in 0..200 {
        let point = random.point(2.0);
        let expected = still.nearest_point_one(point);
        assert!(expected.is_found());
        for world in &moving {
            assert_eq!(world.nearest_point_one(point), expected);
        }
    }
}
