use super::*;
use crate::exact::prepared::PreparedRay;
use crate::hit::Hit;
use crate::kernel::single::boxes::prepared_distances;
use crate::kernel::stream::slot::Slots;
use crate::mesh::TriangleMesh;
use crate::precision::Single;
use crate::search::{AcceptAll, Grouping};
use crate::search::{Closest, Context, Search};
use crate::tree::GroupTree;
use crate::world::AcceleratorKind;
use crate::world::tests::{Random, build, check, dust, levels, nested_scene, soup};
use crate::world::{Structure, World, WorldBuilder};
use proptest::prelude::*;
use snell_math::simd::{Level, Pair, Portable, Portable8};
use snell_math::{Ray, Vec3};
use std::sync::Arc;

fn world_of(mesh: TriangleMesh, level: Level) -> World {
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    build(builder, AcceleratorKind::Bvh, level)
}

/// Rays from places near each other, in all directions; some along axes, some with ends.
fn packet(random: &mut Random, count: usize, width: f32) -> Vec<Ray> {
    let middle = random.point(1.0);
    (0..count)
        .map(|i| {
            let mut ray = Ray::new(middle + random.point(width), random.direction());
            match i % 9 {
                2 => ray.direction = Vec3::new(0.0, ray.direction.y, 0.0),
                3 => ray.direction.z = 0.0,
                4 => ray.t_max = random.unit() * 0.3,
                5 => ray.t_min = random.unit() * 0.3,
                6 => ray.direction *= 1.0e5,
                7 => ray.direction.x *= 1.0e-7,
                _ => {}
            }
            if ray.t_min >= ray.t_max { Ray::new(middle, ray.direction) } else { ray }
        })
        .collect()
}

/// All blocks below a child whose boxes the ray meets, and where it enters them.
fn leaves<L: Lanes8>(
    token: L::Token,
    tree: &GroupTree,
    child: ChildRef,
    ray: &PreparedRay,
    [t_min, cull]: [f32; 2],
) -> Vec<(f32, ChildRef)> {
    let mut found = Vec::new();
    let mut open = vec![(t_min, child)];
    while let Some((distance, child)) = open.pop() {
        if !child.is_node() {
            found.push((distance, child));
            continue;
        }
        let node = &tree.nodes[child.node_index()];
        let mut enters = [0.0; 8];
        let (enter, limit) = prepared_distances::<L>(token, node, ray, t_min, cull);
        enter.store(&mut enters);
        let met = enter.le(limit);
        open.extend((0..8).filter(|i| met >> i & 1 == 1).map(|i| (enters[i], node.children[i])));
    }
    found
}

/// Lets rays start, and compares what is left to each with its own search. Returns the number of
/// rays that are not at the root any more.
fn look<W: Lanes16>(token: W::Token, world: &World, rays: &[Ray]) -> usize {
    looked_at::<W, W::Half>(token, W::half_token(token), world, rays)
}

fn looked_at<W: Lanes16, L: Lanes8>(
    wide_token: W::Token,
    token: L::Token,
    world: &World,
    rays: &[Ray],
) -> usize {
    let Structure::Bvh(forest) = &world.structure else { panic!("the product's own structure") };
    let tree = &forest.trees[0];
    let context = Context { filter: &AcceptAll, options: &world.options, data: &(), cancel: None };
    let mut slots = Slots::<Closest<Single>>::new(rays.len(), forest);
    let mut walks: Vec<Walk<_>> = Vec::new();
    for ((i, ray), walk) in rays.iter().enumerate().zip(slots.walks()) {
        let search = || Search::new(ray.into(), &context, Closest::new(ray));
        walks.extend(walk.start::<L>(false, i, &(), search, ray).ok());
    }
    // SAFETY: they have just started, and there are at most `SHARED_RAYS`.
    unsafe { shared_start_with::<W, _>(wide_token, &mut walks) };
    let mut moved = 0;
    for walk in &walks {
        let entries = walk.entries();
        if entries.len() == 1 && entries[0].1 == tree.root {
            continue;
        }
        moved += 1;
        let (ray, interval) = (walk.ray(), walk.interval());
        assert!(
            entries.windows(2).all(|pair| pair[0].0 >= pair[1].0),
            "the nearest is last: {entries:?}"
        );
        let mut expected = leaves::<L>(token, tree, tree.root, ray, interval);
        for &(distance, child) in &entries {
            let below = leaves::<L>(token, tree, child, ray, interval);
            for (_, leaf) in &below {
                let place = expected.iter().position(|(_, other)| other == leaf);
                // The boxes of a shared start are a little wider.
                if let Some(place) = place {
                    let (enter, _) = expected.swap_remove(place);
                    assert!(distance <= enter, "{distance} {enter}");
                }
            }
        }
        assert!(expected.is_empty(), "not lost: {expected:?}, of {entries:?}");
    }
    moved
}

