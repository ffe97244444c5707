//! Tests of instances of instances and of their numbers.

use super::*;

/// A chain of groups, each holding the next, with a sphere in the last.
fn chain(length: usize) -> WorldBuilder {
    let mut builder = WorldBuilder::default();
    let mut group = WorldBuilder::ROOT;
    for i in 0..length {
        let child = builder.add_group();
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        builder.add_instance(group, child, Transform::translation(DVec3::X * side));
        group = child;
    }
    builder.add_shape(group, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
    builder
}

#[test]
fn instances_nest_512_deep_and_no_deeper() {
    let ray = Ray::new(Vec3::new(0.0, 0.0, -5.0), Vec3::Z);
    for accelerator in AcceleratorKind::ALL {
        let world = build(chain(512), accelerator, Level::best());
        let hit = world.closest_one(&ray, &AcceptAll);
        assert_eq!((hit.t, hit.instance, hit.geometry), (4.0, 512, 0));
        assert_eq!(world.instance_path(512).len(), 512);
        let s = world.interaction(&ray, &hit);
        assert!((s.position + Vec3::Z).length() < 1e-6 && s.geometric_normal == -Vec3::Z);
    }
    let error = chain(513).build(&BuildOptions::default()).expect_err("too deep");
    assert!(matches!(&error, WorldError::Limit(text) if text.contains("512")), "{error}");
}

#[test]
fn cycles_are_refused() {
    let mut builder = WorldBuilder::default();
    let (a, b) = (builder.add_group(), builder.add_group());
    builder.add_instance(WorldBuilder::ROOT, a, Transform::IDENTITY);
    builder.add_instance(a, b, Transform::IDENTITY);
    builder.add_instance(b, a, Transform::IDENTITY);
    assert!(matches!(builder.build(&BuildOptions::default()), Err(WorldError::Cycle(_))));
}

#[test]
fn too_many_occurrences_are_refused() {
    let mut builder = WorldBuilder::default();
    let mut group = WorldBuilder::ROOT;
    for _ in 0..40 {
        let child = builder.add_group();
        builder.add_instance(group, child, Transform::IDENTITY);
        builder.add_instance(group, child, Transform::IDENTITY);
        group = child;
    }
    assert_eq!(builder.build(&BuildOptions::default()).err(), Some(WorldError::TooManyInstances));
}

#[test]
fn occurrences_are_numbered_depth_first() {
    let world = default_world(nested_scene(1));
    // The definition of the numbering: a recursive enumeration.
    fn visit(
        world: &World,
        group: GroupId,
        path: &mut Vec<(GroupId, usize)>,
        all: &mut Vec<Vec<(GroupId, usize)>>,
    ) {
        all.push(path.clone());
        for (i, instance) in world.group(group).instances.iter().enumerate() {
            path.push((group, i));
            visit(world, instance.child, path, all);
            path.pop();
        }
    }
    let mut all = Vec::new();
    visit(&world, GroupId(0), &mut Vec::new(), &mut all);
    assert_eq!(all.len(), world.instance_count() as usize);
    for (number, path) in all.iter().enumerate() {
        assert_eq!(&world.instance_path(number as u32), path);
        let composed = path.iter().fold(Transform::IDENTITY, |m, &(group, i)| {
            m.compose(&world.group(group).instances[i].group_from_child)
        });
        let p = DVec3::new(0.3, 0.2, 0.1);
        assert!(
            (composed.point(p) - world.world_from_instance(number as u32).point(p)).length()
                < 1e-12
        );
    }
}

#[test]
fn triangles_are_counted_once_and_as_often_as_they_occur() {
    let mut builder = WorldBuilder::default();
    let group = builder.add_group();
    builder.add_mesh(group, Arc::new(sphere_mesh(Vec3::ZERO, 1.0, 4, 8)));
    for i in 0..5 {
        builder.add_instance(
            WorldBuilder::ROOT,
            group,
            Transform::translation(DVec3::X * f64::from(i)),
        );
    }
    let world = default_world(builder);
    assert_eq!((world.triangle_count(), world.instanced_triangle_count()), (48, 240));
    assert!(world.memory_bytes() > 0 && world.stats().nodes > 0);
}
