//! Tests of surfaces at hits, and of rays that leave these surfaces.

use super::*;

/// Transforms from moderate to extreme.
fn placements() -> Vec<Transform> {
    let turn = DMat3::from_axis_angle(DVec3::new(0.3, 0.5, -0.8).normalize(), 1.1);
    let map = |scale: DVec3, translation: DVec3| {
        Transform::new(DAffine3 { matrix3: turn * DMat3::from_diagonal(scale), translation })
            .expect("invertible")
    };
    let far = DVec3::new(148376.0, 1234.0, -223423.0);
    vec![
        Transform::IDENTITY,
        map(DVec3::ONE, DVec3::new(1.0, 2.0, 3.0)),
        map(DVec3::new(-1.0, 1.0, 1.0), DVec3::ZERO),
        map(DVec3::new(1.0, 20.0, 0.05), DVec3::new(-3.0, 0.0, 7.0)),
        map(DVec3::splat(1e-6), DVec3::ZERO),
        map(DVec3::splat(1e9), DVec3::splat(1e9)),
        map(DVec3::splat(1e-3), DVec3::splat(10.0)),
        map(DVec3::new(100.0, -300.0, 50.0), far),
        map(DVec3::splat(1.0), far),
    ]
}

/// The geometry added by `add`, instanced through two levels whose product is `placed`.
fn instanced(placed: &Transform, add: impl Fn(&mut WorldBuilder, GroupId)) -> World {
    let mut builder = WorldBuilder::default();
    let (outer, inner) = (builder.add_group(), builder.add_group());
    let extra = Transform::translation(DVec3::new(1e4, -3e3, 77.0));
    builder.add_instance(WorldBuilder::ROOT, outer, placed.compose(&extra.inverse()));
    builder.add_instance(outer, inner, extra);
    add(&mut builder, inner);
    default_world(builder)
}

/// Rays aimed at the geometry from outside, each with its hit.
fn hits_on(world: &World, placed: &Transform, n: usize) -> Vec<(Ray, Hit)> {
    let mut random = Random(99);
    let rays = (0..n).map(|_| {
        let from = placed.point(random.direction().as_dvec3() * 3.0).as_vec3();
        let to = placed.point(random.point(0.5).as_dvec3()).as_vec3();
        Ray::new(from, to - from)
    });
    rays.map(|r| (r, world.closest_one(&r, &AcceptAll))).filter(|(_, h)| h.is_hit()).collect()
}

#[test]
fn a_ray_that_leaves_a_triangle_never_hits_it_again() {
    for placed in placements() {
        // One sphere is at the origin of its coordinates, the other away from it.
        for center in [Vec3::ZERO, Vec3::new(0.0, 0.0, 1.0)] {
            let mesh = Arc::new(sphere_mesh(center, 1.0, 12, 24));
            let world = instanced(&placed, |b, g| {
                b.add_mesh(g, mesh.clone());
            });
            let hits = hits_on(&world, &placed, 400);
            assert!(hits.len() > 150, "{}", hits.len());
            let mut random = Random(7);
            for (ray, hit) in hits {
                let surface = world.interaction(&ray, &hit);
                for _ in 0..8 {
                    let d = random.direction();
                    let next = Ray::new(surface.ray_origin(d), d);
                    let all = world.all_one(&next, &AcceptAll);
                    let same = all.iter().find(|h| h.primitive == hit.primitive);
                    assert!(same.is_none(), "{placed:?} {hit:?} {next:?} {same:?}");
                    if d.dot(surface.geometric_normal) > 1e-3 {
                        assert_eq!(all, [], "convex: nothing lies outside");
                    }
                }
            }
        }
    }
}

#[test]
fn a_ray_that_leaves_a_sphere_meets_it_only_on_the_other_side() {
    for placed in placements() {
        for radius in [1.0, 1e-3, 250.0] {
            let placed = placed.compose(
                &Transform::new(DAffine3::from_scale(DVec3::splat(1.0 / radius))).expect("map"),
            );
            let world = instanced(&placed, |b, g| {
                b.add_shape(g, Arc::new(Sphere { radius }), Transform::IDENTITY);
            });
            let outside = placed
                .compose(&Transform::new(DAffine3::from_scale(DVec3::splat(radius))).expect("map"));
            let hits = hits_on(&world, &outside, 200);
            assert!(hits.len() > 100);
            let mut random = Random(7);
            for (ray, hit) in hits {
                let surface = world.interaction(&ray, &hit);
                for _ in 0..8 {
                    let d = random.direction();
                    let cos = d.dot(surface.geometric_normal);
                    let next = Ray::new(surface.ray_origin(d), d);
                    let count = world.all_one(&next, &AcceptAll).len();
                    if cos.abs() > 1e-3 {
                        assert_eq!(count, usize::from(cos < 0.0), "{placed:?} {next:?} {cos}");
                    }
                }
            }
        }
    }
}

