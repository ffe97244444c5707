use super::*;
use crate::mesh::TriangleMesh;
use crate::search::AcceptAll;
use crate::shape::{AnyShape, Plane, Sphere};
use crate::world::tests::{
    Random, build, default_world, mesh_world, nested_scene, scaling, sphere_mesh,
};
use crate::world::{AcceleratorKind, BuildOptions, Geometry, GeometryId, WorldBuilder};
use proptest::prelude::*;
use snell_math::simd::Level;
use snell_math::{DMat3, Ray, Transform};
use std::sync::Arc;

fn bits(p: &NearestPoint) -> [u32; 9] {
    let f =
        [p.distance, p.position.x, p.position.y, p.position.z, p.uv.x, p.uv.y].map(f32::to_bits);
    [f[0], f[1], f[2], f[3], f[4], f[5], p.instance, p.geometry, p.primitive]
}

/// Random points near, inside and far from the contents.
fn points(seed: u32, count: usize) -> Vec<Vec3> {
    let mut random = Random(seed);
    (0..count).map(|i| random.point([0.5, 3.0, 8.0, 1000.0][i % 4])).collect()
}

#[test]
fn the_tree_finds_what_looking_at_everything_finds_bit_for_bit() {
    let mut instances = std::collections::BTreeSet::new();
    for seed in 0..3 {
        let oracle = build(nested_scene(seed), AcceleratorKind::None, Level::Scalar);
        let world = default_world(nested_scene(seed));
        let points = points(seed * 77, 200);
        let limits: Vec<f32> =
            (0..points.len()).map(|i| [f32::INFINITY, 0.3, 1.0][i % 3]).collect();
        let query = Points { max_distances: &limits, ..Points::new(&points) };
        let (mut found, mut expected) =
            (vec![NearestPoint::NONE; 200], vec![NearestPoint::NONE; 200]);
        world.nearest_point(query, &mut found);
        oracle.nearest_point(query, &mut expected);
        for i in 0..points.len() {
            assert_eq!(
                bits(&found[i]),
                bits(&expected[i]),
                "{seed} {i} {} {:?} {:?}",
                points[i],
                found[i],
                expected[i]
            );
            instances.insert(found[i].instance);
        }
    }
    assert!(instances.len() > 20, "{instances:?}");
}

#[test]
fn no_ray_finds_anything_nearer_and_the_position_is_as_far_as_the_distance_says() {
    for seed in 0..3 {
        let world = default_world(nested_scene(seed));
        let mut random = Random(seed + 9000);
        for point in points(seed, 100) {
            let nearest = world.nearest_point_one(point);
            let slack = 1e-5 * (nearest.distance + point.length());
            assert!(
                (nearest.position.distance(point) - nearest.distance).abs() <= slack,
                "{point} {nearest:?}"
            );
            for _ in 0..30 {
                let hit = world.closest_one(&Ray::new(point, random.direction()), &AcceptAll);
                assert!(hit.t >= nearest.distance - slack, "{point} {nearest:?} {hit:?}");
            }
            if let Geometry::Mesh(mesh) = world.geometry(GeometryId(nearest.geometry)) {
                let corners = mesh.corners(nearest.primitive as usize).map(|c| c.as_dvec3());
                let (b1, b2) = (f64::from(nearest.uv.x), f64::from(nearest.uv.y));
                let local = corners[0] * (1.0 - b1 - b2) + corners[1] * b1 + corners[2] * b2;
                let position = world.world_from_instance(nearest.instance).point(local).as_vec3();
                assert!(position.distance(nearest.position) < 1e-5, "{nearest:?} {position}");
            }
        }
    }
}

#[test]
fn a_stretched_sphere_is_measured_in_the_world() {
    let mut builder = WorldBuilder::default();
    let stretched =
        Transform::new(DAffine3::from_scale(DVec3::new(10.0, 1.0, 1.0))).expect("invertible");
    builder.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 1.0 }), stretched);
    let world = default_world(builder);
    let nearest = world.nearest_point_one(Vec3::new(0.0, 3.0, 0.0));
    assert_eq!((nearest.distance, nearest.position), (2.0, Vec3::Y));
    // In the sphere's own coordinates the nearest point would be one of the poles on the long axis.
    let inside = world.nearest_point_one(Vec3::new(8.0, 0.0, 0.0));
    assert!(inside.distance < 0.62 && inside.position.x > 7.5, "{inside:?}");
}

