use super::*;
use crate::search::AcceptAll;
use crate::shape::Sphere;
use crate::world::tests::{Random, build, default_world, mesh_world, nested_scene, sphere_mesh};
use crate::world::{AcceleratorKind, GeometryId, WorldBuilder};
use proptest::prelude::*;
use snell_math::simd::Level;
use snell_math::{Ray, Transform, Vec2, Vec3};
use std::sync::{Arc, OnceLock};

fn rays(seed: u32, count: usize) -> Vec<Ray> {
    let mut random = Random(seed);
    let mut rays: Vec<Ray> = (0..count)
        .map(|i| {
            let from = random.point(5.0);
            let mut ray = Ray::new(from, random.point(2.0) - from);
            if i % 5 == 0 {
                (ray.t_min, ray.t_max) = (random.range(-1.0, 1.0), random.range(0.5, 2.0));
            }
            ray
        })
        .collect();
    rays[3].direction = Vec3::ZERO;
    rays[count - 1].origin.x = f32::NAN;
    rays
}

struct Odd;
impl HitFilter for Odd {
    fn accept(&self, _: &Ray, hit: &Hit) -> bool {
        hit.primitive % 2 == 1
    }
}

#[test]
fn all_count_closest_and_occluded_agree() {
    for seed in 0..3 {
        let mut builder = nested_scene(seed);
        (0..builder.geometries.len() as u32)
            .step_by(3)
            .for_each(|g| builder.set_filtered(GeometryId(g)));
        let oracle = build(builder.clone(), AcceleratorKind::None, Level::Scalar);
        let world = default_world(builder);
        let rays = rays(seed, 700);
        let n = rays.len();
        for filter in [&AcceptAll as &dyn HitFilter, &Odd] {
            let all = world.all(&rays, filter);
            let mut hits = vec![Hit::MISS; n];
            let mut occluded = vec![false; n];
            let mut counts = vec![9; n];
            let mut distinct = vec![9; n];
            world.closest(&rays, crate::Grouping::None, filter, &mut hits);
            world.occluded(&rays, Grouping::None, filter, &mut occluded);
            world.count(&rays, filter, &mut counts);
            world.searcher(filter).count_distinct(Rays::new(&rays), 8, &mut distinct);
            assert_eq!(all.ray_count(), n);
            for i in 0..n {
                let row = all.of_ray(i);
                assert!(row.windows(2).all(|w| !w[1].is_before(&w[0])), "{i}");
                assert_eq!(row, oracle.all_one(&rays[i], filter));
                assert_eq!(row.first().copied().unwrap_or(Hit::MISS), hits[i]);
                assert_eq!(occluded[i], hits[i].is_hit());
                assert_eq!(counts[i] as usize, row.len());
                assert_eq!(distinct[i] as usize, row.len(), "{i} {row:?}");
            }
            assert!(counts.iter().any(|&c| c > 8), "the small buffer must overflow");
        }
    }
}

#[test]
fn the_first_hits_are_the_start_of_all_and_counting_stops() {
    for (seed, accelerator) in [
        (0, AcceleratorKind::Bvh),
        (1, AcceleratorKind::Bvh),
        (2, AcceleratorKind::None),
        (3, AcceleratorKind::Bvh),
    ] {
        let mut builder = nested_scene(seed);
        (0..builder.geometries.len() as u32)
            .step_by(3)
            .for_each(|g| builder.set_filtered(GeometryId(g)));
        let world = build(builder, accelerator, Level::best());
        let rays = rays(seed, 150);
        for filter in [&AcceptAll as &dyn HitFilter, &Odd] {
            let all = world.all(&rays, filter);
            for most in [0, 1, 2, 7, 50, 5000] {
                let first = world.first(&rays, filter, most);
                let mut counts = vec![9; rays.len()];
                world.count_to(&rays, filter, most as u32, &mut counts);
                for (i, &count) in counts.iter().enumerate() {
                    let row = all.of_ray(i);
                    let row = &row[..row.len().min(most)];
                    assert_eq!(first.of_ray(i), row, "{seed} {most} {i}");
                    assert_eq!(count as usize, row.len(), "{seed} {most} {i}");
                }
            }
        }
    }
}

