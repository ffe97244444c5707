//! Tests of worlds in double precision: structures and SIMD levels agree, closed meshes in a city
//! have no holes, and the results agree with those of worlds in single precision where both apply.

use super::*;
use crate::hit::{DHit, DNearestPoint, Hit};
use crate::precision::Double;
use crate::search::points::Points;
use crate::search::rays::Rays;
use crate::search::{AcceptAll, Grouping, HitFilter};
use crate::shape::nearest::on_triangle;
use crate::shape::{AnyShape, Metric};
use crate::world::AcceleratorKind;
use crate::world::tests::{Random, double_sphere, levels, scaling, soup};
use snell_math::simd::Level;
use snell_math::{DRay, DVec3, Ray};

/// A point in the middle of a city, in metres (UTM).
const CITY: DVec3 = DVec3::new(500_000.123, 4_649_776.22, 300.0);

fn build(builder: DWorldBuilder, accelerator: AcceleratorKind, simd: Level) -> DWorld {
    let options = BuildOptions { accelerator, simd, ..BuildOptions::default() };
    builder.build(&options).expect("a world")
}

fn bits(hit: &DHit) -> [u64; 6] {
    let ids = [hit.instance, hit.geometry, hit.primitive].map(u64::from);
    [hit.t.to_bits(), hit.uv.x.to_bits(), hit.uv.y.to_bits(), ids[0], ids[1], ids[2]]
}

fn double_soup(random: &mut Random, triangles: usize, center: DVec3, size: f64) -> DTriangleMesh {
    let mut mesh = DTriangleMesh::from(&soup(random, triangles));
    mesh.positions.iter_mut().for_each(|p| *p = *p * size + center);
    mesh
}

/// A scene of groups nested three deep, far from the origin, with duplicated meshes, shapes and
/// instances; some geometries are masked and some filtered.
fn nested_scene(seed: u32, center: DVec3, size: f64) -> DWorldBuilder {
    let mut random = Random(snell_math::rng::hash32(seed));
    let mut builder = DWorldBuilder::default();
    let mut group = DWorldBuilder::ROOT;
    let mut middle = center;
    for level in 0..3 {
        let mesh = Arc::new(double_soup(&mut random, 60, middle, size));
        let first = builder.add_mesh(group, mesh.clone());
        builder.add_mesh(group, mesh);
        builder.set_mask(first, 5);
        for _ in 0..2 {
            let shapes = AnyShape::examples();
            let shape = shapes[(random.unit() * shapes.len() as f32) as usize].clone();
            let extent = shape.bounds().size().max_element();
            let factor = if extent.is_finite() { 0.7 * size / extent } else { size };
            let placed = random.transform(2.0).compose(&scaling(factor));
            let placed = Transform::translation(middle).compose(&placed);
            let shape = builder.add_shape(group, Arc::new(shape), placed);
            if random.unit() < 0.3 {
                builder.set_filtered(shape);
            }
        }
        if level < 2 {
            let child = builder.add_group();
            // The child's contents are centred elsewhere.
            let other = middle * 0.5 + DVec3::splat(size);
            for i in 0..3 {
                let placed = Transform::translation(middle).compose(&random.transform(2.0));
                let group_from_child = placed.compose(&Transform::translation(-other));
                let mask = if i == 0 { 3 } else { u64::MAX };
                builder.add(group, Instance { mask, ..Instance::new(child, group_from_child) });
            }
            (group, middle) = (child, other);
        }
    }
    builder
}

fn rays_into(random: &mut Random, center: DVec3, size: f64, n: usize) -> Vec<DRay> {
    let ray = |random: &mut Random| {
        let origin = center + random.point(4.0).as_dvec3() * size;
        let target = center + random.point(1.5).as_dvec3() * size;
        let ray = DRay::new(origin, (target - origin) * f64::from(random.unit() + 0.01));
        if random.unit() < 0.2 { DRay { t_min: 0.5, ..ray.with_t_max(2.0) } } else { ray }
    };
    (0..n).map(|_| ray(random)).collect()
}

/// Rejects every other face.
struct Odd;