#[test]
fn a_point_on_an_edge_or_corner_belongs_to_the_lowest_triangle() {
    let mesh = sphere_mesh(Vec3::new(3.0, -2.0, 5.0), 2.0, 12, 20);
    let world = mesh_world(mesh.clone());
    let lowest = |corners: &[u32]| {
        let has = |t: &[u32; 3]| corners.iter().all(|c| t.contains(c));
        mesh.indices.iter().position(has).expect("a triangle") as u32
    };
    for triangle in &mesh.indices {
        let p = triangle.map(|i| mesh.positions[i as usize]);
        let center = Vec3::new(3.0, -2.0, 5.0);
        for k in 0..3 {
            let (i, j) = (k, (k + 1) % 3);
            let outside = center + (p[i] - center) * 2.0;
            let nearest = world.nearest_point_one(outside);
            assert_eq!((nearest.primitive, nearest.position), (lowest(&[triangle[i]]), p[i]));
            // A point outside, opposite the middle of an edge of a convex mesh.
            let middle = center + ((p[i] + p[j]) * 0.5 - center) * 1.5;
            let nearest = world.nearest_point_one(middle);
            assert!(nearest.position.distance((p[i] + p[j]) * 0.5) < 0.1);
            let on_edge = world.nearest_point_one((p[i] + p[j]) * 0.5);
            assert!(on_edge.distance < 1e-6, "{on_edge:?}");
        }
        assert_eq!(world.nearest_point_one(p[0]).distance, 0.0);
    }
}

#[test]
fn masks_limits_and_unbounded_shapes_count() {
    let mut builder = WorldBuilder::default();
    let plane = builder.add_shape(WorldBuilder::ROOT, Arc::new(Plane {}), Transform::IDENTITY);
    let above = Transform::translation(DVec3::new(0.0, 0.0, 5.0));
    let sphere = builder.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 1.0 }), above);
    builder.set_mask(plane, 1);
    builder.set_mask(sphere, 2);
    let world = default_world(builder);
    let point = [Vec3::new(0.0, 0.0, 1.0)];
    let ask = |mask, max_distance| {
        let mut out = [NearestPoint::NONE];
        world.nearest_point(Points { mask, max_distance, ..Points::new(&point) }, &mut out);
        (out[0].geometry, out[0].distance)
    };
    assert_eq!(ask(3, f32::INFINITY), (plane.0, 1.0));
    assert_eq!(ask(2, f32::INFINITY), (sphere.0, 3.0));
    assert_eq!(ask(4, f32::INFINITY), (Hit::NONE, f32::INFINITY));
    assert_eq!(ask(2, 3.0), (sphere.0, 3.0), "what is exactly as far is found");
    assert_eq!(ask(2, 3.0_f32.next_down()), (Hit::NONE, f32::INFINITY));
    assert_eq!(ask(3, f32::NAN), (Hit::NONE, f32::INFINITY));
    assert_eq!(ask(3, -1.0), (Hit::NONE, f32::INFINITY));
}

#[test]
fn bad_points_find_nothing_and_huge_distances_are_finite() {
    let world = default_world(nested_scene(1));
    for bad in
        [Vec3::NAN, Vec3::new(0.0, f32::INFINITY, 0.0), Vec3::new(f32::NEG_INFINITY, f32::NAN, 0.0)]
    {
        assert_eq!(world.nearest_point_one(bad), NearestPoint::NONE);
    }
    let oracle = build(nested_scene(1), AcceleratorKind::None, Level::Scalar);
    for far in [1e15, 1e19, 1e30, f32::MAX] {
        for point in [Vec3::new(far, 0.0, 0.0), Vec3::splat(-far), Vec3::new(far, -far, 1.0)] {
            let nearest = world.nearest_point_one(point);
            assert!(
                nearest.is_found() && nearest.distance.is_finite() && nearest.position.is_finite(),
                "{nearest:?}"
            );
            assert_eq!(bits(&nearest), bits(&oracle.nearest_point_one(point)), "{point}");
        }
    }
    let empty = default_world(WorldBuilder::default());
    assert_eq!(empty.nearest_point_one(Vec3::ZERO), NearestPoint::NONE);
}

