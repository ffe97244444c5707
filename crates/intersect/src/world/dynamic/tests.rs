use super::*;
use crate::hit::Hit;
use crate::search::AcceptAll;
use crate::shape::{AnyShape, Sphere};
use crate::world::tests::{Random, nested_scene, soup, sphere_mesh};
use crate::world::{AcceleratorKind, EditError, Geometry, GeometryId, GroupId, InstanceId, Reuse};
use crate::{Grouping, NearestPoint};
use snell_math::{DVec3, Ray, Transform, Vec3};
use std::sync::atomic::{AtomicBool, Ordering};

const ROOT: GroupId = WorldBuilder::ROOT;

fn rays(seed: u32, count: usize) -> Vec<Ray> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let from = random.point(6.0);
            Ray::new(from, random.point(2.0) - from)
        })
        .collect()
}

fn closest(world: &World, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    world.closest(rays, Grouping::None, &AcceptAll, &mut hits);
    hits
}

/// Panics unless a committed world gives the same results as a world built from scratch.
fn check(committed: &World, dynamic: &mut DynamicWorld, rays: &[Ray]) {
    let options = dynamic.options.clone();
    let fresh = dynamic.edit().clone().build(&options).expect("a world");
    assert_eq!(closest(committed, rays), closest(&fresh, rays));
    assert_eq!(
        committed.all(&rays[..rays.len() / 4], &AcceptAll),
        fresh.all(&rays[..rays.len() / 4], &AcceptAll)
    );
    let points: Vec<Vec3> = rays.iter().take(20).map(|r| r.origin).collect();
    let mut nearest = [vec![NearestPoint::NONE; 20], vec![NearestPoint::NONE; 20]];
    committed.nearest_point(&points, &mut nearest[0]);
    fresh.nearest_point(&points, &mut nearest[1]);
    assert_eq!(nearest[0], nearest[1]);
    assert_eq!(committed.bounds(), fresh.bounds());
    let (a, b) = (committed.stats(), fresh.stats());
    assert_eq!(
        (a.triangles, a.skipped_triangles, a.instanced_triangles),
        (b.triangles, b.skipped_triangles, b.instanced_triangles)
    );
}

/// The objects among which random edits choose.
#[derive(Default)]
struct Contents {
    groups: Vec<GroupId>,
    geometries: Vec<GeometryId>,
    instances: Vec<InstanceId>,
}

fn pick<T: Copy>(random: &mut Random, from: &[T]) -> Option<T> {
    from.get((random.unit() * from.len() as f32) as usize).copied()
}

/// Makes one random edit of any kind.
fn edit(builder: &mut WorldBuilder, contents: &mut Contents, random: &mut Random) {
    let group = pick(random, &contents.groups).expect("the root at least");
    let (geometry, instance) =
        (pick(random, &contents.geometries), pick(random, &contents.instances));
    match ((random.unit() * 10.0) as u32, geometry, instance) {
        (0, ..) => {
            let triangles = if random.unit() < 0.5 { 40 } else { 1500 };
            contents.geometries.push(builder.add_mesh(group, Arc::new(soup(random, triangles))));
        }
        (1, ..) => {
            let placed = random.transform(2.0);
            contents.geometries.push(builder.add_shape(
                group,
                Arc::new(Sphere { radius: 0.4 }),
                placed,
            ));
        }
        (2, Some(id), _) => {
            builder.remove(id);
        }
        (3 | 4, Some(id), _) => {
            if let Geometry::Mesh(mesh) = builder.geometries[id.0 as usize].clone() {
                let moved = mesh.positions.iter().map(|&p| p + random.point(0.02)).collect();
                let expected = builder.group_of(id).map(|_| ()).ok_or(EditError::Removed(id.0));
                assert_eq!(builder.set_positions(id, moved), expected);
            }
        }
        (5, Some(id), _) => {
            let shape = AnyShape::from(Sphere { radius: 0.3 });
            let _ = builder.replace(id, Geometry::Shape(Arc::new(shape), random.transform(2.0)));
        }
        (6, ..) => {
            // Children have higher numbers than their parents, so there are no cycles.
            let child = builder.add_group();
            contents.groups.push(child);
            contents.geometries.push(builder.add_mesh(child, Arc::new(soup(random, 30))));
            for _ in 0..2 {
                contents.instances.push(builder.add_instance(group, child, random.transform(2.0)));
            }
        }
        (7, _, Some(id)) => {
            builder.remove_instance(id);
        }
        (8, Some(id), _) => builder.set_mask(id, if random.unit() < 0.3 { 0 } else { u64::MAX }),
        (_, _, Some(id)) => {
            builder.move_instance(id, random.transform(2.0));
        }
        _ => {}
    }
}

