use super::*;
use crate::InsideMethod;
use crate::hit::Hit;
use crate::search::AcceptAll;
use crate::shape::Sphere;
use crate::world::double::DWorldBuilder;
use crate::world::tests::{Random, default_world, double_sphere, nested_scene};
use crate::world::{BuildOptions, WorldBuilder};
use snell_math::{DRay, DVec3, Ray, Transform, Vec3};
use std::sync::Arc;

/// Compares the results of different pieces and numbers of threads with those of the world's own
/// queries.
fn check<W: Queries>(world: &W, rays: Rays<Of<W>>, limited: Points<Of<W>>, zero: DistanceOf<W>) {
    let (n, m) = (rays.len(), limited.len());
    let (mut hits, mut blocked, mut counts) =
        (vec![HitOf::<W>::default(); n], vec![false; n], vec![0; n]);
    world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
    world.occluded(rays, Grouping::None, &AcceptAll, &mut blocked);
    world.count(rays, &AcceptAll, &mut counts);
    let all = world.all(rays, &AcceptAll);
    let (mut nearest, mut distances) = (vec![NearestOf::<W>::default(); m], vec![zero; m]);
    world.nearest_point(limited, &mut nearest);
    world.signed_distance(limited, &mut distances);
    let (mut numbers, mut inside) = (vec![0.0; m], vec![false; m]);
    world.winding_number(limited, &mut numbers);
    world.occupancy(limited, &mut inside);
    let is_mixed = |answers: &[bool]| answers.iter().any(|&it| it) && answers.iter().any(|&it| !it);
    assert!(is_mixed(&blocked) && is_mixed(&inside) && counts.iter().any(|&count| count > 1));

    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        for piece in [1, 64, 500, usize::MAX] {
            let parallel = Parallel { world, piece: None, cancel: None }.with_piece(piece);
            pool.install(|| {
                let (mut h, mut b, mut c) =
                    (vec![HitOf::<W>::default(); n], vec![false; n], vec![0; n]);
                parallel.closest(rays, Grouping::None, &AcceptAll, &mut h)?;
                parallel.occluded(rays, Grouping::Coherent, &AcceptAll, &mut b)?;
                parallel.count(rays, &AcceptAll, &mut c)?;
                assert!(h == hits && b == blocked && c == counts, "{threads} {piece}");
                let again = parallel.all(rays, &AcceptAll)?;
                assert!(
                    again.hits == all.hits && again.ray_splits == all.ray_splits,
                    "{threads} {piece}"
                );
                let (mut p, mut d) = (vec![NearestOf::<W>::default(); m], vec![zero; m]);
                parallel.nearest_point(limited, &mut p)?;
                parallel.signed_distance(limited, &mut d)?;
                let (mut w, mut o) = (vec![0.0; m], vec![false; m]);
                parallel.winding_number(limited, &mut w)?;
                parallel.occupancy(limited, &mut o)?;
                assert!(
                    p == nearest && d == distances && w == numbers && o == inside,
                    "{threads} {piece}"
                );
                Ok::<(), Cancelled>(())
            })
            .expect("not cancelled");
        }
    }
}

#[test]
fn answers_do_not_depend_on_threads_or_pieces() {
    let mut random = Random(5);
    let rays: Vec<Ray> =
        (0..1000).map(|_| Ray::new(random.point(3.0), random.direction())).collect();
    let masks: Vec<u64> = (0..1000).map(|i| if i % 3 == 0 { 1 } else { u64::MAX }).collect();
    let points: Vec<Vec3> = (0..60).map(|_| random.point(3.0)).collect();
    let limits: Vec<f32> = (0..60).map(|i| 0.05 * i as f32).collect();
    let method = InsideMethod::Winding;
    let limited = Points { max_distances: &limits, method, ..Points::new(&points) };
    check(&default_world(nested_scene(2)), Rays::new(&rays).with_masks(&masks), limited, 0.0);

    // A ball of radius a millimetre in a city, and a larger one around it.
    let place = DVec3::new(500_000.123, 4_649_776.22, 300.0);
    let mut builder = DWorldBuilder::default();
    for radius in [1e-3, 2e-3] {
        builder.add_mesh(DWorldBuilder::ROOT, Arc::new(double_sphere(place, radius, 20, 40)));
    }
    let world = builder.build(&BuildOptions::default()).expect("two meshes");
    let moved = |p: Vec3| place + p.as_dvec3() * 1e-3;
    let rays: Vec<DRay> =
        rays.iter().map(|ray| DRay::new(moved(ray.origin), ray.direction.as_dvec3())).collect();
    let points: Vec<DVec3> = points.into_iter().map(moved).collect();
    let limits: Vec<f64> = limits.iter().map(|&limit| f64::from(limit) * 1e-3).collect();
    let limited = Points { max_distances: &limits, ..Points::of_doubles(&points) };
    check(&world, Rays::new(&rays).with_masks(&masks), limited, 0.0);
}