#[test]
fn every_shape_is_found_under_strong_shear_as_without_a_tree() {
    for (i, shape) in AnyShape::examples().into_iter().enumerate() {
        let mut builder = WorldBuilder::default();
        let size = shape.bounds().size().max_element();
        let unit = scaling(if size.is_finite() { 1.0 / size } else { 1.0 });
        let shear =
            DMat3::from_cols(DVec3::X, DVec3::new(30.0, 1.0, 0.0), DVec3::new(-4.0, 20.0, 0.05));
        let shear = Transform::new(DAffine3::from_mat3(shear)).expect("invertible");
        let child = builder.add_group();
        builder.add_shape(child, Arc::new(shape), unit);
        builder.add_instance(WorldBuilder::ROOT, child, shear);
        builder.add_instance(WorldBuilder::ROOT, child, Transform::translation(DVec3::Z));
        let oracle = build(builder.clone(), AcceleratorKind::None, Level::Scalar);
        let world = default_world(builder);
        for point in points(i as u32, 24) {
            let (a, b) = (world.nearest_point_one(point), oracle.nearest_point_one(point));
            assert_eq!(bits(&a), bits(&b), "{i} {point}");
        }
    }
}

fn corner() -> impl Strategy<Value = Vec3> {
    let coordinate = || prop_oneof![(-4i32..=4).prop_map(|i| i as f32 * 0.25), -2.0f32..2.0];
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array)
}