#[test]
fn after_any_edits_a_commit_answers_as_a_world_built_from_nothing() {
    for (seed, accelerator) in
        [(1, AcceleratorKind::Bvh), (2, AcceleratorKind::Bvh), (3, AcceleratorKind::None)]
    {
        let mut random = Random(seed * 31);
        let mut world = DynamicWorld::new(BuildOptions { accelerator, ..BuildOptions::default() });
        let mut contents = Contents { groups: vec![ROOT], ..Contents::default() };
        let rays = rays(seed, 120);
        let mut total = Reuse::default();
        let mut old: Vec<(Arc<World>, Vec<Hit>)> = Vec::new();
        for _ in 0..50 {
            for _ in 0..1 + (random.unit() * 3.0) as u32 {
                edit(world.edit(), &mut contents, &mut random);
            }
            let committed = world.commit().expect("no limit is near");
            check(&committed, &mut world, &rays);
            let reuse = committed.stats().reuse;
            total.kept += reuse.kept;
            total.refitted += reuse.refitted;
            total.built += reuse.built;
            old.push((committed.clone(), closest(&committed, &rays)));
        }
        // Old snapshots must be unchanged.
        for (snapshot, hits) in &old {
            assert_eq!(&closest(snapshot, &rays), hits);
        }
        if accelerator == AcceleratorKind::Bvh {
            assert!(total.kept > 10 && total.built > 10 && total.refitted > 2, "{total:?}");
        }
    }
}

fn ball_world() -> (DynamicWorld, GroupId, GeometryId, InstanceId) {
    let mut world = DynamicWorld::new(BuildOptions::default());
    let ball = world.edit().add_group();
    let mesh = world.edit().add_mesh(ball, Arc::new(sphere_mesh(Vec3::ZERO, 1.0, 40, 60)));
    let instance = world.edit().add_instance(ROOT, ball, Transform::IDENTITY);
    world.edit().add_instance(ROOT, ball, Transform::translation(DVec3::new(5.0, 0.0, 0.0)));
    (world, ball, mesh, instance)
}

#[test]
fn only_what_changed_is_built() {
    let (mut world, _, mesh, instance) = ball_world();
    let reuse = |world: &mut DynamicWorld| world.commit().expect("a world").stats().reuse;
    assert_eq!(reuse(&mut world), Reuse { kept: 0, refitted: 0, built: 2 });
    assert_eq!(reuse(&mut world), Reuse { kept: 2, refitted: 0, built: 0 });
    world.edit().move_instance(instance, Transform::translation(DVec3::Y));
    assert_eq!(reuse(&mut world), Reuse { kept: 1, refitted: 0, built: 1 });
    // All vertices move outwards a little: the ball's tree is refitted, and its new size makes the
    // root rebuild.
    let grown = sphere_mesh(Vec3::ZERO, 1.1, 40, 60).positions;
    world.edit().set_positions(mesh, grown).expect("as many");
    assert_eq!(reuse(&mut world), Reuse { kept: 0, refitted: 1, built: 1 });
    // All vertices move to random positions: the old tree is useless.
    let mut random = Random(4);
    let n = sphere_mesh(Vec3::ZERO, 1.0, 40, 60).positions.len();
    let anywhere = (0..n).map(|_| random.point(1.0)).collect();
    world.edit().set_positions(mesh, anywhere).expect("as many");
    assert_eq!(reuse(&mut world), Reuse { kept: 0, refitted: 0, built: 2 });
    // Changing a mask rebuilds nothing.
    world.edit().set_mask(mesh, 2);
    assert_eq!(reuse(&mut world), Reuse { kept: 2, refitted: 0, built: 0 });
}

#[test]
fn slow_wear_is_noticed_over_many_commits() {
    let mut world = DynamicWorld::new(BuildOptions::default());
    let mesh = sphere_mesh(Vec3::ZERO, 1.0, 40, 60);
    let id = world.edit().add_mesh(ROOT, Arc::new(mesh.clone()));
    let mut random = Random(12);
    let mut positions = mesh.positions;
    let mut total = Reuse::default();
    for _ in 0..30 {
        positions.iter_mut().for_each(|p| *p += random.point(0.03));
        world.edit().set_positions(id, positions.clone()).expect("as many");
        let reuse = world.commit().expect("a world").stats().reuse;
        total.refitted += reuse.refitted;
        total.built += reuse.built;
    }
    assert!(total.refitted > 10 && total.built > 1, "{total:?}");
}

