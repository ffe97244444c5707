use super::*;
use crate::mesh::TriangleMesh;
use crate::shape::winding::of_triangle;
use crate::shape::{BoxShape, Cylinder, Disk, Frustum, Metric, Plane, Rectangle, Shape, Sphere};
use crate::world::WorldBuilder;
use crate::world::tests::{Random, default_world, mesh_world, soup, sphere_mesh};
use crate::world::winding::DOUBT;
use snell_math::Transform;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

const ROOT: crate::GroupId = WorldBuilder::ROOT;

/// The exact sum over all triangles, which are in world space.
fn brute_force(meshes: &[TriangleMesh], point: Vec3) -> f64 {
    let around = |mesh: &TriangleMesh| {
        let of = |i| of_triangle(mesh.corners(i).map(|c| c.as_dvec3() - point.as_dvec3()));
        (0..mesh.indices.len()).map(of).sum::<f64>()
    };
    meshes.iter().map(around).sum()
}

fn winding(world: &World, point: Vec3) -> f64 {
    let mut number = [f64::NAN];
    world.winding_number(&[point], &mut number);
    number[0]
}

fn is_inside(world: &World, point: Vec3) -> bool {
    let mut inside = [false];
    world.occupancy(&[point], &mut inside);
    inside[0]
}

fn signed_distance(world: &World, point: Vec3) -> f32 {
    let mut distance = [f32::NAN];
    world.signed_distance(&[point], &mut distance);
    distance[0]
}

/// The upper half of a sphere.
fn bowl(rings: u32, segments: u32) -> TriangleMesh {
    let mut mesh = sphere_mesh(Vec3::ZERO, 1.0, rings, segments);
    let positions = mesh.positions.clone();
    mesh.indices.retain(|t| t.iter().all(|&i| positions[i as usize].z > -1e-3));
    mesh
}

#[test]
fn a_closed_mesh_counts_one_inside_and_nothing_outside() {
    let world = mesh_world(sphere_mesh(Vec3::new(5.0, 0.0, 0.0), 2.0, 40, 80));
    let mut random = Random(3);
    for _ in 0..500 {
        let offset = random.direction() * random.range(0.0, 6.0);
        if (offset.length() - 2.0).abs() < 0.01 {
            continue;
        }
        let (point, expected) =
            (Vec3::new(5.0, 0.0, 0.0) + offset, f64::from(offset.length() < 2.0));
        let exact = world.winding_number_exact(point);
        assert!((exact - expected).abs() < 1e-10, "{point} {exact}");
        assert!(
            (winding(&world, point) - expected).abs() < 0.05,
            "{point} {}",
            winding(&world, point)
        );
        assert_eq!(is_inside(&world, point), expected > 0.5);
    }
}

#[test]
fn the_approximation_of_open_and_random_surfaces_is_near_the_sum() {
    let mut random = Random(17);
    let mut worst: f64 = 0.0;
    for mesh in [bowl(40, 80), soup(&mut random, 2000), sphere_mesh(Vec3::ZERO, 2.0, 60, 20)] {
        let world = mesh_world(mesh.clone());
        for _ in 0..300 {
            let point = random.point(3.0);
            let expected = brute_force(std::slice::from_ref(&mesh), point);
            let exact = world.winding_number_exact(point);
            assert!((exact - expected).abs() < 1e-10, "{point} {exact} {expected}");
            worst = worst.max((winding(&world, point) - expected).abs());
        }
    }
    assert!(worst < 0.25 * DOUBT, "{worst}");
    assert!(worst > 1e-6, "nothing was approximated");
}

#[test]
fn a_bowl_is_inside_below_its_surface_where_it_covers_most_of_the_view() {
    let world = mesh_world(bowl(60, 80));
    // Seen from a point of the axis at height z, the bowl covers everything except a cone through
    // the rim.
    for i in -20..20 {
        let z = f64::from(i) * 0.05 + 0.012;
        let expected = if z < 1.0 { 0.5 * (1.0 + z / z.hypot(1.0)) } else { 0.0 };
        let point = Vec3::new(0.0, 0.0, z as f32);
        let exact = world.winding_number_exact(point);
        assert!((exact - expected).abs() < 2e-3, "{z} {exact} {expected}");
        assert_eq!(is_inside(&world, point), exact > 0.5, "{z}");
        assert_eq!(signed_distance(&world, point) < 0.0, exact > 0.5, "{z}");
    }
}