#[test]
fn a_hit_that_is_offered_again_counts_once_unless_it_is_a_shape() {
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(sphere_mesh(Vec3::ZERO, 1.0, 4, 4)));
    builder.add_shape(WorldBuilder::ROOT, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
    let world = default_world(builder);
    let hit =
        |t: f32, geometry, primitive| Hit { t, uv: Vec2::ZERO, instance: 0, geometry, primitive };
    // 20 triangles, each reported three times, and a shape crossed twice at one distance, again and
    // again from far to near.
    let mut offers = Vec::new();
    for _ in 0..3 {
        offers.extend((0..20).rev().map(|i| hit(1.0 + (i / 2) as f32, 0, i)));
    }
    offers.extend([hit(5.5, 1, 0), hit(5.5, 1, 0)]);
    for buffer in [4, 6, 8, 64] {
        let ray = Ray::new(Vec3::ZERO, Vec3::X);
        let mut count = 0;
        let mut after: Option<Key<Single>> = None;
        for _ in 0..100 {
            let mut goal = Distinct { after, ..Distinct::new(&ray, &world.geometries, buffer) };
            for offer in &offers {
                if offer.t <= goal.limit() && !goal.is_past(offer) && goal.wants(offer) {
                    goal.take(*offer);
                }
                assert!(goal.found.len() <= buffer);
            }
            let (found, last) = goal.finish();
            count += found;
            after = last;
            if after.is_none() {
                break;
            }
        }
        assert_eq!(count, 22, "{buffer}");
    }
}

#[test]
fn a_closed_mesh_is_crossed_an_even_number_of_times_and_odd_from_inside() {
    let world = mesh_world(sphere_mesh(Vec3::ZERO, 1.0, 30, 40));
    let mut random = Random(7);
    let from = |origin: Vec3, random: &mut Random| Ray::new(origin, random.direction());
    let outside: Vec<Ray> = (0..300).map(|_| from(Vec3::new(2.0, 0.0, 0.0), &mut random)).collect();
    let inside: Vec<Ray> = (0..300).map(|_| from(Vec3::new(0.1, 0.2, 0.3), &mut random)).collect();
    let mut counts = [0; 300];
    world.count(&outside, &AcceptAll, &mut counts);
    assert!(counts.iter().all(|&c| c == 0 || c == 2) && counts.contains(&2));
    world.count(&inside, &AcceptAll, &mut counts);
    assert_eq!(counts, [1; 300]);
}

#[test]
fn invalid_rays_are_counted_by_their_first_fault() {
    let good = Ray::new(Vec3::ZERO, Vec3::X);
    let rays = [
        good,
        Ray { origin: Vec3::NAN, direction: Vec3::ZERO, ..good },
        Ray { direction: Vec3::new(f32::INFINITY, 0.0, 0.0), ..good },
        Ray { direction: Vec3::ZERO, t_max: -1.0, ..good },
        Ray { t_max: 0.0, ..good },
        Ray { t_min: f32::NAN, ..good },
    ];
    let counts = Rays::new(&rays).count_invalid();
    assert_eq!(
        counts,
        crate::InvalidRays { not_finite: 2, without_direction: 1, empty_interval: 2 }
    );
    assert_eq!(counts.total(), rays.iter().filter(|r| !r.is_valid()).count());
    let empty = default_world(WorldBuilder::default());
    assert_eq!(empty.all(&rays, &AcceptAll), AllHits { ray_splits: vec![0; 7], hits: vec![] });
    assert_eq!(empty.all(&[], &AcceptAll).ray_count(), 0);
}

fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        8 => -3.0f32..3.0,
        4 => (-3i32..=3).prop_map(|i| i as f32),
        1 => prop::sample::select(
            vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-42, -1e30, f32::MAX, -0.0]
        ),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn any_is_closest_is_count_is_all(
        seed in 0usize..4,
        numbers in prop::collection::vec(prop::array::uniform8(number()), 1..40),
    ) {
        static WORLDS: OnceLock<Vec<World>> = OnceLock::new();
        let make = || (0..4).map(|seed| default_world(nested_scene(seed))).collect();
        let worlds = WORLDS.get_or_init(make);
        let world = &worlds[seed];
        let vector = |n: &[f32]| Vec3::new(n[0], n[1], n[2]);
        let rays: Vec<Ray> = numbers
            .iter()
            .map(|n| Ray {
                origin: vector(n),
                direction: vector(&n[3..]),
                t_min: n[6],
                t_max: n[6] + n[7].abs(),
            })
            .collect();
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![true; rays.len()]);
        let mut counts = vec![7; rays.len()];
        world.closest(&rays, crate::Grouping::None, &AcceptAll, &mut hits);
        world.occluded(&rays, Grouping::None, &AcceptAll, &mut blocked);
        world.count(&rays, &AcceptAll, &mut counts);
        let all = world.all(&rays, &AcceptAll);
        for i in 0..rays.len() {
            prop_assert_eq!(hits[i].is_hit(), blocked[i]);
            prop_assert_eq!(hits[i].is_hit(), counts[i] > 0);
            prop_assert_eq!(counts[i] as usize, all.of_ray(i).len());
            prop_assert!(rays[i].is_valid() || counts[i] == 0);
        }
    }
}