proptest! {
    #[test]
    fn the_nearest_point_of_a_triangle_is_not_beaten_by_a_lattice_on_it(
        corners in [corner(), corner(), corner()], point in corner(), scale in -20i32..20,
    ) {
        let scale = 2.0f64.powi(scale);
        let corners = corners.map(|c| c.as_dvec3() * scale);
        let point = point.as_dvec3() * scale;
        let (position, uv) = on_triangle(&crate::shape::Metric::EUCLIDEAN, point, &corners);
        let [a, b, c] = corners;
        let at = |u: f64, v: f64| a + (b - a) * u + (c - a) * v;
        prop_assert!(at(uv.x, uv.y).distance(position) <= 1e-12 * scale);
        prop_assert!(uv.x >= 0.0 && uv.y >= 0.0 && uv.x + uv.y <= 1.0 + 1e-12);
        let n = 40;
        for i in 0..=n {
            for j in 0..=n - i {
                let other = at(f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                prop_assert!(position.distance(point) <= other.distance(point) + 1e-12 * scale);
            }
        }
    }
}

#[test]
fn spheres_and_curves_in_bulk_are_found_as_without_a_tree_and_hold_what_is_inside() {
    use crate::{CubicCurves, CurveBasis, LinearCurves, Spheres};
    use snell_math::Vec4;
    let mut random = Random(31);
    let point = |random: &mut Random| random.point(2.0).extend(random.range(0.05, 0.2));
    let spheres =
        Spheres { spheres: (0..30).map(|_| point(&mut random)).collect(), ..Spheres::default() };
    let chain = LinearCurves::chain((0..30).map(|_| point(&mut random)).collect::<Vec<Vec4>>());
    let points: Vec<Vec4> = (0..24).map(|_| point(&mut random)).collect();
    let curves = CubicCurves {
        basis: CurveBasis::BSpline,
        points,
        tangents: vec![],
        segments: (0..21).collect(),
        exact: vec![],
    };
    let mut builder = WorldBuilder::default();
    let child = builder.add_group();
    builder.add_set(child, Arc::new(spheres));
    builder.add_set(child, Arc::new(chain));
    builder.add_set(child, Arc::new(curves));
    builder.add_instance(WorldBuilder::ROOT, child, Transform::IDENTITY);
    builder.add_instance(WorldBuilder::ROOT, child, random.transform(3.0));
    let oracle = build(builder.clone(), AcceleratorKind::None, Level::Scalar);
    let world = default_world(builder);
    let mut kinds = std::collections::BTreeSet::new();
    for i in 0..60 {
        let point = random.point(if i % 2 == 0 { 2.0 } else { 5.0 });
        let nearest = world.nearest_point_one(point);
        assert_eq!(bits(&nearest), bits(&oracle.nearest_point_one(point)), "{point}");
        kinds.insert((nearest.instance, nearest.geometry));
        let mut inside = [false];
        world.occupancy(&[point], &mut inside);
        for _ in 0..20 {
            let ray = Ray::new(point, random.direction());
            let hit = world.closest_one(&ray, &AcceptAll);
            assert!(hit.t >= nearest.distance * (1.0 - 1e-4) - 1e-5, "{point} {nearest:?} {hit:?}");
            // From a point inside a solid there is a nearest surface point.
            assert!(!inside[0] || hit.is_hit(), "{point}");
        }
    }
    assert!(kinds.len() > 3, "{kinds:?}");
}

#[test]
fn points_in_double_precision_find_what_rounded_ones_do_and_are_not_rounded() {
    let world = default_world(nested_scene(5));
    for point in points(31, 200) {
        let (single, double) = (
            world.nearest_point_one(point),
            world.nearest_point_at(point.as_dvec3(), 1e9, u64::MAX),
        );
        assert_eq!(
            (
                double.distance as f32,
                double.position.as_vec3(),
                double.uv.as_vec2(),
                double.instance,
                double.geometry,
                double.primitive
            ),
            (
                single.distance,
                single.position,
                single.uv,
                single.instance,
                single.geometry,
                single.primitive
            )
        );
    }
    let ball = |b: &mut WorldBuilder| {
        b.add_shape(
            WorldBuilder::ROOT,
            Arc::new(Sphere { radius: 1.0 }),
            Transform::translation(DVec3::splat(1e6)),
        );
    };
    let mut builder = WorldBuilder::default();
    ball(&mut builder);
    let world = default_world(builder);
    let point = DVec3::splat(1e6) + DVec3::new(1.0 + 1e-3, 0.0, 0.0);
    let near = world.nearest_point_at(point, f64::INFINITY, u64::MAX);
    assert!((near.distance - 1e-3).abs() < 1e-9 && near.is_found(), "{near:?}");
    assert!(!world.is_inside(point) && world.is_inside(point - DVec3::X * 2e-3));
    assert_eq!(world.winding_number_at(point - DVec3::X * 2e-3), 1.0);
    for (point, limit) in [(point, 0.5e-3), (point, -1.0), (point, f64::NAN), (DVec3::NAN, 1.0)] {
        assert_eq!(world.nearest_point_at(point, limit, u64::MAX), DNearestPoint::NONE);
    }
}

#[test]
fn triangles_with_equal_corners_have_the_distance_of_their_line() {
    let mesh = |indices: Vec<[u32; 3]>| TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::X * 0.5, Vec3::new(0.0, 0.0, -9.0)],
        indices,
        ..TriangleMesh::default()
    };
    let point = Vec3::new(0.5, 1.0, 0.0);
    for indices in [vec![[0, 1, 1]], vec![[1, 1, 0]], vec![[0, 1, 0]], vec![[0, 1, 2]]] {
        let near = mesh_world(mesh(indices.clone())).nearest_point_one(point);
        assert_eq!((near.distance, near.primitive), (1.0, 0), "{indices:?}");
        assert_eq!(near.position, Vec3::X * 0.5);
        let mut builder = crate::DWorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, Arc::new((&mesh(indices)).into()));
        let world = builder.build(&BuildOptions::default()).unwrap();
        assert_eq!(world.nearest_point_one(point.as_dvec3()).distance, 1.0);
    }
    let dot = mesh_world(mesh(vec![[2, 2, 2]])).nearest_point_one(point);
    assert_eq!((dot.distance, dot.primitive), (1.0, 0));
    // A sound triangle with the same edge stands for the flat one.
    let both = mesh_world(mesh(vec![[1, 0, 0], [0, 1, 3]])).nearest_point_one(point);
    assert_eq!((both.distance, both.primitive), (1.0, 1));
    let mut many = mesh((0..300).map(|i| [i, i + 1, i + 1]).collect());
    many.positions = (0..301).map(|i| Vec3::new(i as f32, (i % 2) as f32, 0.0)).collect();
    let world = mesh_world(many.clone());
    let mut random = Random(4);
    for _ in 0..100 {
        let point = random.point(50.0) + Vec3::X * 150.0;
        let least = (0..300)
            .map(|i| {
                let (a, b) = (many.positions[i], many.positions[i + 1]);
                let s = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                point.distance(a.lerp(b, s))
            })
            .fold(f32::INFINITY, f32::min);
        let found = world.nearest_point_one(point).distance;
        assert!((found - least).abs() < 1e-4, "{point} {found} {least}");
    }
}

#[test]
fn distances_are_right_at_any_size() {
    for size in [1e-110, 1e-60, 1.0, 1e60, 1e155, 1e250] {
        let mesh = crate::DTriangleMesh {
            positions: [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|c| c * size).to_vec(),
            indices: vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]],
        };
        let mut builder = crate::DWorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
        let world = builder.build(&BuildOptions::default()).unwrap();
        // The nearest point is the middle of the sloping face.
        let near = world.nearest_point_one(DVec3::splat(2.0 * size));
        assert!((near.distance / size - 5.0 / 3f64.sqrt()).abs() < 1e-9, "{size:e} {near:?}");
        assert!((near.position / size - 1.0 / 3.0).length() < 1e-9, "{size:e} {near:?}");
    }
}
