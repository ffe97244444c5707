//! Tests of filters, masks, extreme rays, and counters of the work.

use super::*;

/// Rejects some primitives, and checks its arguments.
struct Cutout {
    reject: Vec<u32>,
    geometry: u32,
}

impl HitFilter for Cutout {
    fn accept(&self, ray: &Ray, hit: &Hit) -> bool {
        assert_eq!((hit.geometry, ray.origin), (self.geometry, Vec3::new(0.1, 0.1, 0.0)));
        !self.reject.contains(&hit.primitive)
    }
}

#[test]
fn the_filter_decides_about_marked_geometries_only() {
    // Ten sheets one behind the other; the first two seen from the other side are in an unmarked
    // geometry.
    let sheets = |first: u32, n: u32| {
        let mut mesh = TriangleMesh::default();
        for i in 0..n {
            let z = (first + i) as f32;
            mesh.positions.extend([
                Vec3::new(-1.0, -1.0, z),
                Vec3::new(3.0, -1.0, z),
                Vec3::new(-1.0, 3.0, z),
            ]);
            mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        Arc::new(mesh)
    };
    for accelerator in AcceleratorKind::ALL {
        let mut builder = WorldBuilder::default();
        let group = builder.add_group();
        builder.add_instance(WorldBuilder::ROOT, group, Transform::IDENTITY);
        let cut = builder.add_mesh(group, sheets(1, 20));
        builder.add_mesh(group, sheets(21, 1));
        builder.set_filtered(cut);
        let world = build(builder, accelerator, Level::best());
        let ray = Ray::new(Vec3::new(0.1, 0.1, 0.0), Vec3::Z);
        let ask = |reject: Vec<u32>| Cutout { reject, geometry: cut.0 };
        let closest = |reject: Vec<u32>| {
            let h = world.closest_one(&ray, &ask(reject));
            (h.t, h.geometry, h.primitive)
        };
        assert_eq!(closest(vec![]), (1.0, 0, 0));
        assert_eq!(closest(vec![0, 1, 3]), (3.0, 0, 2));
        assert_eq!(closest((0..20).collect()), (21.0, 1, 0));
        assert!(world.occluded_one(&ray, &ask((0..20).collect())));
        assert!(!world.occluded_one(&ray.with_t_max(20.5), &ask((0..20).collect())));
        assert_eq!(world.all_one(&ray, &ask(vec![4])).len(), 20);
    }
}

#[test]
fn a_rejected_crossing_of_a_shape_uncovers_the_next_one() {
    struct FarSide;
    impl HitFilter for FarSide {
        fn accept(&self, _: &Ray, hit: &Hit) -> bool {
            hit.t > 5.0
        }
    }
    for accelerator in AcceleratorKind::ALL {
        let mut builder = WorldBuilder::default();
        let id = builder.add_shape(
            WorldBuilder::ROOT,
            Arc::new(Sphere { radius: 1.0 }),
            Transform::IDENTITY,
        );
        builder.set_filtered(id);
        let world = build(builder, accelerator, Level::best());
        let ray = Ray::new(Vec3::new(0.0, 0.0, -5.0), Vec3::Z);
        assert_eq!(world.closest_one(&ray, &FarSide).t, 6.0);
        assert_eq!(
            world.all_one(&ray, &AcceptAll).iter().map(|h| h.t).collect::<Vec<_>>(),
            [4.0, 6.0]
        );
    }
}

#[test]
fn masks_of_rays_choose_geometries_and_instances() {
    let sheet = |z: f32| {
        let positions =
            vec![Vec3::new(-9.0, -9.0, z), Vec3::new(9.0, -9.0, z), Vec3::new(0.0, 9.0, z)];
        Arc::new(TriangleMesh { positions, indices: vec![[0, 1, 2]], ..Default::default() })
    };
    for accelerator in AcceleratorKind::ALL {
        let mut builder = WorldBuilder::default();
        let near = builder.add_mesh(WorldBuilder::ROOT, sheet(1.0));
        builder.set_mask(near, 0b001);
        let child = builder.add_group();
        let inner = builder.add_mesh(child, sheet(2.0));
        builder.set_mask(inner, 0b110);
        builder.add(
            WorldBuilder::ROOT,
            Instance { mask: 0b010, ..Instance::new(child, Transform::IDENTITY) },
        );
        builder.add_shape(
            WorldBuilder::ROOT,
            Arc::new(Sphere { radius: 1.0 }),
            Transform::translation(DVec3::new(0.0, 0.0, 6.0)),
        );
        let world = build(builder, accelerator, Level::best());
        let rays = vec![Ray::new(Vec3::ZERO, Vec3::Z); 40];
        let masks: Vec<u64> = (0..40).map(|i| [u64::MAX, 0b001, 0b010, 0b100, 0][i % 5]).collect();
        let expected = [1.0, 1.0, 2.0, 5.0, f32::INFINITY];
        let queries = Rays::new(&rays).with_masks(&masks);
        let mut hits = vec![Hit::MISS; 40];
        world.closest(queries, Grouping::None, &AcceptAll, &mut hits);
        let mut blocked = vec![false; 40];
        world.occluded(queries, Grouping::None, &AcceptAll, &mut blocked);
        for i in 0..40 {
            assert_eq!(hits[i].t, expected[i % 5], "{accelerator:?}, mask {:b}", masks[i]);
            assert_eq!(world.closest_one(queries.get(i), &AcceptAll), hits[i]);
            assert_eq!(blocked[i], i % 5 != 4);
        }
    }
}

#[test]
fn invalid_and_extreme_rays_end_in_an_answer() {
    let mut builder = nested_scene(3);
    let mut broken = sphere_mesh(Vec3::ZERO, 1.0, 6, 8);
    broken.positions[3].x = f32::NAN;
    broken.positions[9].y = f32::INFINITY;
    broken.positions.extend([
        Vec3::ZERO,
        Vec3::X,
        Vec3::X * 2.0,
        Vec3::splat(3e38),
        -Vec3::splat(3e38),
    ]);
    let n = broken.positions.len() as u32;
    broken.indices.extend([
        [n - 5, n - 4, n - 3],
        [n - 5; 3],
        [n - 1, n - 2, n - 4],
        [0, 5, n - 1],
    ]);
    let skipped = broken.degenerate_triangles();
    assert!(skipped > 4);
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(broken));
    let world = default_world(builder);
    assert!(world.skipped_triangles() >= skipped as u64);
    let special = [0.0, -0.0, 1e-45, 1e-30, 1.0, -1.0, 1e30, 3e38, f32::INFINITY, f32::NAN];
    for i in 0..20_000u32 {
        let pick = |k: u32| special[pcg4d([i, k, 1, 2])[0] as usize % special.len()];
        let ray = Ray {
            origin: Vec3::new(pick(0), pick(1), pick(2)),
            direction: Vec3::new(pick(3), pick(4), pick(5)),
            t_min: pick(6),
            t_max: if i % 2 == 0 { f32::INFINITY } else { pick(7) },
        };
        let hit = world.closest_one(&ray, &AcceptAll);
        assert_eq!(world.occluded_one(&ray, &AcceptAll), hit.is_hit());
        assert!(ray.is_valid() || !hit.is_hit());
        if hit.is_hit() {
            assert!(hit.t > ray.t_min && hit.t < ray.t_max);
            let s = world.interaction(&ray, &hit);
            let finite = [
                s.position,
                s.position_error,
                s.geometric_normal,
                s.shading_normal,
                s.dpdu,
                s.dpdv,
            ];
            assert!(finite.iter().all(|v| v.is_finite()), "{ray:?} {s:?}");
        }
    }
}

#[test]
fn the_cost_of_a_ray_is_counted() {
    let mesh = sphere_mesh(Vec3::ZERO, 1.0, 40, 80);
    let triangles = mesh.indices.len() as u32;
    let ray = Ray::new(Vec3::new(0.1, 0.2, -5.0), Vec3::Z);
    let (hit, cost) = mesh_world(mesh.clone()).closest_counted(&ray, &AcceptAll);
    assert!(
        hit.is_hit()
            && cost.nodes_visited >= 3
            && cost.primitives_tested > 0
            && cost.primitives_tested < 100
    );
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    let (same, cost) =
        build(builder, AcceleratorKind::None, Level::Scalar).closest_counted(&ray, &AcceptAll);
    assert_eq!((same, cost.nodes_visited, cost.primitives_tested), (hit, 0, triangles));
}