#[test]
fn normals_point_outward_under_every_transform() {
    for placed in placements() {
        let mut mesh = sphere_mesh(Vec3::ZERO, 1.0, 40, 80);
        mesh.normals = mesh.positions.clone();
        // Every third normal points inwards: the shading normal must still be on the geometric
        // side.
        mesh.normals.iter_mut().step_by(3).for_each(|n| *n = -*n);
        let (mesh, sphere) = (Arc::new(mesh), Arc::new(Sphere { radius: 1.0 }));
        let worlds = [
            instanced(&placed, |b, g| {
                b.add_mesh(g, mesh.clone());
            }),
            instanced(&placed, |b, g| {
                b.add_shape(g, sphere.clone(), Transform::IDENTITY);
            }),
        ];
        for world in &worlds {
            for (ray, hit) in hits_on(world, &placed, 200) {
                let s = world.interaction(&ray, &hit);
                let outward = match world.geometry(GeometryId(0)) {
                    Geometry::Mesh(mesh) => {
                        let [a, b, c] = mesh
                            .corners(hit.primitive as usize)
                            .map(|p| placed.point(p.as_dvec3()));
                        let n = (b - a).cross(c - a);
                        if n.dot(a - placed.point(DVec3::ZERO)) < 0.0 { -n } else { n }
                    }
                    _ => placed.normal(placed.inverse().point(s.position.as_dvec3())),
                };
                let expected = outward.normalize().as_vec3();
                // Far from the origin, positions have few accurate digits.
                assert!(
                    s.geometric_normal.dot(expected) > 0.999,
                    "{placed:?} {} {expected}",
                    s.geometric_normal
                );
                assert!(s.geometric_normal.is_normalized() && s.shading_normal.is_normalized());
                assert!(s.shading_normal.dot(s.geometric_normal) >= 0.0);
                assert!(s.is_front_facing(ray.direction));
                assert!(s.dpdu.is_finite() && s.dpdu != Vec3::ZERO && s.dpdv != Vec3::ZERO);
            }
        }
    }
}

#[test]
fn errata_e5_directions_keep_their_parameter_and_normals_do_not_follow_directions() {
    // The lecture transforms directions by the inverse transpose, which is correct for normals
    // only.
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Z);
    let placed =
        Transform::new(DAffine3 { matrix3: shear, translation: DVec3::ZERO }).expect("invertible");
    let mesh = TriangleMesh {
        positions: vec![
            Vec3::new(0.0, -9.0, -9.0),
            Vec3::new(0.0, 9.0, -9.0),
            Vec3::new(0.0, 0.0, 9.0),
        ],
        indices: vec![[0, 1, 2]],
        ..TriangleMesh::default()
    };
    let mut builder = WorldBuilder::default();
    let group = builder.add_group();
    builder.add_mesh(group, Arc::new(mesh));
    builder.add_instance(WorldBuilder::ROOT, group, placed);
    let world = default_world(builder);
    let ray = Ray::new(Vec3::new(-2.0, 1.0, 0.0), Vec3::new(0.5, 0.0, 0.0));
    let hit = world.closest_one(&ray, &AcceptAll);
    // The plane x = 0 becomes x = y.
    assert_eq!(hit.t, 6.0);
    let s = world.interaction(&ray, &hit);
    assert!((s.position - Vec3::new(1.0, 1.0, 0.0)).length() < 1e-6);
    assert!((s.geometric_normal - Vec3::new(1.0, -1.0, 0.0).normalize()).length() < 1e-6);
}

#[test]
fn attributes_are_interpolated() {
    let mesh = TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 4.0],
        indices: vec![[0, 1, 2]],
        normals: vec![Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::Z],
        tangents: vec![Vec3::X.extend(-1.0); 3],
        uvs: [
            vec![Vec2::ZERO, Vec2::X, Vec2::Y],
            vec![Vec2::ONE, Vec2::ONE * 3.0, Vec2::ONE],
            Vec::new(),
            vec![Vec2::Y, Vec2::Y, Vec2::X],
        ],
        colors: vec![[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 0.0]],
        material_slots: Vec::new(),
        exact: Vec::new(),
    };
    let world = mesh_world(mesh);
    let ray = Ray::new(Vec3::new(0.5, 1.0, 5.0), -Vec3::Z);
    let hit = world.closest_one(&ray, &AcceptAll);
    assert_eq!((hit.t, hit.uv), (5.0, Vec2::splat(0.25)));
    let s = world.interaction(&ray, &hit);
    assert_eq!((s.position, s.geometric_normal), (Vec3::new(0.5, 1.0, 0.0), Vec3::Z));
    assert!((s.shading_normal - Vec3::new(0.25, 0.0, 1.0).normalize()).length() < 1e-6);
    assert_eq!(s.uv, [Vec2::splat(0.25), Vec2::splat(1.5), Vec2::ZERO, Vec2::new(0.25, 0.75)]);
    assert_eq!((s.dpdu, s.dpdv), (Vec3::X * 2.0, Vec3::Y * 4.0));
    assert_eq!(s.tangent, Some((Vec3::X, -1.0)));
    assert_eq!(s.color, [0.25, 0.5, 0.0, 0.75]);
}

#[test]
fn a_ray_that_leaves_a_shape_does_not_find_it_where_it_starts() {
    for shape in AnyShape::examples() {
        let size = shape.bounds().size().max_element();
        let size = if size.is_finite() { 2.0 / size } else { 1.0 };
        let shape = Arc::new(shape);
        for placed in placements() {
            let world = instanced(&placed, |b, g| {
                b.add_shape(g, shape.clone(), scaling(size));
            });
            let mut random = Random(7);
            for (ray, hit) in hits_on(&world, &placed, 60) {
                let surface = world.interaction(&ray, &hit);
                for _ in 0..6 {
                    let d = random.direction();
                    if d.dot(surface.geometric_normal).abs() < 1e-2 {
                        continue;
                    }
                    let next = Ray::new(surface.ray_origin(d), d);
                    let again = world.closest_one(&next, &AcceptAll);
                    let from = placed.inverse().ray(&DRay::from(&next));
                    let way = from.direction.length() * f64::from(again.t);
                    // At edges and apexes a hit may be very near, but not at the very start of the
                    // ray.
                    let coarse =
                        placed.inverse().vector(surface.position_error.as_dvec3()).length();
                    let found = again.primitive == hit.primitive && way < 1e-9 + 0.5 * coarse;
                    assert!(!found, "{shape:?} {placed:?} {hit:?} {next:?} {again:?} {way}");
                }
            }
        }
    }
}
