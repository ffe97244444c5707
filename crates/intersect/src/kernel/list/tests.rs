use super::Hits;
use super::packet::{ListPacket, RAYS};
use crate::hit::Hit;
use crate::lecture::box_ray::BoxRay;
use crate::mesh::TriangleMesh;
use crate::search::rays::Rays;
use crate::search::{AcceptAll, Grouping, HitFilter};
use crate::shape::{AnyShape, Cylinder, Disk, Plane, Rectangle, Sphere};
use crate::tree::list::List;
use crate::tree::list::faces::{Faces, Outline};
use crate::world::AcceleratorKind;
use crate::world::tests::{build, check, lattice_point, levels};
use crate::world::{GeometryId, Structure, World, WorldBuilder};
use proptest::prelude::*;
use snell_math::simd::{Level, PairDoubles, Portable, Portable8};
use snell_math::{Bounds3, DRay, DVec2, DVec3, Ray, Transform, Vec3, rng};
use std::sync::Arc;

pub(super) fn list_of(world: &World) -> Option<&List> {
    match &world.structure {
        Structure::Bvh(forest) => forest.list.as_deref(),
        _ => None,
    }
}

/// A point on the lattice of halves, so that rays often hit vertices, edges and planes; or
/// anywhere.
fn point() -> impl Strategy<Value = Vec3> {
    let halves = [-8i8..=8, -8i8..=8, -8i8..=8]
        .prop_map(|p| Vec3::from_array(p.map(|x| f32::from(x) * 0.5)));
    prop_oneof![halves, [-4.0f32..4.0, -4.0f32..4.0, -4.0f32..4.0].prop_map(Vec3::from_array)]
}

fn meshes() -> impl Strategy<Value = TriangleMesh> {
    let positions = proptest::collection::vec(lattice_point(), 3..30);
    let corners = proptest::collection::vec(proptest::array::uniform3(0u32..1000), 1..35);
    // Lists reject slivers, so most meshes have none.
    (positions, corners, proptest::bool::weighted(0.1)).prop_map(
        |(positions, corners, with_slivers)| {
            let n = positions.len() as u32;
            let mut indices: Vec<[u32; 3]> = corners.iter().map(|t| t.map(|i| i % n)).collect();
            let area = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
            indices
                .retain(|t| with_slivers || area(t.map(|i| positions[i as usize])) != Vec3::ZERO);
            indices.push([0, 1, 1]);
            TriangleMesh { positions, indices, ..TriangleMesh::default() }
        },
    )
}

/// A mesh of quads, each of two triangles.
pub(crate) fn quads(corners: &[[[f32; 3]; 4]]) -> Arc<TriangleMesh> {
    let positions = corners.iter().flatten().map(|&v| Vec3::from_array(v)).collect();
    let indices = (0..corners.len() as u32)
        .flat_map(|i| [[0, 1, 2], [2, 3, 0]].map(|t| t.map(|v| v + 4 * i)));
    Arc::new(TriangleMesh { positions, indices: indices.collect(), ..TriangleMesh::default() })
}

fn world_of(mesh: Arc<TriangleMesh>, accelerator: AcceleratorKind, level: Level) -> World {
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, mesh);
    build(builder, accelerator, level)
}

pub(super) struct Sieve;