#[test]
fn numbers_stay_when_others_are_removed() {
    let (mut world, ball, mesh, first) = ball_world();
    let sphere = world.edit().add_shape(
        ROOT,
        Arc::new(Sphere { radius: 0.5 }),
        Transform::translation(DVec3::Z * 9.0),
    );
    let last = world.edit().add_instance(ROOT, ball, Transform::translation(DVec3::Y * 9.0));
    assert!(world.edit().remove_instance(first) && !world.edit().remove_instance(first));
    assert!(world.edit().remove(mesh) && !world.edit().remove(mesh));
    let other = world.edit().add_mesh(ball, Arc::new(sphere_mesh(Vec3::ZERO, 1.0, 10, 10)));
    assert_eq!((mesh.0, sphere.0, other.0), (0, 1, 2));
    let now = world.commit().expect("a world");
    let hit = now.closest_one(&Ray::new(Vec3::new(0.0, 20.0, 0.0), -Vec3::Y), &AcceptAll);
    assert_eq!(hit.geometry, other.0);
    assert_eq!(now.instance_id(hit.instance), Some(last));
    let hit = now.closest_one(&Ray::new(Vec3::new(0.0, 0.0, 20.0), -Vec3::Z), &AcceptAll);
    assert_eq!((hit.geometry, now.instance_id(hit.instance)), (sphere.0, None));
    assert!(matches!(now.geometry(mesh), Geometry::Mesh(empty) if empty.indices.is_empty()));
    assert_eq!(world.edit().replace(mesh, now.geometry(other).clone()), Err(EditError::Removed(0)));
    assert_eq!(world.edit().set_positions(sphere, vec![]), Err(EditError::NotAMesh(1)));
    assert!(matches!(world.edit().set_positions(other, vec![]), Err(EditError::Mesh(_))));
    assert!(!world.edit().move_instance(first, Transform::IDENTITY));
}

#[test]
fn a_refused_commit_leaves_the_snapshot_and_the_edits() {
    let (mut world, ball, _, _) = ball_world();
    let good = world.commit().expect("a world");
    let cycle = world.edit().add_instance(ball, ROOT, Transform::IDENTITY);
    assert_eq!(world.commit().err(), Some(WorldError::Cycle(0)));
    assert!(Arc::ptr_eq(&world.snapshot(), &good));
    world.edit().remove_instance(cycle);
    assert!(world.commit().is_ok());
    assert!(DynamicWorld::new(BuildOptions::default()).snapshot().bounds().is_empty());
}

#[test]
fn readers_keep_their_snapshot_while_a_new_one_is_built() {
    let mut world = DynamicWorld::from_builder(nested_scene(3), BuildOptions::default());
    world.commit().expect("a world");
    let rays = rays(9, 200);
    let (snapshots, stop) = (world.snapshots(), AtomicBool::new(false));
    let seen = std::thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut seen = std::collections::BTreeSet::new();
            let mut newest = snapshots.current();
            while !stop.load(Ordering::Relaxed) {
                let hits = closest(&newest, &rays);
                assert_eq!(hits, closest(&newest, &rays), "a snapshot changed while it was read");
                seen.insert(newest.geometry_count());
                newest = snapshots.current();
            }
            seen.insert(newest.geometry_count());
            seen
        });
        for i in 0..20u8 {
            let placed = Transform::translation(DVec3::splat(f64::from(i) * 0.1));
            world.edit().add_shape(ROOT, Arc::new(Sphere { radius: 0.3 }), placed);
            world.commit().expect("a world");
        }
        stop.store(true, Ordering::Relaxed);
        reader.join().expect("the reader")
    });
    assert_eq!(seen.last(), Some(&world.snapshot().geometry_count()));
}

#[test]
fn an_older_world_of_another_structure_is_no_hindrance() {
    let (mut world, ..) = ball_world();
    let bvh = world.commit().expect("a world");
    let none = BuildOptions { accelerator: AcceleratorKind::None, ..BuildOptions::default() };
    let plain = world.edit().rebuild(&none, &bvh).expect("a world");
    let again = world.edit().rebuild(&BuildOptions::default(), &plain).expect("a world");
    let rays = rays(5, 100);
    assert_eq!(closest(&plain, &rays), closest(&bvh, &rays));
    assert_eq!(closest(&again, &rays), closest(&bvh, &rays));
    // The old world may also be that of an unrelated builder.
    let other = nested_scene(1).build(&BuildOptions::default()).expect("a world");
    let again = world.edit().rebuild(&BuildOptions::default(), &other).expect("a world");
    assert_eq!(closest(&again, &rays), closest(&bvh, &rays));
}
