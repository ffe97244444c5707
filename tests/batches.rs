//! Large batches of any size, on any number of threads, with any SIMD level and either grouping
//! give the same bits; and the three queries for a hit agree.
//!
//! The environment variable `SNELL_BATCH_RAYS` sets the number of rays in a batch (12,000 by
//! default), and `SNELL_RANDOM_QUERIES` the number of rays for the three queries (400,000 by
//! default).

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use snell_intersect::AcceleratorKind;
use snell_intersect::{
    AcceptAll, BuildOptions, GroupId, Grouping, Hit, Instance, Rays, Single, World, WorldBuilder,
};
use snell_math::rng::{hash32, pcg4d, to_unit};
use snell_math::sampling::uniform_sphere;
use snell_math::simd::Level;
use snell_math::{DAffine3, DVec3, Ray, Transform, Vec2, Vec3};
use snell_tests::meshes::{icosphere, latitude_longitude_sphere};
use snell_tests::random_worlds::{Source, bits, random_bytes};
use std::sync::Arc;

fn number(name: &str, otherwise: usize) -> usize {
    std::env::var(name).ok().and_then(|s| s.parse().ok()).unwrap_or(otherwise)
}

fn random(index: u64, stream: u32) -> [f32; 4] {
    pcg4d([index as u32, (index >> 32) as u32, stream, 41]).map(to_unit)
}

/// A random world of shapes, a sphere of many triangles, and 60 instances of another, some of which
/// touch or overlap.
fn builder(seed: u32) -> WorldBuilder {
    let bytes = random_bytes(seed, 12_000);
    let mut source = Source::new(&bytes);
    let mut world = source.collected::<Single>();
    source.add_sets(&mut world);
    let mut builder = world.builder;
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(latitude_longitude_sphere(1.0, 40, 80)));
    let ball: GroupId = builder.add_group();
    builder.add_mesh(ball, Arc::new(icosphere(0.5, 4)));
    for i in 0..60 {
        let u = random(i, hash32(seed));
        let place = DVec3::new(u[0].into(), u[1].into(), u[2].into()) * 4.0 - 2.0;
        let scale = DVec3::splat(f64::from(u[3]) + 0.1);
        let placed = DAffine3::from_scale_rotation_translation(scale, Default::default(), place);
        builder.add(
            WorldBuilder::ROOT,
            Instance::new(ball, Transform::new(placed).expect("not flat")),
        );
    }
    builder
}

/// The ray with this number. Half of the rays are random, a quarter start at one point, and a
/// quarter are parallel; of the latter two, neighbours are close together.
fn ray(index: u64) -> Ray {
    let u = random(index, 1);
    let v = random(index, 2);
    let point = (Vec3::new(u[0], u[1], u[2]) * 2.0 - 1.0) * 2.5;
    let screen = Vec3::new(
        (index % 512) as f32 / 256.0 - 1.0,
        (index / 512 % 512) as f32 / 256.0 - 1.0,
        1.0,
    );
    let mut ray = match index / 64 % 4 {
        0 => Ray::new(Vec3::new(0.1, 0.2, -5.0), screen),
        1 => Ray::new(screen * Vec3::new(2.0, 2.0, -4.0), Vec3::Z),
        _ => Ray::new(point, uniform_sphere(Vec2::new(v[0], v[1]))),
    };
    if v[2] < 0.2 {
        ray.t_max = v[3] * 3.0;
    }
    ray
}