impl HitFilter for Sieve {
    fn accept(&self, _: &Ray, hit: &Hit) -> bool {
        rng::hash32(hit.primitive ^ hit.geometry << 8) & 3 != 0
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn lists_hit_lattices_and_shapes_as_the_oracle_does(
        (first, second) in (meshes(), meshes()),
        lines in proptest::collection::vec((point(), point(), 0u32..5), 1..50),
        (spheres, plane, restricted) in (0usize..3, any::<bool>(), any::<bool>()),
        scale in prop_oneof![Just(0), -18i32..18],
        far in prop_oneof![Just(0.0f32), Just(0.0f32), Just(1000.0)],
    ) {
        let scale = 2.0f32.powi(scale);
        let moved = |p: Vec3| (p + Vec3::new(far, -far, far * 0.5)) * scale;
        let place = |mesh: &TriangleMesh| {
            let positions = mesh.positions.iter().map(|&p| moved(p)).collect();
            Arc::new(TriangleMesh { positions, ..mesh.clone() })
        };
        let make = |accelerator, simd| {
            let mut builder = WorldBuilder::default();
            builder.add_mesh(WorldBuilder::ROOT, place(&first));
            builder.add_mesh(WorldBuilder::ROOT, place(&second));
            for i in 0..spheres {
                let center = moved(Vec3::new(i as f32 * 2.0 - 3.0, 0.5, 0.25));
                let sphere = Sphere { radius: f64::from(scale) };
                let at = Transform::translation(center.as_dvec3());
                builder.add_shape(WorldBuilder::ROOT, Arc::new(sphere), at);
            }
            if plane {
                let at = Transform::translation(moved(Vec3::new(0.0, -2.25, 0.0)).as_dvec3());
                builder.add_shape(WorldBuilder::ROOT, Arc::new(AnyShape::from(Plane {})), at);
            }
            if restricted {
                builder.set_mask(GeometryId(1), 2);
                builder.set_filtered(GeometryId(1));
            }
            build(builder, accelerator, simd)
        };
        let rays: Vec<Ray> = lines.iter().map(|&(from, to, kind)| {
            let (from, to) = (moved(from), moved(to));
            match kind {
                0 => Ray::new(from, to - from).with_t_max(1.0),
                1 => Ray { t_min: -1.0, ..Ray::new(from, to - from) },
                2 => Ray::new(from, (to - from).normalize_or_zero()),
                3 => Ray::new(from + (from - to) * 7.0, to - from),
                _ => Ray { t_min: 0.25, ..Ray::new(from, to - from) },
            }
        }).collect();
        let mask = |i: usize| [u64::MAX, 1, 2, 0][i / 3 % 4];
        let masks: Vec<u64> = (0..rays.len()).map(mask).collect();
        let oracle = make(AcceleratorKind::None, Level::Scalar);
        for level in levels() {
            let world = make(AcceleratorKind::Bvh, level);
            check(&world, &oracle, Rays::from(&rays), &AcceptAll)?;
            check(&world, &oracle, Rays::from(&rays).with_masks(&masks), &Sieve)?;
        }
    }
}

#[test]
fn parallelograms_are_met_between_pairs_of_edges() {
    let are_strips = |corners: [[f32; 3]; 4]| {
        let world = world_of(quads(&[corners]), AcceleratorKind::Bvh, Level::Scalar);
        let list = list_of(&world).expect("a list");
        let mut outlines =
            list.faces.iter().flat_map(|faces| faces.across.iter().chain(&faces.tilted));
        let outline = outlines.next().map(|face| face.outline);
        matches!(outline, Some(Outline::Strips(..)))
    };
    let square = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
    assert!(are_strips(square));
    assert!(are_strips(square.map(|[x, y, z]| [x + 0.25 * y, y - 0.75 * x, z + x * 0.5 - y])));
    // The fourth corner is moved by a fraction of the length of an edge.
    for (moved, expected) in [(1e-7, true), (1e-5, false), (0.5, false)] {
        let [a, b, c, d] = square;
        assert_eq!(are_strips([a, b, c, [d[0], d[1] + moved, d[2]]]), expected, "{moved}");
    }
}

/// Heights above planes of coordinates that are not zero, but may underflow when multiplied.
#[test]
fn rays_at_tiny_coordinates_hit_what_the_oracle_hits() {
    let tiny = [0.0, -0.0, 1e-45, 1e-38, 1e-31, -1e-31, 1e-23, 1e-22, -2e-22, 1e-12];
    for level in tiny {
        let square =
            [[-1.0, -1.0, level], [1.0, -1.0, level], [1.0, 1.0, level], [-1.0, 1.0, level]];
        let wall = [[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]];
        let mut rays = Vec::new();
        for z in tiny {
            for scale in [1.0, 1e-11, 1e11, -1.0, -1e11] {
                rays.push(Ray::new(Vec3::new(0.25, 1e-30, z), Vec3::new(0.1, 0.2, 1.0) * scale));
                rays.push(Ray::new(Vec3::new(0.25, 0.5, z), Vec3::new(1.0, 0.2, 1e-4) * scale));
            }
        }
        let oracle = world_of(quads(&[square, wall]), AcceleratorKind::None, Level::Scalar);
        for simd in levels() {
            let world = world_of(quads(&[square, wall]), AcceleratorKind::Bvh, simd);
            assert!(list_of(&world).is_some());
            let same = check(&world, &oracle, Rays::from(&rays), &AcceptAll);
            assert!(same.is_ok(), "{simd} {level:e}: {same:?}");
        }
    }
}

#[test]
fn halves_of_flat_convex_quads_are_one_face() {
    let faces = |corners: &[[f32; 3]; 4]| {
        let world = world_of(quads(&[*corners]), AcceleratorKind::Bvh, Level::Scalar);
        let list = list_of(&world).expect("a list");
        let sum = |count: fn(&Faces) -> usize| list.faces.iter().map(count).sum::<usize>();
        [sum(|faces| faces.across.len()), sum(|faces| faces.tilted.len())]
    };
    let square = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [1.0, 1.0, 2.0], [0.0, 1.0, 2.0]];
    assert_eq!(faces(&square), [1, 0]);
    assert_eq!(faces(&square.map(|[x, y, z]| [x, y, z + x * 0.5 - y])), [0, 1]);
    // The quads are not flat, not convex, and folded over.
    assert_eq!(faces(&[square[0], square[1], square[2], [0.0, 1.0, 2.0 + 1e-6]]), [1, 1]);
    assert_eq!(faces(&[square[0], square[1], square[2], [0.75, 0.25, 2.0]]), [2, 0]);
    assert_eq!(faces(&[square[0], square[1], square[2], [1.0, -1.0, 2.0]]), [2, 0]);
}