#[test]
fn a_flag_stops_a_query_before_its_end() {
    let world = default_world(nested_scene(2));
    let rays = vec![Ray::new(Vec3::ZERO, Vec3::X); 100_000];
    let flag = AtomicBool::new(false);
    let parallel = world.parallel().with_cancel(&flag);
    let mut counts = vec![u32::MAX; rays.len()];
    assert_eq!(parallel.count(&rays, &AcceptAll, &mut counts), Ok(()));
    flag.store(true, Ordering::Relaxed);
    counts.fill(u32::MAX);
    assert_eq!(parallel.count(&rays, &AcceptAll, &mut counts), Err(Cancelled));
    assert!(counts.iter().all(|&c| c == u32::MAX));
    assert_eq!(parallel.all(&rays, &AcceptAll), Err(Cancelled));
    assert_eq!(parallel.occupancy(&[Vec3::ZERO], &mut [false]), Err(Cancelled));

    // A filter that sets the flag while the query runs.
    struct Stop<'a>(&'a AtomicBool);
    impl HitFilter for Stop<'_> {
        fn accept(&self, _: &Ray, _: &Hit) -> bool {
            self.0.store(true, Ordering::Relaxed);
            true
        }
    }
    let mut builder = nested_scene(2);
    (0..builder.geometries.len() as u32).for_each(|g| builder.set_filtered(crate::GeometryId(g)));
    let world = default_world(builder);
    let flag = AtomicBool::new(false);
    let mut random = Random(6);
    let rays: Vec<Ray> =
        (0..100_000).map(|_| Ray::new(random.point(3.0), random.direction())).collect();
    let parallel = world.parallel().with_cancel(&flag);
    assert_eq!(parallel.count(&rays, &Stop(&flag), &mut counts), Err(Cancelled));
    assert!(counts.contains(&u32::MAX));
}

#[test]
fn a_flag_stops_a_ray_through_more_instances_than_it_could_ever_enter() {
    // A ball placed twice at nearly the same place, 30 times: a billion balls on each ray.
    let mut builder = WorldBuilder::default();
    let mut below = builder.add_group();
    builder.add_shape(below, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
    for level in 1..=30 {
        let pair = if level == 30 { WorldBuilder::ROOT } else { builder.add_group() };
        for x in [-1e-9, 1e-9] {
            builder.add_instance(pair, below, Transform::translation(DVec3::new(x, 0.0, 0.0)));
        }
        below = pair;
    }
    let world = default_world(builder);
    // Through a corner of the box, past the ball.
    let ray = Ray::new(Vec3::new(0.9, 0.9, -5.0), Vec3::Z);
    assert_eq!(world.instances_entered(&ray, 1000), 1000);
    let start = std::time::Instant::now();
    for count in [1, 2, 1000] {
        let (flag, rays) = (AtomicBool::new(false), vec![ray; count]);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(std::time::Duration::from_millis(50));
                flag.store(true, Ordering::Relaxed);
            });
            let parallel = world.parallel().with_cancel(&flag);
            let (mut hits, mut blocked) = (vec![Hit::MISS; count], vec![false; count]);
            let mut counts = vec![0; count];
            for grouping in [Grouping::None, Grouping::Coherent] {
                assert!(parallel.closest(&rays, grouping, &AcceptAll, &mut hits).is_err());
                assert!(parallel.occluded(&rays, grouping, &AcceptAll, &mut blocked).is_err());
            }
            assert!(parallel.count(&rays, &AcceptAll, &mut counts).is_err());
        });
    }
    assert!(start.elapsed().as_secs() < 30, "{:?}", start.elapsed());
}
