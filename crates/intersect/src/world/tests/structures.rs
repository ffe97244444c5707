//! Tests that structures, SIMD levels and batches give the same hits.

use super::*;

#[test]
fn every_structure_and_level_gives_the_same_hits_bit_for_bit() {
    let mut hits = 0;
    for seed in 0..4 {
        let oracle = build(nested_scene(seed), AcceleratorKind::None, Level::Scalar);
        let worlds: Vec<_> =
            levels().map(|l| build(nested_scene(seed), AcceleratorKind::Bvh, l)).collect();
        let mut random = Random(seed * 1000);
        for i in 0..500 {
            let (from, to) = (random.point(6.0), random.point(2.0));
            let mut ray = Ray::new(from, (to - from) * random.range(0.1, 10.0));
            if i % 3 == 0 {
                // Along an axis or aimed at a lattice, sometimes backwards.
                ray.direction = [Vec3::X, -Vec3::Y, Vec3::Z][i / 3 % 3];
                ray.t_min = random.range(-5.0, 5.0);
                ray.t_max = ray.t_min + random.range(0.0, 10.0);
            }
            let expected = oracle.closest_one(&ray, &AcceptAll);
            let occluded = oracle.occluded_one(&ray, &AcceptAll);
            let all = oracle.all_one(&ray, &AcceptAll);
            assert_eq!(occluded, expected.is_hit());
            assert_eq!(all.first().map(bits), expected.is_hit().then(|| bits(&expected)));
            hits += usize::from(expected.is_hit());
            for world in &worlds {
                let found = world.closest_one(&ray, &AcceptAll);
                assert_eq!(
                    bits(&found),
                    bits(&expected),
                    "{} {ray:?} {found:?} {expected:?}",
                    world.simd()
                );
                assert_eq!(world.occluded_one(&ray, &AcceptAll), occluded, "{ray:?}");
                assert_eq!(world.all_one(&ray, &AcceptAll), all);
            }
        }
    }
    assert!(hits > 600, "{hits}");
}

/// The lecture keeps the last hit in the node, to test that primitive first. This is a data race,
/// and results depend on earlier rays.
#[test]
fn errata_e8_a_world_keeps_nothing_between_rays_and_is_shared_by_threads() {
    let world = default_world(nested_scene(8));
    let mut random = Random(88);
    let rays: Vec<Ray> =
        (0..2000).map(|_| Ray::new(random.point(3.0), random.direction())).collect();
    let alone: Vec<_> = rays.iter().map(|r| bits(&world.closest_one(r, &AcceptAll))).collect();
    assert!(
        alone.iter().collect::<std::collections::BTreeSet<_>>().len() > 20,
        "rays must hit different things"
    );
    std::thread::scope(|scope| {
        for step in [1, 7, 13, 1999] {
            let (world, rays, alone) = (&world, &rays, &alone);
            scope.spawn(move || {
                for i in (0..rays.len()).map(|i| i * step % rays.len()) {
                    assert_eq!(
                        bits(&world.closest_one(&rays[i], &AcceptAll)),
                        alone[i],
                        "ray {i}, every {step}th"
                    );
                }
            });
        }
    });
}

#[test]
fn batches_answer_as_single_rays_do() {
    let world = default_world(nested_scene(2));
    let mut random = Random(3);
    let rays: Vec<_> = (0..333).map(|_| Ray::new(random.point(5.0), random.direction())).collect();
    let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    world.occluded(&rays, Grouping::None, &AcceptAll, &mut blocked);
    for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked) {
        assert_eq!(bits(hit), bits(&world.closest_one(ray, &AcceptAll)));
        assert_eq!(*blocked, world.occluded_one(ray, &AcceptAll));
    }
}

mod properties {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn lattices_are_hit_alike_by_every_structure_level_and_batch(
            positions in proptest::collection::vec(lattice_point(), 3..20),
            corners in proptest::collection::vec(proptest::array::uniform3(0u32..1000), 1..60),
            rays in proptest::collection::vec((lattice_point(), lattice_point(), -1i8..3), 20..40),
        ) {
            let n = positions.len() as u32;
            let indices = corners.iter().map(|t| t.map(|i| i % n)).collect();
            let mesh = Arc::new(TriangleMesh { positions, indices, ..TriangleMesh::default() });
            let make = |accelerator, simd| {
                let mut builder = WorldBuilder::default();
                builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
                build(builder, accelerator, simd)
            };
            let rays: Vec<_> =
                rays.into_iter()
                    .map(|(o, d, t_min)| Ray { t_min: t_min.into(), ..Ray::new(o, d) })
                    .collect();
            let oracle = make(AcceleratorKind::None, Level::Scalar);
            for level in levels() {
                let world = make(AcceleratorKind::Bvh, level);
                let mut hits = vec![Hit::MISS; rays.len()];
                let mut blocked = vec![false; rays.len()];
                world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
                world.occluded(&rays, Grouping::None, &AcceptAll, &mut blocked);
                for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(blocked) {
                    let expected = oracle.closest_one(ray, &AcceptAll);
                    prop_assert_eq!(bits(hit), bits(&expected), "{} {:?}", level, ray);
                    prop_assert_eq!(bits(&world.closest_one(ray, &AcceptAll)), bits(&expected));
                    prop_assert_eq!(blocked, expected.is_hit());
                }
            }
        }
    }
}

#[test]
fn batches_with_rejections_agree_with_the_oracle() {
    struct Sieve;
    impl HitFilter for Sieve {
        fn accept(&self, _: &Ray, hit: &Hit) -> bool {
            hash32(hit.primitive ^ hit.instance) & 3 != 0
        }
    }
    let make = |accelerator, simd| {
        let mut builder = nested_scene(7);
        (0..builder.geometries.len() as u32)
            .step_by(2)
            .for_each(|g| builder.set_filtered(GeometryId(g)));
        build(builder, accelerator, simd)
    };
    let oracle = make(AcceleratorKind::None, Level::Scalar);
    let mut random = Random(11);
    let mut rays: Vec<_> =
        (0..400).map(|_| Ray::new(random.point(5.0), random.direction())).collect();
    rays.iter_mut().step_by(9).for_each(|r| r.direction = Vec3::ZERO);
    for level in levels() {
        let world = make(AcceleratorKind::Bvh, level);
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        world.closest(&rays, Grouping::None, &Sieve, &mut hits);
        world.occluded(&rays, Grouping::None, &Sieve, &mut blocked);
        for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked) {
            let expected = oracle.closest_one(ray, &Sieve);
            assert_eq!(
                (bits(hit), *blocked),
                (bits(&expected), expected.is_hit()),
                "{level} {ray:?}"
            );
        }
    }
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let mesh = Arc::new(soup(&mut Random(1), 90_000));
    let tree = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, mesh.clone());
        let world = pool.install(|| default_world(builder));
        let Structure::Bvh(forest) = &world.structure else { panic!("a tree") };
        let node = |n: &crate::tree::node::WideNode| {
            (n.children, n.bounds.map(|s| s.map(|a| a.map(f32::to_bits))))
        };
        let nodes: Vec<_> = forest.trees[0].nodes.iter().map(node).collect();
        (nodes, forest.trees[0].blocks.bytes().to_vec())
    };
    assert!(tree(1) == tree(4));
}