impl HitFilter<Double> for Odd {
    fn accept(&self, _: &DRay, hit: &DHit) -> bool {
        hit.primitive % 2 == 1
    }
}

#[test]
fn every_structure_and_level_gives_the_same_hits_bit_for_bit() {
    let (mut hits, mut rays_traced) = (0, 0);
    for (seed, center, size) in [
        (1, CITY, 1.0),
        (2, CITY, 1e-3),
        (3, DVec3::ZERO, 1.0),
        (4, CITY * 1e30, 1e32),
        (5, DVec3::splat(1e-90), 1e-89),
    ] {
        let mut random = Random(seed);
        let rays = rays_into(&mut random, center, size, 300);
        let masks: Vec<u64> =
            (0..rays.len() as u32).map(|i| [u64::MAX, 2, 4, 8][i as usize % 4]).collect();
        let batch = Rays::<Double>::new(&rays).with_masks(&masks);
        let oracle = build(nested_scene(seed, center, size), AcceleratorKind::None, Level::Scalar);
        let mut expected = vec![DHit::MISS; rays.len()];
        oracle.closest(batch, Grouping::None, &Odd, &mut expected);
        let others = AcceleratorKind::ALL.into_iter().map(|kind| (kind, Level::best()));
        for (kind, level) in levels().map(|level| (AcceleratorKind::Bvh, level)).chain(others) {
            let world = build(nested_scene(seed, center, size), kind, level);
            assert_eq!(
                (world.bounds(), world.stats().triangles),
                (oracle.bounds(), oracle.stats().triangles)
            );
            let mut found = vec![DHit::MISS; rays.len()];
            let mut blocked = vec![false; rays.len()];
            world.closest(batch, Grouping::None, &Odd, &mut found);
            world.occluded(batch, Grouping::None, &Odd, &mut blocked);
            let mut together = vec![DHit::MISS; rays.len()];
            world.closest(batch, Grouping::Coherent, &Odd, &mut together);
            assert!(
                together.iter().zip(&found).all(|(a, b)| bits(a) == bits(b)),
                "{kind:?} {level}"
            );
            let checked = if kind == AcceleratorKind::Bvh { rays.len() } else { 60 };
            for i in 0..checked {
                let (ray, expected) = (batch.get(i), &expected[i]);
                assert_eq!(bits(&found[i]), bits(expected), "{kind:?} {level} {:?}", rays[i]);
                assert_eq!(bits(&world.closest_one(ray, &Odd)), bits(expected));
                assert_eq!(bits(&world.closest_counted(ray, &Odd).0), bits(expected));
                assert_eq!(
                    (blocked[i], world.occluded_one(ray, &Odd)),
                    (expected.is_hit(), expected.is_hit())
                );
                let all =
                    |world: &DWorld| world.all_one(ray, &Odd).iter().map(bits).collect::<Vec<_>>();
                assert_eq!(all(&world), all(&oracle));
            }
        }
        hits += expected.iter().filter(|h| h.is_hit()).count();
        rays_traced += rays.len();
    }
    assert!(hits > rays_traced / 3 && hits < rays_traced, "{hits} of {rays_traced}");
}

/// Traces rays from inside a closed mesh to its vertices, edges and random points. Returns the
/// numbers of misses and of rays that do not have exactly one hit.
fn leaks(
    mesh: &Arc<DTriangleMesh>,
    closed: &DTriangleMesh,
    center: DVec3,
    radius: f64,
    step: usize,
) -> (usize, usize, usize) {
    let mut builder = DWorldBuilder::default();
    builder.add_mesh(DWorldBuilder::ROOT, mesh.clone());
    let world = build(builder, AcceleratorKind::Bvh, Level::best());
    let mut random = Random(7);
    let mut rays = Vec::new();
    for triangle in (0..closed.indices.len()).step_by(step) {
        let [a, b, c] = closed.corners(triangle);
        for target in [a, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5, a + (b - a) * 0.25] {
            let origin = center + random.point(0.5).as_dvec3() * radius;
            rays.push(DRay::new(origin, target - origin).with_t_max(2.0));
        }
        rays.push(DRay::new(center, random.direction().as_dvec3() * radius).with_t_max(2.0));
    }
    let mut hits = vec![DHit::MISS; rays.len()];
    world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    let misses = hits.iter().filter(|h| !h.is_hit()).count();
    let wrong = rays.iter().filter(|ray| world.all_one(*ray, &AcceptAll).len() != 1).count();
    (rays.len(), misses, wrong)
}