/// A room with a slanted roof and a rotated block in it.
fn room() -> Arc<TriangleMesh> {
    let wall = |x: f32| [[x, 0.0, 0.0], [x, 0.0, 5.0], [x, 3.0, 5.0], [x, 4.0, 0.0]];
    quads(&[
        [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.0, 5.0], [0.0, 0.0, 5.0]],
        [[0.0, 4.0, 0.0], [4.0, 4.0, 0.0], [4.0, 3.0, 5.0], [0.0, 3.0, 5.0]],
        wall(0.0),
        wall(4.0),
        [[0.0, 0.0, 5.0], [4.0, 0.0, 5.0], [4.0, 3.0, 5.0], [0.0, 3.0, 5.0]],
        [[1.3, 0.0, 2.1], [2.2, 0.0, 3.3], [2.2, 1.4, 3.3], [1.3, 1.4, 2.1]],
        [[1.3, 1.4, 2.1], [2.2, 1.4, 3.3], [3.4, 1.4, 2.4], [2.5, 1.4, 1.2]],
    ])
}

/// Random rays that start inside the room, and rays that start at the hits of these.
fn rays_in_room(oracle: &World, count: u32) -> Vec<Ray> {
    let unit = |i: u32, k: u32| Vec3::from_slice(&rng::pcg4d([i, k, 0, 0]).map(rng::to_unit)[..3]);
    let mut rays: Vec<Ray> = (0..count)
        .map(|i| Ray::new(Vec3::new(4.0, 3.0, 5.0) * unit(i, 0), (unit(i, 1) - 0.5).normalize()))
        .collect();
    for i in 0..count {
        let ray = rays[i as usize];
        let hit = oracle.closest_one(&ray, &AcceptAll);
        if hit.is_hit() {
            let surface = oracle.interaction(&ray, &hit);
            let d = (unit(i, 2) - 0.5).normalize();
            rays.push(Ray::new(surface.ray_origin(d), d));
        }
    }
    rays
}

#[test]
fn nearly_all_rays_in_a_room_are_certain() {
    let world = world_of(room(), AcceleratorKind::Bvh, Level::Scalar);
    let list = list_of(&world).expect("a list");
    let rays = rays_in_room(&world, 5000);
    let mut uncertain = 0;
    for rays in rays.as_chunks::<RAYS>().0 {
        let hits = Hits::of(
            Portable,
            list,
            &ListPacket::<PairDoubles<Portable8>>::new(Portable, list, rays, RAYS),
        );
        uncertain += hits.uncertain.count_ones() as usize;
    }
    assert!(uncertain * 100 < rays.len(), "{uncertain} of {}", rays.len());
}