#[test]
fn batches_of_any_size_on_any_number_of_threads_give_the_same_hits() {
    let rays: Vec<Ray> = (0..number("SNELL_BATCH_RAYS", 12_000) as u64).map(ray).collect();
    let mut expected: Option<Vec<[u32; 6]>> = None;
    let mut counted = 0;
    for simd in Level::ALL.into_iter().filter(|l| l.is_supported()) {
        let world =
            builder(3).build(&BuildOptions { simd, ..BuildOptions::default() }).expect("a world");
        for threads in [1, 2, 4, 7] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            for size in [1, 2, 15, 16, 17, 4096, 1_000_000] {
                for grouping in [Grouping::None, Grouping::Coherent] {
                    let mut hits = vec![Hit::MISS; rays.len()];
                    let mut blocked = vec![false; rays.len()];
                    pool.install(|| {
                        for start in (0..rays.len()).step_by(size) {
                            let range = start..(start + size).min(rays.len());
                            let (rays, world) = (&rays[range.clone()], world.parallel());
                            world
                                .closest(rays, grouping, &AcceptAll, &mut hits[range.clone()])
                                .expect("no cancel");
                            world
                                .occluded(rays, grouping, &AcceptAll, &mut blocked[range])
                                .expect("no cancel");
                        }
                    });
                    let found: Vec<[u32; 6]> = hits.iter().map(bits).collect();
                    let expected = expected.get_or_insert_with(|| found.clone());
                    let what =
                        format!("{simd}, {threads} threads, batches of {size}, {grouping:?}");
                    assert!(*expected == found, "{what}: closest hits differ");
                    assert!(
                        hits.iter().zip(&blocked).all(|(h, &b)| h.is_hit() == b),
                        "{what}: any"
                    );
                    counted += rays.len();
                }
            }
        }
    }
    let hits = expected.iter().flatten().filter(|h| **h != bits(&Hit::MISS)).count();
    assert!(hits > rays.len() / 5 && hits < rays.len(), "{hits} of {} hit", rays.len());
    println!("{counted} queries of either kind");
}

#[test]
fn closest_any_and_count_agree_whether_a_ray_hits() {
    const PIECE: u64 = 1 << 15;
    let worlds: Vec<World> = (0..8)
        .flat_map(|seed| Level::ALL.map(|simd| (seed, simd)))
        .filter(|(_, simd)| simd.is_supported())
        .map(|(seed, simd)| {
            builder(seed).build(&BuildOptions { simd, ..BuildOptions::default() }).expect("a world")
        })
        .collect();
    let pieces = (number("SNELL_RANDOM_QUERIES", 400_000) as u64).div_ceil(PIECE);
    let ask = |piece: u64| {
        let rays: Vec<Ray> = (piece * PIECE..(piece + 1) * PIECE).map(ray).collect();
        let world = &worlds[piece as usize % worlds.len()];
        let grouping = [Grouping::None, Grouping::Coherent][(piece as usize / worlds.len()) % 2];
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut blocked = vec![false; rays.len()];
        let mut counts = vec![0; rays.len()];
        world.closest(&rays[..], grouping, &AcceptAll, &mut hits);
        world.occluded(&rays[..], grouping, &AcceptAll, &mut blocked);
        world.count(&rays[..], &AcceptAll, &mut counts);
        let differ = (0..rays.len())
            .filter(|&i| hits[i].is_hit() != blocked[i] || blocked[i] != (counts[i] > 0));
        (differ.count(), blocked.iter().filter(|&&b| b).count())
    };
    let (differ, hits) =
        (0..pieces).into_par_iter().map(ask).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    println!("{} queries of each kind, {hits} hit, {differ} differ", pieces * PIECE);
    assert_eq!(differ, 0);
    assert!(hits as u64 > pieces * PIECE / 5);
}

#[test]
fn large_batches_agree_with_testing_everything() {
    let rays: Vec<Ray> = (0..number("SNELL_BATCH_RAYS", 12_000) as u64 / 12).map(ray).collect();
    let options = |accelerator| BuildOptions { accelerator, ..BuildOptions::default() };
    for seed in 0..2 {
        let all = builder(seed).build(&options(AcceleratorKind::None)).expect("a world");
        let mut expected = vec![Hit::MISS; rays.len()];
        let every = |world: &World, grouping, hits: &mut [Hit]| {
            world
                .parallel()
                .closest(Rays::from(&rays[..]), grouping, &AcceptAll, hits)
                .expect("no cancel");
        };
        every(&all, Grouping::None, &mut expected);
        for accelerator in AcceleratorKind::ALL {
            let world = builder(seed).build(&options(accelerator)).expect("a world");
            for grouping in [Grouping::None, Grouping::Coherent] {
                let mut hits = vec![Hit::MISS; rays.len()];
                every(&world, grouping, &mut hits);
                let differ = (0..rays.len()).find(|&i| bits(&hits[i]) != bits(&expected[i]));
                let pair = differ.map(|i| (rays[i], hits[i], expected[i]));
                assert!(
                    pair.is_none(),
                    "{}, {grouping:?}, seed {seed}: {pair:?}",
                    accelerator.name()
                );
            }
        }
    }
}