#[test]
fn rays_inside_a_closed_mesh_in_a_city_hit_it_exactly_once() {
    // A sphere of radius 1 m, and one of 5 cm whose triangles have the size of a millimetre.
    for (radius, rings, segments) in [(1.0, 100, 200), (0.05, 150, 300)] {
        let mesh = Arc::new(double_sphere(CITY, radius, rings, segments));
        let (rays, misses, wrong) = leaks(&mesh, &mesh, CITY, radius, 2);
        assert_eq!((misses, wrong), (0, 0), "of {rays} rays, radius {radius}");
    }
}

#[test]
fn closed_meshes_of_any_size_and_place_hold_their_rays() {
    for (center, radius) in [
        (DVec3::ZERO, 2.0),
        (CITY, 1e-6),
        (CITY * 1e6, 3.0),
        (DVec3::ZERO, 1e-150),
        (CITY * 1e100, 1e106),
    ] {
        let mesh = Arc::new(double_sphere(center, radius, 20, 40));
        let (rays, misses, wrong) = leaks(&mesh, &mesh, center, radius, 1);
        assert_eq!((misses, wrong), (0, 0), "of {rays} rays at {center}, radius {radius}");
    }
}

#[test]
fn details_of_a_millimetre_stay_closed_in_a_mesh_of_ten_kilometres() {
    // A small sphere in a corner of the city.
    let corner = CITY + DVec3::new(5000.0, 5000.0, 100.0);
    let bead = double_sphere(corner, 0.05, 150, 300);
    let mut mesh = bead.clone();
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([
        CITY - 5000.0,
        CITY + DVec3::new(-4990.0, -5000.0, 0.0),
        CITY - DVec3::Z * 10.0,
    ]);
    mesh.indices.push([first, first + 1, first + 2]);
    let (rays, misses, wrong) = leaks(&Arc::new(mesh), &bead, corner, 0.05, 3);
    assert_eq!((misses, wrong), (0, 0), "of {rays} rays");
}

#[test]
fn single_precision_sees_the_same_triangles_as_far_as_it_can_see() {
    let mesh = Arc::new(soup(&mut Random(3), 400));
    let mut single = WorldBuilder::default();
    single.add_mesh(WorldBuilder::ROOT, mesh.clone());
    let single = single.build(&BuildOptions::default()).expect("a world");
    let mut double = DWorldBuilder::default();
    double.add_mesh(DWorldBuilder::ROOT, Arc::new(DTriangleMesh::from(mesh.as_ref())));
    let double = build(double, AcceleratorKind::Bvh, Level::best());
    let mut random = Random(11);
    let (mut hits, mut differ) = (0, 0);
    for _ in 0..20_000 {
        let origin = random.point(4.0);
        let ray = Ray::new(origin, random.point(2.0) - origin);
        let (a, b) = (
            single.closest_one(&ray, &AcceptAll),
            double.closest_one(&DRay::from(&ray), &AcceptAll),
        );
        if (a.geometry, a.primitive) != (b.geometry, b.primitive) {
            // The ray hits an edge of the meshes rounded to `f32`.
            differ += 1;
        } else if a.is_hit() {
            hits += 1;
            assert!((f64::from(a.t) - b.t).abs() <= b.t * f64::from(f32::EPSILON), "{a:?} {b:?}");
            assert!((a.uv.as_dvec2() - b.uv).abs().max_element() < 1e-2, "{a:?} {b:?}");
        }
    }
    assert!(hits > 5_000 && differ < 10, "{hits} hits, {differ} differ");
}