#[test]
fn rays_in_a_room_hit_what_the_oracle_hits() {
    let oracle = world_of(room(), AcceleratorKind::None, Level::Scalar);
    let mut rays = rays_in_room(&oracle, 2000);
    // For occlusion queries, some rays end before, at and behind the next wall.
    for (i, ray) in rays.iter_mut().enumerate().step_by(2) {
        let t = oracle.closest_one(&*ray, &AcceptAll).t;
        ray.t_max = t * [0.5, 1.0, 1.0 + 1e-6, 2.0][i / 2 % 4];
    }
    for level in levels() {
        let world = world_of(room(), AcceleratorKind::Bvh, level);
        check(&world, &oracle, Rays::from(&rays), &AcceptAll).expect("the same hits");
    }
}

#[test]
fn rays_among_shapes_in_a_room_hit_what_the_oracle_hits() {
    for (count, has_room) in [(1, true), (3, true), (7, true), (3, false)] {
        let furnished = |accelerator, level| {
            let mut builder = WorldBuilder::default();
            if has_room {
                builder.add_mesh(WorldBuilder::ROOT, room());
            }
            for i in 0..count {
                let place = Transform::translation(DVec3::new(
                    0.8 + 0.4 * f64::from(i),
                    0.6,
                    1.0 + f64::from(i % 3),
                ));
                let shape: AnyShape = match i % 5 {
                    1 => Rectangle { half_size: DVec2::new(0.5, 0.25) }.into(),
                    2 => Disk { radius: 0.5, inner_radius: 0.125 }.into(),
                    3 => Cylinder { radius: 0.25, height: 1.0, caps: true }.into(),
                    _ => Sphere { radius: 0.5 }.into(),
                };
                builder.add_shape(WorldBuilder::ROOT, Arc::new(shape), place);
            }
            build(builder, accelerator, level)
        };
        let oracle = furnished(AcceleratorKind::None, Level::Scalar);
        let mut rays = rays_in_room(&oracle, 1000);
        for (i, ray) in rays.iter_mut().enumerate().step_by(2) {
            let t = oracle.closest_one(&*ray, &AcceptAll).t;
            ray.t_max = t * [0.5, 1.0, 1.0 + 1e-6, 2.0][i / 2 % 4];
        }
        for level in levels() {
            let world = furnished(AcceleratorKind::Bvh, level);
            assert!(list_of(&world).is_some());
            check(&world, &oracle, Rays::from(&rays), &AcceptAll).expect("the same hits");
        }
    }
}

fn strip(triangles: u32) -> WorldBuilder {
    let positions =
        (0..triangles + 2).map(|i| Vec3::new(i as f32, (i & 1) as f32, (i % 7) as f32)).collect();
    let indices = (0..triangles).map(|i| [i, i + 1, i + 2]).collect();
    let mut builder = WorldBuilder::default();
    builder.add_mesh(
        WorldBuilder::ROOT,
        Arc::new(TriangleMesh { positions, indices, ..TriangleMesh::default() }),
    );
    builder
}

#[test]
fn only_small_worlds_of_ordinary_size_have_lists() {
    let has_list =
        |builder| list_of(&build(builder, AcceleratorKind::Bvh, Level::Scalar)).is_some();
    let with = |mut builder: WorldBuilder, shape: AnyShape, count: usize| {
        for i in 0..count {
            let place = Transform::translation(DVec3::new(i as f64, 0.0, 0.0));
            builder.add_shape(WorldBuilder::ROOT, Arc::new(shape.clone()), place);
        }
        builder
    };
    // Shapes that are not tested in lanes must be few compared with the triangles.
    let cylinder = AnyShape::from(Cylinder { radius: 0.5, height: 1.0, caps: true });
    assert!(
        has_list(with(strip(5), cylinder.clone(), 2)) && !has_list(with(strip(5), cylinder, 3))
    );
    let with_spheres = |builder, count| with(builder, Sphere { radius: 1.0 }.into(), count);
    assert!(
        has_list(with_spheres(WorldBuilder::default(), 2)) && has_list(with_spheres(strip(5), 3))
    );
    let most = crate::tree::list::MAX_OBJECTS;
    assert!(
        has_list(with_spheres(strip(40), most)) && !has_list(with_spheres(strip(40), most + 1))
    );
    assert!(has_list(strip(1)));
    assert!(has_list(strip(crate::tree::list::MAX_TRIANGLES as u32)));
    assert!(!has_list(strip(crate::tree::list::MAX_TRIANGLES as u32 + 1)));
    assert!(!has_list(WorldBuilder::default()));
    let mut with_instance = strip(20);
    let child = with_instance.add_group();
    with_instance.add_shape(child, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
    with_instance.add_instance(WorldBuilder::ROOT, child, Transform::IDENTITY);
    assert!(!has_list(with_instance));
    let mut huge = strip(20);
    huge.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 1e20 }), Transform::IDENTITY);
    assert!(!has_list(huge));
}

