use super::*;
use crate::mesh::TriangleMesh;
use crate::shape::winding::of_triangle;
use crate::shape::{BoxShape, Cylinder, Disk, Frustum, Metric, Plane, Rectangle, Shape, Sphere};
use crate::world::WorldBuilder;
use crate::world::tests::{Random, default_world, mesh_world, soup, sphere_mesh};
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
    assert!(worst < 0.05, "{worst}");
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
        assert!((winding(&world, point) - expected).abs() < 0.05, "{point}");
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

fn turned(mut mesh: TriangleMesh) -> TriangleMesh {
    mesh.indices.iter_mut().for_each(|t| t.swap(0, 1));
    mesh
}

fn joined(meshes: &[TriangleMesh]) -> TriangleMesh {
    let mut all = TriangleMesh::default();
    for mesh in meshes {
        let first = all.positions.len() as u32;
        all.positions.extend(&mesh.positions);
        all.indices.extend(mesh.indices.iter().map(|t| t.map(|i| i + first)));
    }
    all
}

fn ball(x: f32, radius: f32) -> TriangleMesh {
    sphere_mesh(Vec3::X * x, radius, 20, 20)
}

/// A square sheet at this height, with its normals upwards.
fn sheet(z: f32, half: f32) -> TriangleMesh {
    let at = |x, y| Vec3::new(x * half, y * half, z);
    TriangleMesh {
        positions: vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }
}

fn cube(min: Vec3, max: Vec3) -> TriangleMesh {
    let shape = BoxShape { min: min.as_dvec3(), max: max.as_dvec3() };
    shape.tessellate(3).unwrap_or_default()
}

/// Where a point of the x axis is, by every precision.
fn inside_at(meshes: &[TriangleMesh], x: f32) -> bool {
    let mut builder = WorldBuilder::default();
    let mut doubles = crate::DWorldBuilder::default();
    for mesh in meshes {
        builder.add_mesh(ROOT, Arc::new(mesh.clone()));
        doubles.add_mesh(ROOT, Arc::new(mesh.into()));
    }
    let world = default_world(builder);
    let double = doubles.build(&crate::BuildOptions::default()).unwrap();
    let point = Vec3::new(x, 0.01, 0.02);
    let (inside, mut other) = (is_inside(&world, point), [false]);
    double.occupancy(&[point.as_dvec3()], &mut other);
    assert_eq!(inside, other[0], "{x}");
    assert_eq!(signed_distance(&world, point) < 0.0, inside, "{x}");
    inside
}

#[test]
fn bodies_in_one_mesh_make_cavities_and_unions() {
    let places = [0.0, 1.5, 3.0];
    let at = |meshes: &[TriangleMesh]| places.map(|x| inside_at(meshes, x));
    let hollow = joined(&[ball(0.0, 2.0), turned(ball(0.0, 1.0))]);
    assert_eq!(at(std::slice::from_ref(&hollow)), [false, true, false]);
    assert_eq!(at(&[turned(hollow.clone())]), [false, true, false], "inside out");
    let filled = joined(&[hollow, turned(ball(0.0, 0.5))]);
    assert_eq!(at(&[filled]), [true, true, false], "a ball in the cavity, inside out");
    assert_eq!(at(&[joined(&[ball(0.0, 2.0), ball(0.0, 1.0)])]), [true, true, false]);
    let overlap = [ball(0.5, 2.0), ball(2.5, 2.0)];
    for turn in 0..4 {
        let turn_each = |i: usize| {
            if turn >> i & 1 == 1 { turned(overlap[i].clone()) } else { overlap[i].clone() }
        };
        let both = [turn_each(0), turn_each(1)];
        assert_eq!(at(&[joined(&both)]), [true; 3], "one mesh, {turn}");
        assert_eq!(at(&both), [true; 3], "two meshes, {turn}");
    }
    // Meshes do not make cavities in each other.
    assert_eq!(at(&[ball(0.0, 2.0), turned(ball(0.0, 1.0))]), [true, true, false]);
}

