use super::List;
use super::lines::{Lines, RAYS};
use crate::accel::AcceleratorKind;
use crate::hit::Hit;
use crate::kernel::ray::LocalRay;
use crate::kernel::triangle::exact_hit;
use crate::mesh::TriangleMesh;
use crate::query::rays::Rays;
use crate::query::{AcceptAll, Grouping, HitFilter};
use crate::shape::{Plane, Sphere};
use crate::world::tests::{bits, build, levels};
use crate::world::{GeometryId, Structure, World, WorldBuilder};
use proptest::prelude::*;
use snell_math::simd::{Level, Portable8};
use snell_math::{DRay, Ray, Transform, Vec3, rng};
use std::sync::Arc;

fn list_of(world: &World) -> Option<&List> {
    match &world.structure {
        Structure::Bvh(forest) => forest.list.as_ref(),
        _ => None,
    }
}

/// Compares all claims with the oracle.
fn check(world: &World, oracle: &World, rays: Rays, filter: &dyn HitFilter) -> Result<(), TestCaseError> {
    let expected: Vec<Hit> = (0..rays.len()).map(|i| oracle.closest_one(rays.get(i), filter)).collect();
    for grouping in [Grouping::Coherent, Grouping::None] {
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        world.closest(rays, grouping, filter, &mut hits);
        world.occluded(rays, grouping, filter, &mut blocked);
        for i in 0..rays.len() {
            prop_assert_eq!(bits(&hits[i]), bits(&expected[i]), "{:?} {:?}", grouping, rays.get(i));
            prop_assert_eq!(blocked[i], expected[i].is_hit(), "{:?} {:?}", grouping, rays.get(i));
        }
    }
    Ok(())
}

fn lattice_point() -> impl Strategy<Value = Vec3> {
    [-3i8..=3, -3i8..=3, -3i8..=3].prop_map(|p| Vec3::from_array(p.map(f32::from)))
}

/// On the lattice of halves, so that rays meet vertices, edges and planes; or anywhere.
fn point() -> impl Strategy<Value = Vec3> {
    let halves = [-8i8..=8, -8i8..=8, -8i8..=8].prop_map(|p| Vec3::from_array(p.map(|x| f32::from(x) * 0.5)));
    prop_oneof![halves, [-4.0f32..4.0, -4.0f32..4.0, -4.0f32..4.0].prop_map(Vec3::from_array)]
}

fn meshes() -> impl Strategy<Value = TriangleMesh> {
    let positions = proptest::collection::vec(lattice_point(), 3..30);
    let corners = proptest::collection::vec(proptest::array::uniform3(0u32..1000), 1..70);
    (positions, corners).prop_map(|(positions, corners)| {
        let n = positions.len() as u32;
        let indices = corners.iter().map(|t| t.map(|i| i % n)).collect();
        TriangleMesh { positions, indices, ..TriangleMesh::default() }
    })
}