#[test]
fn rays_that_are_not_ordinary_are_answered_too() {
    let make = |accelerator| build(strip(40), accelerator, Level::best());
    let (world, oracle) = (make(AcceleratorKind::Bvh), make(AcceleratorKind::None));
    let target = Vec3::new(7.25, 0.5, 1.5);
    let from = |origin: Vec3| Ray::new(origin, target - origin);
    let mut rays = vec![
        from(Vec3::splat(1e7)),
        from(Vec3::splat(f32::NAN)),
        from(Vec3::new(f32::INFINITY, 0.0, 0.0)),
        Ray::new(Vec3::ZERO, Vec3::ZERO),
        Ray::new(target - Vec3::Z * 9.0, Vec3::Z * 1e-30),
        Ray::new(target - Vec3::Z * 9.0, Vec3::Z * 1e30),
        from(Vec3::new(0.0, 0.0, -40.0)).with_t_max(f32::NAN),
        from(Vec3::new(0.0, 0.0, -40.0)).with_t_max(-1.0),
        from(Vec3::new(0.0, 0.0, -40.0)),
    ];
    rays.extend((0..10).map(|i| from(Vec3::new(i as f32, -3.0, -40.0))));
    check(&world, &oracle, Rays::from(&rays), &AcceptAll).expect("the same hits");
    let hits: Vec<Hit> = rays.iter().map(|ray| oracle.closest_one(ray, &AcceptAll)).collect();
    assert!(hits[0].is_hit() && hits[4].is_hit() && hits[8].is_hit(), "{hits:?}");
}

#[test]
fn equally_far_triangles_go_to_the_lowest_number() {
    let mut builder = WorldBuilder::default();
    let square = |z: f32| TriangleMesh {
        positions: vec![Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z)],
        indices: vec![[0, 1, 2], [0, 1, 2]],
        ..TriangleMesh::default()
    };
    for z in [2.0, 1.0, 1.0, 1.0 + 1e-7] {
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(square(z)));
    }
    let world = build(builder, AcceleratorKind::Bvh, Level::best());
    assert!(list_of(&world).is_some());
    let rays: Vec<Ray> =
        (0..20).map(|i| Ray::new(Vec3::new(0.05 * i as f32, 0.0, 0.0), Vec3::Z)).collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    assert!(hits.iter().all(|hit| (hit.geometry, hit.primitive, hit.t) == (1, 0, 1.0)), "{hits:?}");
}

#[test]
fn equally_far_shapes_go_to_the_lowest_number_too() {
    let square = [[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]];
    for mesh_at in 0..4 {
        let make = |accelerator, level| {
            let mut builder = WorldBuilder::default();
            for number in 0..4 {
                if number == mesh_at {
                    builder.add_mesh(WorldBuilder::ROOT, quads(&[square; 3]));
                } else {
                    // The second of three is nearer by less than `f32` resolves.
                    let place = Transform::translation(
                        DVec3::Z * if number == 2 { 1.0 - 1e-12 } else { 1.0 },
                    );
                    let half_size = DVec2::new(0.5 + 0.25 * f64::from(number), 1.0);
                    builder.add_shape(WorldBuilder::ROOT, Arc::new(Rectangle { half_size }), place);
                }
            }
            build(builder, accelerator, level)
        };
        let rays: Vec<Ray> = (0..60)
            .map(|i| Ray::new(Vec3::new(0.05 * i as f32 - 1.5, 0.3, 0.0), Vec3::Z))
            .collect();
        let oracle = make(AcceleratorKind::None, Level::Scalar);
        for level in levels() {
            let world = make(AcceleratorKind::Bvh, level);
            assert!(list_of(&world).is_some());
            check(&world, &oracle, Rays::from(&rays), &AcceptAll).expect("the same hits");
        }
    }
}