#[test]
fn instances_are_measured_in_the_world_and_mirrors_keep_the_outside_outside() {
    let mut random = Random(5);
    let open = bowl(10, 12);
    let mut builder = WorldBuilder::default();
    let (middle, inner) = (builder.add_group(), builder.add_group());
    builder.add_mesh(inner, Arc::new(open.clone()));
    let mut flattened = Vec::new();
    let placements: Vec<Transform> = (0..4).map(|_| random.transform(2.0)).collect();
    builder.add_instance(middle, inner, placements[0]);
    builder.add_instance(middle, inner, placements[1]);
    builder.add_instance(ROOT, middle, placements[2]);
    builder.add_instance(ROOT, middle, placements[3]);
    for outer in &placements[2..] {
        for below in &placements[..2] {
            flattened.push(open.transformed(&outer.compose(below)));
        }
    }
    assert!(
        placements.iter().any(|p| p.is_mirrored()) && !placements.iter().all(|p| p.is_mirrored())
    );
    let world = default_world(builder);
    for _ in 0..300 {
        let point = random.point(5.0);
        let expected = brute_force(&flattened, point);
        assert!((world.winding_number_exact(point) - expected).abs() < 1e-5, "{point}");
        assert!((winding(&world, point) - expected).abs() < 0.25 * DOUBT, "{point}");
    }
}

#[test]
fn closed_shapes_count_exactly_however_they_are_placed() {
    let mut random = Random(8);
    for _ in 0..20 {
        let placed = random.transform(1.0);
        let mut builder = WorldBuilder::default();
        builder.add_shape(ROOT, Arc::new(Sphere { radius: 1.0 }), placed);
        let box_shape = BoxShape { min: DVec3::splat(-0.5), max: DVec3::splat(1.5) };
        builder.add_shape(ROOT, Arc::new(box_shape), placed);
        let cylinder = Cylinder { radius: 0.5, height: 4.0, caps: true };
        builder.add_shape(ROOT, Arc::new(cylinder), placed);
        let world = default_world(builder);
        for _ in 0..50 {
            let point = random.point(2.5);
            let p = placed.inverse().point(point.as_dvec3());
            let expected = f64::from(p.length() < 1.0)
                + f64::from(p.cmpgt(box_shape.min).all() && p.cmplt(box_shape.max).all())
                + f64::from(p.y.abs() < 2.0 && p.x.hypot(p.z) < 0.5);
            assert_eq!(winding(&world, point), expected, "{point}");
            assert_eq!(is_inside(&world, point), expected > 0.5);
        }
    }
}

#[test]
fn open_shapes_cover_the_solid_angle_of_the_textbook() {
    let at =
        |shape: &dyn Shape, x, y, z| shape.winding_number(DVec3::new(x, y, z), &Metric::EUCLIDEAN);
    for z in [0.1, 1.0, -3.0] {
        let disk = -0.5 * (1.0 - f64::abs(z) / z.hypot(2.0)) * z.signum();
        assert!((at(&Disk { radius: 2.0, inner_radius: 0.0 }, 0.0, 0.0, z) - disk).abs() < 1e-11);
        let rectangle = Rectangle { half_size: [1.0, 2.0].into() };
        let angle = 4.0 * (2.0 / (z * (z * z + 5.0).sqrt())).atan();
        assert!((at(&rectangle, 0.0, 0.0, z) + angle / (4.0 * PI)).abs() < 1e-12);
        assert_eq!(at(&Plane {}, 7.0, 8.0, z), -0.5 * z.signum());
    }
    // Just above and below a disk, half of all directions see it.
    let above = at(&Disk { radius: 1.0, inner_radius: 0.0 }, 0.2, 0.3, 1e-4);
    assert!((above + 0.5).abs() < 2e-4, "{above}");
}