#[test]
fn a_body_is_not_inside_because_of_what_is_around_or_below_it() {
    let solid = cube(Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 2.0));
    let (floor, carpet) = (sheet(-0.1, 50.0), sheet(-0.05, 40.0));
    let at = |world: &World, z| is_inside(world, Vec3::new(0.1, 0.2, z));
    let check = |world: &World, what: &str| {
        let found = [1.0, 0.0, 2.0, 3.0, -0.07, -1.0].map(|z| at(world, z));
        assert_eq!(found, [true, true, true, false, false, false], "{what}");
    };
    for solid in [solid.clone(), turned(solid)] {
        let mut builder = WorldBuilder::default();
        builder.add_mesh(ROOT, Arc::new(solid.clone()));
        let below = Transform::translation(DVec3::new(0.0, 0.0, -3.0));
        builder.add_shape(ROOT, Arc::new(Plane {}), below);
        builder.add_shape(ROOT, Arc::new(Disk { radius: 90.0, inner_radius: 0.0 }), below);
        check(&default_world(builder), "plane");
        let mut builder = WorldBuilder::default();
        for mesh in [&solid, &floor, &carpet] {
            builder.add_mesh(ROOT, Arc::new(mesh.clone()));
        }
        check(&default_world(builder), "meshes");
        check(&mesh_world(joined(&[solid, floor.clone(), carpet.clone()])), "one mesh");
    }
}

#[test]
fn a_floor_that_shares_edges_with_a_box_leaves_it_closed() {
    let mut mesh = cube(Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 2.0));
    // A ring of triangles round the foot of the box.
    let ring = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    for i in 0..4 {
        let (a, b) = (ring[i], ring[(i + 1) % 4]);
        let first = mesh.positions.len() as u32;
        let at = |[x, y]: [f32; 2], by: f32| Vec3::new(x * by, y * by, 0.0);
        mesh.positions.extend([at(a, 1.0), at(a, 9.0), at(b, 9.0), at(b, 1.0)]);
        mesh.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    let world = mesh_world(mesh);
    let at = |x: f32, z: f32| is_inside(&world, Vec3::new(x, 0.3, z));
    assert!(at(0.0, 1.0) && at(0.0, 0.0) && !at(0.0, -0.1) && !at(4.0, -0.1) && !at(4.0, 0.1));
}

#[test]
fn faces_of_a_solid_that_are_not_joined_bound_it_together() {
    let mut mesh = ball(0.0, 1.0);
    let mut loose = TriangleMesh::default();
    for (i, t) in std::mem::take(&mut mesh.indices).into_iter().enumerate() {
        // Gaps of a thousandth.
        let by = Vec3::splat(1e-3 * (i % 3) as f32);
        let first = loose.positions.len() as u32;
        loose.positions.extend(t.map(|i| mesh.positions[i as usize] + by));
        loose.indices.push([first, first + 1, first + 2]);
    }
    for mesh in [loose.clone(), turned(loose)] {
        let world = mesh_world(mesh);
        let at = |x: f32| is_inside(&world, Vec3::new(x, 0.01, 0.02));
        assert!(at(0.0) && at(0.9) && !at(1.1) && !at(-3.0));
    }
}