struct Sieve;

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
        lines in proptest::collection::vec((point(), point(), 0u32..4), 1..50),
        (spheres, plane) in (0usize..3, any::<bool>()),
        (scale, far) in (prop_oneof![Just(0), -18i32..18], prop_oneof![Just(0.0f32), Just(0.0f32), Just(1000.0)]),
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
                builder.add_shape(WorldBuilder::ROOT, Arc::new(sphere), Transform::translation(center.as_dvec3()));
            }
            if plane {
                let at = Transform::translation(moved(Vec3::new(0.0, -2.25, 0.0)).as_dvec3());
                builder.add_shape(WorldBuilder::ROOT, Arc::new(Plane {}), at);
            }
            builder.set_mask(GeometryId(1), 2);
            builder.set_filtered(GeometryId(1));
            build(builder, accelerator, simd)
        };
        let rays: Vec<Ray> = lines.iter().map(|&(from, to, kind)| {
            let (from, to) = (moved(from), moved(to));
            match kind {
                0 => Ray::new(from, to - from).with_t_max(1.0),
                1 => Ray { t_min: -1.0, ..Ray::new(from, to - from) },
                2 => Ray::new(from, (to - from).normalize_or_zero()),
                _ => Ray { t_min: 0.25, ..Ray::new(from, to - from) },
            }
        }).collect();
        let masks: Vec<u32> = (0..rays.len() as u32).map(|i| [u32::MAX, 1, 2, 0][(i / 3 % 4) as usize]).collect();
        let oracle = make(AcceleratorKind::None, Level::Scalar);
        for level in levels() {
            let world = make(AcceleratorKind::Bvh, level);
            check(&world, &oracle, Rays::from(&rays), &AcceptAll)?;
            check(&world, &oracle, Rays::from(&rays).with_masks(&masks), &Sieve)?;
        }
    }

    #[test]
    fn what_the_exact_test_takes_passes_the_filter(
        mesh in meshes(),
        lines in proptest::collection::vec((point(), point()), RAYS),
        (scale, distance) in (-25i32..25, prop_oneof![Just(1.0f32), Just(20.0)]),
    ) {
        let scale = 2.0f32.powi(scale);
        let positions = mesh.positions.iter().map(|&p| p * scale).collect();
        let mesh = TriangleMesh { positions, ..mesh };
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
        let world = build(builder, AcceleratorKind::Bvh, Level::Scalar);
        let Some(list) = list_of(&world) else { return Ok(()) };
        let aimed = |&(from, to): &(Vec3, Vec3)| {
            let from = from * distance * scale;
            Ray::new(from, to * scale - from)
        };
        let rays: Vec<Ray> = lines.iter().map(aimed).collect();
        let mut lines = Lines::NONE;
        let ordinary = lines.set_up(list, &rays);
        let mut passing = vec![vec![0; list.edges.len()]];
        // SAFETY: portable code.
        unsafe { lines.passing::<Portable8>(&list.edges, &mut passing[0]) };
        #[cfg(target_arch = "x86_64")]
        if Level::Avx2.is_supported() {
            passing.push(vec![0; list.edges.len()]);
            // SAFETY: just checked.
            unsafe { passing_avx2(&lines, list, &mut passing[1]) };
        }
        for (i, ray) in rays.iter().enumerate().filter(|(i, _)| ordinary >> i & 1 == 1) {
            let local = LocalRay::new(&DRay::from(ray));
            for (triangle, contents) in list.triangles.iter().enumerate() {
                let is_hit = exact_hit(&local, &contents.corners, f64::NEG_INFINITY).is_some();
                let passes = passing.iter().all(|passing| passing[triangle] >> i & 1 == 1);
                prop_assert!(!is_hit || passes, "{ray:?} {:?}", contents.corners);
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,popcnt")]
unsafe fn passing_avx2(lines: &Lines, list: &List, passing: &mut [u16]) {
    // SAFETY: as promised by the caller.
    unsafe { lines.passing::<snell_math::simd::Avx8>(&list.edges, passing) }
}

fn strip(triangles: u32) -> WorldBuilder {
    let positions = (0..triangles + 2).map(|i| Vec3::new(i as f32, (i & 1) as f32, (i % 7) as f32)).collect();
    let indices = (0..triangles).map(|i| [i, i + 1, i + 2]).collect();
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(TriangleMesh { positions, indices, ..TriangleMesh::default() }));
    builder
}

#[test]
fn only_small_worlds_of_ordinary_size_have_lists() {
    let has_list = |builder| list_of(&build(builder, AcceleratorKind::Bvh, Level::Scalar)).is_some();
    let with_sphere = |mut builder: WorldBuilder| {
        builder.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
        builder
    };
    assert!(has_list(with_sphere(strip(20))) && !has_list(with_sphere(strip(5))));
    assert!(has_list(strip(1)));
    assert!(has_list(strip(super::contents::MAX_TRIANGLES as u32)));
    assert!(!has_list(strip(super::contents::MAX_TRIANGLES as u32 + 1)));
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
    let rays: Vec<Ray> = (0..20).map(|i| Ray::new(Vec3::new(0.05 * i as f32, 0.0, 0.0), Vec3::Z)).collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    assert!(hits.iter().all(|hit| (hit.geometry, hit.primitive, hit.t) == (1, 0, 1.0)), "{hits:?}");
}

#[test]
fn batches_that_hit_little_are_answered_too() {
    let make = |accelerator| build(strip(40), accelerator, Level::best());
    let (world, oracle) = (make(AcceleratorKind::Bvh), make(AcceleratorKind::None));
    let beside = |i: usize| Vec3::new((i % 40) as f32, if i.is_multiple_of(5) { 0.5 } else { 50.0 }, -9.0);
    let rays: Vec<Ray> = (0..1000).map(|i| Ray::new(beside(i), Vec3::new(0.01, 0.0, 1.0))).collect();
    check(&world, &oracle, Rays::from(&rays), &AcceptAll).expect("the same hits");
    let hits = rays.iter().filter(|ray| oracle.closest_one(*ray, &AcceptAll).is_hit()).count();
    assert!(hits > 50 && hits < 400, "{hits}");
}