#[test]
fn invalid_and_extreme_rays_end_in_an_answer() {
    let mut builder = DWorldBuilder::default();
    let mut mesh = double_sphere(CITY, 1.0, 8, 16);
    let first = mesh.positions.len() as u32;
    mesh.positions.extend([DVec3::NAN, DVec3::splat(f64::INFINITY), CITY, CITY]);
    mesh.indices.extend([[0, 1, first], [0, first + 1, 2], [first + 2, first + 3, 1]]);
    builder.add_mesh(DWorldBuilder::ROOT, Arc::new(mesh));
    let oracle = build(builder, AcceleratorKind::None, Level::Scalar);
    assert_eq!(oracle.stats().skipped_triangles, 3);
    let numbers =
        [0.0, -0.0, 1.0, 5e-324, 1e-300, -1e300, f64::MAX, f64::INFINITY, f64::NAN, 500_000.0];
    let mut mesh = double_sphere(CITY, 1.0, 8, 16);
    mesh.positions.push(CITY);
    let mut builder = DWorldBuilder::default();
    builder.add_mesh(DWorldBuilder::ROOT, Arc::new(mesh));
    let world = build(builder, AcceleratorKind::Bvh, Level::best());
    let mut rays = Vec::new();
    for (i, &x) in numbers.iter().enumerate() {
        for (j, &y) in numbers.iter().enumerate() {
            for (k, &z) in numbers.iter().enumerate() {
                let other = |n: usize| numbers[(i + 3 * j + 7 * k + n) % numbers.len()];
                let (position, direction) =
                    (DVec3::new(x, y, z), DVec3::new(other(1), other(2), other(4)));
                rays.push(DRay::new(position, direction));
                rays.push(DRay {
                    t_min: other(3),
                    t_max: other(5),
                    ..DRay::new(CITY + position, direction)
                });
                rays.push(DRay { t_min: -1e300, ..DRay::new(CITY, direction) });
            }
        }
    }
    let mut hits = vec![DHit::MISS; rays.len()];
    world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    let mut found = 0;
    for (ray, hit) in rays.iter().zip(&hits) {
        assert_eq!(bits(hit), bits(&oracle.closest_one(ray, &AcceptAll)), "{ray:?}");
        assert!(
            !hit.t.is_nan() && (!hit.is_hit() || ray.is_valid() && ray.contains(hit.t)),
            "{ray:?} {hit:?}"
        );
        found += usize::from(hit.is_hit());
    }
    assert!(found > 100, "{found}");
    assert_eq!(hits.iter().filter(|h| h.geometry == Hit::NONE).count(), hits.len() - found);
}

#[test]
fn rays_that_belong_together_hit_what_they_hit_alone() {
    for (far, radius) in [(3.0, 1.0), (200.0, 1.0), (3.0, 1e-3)] {
        let mut builder = DWorldBuilder::default();
        let child = builder.add_group();
        let other = CITY * 0.5;
        builder.add_mesh(DWorldBuilder::ROOT, Arc::new(double_sphere(CITY, radius, 100, 200)));
        builder.add_mesh(child, Arc::new(double_sphere(other, radius, 100, 200)));
        let placed = Transform::translation(CITY + DVec3::X * 1.5 * radius - other);
        builder.add_instance(DWorldBuilder::ROOT, child, placed);
        let world = build(builder, AcceleratorKind::Bvh, Level::best());
        let eye = CITY + DVec3::new(0.3, 0.4, 1.0).normalize() * far * radius;
        let light = CITY + DVec3::new(3.0, 1.0, 2.0) * radius;
        let pixels = (0..64 * 64)
            .map(|i| DVec3::new(f64::from(i % 64) - 31.7, f64::from(i / 64) - 31.4, 0.0) / 24.0);
        let rays: Vec<DRay> = pixels.map(|p| DRay::new(eye, CITY + p * radius - eye)).collect();
        let (mut alone, mut together) =
            (vec![DHit::MISS; rays.len()], vec![DHit::MISS; rays.len()]);
        world.closest(&rays, Grouping::None, &AcceptAll, &mut alone);
        world.closest(&rays, Grouping::Coherent, &AcceptAll, &mut together);
        assert!(alone.iter().zip(&together).all(|(a, b)| bits(a) == bits(b)));
        let hit: Vec<DVec3> =
            rays.iter().zip(&alone).filter(|(_, h)| h.is_hit()).map(|(r, h)| r.at(h.t)).collect();
        assert!(hit.len() > rays.len() / 4, "{}", hit.len());
        let shadows: Vec<DRay> =
            hit.iter().map(|&p| DRay::new(p, light - p).with_t_max(0.999)).collect();
        let (mut alone, mut together) = (vec![false; hit.len()], vec![false; hit.len()]);
        world.occluded(&shadows, Grouping::None, &AcceptAll, &mut alone);
        world.occluded(&shadows, Grouping::Coherent, &AcceptAll, &mut together);
        assert_eq!(alone, together);
        let mut counts = vec![0; rays.len()];
        world.count(&rays, &AcceptAll, &mut counts);
        let all = world.all(&rays, &AcceptAll);
        assert!(
            (0..rays.len())
                .all(|i| all.of_ray(i).len() == counts[i] as usize && counts[i].is_multiple_of(2))
        );
    }
}