#[test]
fn points_on_a_surface_are_inside() {
    let step = |i: i32| f64::from(i) * 0.05;
    let top = DVec3::splat(0.3);
    let shape = BoxShape { min: DVec3::ZERO, max: top };
    let mut mesh = crate::DTriangleMesh::from(&cube(Vec3::ZERO, Vec3::ONE));
    mesh.positions.iter_mut().for_each(|p| *p *= top);
    let (mut meshes, mut shapes) =
        (crate::DWorldBuilder::default(), crate::DWorldBuilder::default());
    meshes.add_mesh(ROOT, Arc::new(mesh));
    shapes.add_shape(ROOT, Arc::new(shape), Transform::IDENTITY);
    for builder in [meshes, shapes] {
        let world = builder.build(&crate::BuildOptions::default()).unwrap();
        for axis in 0..3 {
            for (i, j) in (0..=6).flat_map(|i| (0..=6).map(move |j| (i, j))) {
                for side in [0.0, 0.3] {
                    let mut point = DVec3::ZERO;
                    (point[axis], point[(axis + 1) % 3], point[(axis + 2) % 3]) =
                        (side, step(i).min(0.3), step(j).min(0.3));
                    for method in [InsideMethod::Auto, InsideMethod::Parity, InsideMethod::Winding]
                    {
                        let points = [point];
                        let points = Points { method, ..Points::of_doubles(&points) };
                        let (mut inside, mut distance) = ([false], [f64::NAN]);
                        world.occupancy(points, &mut inside);
                        world.signed_distance(points, &mut distance);
                        assert!(inside[0], "{point} {method:?}");
                        assert_eq!(distance[0], 0.0, "{point} {method:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn methods_and_masks_choose_what_counts() {
    let mut builder = WorldBuilder::default();
    let solid = builder.add_mesh(ROOT, Arc::new(cube(Vec3::splat(-1.0), Vec3::ONE)));
    let floor = builder.add_mesh(ROOT, Arc::new(sheet(-3.0, 100.0)));
    builder.set_mask(solid, 1);
    builder.set_mask(floor, 2);
    let world = default_world(builder);
    let points = [Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.1, 0.2, -5.0)];
    let ask = |method, mask| {
        let points = Points { method, mask, ..Points::new(&points) };
        let (mut inside, mut signed) = ([false; 2], [0.0; 2]);
        world.occupancy(points, &mut inside);
        world.signed_distance(points, &mut signed);
        assert_eq!(signed.map(|d| d < 0.0), inside, "{method:?} {mask}");
        inside
    };
    use InsideMethod::{Auto, Parity, Winding};
    assert_eq!([1, 2, 3, 4].map(|m| ask(Auto, m)[0]), [true, false, true, false]);
    assert_eq!([1, 2, 3, 4].map(|m| ask(Auto, m)[1]), [false; 4]);
    // A ray upwards from below the floor hits the floor.
    assert_eq!([1, 2, 3, 4].map(|m| ask(Parity, m)[1]), [false, true, true, false]);
    assert_eq!([1, 2, 3, 4].map(|m| ask(Winding, m)[0]), [true, false, true, false]);
    let mut numbers = [0.0; 2];
    for (mask, expected) in [(1, [1.0, 0.0]), (2, [-0.48, 0.48]), (3, [0.52, 0.48]), (4, [0.0; 2])]
    {
        world.winding_number(Points { mask, ..Points::new(&points) }, &mut numbers);
        for (number, expected) in numbers.iter().zip(expected) {
            assert!((number - expected).abs() < 0.03, "{mask} {numbers:?}");
        }
    }
}

#[test]
fn instances_keep_their_insides_under_any_map() {
    let mut random = Random(31);
    let mut builder = WorldBuilder::default();
    let (middle, inner) = (builder.add_group(), builder.add_group());
    let part = turned(joined(&[ball(0.0, 1.0), turned(ball(0.0, 0.5))]));
    builder.add_mesh(inner, Arc::new(part));
    let placements: Vec<Transform> = (0..4).map(|_| random.transform(2.0)).collect();
    builder.add_instance(middle, inner, placements[0]);
    builder.add_instance(middle, inner, placements[1]);
    builder.add_instance(ROOT, middle, placements[2]);
    builder.add_instance(ROOT, middle, placements[3]);
    let world = default_world(builder);
    let mut counts = [0; 2];
    for i in 0..1000 {
        let place = placements[2 + i % 2].compose(&placements[i / 2 % 2]);
        let near = random.direction() * random.range(0.0, 1.5);
        let point = place.point(near.as_dvec3()).as_vec3();
        let mut expected = Some(false);
        for outer in &placements[2..] {
            for below in &placements[..2] {
                let r = outer.compose(below).inverse().point(point.as_dvec3()).length();
                // The meshes are not quite round.
                let clear = !(0.47..0.5).contains(&r) && !(0.96..1.0).contains(&r);
                let inside = (0.5..1.0).contains(&r);
                expected = expected.filter(|_| clear).map(|e| e || inside);
            }
        }
        if let Some(expected) = expected {
            assert_eq!(is_inside(&world, point), expected, "{point}");
            counts[usize::from(expected)] += 1;
        }
    }
    assert!(counts[0] > 50 && counts[1] > 50, "{counts:?}");
}

#[test]
fn bodies_of_any_size_and_place_have_insides() {
    for size in [1e-110, 1e-30, 1.0, 1e30, 1e155] {
        for shift in [0.0, 3e5] {
            let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|c| (c + shift) * size);
            let mesh = crate::DTriangleMesh {
                positions: corners.to_vec(),
                indices: vec![[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]],
            };
            let mut builder = crate::DWorldBuilder::default();
            builder.add_mesh(ROOT, Arc::new(mesh));
            let world = builder.build(&crate::BuildOptions::default()).unwrap();
            let middle = (DVec3::splat(0.25) + shift) * size;
            let points = [middle, middle + 0.5 * size, middle - 0.5 * size];
            let mut inside = [false; 3];
            world.occupancy(&points, &mut inside);
            assert_eq!(inside, [true, false, false], "{size:e} {shift}");
        }
    }
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
