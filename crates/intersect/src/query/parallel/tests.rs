use super::*;
use crate::query::AcceptAll;
use crate::world::tests::{Random, default_world, nested_scene};
use snell_math::Ray;

#[test]
fn answers_do_not_depend_on_threads_or_pieces() {
    let world = default_world(nested_scene(2));
    let mut random = Random(5);
    let rays: Vec<Ray> = (0..1000).map(|_| Ray::new(random.point(3.0), random.direction())).collect();
    let masks: Vec<u32> = (0..1000).map(|i| if i % 3 == 0 { 1 } else { u32::MAX }).collect();
    let rays = Rays::new(&rays).with_masks(&masks);
    let points: Vec<Vec3> = (0..60).map(|_| random.point(3.0)).collect();
    let limits: Vec<f32> = (0..60).map(|i| 0.05 * i as f32).collect();
    let limited = Points { max_distances: &limits, ..Points::new(&points) };

    let (mut hits, mut blocked, mut counts) = (vec![Hit::MISS; 1000], vec![false; 1000], vec![0; 1000]);
    world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
    world.occluded(rays, Grouping::None, &AcceptAll, &mut blocked);
    world.count(rays, &AcceptAll, &mut counts);
    let all = world.all(rays, &AcceptAll);
    let (mut nearest, mut distances) = (vec![NearestPoint::NONE; 60], vec![0.0; 60]);
    world.nearest_point(limited, &mut nearest);
    world.signed_distance(limited, &mut distances);
    let (mut numbers, mut inside) = (vec![0.0; 60], vec![false; 60]);
    world.winding_number(&points, &mut numbers);
    world.occupancy(&points, &mut inside);

    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        for piece in [1, 64, 500, usize::MAX] {
            let parallel = world.parallel().with_piece(piece);
            pool.install(|| {
                let (mut h, mut b, mut c) = (vec![Hit::MISS; 1000], vec![false; 1000], vec![0; 1000]);
                parallel.closest(rays, Grouping::None, &AcceptAll, &mut h)?;
                parallel.occluded(rays, Grouping::Coherent, &AcceptAll, &mut b)?;
                parallel.count(rays, &AcceptAll, &mut c)?;
                assert!(h == hits && b == blocked && c == counts, "{threads} {piece}");
                assert_eq!(parallel.all(rays, &AcceptAll)?, all);
                let (mut n, mut d) = (vec![NearestPoint::NONE; 60], vec![0.0; 60]);
                parallel.nearest_point(limited, &mut n)?;
                parallel.signed_distance(limited, &mut d)?;
                let (mut w, mut o) = (vec![0.0; 60], vec![false; 60]);
                parallel.winding_number(&points, &mut w)?;
                parallel.occupancy(&points, &mut o)?;
                assert!(n == nearest && d == distances && w == numbers && o == inside, "{threads} {piece}");
                Ok::<(), Cancelled>(())
            })
            .expect("nobody cancels");
        }
    }
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

    // Set while it runs, by the filter.
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
    let rays: Vec<Ray> = (0..100_000).map(|_| Ray::new(random.point(3.0), random.direction())).collect();
    let parallel = world.parallel().with_cancel(&flag);
    assert_eq!(parallel.count(&rays, &Stop(&flag), &mut counts), Err(Cancelled));
    assert!(counts.contains(&u32::MAX));
}
