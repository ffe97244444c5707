use super::*;
use crate::search::{AcceptAll, Grouping};
use crate::world::WorldBuilder;
use crate::world::double::DWorldBuilder;
use crate::world::tests::{Random, default_world, double_sphere, nested_scene, sphere_mesh};
use snell_math::{DVec3, Vec3};
use std::sync::Arc;

const SIDES: [Side; 2] = [Side::Front, Side::Back];

/// True if a hit counts, by the normal of its surface; `None` near the border between both.
fn counts(world: &World, ray: &Ray, hit: &Hit, culled: Side) -> Option<bool> {
    let normal = world.interaction(ray, hit).geometric_normal;
    let slope = normal.dot(ray.direction.normalize());
    (slope.abs() > 1e-4).then_some((slope < 0.0) == (culled == Side::Back))
}

#[test]
fn culled_queries_find_the_hits_on_the_other_side() {
    for seed in 0..4 {
        let world = default_world(nested_scene(seed));
        let mut random = Random(seed + 90);
        let rays: Vec<Ray> = (0..600)
            .map(|_| {
                let from = random.point(4.0);
                Ray::new(from, random.point(2.0) - from)
            })
            .collect();
        let all = world.all(&rays, &AcceptAll);
        for side in SIDES {
            let filter = Culled::new(&world, side);
            let (mut hits, mut blocked) = (vec![Hit::MISS; 600], vec![false; 600]);
            let mut found = vec![0; 600];
            world.closest(&rays, Grouping::Coherent, &filter, &mut hits);
            world.occluded(&rays, Grouping::Coherent, &filter, &mut blocked);
            world.count(&rays, &filter, &mut found);
            let listed = world.all(&rays, &filter);
            let mut tested = 0;
            for (i, ray) in rays.iter().enumerate() {
                let row: Option<Vec<Hit>> = all
                    .of_ray(i)
                    .iter()
                    .map(|hit| counts(&world, ray, hit, side).map(|it| it.then_some(*hit)))
                    .collect::<Option<Vec<_>>>()
                    .map(|row| row.into_iter().flatten().collect());
                let Some(row) = row else { continue };
                tested += 1;
                assert_eq!(listed.of_ray(i), row, "{seed} {side:?} {i}");
                assert_eq!(hits[i], row.first().copied().unwrap_or(Hit::MISS));
                assert_eq!((blocked[i], found[i] as usize), (!row.is_empty(), row.len()));
            }
            assert!(tested > 400);
        }
    }
}

#[test]
fn a_closed_mesh_stays_closed_from_the_side_that_is_seen() {
    let mesh = sphere_mesh(Vec3::ZERO, 1.0, 12, 14);
    let double = double_sphere(DVec3::ZERO, 1.0, 12, 14);
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh.clone()));
    let world = default_world(builder);
    let mut builder = DWorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(double));
    let exact = builder.build(&crate::BuildOptions::default()).expect("a world");
    // Through vertices and the middles of edges, exactly or nearly.
    let mut targets = mesh.positions.clone();
    for &[a, b, c] in &mesh.indices {
        let [a, b, c] = [a, b, c].map(|i| mesh.positions[i as usize]);
        targets.extend([(a + b) * 0.5, (b + c) * 0.5]);
    }
    for target in targets {
        let from_inside = Ray::new(Vec3::ZERO, target);
        let from_outside = Ray::new(target * 4.0, -target);
        for (ray, culled) in [(from_inside, Side::Front), (from_outside, Side::Back)] {
            let same = world.closest_one(&ray, &AcceptAll);
            assert_eq!(world.closest_one(&ray, &Culled::new(&world, culled)), same);
            let ray = DRay::from(&ray);
            let same = exact.closest_one(&ray, &AcceptAll);
            assert_eq!(exact.closest_one(&ray, &Culled::new(&exact, culled)), same);
            assert!(same.is_hit());
        }
        let other = Culled::new(&world, Side::Back);
        assert!(!world.occluded_one(&from_inside, &other), "nothing is seen from inside");
    }
}