#[test]
fn empty_worlds_are_missed() {
    let world = build(DWorldBuilder::default(), AcceleratorKind::Bvh, Level::best());
    assert!(!world.closest_one(&DRay::new(DVec3::ZERO, DVec3::X), &AcceptAll).is_hit());
    assert!(world.bounds().is_empty());
}

#[test]
fn nearest_points_are_those_of_looking_at_everything_bit_for_bit() {
    let mut found = std::collections::BTreeSet::new();
    for (seed, center, size) in
        [(1, CITY, 1.0), (2, CITY, 1e-3), (3, DVec3::ZERO, 1.0), (4, CITY * 1e12, 1e14)]
    {
        let mut random = Random(seed);
        let oracle = build(nested_scene(seed, center, size), AcceleratorKind::None, Level::Scalar);
        let world = build(nested_scene(seed, center, size), AcceleratorKind::Bvh, Level::best());
        let points: Vec<DVec3> = (0..100)
            .map(|i| center + random.point([0.5, 3.0, 50.0][i % 3]).as_dvec3() * size)
            .collect();
        let limits: Vec<f64> = (0..100).map(|i| [f64::INFINITY, 0.3, 2.0][i % 3] * size).collect();
        for mask in [u64::MAX, 2] {
            let query = Points { max_distances: &limits, mask, ..Points::of_doubles(&points) };
            let (mut near, mut expected) =
                (vec![DNearestPoint::NONE; 100], vec![DNearestPoint::NONE; 100]);
            world.nearest_point(query, &mut near);
            oracle.nearest_point(query, &mut expected);
            assert_eq!(near, expected, "{seed} {mask}");
            found.extend(near.iter().map(|near| near.instance));
        }
    }
    assert!(found.len() > 6, "{found:?}");
}

#[test]
fn points_around_a_ball_of_a_millimetre_in_a_city_know_how_far_it_is_and_which_side_they_are_on() {
    let (radius, center) = (1e-3, CITY);
    let mesh = Arc::new(double_sphere(center, radius, 40, 80));
    let mut builder = DWorldBuilder::default();
    builder.add_mesh(DWorldBuilder::ROOT, mesh.clone());
    let world = build(builder, AcceleratorKind::Bvh, Level::best());
    let mut random = Random(3);
    let points: Vec<DVec3> = (0..60)
        .map(|i| center + random.direction().as_dvec3() * radius * [0.1, 0.98, 1.02, 40.0][i % 4])
        .collect();
    let (mut distances, mut numbers) = (vec![0.0; 60], vec![0.0; 60]);
    let (mut near, mut inside) = (vec![DNearestPoint::NONE; 60], vec![false; 60]);
    world.signed_distance(&points, &mut distances);
    world.winding_number(&points, &mut numbers);
    world.occupancy(&points, &mut inside);
    world.nearest_point(&points, &mut near);
    for (i, &point) in points.iter().enumerate() {
        let on = |t| on_triangle(&Metric::EUCLIDEAN, point, &mesh.corners(t)).0;
        let triangles = (0..mesh.indices.len()).filter(|&t| !mesh.is_degenerate(t));
        let least = triangles.map(|t| on(t).distance(point)).fold(f64::INFINITY, f64::min);
        let is_inside = i % 4 < 2;
        // A unit in the last place of the coordinates is about a nanometre.
        assert!((distances[i].abs() - least).abs() < 1e-12, "{point}: {} {least}", distances[i]);
        assert!((near[i].position.distance(point) - near[i].distance).abs() < 3e-9);
        assert_eq!((distances[i] < 0.0, inside[i]), (is_inside, is_inside), "{point}");
        assert!(
            (numbers[i] - f64::from(u8::from(is_inside))).abs() < 0.1,
            "{} at {point}",
            numbers[i]
        );
        let exact = world.winding_number_exact(point);
        assert!((exact - f64::from(u8::from(is_inside))).abs() < 1e-6, "{exact} at {point}");
    }
}