#[test]
fn batches_that_hit_little_are_answered_too() {
    let make = |accelerator| build(strip(40), accelerator, Level::best());
    let (world, oracle) = (make(AcceleratorKind::Bvh), make(AcceleratorKind::None));
    let beside =
        |i: usize| Vec3::new((i % 40) as f32, if i.is_multiple_of(5) { 0.5 } else { 50.0 }, -9.0);
    let rays: Vec<Ray> =
        (0..1000).map(|i| Ray::new(beside(i), Vec3::new(0.01, 0.0, 1.0))).collect();
    check(&world, &oracle, Rays::from(&rays), &AcceptAll).expect("the same hits");
    let hits = rays.iter().filter(|ray| oracle.closest_one(*ray, &AcceptAll).is_hit()).count();
    assert!(hits > 50 && hits < 400, "{hits}");
}

/// Whether each ray may hit a box, decided one ray at a time.
fn near(list: &List, rays: &[Ray], bounds: &Bounds3) -> Vec<bool> {
    let of_sixteen = |rays: &[Ray; RAYS]| {
        ListPacket::<PairDoubles<Portable8>>::new(Portable, list, rays, RAYS)
            .may_meet(Portable, list, bounds)
    };
    let (sixteens, rest) = rays.as_chunks();
    assert!(rest.is_empty());
    sixteens
        .iter()
        .flat_map(|rays| (0..RAYS).map(move |lane| of_sixteen(rays) >> lane & 1 == 1))
        .collect()
}

#[test]
fn rays_that_meet_a_box_are_near_it_and_most_others_are_not() {
    let world = world_of(room(), AcceleratorKind::Bvh, Level::Scalar);
    let list = list_of(&world).expect("a list");
    let number = |i: u32, k: u32| rng::to_unit(rng::pcg4d([i, k, 7, 7])[0]) * 2.0 - 1.0;
    let vector = |i: u32, k: u32| Vec3::new(number(i, k), number(i, k + 1), number(i, k + 2));
    let all = Bounds3 { min: list.center - list.reach, max: list.center + list.reach };
    let (mut met, mut told_apart, mut count) = (0, 0, 0);
    for (box_number, flat) in [
        (0, Vec3::ONE),
        (1, Vec3::new(1.0, 0.0, 1.0)),
        (2, Vec3::ZERO),
        (3, Vec3::new(1.0, 1.0, 1e-7)),
    ] {
        let corner = vector(box_number, 90) * 0.5;
        let bounds = Bounds3 { min: corner, max: corner + Vec3::new(0.3, 0.2, 0.4) * flat };
        let rays: Vec<Ray> = (0..16_000)
            .map(|i| {
                // Rays towards the box or one of its corners, along an axis, or in any direction.
                let origin = vector(i, 0) * 0.9;
                let at = bounds.min
                    + (bounds.max - bounds.min)
                        * (vector(i, 3) * 0.5 + 0.5)
                            .map(|x| if i % 3 == 0 { x.round() } else { x });
                let direction = match i % 4 {
                    0 => at - origin,
                    1 => {
                        [Vec3::X, Vec3::NEG_Y, Vec3::Z][i as usize % 3] * Vec3::new(1.0, 1.0, -1.0)
                    }
                    2 => (at - origin) * Vec3::new(1.0, 1.0, 1e-20),
                    _ => vector(i, 6),
                };
                Ray::new(if i % 8 == 1 { at - direction * 0.25 } else { origin }, direction)
            })
            .collect();
        for (ray, is_near) in rays.iter().zip(near(list, &rays, &bounds)) {
            let (begins, ends) = BoxRay::new(&DRay::from(ray), &all, ray.t_min).span_of(&bounds);
            let meets = begins <= ends;
            assert!(is_near || !meets, "{ray:?} {bounds:?}");
            met += u32::from(meets);
            told_apart += u32::from(!is_near);
            count += 1;
        }
    }
    assert!(
        met > count / 4 && told_apart > count / 4 && met + told_apart > count * 99 / 100,
        "{met} {told_apart} {count}"
    );
}