#[test]
fn a_tube_its_ends_and_its_triangles_agree_under_shear() {
    let tube = Frustum { bottom_radius: 1.0, top_radius: 0.4, height: 2.0, caps: false };
    let closed = Frustum { caps: true, ..tube };
    let mut mesh = TriangleMesh::default();
    let n = 2000;
    for i in 0..n {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(n)).sin_cos();
        mesh.positions.push(DVec3::new(sin, -1.0, cos).as_vec3());
        mesh.positions.push(DVec3::new(0.4 * sin, 1.0, 0.4 * cos).as_vec3());
        let next = 2 * ((i + 1) % n);
        mesh.indices.extend([[2 * i, next, next + 1], [2 * i, next + 1, 2 * i + 1]]);
    }
    let mut random = Random(44);
    for _ in 0..10 {
        let placed = random.transform(1.0);
        let in_world = mesh.transformed(&placed);
        let metric = Metric::new(placed.matrix().matrix3);
        for _ in 0..20 {
            let point = random.point(2.0);
            let p = placed.inverse().point(point.as_dvec3());
            let expected = brute_force(std::slice::from_ref(&in_world), point);
            let found = tube.winding_number(p, &metric);
            assert!((found - expected).abs() < 1e-4, "{point} {found} {expected}");
            assert_eq!(
                closed.winding_number(p, &metric),
                if found > 0.99 { 1.0 } else { closed.winding_number(p, &Metric::EUCLIDEAN) }
            );
        }
    }
}

#[test]
fn a_mesh_turned_inside_out_is_a_cavity() {
    let mut inner = sphere_mesh(Vec3::ZERO, 1.0, 20, 20);
    inner.indices.iter_mut().for_each(|t| t.swap(0, 1));
    let mut builder = WorldBuilder::default();
    builder.add_mesh(ROOT, Arc::new(sphere_mesh(Vec3::ZERO, 2.0, 20, 20)));
    builder.add_mesh(ROOT, Arc::new(inner));
    let world = default_world(builder);
    let distance = |x: f32| signed_distance(&world, Vec3::new(x, 0.01, 0.02));
    assert!(distance(0.0) > 0.9 && distance(1.5) < -0.4 && distance(3.0) > 0.9);
}

#[test]
fn signed_distances_to_a_fine_sphere_are_those_of_the_ball() {
    let world = mesh_world(sphere_mesh(Vec3::ZERO, 1.0, 200, 200));
    let mut random = Random(61);
    for _ in 0..300 {
        let point = random.point(2.0);
        let expected = point.length() - 1.0;
        let found = signed_distance(&world, point);
        assert!((found - expected).abs() < 5e-4, "{point} {found} {expected}");
    }
    assert_eq!(signed_distance(&world, Vec3::Z), 0.0);
}

#[test]
fn bad_points_and_empty_worlds_have_answers() {
    let empty = default_world(WorldBuilder::default());
    assert_eq!(signed_distance(&empty, Vec3::ZERO), f32::INFINITY);
    assert_eq!(winding(&empty, Vec3::ZERO), 0.0);
    let world = mesh_world(sphere_mesh(Vec3::ZERO, 1.0, 10, 10));
    for bad in [Vec3::NAN, Vec3::splat(f32::INFINITY)] {
        assert_eq!(signed_distance(&world, bad), f32::INFINITY);
        assert_eq!((winding(&world, bad), is_inside(&world, bad)), (0.0, false));
    }
    for far in [1e10, 1e25, f32::MAX] {
        assert!(winding(&world, Vec3::splat(far)).abs() < 1e-10);
        assert!(signed_distance(&world, Vec3::splat(-far)) >= far);
    }
    let near = [Vec3::ZERO, Vec3::X * 5.0, Vec3::NAN];
    let mut distances = [0.0; 3];
    world.signed_distance(Points { max_distance: 0.25, ..Points::new(&near) }, &mut distances);
    assert_eq!(distances, [-0.25, 0.25, 0.25]);
}