#[test]
fn every_ray_keeps_all_that_it_meets() {
    let mut random = Random(5);
    let (mut moved, mut count) = (0, 0);
    for round in 0..60 {
        let mesh = if round % 3 == 0 { soup(&mut random, 300) } else { dust(&mut random, 3000) };
        let size = [1, 7, 8, 15, 16, 17, 25, SHARED_RAYS][round % 8];
        let rays = packet(&mut random, size, [0.0, 0.01, 0.3][round % 3]);
        let world = world_of(mesh, Level::Scalar);
        moved += look::<Pair<Portable8>>(Portable, &world, &rays);
        count += rays.len();
        for level in levels() {
            match level.wide() {
                #[cfg(target_arch = "x86_64")]
                Some(Wide::Avx512(token)) => drop(look::<Avx16>(token, &world, &rays)),
                Some(wide) => drop(look::<Pair<Wide8>>(WideToken::from(wide), &world, &rays)),
                None => {}
            }
        }
    }
    assert!(moved * 2 > count, "{moved} of {count}");
}

#[test]
fn rays_along_an_axis_stay_at_the_root_and_few_rays_too() {
    let mut random = Random(6);
    let world = world_of(dust(&mut random, 2000), Level::Scalar);
    let along: Vec<Ray> = (0..SHARED_RAYS).map(|_| Ray::new(random.point(0.1), Vec3::X)).collect();
    assert_eq!(look::<Pair<Portable8>>(Portable, &world, &along), 0);
    let few = packet(&mut random, MIN_INSIDE as usize - 1, 0.01);
    assert_eq!(look::<Pair<Portable8>>(Portable, &world, &few), 0);
}

#[test]
fn shared_starts_find_what_single_rays_find() {
    let mut random = Random(7);
    for level in levels() {
        let world = world_of(dust(&mut random, 20_000), level);
        let mut rays: Vec<Ray> = Vec::new();
        for i in 0..40 {
            let mut random = Random(100 + i);
            rays.extend(packet(&mut random, 5 + 7 * i as usize % 64, 0.02));
        }
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        for count in [16, 17, 31, 33, 100, rays.len()] {
            world.closest(&rays[..count], Grouping::None, &AcceptAll, &mut hits[..count]);
            world.occluded(&rays[..count], Grouping::None, &AcceptAll, &mut blocked[..count]);
            for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked).take(count) {
                assert_eq!(world.closest_one(ray, &AcceptAll), *hit, "{level} {ray:?}");
                assert_eq!(hit.is_hit(), *blocked, "{level} {ray:?}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn batches_find_what_single_rays_find_at_any_scale(
        seed in any::<u32>(),
        count in 1usize..70,
        exponent in -37f32..33.0,
        width in 0.0f32..0.3,
    ) {
        let (mut random, scale) = (Random(seed), 10f32.powf(exponent));
        let mut mesh = dust(&mut random, 400);
        mesh.positions.iter_mut().for_each(|p| *p *= scale);
        let mut rays = packet(&mut random, count, width);
        for ray in &mut rays {
            ray.origin *= scale;
            (ray.t_min, ray.t_max) = (ray.t_min * scale, ray.t_max * scale);
        }
        for level in levels() {
            let world = world_of(mesh.clone(), level);
            for grouping in [Grouping::None, Grouping::Coherent] {
                let mut hits = vec![Hit::MISS; rays.len()];
                world.closest(&rays, grouping, &AcceptAll, &mut hits);
                for (ray, hit) in rays.iter().zip(&hits) {
                    let single = world.closest_one(ray, &AcceptAll);
                    prop_assert_eq!(single, *hit, "{} {:?}", level, ray);
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn nested_scenes_agree_with_the_oracle(seed in any::<u32>(), size in 0.0f32..0.3) {
        let oracle = build(nested_scene(seed), AcceleratorKind::None, Level::Scalar);
        let mut random = Random(seed ^ 99);
        let mut rays = Vec::new();
        for _ in 0..3 {
            rays.extend(packet(&mut random, 40, size));
        }
        for level in levels() {
            let world = build(nested_scene(seed), AcceleratorKind::Bvh, level);
            check(&world, &oracle, (&rays).into(), &AcceptAll)?;
        }
    }
}

#[test]
fn what_does_not_pay_is_left_for_a_while() {
    let mut trial = Trial::default();
    assert!(trial.is_on());
    trial.count(32, 32 * Trial::MIN_VISITS);
    assert!(trial.is_on());
    trial.count(32, 32 * Trial::MIN_VISITS - 1);
    assert!((0..Trial::REST).all(|_| !trial.is_on()));
    assert!(trial.is_on(), "and then tried again");
}