#[test]
fn packets_of_rays_hold_a_closed_mesh_in_a_city() {
    for (radius, rings, segments) in [(1.0, 100, 200), (0.05, 150, 300)] {
        let mesh = Arc::new(double_sphere(CITY, radius, rings, segments));
        let mut builder = DWorldBuilder::default();
        builder.add_mesh(DWorldBuilder::ROOT, mesh.clone());
        let world = build(builder, AcceleratorKind::Bvh, Level::best());
        let origin = CITY + DVec3::new(0.1, 0.2, -0.1) * radius;
        // Neighbours share vertices and edges, from one point; and back to it.
        let targets = (0..mesh.indices.len()).flat_map(|t| {
            let [a, b, c] = mesh.corners(t);
            [a, (a + b) * 0.5, (b + c) * 0.5, a + (b - a) * 0.25]
        });
        let out: Vec<DRay> = targets
            .map(|target| DRay::new(origin, (target - origin) * 0.5).with_t_max(4.0))
            .collect();
        let back: Vec<DRay> = out
            .iter()
            .map(|ray| {
                DRay::new(origin + ray.direction * 3.0, ray.direction * -3.0).with_t_max(1.0)
            })
            .collect();
        for rays in [&out, &back] {
            let (mut together, mut alone) =
                (vec![DHit::MISS; rays.len()], vec![DHit::MISS; rays.len()]);
            let mut blocked = vec![false; rays.len()];
            world.closest(rays, Grouping::Coherent, &AcceptAll, &mut together);
            world.closest(rays, Grouping::None, &AcceptAll, &mut alone);
            world.occluded(rays, Grouping::Coherent, &AcceptAll, &mut blocked);
            assert!(together.iter().all(DHit::is_hit) && blocked.iter().all(|&blocked| blocked));
            assert!(together.iter().zip(&alone).all(|(a, b)| bits(a) == bits(b)));
        }
    }
}

#[test]
fn what_did_not_change_is_kept_what_moved_is_refitted_and_hits_are_those_of_a_new_world() {
    let options = BuildOptions::default();
    let mut builder = DWorldBuilder::default();
    let house = builder.add_group();
    let still = Arc::new(double_sphere(CITY, 1.0, 30, 60));
    builder.add_mesh(house, still.clone());
    let moving = builder.add_mesh(DWorldBuilder::ROOT, Arc::new(double_sphere(CITY, 0.5, 30, 60)));
    let placed =
        builder.add_instance(DWorldBuilder::ROOT, house, Transform::translation(DVec3::X * 3.0));
    let mut world = builder.clone().build(&options).expect("a world");
    let mut random = Random(11);
    let rays = rays_into(&mut random, CITY, 0.5, 400);
    for step in 1..4 {
        let mut mesh = double_sphere(CITY + DVec3::splat(0.01 * f64::from(step)), 0.5, 30, 60);
        mesh.positions.iter_mut().for_each(|p| p.z += 0.1 * (p.x - CITY.x));
        builder.set_mesh(moving, Arc::new(mesh)).expect("a mesh");
        builder.move_instance(
            placed,
            Transform::translation(DVec3::X * (3.0 - 0.1 * f64::from(step))),
        );
        let next = builder.rebuild(&options, &world).expect("a world");
        let reuse = next.stats().reuse;
        assert_eq!((reuse.kept, reuse.refitted, reuse.built), (1, 1, 0), "{step}");
        assert!(
            Arc::ptr_eq(&next.data.corners_of(0), &world.data.corners_of(0)),
            "corners are shared"
        );
        let new = builder.clone().build(&options).expect("a world");
        let (mut hits, mut expected) = (vec![DHit::MISS; rays.len()], vec![DHit::MISS; rays.len()]);
        next.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
        new.closest(&rays, Grouping::None, &AcceptAll, &mut expected);
        assert!(hits.iter().zip(&expected).all(|(a, b)| bits(a) == bits(b)), "{step}");
        assert!(expected.iter().filter(|hit| hit.is_hit()).count() > 50);
        world = next;
    }
    assert!(builder.remove(moving) && builder.remove_instance(placed));
    let empty = builder.rebuild(&options, &world).expect("a world");
    assert!(rays.iter().all(|ray| !empty.closest_one(ray, &AcceptAll).is_hit()));
}

#[test]
fn moving_instances_are_hit_where_they_are_at_that_time() {
    let mut random = Random(11);
    let mesh = Arc::new(double_soup(&mut random, 2000, DVec3::ZERO, 1.0));
    let keys: Vec<Transform> = (0..3)
        .map(|i| Transform::translation(CITY + DVec3::X * f64::from(i)))
        .map(|there| there.compose(&random.transform(0.5)))
        .collect();
    for times in [vec![], vec![0.1, 0.3, 0.8]] {
        let place = |at: Option<f32>| {
            let mut builder = DWorldBuilder::default();
            let child = builder.add_group();
            builder.add_mesh(child, mesh.clone());
            let moving = Instance {
                later: keys[1..].to_vec(),
                times: times.clone(),
                ..Instance::new(child, keys[0])
            };
            let placed = at.map(|time| moving.at_time(time).expect("not singular"));
            builder.add(
                DWorldBuilder::ROOT,
                placed.map_or(moving, |placed| Instance::new(child, placed)),
            );
            builder
        };
        let rays = rays_into(&mut random, CITY, 1.0, 300);
        let shared: Vec<f32> = (0..6).map(|_| random.range(-0.1, 1.1)).collect();
        let of_ray: Vec<f32> = (0..rays.len()).map(|i| shared[i % shared.len()]).collect();
        let expected: Vec<DHit> = {
            let still: Vec<DWorld> = shared
                .iter()
                .map(|&time| {
                    let builder = place(Some(time.clamp(0.0, 1.0)));
                    build(builder, AcceleratorKind::None, Level::Scalar)
                })
                .collect();
            let ask = |(i, ray): (usize, &DRay)| {
                let mut hit = [DHit::MISS];
                let rays = [*ray];
                still[i % shared.len()].closest(
                    Rays::<Double>::new(&rays),
                    Grouping::None,
                    &AcceptAll,
                    &mut hit,
                );
                hit[0]
            };
            rays.iter().enumerate().map(ask).collect()
        };
        let met = expected.iter().filter(|hit| hit.is_hit()).count();
        assert!(met > 20, "{met} rays hit");
        let others = AcceleratorKind::ALL.into_iter().map(|kind| (kind, Level::best()));
        for (kind, level) in levels().map(|level| (AcceleratorKind::Bvh, level)).chain(others) {
            let world = build(place(None), kind, level);
            for grouping in [Grouping::None, Grouping::Coherent] {
                let mut found = vec![DHit::MISS; rays.len()];
                let batch = Rays::<Double>::new(&rays).with_times(&of_ray);
                world.closest(batch, grouping, &AcceptAll, &mut found);
                for (a, b) in found.iter().zip(&expected) {
                    assert_eq!(bits(a), bits(b), "{kind:?} at {level:?}");
                }
            }
            let there = world.world_from_instance_at(1, times.get(1).copied().unwrap_or(0.5));
            assert_eq!(there, keys[1]);
        }
    }
}
